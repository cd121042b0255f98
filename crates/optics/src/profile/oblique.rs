//! Photon beam diffusion for light from any direction: the beam follows the refracted ray.
//!
//! $$ M(x; \omega_t) = \alpha'^2 \int_0^\infty \sigma_t' e^{-\sigma_t' t}\; \mathrm{pair}(\rho(t); t\cos\theta_t, -t\cos\theta_t - 2 z_e, D_G, \kappa_G)\; K\, dt + M_1 $$
//!
//! with $\rho(t) = |x - t\, \omega_{t,\parallel}|$ the distance from the point above the source, images mirrored at z = -z_e, and K as at normal incidence with the distance to
//! the source. Single scattering is exact. Flat surfaces; on others the offset is projected to the tangent plane of the entry point.
//!
//! *Source*: \[Habel2013\]. *Accuracy*: quadrature to 1e-5 (test against normal incidence and the albedo).

use moonmilk_core::DVec3;
use moonmilk_core::quadrature::Rule;

use crate::error::Error;
use crate::properties::OpticalProperties;

use super::bssrdf::{Bssrdf, Directed, Placement, equiangular};
use super::image::image_pair;
use super::model::{Slopes, build};
use super::photon_beam::{self, Beam, PhotonBeam};
use super::single::{henyey_greenstein, transmitted};
use super::table::growing_breaks;
use super::{Info, Kind, Profile};

/// Description of the model.
pub const INFO: Info = Info {
    name: "photon-beam-oblique",
    summary: "photon beam diffusion along the refracted light: photon-beam where that comes along the normal",
    source: "Habel2013",
    kind: Kind::Whole,
    valid: photon_beam::INFO.valid,
    use_when: "where light comes in at a slant and its direction should show",
    avoid_when: "for speed: one random point of the beam per path, more noise than photon-beam",
};

/// Points of the beam per estimate; odd against 3.
const AT_ONCE: usize = 8;
/// Points per interval of the quadratures.
const POINTS: usize = 10;

struct Oblique {
    beam: Beam<f64>,
    profile: Box<dyn Profile>,
}

/// Builds the BSSRDF.
pub(crate) fn bssrdf(medium: &OpticalProperties) -> Result<Box<dyn Bssrdf>, Error> {
    let profile = build::<PhotonBeam, PhotonBeam<Slopes>>(&photon_beam::INFO, medium)?;
    Ok(Box::new(Oblique { beam: Beam::new(medium, true), profile }))
}

/// Builds the model for rendering.
pub(crate) fn directed(medium: &OpticalProperties) -> Result<Box<dyn Directed>, Error> {
    Ok(Box::new(Sampled { beam: Beam::new(medium, true), medium: *medium }))
}

/// The refracted ray in the plane: cosine with the inward normal, and products with the offset.
pub(super) struct Ray {
    cos: f64,
    sin: f64,
    /// Offset squared, and its component along the ray's trace.
    r2: f64,
    along: f64,
}

impl Ray {
    /// Returns the ray of a direction into the medium, seen from an offset in the plane.
    pub(super) fn new(w: DVec3, n: DVec3, flat: DVec3) -> Self {
        let cos = -w.dot(n);
        let trace = w + n * cos;
        let sin = trace.length();
        let along = if sin > 0.0 { flat.dot(trace) / sin } else { 0.0 };
        Self { cos, sin, r2: flat.length_squared(), along }
    }

    /// Returns the distance along the ray to the point nearest to the exit, and the distance there.
    fn closest(&self) -> (f64, f64) {
        let nearest = self.sin * self.along;
        (nearest, (self.r2 - nearest * nearest).max(0.0).sqrt())
    }

    /// Returns what a point of the ray gives the exit by single scattering \[1/L^3\].
    fn single_at(&self, m: &OpticalProperties, t: f64) -> f64 {
        let z = t * self.cos;
        let d2 = self.rho2(t) + z * z;
        let d = d2.sqrt();
        if d == 0.0 {
            return 0.0;
        }
        let cos_o = z / d;
        // Deflection between the ray and the direction to the exit point, whose height over the ray's point is z.
        let deflection = ((self.sin * (self.along - t * self.sin) - self.cos * z) / d).clamp(-1.0, 1.0);
        let flight = (-m.sigma_t() * (t + d)).exp();
        m.sigma_s() * flight * henyey_greenstein(deflection, m.g()) * transmitted(cos_o, m.eta()) * cos_o / d2
    }

    /// Returns an estimate of [`Ray::single`] from one point of the ray.
    pub(super) fn one_single(&self, m: &OpticalProperties, choice: f64, u: f64) -> f64 {
        let (nearest, h) = self.closest();
        let (t, density) = equiangular(nearest, h, 1.0 / m.sigma_t(), choice, u);
        self.single_at(m, t) / density
    }

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

    /// Returns the exitance of single scattering \[1/L^2\].
    pub(super) fn single(&self, m: &OpticalProperties) -> f64 {
        let eta = m.eta();
        // Total reflection ends where rho^2 = z^2 / (eta^2 - 1): a quadratic in t.
        let mut critical = Vec::new();
        if eta > 1.0 {
            let a = self.sin * self.sin - self.cos * self.cos / (eta * eta - 1.0);
            let b = self.sin * self.along;
            let root = (b * b - a * self.r2).max(0.0).sqrt();
            // The two roots in the form that does not divide by a near 0.
            critical
                .extend([self.r2 / (b + root), self.r2 / (b - root)].into_iter().filter(|t| t.is_finite() && *t > 0.0));
            // Squares around a root of 1 - F: grade towards it.
            let fine: Vec<f64> = critical
                .iter()
                .flat_map(|c| (1..12).flat_map(move |k| [c * (1.0 + 0.25f64.powi(k)), c * (1.0 - 0.25f64.powi(k))]))
                .collect();
            critical.extend(fine);
        }
        let mfp = 1.0 / m.sigma_t();
        Rule::composite(POINTS, &self.breaks(mfp, 45.0 * mfp, &critical)).integrate(|t| self.single_at(m, t))
    }
}

/// Returns what a point of the ray gives the exit by multiple scattering \[1/L^3\].
fn multiple_at(b: &Beam<f64>, ray: &Ray, t: f64) -> f64 {
    let z = t * ray.cos;
    let rho = ray.rho2(t).sqrt();
    let d = (rho * rho + z * z).sqrt();
    let correction = -(-2.0 * b.sigma * (d + t)).exp_m1();
    let pair = image_pair(rho, z, -(z + b.two_z_e), b.diffusion, b.kappa, &b.boundary);
    b.amplitude * b.sigma * (-b.sigma * t).exp() * pair * correction
}

impl Oblique {
    fn multiple(&self, ray: &Ray) -> f64 {
        let mfp = 1.0 / self.beam.sigma;
        Rule::composite(POINTS, &ray.breaks(mfp, 45.0 * mfp, &[])).integrate(|t| multiple_at(&self.beam, ray, t))
    }
}

/// The offset turned into the tangent plane of the entry point; it keeps its length.
fn flattened(at: &Placement) -> DVec3 {
    (at.offset - at.n_i * at.offset.dot(at.n_i)).normalize_or_zero() * at.offset.length()
}

/// The model by one point of the beam.
#[derive(Debug)]
struct Sampled {
    beam: Beam<f64>,
    medium: OpticalProperties,
}

impl Directed for Sampled {
    fn estimate(&self, at: &Placement, u: [f64; 4]) -> f64 {
        let Some(w) = at.refracted(self.medium.eta()) else {
            return 0.0;
        };
        let ray = Ray::new(w, at.n_i, flattened(at));
        let (nearest, h) = ray.closest();
        // A few points, evenly turned from the first: they cost little beside the ray that led here.
        let turned = |u: f64, k: usize| (u + k as f64 / AT_ONCE as f64).fract();
        let sum: f64 = (0..AT_ONCE)
            .map(|k| {
                let (t, density) = equiangular(nearest, h, 1.0 / self.beam.sigma, turned(u[0], k), turned(u[1], 3 * k));
                let single = ray.one_single(&self.medium, turned(u[2], k), turned(u[3], 3 * k));
                multiple_at(&self.beam, &ray, t) / density + single
            })
            .sum();
        sum / AT_ONCE as f64
    }
}

impl Bssrdf for Oblique {
    fn info(&self) -> &'static Info {
        &photon_beam::INFO
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
        let ray = Ray::new(w, at.n_i, flattened(at));
        self.multiple(&ray) + ray.single(self.profile.medium())
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use moonmilk_core::{Random, Stream};

    use super::*;
    use crate::profile::table::radial_rule;

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
    fn one_point_of_the_beam_has_the_quadrature_for_its_mean() {
        for (eta, w_i) in [(1.0, DVec3::new(0.6, 0.0, 0.8)), (1.4, DVec3::new(0.96, 0.0, 0.28))] {
            let m = OpticalProperties::from_albedo(1.0, 0.95, 0.3, eta).unwrap();
            let (full, one) = (bssrdf(&m).unwrap(), directed(&m).unwrap());
            for (x, y) in [(0.1, 0.05), (-0.8, 0.3), (3.0, 1.0)] {
                let at = Placement::on_plane(x, y, w_i);
                let mut r = Stream::new(&[11]);
                let n = 200_000;
                let e: Vec<f64> =
                    (0..n).map(|_| one.estimate(&at, std::array::from_fn(|_| f64::from(r.uniform())))).collect();
                let mean = e.iter().sum::<f64>() / f64::from(n);
                let error = (e.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(n).powi(2)).sqrt();
                let exact = full.exitance(&at);
                // 4.9 standard errors: a two-sided significance of 1e-6 each; the quadrature is good to 1e-5.
                assert!(
                    (mean - exact).abs() < 4.9 * error && error < 0.01 * exact,
                    "{eta} {x}: {mean} {error} {exact}"
                );
            }
        }
    }

    #[test]
    fn single_scattering_of_oblique_light_has_its_closed_total() {
        // Matched, isotropic: (alpha / 2) (1 - mu ln(1 + 1 / mu)) for light at the cosine mu.
        let m = OpticalProperties::from_albedo(1.0, 1.0, 0.0, 1.0).unwrap();
        for mu in [0.3, 0.8] {
            let sin = (1.0f64 - mu * mu).sqrt();
            let steps = 48;
            let sum: f64 = (0..steps)
                .map(|k| {
                    let cos = (2.0 * PI * (f64::from(k) + 0.5) / f64::from(steps)).cos();
                    radial_rule(1e-4, 40.0, 10)
                        .integrate(|r| r * Ray { cos: mu, sin, r2: r * r, along: r * cos }.single(&m))
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
