//! No length is absolute: a scene and its copy at another scale, coefficients inverse, are the same scene.

use std::sync::Arc;

use moonmilk_core::Vec3;
use moonmilk_geometry::generate::bumpy_sphere;
use moonmilk_render::description::{GeometryDescription, MediumKind, SpectrumDescription};

use crate::common::{Tracer, World, assert_equal, ball, flat, measure, rectangle, samples, smooth, uniform_ray};

/// Returns the points of a mesh, or the radius of a sphere, times a factor.
fn scaled(geometry: &GeometryDescription, by: f32) -> GeometryDescription {
    let mut geometry = geometry.clone();
    match &mut geometry {
        GeometryDescription::Mesh { positions, .. } => positions.iter_mut().for_each(|p| *p *= by),
        GeometryDescription::Sphere { radius, z_min, z_max, .. } => {
            [radius, z_min, z_max].into_iter().for_each(|x| *x *= by);
        }
        _ => unreachable!("this scene has meshes and spheres alone"),
    }
    geometry
}

/// Returns a scene with everything in it, at a scale: a translucent mesh around a ball of glass, fog, a floor, a lamp and a faint sky.
fn scene(scale: f32) -> Tracer {
    let mut world = World::new();
    let [milk, fog] = [world.medium(0.02, 6.0, 0.5), world.medium(0.3, 1.5, 0.0)];
    let [glass, inner, nothing] = [1.4, 1.5 / 1.4, 1.0].map(|eta| world.dielectric(eta, 0.0));
    world.body(&smooth(&bumpy_sphere(3, 0.2)), glass, Some(milk), None);
    world.body(&ball(0.4), inner, None, Some(milk));
    world.body(&flat(&bumpy_sphere(1, 0.0)), nothing, Some(fog), None);
    let floor = world.diffuse(0.5);
    world.surface(&rectangle(Vec3::Z * -1.4, Vec3::X * 5.0, Vec3::Y * 5.0), floor);
    world.emitter(&rectangle(Vec3::new(0.5, 0.5, 2.0), Vec3::X, -Vec3::Y), 5.0);
    world.0.shapes[2].geometry = {
        // Set the fog beside the milk.
        let GeometryDescription::Mesh { positions, normals, uvs, indices } = &*world.0.shapes[2].geometry else {
            unreachable!("the fog is a mesh")
        };
        let positions = positions.iter().map(|p| *p * 0.5 + Vec3::new(1.8, 0.0, 0.0)).collect();
        let (normals, uvs, indices) = (normals.clone(), uvs.clone(), indices.clone());
        Arc::new(GeometryDescription::Mesh { positions, normals, uvs, indices })
    };
    for shape in &mut world.0.shapes {
        shape.geometry = Arc::new(scaled(&shape.geometry, scale));
    }
    for medium in &mut world.0.media {
        let MediumKind::Homogeneous { sigma_a, sigma_s, .. } = &mut medium.kind else {
            unreachable!("these media are homogeneous")
        };
        for s in [sigma_a, sigma_s] {
            let SpectrumDescription::Constant(x) = s else { unreachable!("these media are grey") };
            *x /= scale;
        }
    }
    world.environment(0.2).tracer()
}

#[test]
fn a_scene_scaled_by_a_power_of_two_gives_the_same_bits() {
    // Far enough: at 2^30 squares of areas leave the range of f32.
    let one = scene(1.0);
    for exponent in [10, -10, 20, -20] {
        let scale = 2f32.powi(exponent);
        let other = scene(scale);
        for i in 0..samples(3000, 16) {
            let (o, d) = uniform_ray(71, i, 2.5);
            let (a, b) = (one.radiance(i, o, d), other.radiance(i, o * scale, d));
            assert!(a == b, "path {i} at scale 2^{exponent}: {b} for {a}");
        }
    }
    assert!(one.assert_sound().collisions > 10_000);
}

#[test]
fn a_scene_scaled_by_any_number_looks_the_same() {
    // 1.5 %; slow: .4 %.
    let run = |scale: f32, seed: u64| {
        let mut tracer = scene(scale);
        tracer.integrator.seed = seed;
        let [l] = measure(samples(60_000, 16), |i| {
            let (o, d) = uniform_ray(72 + seed, i, 2.5);
            [tracer.radiance(i, o * scale, d)]
        });
        tracer.assert_sound();
        l
    };
    let one = run(1.0, 1);
    for (scale, seed) in [(1e-3, 2), (1e3, 3)] {
        assert_equal(&format!("scale {scale}"), run(scale, seed), one);
    }
}
