//! The light tree: chooses one of many lights with a probability that follows what they can do to a point.
//!
//! A binary tree over [`LightBounds`]; a choice walks down, at each node taking a child in proportion to its importance. The
//! same walk along the stored way to a leaf gives the exact probability of that leaf. *Source*: \[Conty2018\].

use moonmilk_core::Vec3;

use super::bounds::{LightBounds, Reach};

/// Buckets per axis when a node is split; more of them cost build time and gain nothing measurable.
const BUCKETS: usize = 12;
/// From this depth on nodes are split in the middle, so that the way to a leaf fits into 64 bits.
const DEEP: u32 = 32;

/// A light tree over the lights with positive intensity.
#[derive(Debug, Default)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// The way from the root to each light, one bit per level, lowest first; `None` if the light is not in the tree.
    ways: Vec<Option<u64>>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    reach: Reach,
    /// Number of the first of two adjacent children, or of the light.
    index: u32,
    leaf: bool,
}

impl LightTree {
    /// Builds the tree; light i has bounds `lights[i]`, or none if it does not belong here.
    pub fn new(lights: &[Option<LightBounds>]) -> Self {
        let mut items: Vec<(u32, LightBounds)> =
            (0u32..).zip(lights).filter_map(|(i, b)| b.filter(|b| b.intensity > 0.0).map(|b| (i, b))).collect();
        let mut tree = Self { nodes: Vec::with_capacity(2 * items.len()), ways: vec![None; lights.len()] };
        if let Some(bounds) = items.iter().map(|i| i.1).reduce(|a, b| a.union(&b)) {
            tree.nodes.push(Node { reach: Reach::new(&bounds), index: 0, leaf: true });
            tree.build(0, &mut items, &bounds, 0, 0);
        }
        tree
    }

    /// Returns whether no light is in the tree.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Fills in node `at` for lights of given common bounds, reached by the bits `way` of `depth` levels.
    fn build(&mut self, at: usize, items: &mut [(u32, LightBounds)], bounds: &LightBounds, way: u64, depth: u32) {
        if let [(light, _)] = items {
            self.nodes[at].index = *light;
            self.ways[*light as usize] = Some(way);
            return;
        }
        let middle = if depth < DEEP { split(items, bounds) } else { items.len() / 2 };
        let (left, right) = items.split_at_mut(middle);
        let child = self.nodes.len();
        self.nodes[at].index = child as u32;
        self.nodes[at].leaf = false;
        let both = [&*left, &*right]
            .map(|half| half.iter().map(|i| i.1).reduce(|a, b| a.union(&b)).expect("both halves hold lights"));
        self.nodes.extend(both.iter().map(|b| Node { reach: Reach::new(b), index: 0, leaf: true }));
        self.build(child, left, &both[0], way, depth + 1);
        self.build(child + 1, right, &both[1], way | (1 << depth), depth + 1);
    }

    /// Returns the way to a light, see `ways`.
    #[cfg(test)]
    pub fn way(&self, light: u32) -> Option<u64> {
        self.ways[light as usize]
    }

    /// Returns the importance of all lights together at a point: an estimate of irradiance, 0 if none can contribute.
    pub fn importance(&self, p: Vec3, n: Option<Vec3>) -> f32 {
        self.nodes.first().map_or(0.0, |root| root.reach.importance(p, n))
    }

    /// Chooses a light for a variate u in \[0, 1), and returns its number and probability.
    ///
    /// `None` where no light can contribute, which a node may find only after its parent was taken.
    pub fn sample(&self, p: Vec3, n: Option<Vec3>, mut u: f64) -> Option<(u32, f32)> {
        if self.importance(p, n) == 0.0 {
            return None;
        }
        let mut at = 0;
        let mut probability = 1.0f64;
        loop {
            let node = &self.nodes[at];
            if node.leaf {
                return Some((node.index, probability as f32));
            }
            let [left, right] = self.shares(node, p, n)?;
            if u < left || right == 0.0 {
                u /= left;
                probability *= left;
                at = node.index as usize;
            } else {
                u = (u - left) / right;
                probability *= right;
                at = node.index as usize + 1;
            }
        }
    }

    /// Returns the probability with which [`LightTree::sample`] chooses a light.
    pub fn probability(&self, p: Vec3, n: Option<Vec3>, light: u32) -> f32 {
        let Some(mut way) = self.ways.get(light as usize).copied().flatten() else {
            return 0.0;
        };
        if self.importance(p, n) == 0.0 {
            return 0.0;
        }
        let mut at = 0;
        let mut probability = 1.0f64;
        loop {
            let node = &self.nodes[at];
            if node.leaf {
                return probability as f32;
            }
            let Some(shares) = self.shares(node, p, n) else {
                return 0.0;
            };
            let side = (way & 1) as usize;
            probability *= shares[side];
            if probability == 0.0 {
                return 0.0;
            }
            at = node.index as usize + side;
            way >>= 1;
        }
    }

    /// Returns the probabilities of the two children of a node; `None` if neither can contribute.
    ///
    /// In f64, so that a child 1e8 times weaker than its sibling is rare and not lost.
    #[inline]
    fn shares(&self, node: &Node, p: Vec3, n: Option<Vec3>) -> Option<[f64; 2]> {
        let i = node.index as usize;
        let [a, b] = [i, i + 1].map(|i| f64::from(self.nodes[i].reach.importance(p, n)));
        if a == 0.0 && b == 0.0 {
            return None;
        }
        // A point that lies on a light has no finite importance: take either side.
        let sum = a + b;
        Some(if sum.is_finite() { [a / sum, b / sum] } else { [0.5, 0.5] })
    }
}

/// Orders the lights into two groups of least cost and returns the size of the first, at least 1 and less than all.
fn split(items: &mut [(u32, LightBounds)], bounds: &LightBounds) -> usize {
    let (lo, hi) = items
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), (_, b)| (lo.min(b.centroid()), hi.max(b.centroid())));
    let extent = bounds.max - bounds.min;
    let bucket = |b: &LightBounds, axis: usize| {
        let x = (b.centroid()[axis] - lo[axis]) / (hi[axis] - lo[axis]);
        ((x * BUCKETS as f32) as usize).min(BUCKETS - 1)
    };
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in 0..3 {
        if hi[axis] <= lo[axis] {
            continue;
        }
        let mut buckets: [Option<LightBounds>; BUCKETS] = [None; BUCKETS];
        for (_, b) in items.iter() {
            let slot = &mut buckets[bucket(b, axis)];
            *slot = Some(slot.map_or(*b, |s| s.union(b)));
        }
        let join = |a: Option<LightBounds>, b: Option<LightBounds>| match (a, b) {
            (Some(a), Some(b)) => Some(a.union(&b)),
            (a, b) => a.or(b),
        };
        // Discourage slices across a thin axis.
        let thin = f64::from(extent.max_element() / extent[axis]);
        let mut after = [0.0; BUCKETS];
        let mut group = None;
        for i in (1..BUCKETS).rev() {
            group = join(group, buckets[i]);
            after[i] = group.map_or(0.0, |g: LightBounds| g.cost());
        }
        group = None;
        for i in 0..BUCKETS - 1 {
            group = join(group, buckets[i]);
            let cost = thin * (group.map_or(0.0, |g: LightBounds| g.cost()) + after[i + 1]);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, i));
            }
        }
    }
    let half = items.len() / 2;
    let Some((_, axis, last)) = best else {
        return half;
    };
    items.sort_by_key(|(_, b)| bucket(b, axis) > last);
    let middle = items.partition_point(|(_, b)| bucket(b, axis) <= last);
    if middle == 0 || middle == items.len() { half } else { middle }
}
