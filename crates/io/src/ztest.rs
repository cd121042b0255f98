//! Do two noisy pictures differ by more than their noise? z-tests per pixel, per block of 16 x 16 and over the whole picture.
//!
//! A difference and its variance add up over pixels, so all three tests are one: sum, divide, compare with the distribution
//! that the quotient has if the means are equal. The largest of many quotients is judged after Sidak's correction.
//!
//! *Assumes* sums that are nearly normal, and independent pixels where a picture does not say what the variances of its blocks' means are ([`Sums`]). With few or very unequal
//! samples single pixels are not: the verdict rests on the blocks and the mean, the pixels tell where to look.

use moonmilk_core::stats::z_test;
use statrs::function::beta::beta_reg;
use statrs::function::erf::erfc;

/// Side of the blocks in pixels.
pub const BLOCK: usize = 16;

/// Two values without variance count as equal up to this share of the larger one.
///
/// f32 sums of 10^4 equal terms, in any order, are off by less; halves are not (use f32 files).
pub const ROUNDING: f64 = 1e-5;

/// A sum of differences, its variance, and how well that variance is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Sum of the differences, test minus reference.
    pub difference: f64,
    /// Variance of that sum, as estimated.
    pub variance: f64,
    /// Sum of `variance^2 / degrees of freedom` over the terms; 0 where variances are known exactly.
    pub uncertainty: f64,
}

impl Deviation {
    /// Returns the deviation of one pixel from its values, their variances and the degrees of freedom of these.
    ///
    /// *Domain*: variances not negative; `f64::INFINITY` for variances known exactly.
    pub fn new(test: [f64; 3], reference: [f64; 3]) -> Self {
        let [(a, va, na), (b, vb, nb)] = [test, reference].map(|[mean, variance, freedom]| (mean, variance, freedom));
        Deviation { difference: a - b, variance: va + vb, uncertainty: va * va / na + vb * vb / nb }
    }

    /// Adds an independent deviation.
    pub fn add(&mut self, other: &Deviation) {
        self.difference += other.difference;
        self.variance += other.variance;
        self.uncertainty += other.uncertainty;
    }

    /// Returns the difference in standard errors; 0 where there is no variance.
    pub fn z(&self) -> f64 {
        if self.variance > 0.0 { self.difference / self.variance.sqrt() } else { 0.0 }
    }

    /// Returns the reciprocal of the degrees of freedom of the variance (Welch and Satterthwaite); 0 if it is known exactly.
    fn inverse_freedom(&self) -> f64 {
        if self.variance > 0.0 { self.uncertainty / (self.variance * self.variance) } else { 0.0 }
    }

    /// Returns the probability of a deviation as large or larger, of either sign, if the means are equal.
    ///
    /// Normal law for known variances, Student's for estimated ones.
    pub fn p(&self) -> f64 {
        let (z, inverse) = (self.z(), self.inverse_freedom());
        // From a million degrees of freedom on the two laws agree to a millionth part.
        if inverse < 1e-6 {
            return z_test(z);
        }
        let freedom = 1.0 / inverse;
        beta_reg(0.5 * freedom, 0.5, freedom / (freedom + z * z))
    }
}

/// Returns the probability that the smallest of `n` independent p-values is at most `p`: `1 - (1 - p)^n` (Sidak).
pub fn sidak_p(p: f64, n: usize) -> f64 {
    if p >= 1.0 { 1.0 } else { -(n as f64 * (-p).ln_1p()).exp_m1() }
}

/// The least probable deviation of a set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extreme {
    /// The deviation in standard errors, test minus reference.
    pub z: f64,
    /// Column of the pixel, or of the block's first pixel, counted from the stored pixels' left.
    pub x: usize,
    /// Row, counted from the top.
    pub y: usize,
    /// Probability of such an extreme in the whole set if all means are equal (after Sidak).
    pub p: f64,
}

/// A set of deviations judged together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetTest {
    /// Number of deviations with a variance.
    pub n: usize,
    /// Mean of z^2, scaled so that 1 is expected. Well below 1: the variances are overstated.
    pub mean_square: f64,
    /// Probability of a mean square as large or larger if all means are equal.
    pub mean_square_p: f64,
    /// The least probable one.
    pub extreme: Extreme,
}

/// The tests of one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct ZTest {
    /// `R`, `G` or `B`.
    pub channel: String,
    /// Pixels that differ (by more than [`ROUNDING`]) although neither picture claims any variance there.
    pub unexplained: usize,
    /// The whole picture's mean in standard errors.
    pub mean_z: f64,
    /// Probability of such a mean.
    pub mean_p: f64,
    /// Every pixel by itself; no part of the verdict.
    pub pixels: SetTest,
    /// Means of blocks of 16 x 16 pixels; those at the right and lower border may be smaller.
    pub blocks: SetTest,
}

impl ZTest {
    /// Returns the smallest p-value of mean and blocks, corrected for being the smallest of three.
    ///
    /// The three are not independent, so the correction is on the safe side. Unexplained pixels give 0. The tests of single
    /// pixels are left out: pixels of a path tracer are far from normal, and two correct pictures fail them
    /// (two other renderers' converged pictures of a ball of milk: mean z^2 of the pixels 8, of the blocks 1.07).
    pub fn p(&self) -> f64 {
        if self.unexplained > 0 {
            return 0.0;
        }
        let all = [self.mean_p, self.blocks.mean_square_p, self.blocks.extreme.p];
        sidak_p(all.into_iter().fold(1.0, f64::min), all.len())
    }
}

/// Variances of sums of differences, and `variance^2 / degrees of freedom` of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Sums {
    /// Over the blocks of [`BLOCK`]² pixels, row by row.
    pub blocks: Vec<[f64; 2]>,
    /// Over all pixels.
    pub whole: [f64; 2],
}

/// Returns the tests of one channel of `width` columns; the variances of sums over many pixels are those given.
///
/// `pixel` gives the deviation of a pixel by its index, or nothing where it is invalid; `unexplained` are counted beforehand.
pub fn test_channel(
    channel: &str,
    width: usize,
    height: usize,
    unexplained: usize,
    pixel: impl Fn(usize) -> Option<Deviation>,
    sums: &Sums,
) -> ZTest {
    let columns = width.div_ceil(BLOCK);
    let mut blocks = vec![Deviation::default(); columns * height.div_ceil(BLOCK)];
    let (mut all, mut pixels) = (Deviation::default(), SetSum::default());
    for i in 0..width * height {
        if let Some(d) = pixel(i) {
            let (x, y) = (i % width, i / width);
            all.add(&d);
            blocks[y / BLOCK * columns + x / BLOCK].add(&d);
            pixels.add(&d, x, y);
        }
    }
    [all.variance, all.uncertainty] = sums.whole;
    let mut block_sum = SetSum::default();
    for (k, (d, s)) in blocks.iter_mut().zip(&sums.blocks).enumerate() {
        [d.variance, d.uncertainty] = *s;
        block_sum.add(d, k % columns * BLOCK, k / columns * BLOCK);
    }
    let channel = channel.to_owned();
    ZTest {
        channel,
        unexplained,
        mean_z: all.z(),
        mean_p: all.p(),
        pixels: pixels.finish(),
        blocks: block_sum.finish(),
    }
}

/// Accumulates a [`SetTest`].
#[derive(Default)]
struct SetSum {
    n: usize,
    /// Sum, number and summed variance of the squares whose law has these moments.
    squares: (f64, usize, f64),
    extreme: Option<(f64, Extreme)>,
}

impl SetSum {
    fn add(&mut self, d: &Deviation, x: usize, y: usize) {
        if d.variance <= 0.0 {
            return;
        }
        self.n += 1;
        let (z, inverse) = (d.z(), d.inverse_freedom());
        // The square of a Student variate has mean f / (f - 2); scaled to 1, its variance is 2 (f - 1) / (f - 4).
        if inverse < 0.25 {
            self.squares.0 += z * z * (1.0 - 2.0 * inverse);
            self.squares.1 += 1;
            self.squares.2 += 2.0 * (1.0 - inverse) / (1.0 - 4.0 * inverse);
        }
        let p = d.p();
        // Below the smallest number p is 0 for all; then the larger z is the less probable.
        let less = |(q, e): &(f64, Extreme)| p < *q || p == *q && z.abs() > e.z.abs();
        if self.extreme.as_ref().is_none_or(less) {
            self.extreme = Some((p, Extreme { z, x, y, p }));
        }
    }

    fn finish(self) -> SetTest {
        let (sum, n, variance) = self.squares;
        let mean_square = if n > 0 { sum / n as f64 } else { 1.0 };
        let mean_square_p = if n > 0 { chi_square_tail(mean_square, 2.0 * (n as f64).powi(2) / variance) } else { 1.0 };
        let mut extreme = self.extreme.map_or(Extreme { z: 0.0, x: 0, y: 0, p: 1.0 }, |(_, e)| e);
        extreme.p = sidak_p(extreme.p, self.n);
        SetTest { n: self.n, mean_square, mean_square_p, extreme }
    }
}

/// Returns the probability that a chi-square variate over its degrees of freedom exceeds `ratio`.
///
/// Wilson and Hilferty: its cube root is nearly normal with mean 1 - 2/(9k) and variance 2/(9k); a sum of unequal squares is
/// given the k that fits its variance. *Accuracy*: p itself within 7 % at 10 and 1 % at 100 degrees of freedom, down to p = 0.1 %.
fn chi_square_tail(ratio: f64, freedom: f64) -> f64 {
    let v = 2.0 / (9.0 * freedom);
    0.5 * erfc((ratio.cbrt() - (1.0 - v)) / (2.0 * v).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_are_those_of_the_tables() {
        let normal = |z: f64| Deviation::new([z, 1.0, f64::INFINITY], [0.0, 0.0, f64::INFINITY]).p();
        // Two-sided normal quantiles: 1.959964 at 5 %, 3.890592 at 1e-4 (digits of the quantile limit the agreement).
        assert!((normal(1.959964) - 0.05).abs() < 1e-7 && (normal(-3.890592) / 1e-4 - 1.0).abs() < 1e-5);
        // Student: 2.228139 at 5 % for 10 degrees of freedom, 12.706205 for 1.
        let student = |t: f64, f: f64| Deviation::new([t, 1.0, f], [0.0, 0.0, 5.0]).p();
        assert!((student(2.228139, 10.0) - 0.05).abs() < 1e-7 && (student(12.706205, 1.0) - 0.05).abs() < 1e-7);
        // Continuous at the change from one law to the other.
        assert!((student(3.0, 0.99e6) / normal(3.0) - 1.0).abs() < 3e-5);
    }

    #[test]
    fn two_equal_variances_double_the_degrees_of_freedom() {
        let d = Deviation::new([1.0, 0.5, 7.0], [0.0, 0.5, 7.0]);
        assert!((1.0 / d.inverse_freedom() - 14.0).abs() < 1e-12);
        assert_eq!(Deviation::new([1.0, 0.0, 7.0], [0.0, 0.0, 7.0]).z(), 0.0);
    }

    #[test]
    fn sidak_is_exact_for_tiny_and_large_probabilities() {
        assert!((sidak_p(0.5, 2) - 0.75).abs() < 1e-15 && sidak_p(1.0, 9) == 1.0 && sidak_p(0.0, 9) == 0.0);
        assert!((sidak_p(1e-20, 1000) / 1e-17 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_tail_of_chi_square_is_that_of_the_tables() {
        // Upper quantiles: 18.307 (5 %, 10), 29.588 (0.1 %, 10), 124.342 (5 %, 100), 149.449 (0.1 %, 100).
        for (q, k, p) in [(18.307, 10.0, 0.05), (29.588, 10.0, 0.001), (124.342, 100.0, 0.05), (149.449, 100.0, 0.001)]
        {
            // The approximation's own error, largest at ten degrees of freedom: 0.5 % at p = 5 %, 6.6 % at p = 0.1 %.
            assert!((chi_square_tail(q / k, k) / p - 1.0).abs() < 0.07, "{}", chi_square_tail(q / k, k));
        }
    }
}
