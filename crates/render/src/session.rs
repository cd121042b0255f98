//! Rendering a range of samples of a film on all threads, whole tile updates at a time.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use moonmilk_core::random::SCRAMBLINGS;
use moonmilk_core::{Random, Sampler, Spectrum, Stream, WavelengthMode, Wavelengths};
use rayon::prelude::*;

use crate::effort::{Effort, PILOT};
use crate::film::{Film, PixelSample};
use crate::integrator::{Counters, Integrator, Light};
use crate::scene::Scene;

/// Samples per pixel after which a tile's work is committed.
const CHUNK: u64 = 4;

/// Stream word that separates the random numbers of rounding from those of paths.
const ROUNDING: u64 = 0x51;

/// A sample whose value was NaN, infinite or too large; enough to replay it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvalidSample {
    /// Pixel of the picture.
    pub pixel: [u32; 2],
    /// Absolute sample number.
    pub sample: u64,
    /// Its value.
    pub rgb: [f32; 3],
}

/// What rendering did, summed over all threads.
#[derive(Clone, Debug, Default)]
pub struct Statistics {
    /// Counters of the transport.
    pub counters: Counters,
    /// Number of invalid samples.
    pub invalid: u64,
    /// The first few invalid samples.
    pub examples: Vec<InvalidSample>,
    /// Samples taken (pixels times samples per pixel).
    pub samples: u64,
}

impl Statistics {
    /// Adds the figures of another part of the work.
    pub fn merge(&mut self, o: &Self) {
        self.counters.merge(&o.counters);
        self.invalid += o.invalid;
        self.samples += o.samples;
        self.examples.extend(o.examples.iter().take(8usize.saturating_sub(self.examples.len())));
    }
}

/// Renders each tile up to sample number `end` (exclusive) of the film; returns when done or stopped.
///
/// Work is committed in whole updates of one tile and at most `CHUNK` samples; an update that `stop` interrupts is dropped,
/// so that what the film holds is always exactly a range of samples per tile. `progress` counts committed samples.
pub fn render(
    scene: &Scene,
    integrator: &Integrator,
    film: &Film,
    end: u64,
    stop: &AtomicBool,
    progress: &AtomicU64,
) -> Statistics {
    let mut statistics = Statistics::default();
    let prepares = integrator.prepares(scene);
    let mut last = integrator.clone();
    // Go through sample numbers together: what is made once for each serves all tiles.
    loop {
        let from = film.first + film.samples();
        if from >= end || stop.load(Ordering::Relaxed) {
            return statistics;
        }
        let applies = Effort::applies(integrator);
        let effort = if applies && from >= PILOT {
            let found = film.effort(|| Effort::of(scene, integrator, film, stop, &mut statistics.counters));
            let Some(effort) = found else { return statistics };
            Some(effort)
        } else {
            None
        };
        let end = if applies && from < PILOT { end.min(PILOT) } else { end };
        let chunk = if integrator.prepares_much(scene) { 1 } else { CHUNK };
        let to = if prepares { end.min((from / chunk + 1) * chunk) } else { end };
        let mut prepare = |s: u64| {
            last = last.for_sample(scene, s);
            last.clone()
        };
        let prepared: Vec<Integrator> =
            if prepares { (from..to).map(&mut prepare).collect() } else { vec![integrator.clone()] };
        for (counters, invalid) in prepared.iter().flat_map(Integrator::preparation) {
            statistics.counters.merge(counters);
            statistics.invalid += invalid;
        }
        let of = |s: u64| &prepared[((s - from) as usize).min(prepared.len() - 1)];
        statistics.merge(&tiles(scene, &of, film, effort, to, stop, progress));
    }
}

/// Renders each tile up to sample number `end`.
fn tiles<'a>(
    scene: &Scene,
    integrator: &(impl Fn(u64) -> &'a Integrator + Sync),
    film: &Film,
    effort: Option<&Effort>,
    end: u64,
    stop: &AtomicBool,
    progress: &AtomicU64,
) -> Statistics {
    (0..film.tile_count())
        .into_par_iter()
        .with_max_len(1)
        .map(|i| {
            let mut statistics = Statistics::default();
            loop {
                let tile = {
                    let t = film.tile(i);
                    (t.x0, t.y0, t.width, t.height, film.first + t.samples)
                };
                let from = tile.4;
                if from >= end || stop.load(Ordering::Relaxed) {
                    return statistics;
                }
                let to = end.min((from / CHUNK + 1) * CHUNK);
                let mut update = film.update(&film.tile(i));
                for p in 0..tile.2 * tile.3 {
                    let pixel = [tile.0 + p % tile.2, tile.1 + p / tile.2];
                    if stop.load(Ordering::Relaxed) {
                        return statistics;
                    }
                    let paths = effort.map_or(1, |e| e.paths(pixel));
                    for s in from..to {
                        let integrator = integrator(s);
                        let value = mean_sample(scene, integrator, pixel, s, paths, &mut statistics.counters);
                        let mut dither = Stream::new(&[
                            integrator.seed,
                            ROUNDING,
                            (u64::from(pixel[1]) << 32) | u64::from(pixel[0]),
                            s,
                        ]);
                        if !film.add(&mut update, p as usize, s, &value, || dither.uniform()) {
                            statistics.invalid += 1;
                            if statistics.examples.len() < 8 {
                                statistics.examples.push(InvalidSample { pixel, sample: s, rgb: value.rgb });
                            }
                        }
                    }
                }
                let n = to - from;
                film.commit(i, update, n);
                statistics.samples += n * u64::from(tile.2 * tile.3);
                progress.fetch_add(n * u64::from(tile.2 * tile.3), Ordering::Relaxed);
            }
        })
        .reduce(Statistics::default, |mut a, b| {
            a.merge(&b);
            a
        })
}

/// Returns the mean of so many paths of one sample of one pixel: a pure function of scene, settings, pixel, sample number and that number, which is that of [`Effort`].
///
/// The integrator is that of [`Integrator::for_sample`].
pub fn mean_sample(
    scene: &Scene,
    integrator: &Integrator,
    pixel: [u32; 2],
    s: u64,
    paths: u32,
    counters: &mut Counters,
) -> PixelSample {
    if s < PILOT || paths < 2 {
        return sample(scene, integrator, pixel, s, counters);
    }
    // All paths of a scrambling are those of one sequence, in its order: the pilot's, then the paths of each later sample.
    let (index, scrambling) = (s / SCRAMBLINGS, s % SCRAMBLINGS);
    let first = PILOT / SCRAMBLINGS + (index - PILOT / SCRAMBLINGS) * u64::from(paths);
    let mut sum = PixelSample::default();
    for j in 0..u64::from(paths) {
        sum.add(&sample(scene, integrator, pixel, (first + j) * SCRAMBLINGS + scrambling, counters));
    }
    sum.scaled(1.0 / paths as f32)
}

/// Returns one path of one pixel: a pure function of scene, settings, pixel and number, which is that of the sample where this has one path.
///
/// The integrator is that of [`Integrator::for_sample`].
pub fn sample(
    scene: &Scene,
    integrator: &Integrator,
    pixel: [u32; 2],
    sample: u64,
    counters: &mut Counters,
) -> PixelSample {
    match integrator.wavelengths {
        WavelengthMode::Hero => sample_lanes::<4>(scene, integrator, pixel, sample, counters),
        WavelengthMode::Rgb => sample_lanes::<3>(scene, integrator, pixel, sample, counters),
        WavelengthMode::Mono(_) => sample_lanes::<1>(scene, integrator, pixel, sample, counters),
    }
}

fn sample_lanes<const N: usize>(
    scene: &Scene,
    integrator: &Integrator,
    pixel: [u32; 2],
    sample: u64,
    counters: &mut Counters,
) -> PixelSample {
    let mut rng = Sampler::new(integrator.seed, pixel[0], pixel[1], sample);
    let offset = rng.uniform2();
    let lens = rng.uniform2();
    let u = rng.uniform();
    let wavelengths = Wavelengths::<N>::sample(integrator.wavelengths, integrator.shared_wavelength().unwrap_or(u));
    let ([dx, dy], weight) = scene.filter.sample(offset);
    let film = moonmilk_core::Vec2::new(pixel[0] as f32 + 0.5 + dx, pixel[1] as f32 + 0.5 + dy);
    let (o, d) = scene.camera.ray(film, lens);
    let mut light = Light::<N>::default();
    let images = integrator.trace_pixel(scene, pixel, (o, d), &wavelengths, &mut rng, &mut light, counters);
    let rgb = |s: Spectrum<N>| wavelengths.to_rgb(s).map(|c| c * weight);
    let mut orders = light.orders.map(rgb);
    orders[0] = std::array::from_fn(|c| orders[0][c] + wavelengths.to_rgb(images)[c]);
    PixelSample {
        rgb: std::array::from_fn(|c| orders[0][c] + orders[1][c] + orders[2][c]),
        orders,
        albedo: wavelengths.to_rgb(light.albedo),
        normal: light.normal.to_array(),
        depth: light.depth,
    }
}
