//! What a group of lights can do to a point, bounded: where they are, which way they shine, how strongly.
//!
//! *Source*: \[Conty2018\], in the form of pbrt-v4's `LightBounds`, with two differences: the distance is clamped at the radius of
//! the group (a length, so that a scaled scene behaves the same), and zero means *proven* zero: rounding is on the side of keeping
//! a light.

use std::f64::consts::{FRAC_PI_2, PI};

use moonmilk_core::{DVec3, Vec3};

/// Below this cosine a direction counts as proven to be out of reach; the rounding of the bounds below is under 2e-5.
const SLACK: f32 = 1e-4;
/// Smallest cosine that enters an importance: keeps lights at the edge of a cone or horizon in the game.
const FLOOR: f32 = 1e-3;

/// Box, cone of normals and intensity of a light or of several, for building.
#[derive(Clone, Copy, Debug)]
pub struct LightBounds {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
    /// Axis of the cone of normals.
    pub axis: DVec3,
    /// Half angle of the cone of normals, 0 to pi.
    pub theta_o: f64,
    /// Angle from a normal up to which light is emitted, 0 to pi / 2.
    pub theta_e: f64,
    /// Whether light leaves on both sides.
    pub two_sided: bool,
    /// Radiant intensity along the normal (mean over wavelengths) [power / sr].
    pub intensity: f64,
}

impl LightBounds {
    /// Returns the bounds of two groups together.
    pub fn union(&self, o: &Self) -> Self {
        let mut b = *o;
        let mut a = *self;
        // A two-sided cone may be named by either of its axes.
        if a.axis.dot(b.axis) < 0.0 {
            if b.two_sided {
                b.axis = -b.axis;
            } else if a.two_sided {
                a.axis = -a.axis;
            }
        }
        let (axis, theta_o) = cone_union((a.axis, a.theta_o), (b.axis, b.theta_o));
        Self {
            min: a.min.min(b.min),
            max: a.max.max(b.max),
            axis,
            theta_o,
            theta_e: a.theta_e.max(b.theta_e),
            two_sided: a.two_sided || b.two_sided,
            intensity: a.intensity + b.intensity,
        }
    }

    /// Returns the middle of the box.
    pub fn centroid(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// Returns the cost of keeping these lights in one node: intensity x size^2 x solid angle reached \[Conty2018, Eq. 1\].
    pub fn cost(&self) -> f64 {
        let (o, e) = (self.theta_o, self.theta_e);
        let w = (o + e).min(PI);
        let (sin_o, cos_o) = o.sin_cos();
        let reach =
            2.0 * PI * (1.0 - cos_o) + FRAC_PI_2 * (2.0 * w * sin_o - (o - 2.0 * w).cos() - 2.0 * o * sin_o + cos_o);
        self.intensity * reach * f64::from((self.max - self.min).length_squared())
    }
}

/// Returns a cone that holds two cones (axis, half angle).
fn cone_union(a: (DVec3, f64), b: (DVec3, f64)) -> (DVec3, f64) {
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let normal = a.0.cross(b.0);
    let between = normal.length().atan2(a.0.dot(b.0));
    if between + b.1 <= a.1 {
        return a;
    }
    let theta = 0.5 * (a.1 + between + b.1);
    match normal.try_normalize() {
        // Turn the wider cone's axis towards the other so that both edges fit.
        Some(n) if theta < PI => {
            let (sin, cos) = (theta - a.1).sin_cos();
            ((a.0 * cos + n.cross(a.0) * sin).normalize(), theta)
        }
        _ => (a.0, PI),
    }
}

/// [`LightBounds`] in the form that is evaluated: a bounding sphere and the sines and cosines of the angles.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    center: Vec3,
    radius: f32,
    axis: Vec3,
    intensity: f32,
    cos_o: f32,
    sin_o: f32,
    cos_e: f32,
    two_sided: bool,
}

impl Reach {
    /// Prepares bounds, rounded outwards.
    pub fn new(b: &LightBounds) -> Self {
        let center = b.centroid();
        // Measure the radius from the rounded centre, so that the sphere holds the box exactly.
        let far = (b.max - center).abs().max((center - b.min).abs());
        let (sin_o, cos_o) = (b.theta_o + 1e-6).min(PI).sin_cos();
        Self {
            center,
            radius: far.length() * (1.0 + 1e-6),
            axis: b.axis.as_vec3(),
            intensity: b.intensity as f32,
            cos_o: cos_o as f32,
            sin_o: sin_o as f32,
            cos_e: b.theta_e.cos() as f32,
            two_sided: b.two_sided,
        }
    }

    /// Returns an estimate of the irradiance that these lights may cause at p, on a surface of normal n or, without one, in a
    /// medium; 0 only if no point of the box can send light to p or all of it lies below the horizon of n.
    #[inline]
    pub fn importance(&self, p: Vec3, n: Option<Vec3>) -> f32 {
        let v = p - self.center;
        let d2 = v.length_squared();
        let r2 = self.radius * self.radius;
        // Inside the sphere, every direction may be one of light.
        if d2 <= r2 {
            return self.intensity / r2;
        }
        let inv_d = 1.0 / d2.sqrt();
        let away = v * inv_d;
        // Half angle b under which the sphere is seen from p.
        let sin_b = (self.radius * inv_d).min(1.0);
        let cos_b = (1.0 - sin_b * sin_b).max(0.0).sqrt();

        // Smallest angle between the direction to p and a normal of the cone, over all points of the sphere.
        let cos_w = self.axis.dot(away);
        let cos_w = if self.two_sided { cos_w.abs() } else { cos_w };
        let sin_w = self.axis.cross(away).length();
        let (cos_x, sin_x) = minus((cos_w, sin_w), (self.cos_o, self.sin_o));
        let (cos_prime, _) = minus((cos_x, sin_x), (cos_b, sin_b));
        if cos_prime <= self.cos_e - SLACK {
            return 0.0;
        }
        let mut importance = self.intensity * cos_prime.max(FLOOR) / d2;

        // Largest cosine of incidence.
        if let Some(n) = n {
            let (cos_i, _) = minus((-n.dot(away), n.cross(away).length()), (cos_b, sin_b));
            if cos_i <= -SLACK {
                return 0.0;
            }
            importance *= cos_i.max(FLOOR);
        }
        importance
    }
}

/// Returns cosine and sine of max(0, a - b) from the cosines and sines of two angles in \[0, pi\].
#[inline]
fn minus(a: (f32, f32), b: (f32, f32)) -> (f32, f32) {
    if a.0 > b.0 { (1.0, 0.0) } else { (a.0 * b.0 + a.1 * b.1, a.1 * b.0 - a.0 * b.1) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Random, Stream};

    fn direction(r: &mut Stream) -> Vec3 {
        loop {
            let v = Vec3::from_array([0; 3].map(|_| 2.0 * r.uniform() - 1.0));
            if let Some(d) = v.try_normalize().filter(|_| v.length() < 1.0) {
                return d;
            }
        }
    }

    #[test]
    fn no_light_that_shines_on_a_point_has_importance_zero() {
        // Groups of 1 to 8 random one- or two-sided emitting points with normals; a point that sees the front of one, above its
        // own horizon, must give the whole group a positive importance. No statistics: a single failure is a bug.
        let mut r = Stream::new(&[21]);
        let mut checked = 0;
        for _ in 0..200_000 {
            let n_lights = 1 + (r.uniform() * 8.0) as usize;
            let spread = 10f32.powf(4.0 * r.uniform() - 3.0);
            let main = direction(&mut r);
            let two_sided = r.uniform() < 0.3;
            let lights: Vec<(Vec3, Vec3)> = (0..n_lights)
                .map(|_| (direction(&mut r) * spread, (main + 0.5 * direction(&mut r)).normalize()))
                .collect();
            let bounds = lights
                .iter()
                .map(|&(q, m)| LightBounds {
                    min: q,
                    max: q,
                    axis: m.as_dvec3(),
                    theta_o: 0.0,
                    theta_e: FRAC_PI_2,
                    two_sided,
                    intensity: 1.0,
                })
                .reduce(|a, b| a.union(&b))
                .expect("at least one light");
            let reach = Reach::new(&bounds);
            let p = direction(&mut r) * r.uniform() * 3.0;
            let n = (r.uniform() < 0.7).then(|| direction(&mut r));
            let shines = lights.iter().any(|&(q, m)| {
                let w = q - p;
                (two_sided || m.dot(w) < 0.0) && n.is_none_or(|n| n.dot(w) > 0.0)
            });
            if shines {
                checked += 1;
                assert!(reach.importance(p, n) > 0.0, "{lights:?} {p} {n:?}");
            }
        }
        assert!(checked > 50_000);
    }

    #[test]
    fn lights_that_face_away_or_lie_below_the_horizon_have_importance_zero() {
        let lamp = LightBounds {
            min: Vec3::new(-0.1, -0.1, 1.0),
            max: Vec3::new(0.1, 0.1, 1.0),
            axis: DVec3::NEG_Z,
            theta_o: 0.0,
            theta_e: FRAC_PI_2,
            two_sided: false,
            intensity: 1.0,
        };
        let reach = Reach::new(&lamp);
        assert!(reach.importance(Vec3::ZERO, Some(Vec3::Z)) > 0.0);
        assert_eq!(reach.importance(Vec3::ZERO, Some(Vec3::NEG_Z)), 0.0);
        assert_eq!(reach.importance(Vec3::Z * 2.0, None), 0.0);
    }

    #[test]
    fn importance_scales_like_irradiance_with_the_size_of_the_scene() {
        let lamp = |s: f32| LightBounds {
            min: Vec3::new(-0.1, -0.3, 1.0) * s,
            max: Vec3::new(0.2, 0.1, 1.5) * s,
            axis: DVec3::NEG_Z,
            theta_o: 0.3,
            theta_e: FRAC_PI_2,
            two_sided: false,
            intensity: 1.0,
        };
        let p = Vec3::new(0.3, 0.4, 0.2);
        let one = Reach::new(&lamp(1.0)).importance(p, Some(Vec3::Z));
        // A power of two scales floating point exactly.
        assert_eq!(Reach::new(&lamp(1024.0)).importance(p * 1024.0, Some(Vec3::Z)) * 1048576.0, one);
    }
}
