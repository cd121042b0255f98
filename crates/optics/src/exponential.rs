//! Exponential integrals.

/// Returns the exponential integral E_1(x), x > 0: e^(-x) times the integral of e^(-x t) / (1 + t); its logarithm by series below 1.
pub(crate) fn e_1(x: f64) -> f64 {
    if x < 1.0 {
        // -gamma - ln x + x - x^2 / 4 + x^3 / 18 - ...
        let (mut sum, mut term) = (-0.577_215_664_901_532_9 - x.ln(), 1.0);
        for k in 1..25 {
            term *= -x / f64::from(k);
            sum -= term / f64::from(k);
        }
        return sum;
    }
    // Continued fraction by Lentz: converges fast for x >= 1.
    let mut b = x + 1.0;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut h = d;
    for i in 1..200 {
        let a = -f64::from(i * i);
        b += 2.0;
        d = 1.0 / (a * d + b);
        c = b + a / c;
        h *= c * d;
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    h * (-x).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_integrals_have_their_tabulated_values() {
        for (x, e) in [(0.1, 1.822_923_958_419_39), (1.0, 0.219_383_934_395_520_3), (5.0, 1.148_295_591_275_326e-3)] {
            assert!((e_1(x) / e - 1.0).abs() < 1e-12, "{x} {}", e_1(x));
        }
    }
}
