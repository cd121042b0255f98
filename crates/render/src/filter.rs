//! Pixel reconstruction filters, sampled in proportion to their magnitude.
//!
//! A sample is placed by the filter and counts for its own pixel alone: pixels stay independent, so that sums are exact and
//! variances honest. Weights are +1 or -1 times a constant (negative lobes), 1 for positive filters up to the tabulation.

use std::f32::consts::PI;

use crate::description::{FilterDescription, FilterKind};

const CELLS: usize = 256;

/// One axis of a separable filter: positive part of a tabulated density, and the exact weight.
#[derive(Clone, Debug)]
struct Axis {
    kind: FilterKind,
    radius: f32,
    cdf: Vec<f32>,
    integral: f64,
}

impl Axis {
    fn new(kind: FilterKind, radius: f32) -> Self {
        let width = 2.0 * f64::from(radius) / CELLS as f64;
        let at = |i: f64| -f64::from(radius) + i * width;
        // Tabulate the magnitude at cell centres, kept positive so that no cell with a zero crossing is missed.
        let magnitude: Vec<f64> =
            (0..CELLS).map(|i| f64::from(value(kind, radius, at(i as f64 + 0.5) as f32)).abs() + 1e-4).collect();
        let total: f64 = magnitude.iter().sum();
        let mut sum = 0.0;
        let mut cdf = vec![0.0];
        for m in &magnitude {
            sum += m / total;
            cdf.push(sum as f32);
        }
        cdf[CELLS] = 1.0;
        // Integrate by the midpoint rule on 16 points per cell: below 1e-6 for these filters.
        let fine = 16 * CELLS;
        let integral =
            (0..fine).map(|i| f64::from(value(kind, radius, at((i as f64 + 0.5) / 16.0) as f32))).sum::<f64>() * width
                / 16.0;
        Self { kind, radius, cdf, integral }
    }

    /// Returns an offset and its weight value / (density x integral).
    fn sample(&self, u: f32) -> (f32, f32) {
        if self.kind == FilterKind::Box {
            return ((2.0 * u - 1.0) * self.radius, 1.0);
        }
        let i = self.cdf.partition_point(|&c| c <= u).clamp(1, CELLS) - 1;
        let p = self.cdf[i + 1] - self.cdf[i];
        let width = 2.0 * self.radius / CELLS as f32;
        let x = -self.radius + (i as f32 + ((u - self.cdf[i]) / p).clamp(0.0, 1.0)) * width;
        (x, value(self.kind, self.radius, x) * width / (p * self.integral as f32))
    }
}

/// Returns the filter's value at offset x along one axis [pixels].
fn value(kind: FilterKind, radius: f32, x: f32) -> f32 {
    if x.abs() > radius {
        return 0.0;
    }
    match kind {
        FilterKind::Box => 1.0,
        FilterKind::Triangle => radius - x.abs(),
        FilterKind::Gaussian { sigma } => {
            let g = |x: f32| (-0.5 * (x / sigma).powi(2)).exp();
            (g(x) - g(radius)).max(0.0)
        }
        FilterKind::Mitchell { b, c } => {
            let x = (2.0 * x / radius).abs();
            if x <= 1.0 {
                ((12.0 - 9.0 * b - 6.0 * c) * x * x * x + (-18.0 + 12.0 * b + 6.0 * c) * x * x + (6.0 - 2.0 * b)) / 6.0
            } else {
                ((-b - 6.0 * c) * x * x * x
                    + (6.0 * b + 30.0 * c) * x * x
                    + (-12.0 * b - 48.0 * c) * x
                    + (8.0 * b + 24.0 * c))
                    / 6.0
            }
        }
        FilterKind::Sinc { tau } => {
            let sinc = |x: f32| {
                if x.abs() < 1e-5 { 1.0 } else { (PI * x).sin() / (PI * x) }
            };
            sinc(x) * sinc(x / tau)
        }
    }
}

/// A filter ready for sampling.
#[derive(Clone, Debug)]
pub struct Filter {
    axes: [Axis; 2],
}

impl Filter {
    /// Tabulates a filter.
    pub fn new(d: &FilterDescription) -> Self {
        Self { axes: [Axis::new(d.kind, d.radius.x), Axis::new(d.kind, d.radius.y)] }
    }

    /// Returns an offset from the pixel's centre \[pixels\] and the weight of a sample there; the mean weight is 1.
    pub fn sample(&self, u: [f32; 2]) -> ([f32; 2], f32) {
        let (x, a) = self.axes[0].sample(u[0]);
        let (y, b) = self.axes[1].sample(u[1]);
        ([x, y], a * b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_every_filter_average_to_one_and_second_moments_match() {
        let kinds = [
            (FilterKind::Box, 0.5),
            (FilterKind::Triangle, 2.0),
            (FilterKind::Gaussian { sigma: 0.5 }, 1.5),
            (FilterKind::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 }, 2.0),
            (FilterKind::Sinc { tau: 3.0 }, 4.0),
        ];
        for (kind, radius) in kinds {
            let axis = Axis::new(kind, radius);
            let n = 1 << 18;
            let (mut w0, mut w2) = (0.0f64, 0.0f64);
            for i in 0..n {
                let (x, w) = axis.sample((i as f32 + 0.5) / n as f32);
                w0 += f64::from(w) / f64::from(n);
                w2 += f64::from(w * x * x) / f64::from(n);
            }
            let m = 100_000;
            let exact = (0..m)
                .map(|i| {
                    let x = radius * (2.0 * (i as f32 + 0.5) / m as f32 - 1.0);
                    f64::from(value(kind, radius, x) * x * x)
                })
                .sum::<f64>()
                * 2.0
                * f64::from(radius)
                / f64::from(m)
                / axis.integral;
            // Regular points over 256 cells with single-precision cell masses.
            assert!((w0 - 1.0).abs() < 2e-4 && (w2 - exact).abs() < 1e-3, "{kind:?}: {w0}, {w2} against {exact}");
        }
    }
}
