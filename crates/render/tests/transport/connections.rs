//! Light sampling against closed forms, and against light that only chance can find.

use std::f64::consts::PI;

use moonmilk_core::{DVec3, Mat4, Random, Stream, Vec3, Wavelengths};
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_render::description::LightKind;
use moonmilk_render::integrator::Policy;

use crate::common::{Tracer, World, assert_equal, assert_exact, ball, flat, measure, rectangle, rgb, samples, smooth};

/// Returns the irradiance at p on a surface of normal n from a polygon of radiance 1 above its horizon: half the sum over its edges
/// of the angle they subtend times the cosine of their plane's normal \[Lambert1760\].
fn irradiance(p: DVec3, n: DVec3, corners: &[DVec3]) -> f64 {
    let v: Vec<DVec3> = corners.iter().map(|c| (*c - p).normalize()).collect();
    let edges = (0..v.len()).map(|i| {
        let (a, b) = (v[i], v[(i + 1) % v.len()]);
        a.dot(b).acos() * a.cross(b).normalize().dot(n)
    });
    0.5 * edges.sum::<f64>().abs()
}

#[test]
fn a_diffuse_plane_under_a_rectangle_is_as_bright_as_lambert_says() {
    // Slow: .01 %.
    let (center, s, t) = (Vec3::new(0.3, 0.0, 1.0), Vec3::X * 0.8, Vec3::new(0.0, -0.5, 0.2));
    let corners = [center - s - t, center + s - t, center + s + t, center - s + t].map(|c| c.as_dvec3());
    let mut world = World::new();
    let material = world.diffuse(0.6);
    world.surface(&rectangle(Vec3::ZERO, Vec3::X * 10.0, Vec3::Y * 10.0), material);
    world.emitter(&rectangle(center, s, t), 2.0);
    let tracer = world.tracer();
    for p in [Vec3::new(0.3, 0.1, 0.0), Vec3::new(-2.0, 1.0, 0.0), Vec3::new(0.9, -0.4, 0.0)] {
        let d = Vec3::new(0.5, 0.2, -0.1).normalize();
        let [l] = measure(samples(20_000, 64), |i| [tracer.radiance(i, p - d * 0.01, d)]);
        let exact = 0.6 / PI * 2.0 * irradiance(p.as_dvec3(), DVec3::Z, &corners);
        assert_exact(&format!("plane at {p}"), l, exact, 1e-5 * exact);
    }
}

#[test]
fn a_diffuse_plane_under_a_ball_a_point_and_a_distant_light_is_as_bright_as_their_closed_forms_say() {
    // Ball of radius r at distance h overhead: E = pi L (r / h)^2. Point: I / h^2. Distant: E cos.
    let mut world = World::new();
    let material = world.diffuse(0.5);
    world.surface(&rectangle(Vec3::ZERO, Vec3::X * 10.0, Vec3::Y * 10.0), material);
    let lamp = world.emitter(&ball(0.5), 3.0);
    world.0.shapes[lamp].object_to_world = Mat4::from_translation(Vec3::Z * 2.0);
    world.light(LightKind::Point { from: Vec3::new(0.0, 3.0, 1.0), intensity: rgb(7.0) });
    let tracer = world.distant(Vec3::new(0.0, -0.6, 0.8), 1.5).tracer();
    let d = Vec3::new(0.8, 0.0, -0.6);
    let [l] = measure(samples(20_000, 64), |i| [tracer.radiance(i, -d, d)]);
    let exact = 0.5 / PI * (PI * 3.0 * 0.25f64.powi(2) + 7.0 / 10.0 * 0.1f64.sqrt() + 1.5 * 0.8);
    assert_exact("plane under three lights", l, exact, 1e-5 * exact);
}

/// Adds a lamp of radiance 4 to a world: an emitting box, or the same box full of a glowing medium so dense that it is as bright on its
/// whole surface, up to the corners within 1e-6 of its edges. Lights are sampled; a glow is found by chance alone.
fn with_lamp(mut world: World, min: Vec3, max: Vec3, around: Option<usize>, sampled: bool) -> World {
    let shape = flat(&cuboid(min, max));
    if sampled {
        world.emitter(&shape, 4.0);
    } else {
        let glow = world.glow(1e6, 0.0, 0.0, 4.0);
        let nothing = world.dielectric(1.0, 0.0);
        world.body(&shape, nothing, Some(glow), around);
    }
    world
}

/// Compares both lamps in a world, seen from a point through a window around a target.
fn assert_same(what: &str, make: impl Fn(bool) -> World, eye: Vec3, target: Vec3, window: f32, n: [u64; 2]) {
    assert_same_light(what, |sampled| make(sampled).tracer(), eye, target, window, n);
}

/// Compares both lamps, as [`assert_same`].
pub fn assert_same_light(what: &str, make: impl Fn(bool) -> Tracer, eye: Vec3, target: Vec3, window: f32, n: [u64; 2]) {
    let [sampled, chance] = [true, false].map(|sampled| {
        let mut tracer = make(sampled);
        tracer.integrator.seed = 1 + u64::from(sampled);
        let [l] = measure(samples(n[usize::from(!sampled)], 16), |i| {
            let mut rng = Stream::new(&[61, i, u64::from(sampled)]);
            let [x, y, z] = [rng.uniform(), rng.uniform(), rng.uniform()].map(|u| (2.0 * u - 1.0) * window);
            [tracer.radiance(i, eye, (target + Vec3::new(x, y, z) - eye).normalize())]
        });
        tracer.assert_sound();
        l
    });
    assert_equal(what, sampled, chance);
}

pub const EYE: Vec3 = Vec3::new(0.0, -4.0, 2.0);

/// A lamp overhead.
pub fn lamp_overhead(world: World, sampled: bool) -> World {
    with_lamp(world, Vec3::new(-0.5, -0.5, 2.0), Vec3::new(0.7, 0.5, 2.3), None, sampled)
}

#[test]
fn sampled_light_equals_light_found_by_chance_in_fog() {
    // Here and below: 1 to 5 %; slow: .3 to 1 %.
    for (sigma_s, g) in [(0.7f32, 0.0f32), (6.0, 0.8)] {
        let make = |sampled| {
            let mut world = World::new();
            let fog = world.medium(0.1, sigma_s, g);
            let nothing = world.dielectric(1.0, 0.0);
            world.body(&flat(&bumpy_sphere(2, 0.2)), nothing, Some(fog), None);
            let floor = world.diffuse(0.5);
            world.surface(&rectangle(Vec3::Z * -1.3, Vec3::X * 3.0, Vec3::Y * 3.0), floor);
            lamp_overhead(world, sampled)
        };
        assert_same(&format!("fog, sigma_s {sigma_s}, g {g}"), make, EYE, Vec3::ZERO, 0.5, [60_000, 120_000]);
    }
}

#[test]
fn sampled_light_equals_light_found_by_chance_behind_a_smooth_boundary() {
    let make = |sampled| {
        let mut world = World::new();
        let milk = world.medium(0.05, 5.0, 0.5);
        let glass = world.dielectric(1.4, 0.0);
        world.body(&smooth(&bumpy_sphere(2, 0.2)), glass, Some(milk), None);
        let floor = world.diffuse(0.5);
        world.surface(&rectangle(Vec3::Z * -1.3, Vec3::X * 3.0, Vec3::Y * 3.0), floor);
        lamp_overhead(world, sampled)
    };
    assert_same("smooth milk", make, EYE, Vec3::ZERO, 0.5, [100_000, 100_000]);
    // Caustics on the floor, its shadow: light found by chance through the glass, sampled beside it.
    assert_same("floor beside it", make, EYE, Vec3::new(0.9, 0.6, -1.3), 0.2, [60_000, 120_000]);
}

/// Returns a scene of milk behind more than one smooth boundary, under a lamp.
fn behind_clear(what: &str, g: f32, sampled: bool) -> World {
    let mut world = World::new();
    let milk = world.medium(0.05, 5.0, g);
    let [glass, in_glass, alone] = [1.5, 0.9, 1.35].map(|eta| world.dielectric(eta, 0.0));
    let tint = world.medium(0.3, 0.0, 0.0);
    match what {
        "in a glass ball" => {
            world.body(&ball(1.0), glass, None, None);
            let inner = world.body(&smooth(&bumpy_sphere(2, 0.2)), in_glass, Some(milk), None);
            world.0.shapes[inner].object_to_world = Mat4::from_scale(Vec3::splat(0.7));
        }
        "filling a tinted glass to its wall" => {
            world.body(&flat(&cuboid(-Vec3::ONE, Vec3::ONE)), glass, Some(tint), None);
            let (min, max) = (Vec3::new(-0.8, -0.8, -0.8), Vec3::new(0.8, 0.8, 1.0));
            world.body(&flat(&cuboid(min, max)), in_glass, Some(milk), None);
        }
        "under a pane and a bulb" => {
            world.body(&flat(&bumpy_sphere(2, 0.2)), alone, Some(milk), None);
            let (min, max) = (Vec3::new(-1.5, -1.5, 1.4), Vec3::new(1.5, 1.5, 1.5));
            world.body(&flat(&cuboid(min, max)), glass, Some(tint), None);
            let bulb = world.body(&ball(0.9), glass, None, None);
            world.0.shapes[bulb].object_to_world = Mat4::from_translation(Vec3::new(0.1, 0.0, 2.6));
            let air = world.dielectric(1.0 / 1.5, 0.0);
            let hollow = world.body(&ball(0.85), air, None, None);
            world.0.shapes[hollow].object_to_world = Mat4::from_translation(Vec3::new(0.1, 0.0, 2.6));
            return with_lamp(world, Vec3::new(-0.3, -0.3, 2.5), Vec3::new(0.5, 0.3, 2.6), None, sampled);
        }
        "under a pane in another" => {
            world.body(&ball(1.0), alone, Some(milk), None);
            let (min, max) = (Vec3::new(-1.5, -1.5, 1.4), Vec3::new(1.5, 1.5, 1.5));
            world.body(&flat(&cuboid(min, max)), glass, Some(tint), None);
            world.body(&flat(&cuboid(min - Vec3::Z * 0.1, max + Vec3::Z * 0.2)), alone, None, None);
        }
        _ => unreachable!("no such scene"),
    }
    lamp_overhead(world, sampled)
}

#[test]
fn sampled_light_equals_light_found_by_chance_through_clear_bodies() {
    for (what, g) in [
        ("in a glass ball", 0.0),
        ("in a glass ball", 0.8),
        ("filling a tinted glass to its wall", 0.5),
        ("under a pane and a bulb", 0.5),
        ("under a pane in another", 0.5),
    ] {
        let make = |sampled| behind_clear(what, g, sampled);
        assert_same(&format!("milk {what}, g {g}"), make, EYE, Vec3::new(0.0, -0.3, 0.3), 0.3, [80_000, 200_000]);
    }
}

#[test]
fn connections_through_clear_bodies_leave_less_noise_than_chance() {
    let deviation = |sampled| {
        let tracer = behind_clear("in a glass ball", 0.0, sampled).tracer();
        let [l] = measure(20_000, |i| [tracer.radiance(i, EYE, (Vec3::Z * 0.3 - EYE).normalize())]);
        l.std_err
    };
    let (connected, chance) = (deviation(true), deviation(false));
    println!("standard errors {connected:.2e} and {chance:.2e}");
    assert!(connected < 0.7 * chance, "{connected} {chance}");
}

#[test]
fn a_lamp_of_opacity_0_lights_as_one_that_rays_meet() {
    // What was never scattered is left out: the image of the lamp in surfaces, which one of opacity 0 has not.
    for what in ["ball", "thin ball", "in a glass ball", "floor behind a glass ball"] {
        let make = |hidden: bool| {
            let mut world = match what {
                "in a glass ball" => behind_clear(what, 0.5, true),
                _ => World::new(),
            };
            if what == "floor behind a glass ball" {
                let glass = world.dielectric(1.5, 0.0);
                world.body(&ball(1.0), glass, None, None);
                let floor = world.diffuse(0.5);
                world.surface(&rectangle(Vec3::Z * -1.3, Vec3::X * 3.0, Vec3::Y * 3.0), floor);
            } else if what != "in a glass ball" {
                let milk = world.medium(0.05, if what == "thin ball" { 0.5 } else { 5.0 }, 0.3);
                let boundary = world.dielectric(1.4, 0.0);
                world.body(&ball(1.0), boundary, Some(milk), None);
            }
            if what != "in a glass ball" {
                world = lamp_overhead(world, true);
            }
            if hidden {
                let clear = world.float(0.0);
                world.0.shapes.iter_mut().filter(|s| s.area_light.is_some()).for_each(|s| s.alpha = Some(clear));
            }
            world.tracer()
        };
        let floor = what == "floor behind a glass ball";
        let [hidden, met] = [true, false].map(|hidden| {
            let mut tracer = make(hidden);
            tracer.integrator.seed = 1 + u64::from(hidden);
            let [found] = measure(samples(100_000, 16), |i| {
                let mut rng = Stream::new(&[63, i, u64::from(hidden)]);
                let [x, y, z] = [rng.uniform(), rng.uniform(), rng.uniform()].map(|u| (2.0 * u - 1.0) * 0.3);
                let target = if floor { Vec3::new(0.2, 0.2, -1.3) } else { Vec3::new(0.0, -0.3, 0.3) };
                let eye = if floor { Vec3::new(0.2, 0.1, -1.1) } else { EYE };
                let d = (target + Vec3::new(x, y, if floor { 0.0 } else { z }) - eye).normalize();
                let (light, _) = tracer.follow(i, eye, d, &Wavelengths::<1>::Fixed(550.0));
                let first = if floor { light.orders[0][0] } else { 0.0 };
                [f64::from(first + light.orders[1][0] + light.orders[2][0])]
            });
            tracer.assert_sound();
            found
        });
        assert_equal(what, hidden, met);
    }
}

#[test]
fn a_lamp_of_opacity_0_takes_nothing_from_one_behind_it() {
    let make = |hidden: bool, behind: bool| {
        let mut world = World::new();
        let (milk, boundary) = (world.medium(0.05, 5.0, 0.3), world.dielectric(1.4, 0.0));
        world.body(&ball(1.0), boundary, Some(milk), None);
        if behind {
            world.emitter(&rectangle(Vec3::new(0.1, 0.0, 4.0), Vec3::X * 2.0, Vec3::Y * -2.0), 2.0);
        }
        if hidden {
            let clear = world.float(0.0);
            world = lamp_overhead(world, true);
            world.0.shapes.last_mut().expect("a lamp").alpha = Some(clear);
        }
        world.tracer()
    };
    let scattered = |tracer: &Tracer, i: u64| {
        let d = (Vec3::new(0.0, -0.3, 0.3) - EYE).normalize();
        let (light, _) = tracer.follow(i, EYE, d, &Wavelengths::<1>::Fixed(550.0));
        f64::from(light.orders[1][0] + light.orders[2][0])
    };
    let (both, one, other) = (make(true, true), make(true, false), make(false, true));
    let [both] = measure(samples(100_000, 16), |i| [scattered(&both, i)]);
    let [sum] = measure(samples(100_000, 16), |i| [scattered(&one, i + (1 << 40)) + scattered(&other, i + (1 << 41))]);
    assert_equal("two lamps", both, sum);
}

#[test]
fn a_lamp_of_opacity_0_is_not_seen() {
    let mut world = lamp_overhead(World::new(), true);
    let (clear, glass) = (world.float(0.0), world.dielectric(1.5, 0.0));
    world.0.shapes.last_mut().expect("a lamp").alpha = Some(clear);
    world.body(&ball(1.0), glass, None, None);
    let tracer = world.tracer();
    let seen = |target: Vec3| (0..200).map(|i| tracer.radiance(i, EYE, (target - EYE).normalize())).sum::<f64>();
    assert_eq!(seen(Vec3::new(0.0, 0.0, 2.1)), 0.0);
    assert_eq!(seen(Vec3::new(0.0, -0.2, 0.8)), 0.0);
}

#[test]
fn sampled_light_equals_light_found_by_chance_behind_a_rough_boundary() {
    for (alpha, sigma_s) in [(0.3f32, 0.0f32), (0.15, 5.0)] {
        let make = |sampled| {
            let mut world = World::new();
            let milk = world.medium(0.05, sigma_s, 0.3);
            let frosted = world.dielectric(1.5, alpha);
            world.body(&flat(&bumpy_sphere(3, 0.1)), frosted, Some(milk), None);
            lamp_overhead(world, sampled)
        };
        let what = format!("frosted milk, alpha {alpha}, sigma_s {sigma_s}");
        assert_same(&what, make, EYE, Vec3::ZERO, 0.5, [100_000, 200_000]);
    }
}

#[test]
fn sampled_light_equals_light_found_by_chance_from_inside_a_body() {
    for eta in [1.0f32, 1.4] {
        let make = |sampled| {
            let mut world = World::new();
            let milk = world.medium(0.2, 3.0, 0.4);
            let boundary = world.dielectric(eta, 0.0);
            world.body(&flat(&bumpy_sphere(2, 0.1)), boundary, Some(milk), None);
            with_lamp(world, Vec3::new(-0.2, -0.3, -0.1), Vec3::new(0.1, 0.2, 0.3), Some(0), sampled)
        };
        assert_same(&format!("lamp in milk, eta {eta}"), make, EYE, Vec3::ZERO, 0.5, [60_000, 100_000]);
    }
}

#[test]
fn walks_split_by_importance_find_the_same_light() {
    // A thick body, and a thin one whose walls face one another; without splitting flight by flight.
    for (sigma_s, what) in [(25.0f32, "thick"), (5.0, "thin")] {
        let make = |sampled: bool| {
            let mut world = World::new();
            let milk = world.medium(0.02, sigma_s, 0.9);
            let glass = world.dielectric(1.33, 0.0);
            world.body(&smooth(&bumpy_sphere(2, 0.2)), glass, Some(milk), None);
            let tracer = lamp_overhead(world, true).tracer();
            if sampled { tracer } else { tracer.by(Policy::Classic) }
        };
        assert_same_light(&format!("split milk, {what}"), make, EYE, Vec3::ZERO, 0.5, [40_000, 80_000]);
    }
}
