//! Sums over many points, near ones one by one and far ones by representatives.

use moonmilk_core::{Random, Spectrum, Stream, Vec3};

/// Largest uncertainty of a node that is not opened, as a share of the whole sum.
const TOLERANCE: f32 = 0.1;
/// Most points of a leaf.
const LEAF: usize = 4;
/// Most points of a tree that one thread makes.
const ALONE: usize = 1 << 14;
/// Levels of the tree that a sum may use; more than points can have.
const LEVELS: usize = 40;

/// A point and its light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    pub p: Vec3,
    pub light: [f32; 4],
}

impl Point {
    /// Returns a point of a surface and the light that enters there; `None` if that is not finite.
    pub fn new<const N: usize>(p: Vec3, light: Spectrum<N>) -> Option<Self> {
        let light = std::array::from_fn(|k| if k < N { light[k] } else { 0.0 });
        light.iter().all(|l: &f32| l.is_finite()).then_some(Self { p, light })
    }
}

impl Point {
    fn weight(&self) -> f32 {
        self.light.iter().map(|l| l.abs()).sum()
    }

    fn standing_for(&self, factor: f32) -> Self {
        Self { light: self.light.map(|l| l * factor), ..*self }
    }
}

/// Some points, and one of them that stands for all.
#[derive(Clone, Copy, Debug)]
struct Node {
    center: Vec3,
    radius: f32,
    /// Sum of the points' weights.
    weight: f32,
    /// Number of the second child, the first being the next node; 0 for a leaf.
    second: u32,
    /// Where the points of a leaf begin, and how many there are.
    first: u32,
    count: u32,
    /// The longest axis of its box.
    axis: u32,
    /// The representative, its light divided by its probability.
    point: Point,
}

/// A tree over points.
#[derive(Debug)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    points: Vec<Point>,
}

impl Tree {
    /// Makes a tree, in parallel; `key` names the random numbers that choose representatives.
    pub fn new(mut points: Vec<Point>, key: u64) -> Self {
        points.retain(|p| p.weight() > 0.0);
        let nodes = if points.is_empty() { vec![] } else { build(&mut points, 0, key) };
        Self { nodes, points }
    }

    /// Returns the sum of light x kernel over all points, an estimate without bias; the kernels are functions of the squared distance.
    ///
    /// `scalar` is what `kernel` is over all lanes: it decides which nodes are opened.
    pub fn gather(&self, p: Vec3, kernel: impl Fn(f32) -> [f32; 4], scalar: impl Fn(f32) -> f32) -> [f32; 4] {
        let mut sum = [0.0f32; 4];
        self.visit(p, scalar, |r2, point| {
            let k = kernel(r2);
            (0..4).for_each(|l| sum[l] += k[l] * point.light[l]);
        });
        sum
    }

    /// Visits points near p and representatives of far ones with their squared distance: any sum of light x f(point) over what is visited has the mean of the sum over all points.
    ///
    /// `scalar`, a function of the squared distance, is about what f is over all lanes: it decides which nodes are opened.
    pub fn visit(&self, p: Vec3, scalar: impl Fn(f32) -> f32, mut each: impl FnMut(f32, &Point)) {
        let Some(root) = self.nodes.first() else {
            return;
        };
        // What the tree's places and weights say, never its representatives: they would bias what depends on them.
        let size = |n: &Node| {
            let d = p.distance(n.center);
            let (near, far) = ((d - n.radius).max(0.0), d + n.radius);
            (n.weight * scalar(d.max(0.5 * n.radius).powi(2)), n.weight * (scalar(near * near) - scalar(far * far)))
        };
        let mut level = vec![(0u32, size(root))];
        let mut next = Vec::with_capacity(64);
        let mut settled = 0.0f32;
        for _ in 0..LEVELS {
            let whole = settled + level.iter().map(|n| n.1.0).sum::<f32>();
            for &(i, (value, spread)) in &level {
                let node = &self.nodes[i as usize];
                if spread <= TOLERANCE * whole {
                    settled += value;
                    each(p.distance_squared(node.point.p), &node.point);
                } else if node.second == 0 {
                    settled += value;
                    self.leaf(node).iter().for_each(|point| each(p.distance_squared(point.p), point));
                } else {
                    next.extend([i + 1, node.second].map(|c| (c, size(&self.nodes[c as usize]))));
                }
            }
            level.clear();
            std::mem::swap(&mut level, &mut next);
            if level.is_empty() {
                break;
            }
        }
    }
}

impl Tree {
    fn leaf(&self, node: &Node) -> &[Point] {
        &self.points[node.first as usize..][..node.count as usize]
    }
}

/// Returns the tree over some points, which it sorts; `at` is the number of the first of them.
fn build(points: &mut [Point], at: u32, key: u64) -> Vec<Node> {
    let mut nodes = Vec::with_capacity(4 * points.len() / LEAF + 1);
    if points.len() <= ALONE {
        append(points, at, &mut nodes, &mut Stream::new(&[key, u64::from(at)]));
        return nodes;
    }
    nodes.push(Node::over(points, at));
    let (left, right) = halves(points, &nodes[0]);
    let middle = at + left.len() as u32;
    let (left, right) = rayon::join(|| build(left, at, key), || build(right, middle, key));
    let second = 1 + left.len() as u32;
    for (shift, part) in [(1, left), (second, right)] {
        nodes.extend(part.into_iter().map(|n| Node { second: if n.second == 0 { 0 } else { n.second + shift }, ..n }));
    }
    Node::join(&mut nodes, 0, second, &mut Stream::new(&[key, u64::from(at), 1]));
    nodes
}

/// Appends the tree over some points.
fn append(points: &mut [Point], at: u32, nodes: &mut Vec<Node>, rng: &mut Stream) {
    let root = nodes.len();
    nodes.push(Node::over(points, at));
    if points.len() <= LEAF {
        // One of the points, in proportion to its weight.
        let weight: f32 = points.iter().map(Point::weight).sum();
        let mut left = rng.uniform() * weight;
        let chosen = points.iter().find(|p| {
            left -= p.weight();
            left < 0.0
        });
        let chosen = chosen.unwrap_or(&points[points.len() - 1]);
        nodes[root].weight = weight;
        nodes[root].point = chosen.standing_for(weight / chosen.weight());
        return;
    }
    let (left, right) = halves(points, &nodes[root]);
    let middle = at + left.len() as u32;
    append(left, at, nodes, rng);
    let second = nodes.len() as u32;
    append(right, middle, nodes, rng);
    Node::join(nodes, root, second, rng);
}

/// Parts points at the middle of the longest axis of their box.
fn halves<'a>(points: &'a mut [Point], node: &Node) -> (&'a mut [Point], &'a mut [Point]) {
    let axis = node.axis as usize;
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a.p[axis].total_cmp(&b.p[axis]));
    points.split_at_mut(middle)
}

impl Node {
    /// Returns a leaf over points that is still without weight.
    fn over(points: &[Point], first: u32) -> Self {
        let (low, high) =
            points.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(p.p), h.max(p.p)));
        let (center, extent) = (0.5 * (low + high), high - low);
        let axis = if extent.x >= extent.y.max(extent.z) {
            0
        } else if extent.y >= extent.z {
            1
        } else {
            2
        };
        let (radius, count) = (0.5 * extent.length(), points.len() as u32);
        Self { center, radius, weight: 0.0, second: 0, first, count, axis, point: points[0] }
    }

    /// Gives a node its second child, and one of the representatives of both in proportion to what they stand for.
    fn join(nodes: &mut [Self], root: usize, second: u32, rng: &mut Stream) {
        let (a, b) = (&nodes[root + 1], &nodes[second as usize]);
        let weight = a.weight + b.weight;
        let chosen = if rng.uniform() * weight < a.weight { a } else { b };
        let point = chosen.point.standing_for(weight / chosen.weight);
        let root = &mut nodes[root];
        (root.weight, root.second, root.point) = (weight, second, point);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(n: u64, seed: u64) -> Vec<Point> {
        (0..n)
            .map(|i| {
                let mut r = Stream::new(&[seed, i]);
                let p = Vec3::new(r.uniform(), r.uniform(), 0.1 * r.uniform()) * 4.0;
                let red = if r.uniform() < 0.3 { 0.0 } else { r.uniform() };
                Point::new(p, Spectrum([red, 2.0 * r.uniform() * p.x, 0.5])).unwrap()
            })
            .collect()
    }

    #[test]
    fn sums_by_representatives_have_the_mean_of_the_full_sum_and_little_noise() {
        // Over many choices of representatives; 9 places x 3 lanes: |z| < 4.9 is a two-sided significance of 1e-6 each.
        let points = points(4000, 5);
        let kernel = |r2: f32| {
            [(-r2.sqrt()).exp(), (-2.0 * r2.sqrt()).exp(), (-5.0 * r2.sqrt()).exp() / (0.01 + r2.sqrt()), 0.0]
        };
        let scalar = |r2: f32| kernel(r2).iter().sum::<f32>() / 3.0;
        let trees: Vec<Tree> = (0..200).map(|k| Tree::new(points.clone(), k)).collect();
        for place in 0..9 {
            let p = Vec3::new((place % 3) as f32, (place / 3) as f32, 0.2);
            let exact: [f64; 3] = std::array::from_fn(|l| {
                points.iter().map(|q| f64::from(kernel(p.distance_squared(q.p))[l] * q.light[l])).sum()
            });
            for (l, &exact) in exact.iter().enumerate() {
                let x: Vec<f64> = trees.iter().map(|t| f64::from(t.gather(p, kernel, scalar)[l]) / exact).collect();
                let n = x.len() as f64;
                let mean = x.iter().sum::<f64>() / n;
                let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
                let z = (mean - 1.0) / (variance / n).sqrt();
                assert!(z.abs() < 4.9, "place {place}, lane {l}: mean {mean}, z {z}");
                // Some 50 nodes of up to 10 % each: 0.1 sqrt(50) / sqrt(12) = 0.2; colours that are not alike add to it.
                assert!(variance.sqrt() < 0.4, "place {place}, lane {l}: noise {}", variance.sqrt());
            }
        }
    }

    #[test]
    fn nothing_comes_of_no_points_and_all_of_one() {
        assert_eq!(Tree::new(vec![], 1).gather(Vec3::ZERO, |_| [1.0; 4], |_| 1.0), [0.0; 4]);
        let one = Point::new(Vec3::X, Spectrum([2.0f32])).unwrap();
        let dark = Point::new(Vec3::Y, Spectrum([0.0f32])).unwrap();
        assert_eq!(
            Tree::new(vec![dark, one], 1).gather(Vec3::ZERO, |r2| [3.0 * r2; 4], |r2| 3.0 * r2),
            [6.0, 0.0, 0.0, 0.0]
        );
        assert!(Point::new(Vec3::X, Spectrum([f32::NAN])).is_none());
    }
}
