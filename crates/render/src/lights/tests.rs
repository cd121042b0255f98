//! Tests of all lights together: densities against each other and against closed forms.
//!
//! Seeds are fixed. z-tests use |z| < 4.5 to 5, a significance below 1e-4 after the correction for the number of points of a test.

mod aims;
mod choice;
mod closed_forms;
mod forms;
mod input;
mod portals;

use std::f64::consts::PI;
use std::sync::Arc;

use moonmilk_core::estimate::Accumulator;
use moonmilk_core::{Mat4, Random, Stream, Vec2, Vec3, WavelengthMode, Wavelengths};

use super::Lights;
use crate::description::*;

fn place() -> Place {
    Place { file: "test.pbrt".into(), line: 1, column: 1 }
}

/// Returns a scene without anything in it.
fn empty() -> SceneDescription {
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
        shapes: vec![],
        objects: vec![],
        instances: vec![],
        lights: vec![],
    }
}

fn area_light(radiance: f32, two_sided: bool) -> AreaLightDescription {
    AreaLightDescription {
        place: place(),
        radiance: SpectrumDescription::Rgb([radiance; 3]),
        scale: 1.0,
        two_sided,
        power: None,
        image: None,
    }
}

fn shape(geometry: GeometryDescription, object_to_world: Mat4, light: AreaLightDescription) -> ShapeDescription {
    ShapeDescription {
        place: place(),
        name: "lamp".into(),
        geometry: Arc::new(geometry),
        object_to_world,
        reverse_orientation: false,
        material: 0,
        media: None,
        area_light: Some(light),
        alpha: None,
    }
}

fn mesh(positions: Vec<Vec3>) -> GeometryDescription {
    let indices = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    GeometryDescription::Mesh { positions, normals: vec![], uvs: vec![], indices }
}

fn sphere(radius: f32) -> GeometryDescription {
    GeometryDescription::Sphere { radius, z_min: -radius, z_max: radius, phi_max: 360.0 }
}

fn disk(radius: f32) -> GeometryDescription {
    GeometryDescription::Disk { height: 0.0, radius, inner_radius: 0.0, phi_max: 360.0 }
}

fn cylinder(radius: f32, phi_max: f32) -> GeometryDescription {
    GeometryDescription::Cylinder { radius, z_min: -1.0, z_max: 0.5, phi_max }
}

fn light(kind: LightKind) -> LightDescription {
    let light_to_world = Mat4::IDENTITY;
    LightDescription { place: place(), light_to_world, scale: 1.0, power: None, kind, medium: None, portal: None }
}

fn picture(size: u32, pixel: impl Fn(u32, u32) -> [f32; 3]) -> ImageDescription {
    let rgb = (0..size * size).map(|i| pixel(i % size, i / size)).collect();
    ImageDescription { name: "sky".into(), width: size, height: size, rgb, alpha: vec![] }
}

fn uniform3(r: &mut Stream) -> [f32; 3] {
    [r.uniform(), r.uniform(), r.uniform()]
}

fn point(r: &mut Stream, half: f32) -> Vec3 {
    Vec3::from_array(uniform3(r)) * (2.0 * half) - half
}

fn direction(r: &mut Stream) -> Vec3 {
    loop {
        let v = point(r, 1.0);
        if v.length_squared() < 1.0 && v.length_squared() > 1e-4 {
            return v.normalize();
        }
    }
}

fn grey() -> Wavelengths<1> {
    Wavelengths::sample(WavelengthMode::MONO, 0.5)
}

/// Means of 1 / pdf and of radiance cos / pdf over n samples.
fn moments(lights: &Lights, p: Vec3, n: Vec3, with_normal: bool, samples: u32, key: u64) -> [Accumulator; 2] {
    let mut r = Stream::new(&[41, key]);
    let mut sums = [Accumulator::default(); 2];
    for _ in 0..samples {
        let s = lights.sample(p, with_normal.then_some(n), &grey(), uniform3(&mut r));
        let (omega, e) = s.map_or((0.0, 0.0), |s| {
            let cosine = n.dot(s.wi).max(0.0);
            (1.0 / f64::from(s.pdf), f64::from(s.radiance[0] * cosine) / f64::from(s.pdf))
        });
        sums[0].add(omega);
        sums[1].add(e);
    }
    sums
}

/// A scene with all kinds of lights.
fn everything() -> SceneDescription {
    let mut scene = empty();
    let mut r = Stream::new(&[44]);
    let corners: Vec<Vec3> = (0..60)
        .flat_map(|_| {
            let c = point(&mut r, 2.0);
            [c, c + point(&mut r, 0.5), c + point(&mut r, 0.5)]
        })
        .collect();
    scene.shapes.push(shape(mesh(corners.clone()), Mat4::IDENTITY, area_light(1.0, false)));
    scene.shapes.push(shape(mesh(corners), Mat4::from_translation(Vec3::X), area_light(0.2, true)));
    scene.shapes.push(shape(sphere(0.3), Mat4::from_translation(Vec3::new(1.0, 3.0, 0.0)), area_light(5.0, false)));
    scene.shapes.push(shape(disk(0.8), Mat4::from_translation(Vec3::new(-3.0, 0.0, 1.0)), area_light(2.0, true)));
    let squash = Mat4::from_translation(Vec3::new(0.0, 2.0, -3.0)) * Mat4::from_scale(Vec3::new(1.0, 0.4, 2.0));
    scene.shapes.push(shape(cylinder(0.4, 250.0), Mat4::from_rotation_x(0.6), area_light(2.0, true)));
    scene.shapes.push(shape(sphere(0.7), squash, area_light(3.0, false)));
    scene.shapes.push(shape(disk(0.9), squash, area_light(1.5, false)));
    scene
        .images
        .push(picture(16, |x, y| [x as f32 * 0.05, y as f32 * 0.03, if x == 3 && y == 9 { 40.0 } else { 0.0 }]));
    scene.lights = vec![
        light(LightKind::Point { from: Vec3::new(0.0, 2.0, 2.0), intensity: SpectrumDescription::Rgb([2.0; 3]) }),
        light(LightKind::Spot {
            from: Vec3::new(0.0, -2.0, 2.0),
            to: Vec3::ZERO,
            intensity: SpectrumDescription::Rgb([9.0; 3]),
            cone_angle: 40.0,
            cone_delta_angle: 10.0,
        }),
        light(LightKind::Distant { from: Vec3::ONE, to: Vec3::ZERO, irradiance: SpectrumDescription::Rgb([0.7; 3]) }),
        light(LightKind::Distant { from: Vec3::X, to: Vec3::Y, irradiance: SpectrumDescription::Rgb([0.1; 3]) }),
        light(LightKind::Constant { radiance: SpectrumDescription::Rgb([0.1; 3]) }),
        light(LightKind::Environment { image: 0 }),
        light(LightKind::Goniometric { intensity: SpectrumDescription::Rgb([1.0; 3]), image: 0 }),
        light(LightKind::Projection { image: 0, fov: 70.0 }),
    ];
    scene.lights[6].light_to_world = Mat4::from_translation(Vec3::new(2.0, 2.0, -2.0)) * Mat4::from_rotation_x(1.0);
    scene.lights[7].light_to_world = Mat4::from_translation(Vec3::new(-1.0, 0.0, -4.0)) * Mat4::from_rotation_y(0.3);
    scene.lights[5].light_to_world = Mat4::from_rotation_y(1.0) * Mat4::from_scale(Vec3::new(1.0, 2.0, -0.7));
    scene
}
