//! A BSDF in world space, with the two normals of an interpolated surface.

use moonmilk_core::{Frame, Spectrum, Vec3};

use super::{Bsdf, BsdfSample, Kind};

/// A BSDF at a point of a surface: evaluated about the shading normal, classified by the geometric one.
///
/// Whether a pair of directions reflects or transmits is a fact of the true surface. Pairs on which the two normals disagree scatter nothing,
/// so that no light leaks through closed surfaces. Fibres of hair are the exception: they scatter to all sides of themselves.
#[derive(Clone, Copy, Debug)]
pub struct Shaded<const N: usize> {
    /// Scattering in the local frame.
    pub bsdf: Bsdf<N>,
    /// Local frame; its n is the shading normal.
    pub frame: Frame,
    /// Geometric normal, on the same side as the shading normal.
    pub ng: Vec3,
}

impl<const N: usize> Shaded<N> {
    #[inline]
    fn agree(&self, wo: Vec3, wi: Vec3, local_product: f32) -> bool {
        (wo.dot(self.ng) * wi.dot(self.ng) > 0.0) == (local_product > 0.0) || matches!(self.bsdf, Bsdf::Hair(_))
    }

    /// Returns the value for world directions, without cosine [1/sr].
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Spectrum<N> {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        if self.agree(wo, wi, o.z * i.z) { self.bsdf.eval(o, i) } else { Spectrum::ZERO }
    }

    /// Returns the value times the cosine of wi to the shading normal, and the density of [`Shaded::sample`], at once.
    #[inline]
    pub fn eval_cos_pdf(&self, wo: Vec3, wi: Vec3) -> (Spectrum<N>, f32) {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        if self.agree(wo, wi, o.z * i.z) {
            (self.bsdf.eval(o, i) * i.z.abs(), self.bsdf.pdf(o, i))
        } else {
            (Spectrum::ZERO, 0.0)
        }
    }

    /// Returns the density of world direction wi [1/sr].
    #[inline]
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        if self.agree(wo, wi, o.z * i.z) { self.bsdf.pdf(o, i) } else { 0.0 }
    }

    /// Samples a world direction; the weight is `f |wi . ns| / pdf` ([`BsdfSample::weight`] with [`Shaded::cos`]).
    #[inline]
    pub fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample<N>> {
        let o = self.frame.to_local(wo);
        let s = self.bsdf.sample(o, uc, u)?;
        let wi = self.frame.to_world(s.wi).normalize();
        // The side on which a fibre is left is a fact of the true surface, too.
        let kind = match self.bsdf {
            Bsdf::Hair(_) if wo.dot(self.ng) * wi.dot(self.ng) > 0.0 => Kind::Reflection,
            Bsdf::Hair(_) => Kind::Transmission,
            _ => s.kind,
        };
        self.agree(wo, wi, o.z * s.wi.z).then_some(BsdfSample { wi, kind, ..s })
    }

    /// Returns |w . ns|.
    #[inline]
    pub fn cos(&self, w: Vec3) -> f32 {
        w.dot(self.frame.n).abs()
    }

    /// Returns whether all events are specular, so that lights need not be sampled.
    #[inline]
    pub fn is_specular(&self) -> bool {
        self.bsdf.is_specular()
    }

    /// Returns whether light may pass to the other side.
    #[inline]
    pub fn transmits(&self) -> bool {
        self.bsdf.transmits()
    }

    /// Returns whether only the hero wavelength may go on ([`Bsdf::wavelength_dependent`]).
    #[inline]
    pub fn wavelength_dependent(&self) -> bool {
        self.bsdf.wavelength_dependent()
    }
}
