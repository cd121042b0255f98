//! Whether a mesh is closed: boundary, non-manifold and badly oriented edges, pieces, and caps for the holes.
//!
//! Vertices at the same position count as one, so that seams of texture coordinates or normals are no boundary.

use std::collections::HashMap;

use moonmilk_core::{Vec2, Vec3};
use rayon::prelude::*;

use crate::mesh::Mesh;

/// Longest list of edges in a report.
pub const LISTED: usize = 16;

/// What the edges of a mesh say about its surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    /// Number of edges with one triangle.
    pub boundary: usize,
    /// Number of edges with two triangles that run along it in the same direction (one is wound the wrong way).
    pub misoriented: usize,
    /// Number of edges with more than two triangles.
    pub non_manifold: usize,
    /// Number of those whose triangles do not balance: a surface that leaks there.
    pub unbalanced: usize,
    /// Number of edges in all.
    pub edges: usize,
    /// Number of pieces connected by shared vertices.
    pub components: usize,
    /// Ends of the first [`LISTED`] boundary edges.
    pub boundary_edges: Vec<[Vec3; 2]>,
}

impl Topology {
    /// Returns whether each edge is passed equally often in both directions, so that the surface bounds a volume.
    ///
    /// True for shells that touch along an edge (non-manifold, but balanced).
    pub fn is_closed(&self) -> bool {
        self.boundary == 0 && self.misoriented == 0 && self.unbalanced == 0
    }
}

/// A directed use of an edge: key of its ends (smaller first) and whether it runs from the smaller to the larger.
type Use = (u64, bool);

impl Mesh {
    /// Returns the report on the mesh's edges; sorts them, O(n log n).
    pub fn topology(&self) -> Topology {
        let weld = weld(self.positions());
        let mut uses = edge_uses(self, &weld);
        uses.par_sort_unstable();
        let mut t = Topology { components: components(self, &weld), ..Topology::default() };
        for group in uses.chunk_by(|a, b| a.0 == b.0) {
            t.edges += 1;
            let forward = group.iter().filter(|u| u.1).count();
            match group.len() {
                1 => {
                    t.boundary += 1;
                    if t.boundary_edges.len() < LISTED {
                        let p = |v: u64| self.positions()[v as usize];
                        t.boundary_edges.push([p(group[0].0 >> 32), p(group[0].0 & 0xffff_ffff)]);
                    }
                }
                2 => t.misoriented += usize::from(forward != 1),
                n => {
                    t.non_manifold += 1;
                    t.unbalanced += usize::from(2 * forward != n);
                }
            }
        }
        t
    }

    /// Returns the mesh with every boundary loop closed by a fan around the mean of its vertices.
    ///
    /// Caps get vertices of their own with the cap's normal, so that shading does not bend around the rim. Meant for
    /// roughly plane holes; the fan of a strongly bent loop may cut through the surface.
    pub fn capped(&self) -> Mesh {
        let weld = weld(self.positions());
        let mut uses = edge_uses(self, &weld);
        uses.par_sort_unstable();
        // A cap passes each boundary edge against its triangle.
        let mut next: HashMap<u32, Vec<u32>> = HashMap::new();
        for group in uses.chunk_by(|a, b| a.0 == b.0).filter(|g| g.len() == 1) {
            let (low, high) = ((group[0].0 >> 32) as u32, group[0].0 as u32);
            let (from, to) = if group[0].1 { (high, low) } else { (low, high) };
            next.entry(from).or_default().push(to);
        }
        let mut starts: Vec<u32> = next.keys().copied().collect();
        starts.sort_unstable();

        let (mut positions, mut normals) = (self.positions().to_vec(), self.normals().to_vec());
        let (mut uvs, mut indices) = (self.uvs().to_vec(), self.indices().to_vec());
        for start in starts {
            while let Some(rim) = take_loop(&mut next, start) {
                let corner: Vec<Vec3> = rim.iter().map(|&v| self.positions()[v as usize]).collect();
                let hub = corner.iter().sum::<Vec3>() / corner.len() as f32;
                let n = corner.len();
                let normal: Vec3 = (0..n).map(|k| (corner[k] - hub).cross(corner[(k + 1) % n] - hub)).sum();
                let base = positions.len() as u32;
                positions.push(hub);
                positions.extend(&corner);
                if !normals.is_empty() {
                    normals.resize(positions.len(), normal.normalize_or_zero());
                }
                if !uvs.is_empty() {
                    uvs.resize(positions.len(), Vec2::ZERO);
                }
                indices.extend((0..n as u32).map(|k| [base, base + 1 + k, base + 1 + (k + 1) % n as u32]));
            }
        }
        Mesh::new(positions, normals, uvs, indices).expect("caps of a valid mesh are valid")
    }
}

/// Follows boundary edges from a vertex until it returns there, using them up.
fn take_loop(next: &mut HashMap<u32, Vec<u32>>, start: u32) -> Option<Vec<u32>> {
    let mut rim = Vec::new();
    let mut at = start;
    while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
        rim.push(at);
        at = to;
        if at == start {
            return (rim.len() > 2).then_some(rim);
        }
    }
    None
}

/// Returns for each vertex the first vertex with the same coordinates (-0.0 equals 0.0).
pub(crate) fn weld(positions: &[Vec3]) -> Vec<u32> {
    let key = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<([u32; 3], u32)> = positions.iter().enumerate().map(|(i, &p)| (key(p), i as u32)).collect();
    order.par_sort_unstable();
    let mut first = vec![0; positions.len()];
    for group in order.chunk_by(|a, b| a.0 == b.0) {
        for v in group {
            first[v.1 as usize] = group[0].1;
        }
    }
    first
}

fn edge_uses(mesh: &Mesh, weld: &[u32]) -> Vec<Use> {
    let edge = |a: u32, b: u32| ((u64::from(a.min(b)) << 32) | u64::from(a.max(b)), a < b);
    let triangle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| weld[v as usize]);
        [edge(a, b), edge(b, c), edge(c, a)]
    };
    mesh.indices().iter().flat_map(triangle).collect()
}

/// Counts connected pieces.
fn components(mesh: &Mesh, weld: &[u32]) -> usize {
    labels(mesh, weld).1
}

/// Returns the number of each triangle's connected piece, and the number of pieces, by union-find with path halving.
pub(crate) fn labels(mesh: &Mesh, weld: &[u32]) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..weld.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for t in mesh.indices() {
        let [a, b, c] = t.map(|v| root(&mut parent, weld[v as usize]));
        let low = a.min(b).min(c);
        for v in [a, b, c] {
            parent[v as usize] = low;
        }
    }
    // Number the roots in the order of their first triangles.
    let mut number = vec![u32::MAX; weld.len()];
    let mut count = 0;
    let label = |t: &[u32; 3]| {
        let n = &mut number[root(&mut parent, weld[t[0] as usize]) as usize];
        if *n == u32::MAX {
            *n = count;
            count += 1;
        }
        *n
    };
    let labels = mesh.indices().iter().map(label).collect();
    (labels, count as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate;

    /// Every triangle with vertices of its own: closed only after welding.
    fn exploded(m: &Mesh, keep: impl Fn(usize) -> bool) -> Mesh {
        let corners: Vec<Vec3> =
            (0..m.indices().len()).filter(|&i| keep(i)).flat_map(|i| m.corners(i as u32)).collect();
        let n = corners.len() as u32 / 3;
        Mesh::new(corners, vec![], vec![], (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()).unwrap()
    }

    #[test]
    fn seams_are_no_boundary_and_pieces_are_counted() {
        let cube = exploded(&generate::cuboid(Vec3::splat(-1.0), Vec3::ZERO), |_| true);
        let t = cube.topology();
        assert!(t.is_closed() && t.edges == 18 && t.components == 1, "{t:?}");
        let two = cube.joined(&generate::cuboid(Vec3::ONE, Vec3::splat(2.0)));
        assert_eq!((two.topology().components, two.topology().is_closed()), (2, true));
    }

    #[test]
    fn holes_and_wrong_windings_are_found() {
        let sphere = generate::bumpy_sphere(2, 0.1);
        let open = exploded(&sphere, |i| i != 17);
        let t = open.topology();
        assert!(!t.is_closed() && t.boundary == 3 && t.boundary_edges.len() == 3, "{t:?}");
        let mut indices = sphere.indices().to_vec();
        indices[5].swap(0, 1);
        let t = Mesh::new(sphere.positions().to_vec(), vec![], vec![], indices).unwrap().topology();
        assert_eq!((t.boundary, t.misoriented, t.is_closed()), (0, 3, false));
    }

    #[test]
    fn boxes_that_share_an_edge_are_non_manifold_but_closed() {
        let a = generate::cuboid(Vec3::ZERO, Vec3::ONE);
        let b = generate::cuboid(Vec3::new(1.0, 1.0, 0.0), Vec3::new(2.0, 2.0, 1.0));
        let t = a.joined(&b).topology();
        assert!(t.non_manifold == 1 && t.unbalanced == 0 && t.is_closed(), "{t:?}");
    }

    #[test]
    fn caps_close_two_holes_and_restore_the_volume() {
        let cube = generate::cuboid(Vec3::ZERO, Vec3::splat(2.0));
        // Remove the two faces across z (the first four triangles).
        let tube = exploded(&cube, |i| i >= 4);
        assert_eq!(tube.topology().boundary, 8);
        let closed = tube.capped();
        assert!(closed.topology().is_closed() && (closed.volume() - 8.0).abs() < 1e-6);
    }
}
