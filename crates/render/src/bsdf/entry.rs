//! Where light enters a translucent body, as a BSSRDF sees it: everything that Fresnel lets in counts alike.
//!
//! $$ f(\omega_i) = \frac{1 - F(\cos\theta_i)}{\pi N}, \qquad N = 1 - 2 C_1(1/\eta), $$
//!
//! so that a hemisphere of radiance 1 gives 1 \[Jensen2001; pbrt-v4, NormalizedFresnelBxDF\]. The boundary counts as smooth here, also where it is rough:
//! an approximation of all profiles that are derived for smooth ones.

use std::f32::consts::FRAC_1_PI;

use moonmilk_core::{Spectrum, Vec3};

use super::lambert::sample_cosine;
use super::{BsdfSample, Kind, facet};

/// The directions of entering light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Relative index, inside / outside.
    pub eta: f32,
    /// N.
    pub norm: f32,
}

impl Entry {
    #[inline]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z > 0.0 { (1.0 - facet(wi.z.abs(), self.eta).0) * FRAC_1_PI / self.norm } else { 0.0 }
    }

    #[inline]
    pub(crate) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z > 0.0 { wi.z.abs() * FRAC_1_PI } else { 0.0 }
    }

    #[inline]
    pub(crate) fn sample<const N: usize>(&self, wo: Vec3, u: [f32; 2]) -> BsdfSample<N> {
        let mut wi = sample_cosine(u);
        wi.z = wi.z.copysign(wo.z);
        let (f, pdf) = (Spectrum::splat(self.eval(wo, wi)), wi.z.abs() * FRAC_1_PI);
        BsdfSample { f, wi, pdf, kind: Kind::Reflection, specular: false, eta: 1.0 }
    }
}
