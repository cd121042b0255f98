//! Laws of scattering, as the walk uses them: single precision, no validation, nothing virtual.

use std::f32::consts::FRAC_1_PI;

use moonmilk_core::{Random, Vec3};

use crate::math;

/// Where a collision sends light: a density over the cosine of the deflection, the same for every azimuth.
pub trait PhaseFunction {
    /// Returns the density [1/sr] at a cosine of the deflection, forward = +1.
    fn eval(&self, cosine: f32) -> f32;

    /// Returns the cosine of the deflection at which its cumulative distribution is u.
    fn cosine(&self, u: f32) -> f32;

    /// Returns the mean cosine of the deflection.
    fn mean_cosine(&self) -> f32;

    /// Returns whether all directions are alike.
    #[inline]
    fn is_isotropic(&self) -> bool {
        false
    }

    /// Returns a new direction of flight for light that flew along d; two variates, one call of `uniform2`.
    #[inline]
    fn scatter(&self, d: Vec3, rng: &mut impl Random) -> Vec3 {
        let u = rng.uniform2();
        math::deflect(d, self.cosine(u[0]), u[1])
    }
}

impl<P: PhaseFunction> PhaseFunction for &P {
    #[inline]
    fn eval(&self, cosine: f32) -> f32 {
        (*self).eval(cosine)
    }

    #[inline]
    fn cosine(&self, u: f32) -> f32 {
        (*self).cosine(u)
    }

    #[inline]
    fn mean_cosine(&self) -> f32 {
        (*self).mean_cosine()
    }

    #[inline]
    fn is_isotropic(&self) -> bool {
        (*self).is_isotropic()
    }

    #[inline]
    fn scatter(&self, d: Vec3, rng: &mut impl Random) -> Vec3 {
        (*self).scatter(d, rng)
    }
}

/// The law of Henyey and Greenstein.
///
/// p = (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2)) \[Henyey1941\]; g = 0 is isotropic scattering, for which directions
/// are drawn without reference to the old one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HenyeyGreenstein {
    /// Asymmetry, in (-1, 1).
    pub g: f32,
}

impl PhaseFunction for HenyeyGreenstein {
    #[inline]
    fn eval(&self, cosine: f32) -> f32 {
        let g = self.g;
        if g == 0.0 {
            return 0.25 * FRAC_1_PI;
        }
        let q = (1.0 + g * g - 2.0 * g * cosine).max(0.0);
        0.25 * FRAC_1_PI * (1.0 - g * g) / (q * q.sqrt())
    }

    #[inline]
    fn cosine(&self, u: f32) -> f32 {
        math::henyey_greenstein_cosine(self.g, u)
    }

    #[inline]
    fn mean_cosine(&self) -> f32 {
        self.g
    }

    #[inline]
    fn is_isotropic(&self) -> bool {
        self.g == 0.0
    }

    #[inline]
    fn scatter(&self, d: Vec3, rng: &mut impl Random) -> Vec3 {
        let u = rng.uniform2();
        if self.g == 0.0 { math::uniform_sphere(u) } else { math::deflect(d, self.cosine(u[0]), u[1]) }
    }
}

/// Isotropic scattering, known to the compiler.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Isotropic;

impl PhaseFunction for Isotropic {
    #[inline]
    fn eval(&self, _cosine: f32) -> f32 {
        0.25 * FRAC_1_PI
    }

    #[inline]
    fn cosine(&self, u: f32) -> f32 {
        2.0 * u - 1.0
    }

    #[inline]
    fn mean_cosine(&self) -> f32 {
        0.0
    }

    #[inline]
    fn is_isotropic(&self) -> bool {
        true
    }

    #[inline]
    fn scatter(&self, _d: Vec3, rng: &mut impl Random) -> Vec3 {
        math::uniform_sphere(rng.uniform2())
    }
}
