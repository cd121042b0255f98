//! The law of guided walks: directions and flights that lean towards the nearest wall, and what they weigh.
//!
//! Deep in an absorbing medium light falls off as exp(-kappa x): so much less does a walk at depth x matter. A walk sampled by what it will find draws, for mu the cosine between its direction omega and the
//! direction n of the nearest wall,
//!
//! $$ p(\mu) \propto \frac{1}{1 - b \mu} \ (g = 0) , \qquad p(\omega) = \frac{1 + b \mu}{1 + b g \mu'}\, p_g(\omega' \cdot \omega) , \qquad p(t) = (\sigma_t - \kappa \mu)\, e^{-(\sigma_t - \kappa \mu) t} . $$
//!
//! b = 1 / nu_0 is the eigenvalue of the similar isotropic medium, alpha' atanh(b) = b, and kappa = b sigma_t'. The second form is the first order of the first around any law of mean cosine g, whose normal
//! form it needs no integral for: the mean of mu is g mu'. It is drawn by rejection.
//!
//! *Finite bodies*: light may also leave by the other side. In a ball it matters as sinh(kappa r) / r does at the distance r from the middle, so that b and kappa shrink by the factor coth(kappa r) - 1 / (kappa r).
//! Without that guiding lost to plain walks in bodies below some 1.5 / kappa of radius (index-matched ball of 5 mean free paths, alpha .99: efficiency .2 of theirs, with it 2.9).
//!
//! *Weights.* The whole path is drawn by one strategy, plain with probability [`PLAIN`], and weighed by the mean of both strategies' densities over all its events: the balance heuristic for paths. [`Walker::odds`] is
//! the ratio of the densities so far. So a path never weighs more than 1 / [`PLAIN`] times what it weighs by plain walks: guiding has no fireflies of its own, wherever it leads. Event by event that
//! bound would grow as its power.
//!
//! *Source*: \[Dwivedi1982\]; \[Krivanek2014\], who bring it to graphics; the closest wall is one of the directions of \[Meng2016\]. Path-wise weights, the form for other laws than isotropic and that for finite bodies are ours.

use moonmilk_core::{Random, Spectrum, Vec3};

use crate::jump::Scattering;
use crate::math;
use crate::medium::Medium;
use crate::phase::PhaseFunction;
use crate::walker::Walker;

/// Share of paths that walk plainly: bounds weights by its inverse.
///
/// Half-space, alpha .8 and .99, efficiency over plain walks' at .5, .25, .1: 3.3, 7.8, 15 and 2.9, 9.7, 35; behind a boundary of index 1.4 3.3, 6.8, 12 and 2.7, 6.1, 13. In a ball of 5 mean free paths 2.0, 2.8, 3.3.
pub const PLAIN: f32 = 0.25;
/// Largest eigenvalue. Above it (alpha' below .61) guides would be single-minded: half-space, alpha .3, 1 or .9: efficiency 2.0 or 3.9 times that of plain walks; alpha .8, g .9: 2.2 or 5.6.
const MOST: f64 = 0.9;
/// Eigenvalue below which there is nothing to guide by.
const LEAST: f32 = 1e-3;
/// Depth of a body from which guiding pays [1 / kappa].
///
/// Bumpy balls under a sky, efficiency over plain walks at depths of 3, 6, 7, 11 and 27: index 1.4 .98, 1.8, 2.2, 2.3, 5.1; matched .8, 1.5, 2.3, 1.2, 3.0.
const THICK: f32 = 6.0;
/// Eigenvalue below which (alpha' above .997) jumps pay more: ball of 100 mean free paths, alpha .99 or .999, guided 2.9 or 2.4 times the efficiency of plain walks, by jumps .97 or 1.3 times, more in denser ones.
const WHITE: f32 = 0.1;
/// Bounds of the odds, so that they can be lost neither to zero nor to infinity.
const ODDS: [f32; 2] = [1e-30, 1e30];

/// Returns b = 1 / nu_0, the root of alpha atanh(b) = b in (0, 1): the inverse of the discrete eigenvalue of isotropic transport [mean free paths].
///
/// *Domain*: alpha in (0, 1); 0 at 1. *Accuracy*: rounding (tested by what is left of the equation).
/// *Source*: \[Case1967\], 1 = alpha nu / 2 ln((nu + 1) / (nu - 1)).
pub fn eigenvalue(alpha: f64) -> f64 {
    if alpha >= 1.0 {
        return 0.0;
    }
    // By x = atanh b: f = alpha x - tanh x is convex there, so that Newton's method comes from above without fail.
    let mut x = (1.0 / alpha).min((3.0 * (1.0 - alpha)).sqrt() / alpha * 1.5);
    for _ in 0..60 {
        let t = x.tanh();
        let step = (alpha * x - t) / (alpha - 1.0 + t * t);
        x -= step;
        // Steps go down until rounding takes over.
        if step <= 1e-15 * x {
            break;
        }
    }
    x.tanh()
}

/// Returns coth(y) - 1 / y, how much of a half-space's decay a ball of that radius shows [Langevin].
fn langevin(y: f32) -> f32 {
    if y < 0.3 {
        // The next term is 1e-6 of it at the end.
        y * (1.0 / 3.0 - y * y * (1.0 / 45.0 - y * y * (2.0 / 945.0)))
    } else if y > 20.0 {
        1.0 - 1.0 / y
    } else {
        let e = (2.0 * y).exp_m1();
        1.0 + 2.0 / e - 1.0 / y
    }
}

/// Returns atanh(b) / b.
fn spread(b: f32) -> f32 {
    if b < 0.15 {
        let q = b * b;
        1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0))))
    } else {
        0.5 * ((1.0 + b) / (1.0 - b)).ln() / b
    }
}

/// The way out from a point.
#[derive(Clone, Copy, Debug)]
pub struct Outward {
    /// Unit vector towards the nearest wall.
    pub n: Vec3,
    /// Distance from the middle of the body, infinite in a half-space \[length\].
    pub r: f32,
}

/// What guided walks in a medium need.
#[derive(Clone, Copy, Debug)]
pub struct Guide<const N: usize> {
    /// Eigenvalue of each lane.
    b: Spectrum<N>,
    /// Decay kappa of each lane [1/length].
    kappa: Spectrum<N>,
    gray: bool,
}

impl<const N: usize> Guide<N> {
    /// Returns what guided walks need; `None` where nothing absorbs or nothing scatters: there is nothing to guide by.
    pub fn new<P: PhaseFunction>(medium: &Medium<N, P>) -> Option<Self> {
        if medium.sigma_t.min_value() <= 0.0 {
            return None;
        }
        let sigma_s_prime = medium.sigma_s * (1.0 - medium.g);
        let sigma_t_prime = medium.sigma_a + sigma_s_prime;
        let eigen = |k: usize| {
            let alpha_prime = f64::from(sigma_s_prime[k]) / f64::from(sigma_t_prime[k]);
            // The root is MOST at this albedo, and above it below.
            let at_most = MOST / MOST.atanh();
            if alpha_prime <= at_most { MOST as f32 } else { eigenvalue(alpha_prime) as f32 }
        };
        let gray = medium.is_gray();
        let first = eigen(0);
        let b = Spectrum::from_fn(|k| if k == 0 || gray { first } else { eigen(k) });
        (b.max_value() > LEAST).then_some(Self { b, kappa: b * sigma_t_prime, gray })
    }

    /// Returns whether guiding pays in a body that is that deep, wherever light comes from all around; the same whichever lane leads.
    pub fn pays(&self, depth: f32) -> bool {
        self.kappa.min_value() * depth > THICK
    }

    /// Returns whether it pays more than jumps over balls do, which save flights but no noise; the same whichever lane leads.
    pub fn beats_jumps(&self) -> bool {
        self.b.min_value() > WHITE
    }

    /// Returns the lean at a point whose way out is known; none where it is not.
    #[inline]
    pub(crate) fn lean(&self, out: Option<Outward>) -> Lean<N> {
        let Some(out) = out else {
            let (none, one) = (Spectrum::ZERO, Spectrum::ONE);
            return Lean { n: Vec3::Z, b: none, kappa: none, spread: one, gray: self.gray };
        };
        let factor = |k: usize| {
            let f = langevin(self.kappa[k] * out.r);
            if self.b[k] * f < LEAST { 0.0 } else { f }
        };
        let first = factor(0);
        let f = Spectrum::from_fn(|k| if k == 0 || self.gray { first } else { factor(k) });
        let b = self.b * f;
        let first = spread(b[0]);
        let spread = Spectrum::from_fn(|k| if k == 0 || self.gray { first } else { spread(b[k]) });
        Lean { n: out.n, b, kappa: self.kappa * f, spread, gray: self.gray }
    }
}

/// How walks lean from one point on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lean<const N: usize> {
    n: Vec3,
    b: Spectrum<N>,
    kappa: Spectrum<N>,
    /// atanh(b) / b, the norm of directions.
    spread: Spectrum<N>,
    gray: bool,
}

impl<const N: usize> Lean<N> {
    /// Returns the extinction by which the hero's flights along d are drawn.
    #[inline]
    pub fn sigma<P>(&self, medium: &Medium<N, P>, d: Vec3, guided: bool) -> f32 {
        let sigma = medium.sigma_t[0];
        if guided { sigma - self.kappa[0] * d.dot(self.n) } else { sigma }
    }

    /// Draws a direction for light that flew along `from`, by the hero's guide.
    #[inline]
    pub fn draw<P: PhaseFunction>(&self, medium: &Medium<N, P>, from: Vec3, rng: &mut impl Random) -> Vec3 {
        let b = self.b[0];
        if b == 0.0 {
            return medium.scatter(from, rng);
        }
        if medium.law.is_isotropic() {
            // 1 - b mu falls from 1 + b to 1 - b as a power of the variate.
            let u = rng.uniform2();
            let log = b.ln_1p() - u[0] * 2.0 * b * self.spread[0];
            let mu = -log.exp_m1() / b;
            return math::deflect(self.n, mu.clamp(-1.0, 1.0), u[1]);
        }
        loop {
            let d = medium.scatter(from, rng);
            if rng.uniform() * (1.0 + b) < 1.0 + b * d.dot(self.n) {
                return d;
            }
        }
    }

    /// Returns the guides' densities of a direction over the phase function.
    #[inline]
    fn turn<P: PhaseFunction>(&self, medium: &Medium<N, P>, from: Vec3, d: Vec3) -> Spectrum<N> {
        let (mu, before) = (d.dot(self.n), from.dot(self.n));
        let isotropic = medium.law.is_isotropic();
        let of = |b: f32, spread: f32| {
            if b == 0.0 {
                1.0
            } else if isotropic {
                1.0 / ((1.0 - b * mu) * spread)
            } else {
                (1.0 + b * mu) / (1.0 + b * medium.g * before)
            }
        };
        self.lanes(|k| of(self.b[k], self.spread[k]))
    }

    /// Returns the guides' densities of getting a distance t on along d over the transmittance.
    #[inline]
    fn stretch(&self, d: Vec3, t: f32) -> Spectrum<N> {
        let way = d.dot(self.n) * t;
        // Bounded, as are the odds that it multiplies.
        self.lanes(|k| (self.kappa[k] * way).clamp(-60.0, 60.0).exp())
    }

    #[inline]
    fn lanes(&self, f: impl Fn(usize) -> f32) -> Spectrum<N> {
        let first = f(0);
        Spectrum::from_fn(|k| if k == 0 || self.gray { first } else { f(k) })
    }

    /// Weighs a walker that turned from `from` to its direction by either strategy; returns the density of that over the phase function.
    #[inline]
    pub fn turned<P: PhaseFunction>(&self, walker: &mut Walker<N>, medium: &Medium<N, P>, from: Vec3) -> f32 {
        let factor = self.turn(medium, from, walker.d);
        walker.ratio *= mixed(walker.odds, factor);
        walker.odds = bounded(walker.odds * factor);
        walker.renormalize()
    }

    /// Weighs a walker for a flight of length t that reached a wall.
    #[inline]
    pub fn passed<P>(&self, walker: &mut Walker<N>, medium: &Medium<N, P>, t: f32) {
        let stretch = self.stretch(walker.d, t);
        walker.ratio *= mixed(walker.odds, stretch);
        walker.odds = bounded(walker.odds * stretch);
        let reference = self.transmit(walker, medium, t);
        let mean = walker.renormalize();
        if let Some(pdf) = &mut walker.direction_pdf {
            *pdf *= mean * reference;
        }
    }

    /// Weighs a walker for a flight of length t that ended in a collision; the weight then is per unit coefficient, as that of [`Walker::collide`].
    #[inline]
    pub fn collided<P>(&self, walker: &mut Walker<N>, medium: &Medium<N, P>, t: f32) {
        let mu = walker.d.dot(self.n);
        let ends = self.lanes(|k| 1.0 - self.kappa[k] * mu / medium.sigma_t[k]);
        let factor = self.stretch(walker.d, t) * ends;
        walker.ratio *= medium.sigma_t * mixed(walker.odds, factor);
        walker.odds = bounded(walker.odds * factor);
        self.transmit(walker, medium, t);
        walker.renormalize();
    }

    /// Weighs all lanes by their transmittance, up to a common factor: the transmittance that is returned.
    #[inline]
    fn transmit<P>(&self, walker: &mut Walker<N>, medium: &Medium<N, P>, t: f32) -> f32 {
        if N > 1 && !medium.is_gray() {
            // The thinnest lane's as the common factor: none overflows.
            let least = medium.sigma_t.min_value();
            let relative = medium.sigma_t.map(|s| ((least - s) * t).exp());
            walker.beta *= relative;
            walker.ratio *= relative;
            return (-least * t).exp();
        }
        (-medium.sigma_t[0] * t).exp()
    }
}

/// Returns (1 + odds factor) / (1 + odds): by how much an event multiplies the density of a lane over that of plain walks, `factor` being the guide's over theirs.
#[inline]
fn mixed<const N: usize>(odds: Spectrum<N>, factor: Spectrum<N>) -> Spectrum<N> {
    odds.zip(factor, |o, f| (1.0 + o * f) / (1.0 + o))
}

#[inline]
fn bounded<const N: usize>(odds: Spectrum<N>) -> Spectrum<N> {
    odds.map(|o| o.clamp(ODDS[0], ODDS[1]))
}

/// A collision from which walks go on by either strategy.
#[derive(Clone, Copy, Debug)]
pub struct Leaning<'a, const N: usize, P> {
    pub(crate) medium: &'a Medium<N, P>,
    /// Direction of flight before.
    pub(crate) from: Vec3,
    pub(crate) lean: Lean<N>,
    pub(crate) odds: Spectrum<N>,
}

impl<const N: usize, P: PhaseFunction> Scattering<N> for Leaning<'_, N, P> {
    #[inline]
    fn towards(&self, d: Vec3) -> (Spectrum<N>, Spectrum<N>) {
        let phase = self.medium.phase(self.from, d);
        (Spectrum::splat(phase), mixed(self.odds, self.lean.turn(self.medium, self.from, d)) * phase)
    }

    #[inline]
    fn through(&self, d: Vec3, t: f32) -> Spectrum<N> {
        let factor = self.lean.turn(self.medium, self.from, d) * self.lean.stretch(d, t);
        mixed(self.odds, factor) * self.medium.phase(self.from, d)
    }

    fn draw(&self, rng: &mut impl Random) -> Vec3 {
        self.medium.scatter(self.from, rng)
    }
}

impl<const N: usize> Walker<N> {
    /// Draws the strategy of the whole path, if that was not done before.
    #[inline]
    pub fn choose_strategy(&mut self, rng: &mut impl Random) {
        if self.odds.is_black() {
            self.guided = rng.uniform() >= PLAIN;
            self.odds = Spectrum::splat((1.0 - PLAIN) / PLAIN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase::HenyeyGreenstein;
    use moonmilk_core::Stream;

    #[test]
    fn the_eigenvalue_is_a_root_and_has_its_limits() {
        for i in 1..1000 {
            let alpha = 0.1 + 0.9 * f64::from(i) / 1000.0;
            let b = eigenvalue(alpha);
            // Where b is next to 1, atanh magnifies its rounding by 1 / (1 - b^2).
            let rounding = 4.0 * f64::EPSILON / (1.0 - b * b);
            assert!((alpha * b.atanh() / b - 1.0).abs() < 1e-14 + rounding, "{alpha}: {b}");
        }
        // Tabulated nu_0: 1.4076 at .8, 1.9032 at .9, 5.7967 at .99 [Case1967].
        for (alpha, nu) in [(0.8, 1.407_634), (0.9, 1.903_205), (0.99, 5.796_729)] {
            assert!((1.0 / eigenvalue(alpha) - nu).abs() < 2e-6, "{alpha}: {}", 1.0 / eigenvalue(alpha));
        }
        // b^2 = 3 (1 - alpha) (1 - 4/5 (1 - alpha)) near 1.
        let e = 1e-9;
        assert!((eigenvalue(1.0 - e) / (3.0 * e * (1.0 - 0.8 * e)).sqrt() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn langevins_function_is_continuous_and_right() {
        for y in [0.01f32, 0.1, 0.2999, 0.3001, 1.0, 5.0, 19.99, 20.01, 1e4, f32::INFINITY] {
            let x = f64::from(y);
            let exact = if x < 1e3 { 1.0 / x.tanh() - 1.0 / x } else { 1.0 - 1.0 / x };
            assert!((f64::from(langevin(y)) / exact - 1.0).abs() < 2e-5, "{y}: {} {exact}", langevin(y));
        }
    }

    #[test]
    fn the_norm_of_directions_is_right() {
        for b in [1e-3f32, 0.01, 0.1, 0.1499, 0.1501, 0.5, 0.9] {
            let exact = f64::from(b).atanh() / f64::from(b);
            assert!((f64::from(spread(b)) / exact - 1.0).abs() < 1e-6, "{b}: {} {exact}", spread(b));
        }
    }

    #[test]
    fn directions_are_drawn_from_their_density() {
        // Means of mu and mu^2 by both: sampling, and the density over directions drawn from the phase function.
        for (b, g) in [(0.9f32, 0.0f32), (0.3, 0.0), (0.002, 0.0), (0.9, 0.7), (0.5, -0.4), (0.9, 0.95)] {
            let medium = Medium::<1, _>::with_law(Spectrum([0.1]), Spectrum([0.9]), HenyeyGreenstein { g });
            let b = Spectrum([b]);
            let spread = b.map(spread);
            let lean = Lean { n: Vec3::new(0.6, 0.0, 0.8), b, kappa: b, spread, gray: true };
            let from = Vec3::new(0.0, 0.28, 0.96);
            let mut rng = Stream::new(&[7]);
            let mut sums = [[0.0f64; 2]; 5];
            let n = 400_000;
            for _ in 0..n {
                let d = lean.draw(&medium, from, &mut rng);
                let mu = f64::from(d.dot(lean.n));
                let e = medium.scatter(from, &mut rng);
                let (nu, w) = (f64::from(e.dot(lean.n)), f64::from(lean.turn(&medium, from, e)[0]));
                for (s, x) in sums.iter_mut().zip([mu, mu * mu, w, w * nu, w * nu * nu]) {
                    s[0] += x;
                    s[1] += x * x;
                }
            }
            let n = f64::from(n);
            let [m1, m2, w0, w1, w2] = sums.map(|[s, q]| (s / n, ((q / n - (s / n).powi(2)) / n).sqrt()));
            for (what, a, b) in [("norm", w0, (1.0, 0.0)), ("mean", m1, w1), ("square", m2, w2)] {
                let z = (a.0 - b.0) / a.1.hypot(b.1);
                assert!(z.abs() < 4.9, "{what} at b {:?}, g {g}: {a:?} {b:?}", lean.b);
            }
        }
    }
}
