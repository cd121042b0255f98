//! Walls of several objects at the same place: boxes side by side, milk that ends where its glass begins, a block on a table.
//!
//! Rounding lays either wall before the other, from one point to the next, so that the order in which a ray finds them means nothing and
//! the second is often missed: the path stands beyond it already. What counts is decided by the list of bodies that the path is in, and by
//! one rule of order: *first leave, the highest rank first; then meet what is opaque; then enter, the lowest rank first.* Between
//! objects that touch there is a gap of no width.
//!
//! The walls at a place are searched along the normal of the one that is known, as far as rounding can have moved either. A wall counts if
//! the path would change sides there as the list has it: out of a body that it is in, into one that it is not in. Opaque surfaces count for
//! a path that comes out of a body.

use moonmilk_core::Vec3;
use moonmilk_geometry::{Hit, Ray, Surface};

use crate::interior::Standing;
use crate::nest::Nest;
use crate::scene::{Object, Scene};

/// How far the search goes to either side of a wall [slack of either object]: each may be off by one of its own.
pub(crate) const REACH: f32 = 3.0;

/// How far off a wall that coincides with the one stood on may be met [slack of either object]: a thousandth of a right angle above it.
const GRAZING: f32 = 1000.0;

/// What a path that arrives at a surface does there.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Arrival {
    /// It meets that surface.
    This,
    /// It meets another one first.
    Other(Hit, Surface),
    /// It passes: the surface is on the side where the path is already, by rounding.
    Ghost,
}

/// Place in the order of walls that are met at one place.
type Key = (u8, u32);

/// Returns the place of a body's wall in the order, `None` if the path is on its other side already.
fn key_of_body(nest: &Nest, object: &Object, hit: &Hit) -> Option<Key> {
    (hit.exiting == nest.contains(hit.shape)).then_some(if hit.exiting {
        (0, u32::MAX - object.rank)
    } else {
        (2, object.rank)
    })
}

/// Returns whether an object is a body that paths go into.
fn is_room(object: &Object) -> bool {
    object.yields && object.body.is_some()
}

/// Returns whether a surface ends every straight line.
fn is_opaque(object: &Object) -> bool {
    !object.hollow && object.alpha.is_none()
}

/// Returns whether a surface that was hit may be one that coincides with that where the ray began.
#[inline]
pub(crate) fn is_near(object: &Object, hit: &Hit) -> bool {
    hit.t < GRAZING * object.touch
}

/// The walls at a place.
struct Walls {
    first: Option<(Key, Hit)>,
    /// Whether there is that of a body, besides the known one.
    others: bool,
    /// Whether the path comes from there, inside of a body.
    inward: bool,
    ray: Ray,
}

/// Searches the walls at a point on a surface of normal `n`, for a path that flies along `d`; those of `known` are left out.
fn walls(scene: &Scene, nest: &Nest, p: Vec3, n: Vec3, d: Vec3, known: u32, opaque: bool) -> Walls {
    let reach = REACH * scene.objects[known as usize].touch;
    let n = if n.dot(d) < 0.0 { -n } else { n };
    let ray = Ray::new(p - n * reach, n).up_to(2.0 * reach);
    let mut found = Walls { first: None, others: false, inward: false, ray };
    scene.accel.all_hits(&ray, |hit| {
        let object = &scene.objects[hit.shape as usize];
        if hit.shape == known {
            return;
        }
        let key = if is_room(object) {
            found.others = true;
            found.inward |= !hit.exiting && nest.contains(hit.shape);
            key_of_body(nest, object, hit)
        } else {
            (opaque && is_opaque(object)).then_some((1, 0))
        };
        if let Some(key) = key
            && found.first.is_none_or(|(first, _)| key < first)
        {
            found.first = Some((key, *hit));
        }
    });
    found
}

/// Returns what a path does that flies along `d` and finds a surface.
#[inline]
pub(crate) fn arrival(scene: &Scene, nest: &Nest, hit: &Hit, surface: &Surface, d: Vec3) -> Arrival {
    let object = &scene.objects[hit.shape as usize];
    if object.touch == 0.0 { Arrival::This } else { arrival_among(scene, nest, object, hit, surface, d) }
}

fn arrival_among(scene: &Scene, nest: &Nest, object: &Object, hit: &Hit, surface: &Surface, d: Vec3) -> Arrival {
    let key = if is_room(object) { key_of_body(nest, object, hit) } else { Some((1, 0)) };
    let entering = is_room(object) && !hit.exiting;
    let found = walls(scene, nest, surface.p, surface.ng, d, hit.shape, entering);
    match (key, found.first) {
        (None, None) if found.others => Arrival::Ghost,
        // What is opaque lies on the far side of a body's wall, however rounding has it.
        (Some(_), None) if !is_room(object) && found.inward => Arrival::Ghost,
        (_, None) => Arrival::This,
        (Some(this), Some((other, _))) if this <= other => Arrival::This,
        (_, Some((_, other))) => Arrival::Other(other, scene.accel.surface(&found.ray, &other)),
    }
}

/// Returns the first surface that a path meets on a ray, and how far off it is.
#[inline]
pub(crate) fn nearest(scene: &Scene, nest: &Nest, mut ray: Ray) -> Option<(Hit, Surface, f32)> {
    loop {
        let hit = scene.accel.nearest(&ray)?;
        let surface = scene.accel.surface(&ray, &hit);
        match arrival(scene, nest, &hit, &surface, ray.d) {
            Arrival::This => return Some((hit, surface, hit.t)),
            Arrival::Other(other, surface) => return Some((other, surface, hit.t)),
            Arrival::Ghost => ray.t_min = hit.t.max(ray.t_min).next_up(),
        }
    }
}

/// Returns the wall that a path meets at the very place where it stands when it sets out along `d`.
#[inline]
pub(crate) fn departure(scene: &Scene, nest: &Nest, standing: &Standing, p: Vec3, d: Vec3) -> Option<(Hit, Surface)> {
    let (hit, outside) = match standing {
        Standing::Space | Standing::Through(_) => return None,
        Standing::Outside(hit) => (hit, true),
        Standing::On(hit) | Standing::Inside(hit) => (hit, false),
    };
    let object = &scene.objects[hit.shape as usize];
    if object.touch == 0.0 {
        return None;
    }
    let (_, n) = scene.accel.point_and_normal(&Ray::new(p, d), &Hit { t: 0.0, ..*hit });
    let found = walls(scene, nest, p, n, d, hit.shape, outside && is_room(object));
    found.first.map(|(_, hit)| (hit, scene.accel.surface(&found.ray, &hit)))
}
