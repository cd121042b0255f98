//! Ray queries over all shapes of a scene.

use std::ops::Range;

use moonmilk_core::glam::Mat2;
use moonmilk_core::{Frame, Vec2, Vec3};
use obvhs::cwbvh::CwBvh;

use crate::bounds::Bounds;
use crate::bvh::{self, BoxRay, Quality};
use crate::mesh::Mesh;
use crate::quadric::Quadric;
use crate::ray::{Body, Facing, Hit, NONE, Ray, Surface};
use crate::shape::{Form, Shape};
use crate::triangle::{Leaf, MAX_PRIMS, Projection, REVERSED};

/// [`Body::slack`] in units of the body's largest absolute coordinate: 8 times the spacing 2^-23 of f32. A collision
/// point `o + t d` carries three roundings, a point from barycentric weights five.
const SLACK: f32 = 8.0 / 8_388_608.0;
/// How far before its origin, in units of the slack, a ray still finds the surface that it is outside of by rounding:
/// covers directions whose cosine with the normal is above 1/64.
const BEHIND: f32 = 64.0;
/// Scenes up to this size are searched without a tree.
const FEW: usize = 4;

/// All shapes of a scene, ready for ray queries.
#[derive(Debug)]
pub struct Accel {
    pub(crate) shapes: Vec<Shape>,
    /// First primitive of each shape, and the number of all primitives.
    first: Vec<u32>,
    bounds: Vec<Bounds>,
    pub(crate) bvh: CwBvh,
    pub(crate) leaves: Vec<Leaf>,
    only_quadrics: bool,
}

/// A crossing that counts; `t` may still be below 0.
#[derive(Clone, Copy)]
struct Candidate {
    t: f32,
    prim: u32,
    b: [f32; 2],
    exiting: bool,
}

impl Accel {
    /// Builds the acceleration structure with the default quality.
    ///
    /// *Panics* if the scene has more than 2^28 primitives (11 GB of leaves).
    pub fn build(shapes: Vec<Shape>) -> Self {
        Self::build_with(shapes, Quality::default())
    }

    /// Builds the acceleration structure.
    pub fn build_with(shapes: Vec<Shape>, quality: Quality) -> Self {
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

    /// Returns the shapes, in the order given.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// Returns the box around all shapes.
    pub fn bounds(&self) -> Bounds {
        self.bounds.iter().fold(Bounds::EMPTY, |a, &b| a.union(b))
    }

    /// Returns the box around a shape.
    pub fn shape_bounds(&self, shape: u32) -> Bounds {
        self.bounds[shape as usize]
    }

    /// Returns the primitives of a shape: triangle i of shape s is primitive `prims(s).start + i`.
    pub fn prims(&self, shape: u32) -> Range<u32> {
        self.first[shape as usize]..self.first[shape as usize + 1]
    }

    /// Returns the shape of a primitive and its number in it.
    pub fn locate(&self, prim: u32) -> (u32, u32) {
        let shape = self.first.partition_point(|&f| f <= prim) - 1;
        (shape as u32, prim - self.first[shape])
    }

    /// Returns the closed surface made of consecutive shapes, for [`Facing`].
    pub fn body(&self, shapes: Range<u32>) -> Body {
        let all =
            self.bounds[shapes.start as usize..shapes.end as usize].iter().fold(Bounds::EMPTY, |a, &b| a.union(b));
        Body {
            first: self.first[shapes.start as usize],
            end: self.first[shapes.end as usize],
            slack: SLACK * all.magnitude(),
        }
    }

    /// Returns the bytes held: leaves, tree and the shapes' own arrays.
    pub fn memory(&self) -> usize {
        let shapes: usize = self.shapes.iter().map(|s| size_of::<Shape>() + s.mesh().map_or(0, Mesh::memory)).sum();
        shapes + self.leaves.capacity() * size_of::<Leaf>() + self.bvh.nodes.capacity() * 80
    }

    /// Returns the nearest hit that counts, or `None`.
    ///
    /// An unbounded ray inside a closed body always has one.
    #[inline]
    pub fn nearest(&self, ray: &Ray) -> Option<Hit> {
        let mut best = None;
        self.search(ray, |c, t_max| {
            *t_max = c.t;
            best = Some(c);
            false
        });
        let best = best.map(|c| self.hit(c));
        match ray.facing {
            Facing::Any => best,
            Facing::Exiting(body) if best.is_none() && ray.t_max == f32::INFINITY => {
                self.rescue(body, ray.o, ray.d, true)
            }
            Facing::Exiting(body) | Facing::Entering(body) => {
                if ray.skip != NONE && body.contains(ray.skip) && self.is_shallow(ray, body) {
                    self.verified(ray, body)
                } else {
                    best
                }
            }
        }
    }

    /// Returns whether any hit that counts makes `blocks` return true; hits come in no order, each at most once.
    ///
    /// The closure may look through surfaces (opacity, index-matched boundaries) and leave out the primitive aimed at.
    #[inline]
    pub fn occluded(&self, ray: &Ray, mut blocks: impl FnMut(&Hit) -> bool) -> bool {
        let mut blocked = false;
        self.search(ray, |c, _| {
            blocked = blocks(&self.hit(c));
            blocked
        });
        blocked
    }

    /// Calls `visit` for every hit that counts, in no order.
    pub fn all_hits(&self, ray: &Ray, mut visit: impl FnMut(&Hit)) {
        self.occluded(ray, |h| {
            visit(h);
            false
        });
    }

    /// Returns the surface at a hit of a ray.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let shape = &self.shapes[hit.shape as usize];
        match &shape.form {
            Form::Mesh(m) => mesh_surface(m, hit.index, hit.b, shape.reverse),
            Form::Quadric(q) => {
                let mut s = q.surface(ray.o.as_dvec3() + ray.d.as_dvec3() * f64::from(hit.t));
                if shape.reverse {
                    (s.ng, s.ns) = (-s.ng, -s.ns);
                }
                s
            }
        }
    }

    /// Returns point and unit geometric normal at a hit: what a walk needs, without shading normal and (u, v).
    #[inline]
    pub fn point_and_normal(&self, ray: &Ray, hit: &Hit) -> (Vec3, Vec3) {
        let shape = &self.shapes[hit.shape as usize];
        let (p, n) = match &shape.form {
            Form::Mesh(m) => {
                let c = m.corners(hit.index);
                (interpolate(c, hit.b), (c[1] - c[0]).cross(c[2] - c[0]).normalize())
            }
            Form::Quadric(q) => q.point_and_normal(ray.o.as_dvec3() + ray.d.as_dvec3() * f64::from(hit.t)),
        };
        (p, if shape.reverse { -n } else { n })
    }

    /// Returns point, unit geometric normal and unit shading normal at a hit: what a refractive wall needs.
    #[inline]
    pub fn point_and_normals(&self, ray: &Ray, hit: &Hit) -> (Vec3, Vec3, Vec3) {
        let (p, ng) = self.point_and_normal(ray, hit);
        let Some(m) = self.shapes[hit.shape as usize].mesh().filter(|m| !m.normals().is_empty()) else {
            return (p, ng, ng);
        };
        (p, ng, shading_normal(m, hit.index, [1.0 - hit.b[0] - hit.b[1], hit.b[0], hit.b[1]], ng))
    }

    /// Returns the surface at a point of a triangle given by barycentric weights, e.g. one sampled on a light.
    pub fn triangle_surface(&self, shape: u32, triangle: u32, b: [f32; 2]) -> Option<Surface> {
        let s = &self.shapes[shape as usize];
        s.mesh().map(|m| mesh_surface(m, triangle, b, s.reverse))
    }

    /// Returns the point of a body closest to p, among primitives that a ray along d exits (or enters), as a hit.
    ///
    /// For walks that rounding put on the wrong side. `None` only if nothing faces that way (never on a closed body).
    #[cold]
    pub fn rescue(&self, body: Body, p: Vec3, d: Vec3, exiting: bool) -> Option<Hit> {
        let c = self.closest_facing(body, p, |n| (n.dot(d) > 0.0) == exiting)?;
        let t = (c.p - p).dot(d).max(0.0);
        Some(Hit { rescued: true, ..self.hit(Candidate { t, prim: c.prim, b: c.b, exiting }) })
    }

    /// Returns whether a ray from a triangle starts within the slack of an edge, or passes one within the slack of the plane.
    fn is_shallow(&self, ray: &Ray, body: Body) -> bool {
        let (shape, index) = self.locate(ray.skip);
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

    /// Returns the nearest hit after finding out by the count of crossings on which side of the body the ray starts.
    #[cold]
    fn verified(&self, ray: &Ray, body: Body) -> Option<Hit> {
        let inside = matches!(ray.facing, Facing::Exiting(_));
        let line = Ray { t_max: f32::INFINITY, facing: Facing::Any, ..*ray };
        let (mut count, mut nearest) = (0, None::<Hit>);
        self.all_hits(&line, |h| {
            if body.contains(h.prim) {
                // Crossings at the start, within the slack, belong to the start: what counts is the side behind them.
                let depth = h.t * self.point_and_normal(&line, h).1.dot(ray.d).abs();
                if depth <= body.slack && h.t <= BEHIND * body.slack {
                    return;
                }
                count += if h.exiting { 1 } else { -1 };
                if h.exiting != inside {
                    return;
                }
            }
            if h.t < nearest.map_or(ray.t_max, |n| n.t) {
                nearest = Some(*h);
            }
        });
        if (count > 0) == inside {
            return nearest;
        }
        let limit = nearest.map_or(ray.t_max, |h| h.t);
        self.rescue(body, ray.o, ray.d, inside).filter(|h| h.t < limit).or(nearest)
    }

    #[inline]
    fn hit(&self, c: Candidate) -> Hit {
        let (shape, index) = self.locate(c.prim);
        Hit { t: c.t.max(0.0), prim: c.prim, shape, index, b: c.b, exiting: c.exiting, rescued: false }
    }

    /// Visits the crossings that count and have `t < t_max`, which the visitor may lower, until it returns true.
    #[inline(always)]
    fn search(&self, ray: &Ray, mut visit: impl FnMut(Candidate, &mut f32) -> bool) {
        let low = match ray.facing {
            Facing::Exiting(b) if ray.skip == NONE => ray.t_min - BEHIND * b.slack,
            _ => ray.t_min,
        };
        if self.only_quadrics && self.bvh.nodes.is_empty() {
            // A few quadrics: nothing to project.
            let mut t_max = ray.t_max;
            for leaf in &self.leaves {
                if self.try_quadric(leaf, ray, low, &mut t_max, &mut visit) {
                    return;
                }
            }
            return;
        }
        let projection = Projection::new(ray.o, ray.d);
        let mut try_leaf = |leaf: &Leaf, t_max: &mut f32| {
            if leaf.is_quadric() {
                return self.try_quadric(leaf, ray, low, t_max, &mut visit);
            }
            let Some(x) = projection.cross(leaf) else {
                return false;
            };
            let prim = leaf.prim();
            let exiting = (x.det > 0.0) != leaf.is_reversed();
            if x.t >= *t_max
                || prim == ray.skip
                || !counts(ray, prim, exiting, x.t, low, || outside_by(leaf, x.t, x.det))
            {
                return false;
            }
            visit(Candidate { t: x.t, prim, b: x.b, exiting }, t_max)
        };
        if self.bvh.nodes.is_empty() {
            let mut t_max = ray.t_max;
            for leaf in &self.leaves {
                if try_leaf(leaf, &mut t_max) {
                    return;
                }
            }
        } else {
            let boxes = BoxRay::new(ray.o, ray.d, low);
            bvh::traverse_ray(&self.bvh, &boxes, ray.t_max, |i, t_max| try_leaf(&self.leaves[i as usize], t_max));
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
        let prim = leaf.prim();
        let (shape, _) = self.locate(prim);
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
                && counts(ray, prim, exiting, t, low, outside)
                && visit(Candidate { t, prim, b: [0.0; 2], exiting }, t_max)
        };

        // Inside a closed quadric the exit always exists: the far root, or at once if rounding put the start outside. A
        // ray that starts on a sphere or cylinder and heads outward by rounding leaves at once, too.
        let on_surface = prim == ray.skip;
        if let Facing::Exiting(body) = ray.facing
            && body.contains(prim)
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
fn counts(ray: &Ray, prim: u32, exiting: bool, t: f32, low: f32, outside: impl FnOnce() -> f64) -> bool {
    let (body, wanted) = match ray.facing {
        Facing::Any => return t > ray.t_min,
        Facing::Exiting(b) => (b, true),
        Facing::Entering(b) => (b, false),
    };
    if !body.contains(prim) {
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

#[inline]
fn interpolate([p0, p1, p2]: [Vec3; 3], b: [f32; 2]) -> Vec3 {
    p0 * (1.0 - b[0] - b[1]) + p1 * b[0] + p2 * b[1]
}

/// Interpolates the normals of a triangle and brings the result to the geometric normal's side.
#[inline]
fn shading_normal(m: &Mesh, triangle: u32, w: [f32; 3], ng: Vec3) -> Vec3 {
    let corner = m.indices()[triangle as usize];
    let sum: Vec3 = corner.iter().zip(w).map(|(&v, w)| m.normals()[v as usize] * w).sum();
    match sum.try_normalize() {
        Some(n) if n.dot(ng) < 0.0 => -n,
        Some(n) => n,
        None => ng,
    }
}

fn mesh_surface(m: &Mesh, triangle: u32, b: [f32; 2], reverse: bool) -> Surface {
    let [p0, p1, p2] = m.corners(triangle);
    let corner = m.indices()[triangle as usize];
    let w = [1.0 - b[0] - b[1], b[0], b[1]];
    let mut ng = (p1 - p0).cross(p2 - p0).normalize();
    if reverse {
        ng = -ng;
    }

    let ns = if m.normals().is_empty() { ng } else { shading_normal(m, triangle, w, ng) };

    // Invert the map from (u, v) to the triangle's plane.
    let uvs = if m.uvs().is_empty() { [Vec2::ZERO, Vec2::X, Vec2::ONE] } else { corner.map(|v| m.uvs()[v as usize]) };
    let uv = uvs[0] * w[0] + uvs[1] * w[1] + uvs[2] * w[2];
    let (e1, e2) = (p1 - p0, p2 - p0);
    let (u1, u2) = (uvs[1] - uvs[0], uvs[2] - uvs[0]);
    let det = Mat2::from_cols(u1, u2).determinant();
    let (mut dpdu, mut dpdv) = ((e1 * u2.y - e2 * u1.y) / det, (e2 * u1.x - e1 * u2.x) / det);
    if !dpdu.is_finite() || !dpdv.is_finite() || dpdu.cross(dpdv) == Vec3::ZERO {
        // Texture coordinates that do not span a plane: any tangents of the triangle's size will do.
        let f = Frame::new(ng);
        let size = e1.length().max(e2.length());
        (dpdu, dpdv) = (f.s * size, f.t * size);
    }
    Surface { p: interpolate([p0, p1, p2], b), ng, ns, uv, dpdu, dpdv }
}

impl Accel {
    /// Returns the ball of a shape if it is one, for closed-form distances.
    pub fn ball(&self, shape: u32) -> Option<(Vec3, f32)> {
        self.shapes[shape as usize].quadric().and_then(Quadric::as_ball).map(|(c, r)| (c.as_vec3(), r as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate;
    use moonmilk_core::{Mat4, Random, Stream};

    #[test]
    fn an_empty_scene_has_no_hits() {
        let a = Accel::build(vec![]);
        assert!(a.nearest(&Ray::new(Vec3::ZERO, Vec3::X)).is_none() && a.bounds().is_empty());
    }

    #[test]
    fn hits_name_shape_triangle_point_and_side() {
        let cube = generate::cuboid(Vec3::splat(-1.0), Vec3::splat(1.0));
        let a = Accel::build(vec![Quadric::sphere(Vec3::X * 5.0, 1.0).unwrap().into(), Shape::from(cube).reversed()]);
        let ray = Ray::new(Vec3::new(0.3, 0.2, 9.0), Vec3::NEG_Z);
        let h = a.nearest(&ray).unwrap();
        let s = a.surface(&ray, &h);
        assert_eq!((h.shape, h.t, h.exiting), (1, 8.0, true));
        // Barycentric weights carry a rounding of 2^-24 each, times corners up to 1 and the ray's distance of 9.
        assert!(s.p.distance(Vec3::new(0.3, 0.2, 1.0)) < 1e-6 && s.p.z == 1.0);
        assert_eq!((s.ng, s.ns), (Vec3::NEG_Z, Vec3::NEG_Z));
        assert_eq!(a.locate(h.prim), (1, h.index));
        let ray = Ray::new(Vec3::new(5.0, 0.0, -4.0), Vec3::Z);
        let h = a.nearest(&ray).unwrap();
        assert_eq!((h.shape, h.index, h.t, h.exiting), (0, 0, 3.0, false));
        assert_eq!(a.surface(&ray, &h).ng, Vec3::NEG_Z);
        let mut n = 0;
        a.all_hits(&ray, |_| n += 1);
        assert_eq!(n, 2);
        assert!(!a.occluded(&ray.up_to(3.0), |_| true) && a.occluded(&ray.up_to(3.1), |_| true));
        assert!(!a.occluded(&ray, |h| h.shape == 1));
    }

    #[test]
    fn derivatives_follow_the_texture_coordinates() {
        let p = vec![Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 3.0, 0.0)];
        let uv = vec![Vec2::new(0.1, 0.2), Vec2::new(0.6, 0.2), Vec2::new(0.1, 0.95)];
        let m = Mesh::new(p, vec![], uv, vec![[0, 1, 2]]).unwrap();
        let s = mesh_surface(&m, 0, [0.5, 0.25], false);
        // Rounding of sums of three f32 products.
        assert!(s.dpdu.distance(Vec3::new(4.0, 0.0, 0.0)) < 1e-5 && s.dpdv.distance(Vec3::new(0.0, 4.0, 0.0)) < 1e-5);
        assert!(s.uv.distance(Vec2::new(0.35, 0.3875)) < 1e-6 && s.p.distance(Vec3::new(1.0, 0.75, 0.0)) < 1e-6);
    }

    #[test]
    fn quadrics_answer_as_their_tessellations_do() {
        // An ellipsoid against a fine mesh of it: depths differ by the facets' sag, (0.02)^2 / 8 of the size.
        let m = Mat4::from_translation(Vec3::new(3.0, 1.0, -2.0))
            * Mat4::from_rotation_y(0.4)
            * Mat4::from_scale(Vec3::new(1.0, 0.5, 2.0));
        let kind = crate::QuadricKind::Sphere { radius: 1.0, z_min: -1.0, z_max: 1.0, phi_max: std::f64::consts::TAU };
        let q = Accel::build(vec![Quadric::new(kind, &m).unwrap().into()]);
        let t = Accel::build(vec![generate::bumpy_sphere(6, 0.0).transformed(&m).unwrap().into()]);
        let mut r = Stream::new(&[6]);
        let mut both = 0;
        for _ in 0..20_000 {
            let o = Vec3::new(3.0, 1.0, -2.0) + (Vec3::new(r.uniform(), r.uniform(), r.uniform()) - 0.5) * 8.0;
            let d = (Vec3::new(r.uniform(), r.uniform(), r.uniform()) - 0.5).normalize();
            if let (Some(a), Some(b)) = (q.nearest(&Ray::new(o, d)), t.nearest(&Ray::new(o, d))) {
                let ray = Ray::new(o, d);
                let (n, m) = (q.surface(&ray, &a).ng, t.surface(&ray, &b).ng);
                if n.dot(d).abs() > 0.2 && a.exiting == b.exiting {
                    both += 1;
                    assert!((a.t - b.t).abs() < 2e-3 && n.dot(m) > 0.99, "{a:?} {b:?}");
                }
            }
        }
        assert!(both > 500, "{both}");
    }
}
