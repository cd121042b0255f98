//! Light of points and parallel beams through a smooth refractive boundary: paths that no random direction ever takes.
//!
//! From a collision point c inside a body the light of a lamp without extent arrives along single directions: those whose ray, refracted at the wall (or mirrored there some times
//! before), leads exactly to the lamp. They are the roots of a smooth system of two equations, found by Newton's method on the primitives that the ray meets, each continued
//! beyond its edges ([`moonmilk_geometry::Patch`]); where the root lies beyond an edge the search goes on from there.
//!
//! *Contribution.* The limit of a small light: with omega(out) the direction behind the wall as a function of the direction omega at c, light of irradiance E at the
//! wall's outer side from infinity contributes
//!
//! $$ \beta\, p_c(\omega)\, T\, \eta^2 P\, E \left| \frac{d\omega}{d\omega_{out}} \right| , $$
//!
//! P the product of the probabilities of what happens at the walls ([`crate::bsdf::boundary::branches`]), T the transmittance; for a point at distance r, E r^2 |d omega / dA| with A the area across the ray at the
//! point. The derivatives are central differences in f64 (step 1e-5, relative error below 1e-8 where the curvature is moderate).
//!
//! *All roots.* The root that a search from the refracted straight direction leads to is counted as it is. There may be others: through another facet, another wall, by another
//! outcome at the wall, after mirrors inside. With probability `EXPLORE` a flight is drawn as the walk would go on, mirrored and refracted at random, and a search started from its
//! direction for the same outcomes; what it finds, if not the first root, counts with the inverse of the probability of finding it, of which the number of further flights until it is found
//! again is an unbiased estimate. As flights are drawn by what roots contribute, the product is even; and every root at which the derivatives do not vanish is counted once in the mean.
//!
//! *Through other bodies.* Milk in a glass, a candle behind a pane: where a scene has clear bodies, or the point is in several, the path goes on behind the body's own wall through smooth boundaries, of
//! whatever bodies (`chain.rs`): refracted at each by the first search, at random by flights, which find what a glass mirrors, inside or onto the milk's outside. What ends it, or lets it pass straight
//! on, is asked for along the root alone.
//!
//! *Fog in a glass.* Where the innermost body lets light straight through but lies in one that does not, the same is done from its inside on, and ways that no wall turns are left to straight
//! connections.
//!
//! *Domain.* A body of a smooth boundary of another index than 1, or without a boundary inside such a body; no normal map, as on all boundaries on the way. Not found: what mirrors and rough boundaries send (those sample the lamp by themselves), caustics on opaque
//! surfaces, and, in scenes without clear bodies, light that a body's own outside or another's mirrors onto it.
//!
//! *Source*: solutions by facets are those of \[Walter2009\]; counting by repeated search \[Zeltner2020\] (specular manifold sampling, section 4), here without its first root's noise and with mirrors.

use moonmilk_core::{DVec3, Frame, Random, Sampler, Spectrum, Wavelengths};
use moonmilk_geometry::Contact;
use moonmilk_walk::Walker;
use moonmilk_walk::jump::Scattering;

use crate::connect::{From, Passage, transmittance};
use crate::integrator::{Counters, Light};
use crate::lights::{Lamp, Target};
use crate::nest::{Inside, Meeting, Nest};
use crate::scene::{Boundary, Scene};

mod chain;

use chain::{Next, Outcome, Own, Setting, Trail, Wall, are_same, tempered};

/// Depth from which searches become rarer [mean free paths].
const SHALLOW: f32 = 0.5;
/// Probability of a search near the surface. A smooth ball of milk, .25, .5, 1: variance per sample 1.6, 1.2, 1.0 at 19, 33, 55 us; a bumpy mesh 13.8, 5.3, 4.6 at 80, 134, 261 us.
const MOST: f32 = 0.5;
/// Least probability of a search, at depths of 11 mean free paths and more: far above the step of a variate.
const LEAST: f32 = 1.0 / 65536.0;
/// Probability of looking for other roots besides: .25 or 1 on that mesh 5.3 or 2.9 at 134 or 245 us; 0 would lose a tenth of its light.
const EXPLORE: f32 = 0.25;
/// Most walls of a path.
const MOST_WALLS: usize = 64;
/// Rounds of aiming.
const AIMS: usize = 5;
/// Rounds of a search: from the primitives met to the root on them.
const ROUNDS: usize = 8;
/// Rounds where light is refracted more than once, and the parts of the way that are tried there: all, half, and so on. A fine lens of interpolated normals above milk loses a fifth of its light to roots that hardly any flight finds
/// without; the marble dragon under the sun gains nothing by them, at 1.2 to 1.45 times the time.
const MANY_ROUNDS: usize = 12;
const PARTS: u32 = 4;
/// Steps of Newton's method on the same primitives.
const STEPS: usize = 12;
/// Halvings of a step.
const HALVINGS: u32 = 8;
/// Longest step [radians].
const LONGEST: f64 = 0.5;
/// Step of difference quotients [radians].
const DIFFERENCE: f64 = 1e-5;
/// Largest angle by which a root may miss [radians].
const TOLERANCE: f64 = 1e-9;
/// Angle below which two roots on the same primitives are one [radians]: where two are about to merge, on a caustic, the root of the tolerance.
const SAME: f64 = 1e-4;
/// Most flights for one root, to which the first of them led: more are needed with a probability below p exp(-p n) for a root found with p, at most 1 / (e n) = 4e-7 for each.
const MOST_FLIGHTS: u32 = 1 << 20;

/// A path behind its last wall.
struct Out {
    p: DVec3,
    d: DVec3,
}

/// A direction that leads to the lamp.
struct Root<'a> {
    omega: DVec3,
    walls: Vec<Wall<'a>>,
    outcomes: Vec<Outcome>,
}

impl Root<'_> {
    /// Returns whether any wall turns it: what goes straight on is found by other strategies.
    fn bends(&self) -> bool {
        self.walls.iter().any(|w| w.eta != 1.0)
    }

    fn is(&self, o: &Root<'_>) -> bool {
        self.omega.distance(o.omega) < SAME && self.outcomes == o.outcomes && are_same(&self.walls, &o.walls)
    }
}

/// A body in which lamps without extent are looked for.
#[derive(Clone, Copy)]
pub(crate) struct Manifold<'a> {
    scene: &'a Scene,
    /// The body whose wall comes first, if that is the innermost's own.
    wall: Option<Own>,
    /// Index there against what is around all bodies: parallel walls outside leave that of all refraction.
    index: f32,
    /// Whether there may be more walls behind it.
    goes_on: bool,
}

/// What a search starts from and aims at.
#[derive(Clone, Copy)]
struct Quest<'a, 'b, const N: usize> {
    setting: Setting<'a, 'b, N>,
    from: &'b From<N>,
}

/// Returns two unit vectors across a unit vector.
fn across(d: DVec3) -> [DVec3; 2] {
    let f = Frame::new(d.as_vec3());
    let s = f.s.as_dvec3();
    let s = (s - d * s.dot(d)).normalize();
    [s, d.cross(s)]
}

impl<'a> Manifold<'a> {
    /// Returns the searches for lamps of the body that counts where a path is, or `None` where there are none to find: see the domain above.
    pub fn new(scene: &'a Scene, nest: &Nest) -> Option<Self> {
        let (&Inside { shape, index, .. }, around) = nest.bodies().split_last()?;
        if !scene.lights.has_unseen() {
            return None;
        }
        let o = &scene.objects[shape as usize];
        let meeting = nest.meet(o, shape, true);
        if o.is_open_to_light(meeting, true) {
            let refracts = |b: &Inside| scene.objects[b.shape as usize].refracts();
            return around.iter().any(refracts).then_some(Self { scene, wall: None, index, goes_on: true });
        }
        let (Boundary::Smooth { eta }, Meeting::True(outer)) = (o.boundary, meeting) else {
            return None;
        };
        if o.body.is_none() || scene.materials.perturbs_normals(o.material) {
            return None;
        }
        // By the index against what is around all bodies; one body's own may be relative.
        let eta = eta / outer;
        let index = if around.is_empty() { eta } else { index };
        let goes_on = scene.has_clear || !around.is_empty();
        Some(Self { scene, wall: Some(Own { object: shape, eta }), index, goes_on })
    }

    /// Draws a flight as the walk would go on, but for sure to the first wall; returns its direction and what it did at the walls until there were no more, `None` if it did not get out.
    fn flight<const N: usize>(
        quest: &Quest<'a, '_, N>,
        vertex: &impl Scattering<N>,
        sigma_t: f32,
        rng: &mut Sampler,
        counters: &mut Counters,
    ) -> Option<(DVec3, Vec<Outcome>)> {
        let start = vertex.draw(rng).as_dvec3().normalize();
        let mut trail = Trail::new(quest.setting, quest.from.clone(), start);
        let mut outcomes = vec![];
        while outcomes.len() < MOST_WALLS {
            let (wall, at) = match trail.next(counters) {
                Next::Wall(_, _, true) if rng.uniform() < 0.5 => return Some((start, outcomes)),
                Next::Wall(wall, at, _) => (wall, at),
                Next::Clear => return Some((start, outcomes)),
                Next::Lost => return None,
            };
            let tau = at.t as f32 * if trail.is_inside { sigma_t } else { trail.sigma_t() };
            if trail.has_met() && tau > 0.0 && rng.uniform() >= (-tau).exp() {
                return None;
            }
            let outcome = wall.draw(trail.d, &at, rng.uniform());
            outcomes.push(outcome);
            if !trail.go(&wall, &at, outcome) {
                return None;
            }
        }
        None
    }

    /// Follows a direction over the continued primitives of some walls; calls `each` at every one with the direction of arrival.
    fn follow(
        walls: &[Wall],
        c: DVec3,
        omega: DVec3,
        outcomes: &[Outcome],
        mut each: impl FnMut(&Wall, &Contact, DVec3, Outcome),
    ) -> Option<Out> {
        let mut out = Out { p: c, d: omega };
        for (wall, &outcome) in walls.iter().zip(outcomes) {
            let at = wall.patch.meet(out.p, out.d, wall.t)?;
            each(wall, &at, out.d, outcome);
            out = Out { p: at.p, d: wall.turn(out.d, &at, outcome)? };
        }
        Some(out)
    }

    /// Returns by how much a path misses the target, across the way to it \[radians\].
    fn miss(target: &Target, out: &Out) -> DVec3 {
        out.d - towards(target, out.p)
    }

    /// Moves a direction to the root on the continued primitives of some walls: Newton's method, its steps halved until they come closer. Returns where it got, and whether that is the root.
    fn polish(walls: &[Wall], c: DVec3, mut omega: DVec3, outcomes: &[Outcome], target: &Target) -> (DVec3, bool) {
        let Some(mut out) = Self::follow(walls, c, omega, outcomes, |_, _, _, _| ()) else { return (omega, false) };
        let mut e = Self::miss(target, &out);
        for _ in 0..STEPS {
            if e.length() < TOLERANCE {
                return (omega, true);
            }
            let [x, y] = across(towards(target, out.p));
            let [s, t] = across(omega);
            let slope = |u: DVec3| -> Option<[f64; 2]> {
                let at = |h: f64| Self::follow(walls, c, (omega + u * h).normalize(), outcomes, |_, _, _, _| ());
                let e = Self::miss(target, &at(DIFFERENCE)?) - Self::miss(target, &at(-DIFFERENCE)?);
                Some([e.dot(x), e.dot(y)].map(|e| e / (2.0 * DIFFERENCE)))
            };
            let (Some([a, b]), Some([f, g])) = (slope(s), slope(t)) else { return (omega, false) };
            let (ex, ey) = (e.dot(x), e.dot(y));
            let det = a * g - f * b;
            let step = s * ((f * ey - g * ex) / det) + t * ((b * ex - a * ey) / det);
            let length = step.length();
            if !length.is_finite() {
                return (omega, false);
            }
            let mut share = (LONGEST / length).min(1.0);
            let closer = (0..=HALVINGS).find_map(|_| {
                let there = (omega + step * share).normalize();
                share *= 0.5;
                let out = Self::follow(walls, c, there, outcomes, |_, _, _, _| ())?;
                let miss = Self::miss(target, &out);
                (miss.length() < e.length()).then_some((there, out, miss))
            });
            let Some(closer) = closer else { return (omega, false) };
            (omega, out, e) = closer;
        }
        (omega, false)
    }

    /// Returns the walls that a path along omega meets for some outcomes, or for refraction at every one until there are no more; `None` if there is no such path.
    fn walls<const N: usize>(
        quest: &Quest<'a, '_, N>,
        omega: DVec3,
        plan: Option<&[Outcome]>,
        counters: &mut Counters,
    ) -> Option<Vec<Wall<'a>>> {
        let mut trail = Trail::new(quest.setting, quest.from.clone(), omega);
        let mut walls = Vec::new();
        while plan.map_or(MOST_WALLS, <[_]>::len) > walls.len() {
            match trail.next(counters) {
                Next::Wall(_, _, true) if plan.is_none() => break,
                Next::Wall(wall, at, _) => {
                    let outcome = plan.map_or(Outcome::Refracted, |p| p[walls.len()]);
                    walls.push(wall);
                    if !trail.go(&wall, &at, outcome) {
                        return None;
                    }
                }
                Next::Clear if plan.is_none() => break,
                Next::Clear | Next::Lost => return None,
            }
        }
        (!trail.is_inside).then_some(walls)
    }

    /// Searches for a root from a direction, with given outcomes or by refraction alone: on the primitives met to the root of their continuation, and where others are met there, on from them.
    fn search<const N: usize>(
        quest: &Quest<'a, '_, N>,
        mut omega: DVec3,
        plan: Option<&[Outcome]>,
        counters: &mut Counters,
    ) -> Option<Root<'a>> {
        let (c, target) = (quest.from.p.as_dvec3(), quest.setting.target);
        let outcomes = |walls: &[Wall]| plan.map_or_else(|| vec![Outcome::Refracted; walls.len()], <[_]>::to_vec);
        let miss = |walls: &[Wall], omega: DVec3| {
            let out = Self::follow(walls, c, omega, &outcomes(walls), |_, _, _, _| ())?;
            Some(Self::miss(target, &out).length())
        };
        let mut walls = Self::walls(quest, omega, plan, counters)?;
        let refracts = |(wall, outcome): (&Wall, Outcome)| wall.eta != 1.0 && outcome.is_transmitted();
        let refractions = walls.iter().zip(outcomes(&walls)).filter(|&w| refracts(w)).count();
        let (rounds, parts) = if refractions > 1 { (MANY_ROUNDS, PARTS) } else { (ROUNDS, 0) };
        for _ in 0..rounds {
            let (goal, is_root) = Self::polish(&walls, c, omega, &outcomes(&walls), target);
            if !is_root && parts == 0 {
                return None;
            }
            let there = Self::walls(quest, goal, plan, counters);
            if let Some(there) = there.as_ref().filter(|w| is_root && are_same(w, &walls)) {
                let outcomes = outcomes(there);
                return Some(Root { omega: goal, walls: there.clone(), outcomes });
            }
            // Go as far as the real surface comes closer, which is bent where its primitives are not.
            let now = miss(&walls, omega)?;
            let mut share = 1.0;
            let closer = (0..parts).find_map(|k| {
                let part = (omega + (goal - omega) * share).normalize();
                share *= 0.5;
                let met = if k == 0 { there.clone() } else { Self::walls(quest, part, plan, counters) }?;
                (miss(&met, part)? < now).then_some((part, met))
            });
            // Facets may have to be left against that.
            (omega, walls) = closer.or_else(|| there.filter(|_| is_root).map(|w| (goal, w)))?;
        }
        None
    }

    /// Returns where to begin: the direction that the surface on the straight way to the target would refract there if it were plane, then again on that way, until the real surface lets it out.
    fn aimed<const N: usize>(&self, quest: &Quest<'a, '_, N>, counters: &mut Counters) -> Option<DVec3> {
        let (eta, target) = (f64::from(self.index), quest.setting.target);
        let mut omega = towards(target, quest.from.p.as_dvec3());
        for round in 0..AIMS {
            let Next::Wall(wall, at, _) = Trail::new(quest.setting, quest.from.clone(), omega).next(counters) else {
                return None;
            };
            if round > 0 && wall.turn(omega, &at, Outcome::Refracted).is_some() {
                return Some(omega);
            }
            let n = tempered(at.ng, at.ns);
            let v = towards(target, at.p);
            let k = v.dot(n);
            let cos2 = 1.0 - (1.0 - k * k) / (eta * eta);
            // Where the plane has its back to the target, begin where anything is refracted.
            omega = if k > 0.0 && cos2 > 0.0 { (v / eta + n * (cos2.sqrt() - k / eta)).normalize() } else { n };
        }
        None
    }

    /// Looks for a lamp from a vertex where the walk has the weight `beta` before a direction is chosen; `sigma_t` is the extinction there, by which searches are spread, `room` a lower bound of the depth.
    pub fn connect<const N: usize>(
        &self,
        walker: &Walker<N>,
        beta: Spectrum<N>,
        vertex: &impl Scattering<N>,
        sigma_t: f32,
        room: f32,
        from: From<N>,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) {
        let q = (MOST * (SHALLOW - sigma_t * room).exp().min(1.0)).max(LEAST);
        if rng.uniform() >= q {
            return;
        }
        let u = [rng.uniform(), rng.uniform(), rng.uniform()];
        let Some((lamp, probability)) = self.scene.lights.choose_unseen(walker.p, u) else { return };
        let Some(target) = &self.scene.lights.target(lamp) else { return };
        let setting = Setting { scene: self.scene, wall: self.wall, target, w, goes_on: self.goes_on };
        let quest = Quest { setting, from: &from };
        let mut count = |root: &Root, factor: f32, rng: &mut Sampler, counters: &mut Counters| {
            let (value, _) = vertex.towards(root.omega.as_vec3());
            if value.is_black() {
                return;
            }
            if let Some(found) = Self::arriving(&quest, root, lamp, rng, counters) {
                light.add(walker.collisions, beta * value * found * (factor / (q * probability)));
            }
        };

        let aimed = self.aimed(&quest, counters);
        let first = aimed.and_then(|omega| Self::search(&quest, omega, None, counters)).filter(Root::bends);
        if let Some(root) = &first {
            count(root, 1.0, rng, counters);
        }
        // Look for any other root.
        if rng.uniform() >= EXPLORE {
            return;
        }
        let Some((omega, outcomes)) = Self::flight(&quest, vertex, sigma_t, rng, counters) else { return };
        let Some(root) = Self::search(&quest, omega, Some(&outcomes), counters) else { return };
        if !root.bends() || first.is_some_and(|f| f.is(&root)) {
            return;
        }
        let mut flights = 1;
        while flights < MOST_FLIGHTS {
            let again = Self::flight(&quest, vertex, sigma_t, rng, counters).filter(|f| f.1 == outcomes);
            if again.is_some_and(|f| Self::search(&quest, f.0, Some(&f.1), counters).is_some_and(|r| r.is(&root))) {
                break;
            }
            flights += 1;
        }
        count(&root, flights as f32 / EXPLORE, rng, counters);
    }

    /// Returns what arrives from the lamp along a root, per value of the vertex in that direction.
    fn arriving<const N: usize>(
        quest: &Quest<'a, '_, N>,
        root: &Root,
        lamp: Lamp,
        rng: &mut Sampler,
        counters: &mut Counters,
    ) -> Option<Spectrum<N>> {
        let Setting { scene, target, w, .. } = quest.setting;
        let c = quest.from.p.as_dvec3();
        // Go along once for what is around, the probabilities, and the squared index.
        let (mut place, mut way, mut factor) = (quest.from.clone(), Passage::FREE, 1.0);
        let out = Self::follow(&root.walls, c, root.omega, &root.outcomes, |wall, at, d, outcome| {
            way.pass(scene, place.medium.as_ref(), place.p, d.as_vec3(), at.t as f32, w, rng, counters);
            factor *= wall.probabilities(d, at)[outcome as usize];
            if outcome.is_transmitted() {
                factor *= if wall.hit.exiting { wall.eta * wall.eta } else { 1.0 / (wall.eta * wall.eta) };
            }
            wall.pass(scene, &mut place, at, d.as_vec3(), outcome, w);
        })?;
        if factor == 0.0 || way.is_black() {
            return None;
        }
        let (irradiance, wi, distance) = scene.lights.irradiance(lamp, out.p.as_vec3(), w)?;

        // The derivative of where the light goes: direction at infinity, or point on the plane across the ray.
        let v = towards(target, out.p);
        let e = across(v);
        let [s, r] = across(root.omega);
        let ends = |h: DVec3| -> Option<DVec3> {
            let omega = (root.omega + h * DIFFERENCE).normalize();
            let out = Self::follow(&root.walls, c, omega, &root.outcomes, |_, _, _, _| ())?;
            Some(match *target {
                Target::Direction(_) => out.d,
                // In units of the distance, so that irradiance belongs to it.
                Target::Point(y) => {
                    let to = y.as_dvec3() - out.p;
                    (out.d * (to.dot(v) / out.d.dot(v)) - to) / f64::from(distance)
                }
            })
        };
        let slope = |u: DVec3| -> Option<[f64; 2]> {
            let change = ends(u)? - ends(-u)?;
            Some(e.map(|e| change.dot(e) / (2.0 * DIFFERENCE)))
        };
        let ([a, c], [b, d]) = (slope(s)?, slope(r)?);
        let stretch = (a * d - b * c).abs();
        if stretch == 0.0 {
            return None;
        }
        let passage = transmittance(scene, &place, wi, distance, w, rng, counters);
        let factor = factor / stretch as f32 * way.survival * passage.survival;
        (!passage.is_black()).then(|| way.t * passage.t * irradiance * factor)
    }
}

/// Returns the unit direction from x to a target.
fn towards(target: &Target, x: DVec3) -> DVec3 {
    match target {
        Target::Direction(d) => d.as_dvec3().normalize(),
        Target::Point(y) => (y.as_dvec3() - x).normalize(),
    }
}
