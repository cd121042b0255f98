//! Spheres, cylinders and disks under an affine transform, as pbrt defines them, full or partial.
//!
//! Rays are taken to object space in f64, where the roots of the quadratic are exact to far below f32's resolution.
//! A ray that starts on the surface does not recompute the root that should be zero: it takes the other one.

use std::f64::consts::{PI, TAU};

use moonmilk_core::glam::{DAffine3, DMat4, DVec3};
use moonmilk_core::{Mat4, Vec2, Vec3};

use crate::bounds::Bounds;
use crate::ray::Surface;

/// Form in object space; angles in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum QuadricKind {
    /// Sphere around the origin, cut at `z_min <= z <= z_max` and `phi <= phi_max`.
    Sphere {
        /// Radius.
        radius: f64,
        /// Lower cut.
        z_min: f64,
        /// Upper cut.
        z_max: f64,
        /// Sweep around z \[radians\].
        phi_max: f64,
    },
    /// Cylinder around the z axis, without caps.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Lower end.
        z_min: f64,
        /// Upper end.
        z_max: f64,
        /// Sweep around z \[radians\].
        phi_max: f64,
    },
    /// Disk or ring across the z axis; its normal is +z.
    Disk {
        /// Height along z.
        height: f64,
        /// Outer radius.
        radius: f64,
        /// Radius of the hole.
        inner_radius: f64,
        /// Sweep around z \[radians\].
        phi_max: f64,
    },
}

/// A quadric in world space.
#[derive(Clone, Debug)]
pub struct Quadric {
    kind: QuadricKind,
    to_world: DAffine3,
    to_object: DAffine3,
    /// Smallest and largest factor by which `to_world` stretches a length.
    stretch: [f64; 2],
    /// Cuts are widened by this in object space, so that surfaces that meet at a rim leave no gap: 8 times the spacing
    /// of f32 at the largest world coordinate.
    tolerance: f64,
}

/// One crossing of a line with a quadric.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Root {
    pub(crate) t: f64,
    /// Leaves through the outward side.
    pub(crate) exiting: bool,
}

impl Quadric {
    /// Returns a quadric under an affine object-to-world transform, or `None` if the transform is singular, anything is
    /// not finite, or the form is empty.
    pub fn new(kind: QuadricKind, object_to_world: &Mat4) -> Option<Self> {
        let m = DMat4::from_cols_array(&object_to_world.to_cols_array().map(f64::from));
        Self::of(kind, DAffine3::from_mat4(m))
    }

    /// Returns the quadric moved by a further transform, `None` as for [`Quadric::new`].
    pub(crate) fn moved(&self, by: &DAffine3) -> Option<Self> {
        Self::of(self.kind, *by * self.to_world)
    }

    fn of(kind: QuadricKind, to_world: DAffine3) -> Option<Self> {
        let to_object = to_world.inverse();
        let kind = kind.cleaned()?;
        if !to_world.is_finite() || !to_object.is_finite() {
            return None;
        }
        let stretch = stretch_of(&to_world);
        let mut q = Self { kind, to_world, to_object, stretch, tolerance: 0.0 };
        let magnitude = f64::from(q.bounds().magnitude());
        q.tolerance = magnitude / stretch[0] * 0.5f64.powi(20);
        (magnitude.is_finite() && q.tolerance.is_finite()).then_some(q)
    }

    /// Returns a full sphere in world space, or `None` unless the radius is positive and finite.
    pub fn sphere(center: Vec3, radius: f32) -> Option<Self> {
        let r = f64::from(radius);
        let kind = QuadricKind::Sphere { radius: r, z_min: -r, z_max: r, phi_max: TAU };
        Self::new(kind, &Mat4::from_translation(center))
    }

    /// Returns the form in object space.
    pub fn kind(&self) -> QuadricKind {
        self.kind
    }

    /// Returns centre and radius if this is a full sphere under a similarity.
    pub fn as_ball(&self) -> Option<(DVec3, f64)> {
        match self.kind {
            QuadricKind::Sphere { radius, .. }
                if self.is_closed() && self.stretch[1] <= self.stretch[0] * (1.0 + 1e-6) =>
            {
                Some((self.to_world.translation, radius * self.stretch[0]))
            }
            _ => None,
        }
    }

    /// Returns whether the surface is a whole sphere or ellipsoid.
    pub fn is_closed(&self) -> bool {
        matches!(self.kind, QuadricKind::Sphere { radius, z_min, z_max, phi_max } if z_min <= -radius && z_max >= radius && phi_max >= TAU)
    }

    /// Returns the box around the surface, rounded outward.
    pub fn bounds(&self) -> Bounds {
        let m = &self.to_world.matrix3;
        // Half widths of the image of a disk of radius r across z, and of a ball.
        let across = |r: f64| DVec3::from_array([0, 1, 2].map(|i| r * m.x_axis[i].hypot(m.y_axis[i])));
        let (center, half) = match self.kind {
            QuadricKind::Sphere { radius, .. } => (
                DVec3::ZERO,
                DVec3::from_array(
                    [0, 1, 2].map(|i| radius * DVec3::new(m.x_axis[i], m.y_axis[i], m.z_axis[i]).length()),
                ),
            ),
            QuadricKind::Cylinder { radius, z_min, z_max, .. } => {
                (DVec3::Z * (0.5 * (z_min + z_max)), across(radius) + m.z_axis.abs() * (0.5 * (z_max - z_min)))
            }
            QuadricKind::Disk { height, radius, .. } => (DVec3::Z * height, across(radius)),
        };
        let center = self.to_world.transform_point3(center);
        // One part in 2^22 exceeds the rounding to f32.
        let half = half + (center.abs() + half) * (0.5f64.powi(22));
        Bounds { min: (center - half).as_vec3(), max: (center + half).as_vec3() }
    }

    /// Returns the area [L^2]: closed form under a similarity, otherwise by the midpoint rule in 512 x 512 cells.
    pub fn area(&self) -> f64 {
        let object = self.object_area();
        if self.stretch[1] <= self.stretch[0] * (1.0 + 1e-6) {
            return object * self.stretch[0] * self.stretch[0];
        }
        let n = 512;
        let cell = |i: usize, j: usize| {
            let u = [(i as f64 + 0.5) / n as f64, (j as f64 + 0.5) / n as f64];
            self.area_stretch(self.object_sample(u).1)
        };
        let sum: f64 = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).map(|(i, j)| cell(i, j)).sum();
        object * sum / (n * n) as f64
    }

    /// Returns the volume of a full sphere or ellipsoid [L^3], 0 for open forms.
    pub fn volume(&self) -> f64 {
        match self.kind {
            QuadricKind::Sphere { radius, .. } if self.is_closed() => {
                4.0 / 3.0 * PI * radius.powi(3) * self.to_world.matrix3.determinant().abs()
            }
            _ => 0.0,
        }
    }

    /// Returns a point on the surface for two uniform variates, its outward unit normal, and the density per area
    /// [1/L^2] (uniform under a similarity).
    pub fn sample_area(&self, u: [f32; 2]) -> (Vec3, Vec3, f32) {
        let (p, n) = self.object_sample(u.map(f64::from));
        let pdf = 1.0 / (self.object_area() * self.area_stretch(n));
        (self.to_world.transform_point3(p).as_vec3(), self.normal_to_world(n).as_vec3(), pdf as f32)
    }

    /// Returns the point of [`Quadric::sample_area`] unrounded, with its texture coordinates.
    pub fn sample_point(&self, u: [f64; 2]) -> (DVec3, Vec2) {
        let p = self.to_world.transform_point3(self.object_sample(u).0);
        (p, self.surface(p).uv)
    }

    /// Returns the outward unit normal at a point of the surface, or next to it.
    pub fn outward_normal(&self, p: DVec3) -> DVec3 {
        self.normal_to_world(self.object_normal(self.to_object.transform_point3(p)))
    }

    /// Returns the density per area [1/L^2] with which [`Quadric::sample_area`] finds a point of the surface.
    pub fn pdf_area(&self, p: Vec3) -> f32 {
        let n = self.object_normal(self.to_object.transform_point3(p.as_dvec3()));
        (1.0 / (self.object_area() * self.area_stretch(n))) as f32
    }

    /// Returns the up to two crossings of a line with the form, in order of t; `on_surface`: the origin lies on it.
    #[inline]
    pub(crate) fn roots(&self, o: Vec3, d: Vec3, on_surface: bool) -> [Option<Root>; 2] {
        let (o, d) = (self.to_object.transform_point3(o.as_dvec3()), self.to_object.transform_vector3(d.as_dvec3()));
        let keep = |t: f64, exiting: bool| self.covers(o + d * t).then_some(Root { t, exiting });
        let (o2, d2, r) = match self.kind {
            QuadricKind::Disk { height, .. } => {
                // A plane that the ray starts on is not met again.
                if on_surface || d.z == 0.0 {
                    return [None, None];
                }
                return [keep((height - o.z) / d.z, d.z > 0.0), None];
            }
            QuadricKind::Sphere { radius, .. } => (o, d, radius),
            QuadricKind::Cylinder { radius, .. } => (o.with_z(0.0), d.with_z(0.0), radius),
        };
        let (a, b) = (d2.length_squared(), o2.dot(d2));
        if a == 0.0 {
            return [None, None];
        }
        if on_surface {
            // c = 0 by construction: the other root is -2b/a; the ray enters at the smaller and leaves at the larger root.
            let t = -2.0 * b / a;
            return [keep(t, t > 0.0), None];
        }
        // Discriminant from the distance of the line to the centre [Haines2019].
        let foot = o2 - d2 * (b / a);
        let s = r * r - foot.length_squared();
        if s < 0.0 {
            return [None, None];
        }
        let h = (s / a).sqrt();
        [keep(-b / a - h, false), keep(-b / a + h, true)]
    }

    /// Returns where a line crosses the whole sphere, cylinder or plane of the form.
    pub(crate) fn crossings(&self, o: DVec3, d: DVec3) -> [Option<f64>; 2] {
        let (o, d) = (self.to_object.transform_point3(o), self.to_object.transform_vector3(d));
        let (o, d, r) = match self.kind {
            QuadricKind::Disk { height, .. } => return [Some((height - o.z) / d.z), None],
            QuadricKind::Sphere { radius, .. } => (o, d, radius),
            QuadricKind::Cylinder { radius, .. } => (o.with_z(0.0), d.with_z(0.0), radius),
        };
        let (a, b) = (d.length_squared(), o.dot(d));
        let foot = o - d * (b / a);
        let s = r * r - foot.length_squared();
        if s >= 0.0 { [-1.0, 1.0].map(|sign| Some(sign * (s / a).sqrt() - b / a)) } else { [None, None] }
    }

    /// Returns whether a direction from a point on a sphere or cylinder points outward or along it; false for a disk,
    /// which is flat.
    pub(crate) fn heads_outward(&self, o: Vec3, d: Vec3) -> bool {
        let (o, d) = (self.to_object.transform_point3(o.as_dvec3()), self.to_object.transform_vector3(d.as_dvec3()));
        match self.kind {
            QuadricKind::Sphere { .. } => o.dot(d) >= 0.0,
            QuadricKind::Cylinder { .. } => o.with_z(0.0).dot(d) >= 0.0,
            QuadricKind::Disk { .. } => false,
        }
    }

    /// Returns how far a point near a closed quadric lies outside, negative inside, to first order in that distance. [L]
    pub(crate) fn outside_by(&self, p: Vec3) -> f64 {
        let QuadricKind::Sphere { radius, .. } = self.kind else {
            return f64::INFINITY;
        };
        let q = self.to_object.transform_point3(p.as_dvec3());
        (q.length() - radius) / (self.to_object.matrix3.transpose() * self.object_normal(q)).length()
    }

    /// Returns a lower bound of the distance from a point to the surface, exact for a ball. [L]
    pub(crate) fn distance_bound(&self, p: Vec3) -> f64 {
        let q = self.to_object.transform_point3(p.as_dvec3());
        self.stretch[0] * self.object_distance(q)
    }

    /// Returns the point of the surface found by projecting a world point in object space (the closest one under a
    /// similarity), and its outward unit normal.
    #[inline]
    pub(crate) fn point_and_normal(&self, p: DVec3) -> (Vec3, Vec3) {
        let q = self.project(self.to_object.transform_point3(p));
        (self.to_world.transform_point3(q).as_vec3(), self.normal_to_world(self.object_normal(q)).as_vec3())
    }

    /// Returns the surface next to a world point, with pbrt's (u, v) and derivatives.
    pub(crate) fn surface(&self, p: DVec3) -> Surface {
        let q = self.project(self.to_object.transform_point3(p));
        let n = self.normal_to_world(self.object_normal(q)).as_vec3();
        let mut phi = q.y.atan2(q.x);
        if phi < 0.0 {
            phi += TAU;
        }
        let rho = q.x.hypot(q.y);
        let (cos, sin) = if rho > 0.0 { (q.x / rho, q.y / rho) } else { (1.0, 0.0) };
        let (phi_max, v, dpdv) = match self.kind {
            QuadricKind::Sphere { radius, z_min, z_max, phi_max } => {
                let theta = |z: f64| (z / radius).clamp(-1.0, 1.0).acos();
                let (low, high) = (theta(z_min), theta(z_max));
                let dpdv = DVec3::new(q.z * cos, q.z * sin, -rho) * (high - low);
                (phi_max, (theta(q.z) - low) / (high - low), dpdv)
            }
            QuadricKind::Cylinder { z_min, z_max, phi_max, .. } => {
                (phi_max, (q.z - z_min) / (z_max - z_min), DVec3::Z * (z_max - z_min))
            }
            QuadricKind::Disk { radius, inner_radius, phi_max, .. } => {
                let dpdv = DVec3::new(cos, sin, 0.0) * (inner_radius - radius);
                (phi_max, (radius - rho) / (radius - inner_radius), dpdv)
            }
        };
        let dpdu = DVec3::new(-q.y, q.x, 0.0) * phi_max;
        let vector = |v: DVec3| self.to_world.transform_vector3(v).as_vec3();
        Surface {
            p: self.to_world.transform_point3(q).as_vec3(),
            ng: n,
            ns: n,
            uv: Vec2::new((phi / phi_max) as f32, v as f32),
            dpdu: vector(dpdu),
            dpdv: vector(dpdv),
        }
    }

    /// Returns whether the surface may pass within a distance of a world point (never false if it does).
    pub(crate) fn is_near(&self, p: Vec3, distance: f64) -> bool {
        self.distance_bound(p) <= distance
    }

    /// Returns whether an object point of the unbounded form lies on the part that is kept.
    fn covers(&self, p: DVec3) -> bool {
        let (low, high, phi_max) = match self.kind {
            _ if self.is_closed() => return true,
            QuadricKind::Sphere { z_min, z_max, phi_max, .. } | QuadricKind::Cylinder { z_min, z_max, phi_max, .. } => {
                (z_min, z_max, phi_max)
            }
            QuadricKind::Disk { radius, inner_radius, phi_max, .. } => {
                let rho = p.x.hypot(p.y);
                if rho > radius + self.tolerance || rho < inner_radius - self.tolerance {
                    return false;
                }
                (f64::NEG_INFINITY, f64::INFINITY, phi_max)
            }
        };
        let mut phi = p.y.atan2(p.x);
        if phi < 0.0 {
            phi += TAU;
        }
        p.z >= low - self.tolerance && p.z <= high + self.tolerance && phi <= phi_max
    }

    /// Distance in object space from a point to the form, cuts in phi and sphere cuts in z ignored (so: a lower bound).
    fn object_distance(&self, q: DVec3) -> f64 {
        match self.kind {
            QuadricKind::Sphere { radius, .. } => (q.length() - radius).abs(),
            _ => q.distance(self.project(q)),
        }
    }

    /// Object point on the form closest to q, cuts in phi and sphere cuts in z ignored.
    fn project(&self, q: DVec3) -> DVec3 {
        let rho = q.x.hypot(q.y);
        let radial = if rho > 0.0 { DVec3::new(q.x / rho, q.y / rho, 0.0) } else { DVec3::X };
        match self.kind {
            QuadricKind::Sphere { radius, .. } => q.try_normalize().unwrap_or(DVec3::Z) * radius,
            QuadricKind::Cylinder { radius, z_min, z_max, .. } => radial * radius + DVec3::Z * q.z.clamp(z_min, z_max),
            QuadricKind::Disk { height, radius, inner_radius, .. } => {
                radial * rho.clamp(inner_radius, radius) + DVec3::Z * height
            }
        }
    }

    fn object_normal(&self, q: DVec3) -> DVec3 {
        match self.kind {
            QuadricKind::Sphere { .. } => q.try_normalize().unwrap_or(DVec3::Z),
            QuadricKind::Cylinder { .. } => q.with_z(0.0).try_normalize().unwrap_or(DVec3::X),
            QuadricKind::Disk { .. } => DVec3::Z,
        }
    }

    /// Outward in object space stays outward in world space, also for a mirror image.
    fn normal_to_world(&self, n: DVec3) -> DVec3 {
        (self.to_object.matrix3.transpose() * n).normalize()
    }

    /// Ratio of a world area to the object area it is the image of, for an object normal.
    fn area_stretch(&self, n: DVec3) -> f64 {
        (self.to_object.matrix3.transpose() * n).length() * self.to_world.matrix3.determinant().abs()
    }

    fn object_area(&self) -> f64 {
        match self.kind {
            QuadricKind::Sphere { radius, z_min, z_max, phi_max }
            | QuadricKind::Cylinder { radius, z_min, z_max, phi_max } => phi_max * radius * (z_max - z_min),
            QuadricKind::Disk { radius, inner_radius, phi_max, .. } => {
                0.5 * phi_max * (radius * radius - inner_radius * inner_radius)
            }
        }
    }

    /// Uniform point in object space, with its outward normal.
    fn object_sample(&self, u: [f64; 2]) -> (DVec3, DVec3) {
        let around =
            |phi_max: f64, rho: f64, z: f64| DVec3::new(rho * (u[0] * phi_max).cos(), rho * (u[0] * phi_max).sin(), z);
        let p = match self.kind {
            QuadricKind::Sphere { radius, z_min, z_max, phi_max } => {
                // Archimedes: z is uniform.
                let z = z_min + (z_max - z_min) * u[1];
                around(phi_max, (radius * radius - z * z).max(0.0).sqrt(), z)
            }
            QuadricKind::Cylinder { radius, z_min, z_max, phi_max } => {
                around(phi_max, radius, z_min + (z_max - z_min) * u[1])
            }
            QuadricKind::Disk { height, radius, inner_radius, phi_max } => {
                let (r2, i2) = (radius * radius, inner_radius * inner_radius);
                around(phi_max, (i2 + (r2 - i2) * u[1]).sqrt(), height)
            }
        };
        (p, self.object_normal(p))
    }
}

impl QuadricKind {
    /// Clamps the cuts to the form; `None` if nothing is left or a number is not finite.
    fn cleaned(self) -> Option<Self> {
        let order = |a: f64, b: f64, r: f64| (a.min(b).clamp(-r, r), a.max(b).clamp(-r, r));
        let sweep = |phi: f64| phi.clamp(0.0, TAU);
        let finite = |x: &[f64]| x.iter().all(|x| x.is_finite());
        match self {
            Self::Sphere { radius, z_min, z_max, phi_max } => {
                let (z_min, z_max) = order(z_min, z_max, radius.max(0.0));
                (finite(&[radius, phi_max, z_min, z_max]) && radius > 0.0 && z_max > z_min && phi_max > 0.0)
                    .then_some(Self::Sphere { radius, z_min, z_max, phi_max: sweep(phi_max) })
            }
            Self::Cylinder { radius, z_min, z_max, phi_max } => {
                let (low, high) = (z_min.min(z_max), z_min.max(z_max));
                (finite(&[radius, low, high, phi_max]) && radius > 0.0 && high > low && phi_max > 0.0)
                    .then_some(Self::Cylinder { radius, z_min: low, z_max: high, phi_max: sweep(phi_max) })
            }
            Self::Disk { height, radius, inner_radius, phi_max } => {
                let inner_radius = inner_radius.max(0.0);
                (finite(&[height, radius, inner_radius, phi_max]) && radius > inner_radius && phi_max > 0.0)
                    .then_some(Self::Disk { height, radius, inner_radius, phi_max: sweep(phi_max) })
            }
        }
    }
}

/// Smallest and largest singular value of the linear part: square roots of the eigenvalues of M^T M [Smith1961].
pub(crate) fn stretch_of(m: &DAffine3) -> [f64; 2] {
    let m = m.matrix3;
    let a = m.transpose() * m;
    let (d, e) = (a.x_axis.x.max(a.y_axis.y).max(a.z_axis.z), [a.y_axis.x, a.z_axis.x, a.z_axis.y]);
    let off = e.iter().map(|x| x * x).sum::<f64>();
    let q = (a.x_axis.x + a.y_axis.y + a.z_axis.z) / 3.0;
    let dev = [a.x_axis.x - q, a.y_axis.y - q, a.z_axis.z - q];
    let p = ((dev.iter().map(|x| x * x).sum::<f64>() + 2.0 * off) / 6.0).sqrt();
    if p <= 1e-13 * d {
        return [q.sqrt(); 2];
    }
    let b = (a - moonmilk_core::glam::DMat3::from_diagonal(DVec3::splat(q))) * (1.0 / p);
    let phi = (0.5 * b.determinant()).clamp(-1.0, 1.0).acos() / 3.0;
    let (high, low) = (q + 2.0 * p * phi.cos(), q + 2.0 * p * (phi + TAU / 3.0).cos());
    // Round towards the safe side by more than the formula's own error.
    [(low.max(0.0)).sqrt() * (1.0 - 1e-9), high.sqrt() * (1.0 + 1e-9)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ellipsoid() -> Quadric {
        let m = Mat4::from_rotation_x(0.7) * Mat4::from_scale(Vec3::new(1.0, 2.0, -3.0));
        Quadric::new(QuadricKind::Sphere { radius: 1.0, z_min: -1.0, z_max: 1.0, phi_max: TAU }, &m).unwrap()
    }

    #[test]
    fn area_and_volume_match_the_closed_forms() {
        let s = Quadric::sphere(Vec3::ONE, 2.0).unwrap();
        assert!((s.area() / (16.0 * PI) - 1.0).abs() < 1e-6 && (s.volume() / (32.0 / 3.0 * PI) - 1.0).abs() < 1e-6);
        // Surface of the ellipsoid with half axes 1, 2, 3: 48.882145 (elliptic integrals, Carlson's R_G).
        assert!((ellipsoid().area() - 48.882_145).abs() < 2e-4, "{}", ellipsoid().area());
        assert!((ellipsoid().volume() / (8.0 * PI) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn stretch_is_that_of_the_half_axes() {
        let [low, high] = ellipsoid().stretch;
        assert!((low - 1.0).abs() < 1e-6 && (high - 3.0).abs() < 1e-6, "{low} {high}");
    }

    #[test]
    fn normals_point_outward_even_for_a_mirror_image() {
        let q = ellipsoid();
        for i in 0..100 {
            let (p, n, _) = q.sample_area([(i as f32 + 0.5) / 100.0, (i as f32 * 0.618).fract()]);
            assert!(p.dot(n) > 0.0 && (n.length() - 1.0).abs() < 1e-5);
            let s = q.surface(p.as_dvec3());
            // The derivatives are tangent (rounding of vectors of length up to 20).
            assert!(s.ng.dot(s.dpdu).abs() < 1e-4 && s.ng.dot(s.dpdv).abs() < 1e-4);
        }
    }

    #[test]
    fn a_ray_from_the_surface_finds_the_other_side_and_not_itself() {
        let q = Quadric::sphere(Vec3::splat(1000.0), 1.0).unwrap();
        let o = Vec3::splat(1000.0) + Vec3::X;
        let [root, _] = q.roots(o, Vec3::new(-0.6, 0.8, 0.0), true);
        let root = root.unwrap();
        // Coordinates near 1000 are known to 6e-5.
        assert!((root.t - 1.2).abs() < 2e-4 && root.exiting);
        let [root, _] = q.roots(o, Vec3::new(0.6, 0.8, 0.0), true);
        assert!(root.unwrap().t < 0.0);
    }

    #[test]
    fn cuts_remove_what_they_say() {
        let half = QuadricKind::Sphere { radius: 1.0, z_min: 0.0, z_max: 1.0, phi_max: PI };
        let q = Quadric::new(half, &Mat4::IDENTITY).unwrap();
        let ray = |x: f32, y: f32| q.roots(Vec3::new(x, y, 5.0), Vec3::NEG_Z, false).iter().flatten().count();
        assert_eq!((ray(0.1, 0.3), ray(0.1, -0.3)), (1, 0));
        let ring = QuadricKind::Disk { height: 1.0, radius: 2.0, inner_radius: 1.0, phi_max: TAU };
        let q = Quadric::new(ring, &Mat4::IDENTITY).unwrap();
        let ray = |x: f32| q.roots(Vec3::new(x, 0.0, 5.0), Vec3::NEG_Z, false).iter().flatten().count();
        assert_eq!([ray(0.9), ray(1.1), ray(1.9), ray(2.1)], [0, 1, 1, 0]);
        assert!(Quadric::new(half, &Mat4::from_scale(Vec3::new(1.0, 0.0, 1.0))).is_none());
    }
}
