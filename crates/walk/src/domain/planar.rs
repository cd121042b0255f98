//! Half-space and slab between planes z = 0 and z = thickness, with smooth refractive boundaries.

use moonmilk_core::{Random, Vec3};

use super::{Domain, Wall, smooth_boundary};
use crate::walker::Walker;

/// A slab 0 < z < `thickness` \[length\]; infinite thickness is the half-space. `eta` = inside / outside on both faces.
#[derive(Clone, Copy, Debug)]
pub struct Slab {
    /// Thickness \[length\], may be infinite.
    pub thickness: f32,
    /// Relative index, inside / outside.
    pub eta: f32,
}

/// The face through which a path left a slab.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Face {
    /// z = 0.
    Front,
    /// z = thickness.
    Back,
}

impl<const N: usize> Domain<N> for Slab {
    type Wall = Face;
    type Exit = Face;

    fn start(&self) -> Face {
        Face::Front
    }

    #[inline]
    fn room(&self, p: Vec3) -> f32 {
        p.z.min(self.thickness - p.z)
    }

    #[inline]
    fn segment(&self, p: Vec3, d: Vec3, t_max: f32, _from: &Face) -> Option<(f32, Face)> {
        // Rounding may put p a hair outside: a negative distance counts as zero.
        let (t, face) = if d.z < 0.0 {
            (p.z / -d.z, Face::Front)
        } else if d.z > 0.0 {
            ((self.thickness - p.z) / d.z, Face::Back)
        } else {
            return None;
        };
        (t < t_max).then_some((t.max(0.0), face))
    }

    #[inline]
    fn arrive<R: Random>(&self, face: Face, t: f32, walker: &mut Walker<N>, rng: &mut R) -> Wall<Face, Face> {
        walker.p += walker.d * t;
        let n = match face {
            Face::Front => {
                walker.p.z = 0.0;
                Vec3::NEG_Z
            }
            Face::Back => {
                walker.p.z = self.thickness;
                Vec3::Z
            }
        };
        let (d, left) = smooth_boundary(walker.d, n, self.eta, rng);
        walker.d = d;
        if self.eta != 1.0 {
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
