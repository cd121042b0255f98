//! One layer of a plane stack, with a smooth boundary of its own on either face.

use moonmilk_core::{Random, Vec3};

use super::planar::Face;
use super::{Domain, Wall, smooth_boundary};
use crate::walker::Walker;

/// A layer 0 < z < `thickness` \[length\] in its own coordinates; infinite thickness is a half-space.
///
/// Light that refracts through a face has left the layer: [`crate::layers`] takes it into the next one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Thickness \[length\], may be infinite.
    pub thickness: f32,
    /// Index inside over the index in front of z = 0.
    pub eta_front: f32,
    /// Index inside over the index behind z = `thickness`.
    pub eta_back: f32,
}

impl<const N: usize> Domain<N> for Layer {
    type Wall = Face;
    type Exit = Face;
    const CHEAP_SEGMENTS: bool = true;

    fn start(&self) -> Face {
        Face::Front
    }

    #[inline]
    fn room(&self, p: Vec3) -> f32 {
        p.z.min(self.thickness - p.z)
    }

    #[inline]
    fn segment(&self, p: Vec3, d: Vec3, t_max: f32, _from: &Face) -> Option<(f32, Face)> {
        // Compare depths first: most flights end inside, and a division is spared.
        let z = p.z + d.z * t_max;
        if z >= 0.0 && z <= self.thickness && t_max < f32::INFINITY {
            return None;
        }
        let (t, face) = if d.z < 0.0 {
            (p.z / -d.z, Face::Front)
        } else if d.z > 0.0 {
            ((self.thickness - p.z) / d.z, Face::Back)
        } else {
            return None;
        };
        // Rounding may put p a hair outside: a negative distance counts as zero. The end is known to lie beyond the face.
        (t < f32::INFINITY).then_some((t.clamp(0.0, t_max), face))
    }

    #[inline]
    fn arrive<R: Random>(&self, face: Face, t: f32, walker: &mut Walker<N>, rng: &mut R) -> Wall<Face, Face> {
        walker.p += walker.d * t;
        let (z, n, eta) = match face {
            Face::Front => (0.0, Vec3::NEG_Z, self.eta_front),
            Face::Back => (self.thickness, Vec3::Z, self.eta_back),
        };
        walker.p.z = z;
        let (d, left) = smooth_boundary(walker.d, n, eta, rng);
        walker.d = d;
        if eta != 1.0 {
            walker.direction_pdf = None;
        }
        if left { Wall::Leave(face) } else { Wall::Stay(face) }
    }

    #[inline]
    fn is_outside(&self, p: Vec3) -> bool {
        // A collision a rounding error outside is still inside; a whole thickness off is not.
        p.z < -1e-3 * self.thickness.min(1e30) || p.z > self.thickness * 1.001
    }
}
