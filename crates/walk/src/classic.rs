//! The plain walk: exact, with no other means than flights, collisions and walls.

use moonmilk_core::random::Spread;
use moonmilk_core::{Random, Vec3};

use crate::domain::{Domain, Wall};
use crate::jump::Jumps;
use crate::math;
use crate::medium::Medium;
use crate::phase::PhaseFunction;
use crate::tally::Tally;
use crate::walker::Walker;

/// When walks of little weight end.
///
/// A walk whose weight w (largest lane, radiance scaling undone) fell below `threshold` goes on with probability
/// w / `survivor` and then weighs `survivor`: the mean stays, whatever the numbers.
#[derive(Clone, Copy, Debug)]
pub struct Roulette {
    /// Weight below which a walk is put to the test.
    pub threshold: f32,
    /// Weight of those that pass; not below `threshold`.
    pub survivor: f32,
}

impl Default for Roulette {
    /// Tests below 1/10 and lets survivors weigh 1/5: a convention; where albedos are near 1 walks leave long before.
    fn default() -> Self {
        Self { threshold: 0.1, survivor: 0.2 }
    }
}

impl Roulette {
    /// Returns the factor on a walk's weight, or `None` if it ends.
    #[inline]
    pub fn play(&self, weight: f32, rng: &mut impl Random) -> Option<f32> {
        if weight >= self.threshold {
            return Some(1.0);
        }
        let survival = weight / self.survivor;
        (rng.uniform() < survival).then(|| 1.0 / survival)
    }
}

/// When walks end besides leaving.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Roulette of little weights.
    pub roulette: Roulette,
    /// Value of [`Walker::collisions`] at which a further collision ends the walk: a bias, for reproducing other
    /// renderers' truncation. `u32::MAX` for none.
    pub collisions: u32,
}

impl From<Roulette> for Limits {
    fn from(roulette: Roulette) -> Self {
        Self { roulette, collisions: u32::MAX }
    }
}

/// How a walk ended.
#[derive(Clone, Copy, Debug)]
pub enum Outcome<E> {
    /// It left through a wall; what is behind is the domain's to say.
    Left(E),
    /// Absorbed by weight: roulette ended it, or nothing was left of it.
    Ended,
    /// A position outside the domain was found, which rounding alone can cause; counted, never silent.
    Lost,
}

/// Walks until the path leaves the domain or ends.
///
/// Free flights t = -ln(u) / sigma_t of the hero lane; those shorter than the known room to the wall need no query.
/// *Errors of the result*: none but single-precision rounding of positions.
#[inline]
pub fn walk<const N: usize, P, D, T, R>(
    domain: &D,
    medium: &Medium<N, P>,
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
    walk_with(domain, medium, None, limits, walker, tally, rng)
}

/// Walks as [`walk`] does, but jumps over balls of the medium where there are jumps and there is room for one.
///
/// *Errors of the result*: those of the jumps' table, and rounding.
#[inline]
pub fn walk_with<const N: usize, P, D, T, R>(
    domain: &D,
    medium: &Medium<N, P>,
    jumps: Option<&Jumps<'_, N>>,
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
    let mean_free_path = 1.0 / medium.sigma_t[0];
    let connects = tally.connects();
    let mut on_wall = domain.first();
    // The ball that is walked through for the sake of lights without extent.
    let mut searched: Option<(Vec3, f32)> = None;
    loop {
        // Draw the free flight of the hero lane.
        let u = walker.flight.take().unwrap_or_else(|| rng.uniform());
        let t = math::exponential(u) * mean_free_path;
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
                    walker.pass(medium, t_wall);
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
        walker.p += walker.d * t;
        if !D::CHEAP_SEGMENTS {
            walker.room = (walker.room - t).max(0.0);
        }
        on_wall = domain.start();
        let mut arrived = walker.collide(medium, t);
        walker.collisions += 1;
        if connects || jumps.is_some() {
            walker.room = domain.room(walker.p);
        }
        if !tally.arrives(walker, medium, rng) {
            return Outcome::Ended;
        }

        // Leave a ball of simulated exits, where there is room for one, before anything is done here: what would be looked for is left to chance.
        if let Some((center, radius)) = searched
            && walker.p.distance_squared(center) > radius * radius
        {
            searched = None;
            tally.search(1.0);
        }
        if let Some(jumps) = jumps
            && let Some(bank) = jumps.bank()
            && searched.is_none()
            && let Some((center, room, clear)) = ball(domain, jumps, walker)
            && let Some((level, radius)) = jumps.level(bank, clear)
        {
            walker.beta = arrived;
            jumps.part(walker);
            arrived = walker.beta;
            if jumps.searched() > 0.0 && rng.uniform() < jumps.searched() {
                searched = Some((center, radius));
                tally.search(1.0 / jumps.searched());
            } else {
                let from = walker.p;
                walker.beta = arrived * medium.sigma_s;
                let (n, lost) = jumps.leap(bank, walker, level, (center, radius), rng);
                if let Some(emission) = medium.emission {
                    tally.emission(walker, (arrived * medium.sigma_a + lost) * emission);
                }
                walker.room = (room - radius).max(0.0);
                walker.direction_pdf = None;
                walker.scatter_point = from;
                walker.collisions += n.min(1);
                match tally.leapt(walker, medium, n, rng) {
                    Some(0) => return Outcome::Ended,
                    Some(copies) => (1..copies).for_each(|_| tally.copy(walker)),
                    None => match limits.roulette.play(walker.beta.max_value() * walker.eta_scale, rng) {
                        Some(factor) => walker.beta *= factor,
                        None => return Outcome::Ended,
                    },
                }
                continue;
            }
        }
        let jump = tally.jump(walker, rng);
        walker.beta = arrived * medium.sigma_s;
        match &jump {
            Some(jump) => walker.beta *= jump.weight,
            None => tally.collision(walker, medium, arrived, rng),
        }

        // End walks that carry little, or split those that may find much, keeping the mean.
        let copies = if jump.is_none() && searched.is_none() { tally.copies(walker, rng) } else { None };
        match copies {
            Some(0) => return Outcome::Ended,
            Some(_) => {}
            None => match limits.roulette.play(walker.beta.max_value() * walker.eta_scale, rng) {
                Some(1.0) => {}
                Some(factor) => walker.beta *= factor,
                None => return Outcome::Ended,
            },
        }

        // Go on from where a jump leads, in a uniform direction.
        if let Some(jump) = jump {
            (walker.p, walker.d, walker.room) = (jump.p, jump.d, jump.room);
            walker.scatter_point = jump.p;
            walker.direction_pdf = tally.landed(walker, rng).then_some(0.25 * std::f32::consts::FRAC_1_PI);
            continue;
        }

        // Leave a ball around the collision at once.
        if let Some(jumps) = jumps
            && jumps.bank().is_none()
            && let Some((center, room, clear)) = ball(domain, jumps, walker)
            && let Some(radius) = jumps.radius(clear)
        {
            on_wall = domain.start();
            walker.room = room - radius;
            if rng.uniform() < (-jumps.tau(radius)).exp() {
                // Without a collision the flight that starts here goes on behind the ball.
                let began = walker.p;
                walker.d = math::uniform_sphere(rng.uniform2());
                walker.p = center + walker.d * radius;
                walker.scatter_point = began;
                if jumps.shift().is_some() {
                    walker.direction_pdf = None;
                    continue;
                }
                walker.direction_pdf = connects.then_some(0.25 * std::f32::consts::FRAC_1_PI);
                walker.pass(medium, radius);
                continue;
            }
            let exit = jumps.exit(center, radius, rng);
            exit.enter(walker);
            walker.p = exit.p;
            if connects {
                walker.room = walker.room.max(domain.room(walker.p));
            }
            walker.collisions += 1;
            tally.exit(walker, medium, &exit, rng);
            let pdf = exit.leave(walker, rng);
            tally.jumped(walker, medium, exit.collisions(walker.d));
            walker.direction_pdf = connects.then_some(pdf);
            walker.scatter_point = walker.p;
            match limits.roulette.play(walker.beta.max_value() * walker.eta_scale, rng) {
                Some(factor) => walker.beta *= factor,
                None => return Outcome::Ended,
            }
            continue;
        }

        // Turn by the phase function; the hero's density is every lane's.
        let arrived_along = walker.d;
        let total = copies.unwrap_or(1);
        let mut left = total;
        // Spread the directions of several evenly over the law.
        let mut spread = (total > 1).then(|| Spread::new(rng.uniform2(), total));
        loop {
            let d = match &mut spread {
                Some(spread) => medium.scatter(arrived_along, spread),
                None => medium.scatter(arrived_along, rng),
            };
            if connects {
                walker.direction_pdf = Some(medium.phase(arrived_along, d));
                walker.scatter_point = walker.p;
            } else {
                walker.direction_pdf = None;
            }
            walker.d = d;
            left -= 1;
            if left == 0 {
                break;
            }
            tally.copy(walker);
        }
    }
}

/// Returns the centre of the ball that a jump from a collision may leave, the free room around it, and the radius that is clear of all else around the jumps' point of reference, if that is enough.
#[inline]
fn ball<const N: usize, D: Domain<N>>(
    domain: &D,
    jumps: &Jumps<'_, N>,
    walker: &Walker<N>,
) -> Option<(Vec3, f32, f32)> {
    let [least, most] = jumps.range();
    let (center, room) = match jumps.shift() {
        None => (walker.p, walker.room),
        Some(shift) => {
            let center = walker.p + walker.d * shift;
            // A centre outside has no room.
            (center, if domain.is_outside(center) { 0.0 } else { domain.room(center) })
        }
    };
    let (clear, room) = if jumps.is_common() {
        let clear = domain.clear(center, room, least, most);
        (clear, room.max(clear))
    } else {
        (domain.clear(walker.p, walker.room, least, most), room)
    };
    (clear >= least).then_some((center, room, clear))
}

/// Most lookups that a flight may spend on proving itself free of walls; a wall query costs about as much as thirty.
const LOOKUPS: u32 = 6;
/// Share of a flight that a lookup must prove for the next to be worth while.
const PROGRESS: f32 = 0.125;

/// Returns a distance along the flight that is provably free of walls, at most little more than t.
///
/// Steps from bound to bound: a flight that heads inwards has more room at each step. Each step is shortened by more than
/// the rounding of the point it leads to.
#[inline]
pub(crate) fn march<const N: usize, D: Domain<N>>(domain: &D, walker: &Walker<N>, t: f32) -> f32 {
    let mut free = 0.0;
    for _ in 0..LOOKUPS {
        let room = domain.room(walker.p + walker.d * free);
        free += room * (1.0 - 1e-5);
        if free > t || room < PROGRESS * t {
            break;
        }
    }
    free
}
