//! Cost of choosing one of many lights: the tree's time per sample should grow like log n.
//!
//! Prints, for n small triangles spread over a square lamp field, the time to build, the time per sample and per density, and the
//! relative standard deviation of the irradiance estimate.

use std::sync::Arc;
use std::time::Instant;

use moonmilk_core::estimate::Accumulator;
use moonmilk_core::{Mat4, Random, Stream, Vec2, Vec3, WavelengthMode, Wavelengths};
use moonmilk_render::description::*;
use moonmilk_render::lights::Lights;

fn main() {
    println!("{:>8} {:>10} {:>12} {:>12} {:>10}", "lights", "build ms", "ns/sample", "ns/density", "deviation");
    for n in [1u32, 10, 100, 1_000, 10_000, 100_000] {
        let scene = field_of_lamps(n);
        let start = Instant::now();
        let lights = Lights::of_scene(&scene).expect("the lamps are valid");
        let build = start.elapsed().as_secs_f64() * 1e3;

        let w = Wavelengths::<1>::sample(WavelengthMode::MONO, 0.5);
        let mut r = Stream::new(&[1, u64::from(n)]);
        let mut sum = Accumulator::default();
        let mut found = Vec::new();
        let samples = 200_000;
        let p = Vec3::new(0.2, -0.1, 0.0);
        let start = Instant::now();
        for _ in 0..samples {
            let u = [r.uniform(), r.uniform(), r.uniform()];
            let s = lights.sample(p, Some(Vec3::Z), &w, u);
            sum.add(s.map_or(0.0, |s| f64::from(s.radiance[0] * s.wi.z.max(0.0) / s.pdf)));
            found.extend(s.map(|s| (s.light, s.point)));
        }
        let sampling = start.elapsed().as_secs_f64() * 1e9 / f64::from(samples);
        let start = Instant::now();
        let total: f32 = found.iter().map(|&(l, q)| lights.pdf_hit(p, Some(Vec3::Z), l, q)).sum();
        let density = start.elapsed().as_secs_f64() * 1e9 / found.len() as f64;
        assert!(total > 0.0);
        let deviation = sum.variance().sqrt() / sum.estimate().mean;
        println!("{n:>8} {build:>10.1} {sampling:>12.0} {density:>12.0} {deviation:>10.2}");
    }
}

/// Returns a scene with n triangles of equal radiance at random places above the plane z = 0, of equal area in all.
fn field_of_lamps(n: u32) -> SceneDescription {
    let mut r = Stream::new(&[2]);
    let size = 0.5 / (n as f32).sqrt();
    let mut positions = Vec::new();
    for _ in 0..n {
        let c = Vec3::new(4.0 * r.uniform() - 2.0, 4.0 * r.uniform() - 2.0, 0.5 + r.uniform());
        positions.extend([c, c + Vec3::Y * size, c + Vec3::X * size]);
    }
    let place = Place { file: "lamps".into(), line: 1, column: 1 };
    let geometry = GeometryDescription::Mesh {
        positions,
        normals: vec![],
        uvs: vec![],
        indices: (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
    };
    let lamp = AreaLightDescription {
        place: place.clone(),
        radiance: SpectrumDescription::Constant(1.0),
        scale: 1.0,
        two_sided: false,
        power: None,
        image: None,
    };
    let shape = ShapeDescription {
        place,
        name: "lamps".into(),
        geometry: Arc::new(geometry),
        object_to_world: Mat4::IDENTITY,
        reverse_orientation: false,
        material: 0,
        media: None,
        area_light: Some(lamp),
        alpha: None,
    };
    SceneDescription {
        camera: CameraDescription {
            kind: CameraKind::Orthographic,
            camera_to_world: Mat4::IDENTITY,
            medium: None,
            screen_window: None,
            frame_aspect_ratio: None,
            lens_radius: 0.0,
            focal_distance: 1.0,
        },
        film: FilmDescription {
            width: 1,
            height: 1,
            crop: [0, 1, 0, 1],
            filename: None,
            imaging_ratio: 1.0,
            max_component_value: None,
        },
        filter: FilterDescription { kind: FilterKind::Box, radius: Vec2::splat(0.5) },
        sampler: SamplerDescription { samples: 1, seed: 0 },
        integrator: IntegratorDescription { name: "volpath".into(), max_depth: 5 },
        media: vec![],
        materials: vec![],
        float_textures: vec![],
        spectrum_textures: vec![],
        images: vec![],
        shapes: vec![shape],
        objects: vec![],
        instances: vec![],
        lights: vec![],
    }
}
