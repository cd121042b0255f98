//! The P1 relations: radiance as fluence and flux, and the diffusion equation that follows.
//!
//! **Closure.** Keep the first two moments of the radiance, the fluence $\phi = \int L\, d\omega$ and the flux (vector irradiance) $\mathbf E = \int \omega L\, d\omega$:
//!
//! $$ L(\omega) = \frac{\phi + 3\, \omega \cdot \mathbf E}{4\pi} $$
//!
//! **Balance.** Moments 0 and 1 of the transport equation, with the source's moments $Q_0 = \int L_e\, d\omega$ and $Q_1 = \int \omega L_e\, d\omega$:
//!
//! $$ \nabla \cdot \mathbf E = -\sigma_a \phi + Q_0, \qquad \tfrac13 \nabla \phi = -\sigma_t' \mathbf E + \mathbf Q_1 $$
//!
//! (the lecture has sigma_t in the second, since its phase function is isotropic).
//!
//! **Diffusion.** Without E:
//!
//! $$ D \nabla^2 \phi - \sigma_a \phi = -Q_0 + 3 D\, \nabla \cdot \mathbf Q_1, \qquad \mathbf E = -D \nabla \phi + 3 D\, \mathbf Q_1, \qquad D = \frac{1}{3\sigma_t'} , $$
//!
//! a screened Poisson equation; without absorption the Poisson equation of the equilibrium of heat.
//!
//! **Surface.** What leaves through a boundary is $\int (1 - F) L \cos\theta\, d\omega = C_\phi \phi + C_E\, \mathbf E \cdot \mathbf n$ ([`Boundary::exitance`]).

pub mod lit;

use std::f64::consts::PI;

use moonmilk_core::DVec3;

use crate::boundary::Boundary;
use crate::properties::OpticalProperties;

/// Fluence and flux at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Fluence \[W/L^2\].
    pub phi: f64,
    /// Flux \[W/L^2\].
    pub flux: DVec3,
}

impl Field {
    /// Returns the field of a fluence, its gradient, and the first moment of the source there: E = -D grad phi + 3 D Q_1.
    pub fn from_gradient(medium: &OpticalProperties, phi: f64, gradient: DVec3, q1: DVec3) -> Self {
        let d = medium.diffusion();
        Self { phi, flux: -d * gradient + 3.0 * d * q1 }
    }

    /// Returns the field of a unit point source at `offset` from it: classical monopole fluence, flux (1 + kappa r) e^(-kappa r) / (4 pi r^2) outwards.
    ///
    /// *Domain*: a non-zero offset.
    pub fn monopole(medium: &OpticalProperties, offset: DVec3) -> Self {
        let (r, kappa) = (offset.length(), medium.sigma_tr());
        let phi = (-kappa * r).exp() / (4.0 * PI * medium.diffusion() * r);
        Self { phi, flux: offset * ((1.0 + kappa * r) * (-kappa * r).exp() / (4.0 * PI * r * r * r)) }
    }

    /// Returns the radiance rebuilt from the two moments; it is negative where |E| > phi / 3, outside the domain of P1.
    pub fn radiance(&self, direction: DVec3) -> f64 {
        (self.phi + 3.0 * direction.dot(self.flux)) / (4.0 * PI)
    }

    /// Returns whether the rebuilt radiance is positive in all directions.
    pub fn is_valid(&self) -> bool {
        3.0 * self.flux.length() <= self.phi
    }

    /// Returns the exitance through a boundary with outward normal n.
    pub fn exitance(&self, boundary: &Boundary, n: DVec3) -> f64 {
        boundary.exitance(self.phi, self.flux.dot(n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fresnel::reflectance_f64;
    use moonmilk_core::quadrature::Rule;

    fn medium() -> OpticalProperties {
        OpticalProperties::new(0.1, 1.4, 0.3, 1.4).unwrap()
    }

    /// Integrates over directions: Gauss in the cosine, equal steps in the azimuth.
    fn sphere(from: f64, mut f: impl FnMut(DVec3) -> f64) -> f64 {
        Rule::composite(24, &[from, 0.5 * (from + 1.0), 1.0]).integrate(|z| {
            let s = (1.0 - z * z).sqrt();
            (0..16)
                .map(|k| {
                    let (y, x) = (PI / 8.0 * f64::from(k)).sin_cos();
                    f(DVec3::new(s * x, s * y, z)) * PI / 8.0
                })
                .sum::<f64>()
        })
    }

    #[test]
    fn the_rebuilt_radiance_has_the_moments_it_was_built_from() {
        let field = Field { phi: 2.0, flux: DVec3::new(0.1, -0.3, 0.2) };
        assert!((sphere(-1.0, |w| field.radiance(w)) - 2.0).abs() < 1e-13);
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            assert!((sphere(-1.0, |w| field.radiance(w) * w.dot(axis)) - field.flux.dot(axis)).abs() < 1e-13);
        }
        assert!(field.is_valid() && !Field { phi: 1.0, flux: DVec3::X }.is_valid());
    }

    #[test]
    fn the_exitance_is_what_fresnel_lets_out_of_the_rebuilt_radiance() {
        let field = Field { phi: 2.0, flux: DVec3::new(0.1, -0.3, 0.2) };
        for eta in [0.8, 1.0, 1.4f64] {
            let critical = (1.0 - 1.0 / (eta * eta)).max(0.0).sqrt();
            let sum = sphere(critical, |w| field.radiance(w) * w.z * (1.0 - reflectance_f64(w.z, 1.0 / eta)));
            // 1 - F has a square root at the critical cosine: 24 points leave 1e-4.
            let exact = field.exitance(&Boundary::exact(eta), DVec3::Z);
            assert!((sum / exact - 1.0).abs() < 3e-4, "{eta} {sum} {exact}");
        }
    }

    #[test]
    fn the_monopole_obeys_both_balances_away_from_its_source() {
        let (m, x, h) = (medium(), DVec3::new(0.7, -0.4, 1.1), 1e-4);
        let at = |x| Field::monopole(&m, x);
        let difference = |f: &dyn Fn(DVec3) -> f64, axis: DVec3| (f(x + axis * h) - f(x - axis * h)) / (2.0 * h);
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let divergence: f64 = axes.iter().map(|&a| difference(&|y| at(y).flux.dot(a), a)).sum();
        // Central differences: h^2 of fields that vary on the scale 1.
        assert!((divergence + m.sigma_a() * at(x).phi).abs() < 1e-8);
        let gradient = DVec3::from_array(axes.map(|a| difference(&|y| at(y).phi, a)));
        let rebuilt = Field::from_gradient(&m, at(x).phi, gradient, DVec3::ZERO);
        assert!(rebuilt.flux.distance(at(x).flux) < 1e-8);
    }
}
