//! Exact sums of samples: the film.
//!
//! Contributions are rounded to whole multiples of [`QUANTUM`] and added as integers, so that any split of the work, any
//! order, any number of threads, and any stop, resume or merge gives the same bits. Rounding is random with a number keyed
//! like all others (floor(x / q + u)), so that its expectation is exact. Samples are dealt to
//! [`SCRAMBLINGS`] independent scramblings, summed apart: their spread is the variance.

use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use moonmilk_core::random::SCRAMBLINGS;

use crate::effort::Effort;

/// Unit of the sums: 2^-22. Samples beyond [`LARGEST`] do not fit and are reported as invalid, never clipped.
pub const QUANTUM: f64 = 1.0 / 4_194_304.0;
/// Largest magnitude of a sample: 2^24, so that 2^16 samples per scrambling fit (2^24 times 2^16 times 2^22 < 2^63).
pub const LARGEST: f32 = 16_777_216.0;
/// Edge length of a tile \[pixels\].
pub const TILE: u32 = 16;

const K: usize = SCRAMBLINGS as usize;
/// Side of the blocks of pixels, from the first stored one on, whose means have variances of their own: pixels may share errors.
pub const BLOCK: u32 = 16;

/// Additional pictures that a render may record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Aov {
    /// Multiple-scattering albedo in [0, 1] of the first surface seen.
    Albedo,
    /// Shading normal of the first surface seen, world space.
    Normal,
    /// Distance to the first surface seen [scene units].
    Depth,
    /// Variance of the mean of R, G, B, from the scramblings.
    Variance,
    /// Radiance split by the number of collisions inside media: 0, 1, 2 and more.
    Order,
    /// Radiance of paths that collided inside a medium.
    Subsurface,
    /// Radiance of all other paths.
    Diffuse,
}

impl Aov {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Albedo, Self::Normal, Self::Depth, Self::Variance, Self::Order, Self::Subsurface, Self::Diffuse];

    /// Returns the name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Albedo => "albedo",
            Self::Normal => "normal",
            Self::Depth => "depth",
            Self::Variance => "variance",
            Self::Order => "order",
            Self::Subsurface => "subsurface",
            Self::Diffuse => "diffuse",
        }
    }

    /// Returns the names of the picture's channels.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Albedo => &["Albedo.R", "Albedo.G", "Albedo.B"],
            Self::Normal => &["Ns.X", "Ns.Y", "Ns.Z"],
            Self::Depth => &["Depth.Z"],
            Self::Variance => &["Variance.R", "Variance.G", "Variance.B"],
            Self::Order => &[
                "Scatter0.R",
                "Scatter0.G",
                "Scatter0.B",
                "Scatter1.R",
                "Scatter1.G",
                "Scatter1.B",
                "Scatter2.R",
                "Scatter2.G",
                "Scatter2.B",
            ],
            Self::Subsurface => &["Subsurface.R", "Subsurface.G", "Subsurface.B"],
            Self::Diffuse => &["Diffuse.R", "Diffuse.G", "Diffuse.B"],
        }
    }
}

/// What one sample contributes to its pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSample {
    /// Linear sRGB radiance.
    pub rgb: [f32; 3],
    /// Parts of `rgb` by number of collisions: 0, 1, 2 and more.
    pub orders: [[f32; 3]; 3],
    /// Albedo of the first surface.
    pub albedo: [f32; 3],
    /// Normal of the first surface.
    pub normal: [f32; 3],
    /// Distance of the first surface.
    pub depth: f32,
}

impl PixelSample {
    /// Adds another sample.
    pub(crate) fn add(&mut self, o: &Self) {
        let sum = |a: &mut [f32], b: &[f32]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        sum(&mut self.rgb, &o.rgb);
        sum(self.orders.as_flattened_mut(), o.orders.as_flattened());
        sum(&mut self.albedo, &o.albedo);
        sum(&mut self.normal, &o.normal);
        self.depth += o.depth;
    }

    /// Returns the sample times a factor.
    pub(crate) fn scaled(&self, factor: f32) -> Self {
        let times = |v: [f32; 3]| v.map(|x| x * factor);
        Self {
            rgb: times(self.rgb),
            orders: self.orders.map(times),
            albedo: times(self.albedo),
            normal: times(self.normal),
            depth: self.depth * factor,
        }
    }
}

/// The sums of the pixels of one tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tile {
    /// First pixel, x.
    pub x0: u32,
    /// First pixel, y.
    pub y0: u32,
    /// Width \[pixels\].
    pub width: u32,
    /// Height \[pixels\].
    pub height: u32,
    /// Samples per pixel so far: those numbered `first..first + samples` of the film.
    pub samples: u64,
    /// Colour sums: per pixel, scrambling and channel.
    pub sums: Vec<i64>,
    /// Sums of the additional pictures: per pixel and channel.
    pub extra: Vec<i64>,
}

/// The samples of one tile, on their way to it.
pub struct TileUpdate {
    samples: u64,
    sums: Vec<i64>,
    extra: Vec<i64>,
}

/// The exact sums of a picture.
#[derive(Debug)]
pub struct Film {
    /// Full size of the picture \[pixels\].
    pub size: [u32; 2],
    /// Pixels rendered: x0, x1, y0, y1, end exclusive.
    pub crop: [u32; 4],
    /// Number of the first sample of every pixel.
    pub first: u64,
    /// Additional pictures recorded.
    pub aovs: Vec<Aov>,
    tiles: Vec<Mutex<Tile>>,
    /// Numbers of paths, once they are known.
    effort: OnceLock<Effort>,
}

/// Finished pictures of a film.
#[derive(Clone, Debug)]
pub struct Developed {
    /// Width of the crop \[pixels\].
    pub width: u32,
    /// Height of the crop \[pixels\].
    pub height: u32,
    /// Mean radiance, row-major linear sRGB.
    pub rgb: Vec<[f32; 3]>,
    /// Variance of that mean; NaN where fewer than two scramblings have samples.
    pub variance: Vec<[f32; 3]>,
    /// Variance of the mean over the block of [`BLOCK`] x [`BLOCK`] pixels that the pixel is in; NaN where samples are too few or not everywhere as many.
    pub block_variance: Vec<[f32; 3]>,
    /// Variance of the mean over all pixels; NaN likewise.
    pub mean_variance: [f64; 3],
    /// Additional channels: name and values.
    pub extra: Vec<(&'static str, Vec<f32>)>,
    /// Smallest and largest number of samples of a pixel.
    pub samples: [u64; 2],
}

/// Returns x in quanta, rounded up with probability of the remainder: the expectation over u in (0, 1) is exact.
#[inline]
fn quantize(x: f32, u: f32) -> i64 {
    (f64::from(x) / QUANTUM + f64::from(u)).floor() as i64
}

impl Film {
    /// Returns an empty film of a picture's crop, whose samples start at number `first`.
    pub fn new(size: [u32; 2], crop: [u32; 4], first: u64, aovs: &[Aov]) -> Self {
        let mut film = Self { size, crop, first, aovs: aovs.to_vec(), tiles: Vec::new(), effort: OnceLock::new() };
        let stride = film.extra_channels();
        let [x0, x1, y0, y1] = crop;
        let mut tiles = Vec::new();
        for ty in (y0..y1).step_by(TILE as usize) {
            for tx in (x0..x1).step_by(TILE as usize) {
                let (width, height) = (TILE.min(x1 - tx), TILE.min(y1 - ty));
                let n = (width * height) as usize;
                tiles.push(Mutex::new(Tile {
                    x0: tx,
                    y0: ty,
                    width,
                    height,
                    samples: 0,
                    sums: vec![0; n * K * 3],
                    extra: vec![0; n * stride],
                }));
            }
        }
        film.tiles = tiles;
        film
    }

    /// Returns the number of summed channels per pixel beside colour.
    pub fn extra_channels(&self) -> usize {
        self.aovs.iter().map(|a| if *a == Aov::Variance { 0 } else { a.channels().len() }).sum()
    }

    /// Returns the numbers of paths of the picture's samples, found out if they are not known; `None` if they are not found.
    pub fn effort(&self, find: impl FnOnce() -> Option<Effort>) -> Option<&Effort> {
        if self.effort.get().is_none() {
            // Of two that find them at a time both find the same.
            let _ = self.effort.set(find()?);
        }
        self.effort.get()
    }

    /// Returns the number of tiles.
    pub fn tile_count(&self) -> usize {
        self.tiles.len()
    }

    /// Returns a tile for reading or replacing (checkpoints); each is consistent in itself.
    pub fn tile(&self, i: usize) -> MutexGuard<'_, Tile> {
        self.tiles[i].lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns an empty update for a tile.
    pub fn update(&self, tile: &Tile) -> TileUpdate {
        TileUpdate { samples: 0, sums: vec![0; tile.sums.len()], extra: vec![0; tile.extra.len()] }
    }

    /// Adds a sample to an update. `pixel` counts within the tile, `u` are uniform variates for the rounding.
    ///
    /// Returns false and adds zero if a value is NaN, infinite or beyond [`LARGEST`].
    pub fn add(
        &self,
        update: &mut TileUpdate,
        pixel: usize,
        sample: u64,
        s: &PixelSample,
        mut u: impl FnMut() -> f32,
    ) -> bool {
        let ok = s.rgb.iter().all(|c| c.is_finite() && c.abs() <= LARGEST);
        if !ok {
            return false;
        }
        let scrambling = (sample % SCRAMBLINGS) as usize;
        let at = (pixel * K + scrambling) * 3;
        for c in 0..3 {
            update.sums[at + c] += quantize(s.rgb[c], u());
        }
        // Additional pictures share the rounding rule; invalid values in them count as zero.
        let mut at = pixel * self.extra_channels();
        let mut put = |values: &[f32]| {
            for &v in values {
                if v.is_finite() && v.abs() <= LARGEST {
                    update.extra[at] += quantize(v, u());
                }
                at += 1;
            }
        };
        for aov in &self.aovs {
            match aov {
                Aov::Albedo => put(&s.albedo),
                Aov::Normal => put(&s.normal),
                Aov::Depth => put(&[s.depth]),
                Aov::Variance => {}
                Aov::Order => put(s.orders.as_flattened()),
                Aov::Subsurface => put(&std::array::from_fn::<f32, 3, _>(|c| s.orders[1][c] + s.orders[2][c])),
                Aov::Diffuse => put(&s.orders[0]),
            }
        }
        true
    }

    /// Adds a finished update to its tile: `samples` more per pixel.
    pub fn commit(&self, i: usize, mut update: TileUpdate, samples: u64) {
        update.samples = samples;
        let mut tile = self.tile(i);
        tile.samples += update.samples;
        tile.sums.iter_mut().zip(&update.sums).for_each(|(a, b)| *a += b);
        tile.extra.iter_mut().zip(&update.extra).for_each(|(a, b)| *a += b);
    }

    /// Adds the sums of another film of the same picture, whose samples follow this one's.
    ///
    /// *Errors*: a sentence if sizes, pictures or sample ranges do not fit together.
    pub fn append(&mut self, other: &Film) -> Result<(), String> {
        if self.size != other.size || self.crop != other.crop || self.aovs != other.aovs {
            return Err("the films differ in size, crop or recorded layers".into());
        }
        for i in 0..self.tiles.len() {
            let b = other.tile(i);
            let mut a = self.tile(i);
            if self.first + a.samples != other.first {
                return Err(format!(
                    "samples {}.. do not follow {}..{}",
                    other.first,
                    self.first,
                    self.first + a.samples
                ));
            }
            a.samples += b.samples;
            a.sums.iter_mut().zip(&b.sums).for_each(|(a, b)| *a += b);
            a.extra.iter_mut().zip(&b.extra).for_each(|(a, b)| *a += b);
        }
        Ok(())
    }

    /// Returns the smallest number of samples that every pixel has.
    pub fn samples(&self) -> u64 {
        (0..self.tiles.len()).map(|i| self.tile(i).samples).min().unwrap_or(0)
    }

    /// Returns the number of samples of scrambling k among those numbered `first..first + n`.
    fn dealt(&self, n: u64, k: u64) -> u64 {
        let upto = |m: u64| (m + SCRAMBLINGS - 1 - k) / SCRAMBLINGS;
        upto(self.first + n) - upto(self.first)
    }

    /// Returns means, variances and additional pictures; `factor` (the film's imaging ratio) multiplies colour and the
    /// layers that are parts of it.
    pub fn develop(&self, factor: f32) -> Developed {
        let [x0, x1, y0, y1] = self.crop;
        let (w, h) = (x1 - x0, y1 - y0);
        let n = (w * h) as usize;
        let stride = self.extra_channels();
        let names: Vec<&'static str> =
            self.aovs.iter().filter(|a| **a != Aov::Variance).flat_map(|a| a.channels()).copied().collect();
        // Layers that are parts of the picture share its factor.
        let is_radiance = |a: &Aov| matches!(a, Aov::Order | Aov::Subsurface | Aov::Diffuse);
        let radiance: Vec<bool> = self
            .aovs
            .iter()
            .filter(|a| **a != Aov::Variance)
            .flat_map(|a| std::iter::repeat_n(is_radiance(a), a.channels().len()))
            .collect();
        let mut out = Developed {
            width: w,
            height: h,
            rgb: vec![[0.0; 3]; n],
            variance: vec![[f32::NAN; 3]; n],
            block_variance: vec![[f32::NAN; 3]; n],
            mean_variance: [f64::NAN; 3],
            extra: names.iter().map(|&name| (name, vec![0.0; n])).collect(),
            samples: [u64::MAX, 0],
        };
        let columns = w.div_ceil(BLOCK);
        let mut blocks = vec![([[0.0; 3]; K], 0u32); (columns * h.div_ceil(BLOCK)) as usize];
        for i in 0..self.tiles.len() {
            let t = self.tile(i);
            out.samples = [out.samples[0].min(t.samples), out.samples[1].max(t.samples)];
            if t.samples == 0 {
                continue;
            }
            let dealt: [u64; K] = std::array::from_fn(|k| self.dealt(t.samples, k as u64));
            for p in 0..(t.width * t.height) as usize {
                let (px, py) = (p as u32 % t.width, p as u32 / t.width);
                let at = ((t.y0 + py - y0) * w + (t.x0 + px - x0)) as usize;
                let f = f64::from(factor) * QUANTUM;
                let (x, y) = (at as u32 % w, at as u32 / w);
                let block = &mut blocks[(y / BLOCK * columns + x / BLOCK) as usize];
                block.1 += 1;
                for c in 0..3 {
                    let sum = |k: usize| t.sums[(p * K + k) * 3 + c];
                    (0..K).for_each(|k| block.0[k][c] += f * sum(k) as f64);
                    let mean = f * (0..K).map(sum).sum::<i64>() as f64 / t.samples as f64;
                    out.rgb[at][c] = mean as f32;
                    out.variance[at][c] = between(&dealt, t.samples, |k| f * sum(k) as f64, mean) as f32;
                }
                for (j, (_, values)) in out.extra.iter_mut().enumerate() {
                    let f = if radiance[j] { f } else { QUANTUM };
                    values[at] = (t.extra[p * stride + j] as f64 * f / t.samples as f64) as f32;
                }
            }
        }
        if out.samples[0] == u64::MAX {
            out.samples[0] = 0;
        }
        if out.samples[0] == out.samples[1] && out.samples[0] > 0 {
            self.develop_blocks(&mut out, &blocks, columns);
        }
        out
    }

    /// Adds the variances of means over blocks and the whole, from the sums of the scramblings in each block and its number of pixels.
    fn develop_blocks(&self, out: &mut Developed, blocks: &[([[f64; 3]; K], u32)], columns: u32) {
        let n = out.samples[0];
        let dealt: [u64; K] = std::array::from_fn(|k| self.dealt(n, k as u64));
        let of = |sums: &[[f64; 3]; K], pixels: u32| -> [f64; 3] {
            std::array::from_fn(|c| {
                let sum = |k: usize| sums[k][c] / f64::from(pixels);
                between(&dealt, n, sum, (0..K).map(sum).sum::<f64>() / n as f64)
            })
        };
        let variances: Vec<[f32; 3]> = blocks.iter().map(|(s, pixels)| of(s, *pixels).map(|v| v as f32)).collect();
        for (at, v) in out.block_variance.iter_mut().enumerate() {
            let (x, y) = (at as u32 % out.width, at as u32 / out.width);
            *v = variances[(y / BLOCK * columns + x / BLOCK) as usize];
        }
        let mut all = [[0.0; 3]; K];
        for (sums, _) in blocks {
            all.iter_mut().flatten().zip(sums.iter().flatten()).for_each(|(a, s)| *a += s);
        }
        out.mean_variance = of(&all, blocks.iter().map(|b| b.1).sum());
    }
}

/// Returns the variance of the mean from the sums of the scramblings.
///
/// With n_k samples and mean m_k in scrambling k, n = sum n_k: Var(mean) = sum_k (n_k / n)^2 Var(m_k), and under the model
/// Var(m_k) = v / n_k the unbiased estimate is v / n = sum_k n_k (m_k - m)^2 / (n (K - 1)).
fn between(dealt: &[u64; K], n: u64, sum: impl Fn(usize) -> f64, mean: f64) -> f64 {
    let used = dealt.iter().filter(|&&d| d > 0).count();
    if used < 2 {
        return f64::NAN;
    }
    let s: f64 =
        (0..K).filter(|&k| dealt[k] > 0).map(|k| dealt[k] as f64 * (sum(k) / dealt[k] as f64 - mean).powi(2)).sum();
    s / (n as f64 * (used - 1) as f64)
}

impl Developed {
    /// Returns the relative error sqrt(mean variance) / mean radiance over non-empty pixels, of the mean of R, G and B; infinite
    /// while no variance is known, 0 for an empty picture.
    pub fn relative_error(&self) -> f64 {
        let (mut n, mut variance, mut mean) = (0.0, 0.0, 0.0);
        for (rgb, var) in self.rgb.iter().zip(&self.variance) {
            if rgb.iter().any(|&c| c != 0.0) {
                n += 1.0;
                mean += f64::from(rgb[0] + rgb[1] + rgb[2]) / 3.0;
                variance += f64::from(var[0] + var[1] + var[2]) / 3.0;
            }
        }
        if n == 0.0 {
            return 0.0;
        }
        let e = (variance / n).sqrt() / (mean / n);
        if e.is_nan() { f64::INFINITY } else { e }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Random, Stream};

    #[test]
    fn means_over_pixels_that_share_errors_have_their_variance() {
        // All pixels of a sample number are alike: the mean over them has the variance of one.
        let film = Film::new([20, 18], [0, 20, 0, 18], 0, &[Aov::Variance]);
        for i in 0..film.tile_count() {
            let tile = film.tile(i).clone();
            let mut update = film.update(&tile);
            for p in 0..(tile.width * tile.height) as usize {
                for s in 0..32 {
                    let x = Stream::new(&[2, s]).uniform();
                    let sample = PixelSample { rgb: [x, 2.0 * x, 0.5], ..Default::default() };
                    assert!(film.add(&mut update, p, s, &sample, || 0.5));
                }
            }
            film.commit(i, update, 32);
        }
        let d = film.develop(1.0);
        for at in 0..d.variance.len() {
            for c in 0..2 {
                let [own, block] = [d.variance[at][c], d.block_variance[at][c]].map(f64::from);
                assert!(own > 0.0 && (block / own - 1.0).abs() < 1e-3 && (d.mean_variance[c] / own - 1.0).abs() < 1e-3);
            }
            assert!(d.block_variance[at][2] < 1e-9);
        }
    }

    fn filled(first: u64, range: std::ops::Range<u64>) -> Film {
        let film = Film::new([20, 18], [0, 20, 0, 18], first, &[Aov::Depth]);
        for i in 0..film.tile_count() {
            let tile = film.tile(i).clone();
            let mut update = film.update(&tile);
            for p in 0..(tile.width * tile.height) as usize {
                for s in range.clone() {
                    let mut r = Stream::new(&[1, i as u64, p as u64, s]);
                    let x = r.uniform();
                    let sample = PixelSample { rgb: [x, 2.0 * x, 0.1], depth: 3.0, ..Default::default() };
                    assert!(film.add(&mut update, p, s, &sample, || r.uniform()));
                }
            }
            film.commit(i, update, range.end - range.start);
        }
        film
    }

    #[test]
    fn any_split_of_the_samples_gives_the_same_bits() {
        let whole = filled(0, 0..37);
        let mut parts = filled(0, 0..11);
        parts.append(&filled(11, 11..12)).expect("fits");
        parts.append(&filled(12, 12..37)).expect("fits");
        for i in 0..whole.tile_count() {
            assert_eq!(*whole.tile(i), *parts.tile(i));
        }
        assert!(parts.append(&filled(5, 5..6)).is_err());
    }

    #[test]
    fn means_and_variances_are_those_of_the_samples() {
        let d = filled(0, 0..64).develop(1.0);
        let n = d.rgb.len() as f64;
        let mean = d.rgb.iter().map(|c| f64::from(c[0])).sum::<f64>() / n;
        let variance = d.variance.iter().map(|c| f64::from(c[0])).sum::<f64>() / n;
        // 360 pixels x 64 samples of a uniform variate; 4.9 standard errors (1e-6 two-sided). The variance estimate has 7
        // degrees of freedom per pixel: relative standard error sqrt(2 / (7 * 360)).
        assert!((mean - 0.5).abs() < 4.9 * (1.0 / 12.0 / 64.0 / n).sqrt());
        assert!((variance * 64.0 * 12.0 - 1.0).abs() < 4.9 * (2.0 / (7.0 * n)).sqrt());
        assert!(d.rgb.iter().all(|c| (c[2] - 0.1).abs() < 1e-7) && d.extra[0].1.iter().all(|&z| z == 3.0));
    }

    #[test]
    fn rounding_to_quanta_keeps_the_expectation_of_values_below_one_quantum() {
        let x = 0.3 * QUANTUM as f32;
        let mut r = Stream::new(&[9]);
        let n = 100_000;
        let mean = (0..n).map(|_| quantize(x, r.uniform())).sum::<i64>() as f64 / f64::from(n);
        // Bernoulli(0.3); 4.9 standard errors.
        assert!((mean - 0.3).abs() < 4.9 * (0.21f64 / f64::from(n)).sqrt());
    }

    #[test]
    fn invalid_samples_are_refused() {
        let film = Film::new([1, 1], [0, 1, 0, 1], 0, &[]);
        let tile = film.tile(0).clone();
        let mut update = film.update(&tile);
        for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e9] {
            assert!(!film.add(&mut update, 0, 0, &PixelSample { rgb: [0.0, bad, 0.0], ..Default::default() }, || 0.5));
        }
        assert!(update.sums.iter().all(|&s| s == 0));
    }
}
