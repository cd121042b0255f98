//! Points on the bodies that a model renders, with the light that falls there: many ways in for every way out.
//!
//! For one sample number, of all pixels together, lines at random through the ball around each body (or set of bodies) meet its surface in points of uniform
//! density (Crofton)
//!
//! $$ n = K / (2 \pi \rho^2) \quad [1/L^2] $$
//!
//! for K lines and a ball of radius rho, whatever the shape and its triangles. Each point gets an unbiased estimate of the light E that enters there: a light
//! sample and a path. What leaves at x_o is then
//!
//! $$ \sum_i w_c(r_i)\, \frac{R(r_i)}{n}\, E_i \;+\; \text{lines from } x_o, \text{ with weights } 1 - w_c, \qquad w_c = \frac{n}{n + q/2}, $$
//!
//! q the density per area of [`crate::bssrdf`]'s radii: the points serve where there are many within reach, the lines near x_o and where bodies are too large for
//! the points. As w_c depends on the distance alone, the sum of both is free of bias for any n; R w_c / n stays below 2 R / q.
//!
//! **Clusters.** A tree holds the points; a node that is small against the change of R over it (`TOLERANCE` of the whole) stands for its points by one of
//! them, drawn in proportion to E when the tree is made. Which nodes do depends on places and sums alone, not on those draws, so the mean is kept
//! \[Jensen2002 for the idea of a tree; here without its bias\].
//!
//! All pixels share the points of one sample number, and its wavelengths: their errors are correlated, within one sample number alone.

use moonmilk_core::random::{SCRAMBLINGS, mix};
use moonmilk_core::{Random, Sampler, Spectrum, Vec2, Vec3, WavelengthMode, Wavelengths};
use moonmilk_geometry::{Bounds, Hit, Ray};
use moonmilk_walk::Medium;
use rayon::prelude::*;

use crate::bssrdf::{Exit, Kernel};
use crate::integrator::{Counters, Integrator};
use crate::scene::Scene;
use crate::texture::TexturePoint;

mod lines;
mod tree;

pub(crate) use lines::Lines;
pub(crate) use tree::{Point, Tree};

/// Word that separates the random numbers of points from those of pixels.
const CLOUD: u64 = 0xC10D;
/// Points per pixel of the whole picture.
const PER_PIXEL: f64 = 0.5;
/// Fewest and most points of one sample number.
const POINTS: [f64; 2] = [2048.0, 65536.0];
/// Most lines per point: bodies that lines seldom meet get fewer points.
const LINES: f64 = 8.0;
/// Lines that measure the area of one body.
const PILOT: u32 = 512;
/// Bodies with points: beyond that, each would have too few to be of use.
const MOST: usize = 256;
/// Lines whose points are followed together.
const BATCH: u32 = 128;

/// A body, or set of bodies, and the lines through it.
#[derive(Clone, Debug)]
pub(crate) struct Site {
    /// Number of the set.
    pub set: u32,
    through: Lines,
    lines: u32,
    /// n \[1/L^2\].
    pub density: f64,
}

/// The points of one sample number.
#[derive(Debug)]
pub(crate) struct Cloud {
    /// The variate of the wavelengths of this sample number.
    pub wavelength: f32,
    /// One per site of the scene, with the kernel of its first medium.
    trees: Vec<(Tree, Option<Kernel>)>,
    /// What following the points' paths did.
    pub counters: Counters,
    /// Points whose light was not finite, counted as 0.
    pub invalid: u64,
}

/// Returns the sites of a scene: sets of bodies that a radial model renders and that no other body reaches into. What one line in 500 never meets has none.
pub(crate) fn sites(scene: &Scene) -> Vec<Site> {
    let mut sets: Vec<(u32, Bounds)> = scene
        .objects
        .iter()
        .filter(|o| scene.bank(o).is_some_and(|b| !b.knows_directions()))
        .map(|o| (o.set(), o.common))
        .collect();
    sets.sort_by_key(|s| s.0);
    sets.dedup_by_key(|s| s.0);
    if sets.len() > MOST {
        return vec![];
    }
    let apart = |&(set, bounds): &(u32, Bounds)| {
        scene
            .objects
            .iter()
            .filter(|o| o.body.is_some() && o.hollow && o.set() != set)
            .all(|o| !o.reach.overlaps(&bounds))
            // A point of an open surface would have a side.
            && scene.objects.iter().all(|o| o.set() != set || o.open.is_none())
    };
    let mut sites: Vec<Site> = sets
        .into_iter()
        .filter(|s| apart(s) && s.1.extent().length().is_finite())
        .map(|(set, bounds)| Site { set, through: Lines::around(bounds), lines: PILOT, density: 0.0 })
        .collect();
    // Areas by lines whose numbers depend on nothing but the scene.
    let disc = |s: &Site| s.through.area();
    let areas: Vec<f64> = sites
        .par_iter()
        .map(|s| {
            let mut hits = 0usize;
            (0..PILOT).for_each(|j| hits += s.meet(scene, &mut Sampler::new(CLOUD, s.set, 0, u64::from(j))).1.len());
            disc(s) * hits as f64 / f64::from(PILOT)
        })
        .collect();
    let all = areas.iter().sum::<f64>();
    if all <= 0.0 {
        return vec![];
    }
    let density = (PER_PIXEL * scene.pixels).clamp(POINTS[0], POINTS[1]) / all;
    for (site, area) in sites.iter_mut().zip(areas) {
        let lines = (density * disc(site)).min(LINES * density * area).ceil();
        site.lines = lines.min(f64::from(u32::MAX)) as u32;
        site.density = f64::from(site.lines) / disc(site);
    }
    sites
}

impl Site {
    /// Returns a line through the ball and all its hits on the site's bodies, in order.
    fn meet(&self, scene: &Scene, rng: &mut Sampler) -> (Ray, Vec<Hit>) {
        self.through.meet(scene, rng, |shape| scene.objects[shape as usize].set() == self.set)
    }
}

/// Returns the kernel of a site's medium at some place: the only one where coefficients are not textured.
fn kernel<const N: usize>(scene: &Scene, site: &Site, wavelengths: &Wavelengths<N>) -> Option<Kernel> {
    let object = scene.objects.iter().find(|o| o.set() == site.set)?;
    let at = TexturePoint { p: site.through.center, n: Vec3::Z, uv: Vec2::ZERO };
    let (bank, medium) = scene.bank_at(object, &at, wavelengths)?;
    let exit = Exit::new(bank, &medium, site.density)?;
    exit.has_points().then(|| Kernel::new(&exit, &medium))
}

/// Returns the variate of the wavelengths that all pixels share at a sample number: evenly spread within each of the independent scramblings, as the film takes their spread for the variance.
pub(crate) fn wavelength(seed: u64, sample: u64) -> f32 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (index, scrambling) = (sample / SCRAMBLINGS, sample % SCRAMBLINGS);
    let first = f64::from(Sampler::new(mix(seed, CLOUD), u32::MAX, u32::MAX, scrambling).uniform());
    ((first + index as f64 * GOLDEN).fract() as f32).clamp(f32::EPSILON, 1.0 - f32::EPSILON)
}

impl Cloud {
    /// Returns the points of a sample number; `None` where no body gets any, or where the number of bounces is limited: what falls on a point would
    /// depend on the path to it.
    pub fn new(scene: &Scene, integrator: &Integrator, sample: u64) -> Option<Self> {
        if scene.sites().is_empty() || integrator.max_depth.is_some() {
            return None;
        }
        Some(match integrator.wavelengths {
            WavelengthMode::Hero => Self::follow::<4>(scene, integrator, sample),
            WavelengthMode::Rgb => Self::follow::<3>(scene, integrator, sample),
            WavelengthMode::Mono(_) => Self::follow::<1>(scene, integrator, sample),
        })
    }

    fn follow<const N: usize>(scene: &Scene, integrator: &Integrator, sample: u64) -> Self {
        let wavelength = wavelength(integrator.seed, sample);
        let wavelengths = Wavelengths::<N>::sample(integrator.wavelengths, wavelength);
        let seed = mix(mix(integrator.seed, CLOUD), sample);
        let (mut counters, mut invalid) = (Counters::default(), 0);
        let trees = scene
            .sites()
            .iter()
            .enumerate()
            .map(|(k, site)| {
                let batches: Vec<(Vec<Point>, Counters, u64)> = (0..site.lines.div_ceil(BATCH))
                    .into_par_iter()
                    .map(|b| {
                        let (mut points, mut counters, mut invalid) = (Vec::new(), Counters::default(), 0);
                        for j in BATCH * b..(BATCH * (b + 1)).min(site.lines) {
                            let mut rng = Sampler::new(seed, k as u32, 0, u64::from(j));
                            let (ray, hits) = site.meet(scene, &mut rng);
                            for hit in hits {
                                let surface = scene.accel.surface(&ray, &hit);
                                let light: Spectrum<N> =
                                    integrator.entering(scene, hit, &surface, &wavelengths, &mut rng, &mut counters);
                                match Point::new(surface.p, light) {
                                    Some(point) => points.push(point),
                                    None => invalid += 1,
                                }
                            }
                        }
                        (points, counters, invalid)
                    })
                    .collect();
                let mut points = Vec::with_capacity(batches.iter().map(|b| b.0.len()).sum());
                for (batch, done, bad) in batches {
                    points.extend(batch);
                    counters.merge(&done);
                    invalid += bad;
                }
                (Tree::new(points, mix(seed, k as u64)), kernel(scene, site, &wavelengths))
            })
            .collect();
        Self { wavelength, trees, counters, invalid }
    }

    /// Returns what the points of a site let out at an exit, per lane.
    pub fn gather<const N: usize>(&self, site: usize, exit: &Exit<N>, medium: &Medium<N>, p: Vec3) -> Spectrum<N> {
        let (tree, kernel) = &self.trees[site];
        let lanes = match kernel {
            Some(k) if k.is_for(medium) => tree.gather(p, |r2| k.eval(r2), |r2| k.mean(r2)),
            _ => {
                let mean = |r2: f32| exit.per_point(r2.sqrt()).iter().sum::<f32>() / N as f32;
                tree.gather(p, |r2| exit.per_point(r2.sqrt()), mean)
            }
        };
        Spectrum::from_fn(|i| lanes[i])
    }
}
