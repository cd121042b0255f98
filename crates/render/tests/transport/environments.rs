//! Pictures at infinity behind smooth refractive boundaries: connections aim at what is bright in them, chance finds the rest.
//!
//! A limit of the number of bounces, far beyond any path, switches connections off: all is found by chance then.

use std::f32::consts::PI;
use std::sync::Arc;

use moonmilk_core::{Mat4, Random, Stream, Vec3, Wavelengths};
use moonmilk_geometry::generate::bumpy_sphere;
use moonmilk_render::description::{GeometryDescription, ImageDescription, LightKind};
use moonmilk_render::integrator::Policy;
use moonmilk_render::lights::octahedral::{direction_of, square_of};

use crate::bodies::Body;
use crate::common::{
    Tracer, World, assert_equal, assert_exact, ball, flat, measure, rectangle, samples, smooth, uniform_ray,
};
use crate::connections::{EYE, lamp_overhead};
use crate::furnace::assert_white;

/// Where the sun stands.
const SUN: Vec3 = Vec3::new(0.3, -0.5, 0.81);
/// A limit that no path reaches.
const NO_LIMIT: u32 = 1 << 22;

/// Adds a picture of width x width pixels.
fn with_picture(world: &mut World, width: u32, value: impl Fn(u32, u32) -> f32) {
    let rgb = (0..width * width).map(|i| [value(i % width, i / width); 3]).collect();
    world.0.images.push(ImageDescription { name: "sky".into(), width, height: width, rgb, alpha: vec![] });
    world.light(LightKind::Environment { image: world.0.images.len() - 1 });
}

/// Returns the pixel around the sun in a picture of some width.
fn pixel_of_sun(width: u32) -> [u32; 2] {
    square_of(SUN.normalize()).map(|x| (x * f64::from(width)) as u32)
}

/// Irradiance of a sun of one pixel, whatever its size, on a plane that faces it.
const SUNLIGHT: f32 = 3.0;

fn radiance_of_sun(width: u32) -> f32 {
    SUNLIGHT * (width * width) as f32 / (4.0 * PI)
}

/// Adds a picture that is black but for the pixel of the sun.
fn with_sun(world: &mut World, width: u32) {
    let sun = pixel_of_sun(width);
    with_picture(world, width, |i, j| if [i, j] == sun { radiance_of_sun(width) } else { 0.0 });
}

/// Adds a sky with a bright spot of 2 x 2 pixels out of 16 x 16: .2 sr, three quarters of the light.
fn with_bright_spot(world: &mut World) {
    let [x, y] = pixel_of_sun(16);
    let in_spot = move |i: u32, at: u32| i == at || i + 1 == at;
    with_picture(world, 16, move |i, j| if in_spot(i, x) && in_spot(j, y) { 40.0 } else { 0.2 });
}

/// Returns a body of milk in vacuum.
fn milk(shape: &Arc<GeometryDescription>, sigma_s: f32, g: f32) -> World {
    let mut world = World::new();
    let medium = world.medium(0.05, sigma_s, g);
    let glass = world.dielectric(1.4, 0.0);
    world.body(shape, glass, Some(medium), None);
    world
}

/// Returns the light scattered at least once that path number i finds through a window around a target.
fn scattered(tracer: &Tracer, i: u64, seed: u64, target: Vec3, window: f32) -> f64 {
    let mut rng = Stream::new(&[seed, i]);
    let [x, y, z] = [rng.uniform(), rng.uniform(), rng.uniform()].map(|u| (2.0 * u - 1.0) * window);
    let d = (target + Vec3::new(x, y, z) - EYE).normalize();
    let (light, _) = tracer.follow(i, EYE, d, &Wavelengths::<1>::Fixed(550.0));
    f64::from(light.orders[1][0] + light.orders[2][0])
}

/// Compares the light that was scattered at least once in two scenes, seen through a window around a target; prints the variances of a sample relative to the mean squared.
fn assert_same_scattered(what: &str, a: Tracer, b: Tracer, target: Vec3, window: f32, n: [u64; 2]) {
    let mut variances = [0.0; 2];
    let found: [_; 2] = std::array::from_fn(|k| {
        let tracer = [&a, &b][k];
        let n = samples(n[k], 16);
        let [l] = measure(n, |i| [scattered(tracer, i, 63 + k as u64, target, window)]);
        tracer.assert_sound();
        variances[k] = (l.std_err / l.mean).powi(2) * n as f64;
        l
    });
    println!("{what}: variance of a sample {:.3} and {:.3}", variances[0], variances[1]);
    assert_equal(what, found[0], found[1]);
}

/// Compares connections and chance in one scene, as [`assert_same_scattered`].
fn assert_chance_agrees(what: &str, world: &World, policy: Policy, n: [u64; 2]) {
    let mut chance = world.tracer();
    chance.integrator.seed = 99;
    chance.integrator.max_depth = Some(NO_LIMIT);
    assert_same_scattered(what, world.tracer().by(policy), chance, Vec3::ZERO, 0.4, n);
}

#[test]
fn connections_find_the_same_bright_spot_as_chance() {
    // Here and below: 1 to 3 %; slow: .3 to .7 %.
    let bumpy = bumpy_sphere(2, 0.3);
    for (what, shape) in [("ball", ball(1.0)), ("facets", flat(&bumpy)), ("smooth normals", smooth(&bumpy))] {
        for (sigma_s, g) in [(5.0f32, 0.0f32), (20.0, 0.9)] {
            let mut world = milk(&shape, sigma_s, g);
            with_bright_spot(&mut world);
            assert_chance_agrees(&format!("{what}, g {g}"), &world, Policy::Classic, [30_000, 100_000]);
        }
    }
}

#[test]
fn split_walks_and_jumps_find_the_same_bright_spot_as_chance() {
    for (sigma_s, g, policy) in [(30.0f32, 0.0f32, Policy::Jump), (25.0, 0.9, Policy::Auto)] {
        let mut world = milk(&smooth(&bumpy_sphere(2, 0.2)), sigma_s, g);
        with_bright_spot(&mut world);
        assert_chance_agrees(&format!("{policy:?}, g {g}"), &world, policy, [30_000, 60_000]);
    }
}

#[test]
fn a_bright_spot_and_a_lamp_and_an_even_sky_share_the_light() {
    for (sigma_s, g) in [(5.0f32, 0.0f32), (15.0, 0.8)] {
        let mut world = milk(&smooth(&bumpy_sphere(2, 0.3)), sigma_s, g);
        with_bright_spot(&mut world);
        // In front of the spot from some places.
        let world = lamp_overhead(world, true).environment(0.3);
        assert_chance_agrees(&format!("three lights, g {g}"), &world, Policy::Classic, [30_000, 100_000]);
    }
}

#[test]
fn light_through_a_portal_is_found_as_chance_finds_it() {
    for picture in [false, true] {
        let mut world = milk(&smooth(&bumpy_sphere(2, 0.2)), 5.0, 0.3);
        if picture {
            with_bright_spot(&mut world);
        } else {
            world = world.environment(3.0);
        }
        // A square of side 1.2 above, off the axis.
        let (a, x, y) = (Vec3::new(-0.4, -1.0, 1.6), Vec3::X * 1.2, Vec3::Y * 1.2);
        let light = world.0.lights.last_mut().expect("just added");
        light.portal = Some([a, a + y, a + x + y, a + x]);
        assert_chance_agrees(&format!("portal, picture {picture}"), &world, Policy::Classic, [60_000, 200_000]);
    }
}

/// Adds a lamp far away that fills a pixel of a picture, as seen from the origin: 8 x 8 squares, whose edges deviate from the pixel's by less than 1e-4 of its width.
fn with_far_pixel(world: &mut World, width: u32, [x, y]: [u32; 2], radiance: f32) {
    const PARTS: u32 = 8;
    const FAR: f32 = 1e4;
    let corner = |i: u32, j: u32| {
        let at = |k: u32, i: u32| (f64::from(k) + f64::from(i) / f64::from(PARTS)) / f64::from(width);
        direction_of([at(x, i), at(y, j)]) * FAR
    };
    let side = PARTS + 1;
    let positions: Vec<Vec3> = (0..side * side).map(|k| corner(k % side, k / side)).collect();
    let mut indices = vec![];
    for k in 0..PARTS * PARTS {
        let a = k % PARTS + k / PARTS * side;
        indices.extend([[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]);
    }
    // Shine towards the origin.
    let [a, b, c] = indices[0].map(|i: u32| positions[i as usize]);
    if (b - a).cross(c - a).dot(a) > 0.0 {
        indices.iter_mut().for_each(|t| t.swap(1, 2));
    }
    let geometry = GeometryDescription::Mesh { positions, normals: vec![], uvs: vec![], indices };
    world.emitter(&Arc::new(geometry), radiance);
}

#[test]
fn a_sun_of_one_pixel_lights_as_a_lamp_far_away_in_its_place() {
    // .012 sr, a disk of 7 degrees. 4 to 8 %; slow: 1 to 2 %.
    let bumpy = bumpy_sphere(2, 0.3);
    for (what, shape) in [("ball", ball(1.0)), ("facets", flat(&bumpy)), ("smooth normals", smooth(&bumpy))] {
        for (sigma_s, g) in [(5.0f32, 0.0f32), (20.0, 0.9)] {
            let make = |picture: bool| {
                let mut world = milk(&shape, sigma_s, g);
                if picture {
                    with_sun(&mut world, 32);
                } else {
                    with_far_pixel(&mut world, 32, pixel_of_sun(32), radiance_of_sun(32));
                }
                world.tracer().by(Policy::Classic)
            };
            let mut lamp = make(false);
            lamp.integrator.seed = 77;
            assert_same_scattered(&format!("sun, {what}, g {g}"), make(true), lamp, Vec3::ZERO, 0.4, [40_000, 40_000]);
        }
    }
}

#[test]
fn a_sky_turned_and_stretched_is_found_as_chance_finds_it() {
    let mut world = milk(&ball(1.0), 5.0, 0.3);
    with_bright_spot(&mut world);
    let light = world.0.lights.last_mut().expect("just added");
    light.light_to_world = Mat4::from_rotation_x(0.5) * Mat4::from_scale(Vec3::new(1.0, 2.0, 0.7));
    assert_chance_agrees("stretched", &world, Policy::Classic, [30_000, 100_000]);
}

#[test]
fn two_skies_whose_sum_is_white_hide_a_white_body() {
    // Windows in a wall, one square in four, and the wall: connections aim at the windows. Slow: .03 %.
    for body in [Body::ball(), Body::smooth(), Body::bumpy()] {
        for (tau, g, eta) in [(1.0, 0.0, 1.5), (6.0, 0.9, 1.33)] {
            let mut world = body.world(tau, g, eta);
            for wall in [0.0, 1.0] {
                with_picture(&mut world, 8, |i, j| if i % 2 + j % 2 == 0 { 1.0 - wall } else { wall });
            }
            let tracer = world.tracer();
            let [l] = measure(samples(40_000, 16), |i| {
                let (o, d) = uniform_ray(64, i, body.reach);
                [tracer.radiance(i, o, d)]
            });
            tracer.assert_sound();
            // Without connections every single path would find white.
            assert!(l.std_err * (l.n as f64).sqrt() > 0.01, "connections take part: {l}");
            assert_exact(&format!("windows, {}, g {g}", body.name), l, 1.0, 1e-5);
        }
    }
}

#[test]
fn every_single_path_finds_white_under_an_even_picture() {
    for body in [Body::ball(), Body::smooth()] {
        let mut world = body.world(3.0, 0.5, 1.5);
        with_picture(&mut world, 8, |_, _| 1.0);
        assert_white(&format!("{} under an even picture", body.name), world.tracer(), body.reach, samples(10_000, 8));
    }
}

#[test]
fn a_wall_before_a_bright_spot_shades_it() {
    let mut world = milk(&ball(1.0), 5.0, 0.3);
    with_bright_spot(&mut world);
    let black = world.diffuse(0.0);
    world.surface(&rectangle(SUN * 2.0, Vec3::X * 0.7, Vec3::Y * 0.4), black);
    assert_chance_agrees("shade", &world, Policy::Classic, [30_000, 100_000]);
}

#[test]
fn no_light_from_infinity_gets_through_a_haze_that_absorbs() {
    // Through all of space, to milk and out of it again: nothing, by connections as by chance.
    let mut world = World::new();
    let (milk, haze) = (world.medium(0.05, 5.0, 0.3), world.medium(0.1, 0.0, 0.0));
    let glass = world.dielectric(1.4, 0.0);
    world.body(&ball(1.0), glass, Some(milk), Some(haze));
    world.0.camera.medium = Some(haze);
    with_bright_spot(&mut world);
    let tracer = world.tracer();
    let sum: f64 = (0..500).map(|i| tracer.radiance(i, EYE, -EYE.normalize())).sum();
    assert_eq!(sum, 0.0);
    assert!(tracer.counters().shadow_rays > 0, "connections are made");
}
