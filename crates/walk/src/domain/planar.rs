//! Half-space and slab between planes z = 0 and z = thickness, with smooth refractive boundaries.

use moonmilk_core::{Random, Vec3};

use super::layer::Layer;
use super::{Domain, Wall};
use crate::guide::Outward;
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

impl Slab {
    /// Returns the slab as a layer with the same boundary on both faces.
    #[inline]
    pub fn layer(&self) -> Layer {
        Layer { thickness: self.thickness, eta_front: self.eta, eta_back: self.eta }
    }
}

impl<const N: usize> Domain<N> for Slab {
    type Wall = Face;
    type Exit = Face;
    const CHEAP_SEGMENTS: bool = true;

    fn start(&self) -> Face {
        Face::Front
    }

    #[inline]
    fn room(&self, p: Vec3) -> f32 {
        Domain::<N>::room(&self.layer(), p)
    }

    #[inline]
    fn outward(&self, p: Vec3, _room: f32) -> Option<Outward> {
        let r = 0.5 * self.thickness - p.z;
        Some(Outward { n: if r > 0.0 { -Vec3::Z } else { Vec3::Z }, r: r.abs() })
    }

    #[inline]
    fn entry(&self, _p: Vec3, d: Vec3) -> Option<Outward> {
        Some(Outward { n: if d.z > 0.0 { -Vec3::Z } else { Vec3::Z }, r: 0.5 * self.thickness })
    }

    #[inline]
    fn segment(&self, p: Vec3, d: Vec3, t_max: f32, from: &Face) -> Option<(f32, Face)> {
        Domain::<N>::segment(&self.layer(), p, d, t_max, from)
    }

    #[inline]
    fn arrive<R: Random>(&self, face: Face, t: f32, walker: &mut Walker<N>, rng: &mut R) -> Wall<Face, Face> {
        self.layer().arrive(face, t, walker, rng)
    }

    #[inline]
    fn is_outside(&self, p: Vec3) -> bool {
        Domain::<N>::is_outside(&self.layer(), p)
    }
}
