//! Photon beam diffusion for light from any direction: the beam follows the refracted ray.
//!
//! $$ M(x; \omega_t) = \alpha'^2 \int_0^\infty \sigma_t' e^{-\sigma_t' t}\; \mathrm{pair}(\rho(t); t\cos\theta_t, -t\cos\theta_t - 2 z_e, D_G, \kappa_G)\; K\, dt + M_1 $$
//!
//! with $\rho(t) = |x - t\, \omega_{t,\parallel}|$ the distance from the point above the source, images mirrored at z = -z_e, and K as at normal incidence with the distance to
//! the source. Single scattering is exact. Flat surfaces; on others the offset is projected to the tangent plane of the entry point.
//!
//! *Source*: \[Habel2013\]. *Accuracy*: quadrature to 1e-5 (test against normal incidence and the albedo).

use moonmilk_core::quadrature::Rule;

use crate::error::Error;
use crate::properties::OpticalProperties;

use super::bssrdf::{Bssrdf, Placement};
use super::image::image_pair;
use super::model::{Slopes, build};
use super::photon_beam::{Beam, INFO, PhotonBeam};
use super::single::{henyey_greenstein, transmitted};
use super::table::growing_breaks;
use super::{Info, Profile};

/// Points per interval of the quadratures.
const POINTS: usize = 10;

struct Oblique {
    beam: Beam<f64>,
    profile: Box<dyn Profile>,
}

/// Builds the BSSRDF.
pub(crate) fn bssrdf(medium: &OpticalProperties) -> Result<Box<dyn Bssrdf>, Error> {
    let profile = build::<PhotonBeam, PhotonBeam<Slopes>>(&INFO, medium)?;
    Ok(Box::new(Oblique { beam: Beam::new(medium, true), profile }))
}

/// The refracted ray in the plane: cosine with the inward normal, and products with the offset.
struct Ray {
    cos: f64,
    sin: f64,
    /// Offset squared, and its component along the ray's trace.
    r2: f64,
    along: f64,
}

impl Ray {
    /// Returns the squared distance between the exit point and the point above the ray at distance t.
    fn rho2(&self, t: f64) -> f64 {
        (self.r2 - 2.0 * t * self.sin * self.along + t * t * self.sin * self.sin).max(0.0)
    }

    /// Returns breaks along the ray: graded around the point nearest to the exit, up to `end`, with `extra` ones.
    fn breaks(&self, mfp: f64, end: f64, extra: &[f64]) -> Vec<f64> {
        let nearest = (self.sin * self.along).clamp(0.0, end);
        let distance = (self.rho2(nearest) + (nearest * self.cos).powi(2)).sqrt();
        let scale = distance.clamp(1e-9 * mfp, mfp);
        let mut breaks: Vec<f64> = growing_breaks(scale, end).iter().flat_map(|b| [nearest + b, nearest - b]).collect();
        breaks.extend(growing_breaks(mfp, end));
        breaks.extend(extra);
        breaks.retain(|b| (0.0..=end).contains(b));
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        breaks
    }
}

impl Oblique {
    fn multiple(&self, ray: &Ray) -> f64 {
        let b = &self.beam;
        let mfp = 1.0 / b.sigma;
        let sum = Rule::composite(POINTS, &ray.breaks(mfp, 45.0 * mfp, &[])).integrate(|t| {
            let z = t * ray.cos;
            let rho = ray.rho2(t).sqrt();
            let d = (rho * rho + z * z).sqrt();
            let correction = -(-2.0 * b.sigma * (d + t)).exp_m1();
            (-b.sigma * t).exp() * image_pair(rho, z, -(z + b.two_z_e), b.diffusion, b.kappa, &b.boundary) * correction
        });
        b.amplitude * b.sigma * sum
    }

    fn single(&self, ray: &Ray) -> f64 {
        let m = self.profile.medium();
        let (sigma_t, eta, g) = (m.sigma_t(), m.eta(), m.g());
        // Total reflection ends where rho^2 = z^2 / (eta^2 - 1): a quadratic in t.
        let mut critical = Vec::new();
        if eta > 1.0 {
            let a = ray.sin * ray.sin - ray.cos * ray.cos / (eta * eta - 1.0);
            let b = ray.sin * ray.along;
            let root = (b * b - a * ray.r2).max(0.0).sqrt();
            // The two roots in the form that does not divide by a near 0.
            critical
                .extend([ray.r2 / (b + root), ray.r2 / (b - root)].into_iter().filter(|t| t.is_finite() && *t > 0.0));
            // Squares around a root of 1 - F: grade towards it.
            let fine: Vec<f64> = critical
                .iter()
                .flat_map(|c| (1..12).flat_map(move |k| [c * (1.0 + 0.25f64.powi(k)), c * (1.0 - 0.25f64.powi(k))]))
                .collect();
            critical.extend(fine);
        }
        let mfp = 1.0 / sigma_t;
        let sum = Rule::composite(POINTS, &ray.breaks(mfp, 45.0 * mfp, &critical)).integrate(|t| {
            let z = t * ray.cos;
            let d2 = ray.rho2(t) + z * z;
            let d = d2.sqrt();
            if d == 0.0 {
                return 0.0;
            }
            let cos_o = z / d;
            // Deflection between the ray and the direction to the exit point, whose height over the ray's point is z.
            let deflection = ((ray.sin * (ray.along - t * ray.sin) - ray.cos * z) / d).clamp(-1.0, 1.0);
            (-sigma_t * (t + d)).exp() * henyey_greenstein(deflection, g) * transmitted(cos_o, eta) * cos_o / d2
        });
        m.sigma_s() * sum
    }
}

impl Bssrdf for Oblique {
    fn info(&self) -> &'static Info {
        &INFO
    }

    fn medium(&self) -> &OpticalProperties {
        self.profile.medium()
    }

    fn normal_profile(&self) -> &dyn Profile {
        self.profile.as_ref()
    }

    fn exitance(&self, at: &Placement) -> f64 {
        let Some(w) = at.refracted(self.medium().eta()) else {
            return 0.0;
        };
        let cos = -w.dot(at.n_i);
        let trace = w + at.n_i * cos;
        let sin = trace.length();
        // The offset keeps its length when it is turned into the tangent plane.
        let length = at.offset.length();
        let flat = (at.offset - at.n_i * at.offset.dot(at.n_i)).normalize_or_zero() * length;
        let along = if sin > 0.0 { flat.dot(trace) / sin } else { 0.0 };
        let ray = Ray { cos, sin, r2: length * length, along };
        self.multiple(&ray) + self.single(&ray)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::profile::table::radial_rule;
    use moonmilk_core::DVec3;

    #[test]
    fn light_along_the_normal_gives_the_radial_profile() {
        for (alpha, g, eta) in [(0.5, 0.0, 1.0), (0.9, 0.6, 1.33), (0.99, -0.3, 1.5)] {
            let m = OpticalProperties::from_albedo(1.0, alpha, g, eta).unwrap();
            let b = bssrdf(&m).unwrap();
            for r in [0.05, 0.3, 1.0, 4.0] {
                let at = Placement::on_plane(0.6 * r, -0.8 * r, DVec3::Z);
                let error = b.exitance(&at) / b.normal_profile().eval(r) - 1.0;
                assert!(error.abs() < 1e-5, "{alpha} {eta} {r} {error:e}");
            }
        }
    }

    #[test]
    fn single_scattering_of_oblique_light_has_its_closed_total() {
        // Matched, isotropic: (alpha / 2) (1 - mu ln(1 + 1 / mu)) for light at the cosine mu.
        let m = OpticalProperties::from_albedo(1.0, 1.0, 0.0, 1.0).unwrap();
        let o =
            Oblique { beam: Beam::new(&m, true), profile: build::<PhotonBeam, PhotonBeam<Slopes>>(&INFO, &m).unwrap() };
        for mu in [0.3, 0.8] {
            let sin = (1.0f64 - mu * mu).sqrt();
            let steps = 48;
            let sum: f64 = (0..steps)
                .map(|k| {
                    let cos = (2.0 * PI * (f64::from(k) + 0.5) / f64::from(steps)).cos();
                    radial_rule(1e-4, 40.0, 10)
                        .integrate(|r| r * o.single(&Ray { cos: mu, sin, r2: r * r, along: r * cos }))
                        * 2.0
                        * PI
                        / f64::from(steps)
                })
                .sum();
            let exact = 0.5 * (1.0 - mu * (1.0 + 1.0 / mu).ln());
            // Inside 1e-4 lies 1e-4 of it; the midpoint rule in the azimuth adds as much at grazing light.
            assert!((sum / exact - 1.0).abs() < 2e-3, "{mu} {sum} {exact}");
        }
    }
}
