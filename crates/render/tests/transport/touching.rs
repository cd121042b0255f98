//! Walls of several objects at exactly the same place, where rounding decides which of them a ray finds.

use std::sync::Arc;

use moonmilk_core::Vec3;
use moonmilk_geometry::generate::cuboid;
use moonmilk_render::description::{GeometryDescription, LightKind, MaterialId};

use crate::common::{World, assert_equal, assert_exact, ball, flat, glow, measure, rectangle, samples, uniform_ray};
use crate::furnace::{ROUNDING, assert_white};
use crate::path_length::{UNNOTICED, assert_length};

/// Radius of a ball around the rows.
const REACH: f32 = 1.4;
/// Bodies in a row.
const BOXES: u8 = 4;

/// The k-th of a row of boxes, turned against the axes so that no coordinate of a common wall is exact.
fn box_of(k: u8) -> Arc<GeometryDescription> {
    part(Vec3::new(-1.1 + 0.55 * f32::from(k), -0.5, -0.5), Vec3::new(0.55, 1.0, 1.0))
}

/// A box from a corner, turned.
fn part(low: Vec3, size: Vec3) -> Arc<GeometryDescription> {
    let turn = moonmilk_core::Mat4::from_rotation_z(0.3) * moonmilk_core::Mat4::from_rotation_x(0.7);
    let mut shape = (*flat(&cuboid(low, low + size))).clone();
    if let GeometryDescription::Mesh { positions, .. } = &mut shape {
        positions.iter_mut().for_each(|p| *p = turn.transform_point3(*p));
    }
    Arc::new(shape)
}

/// A row of boxes that touch, with media that scatter differently.
fn row(eta: f32, roughness: f32) -> World {
    let mut world = World::new();
    for k in 0..BOXES {
        let medium = world.medium(0.0, 1.0 + f32::from(k), 0.3);
        let boundary = world.dielectric(eta, roughness);
        world.body(&box_of(k), boundary, Some(medium), None);
    }
    world
}

#[test]
fn no_light_is_lost_between_bodies_that_touch() {
    for eta in [1.3, 1.5] {
        let tracer = row(eta, 0.0).environment(1.0).tracer();
        assert_white(&format!("furnace of boxes that touch, eta {eta}"), tracer, REACH, samples(20_000, 16));
    }
    // Without refraction light is sampled through all walls; weights vary, their mean is exact.
    for (name, world) in [("smooth", row(1.0, 0.0)), ("twice the same", twice()), ("half within", half())] {
        let tracer = world.environment(1.0).tracer();
        let [l] = measure(samples(100_000, 64), |i| {
            let (o, d) = uniform_ray(75, i, REACH);
            [tracer.radiance(i, o, d)]
        });
        tracer.assert_sound();
        assert_exact(&format!("furnace without refraction, {name}"), l, 1.0, ROUNDING);
    }
}

/// The same box twice, with different media: the later is there.
fn twice() -> World {
    let mut world = World::new();
    for s in [5.0, 2.0] {
        let medium = world.medium(0.0, s, 0.0);
        let boundary = world.dielectric(1.0, 0.0);
        world.body(&box_of(1), boundary, Some(medium), None);
    }
    world
}

/// A box that ends where the one around it ends, on five sides.
fn half() -> World {
    let mut world = World::new();
    for (length, s) in [(2.2, 1.0), (1.0, 6.0)] {
        let medium = world.medium(0.0, s, 0.0);
        let boundary = world.dielectric(1.0, 0.0);
        world.body(&part(Vec3::new(-1.1, -0.5, -0.5), Vec3::new(length, 1.0, 1.0)), boundary, Some(medium), None);
    }
    world
}

#[test]
fn every_body_of_a_row_keeps_its_share_of_the_path() {
    // 4 eta^2 V / S for the light that enters from all around: in each body the path is as long as in it alone, if it is seen through its
    // neighbours; see `path_length`.
    for eta in [1.0f32, 1.5] {
        for shown in [0, 1] {
            let mut world = row(eta, 0.0);
            let s = 1.0 + shown as f32;
            world.0.media[shown].kind = glow(s * UNNOTICED, s, 0.3, 1.0 / (s * UNNOTICED));
            let volume = 0.55;
            let what = format!("path in box {shown} of a row, eta {eta}");
            assert_length(&what, &world.tracer(), REACH, volume, samples(100_000, 64));
        }
    }
}

#[test]
fn a_body_cut_in_pieces_looks_as_it_did_in_one() {
    // Lit by a small light, which is found through the inner walls.
    let light = |mut world: World| {
        world.emitter(&rectangle(Vec3::new(0.0, 3.0, 0.0), Vec3::X * 0.2, Vec3::Z * 0.2), 100.0);
        world.light(LightKind::Point { from: Vec3::new(0.3, -2.0, 0.5), intensity: crate::common::rgb(2.0) });
        world.tracer()
    };
    let mut one = World::new();
    let (clear, medium) = (one.dielectric(1.0, 0.0), one.medium(0.3, 3.0, 0.3));
    one.body(&part(Vec3::new(-1.1, -0.5, -0.5), Vec3::new(2.2, 1.0, 1.0)), clear, Some(medium), None);
    let mut many = World::new();
    for k in 0..BOXES {
        let (clear, medium) = (many.dielectric(1.0, 0.0), many.medium(0.3, 3.0, 0.3));
        many.body(&box_of(k), clear, Some(medium), None);
    }
    let [a, b] = [(light(one), 1u64), (light(many), 2)].map(|(tracer, seed)| {
        let [l] = measure(samples(200_000, 32), |i| {
            let (o, d) = uniform_ray(76 + seed, i, REACH);
            [tracer.radiance(i, o, d)]
        });
        tracer.assert_sound();
        l
    });
    assert_equal("a box in one and in four", a, b);
}

#[test]
fn no_light_passes_a_table_on_which_a_body_stands() {
    // A light shut up in a black box, and bodies whose base is exactly on its lid: not one path may find it.
    let table = |world: &mut World, black: MaterialId| {
        world.surface(&part(Vec3::new(-1.0, -1.0, -1.0), Vec3::new(2.0, 1.0, 2.0)), black);
        world.emitter(&ball(0.1), 1.0);
        let lamp = world.0.shapes.len() - 1;
        world.0.shapes[lamp].object_to_world = moonmilk_core::Mat4::from_rotation_z(0.3)
            * moonmilk_core::Mat4::from_rotation_x(0.7)
            * moonmilk_core::Mat4::from_translation(Vec3::new(0.0, -0.5, 0.0));
    };
    for (eta, roughness) in [(1.0, 0.0), (1.5, 0.0), (1.5, 0.3)] {
        let mut world = World::new();
        let black = world.diffuse(0.0);
        table(&mut world, black);
        let (boundary, medium) = (world.dielectric(eta, roughness), world.medium(0.0, 3.0, 0.0));
        world.body(&part(Vec3::new(-0.7, 0.0, -0.7), Vec3::new(1.4, 0.5, 1.4)), boundary, Some(medium), None);
        let tracer = world.tracer();
        let n = samples(50_000, 16);
        for i in 0..n {
            let (o, d) = uniform_ray(77, i, 2.0);
            let l = tracer.radiance(i, o, d);
            assert!(l == 0.0, "eta {eta}, roughness {roughness}: path {i} finds {l}");
        }
        assert!(tracer.assert_sound().collisions > n / 10);
    }
}

#[test]
fn a_body_on_a_white_table_gives_back_all_light() {
    // In uniform light a table that reflects everything is as white as the sky, and the body on it cannot be seen.
    for eta in [1.0, 1.5] {
        let mut world = World::new();
        let white = world.diffuse(1.0);
        world.surface(&part(Vec3::new(-1.0, -1.0, -1.0), Vec3::new(2.0, 1.0, 2.0)), white);
        let (boundary, medium) = (world.dielectric(eta, 0.0), world.medium(0.0, 3.0, 0.0));
        world.body(&part(Vec3::new(-0.7, 0.0, -0.7), Vec3::new(1.4, 0.5, 1.4)), boundary, Some(medium), None);
        let tracer = world.environment(1.0).tracer();
        let [l] = measure(samples(100_000, 64), |i| {
            let (o, d) = uniform_ray(78, i, 2.0);
            [tracer.radiance(i, o, d)]
        });
        tracer.assert_sound();
        assert_exact(&format!("white table, eta {eta}"), l, 1.0, ROUNDING);
    }
}
