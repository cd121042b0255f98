//! Orthonormal frames around a normal.

use glam::Vec3;

/// A right-handed orthonormal frame (s, t, n); local coordinates have z along `n`.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent.
    pub t: Vec3,
    /// Normal (local z).
    pub n: Vec3,
}

impl Frame {
    /// Builds a frame from a unit normal, without branches on its direction [Duff2017, Listing 3].
    #[inline]
    pub fn new(n: Vec3) -> Self {
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// Builds a frame from a unit normal and a tangent hint; falls back to [`Frame::new`] if they are parallel.
    pub fn with_tangent(n: Vec3, tangent: Vec3) -> Self {
        let s = tangent - n * n.dot(tangent);
        match s.try_normalize() {
            Some(s) => Self { s, t: n.cross(s), n },
            None => Self::new(n),
        }
    }

    /// Returns the local coordinates of a world vector.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Returns the world vector of local coordinates.
    #[inline]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed_for_all_normals() {
        for i in 0..2000 {
            let z = (i as f32 + 0.5) / 1000.0 - 1.0;
            let phi = i as f32 * 2.399_963;
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = Vec3::new(r * phi.cos(), r * phi.sin(), z).normalize();
            let f = Frame::new(n);
            // Rounding of f32 products of unit vectors.
            assert!(f.s.cross(f.t).distance(n) < 2e-6 && f.s.dot(f.t).abs() < 1e-6 && f.s.dot(n).abs() < 1e-6);
            let v = Vec3::new(0.3, -0.7, 0.2);
            assert!(f.to_world(f.to_local(v)).distance(v) < 1e-6);
        }
    }
}
