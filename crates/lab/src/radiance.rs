//! The radiance inside bodies lit from outside, exactly, direction by direction: what diffusion keeps only two moments of.
//!
//! Uniform Lambertian light falls on a half-space or a ball; unit power enters per unit of surface. Where a flight crosses the plane or sphere of a depth, its weight goes to the bin
//! of its cosine with the outward normal. The mean radiance over a bin, weighted by |mu|, is then
//!
//! $$ \bar L = \frac{\text{flux}}{2\pi \int |\mu|\, d\mu}, $$
//!
//! whose variance is finite, as that of L at grazing angles is not. A linear radiance has this mean at [`Slice::centre`], so that P1 needs no correction.

use std::f64::consts::PI;

use moonmilk_core::{Estimate, Random, Spectrum, Stream, Vec3};
use moonmilk_walk::domain::ball::Ball;
use moonmilk_walk::domain::planar::Slab;
use moonmilk_walk::math::sin_cos_turn;
use moonmilk_walk::phase::HenyeyGreenstein;
use moonmilk_walk::{Domain, Limits, Medium, Outcome, Roulette, Tally, Walker, walk};
use rayon::prelude::*;

pub use moonmilk_optics::p1::lit::Body;

use crate::error::{Error, within};
use crate::experiment::enter;
use crate::profile::HalfSpace;
use crate::run::BATCHES;

/// Bins of the cosine between -1 and 1.
pub const BINS: usize = 40;
/// Collisions after which a path is given up; its light is [`Answer::unfinished`].
const MOST_COLLISIONS: u32 = 1_000_000;

/// The radiance at one depth.
#[derive(Clone, Debug, PartialEq)]
pub struct Slice {
    /// Depth below the surface \[L\].
    pub depth: f64,
    /// Mean radiance of each bin \[1/(L^2 sr)\], from inward to outward directions.
    pub radiance: Vec<Estimate>,
    /// Fluence \[1/L^2\], by the bins: as if the radiance were even over each, off by .1 % at most.
    pub phi: Estimate,
    /// Outward flux \[1/L^2\].
    pub flux: Estimate,
}

impl Slice {
    /// Returns the edges of a bin.
    pub fn edges(i: usize) -> (f64, f64) {
        let edge = |i: usize| -1.0 + 2.0 * i as f64 / BINS as f64;
        (edge(i), edge(i + 1))
    }

    /// Returns the mean cosine of a bin, weighted by |mu|.
    pub fn centre(i: usize) -> f64 {
        let (a, b) = Self::edges(i);
        2.0 / 3.0 * (b.powi(3) - a.powi(3)) / (b * b - a * a)
    }

    /// Returns the integral of |f - L| over the directions, over that of L.
    pub fn l1(&self, f: impl Fn(f64) -> f64) -> f64 {
        let (mut off, mut all) = (0.0, 0.0);
        for (i, l) in self.radiance.iter().enumerate() {
            off += (f(Self::centre(i)) - l.mean).abs();
            all += l.mean;
        }
        off / all
    }

    /// Returns what noise alone makes of [`Slice::l1`], in the mean.
    pub fn noise(&self) -> f64 {
        let (off, all) = self.radiance.iter().fold((0.0, 0.0), |(o, a), l| (o + l.std_err, a + l.mean));
        (2.0 / PI).sqrt() * off / all
    }
}

/// The radiance at all depths.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// One slice per depth asked for.
    pub slices: Vec<Slice>,
    /// Light still inside when its path was given up.
    pub unfinished: f64,
}

/// Adds the weight of each crossing to the bin of its cosine.
struct Crossings<'a> {
    body: Body,
    /// Depth of each plane, or radius of each sphere.
    places: &'a [f64],
    sums: &'a mut [f64],
}

impl Crossings<'_> {
    #[inline]
    fn add(&mut self, place: usize, cosine: f64, weight: f64) {
        let bin = ((cosine + 1.0) * 0.5 * BINS as f64) as usize;
        self.sums[place * BINS + bin.min(BINS - 1)] += weight;
    }
}

impl<R: Random> Tally<1, R> for Crossings<'_> {
    fn flight(&mut self, walker: &Walker<1>, t: f32) {
        let (p, d, t) = (walker.p.as_dvec3(), walker.d.as_dvec3(), f64::from(t));
        let weight = f64::from(walker.beta[0]);
        for k in 0..self.places.len() {
            let place = self.places[k];
            match self.body {
                Body::HalfSpace => {
                    if (p.z < place) != (p.z + t * d.z < place) {
                        self.add(k, -d.z, weight);
                    }
                }
                Body::Ball { .. } => {
                    let b = p.dot(d);
                    let square = b * b - p.length_squared() + place * place;
                    if square > 0.0 {
                        let root = square.sqrt();
                        for s in [-b - root, -b + root] {
                            if s > 0.0 && s <= t {
                                self.add(k, (b + s) / place, weight);
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Measures the radiance at depths below the surface of a body.
///
/// *Errors*: depths outside of the body or at its surface itself, a ball without size, fewer walks than batches.
pub fn radiance(medium: &HalfSpace, body: Body, depths: &[f64], walks: u64, seed: u64) -> Result<Answer, Error> {
    let deepest = match body {
        Body::HalfSpace => f64::INFINITY,
        Body::Ball { radius } => {
            within("radius", radius, radius > 0.0 && radius.is_finite(), "(0, inf)")?;
            radius
        }
    };
    for &z in depths {
        within("depth", z, z > 0.0 && z < deepest, "(0, the body's half thickness)")?;
    }
    within("walks", walks as f64, walks >= BATCHES, "[64, inf)")?;
    let eta = medium.eta as f32;
    match body {
        Body::HalfSpace => Ok(measure(medium, body, depths, walks, seed, &Slab { thickness: f32::INFINITY, eta })),
        Body::Ball { radius } => Ok(measure(medium, body, depths, walks, seed, &Ball { radius: radius as f32, eta })),
    }
}

fn measure<D: Domain<1> + Sync>(
    medium: &HalfSpace,
    body: Body,
    depths: &[f64],
    walks: u64,
    seed: u64,
    domain: &D,
) -> Answer {
    let law = HenyeyGreenstein { g: medium.g as f32 };
    let inside = Medium::with_law(Spectrum([medium.sigma_a as f32]), Spectrum([medium.sigma_s as f32]), law);
    let places: Vec<f64> = match body {
        Body::HalfSpace => depths.to_vec(),
        Body::Ball { radius } => depths.iter().map(|z| radius - z).collect(),
    };
    let limits = Limits { roulette: Roulette::default(), collisions: MOST_COLLISIONS };
    let batches: Vec<(Vec<f64>, f64)> = (0..BATCHES)
        .into_par_iter()
        .map(|b| {
            let (first, end) = (b * walks / BATCHES, (b + 1) * walks / BATCHES);
            let (mut sums, mut unfinished) = (vec![0.0; depths.len() * BINS], 0.0);
            for i in first..end {
                let mut rng = Stream::new(&[seed, i]);
                let d = lambertian_entry(medium.eta as f32, &mut rng);
                let mut walker = match body {
                    Body::HalfSpace => Walker::new(Vec3::ZERO, d),
                    Body::Ball { radius } => Walker::new(Vec3::new(0.0, 0.0, -radius as f32), d),
                };
                let mut tally = Crossings { body, places: &places, sums: &mut sums };
                let out = walk(domain, &inside, &limits, &mut walker, &mut tally, &mut rng);
                if matches!(out, Outcome::Ended) && walker.collisions >= MOST_COLLISIONS {
                    unfinished += f64::from(walker.beta[0]);
                }
            }
            let n = (end - first) as f64;
            sums.iter_mut().for_each(|s| *s /= n);
            (sums, unfinished / n)
        })
        .collect();

    let n = BATCHES as f64;
    let estimate = |f: &dyn Fn(&[f64]) -> f64| {
        let values: Vec<f64> = batches.iter().map(|b| f(&b.0)).collect();
        let mean = values.iter().sum::<f64>() / n;
        let square: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
        Estimate { mean, std_err: (square / (n - 1.0) / n).sqrt(), n: walks }
    };
    let slices = depths.iter().zip(&places).enumerate().map(|(k, (&depth, &place))| {
        // One walk per unit of surface, or the ball's surface over that of the sphere.
        let scale = match body {
            Body::HalfSpace => 1.0,
            Body::Ball { radius } => (radius / place).powi(2),
        };
        let measure = |i: usize| {
            let (a, b) = Slice::edges(i);
            PI * (b * b - a * a).abs()
        };
        let at = |sums: &[f64], i: usize| sums[k * BINS + i] * scale / measure(i);
        let width = 2.0 / BINS as f64;
        Slice {
            depth,
            radiance: (0..BINS).map(|i| estimate(&|s| at(s, i))).collect(),
            phi: estimate(&|s| (0..BINS).map(|i| 2.0 * PI * width * at(s, i)).sum()),
            flux: estimate(&|s| {
                let sign = |i: usize| if i < BINS / 2 { -scale } else { scale };
                (0..BINS).map(|i| sign(i) * s[k * BINS + i]).sum()
            }),
        }
    });
    Answer { slices: slices.collect(), unfinished: batches.iter().map(|b| b.1).sum::<f64>() / n }
}

/// Returns the direction inside, +z inwards, of Lambertian light that entered.
fn lambertian_entry(eta: f32, rng: &mut impl Random) -> Vec3 {
    loop {
        let u = rng.uniform2();
        let (s, c) = sin_cos_turn(u[1]);
        let r = (1.0 - u[0]).sqrt();
        let (reflected, inside) = enter(Vec3::new(r * c, r * s, u[0].sqrt()), eta);
        match inside {
            Some(d) if eta == 1.0 || rng.uniform() >= reflected => return d,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_optics::boundary::Boundary;
    use moonmilk_optics::halfspace::{HFunction, HalfSpace as Exact, Illumination};

    /// Student's t with 63 degrees of freedom at 1e-4 over the 100 comparisons of a run.
    const Z: f64 = 5.4;

    #[test]
    fn bodies_that_do_not_absorb_are_filled_evenly() {
        for (eta, g) in [(1.0, 0.0), (1.5, 0.7)] {
            let medium = HalfSpace { sigma_a: 0.0, sigma_s: 2.0, g, eta };
            let answer = radiance(&medium, Body::Ball { radius: 1.0 }, &[1e-4, 0.5], 20_000, 5).unwrap();
            // Radiance of a furnace: 1 / (4 pi C_phi).
            let exact = 1.0 / (4.0 * PI * Boundary::exact(eta).c_phi());
            for s in &answer.slices {
                for l in &s.radiance {
                    assert!(l.z(exact).abs() < Z, "{eta} {}: {l} {exact}", s.depth);
                }
                assert!(s.phi.z(4.0 * PI * exact).abs() < Z && s.flux.z(0.0).abs() < Z);
            }
        }
    }

    #[test]
    fn the_radiance_at_a_matched_surface_is_chandrasekhars() {
        let alpha = 0.9;
        let medium = HalfSpace { sigma_a: 1.0 - alpha, sigma_s: alpha, g: 0.0, eta: 1.0 };
        let s = &radiance(&medium, Body::HalfSpace, &[1e-5], 100_000, 6).unwrap().slices[0];
        let h = HFunction::new(alpha).unwrap();
        for (i, l) in s.radiance.iter().enumerate().filter(|(i, _)| *i != BINS / 2) {
            // Lambertian light of unit power has radiance 1 / pi; what comes back is 1 - sqrt(1 - alpha) H of it, by reciprocity.
            let mu = Slice::centre(i);
            let exact = if mu < 0.0 { 1.0 / PI } else { h.plane_albedo(mu) / PI };
            // 1e-5 mean free paths below the surface: .1 % at a cosine of .01. H bends little over a bin: 1e-4.
            assert!((l.mean - exact).abs() < Z * l.std_err + 1e-3 * exact, "{mu}: {l} {exact}");
        }
        let leaves = Exact::new(alpha, 1.0).unwrap().albedo(Illumination::DiffuseOutside);
        assert!((s.flux.mean - (leaves - 1.0)).abs() < Z * s.flux.std_err + 1e-4, "{}", s.flux);
        assert!(radiance(&medium, Body::HalfSpace, &[0.0], 1000, 6).is_err());
        assert!(radiance(&medium, Body::Ball { radius: 1.0 }, &[1.5], 1000, 6).is_err());
    }
}
