//! Lambertian reflection and transmission, and the cosine law on which they sample.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4};

use moonmilk_core::{Spectrum, Vec3};

use super::{BsdfSample, Kind};

/// Returns a direction of the upper hemisphere with density cos / pi, by the area-preserving map of the square to the disk
/// that keeps neighbours together \[Shirley1997\].
#[inline]
pub fn sample_cosine(u: [f32; 2]) -> Vec3 {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    let (r, phi) = if a.abs() > b.abs() {
        (a, FRAC_PI_4 * (b / a))
    } else if b != 0.0 {
        (b, FRAC_PI_2 - FRAC_PI_4 * (a / b))
    } else {
        (0.0, 0.0)
    };
    let (sin, cos) = phi.sin_cos();
    Vec3::new(r * cos, r * sin, (1.0 - r * r).max(1e-12).sqrt())
}

/// Lambertian reflection on both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diffuse<const N: usize> {
    /// Albedo.
    pub reflectance: Spectrum<N>,
}

impl<const N: usize> Diffuse<N> {
    #[inline]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> Spectrum<N> {
        if wo.z * wi.z > 0.0 { self.reflectance * FRAC_1_PI } else { Spectrum::ZERO }
    }

    #[inline]
    pub(crate) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z > 0.0 { wi.z.abs() * FRAC_1_PI } else { 0.0 }
    }

    #[inline]
    pub(crate) fn sample(&self, wo: Vec3, u: [f32; 2]) -> BsdfSample<N> {
        let mut wi = sample_cosine(u);
        wi.z = wi.z.copysign(wo.z);
        let (f, pdf) = (self.reflectance * FRAC_1_PI, wi.z.abs() * FRAC_1_PI);
        BsdfSample { f, wi, pdf, kind: Kind::Reflection, specular: false, eta: 1.0 }
    }
}

/// Lambertian reflection and transmission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseTransmission<const N: usize> {
    /// Albedo of reflection.
    pub reflectance: Spectrum<N>,
    /// Albedo of transmission.
    pub transmittance: Spectrum<N>,
}

impl<const N: usize> DiffuseTransmission<N> {
    /// Returns the probability with which reflection is sampled: its share of the brightest lanes.
    #[inline]
    fn share(&self) -> f32 {
        let (r, t) = (self.reflectance.max_value(), self.transmittance.max_value());
        if r + t > 0.0 { r / (r + t) } else { 1.0 }
    }

    #[inline]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> Spectrum<N> {
        (if wo.z * wi.z > 0.0 { self.reflectance } else { self.transmittance }) * FRAC_1_PI
    }

    #[inline]
    pub(crate) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let p = self.share();
        (if wo.z * wi.z > 0.0 { p } else { 1.0 - p }) * wi.z.abs() * FRAC_1_PI
    }

    #[inline]
    pub(crate) fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> BsdfSample<N> {
        let reflection = uc < self.share();
        let mut wi = sample_cosine(u);
        wi.z = if reflection { wi.z.copysign(wo.z) } else { -wi.z.copysign(wo.z) };
        let kind = if reflection { Kind::Reflection } else { Kind::Transmission };
        BsdfSample { f: self.eval(wo, wi), wi, pdf: self.pdf(wo, wi), kind, specular: false, eta: 1.0 }
    }
}
