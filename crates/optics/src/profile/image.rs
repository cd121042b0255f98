//! A point source below the surface and its negative image above: the block that every dipole is made of.
//!
//! Source of unit power at depth $z_r > 0$, image at signed depth $z_v < 0$, $d_{r,v} = \sqrt{r^2 + z_{r,v}^2}$:
//!
//! $$ \phi = \frac{1}{4\pi D}\left[\frac{e^{-\kappa d_r}}{d_r} - \frac{e^{-\kappa d_v}}{d_v}\right], \qquad
//!    E = \frac{1}{4\pi}\left[\frac{z_r (1 + \kappa d_r) e^{-\kappa d_r}}{d_r^3} - \frac{z_v (1 + \kappa d_v) e^{-\kappa d_v}}{d_v^3}\right] $$
//!
//! at the surface, E outwards. The exitance is $C_\phi \phi + C_E E$ ([`crate::boundary`]).

use std::f64::consts::PI;

use moonmilk_core::Real;

use crate::boundary::Boundary;

/// Returns e^(-kappa d) / (4 pi D d), the fluence at distance d of a unit source in an infinite medium \[1/L^2\].
#[inline]
pub fn monopole_fluence<T: Real>(d: T, diffusion: T, kappa: T) -> T {
    (-(kappa * d)).exp() / (diffusion * d).scale(4.0 * PI)
}

/// Returns z (1 + kappa d) e^(-kappa d) / (4 pi d^3), the flux of a unit source at depth z through the plane z = 0, at distance d \[1/L^2\].
#[inline]
pub fn monopole_flux<T: Real>(z: T, d: T, kappa: T) -> T {
    let kd = kappa * d;
    z * kd.offset(1.0) * (-kd).exp() / (d * d * d).scale(4.0 * PI)
}

/// Returns the exitance of source and image at radius r \[1/L^2\].
#[inline]
pub fn image_pair<T: Real>(r: T, z_r: T, z_v: T, diffusion: T, kappa: T, boundary: &Boundary<T>) -> T {
    let (d_r, d_v) = ((r * r + z_r * z_r).sqrt(), (r * r + z_v * z_v).sqrt());
    let phi = monopole_fluence(d_r, diffusion, kappa) - monopole_fluence(d_v, diffusion, kappa);
    let flux = monopole_flux(z_r, d_r, kappa) - monopole_flux(z_v, d_v, kappa);
    boundary.exitance(phi, flux)
}

/// Returns the integral of [`image_pair`] over the surface.
///
/// C_phi (e^(-kappa z_r) - e^(-kappa |z_v|)) / (2 D kappa) + C_E (e^(-kappa z_r) + e^(-kappa |z_v|)) / 2; kappa = 0 is a valid limit.
#[inline]
pub fn image_pair_total<T: Real>(z_r: T, z_v: T, diffusion: T, kappa: T, boundary: &Boundary<T>) -> T {
    let span = -z_v - z_r;
    let near = (-(kappa * z_r)).exp();
    // (1 - e^(-x)) / x of x = kappa (|z_v| - z_r), without cancellation.
    let x = kappa * span;
    let phi = near * span * one_minus_exp_over(x) / diffusion.scale(2.0);
    boundary.exitance(phi, (near + (kappa * z_v).exp()).scale(0.5))
}

/// Returns (1 - e^(-x)) / x, 1 at x = 0.
pub(crate) fn one_minus_exp_over<T: Real>(x: T) -> T {
    let v = x.value();
    if v.abs() < 1e-5 {
        // Three terms of the series; the next is below 1e-16.
        return (x * (x.scale(1.0 / 6.0) - T::from_f64(0.5))).offset(1.0);
    }
    let value = -(-v).exp_m1() / v;
    x.lift(value, ((-v).exp() - value) / v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::table::radial_rule;

    #[test]
    fn the_area_integral_has_its_closed_form() {
        let b = Boundary::exact(1.33);
        for (z_r, z_v, d, kappa) in [(1.0, -3.0, 1.0 / 3.0, 0.5), (0.1, -0.9, 0.2, 1.7), (2.0, -2.5, 0.4, 0.05)] {
            let sum = radial_rule(1e-5, 400.0 / kappa, 16)
                .integrate(|r| 2.0 * PI * r * image_pair(r, z_r, z_v, d, kappa, &b));
            let exact = image_pair_total(z_r, z_v, d, kappa, &b);
            assert!((sum / exact - 1.0).abs() < 1e-8, "{sum} {exact}");
        }
        // kappa -> 0: C_phi (|z_v| - z_r) / (2 D) + C_E.
        let exact = b.c_phi() * 2.0 / (2.0 * 0.25) + b.c_e();
        assert!((image_pair_total(1.0, -3.0, 0.25, 0.0, &b) - exact).abs() < 1e-15);
        assert!((image_pair_total(1.0, -3.0, 0.25, 1e-6, &b) - exact).abs() < 1e-5);
        // A source at the depth of its own extrapolated image: everything leaves when nothing absorbs.
        let z = b.extrapolation(0.3);
        assert!((image_pair_total(0.7, -0.7 - 2.0 * z, 0.3, 0.0, &b) - 1.0).abs() < 1e-14);
    }
}
