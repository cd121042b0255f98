//! Surfaces that emit: triangles, spheres, disks and all other quadrics, and how a point on them is chosen from a reference point.
//!
//! | surface | choice | density [1/sr] |
//! |---|---|---|
//! | triangle, seen large or at uneven distances | uniform in solid angle | 1 / solid angle |
//! | triangle, else | uniform in area | d^2 / (A cos) |
//! | sphere, from outside | uniform in its cone | 1 / (2 pi (1 - cos theta_max)) |
//! | sphere, from inside | uniform over all directions | 1 / (4 pi) |
//! | disk | uniform in area | d^2 / (A cos) |
//! | cylinder; partial or squashed sphere or disk | uniform in area before the transform | p_A d^2 / cos |
//!
//! Which row applies is a function of the reference point alone, so that [`Surface::pdf`] reproduces it. Arithmetic is in f64: cones
//! and triangles of 1e-10 sr and points at 1e-6 of the size of a light are ordinary.

use std::f64::consts::{FRAC_PI_2, PI};

use moonmilk_core::{DVec3, Frame, Vec2, Vec3};
use moonmilk_geometry::{Quadric, QuadricKind};

use super::bounds::LightBounds;
use super::spherical_triangle::{LARGEST, sample_direction, solid_angle};

/// Below this solid angle [sr] a triangle is always sampled by area: the angles of the spherical one would lose their digits.
const TINY: f64 = 1e-7;
/// Above this solid angle [sr] a triangle is always sampled by solid angle.
const LARGE: f64 = 1e-3;
/// Below [`LARGE`], by solid angle if squared distances differ by more than this factor: the weight of area sampling goes with d^3.
const UNEVEN: f64 = 1.2;

/// A surface that emits, in world space.
#[derive(Clone, Debug)]
pub enum Surface {
    /// A triangle.
    Triangle {
        /// Vertices.
        p: [Vec3; 3],
        /// Texture coordinates of the vertices.
        uv: [Vec2; 3],
        /// Unit normal of the emitting side.
        front: Vec3,
    },
    /// A whole sphere.
    Sphere {
        /// Centre.
        center: Vec3,
        /// Radius.
        radius: f32,
        /// Axes of its texture coordinates: u turns around n from s, v runs from -n to n.
        frame: Frame,
        /// Emits inwards.
        inward: bool,
        /// The shape was turned right side out: normals of hits point against the emitting side.
        turned: bool,
    },
    /// A disk, possibly with a hole or only a sector.
    Disk {
        /// Centre.
        center: Vec3,
        /// Axes in its plane, at whose first the sector begins; the sweep is from s to t.
        frame: Frame,
        /// Unit normal of the emitting side: plus or minus the frame's.
        front: Vec3,
        /// Outer radius.
        radius: f32,
        /// Radius of the hole.
        inner_radius: f32,
        /// Sweep \[radians\], at most 2 pi.
        phi_max: f32,
    },
    /// Any other quadric.
    Quadric {
        /// Its form in world space.
        form: Box<Quadric>,
        /// Emits against the outward normal.
        inward: bool,
        /// The shape was turned right side out: normals of hits point against the emitting side.
        turned: bool,
    },
}

/// A point chosen on a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// The point.
    pub point: Vec3,
    /// Unit normal of the emitting side.
    pub front: Vec3,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Unit direction from the reference point.
    pub wi: Vec3,
    /// Distance from the reference point.
    pub distance: f32,
    /// Solid angle density.
    pub pdf: f64,
}

impl Surface {
    /// Returns the area.
    pub fn area(&self) -> f64 {
        match self {
            Self::Triangle { p, .. } => {
                let [a, b, c] = p.map(|v| v.as_dvec3());
                0.5 * (b - a).cross(c - a).length()
            }
            Self::Sphere { radius, .. } => 4.0 * PI * f64::from(*radius).powi(2),
            Self::Disk { radius, inner_radius, phi_max, .. } => {
                0.5 * f64::from(*phi_max) * (f64::from(*radius).powi(2) - f64::from(*inner_radius).powi(2))
            }
            Self::Quadric { form, .. } => form.area(),
        }
    }

    /// Returns where the surface is and where it shines, for a mean radiance.
    pub fn bounds(&self, radiance: f64, two_sided: bool) -> LightBounds {
        let flat = |min: Vec3, max: Vec3, front: Vec3| LightBounds {
            min,
            max,
            axis: front.as_dvec3(),
            theta_o: 0.0,
            theta_e: FRAC_PI_2,
            two_sided,
            intensity: radiance * self.area(),
        };
        match self {
            Self::Triangle { p: [a, b, c], front, .. } => flat(a.min(*b).min(*c), a.max(*b).max(*c), *front),
            Self::Disk { center, front, radius, .. } => {
                let n = front.as_dvec3();
                let half = (DVec3::ONE - n * n).max(DVec3::ZERO).map(f64::sqrt).as_vec3() * *radius * (1.0 + 1e-6);
                flat(*center - half, *center + half, *front)
            }
            Self::Sphere { center, radius, .. } => LightBounds {
                min: *center - *radius,
                max: *center + *radius,
                axis: DVec3::Z,
                theta_o: PI,
                theta_e: FRAC_PI_2,
                two_sided,
                intensity: radiance * 0.25 * self.area(),
            },
            Self::Quadric { form, inward, .. } => {
                let bounds = form.bounds();
                if matches!(form.kind(), QuadricKind::Disk { .. }) {
                    let n = form.outward_normal(DVec3::ZERO).as_vec3();
                    return flat(bounds.min, bounds.max, if *inward { -n } else { n });
                }
                // Normals point all around.
                LightBounds {
                    min: bounds.min,
                    max: bounds.max,
                    axis: DVec3::Z,
                    theta_o: PI,
                    theta_e: FRAC_PI_2,
                    two_sided,
                    intensity: radiance * 0.25 * self.area(),
                }
            }
        }
    }

    /// Returns whether light leaves towards the unit direction `w` at a point where a hit has normal `normal` (used for curved surfaces
    /// only; the fronts of flat ones are known).
    #[inline]
    pub fn emits_towards(&self, w: Vec3, normal: Vec3) -> bool {
        match self {
            Self::Triangle { front, .. } | Self::Disk { front, .. } => front.dot(w) > 0.0,
            Self::Sphere { turned, .. } | Self::Quadric { turned, .. } => (normal.dot(w) > 0.0) != *turned,
        }
    }

    /// Chooses a point from the reference point `p`, for two variates in \[0, 1); `None` where the surface is seen edge on.
    pub fn sample(&self, p: Vec3, u: [f64; 2]) -> Option<SurfacePoint> {
        let origin = p.as_dvec3();
        match self {
            Self::Triangle { p: vertices, uv, front } => {
                let v = vertices.map(|v| v.as_dvec3() - origin);
                let by_angle = angular(&v);
                let [b0, b1, b2] = match by_angle {
                    Some(omega) => barycentric(&v, sample_direction(&v, omega, u)),
                    None => uniform_barycentric(u),
                };
                let to = v[0] * b0 + v[1] * b1 + v[2] * b2;
                let uv = uv[0] * b0 as f32 + uv[1] * b1 as f32 + uv[2] * b2 as f32;
                let pdf = by_angle.map(|omega| 1.0 / omega).or_else(|| triangle_pdf(&v, to));
                finish(origin, to, *front, uv, pdf?)
            }
            Self::Sphere { center, radius, frame, inward, .. } => {
                let (to_center, r) = (center.as_dvec3() - origin, f64::from(*radius));
                let (w, distance) = sphere_direction(to_center, r, u)?;
                let to = w * distance;
                let normal = ((to - to_center) / r).normalize().as_vec3();
                let front = if *inward { -normal } else { normal };
                finish(origin, to, front, sphere_uv(frame, normal), sphere_pdf(to_center, r))
            }
            Self::Disk { center, frame, front, radius, inner_radius, phi_max } => {
                let (outer, inner) = (f64::from(*radius).powi(2), f64::from(*inner_radius).powi(2));
                let r = (inner + u[0] * (outer - inner)).sqrt();
                let (sin, cos) = (u[1] * f64::from(*phi_max)).sin_cos();
                let to = center.as_dvec3() - origin + (frame.s.as_dvec3() * cos + frame.t.as_dvec3() * sin) * r;
                let v = (f64::from(*radius) - r) / f64::from(radius - inner_radius);
                let pdf = area_pdf(self.area(), front.as_dvec3(), to)?;
                finish(origin, to, *front, Vec2::new(u[1] as f32, v as f32), pdf)
            }
            Self::Quadric { form, inward, .. } => {
                let (point, uv) = form.sample_point(u);
                let n = form.outward_normal(point).as_vec3();
                let to = point - origin;
                // The density of the rounded point, as a hit will find it.
                finish(origin, to, if *inward { -n } else { n }, uv, self.pdf(p, point.as_vec3()))
                    .filter(|s| s.pdf > 0.0)
            }
        }
    }

    /// Returns the solid angle density with which [`Surface::sample`] from p chooses the direction to the point q of the surface.
    pub fn pdf(&self, p: Vec3, q: Vec3) -> f64 {
        let origin = p.as_dvec3();
        let to = q.as_dvec3() - origin;
        match self {
            Self::Triangle { p: vertices, .. } => {
                let v = vertices.map(|v| v.as_dvec3() - origin);
                match angular(&v) {
                    Some(omega) => 1.0 / omega,
                    None => triangle_pdf(&v, to).unwrap_or(0.0),
                }
            }
            Self::Sphere { center, radius, .. } => sphere_pdf(center.as_dvec3() - origin, f64::from(*radius)),
            Self::Disk { front, .. } => area_pdf(self.area(), front.as_dvec3(), to).unwrap_or(0.0),
            Self::Quadric { form, .. } => {
                area_pdf(1.0 / f64::from(form.pdf_area(q)), form.outward_normal(q.as_dvec3()), to).unwrap_or(0.0)
            }
        }
    }
}

/// Rounds a chosen point to f32.
fn finish(origin: DVec3, to: DVec3, front: Vec3, uv: Vec2, pdf: f64) -> Option<SurfacePoint> {
    let distance = to.length();
    (distance > 0.0 && pdf.is_finite()).then(|| SurfacePoint {
        point: (origin + to).as_vec3(),
        front,
        uv,
        wi: (to / distance).as_vec3(),
        distance: distance as f32,
        pdf,
    })
}

/// Returns the solid angle of a triangle around the origin if it is to be sampled by it.
#[inline]
fn angular(v: &[DVec3; 3]) -> Option<f64> {
    let omega = solid_angle(v);
    if !(omega > TINY && omega < LARGEST) {
        return None;
    }
    let middle = (v[0] + v[1] + v[2]) / 3.0;
    let d2 = [v[0], v[1], v[2], middle].map(DVec3::length_squared);
    let uneven = d2[0].max(d2[1]).max(d2[2]) > UNEVEN * d2[0].min(d2[1]).min(d2[2]).min(d2[3]);
    (omega > LARGE || uneven).then_some(omega)
}

/// Returns d^2 / (A cos) for a triangle, from its edges: d^3 / |to . (e1 x e2) / 2|.
#[inline]
fn triangle_pdf(v: &[DVec3; 3], to: DVec3) -> Option<f64> {
    // The height of the plane is taken at a vertex, where it is not the difference of rounded points.
    let flux = 0.5 * v[0].dot((v[1] - v[0]).cross(v[2] - v[0])).abs();
    (flux > 0.0).then(|| to.length_squared() * to.length() / flux)
}

/// Returns d^2 / (A cos) for a flat surface.
#[inline]
fn area_pdf(area: f64, normal: DVec3, to: DVec3) -> Option<f64> {
    let flux = area * normal.dot(to).abs();
    (flux > 0.0).then(|| to.length_squared() * to.length() / flux)
}

/// Returns the barycentric coordinates of a point uniform in a triangle.
fn uniform_barycentric(u: [f64; 2]) -> [f64; 3] {
    let s = u[0].sqrt();
    [1.0 - s, s * (1.0 - u[1]), s * u[1]]
}

/// Returns the barycentric coordinates at which a ray from the origin meets a triangle, moved into it by rounding if need be.
fn barycentric(v: &[DVec3; 3], w: DVec3) -> [f64; 3] {
    // Each coordinate is the volume under w of the opposite edge.
    let b = [w.dot(v[1].cross(v[2])), w.dot(v[2].cross(v[0])), w.dot(v[0].cross(v[1]))];
    let sign = b[0] + b[1] + b[2];
    let b = b.map(|x| (x * sign.signum()).max(0.0));
    let sum = b[0] + b[1] + b[2];
    if sum > 0.0 { b.map(|x| x / sum) } else { [1.0 / 3.0; 3] }
}

/// Returns 1 - cos theta_max of the cone of a sphere at distance d > r, without cancellation.
fn cone(to_center: DVec3, r: f64) -> Option<f64> {
    let d2 = to_center.length_squared();
    let sin2 = r * r / d2;
    (sin2 < 1.0).then(|| sin2 / (1.0 + (1.0 - sin2).sqrt()))
}

/// Returns the solid angle density of [`sphere_direction`].
fn sphere_pdf(to_center: DVec3, r: f64) -> f64 {
    cone(to_center, r).map_or(0.25 / PI, |h| 0.5 / (PI * h))
}

/// Returns a direction towards a sphere and the distance at which it is met.
fn sphere_direction(to_center: DVec3, r: f64, u: [f64; 2]) -> Option<(DVec3, f64)> {
    let d2 = to_center.length_squared();
    let (sin_phi, cos_phi) = (2.0 * PI * u[1]).sin_cos();
    let Some(height) = cone(to_center, r) else {
        // From inside, all directions meet the sphere, at the farther of two roots.
        let z = 1.0 - 2.0 * u[0];
        let s = (1.0 - z * z).max(0.0).sqrt();
        let w = DVec3::new(s * cos_phi, s * sin_phi, z);
        let b = w.dot(to_center);
        let distance = b + (b * b + (r * r - d2)).max(0.0).sqrt();
        return (distance > 0.0).then_some((w, distance));
    };
    let axis = to_center / d2.sqrt();
    let (s, t) = axis.any_orthonormal_pair();
    let h = u[0] * height;
    let sin2 = h * (2.0 - h);
    let sin = sin2.sqrt();
    let w = (s * (sin * cos_phi) + t * (sin * sin_phi) + axis * (1.0 - h)).normalize();
    let distance = d2.sqrt() * (1.0 - h) - (r * r - d2 * sin2).max(0.0).sqrt();
    (distance > 0.0).then_some((w, distance))
}

/// Returns pbrt-v4's texture coordinates of a whole sphere at a unit outward normal.
fn sphere_uv(frame: &Frame, normal: Vec3) -> Vec2 {
    let local = frame.to_local(normal);
    let phi = local.y.atan2(local.x);
    let turn = if phi < 0.0 { phi + 2.0 * std::f32::consts::PI } else { phi };
    let theta = local.z.clamp(-1.0, 1.0).acos();
    Vec2::new(turn / (2.0 * std::f32::consts::PI), 1.0 - theta / std::f32::consts::PI)
}
