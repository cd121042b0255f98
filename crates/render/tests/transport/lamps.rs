//! Lamps without extent behind smooth refractive boundaries, against small lamps with a surface that other strategies find.

use std::f32::consts::PI;
use std::sync::Arc;

use moonmilk_core::{Mat4, Random, Stream, Vec3, Wavelengths};
use moonmilk_geometry::generate::{bumpy_sphere, cuboid, sheet};
use moonmilk_render::description::{GeometryDescription, LightKind, MediumKind};
use moonmilk_render::integrator::Policy;

use crate::common::{Tracer, World, assert_equal, ball, flat, measure, rectangle, rgb, samples, smooth};
use crate::connections::EYE;
use crate::fields::{constant, densities, wild};

/// Where the lamp is.
const LAMP: Vec3 = Vec3::new(1.0, -1.5, 3.0);
/// Radius of the lamp with a surface. Its irradiance is that of a point at its centre, exactly; what walls make of its directions differs by the square of the angle that it is seen under, 2e-3,
/// times some tenths.
const SMALL: f32 = 0.15;

/// Compares the light that was scattered at least once from a lamp without extent and from a small one, seen through a window around a target. What was never scattered is left out: the
/// image of the lamp in the surface, which a point has not.
fn assert_same_light(what: &str, make: impl Fn(bool) -> Tracer, target: Vec3, window: f32, n: [u64; 2]) {
    let [point, small] = [true, false].map(|point| {
        let mut tracer = make(point);
        tracer.integrator.seed = 1 + u64::from(point);
        let [found] = measure(samples(n[usize::from(!point)], 32), |i| {
            let mut rng = Stream::new(&[62, i, u64::from(point)]);
            let [x, y, z] = [rng.uniform(), rng.uniform(), rng.uniform()].map(|u| (2.0 * u - 1.0) * window);
            let d = (target + Vec3::new(x, y, z) - EYE).normalize();
            let (light, _) = tracer.follow(i, EYE, d, &Wavelengths::<1>::Fixed(550.0));
            [f64::from(light.orders[1][0] + light.orders[2][0])]
        });
        tracer.assert_sound();
        found
    });
    assert_equal(what, point, small);
}

/// Adds a lamp of intensity 30: a point, or a small ball.
fn with_lamp(world: &mut World, at: Vec3, point: bool) {
    if point {
        world.light(LightKind::Point { from: at, intensity: rgb(30.0) });
    } else {
        let lamp = world.emitter(&ball(SMALL), 30.0 / (PI * SMALL * SMALL));
        world.0.shapes[lamp].object_to_world = Mat4::from_translation(at);
    }
}

/// Returns a body of milk under a lamp.
fn milk(shape: &Arc<GeometryDescription>, eta: f32, sigma_s: f32, g: f32, point: bool) -> World {
    let mut world = World::new();
    let medium = world.medium(0.05, sigma_s, g);
    let boundary = world.dielectric(eta, 0.0);
    world.body(shape, boundary, Some(medium), None);
    with_lamp(&mut world, LAMP, point);
    world
}

#[test]
fn a_point_lights_a_ball_as_a_small_ball_does() {
    // Here and below: 1.5 to 5 %; slow: .2 to .7 %. The thin ball is lit by ways with mirrors inside as well.
    for (eta, sigma_s, g) in [(1.4f32, 5.0f32, 0.5f32), (1.4, 0.3, 0.0), (0.8, 3.0, 0.0), (1.4, 10.0, 0.8)] {
        let make = |point| milk(&ball(1.0), eta, sigma_s, g, point).tracer();
        assert_same_light(&format!("ball, {eta} {sigma_s} {g}"), make, Vec3::ZERO, 0.4, [20_000, 50_000]);
    }
}

#[test]
fn a_point_lights_facets_folds_and_smooth_normals_as_a_small_ball_does() {
    let bumpy = bumpy_sphere(2, 0.3);
    let cube = flat(&cuboid(-Vec3::ONE, Vec3::ONE));
    for (what, shape) in [("facets", flat(&bumpy)), ("smooth", smooth(&bumpy)), ("cube", cube)] {
        let make = |point| milk(&shape, 1.4, 4.0, 0.3, point).tracer();
        assert_same_light(what, make, Vec3::ZERO, 0.4, [20_000, 50_000]);
    }
    let make = |point| milk(&smooth(&sheet(6, 0.05)), 1.4, 4.0, 0.3, point).tracer();
    assert_same_light("sheet", make, Vec3::ZERO, 0.2, [20_000, 50_000]);
}

#[test]
fn a_point_in_the_shade_lights_as_a_small_ball_there_does() {
    let make = |point| {
        let mut world = milk(&ball(1.0), 1.4, 5.0, 0.5, point);
        let screen = world.diffuse(0.0);
        world.surface(&rectangle(Vec3::new(0.8, -0.6, 1.4), Vec3::X * 0.5, Vec3::Y * 0.4), screen);
        with_lamp(&mut world, Vec3::new(-2.0, 0.5, 0.3), point);
        world.tracer()
    };
    assert_same_light("screen", make, Vec3::new(0.0, 0.0, 0.4), 0.4, [20_000, 50_000]);
}

#[test]
fn a_point_lights_a_dense_ball_by_jumps_as_a_small_ball_does() {
    let make = |point| milk(&ball(1.0), 1.4, 40.0, 0.0, point).tracer().by(Policy::Jump);
    assert_same_light("jumps", make, Vec3::ZERO, 0.4, [20_000, 40_000]);
}

#[test]
fn parallel_light_is_that_of_a_lamp_far_away() {
    // A disk of radius R at distance D seen face on has the irradiance L pi (R / D)^2.
    let (towards, far, radius) = (Vec3::new(0.3, -0.5, 0.8).normalize(), 400.0f32, 20.0f32);
    for shape in [ball(1.0), smooth(&bumpy_sphere(2, 0.3))] {
        let make = |parallel| {
            let mut world = World::new();
            let medium = world.medium(0.05, 4.0, 0.3);
            let boundary = world.dielectric(1.4, 0.0);
            world.body(&shape, boundary, Some(medium), None);
            if parallel {
                return world.distant(towards, 3.0).tracer();
            }
            let lamp = world.emitter(&ball(radius), 3.0 / (PI * (radius / far).powi(2)));
            world.0.shapes[lamp].object_to_world = Mat4::from_translation(towards * far);
            world.tracer()
        };
        assert_same_light("parallel", make, Vec3::ZERO, 0.4, [20_000, 50_000]);
    }
}

/// Returns a ball of a medium that varies as `f` says, under a point.
fn varied(eta: f32, f: impl FnMut(Vec3) -> f32) -> World {
    let mut world = World::new();
    let medium = world.medium_of(MediumKind::Densities(Box::new(densities(12, constant(0.05), constant(4.0), 0.3, f))));
    let boundary = world.dielectric(eta, 0.0);
    world.body(&ball(1.0), boundary, Some(medium), None);
    with_lamp(&mut world, LAMP, true);
    world
}

#[test]
fn a_point_lights_media_that_vary() {
    // A grid of constant density is the homogeneous medium.
    let make = |grid: bool| {
        let world = if grid { varied(1.4, |_| 1.0) } else { milk(&ball(1.0), 1.4, 4.0, 0.3, true) };
        world.tracer().by(Policy::Classic)
    };
    assert_same_light("grid", make, Vec3::ZERO, 0.4, [20_000, 20_000]);
    // Behind an index-matched boundary the same light is found along straight lines.
    let make = |bent: bool| varied(if bent { 1.0002 } else { 1.0 }, wild(7)).tracer();
    assert_same_light("wild densities", make, Vec3::ZERO, 0.4, [30_000, 30_000]);
}

#[test]
fn at_an_index_near_one_refraction_changes_nothing() {
    // Behind an index-matched boundary the same light is found along straight lines; the small difference of the index is worth 1e-3 at most.
    let make = |bent: bool| milk(&ball(1.0), if bent { 1.0002 } else { 1.0 }, 4.0, 0.3, true).tracer();
    assert_same_light("index 1", make, Vec3::ZERO, 0.4, [30_000, 30_000]);
}

/// Returns a scene of milk behind more than one smooth boundary, without light.
fn behind_others(what: &str) -> World {
    let mut world = World::new();
    let milk = world.medium(0.05, 5.0, 0.5);
    let [glass, in_glass, alone] = [1.5, 0.9, 1.35].map(|eta| world.dielectric(eta, 0.0));
    let tint = world.medium(0.3, 0.0, 0.0);
    let bumpy = bumpy_sphere(2, 0.2);
    match what {
        "in a glass ball" => {
            world.body(&ball(1.0), glass, None, None);
            let inner = world.body(&smooth(&bumpy), in_glass, Some(milk), None);
            world.0.shapes[inner].object_to_world = Mat4::from_scale(Vec3::splat(0.7));
        }
        "in a ball of wax" => {
            let wax = world.medium(0.05, 0.5, 0.0);
            world.body(&ball(1.0), glass, Some(wax), None);
            let inner = world.body(&ball(0.7), in_glass, Some(milk), None);
            world.0.shapes[inner].object_to_world = Mat4::from_translation(Vec3::Y * -0.2);
        }
        // No wall of its own that turns light, but in one that does.
        "as fog in a glass ball" | "as a cloud in a glass ball" => {
            let cloud = densities(12, constant(0.05), constant(4.0), 0.3, wild(7));
            let inside = match what {
                "as fog in a glass ball" => world.medium(0.05, 2.0, 0.3),
                _ => world.medium_of(MediumKind::Densities(Box::new(cloud))),
            };
            let none = world.dielectric(1.0, 0.0);
            world.body(&ball(1.0), glass, None, None);
            let inner = world.body(&smooth(&bumpy), none, Some(inside), None);
            world.0.shapes[inner].object_to_world = Mat4::from_scale(Vec3::splat(0.6));
        }
        "filling a tinted glass to its wall" => {
            world.body(&flat(&cuboid(-Vec3::ONE, Vec3::ONE)), glass, Some(tint), None);
            let (min, max) = (Vec3::new(-0.8, -0.8, -0.8), Vec3::new(0.8, 0.8, 1.0));
            world.body(&flat(&cuboid(min, max)), in_glass, Some(milk), None);
        }
        "under a smooth lens" => {
            world.body(&flat(&bumpy), alone, Some(milk), None);
            // Fine enough for normals that go on across edges: a coarse one has single roots that a millionth of the flights finds, of a tenth of the light.
            let lens = world.body(&smooth(&bumpy_sphere(4, 0.2)), glass, Some(tint), None);
            let place = Mat4::from_translation(Vec3::new(0.3, -0.4, 1.7)) * Mat4::from_scale(Vec3::new(1.0, 1.0, 0.3));
            world.0.shapes[lens].object_to_world = place;
        }
        "under a pane in another" => {
            world.body(&ball(1.0), alone, Some(milk), None);
            let (min, max) = (Vec3::new(-1.5, -1.5, 1.4), Vec3::new(1.5, 1.5, 1.5));
            world.body(&flat(&cuboid(min, max)), glass, Some(tint), None);
            // Clear, too, and around the pane: four boundaries, one index over the other.
            world.body(&flat(&cuboid(min - Vec3::Z * 0.1, max + Vec3::Z * 0.2)), alone, None, None);
        }
        _ => unreachable!("no such scene"),
    }
    world
}

#[test]
fn a_point_lights_through_other_bodies_as_a_small_ball_does() {
    for (what, n) in [
        ("in a glass ball", [20_000, 60_000]),
        ("in a ball of wax", [20_000, 60_000]),
        // Chance alone finds the small ball there.
        ("as fog in a glass ball", [20_000, 600_000]),
        ("as a cloud in a glass ball", [20_000, 600_000]),
        ("filling a tinted glass to its wall", [10_000, 30_000]),
        ("under a smooth lens", [5_000, 60_000]),
        ("under a pane in another", [10_000, 60_000]),
    ] {
        let make = |point| {
            let mut world = behind_others(what);
            with_lamp(&mut world, LAMP, point);
            world.tracer()
        };
        assert_same_light(&format!("milk {what}"), make, Vec3::new(0.0, -0.3, 0.3), 0.3, n);
    }
}

#[test]
fn parallel_light_through_other_bodies_is_that_of_a_lamp_far_away() {
    let (towards, far, radius) = (Vec3::new(0.3, -0.5, 0.8).normalize(), 400.0f32, 20.0f32);
    for (what, n) in [
        ("in a glass ball", [20_000, 60_000]),
        ("as fog in a glass ball", [20_000, 1_000_000]),
        ("under a smooth lens", [5_000, 60_000]),
        ("under a pane in another", [10_000, 60_000]),
    ] {
        let make = |parallel| {
            let mut world = behind_others(what);
            if parallel {
                return world.distant(towards, 3.0).tracer();
            }
            let lamp = world.emitter(&ball(radius), 3.0 / (PI * (radius / far).powi(2)));
            world.0.shapes[lamp].object_to_world = Mat4::from_translation(towards * far);
            world.tracer()
        };
        assert_same_light(&format!("milk {what}"), make, Vec3::new(0.0, -0.3, 0.3), 0.3, n);
    }
}
