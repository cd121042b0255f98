//! Where a walk takes place, as the walk sees it.

use moonmilk_core::{Random, Vec3};

use crate::guide::Outward;
use crate::walker::Walker;

pub mod ball;
pub mod layer;
pub mod planar;

/// What happens at a wall.
#[derive(Clone, Copy, Debug)]
pub enum Wall<W, E> {
    /// The path stays in the medium (reflected); it now stands on this wall.
    Stay(W),
    /// The path leaves.
    Leave(E),
}

/// A region of medium with walls.
pub trait Domain<const N: usize> {
    /// A wall as met by a flight; also tells later queries which wall a flight starts on.
    type Wall: Copy;
    /// What is known of a path that left.
    type Exit;

    /// Whether asking for a wall costs no more than asking for the room to it, so that flights ask at once.
    const CHEAP_SEGMENTS: bool = false;

    /// Returns the wall value of a start away from any wall.
    fn start(&self) -> Self::Wall;

    /// Returns the wall that the walk starts on.
    #[inline]
    fn first(&self) -> Self::Wall {
        self.start()
    }

    /// Returns a lower bound of the distance from p to any wall; 0 is always right.
    fn room(&self, p: Vec3) -> f32;

    /// Returns a lower bound of the distance from p to anything that a jump must not pass over: walls, and what else is there (lights).
    ///
    /// `room` is [`Domain::room`] of p. A better bound than that is worth its cost where a radius of `least` or more comes of it; none above `most` is needed.
    #[inline]
    fn clear(&self, _p: Vec3, room: f32, _least: f32, _most: f32) -> f32 {
        room
    }

    /// Returns the way out from p for guided walks, `room` being [`Domain::room`] of p; `None` where it is not known, and walks go on plainly. A function of the path alone.
    #[inline]
    fn outward(&self, _p: Vec3, _room: f32) -> Option<Outward> {
        None
    }

    /// Returns the way out at the start p of a walk along d, if that is a wall.
    #[inline]
    fn entry(&self, _p: Vec3, _d: Vec3) -> Option<Outward> {
        None
    }

    /// Returns the first wall within `t_max` along d, and the distance to it. `from` is the wall that p stands on.
    fn segment(&self, p: Vec3, d: Vec3, t_max: f32, from: &Self::Wall) -> Option<(f32, Self::Wall)>;

    /// Moves the walker to the wall at distance t and decides what happens there.
    fn arrive<R: Random>(
        &self,
        wall: Self::Wall,
        t: f32,
        walker: &mut Walker<N>,
        rng: &mut R,
    ) -> Wall<Self::Wall, Self::Exit>;

    /// Returns whether p lies certainly outside (rounding put it there).
    fn is_outside(&self, p: Vec3) -> bool;
}

/// Decides reflection or refraction at a smooth boundary met from inside; returns the new direction and whether it left.
///
/// `n` is the outward unit normal, `eta` = inside / outside. Reflection with probability F, else refraction: weight one. For light that enters, hand in the inward normal and the inverse index.
pub fn smooth_boundary(d: Vec3, n: Vec3, eta: f32, rng: &mut impl Random) -> (Vec3, bool) {
    let cos_i = d.dot(n).clamp(0.0, 1.0);
    if eta == 1.0 {
        return (d, true);
    }
    let sin2_t = eta * eta * (1.0 - cos_i * cos_i);
    if sin2_t >= 1.0 {
        return (d - n * (2.0 * cos_i), false);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let (a, b) = (eta * cos_i, cos_t);
    let r_s = (a - b) / (a + b);
    let (a, b) = (cos_i, eta * cos_t);
    let r_p = (a - b) / (a + b);
    if rng.uniform() < 0.5 * (r_s * r_s + r_p * r_p) {
        (d - n * (2.0 * cos_i), false)
    } else {
        ((d * eta + n * (cos_t - eta * cos_i)).normalize(), true)
    }
}
