//! The hybrid of exact walks near the surface and diffusion in the core, against exact walks.

use moonmilk_core::{Spectrum, Vec3, Wavelengths};
use moonmilk_geometry::generate::bumpy_sphere;
use moonmilk_optics::fresnel::reflectance_f64;
use moonmilk_optics::halfspace::{Anisotropic, Illumination};
use moonmilk_render::description::{LightKind, MediumKind, SpectrumDescription};

use crate::bodies::Body;
use crate::common::{World, assert_equal, assert_exact, ball, measure, rectangle, samples, smooth, uniform_ray};
use crate::furnace::assert_white;
use crate::half_space::{layer, look};

#[test]
fn every_single_path_finds_white_under_the_hybrid() {
    // No energy is lost or made: without absorption every weight is 1.
    for (body, tau, g, eta) in [(Body::smooth(), 40.0, 0.9, 1.33), (Body::ball(), 60.0, 0.0, 1.5)] {
        let tracer = body.world(tau, g, eta).environment(1.0).hybrid();
        let what = format!("{} under the hybrid, {tau} mean free paths, g {g}, eta {eta}", body.name);
        assert_white(&what, tracer, body.reach, samples(4_000, 4));
    }
}

#[test]
fn a_half_space_under_the_hybrid_reflects_what_the_exact_one_does() {
    for (alpha_prime, g, eta) in [(0.9f32, 0.0f32, 1.0f32), (0.99, 0.0, 1.5), (0.9, 0.8, 1.3)] {
        let scattering = alpha_prime / (1.0 - g);
        let tracer = layer(300.0, 1.0 - alpha_prime, scattering, g, eta).environment(1.0).hybrid();
        let [e] = measure(samples(60_000, 40), |i| [look(&tracer, i, 1.0)]);
        tracer.assert_sound();
        let alpha = f64::from(scattering / (1.0 - alpha_prime + scattering));
        let exact =
            Anisotropic::new(f64::from(g), f64::from(eta), Illumination::Normal).unwrap().albedo(alpha).unwrap();
        let f = reflectance_f64(1.0, f64::from(eta));
        let exact = f + (1.0 - f) * exact;
        // An approximation: its error is below .2 % here, measured with forty times the paths.
        assert_exact(&format!("half-space under the hybrid, {alpha_prime} {g} {eta}"), e, exact, 2e-3 * exact);
    }
}

#[test]
fn no_jump_passes_over_a_lamp_inside() {
    // A point light in the middle of an index-matched ball: all that comes out was scattered or came straight.
    let mut world = World::new();
    let medium = world.medium(0.02, 12.0, 0.0);
    let boundary = world.dielectric(1.0, 0.0);
    world.body(&ball(1.0), boundary, Some(medium), None);
    let intensity = SpectrumDescription::Constant(1.0);
    world.light(LightKind::Point { intensity, from: Vec3::new(0.1, 0.0, 0.2) });
    let see = |t: &crate::common::Tracer, seed: u64, n: u64| {
        let [e] = measure(n, |i| {
            let (o, d) = uniform_ray(seed, i, 1.2);
            [t.radiance(i, o, d)]
        });
        e
    };
    let (exact, hybrid) = (see(&world.tracer(), 7, samples(20_000, 16)), see(&world.hybrid(), 8, samples(20_000, 16)));
    assert_equal("hybrid and exact around a lamp inside", hybrid, exact);
}

#[test]
fn bodies_under_the_hybrid_look_as_exact_ones_in_every_lane() {
    // Lit from one side: the far side gets what went through the core. Lanes differ in both coefficients.
    let at = |x: [f32; 3]| SpectrumDescription::Sampled([450.0, 550.0, 650.0].into_iter().zip(x).collect());
    let (a, s) = ([0.02, 0.005, 0.05], [16.0, 20.0, 24.0]);
    let body = |eta: f32| {
        let kind = MediumKind::Homogeneous { sigma_a: at(a), sigma_s: at(s), scale: 1.0, g: 0.5, emission: None };
        let mut world = World::new();
        let medium = world.medium_of(kind);
        let boundary = world.dielectric(eta, 0.0);
        world.body(&smooth(&bumpy_sphere(4, 0.1)), boundary, Some(medium), None);
        world
    };
    let matched = body(1.0).distant(Vec3::Z, 2.0);
    let mut refractive = body(1.3);
    refractive.emitter(&rectangle(Vec3::Z * 3.0, Vec3::Y * 2.0, Vec3::X * 2.0), 3.0);
    let lambda = [550.0f32, 450.0, 650.0];
    let w = Wavelengths::Sampled { lambda, pdf: [1.0; 3] };
    let see = |t: &crate::common::Tracer, far: bool, n: u64| -> [moonmilk_core::Estimate; 3] {
        measure(n, |i| {
            let (o, d) = uniform_ray(if far { 5 } else { 6 }, i, 1.4);
            // Onto the far or the near half.
            let flip = if (o.z > 0.0) == far { Vec3::new(1.0, 1.0, -1.0) } else { Vec3::ONE };
            let (light, _) = t.follow(i, o * flip, d * flip, &w);
            let sum = light.orders.iter().fold(Spectrum::<3>::ZERO, |s, o| s + *o);
            std::array::from_fn(|k| f64::from(sum[k]))
        })
    };
    for (name, world) in [("distant light, matched", matched), ("lamp, eta 1.3", refractive)] {
        let (exact, hybrid) = (world.tracer(), world.hybrid());
        for far in [true, false] {
            let (x, h) = (see(&exact, far, samples(15_000, 16)), see(&hybrid, far, samples(30_000, 16)));
            for k in 0..3 {
                assert_equal(&format!("hybrid and exact, {name}, at {} nm, far {far}", lambda[k]), h[k], x[k]);
            }
        }
    }
}
