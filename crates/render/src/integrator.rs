//! Volumetric path tracing: the exact transport that judges everything else.
//!
//! A path starts at the camera. Outside media it goes from surface to surface, with light sampling and multiple importance
//! sampling; inside a medium it is handed to the walk of `moonmilk-walk`, which returns it at a wall. Smooth refractive
//! walls with nothing else to decide are crossed inside the walk (`interior.rs`).
//!
//! *Weights.* `beta` and `ratio` are those of [`moonmilk_walk::Walker`]: weight over the mean density of the wavelengths, and
//! density of each over that mean. `direction_pdf` is the density with which the last direction was drawn times the mean
//! probability of getting through the media since; a light that is hit and could have been sampled with density p_l
//! counts with 1 / (1 + p_l / direction_pdf): the balance heuristic over wavelengths and strategies \[Miller2019\].

use std::sync::Arc;

use moonmilk_core::{Sampler, Spectrum, Vec3};
use moonmilk_core::{WavelengthMode, Wavelengths};
use moonmilk_walk::hybrid::{self, Core};
use moonmilk_walk::{Jumps, Medium, Outcome, Roulette, Walker, classic, guided};

use crate::balls::{self, Balls};
use crate::cloud::Cloud;
use crate::connect;
use crate::interior::{Exit, Interior, Standing};
use crate::manifold::Manifold;
use crate::media::Matter;
use crate::mirrors::{self, Sight};
use crate::scene::Scene;
use crate::snag::Snag;
use crate::texture::TexturePoint;
use crate::through::Through;
use crate::tint::Lanes;
use crate::touch;
use crate::vertices::Vertices;
use crate::window::Window;

mod counters;
mod field;
mod flight;
mod path;
pub(crate) mod policy;
mod surface;

pub use counters::Counters;
pub(crate) use path::Path;
pub use policy::Policy;

/// Number of events after which a path is given up and counted: no path of a scene with any loss gets there.
const ENDLESS: u64 = 1 << 24;

/// Surface bounces before roulette may end a path.
const SURE_BOUNCES: u32 = 1;

/// Settings of exact transport.
#[derive(Clone, Debug)]
pub struct Integrator {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Treatment of colour.
    pub wavelengths: WavelengthMode,
    /// Roulette of walks and paths.
    pub roulette: Roulette,
    /// Largest number of bounces, every collision and surface event counted as pbrt does; `None` for no limit.
    pub max_depth: Option<u32>,
    /// How exact walks are sampled.
    pub policy: Policy,
    /// The light that enters bodies of a model, for one sample number; from [`Integrator::for_sample`], and never needed: without it a path finds it alone.
    cloud: Option<Arc<Cloud>>,
    /// Banks of exits for the samples around one number; from [`Integrator::for_sample`], and never needed: without them walks go flight by flight.
    balls: Option<Arc<Balls>>,
    /// Vertices of light's paths for one sample number; from [`Integrator::for_sample`], and never needed.
    vertices: Option<Arc<Vertices>>,
}

/// Radiance that a path collected, by number of collisions, and what it saw first.
#[derive(Clone, Copy, Debug)]
pub struct Light<const N: usize> {
    /// Radiance after 0, 1, and 2 or more collisions.
    pub orders: [Spectrum<N>; 3],
    /// What the densities of the lanes drifted to, times the weight; 0 on average (`tint.rs`).
    pub drift: Spectrum<N>,
    /// Albedo of the first surface.
    pub albedo: Spectrum<N>,
    /// Shading normal of the first surface.
    pub normal: Vec3,
    /// Distance of the first surface; 0 if there is none.
    pub depth: f32,
}

impl<const N: usize> Default for Light<N> {
    fn default() -> Self {
        Self {
            orders: [Spectrum::ZERO; 3],
            drift: Spectrum::ZERO,
            albedo: Spectrum::ZERO,
            normal: Vec3::ZERO,
            depth: 0.0,
        }
    }
}

impl<const N: usize> Light<N> {
    /// Adds radiance that arrived after a number of collisions.
    #[inline]
    pub fn add(&mut self, collisions: u32, radiance: Spectrum<N>) {
        self.orders[collisions.min(2) as usize] += radiance;
    }
}

impl Integrator {
    /// Returns the settings; all light is found by the paths themselves.
    pub fn new(seed: u64, wavelengths: WavelengthMode, roulette: Roulette, max_depth: Option<u32>) -> Self {
        Self {
            seed,
            wavelengths,
            roulette,
            max_depth,
            policy: Policy::default(),
            cloud: None,
            balls: None,
            vertices: None,
        }
    }

    /// Returns the settings with a policy of exact walks.
    pub fn with_policy(self, policy: Policy) -> Self {
        Self { policy, balls: None, vertices: None, ..self }
    }

    /// Returns the integrator for one sample number of all pixels: with points on the bodies that a model renders, if that pays, and banks of exits for jumps.
    ///
    /// A pure function of scene, settings and sample number; all threads take part in it.
    pub fn for_sample(&self, scene: &Scene, sample: u64) -> Self {
        let walks = self.for_walks(scene, sample);
        // What falls on points is followed by paths without vertices.
        let plain = Self { vertices: None, ..walks.clone() };
        Self { cloud: Cloud::new(scene, &plain, sample).map(Arc::new), ..walks }
    }

    /// Returns the same without points: with what exact walks share.
    pub(crate) fn for_walks(&self, scene: &Scene, sample: u64) -> Self {
        let plain = Self { cloud: None, vertices: None, ..self.with_balls(scene, sample) };
        Self { vertices: Vertices::new(scene, &plain, sample).map(Arc::new), ..plain }
    }

    /// Returns whether [`Integrator::for_sample`] has anything to prepare.
    pub(crate) fn prepares(&self, scene: &Scene) -> bool {
        !scene.sites().is_empty() || !scene.wanted_balls(self.policy).is_empty() || self.prepares_much(scene)
    }

    /// Returns whether it is too much to be kept for several sample numbers at a time.
    pub(crate) fn prepares_much(&self, scene: &Scene) -> bool {
        self.max_depth.is_none() && !scene.lit(self.policy).is_empty()
    }

    /// Returns the integrator with the banks of one sample number, its own if they serve that, too.
    pub(crate) fn with_balls(&self, scene: &Scene, sample: u64) -> Self {
        let group = sample / balls::GROUP;
        match &self.balls {
            Some(b) if b.group == group => self.clone(),
            _ => Self { balls: Balls::new(scene, self, group).map(Arc::new), ..self.clone() },
        }
    }

    /// Returns the variate of the wavelengths of points or vertices, if there are any.
    pub(crate) fn shared_wavelength(&self) -> Option<f32> {
        self.vertices.as_ref().map(|v| v.wavelength).or(self.cloud.as_ref().map(|c| c.wavelength))
    }

    /// Returns what making points or vertices did: its counters, and the number of those whose light was not finite.
    pub fn preparation(&self) -> impl Iterator<Item = (&Counters, u64)> {
        let points = self.cloud.iter().map(|c| (&c.counters, c.invalid));
        points.chain(self.vertices.iter().map(|v| (&v.counters, v.invalid)))
    }

    /// Follows one path from the camera and adds what it finds to `light`.
    pub fn trace<const N: usize>(
        &self,
        scene: &Scene,
        o: Vec3,
        d: Vec3,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) {
        self.trace_for(scene, o, d, Sight::All, wavelengths, rng, light, counters);
    }

    /// Follows one path of a pixel, and rays of their own for the mirror images of lamps where it holds their edges; returns what these found, with the filter's weights.
    pub(crate) fn trace_pixel<const N: usize>(
        &self,
        scene: &Scene,
        pixel: [u32; 2],
        (o, d): (Vec3, Vec3),
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> Spectrum<N> {
        let finds = self.policy == Policy::Auto && self.max_depth.is_none();
        let apart = finds && scene.mirrors().is_near(scene, pixel);
        let sight = if apart { Sight::First } else { Sight::All };
        self.trace_for(scene, o, d, sight, wavelengths, rng, light, counters);
        scene.tints().take_off(scene, pixel, wavelengths, light);
        if apart { mirrors::images(scene, pixel, wavelengths, rng, counters) } else { Spectrum::ZERO }
    }

    fn trace_for<const N: usize>(
        &self,
        scene: &Scene,
        o: Vec3,
        d: Vec3,
        sight: Sight,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) {
        counters.paths += 1;
        let inside = scene.nest_at(o);
        let [said, found, ambient] = scene.around(&inside, wavelengths);
        let mut path = Path {
            walker: Walker::new(o, d),
            medium: said.or(found),
            ambient,
            inside,
            standing: Standing::Space,
            normal: None,
            depth: 0,
            bounces: 0,
            seen: false,
            scattered: false,
            whole: true,
            sight,
            escape: None,
            start: None,
            copies: Vec::new(),
        };
        let (start, probes) = (path.walker.collisions, counters.probes);
        self.follow(scene, &mut path, wavelengths, rng, light, counters);
        // A profile counts as two collisions of the light.
        counters.collisions += u64::from(path.walker.collisions - start);
        counters.collisions -= 2 * (counters.probes - probes);
    }

    /// Returns the jumps of a medium: by tables where it scatters isotropically, else by its bank, if there is one.
    fn jumps<const N: usize>(&self, scene: &Scene, medium: &Medium<N>) -> Option<Jumps<'_, N>> {
        let searches = scene.lights.has_unseen();
        let banked = || Jumps::from_bank(medium, self.balls.as_ref()?.bank(medium.g)?).map(|j| j.searching(searches));
        Jumps::new(medium).or_else(banked)
    }

    /// Follows a path and all its copies to their ends.
    fn follow<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) {
        loop {
            let mut events = 0u64;
            let (mut snag, mut collisions) = (Snag::new(path.walker.p), path.walker.collisions);
            while self.step(scene, path, wavelengths, rng, light, counters) {
                events += 1;
                // Free paths that rounding holds between walls at the same place.
                if path.walker.collisions != collisions {
                    (snag, collisions) = (Snag::new(path.walker.p), path.walker.collisions);
                } else if let Some(step) = snag.meet(scene, path.walker.p, &path.standing) {
                    counters.rescued += 1;
                    path.free(scene, step, wavelengths);
                }
                if events + u64::from(path.walker.collisions) > ENDLESS {
                    counters.endless += 1;
                    break;
                }
            }
            let Some(next) = path.copies.pop() else { return };
            // Whoever asked counts the collisions from the start of the first to the end of the last.
            let lap = i64::from(path.walker.collisions) - i64::from(next.walker.collisions);
            counters.collisions = counters.collisions.wrapping_add_signed(lap);
            let copies = std::mem::take(&mut path.copies);
            *path = next;
            path.copies = copies;
        }
    }

    /// Advances to the next surface and through it; returns whether the path goes on.
    fn step<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        // Where walls are at the same place, the next one may be here.
        if let Some((hit, surface)) =
            touch::departure(scene, &path.inside, &path.standing, path.walker.p, path.walker.d)
        {
            path.walker.p = surface.p;
            return self.meet(scene, path, hit, &surface, wavelengths, rng, light, counters);
        }
        let Some(matter) = path.medium else {
            return self.step_outside(scene, path, wavelengths, rng, light, counters);
        };
        let (medium, scatterers) = match matter {
            Matter::Field(id) => return self.step_field(scene, path, id, wavelengths, rng, light, counters),
            Matter::Homogeneous(medium) => (medium, None),
            Matter::Similar(medium, i) => (medium, Some(scene.scatterers(i))),
        };
        if medium.sigma_s.is_black() {
            return self.step_absorbing(scene, path, &medium, wavelengths, rng, light, counters);
        }

        // Walk inside the medium until a wall leaves something to decide.
        let seen = match (&self.vertices, matter) {
            (Some(vertices), Matter::Homogeneous(_)) => vertices.seen_from(scene, &path.inside, &medium),
            _ => None,
        };
        let through = match self.max_depth {
            None => Through::new(scene, &path.inside, &medium, path.ambient.as_ref(), wavelengths),
            Some(_) => None,
        };
        let manifold = if self.max_depth.is_none() { Manifold::new(scene, &path.inside) } else { None };
        let interior = Interior::new(scene, &path.inside, self.max_depth.is_some(), path.standing, through);
        if let Some(start) = path.start.take() {
            interior.set_start(start);
            interior.set_flown(path.walker.p);
        }
        let guides = scatterers.is_none() && seen.is_none();
        let guide = if guides { self.guide(scene, &medium, &interior, path.walker.p) } else { None };
        let splits = self.policy == Policy::Auto && !scene.hybrid && !scene.shifted && self.max_depth.is_none();
        let window = if splits && guide.is_none() && (through.is_some() || manifold.is_some()) {
            Window::new(scene, path.inside.innermost(), &medium, path.walker.p, wavelengths, rng)
        } else {
            None
        };
        let collisions = path.walker.collisions;
        let limit = self.max_depth.map_or(ENDLESS as u32, |m| m - path.depth.min(m));
        let connects = scene.lights.samples_in_media() && interior.connects();
        let mut tally = connect::InMedium {
            scene,
            wavelengths,
            light,
            counters,
            interior: &interior,
            inside: &path.inside,
            ambient: path.ambient,
            around: matter,
            connects,
            through,
            manifold,
            seen,
            window,
            copies: Vec::new(),
            lanes: (!medium.is_gray()).then(|| Lanes::of(&path.walker)),
            unseen: 1.0,
            core: if scene.hybrid { Core::new(&medium, hybrid::DEPTH) } else { None },
        };
        let limits = classic::Limits { roulette: self.roulette, collisions: collisions.saturating_add(limit) };
        let jumps = match (self.policy, self.max_depth) {
            _ if scene.hybrid || guide.is_some() || seen.is_some() => None,
            (_, None) if scene.shifted => Jumps::shifted(&medium),
            (Policy::Jump, None) => self.jumps(scene, &medium),
            (Policy::Auto, None) => self.jumps(scene, &medium).filter(|j| j.pays(interior.depth())),
            _ => None,
        };
        let outcome = match scatterers {
            None if let Some(guide) = &guide => {
                path.walker.choose_strategy(rng);
                guided::walk(&interior, &medium, guide, &limits, &mut path.walker, &mut tally, rng)
            }
            None => classic::walk_with(&interior, &medium, jumps.as_ref(), &limits, &mut path.walker, &mut tally, rng),
            Some(s) => classic::walk(&interior, &medium.under(&s.law), &limits, &mut path.walker, &mut tally, rng),
        };
        tally.settle(&path.walker);
        let copies = std::mem::take(&mut tally.copies);
        for (walker, start) in copies {
            let copy = path.copy(walker, start, collisions);
            path.copies.push(copy);
        }
        counters.segments += interior.segments();
        self.after_walk(scene, path, outcome, collisions, wavelengths, rng, light, counters)
    }

    /// Goes on where a walk ended that began with a number of collisions.
    fn after_walk<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        outcome: Outcome<Exit>,
        collisions: u32,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        let walked = path.walker.collisions - collisions;
        path.depth = path.depth.saturating_add(walked);
        if walked > 0 {
            path.normal = None;
        }
        match outcome {
            Outcome::Left(Exit::Outside(hit, escape)) => {
                path.escape = escape;
                counters.left += 1;
                let point = TexturePoint { p: path.walker.p, n: path.walker.d, uv: Default::default() };
                path.cross_body(scene, hit.shape, true, &point, wavelengths);
                path.standing = Standing::Outside(hit);
                path.normal = None;
                true
            }
            Outcome::Left(Exit::Surface(hit, surface)) => {
                self.surface(scene, path, hit, &surface, wavelengths, rng, light, counters)
            }
            Outcome::Ended => {
                counters.endless += u64::from(self.max_depth.is_none() && walked >= ENDLESS as u32);
                counters.ended_inside += u64::from(path.inside.innermost().is_some());
                false
            }
            Outcome::Lost => {
                match path.inside.innermost().and_then(|i| scene.rescue(i, path.walker.p, path.walker.d)) {
                    // Set a walk that rounding put outside back onto the surface, as if it arrived there.
                    Some((hit, surface)) => {
                        counters.rescued += 1;
                        path.walker.p = surface.p;
                        self.surface(scene, path, hit, &surface, wavelengths, rng, light, counters)
                    }
                    // Look anew where a walk is whose body was left unnoticed: by a chord shorter than rounding, where bodies cross.
                    None if path.inside.innermost().is_some_and(|i| !scene.nest_at(path.walker.p).contains(i)) => {
                        counters.rescued += 1;
                        path.free(scene, 0.0, wavelengths);
                        true
                    }
                    None => {
                        counters.lost += 1;
                        // What no wall ever stops sees the environment through the medium: black for scattering media.
                        false
                    }
                }
            }
        }
    }
}

/// Returns p / (p + q), the balance heuristic's share of the strategy with density p.
#[inline]
pub(crate) fn balance(p: f32, q: f32) -> f32 {
    if q == 0.0 { 1.0 } else { 1.0 / (1.0 + q / p) }
}
