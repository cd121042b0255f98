//! Beyond the boundary: straight on and, by transmission, through clear bodies, past lamps that rays pass, until something ends the way.
//!
//! Milk in a glass, a lamp in its bulb, a candle behind a pane: between a collision and the light there may be more smooth boundaries than the body's own. Connections, looks and chance
//! take the same ways through them: at each a transmitted outcome. With P_i the probability of the one taken at boundary i and tau_i that of all transmitted ones there, a connection or a look draws it with
//! P_i / tau_i, chance with P_i, so that what they are shared by changes by the product of all tau_i alone. What a boundary reflects, what scatters, and what lies beyond [`MOST`] boundaries is left to chance.

use moonmilk_core::{Random, Sampler, Spectrum, Vec3, Wavelengths};
use moonmilk_geometry::{Hit, Surface};

use super::Through;
use crate::bsdf::Crossing;
use crate::bsdf::boundary::branches;
use crate::integrator::Counters;
use crate::interior::Standing;
use crate::media::Matter;
use crate::nest::{Meeting, Nest};
use crate::scene::{Boundary, Object, Scene};
use crate::texture::TexturePoint;
use crate::touch;

/// Most boundaries and lamps of opacity 0 that a way to light passes, the body's own left out.
pub(super) const MOST: u32 = 8;

/// Where the flight is that leads through a boundary.
#[derive(Clone, Copy)]
pub(crate) struct Within<'a, const N: usize> {
    /// Bodies that it is in.
    pub nest: &'a Nest,
    /// Medium around all bodies.
    pub ambient: Option<Matter<N>>,
}

/// Returns whether light goes on straight in a medium.
pub(crate) fn is_clear<const N: usize>(medium: &Option<Matter<N>>) -> bool {
    match medium {
        None => true,
        Some(Matter::Homogeneous(m)) => m.sigma_s.is_black(),
        Some(_) => false,
    }
}

/// Returns the total probability of the transmitted outcomes at a smooth boundary, where light goes from `wo`.
pub(crate) fn transmitted(wo: Vec3, ng: Vec3, ns: Vec3, eta: f32) -> f32 {
    branches(wo, ng, ns, eta).iter().filter(|b| super::is_transmitted(&b.1)).map(|b| b.0).sum()
}

/// Returns the direction of a transmitted outcome, drawn in proportion to its probability, with that and their total; `None` where all is reflected.
pub(crate) fn transmit(wo: Vec3, ng: Vec3, ns: Vec3, eta: f32, mut u: impl FnMut() -> f32) -> Option<(Vec3, f32, f32)> {
    let outcomes = branches(wo, ng, ns, eta);
    let possible = |b: &&(f32, Crossing)| super::is_transmitted(&b.1) && b.0 > 0.0;
    let total: f32 = outcomes.iter().filter(possible).map(|b| b.0).sum();
    let one = outcomes.iter().filter(possible).count() < 2;
    let mut left = if one { 0.0 } else { u() * total };
    let mut drawn = None;
    for (p, c) in outcomes.iter().filter(possible) {
        drawn = Some((c.direction(), *p, total));
        left -= p;
        if left < 0.0 {
            break;
        }
    }
    drawn
}

/// A way to light.
struct Way<'a, const N: usize> {
    scene: &'a Scene,
    p: Vec3,
    d: Vec3,
    standing: Standing,
    nest: Nest,
    medium: Option<Matter<N>>,
    ambient: Option<Matter<N>>,
    /// Transmittance, and the squared index where the way is over that where it began.
    t: Spectrum<N>,
    /// Product of the total probabilities of transmission.
    transmitted: f32,
}

impl<const N: usize> Way<'_, N> {
    /// Returns what is met next, and how far off it is; as a path of the camera meets it.
    fn next(&self) -> Option<(Hit, Surface, f32)> {
        if let Some((hit, surface)) = touch::departure(self.scene, &self.nest, &self.standing, self.p, self.d) {
            return Some((hit, surface, 0.0));
        }
        let ray = match self.medium {
            None => self.standing.ray(self.scene, self.p, self.d),
            Some(_) => self.standing.ray_inside(self.scene, self.nest.innermost(), self.p, self.d),
        };
        touch::nearest(self.scene, &self.nest, ray)
    }

    /// Goes through a surface if it is the boundary of a clear body; returns whether it is, and light goes through.
    fn cross(&mut self, object: &Object, hit: Hit, s: &Surface, w: &Wavelengths<N>, rng: &mut Sampler) -> bool {
        let (Boundary::Smooth { eta }, true) = (object.boundary, object.clear) else { return false };
        let Meeting::True(outer) = self.nest.meet(object, hit.shape, hit.exiting) else { return false };
        let eta = eta / outer;
        if eta == 1.0 {
            return false;
        }
        let ns = self.scene.boundary_normal(object, s);
        let Some((d, _, total)) = transmit(-self.d, s.ng, ns, eta, || rng.uniform()) else { return false };
        let point = TexturePoint { p: s.p, n: s.ng, uv: s.uv };
        self.nest.cross(self.scene, hit.shape, hit.exiting, &point, w, &mut self.medium, &mut self.ambient);
        self.d = d;
        self.standing = if hit.exiting { Standing::Outside(hit) } else { Standing::Inside(hit) };
        self.t *= if hit.exiting { eta * eta } else { 1.0 / (eta * eta) };
        self.transmitted *= total;
        is_clear(&self.medium)
    }
}

impl Through<'_> {
    /// Calls `found` with the radiance of each light that a ray from the outer side of a hit leads to, as it arrives there, and the product of the total probabilities of transmission on the way.
    pub(super) fn lights_beyond<const N: usize>(
        &self,
        hit: &Hit,
        p: Vec3,
        d: Vec3,
        within: &Within<'_, N>,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
        counters: &mut Counters,
        mut found: impl FnMut(Spectrum<N>, f32),
    ) {
        let scene = self.scene;
        let lights = &scene.lights;
        if !scene.has_clear && !lights.may_meet_surface(p, d) && !lights.aims_at_environment() {
            return;
        }
        let (mut medium, mut ambient) = (None, within.ambient);
        let mut nest = within.nest.clone();
        let point = TexturePoint { p, n: d, uv: Default::default() };
        nest.cross(scene, hit.shape, true, &point, w, &mut medium, &mut ambient);
        let standing = Standing::Outside(*hit);
        let mut way = Way { scene, p, d, standing, nest, medium, ambient, t: Spectrum::ONE, transmitted: 1.0 };
        for _ in 0..=MOST {
            counters.shadow_rays += 1;
            let Some((hit, s, distance)) = way.next() else {
                // A medium that absorbs, all the way to infinity, lets nothing through.
                if let Some(Matter::Homogeneous(m)) = &way.medium {
                    way.t *= m.sigma_t.map(|s| if s > 0.0 { 0.0 } else { 1.0 });
                }
                let radiance = lights.aimed_environment(way.p, way.d, w) * way.t;
                if !radiance.is_black() {
                    found(radiance, way.transmitted);
                }
                return;
            };
            if let Some(Matter::Homogeneous(m)) = &way.medium {
                way.t *= m.transmittance(distance);
            }
            way.p = s.p;
            let object = &scene.objects[hit.shape as usize];
            let light = lights.light_of(hit.shape, hit.index);
            let hidden = light.is_some_and(|l| lights.is_hidden(l));
            // Holes are left to chance, and so is what rounding shows from the wrong side.
            let contrary = object.body.is_some() && hit.exiting != way.nest.contains(hit.shape);
            if !hidden && (object.alpha.is_some() || contrary) {
                return;
            }
            if let Some(l) = light {
                let radiance = lights.emitted(l, s.uv, s.ng, -way.d, w);
                if !radiance.is_black() {
                    found(radiance * way.t, way.transmitted);
                }
            }
            if hidden {
                way.standing = Standing::Through(hit);
            } else if !way.cross(object, hit, &s, w, rng) {
                return;
            }
        }
    }
}
