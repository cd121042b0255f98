//! The closest point of the surface, by a search through the tree.

use std::ops::Range;

use moonmilk_core::Vec3;

use crate::accel::Accel;
use crate::group::Group;
use crate::place::Placement;
use crate::ray::{Body, Prim, WORLD};
use crate::search::nearest_first;
use crate::shape::{Form, Shape};
use crate::triangle::closest_on_triangle;

/// The closest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// Distance to it \[L\].
    pub distance: f32,
    /// The point.
    pub p: Vec3,
    /// Its primitive.
    pub prim: Prim,
    /// Barycentric weights of the second and third corner; zero for a quadric.
    pub b: [f32; 2],
}

impl Accel {
    /// Returns the point of all surfaces closest to p; `None` in an empty scene.
    ///
    /// *Accuracy*: rounding of f32 for triangles and balls; for cut or unequally stretched quadrics the point found by
    /// projection in object space, whose distance is an upper bound.
    pub fn closest_point(&self, p: Vec3) -> Option<Closest> {
        let mut limit = f32::INFINITY;
        let mut best = self.world.closest(None, WORLD, 0..u32::MAX, p, &mut limit, |_| true);
        let mut visit = |i: u32, limit: &mut f32| {
            let placed = &self.placements[i as usize];
            let group = &self.groups[placed.group as usize];
            best = group.closest(Some(placed), i, 0..u32::MAX, p, limit, |_| true).or(best);
        };
        if self.top.nodes.is_empty() {
            (0..self.placements.len() as u32).for_each(|i| visit(i, &mut limit));
        } else {
            nearest_first(&self.top, p, 1.0, &mut limit, |i, limit| visit(self.order[i as usize], limit));
        }
        best
    }

    /// Returns the point of a body closest to p.
    pub fn closest_point_on(&self, body: Body, p: Vec3) -> Option<Closest> {
        self.closest_facing(body, p, |_| true)
    }

    /// Returns the closest point among primitives whose normal there (not of unit length) passes a test.
    pub(crate) fn closest_facing(&self, body: Body, p: Vec3, faces: impl Fn(Vec3) -> bool) -> Option<Closest> {
        let (group, placed) = self.group_of(body.instance);
        group.closest(placed, body.instance, body.first..body.end, p, &mut f32::INFINITY.clone(), faces)
    }
}

impl Accel {
    /// Returns whether [`Accel::clearance`] can tell distances: all quadrics are balls of the world.
    pub fn measures(&self) -> bool {
        let ball = |s: &Shape| s.quadric().is_none_or(|q| q.as_ball().is_some());
        self.world.shapes.iter().all(ball) && self.groups.iter().all(|g| g.shapes.iter().all(|s| s.quadric().is_none()))
    }

    /// Returns a lower bound of the distance from p to all surfaces, good to rounding; `most` if there is none nearer, and some number below `least` if one is nearer than that.
    ///
    /// *Domain*: scenes for which [`Accel::measures`] holds. *Cost*: about a ray where `most` is near the true distance.
    pub fn clearance(&self, p: Vec3, least: f32, most: f32) -> f32 {
        let mut limit = most;
        self.world.approach(None, p, least, &mut limit);
        let visit = |i: u32, limit: &mut f32| {
            let placed = &self.placements[i as usize];
            self.groups[placed.group as usize].approach(Some(placed), p, least, limit);
        };
        if self.top.nodes.is_empty() {
            (0..self.placements.len() as u32).for_each(|i| visit(i, &mut limit));
        } else {
            nearest_first(&self.top, p, 1.0, &mut limit, |i, limit| visit(self.order[i as usize], limit));
        }
        // Rounding of the point, of the closest one and of their distance.
        (limit - 1e-6 * (limit + p.abs().max_element())).max(0.0)
    }
}

impl Group {
    /// Lowers the limit to the distance of the closest surface; to 0 as soon as one is nearer than `least`.
    fn approach(&self, placed: Option<&Placement>, p: Vec3, least: f32, limit: &mut f32) {
        let try_leaf = |i: u32, limit: &mut f32| {
            let leaf = &self.leaves[i as usize];
            let distance = if leaf.is_quadric() {
                match self.shapes[self.locate(leaf.prim()).0 as usize].quadric().and_then(|q| q.as_ball()) {
                    Some((c, r)) => ((p.as_dvec3().distance(c) - r).abs()) as f32,
                    None => 0.0,
                }
            } else {
                let corners = leaf.corners();
                p.distance(closest_on_triangle(p, placed.map_or(corners, |m| corners.map(|v| m.point(v)))).0)
            };
            *limit = limit.min(if distance < least { 0.0 } else { distance });
        };
        if self.bvh.nodes.is_empty() {
            (0..self.leaves.len() as u32).for_each(|i| try_leaf(i, limit));
        } else {
            let stretch = placed.map_or(1.0, |m| m.stretch[0] as f32);
            nearest_first(&self.bvh, placed.map_or(p, |m| m.local(p)), stretch, limit, try_leaf);
        }
    }

    /// Returns the point closest to p nearer than the limit, which it lowers.
    fn closest(
        &self,
        placed: Option<&Placement>,
        instance: u32,
        numbers: Range<u32>,
        p: Vec3,
        limit: &mut f32,
        faces: impl Fn(Vec3) -> bool,
    ) -> Option<Closest> {
        let mut best: Option<Closest> = None;
        let here = placed.map_or(p, |placed| placed.local(p));
        let mut try_leaf = |i: u32, limit: &mut f32| {
            let leaf = &self.leaves[i as usize];
            let number = leaf.prim();
            if !numbers.contains(&number) {
                return;
            }
            let (q, b, n) = if leaf.is_quadric() {
                match &self.shapes[self.locate(number).0 as usize].form {
                    Form::Quadric(q) => {
                        let (q, n) = q.point_and_normal(here.as_dvec3());
                        (placed.map_or(q, |placed| placed.point(q)), [0.0; 2], n)
                    }
                    Form::Mesh(_) => return,
                }
            } else {
                // Compare distances in the world: an unequal stretch changes which triangle is nearest.
                let [v0, v1, v2] = leaf.corners();
                let corners = placed.map_or([v0, v1, v2], |placed| [v0, v1, v2].map(|v| placed.point(v)));
                let (q, b) = closest_on_triangle(p, corners);
                (q, b, (v1 - v0).cross(v2 - v0))
            };
            let n = placed.map_or(n, |placed| placed.normal(n));
            if !faces(if leaf.is_reversed() { -n } else { n }) {
                return;
            }
            let distance = p.distance(q);
            if distance < *limit || (best.is_none() && *limit == f32::INFINITY) {
                *limit = distance;
                best = Some(Closest { distance, p: q, prim: Prim { instance, number }, b });
            }
        };
        if self.bvh.nodes.is_empty() {
            (0..self.leaves.len() as u32).for_each(|i| try_leaf(i, limit));
        } else {
            let stretch = placed.map_or(1.0, |placed| placed.stretch[0] as f32);
            nearest_first(&self.bvh, here, stretch, limit, try_leaf);
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate;
    use moonmilk_core::{Random, Stream};

    #[test]
    fn the_tree_search_equals_the_search_of_all_triangles() {
        let mesh = generate::bumpy_sphere(4, 0.2);
        let a = Accel::build(vec![mesh.clone().into()]);
        let mut r = Stream::new(&[8]);
        for _ in 0..300 {
            let p = (Vec3::new(r.uniform(), r.uniform(), r.uniform()) - 0.5) * 4.0 * r.uniform();
            let brute = (0..mesh.indices().len() as u32)
                .map(|i| closest_on_triangle(p, mesh.corners(i)).0.distance(p))
                .fold(f32::INFINITY, f32::min);
            assert_eq!(a.closest_point(p).unwrap().distance, brute);
            // The bound without a primitive: never above, and within rounding unless it may stop early.
            assert!(a.measures());
            let [free, capped] = [a.clearance(p, 0.0, f32::INFINITY), a.clearance(p, 0.0, 0.3)];
            assert!(free <= brute && free > brute - 1e-5 && capped <= 0.3 && (capped > 0.3 - 1e-5 || capped == free));
            assert!(if brute < 0.1 { a.clearance(p, 0.1, 9.0) < 0.1 } else { a.clearance(p, 0.1, 9.0) == free });
        }
    }

    #[test]
    fn a_rescue_lands_on_the_body_asked_for() {
        let far = generate::cuboid(Vec3::splat(4.0), Vec3::splat(5.0));
        let near = generate::cuboid(Vec3::splat(-1.0), Vec3::splat(1.0));
        let a = Accel::build(vec![Shape::from(far), near.into()]);
        let (p, d) = (Vec3::new(0.25, 1.0 + 1e-6, 0.5), Vec3::new(0.6, 0.0, 0.8));
        let h = a.rescue(a.body(1..2), p, Vec3::Y, true).unwrap();
        assert_eq!((h.shape, h.t, h.rescued), (1, 0.0, true));
        assert_eq!(a.rescue(a.body(0..1), p, d, true).unwrap().shape, 0);
        // Along d the closest face that is left through is z = 1, half a unit away.
        let z = a.rescue(a.body(1..2), p, d, true).unwrap();
        assert_eq!(a.triangle_surface(z.shape, z.index, z.b).unwrap().ng, Vec3::Z);
        let s = a.triangle_surface(h.shape, h.index, h.b).unwrap();
        assert!(s.p.distance(Vec3::new(0.25, 1.0, 0.5)) < 1e-6 && s.ng == Vec3::Y);
    }
}
