//! Reflection and refraction at smooth boundaries, and the angular moments of the reflectance.
//!
//! Arguments are named by physics: `n_transmitted_over_incident` is the index beyond the boundary over the one on the side that
//! the light comes from. With `eta` = inside / outside it is `eta` for light that enters and `1 / eta` for light that leaves.

pub mod fits;

use moonmilk_core::quadrature::Rule;
use moonmilk_core::{Spectrum, Vec3};

/// Reflectance of a boundary with the cosine of the refracted direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric<T> {
    /// Unpolarised Fresnel reflectance, in \[0, 1\].
    pub reflectance: T,
    /// Cosine between the refracted direction and the normal on its side; 0 if all light is reflected.
    pub cos_transmitted: T,
}

macro_rules! dielectric {
    ($name:ident, $reflectance:ident, $t:ty, $precision:literal) => {
        /// Returns the unpolarised Fresnel reflectance of a dielectric boundary and the refracted cosine, in
        #[doc = $precision]
        ///
        /// r_s = (c - n c_t) / (c + n c_t), r_p = (n c - c_t) / (n c + c_t), F = (r_s^2 + r_p^2) / 2, with c_t^2 = (n^2 - 1 + c^2) / n^2.
        /// *Domain*: `cos_incident` in \[0, 1\], ratio > 0. A ratio of exactly 1 reflects exactly nothing (but at grazing
        /// incidence, cosine 0, everything).
        #[inline]
        pub fn $name(cos_incident: $t, n_transmitted_over_incident: $t) -> Dielectric<$t> {
            let (c, n) = (cos_incident, n_transmitted_over_incident);
            // Factored so that a ratio near 1 keeps its digits and a ratio of 1 gives c_t = c.
            let ct2 = (n - 1.0) * (n + 1.0) + c * c;
            if ct2 <= 0.0 {
                return Dielectric { reflectance: 1.0, cos_transmitted: 0.0 };
            }
            let ct = ct2.sqrt() / n;
            let r_s = (c - n * ct) / (c + n * ct);
            let r_p = (n * c - ct) / (n * c + ct);
            Dielectric { reflectance: 0.5 * (r_s * r_s + r_p * r_p), cos_transmitted: ct }
        }

        /// Returns the unpolarised Fresnel reflectance alone, in
        #[doc = $precision]
        #[inline]
        pub fn $reflectance(cos_incident: $t, n_transmitted_over_incident: $t) -> $t {
            $name(cos_incident, n_transmitted_over_incident).reflectance
        }
    };
}
dielectric!(dielectric, reflectance, f32, "f32.");
dielectric!(dielectric_f64, reflectance_f64, f64, "f64.");

/// Returns the reflected direction; `w` and the result point away from the surface, on the same side.
#[inline]
pub fn reflect(w: Vec3, n: Vec3) -> Vec3 {
    n * (2.0 * w.dot(n)) - w
}

/// Returns the refracted direction, or `None` where all light is reflected.
///
/// `w` points away from the surface towards where the light comes from (or goes to: the path is reversible), on the side of the normal `n`;
/// the result points away on the other side. *Domain*: w . n > 0.
#[inline]
pub fn refract(w: Vec3, n: Vec3, n_transmitted_over_incident: f32) -> Option<Vec3> {
    let c = w.dot(n);
    let ct = dielectric(c, n_transmitted_over_incident).cos_transmitted;
    if ct <= 0.0 {
        return None;
    }
    let t = (n * c - w) * (1.0 / n_transmitted_over_incident) - n * ct;
    // Renormalise so that rounding does not grow over a thousand refractions.
    Some(t.normalize())
}

/// Returns the unpolarised Fresnel reflectance of a conductor of complex index `eta` + i `k` relative to the outside.
///
/// *Domain*: `cos_incident` in \[0, 1\], eta > 0, k >= 0. *Source*: Born & Wolf, 14.2; k = 0 gives the dielectric's value.
#[inline]
pub fn conductor(cos_incident: f32, eta: f32, k: f32) -> f32 {
    let c = cos_incident;
    let (c2, s2) = (c * c, 1.0 - c * c);
    // a^2 + b^2 is the squared modulus of the (complex) eta cos_t.
    let t0 = eta * eta - k * k - s2;
    let a2b2 = t0.hypot(2.0 * eta * k);
    let a = (0.5 * (a2b2 + t0)).max(0.0).sqrt();
    let r_s = (a2b2 + c2 - 2.0 * a * c) / (a2b2 + c2 + 2.0 * a * c);
    let r_p = r_s * (c2 * a2b2 + s2 * s2 - 2.0 * a * c * s2) / (c2 * a2b2 + s2 * s2 + 2.0 * a * c * s2);
    if c == 0.0 { 1.0 } else { 0.5 * (r_s + r_p) }
}

/// Returns [`conductor`] in every lane.
#[inline]
pub fn conductor_lanes<const N: usize>(cos_incident: f32, eta: Spectrum<N>, k: Spectrum<N>) -> Spectrum<N> {
    eta.zip(k, |eta, k| conductor(cos_incident, eta, k))
}

/// Returns the moment of the reflectance of order m: the integral of F(mu) mu^m over mu in \[0, 1\], for light that hits
/// the boundary from a medium of relative index `n_incident_over_transmitted`.
///
/// 2 `moment(1)` is the reflectance for Lambertian light, 3 `moment(2)` its flux-weighted analogue. *Domain*: ratio > 0, m >= 0.
/// *Accuracy*: 1e-11 (tested against Walsh's closed form and the reciprocity of the first moment).
pub fn moment(m: i32, n_incident_over_transmitted: f64) -> f64 {
    let n = n_incident_over_transmitted;
    // Below the critical cosine everything is reflected.
    let critical2 = ((1.0 - 1.0 / n) * (1.0 + 1.0 / n)).max(0.0);
    let below = critical2.sqrt().powi(m + 1) / f64::from(m + 1);
    // Above it substitute mu = sqrt(critical^2 + t^2): F is smooth in t at the critical angle. The refracted cosine changes its course
    // at |1 - 1/n^2|^(1/2): grade the intervals around it.
    let scale = ((1.0 - 1.0 / n) * (1.0 + 1.0 / n)).abs().sqrt().max(1e-8);
    let end = (1.0 - critical2).sqrt();
    let mut breaks = vec![0.0];
    breaks.extend((-4..40).map(|i| scale * 2f64.powi(i)).take_while(|&b| b < end));
    breaks.push(end);
    let above = Rule::composite(24, &breaks).integrate(|t| {
        let mu = (critical2 + t * t).sqrt();
        let f = reflectance_f64(mu, 1.0 / n);
        if mu > 0.0 { f * mu.powi(m - 1) * t } else { 0.0 }
    });
    below + above
}

/// Returns C1, the first moment: see [`moment`].
pub fn moment_1(n_incident_over_transmitted: f64) -> f64 {
    moment(1, n_incident_over_transmitted)
}

/// Returns C2, the second moment: see [`moment`].
pub fn moment_2(n_incident_over_transmitted: f64) -> f64 {
    moment(2, n_incident_over_transmitted)
}

/// Returns the factor A = (1 + 3 C2) / (1 - 2 C1) of the diffusion boundary condition phi = 2 A D dphi/dz.
///
/// *Domain*: `eta` = inside / outside > 0; the moments are those of light inside.
pub fn boundary_factor(eta: f64) -> f64 {
    (1.0 + 3.0 * moment_2(eta)) / (1.0 - 2.0 * moment_1(eta))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (n_incident / n_transmitted, 2 C1, 3 C2): quadrature, all digits trusted (physics notes, 2.2).
    const MOMENTS: [(f64, f64, f64); 16] = [
        (0.5, 0.16059664, 0.13396508),
        (1.0 / 1.5, 0.09177796, 0.06304806),
        (1.0 / 1.4, 0.07681155, 0.04903861),
        (1.0 / 1.33, 0.06593085, 0.03941330),
        (1.0, 0.0, 0.0),
        (1.1, 0.19434492, 0.08791974),
        (1.2, 0.33630574, 0.19849618),
        (1.3, 0.44445670, 0.30026696),
        (1.33, 0.47194915, 0.32823852),
        (1.4, 0.52898548, 0.38878282),
        (1.45, 0.56450272, 0.42812732),
        (1.5, 0.59634576, 0.46443052),
        (1.6, 0.65087717, 0.52877736),
        (1.8, 0.73273285, 0.63029487),
        (2.0, 0.79014916, 0.70487006),
        (3.0, 0.91957816, 0.88268501),
    ];

    #[test]
    fn moments_agree_with_the_reference_table() {
        for (n, r1, r2) in MOMENTS {
            // Rounding of the table's last digit.
            assert!((2.0 * moment_1(n) - r1).abs() < 1e-8, "{n} {}", 2.0 * moment_1(n));
            assert!((3.0 * moment_2(n) - r2).abs() < 1e-8, "{n} {}", 3.0 * moment_2(n));
        }
        assert!((boundary_factor(1.33) - 2.51536).abs() < 1e-5);
    }

    #[test]
    fn the_first_moment_is_reciprocal_and_equals_walshs_closed_form() {
        for i in 1..200 {
            let n = 1.0 + 0.01 * f64::from(i);
            let (inside, outside) = (2.0 * moment_1(n), 2.0 * moment_1(1.0 / n));
            assert!((1.0 - inside - (1.0 - outside) / (n * n)).abs() < 1e-11, "{n}");
            let (n2, n4) = (n * n, n.powi(4));
            let walsh = 0.5 + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0).powi(2))
                - 2.0 * n.powi(3) * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
                + 8.0 * n4 * (n4 + 1.0) * n.ln() / ((n2 + 1.0) * (n4 - 1.0).powi(2))
                + n2 * (n2 - 1.0).powi(2) * ((n - 1.0) / (n + 1.0)).ln() / (n2 + 1.0).powi(3);
            // The closed form cancels like 1e-16 / (n - 1)^2.
            assert!((outside - walsh).abs() < 1e-11 + 1e-14 / (n - 1.0).powi(2), "{n} {outside} {walsh}");
        }
    }

    #[test]
    fn light_enters_and_leaves_with_the_same_reflectance() {
        for i in 1..100 {
            let c = f64::from(i) / 100.0;
            for n in [1.0, 1.001, 1.33, 1.5, 2.0] {
                let into = dielectric_f64(c, n);
                let back = dielectric_f64(into.cos_transmitted, 1.0 / n);
                // The cosine comes back from a difference of squares: its error is that of rounding over the cosine.
                assert!(
                    (into.reflectance - back.reflectance).abs() < 1e-14 / c
                        && (back.cos_transmitted - c).abs() < 1e-14 / c
                );
                // The same f32 arguments in both precisions: a few roundings of f32 remain.
                let (c, n) = (c as f32, n as f32);
                let double = reflectance_f64(f64::from(c), f64::from(n));
                assert!((f64::from(reflectance(c, n)) - double).abs() < 2e-6, "{c} {n}");
            }
        }
    }

    #[test]
    fn known_reflectances_are_met() {
        // Normal incidence ((n - 1) / (n + 1))^2; total reflection beyond the critical angle; nothing at a matched boundary.
        assert!((reflectance(1.0, 1.5) - 0.04).abs() < 1e-7);
        let critical = (1.0 - 1.0 / 2.25f32).sqrt();
        assert_eq!(reflectance(critical - 1e-3, 1.0 / 1.5), 1.0);
        assert!(reflectance(critical + 1e-3, 1.0 / 1.5) < 1.0);
        assert!((1..=1000).all(|i| reflectance(i as f32 / 1000.0, 1.0) == 0.0));
        // Brewster's angle tan = n: only s is reflected, ((n^2 - 1) / (n^2 + 1))^2.
        let c = 1.0 / (1.0 + 2.25f64).sqrt();
        assert!((reflectance_f64(c, 1.5) - 0.5 * (1.25f64 / 3.25).powi(2)).abs() < 1e-15);
    }

    #[test]
    fn refraction_obeys_snell_and_reverses() {
        let n = Vec3::new(0.2, -0.5, 0.8).normalize();
        for i in 0..500 {
            let (a, b) = (i as f32 * 0.618_034, i as f32 * 0.414_214);
            let w = Vec3::new(a.fract() - 0.5, b.fract() - 0.5, 0.1 + a.fract()).normalize();
            if w.dot(n) <= 0.0 {
                continue;
            }
            for ratio in [1.0f32, 1.33, 1.5, 1.0 / 1.33, 0.5] {
                let Some(t) = refract(w, n, ratio) else {
                    assert!(w.cross(n).length() > ratio * 0.999);
                    continue;
                };
                assert!(t.dot(n) < 0.0 && (t.cross(n).length() * ratio - w.cross(n).length()).abs() < 2e-6);
                let back = refract(t, -n, 1.0 / ratio).unwrap();
                // Near grazing, on either side, a cosine carries the rounding error over itself.
                let tolerance = 1e-6 / w.dot(n).min(-t.dot(n));
                assert!(back.distance(w) < tolerance, "{} {}", back.distance(w), tolerance);
            }
            assert!(reflect(w, n).dot(n) - w.dot(n) < 1e-6 && reflect(reflect(w, n), n).distance(w) < 1e-6);
        }
    }

    #[test]
    fn a_conductor_without_absorption_is_a_dielectric() {
        for i in 1..=100 {
            let c = i as f32 / 100.0;
            for n in [1.2, 1.5, 2.4] {
                assert!((conductor(c, n, 0.0) - reflectance(c, n)).abs() < 2e-6);
            }
            assert!((0.0..=1.0).contains(&conductor(c, 0.2, 3.4)));
        }
        // Normal incidence: ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2).
        assert!((conductor(1.0, 0.2, 3.4) - (0.64 + 11.56) / (1.44 + 11.56)).abs() < 1e-6);
        assert_eq!(conductor(0.0, 0.2, 3.4), 1.0);
    }
}
