//! Where light enters a translucent body, as a BSSRDF sees it: everything that the boundary lets in counts alike.
//!
//! $$ f(\omega_i) = \frac{T(\omega_i)}{\pi N}, \qquad N = \frac{1}{\pi} \int T(\omega) \cos\theta\, d\omega, $$
//!
//! so that a hemisphere of radiance 1 gives 1. Smooth boundaries have T = 1 - F and N = 1 - 2 C_1(1/eta) \[Jensen2001; pbrt-v4, NormalizedFresnelBxDF\]. Rough ones let in what
//! their microfacets do: T is the integral of the transmitted lobe over all directions inside, met by one random facet per path (`Entry::rough`), and N is tabulated
//! over the roughness; of two roughnesses it takes the geometric mean. What facets shadow is lost, as everywhere in this boundary.

use std::f32::consts::FRAC_1_PI;

use moonmilk_core::quadrature::Rule;
use moonmilk_core::{Random, Spectrum, Stream, Vec2, Vec3};

use super::dielectric::Dielectric;
use super::ggx::{Ggx, SMOOTH_ALPHA};
use super::lambert::sample_cosine;
use super::{BsdfSample, Kind, facet};

/// The directions of entering light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Relative index, inside / outside.
    pub eta: f32,
    /// N.
    pub norm: f32,
    /// Microfacets: the value then lacks T, which `Entry::rough` estimates.
    pub ggx: Option<Ggx>,
}

impl Entry {
    #[inline]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z <= 0.0 {
            return 0.0;
        }
        let t = if self.ggx.is_some() { 1.0 } else { 1.0 - facet(wi.z.abs(), self.eta).0 };
        t * FRAC_1_PI / self.norm
    }

    #[inline]
    pub(crate) fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z * wi.z > 0.0 { wi.z.abs() * FRAC_1_PI } else { 0.0 }
    }

    #[inline]
    pub(crate) fn sample<const N: usize>(&self, wo: Vec3, u: [f32; 2]) -> BsdfSample<N> {
        let mut wi = sample_cosine(u);
        wi.z = wi.z.copysign(wo.z);
        let (f, pdf) = (Spectrum::splat(self.eval(wo, wi)), wi.z.abs() * FRAC_1_PI);
        BsdfSample { f, wi, pdf, kind: Kind::Reflection, specular: false, eta: 1.0 }
    }

    /// Returns an estimate of T for light from a direction (local frame) by one random facet; 1 for a smooth boundary, whose value has T already.
    #[inline]
    pub(crate) fn rough(&self, wi: Vec3, u: [f32; 2]) -> f32 {
        match self.ggx {
            Some(_) => self.boundary().sample_lobe(wi, u, false).map_or(0.0, |l| l.weight),
            None => 1.0,
        }
    }

    fn boundary(&self) -> Dielectric {
        Dielectric { eta: self.eta, ggx: self.ggx, dispersive: false }
    }
}

/// Nodes of N over the root of the roughness, from 0 to 1.
const NODES: usize = 17;
/// Facets per direction.
const FACETS: u64 = 64;

/// N of rough boundaries of one index.
///
/// *Accuracy*: 2e-3 of N (test); roughnesses above 1 count as 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Norms {
    nodes: Vec<f32>,
}

impl Norms {
    /// Tabulates N for an index.
    pub fn new(eta: f32) -> Self {
        let node = |k: usize| {
            let alpha = (k as f32 / (NODES - 1) as f32).powi(2);
            let entry = Entry { eta, norm: 1.0, ggx: Ggx::new(Vec2::splat(alpha.max(SMOOTH_ALPHA))) };
            // Cosine-weighted over directions; facets by fixed numbers, stratified in azimuth.
            let mut random = Stream::new(&[k as u64]);
            let mean = Rule::composite(8, &[0.0, 0.1, 0.4, 1.0]).integrate(|mu| {
                let wi = Vec3::new((1.0 - mu * mu).sqrt() as f32, 0.0, mu as f32);
                let facets = (0..FACETS).flat_map(|i| (0..FACETS).map(move |j| (i, j)));
                let cell = |i: u64, u: f32| (i as f32 + u) / FACETS as f32;
                let sum: f32 =
                    facets.map(|(i, j)| entry.rough(wi, [cell(i, random.uniform()), cell(j, random.uniform())])).sum();
                2.0 * mu * f64::from(sum) / (FACETS * FACETS) as f64
            });
            mean as f32
        };
        Self { nodes: (0..NODES).map(node).collect() }
    }

    /// Returns N for some facets.
    pub fn at(&self, ggx: Ggx) -> f32 {
        let x = (ggx.alpha.x * ggx.alpha.y).powf(0.25).min(1.0) * (NODES - 1) as f32;
        let i = (x as usize).min(NODES - 2);
        let t = x - i as f32;
        self.nodes[i] + t * (self.nodes[i + 1] - self.nodes[i])
    }
}

#[cfg(test)]
mod tests {
    use moonmilk_optics::fresnel::moment_1;

    use super::*;

    #[test]
    fn norms_are_what_the_facets_let_in() {
        // Two million random facets each in an independent program (numpy): +- 8e-5.
        let known = [
            (1.3f32, [(0.21f32, 0.94148), (0.55, 0.89545), (0.9, 0.82630)]),
            (1.5, [(0.21, 0.91365), (0.55, 0.87213), (0.9, 0.79981)]),
        ];
        for (eta, values) in known {
            let norms = Norms::new(eta);
            // The smooth limit in closed form.
            let smooth = 1.0 - 2.0 * moment_1(1.0 / f64::from(eta));
            assert!((f64::from(norms.nodes[0]) / smooth - 1.0).abs() < 1e-3, "{} {smooth}", norms.nodes[0]);
            for (alpha, expected) in values {
                let n = f64::from(norms.at(Ggx::new(Vec2::splat(alpha)).unwrap()));
                // Linear between 17 nodes, 4096 facets per direction.
                assert!((n / expected - 1.0).abs() < 2e-3, "{eta} {alpha}: {n} {expected}");
            }
        }
    }
}
