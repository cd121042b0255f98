//! The fluence around a point source in an infinite medium, and what diffusion makes of it.

use std::f64::consts::PI;

use moonmilk_core::Estimate;
use moonmilk_optics::OpticalProperties;
use moonmilk_optics::point_source::{Exact, classical, grosjean};

use super::{Check, Settings};
use crate::error::Error;
use crate::infinite::{fluence, shell_mean};
use crate::profile::HalfSpace;

/// (alpha, largest error of Grosjean's form to 3 mean free paths \[%\]): physics notes, 3.4.
const GROSJEAN: [(f64, f64); 5] = [(0.3, 2.8), (0.5, 2.3), (0.7, 0.9), (0.9, 2.4), (0.99, 4.9)];
/// Radii at which the exact fluence is met \[mean free paths\].
const RADII: [f64; 4] = [0.1, 0.5, 2.0, 5.0];
/// Shells reach from r / WIDTH to r WIDTH.
const WIDTH: f64 = 1.05;

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
        let medium = HalfSpace { sigma_a: 1.0 - alpha, sigma_s: alpha, g: 0.0, eta: 1.0 };
        let measured = fluence(&medium, &shells, walks, seed ^ alpha.to_bits())?;
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
