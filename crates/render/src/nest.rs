//! The closed bodies that a point is inside of, and which of them counts there: nested and overlapping dielectrics.
//!
//! Where bodies overlap, one of them is there and the others are not \[Schmidt2002\]: the one of the highest priority; among
//! equal priorities the one of the smaller volume, so that what lies inside something else is what it seems to be; among
//! equal volumes the one later in the file. That is a strict order ([`crate::scene::Object::rank`]) which depends on the
//! bodies alone, never on the way that a path takes: so light and camera may be exchanged.
//!
//! A surface of a body is a *false boundary* where a body of higher rank is on both sides of it: paths pass it as if it were
//! not there, and only the list changes. A true boundary lies between the body and the next one below.
//!
//! *Indices.* With a priority, a material's `eta` is its index against vacuum, and the relative index of a boundary is the
//! quotient of both sides. Without one it is relative to whatever surrounds the body, as in pbrt. That says which index a
//! body has where it lies within one other body, and is ambiguous where surfaces cross: bodies that cross need priorities.
//!
//! *Media.* The body that counts decides. One with a priority and without a medium is clear inside; one without either leaves
//! the medium that is there without it (pbrt: a ray stays in its medium). With no body, the medium is that around all of them.

use moonmilk_core::Vec2;
use moonmilk_core::{Vec3, Wavelengths};

use crate::media::Matter;
use crate::scene::{Object, Scene, Side};
use crate::texture::TexturePoint;

/// A body that a path is inside of.
#[derive(Clone, Copy, Debug)]
pub struct Inside {
    /// Number of its shape.
    pub shape: u32,
    /// Its place in the order of bodies: the highest counts.
    pub rank: u32,
    /// Its index against vacuum.
    pub index: f32,
    /// Where the path came in from the camera's side: there textured coefficients are evaluated.
    pub point: TexturePoint,
}

impl Default for Inside {
    fn default() -> Self {
        let point = TexturePoint { p: Vec3::ZERO, n: Vec3::Z, uv: Vec2::ZERO };
        Self { shape: u32::MAX, rank: 0, index: 1.0, point }
    }
}

/// What a path meets at the surface of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meeting {
    /// A boundary that is not there, inside of a body of higher rank.
    False,
    /// A boundary; the relative index is the material's own over this.
    True(f32),
}

/// Bodies kept without an allocation.
const FEW: usize = 4;

/// The bodies that a path is inside of, by rank.
#[derive(Clone, Debug, Default)]
pub struct Nest {
    few: [Inside; FEW],
    count: usize,
    /// All of them, where they are more than a few.
    many: Vec<Inside>,
}

impl Nest {
    /// Returns the bodies, that of the highest rank last.
    #[inline]
    pub fn bodies(&self) -> &[Inside] {
        if self.many.is_empty() { &self.few[..self.count] } else { &self.many }
    }

    /// Returns the body that counts.
    #[inline]
    pub fn innermost(&self) -> Option<u32> {
        self.bodies().last().map(|b| b.shape)
    }

    /// Returns whether the path is inside a body.
    #[inline]
    pub fn contains(&self, shape: u32) -> bool {
        self.bodies().iter().any(|b| b.shape == shape)
    }

    /// Goes into a body; nothing happens if the path is there already.
    pub fn enter(&mut self, body: Inside) {
        if self.contains(body.shape) {
            return;
        }
        let at = self.bodies().partition_point(|b| b.rank < body.rank);
        if self.many.is_empty() && self.count < FEW {
            self.few[at..=self.count].rotate_right(1);
            self.few[at] = body;
            self.count += 1;
            return;
        }
        if self.many.is_empty() {
            self.many.extend_from_slice(&self.few[..self.count]);
            self.count = 0;
        }
        self.many.insert(at, body);
    }

    /// Goes out of a body; nothing happens if the path is not in it.
    pub fn leave(&mut self, shape: u32) {
        let Some(at) = self.bodies().iter().position(|b| b.shape == shape) else {
            return;
        };
        if self.many.is_empty() {
            self.few[at..self.count].rotate_left(1);
            self.count -= 1;
        } else {
            self.many.remove(at);
        }
    }

    /// Returns the highest of the other bodies.
    fn beside(&self, shape: u32) -> Option<&Inside> {
        self.bodies().iter().rev().find(|b| b.shape != shape)
    }

    /// Returns the index against vacuum of a body that is entered: its own, or relative to what it lies in.
    fn index_of(&self, object: &Object, shape: u32) -> f32 {
        if object.absolute {
            return object.index;
        }
        let around = self.bodies().iter().rev().find(|b| b.shape != shape && b.rank < object.rank);
        object.index * around.map_or(1.0, |b| b.index)
    }

    /// Returns what the surface of a body is to a path that comes in or goes out through it.
    ///
    /// The hit is believed: whether the path is inside already makes no difference on its way in, nor whether it is not on its way out.
    #[inline]
    pub fn meet(&self, object: &Object, shape: u32, exiting: bool) -> Meeting {
        if self.bodies().is_empty() {
            return Meeting::True(1.0);
        }
        let beside = self.beside(shape);
        if object.yields && beside.is_some_and(|b| b.rank > object.rank) {
            return Meeting::False;
        }
        let around = beside.map_or(1.0, |b| b.index);
        if !exiting {
            return Meeting::True(if object.absolute { around } else { 1.0 });
        }
        let own = self.bodies().iter().find(|b| b.shape == shape).map(|b| b.index);
        let own = own.unwrap_or_else(|| self.index_of(object, shape));
        Meeting::True(object.index * around / own)
    }

    /// Goes into a body at a point of its surface.
    pub(crate) fn step_into(&mut self, object: &Object, shape: u32, point: TexturePoint) {
        let index = self.index_of(object, shape);
        self.enter(Inside { shape, rank: object.rank, index, point });
    }

    /// Goes through the surface of a body (true or false) and changes the medium.
    ///
    /// `ambient` is the medium around all bodies.
    pub(crate) fn cross<const N: usize>(
        &mut self,
        scene: &Scene,
        shape: u32,
        exiting: bool,
        point: &TexturePoint,
        wavelengths: &Wavelengths<N>,
        medium: &mut Option<Matter<N>>,
        ambient: &mut Option<Matter<N>>,
    ) {
        let object = &scene.objects[shape as usize];
        if exiting {
            self.leave(shape);
            if self.bodies().is_empty() && object.outside != Side::Same {
                *ambient = scene.medium_outside(object, wavelengths, *ambient);
            }
        } else {
            self.step_into(object, shape, *point);
        }
        *medium = self.medium(scene, wavelengths, *ambient);
    }

    /// Returns the medium at the path's place.
    pub(crate) fn medium<const N: usize>(
        &self,
        scene: &Scene,
        wavelengths: &Wavelengths<N>,
        ambient: Option<Matter<N>>,
    ) -> Option<Matter<N>> {
        for body in self.bodies().iter().rev() {
            let object = &scene.objects[body.shape as usize];
            if object.inside != Side::Same {
                return scene.medium_inside(object, &body.point, wavelengths, None);
            }
            if object.absolute {
                return None;
            }
        }
        ambient
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inside(shape: u32, rank: u32) -> Inside {
        Inside { shape, rank, ..Inside::default() }
    }

    #[test]
    fn the_highest_rank_counts_whatever_the_order_of_entry_and_however_many_there_are() {
        let mut nest = Nest::default();
        let ranks = [3, 9, 1, 7, 5, 8, 2, 6, 4];
        for (i, &rank) in ranks.iter().enumerate() {
            nest.enter(inside(100 + rank, rank));
            nest.enter(inside(100 + rank, rank));
            assert_eq!(nest.bodies().len(), i + 1);
            assert_eq!(nest.innermost(), ranks[..=i].iter().max().map(|r| 100 + r));
        }
        for (i, rank) in [9, 1, 5, 8, 2, 7, 3].into_iter().enumerate() {
            nest.leave(100 + rank);
            nest.leave(100 + rank);
            assert!(nest.bodies().len() == 8 - i && !nest.contains(100 + rank));
            assert!(nest.bodies().is_sorted_by_key(|b| b.rank));
        }
        assert_eq!(nest.bodies().iter().map(|b| b.rank).collect::<Vec<_>>(), [4, 6]);
        nest.leave(104);
        nest.leave(106);
        assert_eq!(nest.innermost(), None);
    }
}
