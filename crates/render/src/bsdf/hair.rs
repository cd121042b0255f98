//! Hair and fur: a fibre as pbrt-v4's `hair` has it \[Chiang2016b\], after \[Marschner2003\] and \[DEon2011b\].
//!
//! A fibre is a rough dielectric cylinder with scales and an absorbing core. Light leaves after p = 0 (reflected), 1, 2 passages
//! through the core, or more; each of these lobes is a product of a longitudinal part M_p, an attenuation A_p and an azimuthal part N_p:
//!
//! $$ f\,|\cos\theta_z| = \sum_{p=0}^{3} M_p(\theta_o, \theta_i)\, A_p(\omega_o)\, N_p(\phi) , $$
//!
//! theta to the plane across the fibre, phi around it; M_p and N_p integrate to 1 (against cos theta d theta and d phi), so that without absorption the
//! sum of the A_p, exactly 1, is all light: the white furnace stays white from every direction.
//!
//! **Local frame.** x along the fibre, z the surface's normal. The fibre is a cylinder under that normal: where the ray has struck it, as offset h in \[-1, 1\]
//! of its radius, follows from the direction to the viewer, h = -y / hypot(y, z). Light is treated as if it left where it entered; the renderer lets rays
//! from inside pass through the fibre's walls ([`crate::material::Materials::is_fibre`]).
//!
//! *Not reciprocal* at a point (h belongs to wo; scales are tilted), as the published model.

use std::f64::consts::PI;

use moonmilk_core::{Spectrum, Vec3};
use moonmilk_optics::fresnel::reflectance_f64;

use super::{BsdfSample, Kind};

/// Lobes that are told apart; the last one holds all further passages.
const LOBES: usize = 4;

/// A fibre at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hair<const N: usize> {
    /// Absorption coefficient of the core per radius of the fibre.
    pub sigma_a: Spectrum<N>,
    /// Index of the core.
    pub eta: f32,
    /// Variance-like width of M_p.
    v: [f64; LOBES],
    /// Scale of the logistic distribution in N_p.
    s: f64,
    /// Sines and cosines of 2^k times the tilt of the scales.
    tilt: [(f64, f64); 3],
}

/// Where light of one direction goes: what all lobes share.
struct Lobes<const N: usize> {
    sin_o: f64,
    cos_o: f64,
    phi_o: f64,
    /// Azimuths of entry and of the refracted ray, about the normal.
    gamma: [f64; 2],
    /// Attenuations.
    a: [Spectrum<N>; LOBES],
    /// Probabilities of the lobes.
    probability: [f64; LOBES],
}

impl<const N: usize> Hair<N> {
    /// Returns a fibre; `beta_m`, `beta_n` in (0, 1] are its longitudinal and azimuthal roughness, `alpha` the tilt of its scales \[radians\].
    ///
    /// The fits of variances to roughness are those of \[Chiang2016b\].
    pub fn new(sigma_a: Spectrum<N>, eta: f32, beta_m: f32, beta_n: f32, alpha: f32) -> Self {
        let (m, n) = (f64::from(beta_m), f64::from(beta_n));
        let v0 = (0.726 * m + 0.812 * m * m + 3.7 * m.powi(20)).powi(2);
        let s = (PI / 8.0).sqrt() * (0.265 * n + 1.194 * n * n + 5.372 * n.powi(22));
        let tilt = [1.0, 2.0, 4.0].map(|k| (k * f64::from(alpha)).sin_cos());
        Self { sigma_a, eta, v: [v0, 0.25 * v0, 4.0 * v0, 4.0 * v0], s, tilt }
    }

    /// Returns the absorption of a fibre in a mass of hair whose overall colour is `albedo`, for azimuthal roughness `beta_n` \[Chiang2016b\].
    pub fn absorption_of(albedo: Spectrum<N>, beta_n: f32) -> Spectrum<N> {
        let b = beta_n;
        let fit = 5.969 - 0.215 * b + 2.532 * b.powi(2) - 10.73 * b.powi(3) + 5.574 * b.powi(4) + 0.245 * b.powi(5);
        // Black hair would absorb infinitely: 1e-6 is a reflectance that nobody tells from it.
        albedo.map(|c| (c.clamp(1e-6, 1.0).ln() / fit).powi(2))
    }

    /// Returns what depends on the direction to the viewer alone.
    fn lobes(&self, wo: Vec3) -> Lobes<N> {
        let sin_o = f64::from(wo.x).clamp(-1.0, 1.0);
        let cos_o = (1.0 - sin_o * sin_o).sqrt();
        let (y, z) = (f64::from(wo.y), f64::from(wo.z));
        let phi_o = z.atan2(y);
        let across = y.hypot(z);
        let h = if across > 0.0 { (-y / across).clamp(-1.0, 1.0) } else { 0.0 };
        let eta = f64::from(self.eta);

        // Refract in the plane across the fibre with the index seen under the inclination of the ray [Marschner2003].
        let cos_t = (1.0 - (sin_o / eta).powi(2)).max(0.0).sqrt();
        let eta_across = (eta * eta - sin_o * sin_o).max(0.0).sqrt() / cos_o.max(1e-9);
        let sin_gamma_t = (h / eta_across).clamp(-1.0, 1.0);
        let (gamma_o, gamma_t) = (h.asin(), sin_gamma_t.asin());
        let path = 2.0 * gamma_t.cos() / cos_t.max(1e-9);
        let t = self.sigma_a.map(|s| (-f64::from(s) * path).exp() as f32);

        // Reflected, or refracted twice with internal reflections between; the last lobe is the sum of the rest of the series.
        let f = reflectance_f64((cos_o * gamma_o.cos()).clamp(0.0, 1.0), eta) as f32;
        let first = t * ((1.0 - f) * (1.0 - f));
        let second = first * t * f;
        let rest = (second * t * f).zip(t, |x, t| if x > 0.0 { x / (1.0 - t * f).max(f32::MIN_POSITIVE) } else { 0.0 });
        let a = [Spectrum::splat(f), first, second, rest];
        let sum: f64 = a.iter().map(|a| f64::from(a.mean())).sum();
        let probability = a.map(|a| if sum > 0.0 { f64::from(a.mean()) / sum } else { 0.25 });
        Lobes { sin_o, cos_o, phi_o, gamma: [gamma_o, gamma_t], a, probability }
    }

    /// Returns sine and cosine of the viewer's inclination, turned by the scales as lobe p sees them.
    fn tilted(&self, p: usize, l: &Lobes<N>) -> (f64, f64) {
        let turn = |(sin, cos): (f64, f64), sign: f64| {
            (l.sin_o * cos + sign * l.cos_o * sin, (l.cos_o * cos - sign * l.sin_o * sin).abs())
        };
        match p {
            0 => turn(self.tilt[1], -1.0),
            1 => turn(self.tilt[0], 1.0),
            2 => turn(self.tilt[2], 1.0),
            _ => (l.sin_o, l.cos_o),
        }
    }

    /// Returns M_p N_p for each lobe.
    fn shapes(&self, l: &Lobes<N>, wi: Vec3) -> [f64; LOBES] {
        let sin_i = f64::from(wi.x).clamp(-1.0, 1.0);
        let cos_i = (1.0 - sin_i * sin_i).sqrt();
        let phi = f64::from(wi.z).atan2(f64::from(wi.y)) - l.phi_o;
        std::array::from_fn(|p| {
            let (sin_o, cos_o) = self.tilted(p, l);
            let m = longitudinal(cos_i * cos_o, sin_i * sin_o, self.v[p]);
            let n = if p + 1 < LOBES { trimmed_logistic(wrap(phi - leaving(p, l.gamma)), self.s) } else { 0.5 / PI };
            m * n
        })
    }

    /// Returns the value times |cos| to the normal: the fibre does not know the normal's cosine.
    fn flux(&self, l: &Lobes<N>, wi: Vec3) -> Spectrum<N> {
        self.shapes(l, wi).iter().zip(l.a).fold(Spectrum::ZERO, |sum, (s, a)| sum + a * *s as f32)
    }

    /// Returns the value [1/sr].
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> Spectrum<N> {
        self.flux(&self.lobes(wo), wi) * (1.0 / wi.z.abs())
    }

    /// Returns the density of [`Hair::sample`] [1/sr].
    pub(crate) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let l = self.lobes(wo);
        self.shapes(&l, wi).iter().zip(l.probability).map(|(s, p)| s * p).sum::<f64>() as f32
    }

    /// Samples a direction: a lobe by its attenuation, then theta by M_p \[DEon2013b\] and phi by N_p.
    pub(crate) fn sample(&self, wo: Vec3, uc: f32, u: [f32; 2]) -> Option<BsdfSample<N>> {
        let l = self.lobes(wo);
        // Choose the lobe, stretching what is left of the variate.
        let (mut p, mut left) = (0, f64::from(uc));
        while p + 1 < LOBES && left >= l.probability[p] {
            left -= l.probability[p];
            p += 1;
        }
        let left = (left / l.probability[p]).clamp(0.0, 1.0 - 1e-9);

        // The angle to the specular cone has the density of a von Mises-Fisher distribution; turn it around the cone.
        let (sin_o, cos_o) = self.tilted(p, &l);
        let [u0, u1] = u.map(f64::from);
        let v = self.v[p];
        let cos = (1.0 + v * (u0.max(1e-9) + (1.0 - u0) * (-2.0 / v).exp()).ln()).max(-1.0);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let sin_i = (-cos * sin_o + sin * (2.0 * PI * u1).cos() * cos_o).clamp(-1.0, 1.0);
        let cos_i = (1.0 - sin_i * sin_i).sqrt();
        let phi =
            if p + 1 < LOBES { leaving(p, l.gamma) + sample_trimmed_logistic(left, self.s) } else { 2.0 * PI * left };
        let (sin_phi, cos_phi) = (l.phi_o + phi).sin_cos();
        let wi = Vec3::new(sin_i as f32, (cos_i * cos_phi) as f32, (cos_i * sin_phi) as f32).normalize();
        if wi.z == 0.0 {
            return None;
        }
        let pdf = self.shapes(&l, wi).iter().zip(l.probability).map(|(s, p)| s * p).sum::<f64>() as f32;
        let f = self.flux(&l, wi) * (1.0 / wi.z.abs());
        let kind = if wo.z * wi.z > 0.0 { Kind::Reflection } else { Kind::Transmission };
        Some(BsdfSample { f, wi, pdf, kind, specular: false, eta: 1.0 })
    }

    /// Returns the share of light that leaves again, seen along the normal.
    pub(crate) fn albedo(&self) -> Spectrum<N> {
        self.lobes(Vec3::Z).a.iter().fold(Spectrum::ZERO, |sum, a| sum + *a)
    }
}

/// Returns the azimuth, relative to the viewer's, under which the ray leaves after p passages: 2 p gamma_t - 2 gamma_o + p pi.
fn leaving(p: usize, [gamma_o, gamma_t]: [f64; 2]) -> f64 {
    2.0 * p as f64 * gamma_t - 2.0 * gamma_o + p as f64 * PI
}

/// Returns an angle in \[-pi, pi).
fn wrap(phi: f64) -> f64 {
    (phi + PI).rem_euclid(2.0 * PI) - PI
}

/// Returns M_p from the products of cosines and sines \[DEon2011b\]: I_0(c / v) exp(-s / v) / (2 v sinh(1 / v)).
///
/// In logarithms throughout: 1 / v reaches 1e5 for smooth fibres.
fn longitudinal(cos: f64, sin: f64, v: f64) -> f64 {
    // 2 v sinh(1 / v) = v exp(1 / v) (1 - exp(-2 / v)).
    (log_i0_scaled(cos / v) + (cos - sin - 1.0) / v).exp() / (v * -(-2.0 / v).exp_m1())
}

/// Returns ln(exp(-x) I_0(x)), x >= 0; relative error of I_0 below 1e-6.
fn log_i0_scaled(x: f64) -> f64 {
    if x > 25.0 {
        // Asymptotic series; the next term is 0.11 x^-4.
        let y = 1.0 / x;
        return (1.0 + y * (0.125 + y * (9.0 / 128.0 + y * (225.0 / 3072.0)))).ln() - 0.5 * (2.0 * PI * x).ln();
    }
    // Power series: sum of (x / 2)^2i / i!^2.
    let q = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 1.0);
    for i in 1..80 {
        term *= q / f64::from(i * i);
        sum += term;
        if term < 1e-12 * sum {
            break;
        }
    }
    sum.ln() - x
}

/// Returns the density of the logistic distribution of scale s, restricted to \[-pi, pi\].
fn trimmed_logistic(x: f64, s: f64) -> f64 {
    let e = (-x.abs() / s).exp();
    e / (s * (1.0 + e) * (1.0 + e)) / (PI / (2.0 * s)).tanh()
}

/// Returns its quantile: the cumulative distribution is 1/2 + tanh(x / 2s) / (2 tanh(pi / 2s)).
fn sample_trimmed_logistic(u: f64, s: f64) -> f64 {
    let t = (2.0 * u - 1.0) * (PI / (2.0 * s)).tanh();
    // atanh of a number that rounds to 1 is infinite.
    (2.0 * s * t.atanh()).clamp(-PI, PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn the_azimuthal_part_is_a_density_and_its_quantile_inverts_it() {
        for s in [0.02, 0.3, 4.0] {
            let n = 20_000;
            let step = 2.0 * PI / f64::from(n);
            let mut cumulated = 0.0;
            for i in 0..n {
                let x = -PI + (f64::from(i) + 0.5) * step;
                let half = 0.5 * trimmed_logistic(x, s) * step;
                cumulated += half;
                if i % 997 == 0 && cumulated > 1e-9 && cumulated < 1.0 - 1e-9 {
                    assert!((sample_trimmed_logistic(cumulated, s) - x).abs() < 1e-3, "{s} {x}");
                }
                cumulated += half;
            }
            // Midpoint rule.
            assert!((cumulated - 1.0).abs() < 1e-5, "{s}: {cumulated}");
        }
    }

    #[test]
    fn the_longitudinal_part_is_a_density_at_every_width() {
        for v in [1e-5f64, 1e-3, 0.1, 2.0] {
            for theta_o in [-1.2f64, 0.0, 0.7] {
                let n = 400_000;
                let step = PI / f64::from(n);
                let sum: f64 = (0..n)
                    .map(|i| {
                        let theta = -FRAC_PI_2 + (f64::from(i) + 0.5) * step;
                        let m = longitudinal(theta.cos() * theta_o.cos(), theta.sin() * theta_o.sin(), v);
                        m * theta.cos() * step
                    })
                    .sum();
                // Midpoint rule over a peak of width sqrt(v), and 1e-6 of the Bessel function.
                assert!((sum - 1.0).abs() < 1e-5, "v {v}, theta {theta_o}: {sum}");
            }
        }
    }

    #[test]
    fn the_bessel_function_is_continuous_where_the_series_meet() {
        // I_0(25) = 5.774560606e9 [Abramowitz and Stegun's recurrence, and mpmath].
        let exact = 5.774_560_606_466_31e9f64.ln() - 25.0;
        assert!((log_i0_scaled(25.0) - exact).abs() < 1e-9, "{} {exact}", log_i0_scaled(25.0));
        assert!((log_i0_scaled(25.0 + 1e-9) - exact).abs() < 1e-6);
        assert_eq!(log_i0_scaled(0.0), 0.0);
    }

    #[test]
    fn without_absorption_the_attenuations_add_up_to_one() {
        for (x, y, z) in [(0.0f32, 0.0f32, 1.0f32), (0.6, 0.5, 0.3), (-0.9, 0.1, 0.2), (0.1, -0.99, 0.01)] {
            let wo = Vec3::new(x, y, z).normalize();
            let a = Hair::<2>::new(Spectrum::ZERO, 1.55, 0.3, 0.3, 0.03).lobes(wo).a;
            let sum: f32 = a.iter().map(|a| a[0]).sum();
            assert!((sum - 1.0).abs() < 1e-6, "{wo}: {sum}");
        }
        // A colour in, the same colour out of the fit's own inverse: c = exp(-fit sqrt(sigma_a)).
        let sigma = Hair::<1>::absorption_of(Spectrum([0.3]), 0.0);
        assert!(((-5.969 * sigma[0].sqrt()).exp() - 0.3).abs() < 1e-6);
    }
}
