//! Lines at random through a ball: they meet what is inside in points of uniform density (Crofton).

use moonmilk_core::{Frame, Random, Sampler, Vec3};
use moonmilk_geometry::{Bounds, Hit, Ray};

use crate::scene::Scene;

/// A ball around some surfaces, through which lines are drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lines {
    pub center: Vec3,
    radius: f32,
}

impl Lines {
    /// Returns the ball around a box.
    pub fn around(bounds: Bounds) -> Self {
        Self { center: bounds.center(), radius: 0.5001 * bounds.extent().length() }
    }

    /// Returns 2 pi rho^2, the area over which one line has one point of a surface on the mean \[L^2\].
    pub fn area(&self) -> f64 {
        2.0 * std::f64::consts::PI * f64::from(self.radius).powi(2)
    }

    /// Returns a line through the ball and all its hits on the shapes that count, in order.
    pub fn meet(&self, scene: &Scene, rng: &mut Sampler, counts: impl Fn(u32) -> bool) -> (Ray, Vec<Hit>) {
        let (u, v) = (rng.uniform2(), rng.uniform2());
        let (cos, phi) = (1.0 - 2.0 * u[0], 2.0 * std::f32::consts::PI * u[1]);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let frame = Frame::new(Vec3::new(sin * phi.cos(), sin * phi.sin(), cos));
        let (r, (sin, cos)) = (self.radius * v[0].sqrt(), (2.0 * std::f32::consts::PI * v[1]).sin_cos());
        let o = self.center + (frame.s * cos + frame.t * sin) * r - frame.n * self.radius;
        let ray = Ray::new(o, frame.n).up_to(2.0 * self.radius);
        let mut hits = Vec::new();
        scene.accel.all_hits(&ray, |hit| {
            if counts(hit.shape) {
                hits.push(*hit);
            }
        });
        hits.sort_by(|a, b| a.t.total_cmp(&b.t));
        (ray, hits)
    }
}
