//! Colour: lanes that share a path must each have the mean that they would have alone.

use moonmilk_core::color::{LAMBDA_MAX, LAMBDA_MIN, OBSERVED};
use moonmilk_core::{Random, Stream, WavelengthMode, Wavelengths};
use moonmilk_geometry::generate::bumpy_sphere;
use moonmilk_render::description::{MaterialKind, MediumKind, Roughness, SpectrumDescription, SubsurfaceMedium};

use crate::common::{Tracer, World, assert_equal, assert_exact, ball, flat, measure, samples, smooth, uniform_ray};

/// Coefficients of the three channels: extinctions 4, 2 and 7.
const SIGMA_A: [f32; 3] = [0.05, 0.4, 1.0];
const SIGMA_S: [f32; 3] = [3.95, 1.6, 6.0];

/// Returns a translucent mesh and a matched ball of fog of the same medium, side by side under the sky.
fn pair(sigma_a: SpectrumDescription, sigma_s: SpectrumDescription, g: f32) -> World {
    let mut world = World::new();
    let kind = MediumKind::Homogeneous { sigma_a, sigma_s, scale: 1.0, g, emission: None };
    let medium = world.medium_of(kind);
    let [glass, nothing] = [1.4, 1.0].map(|eta| world.dielectric(eta, 0.0));
    let mesh = world.body(&smooth(&bumpy_sphere(2, 0.2)), glass, Some(medium), None);
    let fog = world.body(&ball(0.7), nothing, Some(medium), None);
    world.0.shapes[mesh].object_to_world = moonmilk_core::Mat4::from_translation(moonmilk_core::Vec3::X * -0.9);
    world.0.shapes[fog].object_to_world = moonmilk_core::Mat4::from_translation(moonmilk_core::Vec3::X * 0.9);
    world.environment(1.0)
}

/// Returns the colour that path i finds.
fn colour<const N: usize>(tracer: &Tracer, i: u64, w: &Wavelengths<N>) -> [f64; 3] {
    let (o, d) = uniform_ray(51, i, 2.2);
    let light = tracer.follow(i, o, d, w).0;
    w.to_rgb(light.orders[0] + light.orders[1] + light.orders[2]).map(f64::from)
}

#[test]
fn rgb_is_three_monochromatic_problems() {
    // Slow: .1 %.
    let n = samples(100_000, 64);
    let tracer = pair(SpectrumDescription::Rgb(SIGMA_A), SpectrumDescription::Rgb(SIGMA_S), 0.5).tracer();
    let together = measure(n, |i| {
        let hero = Stream::new(&[52, i]).uniform();
        colour(&tracer, i, &Wavelengths::<3>::sample(WavelengthMode::Rgb, hero))
    });
    tracer.assert_sound();
    for c in 0..3 {
        let [a, s] = [SIGMA_A[c], SIGMA_S[c]].map(SpectrumDescription::Constant);
        let mut alone = pair(a, s, 0.5).tracer();
        alone.integrator.seed = 2;
        let [e] = measure(n, |i| [colour(&alone, i, &Wavelengths::<1>::Fixed(550.0))[0]]);
        assert_equal(&format!("channel {c}"), together[c], e);
    }
}

#[test]
fn lanes_of_a_grey_scene_are_equal_bit_for_bit() {
    let constant = SpectrumDescription::Constant;
    let tracer = pair(constant(0.3), constant(5.0), 0.5).tracer();
    for i in 0..5000 {
        let (o, d) = uniform_ray(53, i, 2.2);
        let alone = tracer.follow(i, o, d, &Wavelengths::<1>::Fixed(550.0)).0.orders.map(|l| l.0[0]);
        let hero = Wavelengths::<4>::sample(WavelengthMode::Hero, 0.37);
        let light = tracer.follow(i, o, d, &hero).0;
        for lane in 0..4 {
            assert_eq!(light.orders.map(|l| l.0[lane]), alone, "path {i}, lane {lane}");
        }
    }
}

/// Returns a translucent ball whose coefficients vary by a factor of five over the spectrum.
fn coloured() -> Tracer {
    let mut world = World::new();
    let knots = |values: [f32; 5]| {
        SpectrumDescription::Sampled((0..5).map(|k| (380.0 + 100.0 * k as f32, values[k])).collect())
    };
    let sigma_a = world.spectrum(knots([1.0, 0.5, 0.2, 0.05, 0.1]));
    let sigma_s = world.spectrum(knots([9.0, 7.0, 4.0, 3.0, 2.0]));
    let material = world.subsurface(SubsurfaceMedium::Coefficients { sigma_a, sigma_s }, 0.3, 1.4);
    world.surface(&flat(&bumpy_sphere(2, 0.2)), material);
    world.environment(1.0).tracer()
}

#[test]
fn hero_wavelengths_see_what_single_wavelengths_integrate_to() {
    // One wavelength per path, spread evenly over the spectrum and weighed by the sensor, against four per path. Slow: .1 %.
    let tracer = coloured();
    let n = samples(100_000, 64);
    let hero = measure(n, |i| {
        let u = Stream::new(&[54, i]).uniform();
        colour(&tracer, i, &Wavelengths::<4>::sample(WavelengthMode::Hero, u))
    });
    tracer.assert_sound();
    let mut tracer = coloured();
    tracer.integrator.seed = 2;
    let range = LAMBDA_MAX - LAMBDA_MIN;
    let single = measure(n, |i| {
        let lambda = LAMBDA_MIN + range * Stream::new(&[55, i]).uniform();
        let l = colour(&tracer, i, &Wavelengths::<1>::Fixed(lambda))[0];
        OBSERVED.response_at(lambda).map(|w| f64::from(w * range) * l)
    });
    for c in 0..3 {
        assert_equal(&format!("channel {c} of hero"), hero[c], single[c]);
    }
    // The scene is coloured enough for this to mean something.
    assert!(hero[0].mean > 1.05 * hero[2].mean);
}

#[test]
fn dispersive_bodies_of_coloured_media_keep_white() {
    // Indices that vary over the spectrum, crossed many times, around a medium whose lanes part: the hero goes on alone, once. Slow: .1 %.
    let knots = |values: [f32; 5]| {
        SpectrumDescription::Sampled((0..5).map(|k| (380.0 + 100.0 * k as f32, values[k])).collect())
    };
    let clear = |fog: bool| {
        let mut world = World::new();
        let nothing = SpectrumDescription::Constant(0.0);
        let sigma_s = knots([2.0, 1.0, 0.6, 0.4, 0.3]);
        let kind = MediumKind::Homogeneous { sigma_a: nothing, sigma_s, scale: 1.0, g: 0.3, emission: None };
        let medium = world.medium_of(kind);
        let alpha = world.float(0.0);
        let roughness = Roughness { u: alpha, v: alpha, remap: false };
        let eta = knots([1.75, 1.65, 1.6, 1.57, 1.55]);
        let glass = world.material(MaterialKind::Dielectric { eta, roughness });
        let matched = world.dielectric(1.0, 0.0);
        if fog {
            // Fog in front, of whose lanes the hero's share is not 1/N any more where the glass is met.
            world.body(&ball(1.0), matched, Some(medium), None);
            world.body(&ball(0.6), glass, None, Some(medium));
        } else {
            world.body(&ball(1.0), glass, Some(medium), None);
        }
        world.environment(1.0).tracer()
    };
    let n = samples(40_000, 40);
    for (what, fog) in [("of fog", false), ("in fog", true)] {
        let tracer = clear(fog);
        let [white] = measure(n, |i| {
            let u = Stream::new(&[56, i]).uniform();
            let c = colour(&tracer, i, &Wavelengths::<4>::sample(WavelengthMode::Hero, u));
            [(c[0] + c[1] + c[2]) / 3.0]
        });
        tracer.assert_sound();
        assert_exact(&format!("dispersive ball {what}"), white, 1.0, 1e-4);
    }
}
