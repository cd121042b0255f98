//! Chandrasekhar's H function, and the angles at which light leaves a half-space.

use std::f64::consts::{FRAC_PI_2, PI};

use moonmilk_core::Estimate;
use moonmilk_core::quadrature::Rule;
use moonmilk_optics::halfspace::{HFunction, HalfSpace, Illumination};

use super::layers::{layer, of};
use super::{Check, Settings};
use crate::error::Error;
use crate::experiment::{Experiment, Source};
use crate::run::run;

/// Bins of the exit angle.
const BINS: usize = 5;

/// Measures the values.
pub(super) fn checks(settings: &Settings) -> Result<Vec<Check>, Error> {
    let mut checks = Vec::new();
    let prepare = |alpha: f64, eta: f64, mu: f64, salt: u64| {
        let mut e = Experiment::new(
            vec![layer(f64::INFINITY, eta, 1.0 - alpha, alpha, 0.0)],
            Source::Pencil { angle: mu.acos() },
        );
        e.photons = settings.walks;
        e.seed = settings.seed.wrapping_mul(1000).wrapping_add(100 + salt);
        e
    };

    // The plane albedo 1 - sqrt(1 - alpha) H(mu) gives H.
    for (k, (alpha, mu)) in [(0.9, 0.25), (0.9, 0.5), (0.9, 1.0), (0.99, 0.5)].into_iter().enumerate() {
        let r = of(&run(&prepare(alpha, 1.0, mu, k as u64))?, "reflected");
        let root = (1.0f64 - alpha).sqrt();
        checks.push(Check {
            name: format!("Chandrasekhar's H({mu}), alpha {alpha}"),
            unit: "",
            source: "Chandrasekhar 1960",
            expected: HFunction::new(alpha).expect("within [0, 1]").eval(mu),
            uncertainty: 1e-9,
            measured: Estimate { mean: (1.0 - r.mean) / root, std_err: r.std_err / root, n: r.n },
        });
    }

    // Light along the normal: the intensity over equal bins of the angle.
    for (k, (alpha, eta)) in [(0.9, 1.0), (0.9, 1.5)].into_iter().enumerate() {
        let mut e = prepare(alpha, eta, 1.0, 10 + k as u64);
        e.tallies.angle = Some(BINS);
        let r = run(&e)?;
        let half = HalfSpace::new(alpha, eta).expect("within the domain of the exact solution");
        let entered = 1.0 - ((eta - 1.0) / (eta + 1.0)).powi(2);
        let grid = r.grid("reflectance_angle").expect("asked for");
        for (i, measured) in grid.cells.iter().enumerate() {
            let edge = |i: usize| FRAC_PI_2 * i as f64 / BINS as f64;
            let (a, b) = (edge(i), edge(i + 1));
            let power =
                Rule::gauss(12, a, b).integrate(|t| 2.0 * PI * t.sin() * half.intensity(Illumination::Normal, t.cos()));
            checks.push(Check {
                name: format!(
                    "alpha {alpha}, n {eta}: intensity, {:.0} to {:.0} degrees",
                    a.to_degrees(),
                    b.to_degrees()
                ),
                unit: "/sr",
                source: "Chandrasekhar 1960",
                expected: entered * power / (2.0 * PI * (a.cos() - b.cos())),
                uncertainty: 1e-7,
                measured: *measured,
            });
        }
    }
    Ok(checks)
}
