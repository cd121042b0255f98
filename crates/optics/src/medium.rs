//! Homogeneous media as a scene holds them.

use moonmilk_core::{Spectra, Spectrum, Wavelengths};

use crate::error::{Error, within};
use crate::phase::HenyeyGreenstein;

/// A homogeneous medium: coefficients \[1/L\] over the wavelength, Henyey-Greenstein scattering, emission. Plain, valid data.
#[derive(Clone, Debug, PartialEq)]
pub struct Homogeneous {
    sigma_a: Spectra,
    sigma_s: Spectra,
    emission: Spectra,
    phase: HenyeyGreenstein,
}

/// The coefficients of a medium at the wavelengths of one path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients<const N: usize> {
    /// Absorption coefficient \[1/L\].
    pub sigma_a: Spectrum<N>,
    /// Scattering coefficient \[1/L\].
    pub sigma_s: Spectrum<N>,
    /// Emitted radiance L_e; the source per length is sigma_a L_e.
    pub emission: Spectrum<N>,
}

impl<const N: usize> Coefficients<N> {
    /// Returns the extinction coefficient \[1/L\].
    #[inline]
    pub fn sigma_t(&self) -> Spectrum<N> {
        self.sigma_a + self.sigma_s
    }

    /// Returns the single-scattering albedo; 0 where nothing interacts.
    #[inline]
    pub fn alpha(&self) -> Spectrum<N> {
        self.sigma_s.safe_div(self.sigma_t())
    }
}

impl Homogeneous {
    /// Returns a medium of absorption and scattering coefficients \[1/L\], asymmetry g, and emission (radiance; the source per length is
    /// sigma_a times it, as in pbrt-v4).
    ///
    /// *Errors*: g outside (-1, 1), a coefficient or emission that is negative or not finite.
    pub fn new(sigma_a: Spectra, sigma_s: Spectra, g: f32, emission: Spectra) -> Result<Self, Error> {
        for (name, s) in [("sigma_a", &sigma_a), ("sigma_s", &sigma_s), ("emission", &emission)] {
            check(name, s)?;
        }
        Ok(Self { sigma_a, sigma_s, emission, phase: HenyeyGreenstein::new(g)? })
    }

    /// Returns a medium without emission.
    ///
    /// *Errors*: as [`Homogeneous::new`].
    pub fn scattering(sigma_a: Spectra, sigma_s: Spectra, g: f32) -> Result<Self, Error> {
        Self::new(sigma_a, sigma_s, g, Spectra::Constant(0.0))
    }

    /// Returns the medium with both coefficients times a factor (pbrt's `scale`); emission is not scaled.
    ///
    /// *Errors*: a factor that is negative or not finite.
    pub fn scaled(&self, factor: f32) -> Result<Self, Error> {
        within("scale", factor, factor >= 0.0 && factor.is_finite(), "[0, inf)")?;
        Self::new(self.sigma_a.scaled(factor), self.sigma_s.scaled(factor), self.phase.g(), self.emission.clone())
    }

    /// Returns the absorption coefficient \[1/L\].
    pub fn sigma_a(&self) -> &Spectra {
        &self.sigma_a
    }

    /// Returns the scattering coefficient \[1/L\].
    pub fn sigma_s(&self) -> &Spectra {
        &self.sigma_s
    }

    /// Returns the emitted radiance.
    pub fn emission(&self) -> &Spectra {
        &self.emission
    }

    /// Returns whether the medium emits.
    pub fn is_emissive(&self) -> bool {
        !self.emission.is_black() && !self.sigma_a.is_black()
    }

    /// Returns the phase function.
    pub fn phase(&self) -> HenyeyGreenstein {
        self.phase
    }

    /// Returns the asymmetry g.
    pub fn g(&self) -> f32 {
        self.phase.g()
    }

    /// Returns the coefficients in the lanes of a path.
    pub fn at<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> Coefficients<N> {
        Coefficients {
            sigma_a: self.sigma_a.sample(wavelengths),
            sigma_s: self.sigma_s.sample(wavelengths),
            emission: self.emission.sample(wavelengths),
        }
    }
}

/// Checks what the constructors of `Spectra` do not: constants, and factors applied later.
fn check(name: &'static str, s: &Spectra) -> Result<(), Error> {
    let ends = s.rgb().into_iter().chain([s.max_value()]);
    for x in ends {
        within(name, x, x >= 0.0 && x.is_finite(), "[0, inf)")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::WavelengthMode;

    #[test]
    fn errors_name_the_quantity_its_value_and_its_range() {
        let one = || Spectra::Constant(1.0);
        assert_eq!(Homogeneous::scattering(one(), one(), 1.2).unwrap_err().to_string(), "g = 1.2 is outside (-1, 1)");
        let e = Homogeneous::scattering(Spectra::Constant(-0.5), one(), 0.0).unwrap_err();
        assert_eq!(e.to_string(), "sigma_a = -0.5 is outside [0, inf)");
        let e = Homogeneous::scattering(one(), Spectra::Constant(f32::NAN), 0.0).unwrap_err();
        assert_eq!(e.to_string(), "sigma_s = NaN is outside [0, inf)");
        assert!(Homogeneous::scattering(one(), one(), 0.0).unwrap().scaled(-1.0).is_err());
    }

    #[test]
    fn coefficients_come_back_in_rgb_and_scale() {
        let (a, s) = ([0.0011, 0.0024, 0.014], [2.55, 3.21, 3.77]);
        let m = Homogeneous::scattering(Spectra::rgb_unbounded(a).unwrap(), Spectra::rgb_unbounded(s).unwrap(), 0.3)
            .unwrap();
        let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, 0.1);
        let c = m.scaled(10.0).unwrap().at(&w);
        assert_eq!((c.sigma_a.0, c.sigma_s.0), (a.map(|x| x * 10.0), s.map(|x| x * 10.0)));
        assert!((c.alpha()[0] - 2.55 / 2.5511).abs() < 1e-6 && !m.is_emissive());
    }
}
