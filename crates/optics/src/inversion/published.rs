//! Published inversions from surface albedo to single-scattering albedo, and what they really invert.
//!
//! The exact inverse is [`super::AlbedoTable`]. These are what other programs use; none says in its name which albedo it means. Errors: albedo of the alpha
//! returned, minus the albedo asked for, against the exact half-space (test `round_trip_errors_are_the_measured_ones`).
//!
//! | function | used by | inverts | error |
//! |---|---|---|---|
//! | [`kulla_conty`] | OpenPBR, Cycles, appleseed | diffuse, eta 1 | .002; against normal incidence up to -.063 |
//! | [`chiang`] | Hyperion | diffuse, eta 1 | .006 to A = .8, then -.03 (.9) to -.07 (.99): white is impossible |
//! | [`wrenninge`] | older Cycles | diffuse, eta 1, with g | .007 to .7, .038 at .9; exceeds 1 above A = .93 |
//! | [`deon_third`] | | diffuse, eta 1 | 1e-5 |
//! | [`deon_2021`] | | diffuse, eta 1 | 3e-4 to .6, .0045 at .9 |
//! | [`jensen_buhler`] | dipoles | normal, any eta, of the classic dipole | up to -.021 at 1.33, -.05 at 1.5 |

use crate::error::{Error, within};
use crate::profile::dipole::diffuse_reflectance_fit;

pub use crate::conventions::kulla_conty_alpha as kulla_conty;

/// Returns alpha of the artist's albedo: 1 - exp(-5.09406 A + 2.61188 A^2 - 4.31805 A^3). *Source*: \[Chiang2016\].
pub fn chiang(albedo: f64) -> f64 {
    let a = albedo;
    -(a * (-5.09406 + a * (2.61188 - 4.31805 * a))).exp_m1()
}

/// Returns the scale s with sigma_t = 1 / (s d) for the artist's scatter distance d: 1.9 - A + 3.5 (A - .8)^2. *Source*: \[Chiang2016\].
pub fn chiang_scale(albedo: f64) -> f64 {
    crate::profile::normalized::diffuse_scale(albedo)
}

/// Coefficients of the six functions of g, constant term first; the second and the fifth are arguments of an exponential.
const WRENNINGE: [[f64; 8]; 6] = [
    [
        1.8260523782,
        -1.28451056436,
        -1.79904629312,
        9.19393289202,
        -22.8215585862,
        32.0234874259,
        -23.6264803333,
        7.21067002658,
    ],
    [0.0, 31.1491581433, -201.847017512, 841.576016723, -2018.09288505, 2731.71560286, -1935.41424244, 559.009054474],
    [
        1.09686102424,
        -0.394704063468,
        1.05258115941,
        -8.83963712726,
        28.8643230661,
        -46.8802913581,
        38.5402837518,
        -12.7181042538,
    ],
    [
        0.496310210422,
        0.360146581622,
        -2.15139309747,
        17.8896899217,
        -55.2984010333,
        82.065982243,
        -58.5106008578,
        15.8478295021,
    ],
    [0.0, 76.7316253952, -594.356773233, 2448.8834203, -5576.68528998, 7116.60171912, -4763.54467887, 1303.5318055],
    [
        2.40602999408,
        -2.51814844609,
        9.18494908356,
        -79.2191708682,
        259.082868209,
        -403.613804597,
        302.85712436,
        -87.4370473567,
    ],
];

/// Returns alpha of an albedo at asymmetry g in \[0, .9\]; more than 1 for albedos above about .93, as published. *Source*: \[Wrenninge2017\].
pub fn wrenninge(albedo: f64, g: f64) -> f64 {
    let p = WRENNINGE.map(|c| c.iter().rev().fold(0.0, |sum, x| sum * g + x));
    let b = 4.98511194385 + 0.127355959438 * p[1].exp();
    let e = 4.23190299701 + 0.00310603949088 * p[4].exp();
    let t = albedo.powf(0.25);
    (1.0 - t) * p[0] * (b * albedo).atan().powf(p[2]) + t * p[3] * (e * albedo).atan().powf(p[5])
}

/// Returns alpha of the index-matched albedo for diffuse light: d'Eon's third inverse. *Accuracy*: 1e-5 in the albedo. *Source*: \[DEon2016\].
pub fn deon_third(albedo: f64) -> f64 {
    let a = albedo;
    let roots =
        (0.394_170_980_892_052_27 + a) * (0.566_708_712_988_374_2 + a).sqrt() * (15.803_432_476_716_953 + a).sqrt();
    let numerator = -1.089_356_410_176_410_8 - 2.301_144_382_010_027_5 * a - 0.824_791_315_051_126_5 * a * a
        + 0.923_484_659_401_138_8 * roots;
    numerator / (0.546_192_829_487_865_5 + a).powi(2)
}

/// Returns alpha of the index-matched albedo for diffuse light, d'Eon's form of 2021. *Source*: \[DEon2016\].
pub fn deon_2021(albedo: f64) -> f64 {
    let a = albedo;
    let inner = |p: f64, q: f64| (1.0 - a.powf(p)).powf(q);
    (1.0 - inner(0.9754096677, 2.1161676028)) / (1.0 - 0.5184951530 * inner(1.1452914346, 2.1001086363))
}

/// Returns the classic dipole's albedo of a reduced single-scattering albedo. *Source*: \[Jensen2001\].
pub fn dipole_albedo(alpha_prime: f64, eta: f64) -> f64 {
    let f = diffuse_reflectance_fit(eta);
    let a = (1.0 + f) / (1.0 - f);
    let s = (3.0 * (1.0 - alpha_prime)).sqrt();
    0.5 * alpha_prime * (1.0 + (-4.0 / 3.0 * a * s).exp()) * (-s).exp()
}

/// Returns the reduced single-scattering albedo whose classic dipole has this albedo, by bisection. *Source*: \[Jensen2002\].
///
/// *Errors*: an albedo outside \[0, 1\], eta outside \[.5, 3\].
pub fn jensen_buhler(albedo: f64, eta: f64) -> Result<f64, Error> {
    within("albedo", albedo as f32, (0.0..=1.0).contains(&albedo), "[0, 1]")?;
    within("eta", eta as f32, (0.5..=3.0).contains(&eta), "[0.5, 3]")?;
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..52 {
        let middle = 0.5 * (low + high);
        if dipole_albedo(middle, eta) < albedo { low = middle } else { high = middle }
    }
    Ok(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::halfspace::{HFunction, HalfSpace, Illumination};

    fn diffuse(alpha: f64) -> f64 {
        HFunction::new(alpha).unwrap().diffuse_albedo()
    }

    #[test]
    fn round_trip_errors_are_the_measured_ones() {
        // Physics notes, 6.2; printed digits.
        for i in 1..20 {
            let a = 0.05 * f64::from(i);
            assert!((diffuse(kulla_conty(a, 0.0)) - a).abs() < 2.1e-3, "{a}");
            assert!((diffuse(deon_third(a)) - a).abs() < 1e-5, "{a} {:e}", diffuse(deon_third(a)) - a);
            if a < 0.805 {
                assert!((diffuse(chiang(a)) - a).abs() < 5.7e-3, "{a}");
            }
            if a < 0.705 {
                assert!((0.0..0.0075).contains(&(diffuse(wrenninge(a, 0.0)) - a)), "{a}");
            }
            if a < 0.605 {
                assert!((diffuse(deon_2021(a)) - a).abs() < 3.5e-4, "{a}");
            }
        }
        for (a, e) in [(0.9, -0.030), (0.95, -0.049), (0.99, -0.069)] {
            assert!((diffuse(chiang(a)) - a - e).abs() < 6e-4, "{a}");
        }
        assert!((diffuse(wrenninge(0.9, 0.0)) - 0.9 - 0.038).abs() < 6e-4 && wrenninge(0.95, 0.0) > 1.0);
        assert!((diffuse(deon_2021(0.9)) - 0.9 - 0.0045).abs() < 6e-5);
        assert!((chiang(1.0) - 0.99889).abs() < 6e-6 && (chiang_scale(0.5) - 1.715).abs() < 1e-12);
        // What the shared inverse does for light along the normal.
        for (a, e) in [(0.05, -0.011), (0.2, -0.038), (0.5, -0.0625), (0.8, -0.041), (0.95, -0.012)] {
            let normal = HFunction::new(kulla_conty(a, 0.0)).unwrap().plane_albedo(1.0);
            assert!((normal - a - e).abs() < 6e-4, "{a} {}", normal - a);
        }
    }

    #[test]
    fn the_dipoles_inverse_has_its_measured_errors() {
        for (eta, a, e) in [
            (1.33, 0.05, -0.010),
            (1.33, 0.2, -0.021),
            (1.33, 0.4, -0.003),
            (1.33, 0.95, 0.003),
            (1.5, 0.05, -0.019),
            (1.5, 0.2, -0.050),
            (1.5, 0.4, -0.023),
        ] {
            let alpha = jensen_buhler(a, eta).unwrap();
            assert!((dipole_albedo(alpha, eta) - a).abs() < 1e-12);
            let exact = HalfSpace::new(alpha, eta).unwrap().albedo(Illumination::Normal);
            assert!((exact - a - e).abs() < 6e-4, "{eta} {a} {}", exact - a);
        }
        assert_eq!(jensen_buhler(1.5, 1.3).unwrap_err().to_string(), "albedo = 1.5 is outside [0, 1]");
    }
}
