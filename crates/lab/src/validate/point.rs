//! The fluence around a point source in an infinite medium, and what diffusion makes of it.

use std::f64::consts::PI;

use moonmilk_core::quadrature::Rule;
use moonmilk_core::{Estimate, Random, Spectrum, Stream, Vec3};
use moonmilk_optics::OpticalProperties;
use moonmilk_optics::point_source::{Exact, classical, grosjean};
use moonmilk_walk::domain::ball::Ball;
use moonmilk_walk::math::uniform_sphere;
use moonmilk_walk::phase::HenyeyGreenstein;
use moonmilk_walk::{Limits, Medium, Outcome, Roulette, Tally, Walker, walk};
use rayon::prelude::*;

use super::{Check, Settings};
use crate::error::Error;
use crate::run::BATCHES;

/// (alpha, largest error of Grosjean's form to 3 mean free paths \[%\]): physics notes, 3.4.
const GROSJEAN: [(f64, f64); 5] = [(0.3, 2.8), (0.5, 2.3), (0.7, 0.9), (0.9, 2.4), (0.99, 4.9)];
/// Radii at which the exact fluence is met \[mean free paths\].
const RADII: [f64; 4] = [0.1, 0.5, 2.0, 5.0];
/// Shells reach from r / WIDTH to r WIDTH.
const WIDTH: f64 = 1.05;

/// Sums the length of flights in spherical shells.
struct Shells<'a> {
    /// Squared radii of each shell.
    squares: &'a [(f64, f64)],
    sums: &'a mut [f64],
}

impl<R: Random> Tally<1, R> for Shells<'_> {
    fn flight(&mut self, walker: &Walker<1>, t: f32) {
        let (p, d, t) = (walker.p.as_dvec3(), walker.d.as_dvec3(), f64::from(t));
        let b = p.dot(d);
        let closest2 = p.length_squared() - b * b;
        // The length of a flight within a ball is that of an interval cut by another.
        let within = |square: f64| {
            let half = (square - closest2).max(0.0).sqrt();
            ((half - b).min(t) - (-half - b).max(0.0)).max(0.0)
        };
        for (sum, &(inner, outer)) in self.sums.iter_mut().zip(self.squares) {
            if outer > closest2 {
                *sum += f64::from(walker.beta[0]) * (within(outer) - within(inner));
            }
        }
    }
}

/// Returns the mean fluence over shells around a point source of unit power, with unit extinction.
fn fluence(alpha: f64, shells: &[(f64, f64)], walks: u64, seed: u64) -> Vec<Estimate> {
    let exact = Exact::new(alpha).expect("within (0, 1)");
    // Light that comes back from beyond this radius to the largest shell is e^-24 of it.
    let radius = shells.iter().map(|s| s.1).fold(0.0, f64::max) + 12.0 / exact.kappa_0();
    let squares: Vec<(f64, f64)> = shells.iter().map(|(a, b)| (a * a, b * b)).collect();
    let domain = Ball { radius: radius as f32, eta: 1.0 };
    let medium =
        Medium::with_law(Spectrum([(1.0 - alpha) as f32]), Spectrum([alpha as f32]), HenyeyGreenstein { g: 0.0 });
    let batches: Vec<Vec<f64>> = (0..BATCHES)
        .into_par_iter()
        .map(|b| {
            let mut sums = vec![0.0; shells.len()];
            let mut tally = Shells { squares: &squares, sums: &mut sums };
            let (first, end) = (b * walks / BATCHES, (b + 1) * walks / BATCHES);
            for i in first..end {
                let mut rng = Stream::new(&[seed, alpha.to_bits(), i]);
                let d = uniform_sphere(rng.uniform2());
                let mut walker = Walker::new(Vec3::ZERO, d);
                let out = walk(&domain, &medium, &Limits::from(Roulette::default()), &mut walker, &mut tally, &mut rng);
                debug_assert!(!matches!(out, Outcome::Lost));
            }
            sums.iter_mut().for_each(|s| *s /= (end - first) as f64);
            sums
        })
        .collect();
    let n = BATCHES as f64;
    (0..shells.len())
        .map(|k| {
            let volume = 4.0 / 3.0 * PI * (shells[k].1.powi(3) - shells[k].0.powi(3));
            let mean = batches.iter().map(|b| b[k]).sum::<f64>() / n;
            let square: f64 = batches.iter().map(|b| (b[k] - mean) * (b[k] - mean)).sum();
            Estimate { mean: mean / volume, std_err: (square / (n - 1.0) / n).sqrt() / volume, n: walks }
        })
        .collect()
}

/// Returns the mean of a fluence over a shell.
fn shell_mean(shell: (f64, f64), f: impl Fn(f64) -> f64) -> f64 {
    let (a, b) = shell;
    Rule::gauss(8, a, b).integrate(|r| 4.0 * PI * r * r * f(r)) / (4.0 / 3.0 * PI * (b.powi(3) - a.powi(3)))
}

/// Returns a shell about a radius.
fn about(r: f64) -> (f64, f64) {
    (r / WIDTH, r * WIDTH)
}

/// Measures the values.
pub(super) fn checks(settings: &Settings) -> Result<Vec<Check>, Error> {
    let mut checks = Vec::new();
    for (alpha, printed) in GROSJEAN {
        let exact = Exact::new(alpha).expect("within (0, 1)");
        let m = OpticalProperties::from_albedo(1.0, alpha, 0.0, 1.0).expect("within its domain");
        // Where the form is worst to 3 mean free paths; there its error is measured.
        let error = |r: f64| grosjean(r, &m) / exact.fluence(r) - 1.0;
        let worst = (1..=60)
            .map(|i| 0.05 * f64::from(i))
            .max_by(|a, b| error(*a).abs().total_cmp(&error(*b).abs()))
            .expect("there are radii");
        let mut shells = vec![about(worst)];
        shells.extend(RADII.map(about));
        // Walks in absorbing media are short, and few of them get far.
        let walks = if alpha < 0.6 { 6 * settings.walks } else { settings.walks };
        let seed = settings.seed.wrapping_mul(1000).wrapping_add(200);
        let measured = fluence(alpha, &shells, walks, seed);
        let percent = |form: f64, phi: Estimate| Estimate {
            mean: 100.0 * (form / phi.mean - 1.0),
            std_err: 100.0 * form / phi.mean * phi.relative_error(),
            n: phi.n,
        };
        for (r, (shell, phi)) in RADII.into_iter().zip(shells.iter().zip(&measured).skip(1)) {
            // At 5 mean free paths nothing arrives where alpha is low: 4 pi r^2 phi = .02 for .3.
            if r > 3.0 && alpha < 0.6 {
                continue;
            }
            let factor = 4.0 * PI * r * r;
            checks.push(Check {
                name: format!("point source, alpha {alpha}: 4 pi r^2 phi({r})"),
                unit: "",
                source: "exact: Case et al. 1953",
                expected: factor * shell_mean(*shell, |r| exact.fluence(r)),
                uncertainty: 1e-7,
                measured: Estimate { mean: factor * phi.mean, std_err: factor * phi.std_err, n: phi.n },
            });
        }
        checks.push(Check {
            name: format!("alpha {alpha}: error of Grosjean's form at its worst, {worst:.2}"),
            unit: "%",
            source: "Grosjean 1956; physics notes, 3.4",
            // The printed errors are absolute.
            expected: printed.copysign(error(worst)),
            // Half of the printed digit; and what the mean over the shell differs from the middle.
            uncertainty: 0.05,
            measured: percent(shell_mean(shells[0], |r| grosjean(r, &m)), measured[0]),
        });
        checks.push(Check {
            name: format!("alpha {alpha}: error of the classical monopole at .1"),
            unit: "%",
            source: "exact: Case et al. 1953",
            expected: 100.0
                * (shell_mean(shells[1], |r| classical(r, &m)) / shell_mean(shells[1], |r| exact.fluence(r)) - 1.0),
            uncertainty: 1e-4,
            measured: percent(shell_mean(shells[1], |r| classical(r, &m)), measured[1]),
        });
    }
    Ok(checks)
}
