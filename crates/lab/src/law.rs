//! Laws of scattering of the laboratory: the phase functions of `moonmilk_optics`, as the walk asks for them.

use std::sync::Arc;

use moonmilk_core::{Random, Vec3};
use moonmilk_optics::phase::function::PhaseFunction as Phase;
use moonmilk_walk::PhaseFunction;
use moonmilk_walk::phase::HenyeyGreenstein;

use crate::error::{Error, within};

/// A law of scattering.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// Henyey and Greenstein's of an asymmetry in (-1, 1), 0 for isotropic scattering: the common one, in single precision.
    HenyeyGreenstein(f32),
    /// Any other, in double precision.
    Other(Arc<Phase>),
}

impl From<Phase> for Law {
    fn from(phase: Phase) -> Self {
        match phase {
            Phase::Isotropic => Self::HenyeyGreenstein(0.0),
            Phase::HenyeyGreenstein(g) => Self::HenyeyGreenstein(g as f32),
            other => Self::Other(Arc::new(other)),
        }
    }
}

impl Law {
    /// Checks the parameters.
    ///
    /// *Errors*: an asymmetry outside (-1, 1), a weight outside \[0, 1\], a concentration outside (0, 1e6\].
    pub fn check(&self, place: &str) -> Result<(), Error> {
        let asymmetry = |name: &str, g: f64| within(format!("{place}{name}"), g, g.abs() < 1.0, "(-1, 1)");
        match self {
            Self::HenyeyGreenstein(g) => asymmetry("g", f64::from(*g)),
            Self::Other(phase) => match **phase {
                Phase::TwoLobes { g_1, g_2, w } => {
                    asymmetry("g1", g_1)?;
                    asymmetry("g2", g_2)?;
                    within(format!("{place}weight"), w, (0.0..=1.0).contains(&w), "[0, 1]")
                }
                Phase::HenyeyGreenstein(g) | Phase::CornetteShanks(g) => asymmetry("g", g),
                Phase::VonMisesFisher(k) => within(format!("{place}kappa"), k, k > 0.0 && k <= 1e6, "(0, 1e6]"),
                Phase::Isotropic | Phase::Rayleigh | Phase::Tabulated(_) => Ok(()),
            },
        }
    }
}

impl PhaseFunction for Law {
    fn eval(&self, cosine: f32) -> f32 {
        match self {
            Self::HenyeyGreenstein(g) => HenyeyGreenstein { g: *g }.eval(cosine),
            Self::Other(phase) => phase.eval(f64::from(cosine)) as f32,
        }
    }

    fn cosine(&self, u: f32) -> f32 {
        match self {
            Self::HenyeyGreenstein(g) => HenyeyGreenstein { g: *g }.cosine(u),
            Self::Other(phase) => phase.sample(f64::from(u)) as f32,
        }
    }

    fn mean_cosine(&self) -> f32 {
        match self {
            Self::HenyeyGreenstein(g) => *g,
            Self::Other(phase) => phase.g() as f32,
        }
    }

    fn scatter(&self, d: Vec3, rng: &mut impl Random) -> Vec3 {
        let u = rng.uniform2();
        match self {
            Self::HenyeyGreenstein(0.0) => moonmilk_walk::math::uniform_sphere(u),
            law => moonmilk_walk::math::deflect(d, law.cosine(u[0]), u[1]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_optics::phase::function::Tabulated;

    #[test]
    fn cosines_follow_their_laws() {
        let table = Tabulated::new(&[-1.0, -0.5, 0.3, 1.0], &[1.0, 0.0, 0.5, 4.0]).unwrap();
        let laws = [
            Phase::HenyeyGreenstein(0.7),
            Phase::TwoLobes { w: 0.8, g_1: 0.9, g_2: -0.4 },
            Phase::Rayleigh,
            Phase::CornetteShanks(0.6),
            Phase::VonMisesFisher(4.0),
            Phase::Tabulated(table),
        ];
        for law in laws.map(Law::from) {
            law.check("").expect("valid");
            // Stratified variates through the inverse; compare the mean and the distribution with sums over the density.
            let n = 100_000;
            let cosines: Vec<f64> = (0..n).map(|i| f64::from(law.cosine((i as f32 + 0.5) / n as f32))).collect();
            let mean = cosines.iter().sum::<f64>() / f64::from(n);
            // Strata of 1e-5 in u, rounding of f32 variates near the ends.
            assert!((mean - f64::from(law.mean_cosine())).abs() < 4e-5, "{law:?}: {mean} {}", law.mean_cosine());
            let steps = 100_000;
            for cut in [-0.7f64, 0.0, 0.5, 0.9] {
                let below = cosines.iter().filter(|&&c| c < cut).count() as f64 / f64::from(n);
                let h = (cut + 1.0) / f64::from(steps);
                let density = |i: i32| f64::from(law.eval((-1.0 + (f64::from(i) + 0.5) * h) as f32));
                let exact: f64 = (0..steps).map(|i| 2.0 * std::f64::consts::PI * h * density(i)).sum();
                assert!((below - exact).abs() < 4e-5, "{law:?} at {cut}: {below} {exact}");
            }
        }
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        for (phase, told) in [
            (Phase::HenyeyGreenstein(1.0), "x: g = 1 "),
            (Phase::TwoLobes { w: 0.5, g_1: -1.5, g_2: 0.0 }, "x: g1 = -1.5 "),
            (Phase::TwoLobes { w: 1.5, g_1: 0.0, g_2: 0.0 }, "x: weight = 1.5 "),
            (Phase::CornetteShanks(f64::NAN), "x: g = NaN "),
            (Phase::VonMisesFisher(0.0), "x: kappa = 0 "),
        ] {
            let e = Law::from(phase).check("x: ").expect_err("refused").to_string();
            assert!(e.starts_with(told), "{e}");
        }
    }
}
