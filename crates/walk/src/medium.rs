//! Coefficients of a homogeneous medium at the wavelengths of one walk.

use std::f32::consts::FRAC_1_PI;

use moonmilk_core::{Random, Spectrum, Vec3};

use crate::math;

/// A homogeneous medium at N wavelengths; coefficients in [1/length], validated by whoever makes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium<const N: usize> {
    /// Absorption coefficient.
    pub sigma_a: Spectrum<N>,
    /// Scattering coefficient.
    pub sigma_s: Spectrum<N>,
    /// Extinction coefficient, sigma_a + sigma_s.
    pub sigma_t: Spectrum<N>,
    /// Asymmetry of the Henyey-Greenstein phase function, in (-1, 1).
    pub g: f32,
    /// Emitted radiance per unit length is sigma_a times this.
    pub emission: Option<Spectrum<N>>,
    gray: bool,
}

impl<const N: usize> Medium<N> {
    /// Returns a medium from its coefficients [1/length] and asymmetry.
    ///
    /// *Domain*: coefficients >= 0 and finite, |g| < 1; checked where a scene is built.
    pub fn new(sigma_a: Spectrum<N>, sigma_s: Spectrum<N>, g: f32) -> Self {
        let sigma_t = sigma_a + sigma_s;
        Self { sigma_a, sigma_s, sigma_t, g, emission: None, gray: sigma_a.is_gray() && sigma_s.is_gray() }
    }

    /// Returns the same medium with emission.
    pub fn with_emission(mut self, emission: Option<Spectrum<N>>) -> Self {
        self.emission = emission;
        self
    }

    /// Returns whether all lanes share their coefficients, so that no spectral weights arise.
    #[inline]
    pub fn is_gray(&self) -> bool {
        self.gray
    }

    /// Returns exp(-sigma_t t) per lane.
    #[inline]
    pub fn transmittance(&self, t: f32) -> Spectrum<N> {
        self.sigma_t.map(|s| if s == 0.0 { 1.0 } else { (-s * t).exp() })
    }

    /// Returns the phase function [1/sr] for light that flew along `from` and leaves along `to` (both directions of flight).
    ///
    /// p = (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2)), cos = from . to, forward = +1 \[Henyey1941\].
    #[inline]
    pub fn phase(&self, from: Vec3, to: Vec3) -> f32 {
        let g = self.g;
        if g == 0.0 {
            return 0.25 * FRAC_1_PI;
        }
        let q = (1.0 + g * g - 2.0 * g * from.dot(to)).max(0.0);
        0.25 * FRAC_1_PI * (1.0 - g * g) / (q * q.sqrt())
    }

    /// Returns a direction of flight drawn from the phase function.
    #[inline]
    pub fn scatter(&self, d: Vec3, rng: &mut impl Random) -> Vec3 {
        let u = rng.uniform2();
        if self.g == 0.0 {
            math::uniform_sphere(u)
        } else {
            math::deflect(d, math::henyey_greenstein_cosine(self.g, u[0]), u[1])
        }
    }
}
