//! Makes the table behind the profile `tabulated`: where and after how many collisions light leaves a conservative half-space.
//!
//! Absorption only weighs: a path of N collisions reaches the surface with alpha^N, whatever else happened. So one conservative
//! simulation holds the profiles of all albedos. Light scattered once is exact elsewhere; the table begins at N = 2.
//!
//! *One walk for all indices.* What a boundary reflects is a weight as well: a walk is reflected as the largest index would, and carries for every
//! index the ratio of its reflectance to that. So there are eight indices for the price of one, and their noise is the same, which interpolation likes.
//!
//! *One walk for all numbers of collisions.* Each upward flight scores its probability of leaving. Roulette at powers of two thins the walks so that
//! every octave of N gets about the same work: few collisions are sampled by very many walks.
//!
//! *Branches.* Where forward scattering dominates, a walk that has not been scattered backwards yet branches off one that is, at every
//! collision with probability .15 and the weight that this is worth: without, one walk in ten would bring back anything in its first ten collisions.
//!
//! *Far light.* Walks are a mixture of three lengths of flight, 1, 1/.8 and 1/.5 mean free paths, the longer ones for few collisions only. A walk of
//! n collisions and optical length T counts with the balance heuristic, 1 / sum_k c_k b_k^n e^((1 - b_k) T), at most 2.

use moonmilk_core::{Random, Stream, Vec3};
use moonmilk_optics::fresnel;
use moonmilk_optics::profile::tabulated::grid::{
    self, ETAS, R_CELLS, R_FIRST, R_PER_OCTAVE, n_last, n_nodes, n_weights,
};
use moonmilk_walk::PhaseFunction;
use moonmilk_walk::math::{deflect, exponential};
use moonmilk_walk::phase::HenyeyGreenstein;
use rayon::prelude::*;

pub mod pack;

/// Walks of a batch; batches are summed in their order, so that threads cannot change a bit.
pub const BATCH: u64 = 1 << 13;
/// Batches held in memory at a time.
const GROUP: usize = 8;
/// Optical depth beyond which a flight's probability of leaving (4e-11) is not scored but found by chance.
const DEEP: f32 = 24.0;
/// The mixture of flights: share of the walks, rate of collisions, largest number of collisions.
const MIXTURE: [(f32, f32, u32); 3] = [(0.5, 1.0, u32::MAX), (0.25, 0.8, 40), (0.25, 0.5, 8)];
/// Branches with light scattered backwards per collision, before the first such collision, if it is rarer than that.
const BRANCHING: f32 = 0.15;
/// Growth of the weight per octave of the collisions before and after 2 / (1 - g).
const GROWTH: (f32, f32) = (2.0, 1.25);
/// Growth of the weight in between, where there were branches.
const JUMP: f32 = 4.0;
/// Steps of the tabulated reflectance in the cosine; linear interpolation leaves 1e-5 of the transmitted share.
const COSINES: usize = 4096;

/// The table of one asymmetry.
#[derive(Clone, Debug)]
pub struct Node {
    /// Asymmetry of the Henyey-Greenstein law.
    pub g: f64,
    /// Share of the entered light that leaves per cell: row of radius, column of number of collisions, relative index (see [`grid`]).
    pub share: Vec<f64>,
    /// Share of the entered light still inside after the last number of collisions, per relative index.
    pub rest: [f64; ETAS],
    /// Walks simulated.
    pub walks: u64,
    /// Collisions simulated.
    pub collisions: u64,
}

/// Sums of a batch of walks.
struct Sums {
    share: Vec<f64>,
    rest: [f64; ETAS],
    collisions: u64,
}

/// What all walks of an asymmetry share.
struct Shared {
    law: HenyeyGreenstein,
    /// Transport mean free paths per mean free path.
    scale: f32,
    last: u32,
    columns: usize,
    /// Probability of scattering backwards.
    backward: f32,
    /// Number of collisions after which directions are random.
    turn: u32,
    /// Least weight of a branch at each power of two of the collisions.
    targets: [f32; 32],
    /// First column and weights of every number of collisions.
    spread: Vec<(u32, [f64; 4])>,
    /// Reflectance of every index over the cosine inside.
    reflectance: Vec<[f32; ETAS]>,
}

impl Node {
    /// Joins two simulations of the same asymmetry, weighted by their walks.
    pub fn join(&mut self, other: &Node) {
        let (a, b) = (self.walks as f64, other.walks as f64);
        let mean = |x: &mut f64, y: &f64| *x = (a * *x + b * y) / (a + b);
        self.share.iter_mut().zip(&other.share).for_each(|(x, y)| mean(x, y));
        self.rest.iter_mut().zip(&other.rest).for_each(|(x, y)| mean(x, y));
        self.walks += other.walks;
        self.collisions += other.collisions;
    }
}

impl Shared {
    fn new(g: f64, etas: &[f64; ETAS]) -> Self {
        let (last, columns) = (n_last(g), n_nodes(g));
        let spread = (0..=last).map(|n| n_weights(n.max(2), columns)).map(|(first, w)| (first as u32, w)).collect();
        let reflectance = (0..=COSINES)
            .map(|i| {
                let mu = i as f64 / COSINES as f64;
                std::array::from_fn(|k| {
                    // Matched, nothing is reflected, at grazing incidence neither.
                    if etas[k] == 1.0 { 0.0 } else { fresnel::reflectance_f64(mu, 1.0 / etas[k]) as f32 }
                })
            })
            .collect();
        // The cumulative distribution of the cosine at 0.
        let backward =
            if g == 0.0 { 0.5 } else { (1.0 - g * g) / (2.0 * g) * (1.0 / (1.0 + g * g).sqrt() - 1.0 / (1.0 + g)) };
        let turn = (2.0 / (1.0 - g)) as u32;
        let branches = backward < f64::from(BRANCHING);
        let mut targets = [0.0; 32];
        let (mut target, mut late) = (if branches { backward as f32 / BRANCHING } else { 1.0 }, false);
        for (k, t) in targets.iter_mut().enumerate().skip(2) {
            if 1u32 << k < turn {
                target *= GROWTH.0;
            } else if !late {
                target *= if branches { JUMP } else { 1.0 };
                late = true;
            } else {
                target *= GROWTH.1;
            }
            *t = target;
        }
        Self {
            law: HenyeyGreenstein { g: g as f32 },
            scale: (1.0 - g) as f32,
            last,
            columns,
            backward: backward as f32,
            turn,
            targets,
            spread,
            reflectance,
        }
    }

    /// Returns the reflectances at a cosine inside.
    #[inline]
    fn reflected(&self, mu: f32) -> [f32; ETAS] {
        let x = mu.min(1.0) * COSINES as f32;
        let i = (x as usize).min(COSINES - 1);
        let t = x - i as f32;
        let (a, b) = (&self.reflectance[i], &self.reflectance[i + 1]);
        std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
    }
}

/// Simulates one asymmetry and eight indices with a number of walks, rounded up to whole batches.
///
/// *Domain*: |g| < 1; indices of at least 1, the last the largest and above 1. Random numbers are keyed by seed and g.
pub fn node(g: f64, etas: &[f64; ETAS], walks: u64, seed: u64) -> Node {
    let shared = Shared::new(g, etas);
    let batches = walks.div_ceil(BATCH);
    let empty = || Sums { share: vec![0.0; R_CELLS * shared.columns * ETAS], rest: [0.0; ETAS], collisions: 0 };
    let mut total = empty();
    for first in (0..batches).step_by(GROUP) {
        let done: Vec<Sums> = (first..(first + GROUP as u64).min(batches))
            .into_par_iter()
            .map(|b| {
                let mut sums = empty();
                let mut stack = Vec::new();
                for i in 0..BATCH {
                    one(&shared, &mut Stream::new(&[seed, g.to_bits(), b, i]), &mut stack, &mut sums);
                }
                sums
            })
            .collect();
        for s in done {
            total.share.iter_mut().zip(&s.share).for_each(|(a, b)| *a += b);
            total.rest.iter_mut().zip(&s.rest).for_each(|(a, b)| *a += b);
            total.collisions += s.collisions;
        }
    }
    let n = (batches * BATCH) as f64;
    total.share.iter_mut().for_each(|x| *x /= n);
    Node {
        g,
        share: total.share,
        rest: total.rest.map(|x| x / n),
        walks: batches * BATCH,
        collisions: total.collisions,
    }
}

/// One branch of a walk.
#[derive(Clone, Copy)]
struct Branch {
    p: Vec3,
    d: Vec3,
    /// Collisions so far.
    n: u32,
    /// Optical length so far.
    length: f32,
    /// Weight that splitting and roulette have left, the same for all lengths of flight.
    weight: f32,
    /// Weight of every index.
    lanes: [f32; ETAS],
    /// Whether the branch has been scattered backwards, or need not be.
    turned: bool,
}

/// Adds one walk with all its branches.
fn one(shared: &Shared, rng: &mut Stream, stack: &mut Vec<Branch>, sums: &mut Sums) {
    // Choose the length of the flights.
    let u = rng.uniform();
    let kind = if u < MIXTURE[0].0 { 0 } else { 1 + usize::from(u >= MIXTURE[0].0 + MIXTURE[1].0) };
    stack.push(Branch {
        p: Vec3::ZERO,
        d: Vec3::Z,
        n: 0,
        length: 0.0,
        weight: 1.0,
        lanes: [1.0; ETAS],
        turned: shared.backward >= BRANCHING,
    });
    while let Some(branch) = stack.pop() {
        follow(shared, kind, branch, rng, stack, sums);
    }
}

/// Follows a branch to its end.
fn follow(shared: &Shared, kind: usize, mut b: Branch, rng: &mut Stream, stack: &mut Vec<Branch>, sums: &mut Sums) {
    let (_, rate, most) = MIXTURE[kind];
    let last = most.min(shared.last);
    loop {
        let t = exponential(rng.uniform()) / rate;
        let wall = if b.d.z < 0.0 { b.p.z / -b.d.z } else { f32::INFINITY };
        if wall < DEEP && b.n > 0 {
            let reflected = shared.reflected(-b.d.z);
            let at = b.p + b.d * wall;
            if b.n > 1 {
                let weight = b.weight * mixture_weight(b.n, b.length) * (-wall).exp();
                score(shared, sums, b.n, at, weight, &b.lanes, &reflected);
            }
            if t >= wall {
                // Reflect as the largest index would.
                let most = reflected[ETAS - 1];
                if rng.uniform() >= most {
                    return;
                }
                b.lanes.iter_mut().zip(&reflected).for_each(|(l, f)| *l *= f / most);
                b.length += wall;
                b.p = Vec3::new(at.x, at.y, 0.0);
                b.d.z = -b.d.z;
                continue;
            }
        } else if t >= wall {
            // Too deep to have been scored: leave as the walk does, with a probability below 4e-11.
            return;
        }
        b.p += b.d * t;
        b.length += t;
        b.n += 1;
        sums.collisions += 1;
        if b.n >= last {
            if kind == 0 {
                let weight = f64::from(b.weight / MIXTURE[0].0);
                sums.rest.iter_mut().zip(&b.lanes).for_each(|(r, &l)| *r += weight * f64::from(l));
            }
            return;
        }
        // Thin the branches at powers of two.
        if b.n >= 4 && b.n.is_power_of_two() {
            let survival = b.weight / shared.targets[b.n.trailing_zeros() as usize];
            if survival < 1.0 {
                if rng.uniform() >= survival {
                    return;
                }
                b.weight /= survival;
            }
        }
        let u = rng.uniform2();
        let mut u0 = u[0];
        if !b.turned {
            // Branch off what is scattered backwards, go on with what is scattered forwards.
            if rng.uniform() < BRANCHING {
                let v = rng.uniform2();
                stack.push(Branch {
                    d: deflect(b.d, shared.law.cosine(v[0] * shared.backward), v[1]),
                    weight: b.weight * shared.backward / BRANCHING,
                    turned: true,
                    ..b
                });
            }
            u0 = shared.backward + (1.0 - shared.backward) * u0;
            b.weight *= 1.0 - shared.backward;
            b.turned = b.n >= shared.turn;
        }
        b.d = deflect(b.d, shared.law.cosine(u0), u[1]);
    }
}

/// Returns the balance heuristic over the lengths of flights for a walk of n collisions and a total optical length.
#[inline]
fn mixture_weight(n: u32, length: f32) -> f32 {
    let mut sum = MIXTURE[0].0;
    for &(share, rate, most) in &MIXTURE[1..] {
        if n < most {
            sum += share * (n as f32 * rate.ln() + (1.0 - rate) * length).exp();
        }
    }
    1.0 / sum
}

/// Adds what leaves at a place after n collisions.
#[inline]
fn score(
    shared: &Shared,
    sums: &mut Sums,
    n: u32,
    at: Vec3,
    weight: f32,
    lanes: &[f32; ETAS],
    reflected: &[f32; ETAS],
) {
    // Cells are quarters of octaves of r, so halves of quarters of r^2.
    let octaves = 0.5 * ((at.x * at.x + at.y * at.y) * shared.scale * shared.scale).max(1e-30).log2() - R_FIRST as f32;
    let row = if octaves < 0.0 { 0 } else { (1 + (octaves * R_PER_OCTAVE as f32) as usize).min(R_CELLS - 1) };
    let left: [f64; ETAS] = std::array::from_fn(|k| f64::from(weight * lanes[k] * (1.0 - reflected[k])));
    let (first, spread) = &shared.spread[n as usize];
    let start = (row * shared.columns + *first as usize) * ETAS;
    if n <= grid::N_SINGLE {
        // The number is a node: the second of four, or the first at the beginning.
        let start = start + if n > 2 { ETAS } else { 0 };
        sums.share[start..start + ETAS].iter_mut().zip(&left).for_each(|(s, l)| *s += l);
        return;
    }
    for (cells, w) in sums.share[start..start + 4 * ETAS].chunks_exact_mut(ETAS).zip(spread) {
        cells.iter_mut().zip(&left).for_each(|(s, l)| *s += w * l);
    }
}
