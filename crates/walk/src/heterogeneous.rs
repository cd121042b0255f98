//! The walk through a [`Field`]: null collisions under a majorant \[Woodcock1965\], with one majorant for all lanes.
//!
//! Tentative collisions come with the density sigma_maj of an upper bound; each is real with probability sigma_t / sigma_maj of
//! the hero, else null, and the flight goes on. Positions of null collisions are part of the path \[Miller2019\]: lane j would
//! have drawn the same ones with the factors sigma_t,j / sigma_maj and 1 - sigma_t,j / sigma_maj. As the majorant is the same in every lane, its
//! exponentials cancel, and what remains are these factors: in [`Walker::beta`] over their mean, in [`Walker::ratio`], and in the density
//! with which chance competes with light sampling. Ratio tracking ([`transmittance`]) draws the same positions with probability 1,
//! so the product of 1 - sigma_t / sigma_maj is both its estimate and the relative density of chance: the balance heuristic
//! between the two needs no transmittance in closed form. Without colour nothing is weighed at all: a conservative walk keeps its weight.

use moonmilk_core::{Random, Spectrum, Vec3};

use crate::classic::{Limits, Outcome, Roulette};
use crate::domain::{Domain, Wall};
use crate::field::Field;
use crate::math;
use crate::tally::Tally;
use crate::walker::Walker;

/// Walks until the path leaves the domain or ends; `Left(None)`: no wall and no matter is in its way any more.
///
/// *Errors of the result*: none but single-precision rounding of positions.
pub fn walk<const N: usize, F, D, T, R>(
    domain: &D,
    field: &F,
    limits: &Limits,
    walker: &mut Walker<N>,
    tally: &mut T,
    rng: &mut R,
) -> Outcome<Option<D::Exit>>
where
    F: Field<N>,
    D: Domain<N>,
    T: Tally<N, R>,
    R: Random,
{
    let (majorants, factor) = field.majorants();
    let (scatters, emits, connects) = (field.scatters(), field.emits(), tally.connects());
    let mut on_wall = domain.first();
    'flights: loop {
        let mut track = majorants.track(walker.p, walker.d);
        let mut sight = Sight { ball: walker.room, clear: 0.0, wall: None };
        loop {
            // Go to the next tentative collision, or to the wall before it.
            let next = track.advance(math::exponential(rng.uniform()), factor);
            let t = next.map_or(f32::INFINITY, |n| n.0);
            if let Some((t_wall, wall)) = sight.look(domain, walker, t, &on_wall) {
                tally.flight(walker, t_wall);
                walker.room = 0.0;
                match domain.arrive(wall, t_wall, walker, rng) {
                    Wall::Stay(w) => {
                        on_wall = w;
                        continue 'flights;
                    }
                    Wall::Leave(exit) => return Outcome::Left(Some(exit)),
                }
            }
            let Some((t, majorant)) = next else {
                // Nothing is in the way: outside a closed domain that is the sky, inside it rounding.
                let lost = domain.is_outside(walker.p + walker.d * FAR);
                return if lost { Outcome::Lost } else { Outcome::Left(None) };
            };
            let p = walker.p + walker.d * t;
            let (sigma_a, sigma_s) = field.at(p, rng);
            let sigma_t = sigma_a + sigma_s;
            if emits {
                tally.emission(walker, walker.beta * sigma_a * field.emission(p) * (1.0 / majorant));
            }
            let kept = passed(sigma_t, majorant);
            if !scatters {
                // Attenuate: the path goes on in any case, and no density changes.
                tally.null_collision();
                walker.beta *= kept;
                match limits.roulette.play(walker.beta.max_value() * walker.eta_scale, rng) {
                    Some(1.0) => {}
                    Some(factor) => walker.beta *= factor,
                    None => return Outcome::Ended,
                }
                continue;
            }
            if rng.uniform() * majorant >= sigma_t[0] {
                tally.null_collision();
                pass(walker, kept);
                continue;
            }
            if domain.is_outside(p) {
                return Outcome::Lost;
            }
            if walker.collisions >= limits.collisions {
                return Outcome::Ended;
            }

            // Move to the collision and weigh what is scattered there.
            tally.flight(walker, t);
            walker.p = p;
            walker.room = (sight.ball - t).max(0.0);
            on_wall = domain.start();
            let arrived = collide(walker, sigma_t);
            walker.collisions += 1;
            let medium = field.local(sigma_a, sigma_s);
            tally.collision(walker, &medium, arrived, rng);
            walker.beta = arrived * sigma_s;
            match limits.roulette.play(walker.beta.max_value() * walker.eta_scale, rng) {
                Some(1.0) => {}
                Some(factor) => walker.beta *= factor,
                None => return Outcome::Ended,
            }

            // Turn by the phase function; the hero's density is every lane's.
            let d = medium.scatter(walker.d, rng);
            if connects {
                walker.direction_pdf = Some(medium.phase(walker.d, d));
                walker.scatter_point = walker.p;
            } else {
                walker.direction_pdf = None;
            }
            walker.d = d;
            continue 'flights;
        }
    }
}

/// A distance beyond any scene, of which single precision holds the square.
const FAR: f32 = 1e18;

/// What ratio tracking found on a straight way.
#[derive(Clone, Copy, Debug)]
pub struct Passage<const N: usize> {
    /// Product of 1 - sigma_t / sigma_maj over all null collisions: with mean exp(-integral of sigma_t), in [0, 1].
    pub transmittance: Spectrum<N>,
    /// Factor of roulette, 0 if it ended the search. The estimate is the product of both.
    pub survival: f32,
    /// Number of look-ups.
    pub collisions: u32,
}

/// Estimates the transmittance per lane from p along d over a distance by ratio tracking \[Novak2014\].
///
/// `weight` is the largest transmittance already found on the same way: roulette judges the product.
pub fn transmittance<const N: usize, F: Field<N>, R: Random>(
    field: &F,
    p: Vec3,
    d: Vec3,
    distance: f32,
    weight: f32,
    roulette: &Roulette,
    rng: &mut R,
) -> Passage<N> {
    let (majorants, factor) = field.majorants();
    let mut track = majorants.track(p, d);
    let mut found = Passage { transmittance: Spectrum::ONE, survival: 1.0, collisions: 0 };
    while let Some((t, majorant)) = track.advance(math::exponential(rng.uniform()), factor) {
        if t >= distance {
            break;
        }
        found.collisions += 1;
        let (sigma_a, sigma_s) = field.at(p + d * t, rng);
        found.transmittance *= passed(sigma_a + sigma_s, majorant);
        match roulette.play(found.transmittance.max_value() * found.survival * weight, rng) {
            Some(1.0) => {}
            Some(factor) => found.survival *= factor,
            None => {
                found.survival = 0.0;
                break;
            }
        }
    }
    found
}

/// Returns 1 - sigma_t / sigma_maj per lane; rounding alone can make that negative.
#[inline]
fn passed<const N: usize>(sigma_t: Spectrum<N>, majorant: f32) -> Spectrum<N> {
    let inverse = 1.0 / majorant;
    sigma_t.map(|s| (1.0 - s * inverse).max(0.0))
}

/// Applies the weights of a null collision.
#[inline]
fn pass<const N: usize>(walker: &mut Walker<N>, kept: Spectrum<N>) {
    let mut mean = kept[0];
    if N > 1 && !kept.is_gray() {
        walker.beta *= kept;
        walker.ratio *= kept;
        mean = walker.renormalize();
    }
    // Light sampling competes with having got through.
    if let Some(pdf) = &mut walker.direction_pdf {
        *pdf *= mean;
    }
}

/// Applies the weights of a real collision, without the factor sigma_s or sigma_a: returns beta over the lanes' mean sigma_t.
#[inline]
fn collide<const N: usize>(walker: &mut Walker<N>, sigma_t: Spectrum<N>) -> Spectrum<N> {
    if N == 1 || sigma_t.is_gray() {
        return walker.beta / sigma_t[0];
    }
    walker.ratio *= sigma_t;
    walker.renormalize();
    walker.beta
}

/// What is known of the walls along one flight.
struct Sight<W> {
    /// End of the last ball without walls around a point of the flight.
    ball: f32,
    /// Distance that is known to be free by casting.
    clear: f32,
    /// The first wall, if it is known.
    wall: Option<(f32, W)>,
}

impl<W: Copy> Sight<W> {
    /// Returns the first wall before distance t.
    #[inline]
    fn look<const N: usize, D: Domain<N, Wall = W>>(
        &mut self,
        domain: &D,
        walker: &Walker<N>,
        t: f32,
        from: &W,
    ) -> Option<(f32, W)> {
        if t < self.ball || t < self.clear {
            return None;
        }
        if self.wall.is_none() {
            if t < f32::INFINITY {
                self.ball = march(domain, walker, self.ball, t);
                if t < self.ball {
                    return None;
                }
            }
            // Look twice as far as needed: a flight of n null collisions then casts log n rays.
            let reach = 2.0 * t;
            self.wall = domain.segment(walker.p, walker.d, reach, from);
            self.clear = self.wall.map_or(reach, |w| w.0);
        }
        self.wall.filter(|w| t >= w.0)
    }
}

/// Most look-ups per tentative collision, as in the classic walk.
const LOOKUPS: u32 = 6;
/// Share of the way that a look-up must prove for the next to be worth while.
const PROGRESS: f32 = 0.125;

/// Returns a distance that is provably free of walls, at most little more than t, given that `free` is.
#[inline]
fn march<const N: usize, D: Domain<N>>(domain: &D, walker: &Walker<N>, mut free: f32, t: f32) -> f32 {
    for _ in 0..LOOKUPS {
        let room = domain.room(walker.p + walker.d * free);
        free += room * (1.0 - 1e-5);
        if free > t || room < PROGRESS * t {
            break;
        }
    }
    free
}
