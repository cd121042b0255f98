//! Walks that jump over balls of the medium: the same means as flight by flight, and exact values.

use moonmilk_core::{Mat4, Stream, Vec3, WavelengthMode, Wavelengths};
use moonmilk_core::{Random, Spectrum};
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_optics::halfspace::{Anisotropic, Illumination};
use moonmilk_optics::slab;
use moonmilk_render::audit::audit;
use moonmilk_render::description::{LightKind, MediumKind, SpectrumDescription};
use moonmilk_render::integrator::Policy;
use moonmilk_render::scene::Similarity;

use crate::bodies::{Body, shells};
use crate::common::{
    Tracer, World, assert_equal, assert_exact, ball, flat, measure, rectangle, samples, smooth, uniform_ray,
};
use crate::connections::{EYE, lamp_overhead};
use crate::furnace::assert_white;
use crate::half_space::{layer, look, look_everywhere, screen};

#[test]
fn every_single_path_finds_white_by_jumps() {
    for body in Body::all() {
        for (tau, eta) in [(3.0, 1.33), (30.0, 1.5), (1000.0, 1.5)] {
            let tracer = body.world(tau, 0.0, eta).environment(1.0).tracer().by(Policy::Jump);
            let what = format!("{} by jumps, {tau} mean free paths, eta {eta}", body.name);
            assert_white(&what, tracer, body.reach, samples(if tau < 50.0 { 10_000 } else { 3000 }, 4));
        }
    }
}

#[test]
fn half_spaces_by_jumps_reflect_what_the_exact_solution_says() {
    // Physics notes 8.1, as for walks flight by flight. Slow: .05 to .1 %.
    for (alpha, eta, normal, diffuse, n) in [
        (0.9f32, 1.0f32, 0.414947, 0.478024, 40_000),
        (0.99, 1.0, 0.752721, 0.794564, 20_000),
        (0.99, 1.33, 0.645854, 0.659795, 30_000),
        (0.98, 1.5, 0.480701, 0.490996, 40_000),
        (0.999, 1.5, 0.834853, 0.839511, 20_000),
    ] {
        let tracer = layer(300.0, 1.0 - alpha, alpha, 0.0, eta).environment(1.0).tracer().by(Policy::Jump);
        let [at_normal, all] = measure(samples(n, 12), |i| [look(&tracer, i, 1.0), look_everywhere(&tracer, i)]);
        assert!(tracer.assert_sound().jumps > n / 4);
        let eta = f64::from(eta);
        let entered = |albedo: f64, f: f64| f + (1.0 - f) * albedo;
        let f = moonmilk_optics::fresnel::reflectance_f64(1.0, eta);
        assert_exact(&format!("normal, {alpha} {eta}, by jumps"), at_normal, entered(normal, f), 1e-6);
        let f = 2.0 * moonmilk_optics::fresnel::moment_1(1.0 / eta);
        assert_exact(&format!("diffuse, {alpha} {eta}, by jumps"), all, entered(diffuse, f), 1e-6);
    }
}

#[test]
fn thick_slabs_by_jumps_transmit_what_the_exact_solution_says() {
    // A sky below a slab without absorption, seen from above.
    for (tau, n) in [(10.0f32, 60_000), (100.0, 60_000), (1000.0, 60_000)] {
        let tracer = screen(layer(tau, 0.0, 1.0, 0.0, 1.0).environment(1.0), 2.0).tracer().by(Policy::Jump);
        let [e] = measure(samples(n, 16), |i| [look_everywhere(&tracer, i)]);
        tracer.assert_sound();
        assert_exact(
            &format!("slab of {tau} by jumps"),
            e,
            slab::conservative_transmittance_diffuse(f64::from(tau)),
            0.0,
        );
    }
}

/// Compares both policies through a window around a target; where scattering is not isotropic, jumps take exits from banks of as many records.
fn assert_same(what: &str, make: impl Fn() -> Tracer, eye: Vec3, target: Vec3, window: f32, n: u64) {
    let [classic, jump] = [Policy::Classic, Policy::Jump].map(|policy| {
        let tracer = make().by(policy).with_banks(samples(32, 12));
        let [l] = measure(samples(n, 12), |i| {
            let mut rng = Stream::new(&[91, i, policy as u64]);
            let [x, y, z] = [rng.uniform(), rng.uniform(), rng.uniform()].map(|u| (2.0 * u - 1.0) * window);
            [tracer.radiance(i, eye, (target + Vec3::new(x, y, z) - eye).normalize())]
        });
        let c = tracer.assert_sound();
        assert_eq!(c.jumps > 0, policy == Policy::Jump, "{what}: {c:?}");
        l
    });
    assert_equal(what, jump, classic);
}

#[test]
fn lamps_shine_through_boundaries_by_jumps_as_by_flights() {
    // Connections at collisions that jump and at exits, chance through balls: all meet here. Slow: .15 to .3 %.
    for (eta, roughness, sigma_s) in [(1.4f32, 0.0f32, 8.0f32), (1.4, 0.0, 40.0), (1.0, 0.0, 12.0), (1.5, 0.2, 10.0)] {
        let make = || {
            let mut world = World::new();
            let milk = world.medium(0.05, sigma_s, 0.0);
            let boundary = world.dielectric(eta, roughness);
            world.body(&smooth(&bumpy_sphere(2, 0.2)), boundary, Some(milk), None);
            let floor = world.diffuse(0.5);
            world.surface(&rectangle(Vec3::Z * -1.3, Vec3::X * 3.0, Vec3::Y * 3.0), floor);
            lamp_overhead(world, true).tracer()
        };
        assert_same(&format!("milk under a lamp, {eta} {roughness} {sigma_s}"), make, EYE, Vec3::ZERO, 0.5, 60_000);
    }
}

#[test]
fn lights_bodies_and_cameras_inside_stop_jumps() {
    let lamp = || {
        let mut world = World::new();
        let milk = world.medium(0.02, 15.0, 0.0);
        let boundary = world.dielectric(1.0, 0.0);
        world.body(&ball(1.0), boundary, Some(milk), None);
        let intensity = SpectrumDescription::Constant(1.0);
        world.light(LightKind::Point { intensity, from: Vec3::new(0.1, 0.0, 0.2) });
        world.tracer()
    };
    assert_same("point light in a ball", lamp, EYE, Vec3::ZERO, 0.7, 60_000);
    for eta in [1.0f32, 1.4] {
        let make = || {
            let mut world = World::new();
            let milk = world.medium(0.1, 15.0, 0.0);
            let boundary = world.dielectric(eta, 0.0);
            world.body(&flat(&bumpy_sphere(2, 0.1)), boundary, Some(milk), None);
            world.emitter(&flat(&cuboid(Vec3::new(-0.2, -0.3, -0.1), Vec3::new(0.1, 0.2, 0.3))), 4.0);
            world.tracer()
        };
        assert_same(&format!("lamp in milk, eta {eta}"), make, EYE, Vec3::ZERO, 0.5, 60_000);
    }
    // A dark clot, and the eye itself inside.
    let clot = || {
        let mut world = World::new();
        let milk = world.medium(0.05, 15.0, 0.0);
        let boundary = world.dielectric(1.3, 0.0);
        world.body(&flat(&bumpy_sphere(2, 0.1)), boundary, Some(milk), None);
        let dark = world.diffuse(0.1);
        world.surface(&ball(0.3), dark);
        lamp_overhead(world, true).environment(0.5).tracer()
    };
    assert_same("clot in milk", clot, EYE, Vec3::ZERO, 0.5, 60_000);
    assert_same("eye in milk", clot, Vec3::new(0.0, -0.6, 0.1), Vec3::ZERO, 0.5, 30_000);
}

#[test]
fn nested_bodies_keep_white_by_jumps() {
    let (mut world, reach, _) = shells();
    for m in &mut world.0.media {
        m.kind = MediumKind::Homogeneous {
            sigma_a: SpectrumDescription::Constant(0.0),
            sigma_s: SpectrumDescription::Constant(25.0),
            scale: 1.0,
            g: 0.0,
            emission: None,
        };
    }
    assert_white("shells by jumps", world.environment(1.0).tracer().by(Policy::Jump), reach, samples(10_000, 4));
}

#[test]
fn lanes_of_different_extinction_jump_together_without_bias() {
    // Extinctions 1 : 1.3 : 2.5, absorption of each; each lane against the same wavelength alone, flight by flight. Slow: .1 %.
    let (sigma_a, sigma_s) = ([0.3f32, 0.02, 1.0], [12.0f32, 16.0, 29.0]);
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
    let together =
        world(SpectrumDescription::Rgb(sigma_a), SpectrumDescription::Rgb(sigma_s)).tracer().by(Policy::Jump);
    let n = samples(120_000, 12);
    let lanes = measure(n, |i| {
        let (o, d) = uniform_ray(92, i, 2.8);
        let hero = Stream::new(&[93, i]).uniform();
        let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, hero);
        let light = together.follow(i, o, d, &w).0;
        w.to_rgb(light.orders.iter().fold(Spectrum::ZERO, |a, l| a + *l)).map(f64::from)
    });
    assert!(together.assert_sound().jumps > 1000);
    for c in 0..3 {
        let [a, s] = [sigma_a[c], sigma_s[c]].map(SpectrumDescription::Constant);
        let alone = world(a, s).tracer().by(Policy::Classic);
        let [e] = measure(n, |i| {
            let (o, d) = uniform_ray(94, i, 2.8);
            let w = Wavelengths::<1>::Fixed(550.0);
            let light = alone.follow(i, o, d, &w).0;
            [f64::from(w.to_rgb(light.orders.iter().fold(Spectrum::ZERO, |a, l| a + *l))[0])]
        });
        assert_equal(&format!("lane {c} by jumps"), lanes[c], e);
    }
}

#[test]
fn an_audit_clears_jumps_and_tells_the_bias_of_approximations() {
    // Half-spaces of reduced albedo .9: jumps are exact; similarity of the first order is 7.7 % too bright at g .8 along the normal.
    let world = |g: f32| layer(300.0, 0.1, 0.9 / (1.0 - g), g, 1.0).environment(1.0);
    let see = |tracer: &Tracer, plain: &Tracer, n: u64| {
        let found = audit(&tracer.scene, &tracer.integrator, &plain.scene, [0, 16, 0, 16], samples(n, 8));
        println!("{:+.4} +- {:.4}, worst block {:.1}", found.relative().0, found.relative().1, found.worst_block);
        found
    };
    let isotropic = world(0.0);
    let jumps = see(&isotropic.tracer().by(Policy::Jump), &isotropic.tracer(), 64);
    assert!(!jumps.differs() && !jumps.blocks_differ() && jumps.pairs >= 64 * 256, "{jumps:?}");
    assert!(jumps.difference.std_err > 0.0);
    let milk = world(0.8);
    let similar = see(&milk.similar(Similarity::First), &milk.tracer(), 256);
    assert!(similar.differs() && (0.06..0.09).contains(&similar.relative().0), "{similar:?}");
    // Plain walks against themselves are the same paths.
    let same = see(&milk.tracer().by(Policy::Classic), &milk.tracer(), 4);
    assert_eq!((same.difference.mean, same.difference.std_err), (0.0, 0.0));
}

#[test]
fn shifted_jumps_are_close_to_exact_walks() {
    // Bodies 20 transport mean free paths thick and half-spaces. An approximation: errors measured with more paths, see `walks.rs`.
    for (g, eta, alpha_prime) in [(0.9f32, 1.33f32, 0.99f32), (0.5, 1.0, 0.9), (0.8, 1.5, 0.999)] {
        let scattering = alpha_prime / (1.0 - g);
        let tracer = layer(300.0, 1.0 - alpha_prime, scattering, g, eta).environment(1.0).shifted();
        let [e] = measure(samples(30_000, 40), |i| [look(&tracer, i, 1.0)]);
        let c = tracer.assert_sound();
        assert!(c.jumps > 0, "{c:?}");
        let alpha = f64::from(scattering / (1.0 - alpha_prime + scattering));
        let exact =
            Anisotropic::new(f64::from(g), f64::from(eta), Illumination::Normal).unwrap().albedo(alpha).unwrap();
        let f = moonmilk_optics::fresnel::reflectance_f64(1.0, f64::from(eta));
        let exact = f + (1.0 - f) * exact;
        assert_exact(&format!("half-space by shifted jumps, {g} {eta} {alpha_prime}"), e, exact, 8e-3 * exact);
    }
    for (body, tau, g, eta) in [(Body::smooth(), 200.0, 0.9, 1.33), (Body::ball(), 60.0, 0.5, 1.5)] {
        let tracer = body.world(tau, g, eta).environment(1.0).shifted();
        assert_white(&format!("{} by shifted jumps", body.name), tracer, body.reach, samples(3_000, 4));
    }
}

/// Makes the picture so large that banks have the most records.
fn large(mut world: World) -> World {
    (world.0.film.width, world.0.film.height) = (512, 512);
    world
}

#[test]
fn every_single_path_finds_white_by_simulated_exits() {
    for body in Body::all() {
        for (tau, g, eta) in [(100.0, 0.9, 1.33), (30.0, 0.5, 1.5), (1000.0, 0.98, 1.33), (40.0, -0.9, 1.2)] {
            let tracer = body.world(tau, g, eta).environment(1.0).tracer().by(Policy::Jump).with_banks(4);
            let what = format!("{} by simulated exits, {tau} mean free paths, g {g}, eta {eta}", body.name);
            assert_white(&what, tracer, body.reach, samples(3000, 4));
        }
    }
}

#[test]
fn half_spaces_by_simulated_exits_reflect_what_the_exact_solution_says() {
    // Slow: .1 %.
    for (g, eta, alpha_prime, n) in [
        (0.9f32, 1.33f32, 0.99f32, 60_000),
        (0.5, 1.0, 0.9, 60_000),
        (0.8, 1.5, 0.999, 30_000),
        (-0.5, 1.0, 0.95, 60_000),
    ] {
        let scattering = alpha_prime / (1.0 - g);
        let world = large(layer(300.0, 1.0 - alpha_prime, scattering, g, eta).environment(1.0));
        let tracer = world.tracer().by(Policy::Jump).with_banks(samples(32, 20));
        let [e] = measure(samples(n, 20), |i| [look(&tracer, i, 1.0)]);
        assert!(tracer.assert_sound().jumps > n / 8);
        let alpha = f64::from(scattering / (1.0 - alpha_prime + scattering));
        let exact =
            Anisotropic::new(f64::from(g), f64::from(eta), Illumination::Normal).unwrap().albedo(alpha).unwrap();
        let f = moonmilk_optics::fresnel::reflectance_f64(1.0, f64::from(eta));
        assert_exact(&format!("half-space, g {g} {eta} {alpha_prime}"), e, f + (1.0 - f) * exact, 1e-5);
    }
}

#[test]
fn lamps_shine_through_boundaries_by_simulated_exits_as_by_flights() {
    // Connections at collisions near walls, looks and chance from exits. Slow: .15 to .3 %.
    for (eta, roughness, sigma_s, g) in
        [(1.4f32, 0.0f32, 60.0f32, 0.9f32), (1.4, 0.0, 20.0, 0.5), (1.0, 0.0, 60.0, 0.8), (1.5, 0.2, 40.0, 0.7)]
    {
        let make = || {
            let mut world = World::new();
            let milk = world.medium(0.05, sigma_s, g);
            let boundary = world.dielectric(eta, roughness);
            world.body(&smooth(&bumpy_sphere(2, 0.2)), boundary, Some(milk), None);
            let floor = world.diffuse(0.5);
            world.surface(&rectangle(Vec3::Z * -1.3, Vec3::X * 3.0, Vec3::Y * 3.0), floor);
            large(lamp_overhead(world, true)).tracer()
        };
        let what = format!("milk under a lamp, {eta} {roughness} {sigma_s} g {g}");
        assert_same(&what, make, EYE, Vec3::ZERO, 0.5, 60_000);
    }
}

#[test]
fn lights_without_extent_are_found_from_within_balls() {
    // A sun and a point, inside and outside, which no chance meets: a share of the balls is walked through for them.
    for (eta, from) in
        [(1.3f32, Vec3::new(0.4, 0.8, 2.0)), (1.0, Vec3::new(0.4, 0.8, 2.0)), (1.0, Vec3::new(0.1, 0.0, 0.2))]
    {
        let make = || {
            let mut world = World::new();
            let milk = world.medium(0.05, 40.0, 0.7);
            let boundary = world.dielectric(eta, 0.0);
            world.body(&ball(1.0), boundary, Some(milk), None);
            let intensity = SpectrumDescription::Constant(1.0);
            world.light(LightKind::Point { intensity, from });
            large(world).tracer()
        };
        assert_same(&format!("point at {from}, eta {eta}, g .7"), make, EYE, Vec3::ZERO, 0.7, 60_000);
    }
}

#[test]
fn glowing_media_keep_white_by_jumps() {
    // A medium in equilibrium with the light around it: what it absorbs it emits, over balls as well.
    for (g, sigma_s) in [(0.0f32, 30.0f32), (0.8, 100.0), (-0.4, 30.0)] {
        let mut world = World::new();
        let medium = world.glow(0.3, sigma_s, g, 1.0);
        let boundary = world.dielectric(1.0, 0.0);
        world.body(&ball(1.0), boundary, Some(medium), None);
        let tracer = large(world.environment(1.0)).tracer().by(Policy::Jump).with_banks(samples(8, 8));
        let [e] = measure(samples(60_000, 8), |i| {
            let (o, d) = uniform_ray(95, i, 1.2);
            [tracer.radiance(i, o, d)]
        });
        assert!(tracer.assert_sound().jumps > 0);
        assert_exact(&format!("glow of g {g}"), e, 1.0, 0.0);
    }
}

#[test]
fn lanes_of_different_extinction_leap_without_bias() {
    // As for tables, where the hero goes on alone. Slow: .2 %.
    let (sigma_a, sigma_s) = ([0.3f32, 0.02, 1.0], [60.0f32, 80.0, 140.0]);
    let world = |a: SpectrumDescription, s: SpectrumDescription| {
        let mut world = World::new();
        let medium =
            world.medium_of(MediumKind::Homogeneous { sigma_a: a, sigma_s: s, scale: 1.0, g: 0.8, emission: None });
        let glass = world.dielectric(1.4, 0.0);
        world.body(&smooth(&bumpy_sphere(2, 0.2)), glass, Some(medium), None);
        let fog = world.dielectric(1.0, 0.0);
        let shape = world.body(&ball(0.7), fog, Some(medium), None);
        world.0.shapes[shape].object_to_world = Mat4::from_translation(Vec3::X * 2.0);
        large(lamp_overhead(world, true).environment(0.3))
    };
    let colours = world(SpectrumDescription::Rgb(sigma_a), SpectrumDescription::Rgb(sigma_s));
    let together = colours.tracer().by(Policy::Jump).with_banks(samples(32, 12));
    let n = samples(120_000, 12);
    let sum = |l: [Spectrum<3>; 3]| l.iter().fold(Spectrum::ZERO, |a, l| a + *l);
    let lanes = measure(n, |i| {
        let (o, d) = uniform_ray(96, i, 2.8);
        let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, Stream::new(&[97, i]).uniform());
        w.to_rgb(sum(together.follow(i, o, d, &w).0.orders)).map(f64::from)
    });
    assert!(together.assert_sound().jumps > 1000);
    for c in 0..3 {
        let [a, s] = [sigma_a[c], sigma_s[c]].map(SpectrumDescription::Constant);
        let alone = world(a, s).tracer().by(Policy::Classic);
        let [e] = measure(n / 2, |i| {
            let (o, d) = uniform_ray(98, i, 2.8);
            [alone.radiance(i, o, d)]
        });
        assert_equal(&format!("lane {c} by simulated exits"), lanes[c], e);
    }
}
