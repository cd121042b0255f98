//! Shadow rays: what gets through from a place towards a light, past surfaces that let it pass and through media.

use moonmilk_core::{Random, Spectrum, Vec3, Wavelengths};
use moonmilk_geometry::Hit;
use moonmilk_walk::{Roulette, heterogeneous};

use crate::integrator::Counters;
use crate::interior::Standing;
use crate::media::Matter;
use crate::nest::Nest;
use crate::scene::{Object, Scene};
use crate::snag::Snag;
use crate::texture::TexturePoint;
use crate::touch;

/// Share of a shadow ray's length that is left out at its end, where the light itself is: a relative length.
const END: f32 = 1.0 - 1e-4;

/// Most index-matched surfaces that one shadow ray may pass.
const MOST_CROSSINGS: u32 = 1 << 14;

/// A place from which light is looked for.
#[derive(Clone)]
pub(crate) struct From<const N: usize> {
    pub p: Vec3,
    pub standing: Standing,
    pub medium: Option<Matter<N>>,
    /// Medium around all bodies.
    pub ambient: Option<Matter<N>>,
    pub inside: Nest,
}

/// What a shadow ray found on its way.
#[derive(Clone, Copy)]
pub(crate) struct Passage<const N: usize> {
    /// Transmittance per lane, or an unbiased estimate of it.
    pub t: Spectrum<N>,
    /// The part of it that chance would have lost at random: that of media which scatter. Others weigh every path alike.
    pub chance: Spectrum<N>,
    /// Factor of roulette on the whole.
    pub survival: f32,
    /// Length of the way up to the first surface that it passed, or to the end \[length\].
    pub first: Option<f32>,
}

impl<const N: usize> Passage<N> {
    /// Nothing in the way.
    pub(crate) const FREE: Self = Self { t: Spectrum::ONE, chance: Spectrum::ONE, survival: 1.0, first: None };
    /// Something in the way.
    const BLOCKED: Self = Self { t: Spectrum::ZERO, chance: Spectrum::ZERO, survival: 0.0, first: None };

    /// Goes a distance through matter.
    pub(crate) fn pass(
        &mut self,
        scene: &Scene,
        matter: Option<&Matter<N>>,
        p: Vec3,
        d: Vec3,
        distance: f32,
        wavelengths: &Wavelengths<N>,
        rng: &mut impl Random,
        counters: &mut Counters,
    ) {
        self.first = self.first.or(Some(distance));
        let (t, scatters) = match matter {
            None => return,
            Some(Matter::Homogeneous(m) | Matter::Similar(m, _)) => (m.transmittance(distance), !m.sigma_s.is_black()),
            Some(Matter::Field(id)) => {
                let field = scene.field(*id, wavelengths);
                let weight = self.t.max_value() * self.survival;
                let roulette = Roulette::default();
                let found = heterogeneous::transmittance(&field, p, d, distance, weight, &roulette, rng);
                counters.null_collisions += u64::from(found.collisions);
                self.survival *= found.survival;
                (found.transmittance, moonmilk_walk::Field::<N>::scatters(&field))
            }
        };
        self.t *= t;
        if scatters {
            self.chance *= t;
        }
    }

    /// Returns whether no light comes through.
    pub(crate) fn is_black(&self) -> bool {
        self.survival == 0.0 || self.t.is_black()
    }
}

/// Returns what gets through per lane towards a light, nothing if something is in the way.
pub(crate) fn transmittance<const N: usize>(
    scene: &Scene,
    from: &From<N>,
    wi: Vec3,
    distance: f32,
    wavelengths: &Wavelengths<N>,
    rng: &mut impl Random,
    counters: &mut Counters,
) -> Passage<N> {
    counters.shadow_rays += 1;
    let mut at = from.clone();
    let mut left = distance * END;
    let mut passage = Passage::FREE;
    let mut snag = Snag::new(at.p);
    for _ in 0..MOST_CROSSINGS {
        let here = touch::departure(scene, &at.inside, &at.standing, at.p, wi);
        let (hit, surface, t) = if let Some((hit, surface)) = here {
            (hit, surface, 0.0)
        } else {
            let ray = at.standing.ray_inside(scene, at.inside.innermost(), at.p, wi).up_to(left);
            // Any hit on what never lets light through will do, and without surfaces that may there is nothing more to find.
            let mut passages = false;
            let blocked = scene.accel.occluded(&ray, |h| {
                let object = &scene.objects[h.shape as usize];
                let may_pass = object.passable || touch::is_near(object, h);
                passages |= may_pass;
                !may_pass
            });
            if blocked {
                return Passage::BLOCKED;
            }
            let next = if passages { touch::nearest(scene, &at.inside, ray) } else { None };
            let Some(next) = next else {
                passage.pass(scene, at.medium.as_ref(), at.p, wi, left / END, wavelengths, rng, counters);
                return passage;
            };
            next
        };
        let object = &scene.objects[hit.shape as usize];
        let point = TexturePoint { p: surface.p, n: surface.ng, uv: surface.uv };
        let cut_out = object.alpha.is_some_and(|a| {
            let alpha = scene.textures.eval_float(a, &point);
            alpha < 1.0 && rng.uniform() >= alpha
        });
        // Out of fibres light passes, too.
        let leaves = object.fibre && wi.dot(surface.ng) > 0.0;
        if !cut_out && !leaves && !object.is_open_to_light(at.inside.meet(object, hit.shape, hit.exiting), hit.exiting)
        {
            return Passage::BLOCKED;
        }
        passage.pass(scene, at.medium.as_ref(), at.p, wi, t, wavelengths, rng, counters);
        if passage.is_black() {
            return Passage::BLOCKED;
        }
        left -= t;
        at.p = surface.p;
        if cut_out {
            at.standing = Standing::Through(hit);
        } else {
            at.cross(scene, object, hit, &point, wi.dot(surface.ng) > 0.0, wavelengths);
        }
        // Get away from walls at the same place.
        if let Some(step) = snag.meet(scene, at.p, &at.standing) {
            if step >= left {
                return passage;
            }
            left -= step;
            at.p += wi * step;
            at.standing = Standing::Space;
            at.inside = scene.nest_at(at.p);
            at.medium = at.inside.medium(scene, wavelengths, at.ambient);
        }
    }
    Passage::BLOCKED
}

impl<const N: usize> From<N> {
    /// Goes to the outer or inner side of an object.
    pub(crate) fn cross(
        &mut self,
        scene: &Scene,
        object: &Object,
        hit: Hit,
        point: &TexturePoint,
        outward: bool,
        wavelengths: &Wavelengths<N>,
    ) {
        if object.body.is_some() {
            let (medium, ambient) = (&mut self.medium, &mut self.ambient);
            self.inside.cross(scene, hit.shape, outward, point, wavelengths, medium, ambient);
        } else {
            self.medium = scene.medium_beyond(object, outward, point, wavelengths, self.medium);
            if self.inside.bodies().is_empty() {
                self.ambient = self.medium;
            }
        }
        self.standing = match (object.body.is_some(), outward) {
            (true, true) => Standing::Outside(hit),
            (true, false) => Standing::Inside(hit),
            (false, _) => Standing::On(hit),
        };
    }
}
