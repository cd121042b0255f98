//! The errors of the registry's models against Monte Carlo, measured again.
//!
//! What is random here is the simulation alone: the errors of all models at one radius rise and fall together.

use std::f64::consts::PI;

use moonmilk_core::Estimate;
use moonmilk_core::quadrature::Rule;
use moonmilk_optics::halfspace::{HalfSpace, Illumination};
use moonmilk_optics::profile::published_errors::{self, Printed, RADII};
use moonmilk_optics::{OpticalProperties, profile};

use super::{Check, Settings};
use crate::error::Error;
use crate::spread::{Question, Spread, spread};

/// Rings of the L1 error: equal ratios from here on, and what is inside the first.
const FIRST: f64 = 0.01;
/// Rings per factor of ten.
const PER_DECADE: usize = 12;
/// Walks for each of [`Settings::walks`]: all albedos of an index share them.
const WALKS: u64 = 3;
/// Relative standard error of R beyond which few walks make most of it, so that its error has no normal law.
const TOO_FEW: f64 = 0.15;
/// Number of rings; they end at 100 mean free paths.
const RINGS: usize = 4 * PER_DECADE;

/// The errors in one medium.
#[derive(Clone, Debug, PartialEq)]
pub struct MediumErrors {
    /// Single-scattering albedo.
    pub alpha: f64,
    /// Relative index, inside / outside.
    pub eta: f64,
    /// The simulation against the printed one: albedo (exact), R at five radii \[% of the expected value\].
    pub simulation: Vec<Option<Check>>,
    /// The models against the simulation.
    pub models: Vec<ModelErrors>,
}

/// The errors of one model against the simulation \[%\].
#[derive(Clone, Debug, PartialEq)]
pub struct ModelErrors {
    /// Its name in the registry.
    pub name: &'static str,
    /// Of the albedo, of R at five radii, L1; `None` where nothing was printed or too little light arrived to judge.
    pub errors: Vec<Option<Check>>,
}

impl MediumErrors {
    /// Returns all comparisons.
    pub fn checks(&self) -> impl Iterator<Item = &Check> {
        self.simulation.iter().flatten().chain(self.models.iter().flat_map(|m| m.errors.iter().flatten()))
    }
}

/// Returns the rings: those about the five radii, one inside [`FIRST`], those of the L1 error.
fn rings() -> Vec<(f64, f64)> {
    let edge = |i: usize| FIRST * 10f64.powf(i as f64 / PER_DECADE as f64);
    let mut rings: Vec<(f64, f64)> = RADII.iter().map(|r| (r / 1.05, r * 1.05)).collect();
    rings.push((0.0, FIRST));
    rings.extend((0..RINGS).map(|i| (edge(i), edge(i + 1))));
    rings
}

fn area(ring: (f64, f64)) -> f64 {
    PI * (ring.1 * ring.1 - ring.0 * ring.0)
}

/// Measures the errors.
pub(super) fn errors(settings: &Settings) -> Result<Vec<MediumErrors>, Error> {
    let table = published_errors::table();
    let mut etas: Vec<f64> = table.iter().map(|m| m.eta).collect();
    etas.dedup();
    let rings = rings();
    let mut out = Vec::new();
    for (k, &eta) in etas.iter().enumerate() {
        let media: Vec<&published_errors::Medium> = table.iter().filter(|m| m.eta == eta).collect();
        let answers = spread(&Question {
            eta,
            alphas: media.iter().map(|m| m.alpha).collect(),
            rings: rings.clone(),
            walks: WALKS * settings.walks,
            seed: settings.seed.wrapping_mul(1000).wrapping_add(300 + k as u64),
        })?;
        for (m, s) in media.iter().zip(&answers) {
            out.push(medium(m, s, &rings));
        }
    }
    Ok(out)
}

/// Compares one medium's simulation and models with what was printed.
fn medium(m: &published_errors::Medium, s: &Spread, rings: &[(f64, f64)]) -> MediumErrors {
    let properties = OpticalProperties::from_albedo(1.0, m.alpha, 0.0, m.eta).expect("within its domain");
    let exact = HalfSpace::new(m.alpha, m.eta).expect("within its domain").albedo(Illumination::Normal);
    let place = format!("alpha {}, n {}", m.alpha, m.eta);
    let check = |what: String, expected: f64, uncertainty: f64, measured: Estimate| Check {
        name: format!("{place}: {what}"),
        unit: "%",
        source: "physics notes, 9",
        expected,
        uncertainty,
        measured,
    };
    let percent =
        |x: Estimate, of: f64| Estimate { mean: 100.0 * (x.mean / of - 1.0), std_err: 100.0 * x.std_err / of, n: x.n };
    let enough = |k: usize| s.rings[k].mean > 0.0 && s.rings[k].relative_error() < TOO_FEW;
    let mut simulation = vec![Some(check("albedo".into(), 0.0, 1e-4, percent(s.albedo, exact)))];
    for (k, r) in RADII.into_iter().enumerate() {
        let printed = m.rings[k];
        let own = m.std_err[k].hypot(100.0 * printed.half_digit / printed.value);
        simulation.push(enough(k).then(|| check(format!("R({r})"), 0.0, own, percent(s.rings[k], printed.value))));
    }
    let models = m.models.iter().map(|model| {
        let p = profile::find(model.name).expect("registered").build(&properties).expect("within its domain");
        let rule = Rule::gauss(6, 0.0, 1.0);
        let power = |ring: (f64, f64)| {
            rule.integrate(|t| {
                let r = ring.0 + t * (ring.1 - ring.0);
                2.0 * PI * r * p.eval(r) * (ring.1 - ring.0)
            })
        };
        let named = |what: &str| format!("{}, {what}", model.name);
        let error = |value: f64, f: &dyn Fn(f64, &[f64]) -> f64| {
            let measured = s.derived(|a, r| 100.0 * (value / f(a, r) - 1.0));
            (value, measured)
        };
        let (_, albedo) = error(p.total(), &|a, _| a);
        let mut errors = vec![Some(check(named("albedo"), model.albedo.value, model.albedo.half_digit, albedo))];
        for (k, r) in RADII.into_iter().enumerate() {
            errors.push(model.rings[k].filter(|_| enough(k)).map(|printed: Printed| {
                let (_, measured) = error(power(rings[k]) / area(rings[k]), &|_, r| r[k]);
                // The printed error has that of the printed simulation, times the ratio.
                let simulated = m.std_err[k] * (1.0 + printed.value / 100.0);
                check(named(&format!("R({r})")), printed.value, printed.half_digit.hypot(simulated), measured)
            }));
        }
        errors.push(model.l1.map(|printed| {
            let first = RADII.len();
            let model: Vec<f64> = rings[first..].iter().map(|&ring| power(ring)).collect();
            let l1 = |a: f64, r: &[f64]| {
                let off: f64 = model
                    .iter()
                    .zip(&r[first..])
                    .zip(&rings[first..])
                    .map(|((m, r), &ring)| (m - r * area(ring)).abs())
                    .sum();
                100.0 * off / a
            };
            // Noise of the rings makes an absolute deviation larger by about its own size where the model is good: count it as an error.
            let noise: f64 =
                s.rings[first..].iter().zip(&rings[first..]).map(|(r, &ring)| r.std_err * area(ring)).sum();
            let uncertainty = printed.half_digit.hypot(100.0 * noise / s.albedo.mean);
            check(named("L1"), printed.value, uncertainty, s.derived(l1))
        }));
        ModelErrors { name: model.name, errors }
    });
    MediumErrors { alpha: m.alpha, eta: m.eta, simulation, models: models.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::stats::{sidak, t_test};

    #[test]
    fn errors_that_are_not_the_models_are_found_out() {
        let all = errors(&Settings { walks: 8000, seed: 3 }).unwrap();
        assert_eq!(all.len(), 15);
        let checks: Vec<&Check> = all.iter().flat_map(MediumErrors::checks).collect();
        let limit = sidak(1e-4, checks.len());
        // Batches are 64. All agree; with the albedo of a model a fifth higher, none would.
        let agrees = |z: f64| t_test(z, 63.0) >= limit;
        assert!(checks.iter().all(|c| agrees(c.z())));
        for c in checks.iter().filter(|c| c.name.contains("photon-beam, albedo") && !c.name.contains("alpha 0.3")) {
            let wrong = Estimate { mean: c.measured.mean + 20.0, ..c.measured };
            assert!(!agrees(Check { measured: wrong, ..(*c).clone() }.z()), "{c:?}");
        }
    }
}
