//! The error of a picture, split into what a model does wrong (bias) and what is noise (variance).
//!
//! A picture comes as two independent halves A and B, the reference as its mean R and the deviation S of its halves P and Q: R = (P + Q) / 2, S = (P - Q) / 2.
//! For each pixel and channel, with the weight 1 / D of [`weights`],
//!
//! $$ \text{bias}^2 = \Big\langle \frac{(A - R)(B - R) - S^2}{D} \Big\rangle, \qquad
//!    \text{variance} = \Big\langle \frac{(A - B)^2}{4 D} \Big\rangle, \qquad
//!    \text{relMSE} = \text{bias}^2 + \text{variance} = \Big\langle \frac{(M - R)^2 - S^2}{D} \Big\rangle, \quad M = \frac{A + B}{2}. $$
//!
//! The first is the mean of (A - P)(B - Q) and (A - Q)(B - P): products of independent factors, whose expectation is (a - r)^2 without any part of the
//! noise of either picture. The second has the variance of M as its expectation. The third follows from both, term by term. A noisy estimate of bias^2 may be negative.
//!
//! **Standard errors** are those of noise: how much a figure would change with another seed. That of a ratio of means comes from the differences of
//! the halves. That of bias^2 comes from the spread within blocks of 2 x 2 pixels, whose noise is independent and whose bias is nearly the same; where it
//! is not, the error is overestimated.
//!
//! Noise may be alike in neighbouring pixels: a renderer's points on a surface serve many. Both errors therefore take sums over blocks of several sizes for
//! independent instead of pixels, whichever size gives the larger error; for bias^2 in what noise changes to first order, (M - R) (A - B) / D. Noise that is alike
//! over larger parts than an eighth of the pixels remains unseen.
//!
//! *Use when* two pictures differ by a model and by noise at once. *Do not use when* pictures come without halves: [`crate::metrics::diff`] compares those.

use moonmilk_core::Estimate;

use crate::image::{Error, ErrorKind, Picture, Planes};
use crate::metrics::RELATIVE_EPSILON;

/// Layers that hold the halves of a picture.
pub const LAYERS: [&str; 2] = ["HalfA", "HalfB"];

/// Pixels on each side of one that its weight is taken from.
const REACH: usize = 2;

/// A colour of three planes, rows from the top.
pub type Colour = [Vec<f32>; 3];

/// Two independent halves of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Halves {
    /// One half.
    pub a: Colour,
    /// The other.
    pub b: Colour,
}

/// What a picture is compared with.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Mean of its halves, or the picture itself.
    pub mean: Colour,
    /// Half the difference of its halves, or the root of its variance, or 0 where neither is known.
    pub deviation: Colour,
}

/// The figures of some pixels and channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figures {
    /// Number of pixels that take part.
    pub pixels: u64,
    /// Number of values: pixels times the channels of each that take part. Means are over these.
    pub values: u64,
    /// Sum of the reference, by which ratios are weighed.
    pub reference: f64,
    /// Sum over that of the reference.
    pub ratio: Estimate,
    /// Squared relative error of the model.
    pub bias2: Estimate,
    /// Relative variance of the picture.
    pub variance: Estimate,
    /// The sum of the two: relMSE.
    pub total: Estimate,
}

fn owned(p: Planes<'_>) -> Colour {
    p.map(<[f32]>::to_vec)
}

/// Returns the planes of a colour.
pub fn planes(c: &Colour) -> Planes<'_> {
    [&c[0], &c[1], &c[2]]
}

fn combine(a: &Colour, b: &Colour, f: impl Fn(f32, f32) -> f32) -> Colour {
    std::array::from_fn(|c| a[c].iter().zip(&b[c]).map(|(&x, &y)| f(x, y)).collect())
}

impl Halves {
    /// Returns the halves in the layers of a picture, if it has them.
    pub fn of(picture: &Picture) -> Option<Self> {
        let [a, b] = LAYERS.map(|l| picture.layer(l).map(owned));
        Some(Self { a: a?, b: b? })
    }

    /// Returns the mean picture.
    pub fn mean(&self) -> Colour {
        combine(&self.a, &self.b, |x, y| 0.5 * (x + y))
    }
}

impl Reference {
    /// Returns the reference of two halves.
    pub fn of_halves(h: &Halves) -> Self {
        Self { mean: h.mean(), deviation: combine(&h.a, &h.b, |x, y| 0.5 * (x - y)) }
    }

    /// Returns a picture as a reference, and whether its noise is known: by halves, else by a layer `Variance`.
    ///
    /// *Errors*: no colour; values that are not finite.
    pub fn of_picture(picture: &Picture) -> Result<(Self, bool), Error> {
        let mean = owned(picture.require_rgb()?);
        let (reference, known) = match (Halves::of(picture), picture.layer("Variance")) {
            (Some(h), _) => (Self::of_halves(&h), true),
            (None, Some(v)) => {
                (Self { mean, deviation: owned(v).map(|p| p.iter().map(|x| x.max(0.0).sqrt()).collect()) }, true)
            }
            (None, None) => (Self { deviation: mean.clone().map(|p| vec![0.0; p.len()]), mean }, false),
        };
        if reference.mean.iter().chain(&reference.deviation).flatten().any(|x| !x.is_finite()) {
            return Err(
                ErrorKind::Damaged { format: "reference", reason: "it has values that are not finite".into() }.into()
            );
        }
        Ok((reference, known))
    }
}

/// Returns D per pixel and channel: the square of the reference's mean over the 24 pixels around it, plus [`RELATIVE_EPSILON`].
///
/// As in relMSE, but without the pixel itself: pixels are independent, so a pixel's weight does not depend on its own noise, and expectations of products
/// with it stay exact. Beyond the border there are fewer.
pub fn weights(reference: &Colour, width: usize) -> Colour {
    let height = reference[0].len() / width.max(1);
    reference.each_ref().map(|plane| {
        let around = |x: usize, y: usize| {
            let (mut sum, mut n) = (0.0f64, 0.0f64);
            for v in y.saturating_sub(REACH)..(y + REACH + 1).min(height) {
                for u in x.saturating_sub(REACH)..(x + REACH + 1).min(width) {
                    if (u, v) != (x, y) {
                        sum += f64::from(plane[v * width + u]);
                        n += 1.0;
                    }
                }
            }
            if n > 0.0 { sum / n } else { 0.0 }
        };
        (0..plane.len()).map(|i| (around(i % width, i / width).powi(2) + RELATIVE_EPSILON) as f32).collect()
    })
}

/// Returns (M - R) / sqrt(D) per pixel, mean over the channels: negative where the picture is too dark.
pub fn signed_error(test: &Colour, reference: &Colour, weights: &Colour) -> Vec<f32> {
    let one = |c: usize, i: usize| (test[c][i] - reference[c][i]) / weights[c][i].sqrt();
    (0..test[0].len()).map(|i| (one(0, i) + one(1, i) + one(2, i)) / 3.0).collect()
}

/// Terms of a pixel, summed over the channels that take part.
#[derive(Clone, Copy, Default)]
struct Terms {
    channels: f64,
    test: f64,
    reference: f64,
    /// Half the difference of the halves, of the picture and of the reference.
    noise: [f64; 2],
    /// bias^2, variance, and their sum.
    squares: [f64; 3],
    /// What the picture's noise changes in bias^2, to first order.
    first_order: f64,
}

/// Sides of the blocks whose noise counts as independent.
const BLOCKS: [usize; 4] = [4, 8, 16, 32];
/// Fewest blocks that say anything.
const FEWEST_BLOCKS: usize = 8;

/// Returns the variance of a sum over pixels of something of mean 0: the sum of the squares of pixels or of blocks, whichever is largest.
fn correlated(all: &[Terms], width: usize, of: impl Fn(&Terms) -> f64) -> f64 {
    let independent = all.iter().map(|t| of(t).powi(2)).sum::<f64>();
    let across = |side: usize| width.div_ceil(side);
    BLOCKS.iter().fold(independent, |largest, &side| {
        let mut sums = vec![(0.0f64, false); across(side) * (all.len() / width).div_ceil(side)];
        for (i, t) in all.iter().enumerate().filter(|(_, t)| t.channels > 0.0) {
            let block = &mut sums[i / width / side * across(side) + i % width / side];
            *block = (block.0 + of(t), true);
        }
        let occupied = sums.iter().filter(|s| s.1).count();
        if occupied < FEWEST_BLOCKS { largest } else { largest.max(sums.iter().map(|s| s.0 * s.0).sum()) }
    })
}

/// Returns the figures of the pixels and channels that `takes(pixel, channel)` names; `None` if there are none.
pub fn figures(
    test: &Halves,
    reference: &Reference,
    weights: &Colour,
    width: usize,
    takes: impl Fn(usize, usize) -> bool,
) -> Option<Figures> {
    let pixel = |i: usize| {
        let mut t = Terms::default();
        for c in (0..3).filter(|&c| takes(i, c)) {
            let [a, b, r, s, d] =
                [test.a[c][i], test.b[c][i], reference.mean[c][i], reference.deviation[c][i], weights[c][i]]
                    .map(f64::from);
            t.channels += 1.0;
            t.test += 0.5 * (a + b);
            t.reference += r;
            t.noise[0] += 0.5 * (a - b);
            t.noise[1] += s;
            t.first_order += (0.5 * (a + b) - r) * (a - b) / d;
            let (bias, variance) = (((a - r) * (b - r) - s * s) / d, 0.25 * (a - b).powi(2) / d);
            [bias, variance, bias + variance].iter().zip(&mut t.squares).for_each(|(x, sum)| *sum += x);
        }
        t
    };
    let all: Vec<Terms> = (0..test.a[0].len()).map(pixel).collect();
    let sum = |f: &dyn Fn(&Terms) -> f64| all.iter().map(f).sum::<f64>();
    let items = sum(&|t| t.channels);
    if items == 0.0 {
        return None;
    }
    let pixels = all.iter().filter(|t| t.channels > 0.0).count() as u64;
    let exact = sum(&|t| t.reference);
    let ratio = sum(&|t| t.test) / exact;
    // Noise of the ratio to first order.
    let noise = (correlated(&all, width, |t| t.noise[0]) + correlated(&all, width, |t| ratio * t.noise[1])).sqrt();
    let alike = correlated(&all, width, |t| t.first_order) - sum(&|t| t.first_order.powi(2));
    let squares = [0, 1, 2].map(|k| Estimate {
        mean: sum(&|t| t.squares[k]) / items,
        std_err: (spread(&all, width, k) + if k == 1 { 0.0 } else { alike }).sqrt() / items,
        n: pixels,
    });
    let [bias2, variance, total] = squares;
    Some(Figures {
        pixels,
        values: items as u64,
        reference: exact,
        ratio: Estimate { mean: ratio, std_err: noise / exact.abs(), n: pixels },
        bias2,
        variance,
        total,
    })
}

/// Returns the variance of the sum of one kind of squares: within each block of 2 x 2 pixels m / (m - 1) sum (x - mean)^2, blocks of one
/// pixel as the mean of the others.
fn spread(all: &[Terms], width: usize, kind: usize) -> f64 {
    let height = all.len() / width;
    let (mut variance, mut counted, mut alone) = (0.0, 0.0f64, 0.0);
    for y in (0..height).step_by(2) {
        for x in (0..width).step_by(2) {
            let block = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)]
                .into_iter()
                .filter(|&(x, y)| x < width && y < height)
                .map(|(x, y)| &all[y * width + x])
                .filter(|t| t.channels > 0.0);
            let values: Vec<f64> = block.map(|t| t.squares[kind]).collect();
            let m = values.len() as f64;
            if values.len() < 2 {
                alone += m;
                continue;
            }
            let mean = values.iter().sum::<f64>() / m;
            variance += m / (m - 1.0) * values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            counted += m;
        }
    }
    if counted > 0.0 { variance * (counted + alone) / counted } else { f64::NAN }
}

#[cfg(test)]
#[path = "split_tests.rs"]
mod tests;
