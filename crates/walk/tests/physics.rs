//! The walk against exact results: path lengths, half-spaces, slabs, angular emission.
//!
//! Significance: each comparison accepts 4.9 standard errors (1e-6 two-sided); a failure is a bug, seeds are fixed.
//! Precision: stated per test; with `MOONMILK_SLOW=1` sample numbers grow sixteenfold.

use moonmilk_core::estimate::Accumulator;
use moonmilk_core::{Estimate, Random, Spectrum, Stream, Vec3};
use moonmilk_walk::domain::ball::Ball;
use moonmilk_walk::domain::planar::{Face, Slab};
use moonmilk_walk::{Medium, NoTally, Outcome, PathLength, Roulette, Walker, walk};

const Z: f64 = 4.9;

fn slow() -> u64 {
    if std::env::var_os("MOONMILK_SLOW").is_some() { 16 } else { 1 }
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

/// Mean path length per incident ray under uniform light on a ball of radius 1.
fn path_length(eta: f32, sigma_s: f32, g: f32, n: u64) -> Estimate {
    let (ball, medium) = (Ball { radius: 1.0, eta }, gray(0.0, sigma_s, g));
    let mut sum = Accumulator::default();
    for i in 0..n {
        let mut rng = Stream::new(&[11, i]);
        // Cosine-distributed light at the north pole stands for uniform light everywhere, by symmetry.
        let u = rng.uniform2();
        let (s, c) = moonmilk_walk::math::sin_cos_turn(u[1]);
        let (cos_o, sin_o) = (u[0].sqrt(), (1.0 - u[0]).sqrt());
        let d = Vec3::new(sin_o * c, sin_o * s, -cos_o);
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
