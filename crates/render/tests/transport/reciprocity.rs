//! Reciprocity of a whole scene: light and eye exchanged.
//!
//! Two black patches, A and B, and a translucent body whose shading normals are far from the true ones. The flux that B receives from A
//! at radiance 1 is area(B) pi times the mean radiance that cosine-distributed rays from B find, and must equal the flux that A receives
//! from B at radiance 1. Light that goes straight from patch to patch is left out.

use std::f64::consts::PI;
use std::sync::Arc;

use moonmilk_core::{Estimate, Random, Stream, Vec3};
use moonmilk_geometry::Ray;
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_render::description::GeometryDescription;

use crate::common::{World, assert_equal, cosine, flat, measure, rectangle, samples, smooth};

/// A rectangle: centre and half edges.
#[derive(Clone, Copy)]
struct Patch(Vec3, Vec3, Vec3);

impl Patch {
    fn area(self) -> f64 {
        4.0 * f64::from(self.1.cross(self.2).length())
    }
    fn normal(self) -> Vec3 {
        self.1.cross(self.2).normalize()
    }
    fn shape(self) -> Arc<GeometryDescription> {
        rectangle(self.0, self.1, self.2)
    }
}

/// Level above the body, and larger and oblique below it.
const A: Patch = Patch(Vec3::new(0.3, -0.2, 1.6), Vec3::new(0.9, 0.0, 0.0), Vec3::new(0.0, -0.7, 0.0));
const B: Patch = Patch(Vec3::new(-1.6, 0.2, -1.2), Vec3::new(0.7, 0.0, -0.9), Vec3::new(0.0, 1.1, 0.0));

/// The body and its medium.
struct Case {
    what: &'static str,
    shape: Arc<GeometryDescription>,
    eta: f32,
    roughness: f32,
    medium: Option<[f32; 3]>,
    /// Factor of a displacement by noise.
    map: f32,
}

/// Returns the flux from one patch to the other by way of the body.
fn flux(case: &Case, from: Patch, to: Patch, seed: u64) -> Estimate {
    let mut world = World::new();
    let medium = case.medium.map(|[a, s, g]| world.medium(a, s, g));
    let boundary = world.dielectric(case.eta, case.roughness);
    if case.map > 0.0 {
        world.displace_all(case.map);
    }
    let body = world.body(&case.shape, boundary, medium, None) as u32;
    world.emitter(&from.shape(), 1.0);
    let black = world.diffuse(0.0);
    world.surface(&to.shape(), black);
    let tracer = world.tracer();
    let [l] = measure(samples(450_000, 8), |i| {
        let mut rng = Stream::new(&[81, seed, i]);
        let [s, t] = rng.uniform2().map(|u| 2.0 * u - 1.0);
        // Start a little above the patch, which is no part of what is measured.
        let o = to.0 + to.1 * s + to.2 * t + to.normal() * 1e-4;
        let d = cosine(rng.uniform2(), to.normal());
        let first = tracer.scene.accel.nearest(&Ray::new(o, d));
        let meets_body = first.is_some_and(|hit| hit.shape == body);
        [if meets_body { to.area() * PI * tracer.radiance(2 * i + seed, o, d) } else { 0.0 }]
    });
    tracer.assert_sound();
    l
}

#[test]
fn light_and_eye_can_be_exchanged() {
    // 2 % or better; slow: .5 %.
    let coarse = smooth(&bumpy_sphere(1, 0.4));
    for case in [
        Case {
            what: "clear, coarse and smooth",
            shape: coarse.clone(),
            eta: 1.5,
            roughness: 0.0,
            medium: None,
            map: 0.0,
        },
        Case {
            what: "milk, coarse and smooth",
            shape: coarse.clone(),
            eta: 1.5,
            roughness: 0.0,
            medium: Some([0.1, 3.0, 0.5]),
            map: 0.0,
        },
        Case {
            what: "water, coarse and smooth",
            shape: coarse,
            eta: 1.33,
            roughness: 0.0,
            medium: Some([0.2, 0.5, -0.4]),
            map: 0.0,
        },
        Case {
            what: "cube",
            shape: flat(&cuboid(Vec3::splat(-0.7), Vec3::splat(0.7))),
            eta: 1.5,
            roughness: 0.0,
            medium: Some([0.2, 1.0, 0.0]),
            map: 0.0,
        },
        Case {
            what: "glass with a map",
            shape: smooth(&bumpy_sphere(3, 0.1)),
            eta: 1.5,
            roughness: 0.0,
            medium: Some([0.1, 0.5, 0.0]),
            map: 0.4,
        },
        Case {
            what: "frosted",
            shape: flat(&bumpy_sphere(3, 0.1)),
            eta: 1.5,
            roughness: 0.3,
            medium: Some([0.2, 1.0, 0.0]),
            map: 0.0,
        },
    ] {
        let (there, back) = (flux(&case, A, B, 0), flux(&case, B, A, 1));
        assert_equal(case.what, there, back);
        assert!(there.relative_error() < 0.02 && back.relative_error() < 0.02, "{}: {there}, {back}", case.what);
    }
}

#[test]
fn the_patches_see_each_other_beside_the_body_in_both_directions() {
    // Without a body the same measurement of direct light is a view factor, known to be symmetric: tests the test.
    let see = |from: Patch, to: Patch, seed: u64| {
        let mut world = World::new();
        world.emitter(&from.shape(), 1.0);
        let tracer = world.tracer();
        let [l] = measure(samples(50_000, 16), |i| {
            let mut rng = Stream::new(&[82, seed, i]);
            let [s, t] = rng.uniform2().map(|u| 2.0 * u - 1.0);
            let o = to.0 + to.1 * s + to.2 * t;
            [to.area() * PI * tracer.radiance(i, o, cosine(rng.uniform2(), to.normal()))]
        });
        l
    };
    assert_equal("view factor", see(A, B, 0), see(B, A, 1));
}
