//! Guided walks: the means of plain ones and of exact solutions, less noise, and no weight above a hard bound.
//!
//! Significance: each comparison accepts 4.9 standard errors (1e-6 two-sided); a failure is a bug, seeds are fixed. With `MOONMILK_SLOW=k` sample numbers grow 16 k fold.

use moonmilk_core::estimate::Accumulator;
use moonmilk_core::{Estimate, Spectrum, Stream, Vec3};
use moonmilk_walk::domain::ball::Ball;
use moonmilk_walk::domain::planar::{Face, Slab};
use moonmilk_walk::{Domain, Guide, Medium, NoTally, Outcome, Roulette, Walker, guide, guided, walk};

const Z: f64 = 4.9;
/// No roulette.
const KEEP_ALL: Roulette = Roulette { threshold: 0.0, survivor: 1.0 };

fn slow() -> u64 {
    std::env::var("MOONMILK_SLOW").map_or(1, |k| 16 * k.parse::<u64>().expect("MOONMILK_SLOW is a number"))
}

fn gray(alpha: f32, g: f32) -> Medium<1> {
    Medium::new(Spectrum([1.0 - alpha]), Spectrum([alpha]), g)
}

/// Walks once by either policy; returns where the walk left, and the walker.
fn go<const N: usize, D: Domain<N>>(
    domain: &D,
    medium: &Medium<N>,
    guide: Option<&Guide<N>>,
    roulette: Roulette,
    start: (Vec3, Vec3),
    rng: &mut Stream,
) -> (Option<D::Exit>, Walker<N>) {
    let mut w = Walker::new(start.0, start.1);
    let limits = roulette.into();
    let out = match guide {
        Some(guide) => {
            w.choose_strategy(rng);
            guided::walk(domain, medium, guide, &limits, &mut w, &mut NoTally, rng)
        }
        None => walk(domain, medium, &limits, &mut w, &mut NoTally, rng),
    };
    match out {
        Outcome::Left(exit) => (Some(exit), w),
        Outcome::Ended => (None, w),
        Outcome::Lost => panic!("a walk was lost"),
    }
}

/// Returns shares that leave a slab by its front and its back for light that enters along the normal, their efficiencies (1 / (relative variance, collisions + 1.5)), and the largest weight.
fn shares(slab: Slab, medium: &Medium<1>, guide: Option<&Guide<1>>, n: u64) -> ([Estimate; 2], [f64; 2], f32) {
    let (mut sums, mut most, mut collisions) = ([Accumulator::default(); 2], 0f32, 0u64);
    for i in 0..n {
        let mut rng = Stream::new(&[21, i]);
        let (exit, w) = go(&slab, medium, guide, Roulette::default(), (Vec3::ZERO, Vec3::Z), &mut rng);
        for (sum, face) in sums.iter_mut().zip([Face::Front, Face::Back]) {
            sum.add(if exit == Some(face) { f64::from(w.beta[0]) } else { 0.0 });
        }
        most = most.max(if exit.is_some() { w.beta[0] } else { 0.0 });
        collisions += u64::from(w.collisions);
    }
    let cost = collisions as f64 + 1.5 * n as f64;
    let found = sums.map(|s| s.estimate());
    (found, found.map(|e| (e.mean / e.std_err).powi(2) / cost), most)
}

#[test]
fn half_space_albedos_are_those_of_the_exact_solution_with_less_noise() {
    // Exact albedos of entered light as in `physics.rs`; the last number is an efficiency over plain walks' that must be exceeded (measured: half as much again).
    for (alpha, eta, exact, gain) in [
        (0.3, 1.0, 0.057214, 2.5),
        (0.8, 1.0, 0.285255, 5.0),
        (0.9, 1.0, 0.414947, 6.0),
        (0.99, 1.0, 0.752721, 6.0),
        (0.5, 1.33, 0.060331, 5.0),
        (0.9, 1.33, 0.280356, 4.0),
        (0.99, 1.33, 0.645854, 4.0),
        (0.8, 1.5, 0.137478, 4.0),
        (0.999, 1.5, 0.834853, 4.0),
    ] {
        let slab = Slab { thickness: f32::INFINITY, eta };
        let medium = gray(alpha, 0.0);
        let guide = Guide::new(&medium).unwrap();
        let n = 40_000 * slow();
        let (plain, was, _) = shares(slab, &medium, None, n);
        let ([r, _], is, most) = shares(slab, &medium, Some(&guide), n);
        println!(
            "alpha {alpha}, eta {eta}: {r}, exact {exact}, z {:+.2}; plain {}; efficiency {:.2}; most {most}",
            r.z(exact),
            plain[0],
            is[0] / was[0]
        );
        assert!(r.z(exact).abs() < Z, "alpha {alpha}, eta {eta}: {r} against {exact}");
        assert!(is[0] > gain * was[0], "alpha {alpha}, eta {eta}: {} times as efficient", is[0] / was[0]);
    }
}

#[test]
fn slabs_reflect_and_transmit_as_published_and_as_plain_walks() {
    // van de Hulst, tau = 2, alpha 0.9, g 0.75, index-matched: R .09739, T .66096 (five digits).
    let medium = gray(0.9, 0.75);
    let guide = Guide::new(&medium).unwrap();
    let ([r, t], ..) = shares(Slab { thickness: 2.0, eta: 1.0 }, &medium, Some(&guide), 200_000 * slow());
    assert!(r.z(0.09739).abs() < Z && t.z(0.66096).abs() < Z, "R {r}, T {t}");
    for (thickness, eta, alpha, g) in
        [(4.0, 1.4, 0.8, 0.0), (10.0, 1.0, 0.95, 0.0), (20.0, 1.4, 0.95, 0.8), (6.0, 1.5, 0.5, -0.5)]
    {
        let (slab, medium) = (Slab { thickness, eta }, gray(alpha, g));
        let guide = Guide::new(&medium).unwrap();
        let n = 200_000 * slow();
        let (a, was, _) = shares(slab, &medium, None, n);
        let (b, is, _) = shares(slab, &medium, Some(&guide), n);
        for k in 0..2 {
            println!("slab of {thickness}, {eta} {alpha} {g}: {} {}, efficiency {:.2}", a[k], b[k], is[k] / was[k]);
            assert!(a[k].z_against(&b[k]).abs() < Z, "slab of {thickness}, face {k}: {} against {}", b[k], a[k]);
        }
    }
}

/// Returns means of what leaves a ball, lane by lane, for light that enters at a slant; the hero goes round the lanes.
fn leaves<const N: usize>(ball: Ball, lanes: [(f32, f32); N], g: f32, guides: bool, n: u64) -> [Estimate; N] {
    let mut sums = [Accumulator::default(); N];
    for i in 0..n {
        let mut rng = Stream::new(&[22, i, N as u64, u64::from(guides)]);
        let lane = |k: usize| (k + i as usize) % N;
        let m = Medium::<N>::new(Spectrum::from_fn(|k| lanes[lane(k)].0), Spectrum::from_fn(|k| lanes[lane(k)].1), g);
        let guide = if guides { Guide::new(&m) } else { None };
        let start = (Vec3::Z * ball.radius, Vec3::new(0.6, 0.0, -0.8));
        let (exit, w) = go(&ball, &m, guide.as_ref(), Roulette::default(), start, &mut rng);
        for k in 0..N {
            sums[lane(k)].add(if exit.is_some() { f64::from(w.beta[k]) } else { 0.0 });
        }
    }
    sums.map(|s| s.estimate())
}

#[test]
fn balls_are_as_bright_as_by_plain_walks() {
    for radius in [1.0f32, 8.0] {
        for eta in [1.0f32, 1.4] {
            for g in [0.0f32, 0.7] {
                for alpha in [0.3f32, 0.8, 0.95] {
                    let (ball, lanes) = (Ball { radius, eta }, [(1.0 - alpha, alpha)]);
                    let n = 60_000 * slow();
                    let [a] = leaves(ball, lanes, g, false, n);
                    let [b] = leaves(ball, lanes, g, true, n);
                    let what = format!("radius {radius}, eta {eta}, g {g}, alpha {alpha}");
                    println!(
                        "{what}: {a} {b}, z {:+.2}, variance ratio {:.2}",
                        b.z_against(&a),
                        (a.std_err / b.std_err).powi(2)
                    );
                    assert!(b.z_against(&a).abs() < Z && b.std_err > 0.0, "{what}: {b} against {a}");
                }
            }
        }
    }
}

#[test]
fn lanes_that_part_keep_their_means_and_white_ones_are_white() {
    // Extinctions 1 : 1.3 : 2.5; the last lane does not absorb at all.
    let lanes = [(0.3, 0.7), (0.05, 1.25), (0.0, 2.5)];
    for (eta, g) in [(1.0f32, 0.0f32), (1.4, 0.0), (1.4, 0.7)] {
        let ball = Ball { radius: 3.0, eta };
        let n = 200_000 * slow();
        let found = leaves(ball, lanes, g, true, 3 * n / 2);
        for k in 0..3 {
            let [alone] = leaves(ball, [lanes[k]], g, false, n);
            println!("eta {eta}, g {g}, lane {k}: {} alone {alone}", found[k]);
            if k == 2 {
                assert!(found[k].z(1.0).abs() < Z && alone.mean == 1.0, "eta {eta}, g {g}: white {}", found[k]);
            } else {
                assert!(found[k].z_against(&alone).abs() < Z, "eta {eta}, g {g}, lane {k}: {} {alone}", found[k]);
            }
        }
    }
}

#[test]
fn any_guide_keeps_white_white() {
    // The guide of a medium that absorbs, in one of the same extinction that does not: as wrong as can be, and still unbiased.
    for (radius, eta, g, guessed) in [(2.0f32, 1.4f32, 0.0f32, 0.8f32), (6.0, 1.0, 0.0, 0.5), (6.0, 1.4, 0.7, 0.9)] {
        let (ball, white) = (Ball { radius, eta }, gray(1.0, g));
        let guide = Guide::new(&gray(guessed, g)).unwrap();
        let mut sum = Accumulator::default();
        for i in 0..200_000 * slow() {
            let mut rng = Stream::new(&[23, i]);
            let start = (Vec3::Z * radius, Vec3::new(0.6, 0.0, -0.8));
            let (exit, w) = go(&ball, &white, Some(&guide), KEEP_ALL, start, &mut rng);
            assert!(exit.is_some());
            // The bound: nothing weighs more than its plain weight, which is 1, over the share of plain walks.
            assert!(w.beta[0] <= (1.0 + 1e-4) / guide::PLAIN, "path {i} weighs {}", w.beta[0]);
            sum.add(f64::from(w.beta[0]));
        }
        let e = sum.estimate();
        println!("radius {radius}, eta {eta}, g {g}: {e}, z {:+.2}", e.z(1.0));
        assert!(e.z(1.0).abs() < Z && e.std_err > 0.0, "radius {radius}, eta {eta}, g {g}: {e}");
    }
}

#[test]
fn no_path_weighs_more_than_four_times_what_it_would_by_plain_walks() {
    // By plain walks a path of n collisions weighs alpha^n.
    let mut closest = 0f32;
    for (radius, eta, g, alpha) in
        [(2.0f32, 1.4f32, 0.0f32, 0.95f32), (10.0, 1.4, 0.0, 0.8), (30.0, 1.0, 0.9, 0.9), (5.0, 1.5, 0.9, 0.5)]
    {
        let (ball, medium) = (Ball { radius, eta }, gray(alpha, g));
        let guide = Guide::new(&medium).unwrap();
        for i in 0..100_000 * slow() {
            let mut rng = Stream::new(&[24, i]);
            let start = (Vec3::Z * radius, Vec3::new(0.6, 0.0, -0.8));
            // Roulette below 1e-6 alone: paths of hundreds of collisions.
            let few = Roulette { threshold: 1e-6, survivor: 1e-6 };
            let (exit, w) = go(&ball, &medium, Some(&guide), few, start, &mut rng);
            if exit.is_some() && w.beta[0] > 1e-5 {
                let of_bound = w.beta[0] * guide::PLAIN / alpha.powi(w.collisions as i32);
                assert!(of_bound < 1.0 + 1e-3, "path {i} weighs {}, {of_bound} of its bound", w.beta[0]);
                closest = closest.max(of_bound);
            }
        }
    }
    // It is reached: paths that the guide would never take.
    assert!(closest > 0.99, "{closest}");
}
