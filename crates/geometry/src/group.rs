//! Shapes in one space with their hierarchy: the scene's own shapes, or an object that is placed several times.
//!
//! A group knows nothing of instances: primitive numbers are its own, and so are those of the rays that it is given.

use obvhs::cwbvh::CwBvh;

use crate::bounds::Bounds;
use crate::bvh::{self, BoxRay, Quality};
use crate::mesh::Mesh;
use crate::ray::{Body, Facing, Ray};
use crate::shape::{Form, Shape};
use crate::triangle::{Leaf, MAX_PRIMS, Projection, REVERSED};

/// [`Body::slack`] in units of the body's largest absolute coordinate: 8 times the spacing 2^-23 of f32. A collision
/// point `o + t d` carries three roundings, a point from barycentric weights five.
pub(crate) const SLACK: f32 = 8.0 / 8_388_608.0;
/// How far before its origin, in units of the slack, a ray still finds the surface that it is outside of by rounding:
/// covers directions whose cosine with the normal is above 1/64.
pub(crate) const BEHIND: f32 = 64.0;
/// Groups up to this size are searched without a tree.
pub(crate) const FEW: usize = 4;

/// Shapes with their hierarchy.
#[derive(Debug)]
pub(crate) struct Group {
    pub(crate) shapes: Vec<Shape>,
    /// First primitive of each shape, and the number of all primitives.
    pub(crate) first: Vec<u32>,
    pub(crate) bounds: Vec<Bounds>,
    pub(crate) bvh: CwBvh,
    pub(crate) leaves: Vec<Leaf>,
    only_quadrics: bool,
}

/// A crossing that counts; `t` may still be below 0.
#[derive(Clone, Copy)]
pub(crate) struct Candidate {
    pub(crate) t: f32,
    pub(crate) number: u32,
    pub(crate) b: [f32; 2],
    pub(crate) exiting: bool,
}

impl Group {
    /// Builds the hierarchy.
    ///
    /// *Panics* if there are more than 2^28 primitives (11 GB of leaves).
    pub(crate) fn build(shapes: Vec<Shape>, quality: Quality) -> Self {
        let mut first = vec![0];
        for s in &shapes {
            first.push(first.last().expect("starts with one element") + s.prim_count());
        }
        let count = *first.last().expect("starts with one element") as usize;
        assert!(count <= MAX_PRIMS, "{count} primitives; at most {MAX_PRIMS} are supported");
        let bounds: Vec<Bounds> = shapes.iter().map(Shape::bounds).collect();

        // Build the tree over the primitives' boxes.
        let bvh = if count > FEW {
            let mut boxes = Vec::with_capacity(count);
            for (s, b) in shapes.iter().zip(&bounds) {
                match &s.form {
                    Form::Mesh(m) => boxes.extend((0..s.prim_count()).map(|i| Bounds::of(m.corners(i)))),
                    Form::Quadric(_) => boxes.push(*b),
                }
            }
            bvh::build(&boxes, quality)
        } else {
            CwBvh { primitive_indices: (0..count as u32).collect(), ..CwBvh::default() }
        };

        // Copy the primitives in leaf order, so that a leaf is one cache line.
        let leaf = |&prim: &u32| {
            let shape = first.partition_point(|&f| f <= prim) - 1;
            let s = &shapes[shape];
            let marks = if s.reverse { REVERSED } else { 0 };
            match &s.form {
                Form::Mesh(m) => Leaf::triangle(m.corners(prim - first[shape]), prim, marks),
                Form::Quadric(_) => Leaf::quadric(prim, marks),
            }
        };
        let leaves = bvh.primitive_indices.iter().map(leaf).collect();
        let bvh = CwBvh { primitive_indices: Vec::new(), ..bvh };
        let only_quadrics = shapes.iter().all(|s| s.quadric().is_some());
        Self { shapes, first, bounds, bvh, leaves, only_quadrics }
    }

    /// Returns the box around all shapes.
    pub(crate) fn all(&self) -> Bounds {
        self.bounds.iter().fold(Bounds::EMPTY, |a, &b| a.union(b))
    }

    /// Returns the shape of a primitive and its number in it.
    #[inline]
    pub(crate) fn locate(&self, number: u32) -> (u32, u32) {
        let shape = self.first.partition_point(|&f| f <= number) - 1;
        (shape as u32, number - self.first[shape])
    }

    /// Returns the bytes held: leaves, tree and the shapes' own arrays.
    pub(crate) fn memory(&self) -> usize {
        let shapes: usize = self.shapes.iter().map(|s| size_of::<Shape>() + s.mesh().map_or(0, Mesh::memory)).sum();
        shapes + self.leaves.capacity() * size_of::<Leaf>() + self.bvh.nodes.capacity() * 80
    }

    /// Returns whether a ray from a triangle starts within the slack of an edge, or passes one within the slack of the plane.
    pub(crate) fn is_shallow(&self, ray: &Ray, body: Body) -> bool {
        let (shape, index) = self.locate(ray.skip.number);
        let Form::Mesh(m) = &self.shapes[shape as usize].form else {
            return false;
        };
        let [p0, p1, p2] = m.corners(index);
        let (e1, e2) = (p1 - p0, p2 - p0);
        let n = e1.cross(e2);
        // Barycentric weights and their rates along the ray, times |n|^2.
        let (g1, g2) = (e2.cross(n), n.cross(e1));
        let (b1, b2) = ((ray.o - p0).dot(g1), (ray.o - p0).dot(g2));
        let (r1, r2) = (ray.d.dot(g1), ray.d.dot(g2));
        let n2 = n.length_squared();
        let b0 = n2 - b1 - b2;
        let edge = (b0 / (g1 + g2).length()).min(b1 / g1.length()).min(b2 / g2.length());
        let t = (b1 / r1).abs().min((b2 / r2).abs()).min((b0 / (r1 + r2)).abs());
        let depth = ray.d.dot(n).abs() * t / n2.sqrt();
        // NaN means a triangle too small for f32 products: verify it, too.
        edge.is_nan() || depth.is_nan() || edge < body.slack || depth < body.slack
    }

    /// Visits the crossings that count and have `t < t_max`, which the visitor may lower, until it returns true; returns
    /// whether it did.
    #[inline(always)]
    pub(crate) fn search(&self, ray: &Ray, mut visit: impl FnMut(Candidate, &mut f32) -> bool) -> bool {
        let low = ray.low();
        if self.only_quadrics && self.bvh.nodes.is_empty() {
            // A few quadrics: nothing to project.
            let mut t_max = ray.t_max;
            for leaf in &self.leaves {
                if self.try_quadric(leaf, ray, low, &mut t_max, &mut visit) {
                    return true;
                }
            }
            return false;
        }
        let projection = Projection::new(ray.o, ray.d);
        let mut try_leaf = |leaf: &Leaf, t_max: &mut f32| {
            if leaf.is_quadric() {
                return self.try_quadric(leaf, ray, low, t_max, &mut visit);
            }
            let Some(x) = projection.cross(leaf) else {
                return false;
            };
            let number = leaf.prim();
            let exiting = (x.det > 0.0) != leaf.is_reversed();
            if x.t >= *t_max
                || number == ray.skip.number
                || !counts(ray, number, exiting, x.t, low, || outside_by(leaf, x.t, x.det))
            {
                return false;
            }
            visit(Candidate { t: x.t, number, b: x.b, exiting }, t_max)
        };
        if self.bvh.nodes.is_empty() {
            let mut t_max = ray.t_max;
            for leaf in &self.leaves {
                if try_leaf(leaf, &mut t_max) {
                    return true;
                }
            }
            false
        } else {
            let boxes = BoxRay::new(ray.o, ray.d, low);
            bvh::traverse_ray(&self.bvh, &boxes, ray.t_max, |i, t_max| try_leaf(&self.leaves[i as usize], t_max))
        }
    }

    #[inline(never)]
    fn try_quadric(
        &self,
        leaf: &Leaf,
        ray: &Ray,
        low: f32,
        t_max: &mut f32,
        visit: &mut impl FnMut(Candidate, &mut f32) -> bool,
    ) -> bool {
        let number = leaf.prim();
        let (shape, _) = self.locate(number);
        let Form::Quadric(q) = &self.shapes[shape as usize].form else {
            return false;
        };
        let mut found = |t: f64, outward: bool, t_max: &mut f32| {
            let (t, exiting) = (t as f32, outward != leaf.is_reversed());
            let outside = || {
                let (_, n) = q.point_and_normal((ray.o + ray.d * t).as_dvec3());
                f64::from((ray.t_min - t).max(0.0) * n.dot(ray.d).abs())
            };
            t < *t_max
                && counts(ray, number, exiting, t, low, outside)
                && visit(Candidate { t, number, b: [0.0; 2], exiting }, t_max)
        };

        // Inside a closed quadric the exit always exists: the far root, or at once if rounding put the start outside. A
        // ray that starts on a sphere or cylinder and heads outward by rounding leaves at once, too.
        let on_surface = number == ray.skip.number;
        if let Facing::Exiting(body) = ray.facing
            && body.has(number)
            && !leaf.is_reversed()
        {
            let at_once = f64::from(ray.t_min);
            if on_surface && q.heads_outward(ray.o, ray.d) {
                return found(at_once, true, t_max);
            }
            if q.is_closed() && !on_surface {
                return match q.roots(ray.o, ray.d, false)[1].filter(|r| r.t > at_once) {
                    Some(exit) => found(exit.t, true, t_max),
                    None => q.outside_by(ray.o) <= f64::from(body.slack) && found(at_once, true, t_max),
                };
            }
        }
        for root in q.roots(ray.o, ray.d, on_surface).into_iter().flatten() {
            if found(root.t, root.exiting, t_max) {
                return true;
            }
        }
        false
    }
}

/// Returns whether a crossing counts for a ray; `outside` tells how far the origin lies beyond the surface.
#[inline(always)]
fn counts(ray: &Ray, number: u32, exiting: bool, t: f32, low: f32, outside: impl FnOnce() -> f64) -> bool {
    let (body, wanted) = match ray.facing {
        Facing::Any => return t > ray.t_min,
        Facing::Exiting(b) => (b, true),
        Facing::Entering(b) => (b, false),
    };
    if !body.has(number) {
        return t > ray.t_min;
    }
    exiting == wanted && (t > ray.t_min || (t >= low && outside() <= f64::from(body.slack)))
}

/// Returns how far a ray's origin lies beyond the plane of a triangle that it crosses at `t <= 0`.
#[cold]
fn outside_by(leaf: &Leaf, t: f32, det: f64) -> f64 {
    let [a, b, c] = leaf.corners();
    let n = (b - a).cross(c - a).as_dvec3().length();
    -f64::from(t) * det.abs() / n
}
