//! Sums over many vertices, eight at a time: near ones one by one, far ones by representatives.
//!
//! Leaves are eight vertices in lanes, nodes eight children; a sum asks all children of a node at once. Nodes are filled from below (parts of 8, 64, 512 ... vertices, cut in the middle of the longest
//! axis), so that hardly a lane is idle.

use moonmilk_core::{Random, Stream, Vec3};
use rayon::prelude::*;
use wide::{f32x8, i32x8};

/// Vertices of a leaf, children of a node.
const LANES: usize = 8;
/// Most vertices that one thread sorts.
const ALONE: usize = 1 << 14;
/// Least probability with which far nodes are visited.
const LEAST: f32 = 1e-3;
/// Nodes that may wait: each of the levels, ten at most for 2^32 vertices, leaves seven.
const WAITING: usize = 80;

/// A vertex of a path of light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    pub p: Vec3,
    /// Direction of flight of the light.
    pub d: Vec3,
    /// The flux that is scattered.
    pub light: [f32; 4],
    /// Share of such vertices that are kept.
    pub kept: f32,
}

impl Vertex {
    fn weight(&self) -> f32 {
        self.light.iter().sum()
    }
}

/// Eight vertices in lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eight {
    pub p: [f32x8; 3],
    pub d: [f32x8; 3],
    pub light: [f32x8; 4],
    pub kept: f32x8,
}

impl Eight {
    /// Returns at most eight vertices in lanes; what is left of these is dark.
    fn new(vertices: impl Iterator<Item = Vertex>) -> Self {
        let mut lanes = [[0.0f32; LANES]; 11];
        lanes[10] = [1.0; LANES];
        for (l, v) in vertices.enumerate() {
            for k in 0..3 {
                (lanes[k][l], lanes[3 + k][l]) = (v.p[k], v.d[k]);
            }
            (0..4).for_each(|k| lanes[6 + k][l] = v.light[k]);
            lanes[10][l] = v.kept;
        }
        let at = |k: usize| f32x8::from(lanes[k]);
        Self { p: [at(0), at(1), at(2)], d: [at(3), at(4), at(5)], light: [at(6), at(7), at(8), at(9)], kept: at(10) }
    }
}

/// Eight children: what sums need to know of them, and one vertex of each that stands for all.
#[derive(Clone, Copy, Debug)]
struct Node {
    center: [f32x8; 3],
    radius: f32x8,
    /// Representatives, their light divided by their probabilities.
    standing: Eight,
    /// Numbers of nodes or of leaves.
    children: [u32; LANES],
    /// Which children there are, and which of them are leaves.
    present: u32,
    leaves: u32,
}

/// A tree over vertices.
#[derive(Debug)]
pub(super) struct Tree {
    /// Every node before its children.
    nodes: Vec<Node>,
    leaves: Vec<Eight>,
}

/// What a node's parent says of it.
#[derive(Clone, Copy)]
struct Summary {
    low: Vec3,
    high: Vec3,
    weight: f32,
    standing: Vertex,
}

/// A vertex while it is sorted.
#[derive(Clone, Copy)]
struct Place {
    p: Vec3,
    index: u32,
}

impl Tree {
    /// Makes a tree, in parallel; `key` names the random numbers that choose representatives.
    pub fn new(mut vertices: Vec<Vertex>, key: u64) -> Self {
        vertices.retain(|v| v.weight() > 0.0);
        let mut places: Vec<Place> =
            vertices.iter().enumerate().map(|(i, v)| Place { p: v.p, index: i as u32 }).collect();
        sort(&mut places);
        let (leaves, summaries): (Vec<Eight>, Vec<Summary>) = places
            .par_chunks(LANES)
            .enumerate()
            .map(|(i, part)| {
                let some = || part.iter().map(|p| vertices[p.index as usize]);
                (Eight::new(some()), Summary::of(some(), &mut Stream::new(&[key, i as u64])))
            })
            .unzip();
        let mut nodes = Vec::with_capacity(leaves.len() / 4);
        if !leaves.is_empty() {
            Node::append(&mut nodes, &summaries, 0, &mut Stream::new(&[key, u64::MAX]));
        }
        Self { nodes, leaves }
    }

    /// Visits what is within reach of p, by eights and with the inverse of the probability that each of these is visited: any sum of light x f(vertex) over what is visited has the mean of the sum over all vertices.
    ///
    /// A node is visited as a whole, by its representative, if its radius is below `angle` times its distance; behind `near` only one in exp((distance - near) / `fade`) is.
    pub fn survey(
        &self,
        p: Vec3,
        angle: f32,
        near: f32,
        fade: f32,
        rng: &mut impl Random,
        mut each: impl FnMut(&Eight, f32x8),
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let o = [p.x, p.y, p.z].map(f32x8::splat);
        let (near, angle2) = (f32x8::splat(near), f32x8::splat(angle * angle));
        let (fade, least) = (f32x8::splat(fade), f32x8::splat(LEAST));
        let steps = f32x8::from(std::array::from_fn(|l| l as f32 / LANES as f32));
        let mut waiting = [(0u32, 1.0f32); WAITING];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (i, weight) = waiting[count];
            let node = &self.nodes[i as usize];
            let v: [f32x8; 3] = std::array::from_fn(|k| node.center[k] - o[k]);
            let d2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
            let reach = near + node.radius;
            let (one, mut weights) = (f32x8::splat(1.0), f32x8::splat(weight));
            let mut visited = node.present;
            // What is far off as a whole is left out by chance as a whole; one variate, an eighth on from lane to lane.
            let far = d2.simd_gt(reach * reach);
            if far.any() {
                let survival = exp((reach - d2.sqrt()) / fade).fast_max(least);
                let thinned = far & (survival * weights).simd_lt(one);
                let u = f32x8::splat(rng.uniform()) + steps;
                let u = u.simd_ge(one).bitselect(u - one, u);
                visited &= !(thinned & u.simd_ge(survival * weights)).to_bitmask();
                weights = thinned.bitselect(one / survival, weights);
            }
            let small = (node.radius * node.radius).simd_lt(angle2 * d2);
            let standing = small.to_bitmask() & visited;
            if standing != 0 {
                let lanes = weights.to_array();
                let some = std::array::from_fn(|l| if standing >> l & 1 == 1 { lanes[l] } else { 0.0 });
                each(&node.standing, f32x8::from(some));
            }
            let weights = weights.to_array();
            let mut large = visited & !standing;
            while large != 0 {
                let l = large.trailing_zeros() as usize;
                large &= large - 1;
                if node.leaves >> l & 1 == 1 {
                    each(&self.leaves[node.children[l] as usize], f32x8::splat(weights[l]));
                } else {
                    waiting[count] = (node.children[l], weights[l]);
                    count += 1;
                }
            }
        }
    }
}

/// Returns e^x for x <= 88, what is below -87 as that; relative error 3e-7.
#[inline]
pub(super) fn exp(x: f32x8) -> f32x8 {
    const LN_2: [f32; 2] = [355.0 / 512.0, -2.121_944_4e-4];
    let x = x.fast_max(f32x8::splat(-87.0));
    let n = (x * f32x8::splat(std::f32::consts::LOG2_E)).round_ties_even();
    let r = LN_2.iter().fold(x, |r, &part| n.mul_neg_add(f32x8::splat(part), r));
    // The series up to r^6 / 720, of |r| <= ln 2 / 2: the next term is 1.2e-7.
    let series = [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0].map(f32x8::splat);
    let e = series.into_iter().reduce(|sum, c| sum.mul_add(r, c)).expect("there are terms");
    let exponent: i32x8 = (n.fast_round_int() + i32x8::splat(127)) << 23;
    e * f32x8::from(exponent.to_array().map(|b| f32::from_bits(b as u32)))
}

/// Sorts vertices so that every node's are neighbours: halves of 8, 16, 32 ... vertices at the middle of the longest axis of their box, what is left over behind.
fn sort(places: &mut [Place]) {
    if places.len() <= LANES {
        return;
    }
    let (low, high) = bounds(places.iter().map(|p| p.p));
    let extent = high - low;
    let axis = extent.max_position();
    let middle = LANES * places.len().div_ceil(2 * LANES).next_power_of_two();
    places.select_nth_unstable_by(middle, |a, b| a.p[axis].total_cmp(&b.p[axis]));
    let alone = places.len() <= ALONE;
    let (left, right) = places.split_at_mut(middle);
    if alone {
        sort(left);
        sort(right);
    } else {
        rayon::join(|| sort(left), || sort(right));
    }
}

fn bounds(places: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)))
}

impl Summary {
    /// Returns the summary of a leaf: of its vertices one stands for all, in proportion to its weight.
    fn of(vertices: impl Iterator<Item = Vertex> + Clone, rng: &mut Stream) -> Self {
        let (low, high) = bounds(vertices.clone().map(|v| v.p));
        let parts = vertices.map(|v| Self { low, high, weight: v.weight(), standing: v });
        Self::join(parts, rng)
    }

    /// Returns the summary of some parts: of their representatives one stands for all, in proportion to what it stood for.
    fn join(parts: impl Iterator<Item = Self> + Clone, rng: &mut Stream) -> Self {
        let mut all = Self { weight: 0.0, ..parts.clone().next().expect("there is a part") };
        for part in parts {
            (all.low, all.high) = (all.low.min(part.low), all.high.max(part.high));
            all.weight += part.weight;
            if rng.uniform() * all.weight < part.weight {
                all.standing = part.standing;
            }
        }
        let factor = all.weight / all.standing.weight();
        all.standing.light = all.standing.light.map(|l| l * factor);
        all
    }
}

impl Node {
    /// Appends the node over some leaves, of which the first has this number, and what is below it.
    fn append(nodes: &mut Vec<Self>, leaves: &[Summary], first: u32, rng: &mut Stream) -> Summary {
        // Nodes below are full: what three levels of halves do not divide is the root's.
        let levels = leaves.len().next_power_of_two().trailing_zeros();
        let own = levels - 3 * (levels.saturating_sub(1) / 3);
        let part = 1usize << (levels - own);
        let root = nodes.len();
        let dark = Eight::new(std::iter::empty());
        let zero = f32x8::splat(0.0);
        nodes.push(Self {
            center: [zero; 3],
            radius: zero,
            standing: dark,
            children: [0; LANES],
            present: 0,
            leaves: 0,
        });
        let (mut children, mut below) = ([0; LANES], [leaves[0]; LANES]);
        let (mut present, mut single) = (0, 0);
        for (l, leaves) in leaves.chunks(part).enumerate() {
            let first = first + (l * part) as u32;
            present |= 1 << l;
            if let [leaf] = leaves {
                single |= 1 << l;
                (children[l], below[l]) = (first, *leaf);
            } else {
                children[l] = nodes.len() as u32;
                below[l] = Self::append(nodes, leaves, first, rng);
            }
        }
        let some = &below[..leaves.chunks(part).len()];
        let lanes = |f: &dyn Fn(&Summary) -> f32| f32x8::from(below.each_ref().map(f));
        nodes[root] = Self {
            center: std::array::from_fn(|k| lanes(&|s| 0.5 * (s.low + s.high)[k])),
            radius: lanes(&|s| 0.5 * s.low.distance(s.high)),
            standing: Eight::new(some.iter().map(|s| s.standing)),
            children,
            present,
            leaves: single,
        };
        Summary::join(some.iter().copied(), rng)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vertices(n: u64, seed: u64) -> Vec<Vertex> {
        (0..n)
            .map(|i| {
                let mut r = Stream::new(&[seed, i]);
                let p = Vec3::new(r.uniform(), r.uniform(), 0.1 * r.uniform()) * 4.0;
                let red = if r.uniform() < 0.3 { 0.0 } else { r.uniform() };
                Vertex { p, d: Vec3::Z, light: [red, 2.0 * r.uniform() * p.x, 0.5, 0.0], kept: 1.0 }
            })
            .collect()
    }

    /// Returns the sum of weight x light x f(squared distance) over eight vertices.
    fn sum(eight: &Eight, weights: f32x8, p: Vec3, f: impl Fn(f32) -> f32) -> f64 {
        let at = eight.p.map(|x| x.to_array());
        (0..LANES)
            .map(|l| {
                let r2 = p.distance_squared(Vec3::new(at[0][l], at[1][l], at[2][l]));
                let light: f32 = eight.light.iter().map(|x| x.to_array()[l]).sum();
                f64::from(f(r2) * light * weights.to_array()[l])
            })
            .sum()
    }

    #[test]
    fn surveys_have_the_mean_of_the_full_sum_wherever_they_thin_out() {
        // Over choices of representatives and of what is left out far off; |z| < 4.9 is a two-sided significance of 1e-6 each.
        let vertices = vertices(4000, 6);
        let kernel = |r2: f32| (-2.0 * r2.sqrt()).exp() / (0.01 + r2);
        let trees: Vec<Tree> = (0..50).map(|k| Tree::new(vertices.clone(), k)).collect();
        for place in 0..5 {
            let p = Vec3::new(place as f32, 1.5, 0.2);
            let exact: f64 =
                vertices.iter().map(|v| f64::from(kernel(p.distance_squared(v.p)) * v.light.iter().sum::<f32>())).sum();
            let x: Vec<f64> = (0..400usize)
                .map(|k| {
                    let (mut all, mut rng) = (0.0, Stream::new(&[7, place, k as u64]));
                    trees[k % 50].survey(p, 0.7, 1.0, 0.3, &mut rng, |eight, weights| {
                        all += sum(eight, weights, p, kernel);
                    });
                    all / exact
                })
                .collect();
            // Trees are shared by eight each: means per tree are independent.
            let x: Vec<f64> = (0..50).map(|t| x.iter().skip(t).step_by(50).sum::<f64>() / 8.0).collect();
            let mean = x.iter().sum::<f64>() / 50.0;
            let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 49.0;
            let z = (mean - 1.0) / (variance / 50.0).sqrt();
            assert!(z.abs() < 4.9 && variance.sqrt() < 0.2, "place {place}: mean {mean}, z {z}, {}", variance.sqrt());
        }
    }

    #[test]
    fn trees_of_any_size_hold_every_vertex_once() {
        // Nothing is small from inside, nothing thinned out: what is visited is what there is.
        for n in [0, 1, 7, 8, 9, 17, 63, 64, 65, 100, 511, 513, 4097, 20_000] {
            let vertices = vertices(n, 3);
            let exact: f64 = vertices.iter().map(|v| f64::from(v.light.iter().sum::<f32>())).sum();
            let (mut all, mut lanes) = (0.0, 0);
            let tree = Tree::new(vertices, 1);
            tree.survey(Vec3::ONE, 0.0, 1e9, 1.0, &mut Stream::new(&[1]), |eight, weights| {
                all += sum(eight, weights, Vec3::ONE, |_| 1.0);
                lanes += 1;
            });
            assert!((all - exact).abs() <= 1e-6 * exact, "{n}: {all} for {exact}");
            assert_eq!(lanes, n.div_ceil(8), "{n}");
        }
    }

    #[test]
    fn the_exponential_is_that_of_the_standard_library() {
        for i in 0..20_000 {
            let x = -87.0 + 0.0087 * i as f32;
            let (own, exact) = (exp(f32x8::splat(x)).to_array()[3], f64::from(x).exp());
            assert!((f64::from(own) / exact - 1.0).abs() < 3e-7, "{x}: {own} for {exact}");
        }
        assert!(exp(f32x8::splat(-1e9)).to_array()[0] < 2e-38);
    }
}
