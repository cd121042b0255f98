//! Statistical tests that return p-values: the probability of data at least as extreme if the hypothesis holds.
//!
//! A test of the project fails when its p-value is below a significance fixed beforehand, corrected by [`sidak`] for the
//! number of tests of the same run.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

/// Least expected count of a cell of the chi-square test; rarer cells are pooled.
pub const POOL_BELOW: f64 = 5.0;

/// Returns the p-value of Pearson's chi-square test of counts against expected counts.
///
/// Cells are pooled from the least expected upwards until each pooled cell expects at least [`POOL_BELOW`]. The degrees of
/// freedom are the remaining cells minus 1 minus `fitted`, the number of parameters estimated from the same data. A count in a
/// cell that expects nothing gives 0; fewer than two cells after pooling give 1 (nothing can be tested).
///
/// *Shapes*: both slices of the same length; expected counts non-negative, their sum that of the counts.
pub fn chi_square(counts: &[f64], expected: &[f64], fitted: usize) -> f64 {
    assert_eq!(counts.len(), expected.len(), "one expected count per cell");
    let mut order: Vec<usize> = (0..counts.len()).collect();
    order.sort_by(|&a, &b| expected[a].total_cmp(&expected[b]));
    let (mut cells, mut pool) = (Vec::new(), (0.0, 0.0));
    for i in order {
        if expected[i] <= 0.0 && counts[i] > 0.0 {
            return 0.0;
        }
        pool = (pool.0 + counts[i], pool.1 + expected[i]);
        if pool.1 >= POOL_BELOW {
            cells.push(std::mem::take(&mut pool));
        }
    }
    // What is left over joins the last cell.
    if let Some(last) = cells.last_mut() {
        *last = (last.0 + pool.0, last.1 + pool.1);
    }
    if cells.len() < 2 + fitted {
        return 1.0;
    }
    let statistic: f64 = cells.iter().map(|(n, e)| (n - e) * (n - e) / e).sum();
    let law = ChiSquared::new((cells.len() - 1 - fitted) as f64).expect("at least one degree of freedom");
    law.sf(statistic)
}

/// Returns the p-value of the one-sample Kolmogorov-Smirnov test of samples against a continuous distribution function.
///
/// Sorts the samples. *Accuracy*: Kolmogorov's limit law with Stephens' correction for finite n \[Stephens1970\]; good to a few percent of p
/// for n of 10 or more.
pub fn kolmogorov_smirnov(samples: &mut [f64], cdf: impl Fn(f64) -> f64) -> f64 {
    samples.sort_by(f64::total_cmp);
    let n = samples.len() as f64;
    let distance = samples.iter().enumerate().fold(0.0f64, |d, (i, &x)| {
        let f = cdf(x);
        d.max(f - i as f64 / n).max((i + 1) as f64 / n - f)
    });
    kolmogorov_survival(distance * (n.sqrt() + 0.12 + 0.11 / n.sqrt()))
}

/// Returns P(K > x) for Kolmogorov's limit law: 2 sum (-1)^(k-1) exp(-2 k^2 x^2).
fn kolmogorov_survival(x: f64) -> f64 {
    if x < 0.2 {
        // The alternating series converges badly here, and 1 - P is below 1e-12.
        return 1.0;
    }
    let sum: f64 =
        (1..=100).map(|k| (if k % 2 == 1 { 2.0 } else { -2.0 }) * (-2.0 * f64::from(k * k) * x * x).exp()).sum();
    sum.clamp(0.0, 1.0)
}

/// Returns the two-sided p-value of a standard normal deviate.
pub fn z_test(z: f64) -> f64 {
    2.0 * Normal::standard().sf(z.abs())
}

/// Returns the two-sided p-value of a deviate of Student's law with `freedom` degrees of freedom.
///
/// *Domain*: freedom > 0.
pub fn t_test(t: f64, freedom: f64) -> f64 {
    2.0 * StudentsT::new(0.0, 1.0, freedom).expect("positive degrees of freedom").sf(t.abs())
}

/// Returns the standard normal deviate that is as improbable as a deviate of Student's law with `freedom` degrees of freedom, with its sign.
///
/// *Domain*: freedom > 0; beyond 38 standard deviations the result is infinite.
pub fn normal_score(t: f64, freedom: f64) -> f64 {
    if t == 0.0 { 0.0 } else { -Normal::standard().inverse_cdf(0.5 * t_test(t, freedom)) * t.signum() }
}

/// Returns the significance per test that gives `significance` over `tests` independent ones: 1 - (1 - a)^(1/n).
pub fn sidak(significance: f64, tests: usize) -> f64 {
    // Through ln and exp so that small significances keep their digits.
    -((-significance).ln_1p() / tests as f64).exp_m1()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Random, Stream};

    #[test]
    fn p_values_agree_with_published_quantiles() {
        // Chi-square 95 % quantile at 9 degrees of freedom: 16.919 (tables).
        let expected = [100.0; 10];
        let mut counts = [100.0; 10];
        let d = (16.919f64 * 100.0 / 2.0).sqrt();
        (counts[0], counts[1]) = (100.0 + d, 100.0 - d);
        assert!((chi_square(&counts, &expected, 0) - 0.05).abs() < 1e-4);
        assert!((z_test(1.959_964) - 0.05).abs() < 1e-6 && (z_test(-2.575_829) - 0.01).abs() < 1e-6);
        // Student's law: 97.5 % quantiles at 3 and 63 degrees of freedom (tables).
        assert!((t_test(3.182_446, 3.0) - 0.05).abs() < 1e-6 && (t_test(-1.998_341, 63.0) - 0.05).abs() < 1e-6);
        assert!((normal_score(-3.182_446, 3.0) + 1.959_964).abs() < 1e-5 && normal_score(0.0, 3.0) == 0.0);
        // Kolmogorov's law: 95 % quantile 1.3581 (tables).
        assert!((kolmogorov_survival(1.3581) - 0.05).abs() < 1e-4);
        assert!((1.0 - (1.0 - sidak(0.01, 20)).powi(20) - 0.01).abs() < 1e-12);
    }

    #[test]
    fn p_values_are_uniform_when_the_hypothesis_holds_and_small_when_not() {
        let (mut chi, mut ks) = (Vec::new(), Vec::new());
        for run in 0..400 {
            let mut r = Stream::new(&[11, run]);
            let mut xs: Vec<f64> = (0..1000).map(|_| f64::from(r.uniform())).collect();
            let mut counts = [0.0; 20];
            xs.iter().for_each(|x| counts[(x * 20.0) as usize] += 1.0);
            chi.push(chi_square(&counts, &[50.0; 20], 0));
            ks.push(kolmogorov_smirnov(&mut xs, |x| x));
            if run < 10 {
                // A distribution that is off by 8 % is found out.
                assert!(kolmogorov_smirnov(&mut xs, |x| x.powf(1.25)) < 1e-3);
            }
        }
        // Two tests at a total significance of 1e-4; the discreteness of the statistics is far below the resolution of 400 values.
        for p in [&mut chi, &mut ks] {
            assert!(kolmogorov_smirnov(p, |x| x) > sidak(1e-4, 2));
        }
    }

    #[test]
    fn rare_cells_are_pooled_and_impossible_ones_rejected() {
        let expected = [1000.0, 1000.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0];
        assert!(chi_square(&[1000.0, 1000.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0], &expected, 0) > 0.99);
        assert_eq!(chi_square(&[1000.0, 999.0, 5.0, 0.0, 0.0, 0.0, 0.0, 1.0], &expected, 0), 0.0);
    }
}
