//! Phase functions: Henyey-Greenstein in f32 for rendering, here; all others, in f64, in [`function`].
//!
//! `w_o` points back along the path, `w_i` onwards; both away from the point. The cosine of the deflection is cos = -dot(w_i, w_o),
//! forward = +1. All densities are per steradian and integrate to 1 over the sphere, so that sampling has weight 1.

pub mod function;

pub use function::{PhaseFunction, Tabulated};

use std::f32::consts::{PI, TAU};

use moonmilk_core::{Frame, Vec3};

use crate::error::{Error, within};

/// The Henyey-Greenstein phase function of asymmetry g; g = 0 is isotropic scattering.
///
/// p(cos) = (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2)), mean cosine g, Legendre moments g^n. *Domain*: |g| < 1.
///
/// *Use when* only the mean cosine is known. *Do not use when* the forward peak or backscatter matters (ripples of Mie
/// scattering, glory). *Source*: \[Henyey1941\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HenyeyGreenstein {
    g: f32,
}

/// A sampled direction of a phase function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseSample {
    /// The new direction.
    pub w_i: Vec3,
    /// Cosine of the deflection.
    pub cos: f32,
    /// Density per steradian; also the value of the phase function.
    pub pdf: f32,
}

impl HenyeyGreenstein {
    /// Isotropic scattering.
    pub const ISOTROPIC: Self = Self { g: 0.0 };

    /// Returns the phase function of asymmetry g.
    ///
    /// *Errors*: g outside (-1, 1).
    pub fn new(g: f32) -> Result<Self, Error> {
        within("g", g, g.abs() < 1.0, "(-1, 1)")?;
        Ok(Self { g })
    }

    /// Returns the asymmetry, the mean cosine of the deflection.
    #[inline]
    pub fn g(&self) -> f32 {
        self.g
    }

    /// Returns the Legendre moment of order n: the mean of P_n(cos), g^n.
    pub fn moment(&self, n: u32) -> f64 {
        f64::from(self.g).powi(n as i32)
    }

    /// Returns the value at a cosine of the deflection \[1/sr\].
    #[inline]
    pub fn eval_cos(&self, cos: f32) -> f32 {
        let g = self.g;
        // 1 + g^2 - 2 g cos, written without cancellation where the peak is.
        let d = if g >= 0.0 {
            (1.0 - g) * (1.0 - g) + 2.0 * g * (1.0 - cos)
        } else {
            (1.0 + g) * (1.0 + g) - 2.0 * g * (1.0 + cos)
        };
        (1.0 - g) * (1.0 + g) / (4.0 * PI * d * d.sqrt())
    }

    /// Returns the value for a pair of directions \[1/sr\].
    #[inline]
    pub fn eval(&self, w_o: Vec3, w_i: Vec3) -> f32 {
        self.eval_cos((-w_o.dot(w_i)).clamp(-1.0, 1.0))
    }

    /// Returns the density with which [`Self::sample`] finds `w_i`: the value itself.
    #[inline]
    pub fn pdf(&self, w_o: Vec3, w_i: Vec3) -> f32 {
        self.eval(w_o, w_i)
    }

    /// Returns the cosine of the deflection at which the cumulative distribution equals u.
    ///
    /// cos = s + g (1 - s^2)(3 + 2 g s - g^2) / (2 (1 + g s)^2), s = 2 u - 1: the textbook inverse, rearranged so that nothing is
    /// divided by g and no threshold is needed. *Accuracy*: f32 rounding for |g| <= .01, 4e-6 at .99 (test).
    #[inline]
    pub fn sample_cos(&self, u: f32) -> f32 {
        let (g, s) = (self.g, 2.0 * u - 1.0);
        let d = 1.0 + g * s;
        // 1 - s^2 = 4 u (1 - u).
        s + g * 4.0 * u * (1.0 - u) * (3.0 + 2.0 * g * s - g * g) / (2.0 * d * d)
    }

    /// Samples a direction from two uniform variates.
    #[inline]
    pub fn sample(&self, w_o: Vec3, u: [f32; 2]) -> PhaseSample {
        let cos = self.sample_cos(u[0]).clamp(-1.0, 1.0);
        let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
        let (s, c) = (TAU * u[1]).sin_cos();
        let w_i = Frame::new(-w_o).to_world(Vec3::new(sin * c, sin * s, cos));
        PhaseSample { w_i, cos, pdf: self.eval_cos(cos) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::quadrature::Rule;
    use moonmilk_core::stats::{chi_square, sidak};
    use moonmilk_core::{Random, Stream};

    const GS: [f32; 9] = [-0.95, -0.5, -1e-3, 0.0, 1e-6, 0.3, 0.75, 0.95, 0.99];

    /// Integrates over the sphere with intervals graded towards both poles.
    fn sphere(f: impl Fn(f64) -> f64) -> f64 {
        let mut breaks: Vec<f64> = (0..24).map(|i| -1.0 + 0.5f64.powi(23 - i)).collect();
        breaks.insert(0, -1.0);
        breaks.extend((1..24).map(|i| 1.0 - 0.5f64.powi(i)));
        breaks.push(1.0);
        Rule::composite(8, &breaks).integrate(|c| std::f64::consts::TAU * f(c))
    }

    #[test]
    fn the_phase_function_is_normalised_and_has_its_moments() {
        for g in GS {
            let p = HenyeyGreenstein::new(g).unwrap();
            let value = |c: f64| f64::from(p.eval_cos(c as f32));
            // Rounding of f32 values; near the peak at g = .99 the argument's rounding 6e-8 / (1 - g)^2 counts.
            let tolerance = if g.abs() > 0.9 { 1e-3 } else { 2e-6 };
            assert!((sphere(value) - 1.0).abs() < tolerance, "{g} {}", sphere(value));
            assert!((sphere(|c| c * value(c)) - p.moment(1)).abs() < tolerance, "{g}");
            assert!((sphere(|c| (1.5 * c * c - 0.5) * value(c)) - p.moment(2)).abs() < tolerance, "{g}");
        }
    }

    #[test]
    fn sampled_directions_follow_the_phase_function() {
        let n = 200_000;
        let w_o = Vec3::new(0.3, -0.8, 0.4).normalize();
        let axis = Frame::new(-w_o);
        for (k, g) in GS.into_iter().enumerate() {
            let p = HenyeyGreenstein::new(g).unwrap();
            let mut r = Stream::new(&[5, k as u64]);
            // 32 cells of equal probability in the cosine, times 8 in the azimuth.
            let edges: Vec<f32> = (0..=32).map(|i| p.sample_cos(i as f32 / 32.0)).collect();
            let mut counts = vec![0.0; 256];
            let mut mean = 0.0f64;
            for _ in 0..n {
                let s = p.sample(w_o, r.uniform2());
                let cos = -s.w_i.dot(w_o);
                // The error of rotating a unit vector.
                assert!((cos - s.cos).abs() < 1e-6 && (s.w_i.length() - 1.0).abs() < 1e-6);
                mean += f64::from(s.cos) / f64::from(n);
                let l = axis.to_local(s.w_i);
                let a = ((l.y.atan2(l.x) / TAU).rem_euclid(1.0) * 8.0) as usize;
                let b = (1..32).filter(|&i| s.cos >= edges[i]).count();
                counts[8 * b + a.min(7)] += 1.0;
            }
            // Expected counts by quadrature of the value, not by the sampler.
            let expected: Vec<f64> = (0..256)
                .map(|i| {
                    let (a, b) = (f64::from(edges[i / 8]), f64::from(edges[i / 8 + 1]));
                    let breaks: Vec<f64> = (0..=8).map(|j| a + (b - a) * f64::from(j) / 8.0).collect();
                    let q = f64::from(g);
                    let f = |c: f64| (1.0 - q * q) / (2.0 * (1.0 + q * q - 2.0 * q * c).powf(1.5));
                    Rule::composite(8, &breaks).integrate(f) / 8.0 * f64::from(n)
                })
                .collect();
            let p_value = chi_square(&counts, &expected, 0);
            assert!(p_value > sidak(1e-4, GS.len()), "g = {g}: p = {p_value}");
            // The variance of the cosine is at most 1: 4.4 standard errors.
            assert!((mean - f64::from(g)).abs() < 4.4 / f64::from(n).sqrt(), "{g} {mean}");
        }
    }

    #[test]
    fn sampling_is_accurate_for_every_g() {
        for g in [-0.99f32, -0.5, -1e-6, 0.0, 1e-7, 1e-4, 1e-3, 0.01, 0.5, 0.99] {
            let p = HenyeyGreenstein::new(g).unwrap();
            let mut worst = 0.0f64;
            for i in 0..=20_000 {
                let u = i as f32 / 20_000.0;
                let c = p.sample_cos(u);
                let (g, u) = (f64::from(g), f64::from(u));
                // Solve cdf(c) = u in f64: cdf = (1 - g^2) / (2 g) (1 / sqrt(1 + g^2 - 2 g c) - 1 / (1 + g)).
                let exact = if g.abs() < 1e-5 {
                    2.0 * u - 1.0 + 6.0 * g * u * (1.0 - u)
                } else {
                    (1.0 + g * g - ((1.0 - g * g) / (1.0 - g + 2.0 * g * u)).powi(2)) / (2.0 * g)
                };
                worst = worst.max((f64::from(c) - exact).abs());
                assert!(c.abs() <= 1.0 + 1e-6);
            }
            assert!(worst < if g.abs() > 0.9 { 6e-6 } else { 3e-7 }, "{g} {worst}");
        }
    }

    #[test]
    fn asymmetries_outside_the_open_interval_are_rejected() {
        assert_eq!(HenyeyGreenstein::new(1.2).unwrap_err().to_string(), "g = 1.2 is outside (-1, 1)");
        assert!(HenyeyGreenstein::new(-1.0).is_err() && HenyeyGreenstein::new(f32::NAN).is_err());
    }
}
