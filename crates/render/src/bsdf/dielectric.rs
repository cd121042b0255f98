//! Boundaries between transparent media: smooth, rough \[Walter2007\], and the thin pane.
//!
//! Local frame: z is the shading normal and points outside; `eta` = inside / outside. Values are those of radiance transport (module docs of
//! [`crate::bsdf`]): transmission carries `1 / eta_p^2`, eta_p = index on the side of wi / index on the side of wo.

use moonmilk_core::{Spectrum, Vec3};
use moonmilk_optics::fresnel::{reflect, reflectance};

use super::ggx::Ggx;
use super::{BsdfSample, Kind, facet, refract};

/// A boundary between two transparent media.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// Relative index, inside / outside.
    pub eta: f32,
    /// Microfacets; `None` for a smooth boundary.
    pub ggx: Option<Ggx>,
    /// Whether `eta` is that of the hero wavelength only: the caller must then keep only the hero lane after this event.
    pub dispersive: bool,
}

/// A direction sampled for one kind of event alone: used inside layers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lobe {
    /// Sampled direction.
    pub wi: Vec3,
    /// f |cos wi| / pdf without the 1 / eta_p^2 of radiance (so: of importance).
    pub weight: f32,
    /// Density of wi, given the kind of event; infinite for a smooth boundary.
    pub pdf: f32,
}

impl Dielectric {
    /// Returns index on the far side / index on the side of w.
    #[inline]
    pub(crate) fn eta_p(&self, w: Vec3) -> f32 {
        if w.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// Returns the microfacet boundary, unless events do not scatter: smooth, or of equal indices.
    #[inline]
    pub(crate) fn rough(&self) -> Option<Ggx> {
        if self.eta == 1.0 { None } else { self.ggx }
    }

    /// Returns the normal of the microfacet that turns wo to wi, in the upper hemisphere, and whether both see its right side.
    #[inline]
    fn half_vector(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, bool)> {
        let reflection = wo.z * wi.z > 0.0;
        let h = if reflection { wo + wi } else { wi * self.eta_p(wo) + wo };
        let m = h.try_normalize()?;
        let m = if m.z < 0.0 { -m } else { m };
        // Discard microfacets that face away from either direction.
        (m.dot(wi) * wi.z > 0.0 && m.dot(wo) * wo.z > 0.0).then_some((m, reflection))
    }

    /// Returns the value of the rough lobes; 0 for a smooth boundary.
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some(ggx) = self.rough() else { return 0.0 };
        let Some((m, reflection)) = self.half_vector(wo, wi) else {
            return 0.0;
        };
        let eta_p = self.eta_p(wo);
        let f = reflectance(wo.dot(m).abs(), eta_p);
        if reflection {
            return ggx.d(m) * f * ggx.g_over_4cos(wo, wi);
        }
        let q = wi.dot(m) + wo.dot(m) / eta_p;
        let jacobian = (wi.dot(m) * wo.dot(m) / (q * q)).abs();
        4.0 * ggx.d(m) * (1.0 - f) * ggx.g_over_4cos(wo, wi) * jacobian / (eta_p * eta_p)
    }

    /// Returns the density of [`Dielectric::sample`] for the rough lobes.
    pub(crate) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some(ggx) = self.rough() else { return 0.0 };
        let Some((m, reflection)) = self.half_vector(wo, wi) else {
            return 0.0;
        };
        let f = reflectance(wo.dot(m).abs(), self.eta_p(wo));
        let given_kind = self.pdf_given_m(ggx, wo, wi, m, reflection);
        given_kind * if reflection { f } else { 1.0 - f }
    }

    #[inline]
    fn pdf_given_m(&self, ggx: Ggx, wo: Vec3, wi: Vec3, m: Vec3, reflection: bool) -> f32 {
        let visible = ggx.visible(wo, m);
        if reflection {
            visible / (4.0 * wo.dot(m).abs())
        } else {
            let q = wi.dot(m) + wo.dot(m) / self.eta_p(wo);
            visible * wi.dot(m).abs() / (q * q)
        }
    }

    /// Samples reflection with the probability of the (micro)facet's Fresnel reflectance, else transmission.
    pub(crate) fn sample<const N: usize>(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample<N>> {
        let eta_p = self.eta_p(wo);
        let Some(ggx) = self.rough() else {
            let (f, cos_t) = facet(wo.z.abs(), eta_p);
            return Some(if uc < f {
                let wi = Vec3::new(-wo.x, -wo.y, wo.z);
                BsdfSample::specular(Spectrum::splat(f / wi.z.abs()), wi, f, Kind::Reflection, 1.0)
            } else {
                let wi = refract(wo, Vec3::Z * 1f32.copysign(wo.z), wo.z.abs(), cos_t, eta_p);
                let p = 1.0 - f;
                BsdfSample::specular(
                    Spectrum::splat(p / (eta_p * eta_p * wi.z.abs())),
                    wi,
                    p,
                    Kind::Transmission,
                    eta_p,
                )
            });
        };
        let m = ggx.sample_visible(wo, u);
        let f = reflectance(wo.dot(m).abs(), eta_p);
        let reflection = uc < f;
        let wi = self.leave(wo, m, reflection)?;
        let pdf = self.pdf_given_m(ggx, wo, wi, m, reflection) * if reflection { f } else { 1.0 - f };
        // The value follows from the weight G / G1 of visible normals: f cos / pdf.
        let scale = if reflection { 1.0 } else { 1.0 / (eta_p * eta_p) };
        let value = pdf * ggx.g_over_g1(wo, wi) * scale / wi.z.abs();
        let (kind, eta) = if reflection { (Kind::Reflection, 1.0) } else { (Kind::Transmission, eta_p) };
        Some(BsdfSample { f: Spectrum::splat(value), wi, pdf, kind, specular: false, eta })
    }

    /// Returns the direction off facet m, `None` if it ends on the wrong side of the surface.
    #[inline]
    fn leave(&self, wo: Vec3, m: Vec3, reflection: bool) -> Option<Vec3> {
        let eta_p = self.eta_p(wo);
        let m = if wo.z < 0.0 { -m } else { m };
        let cos_i = wo.dot(m);
        let wi = if reflection { reflect(wo, m) } else { refract(wo, m, cos_i, facet(cos_i, eta_p).1, eta_p) };
        let kept = if reflection { wi.z * wo.z > 0.0 } else { wi.z * wo.z < 0.0 };
        kept.then_some(wi)
    }

    /// Samples a reflection alone, or a transmission alone; `None` if the event is impossible.
    pub(crate) fn sample_lobe(&self, wo: Vec3, u: [f32; 2], reflection: bool) -> Option<Lobe> {
        let eta_p = self.eta_p(wo);
        let Some(ggx) = self.rough() else {
            let (f, cos_t) = facet(wo.z.abs(), eta_p);
            let (wi, weight) = if reflection {
                (Vec3::new(-wo.x, -wo.y, wo.z), f)
            } else {
                (refract(wo, Vec3::Z * 1f32.copysign(wo.z), wo.z.abs(), cos_t, eta_p), 1.0 - f)
            };
            return (weight > 0.0 && wi.z != 0.0).then_some(Lobe { wi, weight, pdf: f32::INFINITY });
        };
        let m = ggx.sample_visible(wo, u);
        let f = reflectance(wo.dot(m).abs(), eta_p);
        let share = if reflection { f } else { 1.0 - f };
        if share == 0.0 {
            return None;
        }
        let wi = self.leave(wo, m, reflection)?;
        let pdf = self.pdf_given_m(ggx, wo, wi, m, reflection);
        Some(Lobe { wi, weight: share * ggx.g_over_g1(wo, wi), pdf })
    }

    /// Returns the density of [`Dielectric::sample_lobe`]; 0 for a smooth boundary.
    pub(crate) fn pdf_lobe(&self, wo: Vec3, wi: Vec3) -> f32 {
        let Some(ggx) = self.rough() else { return 0.0 };
        self.half_vector(wo, wi).map_or(0.0, |(m, reflection)| self.pdf_given_m(ggx, wo, wi, m, reflection))
    }
}

/// Samples the thin pane of index `eta`: two parallel faces, the series of internal reflections summed.
///
/// With F of one face, `R = F + (1-F)^2 F / (1 - F^2) = 2F / (1 + F)` and `T = 1 - R`; transmitted light goes straight on.
pub(crate) fn sample_thin<const N: usize>(eta: f32, wo: Vec3, uc: f32) -> BsdfSample<N> {
    let f = facet(wo.z.abs(), eta).0;
    let r = 2.0 * f / (1.0 + f);
    if uc < r {
        let wi = Vec3::new(-wo.x, -wo.y, wo.z);
        BsdfSample::specular(Spectrum::splat(r / wi.z.abs()), wi, r, Kind::Reflection, 1.0)
    } else {
        BsdfSample::specular(Spectrum::splat((1.0 - r) / wo.z.abs()), -wo, 1.0 - r, Kind::Transmission, 1.0)
    }
}
