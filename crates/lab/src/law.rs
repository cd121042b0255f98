//! Laws of scattering of the laboratory: any of them in any layer.

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use moonmilk_core::{Random, Vec3};
use moonmilk_walk::PhaseFunction;
use moonmilk_walk::phase::HenyeyGreenstein;

use crate::error::{Error, within};

/// A law of scattering.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// Henyey and Greenstein's of an asymmetry in (-1, 1); 0 is isotropic.
    HenyeyGreenstein(f32),
    /// A share `weight` of Henyey and Greenstein's law with `g1`, the rest with `g2`.
    TwoLobe {
        /// Share of the first lobe, in \[0, 1\].
        weight: f32,
        /// Asymmetry of the first lobe.
        g1: f32,
        /// Asymmetry of the second lobe.
        g2: f32,
    },
    /// Rayleigh's law, 3 (1 + cos^2) / (16 pi).
    Rayleigh,
    /// A table over the cosine.
    Table(Arc<Table>),
}

/// A law linear in the cosine between given cosines, normalised.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    cosines: Vec<f32>,
    /// Density over the cosine (2 pi times that per steradian).
    density: Vec<f32>,
    cumulative: Vec<f32>,
}

impl Table {
    /// Returns the law through (cosine, value) points; values are relative.
    ///
    /// *Errors*: cosines that do not rise from -1 to 1, negative values, all of them 0.
    pub fn new(cosines: &[f64], values: &[f64]) -> Result<Self, Error> {
        let rising = cosines.windows(2).all(|w| w[0] < w[1]);
        within(
            "number of cosines",
            cosines.len() as f64,
            cosines.len() >= 2 && cosines.len() == values.len(),
            "2 or more, as many as values",
        )?;
        within("first cosine", cosines[0], cosines[0] == -1.0 && rising, "-1, rising to 1")?;
        let last = cosines[cosines.len() - 1];
        within("last cosine", last, last == 1.0, "1, rising from -1")?;
        let bad = values.iter().copied().find(|v| !(v.is_finite() && *v >= 0.0));
        within("value", bad.unwrap_or(0.0), bad.is_none(), "[0, inf)")?;
        let mut cumulative = vec![0.0];
        for (c, v) in cosines.windows(2).zip(values.windows(2)) {
            cumulative.push(cumulative[cumulative.len() - 1] + 0.5 * (c[1] - c[0]) * (v[0] + v[1]));
        }
        let total = cumulative[cumulative.len() - 1];
        within("sum of the values", total, total > 0.0, "(0, inf)")?;
        let scaled = |xs: &[f64]| xs.iter().map(|x| (x / total) as f32).collect();
        Ok(Self {
            cosines: cosines.iter().map(|&c| c as f32).collect(),
            density: scaled(values),
            cumulative: scaled(&cumulative),
        })
    }

    fn eval(&self, cosine: f32) -> f32 {
        let i = self.cosines.partition_point(|&c| c <= cosine).clamp(1, self.cosines.len() - 1);
        let t = (cosine - self.cosines[i - 1]) / (self.cosines[i] - self.cosines[i - 1]);
        (self.density[i - 1] + t * (self.density[i] - self.density[i - 1])) * 0.5 * FRAC_1_PI
    }

    fn cosine(&self, u: f32) -> f32 {
        let i = self.cumulative.partition_point(|&c| c <= u).clamp(1, self.cosines.len() - 1);
        // Solve w t (a + t (b - a) / 2) = rest for t, in the form without cancellation.
        let (w, a, b) = (self.cosines[i] - self.cosines[i - 1], self.density[i - 1], self.density[i]);
        let rest = (u - self.cumulative[i - 1]) / w;
        let root = (a * a + 2.0 * (b - a) * rest).max(0.0).sqrt();
        let t = if a + root > 0.0 { 2.0 * rest / (a + root) } else { 0.0 };
        (self.cosines[i - 1] + w * t.min(1.0)).clamp(-1.0, 1.0)
    }
}

impl Law {
    /// Checks the parameters.
    ///
    /// *Errors*: an asymmetry outside (-1, 1), a weight outside \[0, 1\].
    pub fn check(&self, place: &str) -> Result<(), Error> {
        let asymmetry = |name: &str, g: f32| within(format!("{place}{name}"), f64::from(g), g.abs() < 1.0, "(-1, 1)");
        match self {
            Self::HenyeyGreenstein(g) => asymmetry("g", *g),
            Self::TwoLobe { weight, g1, g2 } => {
                asymmetry("g1", *g1)?;
                asymmetry("g2", *g2)?;
                within(format!("{place}weight"), f64::from(*weight), (0.0..=1.0).contains(weight), "[0, 1]")
            }
            Self::Rayleigh | Self::Table(_) => Ok(()),
        }
    }
}

impl PhaseFunction for Law {
    fn eval(&self, cosine: f32) -> f32 {
        match self {
            Self::HenyeyGreenstein(g) => HenyeyGreenstein { g: *g }.eval(cosine),
            Self::TwoLobe { weight, g1, g2 } => {
                weight * HenyeyGreenstein { g: *g1 }.eval(cosine)
                    + (1.0 - weight) * HenyeyGreenstein { g: *g2 }.eval(cosine)
            }
            Self::Rayleigh => 3.0 / 16.0 * FRAC_1_PI * (1.0 + cosine * cosine),
            Self::Table(t) => t.eval(cosine),
        }
    }

    fn cosine(&self, u: f32) -> f32 {
        match self {
            Self::HenyeyGreenstein(g) => HenyeyGreenstein { g: *g }.cosine(u),
            // The variate that chose the lobe, stretched, serves once more.
            Self::TwoLobe { weight, g1, .. } if u < *weight => HenyeyGreenstein { g: *g1 }.cosine(u / weight),
            Self::TwoLobe { weight, g2, .. } => HenyeyGreenstein { g: *g2 }.cosine((u - weight) / (1.0 - weight)),
            Self::Rayleigh => {
                // The root of cos^3 + 3 cos + 4 = 8 u, by Cardano; the two cube roots are reciprocal.
                let q = f64::from(4.0 * u - 2.0);
                let root = (q.abs() + (1.0 + q * q).sqrt()).cbrt();
                ((root - 1.0 / root).copysign(q) as f32).clamp(-1.0, 1.0)
            }
            Self::Table(t) => t.cosine(u),
        }
    }

    fn mean_cosine(&self) -> f32 {
        match self {
            Self::HenyeyGreenstein(g) => *g,
            Self::TwoLobe { weight, g1, g2 } => weight * g1 + (1.0 - weight) * g2,
            Self::Rayleigh => 0.0,
            Self::Table(t) => {
                // The mean of c over a linear piece, exactly.
                let piece = |i: usize| {
                    let (c0, c1) = (f64::from(t.cosines[i]), f64::from(t.cosines[i + 1]));
                    let (a, b) = (f64::from(t.density[i]), f64::from(t.density[i + 1]));
                    (c1 - c0) * (a * (2.0 * c0 + c1) + b * (c0 + 2.0 * c1)) / 6.0
                };
                (0..t.cosines.len() - 1).map(piece).sum::<f64>() as f32
            }
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

    #[test]
    fn cosines_follow_their_laws() {
        let table = Table::new(&[-1.0, -0.5, 0.3, 1.0], &[1.0, 0.0, 0.5, 4.0]).unwrap();
        let laws = [
            Law::HenyeyGreenstein(0.7),
            Law::TwoLobe { weight: 0.8, g1: 0.9, g2: -0.4 },
            Law::Rayleigh,
            Law::Table(Arc::new(table)),
        ];
        for law in laws {
            // Stratified variates through the inverse; compare moments and the distribution with sums over the density.
            let n = 200_000;
            let cosines: Vec<f32> = (0..n).map(|i| law.cosine((i as f32 + 0.5) / n as f32)).collect();
            let mean = cosines.iter().map(|&c| f64::from(c)).sum::<f64>() / f64::from(n);
            // Strata of 5e-6 in u, rounding of f32 variates near the ends.
            assert!((mean - f64::from(law.mean_cosine())).abs() < 2e-5, "{law:?}: {mean} {}", law.mean_cosine());
            let steps = 400_000;
            for cut in [-0.7f32, 0.0, 0.5, 0.9] {
                let below = cosines.iter().filter(|&&c| c < cut).count() as f64 / f64::from(n);
                let h = f64::from(cut + 1.0) / f64::from(steps);
                let exact: f64 = (0..steps)
                    .map(|i| {
                        2.0 * std::f64::consts::PI * h * f64::from(law.eval((-1.0 + (f64::from(i) + 0.5) * h) as f32))
                    })
                    .sum();
                assert!((below - exact).abs() < 2e-5, "{law:?} at {cut}: {below} {exact}");
            }
        }
    }

    #[test]
    fn tables_that_are_no_laws_are_refused() {
        for (c, v) in [
            (vec![-1.0, 1.0], vec![0.0, 0.0]),
            (vec![-1.0, 0.9], vec![1.0, 1.0]),
            (vec![-1.0, 0.5, 0.2, 1.0], vec![1.0; 4]),
            (vec![-1.0, 1.0], vec![1.0, -1.0]),
        ] {
            assert!(Table::new(&c, &v).is_err());
        }
    }
}
