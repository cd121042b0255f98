//! Media that differ from place to place, against homogeneous ones, closed forms, and quadrature.

use std::f64::consts::PI;
use std::sync::Arc;

use moonmilk_core::{Mat4, Random, Spectrum, Stream, Vec3, WavelengthMode, Wavelengths};
use moonmilk_geometry::generate::cuboid;
use moonmilk_render::description::*;
use moonmilk_walk::Grid;

use crate::bodies::Body;
use crate::common::{
    Tracer, World, assert_equal, assert_exact, ball, flat, measure, rectangle, rgb, samples, uniform_ray,
};

/// A turned and stretched medium space whose box holds the ball of radius 1.9 with a voxel of 6 to spare.
fn around() -> FieldBox {
    let medium_to_world =
        Mat4::from_rotation_y(0.7) * Mat4::from_rotation_x(-0.4) * Mat4::from_scale(Vec3::new(2.0, 1.5, 3.0));
    let half = Vec3::new(3.0, 3.0, 3.0) / Vec3::new(2.0, 1.5, 3.0);
    FieldBox { medium_to_world, p0: half, p1: -half }
}

/// Returns a grid of densities with the coefficients of a homogeneous medium.
pub fn densities(
    n: u32,
    sigma_a: SpectrumDescription,
    sigma_s: SpectrumDescription,
    g: f32,
    f: impl FnMut(Vec3) -> f32,
) -> DensityGrid {
    DensityGrid {
        bounds: around(),
        size: [n; 3],
        density: voxels(n, f),
        sigma_a,
        sigma_s,
        scale: 1.0,
        g,
        emission: GridEmission::None,
        emission_scale: vec![],
    }
}

/// Returns the values of a function at the centres of n^3 voxels of the unit cube.
fn voxels<T>(n: u32, mut f: impl FnMut(Vec3) -> T) -> Vec<T> {
    let center = |i: u32| (i as f32 + 0.5) / n as f32;
    (0..n * n * n).map(|i| f(Vec3::new(center(i % n), center(i / n % n), center(i / (n * n))))).collect()
}

/// Returns densities that samplers get wrong: mean near 1, a void, and voxels that are 1e4 times as dense as others.
pub fn wild(seed: u64) -> impl FnMut(Vec3) -> f32 {
    let mut rng = Stream::new(&[seed]);
    move |u| match rng.uniform() {
        _ if u.x < 0.4 => 0.0,
        x if x < 0.02 => 30.0,
        x => 0.003 + x,
    }
}

pub fn constant(x: f32) -> SpectrumDescription {
    SpectrumDescription::Constant(x)
}

/// Coefficients of the three channels: extinctions 2, 1 and 3.5.
const SIGMA_A: [f32; 3] = [0.05, 0.2, 0.5];
const SIGMA_S: [f32; 3] = [1.95, 0.8, 3.0];

/// Returns a glass body, a matched ball and a rough ball of the same medium under the sky.
fn trio(medium: MediumKind) -> Tracer {
    let mut world = World::new();
    let medium = world.medium_of(medium);
    let boundaries = [world.dielectric(1.4, 0.0), world.dielectric(1.0, 0.0), world.dielectric(1.3, 0.3)];
    for (boundary, x) in boundaries.into_iter().zip([-1.0, 0.0, 1.0]) {
        let shape = world.body(&ball(0.45), boundary, Some(medium), None);
        world.0.shapes[shape].object_to_world = Mat4::from_translation(Vec3::X * x);
    }
    world.environment(1.0).tracer()
}

/// Returns the same chromatic medium as homogeneous, as a grid of densities, and as a grid of colours.
fn kinds(g: f32) -> [MediumKind; 3] {
    let [sigma_a, sigma_s] = [SIGMA_A, SIGMA_S].map(SpectrumDescription::Rgb);
    [
        MediumKind::Homogeneous { sigma_a: sigma_a.clone(), sigma_s: sigma_s.clone(), scale: 1.0, g, emission: None },
        // The scale multiplies both grids.
        MediumKind::Densities(Box::new(DensityGrid { scale: 0.5, ..densities(6, sigma_a, sigma_s, g, |_| 2.0) })),
        MediumKind::Colours(Box::new(ColourGrid {
            bounds: around(),
            size: [6; 3],
            sigma_a: vec![SIGMA_A.map(|x| 2.0 * x); 216],
            sigma_s: vec![SIGMA_S.map(|x| 2.0 * x); 216],
            scale: 0.5,
            g,
            emission: vec![],
            emission_scale: 1.0,
        })),
    ]
}

/// Returns the colour that path i finds.
fn colour<const N: usize>(tracer: &Tracer, i: u64, reach: f32, w: &Wavelengths<N>) -> [f64; 3] {
    let (o, d) = uniform_ray(81, i, reach);
    let (light, _) = tracer.follow(i, o, d, w);
    w.to_rgb(light.orders.into_iter().fold(Spectrum::ZERO, |a, b| a + b)).map(f64::from)
}

#[test]
fn a_grid_of_constant_density_and_one_of_constant_colour_are_the_homogeneous_medium() {
    // Hero wavelengths and rgb, three kinds of boundaries at once. Slow: .02 to .05 %.
    for hero in [true, false] {
        let [homogeneous, by_density, by_colour] = kinds(0.4).map(trio);
        let look = |tracer: &Tracer, seed: u64| {
            measure(samples(60_000, 32), |i| {
                let i = i + (seed + 3 * u64::from(hero)) * 1_000_000_000;
                let u = Stream::new(&[82, i]).uniform();
                match hero {
                    true => colour(tracer, i, 1.5, &Wavelengths::<4>::sample(WavelengthMode::Hero, u)),
                    false => colour(tracer, i, 1.5, &Wavelengths::<3>::sample(WavelengthMode::Rgb, u)),
                }
            })
        };
        let exact = look(&homogeneous, 0);
        for (what, tracer, seed) in [("densities", &by_density, 1), ("colours", &by_colour, 2)] {
            let found = look(tracer, seed);
            tracer.assert_sound();
            for c in 0..3 {
                assert_equal(&format!("{what}, hero {hero}, channel {c}"), found[c], exact[c]);
            }
        }
    }
}

#[test]
fn the_furnace_stays_white_in_wild_densities() {
    // Nothing absorbs: the sky's radiance 1 in every lane of every path, from outside, from inside, and with nothing else there.
    let white = |tracer: &Tracer, what: &str, reach: f32, n: u64| {
        let found = measure(samples(n, 64), |i| {
            // Every lane is the hero in turn: the weights sum to one over all of them.
            let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, ((i % 3) as f32 + 0.5) / 3.0);
            colour(tracer, i, reach, &w)
        });
        tracer.assert_sound();
        for (k, e) in found.into_iter().enumerate() {
            assert_exact(&format!("{what}, channel {k}"), e, 1.0, 0.0);
        }
    };
    let chromatic = || SpectrumDescription::Rgb([1.0, 2.5, 4.0]);
    for (eta, g) in [(1.0, 0.0), (1.0, 0.8), (1.5, -0.4)] {
        for body in [Body::ball(), Body::bumpy()] {
            let mut world = World::new();
            let field = densities(14, constant(0.0), chromatic(), g, wild(1));
            let field = world.medium_of(MediumKind::Densities(Box::new(field)));
            let boundary = world.dielectric(eta, 0.0);
            world.body(&body.geometry, boundary, Some(field), None);
            let tracer = world.environment(1.0).tracer();
            white(&tracer, &format!("{}, eta {eta}, g {g}", body.name), body.reach, 20_000);
        }
    }
    // Nested: a glass ball of one field in a ball of another, in a fog that fills the world; the camera is in the fog.
    let mut world = World::new();
    let inner = densities(5, constant(0.0), chromatic(), 0.5, wild(2));
    let outer = densities(9, constant(0.0), constant(1.5), -0.2, wild(3));
    let colours = ColourGrid {
        bounds: around(),
        size: [7; 3],
        sigma_a: vec![[0.0; 3]; 343],
        sigma_s: voxels(7, |u| [u.x, 0.5 * u.y * u.z, 1.0 - u.x]),
        scale: 2.0,
        g: 0.3,
        emission: vec![],
        emission_scale: 1.0,
    };
    let [inner, outer] = [inner, outer].map(|d| world.medium_of(MediumKind::Densities(Box::new(d))));
    let fog = world.medium_of(MediumKind::Colours(Box::new(colours)));
    let [glass, nothing] = [1.5, 1.0].map(|eta| world.dielectric(eta, 0.0));
    world.body(&ball(0.5), glass, Some(inner), Some(outer));
    world.body(&ball(1.0), nothing, Some(outer), Some(fog));
    world.0.camera.medium = Some(fog);
    white(&world.environment(1.0).tracer(), "nested, camera in the fog", 1.5, 20_000);
}

#[test]
fn paths_through_a_conservative_field_are_as_long_as_volume_says() {
    // The mean of the integral of w along a path of uniform light is the integral of w over the volume, over pi B^2 for rays through a
    // sphere of radius B [BlancoFournier2003]: with the emission per unit length for w. Slow: .1 %.
    for (eta, sigma_s, g) in [(1.0, 2.0, 0.0), (1.5, 2.0, 0.6), (1.33, 12.0, -0.3)] {
        let mut world = World::new();
        let sigma_a = sigma_s / 1_073_741_824.0;
        let mut field = densities(14, constant(sigma_a), constant(sigma_s), g, wild(4));
        field.emission = GridEmission::Spectrum(rgb(1.0 / sigma_a));
        let grid = Grid::new([14; 3], field.density.clone()).expect("14^3 values");
        let field = world.medium_of(MediumKind::Densities(Box::new(field)));
        let boundary = world.dielectric(eta, 0.0);
        world.body(&ball(1.0), boundary, Some(field), None);
        // Midpoint rule over 160^3 cells of the ball's box: with 2e6 of them inside the error at the surface averages out below 1e-4.
        let b = around();
        let (low, extent) = (b.p0.min(b.p1), (b.p1 - b.p0).abs());
        let to_unit = (b.medium_to_world * Mat4::from_translation(low) * Mat4::from_scale(extent)).inverse();
        let n = 160;
        let points = voxels(n, |u| u * 2.0 - 1.0);
        let inside = points.into_iter().filter(|p| p.length_squared() < 1.0);
        let weight: f64 = inside.map(|p| f64::from(grid.interpolate(to_unit.transform_point3(p)))).sum();
        let exact = weight * (2.0 / f64::from(n)).powi(3) / (PI * 1.001f64.powi(2));
        let tracer = world.tracer();
        let [l] = measure(samples(40_000, 64), |i| {
            let (o, d) = uniform_ray(84, i, 1.001);
            [tracer.radiance(i, o, d)]
        });
        tracer.assert_sound();
        assert_exact(&format!("path length, eta {eta}, sigma_s {sigma_s}, g {g}"), l, exact, 3e-4 * exact);
    }
}

/// Adds a lamp of radiance 4: an emitting box, or one full of a medium so dense that it glows as brightly, which chance alone finds.
fn with_lamp(mut world: World, around: usize, sampled: bool) -> World {
    let shape = flat(&cuboid(Vec3::new(0.3, 0.5, -0.3), Vec3::new(0.8, 0.9, 0.3)));
    if sampled {
        world.emitter(&shape, 4.0);
    } else {
        let glow = world.glow(1e6, 0.0, 0.0, 4.0);
        let nothing = world.dielectric(1.0, 0.0);
        world.body(&shape, nothing, Some(glow), Some(around));
    }
    world
}

#[test]
fn sampled_lights_in_a_fog_are_as_bright_as_lights_found_by_chance() {
    // A diffuse floor and a lamp in a chromatic field, or in one that only absorbs, which weighs paths instead of ending them.
    let wild_fog = densities(
        9,
        SpectrumDescription::Rgb([0.05, 0.1, 0.02]),
        SpectrumDescription::Rgb([0.3, 1.0, 2.0]),
        0.5,
        wild(5),
    );
    let absorbing = densities(9, SpectrumDescription::Rgb([0.3, 1.0, 2.0]), constant(0.0), 0.0, wild(6));
    let plain = MediumKind::Homogeneous {
        sigma_a: SpectrumDescription::Rgb([0.3, 1.0, 2.0]),
        sigma_s: constant(0.0),
        scale: 1.0,
        g: 0.0,
        emission: None,
    };
    let kinds = [
        ("a scattering field", MediumKind::Densities(Box::new(wild_fog)), 150_000),
        ("an absorbing field", MediumKind::Densities(Box::new(absorbing)), 100_000),
        ("an absorbing homogeneous medium", plain, 100_000),
    ];
    for (what, kind, n) in kinds {
        let found = [true, false].map(|sampled| {
            let mut world = World::new();
            let fog = world.medium_of(kind.clone());
            let white = world.diffuse(0.8);
            world.surface(&rectangle(Vec3::ZERO, Vec3::X * 1.5, Vec3::NEG_Z * 1.5), white);
            world.0.camera.medium = Some(fog);
            let tracer = with_lamp(world, fog, sampled).tracer();
            measure(samples(if sampled { n } else { 4 * n }, 16), |i| {
                let i = i + u64::from(sampled) * 1_000_000_000;
                let mut rng = Stream::new(&[85, i]);
                let [x, y, z] = [rng.uniform(), rng.uniform(), rng.uniform()].map(|u| u - 0.5);
                let eye = Vec3::new(-1.0, 0.8, 0.4);
                let d = (Vec3::new(0.2, 0.1, 0.0) + Vec3::new(x, y, z) - eye).normalize();
                let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, rng.uniform());
                let (light, _) = tracer.follow(i, eye, d, &w);
                w.to_rgb(light.orders.into_iter().fold(Spectrum::ZERO, |a, b| a + b)).map(f64::from)
            })
        });
        for (c, (by_sampling, by_chance)) in std::iter::zip(found[0], found[1]).enumerate() {
            assert_equal(&format!("lamp in {what}, channel {c}"), by_sampling, by_chance);
        }
    }
}

#[test]
fn a_glowing_field_is_as_bright_as_quadrature_says() {
    // L = integral of sigma_a d(z) L_e(z) exp(-tau(z)) along z through a box of unit length; black bodies by rgb of Planck's law.
    let n = 10;
    let mut field = densities(n, constant(1.7), constant(0.0), 0.0, |u| 0.2 + u.z);
    field.bounds = FieldBox { medium_to_world: Mat4::IDENTITY, p0: Vec3::splat(-0.5), p1: Vec3::splat(0.5) };
    field.emission = GridEmission::Spectrum(rgb(3.0));
    field.emission_scale = voxels(n, |u| (1.0 - u.z) * (1.0 - u.z));
    let shine = |field: &DensityGrid| {
        let mut world = World::new();
        let medium = world.medium_of(MediumKind::Densities(Box::new(field.clone())));
        let nothing = world.dielectric(1.0, 0.0);
        world.body(&ball(0.8), nothing, Some(medium), None);
        let tracer = world.tracer();
        let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, 0.1);
        let found = measure(samples(100_000, 64), |i| {
            let (light, _) = tracer.follow(i, Vec3::new(0.1, 0.05, -3.0), Vec3::Z, &w);
            w.to_rgb(light.orders.into_iter().fold(Spectrum::ZERO, |a, b| a + b)).map(f64::from)
        });
        tracer.assert_sound();
        found
    };
    let quadrature = |field: &DensityGrid, radiance: &dyn Fn(Vec3) -> [f64; 3]| {
        let density = Grid::new(field.size, field.density.clone()).expect("n^3 values");
        let (steps, mut tau, mut sum) = (20_000, 0.0, [0.0; 3]);
        for i in 0..steps {
            let u = Vec3::new(0.6, 0.55, (i as f32 + 0.5) / steps as f32);
            let step = 1.7 * f64::from(density.interpolate(u)) / f64::from(steps);
            let weight = step * (-tau - 0.5 * step).exp();
            radiance(u).into_iter().zip(&mut sum).for_each(|(l, s)| *s += weight * l);
            tau += step;
        }
        sum
    };
    let factor = Grid::new(field.size, field.emission_scale.clone()).expect("n^3 values");
    let exact = quadrature(&field, &|u| [3.0 * f64::from(factor.interpolate(u)); 3]);
    for (e, exact) in shine(&field).into_iter().zip(exact) {
        // Midpoint rule over 20 000 steps: below 1e-7.
        assert_exact("glow by Lescale", e, exact, 1e-6 * exact);
    }
    // Temperatures of 20 to 30 hundred kelvin.
    let values = voxels(n, |u| 40.0 + 10.0 * u.z);
    let kelvin = Grid::new(field.size, values.clone()).expect("n^3 values");
    field.emission = GridEmission::Temperature { values, offset: 20.0, scale: 100.0 };
    field.emission_scale = vec![];
    let exact = quadrature(&field, &|u| {
        let t = (kelvin.interpolate(u) - 20.0) * 100.0;
        // pbrt's luminance of a black body of peak 1: 106.856895 times that of ours.
        match t > 100.0 {
            true => moonmilk_core::Spectra::blackbody(t)
                .expect("positive")
                .rgb()
                .map(|x| 106.856_895 * f64::from(x.max(0.0))),
            false => [0.0; 3],
        }
    });
    for (e, exact) in shine(&field).into_iter().zip(exact) {
        // The table of colours is off by 3e-5 of the brightest channel at most.
        assert_exact("glow by temperature", e, exact, 1e-4 * exact.max(1.0));
    }
}

#[test]
fn a_cloud_attenuates_as_its_density_says() {
    // Closed form where there is no noise; with noise only that the bounds hold.
    let cloud = CloudDescription {
        bounds: FieldBox { medium_to_world: Mat4::IDENTITY, p0: Vec3::ZERO, p1: Vec3::ONE },
        sigma_a: constant(4.0),
        sigma_s: constant(0.0),
        g: 0.0,
        density: 2.0,
        wispiness: 0.0,
        frequency: 2.0,
    };
    let look = |cloud: CloudDescription, height: f32| {
        let mut world = World::new();
        let medium = world.medium_of(MediumKind::Cloud(Box::new(cloud)));
        let nothing = world.dielectric(1.0, 0.0);
        let body: Arc<GeometryDescription> = flat(&cuboid(Vec3::splat(-0.01), Vec3::splat(1.01)));
        world.body(&body, nothing, Some(medium), None);
        let tracer = world.environment(1.0).tracer();
        let [l] = measure(samples(40_000, 16), |i| [tracer.radiance(i, Vec3::new(-1.0, height, 0.4), Vec3::X)]);
        tracer.assert_sound();
        l
    };
    // Without noise: density 2 (1/2 - y) below 1/2, nothing above.
    let plain = CloudDescription { density: 0.0, ..cloud.clone() };
    assert_exact("cloud without noise at y = .3", look(plain.clone(), 0.3), (-4.0 * 0.4f64).exp(), 1e-6);
    assert_exact("cloud without noise at y = .6", look(plain, 0.6), 1.0, 1e-6);
    // With noise there is something at y = .6, and nothing is brighter than the sky.
    let noisy = look(cloud, 0.6);
    assert!(noisy.mean < 0.99 && noisy.mean > (-4.0f64).exp(), "{noisy}");
}

#[test]
fn faults_of_fields_are_named_with_their_place() {
    let good = || densities(2, constant(1.0), constant(1.0), 0.0, |_| 1.0);
    let error = |grid: DensityGrid| {
        let mut world = World::new();
        world.medium_of(MediumKind::Densities(Box::new(grid)));
        let options = moonmilk_render::scene::SceneOptions {
            open: moonmilk_render::scene::OpenPolicy::Refuse,
            ..Default::default()
        };
        moonmilk_render::scene::Scene::new(&world.0, &options).expect_err("a fault").to_string()
    };
    let mut negative = good();
    negative.density[3] = -1.0;
    assert_eq!(error(negative), "test:1:1: medium \"medium\": value 4 of `density` is -1, not in [0, inf)");
    let mut short = good();
    short.density.pop();
    assert_eq!(error(short), "test:1:1: medium \"medium\": `density` has 7 values, but nx * ny * nz = 2 * 2 * 2 = 8");
    let huge = DensityGrid { size: [u32::MAX; 3], ..good() };
    assert!(error(huge).contains("`density` has 8 values, but nx * ny * nz"));
    let mut nan = good();
    nan.emission_scale = vec![f32::NAN; 8];
    assert!(error(nan).contains("value 1 of `Lescale` is NaN, not in [0, inf)"));
    let flat = DensityGrid { bounds: FieldBox { p1: around().p0, ..around() }, ..good() };
    assert!(error(flat).contains("has no volume"));
    assert!(error(DensityGrid { g: 1.0, ..good() }).contains("g = 1 is outside (-1, 1)"));
}
