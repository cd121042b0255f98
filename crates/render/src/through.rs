//! Light through a smooth refractive boundary: connections that chance alone would find once in fifty tries.
//!
//! From a collision point c inside a body no straight line reaches a light outside. But the light that a *plane* of the body's
//! index would refract to c comes from directions that are known in closed form, and near the surface the body is almost that
//! plane. So a direction is drawn from the refracted light of a local frame (x0, n0), and then traced exactly: through the real
//! surface, refracted there, to whatever it meets. Where frame and surface disagree the connection misses; nothing is biased.
//!
//! *Density.* A light direction w_i at x0 of density p_L corresponds to the inside direction w with
//! n0-cosines c_i (outside) and c_t (inside), and by Snell's law differentiated
//!
//! $$ p_F(\omega) = p_L(\omega_i)\, \frac{\eta^2 c_t}{c_i} . $$
//!
//! p_L is a mixture: a point of a light's surface, or a direction from the bright part of an environment ([`crate::lights`], `aimed`).
//!
//! Where the surface is rougher than the mean free path a plane is too simple; a share of the directions is drawn from a lobe around the
//! light's. Without it one chance hit in four was on its own, and these made two thirds of the marble dragon's noise.
//!
//! *Looks.* A flight that begins near the surface and may lead to a light is followed to the wall, however short it turns out, and what its
//! refracted continuations meet counts with the probability of getting there. So chance has the density p_c(w) alone, not p_c(w) exp(-sigma_t s) P; the
//! light that such a flight meets after really leaving counts no more. Whether a flight looks depends on where it begins and on its direction, never on its length.
//!
//! *Competition.* The walk finds the same paths by chance, with density p_c(w) exp(-sigma_t s) times the probability P of
//! refraction. Both strategies are shared by the balance heuristic, P being common to both: with P the total probability of the
//! boundary's transmitted outcomes, the connection counts
//! beta p_c T P' L / (p_F / P + p_c T), the chance hit p_c T / (p_F / P + p_c T); against looks, an outcome of probability P' counts
//! beta p_c T P' L / (p_F P' / P + p_c) by either. Every term is at most beta L: no fireflies.
//!
//! *Which flights.* Those that start at a collision, arrive at the body's own boundary within [`REACH`] mean free paths, and
//! whose refracted ray meets a light, or nothing but an environment, at once or through clear bodies (`through/onward.rs`). Others are found by chance (or a look) alone and count in full.
//!
//! *Cost.* A connection is made with probability q at a collision, the less the deeper it lies; q multiplies p_F everywhere. The
//! frame is a function of the collision point and of random numbers drawn there, so that a chance hit, which is rare, can make
//! the frame of its flight afterwards.
//!
//! Lights with a surface take part, and environments that are not even: these count as a whole, at the end of every ray that meets nothing else, and what is even stays with chance, weight
//! and all. Lamps of opacity 0 are found where rays pass them. Lights without extent are solved for ([`crate::manifold`]).

use moonmilk_core::{Random, Sampler, Spectrum, Stream, Vec3, Wavelengths};
use moonmilk_geometry::{Facing, Hit, Ray};
use moonmilk_walk::jump::{self, Scattering};
use moonmilk_walk::{Medium, Walker};

use crate::bsdf::Crossing;
use crate::bsdf::boundary::branches;
use crate::integrator::{Counters, Light, balance};
use crate::lights::Target;
use crate::media::Matter;
use crate::nest::{Inside, Meeting, Nest};
use crate::scene::{Boundary, Scene};

mod frame;
mod onward;

use frame::{Aim, Frame};
pub(crate) use onward::{Within, is_clear, transmit, transmitted};

/// Longest flight that connections and looks compete for [mean free paths of the hero]; longer ones carry exp(-8) and are left to chance.
const REACH: f32 = 8.0;
/// Longest way to the frame [mean free paths]; straight lines to a light are longer than bent ones. On the marble dragon 2, 4, 8, 16
/// leave a variance of .30, .24, .21, .21.
const FRAME_REACH: f32 = 8.0;
/// Depth at which connections become rarer [mean free paths].
const SHALLOW: f32 = 0.5;
/// Optical depth at which a connection is a twentieth as probable as at the surface, and beyond which none is made.
const DEEP: f32 = SHALLOW + 3.0;
/// Probability of a connection near the surface. On the marble dragon .05, .1, .2 leave a variance per sample of 2.07, 1.75, 1.52 at CPU
/// times of .83, .89, 1.16 s: what is left is mostly the walk's own.
const MOST: f32 = 0.1;
/// Optical depth down to which flights look for light: on the dragon .3, 1, 2 leave 1.95, 1.75, 1.68 at .94, .89, 1.07 s.
const LOOK_DEPTH: f32 = 1.0;
// Flights that cross a ball began too deep to look: what they meet is found by chance, with the density that connections reckon with.
const _: () = assert!(LOOK_DEPTH <= jump::LEAST);
/// How far they look [mean free paths of the hero]: 2, 4, 6 leave 1.99, 1.75, 1.74 at .89, .89, .99 s.
const LOOK_REACH: f32 = 4.0;
/// Rounds of looking along the refracted way, for light from infinity, which may be a sun. A ball of milk under one of 160, 10 and .16 square degrees, 1 and 2 rounds: variance per sample
/// 6.2 and 5.6, 61 and 48, above 1000 and about 110, at 13.5 and 15 rays.
const SUN_ROUNDS: u32 = 2;
/// Cosine between the normals of two rounds above which they are the same for a sun: a quarter of a degree.
const SETTLED: f32 = 0.99999;

/// A collision near the surface: all that its aim depends on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    p: Vec3,
    /// Probability of a connection.
    q: f32,
    /// Key of the aim's variates.
    key: u64,
    /// Whether its flight looks for light through the wall ahead.
    looks: bool,
}

/// Where a flight began.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Start {
    /// At a wall, where the walk began, or where a jump led near the surface.
    Wall,
    /// At a collision too deep for connections, or where a jump led as deep.
    Deep,
    /// At a collision near the surface.
    Near(Near),
}

/// Returns where a flight begins that a jump led to, at a depth [mean free paths of the hero]: nothing was looked for there, so that what it meets counts in full.
pub(crate) fn landed(depth: f32) -> Start {
    if depth <= LOOK_DEPTH { Start::Wall } else { Start::Deep }
}

/// The boundary ahead of a flight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ahead {
    pub hit: Hit,
    /// Distance to it.
    pub t: f32,
    pub p: Vec3,
    pub ng: Vec3,
    /// Normal of refraction.
    pub ns: Vec3,
}

/// A path that left through a smooth boundary, and what else has found the light that it leads to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Escape {
    rival: Rival,
    /// Boundaries and lamps of opacity 0 that it has passed since.
    passed: u32,
}

/// What else has found the light that a path leads to.
#[derive(Clone, Copy, Debug)]
enum Rival {
    /// The look of its last flight counted that light.
    Seen,
    /// Connections compete.
    Chance {
        object: u32,
        index: f32,
        sigma_t: f32,
        start: Near,
        /// Direction of the last flight inside.
        omega: Vec3,
        /// p_c T: density of that direction times the mean probability of getting through.
        pdf: f32,
        /// Total probability of the transmitted outcomes, of the body's own boundary and all since.
        transmitted: f32,
    },
}

impl Escape {
    /// Returns the share of a light that this path met by chance.
    pub fn share<const N: usize>(&self, scene: &Scene, w: &Wavelengths<N>, counters: &mut Counters) -> f32 {
        match self.rival {
            Rival::Seen => 0.0,
            Rival::Chance { object, index, sigma_t, start, omega, pdf, transmitted } => {
                let through = Through::of(scene, object, index, index, sigma_t);
                let aim = through.aim(&start, w, counters);
                aim.map_or(1.0, |a| balance(pdf, start.q * a.density(scene, omega) / transmitted))
            }
        }
    }

    /// Returns the same beyond a boundary with that total probability of transmission, or a lamp of opacity 0 (1); `None` where nothing else leads there.
    pub fn beyond(mut self, total: f32) -> Option<Self> {
        self.passed += 1;
        if let Rival::Chance { transmitted, .. } = &mut self.rival {
            *transmitted *= total;
        }
        (self.passed <= onward::MOST).then_some(self)
    }
}

fn is_transmitted(c: &Crossing) -> bool {
    matches!(c, Crossing::Transmitted(_))
}

/// A body whose boundary connections go through.
#[derive(Clone, Copy)]
pub(crate) struct Through<'a> {
    scene: &'a Scene,
    object: u32,
    /// Relative index of the boundary.
    eta: f32,
    /// The body's index against vacuum: what parallel walls around it leave of all refraction.
    index: f32,
    /// Extinction of the hero.
    sigma_t: f32,
    /// Sine and cosine of the largest angle by which the boundary bends light.
    bend: (f32, f32),
}

impl<'a> Through<'a> {
    fn of(scene: &'a Scene, object: u32, eta: f32, index: f32, sigma_t: f32) -> Self {
        // At the critical angle: a right angle less its arc sine.
        let cos = index.min(1.0 / index);
        Self { scene, object, eta, index, sigma_t, bend: ((1.0 - cos * cos).sqrt(), cos) }
    }

    /// Returns the connections of the body that counts where a path is, or `None` where they cannot work: no body, no smooth
    /// boundary, no lights to aim at, lights inside (sampled there), a medium outside that scatters.
    pub fn new<const N: usize>(
        scene: &'a Scene,
        nest: &Nest,
        medium: &Medium<N>,
        ambient: Option<&Matter<N>>,
        wavelengths: &Wavelengths<N>,
    ) -> Option<Self> {
        let Inside { shape, index, point, .. } = *nest.bodies().last()?;
        let o = &scene.objects[shape as usize];
        let (Boundary::Smooth { eta }, Meeting::True(outer)) = (o.boundary, nest.meet(o, shape, true)) else {
            return None;
        };
        let possible = o.body.is_some() && !o.connects && scene.lights.has_aims() && medium.sigma_t[0] > 0.0;
        if !possible || eta == outer {
            return None;
        }
        let outside = if nest.bodies().len() == 1 {
            scene.medium_outside(o, wavelengths, ambient.copied())
        } else {
            let (mut medium, mut ambient) = (None, ambient.copied());
            nest.clone().cross(scene, shape, true, &point, wavelengths, &mut medium, &mut ambient);
            medium
        };
        // By the index against what is around all bodies; one body's own may be relative.
        let index = if nest.bodies().len() == 1 { eta / outer } else { index };
        (is_clear(&outside) && index != 1.0).then(|| Self::of(scene, shape, eta / outer, index, medium.sigma_t[0]))
    }

    /// Returns the longest flight that connections compete for \[length\].
    pub fn reach(&self) -> f32 {
        REACH / self.sigma_t
    }

    /// Casts a segment from a point inside; returns the hit if it is an exit through the body's own boundary.
    fn exit(&self, p: Vec3, d: Vec3, limit: f32, counters: &mut Counters) -> Option<(Ray, Hit)> {
        counters.segments += 1;
        let body = self.scene.objects[self.object as usize].body?;
        let ray = Ray::new(p, d).up_to(limit).facing(Facing::Exiting(body));
        self.scene.accel.nearest(&ray).filter(|h| h.shape == self.object && h.exiting).map(|h| (ray, h))
    }

    /// Returns how far a flight from p along d looks for the wall: 0 where it begins too deep or no refraction can lead to a light.
    #[inline]
    pub fn sight(&self, start: &Start, p: Vec3, d: Vec3) -> f32 {
        let begins = matches!(start, Start::Wall | Start::Near(Near { looks: true, .. }));
        let reach = LOOK_REACH / self.sigma_t;
        let lights = &self.scene.lights;
        let leads = || lights.surface_within(p, d, reach, self.bend) || lights.sun_within(d, self.bend);
        if begins && leads() { reach } else { 0.0 }
    }

    /// Returns what is known of a flight that went a length t from p, where it began or left a ball, along omega that arrived with density `pdf` and is about to be refracted.
    pub fn escape(
        &self,
        start: Start,
        p: Vec3,
        t: f32,
        omega: Vec3,
        pdf: Option<f32>,
        ng: Vec3,
        ns: Vec3,
    ) -> Option<Escape> {
        if t <= self.sight(&start, p, omega) {
            return Some(Escape { rival: Rival::Seen, passed: 0 });
        }
        match (start, pdf) {
            // A flight that crossed a ball began before it.
            (Start::Near(start), Some(pdf)) if t + p.distance(start.p) <= self.reach() => {
                let transmitted = transmitted(-omega, ng, ns, self.eta);
                let (object, index, sigma_t) = (self.object, self.index, self.sigma_t);
                let rival = Rival::Chance { object, index, sigma_t, start, omega, pdf, transmitted };
                Some(Escape { rival, passed: 0 })
            }
            _ => None,
        }
    }

    /// Aims from a collision; `None` where there is no light.
    fn aim<const N: usize>(&self, start: &Near, w: &Wavelengths<N>, counters: &mut Counters) -> Option<Aim> {
        let limit = FRAME_REACH / self.sigma_t;
        let mut keyed = Stream::new(&[start.key]);
        let u = [keyed.uniform(), keyed.uniform(), keyed.uniform()];
        let target = self.scene.lights.aim(start.p, None, w, u)?;
        let at = |(ray, hit): (Ray, Hit)| {
            let s = self.scene.accel.surface(&ray, &hit);
            let n = self.scene.boundary_normal(&self.scene.objects[hit.shape as usize], &s);
            Frame { x: s.p, n, prim: hit.prim, eta: self.index }
        };
        // Look straight towards a point of a light, then again along the refracted way to it.
        let Some(mut frame) = self.exit(start.p, target.wi, limit, counters).map(at) else {
            return Some(Aim { frame: None, axis: target.wi });
        };
        let mut axis = target.wi;
        let rounds = if matches!(target.target, Target::Direction(_)) { SUN_ROUNDS } else { 1 };
        for _ in 0..rounds {
            let towards = match target.target {
                Target::Point(q) => (q - frame.x).normalize(),
                Target::Direction(d) => d,
            };
            let Some((inside, _)) = frame.inside(towards) else { break };
            axis = inside;
            let Some(next) = self.exit(start.p, axis, limit, counters).map(at) else { break };
            let settled = next.n.dot(frame.n) > SETTLED;
            frame = next;
            if settled {
                break;
            }
        }
        Some(Aim { frame: Some(frame), axis })
    }

    /// Looks along the refracted continuations of a flight for light: what leaves there by chance, counted with its probability instead.
    pub fn look<const N: usize, P>(
        &self,
        walker: &Walker<N>,
        medium: &Medium<N, P>,
        start: &Start,
        at: &Ahead,
        within: &Within<'_, N>,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) {
        let outcomes = branches(-walker.d, at.ng, at.ns, self.eta);
        for (p, c) in outcomes.iter().filter(|b| is_transmitted(&b.1) && b.0 > 0.0) {
            let mut sum = Spectrum::ZERO;
            self.lights_beyond(&at.hit, at.p, c.direction(), within, w, rng, counters, |radiance, further| {
                sum += radiance * further;
            });
            if sum.is_black() {
                continue;
            }
            let share = match (start, walker.direction_pdf) {
                (Start::Near(start), Some(pdf)) => self.aim(start, w, counters).map_or(1.0, |aim| {
                    let transmitted: f32 = outcomes.iter().filter(|b| is_transmitted(&b.1)).map(|b| b.0).sum();
                    balance(pdf, start.q * aim.density(self.scene, walker.d) * p / transmitted)
                }),
                _ => 1.0,
            };
            // Leaving multiplies radiance by the squared index.
            let value = walker.beta * medium.transmittance(at.t) * sum * (self.eta * self.eta * p * share);
            light.add(walker.collisions, value);
        }
    }

    /// Makes a connection at a collision, or not; returns what the next flight competes with.
    ///
    /// `beta` is the weight after the collision, scattering coefficient included; `room` a lower bound of the depth.
    pub fn connect<const N: usize, P>(
        &self,
        walker: &Walker<N>,
        medium: &Medium<N, P>,
        beta: Spectrum<N>,
        vertex: &impl Scattering<N>,
        room: f32,
        within: &Within<'_, N>,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> Start {
        let depth = self.sigma_t * room;
        if depth > DEEP {
            return Start::Deep;
        }
        let q = if depth <= SHALLOW { MOST } else { MOST * (SHALLOW - depth).exp() };
        let start = Near { p: walker.p, q, key: rng.stream().bits(), looks: depth <= LOOK_DEPTH };
        if rng.uniform() < q
            && let Some(aim) = self.aim(&start, w, counters)
            && let Some(radiance) = self.sample(&aim, &start, walker, medium, beta, vertex, within, w, rng, counters)
        {
            light.add(walker.collisions, radiance);
        }
        Start::Near(start)
    }

    /// Draws a direction from the frame's refracted light and follows it to the light.
    fn sample<const N: usize, P>(
        &self,
        aim: &Aim,
        start: &Near,
        walker: &Walker<N>,
        medium: &Medium<N, P>,
        beta: Spectrum<N>,
        vertex: &impl Scattering<N>,
        within: &Within<'_, N>,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
        counters: &mut Counters,
    ) -> Option<Spectrum<N>> {
        let scene = self.scene;
        let u: [f32; 5] = std::array::from_fn(|_| rng.uniform());
        let (omega, aimed) = aim.sample(scene, w, u[3], [u[0], u[1], u[2]])?;
        let (value, pdf) = vertex.towards(omega);
        if value.is_black() {
            return None;
        }
        // Cast the real ray to the real surface.
        let (ray, hit) = self.exit(walker.p, omega, self.reach(), counters)?;
        let surface = scene.accel.surface(&ray, &hit);
        let ns = scene.boundary_normal(&scene.objects[hit.shape as usize], &surface);
        // Take one of the transmitted outcomes in proportion to its probability.
        let (d, p, transmitted) = transmit(-omega, surface.ng, ns, self.eta, || u[4])?;
        let t = medium.transmittance(hit.t);
        // A look finds the path whenever its flight takes this direction, chance if it gets through and crosses as well.
        let looks = hit.t <= self.sight(&Start::Near(*start), walker.p, omega);
        let chance = if looks {
            (walker.ratio * pdf).mean() / p
        } else {
            (walker.ratio * vertex.through(omega, hit.t) * t).mean()
        };
        let connection = start.q * aimed / transmitted;
        let mut sum = Spectrum::ZERO;
        self.lights_beyond(&hit, surface.p, d, within, w, rng, counters, |radiance, further| {
            let chance = if looks { chance } else { chance * further };
            sum += radiance * (further / (connection + chance));
        });
        // Leaving multiplies radiance by the squared index.
        (!sum.is_black()).then(|| beta * value * t * sum * (self.eta * self.eta))
    }
}
