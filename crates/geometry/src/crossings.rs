//! Where a mesh cuts itself, and triangles that stand twice.
//!
//! Two triangles cut each other exactly if an edge of one pierces the other, coplanar ones apart. So every edge is sent
//! through the hierarchy as a ray of its length; what it meets is checked in f64. An edge counts as piercing if both ends
//! are farther from the triangle's plane than coordinates are certain: parts that touch do not cut.

use std::collections::HashSet;

use moonmilk_core::Vec3;
use moonmilk_core::glam::DVec3;
use rayon::prelude::*;

use crate::accel::Accel;
use crate::mesh::Mesh;
use crate::ray::Ray;
use crate::topology::weld;

/// Depth below which a cut is a contact, in units of the largest coordinate: 8 spacings of f32.
const CONTACT: f64 = 8.0 / 8_388_608.0;

/// Edges tested at a time: after each batch the search ends if enough is known.
const BATCH: usize = 1 << 18;

/// Pairs of triangles that cut each other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crossings {
    /// Pairs of triangles, the smaller number first, each once, in order; one of them has an edge that pierces the other.
    pub pairs: Vec<[u32; 2]>,
    /// A point on each cut.
    pub points: Vec<Vec3>,
    /// Whether the search ended early, at the limit asked for.
    pub more: bool,
}

/// Triangles over the same three positions as an earlier one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Duplicates {
    /// Number of those wound like the earlier one.
    pub same: usize,
    /// Number of those wound against it: two walls back to back.
    pub opposite: usize,
    /// The first of them.
    pub first: Option<u32>,
}

impl Mesh {
    /// Returns the pairs of triangles that cut each other, about `limit` of them at most; O(n log n) for a mesh of sane triangles.
    ///
    /// Triangles with a vertex position in common are not compared. *Accuracy*: cuts less than 8 spacings of f32 deep, at the mesh's
    /// largest coordinate, are contacts and do not count; a cut whose edges only meet edges may be missed.
    pub fn crossings(&self, limit: usize) -> Crossings {
        let weld = weld(self.positions());
        let corners = |t: u32| self.indices()[t as usize].map(|v| weld[v as usize]);
        let accel = Accel::build(vec![self.clone().into()]);
        let contact = CONTACT * f64::from(self.bounds().magnitude());

        // Sort the edges, so that each is sent once for all triangles along it.
        let mut edges: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * self.indices().len());
        for t in 0..self.indices().len() as u32 {
            let [a, b, c] = corners(t);
            edges.extend([(a, b), (b, c), (c, a)].map(|(a, b)| (a.min(b), a.max(b), t)));
        }
        edges.par_sort_unstable();
        let groups: Vec<&[(u32, u32, u32)]> = edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).collect();

        let mut found: Vec<([u32; 2], [f32; 3])> = Vec::new();
        let mut more = false;
        for batch in groups.chunks(BATCH) {
            let part = batch.par_iter().flat_map_iter(|group| {
                let (from, to, _) = group[0];
                let (p, q) = (self.positions()[from as usize], self.positions()[to as usize]);
                let mut cuts = Vec::new();
                if let Some(d) = (q - p).try_normalize() {
                    accel.all_hits(&Ray::new(p, d).up_to(p.distance(q)), |hit| {
                        let t = corners(hit.index);
                        if t.contains(&from) || t.contains(&to) {
                            return;
                        }
                        if let Some(at) = pierces(p, q, self.corners(hit.index), contact) {
                            let apart = group.iter().filter(|own| !corners(own.2).iter().any(|v| t.contains(v)));
                            let pair = |own: u32| [own.min(hit.index), own.max(hit.index)];
                            cuts.extend(apart.map(|own| (pair(own.2), at.as_vec3().to_array())));
                        }
                    });
                }
                cuts
            });
            found.par_extend(part);
            if found.len() >= limit {
                more = batch.as_ptr_range().end != groups.as_ptr_range().end;
                break;
            }
        }
        found.sort_unstable_by_key(|f| f.0);
        found.dedup_by_key(|f| f.0);
        let (pairs, points) = found.into_iter().map(|(pair, at)| (pair, Vec3::from_array(at))).unzip();
        Crossings { pairs, points, more }
    }

    /// Returns the number of triangles over the same positions as an earlier one.
    pub fn duplicates(&self) -> Duplicates {
        let weld = weld(self.positions());
        let mut seen: HashSet<[u32; 3]> = HashSet::with_capacity(self.indices().len());
        let mut duplicates = Duplicates::default();
        for (i, t) in self.indices().iter().enumerate() {
            // Turn the smallest number to the front: equal lists are equal windings.
            let [a, b, c] = t.map(|v| weld[v as usize]);
            let turned = if a < b && a < c {
                [a, b, c]
            } else if b < c {
                [b, c, a]
            } else {
                [c, a, b]
            };
            let [a, b, c] = turned;
            let (same, opposite) = (seen.contains(&turned), seen.contains(&[a, c, b]));
            if same || opposite {
                duplicates.first = duplicates.first.or(Some(i as u32));
            }
            duplicates.same += usize::from(same);
            duplicates.opposite += usize::from(opposite && !same);
            seen.insert(turned);
        }
        duplicates
    }
}

/// Returns where the segment from p to q pierces a triangle; `None` if it does not, or an end is within `contact` of its plane.
fn pierces(p: Vec3, q: Vec3, corners: [Vec3; 3], contact: f64) -> Option<DVec3> {
    let (p, q) = (p.as_dvec3(), q.as_dvec3());
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let n = (b - a).cross(c - a).try_normalize()?;
    let (above, below) = ((p - a).dot(n), (q - a).dot(n));
    if above.abs() <= contact || below.abs() <= contact || (above > 0.0) == (below > 0.0) {
        return None;
    }
    let at = p + (q - p) * (above / (above - below));
    let inside = [(a, b), (b, c), (c, a)].into_iter().all(|(u, v)| {
        // Distance of the point from the edge's line, inward.
        let edge = v - u;
        n.cross(edge).dot(at - u) > contact * edge.length()
    });
    inside.then_some(at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{bumpy_sphere, cuboid, sheet};

    /// Two triangles cut each other if an edge of one pierces the other, tested pair by pair.
    fn by_brute_force(m: &Mesh) -> Vec<[u32; 2]> {
        let contact = CONTACT * f64::from(m.bounds().magnitude());
        let weld = weld(m.positions());
        let n = m.indices().len() as u32;
        let mut pairs = Vec::new();
        for i in 0..n {
            for j in i + 1..n {
                let [a, b] = [i, j].map(|t| m.indices()[t as usize].map(|v| weld[v as usize]));
                if a.iter().any(|v| b.contains(v)) {
                    continue;
                }
                let cuts = |x: u32, y: u32| {
                    let c = m.corners(x);
                    [(0, 1), (1, 2), (2, 0)].iter().any(|&(k, l)| pierces(c[k], c[l], m.corners(y), contact).is_some())
                };
                if cuts(i, j) || cuts(j, i) {
                    pairs.push([i, j]);
                }
            }
        }
        pairs
    }

    #[test]
    fn sound_bodies_do_not_cut_themselves() {
        for m in [cuboid(Vec3::ZERO, Vec3::ONE), bumpy_sphere(4, 0.3), sheet(20, 0.02)] {
            assert_eq!(m.crossings(100), Crossings::default());
            assert_eq!(m.duplicates(), Duplicates::default());
        }
    }

    #[test]
    fn bodies_that_touch_do_not_cut_and_bodies_that_overlap_do() {
        let a = cuboid(Vec3::ZERO, Vec3::ONE);
        // Shifted by one along x: two faces coincide. Smaller and on top: a face within a face.
        for touching in
            [cuboid(Vec3::X, Vec3::new(2.0, 1.0, 1.0)), cuboid(Vec3::new(0.2, 0.3, 1.0), Vec3::new(0.7, 0.6, 2.0))]
        {
            assert_eq!(a.clone().joined(&touching).crossings(100).pairs, Vec::<[u32; 2]>::new());
        }
        let through = a.joined(&cuboid(Vec3::new(0.2, 0.3, 0.5), Vec3::new(0.7, 0.6, 2.0)));
        let found = through.crossings(1000);
        assert_eq!(found.pairs, by_brute_force(&through));
        assert!(!found.pairs.is_empty() && found.points.iter().all(|p| (p.z - 1.0).abs() < 1e-6), "{found:?}");
    }

    #[test]
    fn the_search_through_the_tree_finds_what_comparing_all_pairs_finds() {
        let moved = bumpy_sphere(2, 0.2).transformed(&moonmilk_core::Mat4::from_translation(Vec3::new(0.8, 0.3, -0.2)));
        let m = bumpy_sphere(2, 0.2).joined(&moved.expect("a mesh"));
        let found = m.crossings(100_000);
        assert_eq!(found.pairs, by_brute_force(&m));
        assert!(found.pairs.len() > 50 && !found.more, "{}", found.pairs.len());
    }

    #[test]
    fn cuts_do_not_depend_on_the_scale() {
        let m = cuboid(Vec3::ZERO, Vec3::ONE).joined(&cuboid(Vec3::splat(0.5), Vec3::splat(1.5)));
        let n = m.crossings(1000).pairs;
        for scale in [1.0 / 1024.0, 4096.0] {
            let scaled = m.transformed(&moonmilk_core::Mat4::from_scale(Vec3::splat(scale))).expect("a mesh");
            assert_eq!(scaled.crossings(1000).pairs, n);
        }
    }

    #[test]
    fn triangles_that_stand_twice_are_counted_by_their_winding() {
        let cube = cuboid(Vec3::ZERO, Vec3::ONE);
        let mut indices = cube.indices().to_vec();
        let [a, b, c] = indices[3];
        indices.extend([[b, c, a], [a, c, b]]);
        let m = Mesh::new(cube.positions().to_vec(), vec![], vec![], indices).expect("a mesh");
        // The last one is over the positions of both; it counts as wound like the first of either kind.
        assert_eq!(m.duplicates(), Duplicates { same: 1, opposite: 1, first: Some(12) });
    }
}
