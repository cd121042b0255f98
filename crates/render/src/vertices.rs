//! Vertices of light's paths inside bodies, shared by all pixels of a sample number: many ends for every beginning.
//!
//! For one sample number light is followed into each body that is fit for it: lines at random through the ball around it meet its surface in points of uniform density
//! ([`crate::cloud`]), a light sample and a path say what falls there and whence, some of these beams are drawn in proportion to their flux, refracted, and walked until they
//! leave (`wall.rs`). Every collision is a *vertex*: a place, the direction of arrival and the flux that it scatters. A camera's path then adds at its collision x, for all vertices y,
//!
//! $$ \sum_y w(r)\, \beta\, p(\omega \cdot \omega_{xy})\, \frac{e^{-\sigma_t r}}{r^2}\, p(\omega_y \cdot \omega_{yx})\, \Phi_y , \qquad r = |x - y| , $$
//!
//! and where its own next flight ends in a collision at a distance r without a wall between, it goes on with probability 1 - w(r) alone. All paths of a number of collisions are so shared between as many
//! strategies as they have collisions, with weights that sum to 1, whatever the function w. It is the balance heuristic against what is typical:
//!
//! $$ w(r) = \frac{n}{n + 2 q(r)}, \qquad q(r) = \frac{\sigma_t\, e^{-\sigma_t r}}{4 \pi r^2}, $$
//!
//! n the mean number of vertices per volume (less in the depth, where they are thinned out); w / r^2 has no pole, and no vertex contributes more than half of what a flight would that ends at it. So a path of the camera ends after some two collisions, whatever the body's density, and sees a
//! mean over hundreds of vertices: bidirectional path tracing with a cache of light vertices \[Davidovic2014\], whose far vertices are
//! thinned by a tree without bias.
//!
//! *Walls between.* Of what the tree visits one is drawn in proportion to its contribution, and a ray looks whether it is seen; within the free room of x that needs no ray.
//!
//! *Colours.* Each path of light draws the lane that it follows: so its weights are right beside those of a camera's path, which follows the sample's first. The sample number has one set of wavelengths.
//!
//! *Correlation.* All pixels share the vertices of one sample number: their errors are correlated, within one sample number alone.

use moonmilk_core::random::mix;
use moonmilk_core::{Random, Sampler, Spectrum, Stream, Vec2, Vec3, WavelengthMode, Wavelengths};
use moonmilk_geometry::{Facing, Hit, Ray, Surface};
use moonmilk_walk::jump::Scattering;
use moonmilk_walk::{Medium, Outcome, PhaseFunction, Roulette, Tally, Walker, classic};
use rayon::prelude::*;

use crate::cloud;
use crate::integrator::{Counters, Integrator};
use crate::interior::{Exit, Interior, Standing};
use crate::media::Matter;
use crate::nest::{Inside, Nest};
use crate::scene::Scene;
use crate::texture::TexturePoint;
use crate::touch::{self, Arrival};

mod eights;
mod fit;
mod sum;
mod wall;

use eights::{Tree, Vertex};
pub(crate) use fit::{Lit, bodies};
use sum::Sum;
use wall::Wall;

/// Word that separates the random numbers of light's paths from those of pixels.
const LIGHT: u64 = 0x11_6487;
/// Work done together.
const BATCH: u32 = 64;
/// Density of flights against that of vertices, in the weights. On the marble dragon .25, .5, 2, 8 leave a variance per sample of .389, .364, .338, .328 at .94, .97, 1.01, 1.11 CPU s.
const FLIGHTS: f32 = 2.0;
/// Flights from a camera path's first collision. On the dragon 1, 2, 3: variance .425, .330, .300 at .78, .91, 1.05 CPU s.
const COPIES: u32 = 2;
/// Radius over distance below which a node of the tree stands for its vertices. On the dragon .5, .6, .7, .8: variance .418, .423, .432, .451 at .98, .89, .83, .78 CPU s.
const ANGLE: f32 = 0.75;
/// Distance beyond which vertices are thinned out further, and over which to a third [mean free paths].
const NEAR: f32 = 1.5;
const FADE: f32 = 0.5;
/// Depth from which vertices are thinned out, and the least share of them that is kept [mean free paths].
const SHALLOW: f32 = 1.5;
const FEWEST: f32 = 0.05;
/// Share of a segment that is looked along: its end is no wall.
const END: f32 = 1.0 - 1e-4;

/// Returns the share of vertices that are kept at a depth below the surface [mean free paths], of which camera's paths see only the shallow ones well.
fn kept(depth: f32) -> f32 {
    (SHALLOW - depth).exp().clamp(FEWEST, 1.0)
}

/// The vertices of one sample number.
#[derive(Debug)]
pub(crate) struct Vertices {
    /// The variate of the wavelengths of this sample number.
    pub wavelength: f32,
    bodies: Vec<Body>,
    /// What following the light did.
    pub counters: Counters,
    /// Beams or vertices that were not finite, counted as 0.
    pub invalid: u64,
}

/// A body and its vertices.
#[derive(Debug)]
struct Body {
    shape: u32,
    /// n \[1/L^3\].
    density: f32,
    /// Scattering and absorption where the light was followed: textured bodies differ from entry to entry.
    medium: [[f32; 4]; 2],
    tree: Tree,
}

/// Returns a medium's coefficients.
fn coefficients<const N: usize>(medium: &Medium<N>) -> [[f32; 4]; 2] {
    [medium.sigma_s, medium.sigma_a].map(|s| std::array::from_fn(|k| if k < N { s[k] } else { 0.0 }))
}

/// Light that arrives at a body's surface from outside.
#[derive(Clone, Copy)]
struct Beam<const N: usize> {
    hit: Hit,
    surface: Surface,
    /// Direction towards where it comes from.
    wi: Vec3,
    flux: Spectrum<N>,
}

impl Vertices {
    /// Returns the vertices of a sample number; `None` where no body has any, or where the number of bounces is limited.
    pub fn new(scene: &Scene, integrator: &Integrator, sample: u64) -> Option<Self> {
        if scene.lit(integrator.policy).is_empty() || integrator.max_depth.is_some() {
            return None;
        }
        Some(match integrator.wavelengths {
            WavelengthMode::Hero => Self::follow::<4>(scene, integrator, sample),
            WavelengthMode::Rgb => Self::follow::<3>(scene, integrator, sample),
            WavelengthMode::Mono(_) => Self::follow::<1>(scene, integrator, sample),
        })
    }

    fn follow<const N: usize>(scene: &Scene, integrator: &Integrator, sample: u64) -> Self {
        let wavelength = cloud::wavelength(integrator.seed, sample);
        let wavelengths = Wavelengths::<N>::sample(integrator.wavelengths, wavelength);
        let seed = mix(mix(integrator.seed, LIGHT), sample);
        let mut all = Self { wavelength, bodies: vec![], counters: Counters::default(), invalid: 0 };
        for lit in scene.lit(integrator.policy) {
            let seed = mix(seed, u64::from(lit.shape));
            let object = &scene.objects[lit.shape as usize];
            let at = TexturePoint { p: object.reach.center(), n: Vec3::Z, uv: Vec2::ZERO };
            let Some(Matter::Homogeneous(medium)) = scene.medium_inside(object, &at, &wavelengths, None) else {
                continue;
            };
            let beams = all.arriving(scene, integrator, lit, &wavelengths, seed);
            // Draw as many as there are paths, in proportion to flux, one per equal step of its sum.
            let flux: Vec<f64> = beams.iter().map(|b| f64::from(b.flux.mean())).collect();
            let total: f64 = flux.iter().sum();
            if total <= 0.0 {
                continue;
            }
            let step = total / f64::from(lit.paths);
            let mut next = step * f64::from(Sampler::new(seed, u32::MAX, 0, 0).uniform());
            let mut chosen: Vec<Beam<N>> = Vec::with_capacity(lit.paths as usize);
            let mut sum = 0.0;
            for (beam, flux) in beams.iter().zip(flux) {
                sum += flux;
                while next < sum && chosen.len() < lit.paths as usize {
                    chosen.push(Beam { flux: beam.flux * (step / flux) as f32, ..*beam });
                    next += step;
                }
            }
            let walked: Vec<(Vec<Vertex>, [u64; 2])> = chosen
                .par_chunks(BATCH as usize)
                .enumerate()
                .map(|(b, beams)| {
                    let mut points = Vec::new();
                    let mut done = [0, 0];
                    for (j, beam) in beams.iter().enumerate() {
                        let mut rng = Sampler::new(seed, 1, b as u32, j as u64);
                        let [collisions, segments] =
                            beam.walk(scene, &medium, &wavelengths, integrator.roulette, &mut points, &mut rng);
                        done = [done[0] + collisions, done[1] + segments];
                    }
                    (points, done)
                })
                .collect();
            let mut points = Vec::with_capacity(walked.iter().map(|w| w.0.len()).sum());
            for (some, [collisions, segments]) in walked {
                points.extend(some);
                all.counters.collisions += collisions;
                all.counters.segments += segments;
            }
            let before = points.len();
            points.retain(|p| p.light.iter().all(|l| l.is_finite()));
            all.invalid += (before - points.len()) as u64;
            all.bodies.push(Body {
                shape: lit.shape,
                density: lit.density,
                medium: coefficients(&medium),
                tree: Tree::new(points, seed),
            });
        }
        all
    }

    /// Returns beams that arrive at a body, whose sums are what falls there.
    fn arriving<const N: usize>(
        &mut self,
        scene: &Scene,
        integrator: &Integrator,
        lit: &Lit,
        wavelengths: &Wavelengths<N>,
        seed: u64,
    ) -> Vec<Beam<N>> {
        let batches: Vec<(Vec<Beam<N>>, Counters, u64)> = (0..lit.lines.div_ceil(BATCH))
            .into_par_iter()
            .map(|b| {
                let (mut beams, mut counters, mut invalid) = (Vec::new(), Counters::default(), 0);
                for j in BATCH * b..(BATCH * (b + 1)).min(lit.lines) {
                    let mut rng = Sampler::new(seed, 0, 0, u64::from(j));
                    let (ray, hits) = lit.through.meet(scene, &mut rng, |s| s == lit.shape);
                    for hit in hits {
                        let surface = scene.accel.surface(&ray, &hit);
                        let found = integrator.falling(scene, hit, &surface, wavelengths, &mut rng, &mut counters);
                        for (wi, light) in found.into_iter().flatten() {
                            let flux = light * (1.0 / lit.points) as f32;
                            if flux.is_finite() {
                                beams.push(Beam { hit, surface, wi, flux });
                            } else {
                                invalid += 1;
                            }
                        }
                    }
                }
                (beams, counters, invalid)
            })
            .collect();
        let mut beams = Vec::with_capacity(batches.iter().map(|b| b.0.len()).sum());
        for (batch, done, bad) in batches {
            beams.extend(batch);
            self.counters.merge(&done);
            self.invalid += bad;
        }
        beams
    }

    /// Returns the vertices of the one body that a path is in.
    pub fn seen_from<'a, const N: usize>(
        &'a self,
        scene: &'a Scene,
        nest: &Nest,
        medium: &Medium<N>,
    ) -> Option<Seen<'a>> {
        let [Inside { shape, .. }] = *nest.bodies() else { return None };
        let body = self.bodies.iter().find(|b| b.shape == shape)?;
        (body.medium == coefficients(medium)).then_some(Seen { scene, body })
    }
}

/// Records the collisions of a path of light.
struct Recorder<'a, const N: usize> {
    interior: &'a Interior<'a>,
    points: &'a mut Vec<Vertex>,
    flux: Spectrum<N>,
    /// The lane that was put first.
    first: usize,
    collisions: u64,
}

/// Returns a spectrum with its first lane exchanged for another, which undoes itself.
fn exchanged<const N: usize>(s: Spectrum<N>, first: usize) -> Spectrum<N> {
    let mut lanes = s.0;
    lanes.swap(0, first);
    Spectrum(lanes)
}

impl<const N: usize, P: PhaseFunction> Tally<N, Sampler, P> for Recorder<'_, N> {
    fn collision(&mut self, walker: &mut Walker<N>, medium: &Medium<N, P>, arrived: Spectrum<N>, rng: &mut Sampler) {
        self.collisions += 1;
        let kept = kept(medium.sigma_t.mean() * self.interior.room_at(walker.p));
        if kept < 1.0 && rng.uniform() >= kept {
            return;
        }
        let light = exchanged(arrived * medium.sigma_s, self.first) * self.flux * (1.0 / kept);
        let lanes = std::array::from_fn(|k| if k < N { light[k] } else { 0.0 });
        self.points.push(Vertex { p: walker.p, d: walker.d, light: lanes, kept });
    }
}

impl<const N: usize> Beam<N> {
    /// Refracts the beam into the body and follows it until it leaves; records its collisions and returns their number and that of segments cast.
    fn walk(
        &self,
        scene: &Scene,
        medium: &Medium<N>,
        wavelengths: &Wavelengths<N>,
        roulette: Roulette,
        points: &mut Vec<Vertex>,
        rng: &mut Sampler,
    ) -> [u64; 2] {
        let shape = self.hit.shape;
        let object = &scene.objects[shape as usize];
        let mut nest = Nest::default();
        let wall = Wall::of(scene, object, nest.meet(object, shape, false));
        let s = &self.surface;
        nest.step_into(object, shape, TexturePoint { p: s.p, n: s.ng, uv: s.uv });
        let Some((d, share)) = wall.enter(scene, object, s, self.wi, wavelengths, rng) else { return [0, 0] };
        let mut flux = self.flux * share;
        // Draw the lane that is followed.
        let first = if N > 1 && !medium.is_gray() { (rng.uniform() * N as f32) as usize % N } else { 0 };
        let medium = if first == 0 {
            *medium
        } else {
            Medium::new(exchanged(medium.sigma_a, first), exchanged(medium.sigma_s, first), medium.g)
        };
        let mut walker = Walker::new(s.p, d);
        let mut standing = Standing::Inside(self.hit);
        let (mut segments, mut collisions) = (0, 0);
        loop {
            let interior = Interior::new(scene, &nest, false, standing, None);
            let mut recorder = Recorder { interior: &interior, points, flux, first, collisions: 0 };
            let outcome = classic::walk(&interior, &medium, &roulette.into(), &mut walker, &mut recorder, rng);
            segments += interior.segments();
            collisions += recorder.collisions;
            let Outcome::Left(Exit::Surface(hit, surface)) = outcome else { return [collisions, segments] };
            // Where something touches the body, its own wall may be found second.
            let own = match touch::arrival(scene, &nest, &hit, &surface, walker.d) {
                Arrival::Ghost => {
                    standing = Standing::Through(hit);
                    continue;
                }
                Arrival::This if hit.shape == shape && hit.exiting => Some((hit, surface)),
                Arrival::Other(hit, surface) if hit.shape == shape => Some((hit, surface)),
                _ => None,
            };
            let turned = own.and_then(|(hit, surface)| {
                let (d, share) = wall.turn(scene, object, &surface, walker.d, wavelengths, rng)?;
                Some((hit, surface, d, share))
            });
            let Some((hit, surface, d, share)) = turned else { return [collisions, segments] };
            (walker.p, walker.d, walker.room) = (surface.p, d, 0.0);
            flux *= share;
            standing = Standing::Inside(hit);
        }
    }
}

/// Returns the transmittance over a distance, by one exponential where all lanes share it.
#[inline]
fn transmittance<const N: usize, P>(medium: &Medium<N, P>, r: f32) -> Spectrum<N> {
    if medium.is_gray() { Spectrum::splat((-medium.sigma_t[0] * r).exp()) } else { medium.transmittance(r) }
}

/// The vertices of a body, as a camera's path in it sees them.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    scene: &'a Scene,
    body: &'a Body,
}

impl Seen<'_> {
    /// Returns how many copies of a walker go on from a collision, and weighs it as one of them: most end at once, and those that a wall reflects carry half of what there is to see.
    #[inline]
    pub fn copies<const N: usize>(&self, walker: &mut Walker<N>) -> Option<u32> {
        (walker.collisions == 1).then(|| {
            walker.beta *= 1.0 / COPIES as f32;
            COPIES
        })
    }

    /// Returns w(r) / r^2 \[1/L^2\], where the transmittance over r is t.
    #[inline]
    fn weight_over_square<const N: usize, P>(&self, medium: &Medium<N, P>, r: f32, t: Spectrum<N>, kept: f32) -> f32 {
        let q = (medium.sigma_t * t).mean() * (0.25 * std::f32::consts::FRAC_1_PI);
        let n = self.body.density * kept;
        n / (n * r * r + FLIGHTS * q)
    }

    /// Returns w at a distance: the share of the vertices in paths with a flight of that length to a point that has this room.
    #[inline]
    pub fn weight<const N: usize, P>(&self, medium: &Medium<N, P>, r: f32, room: f32) -> f32 {
        let kept = kept(medium.sigma_t.mean() * room);
        r * r * self.weight_over_square(medium, r, transmittance(medium, r), kept)
    }

    /// Returns the light of all vertices that a collision of weight `beta` sees; `room` is a lower bound of its distance to any wall.
    pub fn gather<const N: usize, P: PhaseFunction>(
        &self,
        p: Vec3,
        medium: &Medium<N, P>,
        beta: Spectrum<N>,
        vertex: &impl Scattering<N>,
        room: f32,
        rng: &mut Sampler,
        counters: &mut Counters,
    ) -> Spectrum<N> {
        let mean_free_path = 1.0 / medium.sigma_t.mean();
        // One key from the path's stream, two streams of its own.
        let key = rng.stream().bits();
        let mut visits = Stream::new(&[key, 0]);
        let mut sum = Sum::new(p, self.body.density, medium, vertex, Stream::new(&[key, 1]));
        self.body.tree.survey(p, ANGLE, NEAR * mean_free_path, FADE * mean_free_path, &mut visits, |eight, weights| {
            sum.add(eight, weights);
        });
        let Some((y, r2, colour)) = sum.drawn else { return Spectrum::ZERO };
        let (mut sum, total) = (sum.light(), sum.total);
        let r = r2.sqrt();
        if r > room && self.is_hidden(p, y, r, counters) {
            // What is not hidden of the whole is the whole less the hidden: of one lane, nothing.
            sum = sum - colour * total;
        }
        sum * beta
    }

    /// Returns whether a wall is between two points of the body.
    fn is_hidden(&self, p: Vec3, y: Vec3, r: f32, counters: &mut Counters) -> bool {
        let Some(body) = self.scene.objects[self.body.shape as usize].body else { return true };
        counters.shadow_rays += 1;
        let ray = Ray::new(p, (y - p) / r).up_to(r * END).facing(Facing::Exiting(body));
        self.scene.accel.occluded(&ray, |_| true)
    }
}
