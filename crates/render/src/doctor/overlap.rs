//! Translucent objects whose boundaries cut through each other.

use std::collections::BTreeMap;

use moonmilk_core::Vec3;
use moonmilk_geometry::{Accel, Ray};
use rayon::prelude::*;

use super::surface::point;
use super::{Body, Patient};
use crate::description::ShapeDescription;

/// Triangles above which objects are not compared: the comparison casts a ray per edge.
const MOST: usize = 20_000_000;

/// Part of an edge at its ends within which a meeting counts as a touch.
const TOUCH: f32 = 1e-3;

/// Reports pairs of closed objects that overlap in part.
///
/// Edges of meshes are rays against all other objects; two spheres are compared directly. Objects nested in each other or side by
/// side have no meeting; those that touch may meet at the very ends of edges, which does not count.
pub fn examine(p: &mut Patient, bodies: &[Body]) {
    let closed: Vec<usize> = bodies.iter().filter(|b| b.closed).map(|b| b.shape).collect();
    if closed.len() < 2 || bodies.iter().map(|b| b.triangles).sum::<usize>() > MOST {
        return;
    }
    let shapes: Vec<_> = closed.iter().map(|&s| p.shapes[s].clone()).collect();
    let accel = Accel::build(shapes.clone());
    let mut pairs: BTreeMap<[usize; 2], Vec3> = BTreeMap::new();
    let mut add = |a: usize, b: usize, at: Vec3| {
        pairs.entry([a.min(b), a.max(b)]).or_insert(at);
    };
    for (i, shape) in shapes.iter().enumerate() {
        let bounds = shape.bounds();
        let near = |j: usize| {
            let o = shapes[j].bounds();
            j != i && o.min.cmple(bounds.max).all() && bounds.min.cmple(o.max).all()
        };
        if !(0..shapes.len()).any(near) {
            continue;
        }
        if let Some(ball) = shape.quadric().and_then(|q| q.as_ball()) {
            for (j, other) in shapes.iter().enumerate().take(i) {
                if let Some(other) = other.quadric().and_then(|q| q.as_ball()) {
                    let (distance, [r, s]) = (ball.0.distance(other.0), [ball.1, other.1]);
                    // Rounding of f32 in centres and radii.
                    let slack = 1e-6 * (r + s);
                    if distance > (r - s).abs() + slack && distance < r + s - slack {
                        let toward = (other.0 - ball.0).normalize_or_zero();
                        add(i, j, (ball.0 + toward * r).as_vec3());
                    }
                }
            }
        }
        let Some(mesh) = shape.mesh() else {
            continue;
        };
        let contact = 1e-5 * bounds.extent().max_element();
        let met: Vec<(usize, [f32; 3])> = mesh
            .indices()
            .par_iter()
            .flat_map_iter(|t| {
                let c = t.map(|v| mesh.positions()[v as usize]);
                let mut met = Vec::new();
                // Each edge is met from both of its triangles; go along it once.
                for (k, (a, b)) in [(c[0], c[1]), (c[1], c[2]), (c[2], c[0])].into_iter().enumerate() {
                    let [from, to] = [t[k], t[(k + 1) % 3]];
                    let length = a.distance(b);
                    if from > to || length <= 2.0 * contact {
                        continue;
                    }
                    let margin = (TOUCH * length).max(contact);
                    let ray = Ray::new(a, (b - a) / length).up_to(length - margin);
                    accel.all_hits(&ray, |hit| {
                        let grazing = hit.t < margin || hit.shape as usize == i;
                        if !grazing && leaves_plane(&accel, &ray, hit, b, contact) {
                            met.push((hit.shape as usize, ray.at(hit.t).to_array()));
                        }
                    });
                }
                met
            })
            .collect();
        met.into_iter().for_each(|(j, at)| add(i, j, Vec3::from_array(at)));
    }
    for ([a, b], at) in pairs {
        let [first, second] = [closed[a], closed[b]];
        let [one, other] = [first, second].map(|i| &p.d.shapes[i]);
        let ranked = |s: &ShapeDescription| p.d.materials[s.material].priority.is_some();
        let refracts = |shape: usize| bodies.iter().any(|b| b.shape == shape && b.eta != 1.0);
        let message = format!(
            "{} and {} ({}) cut through each other, for instance near {}",
            one.name,
            other.name,
            other.place,
            point(at)
        );
        // With priorities it is clear who is there; without indices the smaller body is, which may be meant.
        if ranked(one) && ranked(other) {
            continue;
        }
        if refracts(first) || refracts(second) {
            let advice = "give both materials an `Attribute \"material\" \"integer moonmilk.priority\"`: indices are ambiguous where they cross; or separate them";
            p.problem("overlapping-objects", first, message, advice);
        } else {
            let advice = "where both are, the one of the smaller volume counts; `moonmilk.priority` says it otherwise";
            p.note("overlapping-objects", first, message, advice);
        }
    }
}

/// Returns whether both ends of an edge are farther from the surface that it meets than rounding.
fn leaves_plane(accel: &Accel, ray: &Ray, hit: &moonmilk_geometry::Hit, end: Vec3, contact: f32) -> bool {
    let s = accel.surface(ray, hit);
    (ray.o - s.p).dot(s.ng).abs() > contact && (end - s.p).dot(s.ng).abs() > contact
}
