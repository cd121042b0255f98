//! Escape from a ball: what leaves a ball of isotropic scatterers through its surface, for light that starts at its centre.
//!
//! Lengths are mean free paths. A collision at the centre sends light in all directions alike; u(r) = 4 pi r C(r), with C the density of the collisions that follow, obeys
//!
//! $$ u(r) = \frac{e^{-r}}{r} + \frac{\alpha}{2} \int_0^R \left[ E_1(|r - r'|) - E_1(r + r') \right] u(r')\, dr' , $$
//!
//! the equation of Peierls for an odd function on a slab. What leaves at the cosine mu to the outward normal after at least one more collision is the light that is scattered along the chord,
//!
//! $$ f(\mu) = \frac{\alpha}{2} R^2 \mu \int_0^{2 R \mu} \frac{u(r(s))}{r(s)}\, e^{-s}\, ds, \qquad r(s)^2 = R^2 + s^2 - 2 R s \mu , $$
//!
//! and exp(-R) leaves without one. f is the generating function of the number N of those collisions: $f(\mu; \alpha) = \sum_{N \ge 1} \alpha^N p_N(\mu)$.
//!
//! Two identities hold for alpha = 1, as r and r^2 + 2 r.d - 2 L are martingales of a flight: the mean cosine and the mean path length L = E\[N\] are tied by
//! $2 L = R^2 + 2 R\, E[\mu]$, and all light leaves. Neither is built in, so both measure the error of a solution; it is below 2e-6 for radii of 1/2 to 100 (tested).
//!
//! *Source*: the equation is textbook (\[Case1953\]); the solution is by collocation on panels with weights that integrate the kernel's logarithm, for all albedos from one Krylov space.

use moonmilk_core::quadrature::Rule;

use crate::exponential::e_1;

/// Order of the polynomials on a panel.
const ORDER: usize = 8;
/// Longest panel [mean free paths].
const LONGEST: f64 = 2.0;
/// Residual of the solution for albedo 1, relative to its first term.
const TOLERANCE: f64 = 1e-9;
/// Beyond this optical distance nothing is added: exp(-40) is nothing.
const FAR: f64 = 40.0;

/// The solution for one radius, at given cosines.
pub struct Ball {
    /// Of exits after exactly one collision, alpha = 1, per cosine.
    single: Vec<f64>,
    /// Krylov space: norm of the first vector, Hessenberg matrix (column by column), and the exits of each basis vector per cosine.
    norm: f64,
    hessenberg: Vec<Vec<f64>>,
    exits: Vec<Vec<f64>>,
}

/// Panels of [0, R], with nodes.
struct Panels {
    breaks: Vec<f64>,
    nodes: Vec<f64>,
    /// Nodes and weights of one panel on [-1, 1], and the weights of barycentric interpolation.
    rule: Rule,
    barycentric: Vec<f64>,
}

impl Panels {
    fn new(radius: f64) -> Self {
        // The solution has logarithms at the centre and at the surface: panels shrink towards both.
        let mut breaks: Vec<f64> = vec![0.0];
        let grades = |limit: f64| {
            let mut b = vec![];
            let mut x = 1e-4f64;
            while x < limit {
                b.push(x);
                x += (1.5 * x).min(LONGEST);
            }
            b
        };
        let half = grades(0.5 * radius);
        breaks.extend(&half);
        breaks.extend(half.iter().rev().map(|x| radius - x));
        breaks.push(radius);
        let rule = Rule::gauss(ORDER, -1.0, 1.0);
        let barycentric = (0..ORDER)
            .map(|j| {
                let others = (0..ORDER).filter(|&k| k != j);
                1.0 / others.map(|k| rule.nodes[j] - rule.nodes[k]).product::<f64>()
            })
            .collect();
        let nodes = breaks
            .windows(2)
            .flat_map(|w| rule.nodes.iter().map(move |x| 0.5 * (w[0] + w[1]) + 0.5 * (w[1] - w[0]) * x))
            .collect();
        Self { breaks, nodes, rule, barycentric }
    }

    /// Returns the roots of the nodes' weights in an integral.
    fn roots(&self) -> Vec<f64> {
        let of = |w: &[f64]| self.rule.weights.iter().map(|c| (0.5 * (w[1] - w[0]) * c).sqrt()).collect::<Vec<_>>();
        self.breaks.windows(2).flat_map(of).collect()
    }

    /// Returns the weights of a panel's nodes in the value of its polynomial at x.
    fn interpolate(&self, panel: usize, x: f64) -> [f64; ORDER] {
        let (a, b) = (self.breaks[panel], self.breaks[panel + 1]);
        let t = (2.0 * x - a - b) / (b - a);
        let mut w = [0.0; ORDER];
        let mut sum = 0.0;
        for ((w, &node), &c) in w.iter_mut().zip(&self.rule.nodes).zip(&self.barycentric) {
            if t == node {
                let mut exact = [0.0; ORDER];
                exact[self.rule.nodes.iter().position(|&n| n == t).unwrap_or(0)] = 1.0;
                return exact;
            }
            *w = c / (t - node);
            sum += *w;
        }
        w.map(|x| x / sum)
    }
}

/// Returns breaks of [a, b] that shrink towards a point x on it or near it, where an integrand has a logarithm.
fn graded(a: f64, b: f64, x: f64) -> Vec<f64> {
    let mut breaks = vec![a, b];
    for (from, to) in [(x, b), (x, a)] {
        let mut d = to - from;
        // Not down to where differences of coordinates are rounding alone.
        while d.abs() > (1e-11 * (b - a)).max(1e-12 * b) {
            let at = from + d;
            if at > a && at < b {
                breaks.push(at);
            }
            d *= 0.15;
        }
    }
    if x > a && x < b {
        breaks.push(x);
    }
    breaks.sort_by(f64::total_cmp);
    breaks.dedup();
    breaks
}

impl Ball {
    /// Solves a ball of a radius in mean free paths, for cosines of exit.
    ///
    /// *Domain*: radius in [1/4, 200], cosines in (0, 1). *Cost*: 10 to 50 ms.
    pub fn new(radius: f64, cosines: &[f64]) -> Self {
        let panels = Panels::new(radius);
        let mut kernel = kernel(&panels);
        let n = panels.nodes.len();
        // Values times the roots of the nodes' weights: so the matrix is symmetric but for the error of the quadrature.
        let roots = panels.roots();
        for (row, a) in kernel.iter_mut().zip(&roots) {
            row.iter_mut().zip(&roots).for_each(|(k, b)| *k *= a / b);
        }
        // What the first collisions make: K u_1, u_1 = exp(-r) / r.
        let first: Vec<f64> = panels.nodes.iter().zip(&roots).map(|(&r, w)| w * once(r, radius)).collect();

        // Arnoldi's process on K from there.
        let norm = dot(&first, &first).sqrt();
        let mut basis = vec![first.iter().map(|x| x / norm).collect::<Vec<f64>>()];
        let mut hessenberg: Vec<Vec<f64>> = vec![];
        while hessenberg.len() < n {
            let last = &basis[hessenberg.len()];
            let mut v: Vec<f64> = kernel.iter().map(|row| dot(row, last)).collect();
            let mut column = vec![0.0; basis.len() + 1];
            // Twice, so that the basis stays orthogonal.
            for _ in 0..2 {
                for (h, b) in column.iter_mut().zip(&basis) {
                    let c = dot(&v, b);
                    *h += c;
                    v.iter_mut().zip(b).for_each(|(v, b)| *v -= c * b);
                }
            }
            let rest = dot(&v, &v).sqrt();
            column[basis.len()] = rest;
            hessenberg.push(column);
            let m = hessenberg.len();
            if rest == 0.0 || m.is_multiple_of(8) && rest * solve(&hessenberg, 1.0, unit(m))[m - 1].abs() < TOLERANCE {
                break;
            }
            basis.push(v.iter().map(|x| x / rest).collect());
        }
        let chords: Vec<Chord> = cosines.iter().map(|&mu| Chord::new(&panels, radius, mu)).collect();
        let exits = basis[..hessenberg.len()].iter().map(|b| {
            let values: Vec<f64> = b.iter().zip(&roots).map(|(x, w)| x / w).collect();
            chords.iter().map(|c| dot(&c.weights, &values)).collect()
        });
        Self { exits: exits.collect(), single: chords.iter().map(|c| c.single).collect(), norm, hessenberg }
    }

    fn combine(&self, y: &[f64]) -> Vec<f64> {
        (0..self.single.len())
            .map(|k| self.norm * self.exits.iter().zip(y).map(|(e, y)| e[k] * y).sum::<f64>())
            .collect()
    }

    /// Returns f(mu) / alpha at every cosine: the density of exits after at least one collision, each collision with weight alpha, of which one is left out.
    ///
    /// *Domain*: alpha in [0, 1].
    pub fn exits(&self, alpha: f64) -> Vec<f64> {
        let y = solve(&self.hessenberg, alpha, unit(self.hessenberg.len()));
        self.single.iter().zip(self.combine(&y)).map(|(s, w)| s + alpha * w).collect()
    }

    /// Returns p(mu) E\[N | mu\] at every cosine, for exits after at least one collision without absorption.
    pub fn collisions(&self) -> Vec<f64> {
        // d/d alpha of alpha (single + alpha (1 - alpha H)^-1 first) at 1.
        let once = solve(&self.hessenberg, 1.0, unit(self.hessenberg.len()));
        let twice = solve(&self.hessenberg, 1.0, once.clone());
        self.single.iter().zip(self.combine(&once)).zip(self.combine(&twice)).map(|((s, a), b)| s + a + b).collect()
    }
}

/// Returns the coefficients of (1 - alpha H)^-1 applied to a vector; H by columns.
fn solve(hessenberg: &[Vec<f64>], alpha: f64, mut right: Vec<f64>) -> Vec<f64> {
    let m = hessenberg.len();
    let mut a: Vec<Vec<f64>> = (0..m)
        .map(|i| {
            let entry = |j: usize| hessenberg[j].get(i).copied().unwrap_or(0.0);
            (0..m).map(|j| f64::from(u8::from(i == j)) - alpha * entry(j)).collect()
        })
        .collect();
    // Eliminate the one entry below the diagonal of each column; 1 - alpha H is positive, so pivots are.
    for i in 1..m {
        let factor = a[i][i - 1] / a[i - 1][i - 1];
        let (above, below) = a.split_at_mut(i);
        below[0].iter_mut().zip(&above[i - 1]).skip(i - 1).for_each(|(x, y)| *x -= factor * y);
        right[i] -= factor * right[i - 1];
    }
    for i in (0..m).rev() {
        let known: f64 = (i + 1..m).map(|j| a[i][j] * right[j]).sum();
        right[i] = (right[i] - known) / a[i][i];
    }
    right
}

/// Returns the first of m unit vectors.
fn unit(m: usize) -> Vec<f64> {
    (0..m).map(|i| f64::from(u8::from(i == 0))).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Returns the matrix of 1/2 [E_1(|r - r'|) - E_1(r + r')] on the panels' polynomials.
fn kernel(panels: &Panels) -> Vec<Vec<f64>> {
    let fine = Rule::gauss(12, -1.0, 1.0);
    let count = panels.breaks.len() - 1;
    panels
        .nodes
        .iter()
        .map(|&r| {
            let mut row = vec![0.0; count * ORDER];
            for panel in 0..count {
                let (a, b) = (panels.breaks[panel], panels.breaks[panel + 1]);
                let row = &mut row[panel * ORDER..(panel + 1) * ORDER];
                for (x, sign) in [(r, 0.5), (-r, -0.5)] {
                    let distance = (a - x).max(x - b).max(0.0);
                    if distance > FAR {
                        continue;
                    }
                    if distance > b - a {
                        for ((w, t), c) in row.iter_mut().zip(&panels.rule.nodes).zip(&panels.rule.weights) {
                            let at = 0.5 * (a + b) + 0.5 * (b - a) * t;
                            *w += sign * c * 0.5 * (b - a) * e_1((at - x).abs());
                        }
                        continue;
                    }
                    for part in graded(a, b, x).windows(2) {
                        let half = 0.5 * (part[1] - part[0]);
                        for (t, c) in fine.iter() {
                            let at = 0.5 * (part[0] + part[1]) + half * t;
                            let value = sign * c * half * e_1((at - x).abs());
                            let basis = panels.interpolate(panel, at);
                            row.iter_mut().zip(basis).for_each(|(w, b)| *w += value * b);
                        }
                    }
                }
            }
            row
        })
        .collect()
}

/// Returns 1/2 of the integral of [E_1(|r - r'|) - E_1(r + r')] exp(-r') / r'.
fn once(r: f64, radius: f64) -> f64 {
    let rule = Rule::gauss(10, -1.0, 1.0);
    let mut breaks = graded(0.0, r, 0.0);
    breaks.extend(graded(0.0, r, r));
    breaks.extend(graded(r, radius, r));
    // Resolve the exponentials as well.
    breaks.extend((1..).map(|k| 2.0 * f64::from(k)).take_while(|&x| x < radius));
    breaks.sort_by(f64::total_cmp);
    breaks.dedup();
    let mut sum = 0.0;
    for part in breaks.windows(2).filter(|p| p[0] < FAR) {
        let half = 0.5 * (part[1] - part[0]);
        for (t, c) in rule.iter() {
            let x = 0.5 * (part[0] + part[1]) + half * t;
            let kernel = if x < 1e-6 * r { 2.0 * x * (-r).exp() / r } else { e_1((r - x).abs()) - e_1(r + x) };
            sum += 0.5 * c * half * kernel * (-x).exp() / x;
        }
    }
    sum
}

/// The integral along a chord.
struct Chord {
    single: f64,
    weights: Vec<f64>,
}

impl Chord {
    fn new(panels: &Panels, radius: f64, mu: f64) -> Self {
        let b = radius * (1.0 - mu * mu).sqrt();
        let rule = Rule::gauss(12, -1.0, 1.0);
        let mut chord = Self { single: 0.0, weights: vec![0.0; panels.nodes.len()] };
        for (panel, ends) in panels.breaks.windows(2).enumerate() {
            if ends[1] <= b {
                continue;
            }
            // x is the distance from the middle of the chord: x = b sinh t, r = b cosh t.
            let at = |r: f64| if r <= b { 0.0 } else { (r / b).acosh() };
            let (from, to) = (at(ends[0]), at(ends[1]));
            // Panels reach far in t where the chord passes near the centre.
            let pieces = ((to - from) / 1.5).ceil().max(1.0);
            for piece in 0..pieces as usize {
                let half = 0.5 * (to - from) / pieces;
                let centre = from + (2.0 * piece as f64 + 1.0) * half;
                for (u, c) in rule.iter() {
                    let t = centre + half * u;
                    let (x, r) = (b * t.sinh(), b * t.cosh());
                    // Both halves of the chord; ds = r dt.
                    let near = radius * mu - x;
                    if near > FAR {
                        continue;
                    }
                    let seen = (-near).exp() + (-(radius * mu + x)).exp();
                    let weight = 0.5 * radius * radius * mu * c * half * seen;
                    chord.single += weight * (-r).exp() / r;
                    let basis = panels.interpolate(panel, r.clamp(ends[0], ends[1]));
                    let row = &mut chord.weights[panel * ORDER..(panel + 1) * ORDER];
                    row.iter_mut().zip(basis).for_each(|(w, b)| *w += weight * b);
                }
            }
        }
        chord
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cosines 1 - v^2 for a rule in v, so that the steep end is resolved; weights for integrals over the cosine.
    fn cosines() -> (Vec<f64>, Vec<f64>) {
        let rule = Rule::composite(16, &[0.0, 0.02, 0.15, 0.5, 0.85, 1.0]);
        rule.iter().map(|(v, w)| (1.0 - v * v, 2.0 * v * w)).unzip()
    }

    #[test]
    fn all_light_leaves_and_the_mean_path_length_is_that_of_the_martingale() {
        let (mu, weights) = cosines();
        for radius in [0.5, 1.0, 2.7, 8.0, 30.0, 100.0] {
            let ball = Ball::new(radius, &mu);
            let p = ball.exits(1.0);
            let unscattered = (-radius).exp();
            let total = dot(&p, &weights) + unscattered;
            let mean: f64 = p.iter().zip(&weights).zip(&mu).map(|((p, w), m)| p * w * m).sum::<f64>() + unscattered;
            let length = dot(&ball.collisions(), &weights);
            let exact = 0.5 * radius * radius + radius * mean;
            println!("{radius}: total {:+.1e}, length {:+.1e}", total - 1.0, length / exact - 1.0);
            assert!((total - 1.0).abs() < 2e-6, "{radius}: {total}");
            assert!((length / exact - 1.0).abs() < 2e-6, "{radius}: {length} {exact}");
        }
    }

    #[test]
    fn exits_agree_with_a_simulation() {
        use moonmilk_core::{Random, Stream};
        let (mu, weights) = cosines();
        let n = 400_000u64;
        for (radius, alpha) in [(1.3f64, 0.6f64), (4.0, 0.9), (4.0, 1.0)] {
            let ball = Ball::new(radius, &mu);
            let f = ball.exits(alpha);
            let moment =
                |k: i32| alpha * f.iter().zip(&weights).zip(&mu).map(|((f, w), m)| f * w * m.powi(k)).sum::<f64>();
            let mut sums = [[0.0f64; 2]; 3];
            for i in 0..n {
                let mut rng = Stream::new(&[11, i]);
                let mut p = [0.0f64; 3];
                let mut weight = 1.0;
                let mut events = 0;
                loop {
                    let (z, a) =
                        (2.0 * f64::from(rng.uniform()) - 1.0, std::f64::consts::TAU * f64::from(rng.uniform()));
                    let s = (1.0 - z * z).sqrt();
                    let d = [s * a.cos(), s * a.sin(), z];
                    let t = -f64::from(rng.uniform()).ln();
                    let (pd, pp) = (0..3).fold((0.0, 0.0), |(x, y), k| (x + p[k] * d[k], y + p[k] * p[k]));
                    let wall = -pd + (pd * pd + radius * radius - pp).sqrt();
                    if t >= wall {
                        if events > 0 {
                            let m = (pd + wall) / radius;
                            for (k, s) in sums.iter_mut().enumerate() {
                                let x = weight * m.powi(k as i32);
                                s[0] += x;
                                s[1] += x * x;
                            }
                        }
                        break;
                    }
                    p.iter_mut().zip(d).for_each(|(p, d)| *p += t * d);
                    weight *= alpha;
                    events += 1;
                }
            }
            for (k, s) in sums.iter().enumerate() {
                let mean = s[0] / n as f64;
                let error = ((s[1] / n as f64 - mean * mean) / n as f64).sqrt();
                // Nine comparisons; 4.9 standard errors are a significance of 1e-5 over all.
                assert!(
                    (mean - moment(k as i32)).abs() < 4.9 * error,
                    "{radius} {alpha} {k}: {mean} +- {error}, {}",
                    moment(k as i32)
                );
            }
        }
    }
}
