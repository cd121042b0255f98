//! Searches through a hierarchy that are not rays: the nearest things to a point, and all things in a box.

use moonmilk_core::Vec3;
use obvhs::cwbvh::CwBvh;

use crate::bounds::Bounds;

/// Entries of the search stack: 7 per level of a tree of at most 32 levels, and one more.
const STACK: usize = 7 * 32 + 1;
/// Boxes are off by roundings of their coordinates; the margin is that of the ray test.
const MARGIN: f32 = 2e-6;

/// Visits the leaves within a limit that the visitor may lower, nearest boxes first.
///
/// Distances to boxes are multiplied by `stretch` before they are compared with the limit.
pub(crate) fn nearest_first(bvh: &CwBvh, p: Vec3, stretch: f32, limit: &mut f32, mut visit: impl FnMut(u32, &mut f32)) {
    let mut stack = [(0f32, 0u32); STACK];
    let mut len = 1;
    while len > 0 {
        len -= 1;
        let (near, index) = stack[len];
        if near > *limit {
            continue;
        }
        let node = &bvh.nodes[index as usize];
        let mut inner = [(0f32, 0u32); 8];
        let mut count = 0;
        for child in (0..8).filter(|&c| !node.is_child_empty(c)) {
            let b = node.child_aabb(child);
            let distance = (p - p.clamp(b.min.into(), b.max.into())).length();
            let distance = stretch * (distance - MARGIN * (distance + b.max.abs().max(b.min.abs()).max_element()));
            if distance > *limit {
                continue;
            }
            if node.is_leaf(child) {
                let (first, n) = node.child_primitives(child);
                (first..first + n).for_each(|i| visit(i, limit));
            } else {
                inner[count] = (distance, node.child_node_index(child));
                count += 1;
            }
        }
        // Push the farthest first.
        inner[..count].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        stack[len..len + count].copy_from_slice(&inner[..count]);
        len += count;
    }
}

/// Visits the leaves of all boxes that `enter` lets in, outer boxes first; boxes are wider than what they hold by their rounding.
pub(crate) fn in_boxes(bvh: &CwBvh, mut enter: impl FnMut(&Bounds) -> bool, mut visit: impl FnMut(u32)) {
    let mut stack = vec![0u32];
    while let Some(index) = stack.pop() {
        let node = &bvh.nodes[index as usize];
        for child in (0..8).filter(|&c| !node.is_child_empty(c)) {
            let b = node.child_aabb(child);
            let b = Bounds { min: b.min.into(), max: b.max.into() };
            if !enter(&b.grown(MARGIN * b.magnitude())) {
                continue;
            }
            if node.is_leaf(child) {
                let (first, n) = node.child_primitives(child);
                (first..first + n).for_each(&mut visit);
            } else {
                stack.push(node.child_node_index(child));
            }
        }
    }
}
