//! Elementary functions of the inner loop.

use std::f32::consts::FRAC_PI_4;

use moonmilk_core::Vec3;

/// Returns (sin, cos) of 2 pi u for u in [0, 1].
///
/// Reduces to the nearest of eight octants and evaluates Taylor polynomials on [-pi/4, pi/4].
/// *Accuracy*: absolute error below 2e-7 (tested), that of f32 itself.
#[inline]
pub fn sin_cos_turn(u: f32) -> (f32, f32) {
    let quarter = (u * 4.0 + 0.5).floor();
    let x = (u * 4.0 - quarter) * (2.0 * FRAC_PI_4);
    let x2 = x * x;
    let s = x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0 + x2 * (1.0 / 362_880.0)))));
    let c =
        1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40_320.0 - x2 * (1.0 / 3_628_800.0)))));
    // Exchange and negate by bits: the octant is random, and a branch on it would be mispredicted half the time.
    let q = quarter as i32 as u32;
    let odd = q & 1 != 0;
    let (a, b) = (if odd { c } else { s }, if odd { s } else { c });
    let flip = |x: f32, bit: u32| f32::from_bits(x.to_bits() ^ ((bit & 2) << 30));
    (flip(a, q), flip(b, q + 1))
}

/// Returns -ln(u), an exponential variate, for u in (0, 1).
///
/// u = 2^k m with m in \[sqrt 1/2, sqrt 2); ln m = 2 artanh(s), s = (m - 1) / (m + 1), five terms of the series.
/// *Accuracy*: relative error below 3e-7 (tested).
#[inline]
pub fn exponential(u: f32) -> f32 {
    /// Bits of sqrt(1/2): what lies below it in the octave belongs to the next lower exponent.
    const HALF_ROOT: u32 = 0x3F35_04F3;
    let shifted = u.to_bits().wrapping_sub(HALF_ROOT);
    let k = (shifted as i32) >> 23;
    let m = f32::from_bits((shifted & 0x007F_FFFF) + HALF_ROOT);
    let s = (m - 1.0) / (m + 1.0);
    let s2 = s * s;
    let series = 2.0 + s2 * (2.0 / 3.0 + s2 * (2.0 / 5.0 + s2 * (2.0 / 7.0 + s2 * (2.0 / 9.0))));
    -(k as f32 * std::f32::consts::LN_2 + s * series)
}

/// Returns a direction uniform on the sphere.
#[inline]
pub fn uniform_sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    // (1 - z)(1 + z) keeps digits near the poles, where 1 - z^2 would cancel.
    let r = (4.0 * u[0] * (1.0 - u[0])).sqrt();
    let (s, c) = sin_cos_turn(u[1]);
    Vec3::new(r * c, r * s, z)
}

/// Returns the deflection cosine of the Henyey-Greenstein law with asymmetry g.
///
/// cos = s + g (1 - s^2)(3 + 2 g s - g^2) / (2 (1 + g s)^2), s = 2u - 1: the inverse of the cumulative distribution,
/// rearranged so that nothing divides by g. *Domain*: |g| < 1. *Accuracy*: 4e-6 for |g| <= 0.99.
#[inline]
pub fn henyey_greenstein_cosine(g: f32, u: f32) -> f32 {
    let s = 2.0 * u - 1.0;
    let q = 1.0 + g * s;
    s + g * (1.0 - s * s) * (3.0 + 2.0 * g * s - g * g) / (2.0 * q * q)
}

/// Returns a unit vector at angle acos(cosine) from `d`, turned around it by `turn` of a full circle.
#[inline]
pub fn deflect(d: Vec3, cosine: f32, turn: f32) -> Vec3 {
    let (sin_phi, cos_phi) = sin_cos_turn(turn);
    let r = ((1.0 - cosine) * (1.0 + cosine)).max(0.0).sqrt();
    let f = moonmilk_core::Frame::new(d);
    let w = f.s * (r * cos_phi) + f.t * (r * sin_phi) + d * cosine;
    // One Newton step towards unit length: over thousands of turns lengths would drift.
    w * (1.5 - 0.5 * w.length_squared())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_are_exact_to_single_precision() {
        for i in 0..=100_000 {
            let u = i as f32 / 100_000.0;
            let (s, c) = sin_cos_turn(u);
            let a = f64::from(u) * std::f64::consts::TAU;
            assert!((f64::from(s) - a.sin()).abs() < 2e-7 && (f64::from(c) - a.cos()).abs() < 2e-7, "u = {u}: {s} {c}");
        }
    }

    #[test]
    fn exponential_variates_are_logarithms() {
        for i in 0..4_000_000u32 {
            // All magnitudes of the 23-bit uniform numbers, and their upper end finely.
            let u = if i % 2 == 0 { (i as f32 + 0.5) / 4_000_000.0 } else { 1.0 - (i as f32 + 0.5) / 8_388_608.0 };
            let exact = -f64::from(u).ln();
            assert!((f64::from(exponential(u)) / exact - 1.0).abs() < 3e-7, "u = {u}: {} {exact}", exponential(u));
        }
        assert!((f64::from(exponential(0.5 / 8_388_608.0)) / 16.635_532_333_438_686 - 1.0).abs() < 3e-7);
    }

    #[test]
    fn henyey_greenstein_cosines_have_mean_g() {
        for g in [-0.95f32, -0.5, -1e-4, 0.0, 1e-6, 0.3, 0.9, 0.99] {
            let n = 1 << 20;
            let mean: f64 =
                (0..n).map(|i| f64::from(henyey_greenstein_cosine(g, (i as f32 + 0.5) / n as f32))).sum::<f64>()
                    / f64::from(n);
            // Midpoint rule over 2^20 cells and single-precision evaluation.
            assert!((mean - f64::from(g)).abs() < 1e-5, "g = {g}: mean {mean}");
        }
    }

    #[test]
    fn a_million_deflections_keep_the_length_of_a_direction() {
        let mut d = Vec3::new(0.6, 0.0, 0.8);
        for i in 0..1_000_000u32 {
            let u = (i.wrapping_mul(2_654_435_769) >> 8) as f32 / 16_777_216.0;
            d = deflect(d, henyey_greenstein_cosine(0.9, u), 1.0 - u);
        }
        assert!((d.length() - 1.0).abs() < 1e-6);
    }
}
