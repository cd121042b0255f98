//! The diffusive boundary: how a diffuse field is kept in and let out by a refractive surface.
//!
//! With the moments of the internal reflectance, $2C_1 = 2\int F \mu\, d\mu$ and $3C_2 = 3\int F \mu^2 d\mu$ ([`crate::fresnel`]), a radiance that
//! is linear in the cosine, $L = (\phi + 3\, \omega \cdot \mathbf E) / 4\pi$, meets three facts at the surface (z = 0, z growing inwards):
//!
//! - partial current (Robin): $\phi - 2 A D\, \partial_z \phi = 0$, with $A = (1 + 3C_2) / (1 - 2C_1)$;
//! - extrapolation: the fluence would vanish at $z = -z_e$, $z_e = 2 A D$. Transport gives .7104 / sigma_t' where P1 gives 2/3 (conservative, matched);
//! - exitance: $M = C_\phi\, \phi + C_E\, \mathbf E \cdot \mathbf n$, with $C_\phi = (1 - 2C_1)/4$ and $C_E = (1 - 3C_2)/2$.
//!
//! Where the Robin condition holds exactly, the exitance is the flux: $2 A C_\phi + C_E = 1$. A dipole obeys it approximately, so that the two
//! forms of exitance differ. *Source*: \[DEon2011\], \[Haskell1994\].

use moonmilk_core::Real;

use crate::fresnel::{moment_1, moment_2};

/// The two moments of the internal reflectance of a boundary, and all that follows from them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary<T = f64> {
    /// 2 C1: reflectance for Lambertian light from inside.
    pub two_c1: T,
    /// 3 C2: its flux-weighted analogue.
    pub three_c2: T,
}

impl<T: Real> Boundary<T> {
    /// Returns the boundary of relative index `eta` = inside / outside > 0, by quadrature of Fresnel's formula.
    ///
    /// *Accuracy*: 1e-11; its derivative by eta is a difference, good to 1e-6. At eta = 1, where the moments have a kink, it is that of eta > 1.
    pub fn exact(eta: T) -> Self {
        let n = eta.value();
        let lifted = |f: fn(f64) -> f64| {
            if !T::CARRIES_DERIVATIVES {
                return T::from_f64(f(n));
            }
            if n == 1.0 {
                let h = 1e-5;
                return eta.lift(0.0, f(1.0 + h) / h);
            }
            // Stay on one side of the kink.
            let h = 1e-4 * n.min((n - 1.0).abs());
            eta.lift(f(n), (f(n + h) - f(n - h)) / (2.0 * h))
        };
        Self { two_c1: lifted(moment_1).scale(2.0), three_c2: lifted(moment_2).scale(3.0) }
    }

    /// Returns C_phi, the share of the fluence in the exitance.
    pub fn c_phi(&self) -> T {
        (-self.two_c1).offset(1.0).scale(0.25)
    }

    /// Returns C_E, the share of the outward flux in the exitance.
    pub fn c_e(&self) -> T {
        (-self.three_c2).offset(1.0).scale(0.5)
    }

    /// Returns A, the factor of the Robin condition.
    pub fn a(&self) -> T {
        self.three_c2.offset(1.0) / (-self.two_c1).offset(1.0)
    }

    /// Returns the extrapolation distance 2 A D \[L\].
    pub fn extrapolation(&self, diffusion: T) -> T {
        (self.a() * diffusion).scale(2.0)
    }

    /// Returns the effective reflectance (2 C1 + 3 C2) / (2 - 2 C1 + 3 C2); A = (1 + R_eff) / (1 - R_eff). *Source*: \[Haskell1994\].
    pub fn r_eff(&self) -> T {
        (self.two_c1 + self.three_c2) / (self.three_c2 - self.two_c1).offset(2.0)
    }

    /// Returns the exitance of fluence `phi` and outward flux `e_n` at the surface.
    pub fn exitance(&self, phi: T, e_n: T) -> T {
        self.c_phi() * phi + self.c_e() * e_n
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::Dual;

    #[test]
    fn factors_agree_with_the_reference_table() {
        // (eta, A, C_phi, C_E, R_eff): physics notes, 2.2.
        for (eta, a, c_phi, c_e, r_eff) in [
            (0.5, 1.35092, 0.209851, 0.433017, 0.1493),
            (1.0, 1.0, 0.25, 0.5, 0.0),
            (1.33, 2.51536, 0.132013, 0.335881, 0.4311),
            (1.5, 3.62793, 0.100914, 0.267785, 0.5678),
            (3.0, 23.41012, 0.020105, 0.058657, 0.9181),
        ] {
            let b = Boundary::<f64>::exact(eta);
            // Rounding of the printed digits.
            assert!((b.a() - a).abs() < 6e-6 && (b.c_phi() - c_phi).abs() < 6e-7, "{eta} {} {}", b.a(), b.c_phi());
            assert!((b.c_e() - c_e).abs() < 6e-7 && (b.r_eff() - r_eff).abs() < 6e-5, "{eta}");
            assert!(((1.0 + b.r_eff()) / (1.0 - b.r_eff()) - b.a()).abs() < 1e-12);
            // The Robin condition makes the exitance the flux.
            assert!((b.exitance(2.0 * b.a(), 1.0) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_derivative_by_the_index_is_that_of_the_table() {
        for eta in [0.7, 1.05, 1.33, 2.0] {
            let d = Boundary::exact(Dual::<1>::variable(eta, 0)).a().partials[0];
            let h = 1e-3 * (eta - 1.0f64).abs();
            let difference = (Boundary::exact(eta + h).a() - Boundary::exact(eta - h).a()) / (2.0 * h);
            // Central differences: h^2 of a function that varies on the scale of eta - 1.
            assert!((d / difference - 1.0).abs() < 1e-5, "{eta} {d} {difference}");
        }
    }
}
