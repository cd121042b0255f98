//! Primitives continued beyond their edges, in f64: for solvers that follow a smooth surface.

use moonmilk_core::DVec3;
use moonmilk_core::glam::DMat3;

use crate::accel::Accel;
use crate::place::Placement;
use crate::quadric::Quadric;
use crate::ray::Hit;
use crate::shape::Form;

/// The primitive at a hit, continued beyond its edges: the plane of a triangle with its linear normals, the whole of a quadric.
#[derive(Clone, Copy, Debug)]
pub struct Patch<'a> {
    surface: Continued<'a>,
    reverse: bool,
}

#[derive(Clone, Copy, Debug)]
enum Continued<'a> {
    Triangle {
        corner: DVec3,
        edges: [DVec3; 2],
        /// Unit normal by winding.
        n: DVec3,
        /// Normals of the corners.
        normals: Option<[DVec3; 3]>,
    },
    Quadric {
        quadric: &'a Quadric,
        placed: Option<&'a Placement>,
    },
}

/// A point of a patch.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Distance along the line.
    pub t: f64,
    /// The point.
    pub p: DVec3,
    /// Unit geometric normal, as [`crate::Surface::ng`].
    pub ng: DVec3,
    /// Unit shading normal, as [`crate::Surface::ns`].
    pub ns: DVec3,
}

impl Accel {
    /// Returns the primitive at a hit, continued.
    pub fn patch(&self, hit: &Hit) -> Patch<'_> {
        let (shape, placed) = self.shape_at(hit);
        let surface = match &shape.form {
            Form::Quadric(quadric) => Continued::Quadric { quadric, placed },
            Form::Mesh(m) => {
                let point = |p: moonmilk_core::Vec3| {
                    let p = p.as_dvec3();
                    placed.map_or(p, |placed| placed.to_world.transform_point3(p))
                };
                let [a, b, c] = m.corners(hit.index).map(point);
                let edges = [b - a, c - a];
                // A mirror image turns the winding round.
                let turned = placed.is_some_and(|p| p.to_world.matrix3.determinant() < 0.0);
                let n = edges[0].cross(edges[1]).normalize() * if turned { -1.0 } else { 1.0 };
                let inverse = placed.map_or(DMat3::IDENTITY, |p| p.to_object.matrix3.transpose());
                let normals = (!m.normals().is_empty())
                    .then(|| m.indices()[hit.index as usize].map(|v| inverse * m.normals()[v as usize].as_dvec3()));
                Continued::Triangle { corner: a, edges, n, normals }
            }
        };
        Patch { surface, reverse: shape.reverse }
    }
}

impl Patch<'_> {
    /// Returns where a line meets the patch; of two points the one closer to the distance `near`. `None` if it passes by.
    pub fn meet(&self, o: DVec3, d: DVec3, near: f64) -> Option<Contact> {
        let (t, p, ng, ns) = match self.surface {
            Continued::Triangle { corner, edges, n, normals } => {
                let t = (corner - o).dot(n) / d.dot(n);
                let p = o + d * t;
                let ng = if self.reverse { -n } else { n };
                let ns = normals.and_then(|normals| {
                    // Weights of the second and third corner.
                    let q = p - corner;
                    let whole = edges[0].cross(edges[1]);
                    let area = whole.length_squared();
                    let (v, w) = (q.cross(edges[1]).dot(whole) / area, edges[0].cross(q).dot(whole) / area);
                    let sum = normals[0] * (1.0 - v - w) + normals[1] * v + normals[2] * w;
                    sum.try_normalize().map(|n| if n.dot(ng) < 0.0 { -n } else { n })
                });
                (t, p, ng, ns.unwrap_or(ng))
            }
            Continued::Quadric { quadric, placed } => {
                let (from, along) =
                    placed.map_or((o, d), |m| (m.to_object.transform_point3(o), m.to_object.transform_vector3(d)));
                let t = quadric.crossings(from, along).into_iter().flatten().min_by(|a, b| {
                    let away = |t: &f64| (t - near).abs();
                    away(a).total_cmp(&away(b))
                })?;
                let n = quadric.outward_normal(from + along * t);
                let n = placed.map_or(n, |m| (m.to_object.matrix3.transpose() * n).normalize());
                let n = if self.reverse { -n } else { n };
                (t, o + d * t, n, n)
            }
        };
        (t.is_finite() && p.is_finite()).then_some(Contact { t, p, ng, ns })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::bumpy_sphere;
    use crate::{Mesh, Ray, Shape};
    use moonmilk_core::glam::DAffine3;
    use moonmilk_core::{Mat4, Random, Stream, Vec3};

    fn direction(r: &mut Stream) -> Vec3 {
        let (z, phi) = (2.0 * r.uniform() - 1.0, std::f32::consts::TAU * r.uniform());
        let s = (1.0 - z * z).sqrt();
        Vec3::new(s * phi.cos(), s * phi.sin(), z)
    }

    #[test]
    fn patches_are_the_surface_at_their_hit_also_placed_mirrored_and_reversed() {
        let m = bumpy_sphere(2, 0.2);
        let normals = m.positions().iter().map(|p| p.normalize()).collect();
        let mesh = Mesh::new(m.positions().to_vec(), normals, vec![], m.indices().to_vec()).unwrap();
        let kind = crate::QuadricKind::Sphere { radius: 1.0, z_min: -1.0, z_max: 1.0, phi_max: std::f64::consts::TAU };
        let ellipsoid = Quadric::new(kind, &Mat4::from_scale(Vec3::new(1.0, 0.7, 1.3))).unwrap();
        let mirror = DAffine3::from_scale(DVec3::new(-1.2, 0.8, 1.0)) * DAffine3::from_rotation_y(0.4);
        let mut r = Stream::new(&[1]);
        let mut count = 0;
        for shape in [Shape::from(mesh.clone()), Shape::from(mesh).reversed(), Shape::from(ellipsoid)] {
            let world = Accel::build(vec![shape.clone()]);
            let placed = Accel::with_instances(vec![], vec![vec![shape]], &[(0, mirror)]).unwrap();
            for accel in [world, placed] {
                for _ in 0..200 {
                    let ray = Ray::new(direction(&mut r) * 0.3, direction(&mut r));
                    let Some(hit) = accel.nearest(&ray) else { continue };
                    let s = accel.surface(&ray, &hit);
                    let patch = accel.patch(&hit);
                    let c = patch.meet(ray.o.as_dvec3(), ray.d.as_dvec3(), f64::from(hit.t)).unwrap();
                    // Rounding of f32 coordinates of order 1.
                    assert!(c.p.as_vec3().distance(s.p) < 3e-6 && (c.t as f32 - hit.t).abs() < 3e-6);
                    assert!(c.ng.as_vec3().distance(s.ng) < 3e-6 && c.ns.as_vec3().distance(s.ns) < 1e-5);
                    count += 1;
                }
            }
        }
        assert!(count > 1000, "{count}");
    }
}
