//! What the doctor finds in scenes that are sound but for one fault, and what it measures on sound and unsound bodies.
//!
//! Significance: 4.9 standard errors (1e-6 two-sided); seeds are fixed.

#[path = "common/mod.rs"]
#[allow(dead_code)]
mod common;

use std::sync::Arc;

use common::*;
use moonmilk_core::{Mat4, Vec3};
use moonmilk_geometry::Mesh;
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_render::description::*;
use moonmilk_render::doctor::{Report, Severity, Unmeasured, examine, furnace};

fn cube(half: f32, at: Vec3) -> Mesh {
    cuboid(at - half, at + half)
}

/// A world under uniform light with one object of a grey medium behind a smooth boundary.
fn with(geometry: &Arc<GeometryDescription>, sigma_s: f32) -> World {
    let mut world = World::new().environment(1.0);
    let medium = world.medium(0.001, sigma_s, 0.5);
    let glass = world.dielectric(1.5, 0.0);
    world.body(geometry, glass, Some(medium), None);
    world
}

fn subsurface(geometry: &Arc<GeometryDescription>, sigma_s: f32) -> World {
    let mut world = World::new().environment(1.0);
    let [sigma_a, sigma_s] = [0.001, sigma_s].map(|x| world.spectrum(SpectrumDescription::Constant(x)));
    let material = world.subsurface(SubsurfaceMedium::Coefficients { sigma_a, sigma_s }, 0.0, 1.33);
    world.surface(geometry, material);
    world
}

fn report(world: &World) -> Report {
    examine(&world.0).expect("the scene can be built")
}

/// Codes of all findings, problems with an exclamation mark.
fn codes(world: &World) -> Vec<String> {
    let mark = |s| if s == Severity::Problem { "!" } else { "" };
    report(world).findings.iter().map(|f| format!("{}{}", f.code, mark(f.severity))).collect()
}

#[test]
fn sound_objects_give_no_findings_and_true_figures() {
    for world in [with(&flat(&cube(1.0, Vec3::ZERO)), 2.0), subsurface(&flat(&cube(1.0, Vec3::ZERO)), 2.0)] {
        let r = report(&world);
        assert!(r.findings.is_empty() && r.problems() == 0, "{:?}", r.findings);
        let [b] = r.bodies.as_slice() else { panic!("one body: {r:?}") };
        // A cube of side 2: V 8, S 24, mean chord 4/3.
        assert!((b.volume - 8.0).abs() < 1e-6 && (b.area - 24.0).abs() < 1e-6 && b.closed && b.smooth, "{b:?}");
        let [low, high] = b.size().expect("closed");
        assert!((low / (2.001 * 4.0 / 3.0) - 1.0).abs() < 1e-6 && low == high, "{b:?}");
        let eta2 = b.eta * b.eta;
        assert!((b.path_length().expect("closed") / (eta2 * 4.0 / 3.0) - 1.0).abs() < 1e-6);
        assert_eq!((r.shapes, r.lights, b.count, b.triangles), (1, 1, 1, 12));
    }
    assert!(codes(&with(&ball(1.0), 2.0)).is_empty());
}

#[test]
fn faults_of_meshes_are_told_apart() {
    let sphere = bumpy_sphere(2, 0.2);
    let open = Mesh::new(sphere.positions().to_vec(), vec![], vec![], sphere.indices()[1..].to_vec()).expect("a mesh");
    let mut inside_out = sphere.clone();
    inside_out.flip();
    let mut cavity = cube(1.0, Vec3::ZERO);
    cavity.flip();
    let outer = cube(2.0, Vec3::ZERO);
    let hollow = outer.clone().joined(&cavity);
    let double = outer.clone().joined(&cube(1.0, Vec3::ZERO));
    let apart = outer.clone().joined(&cube(1.0, Vec3::X * 8.0));
    let overlapping = outer.clone().joined(&cube(1.0, Vec3::X * 2.0));
    let mut twice = sphere.indices().to_vec();
    twice.push(twice[7]);
    let twice = Mesh::new(sphere.positions().to_vec(), vec![], vec![], twice).expect("a mesh");
    // A ball of which one vertex is pulled out through the other side.
    let mut pulled = sphere.positions().to_vec();
    pulled[0] *= -1.7;
    let pierced = Mesh::new(pulled, vec![], vec![], sphere.indices().to_vec()).expect("a mesh");
    let cases: [(&str, &Mesh, &[&str], &[&str]); 7] = [
        ("open", &open, &["open!"], &["open!"]),
        ("inside out", &inside_out, &["inside-out!"], &["inside-out"]),
        ("hollow", &hollow, &["shells"], &["shells"]),
        ("double wall", &double, &["shell-facing!"], &["shell-facing!"]),
        ("two pieces", &apart, &["shells"], &["shells"]),
        ("overlapping pieces", &overlapping, &["overlapping-shells!"], &["overlapping-shells!"]),
        ("a face twice", &twice, &["duplicates!", "non-manifold!"], &["duplicates!", "non-manifold!"]),
    ];
    for (what, mesh, dielectric, translucent) in cases {
        assert_eq!(codes(&with(&flat(mesh), 1.0)), dielectric, "{what}, a dielectric around a medium");
        assert_eq!(codes(&subsurface(&flat(mesh), 1.0)), translucent, "{what}, a subsurface material");
    }
    assert!(
        codes(&with(&flat(&pierced), 1.0)).contains(&"self-intersecting!".to_owned()),
        "{:?}",
        codes(&with(&flat(&pierced), 1.0))
    );
}

#[test]
fn every_finding_names_object_and_place_and_says_what_to_do() {
    let mut world = with(&flat(&cube(1.0, Vec3::ZERO)), 1e-6);
    let glass = world.0.shapes[0].material;
    world.body(&flat(&cube(1.0, Vec3::ONE)), glass, Some(0), None);
    world.0.media.push(MediumDescription { name: "spare".into(), ..world.0.media[0].clone() });
    let found = report(&world).findings;
    let list: Vec<&str> = found.iter().map(|f| f.code).collect();
    assert_eq!(list, ["thin", "thin", "overlapping-objects", "unused-medium"]);
    for f in found {
        assert!(
            f.place.is_some() && f.advice.len() > 20 && (f.object.is_some() || f.message.contains("spare")),
            "{f:?}"
        );
    }
}

#[test]
fn normals_against_the_faces_are_found() {
    let sphere = bumpy_sphere(3, 0.0);
    let normals = |sign: f32| {
        let n: Vec<Vec3> = sphere.positions().iter().map(|p| *p * sign).collect();
        Arc::new(GeometryDescription::Mesh {
            positions: sphere.positions().to_vec(),
            normals: n,
            uvs: vec![],
            indices: sphere.indices().to_vec(),
        })
    };
    assert!(codes(&with(&normals(1.0), 1.0)).is_empty());
    assert_eq!(codes(&with(&normals(-1.0), 1.0)), ["normals!"]);
    // A mirror image turns normals and windings alike.
    let mut mirrored = with(&normals(1.0), 1.0);
    mirrored.0.shapes[0].object_to_world = Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    assert!(codes(&mirrored).is_empty(), "{:?}", codes(&mirrored));
}

#[test]
fn sizes_out_of_range_suggest_the_factor_of_units() {
    for (sigma_s, code, factor) in
        [(0.01, "thin!", Some("1000")), (1e12, "dense!", None), (1e6, "dense!", Some("0.001")), (3.0, "", None)]
    {
        let r = report(&subsurface(&ball(1.0), sigma_s));
        let Some(f) = r.findings.first() else {
            assert_eq!(code, "");
            continue;
        };
        assert_eq!(format!("{}!", f.code), code, "{f:?}");
        let told = factor.map_or("check the coefficients".to_owned(), |x| format!("`float scale` {x}"));
        assert!(f.advice.contains(&told), "{f:?}");
    }
}

#[test]
fn light_that_is_missing_black_or_turned_away_is_found() {
    let body = || {
        let mut w = World::new();
        let medium = w.medium(0.01, 2.0, 0.0);
        let boundary = w.dielectric(1.0, 0.0);
        w.body(&ball(1.0), boundary, Some(medium), None);
        w
    };
    assert_eq!(codes(&body()), ["no-light!"]);
    assert_eq!(codes(&body().environment(0.0)), ["black-light!"]);
    assert!(codes(&body().distant(Vec3::Y, 1.0)).is_empty(), "no refractive boundary hides the inside");
    // A quad below the ball that shines down, and the same turned over.
    let quad = |sign: f32| rectangle(Vec3::new(0.0, -5.0, 0.0), Vec3::X, Vec3::Z * sign);
    let mut up = body();
    up.emitter(&quad(-1.0), 1.0);
    assert!(codes(&up).is_empty(), "{:?}", codes(&up));
    let mut down = body();
    down.emitter(&quad(1.0), 1.0);
    assert_eq!(codes(&down), ["light-faces-away!"]);
    let mut refracts = with(&ball(1.0), 1.0);
    refracts.0.lights.clear();
    assert!(codes(&refracts.clone().distant(Vec3::Y, 1.0)).is_empty(), "parallel light is found behind the boundary");
    // Through others around it, too, but not where a map turns their normals.
    let glass = refracts.dielectric(1.2, 0.0);
    refracts.surface(&ball(2.0), glass);
    assert!(codes(&refracts.clone().distant(Vec3::Y, 1.0)).is_empty(), "parallel light is found in a glass");
    refracts.displace_all(0.01);
    let milk = refracts.0.shapes[0].material;
    refracts.0.materials[milk].displacement = None;
    assert_eq!(codes(&refracts.clone().distant(Vec3::Y, 1.0)), ["point-lights!"]);
    // Fog without a boundary of its own is hidden by the glass alone.
    let mut fog = refracts.clone();
    fog.0.shapes[0].material = fog.dielectric(1.0, 0.0);
    assert_eq!(codes(&fog.clone().distant(Vec3::Y, 1.0)), ["point-lights!"]);
    fog.0.materials.iter_mut().for_each(|m| m.displacement = None);
    assert!(codes(&fog.distant(Vec3::Y, 1.0)).is_empty(), "parallel light is found in fog in a glass");
    assert_eq!(codes(&refracts.environment(1.0).distant(Vec3::Y, 1.0)), ["point-lights"]);
}

#[test]
fn media_that_no_path_reaches_and_cameras_in_bodies_are_found() {
    let mut world = with(&ball(1.0), 1.0);
    let wall = world.diffuse(0.5);
    world.0.shapes[0].material = wall;
    assert_eq!(codes(&world), ["unreachable-medium!"]);
    // The camera of these scenes stands at (0, 0, 4).
    let around = with(&flat(&cube(5.0, Vec3::ZERO)), 0.1);
    assert_eq!(codes(&around), ["camera-inside"]);
    let mut told = around;
    told.0.camera.medium = Some(0);
    assert!(codes(&told).is_empty(), "{:?}", codes(&told));
    told.0.media.push(MediumDescription { name: "other".into(), ..told.0.media[0].clone() });
    told.0.camera.medium = Some(1);
    assert_eq!(codes(&told), ["camera-inside!", "unbounded-medium!"]);
    let mut everywhere = with(&ball(1.0), 1.0);
    everywhere.0.camera.medium = Some(0);
    assert_eq!(codes(&everywhere), ["unbounded-medium!"]);
    let mut shut = with(&ball(1.0), 1.0);
    let wall = shut.diffuse(0.5);
    shut.surface(&flat(&cube(0.5, Vec3::X * 5.0)), wall);
    shut.light(LightKind::Point { from: Vec3::X * 5.0, intensity: rgb(1.0) });
    assert_eq!(codes(&shut), ["light-inside!"]);
}

#[test]
fn objects_that_overlap_are_told_from_nested_and_touching_ones() {
    let pair = |a: &Arc<GeometryDescription>, b: &Arc<GeometryDescription>| {
        let mut world = with(a, 1.0);
        let (medium, glass) = (world.medium(0.0, 2.0, 0.0), world.0.shapes[0].material);
        world.body(b, glass, Some(medium), None);
        codes(&world)
    };
    let meshes = |at: Vec3, half: f32| pair(&flat(&cube(1.0, Vec3::ZERO)), &flat(&cube(half, at)));
    let none: Vec<String> = vec![];
    assert_eq!(meshes(Vec3::splat(0.3), 0.9), ["overlapping-objects!"]);
    assert_eq!(meshes(Vec3::X * 2.0, 1.0), none, "they touch");
    assert_eq!(meshes(Vec3::splat(0.1), 0.5), none, "nested");
    assert_eq!(pair(&ball(1.0), &flat(&cube(0.9, Vec3::X))), ["overlapping-objects!"]);
    assert_eq!(pair(&ball(1.0), &flat(&cube(0.3, Vec3::ZERO))), none);
    let mut world = with(&ball(1.0), 1.0);
    world.body(&ball(1.0), world.0.shapes[0].material, Some(0), None);
    world.0.shapes[1].object_to_world = Mat4::from_translation(Vec3::X);
    assert_eq!(codes(&world), ["overlapping-objects!"]);
    world.0.materials[0].priority = Some(1);
    assert_eq!(codes(&world), none, "the priority says who is there");
    world.0.materials[0].priority = None;
    world.0.shapes[1].object_to_world = Mat4::from_translation(Vec3::X * 2.5);
    assert_eq!(codes(&world), none);
}

#[test]
fn the_furnace_passes_sound_bodies_and_fails_one_that_overlaps_itself() {
    let check = |world: &World| {
        let r = report(world);
        furnace(&world.0, &r.bodies[0], 2e6, 0).expect("the scene can be built")
    };
    for world in
        [with(&flat(&bumpy_sphere(3, 0.2)), 3.0), subsurface(&ball(2.0), 10.0), with(&flat(&cube(1.0, Vec3::ONE)), 0.5)]
    {
        let f = check(&world).expect("closed");
        println!("radiance {}, path length {}, {} mean free paths", f.radiance, f.path_length, f.size);
        // Each path is white up to rounding of weights in f32; the length is statistical.
        assert!((f.radiance.mean - 1.0).abs() < 1e-5 && f.path_length.z(1.0).abs() < Z && f.exact);
        assert!(f.path_length.std_err < 0.02 && f.counters.lost == 0);
    }
    // Two cubes that overlap by half: the surface counts their common part twice.
    let twice = cube(1.0, Vec3::ZERO).joined(&cube(1.0, Vec3::X));
    let f = check(&with(&flat(&twice), 1.0)).expect("closed edge by edge");
    assert!(f.path_length.z(1.0) < -10.0, "{}", f.path_length);
    let sphere = bumpy_sphere(2, 0.2);
    let open = Mesh::new(sphere.positions().to_vec(), vec![], vec![], sphere.indices()[1..].to_vec()).expect("a mesh");
    assert_eq!(check(&with(&flat(&open), 1.0)).err(), Some(Unmeasured::Open));
    assert_eq!(check(&with(&ball(1.0), 1e6)).err(), Some(Unmeasured::Dense));
}

#[test]
fn copies_of_one_form_are_listed_once() {
    let mut world = with(&flat(&cube(1.0, Vec3::ZERO)), 1.0);
    for i in 1..5 {
        let mut copy = world.0.shapes[0].clone();
        copy.object_to_world = Mat4::from_translation(Vec3::X * 3.0 * i as f32);
        world.0.shapes.push(copy);
    }
    let r = report(&world);
    assert_eq!((r.bodies.len(), r.bodies[0].count, r.shapes, r.findings.len()), (1, 5, 5, 0), "{:?}", r.findings);
    // Instances of an object are counted, and measured where the first stands.
    let mut world = subsurface(&flat(&cube(0.5, Vec3::ZERO)), 2.0);
    let shape = world.0.shapes.pop().expect("one shape");
    world.0.objects.push(ObjectDescription { name: "o".into(), shapes: vec![shape] });
    for i in 0..7 {
        let object_to_world = Mat4::from_translation(Vec3::X * 3.0 * i as f32) * Mat4::from_scale(Vec3::splat(2.0));
        world.0.instances.push(InstanceDescription { place: place(), object: 0, object_to_world });
    }
    let r = report(&world);
    assert_eq!((r.bodies.len(), r.bodies[0].count, r.shapes, r.findings.len()), (1, 7, 7, 0), "{:?}", r.findings);
    assert!((r.bodies[0].volume - 8.0).abs() < 1e-6);
    let f = furnace(&world.0, &r.bodies[0], 1e5, 0).expect("it can be built").expect("closed");
    assert!((f.radiance.mean - 1.0).abs() < 1e-5);
}
