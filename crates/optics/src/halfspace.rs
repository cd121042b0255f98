//! Exact reflection of a semi-infinite medium with a smooth boundary: isotropic scattering here, any other in [`anisotropic`].
//!
//! Index-matched, everything isotropic follows from Chandrasekhar's H function. With a refractive boundary the flux density g(mu) that
//! arrives at the boundary from inside obeys
//!
//! $$ g = K (f_0 + F g), \qquad (K f)(\mu) = \tfrac{\alpha}{2}\, \mu H(\mu) \int_0^1 \frac{H(\mu') f(\mu')}{\mu + \mu'} d\mu', \qquad A = \int_0^1 (1 - F)\, g\, d\mu $$
//!
//! with F the internal Fresnel reflectance and f_0 the flux density that enters. K, the reflection of the matched medium, takes care of all
//! scattering; the sum over internal reflections is a Neumann series on Gauss nodes, split at the critical angle.
//!
//! Albedos are those of the light that *entered*: multiply by 1 - F and add F for the total reflectance. *Accuracy*: 1e-6 against the
//! reference table (tests), for eta in \[1/3, 3\]. *Source*: \[Chandrasekhar1960\]; H after Stibbs & Weir (1959).

use std::f64::consts::{FRAC_PI_2, PI};

use moonmilk_core::Real;
use moonmilk_core::quadrature::Rule;

use crate::error::{Error, within};
use crate::fresnel::reflectance_f64;
use crate::properties::OpticalProperties;

pub mod anisotropic;

pub use anisotropic::Anisotropic;

/// Chandrasekhar's H function of isotropic scattering with single-scattering albedo alpha.
#[derive(Clone, Debug)]
pub struct HFunction {
    alpha: f64,
    /// (cos^2 t, sin^2 t, weight times -ln(1 - alpha t cot t) / pi) at the nodes of the integral over t.
    terms: Vec<[f64; 3]>,
}

impl HFunction {
    /// Returns H for a single-scattering albedo.
    ///
    /// *Errors*: alpha outside \[0, 1\].
    pub fn new(alpha: f64) -> Result<Self, Error> {
        within("alpha", alpha as f32, (0.0..=1.0).contains(&alpha), "[0, 1]")?;
        // The logarithm is singular at t = 0 for alpha = 1, the kernel peaks at pi/2 for small mu: grade towards both ends.
        let mut breaks = vec![0.0];
        breaks.extend((0..=9).map(|i| 0.6 * 0.125f64.powi(9 - i)));
        breaks.extend((0..=9).map(|i| FRAC_PI_2 - 0.6 * 0.125f64.powi(i)));
        breaks.push(FRAC_PI_2);
        let terms = Rule::composite(12, &breaks)
            .iter()
            .map(|(t, w)| {
                let (s, c) = t.sin_cos();
                [c * c, s * s, -w / PI * ((1.0 - alpha) + alpha * one_minus_t_cot_t(t)).ln()]
            })
            .collect();
        Ok(Self { alpha, terms })
    }

    /// Returns the single-scattering albedo.
    pub fn alpha(&self) -> f64 {
        self.alpha
    }

    /// Returns H(mu) = exp{ -(mu/pi) int_0^{pi/2} ln(1 - alpha t cot t) / (cos^2 t + mu^2 sin^2 t) dt }.
    ///
    /// *Domain*: mu in \[0, 1\]. *Accuracy*: 1e-10 (test by the moment of order 0).
    pub fn eval(&self, mu: f64) -> f64 {
        let mu2 = mu * mu;
        (mu * self.terms.iter().map(|[c2, s2, l]| l / (c2 + mu2 * s2)).sum::<f64>()).exp()
    }

    /// Returns the moment of order n: the integral of H(mu) mu^n over \[0, 1\].
    pub fn moment(&self, n: i32) -> f64 {
        // Squared nodes resolve the mu ln mu of H at 0.
        Rule::gauss(48, 0.0, 1.0).integrate(|x| 2.0 * x * self.eval(x * x) * x.powi(2 * n))
    }

    /// Returns the plane albedo 1 - sqrt(1 - alpha) H(mu) of the index-matched medium for light of cosine mu.
    pub fn plane_albedo(&self, mu: f64) -> f64 {
        1.0 - (1.0 - self.alpha).sqrt() * self.eval(mu)
    }

    /// Returns the albedo of the index-matched medium for Lambertian light: 1 - 2 sqrt(1 - alpha) times the first moment.
    pub fn diffuse_albedo(&self) -> f64 {
        1.0 - 2.0 * (1.0 - self.alpha).sqrt() * self.moment(1)
    }

    /// Returns the BRDF of the index-matched medium \[1/sr\]: alpha H(mu_i) H(mu_o) / (4 pi (mu_i + mu_o)).
    pub fn brdf(&self, mu_i: f64, mu_o: f64) -> f64 {
        self.alpha * self.eval(mu_i) * self.eval(mu_o) / (4.0 * PI * (mu_i + mu_o))
    }
}

/// Returns 1 - t cot t without cancellation at small t.
fn one_minus_t_cot_t(t: f64) -> f64 {
    let t2 = t * t;
    if t < 0.05 {
        // Series to t^8; the next term is below 1e-17 of the first.
        t2 * (1.0 / 3.0 + t2 * (1.0 / 45.0 + t2 * (2.0 / 945.0 + t2 / 4725.0)))
    } else {
        1.0 - t / t.tan()
    }
}

/// Returns the exact albedo of entered light of a medium, with its derivatives if T carries them.
///
/// Isotropic scattering by [`HalfSpace`], other by [`Anisotropic`]. *Accuracy*: 1e-7 of the value at g = 0, 1e-5 for |g| up to .9,
/// 1e-4 at .95; derivatives are differences of it, good to 1e-5. Costs 0.1 to 1 ms, 10 ms at g = .95, ten times that with derivatives. *Errors*: eta outside \[1/3, 3\].
pub fn exact_albedo<T: Real>(medium: &OpticalProperties<T>, light: Illumination) -> Result<T, Error> {
    // The albedo is smooth in s = sqrt(1 - alpha'), not in alpha'.
    let s = (medium.sigma_a() / medium.sigma_t_prime()).sqrt();
    let [s0, g0, eta0] = [s, medium.g(), medium.eta()].map(Real::value);
    let value = albedo_of(s0, g0, eta0, light)?;
    if !T::CARRIES_DERIVATIVES {
        return Ok(T::from_f64(value));
    }
    // Differences within the domain.
    let (s_low, s_high) = ((s0 - 2e-4).max(0.0), (s0 + 2e-4).min(1.0));
    let by_s = (albedo_of(s_high, g0, eta0, light)? - albedo_of(s_low, g0, eta0, light)?) / (s_high - s_low);
    let h = 2e-4 * (1.0 - g0.abs());
    let by_g = (albedo_of(s0, g0 + h, eta0, light)? - albedo_of(s0, g0 - h, eta0, light)?) / (2.0 * h);
    // Stay on one side of the matched boundary, where the albedo has a kink.
    let (first, last) = if eta0 < 1.0 { (ETA_RANGE.0, 1.0) } else { (1.0, ETA_RANGE.1) };
    let (eta_low, eta_high) = ((eta0 - 2e-4).max(first), (eta0 + 2e-4).min(last));
    let by_eta = (albedo_of(s0, g0, eta_high, light)? - albedo_of(s0, g0, eta_low, light)?) / (eta_high - eta_low);
    Ok(s.lift(value, by_s) + medium.g().lift(0.0, by_g) + medium.eta().lift(0.0, by_eta))
}

/// Returns the albedo for s = sqrt(1 - alpha'), with alpha' the reduced single-scattering albedo.
pub(crate) fn albedo_of(s: f64, g: f64, eta: f64, light: Illumination) -> Result<f64, Error> {
    if g == 0.0 {
        return Ok(HalfSpace::new((1.0 - s) * (1.0 + s), eta)?.albedo(light));
    }
    Anisotropic::new(g, eta, light)?.albedo(alpha_of(s, g))
}

/// Returns alpha for s = sqrt(1 - alpha'): (1 - s^2) / (1 - g s^2).
pub(crate) fn alpha_of(s: f64, g: f64) -> f64 {
    (1.0 - s) * (1.0 + s) / (1.0 - g * s * s)
}

/// How the light that enters is distributed inside the medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Illumination {
    /// Along the normal.
    Normal,
    /// At this cosine inside the medium.
    Inside(f64),
    /// Lambertian inside the medium.
    DiffuseInside,
    /// Lambertian outside, then refracted.
    DiffuseOutside,
}

/// Least and largest relative index of [`HalfSpace`].
pub const ETA_RANGE: (f64, f64) = (1.0 / 3.0, 3.0);

/// A half-space of isotropic scatterers behind a smooth boundary of relative index eta.
#[derive(Clone, Debug)]
pub struct HalfSpace {
    h: HFunction,
    eta: f64,
    /// Nodes in mu with weight, H and internal reflectance.
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    mu: f64,
    weight: f64,
    h: f64,
    reflected: f64,
}

impl HalfSpace {
    /// Number of nodes per side of the critical angle that gives 1e-7 or better.
    pub const NODES: usize = 48;

    /// Returns the half-space of single-scattering albedo `alpha` (reduced, if similarity is used) and index `eta` = inside / outside.
    ///
    /// *Errors*: alpha outside \[0, 1\], eta outside \[1/3, 3\].
    pub fn new(alpha: f64, eta: f64) -> Result<Self, Error> {
        Self::with_nodes(alpha, eta, Self::NODES)
    }

    /// Returns the half-space with n nodes on either side of the critical angle.
    ///
    /// *Errors*: as [`HalfSpace::new`].
    pub fn with_nodes(alpha: f64, eta: f64, n: usize) -> Result<Self, Error> {
        within("eta", eta as f32, (ETA_RANGE.0..=ETA_RANGE.1).contains(&eta), "[1/3, 3]")?;
        let h = HFunction::new(alpha)?;
        let critical2 = ((1.0 - 1.0 / eta) * (1.0 + 1.0 / eta)).max(0.0);
        let end = (1.0 - critical2).sqrt();
        let critical = critical2.sqrt();
        let mut nodes = Vec::with_capacity(2 * n);
        for (x, w) in Rule::gauss(n, 0.0, 1.0).iter() {
            // Squared nodes below the critical cosine resolve the mu ln mu of H at 0.
            if critical > 0.0 {
                nodes.push((critical * x * x, critical * 2.0 * x * w));
            }
            // Above it, mu = sqrt(critical^2 + t^2) resolves the square root of the reflectance; t again squared.
            let t = x * x * end;
            let mu = (critical2 + t * t).sqrt();
            nodes.push((mu, t / mu * 2.0 * x * end * w));
        }
        let nodes = nodes
            .into_iter()
            .map(|(mu, weight)| Node { mu, weight, h: h.eval(mu), reflected: reflectance_f64(mu, 1.0 / eta) })
            .collect();
        Ok(Self { h, eta, nodes })
    }

    /// Returns the fraction of the entered light that leaves again.
    pub fn albedo(&self, light: Illumination) -> f64 {
        let g = self.arriving(&self.sources(light));
        g.iter().zip(&self.nodes).map(|(g, n)| (1.0 - n.reflected) * g * n.weight).sum()
    }

    /// Returns the light that leaves per solid angle outside, at a cosine outside, per unit of the light that entered \[1/sr\].
    ///
    /// $$ I(\mu_o) = \frac{(1 - F)\, g(\mu)}{2\pi} \frac{d\mu}{d\mu_o}, \qquad \mu^2 = 1 - \frac{1 - \mu_o^2}{\eta^2} $$
    ///
    /// Its integral over the hemisphere is [`HalfSpace::albedo`]; index-matched it is [`HFunction::brdf`] times the cosine. *Domain*: cosines in (0, 1\].
    pub fn intensity(&self, light: Illumination, mu_outside: f64) -> f64 {
        let eta2 = self.eta * self.eta;
        let mu2 = 1.0 - (1.0 - mu_outside * mu_outside) / eta2;
        if mu2 <= 0.0 {
            return 0.0;
        }
        let mu = mu2.sqrt();
        let sum: f64 = self.sources(light).iter().map(|(m, s)| s / (mu + m)).sum();
        let g = 0.5 * self.h.alpha * mu * self.h.eval(mu) * sum;
        (1.0 - reflectance_f64(mu, 1.0 / self.eta)) * g * mu_outside / (eta2 * mu) / (2.0 * PI)
    }

    /// Returns all light that travels down at the boundary, what is reflected there included: pairs of cosine and flux times H.
    fn sources(&self, light: Illumination) -> Vec<(f64, f64)> {
        let entered = |node: &Node| match light {
            Illumination::DiffuseInside => 2.0 * node.mu,
            _ => node.mu * (1.0 - node.reflected),
        };
        let mut sources: Vec<(f64, f64)> = match light {
            Illumination::Normal => vec![(1.0, self.h.eval(1.0))],
            Illumination::Inside(mu) => vec![(mu, self.h.eval(mu))],
            _ => {
                let total: f64 = self.nodes.iter().map(|n| entered(n) * n.weight).sum();
                self.nodes.iter().map(|n| (n.mu, n.weight * n.h * entered(n) / total)).collect()
            }
        };
        // Sum over internal reflections. The series is geometric; its ratio is at most the largest mean reflectance, below .93 for eta <= 3.
        let mut order = self.arriving(&sources);
        let mut returned = vec![0.0; self.nodes.len()];
        for _ in 0..2000 {
            let down: Vec<(f64, f64)> =
                order.iter().zip(&self.nodes).map(|(g, n)| (n.mu, n.weight * n.h * g * n.reflected)).collect();
            returned.iter_mut().zip(&down).for_each(|(r, d)| *r += d.1);
            order = self.arriving(&down);
            if order.iter().fold(0.0f64, |m, &x| m.max(x)) < 1e-12 {
                break;
            }
        }
        sources.extend(self.nodes.iter().zip(returned).map(|(n, r)| (n.mu, r)));
        sources
    }

    /// Applies K: returns the flux density that arrives at the nodes from below for light that goes down.
    fn arriving(&self, sources: &[(f64, f64)]) -> Vec<f64> {
        self.nodes
            .iter()
            .map(|n| 0.5 * self.h.alpha * n.mu * n.h * sources.iter().map(|(mu, s)| s / (n.mu + mu)).sum::<f64>())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (alpha, H(.25), H(.5), H(.75), H(1), first moment): physics notes, 8.1.
    const H: [[f64; 6]; 10] = [
        [0.1, 1.020993, 1.028922, 1.033635, 1.036816, 0.515611],
        [0.3, 1.069299, 1.097559, 1.114903, 1.126844, 0.553121],
        [0.5, 1.129653, 1.187735, 1.224933, 1.251260, 0.603484],
        [0.6, 1.166733, 1.245807, 1.297871, 1.335407, 0.636633],
        [0.8, 1.266322, 1.413263, 1.518169, 1.598220, 0.735815],
        [0.9, 1.343271, 1.556034, 1.719001, 1.850099, 0.825316],
        [0.95, 1.400740, 1.671788, 1.891785, 2.077124, 0.901876],
        [0.98, 1.453575, 1.786293, 2.072534, 2.325789, 0.981749],
        [0.99, 1.480743, 1.848601, 2.175394, 2.472793, 1.027182],
        [0.999, 1.526165, 1.958687, 2.365660, 2.756073, 1.111331],
    ];

    /// (alpha; eta 1: normal, diffuse; 1.33: normal, diffuse inside, outside; 1.5: the same): physics notes, 8.1.
    const ALBEDOS: [[f64; 9]; 10] = [
        [0.1, 0.016390, 0.021698, 0.007783, 0.009736, 0.008499, 0.005843, 0.007262, 0.006229],
        [0.3, 0.057214, 0.074451, 0.028318, 0.035009, 0.030807, 0.021406, 0.026306, 0.022762],
        [0.5, 0.115226, 0.146544, 0.060331, 0.073389, 0.065289, 0.046089, 0.055758, 0.048825],
        [0.6, 0.155415, 0.194716, 0.084476, 0.101645, 0.091082, 0.065038, 0.077856, 0.068717],
        [0.8, 0.285255, 0.341867, 0.173684, 0.202086, 0.185049, 0.137478, 0.159313, 0.144025],
        [0.9, 0.414947, 0.478024, 0.280356, 0.316164, 0.295186, 0.229082, 0.257538, 0.237951],
        [0.95, 0.535541, 0.596669, 0.395918, 0.434455, 0.412342, 0.334498, 0.366197, 0.344704],
        [0.98, 0.671084, 0.722319, 0.545425, 0.581429, 0.561222, 0.480701, 0.511631, 0.490996],
        [0.99, 0.752721, 0.794564, 0.645854, 0.677120, 0.659795, 0.585397, 0.613037, 0.594770],
        [0.999, 0.912845, 0.929713, 0.866402, 0.880516, 0.872881, 0.834853, 0.848133, 0.839511],
    ];

    /// Rounding of the tables' last digit.
    const DIGIT: f64 = 6e-7;

    #[test]
    fn h_agrees_with_the_reference_table_and_its_moments_with_theory() {
        for row in H {
            let h = HFunction::new(row[0]).unwrap();
            for (mu, expected) in [0.25, 0.5, 0.75, 1.0].into_iter().zip(&row[1..5]) {
                assert!((h.eval(mu) - expected).abs() < DIGIT, "{} {mu} {}", row[0], h.eval(mu));
            }
            assert!((h.moment(1) - row[5]).abs() < DIGIT);
            // Chandrasekhar: the moment of order 0 is 2 (1 - sqrt(1 - alpha)) / alpha.
            let exact = 2.0 * (1.0 - (1.0 - row[0]).sqrt()) / row[0];
            assert!((h.moment(0) / exact - 1.0).abs() < 1e-9, "{} {:e}", row[0], h.moment(0) / exact - 1.0);
        }
        // alpha = 1: H(1) = 2.90781 (tables), moments 2 and 2 / sqrt 3.
        let h = HFunction::new(1.0).unwrap();
        assert!((h.eval(1.0) - 2.90781).abs() < 5e-6 && (h.moment(0) - 2.0).abs() < 1e-8);
        assert!((h.moment(1) - 2.0 / 3f64.sqrt()).abs() < 1e-8);
        assert_eq!(HFunction::new(0.0).unwrap().eval(0.3), 1.0);
    }

    #[test]
    fn albedos_agree_with_the_reference_table() {
        use Illumination::*;
        for row in ALBEDOS {
            for (eta, light, expected) in [
                (1.0, Normal, row[1]),
                (1.0, DiffuseInside, row[2]),
                (1.0, DiffuseOutside, row[2]),
                (1.33, Normal, row[3]),
                (1.33, DiffuseInside, row[4]),
                (1.33, DiffuseOutside, row[5]),
                (1.5, Normal, row[6]),
                (1.5, DiffuseInside, row[7]),
                (1.5, DiffuseOutside, row[8]),
            ] {
                let a = HalfSpace::new(row[0], eta).unwrap().albedo(light);
                assert!((a - expected).abs() < DIGIT, "{} {eta} {light:?}: {a} {expected}", row[0]);
            }
        }
        // eta = 1.4: normal / diffuse outside.
        for (alpha, n, d) in [(0.2, 0.015107, 0.016284), (0.85, 0.197143, 0.207468), (0.995, 0.709190, 0.719075)] {
            let s = HalfSpace::new(alpha, 1.4).unwrap();
            assert!((s.albedo(Normal) - n).abs() < DIGIT && (s.albedo(DiffuseOutside) - d).abs() < DIGIT);
        }
    }

    #[test]
    fn nothing_is_lost_when_nothing_absorbs() {
        for eta in [1.0 / 3.0, 0.7, 0.999, 1.0, 1.001, 1.33, 1.5, 2.0, 3.0] {
            for light in [
                Illumination::Normal,
                Illumination::Inside(0.3),
                Illumination::DiffuseInside,
                Illumination::DiffuseOutside,
            ] {
                let a = HalfSpace::new(1.0, eta).unwrap().albedo(light);
                assert!((a - 1.0).abs() < 1e-6, "{eta} {light:?} {a}");
            }
        }
    }

    #[test]
    fn the_matched_half_space_is_that_of_the_h_function() {
        for alpha in [0.2, 0.8, 0.99] {
            let (s, h) = (HalfSpace::new(alpha, 1.0).unwrap(), HFunction::new(alpha).unwrap());
            for mu in [0.1, 0.5, 1.0] {
                assert!((s.albedo(Illumination::Inside(mu)) - h.plane_albedo(mu)).abs() < 1e-8);
                // The BRDF integrates to the plane albedo.
                let sum = Rule::gauss(48, 0.0, 1.0).integrate(|x| 2.0 * x * 2.0 * PI * x * x * h.brdf(mu, x * x));
                assert!((sum - h.plane_albedo(mu)).abs() < 1e-8, "{alpha} {mu}");
            }
            assert!((s.albedo(Illumination::DiffuseInside) - h.diffuse_albedo()).abs() < 1e-8);
        }
    }

    #[test]
    fn what_leaves_over_all_directions_is_the_albedo() {
        for (alpha, eta) in [(0.3, 1.0), (0.9, 1.0), (0.9, 1.5), (0.99, 1.33), (0.8, 0.8)] {
            let s = HalfSpace::new(alpha, eta).unwrap();
            for light in [Illumination::Normal, Illumination::Inside(0.4), Illumination::DiffuseOutside] {
                // The intensity rises like a square root at the outside's critical cosine where the inside is thinner: squared nodes from there.
                let first = (1.0 - eta * eta).max(0.0f64).sqrt();
                let rule = Rule::composite(40, &[0.0, 0.2, 1.0]);
                let sum = rule.integrate(|x| {
                    let mu = first + (1.0 - first) * x * x;
                    2.0 * PI * (1.0 - first) * 2.0 * x * s.intensity(light, mu)
                });
                assert!((sum / s.albedo(light) - 1.0).abs() < 1e-6, "{alpha} {eta} {light:?} {sum}");
            }
            if eta == 1.0 {
                let h = HFunction::new(alpha).unwrap();
                for mu in [0.05, 0.5, 1.0] {
                    let exact = h.brdf(0.7, mu) * mu;
                    assert!((s.intensity(Illumination::Inside(0.7), mu) / exact - 1.0).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_boundary_to_a_denser_outside_is_resolved_and_obeys_reciprocity() {
        for (alpha, eta) in [(0.5, 0.7), (0.9, 0.4), (0.99, 0.9)] {
            let fine = HalfSpace::with_nodes(alpha, eta, 120).unwrap();
            let coarse = HalfSpace::new(alpha, eta).unwrap();
            for light in [Illumination::Normal, Illumination::DiffuseInside, Illumination::DiffuseOutside] {
                assert!((fine.albedo(light) - coarse.albedo(light)).abs() < 1e-6, "{alpha} {eta} {light:?}");
            }
            // Less is kept inside than with a denser inside, more than without a boundary.
            let matched = HalfSpace::new(alpha, 1.0).unwrap().albedo(Illumination::Normal);
            let a = coarse.albedo(Illumination::Normal);
            assert!(
                a < matched && a > HalfSpace::new(alpha, 1.0 / eta).unwrap().albedo(Illumination::Normal),
                "{alpha} {eta}"
            );
            // The light that leaves for diffuse light from outside is the mean over incidence of the albedo times what enters.
            let rule = Rule::composite(40, &[0.0, 0.02, 0.1, 0.3, 1.0]);
            let entered = |mu: f64| 2.0 * mu * (1.0 - reflectance_f64(mu, 1.0 / eta));
            let mean =
                rule.integrate(|mu| entered(mu) * coarse.albedo(Illumination::Inside(mu))) / rule.integrate(entered);
            assert!((mean - coarse.albedo(Illumination::DiffuseOutside)).abs() < 1e-6, "{alpha} {eta} {mean}");
        }
    }

    #[test]
    fn giovanellis_reflectance_is_met() {
        // n = 1.5, alpha = .9, specular reflection included: .259919 (exact; Giovanelli 1955 prints .2600).
        let a = HalfSpace::new(0.9, 1.5).unwrap().albedo(Illumination::Normal);
        assert!((0.04 + 0.96 * a - 0.259919).abs() < 1e-6);
    }

    #[test]
    fn single_scattering_is_the_limit_of_small_albedo() {
        // Normal incidence: (alpha / 2)(1 - ln 2).
        let alpha = 1e-5;
        let a = HalfSpace::new(alpha, 1.0).unwrap().albedo(Illumination::Normal);
        assert!((a / (0.5 * alpha * (1.0 - 2f64.ln())) - 1.0).abs() < 1e-4);
    }
}
