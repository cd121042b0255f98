//! The pieces of a mesh: which triangles hang together, what each piece encloses, and which pieces lie in others.
//!
//! A solid with a cavity has two shells, the inner one wound the other way. A file of many grains has many. What is wrong
//! with a mesh of several shells is seen shell by shell: one of them open, or wound against its place in the others.

use moonmilk_core::Vec3;
use moonmilk_core::glam::DVec3;

use crate::accel::Accel;
use crate::bounds::Bounds;
use crate::mesh::Mesh;
use crate::ray::Ray;
use crate::topology::{labels, weld};

/// Direction in which crossings are counted: no mesh is likely to have faces or edges along it.
const PROBE: Vec3 = Vec3::new(0.267_261_24, 0.534_522_5, 0.801_783_74);

/// One connected piece of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Shell {
    /// Number of triangles.
    pub triangles: usize,
    /// A vertex of it.
    pub vertex: Vec3,
    /// Box around it.
    pub bounds: Bounds,
    /// Area \[L^2\].
    pub area: f64,
    /// Signed volume \[L^3\], positive if its normals point outward; for an open shell it says nothing.
    pub volume: f64,
    /// Number of edges with one triangle.
    pub boundary: usize,
    /// Whether each edge is passed equally often in both directions.
    pub closed: bool,
    /// Number of other closed shells around it.
    pub depth: usize,
}

impl Shell {
    /// Returns whether its normals point away from the solid: outward at even depth, into the cavity at odd depth.
    pub fn faces_outward(&self) -> bool {
        (self.volume > 0.0) == self.depth.is_multiple_of(2)
    }
}

impl Mesh {
    /// Returns the number of the shell of each triangle, and the shells in the order of their first triangles.
    ///
    /// Triangles with a vertex position in common belong to one shell, O(n log n). The depth of a shell is that of one of its vertices, found by
    /// counting the crossings of a ray; where shells cut each other it is the depth there.
    pub fn shells(&self) -> (Vec<u32>, Vec<Shell>) {
        let weld = weld(self.positions());
        let (label, count) = labels(self, &weld);
        let empty = Shell {
            triangles: 0,
            vertex: Vec3::ZERO,
            bounds: Bounds::EMPTY,
            area: 0.0,
            volume: 0.0,
            boundary: 0,
            closed: true,
            depth: 0,
        };
        let mut shells = vec![empty; count];
        for (i, &l) in label.iter().enumerate() {
            let corners = self.corners(i as u32);
            let shell = &mut shells[l as usize];
            if shell.triangles == 0 {
                shell.vertex = corners[0];
            }
            shell.triangles += 1;
            shell.bounds = shell.bounds.union(Bounds::of(corners));
        }
        for (i, &l) in label.iter().enumerate() {
            let shell = &mut shells[l as usize];
            // Measure against a point near the shell: far from the origin the sum would cancel.
            let [a, b, c] = self.corners(i as u32).map(|p| p.as_dvec3() - shell.vertex.as_dvec3());
            let normal: DVec3 = (b - a).cross(c - a);
            shell.area += 0.5 * normal.length();
            shell.volume += a.dot(normal) / 6.0;
        }
        self.edges_of_shells(&weld, &label, &mut shells);
        if count > 1 {
            self.depths(&label, &mut shells);
        }
        (label, shells)
    }

    fn edges_of_shells(&self, weld: &[u32], label: &[u32], shells: &mut [Shell]) {
        let mut uses: Vec<(u64, bool, u32)> = Vec::with_capacity(3 * label.len());
        for (t, &l) in self.indices().iter().zip(label) {
            let [a, b, c] = t.map(|v| weld[v as usize]);
            for (a, b) in [(a, b), (b, c), (c, a)] {
                uses.push(((u64::from(a.min(b)) << 32) | u64::from(a.max(b)), a < b, l));
            }
        }
        uses.sort_unstable();
        for group in uses.chunk_by(|a, b| a.0 == b.0) {
            let shell = &mut shells[group[0].2 as usize];
            shell.boundary += usize::from(group.len() == 1);
            shell.closed &= 2 * group.iter().filter(|u| u.1).count() == group.len();
        }
    }

    /// Counts for one vertex of each shell the other closed shells around it.
    fn depths(&self, label: &[u32], shells: &mut [Shell]) {
        let accel = Accel::build(vec![self.clone().into()]);
        for s in 0..shells.len() {
            // Crossings outward minus inward: 0 from outside of a closed shell, +-1 from inside.
            let mut balance: Vec<(u32, i32)> = Vec::new();
            accel.all_hits(&Ray::new(shells[s].vertex, PROBE), |hit| {
                let other = label[hit.index as usize];
                if other as usize != s && shells[other as usize].closed {
                    balance.push((other, if hit.exiting { 1 } else { -1 }));
                }
            });
            balance.sort_unstable();
            shells[s].depth =
                balance.chunk_by(|a, b| a.0 == b.0).filter(|g| g.iter().map(|c| c.1).sum::<i32>() != 0).count();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{bumpy_sphere, cuboid};

    fn cube(half: f32, at: Vec3) -> Mesh {
        cuboid(at - half, at + half)
    }

    #[test]
    fn a_shell_in_a_shell_knows_its_depth_and_whether_it_is_wound_as_a_cavity() {
        let mut cavity = cube(1.0, Vec3::ZERO);
        cavity.flip();
        let mesh =
            cube(2.0, Vec3::ZERO).joined(&cavity).joined(&cube(0.5, Vec3::ZERO)).joined(&cube(0.5, Vec3::X * 9.0));
        let (label, shells) = mesh.shells();
        assert_eq!(label.len(), 48);
        let found: Vec<_> = shells.iter().map(|s| (s.depth, s.closed, s.faces_outward(), s.triangles)).collect();
        assert_eq!(found, [(0, true, true, 12), (1, true, true, 12), (2, true, true, 12), (0, true, true, 12)]);
        for (s, v) in shells.iter().zip([64.0, -8.0, 1.0, 1.0]) {
            assert!((s.volume - v).abs() < 1e-12 * v.abs() && s.boundary == 0, "{s:?}");
        }
        // The same without turning the inner cube over: two walls, one inside the other.
        let (_, double) = cube(2.0, Vec3::ZERO).joined(&cube(1.0, Vec3::ZERO)).shells();
        assert!(double[0].faces_outward() && !double[1].faces_outward() && double[1].depth == 1);
    }

    #[test]
    fn an_open_shell_among_closed_ones_is_told_apart() {
        let sphere = bumpy_sphere(2, 0.1);
        let open =
            Mesh::new(sphere.positions().to_vec(), vec![], vec![], sphere.indices().iter().copied().skip(1).collect());
        let (_, shells) = cube(3.0, Vec3::ZERO).joined(&open.expect("a mesh")).shells();
        assert_eq!(shells.iter().map(|s| (s.closed, s.boundary)).collect::<Vec<_>>(), [(true, 0), (false, 3)]);
        // An open shell encloses nothing: the cube inside it has depth 0 but for the large one.
        assert_eq!(shells[1].depth, 1);
    }

    #[test]
    fn volumes_and_areas_of_shells_add_up_to_those_of_the_mesh() {
        let mesh = bumpy_sphere(3, 0.2).joined(&cube(0.5, Vec3::splat(7.0)));
        let (_, shells) = mesh.shells();
        let (volume, area): (f64, f64) = (shells.iter().map(|s| s.volume).sum(), shells.iter().map(|s| s.area).sum());
        // Sums of 1292 terms in f64.
        assert!((volume / mesh.volume() - 1.0).abs() < 1e-12 && (area / mesh.area() - 1.0).abs() < 1e-12);
    }
}
