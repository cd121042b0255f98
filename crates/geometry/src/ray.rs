//! Rays, hits and what a hit surface looks like.

use moonmilk_core::{Vec2, Vec3};

use crate::group::BEHIND;

/// [`Prim::instance`] of what stands in the world itself.
pub const WORLD: u32 = u32::MAX;

/// A primitive of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Prim {
    /// The instance that it belongs to, or [`WORLD`].
    pub instance: u32,
    /// Its number in the instanced object, or in the world.
    pub number: u32,
}

/// The primitive that no primitive is.
pub const NONE: Prim = Prim { instance: WORLD, number: u32::MAX };

/// A closed surface made of one or several consecutive shapes: the range of its primitives.
///
/// From [`crate::Accel::body`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// The instance that it belongs to, or [`WORLD`].
    pub instance: u32,
    /// First primitive.
    pub first: u32,
    /// One past the last primitive.
    pub end: u32,
    /// How far a point of the body may be off by rounding \[L\]: 8 units in the last place of the body's largest coordinate.
    pub slack: f32,
}

impl Body {
    /// Returns whether a primitive belongs to the body.
    #[inline]
    pub fn contains(&self, prim: Prim) -> bool {
        prim.instance == self.instance && self.has(prim.number)
    }

    /// Returns whether a primitive of the body's own instance belongs to it.
    #[inline(always)]
    pub(crate) fn has(&self, number: u32) -> bool {
        number.wrapping_sub(self.first) < self.end - self.first
    }
}

/// Which hits count; see the crate's documentation for the reasons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Facing {
    /// All hits with `t > t_min`.
    Any,
    /// The ray is inside a body: hits on it count only where the ray leaves through its surface.
    Exiting(Body),
    /// The ray is outside a body that it starts on: hits on it count only where the ray enters.
    Entering(Body),
}

/// A ray, or a segment of one.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin.
    pub o: Vec3,
    /// Direction, of unit length.
    pub d: Vec3,
    /// Hits count for `t > t_min`; usually 0.
    pub t_min: f32,
    /// Hits count for `t < t_max`.
    pub t_max: f32,
    /// Primitive that the ray starts on, or [`NONE`].
    pub skip: Prim,
    /// Which hits count.
    pub facing: Facing,
}

impl Ray {
    /// Returns the unbounded ray from a point in space.
    #[inline]
    pub fn new(o: Vec3, d: Vec3) -> Self {
        Self { o, d, t_min: 0.0, t_max: f32::INFINITY, skip: NONE, facing: Facing::Any }
    }

    /// Returns the ray restricted to `t < t_max`.
    #[inline]
    pub fn up_to(self, t_max: f32) -> Self {
        Self { t_max, ..self }
    }

    /// Returns the ray with the primitive that it starts on.
    #[inline]
    pub fn from_prim(self, prim: Prim) -> Self {
        Self { skip: prim, ..self }
    }

    /// Returns the ray with a rule which hits count.
    #[inline]
    pub fn facing(self, facing: Facing) -> Self {
        Self { facing, ..self }
    }

    /// Returns the ray as an instance (or the world) alone sees it: what it stands on and is inside of counts there only.
    #[inline(always)]
    pub(crate) fn within(&self, instance: u32) -> Self {
        let facing = match self.facing {
            Facing::Exiting(b) | Facing::Entering(b) if b.instance != instance => Facing::Any,
            facing => facing,
        };
        Self { skip: if self.skip.instance == instance { self.skip } else { NONE }, facing, ..*self }
    }

    /// Returns the distance, perhaps below `t_min`, from which hits may count: see the crate's documentation, case 1.
    #[inline(always)]
    pub(crate) fn low(&self) -> f32 {
        match self.facing {
            Facing::Exiting(b) if !b.contains(self.skip) => self.t_min - BEHIND * b.slack,
            _ => self.t_min,
        }
    }

    /// Returns the point at distance t.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.o + self.d * t
    }
}

/// Where a ray meets a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray \[L\]; never below 0.
    pub t: f32,
    /// The primitive (pass it on as [`Ray::skip`]).
    pub prim: Prim,
    /// Number of the shape: those of the world first, then those of each instance in turn.
    pub shape: u32,
    /// Number of the triangle in its mesh; 0 for a quadric.
    pub index: u32,
    /// Barycentric weights of the triangle's second and third corner; zero for a quadric.
    pub b: [f32; 2],
    /// Whether the ray leaves through the surface here (`d . ng > 0`), decided by the same exact test that found the hit.
    pub exiting: bool,
    /// Whether rounding had put the origin on the wrong side of the body, so that this is the closest point that faces
    /// the right way instead of a crossing. Worth counting: more than one in 1e4 says that the body is not closed.
    pub rescued: bool,
}

/// The surface at a hit.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Point on the surface: from barycentric weights or projected onto the quadric, not from `o + t d`.
    pub p: Vec3,
    /// Unit geometric normal, outward by winding, or inward if the shape is reversed.
    pub ng: Vec3,
    /// Unit shading normal on the side of `ng`; equal to `ng` if the mesh has no normals.
    pub ns: Vec3,
    /// Texture coordinates; barycentric weights (pbrt's default corners) for a mesh without them.
    pub uv: Vec2,
    /// Derivative of the point with respect to u; tangent, not of unit length.
    pub dpdu: Vec3,
    /// Derivative of the point with respect to v.
    pub dpdv: Vec3,
}
