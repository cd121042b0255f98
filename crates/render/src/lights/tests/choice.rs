//! Which light is taken, with which probability, and that nothing is lost by it.

use moonmilk_core::stats::chi_square;

use super::*;
use crate::lights::octahedral::direction_of;
use crate::lights::{Lamp, Placed, Target, refined};

#[test]
fn the_density_of_a_hit_is_that_of_the_sample() {
    let lights = Lights::of_scene(&everything()).expect("valid");
    let mut r = Stream::new(&[45]);
    let mut counts = [0; 3];
    for _ in 0..100_000 {
        let p = point(&mut r, 4.0);
        let n = (r.uniform() < 0.5).then(|| direction(&mut r));
        let Some(s) = lights.sample(p, n, &grey(), uniform3(&mut r)) else {
            continue;
        };
        assert!((s.wi.length() - 1.0).abs() < 1e-6 && s.pdf > 0.0);
        let density = if s.is_delta {
            continue;
        } else if s.distance.is_infinite() {
            counts[0] += 1;
            let all = match n {
                None => lights.aimed_environment(p, s.wi, &grey()),
                Some(_) => lights.environment(p, s.wi, &grey()),
            };
            assert_eq!(all, s.radiance);
            lights.pdf_environment(p, n, s.wi)
        } else {
            counts[1] += 1;
            assert!((p + s.wi * s.distance).distance(s.point) < 1e-5);
            lights.pdf_hit(p, n, s.light, s.point)
        };
        // The point rounds to f32: relative 1e-3 at worst where the surface is seen edge on. Rarer grazing samples are counted.
        if (density / s.pdf - 1.0).abs() > 1e-3 {
            counts[2] += 1;
        }
    }
    println!("environment {}, surfaces {}, off {}", counts[0], counts[1], counts[2]);
    assert!(counts[0] > 10_000 && counts[1] > 10_000 && counts[2] == 0, "{counts:?}");
}

#[test]
fn lights_are_chosen_with_their_stated_probabilities() {
    // 12 reference points, half of them with a normal; cells: every placed light, everything at infinity, and no light. Chi-square at
    // 1e-5 each.
    let scene = everything();
    let lights = Lights::of_scene(&scene).expect("valid");
    let mut r = Stream::new(&[46]);
    for k in 0..12 {
        let p = point(&mut r, 4.0);
        let n = (k % 2 == 0).then(|| direction(&mut r));
        let shares = lights.shares(p, n);
        let distant: f64 = lights.distant.iter().map(|l| shares.of(f64::from(l.importance(n)))).sum();
        let total = shares.of(shares.tree) + shares.of(shares.environment) + distant;
        assert!((total - 1.0).abs() < 1e-12, "the shares add up to {total}");

        let m = 100_000;
        let mut expected: Vec<f64> =
            (0..lights.placed_count() as u32).map(|l| f64::from(lights.tree.probability(p, n, l))).collect();
        let mut counts = vec![0.0; expected.len() + 1];
        for _ in 0..m {
            match lights.tree.sample(p, n, refined(uniform3(&mut r))) {
                Some((l, q)) => {
                    assert!((f64::from(q) / expected[l as usize] - 1.0).abs() < 1e-6);
                    counts[l as usize] += 1.0;
                }
                None => counts[lights.placed_count()] += 1.0,
            }
        }
        let sum: f64 = expected.iter().sum();
        assert!(sum < 1.0 + 1e-5, "{sum}");
        // What is missing to 1 is the probability of a node whose children both turn out to be dark.
        expected.push((1.0 - sum).max(0.0));
        if expected[lights.placed_count()] < 1e-6 {
            assert_eq!(counts.pop(), Some(0.0));
            expected.pop();
        }
        let scale: f64 = f64::from(m) / expected.iter().sum::<f64>();
        let expected: Vec<f64> = expected.iter().map(|e| e * scale).collect();
        let significance = chi_square(&counts, &expected, 0);
        assert!(significance > 1e-5, "point {k}: p = {significance}");
    }
}

#[test]
fn probabilities_add_up_to_one_where_every_light_is_in_reach() {
    let mut scene = empty();
    let mut r = Stream::new(&[47]);
    for _ in 0..300 {
        let intensity = SpectrumDescription::Rgb([10f32.powf(8.0 * r.uniform() - 4.0); 3]);
        scene.lights.push(light(LightKind::Point { from: point(&mut r, 1.0) + Vec3::Z * 2.0, intensity }));
    }
    let lights = Lights::of_scene(&scene).expect("valid");
    for k in 0..200 {
        let p = point(&mut r, 1.0) * Vec3::new(1.0, 1.0, 0.5);
        let n = (k % 2 == 0).then_some(Vec3::Z);
        let sum: f64 = (0..300).map(|l| f64::from(lights.probability(p, n, l))).sum();
        // Rounding of f32 products over the depth of the tree.
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    }
}

#[test]
fn all_lights_together_give_the_sum_of_their_irradiances() {
    // The estimator over the whole scene, with and without the normal told, against the sum of brute force over each placed light and
    // quadrature over the environment, without the normal over the part of it that is aimed at. Whatever the tree does, the mean must not move.
    let scene = everything();
    let lights = Lights::of_scene(&scene).expect("valid");
    let mut r = Stream::new(&[48]);
    for k in 0..6u64 {
        let p = point(&mut r, 4.0);
        let n = direction(&mut r);
        // Expectation light by light, by the surfaces' own sampling.
        let (mut mean, mut variance) = (0.0, 0.0);
        for (i, placed) in lights.placed.iter().enumerate() {
            match placed {
                Placed::Surface { surface, emission, two_sided, .. } => {
                    let mut sum = Accumulator::default();
                    for _ in 0..4000 {
                        let e = surface.sample(p, [f64::from(r.uniform()), f64::from(r.uniform())]).map_or(0.0, |s| {
                            let lit = *two_sided || s.front.dot(s.wi) < 0.0;
                            let l = lights.emissions[*emission as usize].at(s.uv, &grey())[0];
                            f64::from(l * n.dot(s.wi).max(0.0)) / s.pdf * f64::from(u8::from(lit))
                        });
                        sum.add(e);
                    }
                    let s = sum.estimate();
                    mean += s.mean;
                    variance += s.std_err * s.std_err;
                    if s.mean > 0.0 {
                        assert!(lights.probability(p, Some(n), i as u32) > 0.0, "light {i} is lost");
                    }
                }
                Placed::Punctual(lamp) => {
                    mean += lamp.sample(p, &grey()).map_or(0.0, |(e, wi, _)| f64::from(e[0] * n.dot(wi).max(0.0)));
                }
            }
        }
        mean +=
            lights.distant.iter().map(|d| f64::from(d.irradiance(&grey())[0] * n.dot(d.towards).max(0.0))).sum::<f64>();
        let m = 1200;
        let sky = |with_normal: bool| -> f64 {
            let radiance = |d: Vec3| match with_normal {
                false if lights.pdf_environment(p, None, d) == 0.0 => 0.0,
                false => lights.aimed_environment(p, d, &grey())[0],
                true => lights.environment(p, d, &grey())[0],
            };
            let at = |i: u32| {
                let d =
                    direction_of([(f64::from(i % m) + 0.5) / f64::from(m), (f64::from(i / m) + 0.5) / f64::from(m)]);
                f64::from(radiance(d) * n.dot(d).max(0.0)) * 4.0 * PI / f64::from(m * m)
            };
            (0..m * m).map(at).sum()
        };
        for with_normal in [false, true] {
            let sky = sky(with_normal);
            let mean = mean + sky;
            let e = moments(&lights, p, n, with_normal, 400_000, 500 + 2 * k + u64::from(with_normal))[1].estimate();
            let z = (e.mean - mean) / (e.std_err.powi(2) + variance).sqrt();
            // The quadrature is good to 2e-4 of the sky (pixels cut by the stretched transform and the horizon).
            let slack = 2e-4 * sky / (e.std_err.powi(2) + variance).sqrt();
            assert!(z.abs() < 4.5 + slack, "point {k}, normal {with_normal}: {e} against {mean}, z = {z}");
        }
    }
}

#[test]
fn faint_lights_are_found_as_often_as_their_probability_says() {
    // One light of 1000 is 1e5 times fainter: its probability, about 1e-8, is far below the 2^-23 steps of an f32 variate.
    let mut scene = empty();
    for i in 0..1000 {
        let from = Vec3::new(i as f32 * 0.01, 0.0, 10.0);
        let intensity = SpectrumDescription::Rgb([if i == 417 { 1e-5 } else { 1.0 }; 3]);
        scene.lights.push(light(LightKind::Point { from, intensity }));
    }
    let lights = Lights::of_scene(&scene).expect("valid");
    let probability = |l: u32| f64::from(lights.probability(Vec3::ZERO, None, l));
    let p = probability(417);
    assert!(p > 1e-9 && p < 2e-8, "{p}");
    // Find where on [0, 1) the walk leads to it, and draw the first variate from the 5 steps around: the others must spread them.
    let way = |l: u32| lights.tree.way(l).expect("it is in the tree").reverse_bits();
    let before: f64 = (0..1000).filter(|&l| way(l) < way(417)).map(probability).sum();
    let step = 1.0 / f64::from(1 << 23);
    let mut r = Stream::new(&[49]);
    let n = 200_000;
    let mut hits = 0;
    for i in 0..n {
        let cell = (before / step).floor() + f64::from(i % 5) - 2.0;
        let u = [((cell + 0.5) * step) as f32, r.uniform(), r.uniform()];
        hits += u32::from(matches!(lights.tree.sample(Vec3::ZERO, None, refined(u)), Some((417, _))));
    }
    let mean = p / (5.0 * step) * f64::from(n);
    // Binomial; significance 1e-5.
    assert!((f64::from(hits) - mean).abs() < 4.5 * mean.sqrt(), "{hits} against {mean}");
}

#[test]
fn lights_without_extent_are_chosen_with_their_stated_probabilities() {
    // 8 reference points; cells: every light without extent, and none. Chi-square at 1e-5 each.
    let lights = Lights::of_scene(&everything()).expect("valid");
    let mut r = Stream::new(&[48]);
    let points: Vec<u32> = (0..lights.placed_count() as u32)
        .filter(|&l| matches!(lights.target(Lamp::Point(l)), Some(Target::Point(_))))
        .collect();
    let distant = lights.distant.len();
    assert!(points.len() > 1 && distant > 0 && lights.has_unseen());
    for k in 0..8 {
        let p = point(&mut r, 4.0);
        let m = 100_000;
        let (mut counts, mut stated) = (vec![0.0; points.len() + distant + 1], vec![0.0; points.len() + distant + 1]);
        for _ in 0..m {
            let cell = match lights.choose_unseen(p, uniform3(&mut r)) {
                None => points.len() + distant,
                Some((lamp, probability)) => {
                    let cell = match lamp {
                        Lamp::Point(l) => points.binary_search(&l).expect("a point"),
                        Lamp::Distant(i) => points.len() + i as usize,
                    };
                    stated[cell] = f64::from(probability);
                    cell
                }
            };
            counts[cell] += 1.0;
        }
        assert!(stated[..points.len() + distant].iter().all(|&s| s > 0.0), "{stated:?}");
        let none = 1.0 - stated.iter().sum::<f64>();
        assert!(none > -1e-5, "{none}");
        if none < 1e-6 {
            assert_eq!((counts.pop(), stated.pop()), (Some(0.0), Some(0.0)));
        } else {
            *stated.last_mut().expect("cells") = none;
        }
        let expected: Vec<f64> = stated.iter().map(|s| s * f64::from(m)).collect();
        let significance = chi_square(&counts, &expected, 0);
        assert!(significance > 1e-5, "point {k}: p = {significance}");
    }
}
