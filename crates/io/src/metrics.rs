//! How two pictures differ: mean ratio, squared errors, FLIP, and z-tests where both bring their variance.
//!
//! A is the picture under test, B the reference. Colour only (`R`, `G`, `B` or `Y`); other layers are not compared.
//! The variance layer `Variance.R` ... holds the variance of the pixel's value itself (not of a single sample). If the
//! attribute [`VARIANCE_SAMPLES`] says from how many independent parts it was estimated, the tests allow for that. Pixels may share errors: then [`BLOCK_VARIANCE`] says what means are worth.

use std::fmt;

use crate::false_color::false_color;
use crate::flip::{self, HdrFlip, PIXELS_PER_DEGREE};
use crate::image::{Error, ErrorKind, Picture, Planes, Value, Window};
use crate::ztest::{BLOCK, Deviation, ROUNDING, Sums, ZTest, sidak_p, test_channel};

/// Epsilon of relMSE and of the relative error: `(a - b)^2 / (b^2 + RELATIVE_EPSILON)`.
///
/// 0.01 as is common in papers on denoising. It keeps black pixels finite; for pictures much darker than 0.1 it dominates
/// and relMSE is 100 times the MSE.
pub const RELATIVE_EPSILON: f64 = 0.01;

/// Name of the attribute (integer, at least 2) with the number of independent parts behind the `Variance` layer.
pub const VARIANCE_SAMPLES: &str = "moonmilk.varianceSamples";

/// Layer with the variance of the mean over the block of [`crate::ztest::BLOCK`]² pixels that a pixel is in, and attributes (before `R`, `G`, `B`) with that of the picture's mean: of as many parts as the
/// `Variance` layer. Without them pixels are taken as independent.
pub const BLOCK_VARIANCE: &str = "BlockVariance";
/// See [`BLOCK_VARIANCE`].
pub const MEAN_VARIANCE: &str = "moonmilk.meanVariance";

/// The plain figures of one channel, or of all channels together.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelDiff {
    /// `R`, `G`, `B` or `all`.
    pub name: String,
    /// Mean of A.
    pub mean_test: f64,
    /// Mean of B.
    pub mean_reference: f64,
    /// Mean of A over mean of B; NaN if both are zero.
    pub ratio: f64,
    /// Standard error of the ratio to first order, if both pictures bring their variance. For `all` the channels
    /// are taken as fully dependent (their noise comes from the same paths), which is the larger figure.
    pub ratio_std_err: Option<f64>,
    /// Mean of (a - b)^2.
    pub mse: f64,
    /// Mean of (a - b)^2 / (b^2 + [`RELATIVE_EPSILON`]).
    pub rel_mse: f64,
    /// Largest |a - b|.
    pub largest: f64,
}

impl ChannelDiff {
    /// Returns the root of the mean squared error.
    pub fn rmse(&self) -> f64 {
        self.mse.sqrt()
    }
}

/// Everything that [`diff`] finds.
#[derive(Clone, Debug, PartialEq)]
pub struct DiffReport {
    /// The pixels compared.
    pub window: Window,
    /// Pixels left out because a value is infinite or not a number in A or B.
    pub invalid: usize,
    /// `R`, `G`, `B`.
    pub channels: Vec<ChannelDiff>,
    /// All channels together.
    pub all: ChannelDiff,
    /// HDR-FLIP: map and exposures (invalid pixels count as black in both).
    pub flip_hdr: HdrFlip,
    /// LDR-FLIP of the pictures clipped to \[0, 1\], per pixel.
    pub flip_ldr: Vec<f32>,
    /// The z-tests of the channels, if both pictures have a `Variance` layer.
    pub tests: Option<Vec<ZTest>>,
    /// |a - b| / sqrt(b^2 + [`RELATIVE_EPSILON`]) per pixel, mean over the channels; NaN where invalid.
    pub relative_error: Vec<f32>,
}

impl DiffReport {
    /// Returns the mean of HDR-FLIP.
    pub fn flip(&self) -> f64 {
        flip::mean(&self.flip_hdr.map)
    }

    /// Returns the smallest of [`ZTest::p`] over the channels, Sidak-corrected.
    ///
    /// That is how probable so large a difference is if A and B have equal means.
    ///
    /// Nothing if a variance is missing. Below 1e-4 the pictures differ by more than noise.
    pub fn p(&self) -> Option<f64> {
        let tests = self.tests.as_ref()?;
        Some(sidak_p(tests.iter().map(ZTest::p).fold(1.0, f64::min), tests.len()))
    }

    /// Returns HDR-FLIP in false colours, black for 0, pale yellow for 1.
    pub fn flip_picture(&self) -> Result<Picture, Error> {
        false_color(&self.flip_hdr.map, self.window.width, self.window.height, 1.0)
    }

    /// Returns the relative error in false colours; errors of `white` and more are the brightest, invalid pixels green.
    pub fn relative_error_picture(&self, white: f32) -> Result<Picture, Error> {
        false_color(&self.relative_error, self.window.width, self.window.height, white)
    }
}

/// Compares a picture A with a reference B.
///
/// *Errors*: a picture without colour; pictures that cover different pixels.
pub fn diff(test: &Picture, reference: &Picture) -> Result<DiffReport, Error> {
    let (a, b) = (test.require_rgb()?, reference.require_rgb()?);
    let window = test.window();
    if window != reference.window() {
        return Err(ErrorKind::DifferentWindows { test: window, reference: reference.window() }.into());
    }
    let n = window.width * window.height;
    let noise = test.layer("Variance").zip(reference.layer("Variance"));
    let valid: Vec<bool> = (0..n).map(|i| a.iter().chain(&b).all(|plane| plane[i].is_finite())).collect();
    let invalid = valid.iter().filter(|v| !**v).count();

    let freedom = [freedom(test), freedom(reference)];
    let (mut channels, mut tests) = (Vec::new(), Vec::new());
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        let mut figures = figures(name, a[c], b[c], &valid);
        if let Some((va, vb)) = noise {
            let pixel = |i: usize| valid[i].then(|| deviation([a[c], va[c]], [b[c], vb[c]], freedom, i)).flatten();
            let unexplained =
                (0..n).filter(|&i| valid[i] && unexplained([a[c][i], va[c][i]], [b[c][i], vb[c][i]])).count();
            let sums = [(test, va[c]), (reference, vb[c])].map(|(p, v)| Sums::of(p, c, v, &valid));
            let variance: f64 = sums.iter().map(|s| s.whole[0]).sum();
            figures.ratio_std_err = Some(variance.sqrt() / ((n - invalid) as f64 * figures.mean_reference.abs()));
            let [a, b] = sums;
            tests.push(test_channel(name, window.width, window.height, unexplained, pixel, &a.joined(&b)));
        }
        channels.push(figures);
    }

    let clean = |p: Planes<'_>| {
        p.map(|plane| plane.iter().zip(&valid).map(|(&x, &v)| if v { x } else { 0.0 }).collect::<Vec<f32>>())
    };
    let (ca, cb) = (clean(a), clean(b));
    let (pa, pb) = ([&ca[0][..], &ca[1], &ca[2]], [&cb[0][..], &cb[1], &cb[2]]);
    Ok(DiffReport {
        window,
        invalid,
        all: together(&channels),
        channels,
        flip_hdr: flip::hdr(pa, pb, window.width, PIXELS_PER_DEGREE),
        flip_ldr: flip::ldr(pa, pb, window.width, PIXELS_PER_DEGREE),
        tests: noise.map(|_| tests),
        relative_error: (0..n).map(|i| if valid[i] { relative_error(a, b, i) } else { f32::NAN }).collect(),
    })
}

impl Sums {
    /// Returns the variances of a picture's sums of a channel over blocks and all valid pixels: as the picture says, or for independent pixels.
    fn of(picture: &Picture, c: usize, variance: &[f32], valid: &[bool]) -> Self {
        let (width, freedom) = (picture.width, freedom(picture));
        let columns = width.div_ceil(BLOCK);
        let mut blocks = vec![[0.0f64; 2]; columns * (valid.len() / width).div_ceil(BLOCK)];
        let mut counts = vec![0.0f64; blocks.len()];
        let block = |i: usize| i / width / BLOCK * columns + i % width / BLOCK;
        let usable = |i: &usize| valid[*i] && variance[*i] >= 0.0 && variance[*i].is_finite();
        for i in (0..valid.len()).filter(usable) {
            let (v, at) = (f64::from(variance[i]), &mut blocks[block(i)]);
            (at[0], at[1], counts[block(i)]) = (at[0] + v, at[1] + v * v / freedom, counts[block(i)] + 1.0);
        }
        let of_mean = |v: f64, n: f64| [v * n * n, (v * n * n).powi(2) / freedom];
        let name = ["R", "G", "B"][c];
        let said = picture.attributes.get(&format!("{MEAN_VARIANCE}{name}"));
        if let (Some(layer), Some(Value::Float(mean))) = (picture.layer(BLOCK_VARIANCE), said) {
            for i in (0..valid.len()).filter(usable) {
                blocks[block(i)] = of_mean(f64::from(layer[c][i]), counts[block(i)]);
            }
            return Self { blocks, whole: of_mean(*mean, counts.iter().sum()) };
        }
        let whole = blocks.iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        Self { blocks, whole }
    }

    /// Returns those of the difference from an independent picture.
    fn joined(&self, other: &Self) -> Self {
        let add = |(a, b): (&[f64; 2], &[f64; 2])| [a[0] + b[0], a[1] + b[1]];
        Self {
            blocks: self.blocks.iter().zip(&other.blocks).map(add).collect(),
            whole: add((&self.whole, &other.whole)),
        }
    }
}

/// Returns the degrees of freedom of a picture's variances: samples - 1, or infinity if nothing is said.
fn freedom(picture: &Picture) -> f64 {
    match picture.attributes.get(VARIANCE_SAMPLES) {
        Some(Value::Int(n)) if *n >= 2 => f64::from(n - 1),
        _ => f64::INFINITY,
    }
}

/// Returns the deviation of pixel `i` of \[value, variance\] planes, or nothing where a variance is not usable.
fn deviation(test: [&[f32]; 2], reference: [&[f32]; 2], freedom: [f64; 2], i: usize) -> Option<Deviation> {
    let [a, va, b, vb] = [test[0], test[1], reference[0], reference[1]].map(|plane| f64::from(plane[i]));
    let usable = va >= 0.0 && vb >= 0.0 && (va + vb).is_finite();
    usable.then(|| Deviation::new([a, va, freedom[0]], [b, vb, freedom[1]]))
}

/// Returns whether two \[value, variance\] differ although neither has any variance.
fn unexplained(test: [f32; 2], reference: [f32; 2]) -> bool {
    let [a, b] = [test[0], reference[0]].map(f64::from);
    test[1] == 0.0 && reference[1] == 0.0 && (a - b).abs() > ROUNDING * a.abs().max(b.abs())
}

fn relative_error(a: Planes<'_>, b: Planes<'_>, i: usize) -> f32 {
    let one = |c: usize| {
        let (a, b) = (f64::from(a[c][i]), f64::from(b[c][i]));
        (a - b).abs() / (b * b + RELATIVE_EPSILON).sqrt()
    };
    ((one(0) + one(1) + one(2)) / 3.0) as f32
}

/// Returns the plain figures of one channel over the valid pixels.
fn figures(name: &str, a: &[f32], b: &[f32], valid: &[bool]) -> ChannelDiff {
    let (mut n, mut sums, mut largest) = (0u64, [0.0f64; 4], 0.0f64);
    for (i, (&a, &b)) in a.iter().zip(b).enumerate() {
        if valid[i] {
            let (a, b) = (f64::from(a), f64::from(b));
            let square = (a - b) * (a - b);
            let terms = [a, b, square, square / (b * b + RELATIVE_EPSILON)];
            sums.iter_mut().zip(terms).for_each(|(s, t)| *s += t);
            largest = largest.max((a - b).abs());
            n += 1;
        }
    }
    let [mean_test, mean_reference, mse, rel_mse] = sums.map(|s| s / n as f64);
    ChannelDiff {
        name: name.into(),
        mean_test,
        mean_reference,
        ratio: mean_test / mean_reference,
        ratio_std_err: None,
        mse,
        rel_mse,
        largest,
    }
}

/// Returns the figures over all channels: means of means, except for the largest.
fn together(channels: &[ChannelDiff]) -> ChannelDiff {
    let mean = |f: fn(&ChannelDiff) -> f64| channels.iter().map(f).sum::<f64>() / channels.len() as f64;
    let (mean_test, mean_reference) = (mean(|c| c.mean_test), mean(|c| c.mean_reference));
    // Absolute standard errors add if the channels depend fully on each other.
    let errors: Option<f64> = channels.iter().map(|c| c.ratio_std_err.map(|e| e * c.mean_reference.abs())).sum();
    ChannelDiff {
        name: "all".into(),
        mean_test,
        mean_reference,
        ratio: mean_test / mean_reference,
        ratio_std_err: errors.map(|e| e / channels.len() as f64 / mean_reference.abs()),
        mse: mean(|c| c.mse),
        rel_mse: mean(|c| c.rel_mse),
        largest: channels.iter().map(|c| c.largest).fold(0.0, f64::max),
    }
}

impl fmt::Display for DiffReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "compared   {}, {} invalid pixels left out", self.window, self.invalid)?;
        writeln!(
            f,
            "{:10} {:>12} {:>12} {:>22} {:>11} {:>11} {:>11} {:>11}",
            "channel", "mean A", "mean B", "A / B", "MSE", "RMSE", "relMSE", "max |A-B|"
        )?;
        for c in self.channels.iter().chain([&self.all]) {
            let ratio = match c.ratio_std_err {
                Some(e) => format!("{:.6} +- {e:.6}", c.ratio),
                None => format!("{:.6}", c.ratio),
            };
            let (a, b) = (c.mean_test, c.mean_reference);
            writeln!(
                f,
                "{:10} {a:>12.6} {b:>12.6} {ratio:>22} {:>11.4e} {:>11.4e} {:>11.4e} {:>11.4e}",
                c.name,
                c.mse,
                c.rmse(),
                c.rel_mse,
                c.largest
            )?;
        }
        writeln!(f, "           relMSE = mean of (A - B)^2 / (B^2 + {RELATIVE_EPSILON})")?;
        let h = &self.flip_hdr;
        writeln!(
            f,
            "FLIP       HDR mean {:.6} ({} exposures, {:.3} to {:.3} stops), LDR mean {:.6}",
            self.flip(),
            h.count,
            h.start,
            h.stop,
            flip::mean(&self.flip_ldr)
        )?;
        let (Some(tests), Some(p)) = (&self.tests, self.p()) else {
            return writeln!(f, "z-test     not possible: both pictures need a Variance layer");
        };
        for t in tests {
            writeln!(
                f,
                "z-test {:3} mean z {:+.3} (p {:.2e}); {} pixels without variance differ",
                t.channel, t.mean_z, t.mean_p, t.unexplained
            )?;
            for (what, s) in [("blocks", &t.blocks), ("pixels", &t.pixels)] {
                let e = &s.extreme;
                writeln!(
                    f,
                    "           {what} {:>8}: mean z^2 {:.4} (p {:.2e}), least probable z {:+.2} at ({}, {}) (p {:.2e} after Sidak)",
                    s.n, s.mean_square, s.mean_square_p, e.z, e.x, e.y, e.p
                )?;
            }
        }
        let verdict =
            if p < 1e-4 { "A and B differ by more than their noise" } else { "the differences agree with the noise" };
        writeln!(f, "           {verdict} (means and blocks: smallest p {p:.2e} after Sidak)")
    }
}

#[cfg(test)]
#[path = "metrics_tests.rs"]
mod tests;
