//! The white furnace: under uniform light nothing that does not absorb can be seen.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};

use moonmilk_core::{Vec2, Vec3, WavelengthMode};
use moonmilk_geometry::Ray;
use moonmilk_render::description::{GeometryDescription, HairAbsorption, MaterialKind};
use moonmilk_render::film::Film;
use moonmilk_render::session;

use crate::bodies::{Body, shells};
use crate::common::{KEEP_ALL, Tracer, World, assert_exact, measure, rgb, samples, uniform_ray};

/// Single-precision rounding of the weights along a path; without it the radiance is 1.
pub const ROUNDING: f64 = 1e-5;

/// Asserts that every single path finds radiance 1, roulette apart.
pub fn assert_white(what: &str, mut tracer: Tracer, reach: f32, n: u64) {
    tracer.keep_all();
    let [off] = measure(n, |i| {
        let (o, d) = uniform_ray(21, i, reach);
        let l = tracer.radiance(i, o, d);
        assert!((l - 1.0).abs() < ROUNDING, "{what}: path {i} finds {l}");
        [(l - 1.0).abs()]
    });
    let c = tracer.assert_sound();
    println!("{what}: {n} paths, {} collisions, mean deviation {:.1e}", c.collisions, off.mean);
    // What has entered has left again.
    assert!(c.collisions > 0 && c.entered > 0 && c.entered == c.left && c.ended_inside == 0, "{what}: {c:?}");
}

#[test]
fn every_single_path_finds_white_behind_a_refractive_boundary() {
    // Light is found by chance alone here, with weights that sum to one: each path is exact, not only their mean.
    for body in Body::all() {
        for (tau, g, eta) in [(0.01, -0.5, 1.33), (1.0, 0.0, 1.5), (10.0, 0.95, 2.0), (100.0, 0.5, 1.33)] {
            let what = format!("{}, {tau} mean free paths, g {g}, eta {eta}", body.name);
            let tracer = body.world(tau, g, eta).environment(1.0).tracer();
            assert_white(&what, tracer, body.reach, samples(if tau < 50.0 { 20_000 } else { 4000 }, 4));
        }
    }
}

#[test]
fn every_single_path_finds_white_at_a_thousand_mean_free_paths() {
    let ball = Body::ball();
    assert_white("dense ball", ball.world(1000.0, 0.0, 1.5).environment(1.0).tracer(), ball.reach, samples(2000, 8));
    let smooth = Body::smooth();
    assert_white(
        "dense mesh",
        smooth.world(1000.0, 0.95, 1.33).environment(1.0).tracer(),
        smooth.reach,
        samples(2000, 8),
    );
}

#[test]
fn every_single_path_finds_white_behind_a_boundary_with_a_map() {
    // Displacements of noise with slopes up to about 1: normals far from the face's.
    for body in [Body::ball(), Body::smooth(), Body::bumpy()] {
        let mut world = body.world(2.0, 0.5, 1.5).environment(1.0);
        world.displace_all(0.5);
        assert_white(&format!("{} with a map", body.name), world.tracer(), body.reach, samples(20_000, 8));
    }
}

/// A tube around x of 24 sides with round normals, u along it.
fn tube() -> Arc<GeometryDescription> {
    let sides = 24;
    let (mut positions, mut normals, mut uvs, mut indices) = (vec![], vec![], vec![], vec![]);
    for i in 0..2 {
        for k in 0..=sides {
            let (sin, cos) = (std::f32::consts::TAU * k as f32 / sides as f32).sin_cos();
            normals.push(Vec3::new(0.0, cos, sin));
            positions.push(Vec3::new(i as f32 * 2.0 - 1.0, 0.3 * cos, 0.3 * sin));
            uvs.push(Vec2::new(i as f32, k as f32 / sides as f32));
        }
    }
    for k in 0..sides {
        let (a, b) = (k, sides + 1 + k);
        indices.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
    }
    Arc::new(GeometryDescription::Mesh { positions, normals, uvs, indices })
}

#[test]
fn white_hair_cannot_be_seen_in_a_furnace() {
    // Light enters a fibre once and leaves it once, whatever side it leaves on; light sampling and chance share it.
    let mut world = World::new();
    let (zero, eta, beta) = (world.spectrum(rgb(0.0)), world.float(1.55), world.float(0.3));
    let hair = world.material(MaterialKind::Hair {
        absorption: HairAbsorption::Coefficient(zero),
        eta,
        beta_m: beta,
        beta_n: beta,
        alpha: eta,
    });
    world.surface(&tube(), hair);
    let tracer = world.environment(1.0).tracer();
    let [l, met] = measure(samples(200_000, 16), |i| {
        let (o, d) = uniform_ray(23, i, 1.2);
        let met = tracer.scene.accel.nearest(&Ray::new(o, d)).is_some();
        [tracer.radiance(i, o, d), f64::from(u8::from(met))]
    });
    tracer.assert_sound();
    assert!(met.mean > 0.2, "{met}");
    assert_exact("furnace of white hair", l, 1.0, 0.0);
}

#[test]
fn every_single_path_finds_white_through_nested_shells() {
    let (world, reach, _) = shells();
    assert_white("shells", world.environment(1.0).tracer(), reach, samples(50_000, 16));
}

#[test]
fn every_pixel_of_a_furnace_is_white() {
    let (world, _, _) = shells();
    for mode in [WavelengthMode::MONO, WavelengthMode::Rgb] {
        let mut tracer = world.clone().environment(1.0).tracer();
        tracer.integrator.wavelengths = mode;
        tracer.integrator.roulette = KEEP_ALL;
        let film = Film::new([16, 16], [0, 16, 0, 16], 0, &[]);
        let (stop, progress) = (AtomicBool::new(false), AtomicU64::new(0));
        let done = session::render(&tracer.scene, &tracer.integrator, &film, 16, &stop, &progress);
        assert!(done.invalid == 0 && done.counters.collisions > 1000, "{done:?}");
        for (i, pixel) in film.develop(1.0).rgb.iter().enumerate() {
            assert!(pixel.iter().all(|c| (c - 1.0).abs() < ROUNDING as f32), "{mode:?}, pixel {i}: {pixel:?}");
        }
    }
}

#[test]
fn a_furnace_with_roulette_and_light_sampling_is_white_on_average() {
    // Without a refractive boundary light is looked for at every collision, behind one roulette may end weak branches: only the
    // mean is 1. Slow: below .03 % each but the last, .1 %.
    for (body, tau, g, eta, n) in [
        (Body::smooth(), 3.0, 0.5, 2.0, 60_000),
        (Body::ball(), 0.01, -0.5, 1.0, 60_000),
        (Body::ball(), 10.0, 0.5, 1.0, 40_000),
        (Body::bumpy(), 3.0, 0.95, 1.0, 60_000),
        (Body::sheet(), 1.0, 0.0, 1.0, 60_000),
        (Body::sheet(), 100.0, 0.0, 1.0, 4_000),
    ] {
        let tracer = body.world(tau, g, eta).environment(1.0).tracer();
        let [l] = measure(samples(n, 64), |i| {
            let (o, d) = uniform_ray(22, i, body.reach);
            [tracer.radiance(i, o, d)]
        });
        tracer.assert_sound();
        assert_exact(&format!("furnace of a {}, {tau} mean free paths, g {g}, eta {eta}", body.name), l, 1.0, 0.0);
    }
}
