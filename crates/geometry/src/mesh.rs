//! Triangle meshes, validated once so that all queries are infallible.

use moonmilk_core::glam::{DVec3, Mat3};
use moonmilk_core::{Mat4, Vec2, Vec3};
use thiserror::Error;

use crate::bounds::Bounds;

/// What makes arrays unfit to be a mesh.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MeshError {
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} uses vertex {vertex}, but there are only {count} vertices")]
    IndexOutOfRange {
        /// Number of the triangle.
        triangle: usize,
        /// Vertex it names.
        vertex: u32,
        /// Number of vertices.
        count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("{array} {element} is {value}: coordinates must be finite numbers")]
    NotFinite {
        /// `position`, `normal` or `uv`.
        array: &'static str,
        /// Number of the element.
        element: usize,
        /// Its value in words.
        value: String,
    },
    /// An array per vertex has another length than the positions.
    #[error("{count} {array}s for {vertices} vertices: give one per vertex or none")]
    LengthMismatch {
        /// `normal` or `uv`.
        array: &'static str,
        /// Its length.
        count: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// No triangle has any area.
    #[error("the mesh has no triangle with an area ({dropped} degenerate)")]
    Empty {
        /// Number of triangles of zero area.
        dropped: usize,
    },
}

/// Triangles over shared vertices, in world space.
///
/// Counter-clockwise triangles face the viewer: the outward normal is `(p1 - p0) x (p2 - p0)`. Triangles without area
/// (coincident or collinear vertices) are dropped by the constructor and counted in [`Mesh::dropped`]; triangle numbers
/// everywhere in this crate count the kept ones.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    indices: Vec<[u32; 3]>,
    dropped: usize,
}

impl Mesh {
    /// Returns a mesh of positions \[n\], normals [n or 0], texture coordinates [n or 0] and triangles.
    ///
    /// Normals need not be of unit length; a zero normal counts as absent at that vertex.
    ///
    /// *Errors*: the first element that is out of range or not finite, by its number.
    pub fn new(
        positions: Vec<Vec3>,
        normals: Vec<Vec3>,
        uvs: Vec<Vec2>,
        mut indices: Vec<[u32; 3]>,
    ) -> Result<Self, MeshError> {
        // Check the arrays per vertex.
        for (array, count) in [("normal", normals.len()), ("uv", uvs.len())] {
            if count != 0 && count != positions.len() {
                return Err(MeshError::LengthMismatch { array, count, vertices: positions.len() });
            }
        }
        for (array, list) in [("position", &positions), ("normal", &normals)] {
            if let Some(element) = list.iter().position(|p| !p.is_finite()) {
                return Err(MeshError::NotFinite { array, element, value: list[element].to_string() });
            }
        }
        if let Some(element) = uvs.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NotFinite { array: "uv", element, value: uvs[element].to_string() });
        }
        // Check the triangles.
        let count = positions.len();
        for (triangle, corners) in indices.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= count) {
                return Err(MeshError::IndexOutOfRange { triangle, vertex, count });
            }
        }
        // Drop triangles without area.
        let all = indices.len();
        indices
            .retain(|&[a, b, c]| twice_area(positions[a as usize], positions[b as usize], positions[c as usize]) > 0.0);
        let dropped = all - indices.len();
        if indices.is_empty() {
            return Err(MeshError::Empty { dropped });
        }
        indices.shrink_to_fit();
        Ok(Self { positions, normals, uvs, indices, dropped })
    }

    /// Returns the vertex positions.
    pub fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    /// Returns the normals per vertex; empty if the mesh is flat.
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// Returns the texture coordinates per vertex; empty if there are none.
    pub fn uvs(&self) -> &[Vec2] {
        &self.uvs
    }

    /// Returns the triangles.
    pub fn indices(&self) -> &[[u32; 3]] {
        &self.indices
    }

    /// Returns the number of triangles without area that the constructor dropped.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// Returns the corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.indices[triangle as usize].map(|v| self.positions[v as usize])
    }

    /// Returns the geometric normal of a triangle, twice its area long.
    #[inline]
    pub fn area_normal(&self, triangle: u32) -> Vec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a)
    }

    /// Returns the area [L^2], summed in f64.
    pub fn area(&self) -> f64 {
        self.indices.iter().map(|&t| 0.5 * twice_area(self.at(t[0]), self.at(t[1]), self.at(t[2]))).sum()
    }

    /// Returns the signed volume [L^3]: positive if a closed mesh's normals point outward.
    ///
    /// For an open mesh it is the volume against the centre of its bounds.
    pub fn volume(&self) -> f64 {
        let o = self.bounds().center().as_dvec3();
        let tetrahedron = |&[a, b, c]: &[u32; 3]| {
            let p = |v: u32| self.at(v).as_dvec3() - o;
            p(a).dot(p(b).cross(p(c))) / 6.0
        };
        self.indices.iter().map(tetrahedron).sum()
    }

    /// Returns the box around all vertices that triangles use.
    pub fn bounds(&self) -> Bounds {
        Bounds::of(self.indices.iter().flatten().map(|&v| self.at(v)))
    }

    /// Returns the area fraction of triangles whose winding agrees with their vertex normals; 1 without normals.
    ///
    /// A value near 0 says that the file winds its triangles the other way: see [`Mesh::flip`].
    pub fn agreement_with_normals(&self) -> f64 {
        if self.normals.is_empty() {
            return 1.0;
        }
        let (mut agree, mut all) = (0.0, 0.0);
        for (i, t) in self.indices.iter().enumerate() {
            let n = self.area_normal(i as u32);
            let sum: Vec3 = t.iter().map(|&v| self.normals[v as usize]).sum();
            let area = f64::from(n.length());
            all += area;
            agree += if n.dot(sum) >= 0.0 { area } else { 0.0 };
        }
        agree / all
    }

    /// Turns the surface inside out: reverses the winding and negates the normals.
    pub fn turn_inside_out(&mut self) {
        self.flip();
        self.normals.iter_mut().for_each(|n| *n = -*n);
    }

    /// Reverses the winding of all triangles, leaving the vertex normals alone.
    pub fn flip(&mut self) {
        self.indices.iter_mut().for_each(|t| t.swap(1, 2));
    }

    /// Applies an affine transform; a mirror image keeps its outward side outward.
    ///
    /// *Errors*: as for [`Mesh::new`], if the transform makes coordinates infinite or flattens the mesh.
    pub fn transformed(&self, m: &Mat4) -> Result<Self, MeshError> {
        // Normals go with the cofactor matrix (det times the inverse transpose), which exists for any transform.
        let linear = Mat3::from_mat4(*m);
        let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
        let sign = 1f32.copysign(linear.determinant());
        let cofactor = Mat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign;
        let positions = self.positions.iter().map(|&p| m.transform_point3(p)).collect();
        let normals = self.normals.iter().map(|&n| (cofactor * n).normalize_or_zero()).collect();
        let mut mesh = Self::new(positions, normals, self.uvs.clone(), self.indices.clone())?;
        mesh.dropped += self.dropped;
        if sign < 0.0 {
            mesh.flip();
        }
        Ok(mesh)
    }

    /// Returns one mesh with the triangles of both; arrays that only one of them has are filled with zeros.
    pub fn joined(mut self, other: &Mesh) -> Self {
        let offset = self.positions.len();
        let pad = |list: &mut Vec<Vec3>, n: usize| list.resize(n, Vec3::ZERO);
        if !self.normals.is_empty() || !other.normals.is_empty() {
            pad(&mut self.normals, offset);
            self.normals.extend(&other.normals);
            pad(&mut self.normals, offset + other.positions.len());
        }
        if !self.uvs.is_empty() || !other.uvs.is_empty() {
            self.uvs.resize(offset, Vec2::ZERO);
            self.uvs.extend(&other.uvs);
            self.uvs.resize(offset + other.positions.len(), Vec2::ZERO);
        }
        self.positions.extend(&other.positions);
        self.indices.extend(other.indices.iter().map(|t| t.map(|v| v + offset as u32)));
        self.dropped += other.dropped;
        self
    }

    /// Returns the bytes held by the arrays.
    pub fn memory(&self) -> usize {
        self.positions.capacity() * 12
            + self.normals.capacity() * 12
            + self.uvs.capacity() * 8
            + self.indices.capacity() * 12
    }

    fn at(&self, v: u32) -> Vec3 {
        self.positions[v as usize]
    }
}

/// Returns twice the area of a triangle in f64: products of f32 differences, so that thin triangles keep theirs.
pub(crate) fn twice_area(a: Vec3, b: Vec3, c: Vec3) -> f64 {
    let (a, b, c): (DVec3, DVec3, DVec3) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    (b - a).cross(c - a).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate;

    #[test]
    fn faulty_arrays_are_rejected_with_the_element_that_is_wrong() {
        let p = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let e = Mesh::new(p.clone(), vec![], vec![], vec![[0, 1, 2], [0, 1, 3]]).unwrap_err();
        assert_eq!(e, MeshError::IndexOutOfRange { triangle: 1, vertex: 3, count: 3 });
        let nan = vec![Vec3::ZERO, Vec3::new(0.0, f32::NAN, 0.0), Vec3::Y];
        let e = Mesh::new(nan, vec![], vec![], vec![[0, 1, 2]]).unwrap_err();
        assert!(matches!(e, MeshError::NotFinite { array: "position", element: 1, .. }), "{e}");
        let e = Mesh::new(p.clone(), vec![Vec3::Z; 2], vec![], vec![[0, 1, 2]]).unwrap_err();
        assert!(matches!(e, MeshError::LengthMismatch { array: "normal", count: 2, vertices: 3 }));
        let e = Mesh::new(p, vec![], vec![], vec![[0, 1, 1]]).unwrap_err();
        assert_eq!(e, MeshError::Empty { dropped: 1 });
    }

    #[test]
    fn degenerate_triangles_are_dropped_and_counted() {
        let p = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X * 2.0];
        let m = Mesh::new(p, vec![], vec![], vec![[0, 1, 2], [0, 1, 3], [2, 2, 1]]).unwrap();
        assert_eq!((m.indices().len(), m.dropped()), (1, 2));
    }

    #[test]
    fn area_and_volume_of_a_box_are_exact_and_survive_a_mirror() {
        let m = generate::cuboid(Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 4.0, 6.0));
        assert_eq!((m.area(), m.volume()), (22.0, 6.0));
        let mirrored = m.transformed(&Mat4::from_scale(Vec3::new(-2.0, 1.0, 1.0))).unwrap();
        assert_eq!((mirrored.area(), mirrored.volume()), (32.0, 12.0));
        let mut inside_out = m;
        inside_out.turn_inside_out();
        assert_eq!(inside_out.volume(), -6.0);
    }

    #[test]
    fn normals_stay_perpendicular_and_outward_under_a_skewed_mirror() {
        let m = generate::bumpy_sphere(3, 0.1);
        let skew =
            Mat4::from_cols_array(&[-1.0, 0.2, 0.0, 0.0, 0.5, 2.0, 0.1, 0.0, 0.0, 0.3, 0.7, 0.0, 4.0, 5.0, 6.0, 1.0]);
        let t = m.transformed(&skew).unwrap();
        assert!(t.volume() > 0.0 && t.agreement_with_normals() > 0.999);
    }
}
