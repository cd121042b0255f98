//! Half-spaces and slabs as scenes: boxes so wide that their sides cannot be noticed.
//!
//! A box reaches 1e4 mean free paths to every side of the point looked at. Light that wanders there is damped by
//! exp(-kappa_0 1e4) with kappa_0 >= .05 (alpha <= .999), or by exp(-pi 1e4 / tau) in a slab without absorption: nothing of it
//! is left in f64. By reciprocity, radiance under uniform light is the albedo for light that arrives from the eye's direction.

use moonmilk_core::{Random, Spectrum, Stream, Vec3};
use moonmilk_geometry::generate::cuboid;
use moonmilk_optics::fresnel::{moment_1, reflectance_f64};
use moonmilk_optics::halfspace::{HFunction, HalfSpace, Illumination};
use moonmilk_optics::slab;
use moonmilk_render::description::{SpectrumDescription, SubsurfaceMedium};

use crate::common::{Tracer, World, assert_exact, cosine, flat, measure, rectangle, samples};

/// Half the width of a box [mean free paths].
const FAR: f32 = 1e4;

/// Returns a box of medium below z = 0.
pub fn layer(thickness: f32, sigma_a: f32, sigma_s: f32, g: f32, eta: f32) -> World {
    let mut world = World::new();
    let medium = world.medium(sigma_a, sigma_s, g);
    let boundary = world.dielectric(eta, 0.0);
    let shape = cuboid(Vec3::new(-FAR, -FAR, -thickness), Vec3::new(FAR, FAR, 0.0));
    world.body(&flat(&shape), boundary, Some(medium), None);
    world
}

/// Returns a half-space of isotropic scatterers and unit extinction; what reaches its bottom comes back with exp(-2 kappa_0 depth),
/// below 1e-14.
fn half_space(alpha: f32, eta: f32) -> World {
    layer(300.0, 1.0 - alpha, alpha, 0.0, eta)
}

/// Adds a black screen at a height.
pub fn screen(mut world: World, z: f32) -> World {
    let black = world.diffuse(0.0);
    world.surface(&rectangle(Vec3::Z * z, Vec3::X * 1e6, Vec3::Y * 1e6), black);
    world
}

/// Returns path i of an eye above the boundary that looks down with the cosine mu, somewhere near the middle.
pub fn look(tracer: &Tracer, i: u64, mu: f32) -> f64 {
    let mut rng = Stream::new(&[41, i]);
    let [x, y] = rng.uniform2();
    let d = Vec3::new((1.0 - mu * mu).sqrt(), 0.0, -mu);
    tracer.radiance(i, Vec3::new(x, y, 0.0) - d, d)
}

/// Returns path i of an eye that looks down in all directions, by the cosine.
pub fn look_everywhere(tracer: &Tracer, i: u64) -> f64 {
    let mut rng = Stream::new(&[42, i]);
    let [x, y] = rng.uniform2();
    let d = cosine(rng.uniform2(), -Vec3::Z);
    tracer.radiance(i, Vec3::new(x, y, 0.0) - d * 0.1, d)
}

#[test]
fn half_spaces_reflect_uniform_light_as_the_exact_solution_says() {
    // Albedos of entered light: physics notes 8.1, normal and Lambertian incidence outside, six digits. Slow: .1 %.
    for (alpha, eta, normal, diffuse, n) in [
        (0.5f32, 1.0f32, 0.115226, 0.146544, 60_000),
        (0.9, 1.0, 0.414947, 0.478024, 40_000),
        (0.99, 1.0, 0.752721, 0.794564, 10_000),
        (0.8, 1.33, 0.173684, 0.185049, 60_000),
        (0.99, 1.33, 0.645854, 0.659795, 20_000),
        (0.9, 1.5, 0.229082, 0.237951, 60_000),
        (0.98, 1.5, 0.480701, 0.490996, 30_000),
        (0.999, 1.5, 0.834853, 0.839511, 5_000),
    ] {
        let tracer = half_space(alpha, eta).environment(1.0).tracer();
        let [e, d] = measure(samples(n, 60), |i| [look(&tracer, i, 1.0), look_everywhere(&tracer, i)]);
        tracer.assert_sound();
        // Entered light is what Fresnel leaves of it; the rest is mirrored into an equally bright sky.
        let with_mirror = |f: f64, a: f64| f + (1.0 - f) * a;
        let normal = with_mirror(reflectance_f64(1.0, f64::from(eta)), normal);
        let diffuse = with_mirror(2.0 * moment_1(1.0 / f64::from(eta)), diffuse);
        assert_exact(&format!("half-space, alpha {alpha}, eta {eta}, normal"), e, normal, 1e-6);
        assert_exact(&format!("half-space, alpha {alpha}, eta {eta}, diffuse"), d, diffuse, 1e-6);
    }
}

#[test]
fn half_spaces_seen_at_an_angle_reflect_as_the_exact_solution_says() {
    // Slow: .1 %.
    for (alpha, eta, mu) in [(0.9f32, 1.0f32, 0.3f32), (0.95, 1.5, 0.2), (0.95, 1.5, 0.6)] {
        let tracer = half_space(alpha, eta).environment(1.0).tracer();
        let [e] = measure(samples(40_000, 20), |i| [look(&tracer, i, mu)]);
        tracer.assert_sound();
        let (alpha, eta, mu) = (f64::from(alpha), f64::from(eta), f64::from(mu));
        let f = reflectance_f64(mu, eta);
        let inside = (1.0 - (1.0 - mu * mu) / (eta * eta)).sqrt();
        let a = HalfSpace::new(alpha, eta).unwrap().albedo(Illumination::Inside(inside));
        assert_exact(&format!("half-space, alpha {alpha}, eta {eta}, mu {mu}"), e, f + (1.0 - f) * a, 1e-6);
    }
}

#[test]
fn a_subsurface_material_has_the_albedo_that_was_asked_for() {
    // Reflectance asked for at normal incidence, of entered light; the inversion is a table within 1e-4 of the exact one. Slow: .1 %.
    for (albedo, eta) in [(0.3f32, 1.3f32), (0.8, 1.5)] {
        let mut world = World::new();
        let [reflectance, mfp] = [albedo, 1.0].map(|x| world.spectrum(SpectrumDescription::Constant(x)));
        let material = world.subsurface(SubsurfaceMedium::Reflectance { reflectance, mfp }, 0.0, eta);
        let shape = cuboid(Vec3::new(-FAR, -FAR, -300.0), Vec3::new(FAR, FAR, 0.0));
        world.surface(&flat(&shape), material);
        let tracer = world.environment(1.0).tracer();
        let [e] = measure(samples(30_000, 40), |i| [look(&tracer, i, 1.0)]);
        tracer.assert_sound();
        let f = reflectance_f64(1.0, f64::from(eta));
        let exact = f + (1.0 - f) * f64::from(albedo);
        assert_exact(&format!("subsurface of albedo {albedo}, eta {eta}"), e, exact, 1e-4 * exact);
    }
}

#[test]
fn slabs_reflect_and_transmit_as_published() {
    // Lit on one side alone: a black screen hides the sky below or above. Light that slips in sideways between slab
    // and screen, 1 apart over 1e4, is below 1e-8. Slow: .05 and .1 % of all.
    let (reflected, transmitted) = slab::VAN_DE_HULST;
    let thin = || layer(2.0, 0.1, 0.9, 0.75, 1.0).environment(1.0);
    let thick = || layer(20.0, 0.0, 1.0, 0.0, 1.0).environment(1.0);
    let below = |world: World, z: f32| screen(world, z).tracer();
    // Published to five digits.
    let (digit, tau) = (5e-6, 20.0);
    let cases = [
        ("van de Hulst's slab reflects", below(thin(), -3.0), reflected, digit, 200_000, 20),
        ("van de Hulst's slab transmits", below(thin(), 2.0), transmitted, digit, 100_000, 20),
        ("a thick slab transmits", below(thick(), 2.0), slab::conservative_transmittance(tau), 1e-7, 20_000, 1000),
        ("a thick slab reflects", below(thick(), -21.0), 1.0 - slab::conservative_transmittance(tau), 1e-7, 20_000, 20),
    ];
    for (what, tracer, exact, slack, n, slow) in cases {
        let [e] = measure(samples(n, slow), |i| [look(&tracer, i, 1.0)]);
        tracer.assert_sound();
        assert_exact(what, e, exact, slack);
    }
    let tracer = below(thick(), 2.0);
    let [e] = measure(samples(20_000, 500), |i| [look_everywhere(&tracer, i)]);
    assert_exact("a thick slab transmits diffuse light", e, slab::conservative_transmittance_diffuse(tau), 1e-7);
}

#[test]
fn a_half_space_in_parallel_light_shines_at_the_angles_of_chandrasekhar() {
    // Radiance under irradiance E at cosine mu_i: mu_i E alpha H(mu) H(mu_i) / (4 pi (mu + mu_i)). Every contribution comes
    // through shadow rays across the index-matched boundary. Slow: .1 %.
    for (alpha, mu_i, mus, n) in [
        (0.9f32, 1.0f32, &[0.1f32, 0.25, 0.5, 0.75, 1.0][..], 30_000),
        (0.5, 0.5, &[0.25, 0.9], 40_000),
        (0.99, 0.7, &[0.5], 10_000),
    ] {
        let towards = Vec3::new(0.0, (1.0 - mu_i * mu_i).sqrt(), mu_i);
        let tracer = half_space(alpha, 1.0).distant(towards, 3.0).tracer();
        let h = HFunction::new(f64::from(alpha)).unwrap();
        for &mu in mus {
            let [e] = measure(samples(n, 64), |i| [look(&tracer, i, mu)]);
            let exact = 3.0 * f64::from(mu_i) * h.brdf(f64::from(mu_i), f64::from(mu));
            assert_exact(&format!("emission at {mu}, alpha {alpha}, light at {mu_i}"), e, exact, 0.0);
        }
        tracer.assert_sound();
    }
}

#[test]
fn orders_of_scattering_of_a_half_space_are_those_of_the_closed_forms() {
    // Normal incidence, index-matched: single (alpha / 2) (1 - ln 2), double alpha^2 / 48 (pi^2 - 6 (ln^2 2 + 2 ln 2 - 1)). Slow: .1 %.
    let alpha = 0.7f32;
    let mut tracer = half_space(alpha, 1.0).environment(1.0).tracer();
    let l = 2f64.ln();
    let a = f64::from(alpha);
    let single = 0.5 * a * (1.0 - l);
    let double = a * a / 48.0 * (std::f64::consts::PI.powi(2) - 6.0 * (l * l + 2.0 * l - 1.0));
    let w = moonmilk_core::Wavelengths::<1>::Fixed(550.0);
    let orders = |tracer: &Tracer, i: u64| -> [f64; 3] {
        let light = tracer.follow(i, Vec3::new(0.3, 0.2, 1.0), -Vec3::Z, &w).0;
        light.orders.map(|o: Spectrum<1>| f64::from(o[0]))
    };
    let [zero, one, _] = measure(samples(40_000, 64), |i| orders(&tracer, i));
    assert_eq!(zero.mean, 0.0, "no light passes a half-space without a collision");
    assert_exact("light scattered once", one, single, 0.0);
    // The film knows no order 2 alone: cut paths there.
    tracer.integrator.max_depth = Some(2);
    let [_, one, two] = measure(samples(40_000, 64), |i| orders(&tracer, i));
    assert_exact("light scattered once, of paths cut at 2", one, single, 0.0);
    assert_exact("light scattered twice", two, double, 0.0);
}
