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

use moonmilk_core::{Random, Sampler, Spectrum, Vec3};
use moonmilk_core::{WavelengthMode, Wavelengths};
use moonmilk_geometry::{Facing, Hit, NONE, Prim, Ray, Surface};
use moonmilk_walk::{Medium, Outcome, Roulette, Walker, classic};

use crate::bsdf::boundary::branches;
use crate::bsdf::{Bsdf, Crossing, Kind};
use crate::connect;
use crate::interior::{Exit, Interior, Standing};
use crate::media::Matter;
use crate::nest::{Meeting, Nest};
use crate::scene::{Boundary, Object, Scene};
use crate::snag::Snag;
use crate::texture::TexturePoint;
use crate::through::{Escape, Through};
use crate::touch::{self, Arrival};

mod field;

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
}

/// Radiance that a path collected, by number of collisions, and what it saw first.
#[derive(Clone, Copy, Debug)]
pub struct Light<const N: usize> {
    /// Radiance after 0, 1, and 2 or more collisions.
    pub orders: [Spectrum<N>; 3],
    /// Albedo of the first surface.
    pub albedo: Spectrum<N>,
    /// Shading normal of the first surface.
    pub normal: Vec3,
    /// Distance of the first surface; 0 if there is none.
    pub depth: f32,
}

impl<const N: usize> Default for Light<N> {
    fn default() -> Self {
        Self { orders: [Spectrum::ZERO; 3], albedo: Spectrum::ZERO, normal: Vec3::ZERO, depth: 0.0 }
    }
}

impl<const N: usize> Light<N> {
    /// Adds radiance that arrived after a number of collisions.
    #[inline]
    pub fn add(&mut self, collisions: u32, radiance: Spectrum<N>) {
        self.orders[collisions.min(2) as usize] += radiance;
    }
}

/// What the transport did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Paths started.
    pub paths: u64,
    /// Collisions inside media.
    pub collisions: u64,
    /// Look-ups of fields that were no collisions: null collisions of walks, all of shadow rays.
    pub null_collisions: u64,
    /// Rays cast outside media, to the nearest hit.
    pub rays: u64,
    /// Segments cast inside media.
    pub segments: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Paths that entered a closed body.
    pub entered: u64,
    /// Paths that left a closed body.
    pub left: u64,
    /// Paths that ended inside a closed body (absorbed, by roulette).
    pub ended_inside: u64,
    /// Walks that rounding put outside their body and that were set back on the nearest surface.
    pub rescued: u64,
    /// Walks in media that found no wall at all: open objects.
    pub lost: u64,
    /// Hits on a closed body from the side that the path did not know itself to be on: bodies that intersect themselves or
    /// each other, or a camera inside a body.
    pub contrary: u64,
    /// Paths given up after 2^24 events.
    pub endless: u64,
}

impl Counters {
    /// Adds the figures of another part of the work.
    pub fn merge(&mut self, o: &Self) {
        let Self {
            paths,
            collisions,
            null_collisions,
            rays,
            segments,
            shadow_rays,
            entered,
            left,
            ended_inside,
            rescued,
            lost,
            contrary,
            endless,
        } = o;
        self.paths += paths;
        self.collisions += collisions;
        self.null_collisions += null_collisions;
        self.rays += rays;
        self.segments += segments;
        self.shadow_rays += shadow_rays;
        self.entered += entered;
        self.left += left;
        self.ended_inside += ended_inside;
        self.rescued += rescued;
        self.lost += lost;
        self.contrary += contrary;
        self.endless += endless;
    }
}

/// A path on its way.
#[derive(Clone)]
pub(crate) struct Path<const N: usize> {
    pub walker: Walker<N>,
    /// Medium around the walker, `None` for vacuum.
    pub medium: Option<Matter<N>>,
    /// Medium around all bodies that the walker is inside of.
    pub ambient: Option<Matter<N>>,
    /// Bodies that the walker is inside of.
    pub inside: Nest,
    /// Surface that the walker stands on.
    pub standing: Standing,
    /// Normal at the point where the last direction was drawn, for the density of light sampling; `None` inside media and at
    /// boundaries that light can cross.
    pub normal: Option<Vec3>,
    /// Bounces, as pbrt counts them.
    pub depth: u32,
    /// Surface bounces since the start.
    pub bounces: u32,
    /// Whether a surface was seen.
    pub seen: bool,
    /// Whether the next smooth boundary may be followed on both branches: true up to the first one.
    pub whole: bool,
    /// The boundary that the last flight left through, where connections compete for the light that it meets next.
    pub escape: Option<Escape>,
}

impl Integrator {
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
        counters.paths += 1;
        // What the file says is around the camera is there; otherwise it is what the bodies around it are made of.
        let said = scene.camera_medium.and_then(|m| scene.medium::<N>(m, wavelengths));
        let inside = scene.nest_at(o);
        let found = inside.medium(scene, wavelengths, None);
        let ambient = if found.is_none() { said } else { None };
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
            whole: true,
            escape: None,
        };
        let start = path.walker.collisions;
        self.follow(scene, &mut path, wavelengths, rng, light, counters);
        counters.collisions += u64::from(path.walker.collisions - start);
    }

    /// Follows a path to its end.
    fn follow<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) {
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
        let medium = match path.medium {
            None => return self.step_outside(scene, path, wavelengths, rng, light, counters),
            Some(Matter::Field(id)) => return self.step_field(scene, path, id, wavelengths, rng, light, counters),
            Some(Matter::Homogeneous(medium)) => medium,
        };
        if medium.sigma_s.is_black() {
            return self.step_absorbing(scene, path, &medium, wavelengths, rng, light, counters);
        }

        // Walk inside the medium until a wall leaves something to decide.
        let through = match self.max_depth {
            None => Through::new(scene, &path.inside, &medium, path.ambient.as_ref(), wavelengths),
            Some(_) => None,
        };
        let interior = Interior::new(scene, &path.inside, self.max_depth.is_some(), path.standing, through);
        let collisions = path.walker.collisions;
        let limit = self.max_depth.map_or(ENDLESS as u32, |m| m - path.depth.min(m));
        let connects = !scene.lights.is_empty() && interior.connects();
        let mut tally = connect::InMedium {
            scene,
            wavelengths,
            light,
            counters,
            interior: &interior,
            inside: &path.inside,
            ambient: path.ambient,
            around: Matter::Homogeneous(medium),
            connects,
            through,
        };
        let limits = classic::Limits { roulette: self.roulette, collisions: collisions.saturating_add(limit) };
        let outcome = classic::walk(&interior, &medium, &limits, &mut path.walker, &mut tally, rng);
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
                    None => {
                        counters.lost += 1;
                        // What no wall ever stops sees the environment through the medium: black for scattering media.
                        false
                    }
                }
            }
        }
    }

    /// Goes to the next surface through vacuum.
    fn step_outside<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        counters.rays += 1;
        let ray = path.standing.ray(scene, path.walker.p, path.walker.d);
        match touch::nearest(scene, &path.inside, ray) {
            Some((hit, surface, _)) => {
                path.walker.p = surface.p;
                self.meet(scene, path, hit, &surface, wavelengths, rng, light, counters)
            }
            None => {
                self.environment(scene, path, wavelengths, light);
                false
            }
        }
    }

    /// Goes to the next surface through a medium that absorbs (and emits) but does not scatter: attenuation in closed form.
    fn step_absorbing<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        medium: &Medium<N>,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        counters.rays += 1;
        let ray = path.standing.ray_inside(scene, path.inside.innermost(), path.walker.p, path.walker.d);
        let next = touch::nearest(scene, &path.inside, ray);
        let t = next.as_ref().map_or(f32::INFINITY, |n| n.2);
        let transmittance = medium.transmittance(t);
        if let Some(emission) = medium.emission {
            // Integrate sigma_a L_e exp(-sigma_a s) along the segment.
            light.add(path.walker.collisions, path.walker.beta * emission * medium.sigma_t.map(|s| -(-s * t).exp_m1()));
        }
        path.walker.beta *= transmittance;
        match next {
            Some((hit, surface, _)) if !path.walker.beta.is_black() => {
                path.walker.p = surface.p;
                self.meet(scene, path, hit, &surface, wavelengths, rng, light, counters)
            }
            Some(_) => false,
            None => {
                self.environment(scene, path, wavelengths, light);
                false
            }
        }
    }

    /// Adds the radiance of infinite lights.
    fn environment<const N: usize>(
        &self,
        scene: &Scene,
        path: &Path<N>,
        wavelengths: &Wavelengths<N>,
        light: &mut Light<N>,
    ) {
        // A portal asks for the line: it starts where the direction was drawn, or at the last smooth boundary.
        let from = if path.walker.direction_pdf.is_some() { path.walker.scatter_point } else { path.walker.p };
        let radiance = scene.lights.environment(from, path.walker.d, wavelengths);
        if radiance.is_black() {
            return;
        }
        let share = path.walker.direction_pdf.map_or(1.0, |pdf| {
            balance(pdf, scene.lights.pdf_environment(path.walker.scatter_point, path.normal, path.walker.d))
        });
        light.add(path.walker.collisions, path.walker.beta * radiance * share);
    }

    /// Handles the arrival at a surface, or at that of several at one place which comes first; returns whether the path goes on.
    fn surface<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        hit: Hit,
        surface: &Surface,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        match touch::arrival(scene, &path.inside, &hit, surface, path.walker.d) {
            Arrival::This => self.meet(scene, path, hit, surface, wavelengths, rng, light, counters),
            Arrival::Other(other, surface) => {
                path.walker.p = surface.p;
                self.meet(scene, path, other, &surface, wavelengths, rng, light, counters)
            }
            Arrival::Ghost => {
                path.standing = Standing::Through(hit);
                true
            }
        }
    }

    /// Handles a surface that is met; returns whether the path goes on.
    fn meet<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        hit: Hit,
        surface: &Surface,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        let object = &scene.objects[hit.shape as usize];
        let wo = -path.walker.d;
        let escape = path.escape.take();

        let point = TexturePoint { p: surface.p, n: surface.ng, uv: surface.uv };
        if object.body.is_some() && hit.exiting != path.inside.contains(hit.shape) {
            counters.contrary += 1;
            path.correct(scene, object, &hit, &point, wavelengths);
        }

        // Let rays through what is cut out.
        let cut_out = object.alpha.is_some_and(|a| {
            let alpha = scene.textures.eval_float(a, &point);
            alpha < 1.0 && rng.uniform() >= alpha
        });
        if cut_out {
            path.standing = Standing::Through(hit);
            return true;
        }

        // Add what the surface emits, shared with light sampling.
        if let Some(l) = scene.lights.light_of(hit.shape, hit.index) {
            let radiance = scene.lights.emitted(l, surface.uv, surface.ng, wo, wavelengths);
            if !radiance.is_black() {
                let share = match (path.walker.direction_pdf, escape) {
                    (Some(pdf), _) => {
                        balance(pdf, scene.lights.pdf_hit(path.walker.scatter_point, path.normal, l, surface.p))
                    }
                    (None, Some(escape)) if object.alpha.is_none() => escape.share(scene, wavelengths, counters),
                    (None, _) => 1.0,
                };
                light.add(path.walker.collisions, path.walker.beta * radiance * share);
            }
        }

        // Pass what is not there: walls of fibres from inside, mere interfaces, boundaries within a body of higher rank, and between equal indices.
        let meeting = match object.body {
            Some(_) => path.inside.meet(object, hit.shape, hit.exiting),
            None => Meeting::True(1.0),
        };
        if object.is_open_to_light(meeting) || (object.fibre && wo.dot(surface.ng) < 0.0) {
            path.change_medium(scene, object, hit, &point, path.walker.d.dot(surface.ng) > 0.0, wavelengths, counters);
            return true;
        }
        let outer = if let Meeting::True(outer) = meeting { outer } else { 1.0 };
        if !path.seen {
            path.seen = true;
            light.normal = surface.ns;
            light.depth = hit.t;
            light.albedo = scene.albedo(object, surface, &point, wavelengths);
        }
        if self.max_depth.is_some_and(|m| path.depth >= m) {
            return false;
        }
        path.depth += 1;

        // Cross smooth refractive boundaries by the reciprocal rule.
        if let Boundary::Smooth { eta } = object.boundary {
            let eta = eta / outer;
            let surface = &Surface { ns: scene.boundary_normal(object, surface), ..*surface };
            let outcome = if std::mem::take(&mut path.whole) {
                self.split(scene, path, hit, surface, eta, wavelengths, rng, light, counters)
            } else {
                crate::bsdf::cross(wo, surface.ng, surface.ns, eta, rng)
            };
            match outcome {
                Crossing::Reflected(d) => {
                    path.turn(d, None);
                    path.stand(object, hit, wo.dot(surface.ng) > 0.0);
                }
                Crossing::Transmitted(d) => {
                    path.turn(d, None);
                    path.transmit(scene, object, hit, &point, wo.dot(surface.ng) <= 0.0, eta, wavelengths, counters);
                }
            }
            return self.survives(path, rng);
        }

        // Every other surface has a BSDF.
        let mut bsdf =
            scene.materials.resolve(object.material, &scene.textures, surface, &point, wavelengths, rng.uniform());
        if let (Bsdf::Dielectric(d), true) = (&mut bsdf.bsdf, outer != 1.0) {
            d.eta /= outer;
        }
        if bsdf.bsdf.wavelength_dependent() {
            path.walker.beta *= Wavelengths::<N>::hero_only();
        }
        let both_sides = bsdf.bsdf.transmits();
        if !bsdf.bsdf.is_specular() {
            let n = (!both_sides).then_some(if wo.dot(surface.ng) > 0.0 { surface.ng } else { -surface.ng });
            connect::at_surface(scene, path, object, hit, surface, &point, &bsdf, n, wavelengths, rng, light, counters);
        }
        let (uc, u) = (rng.uniform(), rng.uniform2());
        let Some(s) = bsdf.sample(wo, uc, u) else {
            return false;
        };
        path.walker.beta *= s.weight(bsdf.cos(s.wi));
        if path.walker.beta.is_black() {
            return false;
        }
        // Coats sample by a random walk: what competes with light sampling is their density as light sampling knows it.
        let pdf = if matches!(bsdf.bsdf, Bsdf::Layered(_)) { bsdf.pdf(wo, s.wi) } else { s.pdf };
        path.turn(s.wi, (!s.specular).then_some(pdf));
        path.normal = (!both_sides).then_some(if wo.dot(surface.ng) > 0.0 { surface.ng } else { -surface.ng });
        let outward = s.wi.dot(surface.ng) > 0.0;
        if s.kind == Kind::Transmission {
            // The BSDF has applied the radiance factor; only the bookkeeping of roulette and media remains.
            path.walker.eta_scale *= s.eta * s.eta;
            path.change_medium(scene, object, hit, &point, outward, wavelengths, counters);
        } else {
            path.stand(object, hit, outward);
        }
        self.survives(path, rng)
    }

    /// Follows the reflected branch of the camera's first smooth boundary with its probability as weight, and leaves the other to
    /// the caller: a bright mirror image seen by one sample in twenty would be most of a pixel's noise.
    fn split<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        hit: Hit,
        surface: &Surface,
        eta: f32,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> Crossing {
        let wo = -path.walker.d;
        let branches = branches(wo, surface.ng, surface.ns, eta);
        let is_reflected = |c: &Crossing| matches!(c, Crossing::Reflected(_));
        let share = |reflected| branches.iter().filter(|b| is_reflected(&b.1) == reflected).map(|b| b.0).sum::<f32>();
        let (reflected, transmitted) = (share(true), share(false));
        // Choose among the outcomes of one kind in proportion to their probabilities.
        let pick = |kind: bool, total: f32, u: f32| {
            let mut left = u * total;
            let mut last = None;
            for (p, c) in branches.iter().filter(|b| is_reflected(&b.1) == kind && b.0 > 0.0) {
                last = Some(*c);
                left -= p;
                if left < 0.0 {
                    break;
                }
            }
            last
        };
        let (u, v) = (rng.uniform(), rng.uniform());
        match (pick(true, reflected, u), pick(false, transmitted, v)) {
            (Some(Crossing::Reflected(d)), Some(other)) => {
                let mut mirror = path.clone();
                mirror.walker.beta *= reflected;
                mirror.turn(d, None);
                mirror.stand(&scene.objects[hit.shape as usize], hit, wo.dot(surface.ng) > 0.0);
                mirror.bounces += 1;
                let start = mirror.walker.collisions;
                self.follow(scene, &mut mirror, wavelengths, rng, light, counters);
                counters.collisions += u64::from(mirror.walker.collisions - start);
                path.walker.beta *= transmitted;
                other
            }
            (Some(only), _) | (None, Some(only)) => only,
            // Probabilities sum to 1, so that some outcome is possible.
            (None, None) => crate::bsdf::cross(wo, surface.ng, surface.ns, eta, rng),
        }
    }

    /// Ends paths of little weight, keeping the mean.
    fn survives<const N: usize>(&self, path: &mut Path<N>, rng: &mut Sampler) -> bool {
        path.bounces += 1;
        if path.bounces <= SURE_BOUNCES {
            return true;
        }
        match self.roulette.play(path.walker.beta.max_value() * path.walker.eta_scale, rng) {
            Some(factor) => {
                path.walker.beta *= factor;
                true
            }
            None => false,
        }
    }
}

/// Returns p / (p + q), the balance heuristic's share of the strategy with density p.
#[inline]
pub(crate) fn balance(p: f32, q: f32) -> f32 {
    if q == 0.0 { 1.0 } else { 1.0 / (1.0 + q / p) }
}

impl<const N: usize> Path<N> {
    /// Sends the walker along d, drawn with a density (`None`: specular).
    fn turn(&mut self, d: Vec3, pdf: Option<f32>) {
        self.walker.d = d;
        self.walker.direction_pdf = pdf;
        self.walker.scatter_point = self.walker.p;
        self.walker.room = 0.0;
        self.normal = None;
    }

    /// Puts the walker on the side of a body on which a hit shows it to be: its wall was missed within rounding, or it meets itself.
    fn correct(
        &mut self,
        scene: &Scene,
        object: &Object,
        hit: &Hit,
        point: &TexturePoint,
        wavelengths: &Wavelengths<N>,
    ) {
        let before = self.index();
        if hit.exiting {
            self.inside.step_into(object, hit.shape, *point);
        } else {
            self.inside.leave(hit.shape);
        }
        self.medium = self.inside.medium(scene, wavelengths, self.ambient);
        self.rescale(before);
    }

    /// Returns the index, against vacuum, of where the walker is.
    fn index(&self) -> f32 {
        self.inside.bodies().last().map_or(1.0, |b| b.index)
    }

    /// Scales radiance by the squared index, where it was `before`.
    fn rescale(&mut self, before: f32) {
        let factor = (before / self.index()).powi(2);
        self.walker.beta *= factor;
        self.walker.eta_scale /= factor;
    }

    /// Moves the walker on by a step and finds out anew what is there; radiance scales with the squared index of that.
    fn free(&mut self, scene: &Scene, step: f32, wavelengths: &Wavelengths<N>) {
        let before = self.index();
        self.walker.p += self.walker.d * step;
        self.walker.room = 0.0;
        self.standing = Standing::Space;
        self.inside = scene.nest_at(self.walker.p);
        self.medium = self.inside.medium(scene, wavelengths, self.ambient);
        self.rescale(before);
    }

    /// Notes that the walker stands on a surface and leaves it on the outer or inner side.
    fn stand(&mut self, object: &Object, hit: Hit, outward: bool) {
        self.standing = match (object.body.is_some(), outward) {
            (true, true) => Standing::Outside(hit),
            (true, false) => Standing::Inside(hit),
            (false, _) => Standing::On(hit),
        };
    }

    /// Refracts into the other side: radiance scaling and medium.
    fn transmit(
        &mut self,
        scene: &Scene,
        object: &Object,
        hit: Hit,
        point: &TexturePoint,
        outward: bool,
        eta: f32,
        wavelengths: &Wavelengths<N>,
        counters: &mut Counters,
    ) {
        let factor = if outward { eta * eta } else { 1.0 / (eta * eta) };
        self.walker.beta *= factor;
        self.walker.eta_scale /= factor;
        self.change_medium(scene, object, hit, point, outward, wavelengths, counters);
    }

    /// Puts the walker on the outer or inner side of an object.
    fn change_medium(
        &mut self,
        scene: &Scene,
        object: &Object,
        hit: Hit,
        point: &TexturePoint,
        outward: bool,
        wavelengths: &Wavelengths<N>,
        counters: &mut Counters,
    ) {
        self.walker.room = 0.0;
        if object.body.is_some() {
            counters.left += u64::from(outward);
            counters.entered += u64::from(!outward);
            self.cross_body(scene, hit.shape, outward, point, wavelengths);
        } else {
            self.medium = scene.medium_beyond(object, outward, point, wavelengths, self.medium);
            if self.inside.bodies().is_empty() {
                self.ambient = self.medium;
            }
        }
        self.stand(object, hit, outward);
    }

    /// Puts the walker into or out of a body.
    fn cross_body(
        &mut self,
        scene: &Scene,
        shape: u32,
        outward: bool,
        point: &TexturePoint,
        wavelengths: &Wavelengths<N>,
    ) {
        self.inside.cross(scene, shape, outward, point, wavelengths, &mut self.medium, &mut self.ambient);
    }
}

impl Standing {
    /// Returns the ray for a flight outside closed bodies.
    #[inline]
    pub(crate) fn ray(&self, scene: &Scene, p: Vec3, d: Vec3) -> Ray {
        let ray = Ray::new(p, d);
        match self {
            Standing::Space => ray,
            Standing::On(hit) | Standing::Through(hit) => ray.from_prim(hit.prim),
            Standing::Outside(hit) => match scene.objects[hit.shape as usize].body {
                Some(body) => ray.from_prim(hit.prim).facing(Facing::Entering(body)),
                None => ray.from_prim(hit.prim),
            },
            Standing::Inside(hit) => match scene.objects[hit.shape as usize].body {
                Some(body) => ray.from_prim(hit.prim).facing(Facing::Exiting(body)),
                None => ray.from_prim(hit.prim),
            },
        }
    }

    /// Returns the ray for a flight inside an object.
    #[inline]
    pub(crate) fn ray_inside(&self, scene: &Scene, inside: Option<u32>, p: Vec3, d: Vec3) -> Ray {
        match inside.and_then(|i| scene.objects[i as usize].body) {
            Some(body) => Ray::new(p, d).from_prim(self.prim()).facing(Facing::Exiting(body)),
            None => self.ray(scene, p, d),
        }
    }

    /// Returns the primitive stood on, or `NONE`.
    #[inline]
    pub(crate) fn prim(&self) -> Prim {
        match self {
            Standing::Space => NONE,
            Standing::On(h) | Standing::Through(h) | Standing::Outside(h) | Standing::Inside(h) => h.prim,
        }
    }
}
