//! Bodies under uniform diffuse light from outside, as diffusion sees them: half-space and ball, in closed form.
//!
//! Let unit power enter per unit of surface. The light that travels inwards just inside is what entered and what the boundary reflects back:
//!
//! $$ \tfrac14 \phi - \tfrac12 E_n = 1 + \tfrac12 C_1 \phi + \tfrac32 C_2 E_n \quad\Rightarrow\quad \phi - 2 A E_n = \frac{1}{C_\phi}, $$
//!
//! with the outward flux $E_n = \mathbf E \cdot \mathbf n$. Inside, $D \nabla^2 \phi = \sigma_a \phi$ leaves one constant:
//!
//! | body | fluence | outward flux |
//! |---|---|---|
//! | half-space | $c\, e^{-\kappa z}$ | $-D \kappa\, \phi$ |
//! | ball | $c \sinh(\kappa r) / (\kappa r)$ | $-D\, \partial_r \phi$ |
//!
//! Without absorption the fluence is $1 / C_\phi$ everywhere, which is exact: the white furnace.

use moonmilk_core::DVec3;

use super::Field;
use crate::boundary::Boundary;
use crate::error::{Error, within};
use crate::properties::OpticalProperties;

/// A body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// A half-space.
    HalfSpace,
    /// A ball of a radius \[L\].
    Ball {
        /// The radius.
        radius: f64,
    },
}

/// Returns the field of diffusion at a depth below the surface \[L\]; unit power enters per unit of surface, z is the outward normal.
///
/// *Errors*: a depth below 0 or beyond the centre of the ball, a radius that is not positive.
pub fn diffusion(medium: &OpticalProperties, body: Body, depth: f64) -> Result<Field, Error> {
    let (d, kappa) = (medium.diffusion(), medium.sigma_tr());
    let boundary = Boundary::exact(medium.eta());
    let entered = 1.0 / boundary.c_phi();
    let along = |phi: f64, outward: f64| Field { phi, flux: DVec3::new(0.0, 0.0, outward) };
    match body {
        Body::HalfSpace => {
            within("depth", depth as f32, depth >= 0.0 && depth.is_finite(), "[0, inf)")?;
            let phi = entered / (1.0 + 2.0 * boundary.a() * d * kappa) * (-kappa * depth).exp();
            Ok(along(phi, -d * kappa * phi))
        }
        Body::Ball { radius } => {
            within("radius", radius as f32, radius > 0.0 && radius.is_finite(), "(0, inf)")?;
            within("depth", depth as f32, (0.0..=radius).contains(&depth), "[0, radius]")?;
            let ((s, slope), (s_wall, slope_wall)) =
                (shape(kappa, radius - depth, radius), shape(kappa, radius, radius));
            let c = entered / (s_wall + 2.0 * boundary.a() * d * slope_wall);
            Ok(along(c * s, -d * c * slope))
        }
    }
}

/// Returns sinh(kappa r) / (kappa r) and its derivative by r, both times exp(-kappa R) so that large balls do not overflow.
fn shape(kappa: f64, r: f64, radius: f64) -> (f64, f64) {
    let x = kappa * r;
    if x < 0.05 {
        // Series to x^5; the next terms are below 1e-11.
        let x2 = x * x;
        let scale = (-kappa * radius).exp();
        let value = 1.0 + x2 / 6.0 * (1.0 + x2 / 20.0 * (1.0 + x2 / 42.0));
        let slope = kappa * x / 3.0 * (1.0 + x2 / 10.0 * (1.0 + x2 / 28.0));
        return (value * scale, slope * scale);
    }
    let (up, down) = ((x - kappa * radius).exp(), (-x - kappa * radius).exp());
    let (sinh, cosh) = (0.5 * (up - down), 0.5 * (up + down));
    (sinh / x, (x * cosh - sinh) / (x * r))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fields_obey_the_diffusion_equation_and_the_boundary() {
        for eta in [1.0, 1.4] {
            let m = OpticalProperties::new(0.2, 3.0, 0.4, eta).unwrap();
            let b = Boundary::exact(eta);
            for body in [Body::HalfSpace, Body::Ball { radius: 1.5 }] {
                let at = |depth: f64| diffusion(&m, body, depth).unwrap();
                let wall = at(0.0);
                assert!((b.c_phi() * (wall.phi - 2.0 * b.a() * wall.flux.z) - 1.0).abs() < 1e-12);
                // Balance: div E = -sigma_a phi; in the ball div E = E' + 2 E / r. Differences of step 1e-4: 1e-7.
                let (x, h) = (0.6, 1e-4);
                let (up, down) = (at(x - h), at(x + h));
                let spread = if let Body::Ball { radius } = body { 2.0 * at(x).flux.z / (radius - x) } else { 0.0 };
                let divergence = (up.flux.z - down.flux.z) / (2.0 * h) + spread;
                assert!((divergence / (-m.sigma_a() * at(x).phi) - 1.0).abs() < 1e-6, "{body:?}");
                let gradient = (up.phi - down.phi) / (2.0 * h);
                assert!((-m.diffusion() * gradient / at(x).flux.z - 1.0).abs() < 1e-6, "{body:?}");
            }
        }
    }

    #[test]
    fn light_fills_what_does_not_absorb_and_large_balls_are_half_spaces() {
        let white = OpticalProperties::new(0.0, 2.0, 0.0, 1.5).unwrap();
        let furnace = 1.0 / Boundary::exact(1.5).c_phi();
        for body in [Body::HalfSpace, Body::Ball { radius: 3.0 }] {
            let f = diffusion(&white, body, 2.0).unwrap();
            assert!((f.phi / furnace - 1.0).abs() < 1e-12 && f.flux.length() < 1e-12);
        }
        let m = OpticalProperties::new(0.5, 2.0, 0.0, 1.3).unwrap();
        let (ball, plane) = (Body::Ball { radius: 1e5 }, Body::HalfSpace);
        for depth in [0.0, 1.0, 5.0] {
            let (a, b) = (diffusion(&m, ball, depth).unwrap(), diffusion(&m, plane, depth).unwrap());
            // Curvature: one mean free path in 1e5.
            assert!((a.phi / b.phi - 1.0).abs() < 1e-4 && (a.flux.z / b.flux.z - 1.0).abs() < 1e-4, "{depth}");
        }
        // Both forms of the shape meet where they change.
        let (a, b) = (shape(1.0, 0.04999999, 1.0), shape(1.0, 0.05000001, 1.0));
        assert!((a.0 / b.0 - 1.0).abs() < 1e-8 && (a.1 / b.1 - 1.0).abs() < 1e-6);
        assert!(diffusion(&m, Body::Ball { radius: 1.0 }, 1.1).is_err() && diffusion(&m, plane, -0.1).is_err());
    }
}
