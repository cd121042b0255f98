//! Metals: smooth or with GGX microfacets, complex Fresnel reflectance in every lane.

use moonmilk_core::{Spectrum, Vec3};
use moonmilk_optics::fresnel::{conductor_lanes, reflect};

use super::ggx::Ggx;
use super::{BsdfSample, Kind};

/// A metal, reflecting on both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conductor<const N: usize> {
    /// Real part of the complex index, relative to the side of incidence.
    pub eta: Spectrum<N>,
    /// Imaginary part.
    pub k: Spectrum<N>,
    /// Microfacets; `None` for a mirror.
    pub ggx: Option<Ggx>,
}

impl<const N: usize> Conductor<N> {
    /// Returns the metal with eta = 1 that reflects `reflectance` at normal incidence: `k = 2 sqrt(r / (1 - r))`.
    ///
    /// From `r = k^2 / (4 + k^2)`. As in pbrt-v4, r is kept below 0.9999, where k would be infinite.
    pub fn from_reflectance(reflectance: Spectrum<N>, ggx: Option<Ggx>) -> Self {
        let k = reflectance.map(|r| {
            let r = r.clamp(0.0, 0.9999);
            2.0 * (r / (1.0 - r)).sqrt()
        });
        Self { eta: Spectrum::ONE, k, ggx }
    }

    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> Spectrum<N> {
        let Some((ggx, m)) = self.facet(wo, wi) else {
            return Spectrum::ZERO;
        };
        self.fresnel(wo.dot(m).abs()) * (ggx.d(m) * ggx.g_over_4cos(wo, wi))
    }

    pub(crate) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.facet(wo, wi).map_or(0.0, |(ggx, m)| ggx.visible(wo, m) / (4.0 * wo.dot(m).abs()))
    }

    pub(crate) fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<BsdfSample<N>> {
        let Some(ggx) = self.ggx else {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            let f = self.fresnel(wo.z.abs()) / wi.z.abs();
            return Some(BsdfSample::specular(f, wi, 1.0, Kind::Reflection, 1.0));
        };
        let m = ggx.sample_visible(wo, u);
        let m = if wo.z < 0.0 { -m } else { m };
        let wi = reflect(wo, m);
        if wi.z * wo.z <= 0.0 {
            return None;
        }
        let pdf = ggx.visible(wo, m) / (4.0 * wo.dot(m).abs());
        let f = self.fresnel(wo.dot(m).abs()) * (pdf * ggx.g_over_g1(wo, wi) / wi.z.abs());
        Some(BsdfSample { f, wi, pdf, kind: Kind::Reflection, specular: false, eta: 1.0 })
    }

    #[inline]
    pub(crate) fn fresnel(&self, cos_i: f32) -> Spectrum<N> {
        conductor_lanes(cos_i, self.eta, self.k)
    }

    #[inline]
    fn facet(&self, wo: Vec3, wi: Vec3) -> Option<(Ggx, Vec3)> {
        if wo.z * wi.z <= 0.0 {
            return None;
        }
        Some((self.ggx?, (wo + wi).try_normalize()?))
    }
}
