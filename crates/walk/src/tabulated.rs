//! A law of scattering that is given by a table: linear between equal steps of the cosine, so that value, distribution and its inverse are all exact.

use std::f32::consts::TAU;

use crate::phase::PhaseFunction;

/// Number of steps of the cosine.
pub const CELLS: usize = 256;
/// Width of a step.
const STEP: f32 = 2.0 / CELLS as f32;

/// A density of the cosine of the deflection, linear between 257 values.
#[derive(Clone, Debug, PartialEq)]
pub struct Tabulated {
    /// Density [1/sr] at the nodes.
    density: [f32; CELLS + 1],
    /// Probability of a smaller cosine than at each node.
    below: [f32; CELLS + 1],
    /// For each of as many equal steps of the probability the cell where it begins.
    guide: [u16; CELLS],
    g: f32,
}

impl Tabulated {
    /// Returns the law with values \[1/sr\] at equal steps of the cosine from -1 to 1; they are normalised.
    ///
    /// *Domain*: positive and finite.
    pub fn new(values: &[f64; CELLS + 1]) -> Self {
        debug_assert!(values.iter().all(|v| *v > 0.0 && v.is_finite()));
        let step = f64::from(STEP);
        let mut below = [0.0; CELLS + 1];
        let mut mean = 0.0;
        for i in 0..CELLS {
            let (a, b) = (values[i], values[i + 1]);
            below[i + 1] = below[i] + 0.5 * step * (a + b);
            // The mean of x over the cell: its middle, moved by the slope.
            mean += 0.5 * step * (a + b) * (-1.0 + step * (i as f64 + 0.5)) + step * step * (b - a) / 12.0;
        }
        let total = below[CELLS];
        let below = below.map(|b| (b / total) as f32);
        let density = values.map(|v| (v / (total * f64::from(TAU))) as f32);
        let guide = std::array::from_fn(|j| {
            let u = j as f32 / CELLS as f32;
            (below.partition_point(|&b| b <= u).clamp(1, CELLS) - 1) as u16
        });
        Self { density, below, guide, g: (mean / total) as f32 }
    }
}

impl PhaseFunction for Tabulated {
    #[inline]
    fn eval(&self, cosine: f32) -> f32 {
        let x = ((cosine + 1.0) * (1.0 / STEP)).clamp(0.0, CELLS as f32);
        let i = (x as usize).min(CELLS - 1);
        self.density[i] + (self.density[i + 1] - self.density[i]) * (x - i as f32)
    }

    #[inline]
    fn cosine(&self, u: f32) -> f32 {
        let mut i = usize::from(self.guide[((u * CELLS as f32) as usize).min(CELLS - 1)]);
        while i < CELLS - 1 && self.below[i + 1] <= u {
            i += 1;
        }
        // Solve a x + slope x^2 / 2 = rest in the form that does not cancel.
        let (a, b) = (TAU * self.density[i], TAU * self.density[i + 1]);
        let rest = u - self.below[i];
        let root = (a * a + 2.0 * rest * (b - a) * (1.0 / STEP)).max(0.0).sqrt();
        (-1.0 + STEP * i as f32 + (2.0 * rest / (a + root)).min(STEP)).min(1.0)
    }

    #[inline]
    fn mean_cosine(&self) -> f32 {
        self.g
    }
}

#[cfg(test)]
mod tests {
    use moonmilk_core::quadrature::Rule;

    use super::*;

    /// A forward lobe, a backward one and a deep valley between them.
    fn lobes() -> Tabulated {
        Tabulated::new(&std::array::from_fn(|i| {
            let x = f64::from(STEP) * i as f64 - 1.0;
            1e-3 + (-8.0 * (x - 0.6).powi(2)).exp() + 0.3 * (-40.0 * (x + 0.8).powi(2)).exp()
        }))
    }

    #[test]
    fn the_density_is_one_over_the_sphere_and_samples_have_it() {
        let law = lobes();
        let breaks: Vec<f64> = (0..=CELLS).map(|i| f64::from(STEP) * i as f64 - 1.0).collect();
        let rule = Rule::composite(3, &breaks);
        let moment = |n: i32| rule.integrate(|x| f64::from(TAU) * f64::from(law.eval(x as f32)) * x.powi(n));
        // Single precision.
        assert!((moment(0) - 1.0).abs() < 1e-6 && (moment(1) - f64::from(law.mean_cosine())).abs() < 1e-6);
        let n = 1 << 20;
        let mut last = -1.0;
        let mut sums = [0.0; 5];
        for k in 0..n {
            let u = (k as f32 + 0.5) / n as f32;
            let x = law.cosine(u);
            assert!((-1.0..=1.0).contains(&x) && x >= last - 2e-6, "{u}: {x} after {last}");
            last = x;
            sums.iter_mut().enumerate().for_each(|(m, s)| *s += f64::from(x).powi(m as i32));
        }
        // Midpoints over 2^20 steps and single precision.
        for (m, s) in sums.iter().enumerate() {
            assert!((s / f64::from(n) - moment(m as i32)).abs() < 2e-6, "moment {m}");
        }
    }

    #[test]
    fn cosines_are_the_inverse_of_the_distribution() {
        let law = lobes();
        for k in 0..=10_000u32 {
            let u = k as f32 / 10_000.0;
            let x = f64::from(law.cosine(u));
            let i = (((x + 1.0) / f64::from(STEP)) as usize).min(CELLS - 1);
            let start = f64::from(STEP) * i as f64 - 1.0;
            let inside = 0.5 * (f64::from(law.density[i]) + f64::from(law.eval(x as f32))) * (x - start);
            let below = f64::from(law.below[i]) + f64::from(TAU) * inside;
            assert!((below - f64::from(u)).abs() < 1e-6, "{u}: {below}");
        }
    }
}
