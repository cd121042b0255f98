//! How far a profile is from another of the same medium, in numbers.

use std::f64::consts::PI;

use super::Prepared;

/// Steps of ln r; with them the trapezoidal rule is exact to 1e-4 on profiles that change over a mean free path.
const STEP: f64 = 0.005;
/// First and last radius \[mean free paths\]. Below, a profile 1/r holds 1e-6 of the light; beyond, 1/r^3 of a medium without absorption 1e-4.
const RANGE: [f64; 2] = [1e-6, 1e4];

/// How far one profile is from another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// Light at the wrong radius: integral of |R - R_exact| 2 pi r dr over that of R_exact.
    pub l1: f64,
    /// Light in all: albedo over exact albedo, minus 1.
    pub total: f64,
}

/// Returns the distance of a profile from another.
///
/// $$ L_1 = \frac{\int |R - \hat R|\, 2\pi r\, dr}{\int \hat R\, 2\pi r\, dr}, \qquad \frac{\int R\, 2 \pi r\, dr}{\int \hat R\, 2 \pi r\, dr} - 1. $$
///
/// `mfp` is the mean free path of their medium \[L\], the unit in which the range of radii is meant.
/// *Accuracy*: that of the baked forms (3e-4 of the energy), plus 1e-4 of the quadrature (test against a closed form).
pub fn distance(test: &Prepared, exact: &Prepared, mfp: f64) -> Distance {
    let count = ((RANGE[1] / RANGE[0]).ln() / STEP).ceil() as u32;
    let (mut off, mut all) = (0.0, 0.0);
    for i in 0..=count {
        let r = RANGE[0] * mfp * (STEP * f64::from(i)).exp();
        // 2 pi r dr = 2 pi r^2 d(ln r).
        let weight = 2.0 * PI * r * r * STEP;
        let (a, b) = (test.eval(r), exact.eval(r));
        off += weight * (a - b).abs();
        all += weight * b;
    }
    Distance { l1: off / all, total: test.total() / exact.total() - 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OpticalProperties;
    use crate::profile::find;

    #[test]
    fn gaussians_of_one_total_have_the_distance_of_the_closed_form() {
        // Two Gaussians exp(-r^2 / 2v) / (2 pi v): they cross where r^2 = 2 ln k / (1/v - 1/(k v)); the distance is twice the difference of
        // their shares within. The model's variance falls with the square of the extinction at equal albedos.
        let medium = OpticalProperties::new(0.1, 0.9, 0.0, 1.3).unwrap();
        let twice = OpticalProperties::new(0.2, 1.8, 0.0, 1.3).unwrap();
        let model = find("gaussian").unwrap();
        let d = distance(&model.prepare(&twice).unwrap(), &model.prepare(&medium).unwrap(), 1.0);
        let k: f64 = 4.0;
        let share = |ratio: f64| 1.0 - (-k.ln() / (k - 1.0) * ratio).exp();
        let expected = 2.0 * (share(k) - share(1.0));
        assert!((d.l1 / expected - 1.0).abs() < 2e-3 && d.total.abs() < 1e-4, "{d:?}, {expected}");
    }

    #[test]
    fn a_profile_is_at_no_distance_from_itself_and_a_published_one_at_the_published() {
        let medium = OpticalProperties::new(0.01, 0.99, 0.0, 1.5).unwrap();
        let exact = find("tabulated").unwrap().prepare(&medium).unwrap();
        assert_eq!(distance(&exact, &exact, 1.0), Distance { l1: 0.0, total: 0.0 });
        let dipole = distance(&find("dipole").unwrap().prepare(&medium).unwrap(), &exact, 1.0);
        // Its own file: albedo within 2 % at alpha = .99, but most light near the source at the wrong radius.
        assert!(dipole.total.abs() < 0.025 && dipole.l1 > 0.1, "{dipole:?}");
    }
}
