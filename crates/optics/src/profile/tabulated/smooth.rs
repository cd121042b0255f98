//! Smoothing, means and splines on equal steps.

use std::sync::LazyLock;

use moonmilk_core::quadrature::Rule;

/// Stiffness of [`penalised`]: a bump of six steps passes, noise of the brightest rings is halved.
const STIFFNESS: f64 = 3.0;

/// Returns the y that minimise sum w (y - value)^2 + stiffness sum (third difference of y)^2.
///
/// Where weights are small, parabolas continue what has weight. *Domain*: equal lengths of at least 4, weights >= 0, three of them positive.
pub(super) fn penalised(values: &[f64], weights: &[f64]) -> Vec<f64> {
    let n = values.len();
    // The band of the symmetric system: entry k of row i is that of column i + k.
    let mut band = vec![[0.0f64; 4]; n];
    let mut y: Vec<f64> = values.iter().zip(weights).map(|(v, w)| v * w).collect();
    (0..n).for_each(|i| band[i][0] = weights[i]);
    let difference = [-1.0, 3.0, -3.0, 1.0];
    for i in 0..n - 3 {
        for a in 0..4 {
            for b in a..4 {
                band[i + a][b - a] += STIFFNESS * difference[a] * difference[b];
            }
        }
    }
    // Eliminate downwards, then substitute back.
    for i in 0..n {
        let pivot = band[i][0];
        for a in 1..4.min(n - i) {
            let f = band[i][a] / pivot;
            for b in a..4 {
                band[i + a][b - a] -= f * band[i][b];
            }
            y[i + a] -= f * y[i];
        }
    }
    for i in (0..n).rev() {
        let known: f64 = (1..4.min(n - i)).map(|a| band[i][a] * y[i + a]).sum();
        y[i] = (y[i] - known) / band[i][0];
    }
    y
}

/// Returns the cubic through four neighbours at a fractional index in \[0, n - 1\]. *Domain*: at least 4 values.
pub(super) fn cubic(y: &[f64], x: f64) -> f64 {
    let i = (x as usize).saturating_sub(1).min(y.len() - 4);
    let t = x - (i + 1) as f64;
    let [a, b, c, d] = [y[i], y[i + 1], y[i + 2], y[i + 3]];
    // Lagrange on -1, 0, 1, 2.
    let (p, q, r) = (t + 1.0, t - 1.0, t - 2.0);
    -a * t * q * r / 6.0 + b * p * q * r / 2.0 - c * p * t * r / 2.0 + d * p * t * q / 6.0
}

static RING: LazyLock<Rule> = LazyLock::new(|| Rule::gauss(5, -0.5, 0.5));

/// Turns ln of means over rings into ln of the values in their middles; rings are one step wide in ln r.
pub(super) fn values_of_means(means: &[f64], step: f64) -> Vec<f64> {
    let n = means.len();
    let mut values = means.to_vec();
    // The correction is small and smooth: it converges by a factor of ten at a time where there is light.
    for _ in 0..3 {
        let next = (0..n).map(|i| {
            let (a, b, c) = (values[i.saturating_sub(1)], values[i], values[(i + 1).min(n - 1)]);
            if i == 0 || i == n - 1 {
                return b;
            }
            let (slope, curvature) = (0.5 * (c - a), c - 2.0 * b + a);
            // Beyond, nothing is left to be corrected.
            if slope.abs() > 20.0 {
                return means[i];
            }
            let (mut sum, mut all) = (0.0, 0.0);
            for (t, w) in RING.iter() {
                let area = w * (2.0 * step * t).exp();
                sum += area * (t * (slope + 0.5 * t * curvature)).exp();
                all += area;
            }
            means[i] - (sum / all).ln()
        });
        values = next.collect();
    }
    values
}

/// A natural cubic spline on equal steps.
#[derive(Clone, Debug)]
pub(super) struct Spline {
    first: f64,
    step: f64,
    y: Vec<f64>,
    /// Second derivatives in steps.
    second: Vec<f64>,
}

impl Spline {
    pub(super) fn new(first: f64, step: f64, y: Vec<f64>) -> Self {
        let n = y.len();
        // Solve m_(i-1) + 4 m_i + m_(i+1) = 6 (second difference) with m = 0 at the ends.
        let (mut second, mut factor) = (vec![0.0; n], vec![0.0; n]);
        for i in 1..n - 1 {
            let pivot = 4.0 - factor[i - 1];
            factor[i] = 1.0 / pivot;
            second[i] = (6.0 * (y[i + 1] - 2.0 * y[i] + y[i - 1]) - second[i - 1]) / pivot;
        }
        for i in (1..n - 1).rev() {
            second[i] -= factor[i] * second[i + 1];
        }
        Self { first, step, y, second }
    }

    /// Returns value and slope; beyond the ends the end slope continues.
    #[inline]
    pub(super) fn eval(&self, x: f64) -> (f64, f64) {
        let last = self.y.len() - 2;
        let u = (x - self.first) / self.step;
        let i = (u.max(0.0) as usize).min(last);
        let (y, m) = (&self.y[i..i + 2], &self.second[i..i + 2]);
        let (t, rise) = ((u - i as f64).clamp(0.0, 1.0), y[1] - y[0]);
        let s = 1.0 - t;
        let value = s * y[0] + t * y[1] + ((s * s * s - s) * m[0] + (t * t * t - t) * m[1]) / 6.0;
        let slope = rise + ((1.0 - 3.0 * s * s) * m[0] + (3.0 * t * t - 1.0) * m[1]) / 6.0;
        (value + (u - i as f64 - t) * slope, slope / self.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parabolas_pass_and_gaps_are_filled() {
        let f = |i: usize| 1.0 + 0.3 * i as f64 - 0.02 * (i * i) as f64;
        let values: Vec<f64> = (0..30).map(|i| if i % 5 == 2 { 99.0 } else { f(i) }).collect();
        let weights: Vec<f64> = (0..30).map(|i| if i % 5 == 2 { 0.0 } else { 1.0 / (1.0 + i as f64) }).collect();
        for (i, y) in penalised(&values, &weights).into_iter().enumerate() {
            assert!((y - f(i)).abs() < 1e-9, "{i} {y}");
        }
        let y: Vec<f64> = (0..30).map(|i| f64::from(i).powi(3)).collect();
        assert!((cubic(&y, 7.3) - 7.3f64.powi(3)).abs() < 1e-9 && (cubic(&y, 0.2) - 0.008).abs() < 1e-9);
    }

    #[test]
    fn means_of_rings_become_values() {
        let step = 2f64.ln() / 4.0;
        let f = |r: f64| (-r).exp() / r;
        let rule = Rule::gauss(12, -0.5, 0.5);
        let middle = |i: usize| step * (i as f64 - 40.0);
        let means: Vec<f64> = (0..60)
            .map(|i| {
                let r = |t: f64| (middle(i) + step * t).exp();
                (rule.integrate(|t| r(t) * r(t) * f(r(t))) / rule.integrate(|t| r(t) * r(t))).ln()
            })
            .collect();
        for (i, v) in values_of_means(&means, step).into_iter().enumerate().skip(3).take(54) {
            let r = middle(i).exp();
            // Third derivatives are left out: they are -r here, times step^3 / 24 of it and less.
            assert!((v - f(r).ln()).abs() < 1e-5 + step.powi(3) / 24.0 * r, "{r} {}", v - f(r).ln());
        }
    }

    #[test]
    fn the_spline_and_its_slope_follow_a_function() {
        let s = Spline::new(-3.0, 0.1, (0..61).map(|i| (-3.0 + 0.1 * f64::from(i)).sin()).collect());
        for x in [-2.0f64, -0.33, 0.0, 1.234, 2.0] {
            let (value, slope) = s.eval(x);
            assert!((value - x.sin()).abs() < 1e-5 && (slope - x.cos()).abs() < 1e-4, "{x} {value} {slope}");
        }
        let (end, slope) = s.eval(3.0);
        assert!((s.eval(4.0).0 - end - slope).abs() < 1e-9);
    }
}
