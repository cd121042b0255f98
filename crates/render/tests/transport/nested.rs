//! Bodies within and across each other: the one of the highest priority is there, boundaries are where it begins and ends.

use std::f64::consts::PI;
use std::sync::Arc;

use moonmilk_core::{Mat4, Random, Stream, Vec3};
use moonmilk_geometry::Mesh;
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_render::description::GeometryDescription;
use moonmilk_render::integrator::Policy;

use crate::common::{
    KEEP_ALL, Tracer, World, assert_exact, ball, direction, flat, glow, measure, samples, uniform_ray,
};
use crate::furnace::{ROUNDING, assert_white};
use crate::path_length::{UNNOTICED, assert_length};

/// Radius of a ball around everything here.
const REACH: f32 = 2.5;

/// Two bodies that cross, moved apart by 1 along x: geometry, index, priority.
fn pair(bodies: [(&Arc<GeometryDescription>, f32, Option<i32>); 2]) -> World {
    let mut world = World::new();
    for (i, (geometry, eta, priority)) in bodies.into_iter().enumerate() {
        let medium = world.medium(0.0, [3.0, 8.0][i], [0.5, -0.2][i]);
        let mut boundary = world.dielectric(eta, 0.0);
        if let Some(priority) = priority {
            boundary = world.with_priority(boundary, priority);
        }
        let shape = world.body(geometry, boundary, Some(medium), None);
        world.0.shapes[shape].object_to_world = Mat4::from_translation(Vec3::X * (i as f32 - 0.5));
    }
    world
}

/// Lets one body shine its path lengths, see `path_length`.
fn show(world: &mut World, body: usize) {
    let s = [3.0, 8.0][body];
    world.0.media[body].kind = glow(s * UNNOTICED, s, 0.3, 1.0 / (s * UNNOTICED));
}

/// Volume of a unit ball, and of two of them with centres 1 apart: lens pi (4 + d) (2 - d)^2 / 12.
const BALL: f64 = 4.0 / 3.0 * PI;
const UNION: f64 = 2.0 * BALL - 5.0 * PI / 12.0;

#[test]
fn every_single_path_finds_white_in_bodies_that_cross() {
    let meshes = [flat(&bumpy_sphere(3, 0.2)), crate::common::smooth(&bumpy_sphere(2, 0.3))];
    for (n, priority) in [
        ([1.5, 1.33], [Some(2), Some(1)]),
        ([1.5, 1.33], [Some(1), Some(2)]),
        ([1.5, 1.5], [Some(1), Some(1)]),
        ([1.5, 1.33], [None, None]),
    ] {
        let world = pair([(&meshes[0], n[0], priority[0]), (&meshes[1], n[1], priority[1])]);
        let what = format!("crossing meshes, indices {n:?}, priorities {priority:?}");
        assert_white(&what, world.environment(1.0).tracer(), REACH, samples(10_000, 16));
    }
}

#[test]
fn a_hollow_of_air_in_glass_is_white_on_average() {
    // What has the index of vacuum counts in the overlap, and light is looked for in it: only the mean is 1.
    let meshes = [flat(&bumpy_sphere(3, 0.2)), flat(&bumpy_sphere(2, 0.3))];
    let world = pair([(&meshes[0], 1.4, Some(0)), (&meshes[1], 1.0, Some(3))]);
    let tracer = world.environment(1.0).tracer();
    let [l] = measure(samples(40_000, 64), |i| {
        let (o, d) = uniform_ray(73, i, REACH);
        [tracer.radiance(i, o, d)]
    });
    tracer.assert_sound();
    assert_exact("furnace of a scattering hollow in glass", l, 1.0, 0.0);
}

#[test]
fn crossing_bodies_share_the_path_length_of_their_union_by_who_is_there() {
    // Each shows its length over its squared index: the volume of the region where it counts. Equal priorities and volumes: the later.
    let unit = ball(1.0);
    for (n, priority, first) in [
        ([1.0, 1.0], [None, None], UNION - BALL),
        ([1.0, 1.0], [Some(1), None], BALL),
        ([1.5, 1.33], [Some(2), Some(1)], BALL),
        ([1.5, 1.33], [Some(1), Some(2)], UNION - BALL),
        ([1.5, 1.5], [Some(1), Some(1)], UNION - BALL),
    ] {
        for (shown, volume) in [(vec![0], first), (vec![1], UNION - first), (vec![0, 1], UNION)] {
            let mut world = pair([(&unit, n[0], priority[0]), (&unit, n[1], priority[1])]);
            shown.iter().for_each(|&b| show(&mut world, b));
            let what = format!("path length in {shown:?} of two balls, indices {n:?}, priorities {priority:?}");
            assert_length(&what, &world.tracer(), REACH, volume, samples(40_000, 64));
        }
    }
}

#[test]
fn a_path_that_left_a_body_unnoticed_finds_out_where_it_is() {
    // Found among 2.6e6: where the balls cross, this path cuts one over a length that rounding swallows, and leaves the other into it.
    let unit = ball(1.0);
    let mut world = pair([(&unit, 1.5, Some(2)), (&unit, 1.33, Some(1))]);
    show(&mut world, 1);
    let tracer = world.tracer().by(Policy::Classic);
    let (o, d) = uniform_ray(31, 1_117_536, REACH);
    tracer.radiance(1_117_536, o, d);
    let c = tracer.counters();
    assert!(c.rescued == 1 && c.lost == 0, "{c:?}");
}

/// Reflectance at normal incidence.
fn fresnel(n: f64) -> f64 {
    ((n - 1.0) / (n + 1.0)).powi(2)
}

/// Returns what an eye on the first side sees of a stack in white light: reflectances of its faces, optical depths between them.
fn stack(faces: &[f64], depths: &[f64]) -> f64 {
    // Add layer by layer from the far side: reflectance, transmittance and reflectance from behind of what is there so far.
    let (mut r, mut t, mut r_back) = (faces[0], 1.0 - faces[0], faces[0]);
    for (f, depth) in faces[1..].iter().zip(depths) {
        let e = (-depth).exp();
        let series = 1.0 / (1.0 - r_back * f * e * e);
        r += t * t * f * e * e * series;
        r_back = f + (1.0 - f) * (1.0 - f) * r_back * e * e * series;
        t *= e * (1.0 - f) * series;
    }
    r + t
}

#[test]
fn overlapping_slabs_absorb_and_reflect_as_the_stack_that_priority_makes_of_them() {
    // Slabs from -1 to .5 and from 0 to 1 along x, wide enough; rays along x meet all faces at right angles.
    let slabs = [(-1.0, 0.5, 1.5, 0.4), (0.0, 1.0, 1.33, 0.9)];
    let (n, a) = ([1.5, 1.33], [0.4, 0.9]);
    let f = [fresnel(n[0]), fresnel(n[0] / n[1]), fresnel(n[1])];
    for (priority, same, exact) in [
        ([2, 1], false, (f.to_vec(), vec![1.5 * a[0], 0.5 * a[1]])),
        ([1, 2], false, (f.to_vec(), vec![1.0 * a[0], 1.0 * a[1]])),
        // Equal priorities: the smaller one.
        ([0, 0], false, (f.to_vec(), vec![1.0 * a[0], 1.0 * a[1]])),
        // Equal indices: no boundary between them.
        ([2, 1], true, (vec![f[0], f[0]], vec![1.5 * a[0] + 0.5 * a[1]])),
    ] {
        let (mut faces, mut depths) = exact;
        let mut world = World::new();
        for (i, (from, to, index, sigma_a)) in slabs.into_iter().enumerate() {
            let medium = world.medium(sigma_a, 0.0, 0.0);
            let boundary = world.dielectric(if same { 1.5 } else { index }, 0.0);
            let boundary = world.with_priority(boundary, priority[i]);
            let slab = cuboid(Vec3::new(from, -9.0, -9.0), Vec3::new(to, 9.0, 9.0));
            world.body(&flat(&slab), boundary, Some(medium), None);
        }
        let tracer = world.environment(1.0).tracer();
        for side in [-1.0, 1.0] {
            let [l] = measure(samples(20_000, 64), |i| {
                [tracer.radiance(i, Vec3::new(3.0 * side, 0.3, 0.2), Vec3::X * -side)]
            });
            let what = format!("slabs of priorities {priority:?}, equal indices {same}, from {side}");
            // Rounding of single precision.
            assert_exact(&what, l, stack(&faces, &depths), 1e-6);
            faces.reverse();
            depths.reverse();
        }
        tracer.assert_sound();
    }
}

#[test]
fn a_camera_inside_of_bodies_sees_white_times_its_squared_index() {
    // In the first alone, in both, in the second alone, in neither; indices 1.5 and 1.33, the first counts where both are.
    let meshes = [flat(&bumpy_sphere(3, 0.2)), flat(&bumpy_sphere(3, 0.1))];
    let world = pair([(&meshes[0], 1.5, Some(2)), (&meshes[1], 1.33, Some(1))]);
    let mut tracer = world.environment(1.0).tracer();
    tracer.integrator.roulette = KEEP_ALL;
    for (x, n, inside) in [(-1.0, 1.5, 1), (0.0, 1.5, 2), (1.0, 1.33, 1), (2.4, 1.0, 0)] {
        let o = Vec3::new(x, 0.1, 0.05);
        assert_eq!(tracer.scene.nest_at(o).bodies().len(), inside, "at {o}");
        for i in 0..2000 {
            let mut r = Stream::new(&[71, i]);
            let l = tracer.radiance(i, o, direction(r.uniform2()));
            let exact = n * n;
            assert!((l / exact - 1.0).abs() < ROUNDING, "from {o}: {l} instead of {exact}");
        }
    }
    tracer.assert_sound();
}

#[test]
fn a_camera_inside_of_nine_shells_knows_them_all() {
    // Each 1.05 times as dense as the one around it, as pbrt says it; then the same against vacuum, in shuffled order.
    for absolute in [false, true] {
        let mut world = World::new();
        for k in [4, 0, 8, 2, 6, 1, 5, 3, 7] {
            let medium = world.medium(0.0, 1.0 + k as f32, 0.0);
            let boundary = match absolute {
                false => world.dielectric(1.05, 0.0),
                true => {
                    let boundary = world.dielectric(1.05f32.powi(k + 1), 0.0);
                    world.with_priority(boundary, k)
                }
            };
            world.body(&ball(2.0 - 0.2 * k as f32), boundary, Some(medium), None);
        }
        let mut tracer = world.environment(1.0).tracer();
        tracer.integrator.roulette = KEEP_ALL;
        for (o, count) in [(Vec3::ZERO, 9), (Vec3::Y * 1.1, 5), (Vec3::Z * 2.1, 0)] {
            assert_eq!(tracer.scene.nest_at(o).bodies().len(), count);
            let exact = 1.05f64.powi(2 * count as i32);
            for i in 0..2000 {
                let mut r = Stream::new(&[72, i]);
                let l = tracer.radiance(i, o, direction(r.uniform2()));
                // 18 factors, each rounded to 2^-24, on a path that crosses many.
                assert!((l / exact - 1.0).abs() < 3.0 * ROUNDING, "from {o}: {l} instead of {exact}");
            }
        }
        tracer.assert_sound();
    }
}

#[test]
fn fog_around_the_camera_is_outside_of_clear_glass_and_inside_of_what_says_nothing() {
    // A glass ball in an absorbing fog: without a word on its inside the fog is there (as in pbrt), with a priority it is clear.
    let fog = 0.5;
    for (priority, inside) in [(None, fog), (Some(0), 0.0)] {
        let mut world = World::new();
        let medium = world.medium(fog, 0.0, 0.0);
        world.0.camera.medium = Some(medium);
        let mut glass = world.dielectric(1.0 + 1e-6, 0.0);
        if let Some(priority) = priority {
            glass = world.with_priority(glass, priority);
        }
        world.surface(&ball(1.0), glass);
        world.emitter(&crate::common::rectangle(Vec3::Z * -3.0, Vec3::X * 9.0, Vec3::Y * 9.0), 1.0);
        let tracer = Tracer::new(world.scene());
        let l = tracer.radiance(0, Vec3::Z * 2.0, Vec3::NEG_Z);
        let exact = (-f64::from(3.0 * fog + 2.0 * inside)).exp();
        // Rounding, and a Fresnel reflectance of 2.5e-13.
        assert!((l / exact - 1.0).abs() < 1e-5, "{l} {exact}");
    }
}

#[test]
fn a_mesh_that_touches_nothing_else_is_as_it_was_without_priorities() {
    // A priority on a lone body changes nothing, to the bit.
    let mesh: Mesh = bumpy_sphere(3, 0.3);
    let radiance = |priority: Option<i32>| {
        let mut world = World::new();
        let medium = world.medium(0.4, 3.0, 0.5);
        let mut boundary = world.dielectric(1.4, 0.0);
        if let Some(p) = priority {
            boundary = world.with_priority(boundary, p);
        }
        world.body(&flat(&mesh), boundary, Some(medium), None);
        let tracer = world.environment(1.0).tracer();
        (0..2000).map(|i| tracer.radiance(i, Vec3::new(0.1, 0.2, 3.0), Vec3::NEG_Z)).collect::<Vec<_>>()
    };
    assert_eq!(radiance(None), radiance(Some(7)));
}
