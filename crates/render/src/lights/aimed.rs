//! What connections through refractive boundaries aim at: lights with a surface, and environments that are not even (`environment`).
//!
//! One strategy: a point of a surface or a direction to infinity, in the shares that [`Lights::sample`] would give the two groups, the environment with its
//! bright part alone. Densities are functions of the reference point (position and normal) and the direction.

use moonmilk_core::{Spectrum, Vec3, Wavelengths};

use super::unseen::Target;
use super::{Lights, Placed, Shares, refined};

/// Where a connection may lead.
#[derive(Clone, Copy, Debug)]
pub struct Aimed {
    /// Point of a light, or direction to infinity.
    pub target: Target,
    /// Unit direction from the reference point.
    pub wi: Vec3,
    /// The environment's part of the density of that direction, its share of the choice included [1/sr].
    pub environment: f32,
}

impl Lights {
    /// Returns whether there is anything to aim at.
    pub fn has_aims(&self) -> bool {
        self.has_surfaces() || self.aims_at_environment()
    }

    /// Returns the share of the environment among what is aimed at from a point.
    fn environment_share(&self, p: Vec3, n: Option<Vec3>) -> f64 {
        let environment = f64::from(self.environment.aimed_importance());
        if environment == 0.0 || !self.has_surfaces() {
            return if environment > 0.0 { 1.0 } else { 0.0 };
        }
        let tree = f64::from(self.tree.importance(p, n));
        let count = if tree > 0.0 { 2.0 } else { 1.0 };
        Shares { tree, environment, sum: tree + environment, count }.of(environment)
    }

    /// Chooses a point of a surface or a direction to infinity, for three uniform variates: the first chooses the light.
    pub fn aim<const N: usize>(
        &self,
        p: Vec3,
        n: Option<Vec3>,
        wavelengths: &Wavelengths<N>,
        u: [f32; 3],
    ) -> Option<Aimed> {
        let share = self.environment_share(p, n);
        let (choice, v) = (refined(u), [f64::from(u[1]), f64::from(u[2])]);
        if choice < share {
            let (wi, pdf) = self.environment.aim(p, choice / share, v)?;
            return Some(Aimed { target: Target::Direction(wi), wi, environment: share as f32 * pdf });
        }
        let choice = ((choice - share) / (1.0 - share)).min(1.0 - f64::EPSILON);
        let s = self.sample_placed(p, n, wavelengths, choice, v, 1.0)?;
        // Points are for others to find; a lamp of opacity 0 has a surface.
        if !matches!(self.placed[s.light as usize], Placed::Surface { .. }) {
            return None;
        }
        let environment = if share > 0.0 { share as f32 * self.environment.aimed_pdf(p, s.wi) } else { 0.0 };
        Some(Aimed { target: Target::Point(s.point), wi: s.wi, environment })
    }

    /// Returns the environment's part of the density of [`Lights::aim`] for a direction [1/sr].
    pub fn aimed_pdf_environment(&self, p: Vec3, n: Option<Vec3>, d: Vec3) -> f32 {
        let share = self.environment_share(p, n);
        if share > 0.0 { share as f32 * self.environment.aimed_pdf(p, d) } else { 0.0 }
    }

    /// Returns the part of the density of [`Lights::aim`] from (p, n) by the point q of a light's surface [1/sr].
    pub fn aimed_pdf_surface(&self, p: Vec3, n: Option<Vec3>, light: u32, q: Vec3) -> f32 {
        (1.0 - self.environment_share(p, n)) as f32 * self.pdf_surface(p, n, light, q)
    }

    /// Returns the radiance from infinity that connections leave to chance: [`Lights::environment`] without [`Lights::aimed_environment`].
    pub fn even_environment<const N: usize>(&self, d: Vec3, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        self.environment.even_radiance(d, wavelengths)
    }

    /// Returns the radiance of the environment that connections take part in.
    pub fn aimed_environment<const N: usize>(&self, p: Vec3, d: Vec3, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        self.environment.aimed_radiance(p, d, wavelengths)
    }

    /// Returns about which share of the light at p comes from what can be aimed at, not from all around.
    pub fn share_of_lamps(&self, p: Vec3) -> f32 {
        let shares = self.shares_with(p, None, self.environment.importance());
        let even = shares.environment - f64::from(self.environment.aimed_importance());
        if shares.sum > 0.0 { (1.0 - even / shares.sum) as f32 } else { 0.0 }
    }

    /// Returns whether the environment's sun, if it has one, may lie within an angle of given sine and cosine from d.
    #[inline]
    pub fn sun_within(&self, d: Vec3, (sin, cos): (f32, f32)) -> bool {
        self.environment.sun().is_some_and(|(axis, half_cos)| {
            let half_sin = (1.0 - half_cos * half_cos).max(0.0).sqrt();
            d.dot(axis) >= half_cos * cos - half_sin * sin
        })
    }

    /// Returns whether the environment is aimed at.
    pub fn aims_at_environment(&self) -> bool {
        self.environment.aimed_importance() > 0.0
    }

    /// Returns whether some light has a surface.
    pub fn has_surfaces(&self) -> bool {
        self.first_of_shape.iter().any(Option::is_some)
    }

    /// Returns whether a light's surface may lie within an angle of given sine and cosine from d, as seen from anywhere within `reach` of p; no
    /// where lights are all around p (in the sphere around all of them): there chance finds them.
    #[inline]
    pub fn surface_within(&self, p: Vec3, d: Vec3, reach: f32, (sin, cos): (f32, f32)) -> bool {
        let Some((min, max)) = self.surfaces else { return false };
        let to = 0.5 * (min + max) - p;
        let (radius, distance2) = (0.5 * (max - min).length() + reach, to.length_squared());
        if radius * radius >= distance2 {
            return false;
        }
        // The angle between d and the middle is at most the given one and the half angle of the sphere, which is below a right angle.
        let half_sin = radius / distance2.sqrt();
        let half_cos = (1.0 - half_sin * half_sin).sqrt();
        let least = half_cos * cos - half_sin * sin;
        // Together they may exceed a half turn only where the sine of the sum has become negative.
        half_sin * cos + half_cos * sin < 0.0 || d.dot(to) >= (least - 1e-4) * distance2.sqrt()
    }

    /// Returns whether a ray from p along d may meet a light's surface: cheap, and never wrong with no.
    #[inline]
    pub fn may_meet_surface(&self, p: Vec3, d: Vec3) -> bool {
        let Some((min, max)) = self.surfaces else { return false };
        // Widen the box by what rounding can move points by.
        let pad = Vec3::splat(4.0 * f32::EPSILON * p.abs().max(min.abs()).max(max.abs()).max_element());
        let (a, b) = ((min - pad - p) / d, (max + pad - p) / d);
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        // Not a number on the faces themselves: rounding is on the side of yes.
        !(near > far + 1e-4 * far.abs() || far < 0.0)
    }

    /// Returns the density with which a choice among the lights that have a position yields, from (p, n), the direction to the point q of a light's surface.
    pub fn pdf_surface(&self, p: Vec3, n: Option<Vec3>, light: u32, q: Vec3) -> f32 {
        match self.placed.get(light as usize) {
            Some(Placed::Surface { surface, .. }) => {
                (f64::from(self.tree.probability(p, n, light)) * surface.pdf(p, q)) as f32
            }
            _ => 0.0,
        }
    }

    /// Returns whether a light's surface with normal `ng` shines towards the unit direction `w_out`.
    pub fn shines(&self, light: u32, ng: Vec3, w_out: Vec3) -> bool {
        matches!(self.placed.get(light as usize),
            Some(Placed::Surface { surface, two_sided, .. }) if *two_sided || surface.emits_towards(w_out, ng))
    }
}
