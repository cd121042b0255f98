//! Where a path stands, in which bodies and media it is, and how it goes on.

use moonmilk_core::{Random, Sampler, Vec3, Wavelengths};
use moonmilk_geometry::{Facing, Hit, NONE, Prim, Ray};
use moonmilk_walk::Walker;

use super::Counters;
use crate::interior::Standing;
use crate::media::Matter;
use crate::mirrors::Sight;
use crate::nest::Nest;
use crate::scene::{Object, Scene};
use crate::texture::TexturePoint;
use crate::through::{Escape, Start};
use crate::window;

/// A path on its way.
#[derive(Clone)]
pub(crate) struct Path<const N: usize> {
    pub walker: Walker<N>,
    /// Medium around the walker, `None` for vacuum.
    pub medium: Option<Matter<N>>,
    /// Medium around all bodies that the walker is inside of.
    pub ambient: Option<Matter<N>>,
    /// Bodies that the walker is inside of.
    pub inside: Nest,
    /// Surface that the walker stands on.
    pub standing: Standing,
    /// Normal at the point where the last direction was drawn, for the density of light sampling; `None` inside media and at
    /// boundaries that light can cross.
    pub normal: Option<Vec3>,
    /// Bounces, as pbrt counts them.
    pub depth: u32,
    /// Surface bounces since the start.
    pub bounces: u32,
    /// Whether a surface was seen.
    pub seen: bool,
    /// Whether anything on its way has scattered it: only then lamps of opacity 0 count that it passes. Collisions are counted elsewhere.
    pub scattered: bool,
    /// Whether the next smooth boundary may be followed on both branches: true up to the first one.
    pub whole: bool,
    /// What the flight from the camera, or that from its first mirror, leaves to other rays.
    pub sight: Sight,
    /// The boundary that the last flight left through, where connections compete for the light that it meets next.
    pub escape: Option<Escape>,
    /// Where the next walk's first flight begins, if that is not a wall.
    pub start: Option<Start>,
    /// Copies of the path that are still to be followed.
    pub copies: Vec<Path<N>>,
}

impl<const N: usize> Path<N> {
    /// Returns a path that looks for light from a point outside all bodies.
    pub(super) fn outside(
        walker: Walker<N>,
        medium: Option<Matter<N>>,
        standing: Standing,
        normal: Option<Vec3>,
    ) -> Self {
        Self {
            walker,
            medium,
            ambient: medium,
            inside: Nest::default(),
            standing,
            normal,
            depth: 0,
            bounces: 0,
            seen: true,
            scattered: true,
            whole: false,
            sight: Sight::All,
            escape: None,
            start: None,
            copies: Vec::new(),
        }
    }

    /// Returns the path of a copy of its walker that flies on from a collision in the medium, of a walk that began with a number of collisions.
    pub(super) fn copy(&self, walker: Walker<N>, start: Start, collisions: u32) -> Self {
        Self {
            walker,
            medium: self.medium,
            ambient: self.ambient,
            inside: self.inside.clone(),
            standing: Standing::Space,
            normal: None,
            depth: self.depth.saturating_add(walker.collisions - collisions),
            bounces: self.bounces,
            seen: self.seen,
            scattered: true,
            whole: self.whole,
            sight: Sight::All,
            escape: None,
            start: Some(start),
            copies: Vec::new(),
        }
    }

    /// Follows two walks from the camera's first boundary into a medium, of half the weight each: most of the noise is the walk's own, most of the rest of a sample's cost not. Where scattering
    /// is forward walks are split by importance instead.
    pub(super) fn double(&mut self, rng: &mut Sampler, counters: &mut Counters) {
        if matches!(&self.medium, Some(Matter::Homogeneous(m)) if !m.sigma_s.is_black() && m.g < window::FORWARD) {
            self.walker.beta *= 0.5;
            let mut other = Self { copies: Vec::new(), ..self.clone() };
            // One first flight from the shorter half of all, one from the longer.
            let u = 0.5 * rng.uniform();
            self.walker.flight = Some(u);
            other.walker.flight = Some(0.5 + u);
            self.copies.push(other);
            counters.entered += u64::from(!self.inside.bodies().is_empty());
        }
    }

    /// Sends the walker along d, drawn with a density (`None`: specular).
    pub(super) fn turn(&mut self, d: Vec3, pdf: Option<f32>) {
        self.walker.d = d;
        self.walker.direction_pdf = pdf;
        self.walker.scatter_point = self.walker.p;
        self.walker.room = 0.0;
        self.normal = None;
    }

    /// Puts the walker on the side of a body on which a hit shows it to be: its wall was missed within rounding, or it meets itself.
    pub(super) fn correct(
        &mut self,
        scene: &Scene,
        object: &Object,
        hit: &Hit,
        point: &TexturePoint,
        wavelengths: &Wavelengths<N>,
    ) {
        let before = self.index();
        if hit.exiting {
            self.inside.step_into(object, hit.shape, *point);
        } else {
            self.inside.leave(hit.shape);
        }
        self.medium = self.inside.medium(scene, wavelengths, self.ambient);
        self.rescale(before);
    }

    /// Returns the index, against vacuum, of where the walker is.
    pub(super) fn index(&self) -> f32 {
        self.inside.bodies().last().map_or(1.0, |b| b.index)
    }

    /// Scales radiance by the squared index, where it was `before`.
    pub(super) fn rescale(&mut self, before: f32) {
        let factor = (before / self.index()).powi(2);
        self.walker.beta *= factor;
        self.walker.eta_scale /= factor;
    }

    /// Moves the walker on by a step and finds out anew what is there; radiance scales with the squared index of that.
    pub(super) fn free(&mut self, scene: &Scene, step: f32, wavelengths: &Wavelengths<N>) {
        let before = self.index();
        self.walker.p += self.walker.d * step;
        self.walker.room = 0.0;
        self.standing = Standing::Space;
        self.inside = scene.nest_at(self.walker.p);
        self.medium = self.inside.medium(scene, wavelengths, self.ambient);
        self.rescale(before);
    }

    /// Notes that the walker stands on a surface and leaves it on the outer or inner side.
    pub(super) fn stand(&mut self, object: &Object, hit: Hit, outward: bool) {
        self.standing = match (object.body.is_some(), outward) {
            (true, true) => Standing::Outside(hit),
            (true, false) => Standing::Inside(hit),
            (false, _) => Standing::On(hit),
        };
    }

    /// Refracts into the other side: radiance scaling and medium.
    pub(super) fn transmit(
        &mut self,
        scene: &Scene,
        object: &Object,
        hit: Hit,
        point: &TexturePoint,
        outward: bool,
        eta: f32,
        wavelengths: &Wavelengths<N>,
        counters: &mut Counters,
    ) {
        let factor = if outward { eta * eta } else { 1.0 / (eta * eta) };
        self.walker.beta *= factor;
        self.walker.eta_scale /= factor;
        self.change_medium(scene, object, hit, point, outward, wavelengths, counters);
    }

    /// Puts the walker on the outer or inner side of an object.
    pub(super) fn change_medium(
        &mut self,
        scene: &Scene,
        object: &Object,
        hit: Hit,
        point: &TexturePoint,
        outward: bool,
        wavelengths: &Wavelengths<N>,
        counters: &mut Counters,
    ) {
        self.walker.room = 0.0;
        if object.body.is_some() {
            counters.left += u64::from(outward);
            counters.entered += u64::from(!outward);
            self.cross_body(scene, hit.shape, outward, point, wavelengths);
        } else {
            self.medium = scene.medium_beyond(object, outward, point, wavelengths, self.medium);
            if self.inside.bodies().is_empty() {
                self.ambient = self.medium;
            }
        }
        self.stand(object, hit, outward);
    }

    /// Puts the walker into or out of a body.
    pub(super) fn cross_body(
        &mut self,
        scene: &Scene,
        shape: u32,
        outward: bool,
        point: &TexturePoint,
        wavelengths: &Wavelengths<N>,
    ) {
        self.inside.cross(scene, shape, outward, point, wavelengths, &mut self.medium, &mut self.ambient);
    }
}

impl Standing {
    /// Returns the ray for a flight outside closed bodies.
    #[inline]
    pub(crate) fn ray(&self, scene: &Scene, p: Vec3, d: Vec3) -> Ray {
        let ray = Ray::new(p, d);
        match self {
            Standing::Space => ray,
            Standing::On(hit) | Standing::Through(hit) => ray.from_prim(hit.prim),
            Standing::Outside(hit) => match scene.objects[hit.shape as usize].body {
                Some(body) => ray.from_prim(hit.prim).facing(Facing::Entering(body)),
                None => ray.from_prim(hit.prim),
            },
            Standing::Inside(hit) => match scene.objects[hit.shape as usize].body {
                Some(body) => ray.from_prim(hit.prim).facing(Facing::Exiting(body)),
                None => ray.from_prim(hit.prim),
            },
        }
    }

    /// Returns the ray for a flight inside an object.
    #[inline]
    pub(crate) fn ray_inside(&self, scene: &Scene, inside: Option<u32>, p: Vec3, d: Vec3) -> Ray {
        match inside.and_then(|i| scene.objects[i as usize].body) {
            Some(body) => Ray::new(p, d).from_prim(self.prim()).facing(Facing::Exiting(body)),
            None => self.ray(scene, p, d),
        }
    }

    /// Returns the primitive stood on, or `NONE`.
    #[inline]
    pub(crate) fn prim(&self) -> Prim {
        match self {
            Standing::Space => NONE,
            Standing::On(h) | Standing::Through(h) | Standing::Outside(h) | Standing::Inside(h) => h.prim,
        }
    }
}
