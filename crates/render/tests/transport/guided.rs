//! Walks guided to the nearest wall: the same means as flight by flight, exact values, and no difference in an audit.

use moonmilk_core::Random;
use moonmilk_core::{Mat4, Spectrum, Stream, Vec3, WavelengthMode, Wavelengths};
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_optics::fresnel::{moment_1, reflectance_f64};
use moonmilk_render::audit::audit;
use moonmilk_render::description::{MediumKind, SpectrumDescription};
use moonmilk_render::integrator::Policy;

use crate::common::{Tracer, World, assert_equal, assert_exact, ball, flat, measure, rectangle, samples, smooth};
use crate::connections::{EYE, lamp_overhead};
use crate::half_space::{layer, look, look_everywhere};

#[test]
fn half_spaces_by_guided_walks_reflect_what_the_exact_solution_says() {
    // Physics notes 8.1, as for walks flight by flight. Slow: .03 to .1 %.
    for (alpha, eta, normal, diffuse) in [
        (0.8f32, 1.0f32, 0.285255, 0.341867),
        (0.9, 1.0, 0.414947, 0.478024),
        (0.99, 1.33, 0.645854, 0.659795),
        (0.98, 1.5, 0.480701, 0.490996),
        (0.999, 1.5, 0.834853, 0.839511),
    ] {
        let tracer = layer(300.0, 1.0 - alpha, alpha, 0.0, eta).environment(1.0).tracer().by(Policy::Guided);
        let [at_normal, all] = measure(samples(30_000, 12), |i| [look(&tracer, i, 1.0), look_everywhere(&tracer, i)]);
        tracer.assert_sound();
        let eta = f64::from(eta);
        let entered = |albedo: f64, f: f64| f + (1.0 - f) * albedo;
        let f = reflectance_f64(1.0, eta);
        assert_exact(&format!("normal, {alpha} {eta}, guided"), at_normal, entered(normal, f), 1e-6);
        let f = 2.0 * moment_1(1.0 / eta);
        assert_exact(&format!("diffuse, {alpha} {eta}, guided"), all, entered(diffuse, f), 1e-6);
    }
}

/// Compares both policies through a window around a target.
fn assert_same(what: &str, make: impl Fn() -> Tracer, eye: Vec3, target: Vec3, window: f32, n: u64) {
    let [classic, guided] = [Policy::Classic, Policy::Guided].map(|policy| {
        let tracer = make().by(policy);
        let [l] = measure(samples(n, 12), |i| {
            let mut rng = Stream::new(&[191, i, policy as u64]);
            let [x, y, z] = [rng.uniform(), rng.uniform(), rng.uniform()].map(|u| (2.0 * u - 1.0) * window);
            [tracer.radiance(i, eye, (target + Vec3::new(x, y, z) - eye).normalize())]
        });
        tracer.assert_sound();
        l
    });
    println!("{what}: variance ratio {:.2}", (classic.std_err / guided.std_err).powi(2));
    assert_equal(what, guided, classic);
}

#[test]
fn lamps_shine_into_absorbing_bodies_by_guided_walks_as_by_flights() {
    // Connections from collisions that lean, looks, chance: all meet here. Slow: .1 to .3 %.
    for (eta, roughness, sigma_a, sigma_s, g) in [
        (1.4f32, 0.0f32, 3.0f32, 8.0f32, 0.0f32),
        (1.4, 0.0, 4.0, 40.0, 0.8),
        (1.4, 0.0, 20.0, 10.0, 0.0),
        (1.0, 0.0, 3.0, 12.0, 0.0),
        (1.5, 0.2, 2.0, 10.0, 0.5),
    ] {
        let make = || {
            let mut world = World::new();
            let jade = world.medium(sigma_a, sigma_s, g);
            let boundary = world.dielectric(eta, roughness);
            world.body(&smooth(&bumpy_sphere(2, 0.2)), boundary, Some(jade), None);
            let floor = world.diffuse(0.5);
            world.surface(&rectangle(Vec3::Z * -1.3, Vec3::X * 3.0, Vec3::Y * 3.0), floor);
            lamp_overhead(world, true).tracer()
        };
        let what = format!("jade under a lamp, {eta} {roughness} {sigma_a} {sigma_s} {g}");
        assert_same(&what, make, EYE, Vec3::ZERO, 0.5, 60_000);
    }
}

#[test]
fn lights_bodies_and_cameras_inside_are_seen_by_guided_walks() {
    for eta in [1.0f32, 1.4] {
        let make = || {
            let mut world = World::new();
            let jade = world.medium(1.0, 8.0, 0.3);
            let boundary = world.dielectric(eta, 0.0);
            world.body(&flat(&bumpy_sphere(2, 0.1)), boundary, Some(jade), None);
            world.emitter(&flat(&cuboid(Vec3::new(-0.2, -0.6, -0.1), Vec3::new(0.1, -0.3, 0.3))), 4.0);
            world.tracer()
        };
        assert_same(&format!("lamp in jade, eta {eta}"), make, EYE, Vec3::ZERO, 0.5, 60_000);
    }
    // A dark clot, and the eye itself inside.
    let clot = || {
        let mut world = World::new();
        let jade = world.medium(1.0, 10.0, 0.0);
        let boundary = world.dielectric(1.3, 0.0);
        world.body(&flat(&bumpy_sphere(2, 0.1)), boundary, Some(jade), None);
        let dark = world.diffuse(0.1);
        world.surface(&ball(0.3), dark);
        lamp_overhead(world, true).environment(0.5).tracer()
    };
    assert_same("clot in jade", clot, EYE, Vec3::ZERO, 0.5, 60_000);
    assert_same("eye in jade", clot, Vec3::new(0.0, -0.6, 0.1), Vec3::ZERO, 0.5, 30_000);
}

#[test]
fn shadow_rays_through_two_media_are_weighed_as_guided_walks_through_them() {
    // A lamp outside two nested bodies without refraction: light sampling and chance share paths whose first way alone is stretched. In colour, so that lanes part on the way.
    let world = |a: SpectrumDescription, s: SpectrumDescription| {
        let mut world = World::new();
        let kind = |a, s| MediumKind::Homogeneous { sigma_a: a, sigma_s: s, scale: 1.0, g: 0.0, emission: None };
        let outer = world.medium_of(kind(a.clone(), s.clone()));
        let inner = world.medium_of(kind(s, a));
        let nothing = world.dielectric(1.0, 0.0);
        world.body(&flat(&bumpy_sphere(2, 0.2)), nothing, Some(outer), None);
        let nothing = world.dielectric(1.0, 0.0);
        world.body(&ball(0.6), nothing, Some(inner), Some(outer));
        lamp_overhead(world, true)
    };
    let (sigma_a, sigma_s) = ([0.8f32, 0.3, 2.0], [1.0f32, 1.5, 4.0]);
    same_lanes("nested fogs", world, 0.6, sigma_a, sigma_s);
}

#[test]
fn lanes_of_different_extinction_are_guided_together_without_bias() {
    let world = |a: SpectrumDescription, s: SpectrumDescription| {
        let mut world = World::new();
        let medium =
            world.medium_of(MediumKind::Homogeneous { sigma_a: a, sigma_s: s, scale: 1.0, g: 0.0, emission: None });
        let glass = world.dielectric(1.4, 0.0);
        world.body(&smooth(&bumpy_sphere(2, 0.2)), glass, Some(medium), None);
        let fog = world.dielectric(1.0, 0.0);
        let shape = world.body(&ball(0.7), fog, Some(medium), None);
        world.0.shapes[shape].object_to_world = Mat4::from_translation(Vec3::X * 2.0);
        lamp_overhead(world, true).environment(0.3)
    };
    // Extinctions 1 : 1.3 : 2.5, absorption of each.
    same_lanes("glass and fog", world, 2.3, [3.0, 0.2, 10.0], [9.0, 16.0, 20.0]);
}

/// Returns a direction from the eye to somewhere between two x, not far above or below the middle.
fn towards(key: u64, i: u64, left: f32, right: f32) -> Vec3 {
    let mut rng = Stream::new(&[key, i]);
    let [u, v] = rng.uniform2();
    (Vec3::new(left + (right - left) * u, 0.0, v - 0.5) - EYE).normalize()
}

/// Compares each lane with the same wavelength alone, flight by flight, from the left body to `right`. Slow: .2 %.
fn same_lanes(
    what: &str,
    world: impl Fn(SpectrumDescription, SpectrumDescription) -> World,
    right: f32,
    sigma_a: [f32; 3],
    sigma_s: [f32; 3],
) {
    let together =
        world(SpectrumDescription::Rgb(sigma_a), SpectrumDescription::Rgb(sigma_s)).tracer().by(Policy::Guided);
    let n = samples(120_000, 12);
    let lanes = measure(n, |i| {
        let (o, d) = (EYE, towards(192, i, -0.6, right));
        let hero = Stream::new(&[193, i]).uniform();
        let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, hero);
        let light = together.follow(i, o, d, &w).0;
        w.to_rgb(light.orders.iter().fold(Spectrum::ZERO, |a, l| a + *l)).map(f64::from)
    });
    together.assert_sound();
    for c in 0..3 {
        let [a, s] = [sigma_a[c], sigma_s[c]].map(SpectrumDescription::Constant);
        let alone = world(a, s).tracer().by(Policy::Classic);
        let [e] = measure(n, |i| {
            let (o, d) = (EYE, towards(194, i, -0.6, right));
            let w = Wavelengths::<1>::Fixed(550.0);
            let light = alone.follow(i, o, d, &w).0;
            [f64::from(w.to_rgb(light.orders.iter().fold(Spectrum::ZERO, |a, l| a + *l))[0])]
        });
        assert_equal(&format!("{what}, lane {c} guided"), lanes[c], e);
    }
}

#[test]
fn an_audit_clears_guided_walks() {
    for (g, eta) in [(0.0f32, 1.0f32), (0.8, 1.4)] {
        let world = layer(300.0, 0.2, 0.8 / (1.0 - g), g, eta).environment(1.0);
        let (guided, plain) = (world.tracer().by(Policy::Guided), world.tracer());
        let found = audit(&guided.scene, &guided.integrator, &plain.scene, [0, 16, 0, 16], samples(64, 8));
        println!("{:+.4} +- {:.4}, worst block {:.1}", found.relative().0, found.relative().1, found.worst_block);
        assert!(!found.differs() && !found.blocks_differ() && found.pairs >= 64 * 256, "{found:?}");
        assert!(found.difference.std_err > 0.0);
    }
}

#[test]
fn bodies_that_absorb_under_a_sky_are_walked_by_guides_on_their_own_accord() {
    // Noise of `auto` is that of two `guided` walks where it pays. Slow: .2 %.
    let make = |sky: bool| {
        let mut world = World::new();
        let jade = world.medium(5.0, 20.0, 0.0);
        let boundary = world.dielectric(if sky { 1.4 } else { 1.0 }, 0.0);
        world.body(&smooth(&bumpy_sphere(3, 0.1)), boundary, Some(jade), None);
        if sky { world.environment(1.0) } else { lamp_overhead(world, true) }
    };
    let see = |policy: Policy| {
        let tracer = make(true).tracer().by(policy);
        let [l] = measure(samples(30_000, 12), |i| [tracer.radiance(i, EYE, towards(196, i, -0.6, 0.6))]);
        tracer.assert_sound();
        l
    };
    let [plain, auto, guided] = [Policy::Classic, Policy::Auto, Policy::Guided].map(see);
    println!("{plain} {auto} {guided}");
    assert_equal("sky, auto", auto, plain);
    assert_equal("sky, guided", guided, plain);
    assert!(plain.std_err > 1.5 * auto.std_err && (0.6..0.85).contains(&(auto.std_err / guided.std_err)));
    // Under a lamp they are the same paths (without a boundary one walk each).
    let [plain, auto] = [Policy::Classic, Policy::Auto].map(|p| {
        let mut tracer = make(false).tracer().by(p);
        tracer.integrator.seed = 9;
        tracer
    });
    for i in 0..2000 {
        let d = towards(197, i, -0.6, 0.6);
        assert_eq!(auto.radiance(i, EYE, d), plain.radiance(i, EYE, d), "path {i}");
    }
}

#[test]
fn half_spaces_under_a_lamp_are_as_bright_by_guided_walks_as_by_flights() {
    // Looks, connections and chance share one large lamp. Slow: .3 to .5 %.
    for (sigma_a, sigma_s, g) in [(0.2f32, 4.0f32, 0.8f32), (0.5, 2.5, 0.8), (0.3, 0.7, 0.0)] {
        let make = || {
            let mut world = layer(300.0, sigma_a, sigma_s, g, 1.4);
            world.emitter(&flat(&cuboid(Vec3::new(-4.0, -4.0, 2.0), Vec3::new(4.0, 4.0, 2.5))), 1.0);
            world.tracer()
        };
        let what = format!("half-space under a lamp, {sigma_a} {sigma_s} {g}");
        assert_same(&what, make, Vec3::new(-0.3, 0.0, 1.0), Vec3::ZERO, 0.1, 60_000);
    }
}
