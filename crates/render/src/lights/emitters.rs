//! From shapes of a scene to surfaces that emit.

use std::f32::consts::PI;

use moonmilk_core::glam::Mat3;
use moonmilk_core::{Frame, Mat4, Vec2, Vec3};
use moonmilk_geometry::{Quadric, QuadricKind};

use super::error::LightError;
use super::surface::Surface;
use crate::description::{GeometryDescription, ShapeDescription};

/// How far a transform may be from a rotation with uniform scale and still map spheres to spheres: rounding of f32 matrices.
const SIMILAR: f32 = 1e-4;

/// Texture coordinates of the vertices of a triangle whose mesh has none, as in pbrt-v4.
pub const DEFAULT_UVS: [Vec2; 3] = [Vec2::ZERO, Vec2::X, Vec2::ONE];

/// Returns the surfaces of a shape in world space, one per triangle of a mesh in its order, else a single one.
///
/// Fronts follow pbrt-v4: the cross product of a triangle's edges, or the outside of a sphere or cylinder, or +z of a disk, turned over by
/// `ReverseOrientation` (for triangles also by a transform that mirrors); where vertex normals exist, their side. A mirrored quadric
/// shines outwards, as its normals point.
///
/// *Errors*: transforms that are singular.
pub fn surfaces_of(shape: &ShapeDescription) -> Result<Vec<Surface>, LightError> {
    let m = &shape.object_to_world;
    let linear = Mat3::from_mat4(*m);
    let reverse = if shape.reverse_orientation { -1.0 } else { 1.0 };
    // Forms without a sampling of their own.
    let other = || {
        let form = shape.geometry.quadric().and_then(|kind| Quadric::new(kind, m));
        let form = form.ok_or_else(|| LightError::Shape { place: shape.place.clone(), name: shape.name.clone() })?;
        Ok(vec![Surface::Quadric { form: Box::new(form), inward: shape.reverse_orientation, turned: false }])
    };
    match shape.geometry.as_ref() {
        GeometryDescription::Mesh { positions, normals, uvs, indices } => {
            Ok(triangles(m, &linear, reverse, (positions, normals, uvs, indices)))
        }
        GeometryDescription::Sphere { radius, z_min, z_max, phi_max } => {
            let whole = *z_min <= -radius && *z_max >= *radius && *phi_max >= 360.0;
            let Some((scale, frame)) = similarity(&linear).filter(|_| whole) else {
                return other();
            };
            let (center, radius) = (m.w_axis.truncate(), radius * scale);
            Ok(vec![Surface::Sphere { center, radius, frame, inward: shape.reverse_orientation, turned: false }])
        }
        GeometryDescription::Disk { height, radius, inner_radius, phi_max } => {
            let (x, y) = (linear.x_axis, linear.y_axis);
            let scale = x.length();
            if scale == 0.0 || (y.length() - scale).abs() > SIMILAR * scale || x.dot(y).abs() > SIMILAR * scale * scale
            {
                return other();
            }
            let up = x.cross(y).normalize();
            let frame = Frame { s: x / scale, t: y / scale, n: up };
            // The normal goes with the inverse transpose: to the side of the image of +z.
            let front = up * up.dot(linear.z_axis).signum() * reverse;
            Ok(vec![Surface::Disk {
                center: m.transform_point3(Vec3::Z * *height),
                frame,
                front,
                radius: radius * scale,
                inner_radius: inner_radius * scale,
                phi_max: phi_max.to_radians().min(2.0 * PI),
            }])
        }
        GeometryDescription::Cylinder { .. } => other(),
    }
}

impl GeometryDescription {
    /// Returns the quadric that is described, `None` for a mesh.
    pub(crate) fn quadric(&self) -> Option<QuadricKind> {
        let degrees = |x: f32| f64::from(x).to_radians();
        match *self {
            Self::Mesh { .. } => None,
            Self::Sphere { radius, z_min, z_max, phi_max } => Some(QuadricKind::Sphere {
                radius: radius.into(),
                z_min: z_min.into(),
                z_max: z_max.into(),
                phi_max: degrees(phi_max),
            }),
            Self::Disk { height, radius, inner_radius, phi_max } => Some(QuadricKind::Disk {
                height: height.into(),
                radius: radius.into(),
                inner_radius: inner_radius.into(),
                phi_max: degrees(phi_max),
            }),
            Self::Cylinder { radius, z_min, z_max, phi_max } => Some(QuadricKind::Cylinder {
                radius: radius.into(),
                z_min: z_min.into(),
                z_max: z_max.into(),
                phi_max: degrees(phi_max),
            }),
        }
    }
}

type Mesh<'a> = (&'a [Vec3], &'a [Vec3], &'a [Vec2], &'a [[u32; 3]]);

fn triangles(m: &Mat4, linear: &Mat3, reverse: f32, (positions, normals, uvs, indices): Mesh) -> Vec<Surface> {
    let mirrored = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
    let inverse_transpose = linear.inverse().transpose();
    indices
        .iter()
        .map(|i| {
            let i = i.map(|k| k as usize);
            let p = i.map(|k| m.transform_point3(positions[k]));
            let n = (p[1] - p[0]).as_dvec3().cross((p[2] - p[0]).as_dvec3()).normalize_or_zero().as_vec3();
            let front = if normals.is_empty() {
                n * (reverse * mirrored)
            } else {
                let side = inverse_transpose * (normals[i[0]] + normals[i[1]] + normals[i[2]]) * reverse;
                if side.dot(n) < 0.0 { -n } else { n }
            };
            let uv = if uvs.is_empty() { DEFAULT_UVS } else { i.map(|k| uvs[k]) };
            Surface::Triangle { p, uv, front }
        })
        .collect()
}

/// Returns the scale and the axes of a transform that keeps angles, if it does.
fn similarity(m: &Mat3) -> Option<(f32, Frame)> {
    let scale = m.x_axis.length();
    let (x, y, z) = (m.x_axis / scale, m.y_axis / scale, m.z_axis / scale);
    let unit = [y, z].iter().all(|v| (v.length() - 1.0).abs() < SIMILAR);
    let square = [x.dot(y), y.dot(z), z.dot(x)].iter().all(|c| c.abs() < SIMILAR);
    (scale > 0.0 && unit && square).then_some((scale, Frame { s: x, t: y, n: z }))
}
