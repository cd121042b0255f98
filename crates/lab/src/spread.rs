//! One set of walks into a half-space, read at several single-scattering albedos: what each returns, and how far out.
//!
//! Absorption only weighs: a path of N collisions counts alpha^N, whatever else happened to it. So walks at the largest albedo serve the smaller ones too, with the factor
//! (alpha / largest)^N. Every upward flight scores its probability of leaving where it would leave, which is the mean of what the walk does next and less noisy. The
//! estimates of different albedos share their walks, so their errors are not independent.

use std::f64::consts::PI;

use moonmilk_core::{Estimate, Random, Spectrum, Stream, Vec3};
use moonmilk_optics::fresnel;
use moonmilk_walk::domain::layer::Layer;
use moonmilk_walk::phase::HenyeyGreenstein;
use moonmilk_walk::{Limits, Medium, Roulette, Tally, Walker, walk};
use rayon::prelude::*;

use crate::error::{Error, within};
use crate::run::BATCHES;

/// What is asked: light along the normal onto a half-space of isotropic scatterers with unit extinction.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// Relative index, inside / outside.
    pub eta: f64,
    /// Single-scattering albedos.
    pub alphas: Vec<f64>,
    /// Rings of the radius, inner and outer \[mean free paths\]; they may overlap.
    pub rings: Vec<(f64, f64)>,
    /// Number of walks.
    pub walks: u64,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// The answer for one albedo, per unit of light that entered.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    /// The single-scattering albedo.
    pub alpha: f64,
    /// Share of the light that leaves.
    pub albedo: Estimate,
    /// Mean of R over each ring \[1/mfp^2\].
    pub rings: Vec<Estimate>,
    /// Means of each batch, albedo first, for errors of what is computed from several of them.
    pub batches: Vec<Vec<f64>>,
}

impl Spread {
    /// Returns a function of (albedo, rings) with the error that the batches give it (jackknife).
    pub fn derived(&self, f: impl Fn(f64, &[f64]) -> f64) -> Estimate {
        let n = self.batches.len() as f64;
        let mean: Vec<f64> =
            (0..self.batches[0].len()).map(|i| self.batches.iter().map(|b| b[i]).sum::<f64>() / n).collect();
        let without = |b: &[f64]| {
            let rest: Vec<f64> = mean.iter().zip(b).map(|(m, x)| (m * n - x) / (n - 1.0)).collect();
            f(rest[0], &rest[1..])
        };
        let values: Vec<f64> = self.batches.iter().map(|b| without(b)).collect();
        let centre = values.iter().sum::<f64>() / n;
        let square: f64 = values.iter().map(|v| (v - centre) * (v - centre)).sum();
        Estimate { mean: f(mean[0], &mean[1..]), std_err: ((n - 1.0) / n * square).sqrt(), n: self.albedo.n }
    }
}

/// Optical depth beyond which a flight's probability of leaving (4e-11) is not scored: 1e-9 of any share.
const DEEP: f32 = 24.0;

struct Exits<'a> {
    question: &'a Question,
    /// Squared bounds of the rings.
    squares: &'a [(f32, f32)],
    /// (alpha / largest)^N of each albedo, and its factor per collision.
    weights: Vec<f64>,
    factors: Vec<f64>,
    /// Per albedo: share that left, then shares through each ring.
    sums: &'a mut [f64],
}

impl<R: Random> Tally<1, R> for Exits<'_> {
    #[inline]
    fn flight(&mut self, walker: &Walker<1>, _t: f32) {
        if walker.d.z >= 0.0 || walker.p.z >= DEEP * -walker.d.z || walker.collisions == 0 {
            return;
        }
        let t = walker.p.z / -walker.d.z;
        let through = 1.0 - fresnel::reflectance(-walker.d.z, 1.0 / self.question.eta as f32);
        if through <= 0.0 {
            return;
        }
        let share = f64::from(walker.beta[0] * through * (-t).exp());
        let (x, y) = (walker.p.x + walker.d.x * t, walker.p.y + walker.d.y * t);
        let r2 = x * x + y * y;
        let columns = 1 + self.squares.len();
        for (k, w) in self.weights.iter().enumerate() {
            self.sums[k * columns] += share * w;
        }
        for (i, _) in self.squares.iter().enumerate().filter(|(_, (a, b))| r2 >= *a && r2 < *b) {
            for (k, w) in self.weights.iter().enumerate() {
                self.sums[k * columns + 1 + i] += share * w;
            }
        }
    }

    #[inline]
    fn collision(&mut self, _walker: &mut Walker<1>, _medium: &Medium<1>, _arrived: Spectrum<1>, _rng: &mut R) {
        self.weights.iter_mut().zip(&self.factors).for_each(|(w, f)| *w *= f);
    }
}

/// Follows the walks and returns an answer per albedo.
///
/// *Errors*: albedos outside (0, 1), an index that is not positive, rings that are none, fewer walks than batches.
pub fn spread(q: &Question) -> Result<Vec<Spread>, Error> {
    for &alpha in &q.alphas {
        within("alpha", alpha, alpha > 0.0 && alpha < 1.0, "(0, 1)")?;
    }
    within("eta", q.eta, q.eta > 0.0 && q.eta.is_finite(), "(0, inf)")?;
    for &(a, b) in &q.rings {
        within("ring", a, a >= 0.0 && a < b, "[0, its outer radius)")?;
    }
    within("walks", q.walks as f64, q.walks >= BATCHES, "[64, inf)")?;
    let most = q.alphas.iter().copied().fold(0.0, f64::max);
    let squares: Vec<(f32, f32)> = q.rings.iter().map(|(a, b)| ((a * a) as f32, (b * b) as f32)).collect();
    let columns = 1 + squares.len();
    let batches: Vec<Vec<f64>> = (0..BATCHES)
        .into_par_iter()
        .map(|b| {
            let domain = Layer { thickness: f32::INFINITY, eta_front: q.eta as f32, eta_back: 1.0 };
            let medium =
                Medium::with_law(Spectrum([(1.0 - most) as f32]), Spectrum([most as f32]), HenyeyGreenstein { g: 0.0 });
            let limits = Limits::from(Roulette::default());
            let mut sums = vec![0.0; q.alphas.len() * columns];
            let mut tally = Exits {
                question: q,
                squares: &squares,
                weights: Vec::new(),
                factors: q.alphas.iter().map(|a| a / most).collect(),
                sums: &mut sums,
            };
            let (first, end) = (b * q.walks / BATCHES, (b + 1) * q.walks / BATCHES);
            for i in first..end {
                let mut rng = Stream::new(&[q.seed, i]);
                let mut walker = Walker::new(Vec3::ZERO, Vec3::Z);
                tally.weights.clear();
                tally.weights.resize(q.alphas.len(), 1.0);
                walk(&domain, &medium, &limits, &mut walker, &mut tally, &mut rng);
            }
            let n = (end - first) as f64;
            sums.iter_mut().for_each(|s| *s /= n);
            sums
        })
        .collect();
    let answer = |(k, &alpha): (usize, &f64)| {
        let area = |i: usize| if i == 0 { 1.0 } else { PI * (q.rings[i - 1].1.powi(2) - q.rings[i - 1].0.powi(2)) };
        let batches: Vec<Vec<f64>> =
            batches.iter().map(|b| (0..columns).map(|i| b[k * columns + i] / area(i)).collect()).collect();
        let estimate = |i: usize| {
            let n = BATCHES as f64;
            let mean = batches.iter().map(|b| b[i]).sum::<f64>() / n;
            let square: f64 = batches.iter().map(|b| (b[i] - mean) * (b[i] - mean)).sum();
            Estimate { mean, std_err: (square / (n - 1.0) / n).sqrt(), n: q.walks }
        };
        Spread { alpha, albedo: estimate(0), rings: (1..columns).map(estimate).collect(), batches: batches.clone() }
    };
    Ok(q.alphas.iter().enumerate().map(answer).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_optics::halfspace::{HalfSpace, Illumination};

    #[test]
    fn one_set_of_walks_has_every_exact_albedo_and_its_rings_sum_to_it() {
        let question = |seed| Question {
            eta: 1.33,
            alphas: vec![0.3, 0.8, 0.99],
            rings: vec![(0.0, 1.0), (1.0, 1e6), (0.0, 1e6)],
            walks: 20_000,
            seed,
        };
        for s in spread(&question(1)).unwrap() {
            let exact = HalfSpace::new(s.alpha, 1.33).unwrap().albedo(Illumination::Normal);
            // Student's t of 63 degrees of freedom: 4.7 is 1.4e-5, three comparisons at 1e-4 in all with room for rounding of f32 weights, 1e-6.
            assert!(s.albedo.z(exact).abs() < 4.7 && s.albedo.relative_error() < 0.02, "{} {}", s.alpha, s.albedo);
            let area = |a: f64, b: f64| PI * (b * b - a * a);
            let sum = s.rings[0].mean * area(0.0, 1.0) + s.rings[1].mean * area(1.0, 1e6);
            assert!(
                (sum / s.albedo.mean - 1.0).abs() < 1e-9 && (s.rings[2].mean * area(0.0, 1e6) / sum - 1.0).abs() < 1e-9
            );
            // The jackknife of the mean is its standard error.
            let d = s.derived(|albedo, _| albedo);
            assert!((d.mean - s.albedo.mean).abs() < 1e-12 && (d.std_err / s.albedo.std_err - 1.0).abs() < 1e-9);
        }
        assert_eq!(spread(&question(1)), spread(&question(1)));
        assert!(spread(&Question { alphas: vec![1.0], ..question(1) }).is_err());
        assert!(spread(&Question { rings: vec![(2.0, 1.0)], ..question(1) }).is_err());
    }
}
