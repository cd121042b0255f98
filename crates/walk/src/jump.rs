//! Jumps: exact walks through a medium of isotropic scatterers whose cost does not grow with its density.
//!
//! A collision at the centre of a ball within the medium sends light on in all directions alike, so that by symmetry it leaves the ball at a uniform point, at any azimuth;
//! the cosine of its exit and the number N of collisions on the way have a law that depends on the optical radius tau alone ([`table`]). With probability exp(-tau) there is no collision,
//! and the flight goes on as it was; otherwise the walk goes on from the exit with the weight E\[alpha^N | mu\]: the collisions of the core are summed over, not sampled.
//!
//! *Exact*: the walk is Markov at a collision and flights have no memory, so any ball within the medium may stand in for the walk inside it. The law is that of the transport equation;
//! its table is off by less than 1e-5 of what a jump carries.
//!
//! *Colour*: lanes of different extinction share the ball. The density of lane j is exp(-tau_j) for no collision, else (1 - exp(-tau_j)) p(mu | tau_j); its value has the weight of its
//! albedo besides. p hardly depends on tau, so that the lanes' densities stay close for many jumps, where flights part after some dozens.
//!
//! *Emission*: of the weight beta that enters a ball (1 - alpha^N) beta is lost to absorption, collision by collision; where the medium emits, as much of its source radiance is added. For that N has to be
//! known: media that emit have banks, isotropic ones as well.
//!
//! *Anisotropic*: where scattering is not isotropic, the ball is shifted and its exits come from walks simulated before, drawn anew for every few samples of a picture ([`Bank`]): exact
//! for any law, radius and albedo. No density is known of where such a jump leads, so that connections neither begin where one is taken nor where it ends; light that is met
//! next counts in full. Where there are lights that chance cannot meet, a share of the balls is walked through flight by flight, and what connections to such lights find there counts with the inverse of that share. Lanes of different extinction would need different balls: the hero goes on alone.
//!
//! *Shifted*: an approximation without a bank ([`Jumps::shifted`]) takes the same ball around p + g l* d, for light that arrived along d, and the law of the similar isotropic
//! medium in it. What it neglects decays over a transport mean free path l*.
//!
//! *Source*: walks on spheres \[Muller1956\]; for transport found for moonmilk, not in the literature known to us.

mod bank;
pub mod table;

pub use bank::{Bank, Leap, Part};

use moonmilk_core::{Frame, Random, Spectrum, Vec3};

use crate::math;
use crate::medium::Medium;
use crate::phase::PhaseFunction;
use crate::walker::Walker;

use table::Law;

/// Least radius of a jump [mean free paths of the lane in which they are longest].
///
/// Smaller ones spare flights but leave fewer vertices from which light is looked for. Reference dragon a hundred times as dense, 1, 1.4, 2: variance per sample 1.21, 1.10, 1.11
/// at 1.70, 1.77, 1.93 s; an index-matched ball a hundred times as dense 1.66, 1.52, 1.44 at .44, .43, .46 s. Keeping exits one mean free path below the surface lowers
/// variances by another 3 % for a third more time.
pub const LEAST: f32 = std::f32::consts::SQRT_2;

/// Least radius of a shifted jump [transport mean free paths]: from 2.5 on exits of the shifted ball are uniform to below what can be measured (physics notes, J1.1).
const SHIFTED: f32 = 2.8;
/// Depth of a body from which jumps pay [least radii]. Efficiency by jumps over that by flights: .87 on a ball 14 deep, 1.7 at 140; .9 on a dragon of
/// a mean chord of 10.6 mean free paths, 1.2 ten times as dense.
const THICK: f32 = 20.0;
/// The same where scattering is not isotropic.
const THICK_FORWARD: f32 = 2.0;

/// Share of the balls in which lights without extent are looked for, and what balls then keep from walls [mean free paths]: what is found within weighs at most exp(-4) / .05 of what flights find at a wall.
const SEARCHED: f32 = 0.05;
const MARGIN: f32 = 4.0;

/// What a vertex sends in a direction, lane by lane.
pub trait Scattering<const N: usize> {
    /// Returns value and density [1/sr] of the lanes in a direction of flight.
    fn towards(&self, d: Vec3) -> (Spectrum<N>, Spectrum<N>);

    /// Returns the value of every direction, where all are alike and that is known.
    #[inline]
    fn uniform(&self) -> Option<Spectrum<N>> {
        None
    }

    /// Returns the density of a direction and of getting a distance t on from there, over the transmittance, lane by lane.
    #[inline]
    fn through(&self, d: Vec3, _t: f32) -> Spectrum<N> {
        self.towards(d).1
    }

    /// Draws a direction by the hero's density.
    fn draw(&self, rng: &mut impl Random) -> Vec3;
}

/// A collision: light that flew along `from` is turned by the law of the medium.
#[derive(Clone, Copy, Debug)]
pub struct Turn<'a, const N: usize, P> {
    /// The medium.
    pub medium: &'a Medium<N, P>,
    /// Direction of flight before.
    pub from: Vec3,
}

impl<const N: usize, P: PhaseFunction> Scattering<N> for Turn<'_, N, P> {
    #[inline]
    fn towards(&self, d: Vec3) -> (Spectrum<N>, Spectrum<N>) {
        let phase = Spectrum::splat(self.medium.phase(self.from, d));
        (phase, phase)
    }

    #[inline]
    fn uniform(&self) -> Option<Spectrum<N>> {
        let law = &self.medium.law;
        law.is_isotropic().then(|| Spectrum::splat(law.eval(0.0)))
    }

    fn draw(&self, rng: &mut impl Random) -> Vec3 {
        self.medium.scatter(self.from, rng)
    }
}

/// What jumps in a medium need.
#[derive(Clone, Copy, Debug)]
pub struct Jumps<'a, const N: usize> {
    sigma_t: Spectrum<N>,
    alpha: Spectrum<N>,
    /// ln alpha, with digits where alpha is near 1; for jumps by a bank alone.
    log_alpha: Spectrum<N>,
    gray: bool,
    /// Least and largest radius \[length\].
    least: f32,
    most: f32,
    /// How far ahead of the collision the ball's centre lies \[length\].
    shift: Option<f32>,
    /// Where exits come from if scattering is not isotropic.
    bank: Option<&'a Bank>,
    /// What such balls keep from walls [mean free paths of the hero], and the share of them that is walked through flight by flight.
    margin: f32,
    searched: f32,
}

impl<'a, const N: usize> Jumps<'a, N> {
    /// Returns what jumps by tables need; `None` where there are none: scattering that is not isotropic, emission, extinctions further apart than the table reaches.
    pub fn new<P: PhaseFunction>(medium: &Medium<N, P>) -> Option<Self> {
        let sigma_t = medium.sigma_t;
        let (thin, dense) = (sigma_t.min_value(), sigma_t.max_value());
        if !medium.law.is_isotropic() || medium.emission.is_some() || thin <= 0.0 || thin * table::MOST <= dense * LEAST
        {
            return None;
        }
        let alpha = medium.sigma_s.safe_div(sigma_t);
        Some(Self {
            sigma_t,
            alpha,
            log_alpha: Spectrum::ZERO,
            gray: sigma_t.is_gray(),
            least: LEAST / thin,
            most: table::MOST / dense,
            shift: None,
            bank: None,
            margin: 0.0,
            searched: 0.0,
        })
    }

    /// Returns what jumps by a bank of the medium's law need; `None` where there are none: a bank of another asymmetry, no extinction.
    pub fn from_bank<P: PhaseFunction>(medium: &Medium<N, P>, bank: &'a Bank) -> Option<Self> {
        let sigma_t = medium.sigma_t;
        let thin = sigma_t.min_value();
        if bank.g() != medium.g || thin <= 0.0 {
            return None;
        }
        let gray = sigma_t.is_gray();
        // Whether there is a jump must not depend on the lane that would take it: where they differ, there is one where each lane's ball fits.
        let least = if gray { bank.least() } else { (bank.least() + bank.shift().abs()) * (1.0 + 1e-4) };
        Some(Self {
            sigma_t,
            alpha: medium.sigma_s.safe_div(sigma_t),
            log_alpha: medium.sigma_a.safe_div(sigma_t).map(|x| (-x).ln_1p()),
            gray,
            least: least / thin,
            most: (bank.most() + bank.shift().abs()) / thin,
            shift: Some(bank.shift() / sigma_t[0]),
            bank: Some(bank),
            margin: 0.0,
            searched: 0.0,
        })
    }

    /// Returns the jumps with a share of the balls walked through flight by flight, for lights that chance cannot meet: from collisions within they are looked for with the inverse of that share as weight.
    pub fn searching(self, searches: bool) -> Self {
        if !searches || self.bank.is_none() {
            return self;
        }
        let least = self.least + MARGIN / self.sigma_t.min_value();
        Self { least, most: self.most + MARGIN / self.sigma_t[0], margin: MARGIN, searched: SEARCHED, ..self }
    }

    /// Returns the share of balls that are walked through flight by flight.
    #[inline]
    pub(crate) fn searched(&self) -> f32 {
        self.searched
    }

    /// Returns jumps by the law of the similar isotropic medium, shifted: an approximation where scattering is not isotropic; `None` where [`Jumps::new`] has none.
    pub fn shifted<P: PhaseFunction>(medium: &Medium<N, P>) -> Option<Self> {
        let similar =
            Medium::new(medium.sigma_a, medium.sigma_s * (1.0 - medium.g), 0.0).with_emission(medium.emission);
        let jumps = Self::new(&similar)?;
        let shift = medium.g / similar.sigma_t[0];
        let isotropic = medium.law.is_isotropic();
        Some(if isotropic { jumps } else { Self { least: SHIFTED * jumps.least / LEAST, shift: Some(shift), ..jumps } })
    }

    /// Returns how far ahead of a collision the centre of its ball lies \[length\], if jumps are shifted.
    #[inline]
    pub fn shift(&self) -> Option<f32> {
        self.shift
    }

    /// Returns whether the ball around the collision's shifted point is the same for all lanes, so that its room alone decides.
    #[inline]
    pub(crate) fn is_common(&self) -> bool {
        self.bank.is_none() || self.gray
    }

    /// Returns whether jumps pay in a body that is that deep: in thinner ones walks are too short, and flights look for light at more places.
    ///
    /// *Source*: measured on the reference scenes at 1, 10 and 100 times their density.
    pub fn pays(&self, depth: f32) -> bool {
        match self.bank {
            Some(_) => depth > THICK_FORWARD * self.least,
            None => depth > THICK * self.least,
        }
    }

    /// Returns whether jumps by a bank of the medium's law would pay in a body that is that deep.
    pub fn pays_by_bank<P>(medium: &Medium<N, P>, depth: f32) -> bool {
        depth * medium.sigma_t.min_value() > THICK_FORWARD * bank::radius(medium.g, 0)
    }

    /// Returns the bank of exits, if they come from one.
    #[inline]
    pub(crate) fn bank(&self) -> Option<&'a Bank> {
        self.bank
    }

    /// Returns the level of a bank and the hero's radius \[length\] of a ball that fits into a clear one: of that radius around the ball's own centre where lanes share their extinction, else around
    /// the collision. `None` where there is no room.
    #[inline]
    pub(crate) fn level(&self, bank: &Bank, clear: f32) -> Option<(usize, f32)> {
        let s0 = self.sigma_t[0];
        let clear = if self.gray { clear } else { clear - bank.shift().abs() / s0 };
        // Shortened by more than the rounding of the points that it leads to.
        bank.level(s0 * clear * (1.0 - 1e-5) - self.margin).map(|(level, radius)| (level, radius / s0))
    }

    /// Leaves the hero alone where lanes would take different balls.
    #[inline]
    pub(crate) fn part(&self, walker: &mut Walker<N>) {
        if !self.gray {
            walker.hero_only();
        }
    }

    /// Jumps by a bank from a collision with the weight after it, over a ball of a level. Returns the collisions on the way besides, and the weight that they took away.
    #[inline]
    pub(crate) fn leap(
        &self,
        bank: &Bank,
        walker: &mut Walker<N>,
        level: usize,
        ball: (Vec3, f32),
        rng: &mut impl Random,
    ) -> (u32, Spectrum<N>) {
        let deal = *walker.deal.get_or_insert_with(|| (rng.uniform() * (1 << 23) as f32) as u32);
        let leap = bank.take(level, deal.wrapping_add(walker.collisions), ball, walker.d, rng);
        (walker.p, walker.d) = (leap.p, leap.d);
        if leap.collisions == 0 {
            return (0, Spectrum::ZERO);
        }
        let arrived = walker.beta;
        let logs = self.log_alpha * leap.collisions as f32;
        let first = logs[0].exp();
        walker.beta *= logs.map(|x| if x == logs[0] { first } else { x.exp() });
        (leap.collisions, arrived * logs.map(|x| -x.exp_m1()))
    }

    /// Returns the least and the largest radius of a jump \[length\].
    #[inline]
    pub fn range(&self) -> [f32; 2] {
        [self.least, self.most]
    }

    /// Returns the radius of a jump from a collision that far from all else, for the hero that of a level of the table; `None` where flights do.
    #[inline]
    pub fn radius(&self, clear: f32) -> Option<f32> {
        // Shortened by more than the rounding of the point that it leads to.
        let most = (clear * (1.0 - 1e-5)).min(self.most);
        (most >= self.least)
            .then(|| table::rounded_down(self.sigma_t[0] * most) / self.sigma_t[0])
            .filter(|&r| r >= self.least * (1.0 - 1e-6))
    }

    /// Returns the optical radius of a ball for the hero.
    #[inline]
    pub fn tau(&self, radius: f32) -> f32 {
        self.sigma_t[0] * radius
    }

    /// Returns where light leaves a ball around p.
    pub fn exit(&self, p: Vec3, radius: f32, rng: &mut impl Random) -> Exit<N> {
        let normal = math::uniform_sphere(rng.uniform2());
        let hero = Law::of_level(table::rounded_down(self.sigma_t[0] * radius * (1.0 + 1e-5)));
        let laws = std::array::from_fn(|k| if k == 0 || self.gray { hero } else { Law::new(self.sigma_t[k] * radius) });
        Exit { p: p + normal * radius, normal, laws, alpha: self.alpha, gray: self.gray }
    }
}

/// The surface of a ball at the point of exit: a vertex with a scattering law of its own.
#[derive(Clone, Copy, Debug)]
pub struct Exit<const N: usize> {
    /// The point.
    pub p: Vec3,
    normal: Vec3,
    laws: [Law; N],
    alpha: Spectrum<N>,
    gray: bool,
}

impl<const N: usize> Exit<N> {
    /// Returns the density over v of every lane, and the weight of its collisions.
    fn lanes(&self, v: f32) -> (Spectrum<N>, Spectrum<N>) {
        let hero = self.laws[0].density(v);
        let density = Spectrum::from_fn(|k| if k == 0 || self.gray { hero } else { self.laws[k].density(v) });
        let first = self.laws[0].weight(v, self.alpha[0]);
        let same = |k: usize| k == 0 || self.gray && self.alpha[k] == self.alpha[0];
        let weight = Spectrum::from_fn(|k| if same(k) { first } else { self.laws[k].weight(v, self.alpha[k]) });
        (density, weight)
    }

    /// Weighs a walker for having collided in the ball at all, all but the direction of exit.
    #[inline]
    pub(crate) fn enter(&self, walker: &mut Walker<N>) {
        if N == 1 || self.gray {
            return;
        }
        let collided = |k: usize| -(-self.laws[k].tau()).exp_m1();
        let relative = Spectrum::from_fn(|k| collided(k) / collided(0));
        walker.beta *= relative;
        walker.ratio *= relative;
        walker.renormalize();
    }

    /// Draws the direction of exit and weighs the walker for it; returns its mean density [1/sr].
    #[inline]
    pub(crate) fn leave(&self, walker: &mut Walker<N>, rng: &mut impl Random) -> f32 {
        let u = rng.uniform2();
        let v = self.laws[0].sample(u[0]);
        walker.d = around(self.normal, v, u[1]);
        let (density, weight) = self.lanes(v);
        let mut pdf = density[0];
        if N > 1 && !self.gray {
            let relative = density * (1.0 / density[0]);
            walker.beta *= relative;
            walker.ratio *= relative;
            pdf *= walker.renormalize();
        }
        walker.beta *= weight;
        pdf * per_steradian(v)
    }

    /// Returns E\[N\] for a direction of exit, of the hero, without absorption.
    pub fn collisions(&self, d: Vec3) -> f32 {
        self.laws[0].collisions(turned(d.dot(self.normal)))
    }
}

/// d v / d omega: mu = 1 - v^2 at any azimuth.
#[inline]
fn per_steradian(v: f32) -> f32 {
    0.25 * std::f32::consts::FRAC_1_PI / v.max(1e-4)
}

/// Returns v of a cosine.
#[inline]
fn turned(mu: f32) -> f32 {
    (1.0 - mu).max(0.0).sqrt()
}

/// Returns the direction at a v from a normal.
#[inline]
fn around(n: Vec3, v: f32, turn: f32) -> Vec3 {
    // sin^2 = 1 - (1 - v^2)^2 = v^2 (2 - v^2).
    let sin = v * (2.0 - v * v).sqrt();
    let (s, c) = math::sin_cos_turn(turn);
    let f = Frame::new(n);
    (f.s * (sin * c) + f.t * (sin * s) + n * (1.0 - v * v)).normalize()
}

impl<const N: usize> Scattering<N> for Exit<N> {
    #[inline]
    fn towards(&self, d: Vec3) -> (Spectrum<N>, Spectrum<N>) {
        let mu = d.dot(self.normal);
        if mu <= 0.0 {
            return (Spectrum::ZERO, Spectrum::ZERO);
        }
        let v = turned(mu);
        let (density, weight) = self.lanes(v);
        let density = density * per_steradian(v);
        (density * weight, density)
    }

    fn draw(&self, rng: &mut impl Random) -> Vec3 {
        let u = rng.uniform2();
        around(self.normal, self.laws[0].sample(u[0]), u[1])
    }
}
