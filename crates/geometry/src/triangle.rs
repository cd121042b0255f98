//! The watertight triangle test, and the closest point on a triangle.
//!
//! Woop, Benthin and Wald \[Woop2013\] make the test watertight by moving to coordinates in which the ray is an axis: each
//! vertex gets a two-dimensional position that depends on the vertex and the ray only, and the test becomes "is the
//! origin inside this planar triangle". We use the same idea with an orthonormal frame (s, t, d) in place of their
//! shear and axis permutation (three lanes at a time, no branch on the largest component of d), and evaluate the edge
//! functions in f64 always: a product of two f32 is exact there and the difference of two such products is rounded once,
//! so every sign is exact. The projected mesh is therefore a true planar image of the closed surface; the signed number of
//! triangles over the origin is zero whatever the rounding of the projection, so no ray enters without leaving.

use moonmilk_core::glam::Vec4;
use moonmilk_core::{Frame, Vec3};

/// Marks a leaf as a quadric.
pub(crate) const QUADRIC: u32 = 0x2000_0000;
/// Marks a leaf whose shape has reversed normals.
pub(crate) const REVERSED: u32 = 0x1000_0000;
/// Largest number of primitives in a scene.
pub const MAX_PRIMS: usize = 0x1000_0000;
/// Keeps the bits of a primitive number a normal f32 (no denormal operands in the unused lane).
const NORMAL_BITS: u32 = 0x4000_0000;

/// A primitive as the BVH stores it, in leaf order: x, y, z of the three corners, then number and marks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaf([f32; 10]);

impl Leaf {
    /// Returns the leaf of a triangle.
    pub(crate) fn triangle([a, b, c]: [Vec3; 3], prim: u32, marks: u32) -> Self {
        Self([a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z, f32::from_bits(prim | marks | NORMAL_BITS)])
    }

    /// Returns the leaf of a quadric.
    pub(crate) fn quadric(prim: u32, marks: u32) -> Self {
        let mut a = [0.0; 10];
        a[9] = f32::from_bits(prim | marks | QUADRIC | NORMAL_BITS);
        Self(a)
    }

    #[inline(always)]
    fn bits(&self) -> u32 {
        self.0[9].to_bits()
    }

    /// Returns the primitive's number.
    #[inline(always)]
    pub(crate) fn prim(&self) -> u32 {
        self.bits() & (MAX_PRIMS as u32 - 1)
    }

    #[inline(always)]
    pub(crate) fn is_quadric(&self) -> bool {
        self.bits() & QUADRIC != 0
    }

    #[inline(always)]
    pub(crate) fn is_reversed(&self) -> bool {
        self.bits() & REVERSED != 0
    }

    /// Returns the three corners.
    #[inline]
    pub(crate) fn corners(&self) -> [Vec3; 3] {
        let a = &self.0;
        [Vec3::new(a[0], a[3], a[6]), Vec3::new(a[1], a[4], a[7]), Vec3::new(a[2], a[5], a[8])]
    }
}

/// What the triangle test needs of a ray: origin and frame, one lane per corner.
#[derive(Clone, Copy)]
pub(crate) struct Projection {
    o: [Vec4; 3],
    s: [Vec4; 3],
    t: [Vec4; 3],
    d: [Vec4; 3],
}

/// A crossing of a ray's line with a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    pub(crate) t: f32,
    /// Weights of the second and third corner.
    pub(crate) b: [f32; 2],
    /// d . n with n = twice the area normal: positive if the ray leaves through the triangle.
    pub(crate) det: f64,
}

impl Projection {
    #[inline(always)]
    pub(crate) fn new(o: Vec3, d: Vec3) -> Self {
        let f = Frame::new(d);
        let splat = |v: Vec3| [Vec4::splat(v.x), Vec4::splat(v.y), Vec4::splat(v.z)];
        Self { o: splat(o), s: splat(f.s), t: splat(f.t), d: splat(d) }
    }

    /// Returns where the line (both directions) crosses a triangle; edges and corners belong to it.
    #[inline(always)]
    pub(crate) fn cross(&self, leaf: &Leaf) -> Option<Crossing> {
        // Project the corners: lane k holds corner k, lane 3 is unused.
        let a = &leaf.0;
        let x = Vec4::from_slice(&a[0..4]) - self.o[0];
        let y = Vec4::from_slice(&a[3..7]) - self.o[1];
        let z = Vec4::from_slice(&a[6..10]) - self.o[2];
        let along = |axis: &[Vec4; 3]| x * axis[0] + y * axis[1] + z * axis[2];
        let [ax, bx, cx, _] = along(&self.s).to_array().map(f64::from);
        let [ay, by, cy, _] = along(&self.t).to_array().map(f64::from);

        // Evaluate the edge functions with exact signs; antisymmetric under exchange of an edge's ends.
        let u = bx * cy - by * cx;
        let v = cx * ay - cy * ax;
        let w = ax * by - ay * bx;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }

        // Interpolate the distance: a convex combination, so it stays within that of the corners.
        let [az, bz, cz, _] = along(&self.d).to_array().map(f64::from);
        let inv = 1.0 / det;
        let t = (u * az + v * bz + w * cz) * inv;
        Some(Crossing { t: t as f32, b: [(v * inv) as f32, (w * inv) as f32], det })
    }
}

/// Returns the point of a triangle closest to p, with the weights of the second and third corner [Ericson2005, 5.1.5].
pub(crate) fn closest_on_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> (Vec3, [f32; 2]) {
    // Work in f64 relative to p: differences of f32 are exact enough that the region tests are never inconsistent.
    let (a, b, c) = ((a.as_dvec3() - p.as_dvec3()), (b.as_dvec3() - p.as_dvec3()), (c.as_dvec3() - p.as_dvec3()));
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (-ab.dot(a), -ac.dot(a));
    let (d3, d4) = (-ab.dot(b), -ac.dot(b));
    let (d5, d6) = (-ab.dot(c), -ac.dot(c));
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let (v, w) = if d1 <= 0.0 && d2 <= 0.0 {
        (0.0, 0.0)
    } else if d3 >= 0.0 && d4 <= d3 {
        (1.0, 0.0)
    } else if d6 >= 0.0 && d5 <= d6 {
        (0.0, 1.0)
    } else if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        (d1 / (d1 - d3), 0.0)
    } else if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        (0.0, d2 / (d2 - d6))
    } else if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        (1.0 - w, w)
    } else {
        let inv = 1.0 / (va + vb + vc);
        (vb * inv, vc * inv)
    };
    ((p.as_dvec3() + a + ab * v + ac * w).as_vec3(), [v as f32, w as f32])
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Random, Stream};

    fn direction(r: &mut Stream) -> Vec3 {
        let (z, phi) = (2.0 * r.uniform() - 1.0, std::f32::consts::TAU * r.uniform());
        let s = (1.0 - z * z).sqrt();
        Vec3::new(s * phi.cos(), s * phi.sin(), z)
    }

    #[test]
    fn a_crossing_lies_on_ray_and_triangle_and_knows_its_side() {
        let mut r = Stream::new(&[1]);
        let mut crossed = 0;
        for _ in 0..20_000 {
            let c = [(); 3].map(|()| direction(&mut r));
            let (o, d) = (direction(&mut r) * 2.0, direction(&mut r));
            let Some(x) = Projection::new(o, d).cross(&Leaf::triangle(c, 7, 0)) else {
                continue;
            };
            crossed += 1;
            let on = c[0] * (1.0 - x.b[0] - x.b[1]) + c[1] * x.b[0] + c[2] * x.b[1];
            // Both points carry a few roundings of coordinates up to 2, amplified along grazing rays.
            let n = (c[1] - c[0]).cross(c[2] - c[0]);
            let cos = n.normalize().dot(d).abs();
            assert!(on.distance(o + d * x.t) < 4e-6 / cos.max(0.01), "{on} {}", o + d * x.t);
            assert_eq!(x.det > 0.0, n.dot(d) > 0.0);
        }
        assert!(crossed > 100, "{crossed}");
    }

    #[test]
    fn rays_through_a_shared_edge_or_vertex_hit_a_triangle_of_the_fan() {
        let mut r = Stream::new(&[2]);
        for i in 0..200_000 {
            // A fan of six triangles around a vertex, slightly out of plane, far from the origin of coordinates.
            let hub = direction(&mut r) * 100.0;
            let rim: Vec<Vec3> = (0..6)
                .map(|k| {
                    let a = k as f32 * std::f32::consts::FRAC_PI_3;
                    hub + Vec3::new(a.cos(), a.sin(), 0.2 * r.uniform())
                })
                .collect();
            let o = hub + Vec3::new(r.uniform() - 0.5, r.uniform() - 0.5, 3.0);
            let target = if i % 2 == 0 { hub } else { hub.lerp(rim[i % 6], r.uniform() * 0.9) };
            let p = Projection::new(o, (target - o).normalize());
            let hits = (0..6).filter(|&k| p.cross(&Leaf::triangle([hub, rim[k], rim[(k + 1) % 6]], 0, 0)).is_some());
            assert!(hits.count() >= 1, "ray {i}");
        }
    }

    #[test]
    fn the_closest_point_beats_every_sampled_point_of_the_triangle() {
        let mut r = Stream::new(&[3]);
        for _ in 0..2000 {
            let c = [(); 3].map(|()| direction(&mut r));
            let p = direction(&mut r) * 2.0 * r.uniform();
            let (q, _) = closest_on_triangle(p, c);
            for _ in 0..50 {
                let [u, v] = r.uniform2();
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let s = c[0] + (c[1] - c[0]) * u + (c[2] - c[0]) * v;
                // Rounding of f32 coordinates of order 1.
                assert!(p.distance(q) <= p.distance(s) + 1e-6);
            }
        }
    }
}
