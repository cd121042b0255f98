//! A measured number with its standard error.

use std::fmt;

/// A Monte Carlo estimate: mean, standard error of that mean, and the number of independent samples behind it.
///
/// *Dimensions*: those of the quantity estimated; `std_err` has the same dimension as `mean`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Sample mean.
    pub mean: f64,
    /// Standard error of the mean: `sqrt(sample variance / n)`.
    pub std_err: f64,
    /// Number of independent samples.
    pub n: u64,
}

impl Estimate {
    /// Returns the number of standard errors between this estimate and an exact `value`.
    ///
    /// A zero standard error gives 0 for an equal value and infinity otherwise.
    pub fn z(&self, value: f64) -> f64 {
        let d = self.mean - value;
        if d == 0.0 { 0.0 } else { d / self.std_err }
    }

    /// Returns the number of combined standard errors between two independent estimates.
    pub fn z_against(&self, other: &Estimate) -> f64 {
        let d = self.mean - other.mean;
        if d == 0.0 { 0.0 } else { d / self.std_err.hypot(other.std_err) }
    }

    /// Returns `std_err / |mean|`.
    pub fn relative_error(&self) -> f64 {
        self.std_err / self.mean.abs()
    }
}

impl fmt::Display for Estimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.6} +- {:.6}", self.mean, self.std_err)
    }
}

/// Accumulates mean and variance of a stream of samples (Welford's update, stable for large n).
#[derive(Clone, Copy, Debug, Default)]
pub struct Accumulator {
    n: u64,
    mean: f64,
    m2: f64,
}

impl Accumulator {
    /// Adds one sample.
    pub fn add(&mut self, x: f64) {
        self.n += 1;
        let d = x - self.mean;
        self.mean += d / self.n as f64;
        self.m2 += d * (x - self.mean);
    }

    /// Adds all samples of another accumulator (Chan's pairwise update).
    pub fn merge(&mut self, other: &Accumulator) {
        if other.n == 0 {
            return;
        }
        let n = self.n + other.n;
        let d = other.mean - self.mean;
        self.m2 += other.m2 + d * d * (self.n as f64 * other.n as f64) / n as f64;
        self.mean += d * other.n as f64 / n as f64;
        self.n = n;
    }

    /// Returns the unbiased sample variance; NaN for fewer than two samples.
    pub fn variance(&self) -> f64 {
        if self.n < 2 { f64::NAN } else { self.m2 / (self.n - 1) as f64 }
    }

    /// Returns mean and standard error of the samples so far.
    pub fn estimate(&self) -> Estimate {
        Estimate { mean: self.mean, std_err: (self.variance() / self.n as f64).sqrt(), n: self.n }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn merging_two_halves_equals_one_run() {
        let xs: Vec<f64> = (0..1000).map(|i| ((i * 7919) % 1013) as f64 + 1e6).collect();
        let (mut whole, mut a, mut b) = (Accumulator::default(), Accumulator::default(), Accumulator::default());
        for (i, &x) in xs.iter().enumerate() {
            whole.add(x);
            if i % 3 == 0 { a.add(x) } else { b.add(x) }
        }
        a.merge(&b);
        let (w, m) = (whole.estimate(), a.estimate());
        // Rounding of 1000 additions in f64.
        assert!((w.mean / m.mean - 1.0).abs() < 1e-12 && (w.std_err / m.std_err - 1.0).abs() < 1e-9);
    }
}
