//! Radial profiles measured by Monte Carlo, and what models are worth against them.

use std::f64::consts::PI;

use moonmilk_core::Estimate;

use crate::error::{Error, within};
use crate::experiment::{Bins, Experiment, LayerSpec, Source};
use crate::law::Law;
use crate::run::run;

/// A measured profile: a pencil beam on a half-space, per unit of the light that entered.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Edges of the rings, of equal ratio \[L\].
    pub edges: Vec<f64>,
    /// Mean of R over each ring \[1/L^2\].
    pub rings: Vec<Estimate>,
    /// The albedo of the light that entered.
    pub albedo: Estimate,
    /// Light still inside when its path was given up, a bias of all of the above.
    pub unfinished: f64,
}

/// A half-space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Absorption coefficient \[1/L\].
    pub sigma_a: f64,
    /// Scattering coefficient \[1/L\].
    pub sigma_s: f64,
    /// Asymmetry of the Henyey-Greenstein law.
    pub g: f64,
    /// Relative index, inside / outside.
    pub eta: f64,
}

impl HalfSpace {
    /// Returns the reduced extinction coefficient \[1/L\].
    pub fn sigma_t_prime(&self) -> f64 {
        self.sigma_a + self.sigma_s * (1.0 - self.g)
    }
}

/// Rings per factor of ten of the radius.
const RINGS_PER_DECADE: f64 = 12.0;

/// Measures a half-space's profile between 1/100 and `reach` transport mean free paths.
///
/// *Errors*: coefficients outside of their domain, or none at all.
pub fn measure(medium: &HalfSpace, reach: f64, photons: u64, seed: u64) -> Result<Measured, Error> {
    within("sigma_t_prime", medium.sigma_t_prime(), medium.sigma_t_prime() > 0.0, "(0, inf)")?;
    let layer = LayerSpec {
        name: "half-space".into(),
        thickness: f64::INFINITY,
        n: medium.eta,
        sigma_a: medium.sigma_a,
        sigma_s: medium.sigma_s,
        law: Law::HenyeyGreenstein(medium.g as f32),
    };
    let mut e = Experiment::new(vec![layer], Source::Pencil { angle: 0.0 });
    let length = 1.0 / medium.sigma_t_prime();
    let (first, max) = (0.01 * length, reach * length);
    let bins = ((max / first).log10() * RINGS_PER_DECADE).ceil() as usize;
    e.tallies.radius = Some(Bins { first, max, bins });
    e.photons = photons;
    e.seed = seed;
    let r = run(&e)?;
    let entered = 1.0 - r.scalar("specular").map_or(0.0, |s| s.mean);
    let per_entered = |x: Estimate| Estimate { mean: x.mean / entered, std_err: x.std_err / entered, n: x.n };
    let total = |name: &str| r.scalar(name).map(per_entered).expect("every run records its totals");
    let grid = r.grid("reflectance_r").expect("radii are recorded");
    Ok(Measured {
        edges: grid.axes[0].edges.clone(),
        rings: grid.cells.iter().map(|&c| per_entered(c)).collect(),
        albedo: total("reflected"),
        unfinished: total("unfinished").mean,
    })
}

/// What a model is worth against a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Worth {
    /// Mean of the model over each ring \[1/L^2\].
    pub rings: Vec<f64>,
    /// Integral of |model - measurement| over the rings, over the measurement's.
    pub l1: f64,
    /// What the measurement's noise alone would make of `l1`, in the mean.
    pub noise: f64,
}

/// Compares a profile with a measurement, ring by ring; the model is averaged over the rings as the measurement is.
pub fn compare(measured: &Measured, profile: impl Fn(f64) -> f64) -> Worth {
    // Six Gauss points in r over rings of ratio 1.2: exact to 1e-9 for powers of r.
    let rule = moonmilk_core::quadrature::Rule::gauss(6, 0.0, 1.0);
    let mean = |a: f64, b: f64| {
        let sum = rule.integrate(|t| {
            let r = a + t * (b - a);
            2.0 * PI * r * profile(r) * (b - a)
        });
        sum / (PI * (b * b - a * a))
    };
    let rings: Vec<f64> = measured.edges.windows(2).map(|e| mean(e[0], e[1])).collect();
    let (mut all, mut off, mut noise) = (0.0, 0.0, 0.0);
    for ((e, m), x) in measured.edges.windows(2).zip(&measured.rings).zip(&rings) {
        let area = PI * (e[1] * e[1] - e[0] * e[0]);
        all += area * m.mean;
        off += area * (x - m.mean).abs();
        // The mean of |normal deviate| is sqrt(2 / pi).
        noise += area * m.std_err * (2.0 / PI).sqrt();
    }
    Worth { rings, l1: off / all, noise: noise / all }
}
