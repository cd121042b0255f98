//! Coefficients of a homogeneous medium at the wavelengths of one walk.

use moonmilk_core::{Random, Spectrum, Vec3};

use crate::phase::{HenyeyGreenstein, PhaseFunction};

/// A homogeneous medium at N wavelengths; coefficients in [1/length], validated by whoever makes it.
///
/// P is the law of scattering; the default is that of Henyey and Greenstein.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium<const N: usize, P = HenyeyGreenstein> {
    /// Absorption coefficient.
    pub sigma_a: Spectrum<N>,
    /// Scattering coefficient.
    pub sigma_s: Spectrum<N>,
    /// Extinction coefficient, sigma_a + sigma_s.
    pub sigma_t: Spectrum<N>,
    /// Where collisions send light.
    pub law: P,
    /// Asymmetry: the mean cosine of the law, in (-1, 1).
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
        Self::with_law(sigma_a, sigma_s, HenyeyGreenstein { g })
    }

    /// Returns the medium of isotropic scatterers that is similar in the first order: sigma_s' = (1 - g) sigma_s, the rest as it is \[Wyman1989\].
    ///
    /// *Errors*: none of the diffusion equation; near surfaces and for single scattering the size of g.
    pub fn similar(&self) -> Self {
        Self::new(self.sigma_a, self.sigma_s * (1.0 - self.g), 0.0).with_emission(self.emission)
    }
}

impl<const N: usize, P: PhaseFunction> Medium<N, P> {
    /// Returns a medium from its coefficients [1/length] and its law of scattering.
    ///
    /// *Domain*: coefficients >= 0 and finite.
    pub fn with_law(sigma_a: Spectrum<N>, sigma_s: Spectrum<N>, law: P) -> Self {
        let sigma_t = sigma_a + sigma_s;
        let g = law.mean_cosine();
        Self { sigma_a, sigma_s, sigma_t, law, g, emission: None, gray: sigma_a.is_gray() && sigma_s.is_gray() }
    }

    /// Returns the same medium under another law of scattering.
    pub fn under<Q: PhaseFunction>(&self, law: Q) -> Medium<N, Q> {
        Medium::with_law(self.sigma_a, self.sigma_s, law).with_emission(self.emission)
    }

    /// Returns the same medium with emission.
    pub fn with_emission(mut self, emission: Option<Spectrum<N>>) -> Self {
        self.emission = emission;
        self
    }

    /// Returns the phase function [1/sr] for light that flew along `from` and leaves along `to` (both directions of flight).
    #[inline]
    pub fn phase(&self, from: Vec3, to: Vec3) -> f32 {
        self.law.eval(from.dot(to))
    }

    /// Returns a direction of flight drawn from the phase function.
    #[inline]
    pub fn scatter(&self, d: Vec3, rng: &mut impl Random) -> Vec3 {
        self.law.scatter(d, rng)
    }
}

impl<const N: usize, P> Medium<N, P> {
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
}
