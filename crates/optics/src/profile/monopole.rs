//! The monopole: one point source below the surface, and no surface.
//!
//! $$ R(r) = \alpha'\, \frac{\ell\,(1 + \kappa d)\, e^{-\kappa d}}{4\pi d^3}, \qquad \ell = 1/\sigma_t',\ d = \sqrt{r^2 + \ell^2}, \qquad \int R\, dA = \tfrac{\alpha'}{2} e^{-\kappa \ell} $$
//!
//! The flux through the plane z = 0 of an infinite medium, classical diffusion: the lecture's first step. Half the light goes down and is never asked to come back, since nothing
//! is said about the boundary; the dipole's image mends that. *Source*: the lecture; classical diffusion \[Ishimaru1978\].

use moonmilk_core::Real;

use crate::error::Error;
use crate::properties::OpticalProperties;

use super::image::monopole_flux;
use super::model::RadialModel;
use super::{Info, Kind};

/// Description of the model.
pub const INFO: Info = Info {
    name: "monopole",
    summary: "one point source in an infinite medium, no boundary",
    source: "Ishimaru1978",
    kind: Kind::Whole,
    valid: "nowhere: albedo at most 1/2, for any boundary",
    use_when: "to see what the boundary does",
    avoid_when: "in pictures",
};

/// The monopole of one medium.
#[derive(Clone, Copy, Debug)]
pub struct Monopole<T = f64> {
    alpha_prime: T,
    depth: T,
    kappa: T,
}

impl<T: Real> RadialModel<T> for Monopole<T> {
    fn new(medium: &OpticalProperties<T>) -> Result<Self, Error> {
        Ok(Self { alpha_prime: medium.alpha_prime(), depth: medium.sigma_t_prime().recip(), kappa: medium.sigma_tr() })
    }

    fn eval(&self, r: T) -> T {
        let d = (r * r + self.depth * self.depth).sqrt();
        self.alpha_prime * monopole_flux(self.depth, d, self.kappa)
    }

    fn total(&self) -> T {
        (self.alpha_prime * (-(self.kappa * self.depth)).exp()).scale(0.5)
    }
}
