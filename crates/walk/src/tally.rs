//! What a walk reports while it runs.

use moonmilk_core::{Random, Spectrum};

use crate::guide::Leaning;
use crate::hybrid::Jump;
use crate::jump::Exit;
use crate::medium::Medium;
use crate::phase::HenyeyGreenstein;
use crate::walker::Walker;

/// A recorder of the events of a walk in media with scattering law P.
pub trait Tally<const N: usize, R: Random, P = HenyeyGreenstein> {
    /// Called for each flight of length t inside the medium, before the walker moves.
    #[inline]
    fn flight(&mut self, _walker: &Walker<N>, _t: f32) {}

    /// Called at each collision before anything else is done there; returns whether the walk arrives, or ends as what other strategies than it have counted.
    #[inline]
    fn arrives(&mut self, _walker: &Walker<N>, _medium: &Medium<N, P>, _rng: &mut R) -> bool {
        true
    }

    /// Called at each collision; `arrived` is the weight there per unit coefficient \[length\]: times sigma_s it continues,
    /// times sigma_a it is absorbed (or emitted).
    #[inline]
    fn collision(&mut self, _walker: &mut Walker<N>, _medium: &Medium<N, P>, _arrived: Spectrum<N>, _rng: &mut R) {}

    /// Called instead of [`Tally::collision`] in guided walks; `vertex` is what the walk may go on by.
    #[inline]
    fn leaning(
        &mut self,
        walker: &mut Walker<N>,
        medium: &Medium<N, P>,
        arrived: Spectrum<N>,
        _vertex: &Leaning<'_, N, P>,
        rng: &mut R,
    ) {
        self.collision(walker, medium, arrived, rng);
    }

    /// Returns how many copies of a walker go on from a collision, each by itself, and weighs it as one of them; `None` where roulette of little weights is to decide whether one does.
    #[inline]
    fn copies(&mut self, _walker: &mut Walker<N>, _rng: &mut R) -> Option<u32> {
        None
    }

    /// Called for each of them but the last, as it is about to fly on.
    #[inline]
    fn copy(&mut self, _walker: &Walker<N>) {}

    /// Returns a jump that takes the place of a collision and of all flights until near the surface, if there is to be one; [`Tally::collision`] is then not called.
    #[inline]
    fn jump(&mut self, _walker: &Walker<N>, _rng: &mut R) -> Option<Jump<N>> {
        None
    }

    /// Called where a jump has led, before the flight from there in a uniform direction; returns whether this tally looked for light there.
    #[inline]
    fn landed(&mut self, _walker: &Walker<N>, _rng: &mut R) -> bool {
        false
    }

    /// Called where a jump over a ball has led, before the direction of exit is drawn; the walker's weight leaves out that direction and the collisions within the ball.
    #[inline]
    fn exit(&mut self, _walker: &mut Walker<N>, _medium: &Medium<N, P>, _exit: &Exit<N>, _rng: &mut R) {}

    /// Called then with the mean number of collisions that the ball took the place of.
    #[inline]
    fn jumped(&mut self, _walker: &Walker<N>, _medium: &Medium<N, P>, _collisions: f32) {}

    /// Called where lights that chance cannot meet begin to count with a weight, as only a share of the walks look for them from here.
    #[inline]
    fn search(&mut self, _weight: f32) {}

    /// Called after a jump by a bank with the number of collisions besides the one where it began; the walker flies on from where it led. Returns what [`Tally::copies`] does.
    #[inline]
    fn leapt(&mut self, walker: &mut Walker<N>, medium: &Medium<N, P>, collisions: u32, _rng: &mut R) -> Option<u32> {
        self.jumped(walker, medium, collisions as f32);
        None
    }

    /// Called in fields at each tentative collision, and for what a jump passed over, with what is emitted towards the start of the path; `radiance` has its weight.
    #[inline]
    fn emission(&mut self, _walker: &Walker<N>, _radiance: Spectrum<N>) {}

    /// Called in fields at each tentative collision that was none.
    #[inline]
    fn null_collision(&mut self) {}

    /// Returns a distance within which this tally wants to know the wall ahead at the flight about to begin \[length\], however short the flight turns
    /// out. It may depend on where the flight begins and on its direction, not on its length.
    #[inline]
    fn sight(&self, _walker: &Walker<N>) -> f32 {
        0.0
    }

    /// Called where a wall lies ahead within that distance, t away, before the walker moves; whether the flight reaches it is another matter.
    #[inline]
    fn glimpse(&mut self, _walker: &Walker<N>, _medium: &Medium<N, P>, _t: f32, _rng: &mut R) {}

    /// Returns whether this tally looks for light at collisions. If not, directions count as drawn without competition, so
    /// that lights found by chance count in full.
    #[inline]
    fn connects(&self) -> bool {
        false
    }
}

/// Records nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoTally;

impl<const N: usize, R: Random, P> Tally<N, R, P> for NoTally {}

/// Sums the length of all flights \[length\]; of balls jumped over the mean (that of collisions, with which a path's length has the expectation in common).
#[derive(Clone, Copy, Debug, Default)]
pub struct PathLength(pub f64);

impl<const N: usize, R: Random, P> Tally<N, R, P> for PathLength {
    #[inline]
    fn flight(&mut self, _walker: &Walker<N>, t: f32) {
        self.0 += f64::from(t);
    }

    #[inline]
    fn jumped(&mut self, _walker: &Walker<N>, medium: &Medium<N, P>, collisions: f32) {
        self.0 += f64::from(collisions / medium.sigma_t[0]);
    }
}
