//! A ball around the origin with a smooth refractive boundary.

use moonmilk_core::{Random, Vec3};

use super::{Domain, Wall, smooth_boundary};
use crate::guide::Outward;
use crate::walker::Walker;

/// A ball of a radius \[length\] around the origin; `eta` = inside / outside.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// Radius \[length\].
    pub radius: f32,
    /// Relative index, inside / outside.
    pub eta: f32,
}

impl<const N: usize> Domain<N> for Ball {
    type Wall = ();
    type Exit = ();

    fn start(&self) {}

    #[inline]
    fn room(&self, p: Vec3) -> f32 {
        // Round down by more than the error of length().
        self.radius * (1.0 - 1e-6) - p.length()
    }

    #[inline]
    fn outward(&self, p: Vec3, _room: f32) -> Option<Outward> {
        let r = p.length();
        (r > 0.0).then(|| Outward { n: p / r, r })
    }

    #[inline]
    fn entry(&self, p: Vec3, _d: Vec3) -> Option<Outward> {
        Some(Outward { n: p / self.radius, r: self.radius })
    }

    #[inline]
    fn segment(&self, p: Vec3, d: Vec3, t_max: f32, _from: &()) -> Option<(f32, ())> {
        // From inside exactly one root lies ahead; a start pushed out by rounding counts as on the surface.
        let b = p.dot(d);
        let c = (p.length_squared() - self.radius * self.radius).min(0.0);
        let root = (b * b - c).sqrt();
        let t = if b > 0.0 { -c / (b + root) } else { root - b };
        (t < t_max).then_some((t, ()))
    }

    #[inline]
    fn arrive<R: Random>(&self, _wall: (), t: f32, walker: &mut Walker<N>, rng: &mut R) -> Wall<(), ()> {
        let n = (walker.p + walker.d * t).normalize();
        walker.p = n * self.radius;
        let (d, left) = smooth_boundary(walker.d, n, self.eta, rng);
        walker.d = d;
        if self.eta != 1.0 {
            walker.direction_pdf = None;
        }
        if left { Wall::Leave(()) } else { Wall::Stay(()) }
    }

    #[inline]
    fn is_outside(&self, p: Vec3) -> bool {
        p.length_squared() > self.radius * self.radius * (1.0 + 1e-5)
    }
}
