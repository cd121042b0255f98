//! Black bodies of any temperature, at the wavelengths of a path.

use moonmilk_core::color::OBSERVED;
use moonmilk_core::named::planck_over_peak;
use moonmilk_core::{Spectrum, Wavelengths};

/// Integral of the luminous efficiency over wavelengths [nm], CIE 1931, as in pbrt-v4 (`CIE_Y_integral`).
///
/// pbrt brings the spectra of lights to luminance 1, but takes a black body of a grid, and a colour of an rgb grid, as a spectral radiance of
/// peak 1, or as D65 of mean 1: their luminance is this many times larger.
pub(crate) const Y_INTEGRAL: f32 = 106.856_895;

/// Intervals of the table in 1 / T. Between nodes exp(-c2 / (lambda T)) is off by (c2 h / lambda)^2 / 8 at most, c2 = 1.44e7 nm K: 3e-5 at 600 nm.
const NODES: usize = 1 << 14;

/// Colours of black bodies in linear sRGB over 1 / T in (0, .01 / K]: for rgb mode, where a spectrum is its projection.
#[derive(Clone, Debug)]
pub(crate) struct Colours {
    rgb: Vec<[f32; 3]>,
    hottest: f64,
}

impl Colours {
    /// Makes the table up to a temperature in kelvin.
    pub(crate) fn new(hottest: f32) -> Self {
        use rayon::prelude::*;
        let hottest = f64::from(hottest).max(200.0);
        let rgb = (0..=NODES)
            .into_par_iter()
            .map(|i| {
                let t = 1.0 / inverse_of(i as f64, hottest);
                let relative = |l: f32| (planck_over_peak(f64::from(l), t) / OBSERVED.d65_at(l)) as f32;
                // A colour outside the gamut has no negative radiance: as for tabulated lights, keep it within the spectrum's range.
                OBSERVED.rgb_of(relative).map(|x| (x as f32).max(0.0))
            })
            .collect();
        Self { rgb, hottest }
    }

    fn at(&self, t: f32) -> [f32; 3] {
        let (a, b) = (1.0 / self.hottest, 0.01);
        let x = ((1.0 / f64::from(t) - a) / (b - a) * NODES as f64).clamp(0.0, NODES as f64);
        let i = (x as usize).min(NODES - 1);
        let f = (x - i as f64) as f32;
        std::array::from_fn(|c| self.rgb[i][c] + f * (self.rgb[i + 1][c] - self.rgb[i][c]))
    }

    /// Returns the radiance, relative to D65, of a black body of t > 100 kelvin whose spectral radiance peaks at 1.
    pub(crate) fn radiance<const N: usize>(&self, t: f32, w: &Wavelengths<N>) -> Spectrum<N> {
        let eval = |l: f32| (planck_over_peak(f64::from(l), f64::from(t)) / OBSERVED.d65_at(l)) as f32;
        let relative = match w {
            Wavelengths::Sampled { lambda, .. } => Spectrum(lambda.map(eval)),
            Wavelengths::Channels { channel } => {
                let rgb = self.at(t);
                Spectrum(channel.map(|c| rgb[c as usize]))
            }
            Wavelengths::Fixed(lambda) => Spectrum::splat(eval(*lambda)),
        };
        relative * Y_INTEGRAL
    }
}

/// Returns 1 / T at a node of the table.
fn inverse_of(i: f64, hottest: f64) -> f64 {
    let a = 1.0 / hottest;
    a + (0.01 - a) * i / NODES as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Spectra, WavelengthMode};

    #[test]
    fn radiances_are_those_of_black_body_lights_up_to_their_normalisation() {
        let colours = Colours::new(9000.0);
        for t in [700.0f32, 1500.0, 3000.0, 6500.0, 8999.0] {
            let light = Spectra::blackbody(t).expect("positive");
            let w = Wavelengths::<4>::sample(WavelengthMode::Hero, 0.3);
            for (a, b) in colours.radiance(t, &w).0.iter().zip(light.sample(&w).0) {
                // Linear interpolation of the light's 1 nm table.
                assert!((a / (b * Y_INTEGRAL) - 1.0).abs() < 2e-3, "{t} K: {a} against {b}");
            }
            let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, 0.3);
            for (a, b) in colours.radiance(t, &w).0.iter().zip(light.sample(&w).0) {
                // The table's step, relative to the brightest channel.
                let scale = light.max_value().max(1e-30);
                assert!((a / Y_INTEGRAL - b.max(0.0)).abs() < 1e-4 * scale, "{t} K: {a} against {b}");
            }
        }
    }
}
