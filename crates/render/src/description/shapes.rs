//! Shapes, objects and their instances, as a file says them.

use std::sync::Arc;

use moonmilk_core::{Mat4, Vec2, Vec3};

use super::*;

/// The media on both sides of a surface; `None` is vacuum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MediumInterface {
    /// On the side opposite to the normal.
    pub inside: Option<MediumId>,
    /// On the side of the normal.
    pub outside: Option<MediumId>,
}

/// A shape in the scene.
#[derive(Clone, Debug)]
pub struct ShapeDescription {
    /// Where it was said.
    pub place: Place,
    /// File or kind, for messages: `dragon.ply`, `sphere`.
    pub name: String,
    /// Its form in object space.
    pub geometry: Arc<GeometryDescription>,
    /// Object to world space.
    pub object_to_world: Mat4,
    /// The file's ReverseOrientation.
    pub reverse_orientation: bool,
    /// Its material.
    pub material: MaterialId,
    /// `Some` if a MediumInterface with different sides is in force; otherwise a ray stays in the medium that it is in.
    pub media: Option<MediumInterface>,
    /// Its emission.
    pub area_light: Option<AreaLightDescription>,
    /// Opacity: a stochastic cut-out.
    pub alpha: Option<FloatTextureId>,
}

/// Shapes that stand together in several places, or in none.
#[derive(Clone, Debug)]
pub struct ObjectDescription {
    /// Name in the file.
    pub name: String,
    /// Its shapes; `object_to_world` leads to the object's space instead. None of them emits.
    pub shapes: Vec<ShapeDescription>,
}

/// A place of an object.
#[derive(Clone, Debug)]
pub struct InstanceDescription {
    /// Where it was said.
    pub place: Place,
    /// Index into [`SceneDescription::objects`].
    pub object: usize,
    /// The object's space to world space.
    pub object_to_world: Mat4,
}

/// Forms of shapes in object space.
#[derive(Clone, Debug)]
pub enum GeometryDescription {
    /// Triangles.
    Mesh {
        /// Vertex positions.
        positions: Vec<Vec3>,
        /// Normals per vertex, or empty.
        normals: Vec<Vec3>,
        /// Texture coordinates per vertex, or empty.
        uvs: Vec<Vec2>,
        /// Three vertex numbers per triangle.
        indices: Vec<[u32; 3]>,
    },
    /// A sphere around the origin, possibly partial.
    Sphere {
        /// Radius.
        radius: f32,
        /// Lower cut in z.
        z_min: f32,
        /// Upper cut in z.
        z_max: f32,
        /// Sweep \[degrees\].
        phi_max: f32,
    },
    /// A disk across the z axis.
    Disk {
        /// Height along z.
        height: f32,
        /// Radius.
        radius: f32,
        /// Radius of the hole.
        inner_radius: f32,
        /// Sweep \[degrees\].
        phi_max: f32,
    },
    /// A cylinder around the z axis.
    Cylinder {
        /// Radius.
        radius: f32,
        /// Lower end.
        z_min: f32,
        /// Upper end.
        z_max: f32,
        /// Sweep \[degrees\].
        phi_max: f32,
    },
}
