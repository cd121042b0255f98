use moonmilk_core::estimate::Accumulator;
use moonmilk_core::{Random, Stream};

use super::*;

const WIDTH: usize = 16;
const N: usize = WIDTH * 12;

/// Exact radiance, and relative error of the model: different in every pixel and channel.
fn truth(i: usize, c: usize) -> (f32, f32) {
    let x = (i % WIDTH) as f32 / WIDTH as f32;
    (0.3 + x + 0.2 * c as f32, 0.1 * (6.0 * x).sin() + 0.05)
}

/// A picture of these values with noise of a relative size, skewed as that of a renderer.
fn noisy(seed: u64, half: u64, noise: f32, value: impl Fn(usize, usize) -> f32) -> Colour {
    std::array::from_fn(|c| {
        let draw = |i: usize| {
            let mut r = Stream::new(&[seed, half, i as u64, c as u64]);
            // Exponential minus its mean: variance 1, skewness 2.
            value(i, c) * (1.0 + noise * (-r.uniform().ln() - 1.0))
        };
        (0..N).map(draw).collect()
    })
}

fn halves(seed: u64, noise: f32, value: impl Fn(usize, usize) -> f32) -> Halves {
    Halves { a: noisy(seed, 0, noise, &value), b: noisy(seed, 1, noise, &value) }
}

/// Runs the split with fresh noise and returns estimates of the mean of bias^2, variance and ratio, and of their claimed variances.
fn repeated(biased: bool) -> [[Accumulator; 2]; 3] {
    let model = |i: usize, c: usize| truth(i, c).0 * (1.0 + if biased { truth(i, c).1 } else { 0.0 });
    let mut out: [[Accumulator; 2]; 3] = Default::default();
    // One set of weights, as for all models of one comparison.
    let weights = weights(&std::array::from_fn(|c| (0..N).map(|i| truth(i, c).0).collect()), WIDTH);
    for k in 0..400 {
        let test = halves(1000 + k, 0.3, model);
        let reference = Reference::of_halves(&halves(5000 + k, 0.2, |i, c| truth(i, c).0));
        let f = figures(&test, &reference, &weights, WIDTH, |_, _| true).expect("pixels");
        assert!((f.bias2.mean + f.variance.mean - f.total.mean).abs() < 1e-12);
        for (sum, e) in out.iter_mut().zip([f.bias2, f.variance, f.ratio]) {
            sum[0].add(e.mean);
            sum[1].add(e.std_err * e.std_err);
        }
    }
    out
}

#[test]
fn bias_and_variance_have_the_right_expectation_and_standard_errors() {
    for biased in [false, true] {
        let exact = |f: &dyn Fn(usize, usize) -> f64| {
            (0..N).flat_map(|i| (0..3).map(move |c| (i, c))).map(|(i, c)| f(i, c)).sum::<f64>() / (3 * N) as f64
        };
        let weights = weights(&std::array::from_fn(|c| (0..N).map(|i| truth(i, c).0).collect()), WIDTH);
        let value = |i: usize, c: usize| f64::from(truth(i, c).0);
        let error = |i: usize, c: usize| if biased { f64::from(truth(i, c).1) } else { 0.0 };
        let bias2 = exact(&|i, c| (value(i, c) * error(i, c)).powi(2) / f64::from(weights[c][i]));
        // The variance of the mean of two halves of relative noise .3.
        let variance =
            exact(&|i, c| 0.5 * (0.3 * value(i, c) * (1.0 + error(i, c))).powi(2) / f64::from(weights[c][i]));
        let ratio = 1.0 + exact(&|i, c| value(i, c) * error(i, c)) / exact(&value);
        for (k, (sum, exact)) in repeated(biased).iter().zip([bias2, variance, ratio]).enumerate() {
            // 4.3 standard errors: 1e-4 two-sided after Sidak over six tests. A ratio is off by (relative noise)^2 / n = 3e-5 of its noise.
            let e = sum[0].estimate();
            assert!(e.z(exact).abs() < 4.3, "figure {k}, biased {biased}: {e}, exact {exact}");
            // The claimed variance is the one found, or a little larger where the bias differs within a block; 400 repetitions know it
            // to 2 sqrt(2 / 400) = 14 % at two standard errors, more for skewed noise.
            let claimed = sum[1].estimate().mean / sum[0].variance();
            assert!(claimed > 0.75 && claimed < 1.6, "figure {k}, biased {biased}: claimed / found {claimed}");
        }
    }
}

#[test]
fn noise_that_neighbours_share_is_in_the_standard_errors() {
    // 64 x 64 pixels, each block of 8 x 8 with a common error of 3 % in each half, besides 5 % in each pixel: nearly all of the noise of the mean.
    let width = 64;
    let value = |i: usize| 0.5 + (i % width) as f32 / 64.0;
    let draw = |key: [u64; 3]| (Stream::new(&key).uniform() - 0.5) * 12f32.sqrt();
    let half = |seed: u64, bias: f32| -> Colour {
        std::array::from_fn(|c| {
            (0..width * width)
                .map(|i| {
                    let block = (i / width / 8 * 8 + i % width / 8) as u64;
                    let own = draw([seed, 7 + c as u64, i as u64]);
                    value(i) * (1.0 + bias + 0.03 * draw([seed, 3, block]) + 0.05 * own)
                })
                .collect()
        })
    };
    let exact: Colour = std::array::from_fn(|_| (0..width * width).map(value).collect());
    let w = weights(&exact, width);
    let reference = Reference { deviation: std::array::from_fn(|_| vec![0.0; width * width]), mean: exact };
    let mut found: [[Accumulator; 2]; 2] = Default::default();
    for k in 0..300 {
        let test = Halves { a: half(2 * k, 0.2), b: half(2 * k + 1, 0.2) };
        let f = figures(&test, &reference, &w, width, |_, _| true).expect("pixels");
        for (sum, e) in found.iter_mut().zip([f.ratio, f.bias2]) {
            sum[0].add(e.mean);
            sum[1].add(e.std_err * e.std_err);
        }
    }
    for [mean, claimed] in found {
        // 300 repetitions know a variance to 16 % at two standard errors; the largest of five sizes is a little too large on average.
        let claimed = claimed.estimate().mean / mean.variance();
        assert!(claimed > 0.8 && claimed < 1.7, "claimed / found {claimed}");
    }
}

#[test]
fn noise_of_the_reference_is_no_bias() {
    // The plain product with a noisy reference would find its variance, .02 of relMSE; ours is within 4 standard errors of 0.
    let test = halves(1, 0.1, |i, c| truth(i, c).0);
    let noisy = halves(2, 0.5, |i, c| truth(i, c).0);
    let weights = weights(&noisy.mean(), WIDTH);
    let known = figures(&test, &Reference::of_halves(&noisy), &weights, WIDTH, |_, _| true).expect("pixels");
    assert!(known.bias2.z(0.0).abs() < 4.0, "{known:?}");
    let unknown = Reference { deviation: std::array::from_fn(|_| vec![0.0; N]), mean: noisy.mean() };
    let naive = figures(&test, &unknown, &weights, WIDTH, |_, _| true).expect("pixels");
    assert!(naive.bias2.mean > 0.05, "{naive:?}");
}

#[test]
fn a_weight_does_not_depend_on_its_own_pixel_and_bins_are_summed_apart() {
    let mut c: Colour = std::array::from_fn(|_| vec![1.0; N]);
    let before = weights(&c, WIDTH);
    c[1][5 * WIDTH + 5] = 100.0;
    let after = weights(&c, WIDTH);
    assert_eq!(before[1][5 * WIDTH + 5], after[1][5 * WIDTH + 5]);
    assert!(before[1][5 * WIDTH + 6] < after[1][5 * WIDTH + 6] && before[0] == after[0]);

    let test = halves(3, 0.2, |i, c| truth(i, c).0 * if i < N / 2 { 1.5 } else { 1.0 });
    let reference = Reference::of_halves(&halves(4, 0.2, |i, c| truth(i, c).0));
    let weights = weights(&reference.mean, WIDTH);
    let of = |takes: &dyn Fn(usize, usize) -> bool| figures(&test, &reference, &weights, WIDTH, takes);
    let (first, second) = (of(&|i, _| i < N / 2).expect("pixels"), of(&|i, c| i >= N / 2 && c == 0).expect("pixels"));
    assert!(first.ratio.z(1.5).abs() < 4.0 && second.ratio.z(1.0).abs() < 4.0, "{first:?} {second:?}");
    assert!(of(&|_, _| false).is_none());
}

#[test]
fn references_are_read_from_halves_from_variances_and_from_neither() {
    let h = halves(7, 0.2, |i, c| truth(i, c).0);
    let mut p = Picture::new(WIDTH, N / WIDTH);
    for (c, name) in ["R", "G", "B"].iter().enumerate() {
        p.push(name, h.mean()[c].clone()).unwrap();
    }
    let (plain, known) = Reference::of_picture(&p).unwrap();
    assert!(!known && plain.deviation[0][3] == 0.0);
    for name in ["Variance.R", "Variance.G", "Variance.B"] {
        p.push(name, vec![0.04; N]).unwrap();
    }
    let (by_variance, known) = Reference::of_picture(&p).unwrap();
    assert!(known && by_variance.deviation[2][9] == 0.2);
    for (layer, half) in LAYERS.iter().zip([&h.a, &h.b]) {
        for (c, name) in ["R", "G", "B"].iter().enumerate() {
            p.push(&format!("{layer}.{name}"), half[c].clone()).unwrap();
        }
    }
    assert_eq!(Reference::of_picture(&p).unwrap().0, Reference::of_halves(&h));
}
