//! Connections to lights: shadow rays through media and index-matched boundaries, with multiple importance sampling.

use moonmilk_core::{Random, Sampler, Spectrum, Vec3, Wavelengths};
use moonmilk_geometry::{Hit, Ray, Surface};
use moonmilk_walk::guide::Leaning;
use moonmilk_walk::hybrid::{Core, Jump};
use moonmilk_walk::jump::{self, Scattering, Turn};
use moonmilk_walk::{Domain, Medium, PhaseFunction, Tally, Walker, math};

use crate::bsdf::Shaded;
use crate::bssrdf::Arriving;
use crate::integrator::{Counters, Light, Path};
use crate::interior::{Interior, Standing};
use crate::lights::LightSample;
use crate::manifold::Manifold;
use crate::media::Matter;
use crate::nest::Nest;
use crate::scene::{Object, Scene};
use crate::texture::TexturePoint;
use crate::through::{self, Ahead, Start, Through, Within};
use crate::tint::Lanes;
use crate::vertices::Seen;
use crate::window::Window;

mod passage;

pub(crate) use passage::{From, Passage, transmittance};

/// Least probability of looking for light at a collision: bounds the weights where lights may hide inside the body.
const LEAST: f32 = 0.02;

/// Returns what a light sample contributes: value x radiance x transmittance over the densities of both strategies.
///
/// `value` is beta times BSDF and cosine, or phase function; `chance` per lane the density with which scattering would have drawn the
/// direction, 0 if it cannot, times the lane's ratio. The path would also have had to get through.
#[inline]
fn weighed<const N: usize>(
    sample: &LightSample<N>,
    value: Spectrum<N>,
    chance: Spectrum<N>,
    passage: &Passage<N>,
) -> Spectrum<N> {
    let density = if sample.is_delta { sample.pdf } else { sample.pdf + (chance * passage.chance).mean() };
    value * passage.t * sample.radiance * (passage.survival / density)
}

/// Returns a sample with the opacity of the light at its point, `None` where the light is cut out.
fn opaque<const N: usize>(scene: &Scene, sample: LightSample<N>) -> Option<LightSample<N>> {
    let Some(id) = sample.alpha else {
        return Some(sample);
    };
    let at = TexturePoint { p: sample.point, n: sample.front, uv: sample.uv };
    let alpha = scene.textures.eval_float(id, &at).clamp(0.0, 1.0);
    (alpha > 0.0).then(|| LightSample { radiance: sample.radiance * alpha, ..sample })
}

/// Samples a light from a point of a surface; returns its direction and the irradiance by it, where directions in proportion to the cosine compete.
pub(crate) fn sampled<const N: usize>(
    scene: &Scene,
    from: &From<N>,
    n: Vec3,
    wavelengths: &Wavelengths<N>,
    rng: &mut Sampler,
    counters: &mut Counters,
) -> Option<(Vec3, Spectrum<N>)> {
    if scene.lights.is_empty() {
        return None;
    }
    let u = [rng.uniform(), rng.uniform(), rng.uniform()];
    let sample = opaque(scene, scene.lights.sample(from.p, Some(n), wavelengths, u)?)?;
    let cos = sample.wi.dot(n);
    if cos <= 0.0 || sample.radiance.is_black() {
        return None;
    }
    let passage = transmittance(scene, from, sample.wi, sample.distance, wavelengths, rng, counters);
    let chance = Spectrum::splat(cos * std::f32::consts::FRAC_1_PI);
    (!passage.is_black()).then(|| (sample.wi, weighed(&sample, Spectrum::splat(cos), chance, &passage)))
}

/// Samples a light from a surface and adds its contribution; `arriving` is what else there is to say of light that enters a body of a model.
pub(crate) fn at_surface<const N: usize>(
    scene: &Scene,
    path: &Path<N>,
    object: &Object,
    hit: Hit,
    surface: &Surface,
    bsdf: &Shaded<N>,
    arriving: Option<&Arriving<N>>,
    n: Option<Vec3>,
    wavelengths: &Wavelengths<N>,
    rng: &mut Sampler,
    light: &mut Light<N>,
    counters: &mut Counters,
) {
    if scene.lights.is_empty() {
        return;
    }
    let u = [rng.uniform(), rng.uniform(), rng.uniform()];
    let Some(sample) = scene.lights.sample(surface.p, n, wavelengths, u) else {
        return;
    };
    let Some(sample) = opaque(scene, sample) else {
        return;
    };
    let wo = -path.walker.d;
    let (f, pdf) = bsdf.eval_cos_pdf(wo, sample.wi);
    if f.is_black() || sample.radiance.is_black() {
        return;
    }
    // Start on the side towards the light, in the medium there.
    let mut from = From {
        p: surface.p,
        standing: path.standing,
        medium: path.medium,
        ambient: path.ambient,
        inside: path.inside.clone(),
    };
    let outward = sample.wi.dot(surface.ng) > 0.0;
    if outward == (wo.dot(surface.ng) > 0.0) {
        from.standing = match (object.body.is_some(), outward) {
            (true, true) => Standing::Outside(hit),
            (true, false) => Standing::Inside(hit),
            (false, _) => Standing::On(hit),
        };
    } else {
        let point = TexturePoint { p: surface.p, n: surface.ng, uv: surface.uv };
        from.cross(scene, object, hit, &point, outward, wavelengths);
    }
    let passage = transmittance(scene, &from, sample.wi, sample.distance, wavelengths, rng, counters);
    if !passage.is_black() {
        let f = arriving.map_or(f, |a| f * a.factor(sample.wi, rng));
        light.add(path.walker.collisions, weighed(&sample, path.walker.beta * f, path.walker.ratio * pdf, &passage));
    }
}

/// Looks for light at every collision of a walk, and adds what the medium emits.
pub(crate) struct InMedium<'a, 'b, const N: usize> {
    pub scene: &'a Scene,
    pub wavelengths: &'a Wavelengths<N>,
    pub light: &'b mut Light<N>,
    pub counters: &'b mut Counters,
    pub interior: &'b Interior<'a>,
    pub inside: &'b Nest,
    /// Medium around all bodies.
    pub ambient: Option<Matter<N>>,
    /// The medium walked in.
    pub around: Matter<N>,
    pub connects: bool,
    /// Connections through the object's boundary.
    pub through: Option<Through<'a>>,
    /// Searches for lamps without extent behind the object's boundary.
    pub manifold: Option<Manifold<'a>>,
    /// Vertices of light's paths.
    pub seen: Option<Seen<'a>>,
    /// Splitting by importance, the copies of the walker still to be followed, and where their flights begin.
    pub window: Option<Window<'a>>,
    pub copies: Vec<(Walker<N>, Start)>,
    /// The lanes when the walk began, where they may part.
    pub lanes: Option<Lanes<N>>,
    /// Weight of lights without extent.
    pub unseen: f32,
    /// Jumps through the core of the body.
    pub core: Option<Core<N>>,
}

impl<const N: usize> InMedium<'_, '_, N> {
    /// Notes what the lanes have drifted to at the end of the walk.
    #[inline]
    pub fn settle(&mut self, walker: &Walker<N>) {
        if let Some(lanes) = &mut self.lanes {
            lanes.settle(walker, self.light);
        }
    }

    /// Notes that several copies of the walker go on, of which each drifts by itself.
    #[inline]
    fn divided(&mut self, walker: &Walker<N>, copies: u32) -> Option<u32> {
        if copies > 1 {
            self.settle(walker);
        }
        Some(copies)
    }
}

impl<const N: usize, P: PhaseFunction> Tally<N, Sampler, P> for InMedium<'_, '_, N> {
    #[inline]
    fn arrives(&mut self, walker: &Walker<N>, medium: &Medium<N, P>, rng: &mut Sampler) -> bool {
        // What the flight was shared with has counted already.
        let (Some(seen), Some(from)) = (&self.seen, self.interior.flown()) else { return true };
        rng.uniform() >= seen.weight(medium, from.distance(walker.p), walker.room)
    }

    #[inline]
    fn collision(&mut self, walker: &mut Walker<N>, medium: &Medium<N, P>, arrived: Spectrum<N>, rng: &mut Sampler) {
        self.settle(walker);
        if let Some(emission) = medium.emission {
            self.light.add(walker.collisions - 1, arrived * medium.sigma_a * emission);
        }
        self.find_light(walker, medium, arrived * medium.sigma_s, &Turn { medium, from: walker.d }, rng);
    }

    #[inline]
    fn leaning(
        &mut self,
        walker: &mut Walker<N>,
        medium: &Medium<N, P>,
        arrived: Spectrum<N>,
        vertex: &Leaning<'_, N, P>,
        rng: &mut Sampler,
    ) {
        self.settle(walker);
        if let Some(emission) = medium.emission {
            self.light.add(walker.collisions - 1, arrived * medium.sigma_a * emission);
        }
        self.find_light(walker, medium, walker.beta, vertex, rng);
    }

    #[inline]
    fn exit(&mut self, walker: &mut Walker<N>, medium: &Medium<N, P>, exit: &jump::Exit<N>, rng: &mut Sampler) {
        self.settle(walker);
        self.counters.jumps += 1;
        self.find_light(walker, medium, walker.beta, exit, rng);
    }

    #[inline]
    fn search(&mut self, weight: f32) {
        self.unseen = weight;
    }

    #[inline]
    fn leapt(
        &mut self,
        walker: &mut Walker<N>,
        medium: &Medium<N, P>,
        _collisions: u32,
        rng: &mut Sampler,
    ) -> Option<u32> {
        self.counters.jumps += 1;
        if self.through.is_some() {
            let depth = medium.sigma_t[0] * walker.room.max(self.interior.room_at(walker.p));
            self.interior.set_start(through::landed(depth));
        }
        let copies = self.window.as_ref()?.divide(walker, rng, self.counters);
        self.divided(walker, copies)
    }

    #[inline]
    fn copies(&mut self, walker: &mut Walker<N>, rng: &mut Sampler) -> Option<u32> {
        if let Some(seen) = &self.seen {
            let copies = seen.copies(walker)?;
            return self.divided(walker, copies);
        }
        let copies = self.window.as_ref()?.copies(walker, rng, self.counters);
        self.divided(walker, copies)
    }

    fn copy(&mut self, walker: &Walker<N>) {
        self.copies.push((*walker, self.interior.began()));
    }

    #[inline]
    fn jump(&mut self, walker: &Walker<N>, rng: &mut Sampler) -> Option<Jump<N>> {
        // Lights inside are no part of the core.
        let room = |p: Vec3| {
            let room = self.interior.room_at(p);
            Domain::<N>::clear(self.interior, p, room, f32::INFINITY, f32::INFINITY)
        };
        let jump = self.core.as_ref()?.jump(walker.p, walker.d, room, rng)?;
        self.counters.jumps += 1;
        self.interior.set_start(Start::Deep);
        Some(jump)
    }

    #[inline]
    fn landed(&mut self, walker: &Walker<N>, rng: &mut Sampler) -> bool {
        if self.connects {
            self.sample_light(walker, &Uniform, walker.beta, rng);
        }
        if let Some(manifold) = &self.manifold {
            // Jumps through a core know homogeneous media only.
            let sigma_t = match &self.around {
                Matter::Homogeneous(m) | Matter::Similar(m, _) => m.sigma_t[0],
                Matter::Field(_) => 0.0,
            };
            let (from, beta, room) = (self.from(walker.p), walker.beta, walker.room);
            let (light, counters) = (&mut *self.light, &mut *self.counters);
            manifold.connect(walker, beta, &Uniform, sigma_t, room, from, self.wavelengths, rng, light, counters);
        }
        self.connects
    }

    #[inline]
    fn emission(&mut self, walker: &Walker<N>, radiance: Spectrum<N>) {
        self.light.add(walker.collisions, radiance);
    }

    #[inline]
    fn null_collision(&mut self) {
        self.counters.null_collisions += 1;
    }

    #[inline]
    fn connects(&self) -> bool {
        self.connects || self.through.is_some() || self.manifold.is_some() || self.seen.is_some()
    }

    #[inline]
    fn sight(&self, walker: &Walker<N>) -> f32 {
        self.through.as_ref().map_or(0.0, |t| t.sight(&self.interior.began(), walker.p, walker.d))
    }

    fn glimpse(&mut self, walker: &Walker<N>, medium: &Medium<N, P>, t: f32, rng: &mut Sampler) {
        let Some(through) = &self.through else { return };
        let ray = Ray::new(walker.p, walker.d);
        if let Some((hit, p, ng, ns)) = self.interior.ahead(&ray) {
            let at = Ahead { hit, t, p, ng, ns };
            let (began, within) = (self.interior.began(), self.within());
            through.look(walker, medium, &began, &at, &within, self.wavelengths, rng, self.light, self.counters);
        }
    }
}

/// A vertex that sends light in all directions alike.
struct Uniform;

impl<const N: usize> Scattering<N> for Uniform {
    fn towards(&self, _d: Vec3) -> (Spectrum<N>, Spectrum<N>) {
        let all = Spectrum::splat(0.25 * std::f32::consts::FRAC_1_PI);
        (all, all)
    }

    fn uniform(&self) -> Option<Spectrum<N>> {
        Some(Spectrum::splat(0.25 * std::f32::consts::FRAC_1_PI))
    }

    fn draw(&self, rng: &mut impl Random) -> Vec3 {
        math::uniform_sphere(rng.uniform2())
    }
}

impl<'b, const N: usize> InMedium<'_, 'b, N> {
    /// Returns where the walk is.
    fn within(&self) -> Within<'b, N> {
        Within { nest: self.inside, ambient: self.ambient }
    }

    /// Looks for light from a vertex where the walk has the weight `beta` before a direction is chosen.
    #[inline]
    fn find_light<P: PhaseFunction>(
        &mut self,
        walker: &Walker<N>,
        medium: &Medium<N, P>,
        beta: Spectrum<N>,
        vertex: &impl Scattering<N>,
        rng: &mut Sampler,
    ) {
        // Walks in homogeneous media know it already.
        let room = if walker.room > 0.0 { walker.room } else { self.interior.room_at(walker.p) };
        if let Some(through) = &self.through {
            let (w, within) = (self.wavelengths, self.within());
            let start = through.connect(walker, medium, beta, vertex, room, &within, w, rng, self.light, self.counters);
            self.interior.set_start(start);
        }
        if let Some(seen) = &self.seen {
            let light = seen.gather(walker.p, medium, beta, vertex, room, rng, self.counters);
            self.light.add(walker.collisions + 1, light);
            self.interior.set_flown(walker.p);
        }
        if let Some(manifold) = &self.manifold {
            let from = self.from(walker.p);
            let (beta, w, sigma_t) = (beta * self.unseen, self.wavelengths, medium.sigma_t[0]);
            manifold.connect(walker, beta, vertex, sigma_t, room, from, w, rng, self.light, self.counters);
        }
        if self.connects {
            // Look for light less often where little can come through: the transmittance to the wall, at most
            // exp(-sigma_t room), is the probability; dividing by it keeps the mean.
            // In a field the coefficients here say nothing about the way to the wall.
            let through = match self.around {
                Matter::Homogeneous(_) | Matter::Similar(..) => (-medium.sigma_t.min_value() * room).exp().min(1.0),
                Matter::Field(_) => 1.0,
            };
            let probability = if through > 0.5 { 1.0 } else { (2.0 * through).max(LEAST) };
            if probability == 1.0 || rng.uniform() < probability {
                self.sample_light(walker, vertex, beta * (1.0 / probability), rng);
            }
        }
    }

    fn from(&self, p: Vec3) -> From<N> {
        From {
            p,
            standing: Standing::Space,
            medium: Some(self.around),
            ambient: self.ambient,
            inside: self.inside.clone(),
        }
    }

    fn sample_light(&mut self, walker: &Walker<N>, vertex: &impl Scattering<N>, beta: Spectrum<N>, rng: &mut Sampler) {
        let u = [rng.uniform(), rng.uniform(), rng.uniform()];
        let Some(sample) = self.scene.lights.sample(walker.p, None, self.wavelengths, u) else {
            return;
        };
        let Some(sample) = opaque(self.scene, sample).filter(|s| !s.radiance.is_black()) else {
            return;
        };
        let (value, _) = vertex.towards(sample.wi);
        if value.is_black() {
            return;
        }
        let from = self.from(walker.p);
        let passage =
            transmittance(self.scene, &from, sample.wi, sample.distance, self.wavelengths, rng, self.counters);
        if !passage.is_black() {
            let beta = if sample.is_delta { beta * self.unseen } else { beta };
            let chance = walker.ratio * vertex.through(sample.wi, passage.first.unwrap_or(0.0));
            self.light.add(walker.collisions, weighed(&sample, beta * value, chance, &passage));
        }
    }
}
