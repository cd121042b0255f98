//! The walk through fields against exact results: path lengths, equality with homogeneous media, transmittances, emission.
//!
//! Significance: each comparison accepts 4.9 standard errors (1e-6 two-sided); a failure is a bug, seeds are fixed.
//! Precision: stated per test; with `MOONMILK_SLOW=1` sample numbers grow sixteenfold.

use moonmilk_core::estimate::Accumulator;
use moonmilk_core::{Estimate, Mat4, Random, Spectrum, Stream, Vec3};
use moonmilk_walk::domain::ball::Ball;
use moonmilk_walk::domain::planar::{Face, Slab};
use moonmilk_walk::field::{Field, Grid, Majorants};
use moonmilk_walk::heterogeneous::{self, transmittance};
use moonmilk_walk::{Medium, NoTally, Outcome, PathLength, Roulette, Tally, Walker};

const Z: f64 = 4.9;

fn slow() -> u64 {
    if std::env::var_os("MOONMILK_SLOW").is_some() { 16 } else { 1 }
}

/// Densities in a box times coefficients.
struct Densities<const N: usize> {
    grid: Grid<f32>,
    majorants: Majorants,
    to_unit: Mat4,
    sigma_a: Spectrum<N>,
    sigma_s: Spectrum<N>,
    g: f32,
    radiance: f32,
}

impl<const N: usize> Densities<N> {
    fn new(grid: Grid<f32>, from: Vec3, to: Vec3, sigma_a: [f32; N], sigma_s: [f32; N], g: f32) -> Self {
        let to_unit = (Mat4::from_translation(from) * Mat4::from_scale(to - from)).inverse();
        let [sigma_a, sigma_s] = [sigma_a, sigma_s].map(Spectrum);
        let most = (sigma_a + sigma_s).max_value();
        let majorants = Majorants::of_voxels(grid.size(), |i| grid.values()[i], most, &to_unit);
        Self { grid, majorants, to_unit, sigma_a, sigma_s, g, radiance: 0.0 }
    }

    fn glowing(mut self, radiance: f32) -> Self {
        self.radiance = radiance;
        self
    }
}

impl<const N: usize> Field<N> for Densities<N> {
    fn majorants(&self) -> (&Majorants, f32) {
        (&self.majorants, (self.sigma_a + self.sigma_s).max_value())
    }
    fn at<R: Random>(&self, p: Vec3, rng: &mut R) -> (Spectrum<N>, Spectrum<N>) {
        let density = self.grid.pick(self.to_unit.transform_point3(p), rng).copied().unwrap_or(0.0);
        (self.sigma_a * density, self.sigma_s * density)
    }
    fn scatters(&self) -> bool {
        !self.sigma_s.is_black()
    }
    fn emits(&self) -> bool {
        self.radiance > 0.0
    }
    fn emission(&self, _p: Vec3) -> Spectrum<N> {
        Spectrum::splat(self.radiance)
    }
    fn local(&self, sigma_a: Spectrum<N>, sigma_s: Spectrum<N>) -> Medium<N> {
        Medium::new(sigma_a, sigma_s, self.g)
    }
}

/// Returns n^3 densities.
fn cube(n: u32, mut f: impl FnMut(Vec3) -> f32) -> Grid<f32> {
    let center = |i: u32| (i as f32 + 0.5) / n as f32;
    let mut values = Vec::new();
    for z in 0..n {
        for y in 0..n {
            for x in 0..n {
                values.push(f(Vec3::new(center(x), center(y), center(z))));
            }
        }
    }
    Grid::new([n; 3], values).expect("n^3 values")
}

/// Returns one of the kinds of densities that samplers get wrong.
fn density(kind: &str) -> Grid<f32> {
    let mut rng = Stream::new(&[7]);
    match kind {
        "constant" => cube(8, |_| 1.0),
        "ramp" => cube(16, |u| 2.0 * u.z),
        // Half of the space is empty, majorants and all.
        "half empty" => cube(16, |u| if u.x < 0.5 { 0.0 } else { 2.0 }),
        // One voxel in a hundred is 1e4 times as dense as the rest.
        "peaked" => cube(20, |_| if rng.uniform() < 0.01 { 50.0 } else { 0.005 }),
        "noise" => cube(9, |_| 2.0 * rng.uniform()),
        _ => unreachable!("no such density"),
    }
}

/// Returns a point of uniform light on the unit ball and its direction inside, or `None` if Fresnel reflects it.
fn enter(eta: f32, rng: &mut Stream) -> Option<(Vec3, Vec3)> {
    let [a, b] = [rng.uniform2(), rng.uniform2()];
    let n = moonmilk_walk::math::uniform_sphere(a);
    let (s, c) = moonmilk_walk::math::sin_cos_turn(b[1]);
    let (cos_o, sin_o) = (b[0].sqrt(), (1.0 - b[0]).sqrt());
    let d = moonmilk_core::Frame::new(-n).to_world(Vec3::new(sin_o * c, sin_o * s, cos_o));
    let cos_i = (1.0 - (1.0 - cos_o * cos_o) / (eta * eta)).sqrt();
    let r_s = (cos_o - eta * cos_i) / (cos_o + eta * cos_i);
    let r_p = (eta * cos_o - cos_i) / (eta * cos_o + cos_i);
    let f = 0.5 * (r_s * r_s + r_p * r_p);
    (rng.uniform() >= f).then(|| (n, (d / eta + n * (cos_o / eta - cos_i)).normalize()))
}

#[test]
fn mean_path_length_is_four_eta_squared_v_over_s_whatever_the_densities() {
    // Precision: .2 to .6 %; slow: a quarter of that.
    let cases = [
        ("constant", 3.0, 0.0, 1.5),
        ("ramp", 10.0, 0.7, 1.0),
        ("half empty", 5.0, 0.0, 1.33),
        ("half empty", 30.0, 0.9, 1.5),
        ("peaked", 4.0, 0.0, 1.0),
        ("peaked", 4.0, -0.5, 1.5),
        ("noise", 1.0, 0.95, 2.0),
        ("noise", 20.0, -0.3, 1.33),
    ];
    for (case, (kind, sigma_s, g, eta)) in cases.into_iter().enumerate() {
        let box_ = Vec3::splat(1.1);
        let field = Densities::<1>::new(density(kind), -box_, box_, [0.0], [sigma_s], g);
        let ball = Ball { radius: 1.0, eta };
        let mut sum = Accumulator::default();
        for i in 0..30_000 * slow() {
            let mut rng = Stream::new(&[21, case as u64, i]);
            let mut length = PathLength::default();
            if let Some((p, d)) = enter(eta, &mut rng) {
                let mut w = Walker::new(p, d);
                let out =
                    heterogeneous::walk(&ball, &field, &Roulette::default().into(), &mut w, &mut length, &mut rng);
                assert!(matches!(out, Outcome::Left(Some(()))), "{out:?}");
                // Rounding of sigma_s / sigma_t at up to thousands of collisions.
                assert!((w.beta[0] - 1.0).abs() < 1e-4, "a conservative walk keeps its weight: {}", w.beta[0]);
            }
            sum.add(length.0);
        }
        let (e, exact) = (sum.estimate(), f64::from(eta * eta) * 4.0 / 3.0);
        println!("{kind}, sigma_s {sigma_s}, g {g}, eta {eta}: {e}, exact {exact:.5}, z {:+.2}", e.z(exact));
        assert!(e.z(exact).abs() < Z, "{kind}, sigma_s {sigma_s}, g {g}, eta {eta}: {e} against {exact}");
    }
}

/// Returns the weights with which chromatic light leaves a slab at the front and the back, lane by lane.
fn shares(
    n: u64,
    seed: u64,
    mut walk: impl FnMut([usize; 3], &mut Walker<3>, &mut Stream) -> Option<Face>,
) -> [Estimate; 6] {
    let mut sums = [Accumulator::default(); 6];
    for i in 0..n {
        let mut rng = Stream::new(&[seed, i]);
        // Rotate the hero over the lanes, as a renderer does.
        let lanes: [usize; 3] = std::array::from_fn(|k| (k + i as usize) % 3);
        let mut w = Walker::new(Vec3::ZERO, Vec3::Z);
        let face = walk(lanes, &mut w, &mut rng);
        for (k, &lane) in lanes.iter().enumerate() {
            let weight = |at| if face == Some(at) { f64::from(w.beta[k]) } else { 0.0 };
            sums[2 * lane].add(weight(Face::Front));
            sums[2 * lane + 1].add(weight(Face::Back));
        }
    }
    sums.map(|s| s.estimate())
}

#[test]
fn constant_densities_are_homogeneous_media_in_every_lane() {
    // Extinctions 1 : 1.37 : 4 and different albedos; the slab is thinner than the grid, whose edges fall off.
    let (sigma_a, sigma_s, g) = ([0.1f32, 0.2, 0.4], [0.9f32, 1.17, 3.6], 0.5);
    let slab = Slab { thickness: 2.0, eta: 1.3 };
    let n = 60_000 * slow();
    let homogeneous = shares(n, 22, |lanes, w, rng| {
        let m = Medium::<3>::new(Spectrum(lanes.map(|l| sigma_a[l])), Spectrum(lanes.map(|l| sigma_s[l])), g);
        match moonmilk_walk::walk(&slab, &m, &Roulette::default().into(), w, &mut NoTally, rng) {
            Outcome::Left(face) => Some(face),
            _ => None,
        }
    });
    let (from, to) = (Vec3::new(-500.0, -500.0, -2.0), Vec3::new(500.0, 500.0, 4.0));
    let fields: [Densities<3>; 3] = std::array::from_fn(|first| {
        let lane = |k: usize| (k + first) % 3;
        let pick = |s: [f32; 3]| std::array::from_fn(|k| s[lane(k)]);
        Densities::new(cube(8, |_| 1.0), from, to, pick(sigma_a), pick(sigma_s), g)
    });
    let field = shares(n, 23, |lanes, w, rng| {
        match heterogeneous::walk(&slab, &fields[lanes[0]], &Roulette::default().into(), w, &mut NoTally, rng) {
            Outcome::Left(Some(face)) => Some(face),
            _ => None,
        }
    });
    for (k, (a, b)) in homogeneous.iter().zip(&field).enumerate() {
        println!("lane {}, face {}: homogeneous {a}, field {b}, z {:+.2}", k / 2, k % 2, a.z_against(b));
        assert!(a.z_against(b).abs() < Z, "lane {}, face {}: {a} against {b}", k / 2, k % 2);
    }
}

#[test]
fn one_wavelength_alone_agrees_with_itself_among_others_in_noise() {
    // Lanes of one walk through random densities against one walk per lane.
    let (sigma_a, sigma_s, g) = ([0.05f32, 0.2, 0.02], [0.5f32, 1.3, 3.0], -0.3);
    let slab = Slab { thickness: 1.5, eta: 1.0 };
    let (from, to) = (Vec3::new(-20.0, -20.0, -0.3), Vec3::new(20.0, 20.0, 1.6));
    let grid = || {
        let mut rng = Stream::new(&[8]);
        Grid::new([12, 12, 7], (0..12 * 12 * 7).map(|_| 3.0 * rng.uniform() * rng.uniform()).collect())
            .expect("sizes agree")
    };
    let n = 60_000 * slow();
    let fields: [Densities<3>; 3] = std::array::from_fn(|first| {
        let pick = |s: [f32; 3]| std::array::from_fn(|k| s[(k + first) % 3]);
        Densities::new(grid(), from, to, pick(sigma_a), pick(sigma_s), g)
    });
    let together = shares(n, 24, |lanes, w, rng| {
        match heterogeneous::walk(&slab, &fields[lanes[0]], &Roulette::default().into(), w, &mut NoTally, rng) {
            Outcome::Left(Some(face)) => Some(face),
            _ => None,
        }
    });
    for lane in 0..3 {
        let field = Densities::<1>::new(grid(), from, to, [sigma_a[lane]], [sigma_s[lane]], g);
        let mut sums = [Accumulator::default(); 2];
        for i in 0..n {
            let mut rng = Stream::new(&[25, i]);
            let mut w = Walker::new(Vec3::ZERO, Vec3::Z);
            let out = heterogeneous::walk(&slab, &field, &Roulette::default().into(), &mut w, &mut NoTally, &mut rng);
            let weight = |at| if matches!(out, Outcome::Left(Some(f)) if f == at) { f64::from(w.beta[0]) } else { 0.0 };
            sums[0].add(weight(Face::Front));
            sums[1].add(weight(Face::Back));
        }
        for k in 0..2 {
            let (a, b) = (sums[k].estimate(), together[2 * lane + k]);
            println!("lane {lane}, face {k}: alone {a}, together {b}, z {:+.2}", a.z_against(&b));
            assert!(a.z_against(&b).abs() < Z, "lane {lane}, face {k}: {a} against {b}");
        }
    }
}

/// Returns the integral of a linear density 2 u_z along a way through the ramp's box, where no face interferes.
fn ramp_depth(p: Vec3, d: Vec3, distance: f32, to_unit: &Mat4) -> f64 {
    let z = |t: f32| 2.0 * f64::from(to_unit.transform_point3(p + d * t).z);
    0.5 * (z(0.0) + z(distance)) * f64::from(distance)
}

#[test]
fn ratio_tracking_has_the_transmittance_of_a_linear_ramp_in_every_lane() {
    let (sigma_a, sigma_s) = ([0.1f32, 0.5, 1.0], [0.2f32, 0.6, 1.2]);
    let from = Vec3::new(-3.0, -3.0, -3.0);
    let field = Densities::<3>::new(density("ramp"), from, -from, sigma_a, sigma_s, 0.0);
    let p = Vec3::new(-1.5, 0.3, -2.0);
    for (d, distance) in [(Vec3::new(0.3, 0.1, 0.9), 1.0f32), (Vec3::new(0.6, -0.2, 0.7), 3.0), (Vec3::X, 2.0)] {
        let d = d.normalize();
        let depth = ramp_depth(p, d, distance, &field.to_unit);
        let mut sums = [Accumulator::default(); 3];
        for i in 0..100_000 * slow() {
            let mut rng = Stream::new(&[26, i]);
            let t = transmittance(&field, p, d, distance, 1.0, &Roulette::default(), &mut rng);
            for (s, x) in sums.iter_mut().zip(t.transmittance.0) {
                s.add(f64::from(x * t.survival));
            }
        }
        for k in 0..3 {
            let (e, exact) = (sums[k].estimate(), (-depth * f64::from(sigma_a[k] + sigma_s[k])).exp());
            println!("lane {k}, distance {distance}: {e}, exact {exact:.6}, z {:+.2}", e.z(exact));
            // Interpolation of a linear function is exact to rounding, 1e-5.
            assert!((e.mean - exact).abs() < Z * e.std_err + 1e-5 * exact, "lane {k}: {e} against {exact}");
        }
    }
}

#[test]
fn ratio_tracking_agrees_with_quadrature_through_peaks_and_voids() {
    for kind in ["half empty", "peaked", "noise"] {
        let from = Vec3::splat(-1.0);
        let field = Densities::<1>::new(density(kind), from, -from, [0.7], [0.3], 0.0);
        let (p, d) = (Vec3::new(-3.0, -1.4, -2.2), Vec3::new(0.7, 0.33, 0.55).normalize());
        // Midpoint rule with 1e6 points; the density is continuous, its kinks at 60 voxel faces: below 1e-9.
        let n = 1_000_000;
        let at = |i: u32| p + d * (7.0 * (i as f32 + 0.5) / n as f32);
        let inside = |u: Vec3| u.cmpge(Vec3::ZERO).all() && u.cmple(Vec3::ONE).all();
        let density = |u: Vec3| if inside(u) { f64::from(field.grid.interpolate(u)) } else { 0.0 };
        let depth = (0..n).map(|i| density(field.to_unit.transform_point3(at(i)))).sum::<f64>() * 7.0 / f64::from(n);
        let mut sum = Accumulator::default();
        for i in 0..200_000 * slow() {
            let mut rng = Stream::new(&[27, i]);
            let t = transmittance(&field, p, d, f32::INFINITY, 1.0, &Roulette::default(), &mut rng);
            sum.add(f64::from(t.transmittance[0] * t.survival));
        }
        let (e, exact) = (sum.estimate(), (-depth).exp());
        println!("{kind}: {e}, exact {exact:.6}, z {:+.2}", e.z(exact));
        assert!(e.relative_error() < 0.02 && e.z(exact).abs() < Z, "{kind}: {e} against {exact}");
    }
}

/// Sums what is emitted.
#[derive(Default)]
struct Glow(f64);

impl<R: Random> Tally<1, R> for Glow {
    fn emission(&mut self, _walker: &Walker<1>, radiance: Spectrum<1>) {
        self.0 += f64::from(radiance[0]);
    }
}

#[test]
fn an_isothermal_slab_shines_with_its_emissivity() {
    // L = B (1 - exp(-tau)) along z, tau by the midpoint rule over 1e5 points: its error is below 1e-9.
    let (from, to) = (Vec3::new(-50.0, -50.0, 0.0), Vec3::new(50.0, 50.0, 1.0));
    for (kind, sigma) in [("ramp", 0.4f32), ("ramp", 3.0), ("noise", 1.0)] {
        let field = Densities::<1>::new(density(kind), from, to, [sigma], [0.0], 0.0).glowing(2.5);
        let p = Vec3::new(3.0, 2.0, 0.0);
        let n = 100_000;
        let at = |i: u32| field.to_unit.transform_point3(p + Vec3::Z * ((i as f32 + 0.5) / n as f32));
        let depth = (0..n).map(|i| f64::from(field.grid.interpolate(at(i)))).sum::<f64>() / f64::from(n);
        let exact = 2.5 * (1.0 - (-depth * f64::from(sigma)).exp());
        let slab = Slab { thickness: 1.0, eta: 1.0 };
        let mut sum = Accumulator::default();
        for i in 0..100_000 * slow() {
            let mut rng = Stream::new(&[28, i]);
            let mut glow = Glow::default();
            let mut w = Walker::new(p, Vec3::Z);
            heterogeneous::walk(&slab, &field, &Roulette::default().into(), &mut w, &mut glow, &mut rng);
            sum.add(glow.0);
        }
        let e = sum.estimate();
        println!("{kind}, sigma {sigma}: {e}, exact {exact:.6}, z {:+.2}", e.z(exact));
        assert!(e.z(exact).abs() < Z, "{kind}, sigma {sigma}: {e} against {exact}");
    }
}

#[test]
fn what_flies_past_all_matter_comes_back_as_such() {
    // A box of fog in front of nothing at all: a half-space domain whose wall lies behind.
    let field = Densities::<1>::new(cube(4, |_| 1.0), Vec3::splat(1.0), Vec3::splat(2.0), [0.0], [1.0], 0.0);
    let open = Slab { thickness: f32::INFINITY, eta: 1.0 };
    let mut rng = Stream::new(&[29]);
    let mut beyond = 0;
    for _ in 0..1000 {
        let mut w = Walker::new(Vec3::new(1.5, 1.5, 0.0), Vec3::Z);
        match heterogeneous::walk(&open, &field, &Roulette::default().into(), &mut w, &mut NoTally, &mut rng) {
            Outcome::Left(None) => beyond += 1,
            Outcome::Left(Some(face)) => assert_eq!(face, Face::Front),
            other => panic!("{other:?}"),
        }
    }
    assert!((500..1000).contains(&beyond), "{beyond}");
}
