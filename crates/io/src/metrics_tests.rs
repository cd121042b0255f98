//! Closed-form figures; false and true alarms of the tests on pictures with known noise.

use super::*;
use moonmilk_core::{Random, Stream};

fn noisy(width: usize, height: usize, seed: u64, parts: usize, bias: f64) -> Picture {
    let mut random = Normal(Stream::new(&[seed]));
    let mut p = Picture::new(width, height);
    for name in ["R", "G", "B"] {
        let (mut mean, mut variance) = (Vec::new(), Vec::new());
        for i in 0..width * height {
            // Noise that grows with the value, estimated from `parts` normal parts as a renderer does (exact if 0).
            let (true_mean, sigma) = (1.0 + (i % 7) as f64, 0.1 + (i % 5) as f64 * 0.05);
            let n = parts.max(1) as f64;
            let xs: Vec<f64> = (0..parts.max(1)).map(|_| bias + true_mean + n.sqrt() * sigma * random.next()).collect();
            let m = xs.iter().sum::<f64>() / n;
            let v = xs.iter().map(|x| (x - m) * (x - m)).sum::<f64>() / (n - 1.0) / n;
            mean.push(m as f32);
            variance.push(if parts == 0 { sigma * sigma } else { v } as f32);
        }
        p.push(name, mean).unwrap();
        p.push(&format!("Variance.{name}"), variance).unwrap();
    }
    if parts > 0 {
        p.attributes.insert(VARIANCE_SAMPLES.into(), Value::Int(parts as i32));
    }
    p
}

/// Normal variates by Box and Muller.
struct Normal(Stream);

impl Normal {
    fn next(&mut self) -> f64 {
        let [u, v] = self.0.uniform2().map(f64::from);
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

#[test]
fn figures_are_those_of_a_hand_calculation() {
    let a = Picture::from_rgb(2, 1, &[[1.0, 2.0, 0.0], [3.0, 2.0, 0.0]]).unwrap();
    let b = Picture::from_rgb(2, 1, &[[1.0, 1.0, 0.0], [1.0, 1.0, 0.0]]).unwrap();
    let r = diff(&a, &b).unwrap();
    let red = &r.channels[0];
    assert_eq!((red.ratio, red.mse, red.rmse(), red.largest), (2.0, 2.0, 2f64.sqrt(), 2.0));
    assert!((red.rel_mse - 2.0 / 1.01).abs() < 1e-15);
    assert_eq!((r.all.ratio, r.all.mse, r.all.largest), (2.0, 1.0, 2.0));
    assert!(r.channels[2].ratio.is_nan() && r.tests.is_none() && r.p().is_none());
    // Errors 0, 1, 0 and 2, 1, 0 over sqrt(1.01), a third of their sum.
    assert!((f64::from(r.relative_error[1]) - 1.0 / 1.01f64.sqrt()).abs() < 1e-6);
    assert!(r.to_string().contains("not possible"));
}

#[test]
fn invalid_pixels_are_counted_and_left_out() {
    let a = Picture::from_rgb(3, 1, &[[f32::NAN, 1.0, 1.0], [2.0; 3], [4.0; 3]]).unwrap();
    let b = Picture::from_rgb(3, 1, &[[1.0; 3], [1.0; 3], [1.0, f32::INFINITY, 1.0]]).unwrap();
    let r = diff(&a, &b).unwrap();
    assert_eq!((r.invalid, r.all.ratio, r.all.mse), (2, 2.0, 1.0));
    assert!(r.flip().is_finite() && r.relative_error[0].is_nan());
    assert_eq!(r.relative_error_picture(1.0).unwrap().channel("G").unwrap()[0], 1.0);
}

#[test]
fn pictures_without_colour_or_of_other_pixels_are_refused() {
    let a = Picture::from_rgb(2, 1, &[[0.0; 3]; 2]).unwrap();
    let mut b = a.clone();
    b.offset = [1, 0];
    assert!(diff(&a, &b).unwrap_err().to_string().contains("2 x 1 pixels at (0, 0) against 2 x 1 pixels at (1, 0)"));
    let mut c = Picture::new(2, 1);
    c.push("N.X", vec![0.0; 2]).unwrap();
    c.push("N.Z", vec![0.0; 2]).unwrap();
    assert!(diff(&a, &c).is_err());
}

#[test]
fn equal_means_raise_no_alarm_whether_variances_are_known_or_estimated() {
    for parts in [0, 8, 16] {
        for seed in 0..4 {
            let r = diff(&noisy(70, 50, 2 * seed, parts, 0.0), &noisy(70, 50, 2 * seed + 1, parts, 0.0)).unwrap();
            // Twelve independent reports at fixed seeds: significance 1e-4 for each.
            assert!(r.p().unwrap() > 1e-4, "{parts} {seed}\n{r}");
            for t in r.tests.as_ref().unwrap() {
                // Four standard deviations of a mean of 3500 squares, each of variance 2 (14 - 1) / (14 - 4) = 2.6 or less.
                assert!((t.pixels.mean_square - 1.0).abs() < 4.0 * (2.6f64 / 3500.0).sqrt(), "{r}");
                assert_eq!((t.pixels.n, t.blocks.n, t.unexplained), (3500, 5 * 4, 0));
            }
            // The ratio is within four of its own standard errors.
            assert!((r.all.ratio - 1.0).abs() < 4.0 * r.all.ratio_std_err.unwrap());
        }
    }
}

#[test]
fn a_bias_is_seen_by_the_mean_before_the_pixels() {
    // 0.04 is a seventh of the noise of a pixel's difference (0.3) and eight standard errors of the mean.
    let r = diff(&noisy(70, 50, 20, 8, 0.04), &noisy(70, 50, 21, 8, 0.0)).unwrap();
    for t in r.tests.as_ref().unwrap() {
        assert!(t.mean_z > 4.0 && t.pixels.extreme.p > 1e-4, "{r}");
    }
    assert!(r.p().unwrap() < 1e-4);
    assert!(r.to_string().contains("differ by more than their noise"));
}

#[test]
fn one_wrong_block_and_one_wrong_pixel_are_found_where_they_are() {
    let mut a = noisy(70, 50, 30, 0, 0.0);
    let b = noisy(70, 50, 31, 0, 0.0);
    for y in 16..32 {
        (32..48).for_each(|x| a.channels[0].data[y * 70 + x] += 0.2);
    }
    // Channels alternate with their variances: 0 is R, 2 is G.
    a.channels[2].data[49 * 70 + 69] -= 5.0;
    let r = diff(&a, &b).unwrap();
    let tests = r.tests.as_ref().unwrap();
    let (block, untouched) = (tests[0].blocks.extreme, tests[2].blocks.extreme);
    assert!((block.x, block.y) == (32, 16) && block.z > 5.0 && block.p < 1e-5 && untouched.p > 1e-4, "{r}");
    let worst = tests[1].pixels.extreme;
    assert!((worst.x, worst.y) == (69, 49) && worst.z < -8.0 && worst.p < 1e-10, "{r}");
}

#[test]
fn pixels_without_variance_must_agree() {
    let mut a = noisy(20, 20, 40, 0, 0.0);
    let mut b = noisy(20, 20, 41, 0, 0.0);
    for p in [&mut a, &mut b] {
        p.channels.iter_mut().for_each(|c| c.data[7] = if c.name.starts_with('V') { 0.0 } else { 3.0 });
    }
    a.channels[0].data[7] *= 1.0 + 1e-6;
    assert!(diff(&a, &b).unwrap().p().unwrap() > 1e-4);
    a.channels[0].data[7] *= 1.001;
    let r = diff(&a, &b).unwrap();
    assert_eq!((r.tests.as_ref().unwrap()[0].unexplained, r.p()), (1, Some(0.0)));
}

#[test]
fn a_picture_equals_itself_in_every_figure() {
    let a = noisy(33, 17, 50, 8, 0.0);
    let r = diff(&a, &a).unwrap();
    assert_eq!((r.all.ratio, r.all.mse, r.flip(), r.p()), (1.0, 0.0, 0.0, Some(1.0)));
    assert_eq!(r.flip_picture().unwrap().width, 33);
}

#[test]
fn errors_that_pixels_share_are_no_difference_where_a_picture_says_so() {
    // Noise of each pixel, and as large a part common to all: eight parts, whose spread says what means are worth.
    let shared = |seed: u64, said: bool| {
        let mut random = Normal(Stream::new(&[seed]));
        let (width, height, parts) = (32usize, 16usize, 8usize);
        let n = width * height;
        let xs: Vec<Vec<f64>> = (0..parts)
            .map(|_| {
                let common = random.next();
                (0..n).map(|_| 5.0 + 0.3 * (random.next() + common)).collect()
            })
            .collect();
        let variance = |x: &[f64]| {
            let m = x.iter().sum::<f64>() / parts as f64;
            x.iter().map(|x| (x - m).powi(2)).sum::<f64>() / ((parts - 1) * parts) as f64
        };
        let mean_over = |i: std::ops::Range<usize>, within: &dyn Fn(usize) -> bool| -> Vec<f64> {
            let list: Vec<usize> = i.filter(|&i| within(i)).collect();
            xs.iter().map(|x| list.iter().map(|&i| x[i]).sum::<f64>() / list.len() as f64).collect()
        };
        let block = |k: usize| variance(&mean_over(0..n, &|i| i % width / 16 == k));
        let blocks = [block(0), block(1)];
        let mut p = Picture::new(width, height);
        for name in ["R", "G", "B"] {
            let pixel = |i: usize| xs.iter().map(|x| x[i]).collect::<Vec<f64>>();
            p.push(name, (0..n).map(|i| (pixel(i).iter().sum::<f64>() / parts as f64) as f32).collect()).unwrap();
            p.push(&format!("Variance.{name}"), (0..n).map(|i| variance(&pixel(i)) as f32).collect()).unwrap();
            if said {
                let plane = (0..n).map(|i| blocks[i % width / 16] as f32).collect();
                p.push(&format!("{BLOCK_VARIANCE}.{name}"), plane).unwrap();
                let whole = Value::Float(variance(&mean_over(0..n, &|_| true)));
                p.attributes.insert(format!("{MEAN_VARIANCE}{name}"), whole);
            }
        }
        p.attributes.insert(VARIANCE_SAMPLES.into(), Value::Int(parts as i32));
        p
    };
    // Of forty pairs none is below 1e-4 by chance (.4 %); taken for independent nearly all are.
    let alarms = |said: bool| {
        (0..40).filter(|&k| diff(&shared(2 * k, said), &shared(2 * k + 1, said)).unwrap().p().unwrap() < 1e-4).count()
    };
    assert_eq!(alarms(true), 0);
    assert!(alarms(false) > 20, "{}", alarms(false));
    // The ratio's standard error is that of the means.
    let e = diff(&shared(1, true), &shared(2, true)).unwrap().all.ratio_std_err.unwrap();
    let expected = 0.3 * (2.0f64 / 8.0).sqrt() / 5.0;
    assert!(e > 0.4 * expected && e < 2.0 * expected, "{e} against {expected}");
}
