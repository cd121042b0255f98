//! Splitting by importance: more walks where a forward-scattering medium is about to let light in.
//!
//! In a medium that scatters forward only a walk that flies towards the lit wall near it can find much light, and few do: the noise is in the walk's direction long before its last collision. So at a collision a walk
//! of weight w goes on as w I copies of weight 1 / I, or ends with probability 1 - w I where that is far below 1, with the importance
//!
//! $$ I = 1 + K (k + .2)\, e^{-a \sigma_t' s} \left( .3 + .7\, \frac{p_{.7}(\omega \cdot \omega_L)}{p_{.7}(1)} \right) , $$
//!
//! s the distance to the wall towards a point on a light, k the cosine of the light at that wall, omega_L the direction that the wall refracts to it, p_.7 the law of Henyey and Greenstein. Every number in it
//! changes the noise alone: the expectation is that of the walk without, for any I.
//!
//! *Gain.* On the reference milk (g .9, 6 transport mean free paths of radius) 1.7 times the efficiency: 4.9 times less variance (6.68, 1.36 per sample) at 2.8 times the time.
//!
//! *Source*: recipe found for moonmilk (its K 32, a .5); weight windows are those of neutron transport \[Booth1984\].

use moonmilk_core::{Random, Sampler, Vec3, Wavelengths};
use moonmilk_geometry::{Facing, Ray};
use moonmilk_walk::{Medium, Walker};

use crate::bsdf::boundary::near;
use crate::integrator::Counters;
use crate::lights::Target;
use crate::scene::{Boundary, Scene};

/// Asymmetry from which walks are split.
pub(crate) const FORWARD: f32 = 0.6;
/// Importance right at a wall that faces the light, flying towards it.
///
/// Reference milk, 0, 32, 64 (a .7): variance per sample 6.8, 1.49, 1.01 at .66, 1.82, 2.60 CPU s per sample of the picture.
const HEIGHT: f32 = 64.0;
/// How fast importance falls with the distance to the wall [1 / transport mean free path].
const FALL: f32 = 1.0;
/// Distance to any wall beyond which importance is 1 [transport mean free paths].
const REACH: f32 = 3.0;
/// Collisions between two decisions times 1 - g. Reference milk (g .9), every 1, 3, 5, 8 collisions: variance 1.25, 1.41, 1.49, 1.63 at 3.34, 2.15, 1.82, 1.64 s: each asks for a ray, and
/// directions last for a transport mean free path.
const PERIOD: f32 = 0.8;
/// Copies from which a walk is split, and most of them.
const SPLIT: f32 = 1.5;
const MOST: f32 = 20.0;
/// Share of a copy below which a walk may end, and the share that survivors stand for.
const FEW: f32 = 0.25;
const SURVIVORS: f32 = 0.5;

/// The importance of walks in one body.
#[derive(Clone, Copy)]
pub(crate) struct Window<'a> {
    scene: &'a Scene,
    object: u32,
    eta: f32,
    target: Target,
    height: f32,
    /// Collisions from decision to decision.
    period: u32,
    /// Reduced extinction of the hero.
    sigma_t_prime: f32,
}

impl<'a> Window<'a> {
    /// Returns the importance for a walk from p in a body, `None` where scattering is not forward or there is no light to fly to.
    pub fn new<const N: usize>(
        scene: &'a Scene,
        object: Option<u32>,
        medium: &Medium<N>,
        p: Vec3,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
    ) -> Option<Self> {
        if medium.g < FORWARD {
            return None;
        }
        let object = object?;
        let o = &scene.objects[object as usize];
        let Boundary::Smooth { eta } = o.boundary else { return None };
        o.body?;
        let u = [rng.uniform(), rng.uniform(), rng.uniform()];
        let target = if scene.lights.has_aims() {
            scene.lights.aim(p, None, w, u)?.target
        } else {
            scene.lights.target(scene.lights.choose_unseen(p, u)?.0)?
        };
        // Where most light comes from all around, splitting would multiply its noise.
        let height = HEIGHT * scene.lights.share_of_lamps(p);
        let sigma_t_prime = medium.sigma_s[0] * (1.0 - medium.g) + medium.sigma_a[0];
        let period = (PERIOD / (1.0 - medium.g)).max(1.0) as u32;
        (height >= 1.0).then_some(Self { scene, object, eta, target, height, period, sigma_t_prime })
    }

    /// Returns the importance of a walk that arrives at p along d, `room` a lower bound of its distance to any wall.
    fn importance(&self, p: Vec3, d: Vec3, room: f32, counters: &mut Counters) -> f32 {
        if self.sigma_t_prime * room > REACH {
            return 1.0;
        }
        let towards = |x: Vec3| match self.target {
            Target::Point(y) => (y - x).normalize(),
            Target::Direction(d) => d,
        };
        let Some(body) = self.scene.objects[self.object as usize].body else { return 1.0 };
        counters.segments += 1;
        let ray = Ray::new(p, towards(p)).up_to(REACH / self.sigma_t_prime).facing(Facing::Exiting(body));
        let Some(hit) = self.scene.accel.nearest(&ray).filter(|h| h.shape == self.object && h.exiting) else {
            return 1.0;
        };
        let (x, ng, ns) = self.scene.accel.point_and_normals(&ray, &hit);
        let (n, v) = (near(ng, ns), towards(x));
        let k = v.dot(n);
        if k <= 0.0 {
            return 1.0;
        }
        let cos2 = (1.0 - (1.0 - k * k) / (self.eta * self.eta)).max(0.0);
        let omega = v / self.eta + n * (cos2.sqrt() - k / self.eta);
        // p_g(c) / p_g(1) = ((1 - g)^2 / (1 + g^2 - 2 g c))^(3/2).
        let ratio = 0.09 / (1.49 - 1.4 * d.dot(omega).min(1.0));
        let lobe = ratio * ratio.sqrt();
        1.0 + self.height * (k + 0.2) * (-FALL * self.sigma_t_prime * hit.t).exp() * (0.3 + 0.7 * lobe)
    }

    /// Returns how many copies go on from a collision that the walker arrived at along its direction, and weighs it as one of them.
    pub fn copies<const N: usize>(&self, walker: &mut Walker<N>, rng: &mut Sampler, counters: &mut Counters) -> u32 {
        if walker.collisions.is_multiple_of(self.period) { self.divide(walker, rng, counters) } else { 1 }
    }

    /// Returns how many copies go on from where the walker is, whatever its number of collisions, and weighs it as one of them.
    pub fn divide<const N: usize>(&self, walker: &mut Walker<N>, rng: &mut Sampler, counters: &mut Counters) -> u32 {
        let importance = self.importance(walker.p, walker.d, walker.room, counters);
        // The mean of the lanes: the largest alone, when they have parted, would ask for as many copies as there are lanes.
        let copies = (importance * walker.beta.mean() * walker.eta_scale).min(MOST);
        if copies > SPLIT {
            walker.beta *= 1.0 / copies;
            (copies + rng.uniform()) as u32
        } else if copies < FEW {
            let survival = copies / SURVIVORS;
            walker.beta *= if survival > 0.0 { 1.0 / survival } else { 0.0 };
            u32::from(rng.uniform() < survival)
        } else {
            1
        }
    }
}
