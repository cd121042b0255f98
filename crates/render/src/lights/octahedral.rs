//! The equal-area octahedral map between the unit sphere and the unit square.
//!
//! The upper hemisphere (z > 0) fills the inner diamond |x| + |y| < 1 of \[-1, 1\]^2, the lower one is folded out into the corners.
//! Every area of the square is 1 / (4 pi) of that of its image. This is the layout of pbrt-v4's environment pictures; (0, 0) is the
//! corner of the first pixel of the first row. *Source*: \[Clarberg2008\], here with exact trigonometric functions.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_4};

use moonmilk_core::{DVec3, Vec2, Vec3};

/// Returns the point of the unit square that stands for a unit direction.
pub fn square_of(d: Vec3) -> [f64; 2] {
    let (x, y, z) = (f64::from(d.x.abs()), f64::from(d.y.abs()), f64::from(d.z.abs()));
    // r = sqrt(1 - |z|), written so that it keeps its precision at the poles.
    let planar = x * x + y * y;
    let r = (planar / (1.0 + z)).sqrt().min(1.0);
    let phi = if planar > 0.0 { y.atan2(x) * FRAC_2_PI } else { 0.0 };
    let (mut v, mut u) = (phi * r, r - phi * r);
    if d.z < 0.0 {
        (u, v) = (1.0 - v, 1.0 - u);
    }
    [0.5 + 0.5 * u.copysign(f64::from(d.x)), 0.5 + 0.5 * v.copysign(f64::from(d.y))]
}

/// Returns [`direction_of`] for texture coordinates: u to the right, v downwards.
pub fn to_sphere(uv: Vec2) -> Vec3 {
    direction_of([f64::from(uv.x), f64::from(uv.y)])
}

/// Returns the unit direction for which a point of the unit square stands; the inverse of [`square_of`].
pub fn direction_of(p: [f64; 2]) -> Vec3 {
    let (u, v) = (2.0 * p[0] - 1.0, 2.0 * p[1] - 1.0);
    let (ua, va) = (u.abs(), v.abs());
    // The distance to the diamond's edge is positive inside, where z is.
    let signed = 1.0 - (ua + va);
    let r = 1.0 - signed.abs();
    let phi = if r > 0.0 { ((va - ua) / r + 1.0) * FRAC_PI_4 } else { 0.0 };
    let z = (1.0 - r * r).copysign(signed);
    let s = r * (2.0 - r * r).max(0.0).sqrt();
    DVec3::new((s * phi.cos()).copysign(u), (s * phi.sin()).copysign(v), z).as_vec3().normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_and_its_inverse_agree_all_over_the_sphere() {
        for i in 0..200 {
            for j in 0..200 {
                let p = [(f64::from(i) + 0.5) / 200.0, (f64::from(j) + 0.5) / 200.0];
                let q = square_of(direction_of(p));
                // Rounding of the direction to f32 (6e-8), times the largest slope of the map.
                assert!((p[0] - q[0]).abs() < 1e-6 && (p[1] - q[1]).abs() < 1e-6, "{p:?} {q:?}");
            }
        }
        for d in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
            assert!(direction_of(square_of(d)).distance(d) < 1e-6, "{d}");
        }
    }

    #[test]
    fn the_centre_is_up_and_a_quarter_of_the_square_is_each_quadrant() {
        assert!(direction_of([0.5, 0.5]).distance(Vec3::Z) < 1e-7);
        assert!(direction_of([0.0, 0.0]).distance(-Vec3::Z) < 1e-7);
        let d = direction_of([0.9, 0.6]);
        assert!(d.x > 0.0 && d.y > 0.0);
    }

    #[test]
    fn equal_areas_of_the_square_are_equal_solid_angles() {
        // Second moments of the sphere, 1/3 each, as midpoint sums over the square; error of the rule below 1e-4.
        let n = 400;
        let mut m = [0.0f64; 3];
        for i in 0..n {
            for j in 0..n {
                let d = direction_of([(f64::from(i) + 0.5) / f64::from(n), (f64::from(j) + 0.5) / f64::from(n)]);
                let d = d.as_dvec3().to_array();
                m.iter_mut().zip(d).for_each(|(m, x)| *m += x * x / f64::from(n * n));
            }
        }
        assert!(m.iter().all(|x| (x - 1.0 / 3.0).abs() < 1e-4), "{m:?}");
    }
}
