//! Vertices of light's paths, shared by all pixels: the same means as by flights alone, white furnaces, and no difference in an audit.
//!
//! All pixels of a sample number share their vertices, so that its mean over pixels is one independent value.

use moonmilk_core::{Mat4, Vec3, WavelengthMode};
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_render::audit::audit;
use moonmilk_render::description::{LightKind, MediumKind, SpectrumDescription};
use moonmilk_render::integrator::{Counters, Integrator, Policy};
use moonmilk_render::session;

use crate::common::{World, assert_equal, assert_exact, ball, flat, measure, rectangle, rgb, samples, smooth};

/// Adds a lamp above, to the right and nearer to the camera.
fn lamp(mut world: World) -> World {
    world.emitter(&flat(&cuboid(Vec3::new(0.9, 1.4, 0.6), Vec3::new(1.6, 1.8, 1.3))), 8.0);
    world
}

/// Returns a scene with as many pixels as make vertices worth their while.
fn fine(world: &World) -> World {
    let mut world = world.clone();
    let film = &mut world.0.film;
    (film.width, film.height, film.crop) = (128, 128, [0, 128, 0, 128]);
    world
}

/// Returns the picture's mean over n sample numbers by a policy, per channel, and asserts that light was followed into so many bodies at once or none.
fn means(world: &World, policy: Policy, n: u64, lit: bool) -> [moonmilk_core::Estimate; 3] {
    let scene = fine(world).scene();
    let integrator =
        Integrator::new(3 + policy as u64, WavelengthMode::Rgb, Default::default(), None).with_policy(policy);
    assert_eq!(integrator.for_sample(&scene, 0).preparation().count(), usize::from(lit));
    measure(n, |s| {
        let integrator = integrator.for_sample(&scene, s);
        let mut sum = [0.0f64; 3];
        for pixel in (0..256).map(|i| [8 * (i % 16) + 3, 8 * (i / 16) + 3]) {
            let rgb = session::sample(&scene, &integrator, pixel, s, &mut Counters::default()).rgb;
            sum.iter_mut().zip(rgb).for_each(|(s, x)| *s += f64::from(x) / 256.0);
        }
        sum
    })
}

/// Compares both policies.
fn assert_same(what: &str, world: &World, n: u64) {
    let n = samples(n, 4);
    let [classic, auto] = [Policy::Classic, Policy::Auto].map(|p| means(world, p, n, p == Policy::Auto));
    for (channel, (auto, classic)) in auto.into_iter().zip(classic).enumerate() {
        assert_equal(&format!("{what}, channel {channel}"), auto, classic);
    }
}

#[test]
fn a_furnace_is_white_by_vertices() {
    for (eta, g, smoothed) in [(1.5f32, 0.0f32, false), (1.0, 0.0, false), (1.4, 0.5, true), (1.3, -0.4, false)] {
        let mut world = World::new();
        let milk = world.medium(0.0, 8.0, g);
        let boundary = world.dielectric(eta, 0.0);
        let mesh = bumpy_sphere(2, 0.3);
        world.body(&if smoothed { smooth(&mesh) } else { flat(&mesh) }, boundary, Some(milk), None);
        // A room whose walls shine: under a sky alone flights are used.
        for (axis, s, t) in [(Vec3::X, Vec3::Y, Vec3::Z), (Vec3::Y, Vec3::Z, Vec3::X), (Vec3::Z, Vec3::X, Vec3::Y)] {
            world.emitter(&rectangle(5.0 * axis, 5.0 * t, 5.0 * s), 1.0);
            world.emitter(&rectangle(-5.0 * axis, 5.0 * s, 5.0 * t), 1.0);
        }
        let all = means(&world, Policy::Auto, samples(300, 4), true);
        for e in all {
            assert_exact(&format!("furnace, eta {eta}, g {g}"), e, 1.0, 2e-6);
        }
    }
}

#[test]
fn bodies_under_lamps_look_as_by_flights() {
    for (eta, sigma_a, sigma_s, g) in
        [(1.4f32, 0.1f32, 8.0f32, 0.0f32), (1.0, 0.1, 8.0, 0.0), (1.5, 1.0, 6.0, 0.5), (1.3, 0.2, 5.0, -0.4)]
    {
        let mut world = World::new();
        let milk = world.medium(sigma_a, sigma_s, g);
        let boundary = world.dielectric(eta, 0.0);
        world.body(&smooth(&bumpy_sphere(2, 0.3)), boundary, Some(milk), None);
        let floor = world.diffuse(0.5);
        world.surface(&rectangle(Vec3::Y * -1.4, Vec3::Z * 3.0, Vec3::X * 3.0), floor);
        let world = lamp(world).environment(0.3);
        assert_same(&format!("milk under a lamp, {eta} {sigma_a} {sigma_s} {g}"), &world, 150);
    }
}

#[test]
fn rough_bodies_under_lamps_look_as_by_flights() {
    // Interpolated and flat normals, slightly and very rough, denser and thinner than what is around.
    for (eta, alpha, g, smoothed) in
        [(1.4f32, 0.3f32, 0.0f32, true), (1.5, 0.1, 0.4, false), (0.8, 0.2, 0.0, false), (1.33, 0.6, -0.4, true)]
    {
        let mut world = World::new();
        let wax = world.medium(0.2, 6.0, g);
        let boundary = world.dielectric(eta, alpha);
        let mesh = bumpy_sphere(2, 0.3);
        world.body(&if smoothed { smooth(&mesh) } else { flat(&mesh) }, boundary, Some(wax), None);
        let world = lamp(world).environment(0.3);
        assert_same(&format!("rough milk under a lamp, {eta} {alpha} {g}"), &world, 150);
    }
}

#[test]
fn rough_bodies_under_points_and_in_colour_look_as_by_flights() {
    let coloured = MediumKind::Homogeneous {
        sigma_a: SpectrumDescription::Rgb([0.1, 0.4, 0.9]),
        sigma_s: SpectrumDescription::Rgb([3.0, 6.0, 11.0]),
        scale: 1.0,
        g: 0.0,
        emission: None,
    };
    let mut world = World::new();
    let skin = world.medium_of(coloured);
    let boundary = world.dielectric(1.4, 0.3);
    world.body(&flat(&bumpy_sphere(3, 0.8)), boundary, Some(skin), None);
    world.light(LightKind::Point { from: Vec3::new(1.0, 2.0, 2.0), intensity: rgb(6.0) });
    assert_same("rough folds under a point", &world.environment(0.1), 150);
}

#[test]
fn colours_come_out_as_by_flights() {
    // Lanes whose free paths differ by four, in two bodies at once.
    let coloured = |a: [f32; 3], s: [f32; 3]| MediumKind::Homogeneous {
        sigma_a: SpectrumDescription::Rgb(a),
        sigma_s: SpectrumDescription::Rgb(s),
        scale: 1.0,
        g: 0.0,
        emission: None,
    };
    let mut world = World::new();
    let skin = world.medium_of(coloured([0.1, 0.4, 0.9], [3.0, 6.0, 11.0]));
    let wax = world.medium_of(coloured([0.5, 0.1, 0.05], [8.0, 4.0, 2.0]));
    let boundary = world.dielectric(1.4, 0.0);
    world.body(&flat(&cuboid(Vec3::new(-1.2, -0.6, -0.3), Vec3::new(-0.1, 0.6, 0.3))), boundary, Some(skin), None);
    world.body(&flat(&cuboid(Vec3::new(0.1, -0.6, -0.3), Vec3::new(1.2, 0.6, 0.3))), boundary, Some(wax), None);
    assert_same("two colours", &lamp(world).environment(0.3), 200);
}

#[test]
fn lights_without_extent_shine_in_as_by_flights() {
    let mut world = World::new();
    let milk = world.medium(0.1, 8.0, 0.0);
    let boundary = world.dielectric(1.3, 0.0);
    world.body(&ball(1.0), boundary, Some(milk), None);
    world.light(LightKind::Point { from: Vec3::new(1.0, 2.0, 2.0), intensity: rgb(6.0) });
    assert_same("milk under a point", &world.distant(Vec3::new(-1.0, 0.5, 1.0), 1.0), 100);
}

#[test]
fn what_stands_on_a_table_and_what_hides_itself_looks_as_by_flights() {
    // A slab on a table at the same height: walls coincide.
    let mut world = World::new();
    let wax = world.medium(0.1, 6.0, 0.0);
    let boundary = world.dielectric(1.4, 0.0);
    world.body(&flat(&cuboid(Vec3::new(-1.0, -0.5, -0.6), Vec3::new(1.0, 0.2, 0.6))), boundary, Some(wax), None);
    let table = world.diffuse(0.7);
    world.surface(&rectangle(Vec3::Y * -0.5, Vec3::Z * 3.0, Vec3::X * 3.0), table);
    assert_same("wax on a table", &lamp(world).environment(0.3), 150);
    // Deep folds: vertices behind walls, light that leaves and comes in again.
    let mut world = World::new();
    let wax = world.medium(0.05, 4.0, 0.0);
    let boundary = world.dielectric(1.4, 0.0);
    world.body(&flat(&bumpy_sphere(3, 0.8)), boundary, Some(wax), None);
    world.emitter(&flat(&cuboid(Vec3::new(1.9, 1.9, 0.6), Vec3::new(2.6, 2.3, 1.3))), 20.0);
    assert_same("folds", &world.environment(0.3), 150);
}

#[test]
fn cameras_and_instances_inside_and_out_see_them_alike() {
    // The eye inside, at (0, 0, 4).
    let mut world = World::new();
    let milk = world.medium(0.3, 3.0, 0.0);
    let boundary = world.dielectric(1.3, 0.0);
    let far = cuboid(Vec3::new(-0.8, -0.8, 2.9), Vec3::new(0.8, 0.8, 4.5));
    world.body(&flat(&far), boundary, Some(milk), None);
    assert_same("eye in milk", &lamp(world).environment(0.3), 100);
    let mut world = World::new();
    let milk = world.medium(0.2, 6.0, 0.3);
    let boundary = world.dielectric(1.3, 0.0);
    let first = world.body(&smooth(&bumpy_sphere(2, 0.3)), boundary, Some(milk), None);
    let places = [Vec3::X, -Vec3::X].map(|x| Mat4::from_translation(0.7 * x) * Mat4::from_scale(Vec3::splat(0.5)));
    world.instances(first, &places);
    assert_same("two instances", &lamp(world).environment(0.3), 100);
}

#[test]
fn where_flights_find_less_or_something_is_inside_there_are_no_vertices() {
    let made = |world: &World| {
        let integrator = Integrator::new(5, WavelengthMode::Hero, Default::default(), None);
        let count = integrator.for_sample(&world.scene(), 0).preparation().count();
        // A limit of bounces, and plain walks, do without.
        let limited = Integrator::new(5, WavelengthMode::Hero, Default::default(), Some(9));
        assert_eq!(limited.for_sample(&world.scene(), 0).preparation().count(), 0);
        let classic = integrator.with_policy(Policy::Classic);
        assert_eq!(classic.for_sample(&world.scene(), 0).preparation().count(), 0);
        count
    };
    let body = |g: f32, sigma_s: f32| {
        let mut world = World::new();
        let milk = world.medium(0.1, sigma_s, g);
        let boundary = world.dielectric(1.4, 0.0);
        world.body(&flat(&bumpy_sphere(2, 0.3)), boundary, Some(milk), None);
        fine(&world)
    };
    assert_eq!(made(&lamp(body(0.0, 8.0))), 1);
    // Under a sky alone, forward scattering, too dense for the picture.
    assert_eq!(made(&body(0.0, 8.0).environment(1.0)), 0);
    assert_eq!(made(&lamp(body(0.8, 8.0))), 0);
    assert_eq!(made(&lamp(body(0.0, 80.0))), 0);
    // Behind a rough boundary, too.
    let mut rough = lamp(body(0.0, 8.0));
    rough.0.shapes[0].material = rough.dielectric(1.4, 0.2);
    assert_eq!(made(&rough), 1);
    // A table that reaches into it.
    let mut sunk = lamp(body(0.0, 8.0));
    let table = sunk.diffuse(0.5);
    sunk.surface(&rectangle(Vec3::Y * -0.9, Vec3::Z * 3.0, Vec3::X * 3.0), table);
    assert_eq!(made(&sunk), 0);
    // A pebble inside, and all of it in a ball of fog.
    let mut held = lamp(body(0.0, 8.0));
    let stone = held.diffuse(0.5);
    let pebble = held.surface(&ball(0.1), stone);
    assert_eq!(made(&held), 0);
    held.0.shapes[pebble].object_to_world = Mat4::from_translation(Vec3::new(1.2, 1.2, 1.2));
    assert_eq!(made(&held), 1);
    let (fog, nothing) = (held.medium(0.1, 0.2, 0.0), held.dielectric(1.0, 0.0));
    held.body(&ball(3.0), nothing, Some(fog), None);
    assert_eq!(made(&held), 0);
}

#[test]
fn what_reaches_into_a_body_s_box_and_not_into_it_takes_no_vertices_from_it() {
    // In a room of one mesh, on a large ball, beside a slope that cuts its box, lit by a lamp that rays pass.
    let mut world = World::new();
    let milk = world.medium(0.1, 8.0, 0.0);
    let boundary = world.dielectric(1.4, 0.0);
    world.body(&smooth(&bumpy_sphere(3, 0.2)), boundary, Some(milk), None);
    let grey = world.diffuse(0.5);
    let mut room = cuboid(Vec3::splat(-4.5), Vec3::splat(4.5));
    room.turn_inside_out();
    world.surface(&flat(&room), grey);
    let floor = world.surface(&ball(50.0), grey);
    world.0.shapes[floor].object_to_world = Mat4::from_translation(Vec3::Y * -51.3);
    world.surface(&rectangle(Vec3::new(-1.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 0.0), Vec3::Z * -0.4), grey);
    let mut world = lamp(world);
    assert_same("milk in a room", &world, 100);
    world.0.shapes.last_mut().expect("a lamp").alpha = Some(world.float(0.0));
    assert_same("milk under a lamp of opacity 0", &world, 100);
}

#[test]
fn a_body_in_a_glass_with_a_film_of_air_between_has_vertices() {
    let mut world = World::new();
    let milk = world.medium(0.2, 5.0, 0.0);
    let [water, glass] = [1.33, 1.5].map(|eta| world.dielectric(eta, 0.0));
    let box_of = |half: f32| cuboid(Vec3::splat(-half), Vec3::splat(half));
    world.body(&flat(&box_of(0.8)), water, Some(milk), None);
    let mut cavity = box_of(0.802);
    cavity.flip();
    world.body(&flat(&box_of(0.9).joined(&cavity)), glass, None, None);
    assert_same("milk in a glass", &lamp(world).environment(0.3), 150);
}

#[test]
fn an_audit_clears_vertices_by_sample_numbers() {
    let mut world = World::new();
    let milk = world.medium(0.1, 8.0, 0.0);
    let boundary = world.dielectric(1.4, 0.0);
    world.body(&flat(&bumpy_sphere(2, 0.3)), boundary, Some(milk), None);
    let world = fine(&lamp(world).environment(0.3));
    let (scene, plain) = (world.scene(), world.scene());
    let integrator = Integrator::new(5, WavelengthMode::Hero, Default::default(), None);
    let n = samples(24, 4);
    let found = audit(&scene, &integrator, &plain, [40, 56, 48, 64], n);
    println!("{:+.4} +- {:.4}, worst block {:.1}", found.relative().0, found.relative().1, found.worst_block);
    assert!(!found.differs() && !found.blocks_differ(), "{found:?}");
    assert!(found.difference.n == n && found.pairs == 256 * n && found.difference.std_err > 0.0);
}
