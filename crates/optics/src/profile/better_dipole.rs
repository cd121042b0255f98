//! The better dipole: Grosjean's diffusion coefficient, exact boundary, exitance from fluence and flux; exact single scattering beside it.
//!
//! $$ R(r) = \alpha'^2\; \mathrm{pair}\!\left(r;\ \ell,\ -\ell - 2 z_e,\ D_G,\ \kappa_G\right) + R_1(r), \qquad \ell = 1/\sigma_t',\quad z_e = 2 A D_G $$
//!
//! One alpha' is that of the first collision, the other comes from Grosjean's monopole: the pair describes what is scattered twice or more. Its albedo, with
//! $q = \sqrt{(1-\alpha')(2-\alpha')/3}$ and $x = e^{-4Aq}$:
//!
//! $$ \tfrac12 \alpha'^2\, e^{-\sqrt{3(1-\alpha')/(2-\alpha')}} \left[ C_E (1 + x) + \tfrac{C_\phi}{q} (1 - x) \right] $$
//!
//! **Energy.** As alpha' -> 1 the pair alone returns everything; with single scattering the albedo reaches 1.153 at eta 1, 1.072 at 1.33, 1.054 at 1.5 in the limit.
//! Public codes disagree: one evaluates the profile with the classical kappa and the albedo with kappa_G. *Source*: \[DEon2012\].

use moonmilk_core::Real;

use crate::boundary::Boundary;
use crate::error::Error;
use crate::properties::OpticalProperties;

use super::dipole::Pair;
use super::model::RadialModel;
use super::single::Single;
use super::{Info, Kind};

/// Description of the model.
pub const INFO: Info = Info {
    name: "better-dipole",
    summary: "dipole of Grosjean's diffusion with exact boundary, exact single scattering",
    source: "DEon2012",
    kind: Kind::Whole,
    valid: "albedo +3 to +18 %; R(r) within 23 % to 3 mean free paths at alpha >= .8 and eta >= 1.33, within 7 % at 10",
    use_when: "instead of the classic dipole, at about its cost",
    avoid_when: "where no energy may be gained: its albedo exceeds 1 as alpha tends to 1",
};

/// The better dipole of one medium.
#[derive(Clone, Copy, Debug)]
pub struct BetterDipole<T = f64> {
    multiple: Pair<T>,
    single: Single<T>,
}

impl<T: Real> BetterDipole<T> {
    /// Returns the part that is scattered twice or more \[1/L^2\].
    pub fn multiple(&self, r: T) -> T {
        self.multiple.eval(r)
    }
}

impl<T: Real> RadialModel<T> for BetterDipole<T> {
    fn new(medium: &OpticalProperties<T>) -> Result<Self, Error> {
        let boundary = Boundary::exact(medium.eta());
        let (z_r, diffusion) = (medium.sigma_t_prime().recip(), medium.diffusion_grosjean());
        let multiple = Pair {
            amplitude: medium.alpha_prime().squared(),
            z_r,
            z_v: -(z_r + boundary.extrapolation(diffusion).scale(2.0)),
            diffusion,
            kappa: medium.sigma_tr_grosjean(),
            boundary,
        };
        Ok(Self { multiple, single: Single::new(medium)? })
    }

    fn eval(&self, r: T) -> T {
        self.multiple.eval(r) + self.single.eval(r)
    }

    fn total(&self) -> T {
        self.multiple.total() + self.single.total()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_agree_with_the_reference_table() {
        // Physics notes, 8.5: r = .1, 1, 5 and the albedo, without single scattering.
        for (alpha, eta, expected, albedo) in [
            (0.5, 1.0, [1.08701641e-2, 3.80729856e-3, 1.27086430e-5], 0.04598493),
            (0.9, 1.33, [3.27709310e-2, 1.40673573e-2, 3.05014928e-4], 0.23395087),
            (0.99, 1.5, [3.88637763e-2, 1.91719382e-2, 1.39145410e-3], 0.56633578),
        ] {
            let m = OpticalProperties::from_albedo(1.0, alpha, 0.0, eta).unwrap();
            let d = BetterDipole::new(&m).unwrap();
            for (r, e) in [0.1, 1.0, 5.0].into_iter().zip(expected) {
                assert!((d.multiple(r) / e - 1.0).abs() < 1e-6, "{alpha} {r} {:e}", d.multiple(r));
            }
            assert!((d.multiple.total() / albedo - 1.0).abs() < 1e-6, "{}", d.multiple.total());
            // The closed form in alpha' and A.
            let b = Boundary::exact(eta);
            let q = ((1.0 - alpha) * (2.0 - alpha) / 3.0_f64).sqrt();
            let x = (-4.0 * b.a() * q).exp();
            let exact = 0.5
                * alpha
                * alpha
                * (-(3.0 * (1.0 - alpha) / (2.0 - alpha)).sqrt()).exp()
                * (b.c_e() * (1.0 + x) + b.c_phi() / q * (1.0 - x));
            assert!((d.multiple.total() - exact).abs() < 1e-12);
        }
    }
}
