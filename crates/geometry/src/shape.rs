//! Shapes: a mesh or a quadric, and which way its normals point.

use crate::bounds::Bounds;
use crate::mesh::Mesh;
use crate::quadric::Quadric;

/// Geometry of a shape.
#[derive(Clone, Debug)]
pub enum Form {
    /// Triangles.
    Mesh(Mesh),
    /// Sphere, disk or cylinder under an affine transform.
    Quadric(Quadric),
}

/// A shape of the scene.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Its geometry in world space.
    pub form: Form,
    /// Whether normals point against the form's own outward side.
    pub reverse: bool,
}

impl From<Mesh> for Shape {
    fn from(mesh: Mesh) -> Self {
        Self { form: Form::Mesh(mesh), reverse: false }
    }
}

impl From<Quadric> for Shape {
    fn from(quadric: Quadric) -> Self {
        Self { form: Form::Quadric(quadric), reverse: false }
    }
}

impl Shape {
    /// Returns the shape with its normals reversed.
    pub fn reversed(self) -> Self {
        Self { reverse: !self.reverse, ..self }
    }

    /// Returns the mesh, if it is one.
    pub fn mesh(&self) -> Option<&Mesh> {
        match &self.form {
            Form::Mesh(m) => Some(m),
            Form::Quadric(_) => None,
        }
    }

    /// Returns the quadric, if it is one.
    pub fn quadric(&self) -> Option<&Quadric> {
        match &self.form {
            Form::Mesh(_) => None,
            Form::Quadric(q) => Some(q),
        }
    }

    /// Returns the number of primitives: triangles, or 1.
    pub fn prim_count(&self) -> u32 {
        match &self.form {
            Form::Mesh(m) => m.indices().len() as u32,
            Form::Quadric(_) => 1,
        }
    }

    /// Returns the box around the shape.
    pub fn bounds(&self) -> Bounds {
        match &self.form {
            Form::Mesh(m) => m.bounds(),
            Form::Quadric(q) => q.bounds(),
        }
    }

    /// Returns the surface area [L^2].
    pub fn area(&self) -> f64 {
        match &self.form {
            Form::Mesh(m) => m.area(),
            Form::Quadric(q) => q.area(),
        }
    }

    /// Returns the signed volume [L^3]: positive if the normals of a closed shape point outward.
    pub fn volume(&self) -> f64 {
        let v = match &self.form {
            Form::Mesh(m) => m.volume(),
            Form::Quadric(q) => q.volume(),
        };
        if self.reverse { -v } else { v }
    }

    /// Returns whether the surface has no boundary, so that it separates inside from outside.
    ///
    /// Sorts the edges of a mesh: call it once per shape, not per ray.
    pub fn is_closed(&self) -> bool {
        match &self.form {
            Form::Mesh(m) => m.topology().is_closed(),
            Form::Quadric(q) => q.is_closed(),
        }
    }
}
