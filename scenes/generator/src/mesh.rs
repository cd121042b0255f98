//! An indexed triangle mesh, the one way in which all showcase objects are built, and its PLY form.
//!
//! Every object is a *tube*: a stack of closed loops with the same number of points, shut by one point at each end.
//! A turned chess piece, a pillow of soap and a curled leaf have this shape alike, and a tube is closed and consistently
//! oriented by construction, whatever is done to its points.

use std::collections::HashMap;
use std::io::{self, Write};

use glam::DVec3;

/// A triangle mesh in millimetres; triangles run counter-clockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions \[mm\].
    pub positions: Vec<DVec3>,
    /// Corner indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The tube through `rings`, closed by the points `start` and `end`.
    ///
    /// Seen against the direction from `start` to `end` the loops run counter-clockwise; then normals point outward.
    pub fn tube(start: DVec3, rings: &[Vec<DVec3>], end: DVec3) -> Self {
        let columns = rings[0].len();
        assert!(rings.iter().all(|ring| ring.len() == columns), "all rings have the same number of points");
        let mut positions = vec![start];
        positions.extend(rings.iter().flatten());
        positions.push(end);
        let last = positions.len() as u32 - 1;
        let index = |ring: usize, column: usize| (1 + ring * columns + column % columns) as u32;

        let mut triangles = Vec::with_capacity(2 * rings.len() * columns);
        for column in 0..columns {
            triangles.push([0, index(0, column + 1), index(0, column)]);
        }
        for ring in 0..rings.len() - 1 {
            for column in 0..columns {
                let [a, b] = [index(ring, column), index(ring, column + 1)];
                let [d, c] = [index(ring + 1, column), index(ring + 1, column + 1)];
                // Split each quad along its shorter diagonal, which keeps triangles of curved parts near the surface.
                let length = |p: u32, q: u32| positions[p as usize].distance_squared(positions[q as usize]);
                if length(a, c) <= length(b, d) {
                    triangles.extend([[a, b, c], [a, c, d]]);
                } else {
                    triangles.extend([[a, b, d], [b, c, d]]);
                }
            }
        }
        for column in 0..columns {
            triangles.push([last, index(rings.len() - 1, column), index(rings.len() - 1, column + 1)]);
        }
        Self { positions, triangles }
    }

    /// The mesh with every position replaced by `f` of it; `f` keeps orientation.
    pub fn mapped(mut self, f: impl Fn(DVec3) -> DVec3) -> Self {
        self.positions.iter_mut().for_each(|p| *p = f(*p));
        self
    }

    /// The mesh moved so that its lowest point is `clearance` above the plane z = 0, and by (x, y) sideways.
    pub fn placed(self, x: f64, y: f64, clearance: f64) -> Self {
        let lift = DVec3::new(x, y, clearance - self.bounds().0.z);
        self.mapped(|p| p + lift)
    }

    /// The smallest and largest coordinates.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.positions.iter().fold(none, |(low, high), p| (low.min(*p), high.max(*p)))
    }

    /// The corners of one triangle.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|i| self.positions[i as usize])
    }

    /// The enclosed volume [mm^3]; positive if normals point outward.
    pub fn volume(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    }

    /// The surface area [mm^2].
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum()
    }

    /// Unit normals at the vertices: the mean of the adjacent face normals, weighted by the angle of the face there.
    pub fn vertex_normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.positions.len()];
        for t in 0..self.triangles.len() {
            let p = self.corners(t);
            let face = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
            for corner in 0..3 {
                let [a, b] = [p[(corner + 1) % 3] - p[corner], p[(corner + 2) % 3] - p[corner]];
                normals[self.triangles[t][corner] as usize] += face * a.angle_between(b);
            }
        }
        normals.into_iter().map(DVec3::normalize_or_zero).collect()
    }

    /// What is wrong with the mesh: open, doubled or wrongly oriented edges, and coordinates that are not finite.
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if self.positions.iter().any(|p| !p.is_finite()) {
            faults.push("a coordinate is not finite".to_owned());
        }
        // In a closed, oriented mesh each directed edge occurs once, and so does its reverse.
        let mut directed: HashMap<(u32, u32), u32> = HashMap::new();
        for t in &self.triangles {
            for k in 0..3 {
                *directed.entry((t[k], t[(k + 1) % 3])).or_default() += 1;
            }
        }
        let bad = directed.iter().filter(|((a, b), n)| **n != 1 || directed.get(&(*b, *a)) != Some(&1)).count();
        if bad > 0 {
            faults.push(format!("{bad} edges are not shared by two oppositely oriented triangles"));
        }
        faults
    }

    /// Writes the mesh as binary little-endian PLY with 32-bit positions and vertex normals.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_ply(&self, out: &mut impl Write) -> io::Result<()> {
        let header = [
            "ply\nformat binary_little_endian 1.0\ncomment made by moonmilk-showcase-generator, millimetres".to_owned(),
            format!("element vertex {}", self.positions.len()),
            "property float x\nproperty float y\nproperty float z".to_owned(),
            "property float nx\nproperty float ny\nproperty float nz".to_owned(),
            format!("element face {}\nproperty list uchar int vertex_indices\nend_header\n", self.triangles.len()),
        ];
        out.write_all(header.join("\n").as_bytes())?;
        for (p, n) in self.positions.iter().zip(self.vertex_normals()) {
            for value in p.to_array().into_iter().chain(n.to_array()) {
                out.write_all(&(value as f32).to_le_bytes())?;
            }
        }
        for triangle in &self.triangles {
            out.write_all(&[3])?;
            for index in triangle {
                out.write_all(&index.to_le_bytes())?;
            }
        }
        Ok(())
    }
}
