//! Walks through similar media: exact in those, off by a measured error from what they stand for.

use moonmilk_core::{Random, Spectrum, Stream, Vec3, Wavelengths};
use moonmilk_geometry::generate::bumpy_sphere;
use moonmilk_optics::fresnel::reflectance_f64;
use moonmilk_optics::halfspace::{Anisotropic, Illumination};
use moonmilk_render::description::{MediumKind, SpectrumDescription};
use moonmilk_render::scene::Similarity;

use crate::bodies::Body;
use crate::common::{World, assert_equal, assert_exact, measure, samples, smooth, uniform_ray};
use crate::connections::{EYE, assert_same_light, lamp_overhead};
use crate::furnace::assert_white;
use crate::half_space::{layer, look};

/// Returns the exact albedo of a half-space for light along the normal: reduced albedo .9.
fn exact(g: f32, eta: f32) -> f64 {
    let sigma_s = 0.9 / (1.0 - g);
    let operator = Anisotropic::new(f64::from(g), f64::from(eta), Illumination::Normal).expect("valid");
    operator.albedo(f64::from(sigma_s / (0.1 + sigma_s))).expect("valid")
}

#[test]
fn a_half_space_under_similarity_reflects_as_the_isotropic_one_and_that_is_not_the_exact_one() {
    // Reduced albedo .9, g .8; six digits of the notes, 8.1, for isotropic scatterers. Slow: .1 %.
    for (eta, normal) in [(1.0f32, 0.414947), (1.5, 0.229082)] {
        let tracer = layer(300.0, 0.1, 4.5, 0.8, eta).environment(1.0).similar(Similarity::First);
        let [e] = measure(samples(40_000, 60), |i| [look(&tracer, i, 1.0)]);
        let f = reflectance_f64(1.0, f64::from(eta));
        assert_exact(&format!("similar half-space, eta {eta}"), e, f + (1.0 - f) * normal, 1e-6);
        // What similarity costs here, from the exact solution: more than the noise above.
        let exact = exact(0.8, eta);
        println!("similarity of order 1, eta {eta}: albedo {normal} instead of {exact}");
        assert!((normal / exact - 1.0).abs() > 0.05, "{exact}");
    }
}

#[test]
fn similarity_of_third_order_is_off_by_less_than_half_of_what_the_first_order_is() {
    // Reduced albedo .9. Excess over the exact albedo, measured with 2.4 million paths to .0006 and .0009 of it; the slack is four times that.
    for (g, eta, excess, error, first) in [(0.8f32, 1.0f32, -0.0094, 6e-4, 0.0769), (0.8, 1.5, 0.0242, 9e-4, 0.0564)] {
        let tracer = layer(300.0, 0.1, 0.9 / (1.0 - g), g, eta).environment(1.0).similar(Similarity::Third);
        let [e] = measure(samples(150_000, 16), |i| [look(&tracer, i, 1.0)]);
        tracer.assert_sound();
        let (f, exact) = (reflectance_f64(1.0, f64::from(eta)), exact(g, eta));
        let what = format!("half-space under similarity of third order, g {g}, eta {eta}");
        assert_exact(&what, e, f + (1.0 - f) * exact * (1.0 + excess), 4.0 * error * (1.0 - f) * exact);
        let off = ((e.mean - f) / (1.0 - f) / exact - 1.0).abs();
        println!("excess {excess} +- {error}; here {off:.4}, first order {first}");
        assert!(off < 0.5 * first);
    }
}

#[test]
fn every_single_path_finds_white_under_similarity_of_third_order() {
    for (body, tau, g, eta) in [(Body::smooth(), 10.0, 0.9, 1.33), (Body::ball(), 30.0, 0.6, 1.5)] {
        let tracer = body.world(tau, g, eta).environment(1.0).similar(Similarity::Third);
        let what = format!("{} under similarity, {tau} mean free paths, g {g}, eta {eta}", body.name);
        assert_white(&what, tracer, body.reach, samples(10_000, 4));
    }
    // Light is looked for at every collision where nothing refracts.
    let body = Body::bumpy();
    let tracer = body.world(6.0, 0.9, 1.0).environment(1.0).similar(Similarity::Third);
    let [l] = measure(samples(60_000, 16), |i| {
        let (o, d) = uniform_ray(22, i, body.reach);
        [tracer.radiance(i, o, d)]
    });
    tracer.assert_sound();
    assert_exact("furnace of fog under similarity of third order", l, 1.0, 0.0);
}

#[test]
fn sampled_light_equals_light_found_by_chance_under_similarity() {
    for eta in [1.0f32, 1.4] {
        let make = |sampled| {
            let mut world = World::new();
            let milk = world.medium(0.05, 12.0, 0.8);
            let glass = world.dielectric(eta, 0.0);
            world.body(&smooth(&bumpy_sphere(2, 0.2)), glass, Some(milk), None);
            lamp_overhead(world, sampled).similar(Similarity::Third)
        };
        let what = format!("milk under similarity of third order, eta {eta}");
        assert_same_light(&what, make, EYE, Vec3::ZERO, 0.5, [60_000, 100_000]);
    }
}

#[test]
fn similar_media_scatter_less_in_every_lane_and_absorb_as_before() {
    // Four wavelengths together and each alone.
    let mut world = World::new();
    let [a, s] = [[(400.0, 0.3), (700.0, 0.02)], [(400.0, 12.0), (700.0, 4.0)]];
    let sampled = |x: [(f32, f32); 2]| SpectrumDescription::Sampled(x.to_vec());
    let kind = MediumKind::Homogeneous { sigma_a: sampled(a), sigma_s: sampled(s), scale: 1.0, g: 0.7, emission: None };
    let medium = world.medium_of(kind);
    let boundary = world.dielectric(1.3, 0.0);
    world.body(&smooth(&bumpy_sphere(2, 0.2)), boundary, Some(medium), None);
    let world = world.environment(1.0);
    let lambda = [420.0f32, 500.0, 610.0, 690.0];
    let tracer = world.similar(Similarity::Third);
    let n = samples(60_000, 16);
    let total = |orders: [f32; 3]| orders.iter().map(|&x| f64::from(x)).sum::<f64>();
    let together: [_; 4] = measure(n, |i| {
        let (o, d) = uniform_ray(56, i, 1.3);
        // Each of the four is the hero in turn.
        let first = (Stream::new(&[57, i]).uniform() * 4.0) as usize % 4;
        let turned: [f32; 4] = std::array::from_fn(|k| lambda[(first + k) % 4]);
        let w = Wavelengths::Sampled { lambda: turned, pdf: [1.0; 4] };
        let light = tracer.follow(i, o, d, &w).0;
        std::array::from_fn(|k| total(light.orders.map(|o: Spectrum<4>| o[(k + 4 - first) % 4])))
    });
    for (k, nm) in lambda.into_iter().enumerate() {
        let mut alone = world.similar(Similarity::Third);
        alone.integrator.seed = 2;
        let [e] = measure(n, |i| {
            let (o, d) = uniform_ray(58, i, 1.3);
            [total(alone.follow(i, o, d, &Wavelengths::<1>::Fixed(nm)).0.orders.map(|o| o[0]))]
        });
        assert_equal(&format!("similar medium at {nm} nm"), together[k], e);
    }
}
