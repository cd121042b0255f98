//! Exact profiles, tabulated: all albedos from one conservative simulation per asymmetry and index.
//!
//! Absorption only weighs a path of N collisions by alpha^N. So a conservative Monte Carlo simulation resolved in N holds the profiles of all albedos,
//!
//! $$ R(r; \alpha) = R_1(r) + \sum_{N \ge 2} \alpha^N R_N(r), $$
//!
//! and only the asymmetry g and the index eta are left to interpolate. What is known otherwise is not left to chance:
//!
//! * Light scattered once, $R_1(r) = \frac{\alpha}{r} \int_0^{\theta_c} e^{-r \cot(\theta / 2)}\, p(-\cos\theta)\, (1 - F)\, \cos\theta\, d\theta$ in mean free paths, is a quadrature.
//! * Totals are those of [`crate::halfspace::Anisotropic`], tabulated as $\ln \frac{A s}{(1 - A)(1 - s)}$ over $s = \sqrt{1 - \alpha'}$, g and eta, a smooth function.
//! * Light that is inside after 2048 transport mean free paths leaves like $N^{-3/2}$ at Gaussian distances.
//! * Beyond where the table has anything to say the profile falls like a dipole's, $(1 + \kappa r) e^{-\kappa r} / r^3$.
//!
//! *Interpolation*: polynomials through 12 Chebyshev-Lobatto nodes in artanh g and 8 in 1 - 1/eta^2, at equal reduced albedo and equal radius in reduced mean free paths; over
//! the radius penalised least squares (third differences, weights like the root of the light per ring), then a cubic spline of ln R over ln r. Rings are a quarter of an octave; their means are turned
//! into values. All walks of an asymmetry serve all indices.
//!
//! *Accuracy*, measured between the nodes: albedo 5e-5; L1 error below .28 % at g = -.25, .3, .57 and .91, up to .36 % at .94 where the measurement is no better; pointwise 1 % where
//! the measurement can tell, several per cent towards r^2 R of 1e-5 of its maximum (DESIGN.md; example `tabulated_error` and test `tabulated` of `moonmilk-lab`).
//!
//! *Provenance*: version 0.1.0, 28 November 2026, `cargo run --release -p moonmilk-lab --example tabulate -- DIR`: seeds 1 to 4, 6 or 24, 2e7 to 2.4e8 walks per asymmetry, as listed
//! there. Equal seeds make equal bits. *Source*: this project.

pub mod grid;
mod single;
mod smooth;

use std::f64::consts::PI;
use std::sync::LazyLock;

use moonmilk_core::Real;
use moonmilk_core::quadrature::Rule;

use crate::error::{Error, within};
use crate::halfspace::alpha_of;
use crate::properties::OpticalProperties;

use super::model::RadialModel;
use super::{Info, Kind};
use grid::{ETA_RANGE, ETAS, G_RANGE, GS, N_LAST, R_FIRST, R_PER_OCTAVE, ROWS, TOTALS};

/// Description of the model.
pub const INFO: Info = Info {
    name: "tabulated",
    summary: "exact: conservative walks resolved in the number of collisions, with exact totals",
    source: "this project",
    kind: Kind::Whole,
    valid: "any albedo, eta 1 to 2, g -.5 to .95; albedo within 5e-5, L1 error .05 to .3 %, up to .36 % at g = .94",
    use_when: "wherever it is valid: it is as fast as the others once prepared",
    avoid_when: "for other phase functions than Henyey-Greenstein, or beyond eta 2 or g .95",
};

/// The table as it is shipped; its making is described in `crates/lab/examples/tabulate.rs`.
static BYTES: &[u8] = include_bytes!("tabulated/tabulated.bin");

/// First radius of the spline: 2^-17 reduced mean free paths; below it R falls like 1 / r.
const FIRST: i32 = -17;
/// Octaves of the spline.
const OCTAVES: usize = 31;
/// Nodes of the spline, as many per octave as there are rings.
const NODES: usize = OCTAVES * R_PER_OCTAVE + 1;
/// Rings with less than this of the light of the brightest say nothing.
const SILENT: f64 = 1e-7;
/// Step between rings, and between nodes, in ln r.
const STEP: f64 = std::f64::consts::LN_2 / R_PER_OCTAVE as f64;

/// What was simulated for one asymmetry.
struct Asymmetry {
    g: f64,
    columns: usize,
    /// Share that is still inside, per index.
    rest: [f32; ETAS],
    /// Share by ring, number of collisions and index.
    share: Vec<[f32; ETAS]>,
}

/// The decoded table.
struct Table {
    asymmetries: Vec<Asymmetry>,
    /// ln(A s / ((1 - A)(1 - s))) by asymmetry, index and s.
    totals: Vec<f32>,
}

static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let powers = grid::powers();
    let mut at = 0;
    let mut take = |n: usize| {
        at += n;
        &BYTES[at - n..at]
    };
    let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let asymmetries = (0..GS)
        .map(|i| {
            let g = grid::g(i);
            let columns = grid::n_nodes(g);
            let rest = take(4 * ETAS);
            let rest = std::array::from_fn(|k| float(&rest[4 * k..]));
            let share = take(2 * ROWS * columns * ETAS)
                .chunks_exact(2 * ETAS)
                .map(|c| std::array::from_fn(|k| grid::unpack(u16::from_le_bytes([c[2 * k], c[2 * k + 1]]), &powers)))
                .collect();
            Asymmetry { g, columns, rest, share }
        })
        .collect();
    let totals = take(4 * TOTALS.iter().product::<usize>()).chunks_exact(4).map(float).collect();
    Table { asymmetries, totals }
});

impl Asymmetry {
    /// Returns the light of every ring, from the second collision on, for s = sqrt(1 - alpha').
    fn rings(&self, s: f64, by_eta: &[f64; ETAS]) -> [f64; ROWS] {
        // ln alpha = ln(1 - s^2 (1 - g) / (1 - g s^2)), exact near 0.
        let ln_alpha = (-s * s * (1.0 - self.g) / (1.0 - self.g * s * s)).ln_1p();
        let weights: Vec<f64> = (0..self.columns).map(|i| (grid::n_node(i) * ln_alpha).exp()).collect();
        let mut rings = [0.0; ROWS];
        for (ring, row) in rings.iter_mut().zip(self.share.chunks_exact(self.columns)) {
            // In f64, for the sake of differences between neighbouring media.
            let mut sums = [0.0f64; ETAS];
            for (share, w) in row.iter().zip(&weights) {
                for (sum, x) in sums.iter_mut().zip(share) {
                    *sum += w * f64::from(*x);
                }
            }
            *ring = sums.iter().zip(by_eta).map(|(s, w)| s * w).sum();
        }
        self.add_rest(ln_alpha, by_eta, &mut rings);
        rings
    }

    /// Adds what leaves after the last number of collisions, N = N_last / q^2 with a uniform q.
    fn add_rest(&self, ln_alpha: f64, by_eta: &[f64; ETAS], rings: &mut [f64; ROWS]) {
        let last = f64::from(grid::n_last(self.g));
        // Nothing survives that is worth e^-14.
        if last * ln_alpha < -14.0 {
            return;
        }
        let rest: f64 = self.rest.iter().zip(by_eta).map(|(r, w)| f64::from(*r) * w).sum();
        for (q, weight) in REST.iter() {
            let left = rest * weight * (ln_alpha * last / (q * q)).exp();
            // Variance of the distance: 4/3 of the transport mean free paths walked.
            let scale = -0.75 * q * q / N_LAST;
            let mut before = 1.0;
            for (i, ring) in rings.iter_mut().enumerate() {
                let r = edge(i + 1);
                let beyond = if i == 0 { (scale * edge(0) * edge(0)).exp() } else { before };
                before = (scale * r * r).exp();
                *ring += left * (beyond - before);
            }
        }
    }
}

static REST: LazyLock<Rule> = LazyLock::new(|| Rule::gauss(12, 0.0, 1.0));

/// Returns the inner edge of a ring in transport mean free paths.
fn edge(i: usize) -> f64 {
    grid::r_edge(i + 1)
}

/// Returns ln of the middle of ring i, which may lie outside of the table.
fn middle(i: f64) -> f64 {
    std::f64::consts::LN_2 * f64::from(R_FIRST) + STEP * (i + 0.5)
}

/// Returns the exact albedo from the table of totals.
fn total(s: f64, g: f64, eta: f64) -> f64 {
    let (by_g, by_eta, by_s) = grid::total_weights(g, eta, s);
    let [_, etas, ss] = TOTALS;
    let mut y = 0.0;
    for (i, a) in by_g.iter().enumerate() {
        for (j, b) in by_eta.iter().enumerate() {
            let row = &TABLE.totals[(i * etas + j) * ss..][..ss];
            y += a * b * row.iter().zip(&by_s).map(|(&t, w)| f64::from(t) * w).sum::<f64>();
        }
    }
    // A / (1 - A) = (1 - s) / s e^y.
    let left = (1.0 - s) * y.exp();
    left / (left + s)
}

/// Returns ln R at the nodes of the spline, in reduced mean free paths.
fn logarithms(s: f64, g: f64, eta: f64) -> Vec<f64> {
    let (by_eta, by_g) = (grid::eta_weights(eta), grid::g_weights(g));
    // Decay per reduced mean free path, after Grosjean; only the shape of what is left to interpolate depends on it.
    let kappa = (3.0 * s * s / (1.0 + s * s)).sqrt();
    let baseline = |ln_r: f64| {
        let x = kappa * ln_r.exp();
        x.ln_1p() - x
    };
    // ln of the ring means over the baseline, by asymmetry, at equal reduced radius.
    let mut means = [0.0; NODES];
    for (node, weight) in TABLE.asymmetries.iter().zip(by_g) {
        let alpha = alpha_of(s, node.g);
        // A transport mean free path of the table in reduced mean free paths of the medium, inverse.
        let scale = (1.0 - node.g) / (1.0 - alpha * node.g);
        let ln_scale = scale.ln();
        let rings = node.rings(s, &by_eta);
        let top = rings.iter().fold(0.0f64, |m, &x| m.max(x));
        let last = rings.iter().rposition(|&x| x > SILENT * top).unwrap_or(ROWS - 1).max(4);
        let (mut values, mut trust) = ([0.0; ROWS], [0.0; ROWS]);
        for (i, &ring) in rings.iter().enumerate() {
            // Fade out what says nothing: neighbouring media must not differ by a ring.
            if ring > SILENT * top {
                let area = PI * (edge(i + 1) * edge(i + 1) - edge(i) * edge(i));
                values[i] = (ring / area).ln() - baseline(middle(i as f64) - ln_scale);
                trust[i] = (ring / top - SILENT).sqrt();
            }
        }
        let mut smooth = smooth::penalised(&values, &trust);
        smooth.truncate(last + 1);
        // Towards the beam, what was scattered twice or more grows like a logarithm of the radius; the first octave tells how fast.
        let (n, slope) = (smooth.len(), ((smooth[0] - smooth[4.min(last)]) / 4.0).max(0.0));
        for (j, mean) in means.iter_mut().enumerate() {
            // The node of the spline among the rings.
            let x = (f64::from(FIRST - R_FIRST) * R_PER_OCTAVE as f64 + j as f64) - 0.5 + ln_scale / STEP;
            let value = if x <= 0.0 {
                smooth[0] + (-x * slope).ln_1p()
            } else if x >= (n - 1) as f64 {
                smooth[n - 1] - 3.0 * STEP * (x - (n - 1) as f64)
            } else {
                smooth::cubic(&smooth, x)
            };
            *mean += weight * (value + 2.0 * ln_scale);
        }
    }
    let radius = |j: usize| (std::f64::consts::LN_2 * f64::from(FIRST) + STEP * j as f64).exp();
    // From means to values.
    let ln_means: Vec<f64> = means.iter().enumerate().map(|(j, m)| m + baseline(radius(j).ln())).collect();
    let multiple = smooth::values_of_means(&ln_means, STEP);
    // Light scattered once, and the exact total: trapezoids in ln r are exact for such functions, their ends are powers of r.
    let alpha = alpha_of(s, g);
    let sigma_t = 1.0 / (1.0 - alpha * g);
    let once = single::Once::new(alpha, g, eta);
    let single: Vec<f64> = (0..NODES).map(|j| sigma_t * sigma_t * once.eval(radius(j) * sigma_t)).collect();
    let integral = |f: &dyn Fn(usize) -> f64| {
        let energy = |j: usize| 2.0 * PI * STEP * radius(j) * radius(j) * f(j);
        let ends = 1.0 / (STEP.exp() - 1.0);
        (0..NODES).map(energy).sum::<f64>() + ends * (energy(0) + energy(NODES - 1))
    };
    let factor = (total(s, g, eta) - integral(&|j| single[j])) / integral(&|j| multiple[j].exp());
    let sum: Vec<f64> = (0..NODES).map(|j| single[j] + factor * multiple[j].exp()).collect();
    // Far away the exponential underflows, its logarithm does not.
    (0..NODES).map(|j| if sum[j] > 1e-250 { sum[j].ln() } else { factor.ln() + multiple[j] }).collect()
}

/// The exact profile of one medium.
#[derive(Clone, Debug)]
pub struct Tabulated<T = f64> {
    /// ln R over ln r in reduced mean free paths.
    value: smooth::Spline,
    /// Its slopes by s, g and eta, if T carries derivatives.
    slopes: Vec<smooth::Spline>,
    variables: [T; 3],
    sigma_t_prime: T,
    total: T,
}

impl<T: Real> RadialModel<T> for Tabulated<T> {
    fn new(medium: &OpticalProperties<T>) -> Result<Self, Error> {
        let s = (medium.sigma_a() / medium.sigma_t_prime()).sqrt();
        let variables = [s, medium.g(), medium.eta()];
        let [s0, g, eta] = variables.map(Real::value);
        within("eta", eta as f32, (ETA_RANGE.0..=ETA_RANGE.1).contains(&eta), "[1, 2]")?;
        within("g", g as f32, (G_RANGE.0..=G_RANGE.1).contains(&g), "[-0.5, 0.95]")?;
        let spline = |y: Vec<f64>| smooth::Spline::new(std::f64::consts::LN_2 * f64::from(FIRST), STEP, y);
        let value = spline(logarithms(s0, g, eta));
        let (mut slopes, mut sum) = (Vec::new(), T::from_f64(total(s0, g, eta)));
        if T::CARRIES_DERIVATIVES {
            let ranges = [(0.0, 1.0), G_RANGE, ETA_RANGE];
            for (k, (low, high)) in ranges.into_iter().enumerate() {
                // Differences within the domain.
                let moved = |d: f64| {
                    let mut x = [s0, g, eta];
                    x[k] = (x[k] + d).clamp(low, high);
                    x
                };
                let (a, b) = (moved(-1e-4), moved(1e-4));
                let step = b[k] - a[k];
                let (la, lb) = (logarithms(a[0], a[1], a[2]), logarithms(b[0], b[1], b[2]));
                slopes.push(spline(la.iter().zip(&lb).map(|(a, b)| (b - a) / step).collect()));
                sum = sum + variables[k].lift(0.0, (total(b[0], b[1], b[2]) - total(a[0], a[1], a[2])) / step);
            }
        }
        Ok(Self { value, slopes, variables, sigma_t_prime: medium.sigma_t_prime(), total: sum })
    }

    fn eval(&self, r: T) -> T {
        let x = r * self.sigma_t_prime;
        let ln_x = x.value().ln();
        let (value, slope) = self.value.eval(ln_x);
        let mut y = x.ln().lift(value, slope);
        for (spline, variable) in self.slopes.iter().zip(self.variables) {
            y = y + variable.lift(0.0, spline.eval(ln_x).0);
        }
        self.sigma_t_prime * self.sigma_t_prime * y.exp()
    }

    fn total(&self) -> T {
        self.total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::halfspace::{Illumination, albedo_of};
    use crate::profile::single::Single;

    /// Points between the nodes, from a sequence of low discrepancy.
    fn points(n: u32) -> impl Iterator<Item = [f64; 3]> {
        (1..=n).map(|i| {
            let u = [0.819_172_5, 0.671_043_6, 0.549_700_5].map(|a: f64| (a * f64::from(i)).fract());
            [u[0], G_RANGE.0 + u[1] * (G_RANGE.1 - G_RANGE.0), 1.0 + u[2]]
        })
    }

    #[test]
    fn totals_are_exact_between_the_nodes() {
        let mut worst = 0.0f64;
        for [s, g, eta] in points(60) {
            let exact = albedo_of(s, g, eta, Illumination::Normal).unwrap();
            let error = total(s, g, eta) / exact - 1.0;
            worst = worst.max(error.abs());
            // A tenth of the .1 % that is promised.
            assert!(error.abs() < 1e-4, "s {s} g {g} eta {eta}: {error:e}");
        }
        println!("worst {worst:e}");
    }

    #[test]
    fn the_shape_needs_little_scaling_to_the_exact_total() {
        let mut worst = 0.0f64;
        for [s, g, eta] in points(60) {
            let multiple: f64 = TABLE
                .asymmetries
                .iter()
                .zip(grid::g_weights(g))
                .map(|(a, w)| w * a.rings(s, &grid::eta_weights(eta)).iter().sum::<f64>().ln())
                .sum::<f64>()
                .exp();
            let medium = OpticalProperties::from_albedo(1.0, alpha_of(s, g), g, eta).unwrap();
            let once: f64 = Single::new(&medium).unwrap().total();
            let error = multiple / (total(s, g, eta) - once) - 1.0;
            worst = worst.max(error.abs());
            // Noise of the walks and interpolation, together; what is left after scaling to the exact total is less.
            assert!(error.abs() < 0.004, "s {s:.3} g {g:.3} eta {eta:.3}: {error:+.5}");
        }
        println!("worst {worst:e}");
    }

    #[test]
    fn what_is_outside_the_table_is_named() {
        let message =
            |g, eta| Tabulated::new(&OpticalProperties::new(0.1, 1.0, g, eta).unwrap()).unwrap_err().to_string();
        assert_eq!(message(0.0, 0.9), "eta = 0.9 is outside [1, 2]");
        assert_eq!(message(0.96, 1.3), "g = 0.96 is outside [-0.5, 0.95]");
        assert_eq!(message(-0.6, 1.3), "g = -0.6 is outside [-0.5, 0.95]");
    }

    #[test]
    fn the_profile_ends_as_it_should() {
        // 1 / r at the beam, r^-3 far away without absorption, an exponential with it.
        let white = Tabulated::new(&OpticalProperties::new(0.0, 1.0, 0.3, 1.4).unwrap()).unwrap();
        assert!((white.eval(1e-6) / white.eval(2e-6) - 2.0).abs() < 0.02);
        assert!((white.eval(4e3) / white.eval(8e3) - 8.0).abs() < 0.1);
        let dull = Tabulated::new(&OpticalProperties::new(1.0, 1.0, 0.3, 1.4).unwrap()).unwrap();
        assert!(dull.eval(100.0) < 1e-30 && dull.eval(1e4) == 0.0);
    }
}
