//! Where an instance of an object stands: rays go to the object's space, what they meet comes back.
//!
//! A ray is taken to object space once, in f64, and rounded there: for all triangles of the instance it is *one* ray, so that
//! what is watertight stays watertight under any transform. A point of the surface is known in the world up to the rounding of
//! world coordinates, and in object space up to that over the smallest stretch; [`Body::slack`] covers both.

use moonmilk_core::Vec3;
use moonmilk_core::glam::{DAffine3, DVec3};

use crate::bounds::Bounds;
use crate::group::{Group, SLACK};
use crate::quadric::stretch_of;
use crate::ray::{Body, Facing, NONE, Prim, Ray, Surface, WORLD};

/// An object placed in the world.
#[derive(Clone, Debug)]
pub(crate) struct Placement {
    /// The object.
    pub(crate) group: u32,
    /// Number of its first shape in the scene.
    pub(crate) first_shape: u32,
    pub(crate) to_world: DAffine3,
    pub(crate) to_object: DAffine3,
    /// Smallest and largest factor by which `to_world` stretches a length.
    pub(crate) stretch: [f64; 2],
}

impl Placement {
    /// Returns a placement, or `None` if the transform is singular or not finite.
    pub(crate) fn new(group: u32, first_shape: u32, to_world: &DAffine3) -> Option<Self> {
        let to_object = to_world.inverse();
        if !to_world.is_finite() || !to_object.is_finite() {
            return None;
        }
        let stretch = stretch_of(to_world);
        let usable = stretch[0] > 0.0 && stretch[1].is_finite();
        usable.then_some(Self { group, first_shape, to_world: *to_world, to_object, stretch })
    }

    /// Returns the ray in object space, of unit direction, and the factor from world to object distances.
    #[inline]
    pub(crate) fn ray(&self, ray: &Ray, instance: u32, t_max: f32) -> (Ray, f32) {
        let d = self.to_object.matrix3 * ray.d.as_dvec3();
        let length = unless_unit(d.length());
        let factor = length as f32;
        let facing = match ray.facing {
            Facing::Exiting(b) if b.instance == instance => Facing::Exiting(self.body(b)),
            Facing::Entering(b) if b.instance == instance => Facing::Entering(self.body(b)),
            _ => Facing::Any,
        };
        let skip = if ray.skip.instance == instance { Prim { instance: WORLD, ..ray.skip } } else { NONE };
        let o = self.to_object.transform_point3(ray.o.as_dvec3()).as_vec3();
        let d = (d / length).as_vec3();
        (Ray { o, d, t_min: ray.t_min * factor, t_max: t_max * factor, skip, facing }, factor)
    }

    /// Returns a body of this instance as its group knows it.
    #[inline]
    pub(crate) fn body(&self, b: Body) -> Body {
        Body { instance: WORLD, slack: b.slack / self.stretch[0] as f32, ..b }
    }

    /// Returns what a point of a surface may be off by \[L\]: of a box in the object and of its image in the world.
    pub(crate) fn slack(&self, object: &Bounds, world: &Bounds) -> f32 {
        SLACK * world.magnitude().max(self.stretch[1] as f32 * object.magnitude())
    }

    /// Returns the box around the image of a box of the object, rounded outward.
    pub(crate) fn image(&self, b: &Bounds) -> Bounds {
        image(&self.to_world, b)
    }

    /// Returns a box around a group in the world: the union of the images of the boxes below its root.
    pub(crate) fn bounds(&self, group: &Group) -> Bounds {
        let Some(root) = group.bvh.nodes.first() else {
            return self.image(&group.all());
        };
        let child = |c: usize| {
            let b = root.child_aabb(c);
            self.image(&Bounds { min: b.min.into(), max: b.max.into() })
        };
        (0..8).filter(|&c| !root.is_child_empty(c)).map(child).fold(Bounds::EMPTY, Bounds::union)
    }

    /// Returns a point of the object in the world.
    #[inline]
    pub(crate) fn point(&self, p: Vec3) -> Vec3 {
        self.to_world.transform_point3(p.as_dvec3()).as_vec3()
    }

    /// Returns a point of the world in the object.
    #[inline]
    pub(crate) fn local(&self, p: Vec3) -> Vec3 {
        self.to_object.transform_point3(p.as_dvec3()).as_vec3()
    }

    /// Returns a unit normal in the world; what points outward keeps pointing outward, also in a mirror image.
    #[inline]
    pub(crate) fn normal(&self, n: Vec3) -> Vec3 {
        let n = self.to_object.matrix3.transpose() * n.as_dvec3();
        (n / unless_unit(n.length())).as_vec3()
    }

    /// Returns geometric and shading normal in the world, on one side of the surface.
    #[inline]
    pub(crate) fn normals(&self, ng: Vec3, ns: Vec3) -> (Vec3, Vec3) {
        let g = self.normal(ng);
        if ns == ng {
            return (g, g);
        }
        let s = self.normal(ns);
        (g, if s.dot(g) < 0.0 { -s } else { s })
    }

    /// Returns a surface of the object in the world.
    pub(crate) fn surface(&self, s: Surface) -> Surface {
        let (ng, ns) = self.normals(s.ng, s.ns);
        let vector = |v: Vec3| (self.to_world.matrix3 * v.as_dvec3()).as_vec3();
        Surface { p: self.point(s.p), ng, ns, uv: s.uv, dpdu: vector(s.dpdu), dpdv: vector(s.dpdv) }
    }
}

/// Returns a length, or 1 if it differs from that by no more than the rounding of a unit vector: dividing by it would only add
/// another rounding, and an instance that is not moved would not be its copy bit for bit.
#[inline]
fn unless_unit(length: f64) -> f64 {
    if (length - 1.0).abs() < 2.5e-7 { 1.0 } else { length }
}

/// Returns the box around the image of a box, rounded outward.
fn image(by: &DAffine3, b: &Bounds) -> Bounds {
    if b.is_empty() {
        return Bounds::EMPTY;
    }
    let (min, max) = (b.min.as_dvec3(), b.max.as_dvec3());
    let center = by.transform_point3((min + max) * 0.5);
    let along =
        |v: DVec3| by.matrix3.x_axis.abs() * v.x + by.matrix3.y_axis.abs() * v.y + by.matrix3.z_axis.abs() * v.z;
    let half = along((max - min) * 0.5);
    // One part in 2^21 exceeds the rounding of the result, and that of the box's own coordinates.
    let half = half + (center.abs() + half + along(min.abs().max(max.abs()))) * 0.5f64.powi(21);
    Bounds { min: (center - half).as_vec3(), max: (center + half).as_vec3() }
}
