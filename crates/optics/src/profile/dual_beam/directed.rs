//! The dual beam for any two directions: one random point on each beam.
//!
//! $$ \pi\, L_o = \frac{\alpha'^2}{4} \int\!\!\int e^{-u-v}\, \phi_M(x_o - u\,\omega_o,\; x_i - v\,\omega_i)\, du\, dv \;+\; M_1(x_o; \omega_i) $$
//!
//! u is exponential; v exponential or equiangular about the point on the beam of view, by the balance heuristic \[Kulla2012\], which takes out the 1/d^2 of the uncollided part. Single
//! scattering joins only rays that meet: its exitance is spread over all directions.

use moonmilk_core::DVec3;

use crate::error::{Error, within};
use crate::properties::OpticalProperties;

use super::super::bssrdf::{Directed, Placement, equiangular};
use super::super::oblique::Ray;
use super::Connection;

/// The estimator of one medium; F is the factor of the image offset.
#[derive(Debug)]
struct Beams {
    medium: OpticalProperties,
    connection: Connection<f64>,
}

/// Builds the estimator of the corrected model.
pub(crate) fn corrected(medium: &OpticalProperties) -> Result<Box<dyn Directed>, Error> {
    new(medium, 2.0)
}

/// Builds the estimator of the published code's model.
pub(crate) fn as_published(medium: &OpticalProperties) -> Result<Box<dyn Directed>, Error> {
    new(medium, 1.0)
}

fn new(medium: &OpticalProperties, factor: f64) -> Result<Box<dyn Directed>, Error> {
    within("eta", medium.eta() as f32, medium.eta() == 1.0, "[1, 1]: the model is index-matched")?;
    Ok(Box::new(Beams { medium: *medium, connection: Connection::new(medium, factor) }))
}

impl Directed for Beams {
    fn estimate(&self, at: &Placement, u: [f64; 4]) -> f64 {
        let (w_i, w_o) = (at.w_i, at.w_o);
        if w_i.dot(at.n_i) <= 0.0 || w_o.dot(at.n_o) <= 0.0 {
            return 0.0;
        }
        let (c, sigma) = (&self.connection, self.medium.sigma_t_prime());
        // On the plane of the entry point, in reduced mean free paths; the view is turned with the normal.
        let length = at.offset.length();
        let flat = (at.offset - at.n_i * at.offset.dot(at.n_i)).normalize_or_zero() * (length * sigma);
        let cos_o = w_o.dot(at.n_o);
        let aside = w_o - at.n_o * cos_o;
        let across = (aside - at.n_i * aside.dot(at.n_i)).normalize_or_zero() * aside.length();
        let y = flat - (across + at.n_i * cos_o) * -(1.0 - u[0]).ln();
        // A point on the beam of light, seen from there.
        let (nearest, h) = closest(y, -w_i);
        let (v, density) = equiangular(nearest, h, 1.0, u[1], u[2]);
        let s = -w_i * v;
        let (deep_y, deep_s) = (-y.dot(at.n_i), -s.dot(at.n_i));
        let apart2 = (y - s).length_squared() - (deep_y - deep_s).powi(2);
        let multiple = (-v).exp() * c.eval(apart2.max(0.0), deep_y, deep_s) / density;
        let ray = Ray::new(-w_i, at.n_i, flat / sigma);
        c.alpha * c.alpha / 4.0 * multiple * sigma * sigma + ray.one_single(&self.medium, u[3], u[1])
    }
}

/// Returns the distance along a ray from the origin to the point nearest to y, and the distance there.
fn closest(y: DVec3, d: DVec3) -> (f64, f64) {
    let along = y.dot(d);
    (along, (y.length_squared() - along * along).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use moonmilk_core::{Random, Stream};

    use super::super::multiple_radiance;
    use super::*;
    use crate::profile::Profile;
    use crate::profile::find;

    fn mean(d: &dyn Directed, at: &Placement, n: u64) -> (f64, f64) {
        let mut r = Stream::new(&[7]);
        let x: Vec<f64> = (0..n).map(|_| d.estimate(at, std::array::from_fn(|_| f64::from(r.uniform())))).collect();
        let m = x.iter().sum::<f64>() / n as f64;
        (m, (x.iter().map(|x| (x - m).powi(2)).sum::<f64>() / (n - 1) as f64 / n as f64).sqrt())
    }

    #[test]
    fn the_mean_is_the_quadrature_for_any_two_directions() {
        let m = OpticalProperties::from_albedo(1.0, 0.9, 0.0, 1.0).unwrap();
        let d = corrected(&m).unwrap();
        for (x, a, b) in [
            (DVec3::new(0.4, 0.1, 0.0), DVec3::new(0.6, 0.0, 0.8), DVec3::new(-0.2, 0.5, 0.6).normalize()),
            (DVec3::new(-2.0, 0.5, 0.0), DVec3::new(0.0, 0.28, 0.96), DVec3::Z),
        ] {
            let at = Placement { w_o: b, ..Placement::on_plane(x.x, x.y, a) };
            let flat = Ray::new(-a, DVec3::Z, x).single(&m);
            let exact = PI * multiple_radiance(&m, x, a, b).unwrap() + flat;
            let (e, error) = mean(d.as_ref(), &at, 400_000);
            // 4.9 standard errors: a two-sided significance of 1e-6 each.
            assert!((e - exact).abs() < 4.9 * error && error < 0.02 * exact, "{e} {error} {exact}");
        }
    }

    #[test]
    fn over_all_directions_of_view_it_is_the_radial_profile() {
        let m = OpticalProperties::from_albedo(1.0, 0.8, 0.0, 1.0).unwrap();
        let d = corrected(&m).unwrap();
        let profile: Box<dyn Profile> = find("dual-beam").unwrap().build(&m).unwrap();
        for r in [0.3, 1.5] {
            // Cosine-weighted over the hemisphere.
            let mut random = Stream::new(&[3]);
            let n = 1_000_000;
            let x: Vec<f64> = (0..n)
                .map(|_| {
                    let (mu2, phi) = (f64::from(random.uniform()), 2.0 * PI * f64::from(random.uniform()));
                    let sin = (1.0 - mu2).sqrt();
                    let w_o = DVec3::new(sin * phi.cos(), sin * phi.sin(), mu2.sqrt());
                    let at = Placement { w_o, ..Placement::on_plane(r, 0.0, DVec3::Z) };
                    d.estimate(&at, std::array::from_fn(|_| f64::from(random.uniform())))
                })
                .collect();
            let e = x.iter().sum::<f64>() / f64::from(n);
            let error = (x.iter().map(|x| (x - e).powi(2)).sum::<f64>() / f64::from(n).powi(2)).sqrt();
            let exact = profile.eval(r);
            // The profile's quadrature is good to 3e-3.
            let off = ((e - exact).abs() - 3e-3 * exact).max(0.0);
            assert!(off < 4.9 * error && error < 0.01 * exact, "{r}: {e} {error} {exact}");
        }
    }
}
