//! Colour: lanes that share a path must each have the mean that they would have alone.

use moonmilk_core::color::{LAMBDA_MAX, LAMBDA_MIN, OBSERVED};
use moonmilk_core::estimate::Accumulator;
use moonmilk_core::{Random, Sampler, Stream, Vec2, Vec3, WavelengthMode, Wavelengths};
use moonmilk_geometry::generate::bumpy_sphere;
use moonmilk_render::description::{
    ColourGrid, FieldBox, MaterialKind, MediumKind, Roughness, SpectrumDescription, SubsurfaceMedium,
};
use moonmilk_render::integrator::{Counters, Integrator, Light, Policy};
use moonmilk_render::session;

use crate::common::{
    Tracer, World, assert_equal, assert_exact, ball, flat, measure, rectangle, samples, smooth, uniform_ray,
};

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

/// Returns a ball of a coloured medium `tau` mean free paths of its densest channel in radius.
fn coloured_ball(tau: f32, g: f32, white: bool) -> World {
    let mut world = World::new();
    let alpha = if white { [1.0; 3] } else { [0.9, 0.97, 0.99] };
    let sigma_t = [1.0f32, 0.7, 0.4].map(|s| s * tau / (1.0 - g));
    let sigma_s = SpectrumDescription::Rgb(std::array::from_fn(|c| sigma_t[c] * alpha[c]));
    let sigma_a = SpectrumDescription::Rgb(std::array::from_fn(|c| sigma_t[c] * (1.0 - alpha[c])));
    let medium = world.medium_of(MediumKind::Homogeneous { sigma_a, sigma_s, scale: 1.0, g, emission: None });
    let glass = world.dielectric(1.4, 0.0);
    world.body(&ball(1.0), glass, Some(medium), None);
    world
}

#[test]
fn what_lanes_drift_to_is_nothing_on_average() {
    // Three channels each, beside the size that single values have; dispersion, walls, fog and light of all kinds. Slow: 8 times as many.
    let lit = |world: World| {
        let mut world = world.environment(0.5);
        world.emitter(&rectangle(Vec3::new(0.0, 2.5, 0.0), Vec3::X, Vec3::Z), 6.0);
        world
    };
    let prism = || {
        let mut world = coloured_ball(3.0, 0.2, false);
        let alpha = world.float(0.2);
        let roughness = Roughness { u: alpha, v: alpha, remap: false };
        let eta = SpectrumDescription::Sampled(vec![(380.0, 1.7), (780.0, 1.5)]);
        let glass = world.material(MaterialKind::Dielectric { eta, roughness });
        let there = world.body(&ball(0.6), glass, Some(0), None);
        world.0.shapes[there].object_to_world = moonmilk_core::Mat4::from_translation(Vec3::X * 1.7);
        world
    };
    let cloud = || {
        let mut world = World::new();
        let kind = MediumKind::Colours(Box::new(ColourGrid {
            bounds: FieldBox { medium_to_world: moonmilk_core::Mat4::IDENTITY, p0: Vec3::splat(-1.0), p1: Vec3::ONE },
            size: [2, 1, 1],
            sigma_a: vec![[0.1, 0.3, 0.6], [0.2, 0.1, 0.0]],
            sigma_s: vec![[4.0, 3.0, 6.0], [1.0, 5.0, 2.0]],
            scale: 1.0,
            g: 0.3,
            emission: vec![],
            emission_scale: 1.0,
        }));
        let medium = world.medium_of(kind);
        let nothing = world.dielectric(1.0, 0.0);
        world.body(&ball(0.9), nothing, Some(medium), None);
        world
    };
    let n = samples(20_000, 8);
    for (what, world, policy, jumps) in [
        ("flights", coloured_ball(8.0, 0.0, false), Policy::Classic, false),
        ("flights forward", coloured_ball(8.0, 0.8, false), Policy::Classic, false),
        ("split walks", coloured_ball(8.0, 0.8, false), Policy::Auto, false),
        ("jumps by tables", coloured_ball(40.0, 0.0, false), Policy::Jump, true),
        ("jumps by banks", coloured_ball(40.0, 0.8, false), Policy::Jump, true),
        ("guided walks", coloured_ball(20.0, 0.0, false), Policy::Guided, false),
        ("prism", prism(), Policy::Auto, false),
        ("cloud", cloud(), Policy::Auto, false),
    ] {
        let tracer = lit(world).tracer().by(policy).with_banks(16);
        let found = measure(n, |i| {
            let (o, d) = uniform_ray(57, i, 1.5);
            let w = Wavelengths::<4>::sample(WavelengthMode::Hero, Stream::new(&[58, i]).uniform());
            let light = tracer.follow(i, o, d, &w).0;
            w.to_rgb(light.drift).map(f64::from)
        });
        let c = tracer.assert_sound();
        assert_eq!(c.jumps > 0, jumps, "{what}: {c:?}");
        for (c, e) in found.into_iter().enumerate() {
            assert_exact(&format!("{what}, channel {c}"), e, 0.0, 0.0);
        }
    }
}

/// Returns the variance of a channel's samples of a picture around the mean of their pixel, without and with what is known of the lanes, and both means.
fn noise_of_colour(world: &World, samples: u64) -> ([f64; 2], [moonmilk_core::Estimate; 2]) {
    let scene = world.scene();
    let integrator = Integrator::new(3, WavelengthMode::Hero, Default::default(), None).with_policy(Policy::Classic);
    let (mut variance, mut means) = ([0.0; 2], [Accumulator::default(); 2]);
    for pixel in (0..16).flat_map(|y| (0..16).map(move |x| [x, y])) {
        let mut sums = [Accumulator::default(); 2];
        for s in 0..samples {
            let with = session::sample(&scene, &integrator, pixel, s, &mut Counters::default()).rgb;
            // The same path: numbers are drawn in the order of `session::sample`.
            let mut rng = Sampler::new(integrator.seed, pixel[0], pixel[1], s);
            let (offset, lens, u) = (rng.uniform2(), rng.uniform2(), rng.uniform());
            let w = Wavelengths::<4>::sample(WavelengthMode::Hero, u);
            let film = Vec2::new(pixel[0] as f32 + offset[0], pixel[1] as f32 + offset[1]);
            let (o, d) = scene.camera.ray(film, lens);
            let mut light = Light::<4>::default();
            integrator.trace(&scene, o, d, &w, &mut rng, &mut light, &mut Counters::default());
            let without = w.to_rgb(light.orders[0] + light.orders[1] + light.orders[2]);
            [without, with].iter().zip(&mut sums).for_each(|(c, sum)| sum.add(f64::from(c[1])));
        }
        for k in 0..2 {
            variance[k] += sums[k].variance() / 256.0;
            means[k].merge(&sums[k]);
        }
    }
    (variance, means.map(|m| m.estimate()))
}

#[test]
fn noise_of_colour_is_taken_off_where_light_is_even_and_none_added_where_it_is_not() {
    // Ratios measured over 16 x 16 pixels: a white furnace, under a sky, and a lamp alone, which loses nothing: the bound of 1.05 is for the error of the slopes, one part in 256 each, and of this measurement.
    let lamp = |mut world: World| {
        world.emitter(&rectangle(Vec3::new(0.0, 2.5, 0.0), Vec3::X * 0.3, Vec3::Z * 0.3), 60.0);
        world
    };
    for (what, world, least) in [
        ("furnace", coloured_ball(10.0, 0.0, true).environment(1.0), 20.0),
        ("sky", coloured_ball(10.0, 0.0, false).environment(1.0), 1.5),
        ("sky, forward", coloured_ball(3.0, 0.8, false).environment(1.0), 1.5),
        ("lamp", lamp(coloured_ball(10.0, 0.0, false)), 1.0 / 1.05),
    ] {
        let ([without, with], means) = noise_of_colour(&world, 64);
        println!(
            "{what}: variance {without:.4} and {with:.4}, ratio {:.2}; means {} and {}",
            without / with,
            means[0],
            means[1]
        );
        assert!(without / with > least, "{what}: {without} and {with}");
    }
}
