//! Points on surfaces for sampling lights, each with its density.

use std::f32::consts::{PI, TAU};

use moonmilk_core::{Frame, Vec3};

/// Returns a point of a triangle, uniform by area, with the barycentric weights of the second and third corner
/// \[Heitz2019\]; its density is 1 / area.
#[inline]
pub fn sample_triangle([a, b, c]: [Vec3; 3], u: [f32; 2]) -> (Vec3, [f32; 2]) {
    // Fold the unit square onto the triangle with little distortion.
    let (b1, b2) = if u[0] < u[1] { (0.5 * u[0], u[1] - 0.5 * u[0]) } else { (u[0] - 0.5 * u[1], 0.5 * u[1]) };
    (a * (1.0 - b1 - b2) + b * b1 + c * b2, [b1, b2])
}

/// A direction towards a light with its density per solid angle.
#[derive(Clone, Copy, Debug)]
pub struct Direction {
    /// Unit vector.
    pub w: Vec3,
    /// Density [1/sr].
    pub pdf: f32,
}

/// Returns a direction uniform in the cone that a sphere fills as seen from p, or `None` from inside it.
///
/// *Accuracy*: stable for small and distant spheres (1 - cos from the squared sine).
pub fn sample_sphere_cone(p: Vec3, center: Vec3, radius: f32, u: [f32; 2]) -> Option<Direction> {
    let (axis, one_minus_cos) = sphere_cone(p, center, radius)?;
    let v = u[0] * one_minus_cos;
    let sin = (v * (2.0 - v)).max(0.0).sqrt();
    let phi = TAU * u[1];
    let w = Frame::new(axis).to_world(Vec3::new(sin * phi.cos(), sin * phi.sin(), 1.0 - v));
    Some(Direction { w: w.normalize(), pdf: 1.0 / (TAU * one_minus_cos) })
}

/// Returns the density per solid angle [1/sr] of [`sample_sphere_cone`] inside its cone, or `None` from inside the sphere.
pub fn pdf_sphere_cone(p: Vec3, center: Vec3, radius: f32) -> Option<f32> {
    sphere_cone(p, center, radius).map(|(_, one_minus_cos)| 1.0 / (TAU * one_minus_cos))
}

/// Axis and 1 - cos of half the opening angle of the cone that a sphere fills.
fn sphere_cone(p: Vec3, center: Vec3, radius: f32) -> Option<(Vec3, f32)> {
    let to = center - p;
    let (axis, distance) = to.try_normalize().map(|a| (a, to.length()))?;
    if distance <= radius {
        return None;
    }
    let sin2 = (radius / distance) * (radius / distance);
    Some((axis, sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())))
}

/// Returns a point uniform by area on a disk around the origin, by the concentric map \[Shirley1997\]; density
/// 1 / (pi radius^2).
pub fn sample_disk(radius: f32, u: [f32; 2]) -> [f32; 2] {
    let (x, y) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if x == 0.0 && y == 0.0 {
        return [0.0; 2];
    }
    let (r, phi) = if x.abs() > y.abs() { (x, PI / 4.0 * (y / x)) } else { (y, PI / 2.0 - PI / 4.0 * (x / y)) };
    [radius * r * phi.cos(), radius * r * phi.sin()]
}

/// Returns the solid angle of a triangle seen from p \[sr\], by [VanOosterom1983, Eq. 8].
pub fn triangle_solid_angle(p: Vec3, corners: [Vec3; 3]) -> f32 {
    let [a, b, c] = corners.map(|q| (q - p).normalize_or_zero());
    let numerator = a.dot(b.cross(c)).abs();
    let denominator = 1.0 + a.dot(b) + b.dot(c) + c.dot(a);
    let angle = 2.0 * numerator.atan2(denominator);
    if angle < 0.0 { angle + TAU } else { angle }
}

/// Returns a direction towards a triangle uniform in solid angle \[Arvo1995\], with the barycentric weights of the point
/// there, or `None` where the triangle fills no angle.
///
/// *Accuracy*: f64 inside; usable between 1e-9 sr and a half space (test: solid angle against area sampling). Callers
/// that see a triangle under less than about 1e-4 sr lose nothing by sampling its area.
pub fn sample_triangle_solid_angle(p: Vec3, corners: [Vec3; 3], u: [f32; 2]) -> Option<(Direction, [f32; 2])> {
    let o = p.as_dvec3();
    let [a, b, c] = corners.map(|q| (q.as_dvec3() - o).normalize_or_zero());
    let (n_ab, n_bc, n_ca) = (a.cross(b).try_normalize()?, b.cross(c).try_normalize()?, c.cross(a).try_normalize()?);
    // Interior angles from the normals of the great circles; their excess over pi is the solid angle.
    let (alpha, beta, gamma) = (n_ab.angle_between(-n_ca), n_bc.angle_between(-n_ab), n_ca.angle_between(-n_bc));
    let area = alpha + beta + gamma - std::f64::consts::PI;
    if area <= 1e-12 {
        return None;
    }

    // Cut off the part u0 of the area by a new vertex on the arc from a to c.
    let (sin, cos) = (u[0] as f64 * area - alpha).sin_cos();
    let (ca, cos_c) = (alpha.cos(), a.dot(b));
    let k1 = cos - ca;
    let k2 = sin + alpha.sin() * cos_c;
    let q = ((k2 * cos - k1 * sin) * ca - k2) / ((k2 * sin + k1 * cos) * alpha.sin());
    let q = if q.is_finite() { q.clamp(-1.0, 1.0) } else { 1.0 };
    let tangent = (c - a * c.dot(a)).try_normalize()?;
    let cut = a * q + tangent * (1.0 - q * q).sqrt();

    // Move from b towards that vertex, uniformly in height.
    let z = 1.0 - u[1] as f64 * (1.0 - cut.dot(b));
    let w = match (cut - b * cut.dot(b)).try_normalize() {
        Some(t) => b * z + t * (1.0 - z * z).max(0.0).sqrt(),
        None => b,
    };

    // Meet the triangle's plane for the weights.
    let [p0, p1, p2] = corners.map(|q| q.as_dvec3() - o);
    let n = (p1 - p0).cross(p2 - p0);
    let hit = w * (p0.dot(n) / w.dot(n));
    let (b1, b2) = ((hit - p0).cross(p2 - p0).dot(n), (p1 - p0).cross(hit - p0).dot(n));
    let scale = 1.0 / n.length_squared();
    let (b1, b2) = ((b1 * scale).clamp(0.0, 1.0), (b2 * scale).clamp(0.0, 1.0));
    let excess = (b1 + b2).max(1.0);
    let direction = Direction { w: w.as_vec3(), pdf: (1.0 / area) as f32 };
    direction.pdf.is_finite().then_some((direction, [(b1 / excess) as f32, (b2 / excess) as f32]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Random, Stream};

    const N: usize = 200_000;

    #[test]
    fn triangle_points_have_the_mean_and_spread_of_the_uniform_law() {
        let t = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 2.5, 3.0), Vec3::new(0.0, 6.0, 2.0)];
        let mut r = Stream::new(&[20]);
        let (mut m1, mut m2) = ([0f64; 2], 0f64);
        for _ in 0..N {
            let (p, b) = sample_triangle(t, r.uniform2());
            assert!(b[0] >= 0.0 && b[1] >= 0.0 && b[0] + b[1] <= 1.0 + 1e-6);
            assert!(p.distance(t[0] * (1.0 - b[0] - b[1]) + t[1] * b[0] + t[2] * b[1]) < 1e-5);
            m1[0] += f64::from(b[0]);
            m1[1] += f64::from(b[1]);
            m2 += f64::from(b[0] * b[1]);
        }
        // Uniform weights: E b = 1/3, var b = 1/18, E b1 b2 = 1/12, var = 1/90 - 1/144 = 0.00417; |z| < 4.9 is 1e-6.
        let n = N as f64;
        for m in m1 {
            assert!(((m / n - 1.0 / 3.0) / (1.0 / 18.0 / n).sqrt()).abs() < 4.9);
        }
        assert!(((m2 / n - 1.0 / 12.0) / (0.004_17 / n).sqrt()).abs() < 4.9);
    }

    #[test]
    fn disk_points_are_uniform() {
        let mut r = Stream::new(&[21]);
        let mut counts = [0f64; 16];
        for _ in 0..N {
            let [x, y] = sample_disk(2.0, r.uniform2());
            let (ring, sector) = ((x * x + y * y).min(3.999), (y.atan2(x) + PI) / TAU);
            counts[ring as usize * 4 + (sector * 4.0).min(3.999) as usize] += 1.0;
        }
        // Chi-square with 15 degrees of freedom exceeds 54.0 with probability 3e-6.
        let e = N as f64 / 16.0;
        let chi2: f64 = counts.iter().map(|c| (c - e) * (c - e) / e).sum();
        assert!(chi2 < 54.0, "{chi2}");
    }

    #[test]
    fn cone_directions_hit_the_sphere_and_their_density_integrates_to_one() {
        let (p, c) = (Vec3::new(1.0, 0.0, -2.0), Vec3::new(3.0, 1.0, 1.0));
        let mut r = Stream::new(&[22]);
        for radius in [3.5f32, 1.0, 1e-3] {
            let pdf = pdf_sphere_cone(p, c, radius).unwrap();
            let d = c.distance(p);
            // Solid angle of the cone, independently: 2 pi (1 - cos asin(r / d)).
            let omega = std::f64::consts::TAU * (1.0 - (f64::from(radius) / f64::from(d)).asin().cos());
            assert!((f64::from(pdf) * omega - 1.0).abs() < 1e-4, "{radius}");
            for _ in 0..1000 {
                let s = sample_sphere_cone(p, c, radius, r.uniform2()).unwrap();
                let line = (c - p).as_dvec3().cross(s.w.as_dvec3()).length();
                assert!(line <= f64::from(radius) + 4e-7 * f64::from(d) && s.pdf == pdf);
            }
        }
        assert!(sample_sphere_cone(c, c, 1.0, [0.5; 2]).is_none());
    }

    #[test]
    fn the_uniform_law_over_a_triangles_solid_angle_agrees_with_area_sampling() {
        let mut r = Stream::new(&[23]);
        let p = Vec3::new(0.1, 0.2, 0.3);
        for t in [
            [Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.5, 1.0), Vec3::new(-1.0, 0.0, 0.8)],
            [Vec3::new(9.0, 9.0, 9.0), Vec3::new(9.1, 9.0, 9.0), Vec3::new(9.0, 9.2, 9.1)],
            [Vec3::new(-9.0, -9.0, 0.31), Vec3::new(9.0, -9.0, 0.31), Vec3::new(0.0, 12.0, 0.31)],
        ] {
            let omega = f64::from(triangle_solid_angle(p, t));
            let pdf = f64::from(sample_triangle_solid_angle(p, t, [0.5; 2]).unwrap().0.pdf);
            assert!((omega * pdf - 1.0).abs() < 1e-3, "{omega} {pdf}");
            // E of f over solid angle: mean of f, against area sampling with cos / r^2 weights. f is smooth and non-constant.
            let f = |w: Vec3| f64::from(1.0 + w.x + w.y * w.z);
            let n = (t[1] - t[0]).cross(t[2] - t[0]);
            let (mut a, mut b) =
                (moonmilk_core::estimate::Accumulator::default(), moonmilk_core::estimate::Accumulator::default());
            for _ in 0..N {
                let (s, bary) = sample_triangle_solid_angle(p, t, r.uniform2()).unwrap();
                let on = t[0] * (1.0 - bary[0] - bary[1]) + t[1] * bary[0] + t[2] * bary[1];
                assert!((on - p).normalize().distance(s.w) < 2e-4);
                a.add(f(s.w) / f64::from(s.pdf));
                let q = sample_triangle(t, r.uniform2()).0 - p;
                b.add(f(q.normalize()) * f64::from(0.5 * n.dot(q).abs() / q.length().powi(3)));
            }
            // Different samplers of one integral: |z| < 4.9 is a significance of 1e-6. The third triangle is seen under
            // almost a half space from 0.01 away, where area sampling has no useful variance.
            if omega < 6.0 {
                let z = a.estimate().z_against(&b.estimate());
                assert!(z.abs() < 4.9, "{z}");
            }
        }
    }
}
