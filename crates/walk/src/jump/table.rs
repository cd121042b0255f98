//! What leaves balls of isotropic scatterers, as a table over radius, cosine and albedo.
//!
//! The table is made of exact solutions ([`moonmilk_optics::escape`]), not of simulated walks; levels of radius are solved when first needed, 40 ms each.
//! With v = sqrt(1 - mu) the density of exits is smooth up to the radial direction, where p(mu) itself has a pole of single scattering.
//!
//! *Accuracy*: moments of the exits, absorbed and not, within 1e-5 of direct solutions at any radius and albedo (test: weights 1, mu, mu^2, 1 - mu). A path makes a few jumps.

use std::sync::OnceLock;

use moonmilk_core::quadrature::Rule;
use moonmilk_optics::escape::Ball;

/// Largest radius of a jump [mean free paths].
pub const MOST: f32 = 64.0;
/// Levels per factor of two in radius.
const PER_OCTAVE: f32 = 4.0;
/// Levels: from one below a radius of 1 to one above [`MOST`].
const LEVELS: usize = 27;
/// Cells in v.
const CELLS: usize = 64;
/// Nodes in sqrt(1 - alpha).
const ALBEDOS: usize = 25;
/// Weights below are those of [`smooth`], by the ratio of the node before: solutions are right to 1e-9 of what leaves without absorption.
const LEAST_WEIGHT: f64 = 1e-10;

static TABLE: [OnceLock<Level>; LEVELS] = [const { OnceLock::new() }; LEVELS];

/// One radius.
struct Level {
    /// Density over v of exits after at least one collision, linear between nodes; integral 1.
    density: [f32; CELLS + 1],
    /// Its integral up to each node.
    below: [f32; CELLS + 1],
    /// ln of E[alpha^(N - 1) | v], less [`smooth`], per v and albedo.
    weight: Vec<[f32; ALBEDOS]>,
    /// E[N | v].
    collisions: [f32; CELLS + 1],
    /// The cell in which a share k / CELLS has left.
    guide: [u8; CELLS],
}

/// Radii of the levels, f32.
fn radii() -> &'static [f32; LEVELS] {
    static RADII: OnceLock<[f32; LEVELS]> = OnceLock::new();
    RADII.get_or_init(|| std::array::from_fn(|k| radius(k) as f32))
}

/// Returns the largest radius of a level that is not above tau.
///
/// *Domain*: tau in [1, [`MOST`]].
#[inline]
pub fn rounded_down(tau: f32) -> f32 {
    radii()[level_below(tau)]
}

#[inline]
fn level_below(tau: f32) -> usize {
    let radii = radii();
    let mut k = ((PER_OCTAVE * tau.log2()).floor().max(0.0) as usize + 1).min(LEVELS - 2);
    // The logarithm may be off by a rounding.
    while k > 1 && radii[k] > tau {
        k -= 1;
    }
    k
}

/// Radius of a level [mean free paths].
fn radius(level: usize) -> f64 {
    ((level as f64 - 1.0) / f64::from(PER_OCTAVE)).exp2()
}

/// ln(x / sinh x), x = kappa (tau + .71), kappa^2 = 3 s^2 - 2.4 s^4 + .4 s^6 with s^2 = 1 - alpha (right for small s, and for 1): most of how weights fall with absorption.
#[inline]
fn smooth(root: f32, tau: f32) -> f32 {
    let s2 = root * root;
    let x = (s2 * (3.0 - s2 * (2.4 - 0.4 * s2))).sqrt() * (tau + 0.7104);
    if x < 0.05 {
        return -x * x * (1.0 / 6.0 - x * x / 180.0);
    }
    (2.0 * x / -(-2.0 * x).exp_m1()).ln() - x
}

impl Level {
    fn new(tau: f64) -> Self {
        let h = 1.0 / CELLS as f64;
        let rule = Rule::gauss(4, 0.0, 1.0);
        // At the ends v is moved in by what does not show.
        let node = |m: usize| (m as f64 * h).clamp(1e-4, 1.0 - 1e-4);
        let inner = (0..CELLS).flat_map(|m| rule.nodes.iter().map(move |t| (m as f64 + t) * h));
        let v: Vec<f64> = (0..=CELLS).map(node).chain(inner).collect();
        let ball = Ball::new(tau, &v.iter().map(|v| 1.0 - v * v).collect::<Vec<_>>());
        let conservative = ball.exits(1.0);

        // Project on functions linear in each cell, so that integrals keep more digits than values.
        let projected = |f: &[f64]| {
            let mut right = [0.0; CELLS + 1];
            for m in 0..CELLS {
                for (k, (t, w)) in rule.iter().enumerate() {
                    let i = CELLS + 1 + m * rule.len() + k;
                    let mass = w * h * 2.0 * v[i] * f[i];
                    right[m] += mass * (1.0 - t);
                    right[m + 1] += mass * t;
                }
            }
            project(right, h)
        };
        let base = projected(&conservative);
        // Ratios of projections; at v = 1 both vanish.
        let over = |f: &[f64]| -> [f64; CELLS + 1] {
            let p = projected(f);
            std::array::from_fn(|m| if base[m] > 0.0 { p[m] / base[m] } else { f[m] / conservative[m] })
        };
        let sum: f64 = (0..CELLS).map(|m| 0.5 * h * (base[m] + base[m + 1])).sum();
        let density = base.map(|p| (p / sum) as f32);
        let mut below = [0.0; CELLS + 1];
        for m in 0..CELLS {
            below[m + 1] = below[m] + 0.5 * h as f32 * (density[m] + density[m + 1]);
        }

        let mut weight = vec![[0.0; ALBEDOS]; CELLS + 1];
        for k in 0..ALBEDOS {
            let root = k as f64 / (ALBEDOS - 1) as f64;
            let absorbed = over(&ball.exits(1.0 - root * root));
            for (row, w) in weight.iter_mut().zip(absorbed) {
                // Carry the ratio to `smooth` on where so little is left that it is the solution's error, which may be negative.
                row[k] = if w > LEAST_WEIGHT { w.ln() as f32 - smooth(root as f32, tau as f32) } else { row[k - 1] };
            }
        }
        let collisions = over(&ball.collisions()).map(|n| n as f32);
        let mut guide = [0; CELLS];
        for (k, g) in guide.iter_mut().enumerate() {
            *g = below.partition_point(|&b| b <= k as f32 / CELLS as f32).clamp(1, CELLS) as u8 - 1;
        }
        Self { density, below, weight, collisions, guide }
    }
}

/// Returns the values at nodes of spacing h of the piecewise linear function whose integrals with the hat functions are given, the last two taken together;
/// it ends in 0, as what leaves at mu = 0 does.
fn project(mut right: [f64; CELLS + 1], h: f64) -> [f64; CELLS + 1] {
    const LAST: usize = CELLS - 1;
    right[LAST] += right[CELLS];
    right[CELLS] = 0.0;
    let diagonal = |m: usize| match m {
        0 => h / 3.0,
        LAST => 5.0 * h / 6.0,
        _ => 2.0 * h / 3.0,
    };
    let mut pivot = [0.0; CELLS];
    pivot[0] = diagonal(0);
    for m in 1..CELLS {
        let factor = h / 6.0 / pivot[m - 1];
        pivot[m] = diagonal(m) - factor * h / 6.0;
        right[m] -= factor * right[m - 1];
    }
    for m in (0..CELLS).rev() {
        right[m] = (right[m] - right[m + 1] * h / 6.0) / pivot[m];
    }
    right.map(|p| p.max(0.0))
}

/// The exits from a ball of one radius: of a level, or between levels.
#[derive(Clone, Copy)]
pub struct Law {
    tau: f32,
    levels: [&'static Level; 4],
    /// Cubic interpolation in ln(tau); `None` at a level, the first of the four.
    c: Option<[f32; 4]>,
}

impl std::fmt::Debug for Law {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Law").field("tau", &self.tau).finish_non_exhaustive()
    }
}

#[inline]
fn level(k: usize) -> &'static Level {
    TABLE[k].get_or_init(|| Level::new(radius(k)))
}

/// Returns the weights of cubic interpolation at t in [0, 1] between the middle two of four equidistant nodes.
#[inline]
fn cubic(t: f32) -> [f32; 4] {
    let (a, b, c) = (t + 1.0, t - 1.0, t - 2.0);
    [-t * b * c / 6.0, 0.5 * a * b * c, -0.5 * a * t * c, a * t * b / 6.0]
}

impl Law {
    /// Returns the law of a radius in mean free paths.
    ///
    /// *Domain*: tau in [1, [`MOST`]].
    pub fn new(tau: f32) -> Self {
        let x = PER_OCTAVE * tau.log2();
        let k = (x.floor().max(0.0) as usize).min(LEVELS - 4);
        Self { tau, levels: std::array::from_fn(|i| level(k + i)), c: Some(cubic(x - k as f32)) }
    }

    /// Returns the law of a radius that [`rounded_down`] returned.
    #[inline]
    pub fn of_level(tau: f32) -> Self {
        Self { tau, levels: [level(level_below(tau)); 4], c: None }
    }

    #[inline]
    fn mix(&self, f: impl Fn(&Level) -> f32) -> f32 {
        match self.c {
            None => f(self.levels[0]),
            Some(c) => self.levels.iter().zip(c).map(|(l, c)| c * f(l)).sum(),
        }
    }

    /// Returns the radius [mean free paths].
    pub fn tau(&self) -> f32 {
        self.tau
    }

    /// Returns the density over v = sqrt(1 - mu) of exits after at least one collision; its integral over [0, 1] is 1.
    #[inline]
    pub fn density(&self, v: f32) -> f32 {
        let (m, t) = cell(v);
        self.mix(|l| l.density[m] + t * (l.density[m + 1] - l.density[m])).max(0.0)
    }

    /// Returns the v up to which a share u leaves.
    pub fn sample(&self, u: f32) -> f32 {
        let mut low = match self.c {
            None => usize::from(self.levels[0].guide[((u * CELLS as f32) as usize).min(CELLS - 1)]),
            Some(_) => 0,
        };
        while low < CELLS - 1 && self.mix(|l| l.below[low + 1]) <= u {
            low += 1;
        }
        let [p, q] = [low, low + 1].map(|m| self.mix(|l| l.density[m]).max(0.0));
        // p t + (q - p) t^2 / 2 = rest, in cells.
        let rest = ((u - self.mix(|l| l.below[low])) * CELLS as f32).max(0.0);
        let root = (p * p + 2.0 * (q - p) * rest).max(0.0).sqrt();
        let t = if p + root > 0.0 { (2.0 * rest / (p + root)).min(1.0) } else { 0.5 };
        // At v = 1 nothing leaves: a density of 0 must not be divided by.
        ((low as f32 + t) * (1.0 / CELLS as f32)).min(1.0 - 1e-6)
    }

    /// Returns E\[alpha^N | v\] for N >= 1.
    ///
    /// *Domain*: alpha in [0, 1].
    pub fn weight(&self, v: f32, alpha: f32) -> f32 {
        if alpha >= 1.0 {
            return 1.0;
        }
        let root = (1.0 - alpha).sqrt();
        let (m, t) = cell(v);
        let x = root * (ALBEDOS - 1) as f32;
        // Analytic in alpha, so even in the root: the node before the first is the second.
        let k = (x as usize).min(ALBEDOS - 3);
        let (s, nodes) = (cubic(x - k as f32), [k.abs_diff(1), k, k + 1, k + 2]);
        let row = |m: usize| self.mix(|l| (0..4).map(|i| s[i] * l.weight[m][nodes[i]]).sum()).exp();
        alpha * smooth(root, self.tau).exp() * self.average(m, t, row(m), row(m + 1))
    }

    /// Returns the mean at a place in a cell of what belongs to its ends, each end with its share of the density: so that density times mean is linear.
    ///
    /// Near v = 0 single scattering, which is constant there, meets the rest, which is linear: means vary steeply, densities do not.
    #[inline]
    fn average(&self, m: usize, t: f32, first: f32, second: f32) -> f32 {
        let p = (1.0 - t) * self.mix(|l| l.density[m]).max(0.0);
        let q = t * self.mix(|l| l.density[m + 1]).max(0.0);
        if p + q > 0.0 { (p * first + q * second) / (p + q) } else { 0.5 * (first + second) }
    }

    /// Returns E\[N | v\] for N >= 1 without absorption.
    pub fn collisions(&self, v: f32) -> f32 {
        let (m, t) = cell(v);
        self.average(m, t, self.mix(|l| l.collisions[m]), self.mix(|l| l.collisions[m + 1]))
    }
}

/// Returns the cell of v and the place in it.
#[inline]
fn cell(v: f32) -> (usize, f32) {
    let x = v.clamp(0.0, 1.0) * CELLS as f32;
    let m = (x as usize).min(CELLS - 1);
    (m, x - m as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_between_the_levels_are_those_of_direct_solutions() {
        // Breaks at the cells, and finer where single scattering is steep.
        let cells = (1..=CELLS).map(|m| m as f64 / CELLS as f64);
        let rule = Rule::composite(5, &[0.0, 3e-4, 2e-3, 6e-3].into_iter().chain(cells).collect::<Vec<_>>());
        let cosines: Vec<f64> = rule.nodes.iter().map(|v| 1.0 - v * v).collect();
        let mut worst = 0.0f64;
        for tau in [1.02f32, 1.3, 1.77, 2.6, 4.4, 9.1, 20.0, 36.0, 63.9] {
            let (law, ball) = (Law::new(tau), Ball::new(f64::from(tau), &cosines));
            let total = -f64::from(-tau).exp_m1();
            for alpha in [1.0f32, 0.99999, 0.9991, 0.99, 0.93, 0.7, 0.3, 0.01] {
                let exits = ball.exits(f64::from(alpha));
                for g in [|_| 1.0, |mu: f64| mu, |mu: f64| mu * mu, |mu: f64| 1.0 - mu] {
                    let (mut table, mut direct) = (0.0, 0.0);
                    for (i, (v, w)) in rule.iter().enumerate() {
                        let p = law.density(v as f32) * law.weight(v as f32, alpha);
                        table += w * f64::from(p) * g(cosines[i]);
                        direct += w * 2.0 * v * f64::from(alpha) * exits[i] / total * g(cosines[i]);
                    }
                    worst = worst.max((table - direct).abs());
                    assert!((table - direct).abs() < 1e-5, "{tau} {alpha}: {table} {direct}");
                }
            }
        }
        println!("largest error of a moment: {worst:.1e}");
    }

    #[test]
    fn every_level_keeps_the_martingales() {
        // All light leaves, and 2 E[N] = R^2 + 2 R E[mu]: both for exits with and without collisions.
        for level in 0..LEVELS {
            let tau = radius(level);
            let l = Level::new(tau);
            assert!(l.weight.iter().flatten().chain(&l.collisions).all(|x| x.is_finite()), "{tau}");
            assert!(l.density[..CELLS].iter().all(|&p| p > 0.0), "{tau}");
            let (mut total, mut cosine, mut count) = (0.0f64, 0.0f64, 0.0f64);
            let rule = Rule::gauss(3, 0.0, 1.0);
            for m in 0..CELLS {
                for (t, w) in rule.iter() {
                    let at = |x: &[f32; CELLS + 1]| f64::from(x[m]) * (1.0 - t) + f64::from(x[m + 1]) * t;
                    let v = (m as f64 + t) / CELLS as f64;
                    let p = w / CELLS as f64 * at(&l.density);
                    total += p;
                    cosine += p * (1.0 - v * v);
                    let both: [f32; CELLS + 1] = std::array::from_fn(|m| l.density[m] * l.collisions[m]);
                    count += w / CELLS as f64 * at(&both);
                }
            }
            let through = (-tau).exp();
            let mean = (1.0 - through) * cosine + through;
            let exact = 0.5 * tau * tau + tau * mean;
            assert!((total - 1.0).abs() < 1e-6, "{tau}: {total}");
            assert!(((1.0 - through) * count / exact - 1.0).abs() < 1e-5, "{tau}: {count} {exact}");
        }
    }

    #[test]
    fn samples_follow_the_density() {
        let down = rounded_down(2.2);
        assert!(
            (down - 2.0).abs() < 1e-6
                && rounded_down(down) == down
                && rounded_down(64.0) == 64.0
                && rounded_down(1.0) == 1.0
        );
        let last = Law::of_level(down);
        assert!(last.density(last.sample(1.0)) > 0.0);
        for (law, i) in [Law::new(2.2), Law::of_level(down)].into_iter().flat_map(|l| (1..200).map(move |i| (l, i))) {
            let u = i as f32 / 200.0;
            let v = law.sample(u);
            let n = 2000;
            let below: f32 = (0..n).map(|k| law.density((k as f32 + 0.5) / n as f32 * v) * v / n as f32).sum();
            // Midpoint rule, f32.
            assert!((below - u).abs() < 1e-4, "{u} {v} {below}");
        }
    }
}
