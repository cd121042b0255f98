//! One material in the numbers that other programs ask for, and what each of them loses.
//!
//! A measured material is (sigma_a, sigma_s, g, eta) per colour. Programs ask for albedos and lengths instead, of at least three kinds:
//!
//! | who | colour | length |
//! |---|---|---|
//! | pbrt `subsurface` | reflectance of entered light along the normal, with the boundary | mfp = 1 / sigma_t |
//! | OpenPBR, Cycles | albedo for diffuse light without the boundary, by a fit | radius = 1 / sigma_t |
//! | diffusion, Jensen & Buhler | albedo of the dipole | dmfp = 1 / sigma_tr |
//!
//! The same number means different media in each. [`kulla_conty_albedo`] and its inverse are the fit that OpenPBR, Cycles and glTF's drafts share:
//! $A = (1-s)(1-.139 s)/(1+1.17 s)$, $s = \sqrt{(1-\alpha)/(1-\alpha g)}$; within .002 of the exact diffuse, index-matched albedo.

use crate::error::Error;
use crate::halfspace::{Illumination, exact_albedo};
use crate::properties::OpticalProperties;

/// Returns the colour that [`kulla_conty_alpha`] maps to this single-scattering albedo.
///
/// *Accuracy*: within .002 of the albedo of an index-matched half-space for diffuse light; .06 above that for light along the normal (test).
/// *Source*: van de Hulst's formula with the constants of \[Kulla2017\].
pub fn kulla_conty_albedo(alpha: f64, g: f64) -> f64 {
    let s = ((1.0 - alpha) / (1.0 - alpha * g)).sqrt();
    (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)
}

/// Returns the single-scattering albedo of a colour: s = 4.09712 + 4.20863 A - sqrt(9.59217 + 41.6808 A + 17.7126 A^2), alpha = (1 - s^2) / (1 - g s^2).
///
/// One public program has 9.59271 (two digits swapped): 1.8e-4 instead of 6e-6 for black. *Source*: \[Kulla2017\].
pub fn kulla_conty_alpha(albedo: f64, g: f64) -> f64 {
    let a = albedo;
    let s = 4.09712 + 4.20863 * a - (9.59217 + 41.6808 * a + 17.7126 * a * a).sqrt();
    (1.0 - s * s) / (1.0 - g * s * s)
}

/// A material's numbers for one colour in all conventions; lengths in the unit of the coefficients' inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conventions {
    /// The coefficients themselves.
    pub properties: OpticalProperties,
    /// Reflectance of entered light along the normal, with the boundary, exact.
    pub albedo_normal: f64,
    /// Reflectance of entered Lambertian light, with the boundary.
    pub albedo_diffuse: f64,
    /// The colour of OpenPBR, Cycles and glTF that leads back to alpha (at this g).
    pub colour: f64,
    /// The same for the reduced medium, g = 0.
    pub colour_reduced: f64,
    /// 1 / sigma_t.
    pub mfp: f64,
    /// 1 / sigma_t'.
    pub mfp_reduced: f64,
    /// 1 / sigma_tr, infinite without absorption.
    pub dmfp: f64,
}

impl Conventions {
    /// Returns all numbers of a material.
    ///
    /// *Errors*: eta outside \[1, 3\].
    pub fn new(properties: &OpticalProperties) -> Result<Self, Error> {
        let p = *properties;
        Ok(Self {
            properties: p,
            albedo_normal: exact_albedo(&p, Illumination::Normal)?,
            albedo_diffuse: exact_albedo(&p, Illumination::DiffuseOutside)?,
            colour: kulla_conty_albedo(p.alpha(), p.g()),
            colour_reduced: kulla_conty_albedo(p.alpha_prime(), 0.0),
            mfp: 1.0 / p.sigma_t(),
            mfp_reduced: 1.0 / p.sigma_t_prime(),
            dmfp: 1.0 / p.sigma_tr(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::halfspace::HFunction;

    #[test]
    fn the_shared_fit_has_its_measured_error() {
        let (mut diffuse, mut normal) = (0.0f64, 0.0f64);
        for i in 1..100 {
            let alpha = 1.0 - (f64::from(i) / 100.0).powi(2);
            let (h, fit) = (HFunction::new(alpha).unwrap(), kulla_conty_albedo(alpha, 0.0));
            diffuse = diffuse.max((fit - h.diffuse_albedo()).abs());
            normal = normal.max(fit - h.plane_albedo(1.0));
        }
        // Physics notes, 6.2: .0021 and .0625 at most.
        assert!(diffuse < 0.0022 && (0.055..0.065).contains(&normal), "{diffuse} {normal}");
    }

    #[test]
    fn colour_and_albedo_lead_back_to_each_other() {
        for alpha in [0.1, 0.6, 0.9, 0.99, 0.999] {
            for g in [0.0, 0.8] {
                let back = kulla_conty_alpha(kulla_conty_albedo(alpha, g), g);
                // The constants of the inverse have six digits.
                assert!((back - alpha).abs() < 1e-4, "{alpha} {g} {back}");
            }
        }
        assert!(kulla_conty_alpha(0.0, 0.0).abs() < 1e-5 && (kulla_conty_alpha(1.0, 0.0) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn marble_has_the_recomputed_albedo() {
        // Physics notes, 8.6: exact albedo .838 for red.
        let c = Conventions::new(&OpticalProperties::new(0.0021, 2.19, 0.0, 1.5).unwrap()).unwrap();
        assert!((c.albedo_normal - 0.838).abs() < 6e-4 && c.albedo_diffuse > c.albedo_normal);
        assert!((c.mfp - 1.0 / 2.1921).abs() < 1e-12 && c.mfp == c.mfp_reduced && c.colour == c.colour_reduced);
    }
}
