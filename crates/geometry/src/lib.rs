//! Meshes, analytic shapes, watertight ray queries and distance bounds.
//!
//! The walks of light inside a body have thousands of segments; one ray in a million that slips through an edge is one
//! walk in a thousand that is lost. Everything here follows from that:
//!
//! 1. **No absolute length.** Every tolerance is a multiple of f32's resolution at the coordinates involved, so a scene
//!    and its copy scaled by a power of two give the same answers.
//! 2. **Triangles are tested in the plane across the ray** ([`triangle`]): vertices are projected once (a function of the
//!    vertex and the ray alone), then the three edge functions are evaluated exactly. Two triangles that share an edge
//!    agree on the side of it that the ray passes, and a closed mesh is crossed outward exactly as often as inward.
//! 3. **Boxes are tested with a margin** that covers the rounding of box and triangle test ([`bvh`]).
//! 4. **No ray offsets.** A ray that starts on a surface says so ([`Ray::skip`], [`Facing`]); the surface answers by
//!    topology (which triangle, which way through it) instead of by distance.
//!
//! 5. **An instance is one more space.** A ray is taken to the object's space once; what holds for a closed mesh holds there, under
//!    any affine transform ([`Accel::with_instances`]).
//!
//! # Facing: which hits count
//!
//! A point on or inside a body is known up to [`Body::slack`], a few units in the last place of the body's largest
//! coordinate; after rounding it may lie on the wrong side of the surface. What saves the walk is knowledge that the
//! caller has: whether it is inside or outside, and which primitive it is on.
//!
//! * [`Facing::Exiting`] (inside the body): of the body's own primitives only those count that the ray leaves through
//!   (`d . ng > 0`).
//! * [`Facing::Entering`] (outside, having just left the body or been reflected off it): only those that it enters through.
//! * [`Facing::Any`]: all hits with `t > t_min`. For rays that start in space (camera), from surfaces that bound nothing, and
//!   for shadow rays, where blocking one in a million too many at an edge is better than shining through.
//!
//! Hits of shapes that are not part of the body always count for `t > t_min`. [`Ray::skip`] excludes the one primitive
//! that a ray starts on; a plane cannot be hit twice, and a sphere then answers with its other root. That leaves two cases:
//!
//! 1. *A point that rounding put outside*: a collision in space, or on a surface of something else (`skip` is not of the body). The exit lies at `t` slightly below zero.
//!    It counts if the origin is beyond it by no more than the slack; the answer is then `t = 0`.
//! 2. *A start on triangle A near its edge, or along it.* The triangle B behind a convex edge should end a ray that heads
//!    inward, but if rounding lifted the start by h, the ray passes above the edge by h and misses both: accepting
//!    negative `t` does not help (B's plane is met above its edge), and would produce false exits at concave edges. The
//!    test that tells is how deep below A the ray passes A's edge. If that is more than the slack, rounding cannot matter.
//!    If less (one start in 1e3 to 1e5, by the size of the triangles), the side is found by counting crossings along the whole line: exits minus entries
//!    are 1 from inside and 0 from outside, by the exactness of point 2 above. A start on the wrong side leaves the body at
//!    the closest point of a triangle that faces the right way ([`Hit::rescued`]).
//!
//! So an unbounded ray from inside always has an exit. A *bounded* flight of an inside walk ends in a collision if there
//! is no hit; the position can be outside by rounding (case 1). Callers that want the last guarantee check
//! [`Accel::shape_bounds`] after a move and call [`Accel::rescue`] outside of them.

pub mod accel;
pub mod bounds;
pub mod bvh;
pub mod clearance;
pub mod closest;
pub mod crossings;
pub mod generate;
mod group;
pub mod mesh;
pub mod patch;
mod place;
pub mod quadric;
pub mod ray;
pub mod room;
pub mod sample;
mod search;
pub mod shape;
pub mod shells;
mod surface;
pub mod topology;
pub mod triangle;

pub use accel::Accel;
pub use bounds::Bounds;
pub use clearance::Clearance;
pub use closest::Closest;
pub use crossings::{Crossings, Duplicates};
pub use mesh::{Mesh, MeshError};
pub use patch::{Contact, Patch};
pub use quadric::{Quadric, QuadricKind};
pub use ray::{Body, Facing, Hit, NONE, Prim, Ray, Surface, WORLD};
pub use room::Room;
pub use shape::{Form, Shape};
pub use shells::Shell;
pub use topology::Topology;
