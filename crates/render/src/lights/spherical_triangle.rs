//! Uniform directions towards a triangle: its solid angle and its sampling by solid angle.
//!
//! All in f64, and the density from [`solid_angle`] alone, so that it is the same number when a point is chosen and when
//! it is hit. The angles of a spherical triangle add up to pi plus its area, a sum that f32 cannot resolve for the many small triangles
//! of a mesh.

use std::f64::consts::PI;

use moonmilk_core::DVec3;

/// Returns the solid angle of a triangle seen from the origin [sr], in [0, 2 pi].
///
/// tan(omega / 2) = |a . (b x c)| / (|a||b||c| + (a.b)|c| + (b.c)|a| + (c.a)|b|), with the triple product taken from the
/// edges so that it stays accurate for small triangles. *Source*: \[VanOosterom1983, Eq. 8\].
pub fn solid_angle(v: &[DVec3; 3]) -> f64 {
    let [a, b, c] = *v;
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let triple = a.dot((b - a).cross(c - a)).abs();
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    // A vertex at the origin sees nothing of its own triangle.
    if triple == 0.0 { 0.0 } else { 2.0 * triple.atan2(denominator) }
}

/// Returns a unit direction from the origin, uniform within a triangle of solid angle `omega` (of [`solid_angle`]), for
/// two uniform variates.
///
/// The first variate cuts the spherical triangle a b c along a great circle from b to a point c' of the side a c, such that
/// a b c' holds that fraction of the area; the second is uniform in height 1 - cos on the arc b c'. *Source*: \[Arvo1995\].
pub fn sample_direction(v: &[DVec3; 3], omega: f64, u: [f64; 2]) -> DVec3 {
    let [a, b, c] = v.map(DVec3::normalize);
    // The angle at a, between the planes a b and a c, from unnormalised products: accurate for thin triangles too.
    let (n_ab, n_ac) = (a.cross(b), a.cross(c));
    let alpha = n_ab.cross(n_ac).length().atan2(n_ab.dot(n_ac));
    let (sin_alpha, cos_alpha) = alpha.sin_cos();
    let cos_c = a.dot(b);

    // With area A' = u omega and phi = A' - alpha, the side b' = a c' follows from spherical trigonometry:
    // cos b' = ((v cos phi - u sin phi) cos alpha - v) / ((v sin phi + u cos phi) sin alpha).
    let (sin_phi, cos_phi) = (u[0] * omega - alpha).sin_cos();
    let p = cos_phi - cos_alpha;
    let q = sin_phi + sin_alpha * cos_c;
    let divisor = (q * sin_phi + p * cos_phi) * sin_alpha;
    let cos_b_prime =
        if divisor.abs() > 0.0 { ((q * cos_phi - p * sin_phi) * cos_alpha - q) / divisor } else { a.dot(c) };
    let cos_b_prime = cos_b_prime.clamp(a.dot(c).min(1.0), 1.0);

    // Walk from a along the side a c, then from b along the arc b c'.
    let c_prime = along(a, c, cos_b_prime);
    let cos_theta = 1.0 - u[1] * (1.0 - c_prime.dot(b));
    along(b, c_prime, cos_theta)
}

/// Returns the unit vector in the plane of two unit vectors at the angle of given cosine from the first.
fn along(from: DVec3, towards: DVec3, cosine: f64) -> DVec3 {
    let tangent = (towards - from * from.dot(towards)).normalize_or_zero();
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    (from * cosine + tangent * sine).normalize()
}

/// Largest solid angle that is sampled by directions: beyond it the vertices are all but antipodal in one plane.
pub const LARGEST: f64 = 2.0 * PI - 1e-5;

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Random, Stream};

    #[test]
    fn an_octant_has_an_eighth_of_the_sphere() {
        let octant = [DVec3::X, DVec3::Y * 3.0, DVec3::Z * 0.2];
        assert!((solid_angle(&octant) - PI / 2.0).abs() < 1e-14);
    }

    #[test]
    fn small_triangles_have_the_solid_angle_of_their_projected_area() {
        for k in 0..8 {
            let s = 10f64.powi(-k);
            let far = DVec3::new(0.0, 0.0, 1000.0);
            let v = [far, far + DVec3::X * s, far + DVec3::Y * s];
            // Next order: relative s^2 / 1e6.
            assert!((solid_angle(&v) / (0.5 * s * s * 1e-6) - 1.0).abs() < 2e-6, "{k}");
        }
    }

    #[test]
    fn directions_halve_the_triangle_into_equal_areas() {
        // The great circle from a vertex to any point of the opposite side cuts off a part whose share of the samples is its
        // share of the area. 6 triangles x 3 cuts; |z| < 4.6 is a significance of 1e-4 after Sidak.
        let n = 40_000;
        for t in 0..6u64 {
            let mut r = Stream::new(&[11, t]);
            let mut point = || DVec3::from_array([0; 3].map(|_| f64::from(r.uniform()) * 2.0 - 1.0));
            let v = [point(), point(), point()];
            let omega = solid_angle(&v);
            for cut in 0..3 {
                let [a, b, c] = [v[cut], v[(cut + 1) % 3], v[(cut + 2) % 3]];
                let m = b * 0.3 + c * 0.7;
                let p = solid_angle(&[a, b, m]) / omega;
                let side = a.cross(m);
                let mut inside = 0;
                for _ in 0..n {
                    let w = sample_direction(&v, omega, [f64::from(r.uniform()), f64::from(r.uniform())]);
                    inside += u32::from(side.dot(w) * side.dot(b) > 0.0);
                }
                let z = (f64::from(inside) - p * f64::from(n)) / (f64::from(n) * p * (1.0 - p)).sqrt();
                assert!(z.abs() < 4.6, "triangle {t}, cut {cut}: z = {z}");
            }
        }
    }
}
