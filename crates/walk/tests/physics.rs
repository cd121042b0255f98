//! The walk against exact results: path lengths, half-spaces, slabs, angular emission.
//!
//! Significance: each comparison accepts 4.9 standard errors (1e-6 two-sided); a failure is a bug, seeds are fixed.
//! Precision: stated per test; with `MOONMILK_SLOW=k` sample numbers grow 16 k fold.

use std::cell::Cell;

use moonmilk_core::estimate::Accumulator;
use moonmilk_core::{Estimate, Random, Spectrum, Stream, Vec3};
use moonmilk_walk::domain::ball::Ball;
use moonmilk_walk::domain::planar::{Face, Slab};
use moonmilk_walk::jump::Bank;
use moonmilk_walk::phase::{HenyeyGreenstein, Isotropic};
use moonmilk_walk::{
    Domain, Jumps, Medium, NoTally, Outcome, PathLength, PhaseFunction, Roulette, Stack, Walker, Wall, walk,
    walk_stack, walk_with,
};

const Z: f64 = 4.9;

fn slow() -> u64 {
    std::env::var("MOONMILK_SLOW").map_or(1, |k| 16 * k.parse::<u64>().expect("MOONMILK_SLOW is a number"))
}

fn gray(sigma_a: f32, sigma_s: f32, g: f32) -> Medium<1> {
    Medium::new(Spectrum([sigma_a]), Spectrum([sigma_s]), g)
}

/// Refracts light of cosine `cos_o` on its way into a body; `None` if Fresnel reflects it.
fn enter(d: Vec3, n: Vec3, eta: f32, rng: &mut impl Random) -> Option<Vec3> {
    let cos_o = -d.dot(n);
    let sin2_i = (1.0 - cos_o * cos_o) / (eta * eta);
    let cos_i = (1.0 - sin2_i).sqrt();
    let r_s = (cos_o - eta * cos_i) / (cos_o + eta * cos_i);
    let r_p = (eta * cos_o - cos_i) / (eta * cos_o + cos_i);
    let f = 0.5 * (r_s * r_s + r_p * r_p);
    (rng.uniform() >= f).then(|| (d / eta + n * (cos_o / eta - cos_i)).normalize())
}

/// Cosine-distributed light at the north pole, which stands for uniform light everywhere, by symmetry.
fn cosine_distributed(rng: &mut impl Random) -> Vec3 {
    let u = rng.uniform2();
    let (s, c) = moonmilk_walk::math::sin_cos_turn(u[1]);
    let (cos_o, sin_o) = (u[0].sqrt(), (1.0 - u[0]).sqrt());
    Vec3::new(sin_o * c, sin_o * s, -cos_o)
}

/// Mean path length per incident ray under uniform light on a ball of radius 1.
fn path_length(eta: f32, sigma_s: f32, g: f32, n: u64) -> Estimate {
    let (ball, medium) = (Ball { radius: 1.0, eta }, gray(0.0, sigma_s, g));
    let mut sum = Accumulator::default();
    for i in 0..n {
        let mut rng = Stream::new(&[11, i]);
        let d = cosine_distributed(&mut rng);
        let mut length = PathLength::default();
        if let Some(d) = enter(d, Vec3::Z, eta, &mut rng) {
            let mut w = Walker::new(Vec3::Z, d);
            let out = walk(&ball, &medium, &Roulette::default().into(), &mut w, &mut length, &mut rng);
            assert!(matches!(out, Outcome::Left(())), "{out:?}");
            assert_eq!(w.beta[0], 1.0, "a conservative walk keeps its weight");
        }
        sum.add(length.0);
    }
    sum.estimate()
}

#[test]
fn mean_path_length_is_four_eta_squared_v_over_s_whatever_the_medium() {
    for (eta, sigma_s, g) in [
        (1.0, 0.01, 0.0),
        (1.0, 10.0, 0.0),
        (1.33, 1.0, -0.5),
        (1.33, 30.0, 0.9),
        (1.5, 3.0, 0.5),
        (1.5, 30.0, 0.0),
        (2.0, 5.0, 0.95),
        (2.0, 0.1, 0.0),
    ] {
        let e = path_length(eta, sigma_s, g, 60_000 * slow());
        let exact = f64::from(eta * eta) * 4.0 / 3.0;
        assert!(e.z(exact).abs() < Z, "eta {eta}, sigma_s {sigma_s}, g {g}: {e} against {exact}");
    }
}

#[test]
fn mean_path_length_by_jumps_is_that_of_flights_at_any_density() {
    // By jumps a ball of 10 000 mean free paths costs what one of 100 does.
    for (eta, sigma_s) in [(1.0, 3.0), (1.5, 10.0), (1.33, 100.0), (1.0, 1000.0), (1.5, 10_000.0)] {
        let (ball, medium) = (Ball { radius: 1.0, eta }, gray(0.0, sigma_s, 0.0));
        let jumps = Jumps::new(&medium).unwrap();
        let (mut sum, mut events) = (Accumulator::default(), 0u64);
        let n = 60_000 * slow();
        for i in 0..n {
            let mut rng = Stream::new(&[12, i]);
            let d = cosine_distributed(&mut rng);
            let mut length = PathLength::default();
            if let Some(d) = enter(d, Vec3::Z, eta, &mut rng) {
                let mut w = Walker::new(Vec3::Z, d);
                let limits = Roulette::default().into();
                let out = walk_with(&ball, &medium, Some(&jumps), &limits, &mut w, &mut length, &mut rng);
                assert!(matches!(out, Outcome::Left(())), "{out:?}");
                assert_eq!(w.beta[0], 1.0, "a conservative walk keeps its weight");
                events += u64::from(w.collisions);
            }
            sum.add(length.0);
        }
        let (e, exact) = (sum.estimate(), f64::from(eta * eta) * 4.0 / 3.0);
        println!(
            "{eta} {sigma_s}: {e}, exact {exact:.5}, z {:+.2}, {:.1} events",
            e.z(exact),
            events as f64 / n as f64
        );
        assert!(e.z(exact).abs() < Z, "eta {eta}, sigma_s {sigma_s} by jumps: {e} against {exact}");
    }
}

#[test]
fn mean_path_length_by_simulated_exits_is_that_of_flights() {
    // Banks of as many records as there are jumps, so that errors are those of independent paths.
    for (eta, sigma_s, g) in [(1.0f32, 40.0f32, 0.5f32), (1.33, 150.0, 0.9), (1.5, 25.0, -0.6)] {
        let (ball, medium) = (Ball { radius: 1.0, eta }, gray(0.0, sigma_s, g));
        let (n, banks) = (40_000 * slow(), 32 * slow());
        let all: Vec<Bank> = (0..banks).map(|k| Bank::new(&HenyeyGreenstein { g }, k, 2048, sigma_s)).collect();
        let (mut sum, mut events) = (Accumulator::default(), 0u64);
        for i in 0..n {
            let jumps = Jumps::from_bank(&medium, &all[(i % banks) as usize]).unwrap();
            let mut rng = Stream::new(&[13, i]);
            let d = cosine_distributed(&mut rng);
            let mut length = PathLength::default();
            if let Some(d) = enter(d, Vec3::Z, eta, &mut rng) {
                let mut w = Walker::new(Vec3::Z, d);
                let limits = Roulette::default().into();
                let out = walk_with(&ball, &medium, Some(&jumps), &limits, &mut w, &mut length, &mut rng);
                assert!(matches!(out, Outcome::Left(())), "{out:?}");
                assert_eq!(w.beta[0], 1.0, "a conservative walk keeps its weight");
                events += u64::from(w.collisions);
            }
            sum.add(length.0);
        }
        let (e, exact) = (sum.estimate(), f64::from(eta * eta) * 4.0 / 3.0);
        let collisions = exact * f64::from(sigma_s);
        println!(
            "{eta} {sigma_s} {g}: {e}, exact {exact:.5}, z {:+.2}, {:.1} events",
            e.z(exact),
            events as f64 / n as f64
        );
        assert!((events as f64 / n as f64) < 0.7 * collisions, "{events} events");
        assert!(e.z(exact).abs() < Z, "eta {eta}, sigma_s {sigma_s}, g {g}: {e} against {exact}");
    }
}

/// A ball that notes the cosines at which its wall is met, in `at_wall`.
struct Noting<'a> {
    ball: Ball,
    at_wall: &'a Cell<f64>,
}

impl Domain<1> for Noting<'_> {
    type Wall = ();
    type Exit = ();

    fn start(&self) {}

    fn room(&self, p: Vec3) -> f32 {
        Domain::<1>::room(&self.ball, p)
    }

    fn segment(&self, p: Vec3, d: Vec3, t_max: f32, from: &()) -> Option<(f32, ())> {
        Domain::<1>::segment(&self.ball, p, d, t_max, from)
    }

    fn arrive<R: Random>(&self, wall: (), t: f32, walker: &mut Walker<1>, rng: &mut R) -> Wall<(), ()> {
        let cosine = f64::from((walker.p + walker.d * t).normalize().dot(walker.d));
        let outcome = Domain::<1>::arrive(&self.ball, wall, t, walker, rng);
        // Arriving counts once; being sent back by the wall once more.
        self.at_wall.set(self.at_wall.get() + if matches!(outcome, Wall::Stay(())) { 2.0 * cosine } else { cosine });
        outcome
    }

    fn is_outside(&self, p: Vec3) -> bool {
        Domain::<1>::is_outside(&self.ball, p)
    }
}

#[test]
fn dense_balls_keep_light_for_their_mean_path_length() {
    // Between walls r^2 + 2 l r.d - 2 l L is a martingale, l the transport mean free path, L the length flown: for a unit ball the
    // mean length is that of the sum of the cosines at its wall, entry and exit once, reflections twice. That sum hardly varies where
    // the length itself varies as the optical thickness does: a thousand mean free paths to .03 % with MOONMILK_SLOW=16 (of the mean
    // chord, 4/3), where counting lengths would need 1e13 collisions. What it leaves out, that the mean length of a flight is right, is
    // what the other tests of path lengths are about.
    for (eta, tau, g, n) in [
        (1.5f32, 1000.0f32, 0.0f32, 21_000),
        (1.0, 1000.0, 0.9, 3_100),
        (1.33, 100.0, 0.5, 16_000),
        (2.0, 30.0, 0.95, 50_000),
    ] {
        let medium = gray(0.0, 0.75 * tau, g);
        let (at_wall, mut sum) = (Cell::new(0.0), Accumulator::default());
        let domain = Noting { ball: Ball { radius: 1.0, eta }, at_wall: &at_wall };
        for i in 0..n * slow() {
            let mut rng = Stream::new(&[17, i]);
            let d = cosine_distributed(&mut rng);
            at_wall.set(0.0);
            if let Some(d) = enter(d, Vec3::Z, eta, &mut rng) {
                at_wall.set(f64::from(-d.z));
                let mut w = Walker::new(Vec3::Z, d);
                let out = walk(&domain, &medium, &Roulette::default().into(), &mut w, &mut NoTally, &mut rng);
                assert!(matches!(out, Outcome::Left(())), "{out:?}");
            }
            sum.add(at_wall.get());
        }
        let (e, exact) = (sum.estimate(), f64::from(eta * eta) * 4.0 / 3.0);
        println!(
            "ball of {tau} mean free paths, eta {eta}, g {g}: {e}, exact {exact}, precision {:.3} %",
            100.0 * e.std_err / exact
        );
        assert!(e.z(exact).abs() < Z, "eta {eta}, tau {tau}, g {g}: {e} against {exact}");
    }
}

/// Reflected share of light that entered a half-space (or slab) at normal incidence.
fn shares(slab: Slab, medium: Medium<1>, n: u64) -> (Estimate, Estimate) {
    let (mut front, mut back) = (Accumulator::default(), Accumulator::default());
    for i in 0..n {
        let mut rng = Stream::new(&[12, i]);
        let mut w = Walker::new(Vec3::ZERO, Vec3::Z);
        let out = walk(&slab, &medium, &Roulette::default().into(), &mut w, &mut NoTally, &mut rng);
        let beta = f64::from(w.beta[0]);
        front.add(if matches!(out, Outcome::Left(Face::Front)) { beta } else { 0.0 });
        back.add(if matches!(out, Outcome::Left(Face::Back)) { beta } else { 0.0 });
    }
    (front.estimate(), back.estimate())
}

#[test]
fn half_space_albedos_are_those_of_the_exact_solution() {
    // Albedo of entered light at normal incidence, isotropic scattering; exact half-space solution (six digits).
    for (alpha, eta, exact) in [
        (0.3, 1.0, 0.057214),
        (0.8, 1.0, 0.285255),
        (0.9, 1.0, 0.414947),
        (0.99, 1.0, 0.752721),
        (0.5, 1.33, 0.060331),
        (0.9, 1.33, 0.280356),
        (0.99, 1.33, 0.645854),
        (0.8, 1.5, 0.137478),
        (0.98, 1.5, 0.480701),
        (0.999, 1.5, 0.834853),
    ] {
        let slab = Slab { thickness: f32::INFINITY, eta };
        let (r, _) = shares(slab, gray(1.0 - alpha, alpha, 0.0), 100_000 * slow());
        assert!(r.z(exact).abs() < Z, "alpha {alpha}, eta {eta}: {r} against {exact}");
    }
}

#[test]
fn slabs_reflect_and_transmit_as_published() {
    // van de Hulst, tau = 2, alpha 0.9, g 0.75, index-matched: R .09739, T .66096 (five digits).
    let (r, t) = shares(Slab { thickness: 2.0, eta: 1.0 }, gray(0.1, 0.9, 0.75), 400_000 * slow());
    assert!(r.z(0.09739).abs() < Z && t.z(0.66096).abs() < Z, "R {r}, T {t}");
    // Thick conservative slab: T = (H(1)/sqrt 3)/(tau + 1.42089), H(1) = 2.90781.
    let (r, t) = shares(Slab { thickness: 50.0, eta: 1.0 }, gray(0.0, 1.0, 0.0), 100_000 * slow());
    let exact = 2.907_81 / 3f64.sqrt() / (50.0 + 1.420_89);
    assert!(t.z(exact).abs() < Z, "T {t} against {exact}");
    // Energy: R + T = 1 to rounding of the sums, since every weight is one.
    assert!((r.mean + t.mean - 1.0).abs() < 1e-9);
}

#[test]
fn chromatic_walks_agree_with_one_walk_per_wavelength() {
    // Lanes with extinctions 1 : 1.37 : 2 and different albedos: each lane must have its own half-space albedo.
    let alphas = [0.9f32, 0.8, 0.98];
    let exact = [0.414947, 0.285255, 0.671084];
    let sigma_t = [1.0f32, 1.37, 2.0];
    let slab = Slab { thickness: f32::INFINITY, eta: 1.0 };
    let mut sums = [Accumulator::default(); 3];
    for i in 0..200_000 * slow() {
        let mut rng = Stream::new(&[13, i]);
        // Rotate the hero over the lanes, as a renderer does.
        let lane = |k: usize| (k + i as usize) % 3;
        let pick = |f: &dyn Fn(usize) -> f32| Spectrum(std::array::from_fn(|k| f(lane(k))));
        let m = Medium::<3>::new(pick(&|k| sigma_t[k] * (1.0 - alphas[k])), pick(&|k| sigma_t[k] * alphas[k]), 0.0);
        let mut w = Walker::new(Vec3::ZERO, Vec3::Z);
        let out = walk(&slab, &m, &Roulette::default().into(), &mut w, &mut NoTally, &mut rng);
        for k in 0..3 {
            sums[lane(k)].add(if matches!(out, Outcome::Left(_)) { f64::from(w.beta[k]) } else { 0.0 });
        }
    }
    for k in 0..3 {
        let e = sums[k].estimate();
        assert!(e.z(exact[k]).abs() < Z && e.relative_error() < 0.02, "lane {k}: {e} against {}", exact[k]);
    }
}

#[test]
fn light_leaves_an_index_matched_half_space_at_the_angles_of_chandrasekhar() {
    // Emergent radiance per unit flux at normal incidence: L(mu) = alpha H(1) H(mu) / (4 pi (1 + mu)); H by its published values.
    let alpha = 0.9f32;
    let h = |mu: f64| {
        // H for alpha = .9 at 0, .25, .5, .75, 1 (Stibbs & Weir 1959), quartic through them: below 1e-3 between.
        let (x, y) = ([0.0, 0.25, 0.5, 0.75, 1.0], [1.0, 1.343271, 1.556034, 1.719001, 1.850099]);
        (0..5)
            .map(|i| y[i] * (0..5).filter(|&j| j != i).map(|j| (mu - x[j]) / (x[i] - x[j])).product::<f64>())
            .sum::<f64>()
    };
    let slab = Slab { thickness: f32::INFINITY, eta: 1.0 };
    let medium = gray(1.0 - alpha, alpha, 0.0);
    let mut bins = [Accumulator::default(); 4];
    for i in 0..300_000 * slow() {
        let mut rng = Stream::new(&[14, i]);
        let mut w = Walker::new(Vec3::ZERO, Vec3::Z);
        let out = walk(&slab, &medium, &Roulette::default().into(), &mut w, &mut NoTally, &mut rng);
        let bin = ((-w.d.z * 4.0) as usize).min(3);
        for (k, b) in bins.iter_mut().enumerate() {
            b.add(if k == bin && matches!(out, Outcome::Left(_)) { f64::from(w.beta[0]) } else { 0.0 });
        }
    }
    // Skip the most grazing bin, where the quartic for H is poor near mu = 0.
    for (k, bin) in bins.iter().enumerate().skip(1) {
        let n = 1000;
        let exact = (0..n)
            .map(|i| {
                let mu = (k as f64 + (f64::from(i) + 0.5) / f64::from(n)) / 4.0;
                f64::from(alpha) * h(1.0) * h(mu) / (1.0 + mu) * mu / 2.0
            })
            .sum::<f64>()
            / f64::from(n)
            / 4.0;
        let e = bin.estimate();
        assert!((e.mean - exact).abs() < Z * e.std_err + 1e-3 * exact, "bin {k}: {e} against {exact}");
    }
}

/// A layer of (thickness, index, medium).
fn layer(thickness: f32, n: f32, sigma_a: f32, sigma_s: f32, g: f32) -> (f32, f32, Medium<1, HenyeyGreenstein>) {
    (thickness, n, gray(sigma_a, sigma_s, g))
}

/// Shares of entered light that leave a stack in front and behind, at normal incidence.
fn stack_shares<P: PhaseFunction>(stack: &Stack<P>, seed: u64, n: u64) -> (Estimate, Estimate) {
    let (mut front, mut back) = (Accumulator::default(), Accumulator::default());
    for i in 0..n {
        let mut rng = Stream::new(&[seed, i]);
        let mut w = Walker::new(Vec3::ZERO, Vec3::Z);
        let out = walk_stack(stack, 0, &Roulette::default().into(), &mut w, &mut NoTally, &mut rng);
        let beta = f64::from(w.beta[0]);
        front.add(if matches!(out, Outcome::Left(Face::Front)) { beta } else { 0.0 });
        back.add(if matches!(out, Outcome::Left(Face::Back)) { beta } else { 0.0 });
    }
    (front.estimate(), back.estimate())
}

#[test]
fn a_slab_cut_into_layers_reflects_and_transmits_as_before() {
    // van de Hulst's slab again, cut at .1 and .7: index-matched boundaries between equal layers are invisible.
    let m = |t| layer(t, 1.4, 0.1, 0.9, 0.75);
    let stack = Stack::new(1.4, vec![m(0.1), m(0.6), m(1.3)], 1.4);
    let (r, t) = stack_shares(&stack, 15, 400_000 * slow());
    assert!(r.z(0.09739).abs() < Z && t.z(0.66096).abs() < Z, "R {r}, T {t}");
}

#[test]
fn a_clear_pane_reflects_by_its_two_faces() {
    // Of the light that entered, 1 / (1 + r) leaves behind and r / (1 + r) in front, r = ((n - 1) / (n + 1))^2: the series of internal reflections.
    let pane = Stack::new(1.0, vec![layer(1.0, 1.5, 0.0, 0.0, 0.0)], 1.0);
    let (r, t) = stack_shares(&pane, 16, 200_000 * slow());
    assert!(r.z(0.04 / 1.04).abs() < Z && t.z(1.0 / 1.04).abs() < Z, "R {r}, T {t}");
}

/// Splits a path's length over the layers of a stack.
#[derive(Default)]
struct LayerLengths {
    current: usize,
    lengths: [f64; 3],
}

impl<R: Random, P> moonmilk_walk::Tally<1, R, P> for LayerLengths {
    fn flight(&mut self, _walker: &Walker<1>, t: f32) {
        self.lengths[self.current] += f64::from(t);
    }
}

impl<R: Random, P> moonmilk_walk::layers::StackTally<R, P> for LayerLengths {
    fn enter(&mut self, layer: usize) {
        self.current = layer;
    }
}

#[test]
fn light_stays_in_each_layer_for_two_n_squared_thicknesses() {
    // Uniform light on both sides of a stack makes n^2 times its radiance in every layer that scatters: mean path 4 n^2 V / S = 2 n^2 d per
    // ray. The stack is its own mirror image, so that light on one side is enough. Different n, g and sigma_s.
    let (d, n) = ([0.5f32, 0.8, 0.5], [1.5f32, 1.2, 1.5]);
    let stack = Stack::new(
        1.0,
        vec![layer(d[0], n[0], 0.0, 3.0, 0.8), layer(d[1], n[1], 0.0, 1.0, 0.0), layer(d[2], n[2], 0.0, 3.0, 0.8)],
        1.0,
    );
    let mut sums = [Accumulator::default(); 3];
    for i in 0..100_000 * slow() {
        let mut rng = Stream::new(&[17, i]);
        let u = rng.uniform2();
        let (s, c) = moonmilk_walk::math::sin_cos_turn(u[1]);
        let (cos_o, sin_o) = (u[0].sqrt(), (1.0 - u[0]).sqrt());
        let mut tally = LayerLengths::default();
        if let Some(d) = enter(Vec3::new(sin_o * c, sin_o * s, cos_o), Vec3::NEG_Z, n[0], &mut rng) {
            let mut w = Walker::new(Vec3::ZERO, d);
            let out = walk_stack(&stack, 0, &Roulette::default().into(), &mut w, &mut tally, &mut rng);
            assert!(matches!(out, Outcome::Left(_)), "{out:?}");
        }
        // The mirror image: what the front layer sees of light from behind is what the back layer sees of light in front.
        sums[0].add(0.5 * (tally.lengths[0] + tally.lengths[2]));
        sums[1].add(tally.lengths[1]);
        sums[2].add(tally.lengths.iter().sum());
    }
    let exact = |i: usize| 2.0 * f64::from(n[i] * n[i] * d[i]);
    for (sum, exact) in sums.iter().zip([exact(0), exact(1), 2.0 * exact(0) + exact(1)]) {
        let e = sum.estimate();
        assert!(e.z(exact).abs() < Z, "{e} against {exact}");
    }
}

#[test]
fn a_law_known_to_the_compiler_walks_as_one_known_at_run_time() {
    // The same random numbers, the same directions: equal to the bit.
    let slab = Slab { thickness: f32::INFINITY, eta: 1.33 };
    let fixed = Medium::with_law(Spectrum([0.1]), Spectrum([0.9]), Isotropic);
    for i in 0..1000 {
        let mut walkers = [Walker::new(Vec3::ZERO, Vec3::Z); 2];
        let limits = Roulette::default().into();
        let mut rng = Stream::new(&[18, i]);
        walk(&slab, &fixed, &limits, &mut walkers[0], &mut NoTally, &mut rng);
        let mut rng = Stream::new(&[18, i]);
        walk(&slab, &gray(0.1, 0.9, 0.0), &limits, &mut walkers[1], &mut NoTally, &mut rng);
        assert_eq!(
            (walkers[0].p, walkers[0].beta, walkers[0].collisions),
            (walkers[1].p, walkers[1].beta, walkers[1].collisions)
        );
    }
}
