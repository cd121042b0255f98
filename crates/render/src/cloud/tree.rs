//! Sums over many points, near ones one by one and far ones by representatives.

use moonmilk_core::{Random, Spectrum, Stream, Vec3};

/// Largest uncertainty of a node that is not opened, as a share of the whole sum.
const TOLERANCE: f32 = 0.1;
/// Levels of the tree that a sum may use; more than points can have.
const LEVELS: usize = 40;

/// A point of a surface and the light that enters there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    p: Vec3,
    light: [f32; 4],
}

impl Point {
    /// Returns a point; `None` if its light is not finite.
    pub fn new<const N: usize>(p: Vec3, light: Spectrum<N>) -> Option<Self> {
        let light = std::array::from_fn(|k| if k < N { light[k] } else { 0.0 });
        light.iter().all(|l: &f32| l.is_finite()).then_some(Self { p, light })
    }

    fn weight(&self) -> f32 {
        self.light.iter().map(|l| l.abs()).sum()
    }
}

/// Some points, and one of them that stands for all.
#[derive(Clone, Copy, Debug)]
struct Node {
    center: Vec3,
    radius: f32,
    /// Sum of the points' weights.
    weight: f32,
    /// Number of the second child, the first being the next node; 0 for a single point.
    second: u32,
    /// The representative, its light divided by its probability.
    point: Point,
}

/// A tree over points.
#[derive(Debug)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
}

impl Tree {
    /// Makes a tree; `key` names the random numbers that choose representatives.
    pub fn new(mut points: Vec<Point>, key: u64) -> Self {
        points.retain(|p| p.weight() > 0.0);
        let mut nodes = Vec::with_capacity(2 * points.len());
        if !points.is_empty() {
            build(&mut points, &mut nodes, &mut Stream::new(&[key]));
        }
        Self { nodes }
    }

    /// Returns the sum of light x kernel over all points, an estimate without bias; the kernels are functions of the squared distance.
    ///
    /// `scalar` is what `kernel` is over all lanes: it decides which nodes are opened.
    pub fn gather(&self, p: Vec3, kernel: impl Fn(f32) -> [f32; 4], scalar: impl Fn(f32) -> f32) -> [f32; 4] {
        let mut sum = [0.0f32; 4];
        let Some(root) = self.nodes.first() else {
            return sum;
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
                if node.second == 0 || spread <= TOLERANCE * whole {
                    settled += value;
                    let k = kernel(p.distance_squared(node.point.p));
                    (0..4).for_each(|l| sum[l] += k[l] * node.point.light[l]);
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
        sum
    }
}

/// Appends the tree over some points.
fn build(points: &mut [Point], nodes: &mut Vec<Node>, rng: &mut Stream) {
    let at = nodes.len();
    let (low, high) = points.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(p.p), h.max(p.p)));
    let (center, extent) = (0.5 * (low + high), high - low);
    nodes.push(Node { center, radius: 0.5 * extent.length(), weight: points[0].weight(), second: 0, point: points[0] });
    if points.len() == 1 {
        return;
    }
    let axis = if extent.x >= extent.y.max(extent.z) {
        0
    } else if extent.y >= extent.z {
        1
    } else {
        2
    };
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a.p[axis].total_cmp(&b.p[axis]));
    let (left, right) = points.split_at_mut(middle);
    build(left, nodes, rng);
    let second = nodes.len();
    build(right, nodes, rng);
    // One of the two representatives, in proportion to what they stand for.
    let (a, b) = (nodes[at + 1], nodes[second]);
    let weight = a.weight + b.weight;
    let (chosen, own) = if rng.uniform() * weight < a.weight { (a.point, a.weight) } else { (b.point, b.weight) };
    nodes[at].weight = weight;
    nodes[at].second = second as u32;
    nodes[at].point = Point { light: chosen.light.map(|l| l * (weight / own)), ..chosen };
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
