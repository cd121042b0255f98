//! From surface albedo to single-scattering albedo, and conversions between coefficients.
//!
//! Which albedo: the fraction of the light that *entered*, along the normal or diffusely, that leaves again, at any relative index and asymmetry.
//! The forward function is exact ([`crate::halfspace`]), tabulated once per index, asymmetry and illumination; its variable is the reduced albedo
//! alpha' = alpha (1 - g) / (1 - alpha g), over which all asymmetries are alike. (They are not equal: with g = .8 and light along the normal the albedo is 1 % below that of the
//! reduced isotropic medium where it exceeds .5, 5 % at .3 and 30 % at .1.)
//!
//! pbrt's `reflectance` and `mfp`: sigma_t = 1 / mfp (not reduced), sigma_s = alpha sigma_t, sigma_a = (1 - alpha) sigma_t with alpha
//! inverted for the given g. pbrt inverts its photon beam diffusion profile instead of the exact function, whose albedo is 1 to
//! 10 % off: the same file gives a slightly different alpha here, and the reflectance asked for.

pub mod published;

use std::f64::consts::PI;

use moonmilk_core::Spectrum;

use crate::error::Error;
use crate::halfspace::{Anisotropic, HalfSpace, Illumination, alpha_of};

/// The albedo of a half-space over the reduced single-scattering albedo at one relative index and asymmetry, and its inverse.
///
/// Tabulated at equal steps of the angle theta in sqrt(1 - alpha') = (1 - cos theta) / 2: dense at both ends, and even about them, so
/// that central differences give the slopes everywhere.
#[derive(Clone, Debug)]
pub struct AlbedoTable {
    eta: f64,
    g: f64,
    /// (A, dA per step) at theta = 0, h, ... pi: A falls from 1 to 0.
    nodes: Vec<[f64; 2]>,
}

impl AlbedoTable {
    /// Number of steps for isotropic scattering; they give 5e-7 in the albedo at eta 2, less below (test).
    const STEPS: usize = 96;
    /// Number of steps otherwise: 2e-5 (test).
    const STEPS_ANISOTROPIC: usize = 48;
    /// Gauss nodes per side of the critical angle: enough for the same.
    const NODES: usize = 24;

    /// Tabulates the albedo for normal incidence.
    ///
    /// *Errors*: `eta` = inside / outside, outside \[1/3, 3\], g outside (-1, 1). Takes about 8 ms, 30 ms at g = .8, half a second at .95.
    pub fn new(eta: f64, g: f64) -> Result<Self, Error> {
        Self::for_light(eta, g, Illumination::Normal)
    }

    /// Tabulates the albedo of entered light for any illumination.
    ///
    /// *Errors*: as [`AlbedoTable::new`].
    pub fn for_light(eta: f64, g: f64, light: Illumination) -> Result<Self, Error> {
        let n = if g == 0.0 { Self::STEPS } else { Self::STEPS_ANISOTROPIC };
        let operator = if g == 0.0 { None } else { Some(Anisotropic::new(g, eta, light)?) };
        let mut albedo = vec![1.0; n + 1];
        for (i, a) in albedo.iter_mut().enumerate().skip(1) {
            let s = 0.5 * (1.0 - (PI * i as f64 / n as f64).cos());
            *a = match &operator {
                _ if i == n => 0.0,
                Some(operator) => operator.albedo(alpha_of(s, g))?,
                None => HalfSpace::with_nodes((1.0 - s) * (1.0 + s), eta, Self::NODES)?.albedo(light),
            };
        }
        // Fourth-order slopes; mirror the values at the ends.
        let at = |i: isize| albedo[i.unsigned_abs().min(2 * n - i.unsigned_abs())];
        let slope = |i: isize| (8.0 * (at(i + 1) - at(i - 1)) - (at(i + 2) - at(i - 2))) / 12.0;
        Ok(Self { eta, g, nodes: (0..=n).map(|i| [albedo[i], slope(i as isize)]).collect() })
    }

    /// Returns the number of steps.
    fn steps(&self) -> usize {
        self.nodes.len() - 1
    }

    /// Returns the asymmetry of the table.
    pub fn g(&self) -> f64 {
        self.g
    }

    /// Returns the relative index of the table.
    pub fn eta(&self) -> f64 {
        self.eta
    }

    /// Returns the albedo of entered light for a reduced single-scattering albedo in \[0, 1\].
    pub fn albedo(&self, alpha_prime: f64) -> f64 {
        let s = (1.0 - alpha_prime).clamp(0.0, 1.0).sqrt();
        let x = (1.0 - 2.0 * s).acos() / PI * self.steps() as f64;
        let i = (x as usize).min(self.steps() - 1);
        self.cubic(i, x - i as f64)
    }

    /// Returns the reduced single-scattering albedo of a surface albedo in \[0, 1\]; monotone, 0 at 0 and 1 at 1.
    pub fn alpha_prime(&self, albedo: f64) -> f64 {
        if albedo <= 0.0 {
            return 0.0;
        }
        if albedo >= 1.0 {
            return 1.0;
        }
        let i = self.nodes.partition_point(|n| n[0] >= albedo).clamp(1, self.steps()) - 1;
        // Bisect the cubic of the interval: 48 steps are the digits of f64.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..48 {
            let middle = 0.5 * (low + high);
            if self.cubic(i, middle) > albedo { low = middle } else { high = middle }
        }
        let theta = PI * (i as f64 + 0.5 * (low + high)) / self.steps() as f64;
        // s = sin^2(theta / 2); 1 - s^2 = (1 - s)(1 + s) with 1 - s = cos^2(theta / 2).
        let (sin, cos) = (0.5 * theta).sin_cos();
        cos * cos * (1.0 + sin * sin)
    }

    /// Returns the single-scattering albedo of a surface albedo in \[0, 1\].
    ///
    /// *Accuracy*: 1e-6 in the albedo for g = 0 and eta up to 2, 3e-5 for |g| up to .95 (tests).
    pub fn alpha(&self, albedo: f64) -> f64 {
        alpha_from_reduced(self.alpha_prime(albedo), self.g)
    }

    /// Evaluates the Hermite cubic of interval i at the fraction t.
    fn cubic(&self, i: usize, t: f64) -> f64 {
        let ([a0, d0], [a1, d1]) = (self.nodes[i], self.nodes[i + 1]);
        let u = 1.0 - t;
        a0 * u * u * (1.0 + 2.0 * t) + a1 * t * t * (1.0 + 2.0 * u) + t * u * (d0 * u - d1 * t)
    }

    /// Returns sigma_a and sigma_s in every lane for pbrt's `reflectance` and `mfp` (see the module's text).
    ///
    /// *Domain*: reflectance in \[0, 1\], mfp > 0 \[L\]; the result is in \[1/L\].
    pub fn coefficients<const N: usize>(
        &self,
        reflectance: Spectrum<N>,
        mfp: Spectrum<N>,
    ) -> (Spectrum<N>, Spectrum<N>) {
        // Equal lanes stay equal bit for bit: each lane is the same function of its own values.
        let alpha = reflectance.map(|r| self.alpha(f64::from(r)) as f32);
        let sigma_a = reflectance.zip(mfp, |r, l| {
            // 1 - alpha in f64: in f32 it would lose its digits near white.
            ((1.0 - self.alpha(f64::from(r))) / f64::from(l)) as f32
        });
        (sigma_a, alpha.zip(mfp, |a, l| a / l))
    }
}

/// Returns alpha' = alpha (1 - g) / (1 - alpha g).
pub fn reduced_alpha(alpha: f64, g: f64) -> f64 {
    alpha * (1.0 - g) / (1.0 - alpha * g)
}

/// Returns alpha = alpha' / (1 - g + g alpha'), the inverse of [`reduced_alpha`].
pub fn alpha_from_reduced(alpha_prime: f64, g: f64) -> f64 {
    alpha_prime / (1.0 - g + g * alpha_prime)
}

/// Returns the reduced scattering coefficient sigma_s (1 - g).
pub fn reduced_scattering(sigma_s: f64, g: f64) -> f64 {
    sigma_s * (1.0 - g)
}

/// Returns the classical diffuse mean free path 1 / sigma_tr = 1 / sqrt(3 sigma_a (sigma_a + sigma_s')) \[L\]; infinite without absorption.
pub fn dmfp(sigma_a: f64, sigma_s_prime: f64) -> f64 {
    1.0 / (3.0 * sigma_a * (sigma_a + sigma_s_prime)).sqrt()
}

/// Returns sigma_a and sigma_s' from the reduced albedo and the classical diffuse mean free path.
///
/// sigma_t' = 1 / (dmfp sqrt(3 (1 - alpha'))). *Domain*: alpha' in \[0, 1), dmfp > 0.
pub fn from_dmfp(alpha_prime: f64, dmfp: f64) -> (f64, f64) {
    let sigma_t_prime = 1.0 / (dmfp * (3.0 * (1.0 - alpha_prime)).sqrt());
    ((1.0 - alpha_prime) * sigma_t_prime, alpha_prime * sigma_t_prime)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverses_agree_with_the_reference_table() {
        // (albedo; alpha' at eta 1, 1.33, 1.5, normal incidence): physics notes, 6.1.
        #[allow(clippy::approx_constant)]
        let rows = [
            [0.05, 0.26896, 0.44591, 0.52350],
            [0.1, 0.45487, 0.64992, 0.72066],
            [0.2, 0.68575, 0.83295, 0.87704],
            [0.3, 0.81497, 0.91130, 0.93769],
            [0.5, 0.93817, 0.97334, 0.98232],
            [0.7, 0.98409, 0.99347, 0.99583],
            [0.8, 0.99388, 0.99753, 0.99845],
            [0.9, 0.99866, 0.99947, 0.99967],
            [0.95, 0.99969, 0.99988, 0.99992],
        ];
        for (k, eta) in [1.0, 1.33, 1.5].into_iter().enumerate() {
            let table = AlbedoTable::new(eta, 0.0).unwrap();
            for row in rows {
                // Rounding of the table, and 1e-6 in the albedo times the slope d alpha / dA of at most 6.
                assert!(
                    (table.alpha_prime(row[0]) - row[k + 1]).abs() < 1.2e-5,
                    "{eta} {} {}",
                    row[0],
                    table.alpha_prime(row[0])
                );
            }
        }
    }

    #[test]
    fn the_round_trip_through_the_exact_albedo_closes() {
        for eta in [1.0, 1.05, 1.33, 1.5, 2.0] {
            let table = AlbedoTable::new(eta, 0.0).unwrap();
            let mut worst = 0.0f64;
            for i in 0..100 {
                let a = (f64::from(i) + 0.37) / 100.0;
                let exact = HalfSpace::new(table.alpha_prime(a), eta).unwrap().albedo(Illumination::Normal);
                worst = worst.max((exact - a).abs());
            }
            // Measured interpolation and quadrature error of the table.
            assert!(worst < 1e-6, "{eta} {worst:e}");
        }
    }

    #[test]
    fn diffuse_light_is_inverted_as_well_at_any_index_and_asymmetry() {
        // (albedo; alpha at eta 1, 1.33, 1.5 for Lambertian light from outside): physics notes, 6.1.
        let rows = [
            [0.05, 0.21410, 0.42323, 0.50689],
            [0.2, 0.60968, 0.81888, 0.86954],
            [0.5, 0.91134, 0.97050, 0.98112],
            [0.8, 0.99058, 0.99725, 0.99834],
            [0.95, 0.99951, 0.99986, 0.99992],
        ];
        for (k, eta) in [1.0, 1.33, 1.5].into_iter().enumerate() {
            let table = AlbedoTable::for_light(eta, 0.0, Illumination::DiffuseOutside).unwrap();
            for row in rows {
                assert!((table.alpha_prime(row[0]) - row[k + 1]).abs() < 1.2e-5, "{eta} {}", table.alpha_prime(row[0]));
            }
        }
    }

    #[test]
    fn the_round_trip_closes_at_any_index_asymmetry_and_light() {
        // Through finer nodes than the table's: 1e-4 is asked for, the interpolation's 2e-5 found.
        for eta in [0.5, 1.0, 1.2, 1.7, 2.5] {
            for light in [Illumination::Normal, Illumination::DiffuseInside, Illumination::DiffuseOutside] {
                for g in [-0.5, 0.0, 0.3, 0.8] {
                    let table = AlbedoTable::for_light(eta, g, light).unwrap();
                    let fine = Anisotropic::with_nodes(g, eta, light, Anisotropic::nodes(g) + 6).unwrap();
                    for a in [0.02, 0.13, 0.3, 0.55, 0.77, 0.93, 0.985] {
                        let exact = fine.albedo(table.alpha(a)).unwrap();
                        assert!((exact - a).abs() < 3e-5, "{eta} {light:?} {g} {a} {exact}");
                    }
                }
            }
        }
        let table = AlbedoTable::new(1.4, 0.95).unwrap();
        let fine = Anisotropic::with_nodes(0.95, 1.4, Illumination::Normal, 70).unwrap();
        for a in [0.01, 0.1, 0.5, 0.9] {
            let exact = fine.albedo(table.alpha(a)).unwrap();
            assert!((exact - a).abs() < 3e-5, "{a} {exact}");
        }
    }

    #[test]
    fn similarity_has_its_measured_error() {
        // Walks in a half-space of eta 1.33 and g = .8, light along the normal: physics notes, 6.4. (alpha', reduced isotropic, measured.)
        let (table, reduced) = (AlbedoTable::new(1.33, 0.8).unwrap(), AlbedoTable::new(1.33, 0.0).unwrap());
        for (alpha_prime, isotropic, measured) in
            [(0.6429, 0.0976, 0.0753), (0.9074, 0.2929, 0.2792), (0.9755, 0.5135, 0.5092)]
        {
            // Rounding of alpha' and of the albedos, and the noise of the walks.
            assert!((reduced.albedo(alpha_prime) - isotropic).abs() < 2e-4, "{}", reduced.albedo(alpha_prime));
            assert!((table.albedo(alpha_prime) - measured).abs() < 5e-4, "{}", table.albedo(alpha_prime));
        }
    }

    #[test]
    fn the_inverse_is_monotone_and_keeps_its_ends() {
        let table = AlbedoTable::new(1.4, 0.0).unwrap();
        assert_eq!((table.alpha_prime(0.0), table.alpha_prime(1.0)), (0.0, 1.0));
        let mut last = 0.0;
        for i in 1..=10_000 {
            let alpha = table.alpha_prime(f64::from(i) * 1e-4);
            assert!(alpha > last && alpha <= 1.0, "{i}");
            last = alpha;
        }
    }

    #[test]
    fn conversions_invert_each_other() {
        for g in [-0.9, 0.0, 0.5, 0.95] {
            for alpha in [0.01, 0.5, 0.999] {
                assert!((alpha_from_reduced(reduced_alpha(alpha, g), g) - alpha).abs() < 1e-13);
                // Similarity keeps absorption: sigma_t' = sigma_t (1 - alpha g).
                let (sigma_t, reduced) = (2.0, reduced_alpha(alpha, g));
                let sigma_t_prime = sigma_t * (1.0 - alpha * g);
                assert!(((1.0 - reduced) * sigma_t_prime - (1.0 - alpha) * sigma_t).abs() < 1e-13);
                assert!((reduced * sigma_t_prime - reduced_scattering(alpha * sigma_t, g)).abs() < 1e-13);
            }
        }
        let (a, s) = from_dmfp(0.97, 2.5);
        assert!((dmfp(a, s) - 2.5).abs() < 1e-13 && (s / (a + s) - 0.97).abs() < 1e-15);
    }

    #[test]
    fn reflectance_and_mfp_give_pbrts_coefficients() {
        let table = AlbedoTable::new(1.33, 0.0).unwrap();
        let (a, s) = table.coefficients(Spectrum([0.0, 0.5, 0.9, 1.0]), Spectrum([1.0, 0.5, 2.0, 4.0]));
        // sigma_t = 1 / mfp; no scattering for black, no absorption for white.
        assert!((0..4).all(|i| ((a[i] + s[i]) * [1.0, 0.5, 2.0, 4.0][i] - 1.0).abs() < 1e-6));
        assert!(s[0] == 0.0 && a[3] == 0.0 && (s[1] * 0.5 - 0.97334).abs() < 1e-5);
    }
}
