//! BSSRDFs that know directions: more than a radial profile.
//!
//! $$ S(x_i, \omega_i, x_o, \omega_o) = \frac{dL_o(x_o, \omega_o)}{d\Phi_i(x_i, \omega_i)} \quad [1/(L^2\, sr)] $$
//!
//! The models here let the exitance depend on where the light comes from, and let it out diffusely, $S = T(\omega_i)\, M(x_o; \omega_i)\, T(\omega_o) / (\pi N)$, with M the
//! exitance per unit of *entered* power, T = 1 - F from outside and $N = 1 - 2 C_1(1/\eta)$.

use std::f64::consts::PI;

use moonmilk_core::DVec3;

use crate::error::Error;
use crate::fresnel::{moment_1, reflectance_f64};
use crate::properties::OpticalProperties;

use super::{Info, Profile};

/// Where light goes in and out. Directions are unit vectors away from the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Exit point minus entry point \[L\].
    pub offset: DVec3,
    /// Outward normal at the entry point.
    pub n_i: DVec3,
    /// Outward normal at the exit point.
    pub n_o: DVec3,
    /// Direction to the light.
    pub w_i: DVec3,
    /// Direction to the viewer.
    pub w_o: DVec3,
}

impl Placement {
    /// Returns the placement on the plane z = 0, medium below, viewer along the normal.
    pub fn on_plane(x: f64, y: f64, w_i: DVec3) -> Self {
        Self { offset: DVec3::new(x, y, 0.0), n_i: DVec3::Z, n_o: DVec3::Z, w_i, w_o: DVec3::Z }
    }

    /// Returns the direction of the refracted light, into the medium, or `None` for light from below or totally reflected (eta < 1).
    pub fn refracted(&self, eta: f64) -> Option<DVec3> {
        let cos = self.w_i.dot(self.n_i);
        let cos2 = 1.0 - (1.0 - cos * cos) / (eta * eta);
        (cos > 0.0 && cos2 > 0.0).then(|| (self.n_i * cos - self.w_i) / eta - self.n_i * cos2.sqrt())
    }
}

/// A BSSRDF of one medium.
pub trait Bssrdf: Send + Sync {
    /// Returns the description of the model.
    fn info(&self) -> &'static Info;

    /// Returns the medium.
    fn medium(&self) -> &OpticalProperties;

    /// Returns the exitance per unit of entered power \[1/L^2\]; 0 where no light enters.
    fn exitance(&self, at: &Placement) -> f64;

    /// Returns the radial profile for light along the normal, to sample exit points with.
    fn normal_profile(&self) -> &dyn Profile;

    /// Returns S \[1/(L^2 sr)\].
    fn eval(&self, at: &Placement) -> f64 {
        let eta = self.medium().eta();
        let (cos_i, cos_o) = (at.w_i.dot(at.n_i), at.w_o.dot(at.n_o));
        if cos_i <= 0.0 || cos_o <= 0.0 {
            return 0.0;
        }
        let transmitted = (1.0 - reflectance_f64(cos_i, eta)) * (1.0 - reflectance_f64(cos_o, eta));
        transmitted * self.exitance(at) / (PI * (1.0 - 2.0 * moment_1(1.0 / eta)))
    }

    /// Returns the offset (x, y) of an exit point in the tangent plane, and its density per area \[1/L^2\]: radii of the normal profile, any azimuth.
    fn sample(&self, u: [f64; 2]) -> ([f64; 2], f64) {
        let s = self.normal_profile().sample(u[0]);
        let (sin, cos) = (2.0 * PI * u[1]).sin_cos();
        ([s.r * cos, s.r * sin], s.pdf / (2.0 * PI * s.r))
    }

    /// Returns the density of [`Bssrdf::sample`] at a distance, per area \[1/L^2\].
    fn pdf(&self, r: f64) -> f64 {
        self.normal_profile().pdf(r) / (2.0 * PI * r)
    }
}

/// A BSSRDF in full, by one random sample of what its formula integrates: what a renderer needs where a table over all directions would be large.
pub trait Directed: Send + Sync + std::fmt::Debug {
    /// Returns an estimate, from uniform variates u, of $M = \pi N S / (T(\omega_i) T(\omega_o))$ \[1/L^2\]: the exitance per unit of entered power of light that leaves
    /// diffusely; 0 where no light enters. Its mean over u is the model.
    fn estimate(&self, at: &Placement, u: [f64; 4]) -> f64;
}

/// Returns a distance along a ray and its density \[1/L\]: exponential of mean `mfp` for u below 1/2, else equiangular about the point at distance `nearest`, from which the target
/// is `h` away; the density is that of both together \[Kulla2012\].
pub(crate) fn equiangular(nearest: f64, h: f64, mfp: f64, choice: f64, u: f64) -> (f64, f64) {
    let h = h.max(1e-9 * mfp);
    let first = (-nearest / h).atan();
    let width = 0.5 * PI - first;
    let t = if choice < 0.5 { -mfp * (1.0 - u).ln() } else { (nearest + h * (first + width * u).tan()).max(0.0) };
    let along = t - nearest;
    let density = 0.5 * (-t / mfp).exp() / mfp + 0.5 * h / (width * (h * h + along * along));
    (t, density)
}

/// How a [`Directed`] is built.
pub(crate) type BuildDirected = fn(&OpticalProperties) -> Result<Box<dyn Directed>, Error>;
/// How a BSSRDF is built.
pub(crate) type BuildBssrdf = fn(&OpticalProperties) -> Result<Box<dyn Bssrdf>, Error>;
