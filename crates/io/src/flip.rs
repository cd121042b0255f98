//! FLIP: how much two pictures differ to an observer who flips between them, per pixel, from 0 to 1.
//!
//! Two parts: colours are blurred by what the eye cannot resolve and compared in a perceptual space; edges and points
//! present in only one of the pictures raise the result. The LDR form takes pictures as shown on a screen; the HDR form
//! shows both at several exposures through a tone curve and keeps the largest error per pixel.
//!
//! *Use when* an error must be judged by eye or located. *Do not use when* a bias of a per cent is sought: FLIP hardly sees
//! it. There the mean ratio and the z-tests of [`crate::metrics`] are right.
//!
//! *Source*: `[Andersson2020]` P. Andersson, J. Nilsson, T. Akenine-Moller, M. Oskarsson, K. Astrom, M. Fairchild, "FLIP: A
//! Difference Evaluator for Alternating Images", HPG 2020; `[Andersson2021]` P. Andersson, J. Nilsson, P. Shirley,
//! T. Akenine-Moller, "Visualizing Errors in Rendered High Dynamic Range Images", Eurographics 2021. Written from the formulas;
//! choices that the papers leave open (borders, median, rounding of counts) follow the authors' evaluator 1.7, against
//! which the tests compare.

use std::f64::consts::PI;
use std::sync::LazyLock;

use rayon::prelude::*;

use crate::image::Planes;

/// Pixels per degree of visual angle for a 0.7 m wide screen of 3840 pixels seen from 0.7 m: 67.02.
///
/// The observer assumed by the papers. A larger number blurs more: details must be larger to be seen.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// A map of HDR-FLIP values and the exposures it was made with.
#[derive(Clone, Debug, PartialEq)]
pub struct HdrFlip {
    /// FLIP per pixel in \[0, 1\], rows from the top: the largest over all exposures.
    pub map: Vec<f32>,
    /// First exposure in stops (powers of two).
    pub start: f64,
    /// Last exposure in stops.
    pub stop: f64,
    /// Number of exposures, evenly spaced from `start` to `stop`.
    pub count: usize,
}

/// Returns LDR-FLIP per pixel, in \[0, 1\].
///
/// Input is linear RGB, clipped to \[0, 1\] (what is not a number counts as 0): the picture as a screen shows it. Symmetric in
/// the two pictures; 0 where they agree within the reach of the filters.
///
/// *Shapes*: six planes of equal length, a multiple of `width`; the map has that length.
/// *Accuracy*: mean within 5e-6 of the authors' evaluator (test).
pub fn ldr(test: Planes<'_>, reference: Planes<'_>, width: usize, pixels_per_degree: f64) -> Vec<f32> {
    let filters = Filters::new(pixels_per_degree);
    let clip = |p: Planes<'_>| p.map(|plane| plane.iter().map(|&x| clip01(x)).collect::<Vec<f32>>());
    flip(&clip(test), &clip(reference), width, &filters)
}

/// Returns HDR-FLIP: the largest LDR-FLIP over the exposures that show the reference from its highlights to its median.
///
/// Input is linear RGB of any range; negative values and what is not a number count as 0.
/// Exposures run from the one that maps the brightest luminance of the reference to 0.85 of the ACES curve to the one that does
/// so with its median, one per stop, at least two. A median of zero is replaced by 2^-23 as the authors' evaluator does: a
/// picture that is more than half black gets about 30 exposures. A black reference is shown at exposure 0 only.
///
/// *Shapes*: as for [`ldr`]. *Accuracy*: mean within 5e-6 of the authors' evaluator (test).
pub fn hdr(test: Planes<'_>, reference: Planes<'_>, width: usize, pixels_per_degree: f64) -> HdrFlip {
    let filters = Filters::new(pixels_per_degree);
    let (start, stop) = exposures(reference);
    let count = if start == stop && start == 0.0 { 1 } else { ((stop - start).ceil() as usize).max(2) };
    let mut map = vec![0.0f32; reference[0].len()];
    for i in 0..count {
        let stops = start + (stop - start) * i as f64 / (count - 1).max(1) as f64;
        let show = |p: Planes<'_>| p.map(|plane| plane.iter().map(|&x| tone(x, stops.exp2())).collect::<Vec<f32>>());
        let shown = flip(&show(test), &show(reference), width, &filters);
        map.par_iter_mut().zip(shown).for_each(|(m, e)| *m = m.max(e));
    }
    HdrFlip { map, start, stop, count }
}

/// Returns the mean of a map.
pub fn mean(map: &[f32]) -> f64 {
    map.iter().map(|&x| f64::from(x)).sum::<f64>() / map.len().max(1) as f64
}

// --- exposures and tone curve -------------------------------------------------------------------------------------------

/// The ACES curve (a x^2 + b x) / (c x^2 + d x + e) in Narkowicz' fit, with his pre-exposure 0.6 taken out.
const ACES: [f64; 5] = [0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14];

fn tone(x: f32, exposure: f64) -> f32 {
    // Above 1e4 the curve is at its end, and its squares are far from overflow.
    let x = (f64::from(if x > 0.0 { x } else { 0.0 }) * exposure).min(1e4);
    let [a, b, c, d, e] = ACES;
    clip01(((a * x * x + b * x) / (c * x * x + d * x + e)) as f32)
}

/// Returns x with NaN and negative numbers as 0, numbers above 1 as 1.
fn clip01(x: f32) -> f32 {
    if x > 0.0 { x.min(1.0) } else { 0.0 }
}

/// Returns the first and last exposure in stops [Andersson2021, Section 3].
fn exposures(reference: Planes<'_>) -> (f64, f64) {
    let [r, g, b] = reference;
    let positive = |x: f32| f64::from(if x > 0.0 { x.min(1e30) } else { 0.0 });
    let mut luminance: Vec<f64> =
        (0..r.len()).map(|i| 0.2126 * positive(r[i]) + 0.7152 * positive(g[i]) + 0.0722 * positive(b[i])).collect();
    luminance.sort_unstable_by(f64::total_cmp);
    let n = luminance.len();
    let brightest = luminance.last().copied().unwrap_or(0.0);
    if brightest <= 0.0 {
        return (0.0, 0.0);
    }
    // Of an even number of pixels the upper of the two in the middle, as the evaluator takes it.
    let median = luminance[n / 2];
    // Invert the curve at 0.85: the positive root of (a - tc) x^2 + (b - td) x - te = 0.
    let t = 0.85;
    let [a, b, c] = [ACES[0] - t * ACES[2], ACES[1] - t * ACES[3], -t * ACES[4]];
    let bright = (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);
    ((bright / brightest).log2(), (bright / median.max(f64::from(f32::EPSILON))).log2())
}

// --- filters ------------------------------------------------------------------------------------------------------------

/// The filters for one viewing distance, all separable.
struct Filters {
    /// Gaussians of the eye's contrast sensitivity, each of sum 1: luminance, red-green, blue-yellow wide and narrow.
    csf: [Vec<f32>; 4],
    /// Weights of the two blue-yellow Gaussians; their sum is 1.
    blue_yellow: [f32; 2],
    /// Gaussian, its first and its second derivative for edges and points.
    feature: [Vec<f32>; 3],
}

impl Filters {
    /// Builds the filters [Andersson2020, Table 1 and Section 4.2].
    fn new(pixels_per_degree: f64) -> Self {
        // A component a sqrt(pi/b) exp(-pi^2 r^2 / b) per channel, r in degrees; blue-yellow is a sum of two.
        let b = [0.0047, 0.0053, 0.04, 0.025];
        let a = [34.1, 13.5];
        let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
        let line =
            |b: f64| (-radius..=radius).map(move |x| (-(PI * f64::from(x) / pixels_per_degree).powi(2) / b).exp());
        let csf = b.map(|b| line(b).map(|v| (v / line(b).sum::<f64>()) as f32).collect());
        // The two-dimensional sum of a component is its amplitude times the square of its one-dimensional sum.
        let share = [0, 1].map(|i| a[i] * (PI / b[i + 2]).sqrt() * line(b[i + 2]).sum::<f64>().powi(2));
        let blue_yellow = share.map(|s| (s / (share[0] + share[1])) as f32);
        // Edges of 0.082 degrees are what the eye detects best.
        let sigma = 0.5 * 0.082 * pixels_per_degree;
        let radius = (3.0 * sigma).ceil() as i32;
        let derivative = |order: i32| -> Vec<f32> {
            let value = |x: i32| {
                let x = f64::from(x);
                let factor = [1.0, -x, x * x / (sigma * sigma) - 1.0][order as usize];
                factor * (-x * x / (2.0 * sigma * sigma)).exp()
            };
            // Positive weights sum to 1, negative ones to -1.
            let sum = |sign: f64| (-radius..=radius).map(value).filter(|v| v * sign > 0.0).sum::<f64>().abs();
            let (positive, negative) = (sum(1.0), sum(-1.0));
            (-radius..=radius)
                .map(|x| (value(x) / if value(x) > 0.0 { positive } else { negative.max(f64::MIN_POSITIVE) }) as f32)
                .collect()
        };
        Filters { csf, blue_yellow, feature: [derivative(0), derivative(1), derivative(2)] }
    }
}

/// Returns each row correlated with the kernel; outside, the border pixel is repeated.
fn along_rows(src: &[f32], width: usize, kernel: &[f32]) -> Vec<f32> {
    let radius = kernel.len() / 2;
    let mut out = vec![0.0; src.len()];
    out.par_chunks_mut(width).zip(src.par_chunks(width)).for_each_init(
        || Vec::with_capacity(width + 2 * radius),
        |padded, (out, row)| {
            padded.clear();
            padded.resize(radius, row[0]);
            padded.extend_from_slice(row);
            padded.resize(width + 2 * radius, row[width - 1]);
            for (k, &weight) in kernel.iter().enumerate() {
                out.iter_mut().zip(&padded[k..]).for_each(|(o, &x)| *o += weight * x);
            }
        },
    );
    out
}

/// Returns each column correlated with the kernel; outside, the border pixel is repeated.
fn along_columns(src: &[f32], width: usize, kernel: &[f32]) -> Vec<f32> {
    let (radius, height) = (kernel.len() / 2, src.len() / width);
    let mut out = vec![0.0; src.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (k, &weight) in kernel.iter().enumerate() {
            let from = (y + k).saturating_sub(radius).min(height - 1) * width;
            out.iter_mut().zip(&src[from..from + width]).for_each(|(o, &x)| *o += weight * x);
        }
    });
    out
}

// --- colour spaces ------------------------------------------------------------------------------------------------------

type Matrix = [[f32; 3]; 3];

/// Linear sRGB to XYZ relative to the D65 white, so that white is (1, 1, 1), and back.
///
/// Rows of the standard's matrix in rational form, each divided by its sum (which is the white).
static RELATIVE_XYZ: LazyLock<(Matrix, Matrix)> = LazyLock::new(|| {
    let rows =
        [[10135552.0, 8788810.0, 4435075.0], [5226144.0, 17577620.0, 1774030.0], [1425312.0, 8788810.0, 70074185.0]];
    let m: [[f64; 3]; 3] = rows.map(|r: [f64; 3]| r.map(|v| v / (r[0] + r[1] + r[2])));
    // Invert by cofactors: element (i, j) of the inverse is the cofactor (j, i) over the determinant.
    let cofactor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    let inverse = std::array::from_fn(|i| std::array::from_fn(|j| (cofactor(j, i) / determinant) as f32));
    (m.map(|r| r.map(|v| v as f32)), inverse)
});

fn multiply(m: &Matrix, v: [f32; 3]) -> [f32; 3] {
    m.map(|r| r[0] * v[0] + r[1] * v[1] + r[2] * v[2])
}

/// Returns CIELAB with the Hunt effect: chroma loses weight in the dark, factor L / 100 [Andersson2020, Eq. 4].
fn lab_hunt(linear: [f32; 3]) -> [f32; 3] {
    let delta: f32 = 6.0 / 29.0;
    let f = |t: f32| {
        if t > delta.powi(3) { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 }
    };
    let [x, y, z] = multiply(&RELATIVE_XYZ.0, linear).map(f);
    let l = 116.0 * y - 16.0;
    [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
}

/// Returns the HyAB distance: lightness in steps, chroma by Euclid [Andersson2020, Eq. 5].
fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

// --- the metric ---------------------------------------------------------------------------------------------------------

/// Exponent that compresses large colour differences, q_c.
const COLOUR_EXPONENT: f32 = 0.7;
/// Colour differences below this share of the largest, p_c, are spread over \[0, p_t\].
const KNEE: f32 = 0.4;
/// Result at the knee, p_t.
const KNEE_VALUE: f32 = 0.95;

/// What one picture contributes: its colours as seen, and its edges and points.
struct Seen {
    colour: [Vec<f32>; 3],
    edges: Vec<f32>,
    points: Vec<f32>,
}

/// Filters one picture, given in linear RGB in \[0, 1\].
fn see(rgb: &[Vec<f32>; 3], width: usize, filters: &Filters) -> Seen {
    // Relative XYZ, then the opponent space of the filters: luminance y, red-green x - y, blue-yellow y - z. The published
    // one is an affine function of it, with which the filters commute.
    let n = rgb[0].len();
    let mut planes = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
    for i in 0..n {
        let [x, y, z] = multiply(&RELATIVE_XYZ.0, [rgb[0][i], rgb[1][i], rgb[2][i]]);
        (planes[0][i], planes[1][i], planes[2][i]) = (y, x - y, y - z);
    }
    let blur = |plane: &[f32], kernel: &[f32]| along_columns(&along_rows(plane, width, kernel), width, kernel);
    let [luminance, red_green, blue_yellow] = &planes;
    let wide = blur(blue_yellow, &filters.csf[2]);
    let narrow = blur(blue_yellow, &filters.csf[3]);
    let [w0, w1] = filters.blue_yellow;
    let colour = [
        blur(luminance, &filters.csf[0]),
        blur(red_green, &filters.csf[1]),
        wide.iter().zip(&narrow).map(|(a, b)| w0 * a + w1 * b).collect(),
    ];
    // Edges are gradients, points second derivatives, both of the unblurred luminance; their length in the two directions.
    let [gauss, first, second] = &filters.feature;
    let smooth = along_rows(luminance, width, gauss);
    let length = |kernel: &[f32]| -> Vec<f32> {
        let x = along_columns(&along_rows(luminance, width, kernel), width, gauss);
        let y = along_columns(&smooth, width, kernel);
        x.iter().zip(&y).map(|(x, y)| x.hypot(*y)).collect()
    };
    Seen { colour, edges: length(first), points: length(second) }
}

/// Returns FLIP per pixel of two pictures in linear RGB in \[0, 1\].
fn flip(test: &[Vec<f32>; 3], reference: &[Vec<f32>; 3], width: usize, filters: &Filters) -> Vec<f32> {
    if width == 0 || reference[0].is_empty() {
        return Vec::new();
    }
    let (a, b) = (see(test, width, filters), see(reference, width, filters));
    // The largest distance of the space is that between the screen's green and blue.
    let largest = hyab(lab_hunt([0.0, 1.0, 0.0]), lab_hunt([0.0, 0.0, 1.0])).powf(COLOUR_EXPONENT);
    let knee = KNEE * largest;
    let lab = |s: &Seen, i: usize| {
        let (y, rg, by) = (s.colour[0][i], s.colour[1][i], s.colour[2][i]);
        lab_hunt(multiply(&RELATIVE_XYZ.1, [y + rg, y, y - by]).map(clip01))
    };
    let pixel = |i: usize| {
        let distance = hyab(lab(&a, i), lab(&b, i)).powf(COLOUR_EXPONENT);
        let colour = if distance < knee {
            KNEE_VALUE * distance / knee
        } else {
            KNEE_VALUE + (1.0 - KNEE_VALUE) * (distance - knee) / (largest - knee)
        };
        let edge = (a.edges[i] - b.edges[i]).abs();
        let point = (a.points[i] - b.points[i]).abs();
        let feature = (edge.max(point) / std::f32::consts::SQRT_2).sqrt();
        colour.powf(1.0 - feature)
    };
    (0..reference[0].len()).into_par_iter().map(pixel).collect()
}

#[cfg(test)]
#[path = "flip_tests.rs"]
mod tests;
