//! A rectangle through which an infinite light shines: the window of a closed room.
//!
//! Only lines that pass the rectangle carry light, and only towards its +z = (p3 - p0) x (p1 - p0), as seen from where the line starts. So the radiance
//! of such a light depends on the point, and points of the rectangle are what to sample. *Source*: pbrt-v4, `PortalImageInfiniteLight`, without
//! its rectified copy of the picture.

use moonmilk_core::{DVec3, Vec3};

use super::error::LightError;
use crate::description::Place;

/// A rectangle in world space.
#[derive(Clone, Copy, Debug)]
pub struct Portal {
    corner: DVec3,
    /// Edges from the corner.
    edges: [DVec3; 2],
    /// Unit normal, along which light is looked for.
    z: DVec3,
    area: f64,
}

/// How far the corners may be from a rectangle, relative to its size: pbrt-v4's tolerance.
const TOLERANCE: f64 = 1e-3;

impl Portal {
    /// Returns the portal with these corners in order around it. *Errors*: they are no rectangle.
    pub fn new(corners: [Vec3; 4], place: &Place) -> Result<Self, LightError> {
        let [a, b, c, d] = corners.map(|p| p.as_dvec3());
        let (x, y) = (d - a, b - a);
        let size = x.length().min(y.length());
        let rectangle = c.distance(b + x) <= TOLERANCE * size && x.dot(y).abs() <= TOLERANCE * x.length() * y.length();
        let area = x.cross(y).length();
        if !(rectangle && area > 0.0 && area.is_finite()) {
            return Err(LightError::Portal { place: place.clone() });
        }
        Ok(Self { corner: a, edges: [x, y], z: x.cross(y) / area, area })
    }

    /// Returns the way from p along the unit direction d to the rectangle, `None` if the line misses it.
    fn distance(&self, p: Vec3, d: Vec3) -> Option<f64> {
        let (p, d) = (p.as_dvec3(), d.as_dvec3());
        let (height, cos) = ((self.corner - p).dot(self.z), d.dot(self.z));
        if !(height > 0.0 && cos > 0.0) {
            return None;
        }
        let t = height / cos;
        let q = p + d * t - self.corner;
        self.edges.iter().all(|e| (0.0..=1.0).contains(&(q.dot(*e) / e.length_squared()))).then_some(t)
    }

    /// Returns whether light arrives at p from the unit direction d.
    pub fn is_open(&self, p: Vec3, d: Vec3) -> bool {
        self.distance(p, d).is_some()
    }

    /// Returns the direction from p to a point of the rectangle, uniform by area.
    pub fn sample(&self, p: Vec3, u: [f64; 2]) -> Option<Vec3> {
        let to = self.corner + self.edges[0] * u[0] + self.edges[1] * u[1] - p.as_dvec3();
        if to.dot(self.z) > 0.0 { to.try_normalize().map(|d| d.as_vec3()) } else { None }
    }

    /// Returns the density of [`Portal::sample`] [1/sr].
    pub fn pdf(&self, p: Vec3, d: Vec3) -> f32 {
        self.distance(p, d).map_or(0.0, |t| (t * t / (self.area * d.as_dvec3().dot(self.z))) as f32)
    }
}
