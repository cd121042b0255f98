//! Directions towards the light that a plane refracts, and a lobe around them: what connections draw from, with its density.

use std::f32::consts::PI;

use moonmilk_core::{Vec3, Wavelengths};
use moonmilk_geometry::{Prim, Ray};
use moonmilk_walk::math;

use crate::scene::Scene;

/// Share of the connections that leave the frame's light for a lobe around it, for what a plane does not know: folds, edges of the light.
const SPREAD: f32 = 0.3;
/// Asymmetry of that lobe, a Henyey-Greenstein law: half of it lies within 15 degrees. The measured variance hardly depends on it.
const LOBE: f32 = 0.85;

/// A plane that stands in for the boundary near a collision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub x: Vec3,
    /// Outward unit normal.
    pub n: Vec3,
    pub prim: Prim,
    pub eta: f32,
}

/// Where connections from a collision aim.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aim {
    /// The plane whose refracted light is drawn from; `None` where no boundary is near on the way to the light.
    pub frame: Option<Frame>,
    /// Axis of the lobe for what the plane does not know.
    pub axis: Vec3,
}

impl Aim {
    /// Returns the density of directions.
    pub fn density(&self, scene: &Scene, omega: Vec3) -> f32 {
        match &self.frame {
            Some(frame) => (1.0 - SPREAD) * frame.density(scene, omega) + SPREAD * self.lobe(omega),
            None => self.lobe(omega),
        }
    }

    /// Returns the density of the lobe.
    fn lobe(&self, omega: Vec3) -> f32 {
        let g = LOBE;
        let q = 1.0 + g * g - 2.0 * g * omega.dot(self.axis);
        (1.0 - g * g) / (4.0 * PI * q * q.sqrt())
    }

    /// Draws a direction and returns its density, for four uniform variates.
    pub fn sample<const N: usize>(
        &self,
        scene: &Scene,
        w: &Wavelengths<N>,
        choice: f32,
        u: [f32; 3],
    ) -> Option<(Vec3, f32)> {
        match &self.frame {
            Some(frame) if choice >= SPREAD => {
                let target = scene.lights.aim(frame.x, Some(frame.n), w, u)?;
                let (omega, jacobian) = frame.inside(target.wi)?;
                // The density of what was drawn: refracted there and back, a direction may lie on the other side of an edge of the light.
                let density = frame.density_towards(scene, target.wi, target.environment) * jacobian;
                Some((omega, (1.0 - SPREAD) * density + SPREAD * self.lobe(omega)))
            }
            _ => {
                let omega = math::deflect(self.axis, math::henyey_greenstein_cosine(LOBE, u[0]), u[1]);
                Some((omega, self.density(scene, omega)))
            }
        }
    }
}

impl Frame {
    /// Returns the direction omega of flight inside that the plane refracts towards w_i outside, and d omega_i / d omega.
    pub fn inside(&self, w_i: Vec3) -> Option<(Vec3, f32)> {
        let c_i = w_i.dot(self.n);
        let cos2 = 1.0 - (1.0 - c_i * c_i) / (self.eta * self.eta);
        if c_i <= 0.0 || cos2 <= 0.0 {
            return None;
        }
        let c_t = cos2.sqrt();
        let omega = (w_i / self.eta + self.n * (c_t - c_i / self.eta)).normalize();
        Some((omega, self.eta * self.eta * c_t / c_i))
    }

    /// Returns the direction outside to which the plane refracts omega, and d omega_i / d omega.
    fn outside(&self, omega: Vec3) -> Option<(Vec3, f32)> {
        let c_t = omega.dot(self.n);
        let cos2 = 1.0 - self.eta * self.eta * (1.0 - c_t * c_t);
        if c_t <= 0.0 || cos2 <= 0.0 {
            return None;
        }
        let c_i = cos2.sqrt();
        let w_i = (omega * self.eta + self.n * (c_i - self.eta * c_t)).normalize();
        Some((w_i, self.eta * self.eta * c_t / c_i))
    }

    /// Returns p_F(omega).
    pub fn density(&self, scene: &Scene, omega: Vec3) -> f32 {
        let Some((w_i, jacobian)) = self.outside(omega) else { return 0.0 };
        self.density_towards(scene, w_i, scene.lights.aimed_pdf_environment(self.x, Some(self.n), w_i)) * jacobian
    }

    /// Returns p_L(omega_i): the density over all lights that the ray from x0 meets, as if nothing else were in the way, `environment` that of the environment.
    fn density_towards(&self, scene: &Scene, w_i: Vec3, environment: f32) -> f32 {
        let mut pdf = environment;
        if !scene.lights.may_meet_surface(self.x, w_i) {
            return pdf;
        }
        let ray = Ray::new(self.x, w_i).from_prim(self.prim);
        scene.accel.all_hits(&ray, |h| {
            if let Some(l) = scene.lights.light_of(h.shape, h.index) {
                let s = scene.accel.surface(&ray, h);
                if scene.lights.shines(l, s.ng, -w_i) {
                    pdf += scene.lights.aimed_pdf_surface(self.x, Some(self.n), l, s.p);
                }
            }
        });
        pdf
    }
}
