//! Instances of translucent objects: each is a body of its own, whatever its transform, and looks as its copy does.

use moonmilk_core::glam::Quat;
use moonmilk_core::{Mat4, Vec3};
use moonmilk_geometry::generate::bumpy_sphere;

use crate::bodies::Body;
use crate::common::{Tracer, World, assert_equal, ball, flat, measure, rectangle, samples, uniform_ray};
use crate::furnace::assert_white;
use crate::path_length::{UNNOTICED, assert_length};

/// Places in a ball of radius 5: turned, small, mirrored, squashed, sheared; no two of the unit bodies there touch.
fn places() -> [Mat4; 5] {
    let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.0);
    let place = |scale: Vec3, at: Vec3| Mat4::from_scale_rotation_translation(scale, turn, at);
    let mut shear = place(Vec3::splat(0.8), Vec3::new(0.0, -3.0, 0.5));
    shear.y_axis += shear.x_axis * 0.5;
    [
        place(Vec3::ONE, Vec3::new(2.5, 0.0, 0.0)),
        place(Vec3::splat(0.3), Vec3::new(-2.5, 0.0, 1.0)),
        place(Vec3::new(-0.9, 0.9, 0.9), Vec3::new(0.0, 3.0, 0.0)),
        place(Vec3::new(1.2, 0.2, 0.7), Vec3::new(0.0, 0.0, -3.2)),
        shear,
    ]
}

/// Radius of a ball around all of them.
const REACH: f32 = 5.0;

/// An object of a body and a small ball beside it, in all places, or copied there.
fn world(body: &Body, eta: f32, glow: bool, copied: bool) -> World {
    let mut world = World::new();
    let s = 3.0;
    let medium = match glow {
        true => world.glow(s * UNNOTICED, s, 0.4, 1.0 / (s * UNNOTICED)),
        false => world.medium(0.3, s, 0.4),
    };
    let boundary = world.dielectric(eta, 0.0);
    if copied {
        for m in places() {
            for (geometry, at) in [(&body.geometry, Mat4::IDENTITY), (&ball(0.1), BESIDE)] {
                let shape = world.body(geometry, boundary, Some(medium), None);
                world.0.shapes[shape].object_to_world = m * at;
            }
        }
    } else {
        world.body(&body.geometry, boundary, Some(medium), None);
        let shape = world.body(&ball(0.1), boundary, Some(medium), None);
        world.0.shapes[shape].object_to_world = BESIDE;
        world.instances(0, &places());
    }
    world
}

/// Beside a bumpy sphere, whose radius is 1.2 at most.
const BESIDE: Mat4 =
    Mat4::from_cols_array(&[1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.4, 0.0, 0.0, 1.0]);

fn bumpy(normals: bool) -> Body {
    let mesh = bumpy_sphere(3, 0.2);
    let geometry = if normals { crate::common::smooth(&mesh) } else { flat(&mesh) };
    Body { name: "bumpy mesh", geometry, volume: mesh.volume(), surface: mesh.area(), reach: 1.25 }
}

#[test]
fn every_single_path_finds_white_among_instances() {
    for (normals, eta) in [(false, 1.5), (true, 1.33)] {
        let mut scene = world(&bumpy(normals), eta, true, false);
        for m in &mut scene.0.media {
            m.kind = crate::common::glow(0.0, 3.0, 0.4, 0.0);
        }
        let tracer = scene.environment(1.0).tracer();
        assert_eq!(tracer.scene.objects.len(), 10);
        assert_white(&format!("instances, normals {normals}, eta {eta}"), tracer, REACH, samples(40_000, 16));
    }
}

#[test]
fn instances_share_the_mean_path_length_of_their_volumes() {
    let body = bumpy(true);
    let ball_volume = 4.0 / 3.0 * std::f64::consts::PI * 0.001;
    let stretch: f64 = places().iter().map(|m| f64::from(m.determinant()).abs()).sum();
    for eta in [1.0, 1.5] {
        let tracer = world(&body, eta, true, false).tracer();
        let volume = (body.volume + ball_volume) * stretch;
        assert_length(&format!("path length among instances, eta {eta}"), &tracer, REACH, volume, samples(200_000, 32));
    }
}

#[test]
fn instances_look_as_their_copies_do() {
    let body = bumpy(false);
    // Light from one side and from a lamp, on a ground that half of them stand in; media that absorb.
    let lit = |copied| -> Tracer {
        let mut world = world(&body, 1.4, false, copied);
        let grey = world.diffuse(0.6);
        world.surface(&rectangle(Vec3::Z * -3.2, Vec3::X * 9.0, Vec3::Y * 9.0), grey);
        world.emitter(&rectangle(Vec3::new(0.0, 0.0, 6.0), Vec3::Y, Vec3::X), 20.0);
        world.distant(Vec3::new(1.0, -1.0, 2.0), 2.0).tracer()
    };
    let look = |tracer: &Tracer, seed| {
        let [l] = measure(samples(60_000, 32), |i| {
            let (o, d) = uniform_ray(seed, i, 4.9);
            [tracer.radiance(i + (seed << 40), o, d)]
        });
        tracer.assert_sound();
        l
    };
    assert_equal("instances and copies", look(&lit(false), 61), look(&lit(true), 62));
}

#[test]
fn mirrored_objects_keep_their_inside_inside() {
    for mirror in [Mat4::IDENTITY, Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0))] {
        let mut world = World::new();
        let medium = world.medium(0.0, 2.0, 0.0);
        let boundary = world.dielectric(1.5, 0.0);
        for geometry in [flat(&bumpy_sphere(2, 0.2)), ball(1.0)] {
            let shape = world.body(&geometry, boundary, Some(medium), None);
            world.0.shapes[shape].object_to_world = mirror;
        }
        let scene = world.scene();
        assert!(scene.objects.iter().all(|o| o.body.is_some()), "{mirror}");
    }
}
