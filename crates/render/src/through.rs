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
//! *Competition.* The walk finds the same paths by chance, with density p_c(w) exp(-sigma_t s) times the probability P of
//! refraction. Both strategies are shared by the balance heuristic, P being common to both: with P the total probability of the
//! boundary's transmitted outcomes, the connection counts
//! beta p_c T P' L / (p_F / P + p_c T), the chance hit p_c T / (p_F / P + p_c T). Every term is at most beta L: no fireflies.
//!
//! *Which flights.* Those that start at a collision, arrive at the body's own boundary within [`REACH`] mean free paths, and
//! whose refracted ray meets a light first of all. Others are found by chance alone and count in full.
//!
//! *Cost.* A connection is made with probability q at a collision, the less the deeper it lies; q multiplies p_F everywhere. The
//! frame is a function of the collision point and of random numbers drawn there, so that a chance hit, which is rare, can make
//! the frame of its flight afterwards.
//!
//! Only lights with a surface take part: nothing connects to a point through a curved mirror of directions.

use moonmilk_core::{Random, Sampler, Spectrum, Stream, Vec3, Wavelengths};
use moonmilk_geometry::{Facing, Hit, Prim, Ray};
use moonmilk_walk::{Medium, Walker};

use crate::bsdf::Crossing;
use crate::bsdf::boundary::branches;
use crate::integrator::{Counters, Light};
use crate::interior::Standing;
use crate::media::Matter;
use crate::nest::{Inside, Nest};
use crate::scene::{Boundary, Scene};

/// Longest flight that connections compete for [mean free paths of the hero]; longer ones carry exp(-8) and are left to chance.
pub(crate) const REACH: f32 = 8.0;
/// Longest way to the frame [mean free paths]; straight lines to a light are longer than bent ones. On the marble dragon 2, 4, 8, 16
/// leave a variance of .30, .24, .21, .21.
const FRAME_REACH: f32 = 8.0;
/// Depth at which connections become rarer [mean free paths].
const SHALLOW: f32 = 0.5;
/// Probability of a connection near the surface. The noise that is left is mostly the walk's own: on the marble dragon a variance of
/// .219, .224, .243, .270 for .2, .1, .05, .025 at CPU times of 7.8, 6.8, 6.2, 5.7 s.
const MOST: f32 = 0.05;
/// Optical depth at which a connection is a twentieth as probable as at the surface, and beyond which none is made.
const DEEP: f32 = SHALLOW + 3.0;

/// A plane that stands in for the boundary near a collision.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    x: Vec3,
    /// Outward unit normal.
    n: Vec3,
    prim: Prim,
    eta: f32,
}

/// A collision where a flight began: all that its frame depends on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    p: Vec3,
    /// Probability of a connection.
    q: f32,
    /// Key of the frame's variates.
    key: u64,
}

/// A path that left through a smooth boundary, and with which density connections would have found it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Escape {
    object: u32,
    eta: f32,
    sigma_t: f32,
    start: Start,
    /// Direction of the last flight inside.
    omega: Vec3,
    /// p_c T: density of that direction times the mean probability of getting through.
    pdf: f32,
    /// Total probability of the boundary's transmitted outcomes.
    transmitted: f32,
}

impl Escape {
    /// Returns the share of a light that this path met by chance.
    pub fn share<const N: usize>(&self, scene: &Scene, w: &Wavelengths<N>, counters: &mut Counters) -> f32 {
        let through = Through { scene, object: self.object, eta: self.eta, sigma_t: self.sigma_t };
        match through.frame(&self.start, w, counters) {
            Some(frame) => {
                crate::integrator::balance(self.pdf, self.start.q * frame.density(scene, self.omega) / self.transmitted)
            }
            None => 1.0,
        }
    }
}

fn is_transmitted(c: &Crossing) -> bool {
    matches!(c, Crossing::Transmitted(_))
}

impl Frame {
    /// Returns the direction of flight inside that the plane refracts towards w_i outside.
    fn inside(&self, w_i: Vec3) -> Option<Vec3> {
        let k = w_i.dot(self.n);
        let cos2 = 1.0 - (1.0 - k * k) / (self.eta * self.eta);
        (k > 0.0 && cos2 > 0.0).then(|| (w_i / self.eta + self.n * (cos2.sqrt() - k / self.eta)).normalize())
    }

    /// Returns the direction outside to which the plane refracts omega, and d omega_i / d omega.
    fn outside(&self, omega: Vec3) -> Option<(Vec3, f32)> {
        let c_t = omega.dot(self.n);
        let cos2 = 1.0 - self.eta * self.eta * (1.0 - c_t * c_t);
        if c_t <= 0.0 || cos2 <= 0.0 {
            return None;
        }
        let c_i = cos2.sqrt();
        let w_i = (omega * self.eta + self.n * (c_i - self.eta * c_t)).normalize();
        Some((w_i, self.eta * self.eta * c_t / c_i))
    }

    /// Returns p_F(omega): the density over all lights that the ray from x0 meets, as if nothing else were in the way.
    fn density(&self, scene: &Scene, omega: Vec3) -> f32 {
        let Some((w_i, jacobian)) = self.outside(omega) else { return 0.0 };
        let mut pdf = 0.0;
        let ray = Ray::new(self.x, w_i).from_prim(self.prim);
        scene.accel.all_hits(&ray, |h| {
            if let Some(l) = scene.lights.light_of(h.shape, h.index) {
                let s = scene.accel.surface(&ray, h);
                if scene.lights.shines(l, s.ng, -w_i) {
                    pdf += scene.lights.pdf_surface(self.x, Some(self.n), l, s.p);
                }
            }
        });
        pdf * jacobian
    }
}

/// A body whose boundary connections go through.
#[derive(Clone, Copy)]
pub(crate) struct Through<'a> {
    scene: &'a Scene,
    object: u32,
    eta: f32,
    /// Extinction of the hero.
    sigma_t: f32,
}

impl<'a> Through<'a> {
    /// Returns the connections of the one body that a path is in, or `None` where they cannot work: no or several bodies, no smooth
    /// boundary, no lights with a surface, lights inside (sampled there), a medium outside.
    pub fn new<const N: usize>(
        scene: &'a Scene,
        nest: &Nest,
        medium: &Medium<N>,
        ambient: Option<&Matter<N>>,
        wavelengths: &Wavelengths<N>,
    ) -> Option<Self> {
        let [Inside { shape: index, .. }] = *nest.bodies() else { return None };
        let o = &scene.objects[index as usize];
        let Boundary::Smooth { eta } = o.boundary else { return None };
        let possible = o.body.is_some() && !o.connects && scene.lights.has_surfaces() && medium.sigma_t[0] > 0.0;
        if !possible || scene.medium_outside(o, wavelengths, ambient.copied()).is_some() {
            return None;
        }
        Some(Self { scene, object: index, eta, sigma_t: medium.sigma_t[0] })
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

    /// Returns what is known of a flight along omega that arrived with density `pdf` and is about to be refracted.
    pub fn escape(&self, start: Start, omega: Vec3, pdf: f32, ng: Vec3, ns: Vec3) -> Escape {
        let transmitted = branches(-omega, ng, ns, self.eta).iter().filter(|b| is_transmitted(&b.1)).map(|b| b.0).sum();
        Escape { object: self.object, eta: self.eta, sigma_t: self.sigma_t, start, omega, pdf, transmitted }
    }

    /// Makes the frame of a collision; `None` where no boundary is near on the way to the light.
    fn frame<const N: usize>(&self, start: &Start, w: &Wavelengths<N>, counters: &mut Counters) -> Option<Frame> {
        let limit = FRAME_REACH / self.sigma_t;
        let mut keyed = Stream::new(&[start.key]);
        let u = [keyed.uniform(), keyed.uniform(), keyed.uniform()];
        let target = self.scene.lights.sample_surface(start.p, None, w, u)?;
        let at = |(ray, hit): (Ray, Hit)| {
            let s = self.scene.accel.surface(&ray, &hit);
            Frame { x: s.p, n: s.ns, prim: hit.prim, eta: self.eta }
        };
        // Look straight towards a point of a light, then again along the refracted way to it.
        let straight = at(self.exit(start.p, target.wi, limit, counters)?);
        let bent = straight.inside((target.point - straight.x).normalize());
        Some(bent.and_then(|d| self.exit(start.p, d, limit, counters)).map_or(straight, at))
    }

    /// Makes a connection at a collision, or not; returns what the next flight competes with.
    ///
    /// `beta` is the weight after the collision, scattering coefficient included; `room` a lower bound of the depth.
    pub fn connect<const N: usize>(
        &self,
        walker: &Walker<N>,
        medium: &Medium<N>,
        beta: Spectrum<N>,
        room: f32,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> Option<Start> {
        let depth = self.sigma_t * room;
        if depth > DEEP {
            return None;
        }
        let q = if depth <= SHALLOW { MOST } else { MOST * (SHALLOW - depth).exp() };
        let start = Start { p: walker.p, q, key: rng.stream().bits() };
        if rng.uniform() < q
            && let Some(frame) = self.frame(&start, w, counters)
        {
            let u = [rng.uniform(), rng.uniform(), rng.uniform()];
            let choice = rng.uniform();
            if let Some(radiance) = self.sample(&frame, q, walker, medium, beta, w, u, choice, counters) {
                light.add(walker.collisions, radiance);
            }
        }
        Some(start)
    }

    /// Draws a direction from the frame's refracted light and follows it to the light.
    fn sample<const N: usize>(
        &self,
        frame: &Frame,
        q: f32,
        walker: &Walker<N>,
        medium: &Medium<N>,
        beta: Spectrum<N>,
        w: &Wavelengths<N>,
        u: [f32; 3],
        choice: f32,
        counters: &mut Counters,
    ) -> Option<Spectrum<N>> {
        let scene = self.scene;
        let target = scene.lights.sample_surface(frame.x, Some(frame.n), w, u)?;
        let omega = frame.inside(target.wi)?;
        let phase = medium.phase(walker.d, omega);
        // Cast the real ray to the real surface.
        let (ray, hit) = self.exit(walker.p, omega, self.reach(), counters)?;
        let surface = scene.accel.surface(&ray, &hit);
        let ns = scene.boundary_normal(&scene.objects[hit.shape as usize], &surface);
        let outcomes = branches(-omega, surface.ng, ns, self.eta);
        let transmitted: f32 = outcomes.iter().filter(|b| is_transmitted(&b.1)).map(|b| b.0).sum();
        // Take one of the transmitted outcomes in proportion to its probability.
        let mut left = choice * transmitted;
        let mut out = None;
        for (p, c) in outcomes.iter().filter(|b| is_transmitted(&b.1) && b.0 > 0.0) {
            out = Some(c.direction());
            left -= p;
            if left < 0.0 {
                break;
            }
        }
        let d = out?;
        // Only what the refracted ray meets first can be a light that it shines from.
        counters.shadow_rays += 1;
        let ray = Standing::Outside(hit).ray(scene, surface.p, d);
        let met = scene.accel.nearest(&ray)?;
        let l = scene.lights.light_of(met.shape, met.index)?;
        let there = scene.accel.surface(&ray, &met);
        let radiance = scene.lights.emitted(l, there.uv, there.ng, -d, w);
        if radiance.is_black() || scene.objects[met.shape as usize].alpha.is_some() {
            return None;
        }
        let t = medium.transmittance(hit.t);
        let chance = phase * (walker.ratio * t).mean();
        let density = q * frame.density(scene, omega) / transmitted + chance;
        // Leaving multiplies radiance by eta^2.
        Some(beta * t * radiance * (phase * self.eta * self.eta / density))
    }
}
