//! Paths that rounding holds at one place.
//!
//! Walls of several bodies at the same place (boxes that touch, the same box twice) can each lie ahead of the other by rounding, so that
//! a ray that has crossed one meets the other, then the first again, and never gets away. A [`Snag`] counts the surfaces that are met at
//! one place; when they are more than there can reasonably be, the caller moves on by [`Snag::STEP`] and finds out anew what is there.
//! That is right also where so many walls really are at one place: a step over them by less than they are known to is what they say.

use moonmilk_core::Vec3;

use crate::interior::Standing;
use crate::scene::Scene;

/// Surfaces met at one place after which a path is set free there: between two walls that reflect, grazing light is thrown to and fro many times.
const MOST: u32 = 256;
/// What counts as one place [slack of the body stood on]: rounding moves a path by one or two.
const REACH: f32 = 8.0;

/// The place where a path met its last surfaces, and how many.
pub(crate) struct Snag {
    at: Vec3,
    count: u32,
}

impl Snag {
    /// How far to go on [slack of the body stood on].
    const STEP: f32 = 2.0 * REACH;

    /// Returns the watch over a path at p.
    pub fn new(p: Vec3) -> Self {
        Self { at: p, count: 0 }
    }

    /// Counts a surface met at p, on which a path stands now; returns how far it must be moved, if it must.
    #[inline]
    pub fn meet(&mut self, scene: &Scene, p: Vec3, standing: &Standing) -> Option<f32> {
        let body = standing.shape().and_then(|shape| scene.objects[shape as usize].body);
        let slack = body.map_or(0.0, |b| b.slack);
        if p.distance(self.at) > REACH * slack {
            *self = Self::new(p);
            return None;
        }
        self.count += 1;
        // On what bounds nothing there is no step that leads away.
        (slack > 0.0 && self.count.is_multiple_of(MOST)).then_some(Self::STEP * slack)
    }
}
