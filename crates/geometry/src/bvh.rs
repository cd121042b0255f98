//! The bounding volume hierarchy: obvhs builds and traverses it, our node test keeps it watertight.
//!
//! obvhs' own box test starts at an absolute distance of 1e-4, takes the reciprocal of small direction components as
//! 2^23 and has no margin for rounding, so it loses hits near the origin, in small scenes and at box edges. Ours is
//! `hit_children`: every bound is moved outward by `MARGIN` times the coordinates that enter it, which covers
//! the rounding of the box test and of the triangle test at any scale.
//!
//! Large scenes are cut into eight parts of equal size that are built on their own (in parallel, with an eighth of the
//! transient memory) and joined under a root node.

use moonmilk_core::Vec3;
use moonmilk_core::glam::{UVec2, UVec3, Vec3A};
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::cwbvh::{CwBvh, Traversal};
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use obvhs::traverse;
use rayon::prelude::*;
use wide::{f32x8, i16x8, i32x8, u8x16};

use crate::bounds::Bounds;

/// Margin of the box test relative to the distances in it. A projected corner carries at most 12 roundings of 2^-24
/// (subtraction, three products, two sums, and the frame's own deviation), the box test 5, the quantisation of boxes 16.
const MARGIN: f32 = 1.0 / 524_288.0;
/// Smallest magnitude of a direction component in the box test: over any length f32 can tell from the rest of the ray
/// the deviation is far below [`MARGIN`].
const MIN_COMPONENT: f32 = 1e-18;
/// obvhs' traversal stack; a deeper tree is rebuilt from medians.
const MAX_DEPTH: usize = 32;
/// Parts above this size are cut into eight.
const PART: usize = 1 << 18;

/// What the box test needs of a ray.
pub(crate) struct BoxRay {
    pub(crate) o: Vec3A,
    pub(crate) d: Vec3A,
    inv: Vec3A,
    negative: [bool; 3],
    /// Boxes behind this distance do not count; may be below 0.
    t_low: f32,
}

impl BoxRay {
    #[inline(always)]
    pub(crate) fn new(o: Vec3, d: Vec3, t_low: f32) -> Self {
        // Adding zero turns -0.0 into 0.0, so that sign tests and octants agree.
        let d = Vec3A::from(d) + Vec3A::ZERO;
        let component = |x: f32| 1.0 / if x.abs() < MIN_COMPONENT { MIN_COMPONENT.copysign(x) } else { x };
        Self {
            o: o.into(),
            d,
            inv: Vec3A::new(component(d.x), component(d.y), component(d.z)),
            negative: [d.x < 0.0, d.y < 0.0, d.z < 0.0],
            t_low,
        }
    }
}

/// Converts eight bytes to eight lanes.
#[inline(always)]
fn lanes(q: &[u8; 8]) -> f32x8 {
    let mut bytes = [0; 16];
    bytes[..8].copy_from_slice(q);
    i32x8::from_i16x8(i16x8::from_u8x16_low(u8x16::new(bytes))).round_float()
}

/// Returns obvhs' hit mask of the children that a ray may meet before `t_max`.
#[inline(always)]
pub(crate) fn hit_children(node: &CwBvhNode, ray: &BoxRay, t_max: f32, oct_inv4: u32) -> u32 {
    // Planes are p + q e with bytes q; their distances are q (e inv) + (p - o) inv, moved outward by the margin.
    let e = node.compute_extent();
    let base = Vec3A::from(node.p) - ray.o;
    let reach = base.abs().max_element() + 255.0 * e.max_element();
    let slack = ray.inv.abs() * (reach * MARGIN);
    let (scale, base) = (e * ray.inv, base * ray.inv);
    let (low, high) = (base - slack, base + slack);

    let planes = |negative: bool, min, max, scale: f32, low: f32, high: f32| {
        let (near, far) = if negative { (max, min) } else { (min, max) };
        let scale = f32x8::splat(scale);
        (lanes(near).mul_add(scale, f32x8::splat(low)), lanes(far).mul_add(scale, f32x8::splat(high)))
    };
    let (x0, x1) = planes(ray.negative[0], &node.child_min_x, &node.child_max_x, scale.x, low.x, high.x);
    let (y0, y1) = planes(ray.negative[1], &node.child_min_y, &node.child_max_y, scale.y, low.y, high.y);
    let (z0, z1) = planes(ray.negative[2], &node.child_min_z, &node.child_max_z, scale.z, low.z, high.z);
    let near = x0.fast_max(y0).fast_max(z0.fast_max(f32x8::splat(ray.t_low)));
    let far = x1.fast_min(y1).fast_min(z1.fast_min(f32x8::splat(t_max)));
    let mut mask = near.simd_le(far).to_bitmask();

    // Gather the bits in obvhs' order: internal children by octant priority, leaves by primitive.
    let (child_bits, bit_index) = node.get_child_and_index_bits(oct_inv4);
    let mut hits = 0;
    while mask != 0 {
        let shift = mask.trailing_zeros() * 8;
        hits |= ((child_bits >> shift) as u32 & 0xff) << ((bit_index >> shift) as u32 & 0x1f);
        mask &= mask - 1;
    }
    hits
}

/// Visits the leaves that a ray may meet, nearest octant first; `visit` gets a position in leaf order and the current
/// `t_max`, which it may lower, and returns whether to stop. Returns whether it stopped.
#[inline(always)]
pub(crate) fn traverse_ray(
    bvh: &CwBvh,
    ray: &BoxRay,
    mut t_max: f32,
    mut visit: impl FnMut(u32, &mut f32) -> bool,
) -> bool {
    let mut state: Traversal = bvh.new_traversal(ray.d);
    let mut node;
    'all: {
        traverse!(bvh, node, state, hit_children(node, ray, t_max, state.oct_inv4), {
            if visit(state.primitive_id, &mut t_max) {
                break 'all true;
            }
        });
        false
    }
}

/// A box and its number in 28 bytes, to keep the build small.
#[derive(Clone, Copy)]
struct Item {
    bounds: Bounds,
    id: u32,
}

impl Boundable for Item {
    fn aabb(&self) -> Aabb {
        Aabb::new(self.bounds.min.into(), self.bounds.max.into())
    }
}

/// How much work goes into the tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Neighbours on each side that PLOC looks at.
    pub search: Search,
    /// Share of nodes that are candidates for reinsertion.
    pub reinsertion: f32,
    /// Largest number of primitives in a leaf: 1 to 3.
    pub leaf: u32,
}

/// Search distance of PLOC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Search {
    /// 1 neighbour.
    Minimum,
    /// 6 neighbours.
    Low,
    /// 14 neighbours.
    Medium,
}

impl Default for Quality {
    fn default() -> Self {
        Self { search: Search::Low, reinsertion: 0.02, leaf: 3 }
    }
}

/// Builds the hierarchy over boxes; `primitive_indices` of the result are positions in `boxes`.
pub(crate) fn build(boxes: &[Bounds], quality: Quality) -> CwBvh {
    let mut items: Vec<Item> = boxes.iter().enumerate().map(|(id, &bounds)| Item { bounds, id: id as u32 }).collect();
    let mut bvh = build_part(&mut items, quality, PART);
    if depth(&bvh, 0) > MAX_DEPTH {
        // Coincident primitives can make a clustered tree arbitrarily deep; medians cannot.
        bvh = build_part(&mut items, quality, 64);
    }
    bvh.nodes.shrink_to_fit();
    bvh
}

fn build_part(items: &mut [Item], quality: Quality, part: usize) -> CwBvh {
    if items.len() > part {
        let (parts, boxes) = eighths(items);
        let built: Vec<CwBvh> = parts.into_par_iter().map(|p| build_part(p, quality, part)).collect();
        return join(built, boxes);
    }
    let search = match quality.search {
        Search::Minimum => PlocSearchDistance::Minimum,
        Search::Low => PlocSearchDistance::Low,
        Search::Medium => PlocSearchDistance::Medium,
    };
    let order = (0..items.len() as u32).collect();
    let mut bvh2 = PlocBuilder::with_capacity(items.len()).build(search, items, order, SortPrecision::U64, 2);
    ReinsertionOptimizer::default().run(&mut bvh2, quality.reinsertion, None);
    let mut bvh = bvh2_to_cwbvh(&bvh2, quality.leaf.clamp(1, 3), true, false);
    drop(bvh2);
    bvh.nodes.shrink_to_fit();
    bvh.primitive_indices.iter_mut().for_each(|i| *i = items[*i as usize].id);
    bvh
}

/// Cuts items three times at the median of the longest side of their midpoints.
fn eighths(items: &mut [Item]) -> (Vec<&mut [Item]>, Vec<Bounds>) {
    let mut parts = vec![items];
    for _ in 0..3 {
        parts = parts
            .into_iter()
            .flat_map(|p| {
                let (a, b) = halves(p);
                [a, b]
            })
            .collect();
    }
    let boxes = parts.iter().map(|p| p.iter().fold(Bounds::EMPTY, |b, i| b.union(i.bounds))).collect();
    (parts, boxes)
}

fn halves(items: &mut [Item]) -> (&mut [Item], &mut [Item]) {
    let side = Bounds::of(items.iter().map(|i| i.bounds.center())).extent();
    let axis = if side.x >= side.y.max(side.z) {
        0
    } else if side.y >= side.z {
        1
    } else {
        2
    };
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| a.bounds.center()[axis].total_cmp(&b.bounds.center()[axis]));
    items.split_at_mut(middle)
}

/// Joins eight trees under a root node.
fn join(parts: Vec<CwBvh>, boxes: Vec<Bounds>) -> CwBvh {
    let all = boxes.iter().fold(Bounds::EMPTY, |a, &b| a.union(b));

    // Quantise the children's boxes: powers of two per axis, rounded outward.
    let exponent = |length: f32| {
        let mut e = 1e-20f32.max(length / 255.0).to_bits() >> 23;
        while f32::from_bits(e << 23) * 255.0 < length {
            e += 1;
        }
        e
    };
    let e = UVec3::from_array(all.extent().to_array().map(exponent));
    let unit = Vec3::from_array(e.to_array().map(|e| f32::from_bits(e << 23)));
    let mut root = CwBvhNode {
        p: all.min,
        e: e.to_array().map(|e| e as u8),
        imask: 0xff,
        child_base_idx: 1,
        ..CwBvhNode::default()
    };

    // Give each child the slot whose octant it lies in, cheapest first.
    let mut slots = [usize::MAX; 8];
    let cost = |part: usize, slot: usize| {
        let v = boxes[part].center() - all.center();
        let sign = |bit: usize| if slot & bit != 0 { -1.0 } else { 1.0 };
        v.x * sign(4) + v.y * sign(2) + v.z * sign(1)
    };
    for _ in 0..8 {
        let free = (0..8).filter(|p| !slots.contains(p));
        let pairs = free.flat_map(|p| (0..8).map(move |s| (p, s))).filter(|&(_, s)| slots[s] == usize::MAX);
        if let Some((p, s)) = pairs.min_by(|a, b| cost(a.0, a.1).total_cmp(&cost(b.0, b.1))) {
            slots[s] = p;
        }
    }
    for (s, &p) in slots.iter().enumerate() {
        let low = ((boxes[p].min - all.min) / unit).floor().clamp(Vec3::ZERO, Vec3::splat(255.0));
        let high = ((boxes[p].max - all.min) / unit).ceil().clamp(Vec3::ZERO, Vec3::splat(255.0));
        root.child_meta[s] = (24 + s as u8) | 0b0010_0000;
        (root.child_min_x[s], root.child_min_y[s], root.child_min_z[s]) = (low.x as u8, low.y as u8, low.z as u8);
        (root.child_max_x[s], root.child_max_y[s], root.child_max_z[s]) = (high.x as u8, high.y as u8, high.z as u8);
    }

    // Lay out: root, the eight former roots, then what each part had behind its root.
    let mut nodes = Vec::with_capacity(1 + parts.iter().map(|p| p.nodes.len()).sum::<usize>());
    let mut primitive_indices = Vec::with_capacity(parts.iter().map(|p| p.primitive_indices.len()).sum());
    nodes.push(root);
    let (mut behind, mut prims) = (9u32, 0u32);
    let mut offsets = [(0, 0); 8];
    for (s, &p) in slots.iter().enumerate() {
        offsets[s] = (behind - 1, prims);
        behind += parts[p].nodes.len() as u32 - 1;
        prims += parts[p].primitive_indices.len() as u32;
    }
    let moved = |node: &CwBvhNode, (n, p): (u32, u32)| CwBvhNode {
        child_base_idx: node.child_base_idx + n,
        primitive_base_idx: node.primitive_base_idx + p,
        ..*node
    };
    nodes.extend(slots.iter().zip(offsets).map(|(&p, o)| moved(&parts[p].nodes[0], o)));
    for (&p, o) in slots.iter().zip(offsets) {
        nodes.extend(parts[p].nodes[1..].iter().map(|n| moved(n, o)));
        primitive_indices.extend_from_slice(&parts[p].primitive_indices);
    }
    let total_aabb = Aabb::new(all.min.into(), all.max.into());
    CwBvh { nodes, primitive_indices, total_aabb, exact_node_aabbs: None, uses_spatial_splits: false }
}

/// Returns the number of levels of nodes below and with a node.
fn depth(bvh: &CwBvh, node: u32) -> usize {
    let n = &bvh.nodes[node as usize];
    let inner = (0..8).filter(|&c| !n.is_child_empty(c) && !n.is_leaf(c));
    1 + inner.map(|c| depth(bvh, n.child_node_index(c))).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Random, Stream};

    fn boxes(n: usize) -> Vec<Bounds> {
        let mut r = Stream::new(&[4]);
        let mut point = || Vec3::new(r.uniform(), r.uniform(), r.uniform());
        (0..n)
            .map(|_| {
                let p = point();
                Bounds::of([p, p + point() * 0.02])
            })
            .collect()
    }

    /// Leaves whose box the ray meets, by brute force in f64 and by traversal.
    fn compare(bvh: &CwBvh, boxes: &[Bounds], o: Vec3, d: Vec3) -> (usize, usize) {
        let mut seen = vec![false; boxes.len()];
        traverse_ray(bvh, &BoxRay::new(o, d, 0.0), f32::INFINITY, |i, _| {
            seen[bvh.primitive_indices[i as usize] as usize] = true;
            false
        });
        let meets = |b: &Bounds| {
            let (mut near, mut far) = (0f64, f64::INFINITY);
            for k in 0..3 {
                let (o, d) = (f64::from(o[k]), f64::from(d[k]));
                let (a, b) = (f64::from(b.min[k]) - o, f64::from(b.max[k]) - o);
                if d == 0.0 {
                    if a > 0.0 || b < 0.0 {
                        return false;
                    }
                } else {
                    near = near.max((a / d).min(b / d));
                    far = far.min((a / d).max(b / d));
                }
            }
            near <= far
        };
        let met: Vec<usize> = (0..boxes.len()).filter(|&i| meets(&boxes[i])).collect();
        (met.len(), met.iter().filter(|&&i| seen[i]).count())
    }

    #[test]
    fn no_box_on_a_ray_is_missed_in_one_tree_or_in_joined_parts() {
        let boxes = boxes(3000);
        let mut items: Vec<Item> =
            boxes.iter().enumerate().map(|(id, &bounds)| Item { bounds, id: id as u32 }).collect();
        let mut r = Stream::new(&[5]);
        for bvh in [build(&boxes, Quality::default()), build_part(&mut items, Quality::default(), 300)] {
            assert_eq!(bvh.primitive_indices.len(), 3000);
            let mut total = 0;
            for i in 0..2000 {
                // Through a corner of a box, from outside or inside, some axis-parallel with negative zeros.
                let target = boxes[i % 3000].min;
                let mut d = Vec3::new(r.uniform() - 0.5, r.uniform() - 0.5, r.uniform() - 0.5);
                if i % 3 == 0 {
                    d = [Vec3::new(-0.0, -0.0, 1.0), Vec3::new(0.0, -1.0, -0.0), Vec3::new(-1.0, 0.0, 0.0)][i / 3 % 3];
                }
                let d = d.normalize();
                let (met, found) = compare(&bvh, &boxes, target - d * r.uniform(), d);
                assert_eq!(met, found, "ray {i}");
                total += met;
            }
            assert!(total > 500, "{total}");
        }
    }

    #[test]
    fn coincident_primitives_stay_within_the_traversal_stack() {
        let b = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
        let bvh = build(&vec![b; 20_000], Quality::default());
        assert!(depth(&bvh, 0) <= MAX_DEPTH);
        let mut n = 0;
        traverse_ray(&bvh, &BoxRay::new(Vec3::splat(0.5), Vec3::X, 0.0), f32::INFINITY, |_, _| {
            n += 1;
            false
        });
        assert_eq!(n, 20_000);
    }
}
