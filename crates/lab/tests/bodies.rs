//! Bodies given as meshes: theorems, and slabs against plane layers.

use moonmilk_core::stats::{sidak, t_test};
use moonmilk_core::{Estimate, Vec3};
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_geometry::{Mesh, Shape};
use moonmilk_lab::bodies::{Bodies, BodySpec, DetectorSpec, Grids, Light};
use moonmilk_lab::{Error, Experiment, Law, LayerSpec, Results, Source, bodies, run};

/// Paths, and comparisons of this file, for significances after Sidak.
const PHOTONS: u64 = 60_000;
const COMPARISONS: usize = 40;

fn body(name: &str, shape: impl Into<Shape>, n: f64, sigma_a: f64, sigma_s: f64, g: f64) -> BodySpec {
    BodySpec { name: name.into(), shape: shape.into(), n, sigma_a, sigma_s, g }
}

fn simulate(e: &Bodies) -> Results {
    let r = bodies::run(e).expect("a valid experiment");
    assert_eq!(r.lost, 0);
    let value = |name: &str| r.scalar(name).expect(name).mean;
    // Light is accounted for, roulette keeps the mean only: three standard errors of its parts, added.
    let mut parts: Vec<&str> = vec!["missed", "escaped", "absorbed", "unfinished"];
    parts.extend(r.scalars.iter().map(|s| s.name.as_str()).filter(|n| n.starts_with("detected.")));
    let error: f64 = parts.iter().map(|n| r.scalar(n).expect(n).std_err).sum();
    let sum: f64 = parts.iter().map(|n| value(n)).sum();
    assert!((sum - 1.0).abs() < 3.0 * error + 1e-9, "{sum} {error}");
    r
}

/// Checks two independent estimates against each other; 63 degrees of freedom at least.
fn agree(a: Estimate, b: Estimate, what: &str) {
    assert!(t_test(a.z_against(&b), 63.0) > sidak(1e-4, COMPARISONS), "{what}: {a} against {b}");
}

fn exactly(mean: f64) -> Estimate {
    Estimate { mean, std_err: 0.0, n: 1 }
}

/// Moves a mesh.
fn moved(m: &Mesh, by: Vec3) -> Mesh {
    m.transformed(&moonmilk_core::Mat4::from_translation(by)).expect("a mesh")
}

#[test]
fn paths_have_the_mean_length_4_eta2_v_over_s() {
    let stone = bumpy_sphere(3, 0.4);
    let slab = cuboid(Vec3::new(-2.0, -1.0, -0.2), Vec3::new(2.0, 1.0, 0.2));
    for (mesh, n, sigma_s, g) in [
        (stone.clone(), 1.0, 5.0, 0.0),
        (stone, 1.5, 8.0, 0.8),
        (slab.clone(), 1.33, 2.0, 0.5),
        (slab, 0.8, 10.0, -0.3),
    ] {
        let exact = 4.0 * n * n * mesh.volume() / mesh.area();
        let mut e = Bodies::new(vec![body("b", mesh, n, 0.0, sigma_s, g)], Light::Uniform);
        e.photons = PHOTONS;
        let r = simulate(&e);
        let (path, incident) = (r.scalar("path.b").unwrap(), r.scalar("incident.b").unwrap());
        // The ratio's error: that of the path alone is larger by what both share.
        let ratio = Estimate { mean: path.mean / incident.mean, std_err: path.std_err / incident.mean, n: path.n };
        assert!(ratio.relative_error() < 0.02);
        agree(ratio, exactly(exact), &format!("n {n}, g {g}"));
        // What absorbs nothing keeps nothing.
        assert_eq!(r.scalar("absorbed").unwrap().mean, 0.0);
    }
}

#[test]
fn a_wide_box_is_a_plane_layer() {
    // 200 mean free paths wide, so that nothing leaves through the rim (e^-30 of the light).
    for (n, g) in [(1.0f64, 0.0), (1.4, 0.7)] {
        let (sigma_a, sigma_s) = (0.3, 2.0 / (1.0 - g));
        let slab = cuboid(Vec3::new(-80.0, -80.0, 0.0), Vec3::new(80.0, 80.0, 1.0));
        let lid = |z: f32| cuboid(Vec3::new(-90.0, -90.0, z), Vec3::new(90.0, 90.0, z + 1.0));
        let light = Light::beam(Vec3::new(0.3, 0.2, -2.0), Vec3::Z);
        let mut e = Bodies::new(vec![body("slab", slab, n, sigma_a, sigma_s, g)], light);
        e.detectors = vec![
            DetectorSpec { name: "below".into(), shape: lid(-4.0).into() },
            DetectorSpec { name: "above".into(), shape: lid(3.0).into() },
        ];
        e.photons = PHOTONS;
        e.grids = Grids { fluence: Some(160), absorption: Some(160) };
        let r = simulate(&e);
        let layer = LayerSpec {
            name: "slab".into(),
            thickness: 1.0,
            n,
            sigma_a,
            sigma_s,
            law: Law::HenyeyGreenstein(g as f32),
        };
        let mut plane = Experiment::new(vec![layer], Source::Pencil { angle: 0.0 });
        plane.photons = PHOTONS;
        plane.seed = 77;
        let p = run(&plane).unwrap();
        let both = |a: &str, b: &str| {
            let (a, b) = (p.scalar(a).unwrap(), p.scalar(b).unwrap());
            Estimate { mean: a.mean + b.mean, std_err: a.std_err.hypot(b.std_err), n: a.n }
        };
        agree(r.scalar("detected.below").unwrap(), both("reflected", "specular"), "reflected");
        agree(r.scalar("detected.above").unwrap(), both("transmitted", "ballistic"), "transmitted");
        agree(r.scalar("absorbed.slab").unwrap(), p.scalar("absorbed").unwrap(), "absorbed");
        agree(r.scalar("absorbed_track.slab").unwrap(), p.scalar("absorbed_track.slab").unwrap(), "by track length");
        // Grids add up to the totals, to rounding of a million additions.
        let total = |name: &str| {
            let g = r.grid(name).unwrap();
            g.cells.iter().map(|c| c.mean).sum::<f64>() + g.outside.mean
        };
        assert!((total("absorption_xyz") / r.scalar("absorbed.slab").unwrap().mean - 1.0).abs() < 1e-9);
        assert!((total("fluence_xyz") / r.scalar("path.slab").unwrap().mean - 1.0).abs() < 1e-9);
        assert!(r.grid("fluence_xyz").unwrap().outside.mean < 1e-3);
    }
}

#[test]
fn points_inside_shine_evenly_and_bodies_shade_one_another() {
    // A point in the middle of a matched ball without scattering: what is absorbed is 1 - e^(-sigma_a r) of a sphere's mean.
    let ball = bumpy_sphere(5, 0.0);
    let mut e = Bodies::new(vec![body("ball", ball.clone(), 1.0, 0.7, 0.0, 0.0)], Light::point(Vec3::ZERO));
    e.photons = PHOTONS;
    let r = simulate(&e);
    // The mesh's radius lies between those of the spheres about and within it.
    let radius = ball.volume() * 3.0 / ball.area();
    let track = r.scalar("absorbed_track.ball").unwrap();
    let collided = r.scalar("absorbed.ball").unwrap();
    let exact = 1.0 - (-0.7 * radius).exp();
    assert!((collided.mean - exact).abs() < 5.0 * collided.std_err + 1e-3, "{collided} {exact}");
    agree(track, Estimate { n: 1, ..collided }, "both estimators");

    // Two balls in a row under parallel light: the second, of the same size, gets nothing but what the first scatters.
    let far = moved(&ball, Vec3::new(0.0, 0.0, 10.0));
    let black = |name: &str, m: &Mesh| body(name, m.clone(), 1.0, 50.0, 0.0, 0.0);
    let mut e = Bodies::new(vec![black("near", &ball), black("far", &far)], Light::Parallel { direction: Vec3::Z });
    e.photons = PHOTONS;
    let r = simulate(&e);
    let radius = r.scalar("radius").unwrap().mean;
    let near = r.scalar("incident.near").unwrap();
    // Cross section of the mesh over that of the ball around everything: within .5 % of a circle's.
    assert!((near.mean * radius * radius - 1.0).abs() < 5.0 * near.std_err * radius * radius + 5e-3, "{near} {radius}");
    assert!(r.scalar("incident.far").unwrap().mean < 1e-3 && near.mean > 0.02);
    assert!(r.scalar("absorbed.near").unwrap().mean > 0.99 * near.mean);
}

#[test]
fn meshes_shine_on_bodies_and_take_what_comes_back() {
    // Two parallel unit squares at the distance 1: a share of .199825 of the light of one meets the other (Howell's catalogue, C-11).
    let square = |z: f32, up: bool| {
        let p = vec![Vec3::new(0.0, 0.0, z), Vec3::new(1.0, 0.0, z), Vec3::new(1.0, 1.0, z), Vec3::new(0.0, 1.0, z)];
        let faces = if up { vec![[0, 1, 2], [0, 2, 3]] } else { vec![[0, 2, 1], [0, 3, 2]] };
        Shape::from(Mesh::new(p, vec![], vec![], faces).unwrap())
    };
    let far = body("b", moved(&bumpy_sphere(2, 0.0), Vec3::new(0.5, 0.5, -30.0)), 1.0, 50.0, 0.0, 0.0);
    for (two_sided, share) in [(false, 1.0), (true, 0.5)] {
        let mut e = Bodies::new(vec![far.clone()], Light::Surface { detector: 0, two_sided });
        let detector = |name: &str, shape| DetectorSpec { name: name.into(), shape };
        e.detectors = vec![detector("lamp", square(0.0, true)), detector("screen", square(1.0, false))];
        e.photons = PHOTONS;
        let r = simulate(&e);
        agree(r.scalar("detected.screen").unwrap(), exactly(0.199825 * share), "two squares");
        // No light meets the flat square that it comes from.
        assert_eq!(r.scalar("detected.lamp").unwrap().mean, 0.0);
        assert_eq!(r.scalar("incident.b").unwrap().mean > 0.0, two_sided);
    }
    // A wall of a milky box takes back what the box returns.
    let milk = body("milk", cuboid(Vec3::new(-1.0, -1.0, -2.0), Vec3::new(2.0, 2.0, -0.5)), 1.0, 0.01, 20.0, 0.0);
    let mut e = Bodies::new(vec![milk], Light::Surface { detector: 0, two_sided: false });
    e.detectors = vec![DetectorSpec { name: "lamp".into(), shape: square(0.0, false) }];
    e.photons = 4000;
    assert!(simulate(&e).scalar("detected.lamp").unwrap().mean > 0.05);
    e.light = Light::Surface { detector: 1, two_sided: false };
    assert!(bodies::run(&e).is_err());
}

#[test]
fn the_result_does_not_depend_on_threads_and_beams_stay_narrow() {
    let mut e = Bodies::new(vec![body("b", bumpy_sphere(3, 0.2), 1.3, 0.1, 4.0, 0.5)], Light::Uniform);
    e.photons = 4000;
    e.grids.fluence = Some(8);
    let on = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| bodies::run(&e).unwrap());
    assert_eq!(on(1), on(3));
    let cone = Light::Point { at: Vec3::new(0.0, 0.0, -5.0), axis: Vec3::Z, cosines: (0.9999, 0.999) };
    let mut e = Bodies::new(vec![body("b", bumpy_sphere(3, 0.0), 1.0, 1.0, 0.0, 0.0)], cone);
    e.photons = 4000;
    assert_eq!(simulate(&e).scalar("missed").unwrap().mean, 0.0);
}

#[test]
fn what_cannot_be_simulated_is_refused() {
    let ball = bumpy_sphere(2, 0.0);
    let good = || body("b", ball.clone(), 1.3, 0.1, 1.0, 0.0);
    let refused = |b: Vec<BodySpec>, light| {
        let mut e = Bodies::new(b, light);
        e.photons = 2000;
        bodies::run(&e).expect_err("refused")
    };
    assert_eq!(refused(vec![], Light::Uniform), Error::NoBodies);
    let inverted = body("b", Shape::from(ball.clone()).reversed(), 1.3, 0.1, 1.0, 0.0);
    assert!(matches!(refused(vec![inverted], Light::Uniform), Error::InsideOut { .. }));
    let triangle = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![], vec![], vec![[0, 1, 2]]).unwrap();
    assert!(matches!(refused(vec![body("b", triangle, 1.0, 0.1, 1.0, 0.0)], Light::Uniform), Error::Open { .. }));
    let beside = body("c", moved(&ball, Vec3::X), 1.3, 0.1, 1.0, 0.0);
    assert!(matches!(refused(vec![good(), beside], Light::Uniform), Error::Overlap { .. }));
    let clear = body("b", ball.clone(), 1.5, 0.0, 0.0, 0.0);
    assert!(matches!(refused(vec![clear], Light::point(Vec3::ZERO)), Error::Trapped { .. }));
    for (what, b) in [("n", (-1.0, 0.1, 1.0, 0.0)), ("sigma_a", (1.0, -0.1, 1.0, 0.0)), ("g", (1.0, 0.1, 1.0, 1.0))] {
        let e = refused(vec![body("b", ball.clone(), b.0, b.1, b.2, b.3)], Light::Uniform);
        assert!(e.to_string().starts_with(&format!("b: {what} = ")), "{e}");
    }
}
