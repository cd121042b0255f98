//! Optical properties of a medium at one wavelength, and what follows from them.
//!
//! | quantity | formula | dimension |
//! |---|---|---|
//! | extinction | $\sigma_t = \sigma_a + \sigma_s$ | 1/L |
//! | single-scattering albedo | $\alpha = \sigma_s / \sigma_t$ | 1 |
//! | reduced coefficients (similarity of order 1) | $\sigma_s' = \sigma_s (1 - g)$, $\sigma_t' = \sigma_a + \sigma_s'$ | 1/L |
//! | reduced albedo | $\alpha' = \sigma_s' / \sigma_t'$ | 1 |
//! | diffusion coefficient, classical | $D = 1 / (3 \sigma_t')$ | L |
//! | diffusion coefficient, Grosjean | $D_G = (2 \sigma_a + \sigma_s') / (3 \sigma_t'^2)$ | L |
//! | effective transport coefficient | $\kappa = \sqrt{\sigma_a / D}$ | 1/L |
//!
//! Grosjean's D keeps the total fluence right when the first collision is taken out of the diffusive term ([`crate::point_source`]).

use moonmilk_core::{Dual, Real};

use crate::error::{Error, within};

/// Absorption and scattering coefficient \[1/L\], asymmetry g, and relative index eta = inside / outside, at one wavelength.
///
/// Over [`Dual`] numbers every derived quantity carries its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpticalProperties<T = f64> {
    sigma_a: T,
    sigma_s: T,
    g: T,
    eta: T,
}

/// Number of variables of [`OpticalProperties::variables`]: radius, sigma_a, sigma_s, g, eta.
pub const VARIABLES: usize = 5;

impl OpticalProperties<f64> {
    /// Returns the properties.
    ///
    /// *Errors*: a coefficient that is negative or not finite, both of them 0, g outside (-1, 1), eta outside (0, inf).
    pub fn new(sigma_a: f64, sigma_s: f64, g: f64, eta: f64) -> Result<Self, Error> {
        let valid = |x: f64| x >= 0.0 && x.is_finite();
        within("sigma_a", sigma_a as f32, valid(sigma_a), "[0, inf)")?;
        within("sigma_s", sigma_s as f32, valid(sigma_s), "[0, inf)")?;
        within("sigma_t", (sigma_a + sigma_s) as f32, sigma_a + sigma_s > 0.0, "(0, inf)")?;
        within("g", g as f32, g.abs() < 1.0, "(-1, 1)")?;
        within("eta", eta as f32, eta > 0.0 && eta.is_finite(), "(0, inf)")?;
        Ok(Self { sigma_a, sigma_s, g, eta })
    }

    /// Returns the properties of a medium with extinction `sigma_t` and single-scattering albedo `alpha`.
    ///
    /// *Errors*: alpha outside \[0, 1\], and as [`OpticalProperties::new`].
    pub fn from_albedo(sigma_t: f64, alpha: f64, g: f64, eta: f64) -> Result<Self, Error> {
        within("alpha", alpha as f32, (0.0..=1.0).contains(&alpha), "[0, 1]")?;
        Self::new((1.0 - alpha) * sigma_t, alpha * sigma_t, g, eta)
    }

    /// Returns the same properties as variables number 1 to 4 (sigma_a, sigma_s, g, eta); number 0 is left for the radius.
    ///
    /// Diffusion has roots of sigma_a, whose slope is infinite at 0 although that of their result is not: there the derivative is taken at
    /// 1e-10 sigma_s instead.
    pub fn variables(&self) -> OpticalProperties<Dual<VARIABLES>> {
        let sigma_a = self.sigma_a.max(1e-10 * self.sigma_s);
        OpticalProperties {
            sigma_a: Dual::variable(sigma_a, 1),
            sigma_s: Dual::variable(self.sigma_s, 2),
            g: Dual::variable(self.g, 3),
            eta: Dual::variable(self.eta, 4),
        }
    }

    /// Returns the isotropically scattering medium that is equivalent by similarity of order 1: sigma_a, sigma_s', g = 0.
    pub fn reduced(&self) -> Self {
        Self { sigma_s: self.sigma_s_prime(), g: 0.0, ..*self }
    }
}

impl<T: Real> OpticalProperties<T> {
    /// Returns the absorption coefficient \[1/L\].
    pub fn sigma_a(&self) -> T {
        self.sigma_a
    }

    /// Returns the scattering coefficient \[1/L\].
    pub fn sigma_s(&self) -> T {
        self.sigma_s
    }

    /// Returns the asymmetry, the mean cosine of the deflection.
    pub fn g(&self) -> T {
        self.g
    }

    /// Returns the relative index, inside / outside.
    pub fn eta(&self) -> T {
        self.eta
    }

    /// Returns the extinction coefficient \[1/L\].
    pub fn sigma_t(&self) -> T {
        self.sigma_a + self.sigma_s
    }

    /// Returns the single-scattering albedo.
    pub fn alpha(&self) -> T {
        self.sigma_s / self.sigma_t()
    }

    /// Returns the reduced scattering coefficient \[1/L\].
    pub fn sigma_s_prime(&self) -> T {
        self.sigma_s * (-self.g).offset(1.0)
    }

    /// Returns the reduced extinction coefficient \[1/L\].
    pub fn sigma_t_prime(&self) -> T {
        self.sigma_a + self.sigma_s_prime()
    }

    /// Returns the reduced single-scattering albedo.
    pub fn alpha_prime(&self) -> T {
        self.sigma_s_prime() / self.sigma_t_prime()
    }

    /// Returns the classical diffusion coefficient \[L\].
    pub fn diffusion(&self) -> T {
        self.sigma_t_prime().scale(3.0).recip()
    }

    /// Returns Grosjean's diffusion coefficient \[L\].
    pub fn diffusion_grosjean(&self) -> T {
        (self.sigma_a.scale(2.0) + self.sigma_s_prime()) / self.sigma_t_prime().squared().scale(3.0)
    }

    /// Returns the classical effective transport coefficient sqrt(3 sigma_a sigma_t') \[1/L\], the inverse diffuse mean free path.
    pub fn sigma_tr(&self) -> T {
        (self.sigma_a / self.diffusion()).sqrt()
    }

    /// Returns the effective transport coefficient of Grosjean's diffusion coefficient \[1/L\].
    pub fn sigma_tr_grosjean(&self) -> T {
        (self.sigma_a / self.diffusion_grosjean()).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_properties_are_named_with_value_and_range() {
        let message = |r: Result<OpticalProperties, Error>| r.unwrap_err().to_string();
        assert_eq!(message(OpticalProperties::new(-1.0, 1.0, 0.0, 1.0)), "sigma_a = -1 is outside [0, inf)");
        assert_eq!(message(OpticalProperties::new(0.0, f64::NAN, 0.0, 1.0)), "sigma_s = NaN is outside [0, inf)");
        assert_eq!(message(OpticalProperties::new(0.0, 0.0, 0.0, 1.0)), "sigma_t = 0 is outside (0, inf)");
        assert_eq!(message(OpticalProperties::new(0.1, 1.0, 1.0, 1.0)), "g = 1 is outside (-1, 1)");
        assert_eq!(message(OpticalProperties::new(0.1, 1.0, 0.0, 0.0)), "eta = 0 is outside (0, inf)");
        assert_eq!(message(OpticalProperties::from_albedo(1.0, 1.5, 0.0, 1.0)), "alpha = 1.5 is outside [0, 1]");
    }

    #[test]
    fn reduced_quantities_follow_their_definitions() {
        let m = OpticalProperties::new(0.2, 3.0, 0.6, 1.4).unwrap();
        let (s, t) = (1.2, 1.4);
        assert!((m.sigma_s_prime() - s).abs() < 1e-15 && (m.sigma_t_prime() - t).abs() < 1e-15);
        assert!((m.sigma_tr() - (3.0 * 0.2 * t).sqrt()).abs() < 1e-15);
        let a = s / t;
        assert!((m.sigma_tr_grosjean() - t * (3.0 * (1.0 - a) / (2.0 - a)).sqrt()).abs() < 1e-15);
        assert!((m.reduced().alpha() - a).abs() < 1e-15 && (m.variables().alpha_prime().value - a).abs() < 1e-15);
    }
}
