//! The GGX distribution of microfacet slopes, anisotropic, with its visible normals.
//!
//! A surface of microfacets has normals m with density D(m) (per projected area: the integral of D (m . z) is 1). The height-correlated
//! Smith shadowing G and all densities are written through
//! `s(w) = sqrt(w_z^2 + alpha_x^2 w_x^2 + alpha_y^2 w_y^2)`, which has no tangent to overflow: `G1(w) = 2 |w_z| / (|w_z| + s(w))`.

use moonmilk_core::{Vec2, Vec3};

/// Below this value of both alphas a surface is treated as perfectly smooth, as pbrt-v4 does.
pub const SMOOTH_ALPHA: f32 = 1e-3;

/// GGX (Trowbridge-Reitz) distribution in the local frame with z along the shading normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    /// Roughness along the two tangents \[1\].
    pub alpha: Vec2,
}

/// Returns the roughness alpha of a roughness as pbrt-v4 writes it: its square root if it is perceptual.
#[inline]
pub fn roughness_to_alpha(roughness: f32, remap: bool) -> f32 {
    if remap { roughness.max(0.0).sqrt() } else { roughness.max(0.0) }
}

impl Ggx {
    /// Returns the distribution, or `None` for a surface that counts as smooth (both alphas below [`SMOOTH_ALPHA`]).
    ///
    /// If only one alpha is tiny it is raised to 1e-4, as in pbrt-v4, so that D stays finite.
    pub fn new(alpha: Vec2) -> Option<Self> {
        (alpha.max_element() >= SMOOTH_ALPHA).then(|| Self { alpha: alpha.max(Vec2::splat(1e-4)) })
    }

    /// Returns the density D(m) of microfacet normals [1/sr], [Walter2007, Eq. 33] in its anisotropic form.
    #[inline]
    pub fn d(&self, m: Vec3) -> f32 {
        let (x, y) = (m.x / self.alpha.x, m.y / self.alpha.y);
        let e = x * x + y * y + m.z * m.z;
        1.0 / (std::f32::consts::PI * self.alpha.x * self.alpha.y * e * e)
    }

    #[inline]
    fn s(&self, w: Vec3) -> f32 {
        let (x, y) = (self.alpha.x * w.x, self.alpha.y * w.y);
        (w.z * w.z + x * x + y * y).sqrt()
    }

    /// Returns G1(w), the visible share of the microfacets that face w.
    #[inline]
    pub fn g1(&self, w: Vec3) -> f32 {
        2.0 * w.z.abs() / (w.z.abs() + self.s(w))
    }

    /// Returns G(wo, wi) / (4 |wo_z| |wi_z|) for the height-correlated Smith shadowing G = 1 / (1 + L(wo) + L(wi)).
    ///
    /// With 1 + L(wo) + L(wi) = (s_o/|wo_z| + s_i/|wi_z|) / 2 the cosines cancel, so that grazing directions are harmless.
    #[inline]
    pub fn g_over_4cos(&self, wo: Vec3, wi: Vec3) -> f32 {
        0.5 / (self.s(wo) * wi.z.abs() + self.s(wi) * wo.z.abs())
    }

    /// Returns G(wo, wi) / G1(wo), the weight of a sampled visible normal.
    #[inline]
    pub fn g_over_g1(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (co, ci) = (wo.z.abs(), wi.z.abs());
        let so = self.s(wo);
        ci * (co + so) / (so * ci + self.s(wi) * co)
    }

    /// Returns the density of the normals visible from w, G1(w) |w . m| D(m) / |w_z| [1/sr].
    #[inline]
    pub fn visible(&self, w: Vec3, m: Vec3) -> f32 {
        2.0 * self.d(m) * w.dot(m).abs() / (w.z.abs() + self.s(w))
    }

    /// Samples a normal visible from w (from -w if w is below) with density [`Ggx::visible`]; the normal is above.
    ///
    /// *Source*: the stretched view direction reflects off a uniform point of a spherical cap [Dupuy2023, Listing 3].
    #[inline]
    pub fn sample_visible(&self, w: Vec3, u: [f32; 2]) -> Vec3 {
        // Stretch to the unit hemisphere.
        let w = if w.z < 0.0 { -w } else { w };
        let v = Vec3::new(self.alpha.x * w.x, self.alpha.y * w.y, w.z).normalize();
        // Take a uniform point of the cap that the reflections of v fill.
        let z = (1.0 - u[1]) * (1.0 + v.z) - v.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = (std::f32::consts::TAU * u[0]).sin_cos();
        let h = Vec3::new(r * cos, r * sin, z) + v;
        // Return to the ellipsoid.
        Vec3::new(self.alpha.x * h.x, self.alpha.y * h.y, h.z.max(1e-12)).normalize()
    }
}
