//! The closest point of the surface, by a search through the tree.

use moonmilk_core::Vec3;

use crate::accel::Accel;
use crate::ray::Body;
use crate::shape::Form;
use crate::triangle::{Leaf, closest_on_triangle};

/// The closest point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// Distance to it \[L\].
    pub distance: f32,
    /// The point.
    pub p: Vec3,
    /// Its primitive.
    pub prim: u32,
    /// Barycentric weights of the second and third corner; zero for a quadric.
    pub b: [f32; 2],
}

/// Entries of the search stack: 7 per level of a tree of at most 32 levels, and one more.
const STACK: usize = 7 * 32 + 1;

impl Accel {
    /// Returns the point of all surfaces closest to p; `None` in an empty scene.
    ///
    /// *Accuracy*: rounding of f32 for triangles and balls; for cut or unequally stretched quadrics the point found by
    /// projection in object space, whose distance is an upper bound.
    pub fn closest_point(&self, p: Vec3) -> Option<Closest> {
        self.closest_point_on(Body { first: 0, end: u32::MAX, slack: 0.0 }, p)
    }

    /// Returns the point of a body closest to p.
    pub fn closest_point_on(&self, body: Body, p: Vec3) -> Option<Closest> {
        self.closest_facing(body, p, |_| true)
    }

    /// Returns the closest point among primitives whose normal there (not of unit length) passes a test.
    pub(crate) fn closest_facing(&self, body: Body, p: Vec3, faces: impl Fn(Vec3) -> bool) -> Option<Closest> {
        let mut best: Option<Closest> = None;
        let mut limit = f32::INFINITY;
        let mut try_leaf = |leaf: &Leaf, limit: &mut f32| {
            let prim = leaf.prim();
            if !body.contains(prim) {
                return;
            }
            let (q, b, n) = if leaf.is_quadric() {
                match &self.shapes[self.locate(prim).0 as usize].form {
                    Form::Quadric(q) => {
                        let (q, n) = q.point_and_normal(p.as_dvec3());
                        (q, [0.0; 2], n)
                    }
                    Form::Mesh(_) => return,
                }
            } else {
                let [v0, v1, v2] = leaf.corners();
                let (q, b) = closest_on_triangle(p, [v0, v1, v2]);
                (q, b, (v1 - v0).cross(v2 - v0))
            };
            if !faces(if leaf.is_reversed() { -n } else { n }) {
                return;
            }
            let distance = p.distance(q);
            if best.is_none() || distance < *limit {
                *limit = distance;
                best = Some(Closest { distance, p: q, prim, b });
            }
        };
        if self.bvh.nodes.is_empty() {
            self.leaves.iter().for_each(|l| try_leaf(l, &mut limit));
            return best;
        }

        // Depth first, nearest child first; boxes farther than the best point are skipped.
        let mut stack = [(0f32, 0u32); STACK];
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let (near, index) = stack[len];
            if near > limit {
                continue;
            }
            let node = &self.bvh.nodes[index as usize];
            let mut inner = [(0f32, 0u32); 8];
            let mut count = 0;
            for child in (0..8).filter(|&c| !node.is_child_empty(c)) {
                let b = node.child_aabb(child);
                let distance = (p - p.clamp(b.min.into(), b.max.into())).length();
                // Boxes are off by roundings of their coordinates; the margin is that of the ray test.
                let distance = distance - 2e-6 * (distance + b.max.abs().max(b.min.abs()).max_element());
                if distance > limit {
                    continue;
                }
                if node.is_leaf(child) {
                    let (first, n) = node.child_primitives(child);
                    self.leaves[first as usize..(first + n) as usize].iter().for_each(|l| try_leaf(l, &mut limit));
                } else {
                    inner[count] = (distance, node.child_node_index(child));
                    count += 1;
                }
            }
            // Push the farthest first.
            inner[..count].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
            stack[len..len + count].copy_from_slice(&inner[..count]);
            len += count;
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Shape, generate};
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
