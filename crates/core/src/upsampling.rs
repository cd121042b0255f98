//! Smooth spectra from linear sRGB colours \[JakobHanika2019\].
//!
//! A colour is turned into three coefficients of s(lambda) = S(c0 lambda^2 + c1 lambda + c2) with S(x) = 1/2 + x / (2 sqrt(1 + x^2)):
//! always within (0, 1), smooth, and of the wanted colour under D65. The coefficients come from an embedded table of 32^3
//! nodes per largest channel (made by the example `upsampling_table`, read by the crate `rgb2spec`), interpolated trilinearly.
//!
//! *Accuracy*: over 4096 colours of the cube the colour seen by [`crate::color`] is off by at most .003, .0006 in
//! the mean; after [`RgbSpectrum::refined`], as the spectra of a scene are, by 1e-5 (tests
//! below). Greys do not go through the table: they are exactly constant.

use std::sync::LazyLock;

use rgb2spec::RGB2Spec;

use crate::color::{LAMBDA_MAX, LAMBDA_MIN, OBSERVED, SAMPLES, inverse, multiply};
use crate::spectrum::Spectrum;
use crate::wavelengths::Wavelengths;

static TABLE: LazyLock<RGB2Spec> = LazyLock::new(|| {
    RGB2Spec::from_reader(&mut &include_bytes!("../data/srgb.spec")[..]).expect("the embedded table is valid")
});

/// A linear sRGB colour with the smooth spectrum that stands for it: `scale` times a sigmoid of a quadratic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RgbSpectrum {
    /// The colour itself, which the lanes of rgb mode return.
    pub rgb: [f32; 3],
    scale: f32,
    coefficients: [f32; 3],
}

impl RgbSpectrum {
    /// Returns the spectrum of a reflectance or albedo; components outside \[0, 1\] are outside the table and act as the nearest end.
    pub fn albedo(rgb: [f32; 3]) -> Self {
        Self { rgb, scale: 1.0, coefficients: if is_gray(rgb) { [0.0; 3] } else { TABLE.fetch(rgb) } }
    }

    /// Returns the spectrum of any non-negative colour: twice the largest component times the spectrum of the rest.
    ///
    /// The factor 2 keeps the sigmoid away from its saturated end, so that the spectra stay smooth (the definition of pbrt-v4).
    pub fn unbounded(rgb: [f32; 3]) -> Self {
        let scale = 2.0 * rgb[0].max(rgb[1]).max(rgb[2]);
        if is_gray(rgb) || scale <= 0.0 {
            return Self { rgb, scale, coefficients: [0.0; 3] };
        }
        Self { rgb, scale, coefficients: TABLE.fetch(rgb.map(|x| x / scale)) }
    }

    /// Returns the spectrum with its coefficients improved until its colour is met: Newton steps from the table's values.
    ///
    /// For spectra made once per scene (it takes some 20 us); textures use the table alone. A step that does not improve the
    /// colour is not taken.
    pub fn refined(self) -> Self {
        if is_gray(self.rgb) {
            return self;
        }
        let goal = self.rgb.map(|x| f64::from(x) / f64::from(self.scale));
        let mut best = self;
        let (mut error, mut jacobian) = best.residual(goal);
        for _ in 0..6 {
            let step = multiply(&inverse(jacobian), error);
            // From the scaled wavelength t = (lambda - 580) / 200 of the Jacobian to lambda in nm.
            let [a, b, c] = [step[0] / 40_000.0, step[1] / 200.0, step[2]];
            let delta = [a, b - 1160.0 * a, c - 580.0 * b + 336_400.0 * a];
            let next = Self {
                coefficients: std::array::from_fn(|i| (f64::from(best.coefficients[i]) - delta[i]) as f32),
                ..best
            };
            let (e, j) = next.residual(goal);
            let norm = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
            // NaN of a singular Jacobian is no improvement either.
            if norm(e) >= norm(error) || norm(e).is_nan() {
                break;
            }
            (best, error, jacobian) = (next, e, j);
        }
        best
    }

    /// Returns the colour of the unscaled sigmoid minus the goal, and its derivatives by the coefficients over t.
    fn residual(&self, goal: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
        let (mut error, mut jacobian) = (goal.map(|x| -x), [[0.0; 3]; 3]);
        for (i, w) in OBSERVED.response.iter().enumerate() {
            let lambda = LAMBDA_MIN + i as f32;
            let t = (f64::from(lambda) - 580.0) / 200.0;
            let x = f64::from(self.quadratic(lambda));
            let r = 1.0 / (1.0 + x * x).sqrt();
            // The trapezoidal rule of `OBSERVED`.
            let end = if i == 0 || i + 1 == SAMPLES { 0.5 } else { 1.0 };
            for k in 0..3 {
                let weight = end * f64::from(w[k]);
                error[k] += weight * (0.5 + 0.5 * x * r);
                for (d, power) in jacobian[k].iter_mut().zip([t * t, t, 1.0]) {
                    *d += weight * 0.5 * r * r * r * power;
                }
            }
        }
        (error, jacobian)
    }

    #[inline]
    fn quadratic(&self, lambda: f32) -> f32 {
        let [c0, c1, c2] = self.coefficients;
        (c0 * lambda + c1) * lambda + c2
    }

    /// Returns the wavelength \[nm\] within 380..780 nm at which the spectrum has its only inner extremum, if there is one.
    pub fn vertex(&self) -> Option<f32> {
        let [c0, c1, _] = self.coefficients;
        Some(-0.5 * c1 / c0).filter(|vertex| (LAMBDA_MIN..=LAMBDA_MAX).contains(vertex))
    }

    /// Returns the spectrum times a non-negative factor.
    pub fn scaled(&self, factor: f32) -> Self {
        Self { rgb: self.rgb.map(|x| x * factor), scale: self.scale * factor, ..*self }
    }

    /// Returns the value at a wavelength in nm; exactly the common component for a grey.
    #[inline]
    pub fn eval(&self, lambda: f32) -> f32 {
        if is_gray(self.rgb) {
            return self.rgb[0];
        }
        let x = self.quadratic(lambda);
        // The two forms agree; the second keeps its digits where the sigmoid is near 0.
        let y = (1.0 + x * x).sqrt();
        let s = if x > 0.0 { 0.5 + 0.5 * x / y } else { 0.5 / (y * (y - x)) };
        self.scale * s
    }

    /// Returns the values in the lanes of a path: the components themselves in rgb mode.
    #[inline]
    pub fn sample<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        lanes(self.rgb, wavelengths, |l| self.eval(l))
    }
}

/// Returns the lanes of an albedo given as a colour, without a spectrum object: for textures.
#[inline]
pub fn sample_albedo<const N: usize>(rgb: [f32; 3], wavelengths: &Wavelengths<N>) -> Spectrum<N> {
    match wavelengths {
        Wavelengths::Channels { .. } => lanes(rgb, wavelengths, |_| 0.0),
        _ => RgbSpectrum::albedo(rgb).sample(wavelengths),
    }
}

/// Returns the lanes of a non-negative colour (a coefficient or radiance), without a spectrum object: for textures.
#[inline]
pub fn sample_unbounded<const N: usize>(rgb: [f32; 3], wavelengths: &Wavelengths<N>) -> Spectrum<N> {
    match wavelengths {
        Wavelengths::Channels { .. } => lanes(rgb, wavelengths, |_| 0.0),
        _ => RgbSpectrum::unbounded(rgb).sample(wavelengths),
    }
}

/// Fills the lanes: with components of a colour in rgb mode, else with values at wavelengths.
#[inline]
pub(crate) fn lanes<const N: usize>(
    rgb: [f32; 3],
    wavelengths: &Wavelengths<N>,
    eval: impl Fn(f32) -> f32,
) -> Spectrum<N> {
    match wavelengths {
        Wavelengths::Sampled { lambda, .. } => Spectrum(lambda.map(eval)),
        Wavelengths::Channels { channel } => Spectrum(channel.map(|c| rgb[c as usize])),
        Wavelengths::Fixed(lambda) => Spectrum::splat(eval(*lambda)),
    }
}

#[inline]
fn is_gray(rgb: [f32; 3]) -> bool {
    rgb[0] == rgb[1] && rgb[1] == rgb[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_survive_the_way_through_their_spectrum() {
        let (mut worst, mut sum, mut at) = (0.0f64, 0.0f64, [0.0; 3]);
        for i in 0..4096u32 {
            let rgb = [i % 16, i / 16 % 16, i / 256].map(|k| k as f32 / 15.0);
            let s = RgbSpectrum::albedo(rgb);
            let back = OBSERVED.rgb_of(|l| s.eval(l));
            let e = back.iter().zip(rgb).map(|(a, b)| (a - f64::from(b)).abs()).fold(0.0, f64::max);
            sum += e;
            if e > worst {
                (worst, at) = (e, rgb);
            }
        }
        // Measured errors of the interpolated table, rounded up.
        assert!(worst < 0.003 && sum / 4096.0 < 6.5e-4, "worst {worst} at {at:?}, mean {}", sum / 4096.0);
    }

    #[test]
    fn refined_spectra_have_their_colour() {
        let (mut worst, mut at) = (0.0f64, [0.0; 3]);
        for i in 0..4096u32 {
            let rgb = [i % 16, i / 16 % 16, i / 256].map(|k| k as f32 / 15.0);
            let (table, s) = (RgbSpectrum::albedo(rgb), RgbSpectrum::albedo(rgb).refined());
            let error = |s: RgbSpectrum| {
                let back = OBSERVED.rgb_of(|l| s.eval(l));
                back.iter().zip(rgb).map(|(a, b)| (a - f64::from(b)).powi(2)).sum::<f64>().sqrt()
            };
            assert!(error(s) <= error(table) + 1e-6);
            if error(s) > worst {
                (worst, at) = (error(s), rgb);
            }
        }
        // Coefficients rounded to f32.
        assert!(worst < 1e-5, "{worst:e} at {at:?}");
    }

    #[test]
    fn unbounded_colours_survive_too() {
        for rgb in [[2.29f32, 2.39, 1.97], [0.003, 0.0034, 0.046], [7.0, 0.5, 30.0], [0.011, 0.0368, 0.1564]] {
            let max = f64::from(rgb[0].max(rgb[1]).max(rgb[2]));
            // The table's error at half brightness, and that of coefficients in f32, relative to the largest component.
            for (s, tolerance) in [(RgbSpectrum::unbounded(rgb), 0.005), (RgbSpectrum::unbounded(rgb).refined(), 2e-5)]
            {
                let back = OBSERVED.rgb_of(|l| s.eval(l));
                assert!(
                    back.iter().zip(rgb).all(|(a, b)| (a - f64::from(b)).abs() < tolerance * max),
                    "{back:?} {rgb:?}"
                );
            }
        }
    }

    #[test]
    fn greys_are_exact_bit_for_bit() {
        for x in [0.0f32, 1e-7, 0.3, 0.5, 1.0, 17.3] {
            assert!((0..41).all(|i| RgbSpectrum::unbounded([x; 3]).eval(380.0 + 10.0 * i as f32) == x));
            assert!((0..41).all(|i| RgbSpectrum::albedo([x; 3]).eval(380.0 + 10.0 * i as f32) == x));
        }
    }
}
