//! What a surface looks like at a point: normals, texture coordinates, derivatives.

use moonmilk_core::glam::Mat2;
use moonmilk_core::{Frame, Vec2, Vec3};

use crate::mesh::Mesh;
use crate::ray::Surface;

#[inline]
pub(crate) fn interpolate([p0, p1, p2]: [Vec3; 3], b: [f32; 2]) -> Vec3 {
    p0 * (1.0 - b[0] - b[1]) + p1 * b[0] + p2 * b[1]
}

/// Interpolates the normals of a triangle and brings the result to the geometric normal's side.
#[inline]
pub(crate) fn shading_normal(m: &Mesh, triangle: u32, w: [f32; 3], ng: Vec3) -> Vec3 {
    let corner = m.indices()[triangle as usize];
    let sum: Vec3 = corner.iter().zip(w).map(|(&v, w)| m.normals()[v as usize] * w).sum();
    match sum.try_normalize() {
        Some(n) if n.dot(ng) < 0.0 => -n,
        Some(n) => n,
        None => ng,
    }
}

/// Returns the surface at a point of a triangle given by the weights of its second and third corner.
pub(crate) fn mesh_surface(m: &Mesh, triangle: u32, b: [f32; 2], reverse: bool) -> Surface {
    let [p0, p1, p2] = m.corners(triangle);
    let corner = m.indices()[triangle as usize];
    let w = [1.0 - b[0] - b[1], b[0], b[1]];
    let mut ng = (p1 - p0).cross(p2 - p0).normalize();
    if reverse {
        ng = -ng;
    }

    let ns = if m.normals().is_empty() { ng } else { shading_normal(m, triangle, w, ng) };

    // Invert the map from (u, v) to the triangle's plane.
    let uvs = if m.uvs().is_empty() { [Vec2::ZERO, Vec2::X, Vec2::ONE] } else { corner.map(|v| m.uvs()[v as usize]) };
    let uv = uvs[0] * w[0] + uvs[1] * w[1] + uvs[2] * w[2];
    let (e1, e2) = (p1 - p0, p2 - p0);
    let (u1, u2) = (uvs[1] - uvs[0], uvs[2] - uvs[0]);
    let det = Mat2::from_cols(u1, u2).determinant();
    let (mut dpdu, mut dpdv) = ((e1 * u2.y - e2 * u1.y) / det, (e2 * u1.x - e1 * u2.x) / det);
    if !dpdu.is_finite() || !dpdv.is_finite() || dpdu.cross(dpdv) == Vec3::ZERO {
        // Texture coordinates that do not span a plane: any tangents of the triangle's size will do.
        let f = Frame::new(ng);
        let size = e1.length().max(e2.length());
        (dpdu, dpdv) = (f.s * size, f.t * size);
    }
    Surface { p: interpolate([p0, p1, p2], b), ng, ns, uv, dpdu, dpdv }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_follow_the_texture_coordinates() {
        let p = vec![Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 3.0, 0.0)];
        let uv = vec![Vec2::new(0.1, 0.2), Vec2::new(0.6, 0.2), Vec2::new(0.1, 0.95)];
        let m = Mesh::new(p, vec![], uv, vec![[0, 1, 2]]).unwrap();
        let s = mesh_surface(&m, 0, [0.5, 0.25], false);
        // Rounding of sums of three f32 products.
        assert!(s.dpdu.distance(Vec3::new(4.0, 0.0, 0.0)) < 1e-5 && s.dpdv.distance(Vec3::new(0.0, 4.0, 0.0)) < 1e-5);
        assert!(s.uv.distance(Vec2::new(0.35, 0.3875)) < 1e-6 && s.p.distance(Vec3::new(1.0, 0.75, 0.0)) < 1e-6);
    }
}
