//! Bodies rendered by a radial profile instead of a walk inside: `--subsurface MODEL`.
//!
//! Light that leaves at $x_o$ entered at $x_i$ somewhere on the same body (or on one of the same `moonmilk.set`):
//!
//! $$ L_o(x_o, \omega_o) = T(\omega_o) \int_A R(|x_o - x_i|) \int \frac{T(\omega_i)}{\pi N} L_i(x_i, \omega_i) \cos\theta_i\, d\omega_i\, dA. $$
//!
//! **Points** \[King2013\]: a radius from the model's own distribution, a disc about one of three axes (the normal with probability 1/2, two tangents with 1/4
//! each), and a line through its point along the axis. *All* hits of the whole line on the body count, each with
//!
//! $$ w = \frac{R(|x_o - x|)}{\sum_a p_a\, q(r_a)\, |n_x \cdot a|}, $$
//!
//! q the density per area of the radius and r_a the distance from the axis; one of them is followed, in proportion to w. The expectation of the sum is the integral
//! of R over the surface, since the lines along all axes together have exactly that density. Lines are not cut off at a radius, so that no energy is lost;
//! weights are bounded, as one axis makes less than 55 degrees with every normal and r_a is at most the distance.
//!
//! **Wavelengths.** The radius comes from one lane at random; q is the mean over the lanes.
//!
//! **Media.** Profiles are free of scale: for one g and index a [`Bank`] holds them over the albedo of scattering, so that textured coefficients (those at
//! $x_o$ count) cost nothing. ln R is interpolated by a cubic; the radius comes from one of the two neighbours, whose mixed density is the q above.
//!
//! **Directions.** Models that know where the light comes from ([`Directed`]) are sampled by their radial profile at normal incidence, and weighed by what they
//! say in full over that profile, once the direction is drawn.

use std::f64::consts::PI;
use std::sync::OnceLock;

use moonmilk_core::{Frame, Random, Spectrum, Vec3, Wavelengths};
use moonmilk_geometry::{Hit, Ray, Surface};
use moonmilk_optics::OpticalProperties;
use moonmilk_optics::fresnel::moment_1;
use moonmilk_optics::profile::{Directed, Model, Placement, Prepared};
use moonmilk_walk::Medium;
use rayon::prelude::*;

use crate::bsdf::entry::{Entry, Norms};
use crate::bsdf::ggx::Ggx;
use crate::scene::{Object, Scene};
use crate::texture::TexturePoint;

mod kernel;

pub(crate) use kernel::Kernel;

/// Probabilities of the axes: normal and two tangents.
const AXES: [f64; 3] = [0.5, 0.25, 0.25];
/// R in units of the extinction squared, below which a model that knows directions gives nothing.
const MOST_REMOTE: f64 = 1e-200;
/// First node of the albedo, in logit of s = sqrt(1 - alpha): 1 - alpha = 4e-9.
const FIRST: f64 = -9.7;
/// Distance of the nodes.
const STEP: f64 = 0.2;
/// Points within the median radius below which they take no part.
const FEWEST: f64 = 4.0;
/// Least probability of a line where points have most of the light.
const SELDOM: f64 = 0.02;
/// Number of nodes, besides that of alpha = 1; the last has alpha = .02, below which R is extrapolated.
const NODES: usize = 72;

/// The profiles of one model for one asymmetry and index, over the albedo of scattering; unit extinction.
#[derive(Debug)]
pub(crate) struct Bank {
    /// For alpha = 1, if the model is defined there.
    conservative: Option<Prepared>,
    /// From the first node in the model's domain to the last.
    nodes: Vec<Prepared>,
    /// The model in full at alpha = 1 and at the nodes, if it knows directions.
    directed: Option<Directions>,
    /// Number of the first.
    first: usize,
    /// What the model rejects at albedos outside its domain, where the nearest of its domain stands in.
    pub limit: Option<String>,
    /// Directions of entering light through a smooth boundary.
    entry: Entry,
    /// N of rough ones, made where one is met first.
    norms: OnceLock<Norms>,
}

/// A model that knows directions, for unit extinction.
#[derive(Debug)]
struct Directions {
    conservative: Option<Box<dyn Directed>>,
    nodes: Vec<Box<dyn Directed>>,
}

/// Profiles for one wavelength at one point.
struct Lane<'a> {
    /// Neighbours of the albedo, with the weights of their ln R.
    around: [(&'a Prepared, f64); 4],
    /// The two to sample from, and the probability of the second.
    pair: [&'a Prepared; 2],
    /// The model in full at those two, if it knows directions.
    directed: Option<[&'a dyn Directed; 2]>,
    t: f64,
    sigma_t: f64,
}

impl Bank {
    /// Bakes a model.
    ///
    /// *Errors*: what the model rejects whatever the albedo.
    pub fn new(model: &Model, g: f64, eta: f64) -> Result<Self, moonmilk_optics::Error> {
        let bake = |alpha: f64| model.prepare(&OpticalProperties::new(1.0 - alpha, alpha, g, eta)?);
        let s = |k: usize| 1.0 / (1.0 + (-(FIRST + STEP * k as f64)).exp());
        let mut limit = None;
        let made: Vec<_> = (0..NODES).into_par_iter().map(|k| bake(1.0 - s(k).powi(2))).collect();
        let first = made.iter().position(Result::is_ok).unwrap_or(NODES);
        let mut nodes = Vec::with_capacity(NODES);
        for made in made {
            match made {
                Ok(p) => nodes.push(p),
                Err(e) => limit = Some(e),
            }
        }
        let conservative = bake(1.0).map_err(|e| limit = Some(e)).ok();
        if let (true, Some(e)) = (nodes.is_empty(), &limit) {
            return Err(e.clone());
        }
        let medium = |alpha: f64| OpticalProperties::new(1.0 - alpha, alpha, g, eta).ok();
        let full = |alpha: f64| model.directed(&medium(alpha)?).and_then(Result::ok);
        let directed: Option<Vec<_>> = (first..first + nodes.len()).map(|k| full(1.0 - s(k).powi(2))).collect();
        let directed =
            directed.map(|nodes| Directions { conservative: conservative.as_ref().and_then(|_| full(1.0)), nodes });
        let norm = (1.0 - 2.0 * moment_1(1.0 / eta)) as f32;
        let limit = limit.map(|e| e.to_string());
        Ok(Self {
            conservative,
            nodes,
            directed,
            first,
            limit,
            entry: Entry { eta: eta as f32, norm, ggx: None },
            norms: OnceLock::new(),
        })
    }

    /// Returns whether the model knows directions.
    pub fn knows_directions(&self) -> bool {
        self.directed.is_some()
    }

    /// Returns the directions of entering light through a boundary with these facets, if it has any.
    pub fn entry(&self, ggx: Option<Ggx>) -> Entry {
        match ggx {
            Some(ggx) => {
                let norm = self.norms.get_or_init(|| Norms::new(self.entry.eta)).at(ggx);
                Entry { norm, ggx: Some(ggx), ..self.entry }
            }
            None => self.entry,
        }
    }

    /// Returns the profiles for a medium at one wavelength; `None` if nothing scatters.
    fn lane(&self, sigma_a: f64, sigma_s: f64) -> Option<Lane<'_>> {
        if sigma_s <= 0.0 {
            return None;
        }
        let sigma_t = sigma_a + sigma_s;
        let s = (sigma_a / sigma_t).sqrt();
        let last = self.nodes.len() - 1;
        let node = |k: usize| &self.nodes[k.min(last)];
        let full = |k: usize| self.directed.as_ref().map(|d| d.nodes[k.min(last)].as_ref());
        let x = ((s / (1.0 - s)).ln() - FIRST) / STEP;
        if let (true, Some(a)) = (x < 0.0, &self.conservative) {
            // ln R is even in s where absorption vanishes: ln(1 + x) - x with x in proportion to s r.
            let b = node(0);
            let t = (s * (1.0 + (-FIRST).exp())).powi(2);
            let bright = self.directed.as_ref().and_then(|d| Some([d.conservative.as_deref()?, d.nodes[0].as_ref()]));
            return Some(Lane {
                around: [(a, 1.0 - t), (b, t), (b, 0.0), (b, 0.0)],
                pair: [a, b],
                directed: bright,
                t,
                sigma_t,
            });
        }
        let x = (x - self.first as f64).clamp(0.0, last as f64);
        let i = (x as usize).min(last.saturating_sub(1));
        let t = x - i as f64;
        let around = if i > 0 && i + 2 <= last {
            // Lagrange's cubic on -1, 0, 1, 2.
            let w = [
                -t * (t - 1.0) * (t - 2.0) / 6.0,
                (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
                -(t + 1.0) * t * (t - 2.0) / 2.0,
                (t + 1.0) * t * (t - 1.0) / 6.0,
            ];
            [0, 1, 2, 3].map(|k| (node(i + k - 1), w[k]))
        } else {
            [(node(i), 1.0 - t), (node(i + 1), t), (node(i), 0.0), (node(i), 0.0)]
        };
        let directed = full(i).zip(full(i + 1)).map(|(a, b)| [a, b]);
        Some(Lane { around, pair: [node(i), node(i + 1)], directed, t, sigma_t })
    }
}

impl Lane<'_> {
    /// Returns R \[1/L^2\].
    fn eval(&self, r: f64) -> f64 {
        let x = r * self.sigma_t;
        let ln = self.around.iter().filter(|a| a.1 != 0.0).map(|(p, w)| w * p.ln_eval(x)).sum::<f64>();
        ln.exp() * self.sigma_t * self.sigma_t
    }

    /// Returns an estimate of what a model that knows directions gives over R: the neighbours' own quotients, one of them by chance.
    fn quotient(&self, at: &Placement, choice: f64, u: [f64; 4]) -> f64 {
        let Some(directed) = self.directed else {
            return 1.0;
        };
        let k = usize::from(choice < self.t);
        let at = Placement { offset: at.offset * self.sigma_t, ..*at };
        let radial = self.pair[k].eval(at.offset.length());
        // Where R has run out of numbers, far beyond all energy, nothing comes.
        if radial > MOST_REMOTE { directed[k].estimate(&at, u) / radial } else { 0.0 }
    }

    /// Samples a radius.
    fn sample(&self, choice: f64, u: f64) -> f64 {
        self.pair[usize::from(choice < self.t)].sample(u) / self.sigma_t
    }

    /// Returns the density of [`Lane::sample`] per area \[1/L^2\].
    fn density(&self, r: f64) -> f64 {
        let x = r * self.sigma_t;
        let p = (1.0 - self.t) * self.pair[0].pdf(x) + self.t * self.pair[1].pdf(x);
        p * self.sigma_t / (2.0 * PI * r)
    }
}

/// Ways out of a body: the profiles at a point, and how its points ([`crate::cloud`]) share the work with lines.
pub(crate) struct Exit<'a, const N: usize> {
    lanes: [Option<Lane<'a>>; N],
    /// Number of lanes that scatter.
    count: usize,
    /// n of the points \[1/L^2\]; 0 if they take no part.
    density: f64,
    /// Distances at which they do.
    range: [f64; 2],
}

/// Where light entered that leaves at a given point, and the weight of that per lane.
pub(crate) struct Entered<const N: usize> {
    pub hit: Hit,
    pub surface: Surface,
    pub weight: Spectrum<N>,
}

/// What a model that knows directions makes of light from a given one.
pub(crate) struct Slant<'a, const N: usize> {
    exit: &'a Exit<'a, N>,
    at: Placement,
}

/// What is estimated once the direction of entering light is known.
pub(crate) struct Arriving<'a, const N: usize> {
    pub slant: Option<Slant<'a, N>>,
    /// A rough boundary, with its frame.
    pub rough: Option<(Entry, Frame)>,
}

impl<const N: usize> Arriving<'_, N> {
    /// Returns the factor on the light from a direction, an estimate.
    pub fn factor(&self, w_i: Vec3, rng: &mut impl Random) -> Spectrum<N> {
        let through = self.rough.as_ref().map_or(1.0, |(entry, f)| entry.rough(f.to_local(w_i), rng.uniform2()));
        match &self.slant {
            Some(slant) if through > 0.0 => slant.factor(w_i, rng) * through,
            _ => Spectrum::splat(through),
        }
    }
}

impl<const N: usize> Slant<'_, N> {
    /// Returns the factor on the weight of [`Entered`], an estimate, for light from a direction.
    fn factor(&self, w_i: Vec3, rng: &mut impl Random) -> Spectrum<N> {
        let at = Placement { w_i: w_i.as_dvec3(), ..self.at };
        let (choice, u) = (f64::from(rng.uniform()), std::array::from_fn(|_| f64::from(rng.uniform())));
        let lanes = &self.exit.lanes;
        Spectrum::from_fn(|k| lanes[k].as_ref().map_or(0.0, |l| l.quotient(&at, choice, u) as f32))
    }
}

impl<'a, const N: usize> Exit<'a, N> {
    /// Returns what directions change, if the model knows them: light that entered at x and leaves at p towards w_o.
    pub fn slant(&self, p: Vec3, n_o: Vec3, w_o: Vec3, x: Vec3, n_i: Vec3) -> Option<Slant<'_, N>> {
        let knows = self.lanes().any(|l| l.directed.is_some());
        let [n_i, n_o, w_o] = [n_i, n_o, w_o].map(|v| v.as_dvec3());
        let at = Placement { offset: (p - x).as_dvec3(), n_i, n_o, w_i: n_i, w_o };
        knows.then_some(Slant { exit: self, at })
    }

    /// Returns the profiles for a medium; `None` if nothing scatters. `density` is that of the body's points.
    pub fn new(bank: &'a Bank, medium: &Medium<N>, density: f64) -> Option<Self> {
        let lanes: [Option<Lane>; N] =
            std::array::from_fn(|k| bank.lane(f64::from(medium.sigma_a[k]), f64::from(medium.sigma_s[k])));
        let some = || lanes.iter().flatten();
        let count = some().count();
        if count == 0 {
            return None;
        }
        // Points are worth their cost where several are within the radius of half of the light.
        let median = some().map(|l| l.sample(0.5, 0.5)).sum::<f64>() / count as f64;
        let density = if density * PI * median * median > FEWEST { density } else { 0.0 };
        let reach = some().map(|l| l.sample(0.5, 1.0 - 1e-6)).fold(0.0, f64::max);
        let shortest = some().map(|l| 1e-3 / l.sigma_t).fold(f64::INFINITY, f64::min);
        Some(Self { lanes, count, density, range: [shortest, reach] })
    }

    /// Returns whether the body's points take part.
    pub fn has_points(&self) -> bool {
        self.density > 0.0
    }

    fn lanes(&self) -> impl Iterator<Item = &Lane<'a>> {
        self.lanes.iter().flatten()
    }

    /// Returns q, the density of a radius per area, mean over the lanes.
    fn density(&self, r: f64) -> f64 {
        self.lanes().map(|l| l.density(r)).sum::<f64>() / self.count as f64
    }

    /// Returns w_c, the share of the points in what comes from a distance.
    fn share(&self, r: f64) -> f64 {
        if self.density > 0.0 && r > self.range[0] && r < self.range[1] {
            self.density / (self.density + 0.5 * self.density(r))
        } else {
            0.0
        }
    }

    /// Returns R w_c / n: what one point at a distance lets out per unit of its light.
    pub fn per_point(&self, r: f32) -> [f32; 4] {
        let r = f64::from(r);
        let share = self.share(r);
        if share == 0.0 {
            return [0.0; 4];
        }
        std::array::from_fn(|k| {
            self.lanes.get(k).and_then(Option::as_ref).map_or(0.0, |l| (l.eval(r) * share / self.density) as f32)
        })
    }

    /// Samples the point where light entered that leaves at p; `None` if the line found nothing, or chance left it to the points.
    ///
    /// `beta` says how much each lane matters.
    pub fn enter(
        &self,
        scene: &Scene,
        object: &Object,
        p: Vec3,
        n: Vec3,
        beta: &Spectrum<N>,
        rng: &mut impl Random,
    ) -> Option<Entered<N>> {
        // A line along one of the axes.
        let frame = Frame::new(n);
        let axes = [frame.n, frame.s, frame.t];
        let u = rng.uniform();
        let k = if u < 0.5 {
            0
        } else if u < 0.75 {
            1
        } else {
            2
        };
        let lane = ((rng.uniform() * self.count as f32) as usize).min(self.count - 1);
        let r = self.lanes().nth(lane)?.sample(f64::from(rng.uniform()), f64::from(rng.uniform()));
        // Look seldom where the points have most of it.
        let chance = if self.density > 0.0 { (2.0 * (1.0 - self.share(r))).clamp(SELDOM, 1.0) } else { 1.0 };
        if chance < 1.0 && f64::from(rng.uniform()) >= chance {
            return None;
        }
        let (sin, cos) = (2.0 * std::f32::consts::PI * rng.uniform()).sin_cos();
        let o = p + (axes[(k + 1) % 3] * cos + axes[(k + 2) % 3] * sin) * r as f32;
        let all = object.common;
        let half = 0.5 * all.extent().length() + o.distance(all.center());
        if !half.is_finite() {
            return None;
        }
        let ray = Ray::new(o - axes[k] * half, axes[k]).up_to(2.0 * half);
        // All hits, each with its weight.
        let mut hits: Vec<(Hit, Spectrum<N>, f32)> = Vec::new();
        scene.accel.all_hits(&ray, |hit| {
            if !object.is_one_with(&scene.objects[hit.shape as usize]) {
                return;
            }
            let (x, n_x) = scene.accel.point_and_normal(&ray, hit);
            let offset = (x - p).as_dvec3();
            let distance = offset.length().max(f64::MIN_POSITIVE);
            let mut density = 0.0;
            for (a, probability) in axes.iter().zip(AXES) {
                let along = offset.dot(a.as_dvec3());
                let from_axis = (distance * distance - along * along).max(0.0).sqrt().max(1e-12 * distance);
                density += probability * self.density(from_axis) * f64::from(n_x.dot(*a).abs());
            }
            let factor = (1.0 - self.share(distance)) / (density * chance);
            let weight =
                Spectrum::from_fn(|k| self.lanes[k].as_ref().map_or(0.0, |l| (l.eval(distance) * factor) as f32));
            // Weights may be negative where a model is.
            let importance = (weight * *beta).map(f32::abs).max_value();
            if importance > 0.0 && importance.is_finite() {
                hits.push((*hit, weight, importance));
            }
        });
        // Hits come in no order: sort them, so that the choice depends on the line alone.
        hits.sort_by(|a, b| a.0.t.total_cmp(&b.0.t));
        let total: f32 = hits.iter().map(|h| h.2).sum();
        let mut left = rng.uniform() * total;
        let last = hits.len().checked_sub(1)?;
        let (hit, weight, importance) = hits.into_iter().enumerate().find_map(|(i, h)| {
            left -= h.2;
            (left < 0.0 || i == last).then_some(h)
        })?;
        // What the points leave over is followed as often as it weighs.
        let whole = beta.max_value();
        let followed = if self.density > 0.0 && total < whole { total / whole } else { 1.0 };
        if followed < 1.0 && rng.uniform() >= followed {
            return None;
        }
        let weight = weight * (total / (importance * followed));
        Some(Entered { hit, surface: scene.accel.surface(&ray, &hit), weight })
    }
}

impl Scene {
    /// Returns the profiles of an object and its medium at a point, if it is rendered by a model and scatters there.
    pub(crate) fn bank_at<const N: usize>(
        &self,
        object: &Object,
        point: &TexturePoint,
        w: &Wavelengths<N>,
    ) -> Option<(&Bank, Medium<N>)> {
        let bank = self.bank(object)?;
        match self.medium_inside(object, point, w, None)? {
            crate::media::Matter::Homogeneous(m) if !m.sigma_s.is_black() => Some((bank, m)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use moonmilk_optics::profile::{MODELS, find};

    use super::*;

    #[test]
    fn banks_hold_the_profiles_of_all_albedos() {
        // Off the nodes; where r^2 R is above 1e-5 of its maximum. Bounds are measured, rounded up; Gaussians are steepest far out.
        for (name, bound) in [("dipole", 5e-4), ("photon-beam", 5e-4), ("normalized", 5e-4), ("gaussian-sum", 1e-2)] {
            let model = find(name).unwrap();
            let bank = Bank::new(model, 0.3, 1.4).unwrap();
            let (mut worst, mut total) = (0.0f64, 0.0f64);
            for alpha in [0.05, 0.4, 0.83, 0.97, 0.9977, 0.99991, 1.0 - 3e-7] {
                let exact =
                    model.build(&OpticalProperties::new(2.0 * (1.0 - alpha), 2.0 * alpha, 0.3, 1.4).unwrap()).unwrap();
                let lane = bank.lane(2.0 * (1.0 - alpha), 2.0 * alpha).unwrap();
                let r = |i: i32| 0.01 * 1.3f64.powi(i);
                let most = (0..40).map(|i| r(i).powi(2) * exact.eval(r(i))).fold(0.0, f64::max);
                for r in (0..40).map(r).filter(|&r| r * r * exact.eval(r) > 1e-5 * most) {
                    worst = worst.max((lane.eval(r) / exact.eval(r) - 1.0).abs());
                }
                // The ends of the range hold 1e-4 of the energy.
                let sum = (0..3600)
                    .map(|i| 1e-6 * 1.006f64.powi(i))
                    .map(|r| 2.0 * PI * r * r * 1.006f64.ln() * lane.eval(r))
                    .sum::<f64>();
                total = total.max((sum / exact.total() - 1.0).abs());
                println!("{name}, alpha {alpha}: pointwise {worst:.2e}, total {total:.2e}");
            }
            assert!(worst < bound && total < 2e-4, "{name}: pointwise {worst}, total {total}");
        }
    }

    #[test]
    fn every_model_has_banks_for_all_albedos() {
        for model in MODELS {
            let made = Bank::new(model, 0.5, 1.0);
            assert!(made.is_ok(), "{}: {:?}", model.info.name, made.err());
        }
    }
}
