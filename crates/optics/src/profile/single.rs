//! Light that is scattered exactly once, exact for a flat surface.
//!
//! A pencil beam enters along the normal; at depth t it scatters towards the surface point at radius r:
//!
//! $$ R_1(r) = \int_{t_c}^\infty \sigma_s\, e^{-\sigma_t (t + d)}\, p(-\cos\theta)\, (1 - F(\cos\theta))\, \frac{\cos\theta}{d^2}\, dt, \qquad d = \sqrt{r^2 + t^2},\ \cos\theta = t/d $$
//!
//! with F the internal reflectance and $t_c = r\sqrt{\eta^2 - 1}$ the depth above which all is reflected (0 for eta < 1). The phase function p takes the
//! cosine of the *deflection*: light turns from downwards to upwards, hence the sign. Codes whose phase function takes both directions away
//! from the vertex pass +cos; mixing the two flips g. The true coefficients enter, not the reduced ones.
//!
//! *Accuracy*: 1e-8 (test against the closed total). *Source*: \[Habel2013\]; single scattering of a half-space.

use std::f64::consts::PI;

use moonmilk_core::Real;
use moonmilk_core::quadrature::Rule;

use crate::error::Error;
use crate::properties::OpticalProperties;

use super::model::RadialModel;
use super::table::growing_breaks;
use super::{Info, Kind};

/// Description of the model.
pub const INFO: Info = Info {
    name: "single",
    summary: "light scattered once, exact",
    source: "Habel2013",
    kind: Kind::Part,
    valid: "exact for a flat half-space, any g and eta; leaves out everything scattered twice or more",
    use_when: "as a part of models that start at the second scattering, or where alpha is below .1",
    avoid_when: "as the whole: at alpha = .9 it is a fifth to a third of the reflected light",
};

/// The single-scattering profile of one medium.
#[derive(Clone, Copy, Debug)]
pub struct Single<T = f64> {
    medium: OpticalProperties<T>,
}

/// Points per interval of the quadratures.
const POINTS: usize = 10;

impl<T: Real> RadialModel<T> for Single<T> {
    fn new(medium: &OpticalProperties<T>) -> Result<Self, Error> {
        Ok(Self { medium: *medium })
    }

    fn eval(&self, r: T) -> T {
        let m = &self.medium;
        let (sigma_t, eta) = (m.sigma_t(), m.eta());
        // Start at the depth of total reflection; there 1 - F rises like a root, which t = t_c + w^2 resolves.
        let critical = if eta.value() > 1.0 { r * (eta.squared().offset(-1.0)).sqrt() } else { T::from_f64(0.0) };
        let scale = r.value().min(1.0 / sigma_t.value());
        let mut sum = T::from_f64(0.0);
        for (w, weight) in
            Rule::composite(POINTS, &growing_breaks(scale.sqrt(), (45.0 / sigma_t.value()).sqrt())).iter()
        {
            let t = critical.offset(w * w);
            let d = (r * r + t * t).sqrt();
            let cos = t / d;
            let value =
                (-(sigma_t * (t + d))).exp() * henyey_greenstein(-cos, m.g()) * transmitted(cos, eta) * cos / (d * d);
            sum = sum + value.scale(2.0 * w * weight);
        }
        sum * m.sigma_s()
    }

    fn total(&self) -> T {
        // alpha times the integral of 2 pi p(-mu) (1 - F) mu / (1 + mu) over the cosines that are let out.
        let m = &self.medium;
        let eta = m.eta();
        let one = T::from_f64(1.0);
        let critical2 = if eta.value() > 1.0 { one - eta.squared().recip() } else { T::from_f64(0.0) };
        let end = (one - critical2).sqrt();
        let mut sum = T::from_f64(0.0);
        for (x, weight) in Rule::composite(16, &growing_breaks(0.05, 1.0)).iter() {
            let t = end.scale(x);
            let mu = (critical2 + t * t).sqrt();
            let jacobian = end * t / mu;
            let value = henyey_greenstein(-mu, m.g()) * transmitted(mu, eta) * mu / mu.offset(1.0) * jacobian;
            sum = sum + value.scale(2.0 * PI * weight);
        }
        sum * m.alpha()
    }
}

/// Returns the Henyey-Greenstein phase function at a cosine of the deflection \[1/sr\].
pub(crate) fn henyey_greenstein<T: Real>(cos: T, g: T) -> T {
    let g2 = g * g;
    let base = (g2 - (g * cos).scale(2.0)).offset(1.0);
    (-g2).offset(1.0) / (base * base.sqrt()).scale(4.0 * PI)
}

/// Returns 1 - F of light that leaves at an inside cosine above the critical one.
pub(crate) fn transmitted<T: Real>(cos: T, eta: T) -> T {
    // sin_o = eta sin_i; 1 - F = 1/2 (T_s + T_p) with T = 4 a b / (a + b)^2, free of cancellation.
    let cos_o2 = (-(eta.squared() * (-cos.squared()).offset(1.0))).offset(1.0);
    if cos_o2.value() <= 0.0 {
        return T::from_f64(0.0);
    }
    let cos_o = cos_o2.sqrt();
    let (inside, outside) = (eta * cos, eta * cos_o);
    let product = (inside * cos_o).scale(4.0);
    let s = product / (inside + cos_o).squared();
    let p = product / (cos + outside).squared();
    (s + p).scale(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fresnel::reflectance_f64;
    use crate::profile::table::radial_rule;

    fn single(alpha: f64, g: f64, eta: f64) -> Single {
        Single::new(&OpticalProperties::from_albedo(1.0, alpha, g, eta).unwrap()).unwrap()
    }

    #[test]
    fn values_agree_with_the_reference_table() {
        // Physics notes, 8.5.
        for (alpha, eta, r, expected) in [
            (0.5, 1.0, 0.1, 2.37456933e-1),
            (0.5, 1.0, 1.0, 2.61739576e-3),
            (0.5, 1.0, 5.0, 1.27255445e-6),
            (0.9, 1.33, 0.1, 2.61258638e-1),
            (0.9, 1.33, 1.0, 1.10323342e-3),
            (0.9, 1.33, 5.0, 7.21295672e-9),
            (0.99, 1.5, 0.1, 2.31058309e-1),
            (0.99, 1.5, 1.0, 6.47482003e-4),
            (0.99, 1.5, 5.0, 8.00740403e-10),
        ] {
            let value = single(alpha, 0.0, eta).eval(r);
            assert!((value / expected - 1.0).abs() < 1e-6, "{alpha} {eta} {r} {value:e} {expected:e}");
        }
    }

    #[test]
    fn totals_agree_with_closed_forms_and_with_the_integral() {
        // Matched and isotropic: (alpha / 2)(1 - ln 2); physics notes, 5.7, for the other two.
        for (eta, expected, digits) in
            [(1.0, 0.5 * (1.0 - 2f64.ln()), 1e-10), (1.33, 0.0716204, 6e-8), (1.5, 0.0536242, 6e-8)]
        {
            assert!(
                (single(1.0, 0.0, eta).total() - expected).abs() < digits,
                "{eta} {}",
                single(1.0, 0.0, eta).total()
            );
        }
        for (g, eta) in [(0.0, 1.0), (0.8, 1.33), (-0.5, 1.5), (0.3, 0.8)] {
            let s = single(0.7, g, eta);
            let sum = radial_rule(1e-6, 60.0, 16).integrate(|r| 2.0 * PI * r * s.eval(r));
            // What lies inside the smallest radius is 2 pi r R of about 1e-6.
            assert!((sum / s.total() - 1.0).abs() < 2e-5, "{g} {eta} {sum} {}", s.total());
        }
        // Forward scattering sends less light back.
        assert!(single(0.9, 0.5, 1.0).total() < single(0.9, 0.0, 1.0).total());
        assert!((single(1.0, -0.5, 1.0).total() > single(1.0, 0.0, 1.0).total()));
    }

    #[test]
    fn the_transmittance_is_fresnels() {
        for eta in [0.7, 1.0, 1.33, 2.0] {
            for i in 1..=100 {
                let cos = f64::from(i) / 100.0;
                let expected = 1.0 - reflectance_f64(cos, 1.0 / eta);
                // Rounding of the difference from 1.
                assert!((transmitted(cos, eta) - expected).abs() < 1e-14, "{eta} {cos}");
            }
        }
    }
}
