//! Walks in a medium without end: the fluence around a point source, and how far light has gone after a path of some length.
//!
//! **How far.** Directions forget themselves over the transport mean free path l' = 1 / (sigma_s (1 - g)): the correlation of two directions a path s apart is e^(-s / l'). So, exactly,
//!
//! $$ \langle r^2 \rangle(s) = 2 l'^2 \left( \frac{s}{l'} - 1 + e^{-s/l'} \right), $$
//!
//! which is $s^2$ at first, as for anything that flies straight, and $6 D s$ less a constant in the end, $D = l'/3$: Brownian motion, which knows no speed of light. Of its paths the share
//! [`beyond`] has gone farther than light can.

use std::f64::consts::PI;

use moonmilk_core::quadrature::Rule;
use moonmilk_core::{DVec3, Estimate, Random, Spectrum, Stream, Vec3};
use moonmilk_walk::domain::ball::Ball;
use moonmilk_walk::math::uniform_sphere;
use moonmilk_walk::phase::HenyeyGreenstein;
use moonmilk_walk::{Limits, Medium, Roulette, Tally, Walker, walk};
use rayon::prelude::*;

use crate::error::{Error, within};
use crate::profile::HalfSpace;
use crate::run::BATCHES;

/// Returns the mean square distance from the start after a path of length s \[L^2\], for a transport mean free path \[L\].
pub fn mean_square(s: f64, transport: f64) -> f64 {
    let x = s / transport;
    // x - 1 + e^-x cancels at small x: take its series there, whose next term is below 1e-9 of it.
    let shape = if x < 0.01 { x * x * (0.5 - x / 6.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0))) } else { x + (-x).exp_m1() };
    2.0 * transport * transport * shape
}

/// Returns the share of Brownian paths of diffusion coefficient l' / 3 that have gone farther than s after a path of length s, which light cannot.
pub fn beyond(s: f64, transport: f64) -> f64 {
    // Beyond x of a Maxwell law: the integral of 4 t^2 e^(-t^2) / sqrt(pi).
    let x = (0.75 * s / transport).sqrt();
    4.0 / PI.sqrt() * Rule::composite(16, &[x, x + 1.0, x + 3.0, x + 8.0]).integrate(|t| t * t * (-t * t).exp())
}

/// Walks and Brownian paths from the origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Journeys {
    /// Path lengths \[L\].
    pub lengths: Vec<f64>,
    /// Mean square distance of light from the origin at each \[L^2\].
    pub light: Vec<Estimate>,
    /// The same of Brownian motion, simulated.
    pub brownian: Vec<Estimate>,
    /// Corners of some paths of light.
    pub light_paths: Vec<Vec<DVec3>>,
    /// Corners of as many Brownian paths.
    pub brownian_paths: Vec<Vec<DVec3>>,
}

/// Paths that are kept to be drawn.
const KEPT: u64 = 6;
/// Steps of a Brownian path per transport mean free path, for drawing; its law at any time does not depend on them.
const STEPS: f64 = 24.0;
/// Radius of a domain that no path of the lengths allowed comes near the wall of, over the longest path.
const ENDLESS: f64 = 4.0;

/// Records where a path is after given lengths.
struct Milestones<'a> {
    lengths: &'a [f64],
    next: usize,
    path: f64,
    squares: &'a mut [f64],
    corners: Option<Vec<DVec3>>,
}

impl<R: Random> Tally<1, R> for Milestones<'_> {
    fn flight(&mut self, walker: &Walker<1>, t: f32) {
        let (p, d, t) = (walker.p.as_dvec3(), walker.d.as_dvec3(), f64::from(t));
        while self.next < self.lengths.len() && self.lengths[self.next] <= self.path + t {
            let at = p + d * (self.lengths[self.next] - self.path);
            self.squares[self.next] += at.length_squared();
            self.next += 1;
            if let (Some(c), true) = (&mut self.corners, self.next == self.lengths.len()) {
                c.push(at);
            }
        }
        self.path += t;
        if let (Some(c), true) = (&mut self.corners, self.next < self.lengths.len()) {
            c.push(p + d * t);
        }
    }

    fn collision(&mut self, walker: &mut Walker<1>, _medium: &Medium<1>, _arrived: Spectrum<1>, _rng: &mut R) {
        // The journey is over: a weight that looks like none ends the walk.
        if self.next == self.lengths.len() {
            walker.eta_scale = 0.0;
        }
    }
}

/// Sends light, and Brownian motion of the same diffusion coefficient, on paths of given lengths; absorption plays no part.
///
/// *Errors*: a medium that does not scatter, lengths that do not rise from above 0, fewer walks than batches.
pub fn journeys(medium: &HalfSpace, lengths: &[f64], walks: u64, seed: u64) -> Result<Journeys, Error> {
    within("sigma_s", medium.sigma_s, medium.sigma_s > 0.0 && medium.sigma_s.is_finite(), "(0, inf)")?;
    within("g", medium.g, medium.g.abs() < 1.0, "(-1, 1)")?;
    let rising = lengths.windows(2).all(|w| w[0] < w[1]) && lengths.first().is_some_and(|&s| s > 0.0);
    within("number of path lengths", lengths.len() as f64, rising, "[1, inf), rising from above 0")?;
    within("walks", walks as f64, walks >= BATCHES, "[64, inf)")?;
    let transport = 1.0 / (medium.sigma_s * (1.0 - medium.g));
    let domain = Ball { radius: (ENDLESS * lengths[lengths.len() - 1]) as f32, eta: 1.0 };
    let inside =
        Medium::with_law(Spectrum([0.0]), Spectrum([medium.sigma_s as f32]), HenyeyGreenstein { g: medium.g as f32 });
    let kept = |i: u64| (i < KEPT).then(|| vec![DVec3::ZERO]);
    type Batch = (Vec<f64>, Vec<f64>, Vec<Vec<DVec3>>, Vec<Vec<DVec3>>);
    let batches: Vec<Batch> = (0..BATCHES)
        .into_par_iter()
        .map(|b| {
            let (first, end) = (b * walks / BATCHES, (b + 1) * walks / BATCHES);
            let (mut light, mut brownian) = (vec![0.0; lengths.len()], vec![0.0; lengths.len()]);
            let (mut light_paths, mut brownian_paths) = (Vec::new(), Vec::new());
            for i in first..end {
                let mut rng = Stream::new(&[seed, i]);
                let mut walker = Walker::new(Vec3::ZERO, uniform_sphere(rng.uniform2()));
                let mut tally = Milestones { lengths, next: 0, path: 0.0, squares: &mut light, corners: kept(i) };
                walk(&domain, &inside, &Limits::from(Roulette::default()), &mut walker, &mut tally, &mut rng);
                light_paths.extend(tally.corners);
                brownian_paths.extend(wander(lengths, transport, &mut brownian, kept(i), &mut rng));
            }
            let n = (end - first) as f64;
            light.iter_mut().chain(&mut brownian).for_each(|s| *s /= n);
            (light, brownian, light_paths, brownian_paths)
        })
        .collect();
    let estimate = |of: &dyn Fn(&Batch) -> f64| {
        let n = BATCHES as f64;
        let mean = batches.iter().map(of).sum::<f64>() / n;
        let square: f64 = batches.iter().map(|b| (of(b) - mean).powi(2)).sum();
        Estimate { mean, std_err: (square / (n - 1.0) / n).sqrt(), n: walks }
    };
    Ok(Journeys {
        lengths: lengths.to_vec(),
        light: (0..lengths.len()).map(|k| estimate(&|b| b.0[k])).collect(),
        brownian: (0..lengths.len()).map(|k| estimate(&|b| b.1[k])).collect(),
        light_paths: batches.iter().flat_map(|b| b.2.clone()).collect(),
        brownian_paths: batches.iter().flat_map(|b| b.3.clone()).collect(),
    })
}

/// Follows one Brownian path of diffusion coefficient l' / 3; between milestones in one step unless its corners are kept.
fn wander(
    lengths: &[f64],
    transport: f64,
    squares: &mut [f64],
    mut corners: Option<Vec<DVec3>>,
    rng: &mut Stream,
) -> Option<Vec<DVec3>> {
    let (mut at, mut from) = (DVec3::ZERO, 0.0);
    for (s, square) in lengths.iter().zip(squares) {
        let span = s - from;
        let steps = if corners.is_some() { (span / transport * STEPS).ceil().max(1.0) } else { 1.0 };
        for _ in 0..steps as u64 {
            at += normal3(rng) * (2.0 * transport / 3.0 * span / steps).sqrt();
            if let Some(c) = &mut corners {
                c.push(at);
            }
        }
        *square += at.length_squared();
        from = *s;
    }
    corners
}

/// Returns three normal deviates.
fn normal3(rng: &mut Stream) -> DVec3 {
    let mut pair = || {
        // Box and Muller.
        let u = rng.uniform2().map(f64::from);
        let r = (-2.0 * u[0].ln()).sqrt();
        let (s, c) = (2.0 * PI * u[1]).sin_cos();
        (r * c, r * s)
    };
    let ((x, y), (z, _)) = (pair(), pair());
    DVec3::new(x, y, z)
}

/// Sums the length of flights in spherical shells.
struct Shells<'a> {
    /// Squared radii of each shell.
    squares: &'a [(f64, f64)],
    sums: &'a mut [f64],
}

impl<R: Random> Tally<1, R> for Shells<'_> {
    fn flight(&mut self, walker: &Walker<1>, t: f32) {
        let (p, d, t) = (walker.p.as_dvec3(), walker.d.as_dvec3(), f64::from(t));
        let b = p.dot(d);
        let closest2 = p.length_squared() - b * b;
        // The length of a flight within a ball is that of an interval cut by another.
        let within = |square: f64| {
            let half = (square - closest2).max(0.0).sqrt();
            ((half - b).min(t) - (-half - b).max(0.0)).max(0.0)
        };
        for (sum, &(inner, outer)) in self.sums.iter_mut().zip(self.squares) {
            if outer > closest2 {
                *sum += f64::from(walker.beta[0]) * (within(outer) - within(inner));
            }
        }
    }
}

/// Returns the mean fluence over shells (inner and outer radius \[L\]) around a point source of unit power \[1/L^2\], by track length.
///
/// *Errors*: a medium that does not absorb or not scatter, shells that are none, fewer walks than batches.
pub fn fluence(medium: &HalfSpace, shells: &[(f64, f64)], walks: u64, seed: u64) -> Result<Vec<Estimate>, Error> {
    within("sigma_a", medium.sigma_a, medium.sigma_a > 0.0 && medium.sigma_a.is_finite(), "(0, inf)")?;
    within("sigma_s", medium.sigma_s, medium.sigma_s >= 0.0 && medium.sigma_s.is_finite(), "[0, inf)")?;
    within("g", medium.g, medium.g.abs() < 1.0, "(-1, 1)")?;
    for &(a, b) in shells {
        within("shell", a, a >= 0.0 && a < b && b.is_finite(), "[0, its outer radius)")?;
    }
    within("walks", walks as f64, walks >= BATCHES, "[64, inf)")?;
    // The attenuation is at least .9 of the smaller of diffusion's and the extinction: what comes back from beyond is below e^-21.
    let kappa = (3.0 * medium.sigma_a * medium.sigma_t_prime()).sqrt().min(medium.sigma_a + medium.sigma_s);
    let radius = shells.iter().map(|s| s.1).fold(0.0, f64::max) + 12.0 / kappa;
    let squares: Vec<(f64, f64)> = shells.iter().map(|(a, b)| (a * a, b * b)).collect();
    let domain = Ball { radius: radius as f32, eta: 1.0 };
    let inside = Medium::with_law(
        Spectrum([medium.sigma_a as f32]),
        Spectrum([medium.sigma_s as f32]),
        HenyeyGreenstein { g: medium.g as f32 },
    );
    let batches: Vec<Vec<f64>> = (0..BATCHES)
        .into_par_iter()
        .map(|b| {
            let mut sums = vec![0.0; shells.len()];
            let mut tally = Shells { squares: &squares, sums: &mut sums };
            let (first, end) = (b * walks / BATCHES, (b + 1) * walks / BATCHES);
            for i in first..end {
                let mut rng = Stream::new(&[seed, i]);
                let mut walker = Walker::new(Vec3::ZERO, uniform_sphere(rng.uniform2()));
                walk(&domain, &inside, &Limits::from(Roulette::default()), &mut walker, &mut tally, &mut rng);
            }
            sums.iter_mut().for_each(|s| *s /= (end - first) as f64);
            sums
        })
        .collect();
    let n = BATCHES as f64;
    Ok((0..shells.len())
        .map(|k| {
            let volume = 4.0 / 3.0 * PI * (shells[k].1.powi(3) - shells[k].0.powi(3));
            let mean = batches.iter().map(|b| b[k]).sum::<f64>() / n;
            let square: f64 = batches.iter().map(|b| (b[k] - mean) * (b[k] - mean)).sum();
            Estimate { mean: mean / volume, std_err: (square / (n - 1.0) / n).sqrt() / volume, n: walks }
        })
        .collect())
}

/// Returns the mean of a fluence over a shell.
pub fn shell_mean(shell: (f64, f64), f: impl Fn(f64) -> f64) -> f64 {
    let (a, b) = shell;
    Rule::gauss(8, a, b).integrate(|r| 4.0 * PI * r * r * f(r)) / (4.0 / 3.0 * PI * (b.powi(3) - a.powi(3)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Student's t with 63 degrees of freedom at 1e-4 over 30 comparisons.
    const Z: f64 = 5.1;

    #[test]
    fn light_begins_straight_and_ends_as_brownian_motion() {
        let lengths = [0.1, 0.5, 1.0, 3.0, 10.0, 30.0];
        for g in [0.0, 0.6, -0.4] {
            let medium = HalfSpace { sigma_a: 0.0, sigma_s: 1.0 / (1.0 - g), g, eta: 1.0 };
            let j = journeys(&medium, &lengths, 20_000, 3).unwrap();
            for (k, &s) in lengths.iter().enumerate() {
                assert!(j.light[k].z(mean_square(s, 1.0)).abs() < Z, "g {g}, s {s}: {}", j.light[k]);
                assert!(j.brownian[k].z(2.0 * s).abs() < Z, "g {g}, s {s}: {}", j.brownian[k]);
            }
            assert_eq!((j.light_paths.len(), j.brownian_paths.len()), (6, 6));
            // A drawn path has the length asked for.
            let length = |p: &[DVec3]| p.windows(2).map(|w| w[0].distance(w[1])).sum::<f64>();
            assert!(j.light_paths.iter().all(|p| (length(p) / 30.0 - 1.0).abs() < 1e-4));
        }
        assert!((mean_square(1e-3, 1.0) / 1e-6 - 1.0).abs() < 1e-3);
        // Both forms meet where they change.
        assert!((mean_square(0.00999999, 1.0) / mean_square(0.01000001, 1.0) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn brownian_motion_outruns_light() {
        // A Maxwell law by hand: P(x > sqrt(3)/2) = erfc(.8660) + 2 (.8660) e^-.75 / sqrt(pi) = .2207 + .4616.
        assert!((beyond(1.0, 1.0) - 0.6823).abs() < 2e-4, "{}", beyond(1.0, 1.0));
        assert!(beyond(1e-6, 1.0) > 0.999 && beyond(30.0, 1.0) < 1e-8);
    }

    #[test]
    fn what_is_not_endless_or_no_shell_is_refused() {
        let white = HalfSpace { sigma_a: 0.0, sigma_s: 1.0, g: 0.0, eta: 1.0 };
        assert!(fluence(&white, &[(0.1, 0.2)], 1000, 1).is_err());
        assert!(fluence(&HalfSpace { sigma_a: 0.1, ..white }, &[(0.2, 0.1)], 1000, 1).is_err());
        assert!(journeys(&white, &[1.0, 0.5], 1000, 1).is_err());
        assert!(journeys(&HalfSpace { sigma_s: 0.0, ..white }, &[1.0], 1000, 1).is_err());
    }
}
