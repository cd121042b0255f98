//! Comparison with the authors' evaluator on pictures made by formula, and what FLIP promises.
//!
//! The numbers were produced by `pip install flip-evaluator==1.7` and, for each pair of H x W x 3 arrays of f32 made by the
//! formulas below, `flip_evaluator.evaluate(reference, test, "LDR", True, False, True, {})` (sRGB-coded values) or
//! `evaluate(reference, test, "HDR", False, False, True, {})` (linear values): element 1 is the mean, element 0 the map.

use super::*;
use crate::png::srgb_decode;

const W: usize = 96;
const H: usize = 64;

/// Mean over the pixels; the evaluator's f32 sums and the six digits noted here.
const TOLERANCE: f64 = 5e-6;

type Rgb = [Vec<f32>; 3];

fn make(f: impl Fn(f64, f64) -> [f64; 3]) -> Rgb {
    let mut planes: Rgb = Default::default();
    for y in 0..H {
        for x in 0..W {
            let c = f(x as f64, y as f64);
            (0..3).for_each(|k| planes[k].push(c[k] as f32));
        }
    }
    planes
}

/// A hash of the pixel's index, uniform in [0, 1).
fn noise(x: f64, y: f64) -> f64 {
    let mut i = y as u32 * W as u32 + x as u32;
    i = (i ^ (i >> 16)).wrapping_mul(0x7feb352d);
    i = (i ^ (i >> 15)).wrapping_mul(0x846ca68b);
    f64::from(i ^ (i >> 16)) / 4294967296.0
}

fn planes(p: &Rgb) -> Planes<'_> {
    [&p[0], &p[1], &p[2]]
}

fn check_ldr(reference: Rgb, test: Rgb, expected_mean: f64, expected_at_20_10: f64) {
    let linear = |p: Rgb| p.map(|c| c.into_iter().map(|v| srgb_decode(f64::from(v)) as f32).collect::<Vec<f32>>());
    let (reference, test) = (linear(reference), linear(test));
    let map = ldr(planes(&test), planes(&reference), W, PIXELS_PER_DEGREE);
    assert!((mean(&map) - expected_mean).abs() < TOLERANCE, "{} against {expected_mean}", mean(&map));
    let value = f64::from(map[10 * W + 20]);
    assert!((value - expected_at_20_10).abs() < 1e-5, "{value} against {expected_at_20_10}");
    let back = ldr(planes(&reference), planes(&test), W, PIXELS_PER_DEGREE);
    assert!(map == back, "not symmetric");
}

#[test]
fn ldr_of_shifted_tinted_waves_is_that_of_the_evaluator() {
    let (sin, cos) = (f64::sin, f64::cos);
    let reference = make(|x, y| [0.5 + 0.4 * sin(x / 7.0), 0.5 + 0.4 * cos(y / 9.0), 0.5 + 0.4 * sin((x + y) / 11.0)]);
    let test =
        make(|x, y| [0.5 + 0.4 * sin((x + 1.0) / 7.0), 0.55 + 0.4 * cos(y / 9.0), 0.45 + 0.4 * sin((x + y) / 11.0)]);
    check_ldr(reference, test, 0.355929, 0.423695);
}

#[test]
fn ldr_of_a_noisy_checkerboard_is_that_of_the_evaluator() {
    let c = |x: f64, y: f64| ((x as i32 / 8 + y as i32 / 8) % 2) as f64 * 0.8 + 0.1;
    let reference = make(|x, y| [c(x, y); 3]);
    let test = make(|x, y| {
        let (c, n) = (c(x, y), noise(x, y) - 0.5);
        [(c + 0.3 * n).clamp(0.0, 1.0), c, (c - 0.2 * n).clamp(0.0, 1.0)]
    });
    check_ldr(reference, test, 0.084256, 0.102971);
}

#[test]
fn ldr_of_exchanged_saturated_bars_is_that_of_the_evaluator() {
    let bar = |x: f64| (x as i32 / 12 % 2) as f64;
    let reference = make(|x, _| [0.0, bar(x), 1.0 - bar(x)]);
    let test = make(|x, _| [0.0, 1.0 - bar(x), 0.5 * bar(x)]);
    check_ldr(reference, test, 0.983260, 0.990218);
}

#[test]
fn ldr_of_fine_blue_and_yellow_patterns_is_that_of_the_evaluator() {
    // Only the sum of two Gaussians for blue-yellow decides here.
    let reference = make(|x, y| [0.5, 0.5, 0.5 + 0.3 * (x / 1.3).sin() * (y / 2.0).cos()]);
    let test = make(|x, y| [0.5, 0.5, 0.5 + 0.3 * (x / 2.0).cos() * (y / 1.3).sin()]);
    check_ldr(reference, test, 0.149622, 0.197516);
}

fn decades(x: f64, y: f64) -> f64 {
    (6.0 * (x / 13.0).sin() * (y / 17.0).cos()).exp2()
}

fn check_hdr(reference: Rgb, test: Rgb, expected: (f64, f64, f64, usize)) {
    let flip = hdr(planes(&test), planes(&reference), W, PIXELS_PER_DEGREE);
    let (expected_mean, start, stop, count) = expected;
    assert!((mean(&flip.map) - expected_mean).abs() < TOLERANCE, "{} against {expected_mean}", mean(&flip.map));
    // Six digits of the printed f32.
    assert!((flip.start - start).abs() < 1e-4 && (flip.stop - stop).abs() < 1e-4, "{} {}", flip.start, flip.stop);
    assert_eq!(flip.count, count);
}

#[test]
fn hdr_over_many_decades_is_that_of_the_evaluator() {
    let reference = |x, y| [decades(x, y), 0.7 * decades(x, y), 0.4 * decades(x, y) + 0.05];
    let test = |x, y| {
        let d = decades(x, y);
        [d * (1.0 + 0.4 * (noise(x, y) - 0.5)), 0.7 * d * 1.05, 0.4 * d + 0.05]
    };
    check_hdr(make(reference), make(test), (0.108239, -4.483608, 1.544451, 7));
    // Black right of 40 % of the width: the median is zero and the evaluator goes on to 24 stops.
    let left = |x: f64, c: [f64; 3]| if x > W as f64 * 0.4 { [0.0; 3] } else { c };
    check_hdr(
        make(|x, y| left(x, reference(x, y))),
        make(|x, y| left(x, test(x, y))),
        (0.049088, -4.483401, 24.083297, 29),
    );
}

#[test]
fn hdr_of_a_flat_picture_and_its_brighter_twin_is_that_of_the_evaluator() {
    let reference = make(|x, y| [0.2 + 0.1 * (x / 7.0).sin(), 0.3, 0.25 + 0.2 * (y / 5.0).cos().powi(2)]);
    let test = reference.clone().map(|c| c.into_iter().map(|v| v * 1.1).collect());
    check_hdr(reference, test, (0.067942, 2.769099, 2.897678, 2));
}

#[test]
fn equal_pictures_have_no_error_and_opposite_ones_the_largest() {
    let p = make(|x, y| [decades(x, y), noise(x, y), 0.3]);
    assert_eq!(ldr(planes(&p), planes(&p), W, PIXELS_PER_DEGREE), vec![0.0; W * H]);
    assert_eq!(hdr(planes(&p), planes(&p), W, PIXELS_PER_DEGREE).map, vec![0.0; W * H]);
    let (green, blue) = (make(|_, _| [0.0, 1.0, 0.0]), make(|_, _| [0.0, 0.0, 1.0]));
    for e in ldr(planes(&green), planes(&blue), W, PIXELS_PER_DEGREE) {
        // Rounding of f32 through the filters and the colour space.
        assert!((e - 1.0).abs() < 1e-4, "{e}");
    }
}

#[test]
fn strange_values_and_tiny_pictures_give_a_number_between_zero_and_one() {
    let odd = [f32::NAN, f32::INFINITY, -1.0, 0.0, f32::MAX, 1e-42];
    for (width, n) in [(1, 1), (1, 6), (6, 6), (3, 6)] {
        let a: Vec<f32> = odd[..n].to_vec();
        let b: Vec<f32> = odd.iter().rev().copied().take(n).collect();
        for (t, r) in [(&a, &b), (&b, &a), (&a, &a)] {
            let (t, r) = ([&t[..]; 3], [&r[..]; 3]);
            for e in ldr(t, r, width, PIXELS_PER_DEGREE).into_iter().chain(hdr(t, r, width, PIXELS_PER_DEGREE).map) {
                assert!((0.0..=1.0001).contains(&e), "{e}");
            }
        }
    }
    let black = vec![0.0; 4];
    assert_eq!(hdr([&black; 3], [&black; 3], 2, PIXELS_PER_DEGREE).count, 1);
}
