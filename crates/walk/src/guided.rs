//! The guided walk: as exact as the plain one, with less noise where much is absorbed.
//!
//! Both strategies of [`crate::guide`] run through the same loop; they differ in what they draw from, not in what is recorded or weighed.
//! Everything that decides how a walk may lean (where it is, where the wall is near) depends on the path alone, never on the strategy: only so the weights are those of both.

use moonmilk_core::Random;

use crate::classic::{Limits, Outcome, march};
use crate::domain::{Domain, Wall};
use crate::guide::{Guide, Leaning};
use crate::math;
use crate::medium::Medium;
use crate::phase::PhaseFunction;
use crate::tally::Tally;
use crate::walker::Walker;

/// How much less than plain walks guided ones may weigh before roulette: most of them weigh about what leaves the body at all.
///
/// Thresholds .1, .05 and .02 of the weight: half-space of alpha .8 behind a boundary of index 1.4, efficiency 7.7, 7.3 and 6.8 times that of plain walks; alpha .3, g .9: 6.1 at .1 and 12 at .02.
const LIGHTER: f32 = 2.0;

/// Walks as [`crate::walk`] does, by the strategy that the walker was given ([`Walker::choose_strategy`]).
///
/// *Errors of the result*: none but rounding.
#[inline]
pub fn walk<const N: usize, P, D, T, R>(
    domain: &D,
    medium: &Medium<N, P>,
    guide: &Guide<N>,
    limits: &Limits,
    walker: &mut Walker<N>,
    tally: &mut T,
    rng: &mut R,
) -> Outcome<D::Exit>
where
    P: PhaseFunction,
    D: Domain<N>,
    T: Tally<N, R, P>,
    R: Random,
{
    let connects = tally.connects();
    let mut on_wall = domain.first();
    // A direction that light sampling competes with was drawn outside, where nothing is known of this guide.
    let mut lean = guide.lean(if walker.direction_pdf.is_none() { domain.entry(walker.p, walker.d) } else { None });
    loop {
        // Draw the free flight of the hero lane.
        let t = math::exponential(rng.uniform()) / lean.sigma(medium, walker.d, walker.guided);
        let sight = tally.sight(walker);
        // Skip the wall query where the flight provably ends before any wall.
        if D::CHEAP_SEGMENTS || t >= walker.room || sight > 0.0 {
            if !D::CHEAP_SEGMENTS && sight == 0.0 {
                walker.room = march(domain, walker, t);
            }
            if D::CHEAP_SEGMENTS || t >= walker.room || sight > 0.0 {
                let ahead = domain.segment(walker.p, walker.d, t.max(sight), &on_wall);
                if let Some((t_wall, _)) = ahead
                    && t_wall <= sight
                {
                    tally.glimpse(walker, medium, t_wall, rng);
                }
                if let Some((t_wall, wall)) = ahead
                    && t_wall <= t
                {
                    tally.flight(walker, t_wall);
                    lean.passed(walker, medium, t_wall);
                    walker.room = 0.0;
                    match domain.arrive(wall, t_wall, walker, rng) {
                        Wall::Stay(w) => {
                            on_wall = w;
                            continue;
                        }
                        Wall::Leave(exit) => return Outcome::Left(exit),
                    }
                }
                if t == f32::INFINITY || domain.is_outside(walker.p + walker.d * t) {
                    return Outcome::Lost;
                }
            }
        }
        if walker.collisions >= limits.collisions {
            return Outcome::Ended;
        }

        // Move to the collision and weigh what is scattered there.
        tally.flight(walker, t);
        lean.collided(walker, medium, t);
        walker.p += walker.d * t;
        on_wall = domain.start();
        let arrived = walker.beta;
        walker.collisions += 1;
        walker.room = domain.room(walker.p);
        walker.beta = arrived * medium.sigma_s;
        lean = guide.lean(domain.outward(walker.p, walker.room));
        let leaning = Leaning { medium, from: walker.d, lean, odds: walker.odds };
        tally.leaning(walker, medium, arrived, &leaning, rng);

        // End walks that carry little, keeping the mean.
        match limits.roulette.play(LIGHTER * walker.beta.max_value() * walker.eta_scale, rng) {
            Some(factor) => walker.beta *= factor,
            None => return Outcome::Ended,
        }

        // Turn by either law.
        let from = walker.d;
        walker.d = if walker.guided { lean.draw(medium, from, rng) } else { medium.scatter(from, rng) };
        let density = lean.turned(walker, medium, from);
        walker.direction_pdf = None;
        if connects {
            walker.direction_pdf = Some(medium.phase(from, walker.d) * density);
            walker.scatter_point = walker.p;
        }
    }
}
