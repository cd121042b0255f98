//! Random numbers as a pure function of (seed, pixel, sample, dimension).
//!
//! A [`Stream`] is a counter-based generator: the d-th number of the stream of a key is a fixed hash of (key, d), so that
//! neither threads, nor the order of work, nor interruptions change a result. A [`Sampler`] prepends Owen-scrambled Sobol
//! points for the first dimensions of a path; its samples come in [`SCRAMBLINGS`] independent scramblings, the variance
//! between which is an honest error estimate.

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// Number of independent scramblings that the samples of a pixel are dealt to in turn.
pub const SCRAMBLINGS: u64 = 8;
/// Number of leading dimensions taken from the scrambled Sobol sequence.
pub const SOBOL_DIMENSIONS: u32 = 16;

/// A source of uniform variates in the open interval (0, 1).
pub trait Random {
    /// Returns the next uniform variate; 0 and 1 are never returned, so that `ln(u)` and `ln(1 - u)` are finite.
    fn uniform(&mut self) -> f32;

    /// Returns the next two uniform variates.
    #[inline]
    fn uniform2(&mut self) -> [f32; 2] {
        [self.uniform(), self.uniform()]
    }
}

/// Mixes a word into a key (the finaliser of SplitMix64 over a multiply-add).
#[inline]
pub fn mix(key: u64, word: u64) -> u64 {
    let mut z = (key ^ word.wrapping_mul(0x9E37_79B9_7F4A_7C15)).wrapping_add(0xD1B5_4A32_D192_ED03);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// A stream of random numbers whose d-th value is a fixed function of its key and d.
#[derive(Clone, Debug)]
pub struct Stream {
    generator: SplitMix64,
}

impl Stream {
    /// Returns the stream of a key made of any number of words, e.g. `[seed, pixel, sample]`.
    #[inline]
    pub fn new(words: &[u64]) -> Self {
        let key = words.iter().fold(0x243F_6A88_85A3_08D3, |k, &w| mix(k, w));
        Self { generator: SplitMix64::from_seed(key.to_le_bytes()) }
    }

    /// Returns the next 64 random bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.generator.next_u64()
    }
}

/// Maps 23 random bits to the centre of one of 2^23 equal cells of (0, 1): exact in f32 and never 0 or 1.
#[inline]
fn to_open_unit(bits: u32) -> f32 {
    ((bits >> 9) as f32 + 0.5) * (1.0 / 8_388_608.0)
}

impl Random for Stream {
    #[inline]
    fn uniform(&mut self) -> f32 {
        to_open_unit((self.bits() >> 32) as u32)
    }

    #[inline]
    fn uniform2(&mut self) -> [f32; 2] {
        let b = self.bits();
        [to_open_unit((b >> 32) as u32), to_open_unit(b as u32)]
    }
}

/// The random numbers of one sample of one pixel: Sobol in the first dimensions, a keyed stream behind them.
#[derive(Clone, Debug)]
pub struct Sampler {
    index: u32,
    scramble: u32,
    dimension: u32,
    stream: Stream,
}

impl Sampler {
    /// Returns the sampler of absolute sample number `sample` of a pixel.
    ///
    /// Sample s belongs to scrambling `s mod 8` and is point `s / 8` of it. Beyond 65536 points per scrambling the
    /// Sobol sequence ends; all dimensions then come from the stream.
    pub fn new(seed: u64, x: u32, y: u32, sample: u64) -> Self {
        let pixel = (u64::from(y) << 32) | u64::from(x);
        let index = sample / SCRAMBLINGS;
        let scramble = mix(mix(mix(seed, pixel), sample % SCRAMBLINGS), 0x5C4A) as u32;
        let dimension = if index < 65_536 { 0 } else { SOBOL_DIMENSIONS };
        Self { index: index as u32, scramble, dimension, stream: Stream::new(&[seed, pixel, sample]) }
    }

    /// Skips to a fixed dimension, so that what follows does not depend on how many numbers were used before.
    #[inline]
    pub fn skip_to(&mut self, dimension: u32) {
        self.dimension = self.dimension.max(dimension);
    }

    /// Returns the stream behind the Sobol dimensions.
    #[inline]
    pub fn stream(&mut self) -> &mut Stream {
        &mut self.stream
    }
}

impl Random for Sampler {
    #[inline]
    fn uniform(&mut self) -> f32 {
        if self.dimension >= SOBOL_DIMENSIONS {
            return self.stream.uniform();
        }
        let u = sobol_burley::sample(self.index, self.dimension, self.scramble);
        self.dimension += 1;
        // Move to the open interval in steps that f32 can hold.
        ((u * 8_388_608.0).floor() + 0.5) * (1.0 / 8_388_608.0)
    }
}

/// Points of a lattice of rank 1 under one random shift: pairs of variates, each uniform, that spread over the square together.
///
/// Pair k of n is (u + k / n, v + k phi) mod 1, phi the golden ratio.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    shift: [f32; 2],
    step: f32,
    next: u32,
}

impl Spread {
    /// Returns the lattice of n points under a shift.
    pub fn new(shift: [f32; 2], n: u32) -> Self {
        Self { shift, step: 1.0 / n as f32, next: 0 }
    }
}

impl Random for Spread {
    /// Returns the first of the next pair.
    #[inline]
    fn uniform(&mut self) -> f32 {
        self.uniform2()[0]
    }

    #[inline]
    fn uniform2(&mut self) -> [f32; 2] {
        const GOLDEN: f32 = 0.618_034;
        let k = self.next as f32;
        self.next += 1;
        // Back to the centres of cells, within the open interval.
        let cell = |u: f32| to_open_unit(((u.fract() * 8_388_608.0) as u32).min(8_388_607) << 9);
        [cell(self.shift[0] + k * self.step), cell(self.shift[1] + k * GOLDEN)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_lattice_are_spread_and_each_is_uniform() {
        // One in each of n strips, whatever the shift; the mean over shifts of a smooth function is its integral to 4 sigma.
        let (n, mut sum, mut squares) = (5u32, 0.0f64, 0.0f64);
        for k in 0..4000 {
            let shift = Stream::new(&[11, k]).uniform2();
            let mut spread = Spread::new(shift, n);
            let mut strips: Vec<u32> = Vec::new();
            for i in 0..n {
                let [u, v] = spread.uniform2();
                assert!(u > 0.0 && u < 1.0 && v > 0.0 && v < 1.0);
                let first = shift[0] - (shift[0] * n as f32).floor() / n as f32;
                strips.push(((u - first) * n as f32).round() as u32 % n);
                if i == 3 {
                    let f = f64::from(u * u * v);
                    (sum, squares) = (sum + f, squares + f * f);
                }
            }
            strips.sort();
            strips.dedup();
            assert!(strips.len() as u32 == n, "{strips:?}");
        }
        let mean = sum / 4000.0;
        let error = ((squares / 4000.0 - mean * mean) / 4000.0).sqrt();
        assert!((mean - 1.0 / 6.0).abs() < 4.0 * error, "{mean} +- {error}");
    }

    #[test]
    fn numbers_stay_inside_the_open_unit_interval() {
        assert!(to_open_unit(0) > 0.0 && to_open_unit(u32::MAX) < 1.0);
        assert!(1.0 - to_open_unit(u32::MAX) > 0.0 && to_open_unit(0).ln().is_finite());
    }

    #[test]
    fn streams_depend_on_every_word_of_their_key_and_on_nothing_else() {
        let first = |w: [u64; 3]| Stream::new(&w).bits();
        assert_eq!(first([1, 2, 3]), first([1, 2, 3]));
        assert!(
            first([1, 2, 3]) != first([0, 2, 3])
                && first([1, 2, 3]) != first([1, 3, 2])
                && first([1, 2, 3]) != first([1, 2, 4])
        );
    }

    #[test]
    fn mean_and_variance_of_a_stream_are_those_of_the_uniform_law() {
        // 2^20 numbers over 1024 streams; |z| < 4.9 is a two-sided significance of 1e-6.
        let (mut s1, mut s2) = (0.0f64, 0.0f64);
        let n = 1 << 20;
        for key in 0..1024u64 {
            let mut r = Stream::new(&[7, key, 0]);
            for _ in 0..1024 {
                let u = f64::from(r.uniform());
                s1 += u;
                s2 += (u - 0.5) * (u - 0.5);
            }
        }
        let n = f64::from(n);
        let z1 = (s1 / n - 0.5) / (1.0 / 12.0 / n).sqrt();
        let z2 = (s2 / n - 1.0 / 12.0) / (1.0 / 180.0 / n).sqrt();
        assert!(z1.abs() < 4.9 && z2.abs() < 4.9, "z = {z1}, {z2}");
    }

    #[test]
    fn each_scrambling_stratifies_its_own_points() {
        // The first 16 points of a scrambling fall one into each of 16 strata of dimension 0.
        for k in 0..SCRAMBLINGS {
            let mut seen = [0; 16];
            for i in 0..16 {
                let u = Sampler::new(3, 5, 9, i * SCRAMBLINGS + k).uniform();
                seen[(u * 16.0) as usize] += 1;
            }
            assert!(seen.iter().all(|&c| c == 1), "{seen:?}");
        }
    }
}
