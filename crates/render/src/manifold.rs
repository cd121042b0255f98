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
//! P the product of the probabilities of what happens at the walls ([`branches`]), T the transmittance; for a point at distance r, E r^2 |d omega / dA| with A the area across the ray at the
//! point. The derivatives are central differences in f64 (step 1e-5, relative error below 1e-8 where the curvature is moderate).
//!
//! *All roots.* The root that a search from the refracted straight direction leads to is counted as it is. There may be others: through another facet, another wall, by another
//! outcome at the wall, after mirrors inside. With probability `EXPLORE` a flight is drawn as the walk would go on, mirrored and refracted at random, and a search started from its
//! direction for the same outcomes; what it finds, if not the first root, counts with the inverse of the probability of finding it, of which the number of further flights until it is found
//! again is an unbiased estimate. As flights are drawn by what roots contribute, the product is even; and every root at which the derivatives do not vanish is counted once in the mean.
//!
//! *Domain.* One body around the point, of a smooth boundary of another index than 1 without a normal map, homogeneous media. Lit through two refractive boundaries (milk in a glass) such lamps
//! are not found, nor are caustics behind a clear body.
//!
//! *Source*: solutions by facets are those of \[Walter2009\]; counting by repeated search \[Zeltner2020\] (specular manifold sampling, section 4), here without its first root's noise and with mirrors.

use moonmilk_core::{DVec3, Frame, Random, Sampler, Spectrum, Vec3, Wavelengths};
use moonmilk_geometry::{Contact, Facing, Hit, Patch, Prim, Ray};
use moonmilk_walk::jump::Scattering;
use moonmilk_walk::{Medium, Walker};

use crate::bsdf::boundary::{NEAR, branches, near};
use crate::connect::{From, transmittance};
use crate::integrator::{Counters, Light};
use crate::lights::{Lamp, Target};
use crate::nest::{Inside, Nest};
use crate::scene::{Boundary, Scene};
use crate::texture::TexturePoint;

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
/// Most flights for one root, for which the first of them led to it: more with a probability that is nothing.
const MOST_FLIGHTS: u32 = 1 << 16;

/// What a path does at a wall: the outcomes of [`branches`] in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    Mirrored = 0,
    Refracted = 1,
    Crossed = 2,
    Aside = 3,
}

const OUTCOMES: [Outcome; 4] = [Outcome::Mirrored, Outcome::Refracted, Outcome::Crossed, Outcome::Aside];

/// Refraction at the first wall.
const PLAIN: &[Outcome] = &[Outcome::Refracted];

/// A wall that a path meets.
#[derive(Clone, Copy)]
struct Wall<'a> {
    hit: Hit,
    patch: Patch<'a>,
}

/// A path behind its last wall.
struct Out {
    p: DVec3,
    d: DVec3,
    /// Length of the way inside.
    length: f64,
    /// Product of the probabilities of the outcomes.
    probability: f32,
}

/// A direction that leads to the lamp.
struct Root<'a> {
    omega: DVec3,
    walls: Vec<Wall<'a>>,
}

fn are_same(a: &[Wall], b: &[Wall]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.hit.prim == b.hit.prim)
}

impl Root<'_> {
    fn is(&self, o: &Root<'_>) -> bool {
        self.omega.distance(o.omega) < SAME && are_same(&self.walls, &o.walls)
    }
}

/// A body in which lamps without extent are looked for.
#[derive(Clone, Copy)]
pub(crate) struct Manifold<'a> {
    scene: &'a Scene,
    object: u32,
    eta: f32,
    sigma_t: f32,
}

/// Returns the direction in which an outcome goes on that arrives along d from inside, for unit normals to the outside: [`branches`] in f64. `None` if there is none.
fn turn(d: DVec3, ng: DVec3, ns: DVec3, eta: f64, outcome: Outcome) -> Option<DVec3> {
    let mirror = |w: DVec3, n: DVec3| w - n * (2.0 * w.dot(n));
    // From inside outward: n1 sin = n2 sin, along the normal n.
    let refract = |w: DVec3, n: DVec3| {
        let c = w.dot(n);
        let cos2 = 1.0 - eta * eta * (1.0 - c * c);
        (c > 0.0 && cos2 > 0.0).then(|| w * eta + n * (cos2.sqrt() - eta * c))
    };
    // Reflection in the plane of both normals.
    let aside = |w: DVec3| {
        let across = ng.cross(ns);
        if across.length_squared() < 1e-8 { w } else { mirror(w, across.normalize()) }
    };
    match outcome {
        Outcome::Mirrored => Some(mirror(d, ns)),
        Outcome::Refracted => refract(d, ns),
        Outcome::Crossed => refract(mirror(aside(-d), ng), ng),
        Outcome::Aside => Some(aside(-d)),
    }
    .map(DVec3::normalize)
}

/// Returns [`near`] in f64.
fn tempered(ng: DVec3, ns: DVec3) -> DVec3 {
    // Only where it turns the normal, so that elsewhere no digits are lost.
    if near(ng.as_vec3(), ns.as_vec3()) == ns.as_vec3() {
        return ns;
    }
    let tangent = ns - ng * ns.dot(ng);
    let angle = f64::from(NEAR).acos();
    tangent.try_normalize().map_or(ng, |t| ng * angle.cos() + t * angle.sin())
}

/// Returns two unit vectors across a unit vector.
fn across(d: DVec3) -> [DVec3; 2] {
    let f = Frame::new(d.as_vec3());
    let s = f.s.as_dvec3();
    let s = (s - d * s.dot(d)).normalize();
    [s, d.cross(s)]
}

impl<'a> Manifold<'a> {
    /// Returns the searches for lamps of the one body that a path is in, or `None` where there are none to find: see the domain above.
    pub fn new<const N: usize>(scene: &'a Scene, nest: &Nest, medium: &Medium<N>) -> Option<Self> {
        let [Inside { shape: object, .. }] = *nest.bodies() else { return None };
        let o = &scene.objects[object as usize];
        let Boundary::Smooth { eta } = o.boundary else { return None };
        let sigma_t = medium.sigma_t[0];
        let possible = o.body.is_some() && eta != 1.0 && sigma_t > 0.0 && !scene.materials.perturbs_normals(o.material);
        (possible && scene.lights.has_unseen()).then_some(Self { scene, object, eta, sigma_t })
    }

    /// Returns the walls that a path from c along omega meets, `None` if it does not run inside the body.
    fn walls(&self, c: Vec3, omega: DVec3, outcomes: &[Outcome], counters: &mut Counters) -> Option<Vec<Wall<'a>>> {
        let mut walls = Vec::with_capacity(outcomes.len());
        let (mut o, mut d, mut from) = (c, omega, None);
        for &outcome in outcomes {
            let (wall, at) = self.wall(o, d, from, counters)?;
            d = turn(d, at.ng, tempered(at.ng, at.ns), f64::from(self.eta), outcome)?;
            (o, from) = (at.p.as_vec3(), Some(wall.hit.prim));
            walls.push(wall);
        }
        Some(walls)
    }

    /// Returns the wall that a ray inside the body meets, and where.
    fn wall(&self, o: Vec3, d: DVec3, from: Option<Prim>, counters: &mut Counters) -> Option<(Wall<'a>, Contact)> {
        counters.segments += 1;
        let body = self.scene.objects[self.object as usize].body?;
        let mut ray = Ray::new(o, d.as_vec3()).facing(Facing::Exiting(body));
        if let Some(prim) = from {
            ray = ray.from_prim(prim);
        }
        let hit = self.scene.accel.nearest(&ray).filter(|h| h.shape == self.object && h.exiting)?;
        let patch = self.scene.accel.patch(&hit);
        let at = patch.meet(o.as_dvec3(), d, f64::from(hit.t))?;
        Some((Wall { hit, patch }, at))
    }

    /// Draws a flight as the walk would go on, but for sure to the first wall; returns its direction and what it did at the walls until it left, `None` if it did not.
    fn flight<const N: usize>(
        &self,
        c: Vec3,
        vertex: &impl Scattering<N>,
        rng: &mut Sampler,
        counters: &mut Counters,
    ) -> Option<(DVec3, Vec<Outcome>)> {
        let start = vertex.draw(rng).as_dvec3().normalize();
        let (mut o, mut d, mut from) = (c, start, None);
        let mut outcomes = vec![];
        while outcomes.len() < MOST_WALLS {
            let (wall, at) = self.wall(o, d, from, counters)?;
            if from.is_some() && rng.uniform() >= (-self.sigma_t * at.t as f32).exp() {
                return None;
            }
            let ns = tempered(at.ng, at.ns);
            let mut u = rng.uniform();
            let all = branches(-d.as_vec3(), at.ng.as_vec3(), ns.as_vec3(), self.eta);
            let chosen = all.iter().position(|b| {
                u -= b.0;
                u < 0.0
            });
            let outcome = OUTCOMES[chosen.unwrap_or(0)];
            outcomes.push(outcome);
            if matches!(outcome, Outcome::Refracted | Outcome::Crossed) {
                return Some((start, outcomes));
            }
            d = turn(d, at.ng, ns, f64::from(self.eta), outcome)?;
            (o, from) = (at.p.as_vec3(), Some(wall.hit.prim));
        }
        None
    }

    /// Follows a direction over the continued primitives of some walls.
    fn follow(&self, walls: &[Wall], c: DVec3, omega: DVec3, outcomes: &[Outcome], weigh: bool) -> Option<Out> {
        let mut out = Out { p: c, d: omega, length: 0.0, probability: 1.0 };
        for (wall, &outcome) in walls.iter().zip(outcomes) {
            let at = wall.patch.meet(out.p, out.d, f64::from(wall.hit.t))?;
            let ns = tempered(at.ng, at.ns);
            if weigh {
                let all = branches(-out.d.as_vec3(), at.ng.as_vec3(), ns.as_vec3(), self.eta);
                out.probability *= all[outcome as usize].0;
            }
            let d = turn(out.d, at.ng, ns, f64::from(self.eta), outcome)?;
            out = Out { p: at.p, d, length: out.length + at.t, ..out };
        }
        Some(out)
    }

    /// Returns by how much a path misses the target, across the way to it \[radians\].
    fn miss(target: &Target, out: &Out) -> DVec3 {
        out.d - towards(target, out.p)
    }

    /// Moves a direction to the root on the continued primitives of some walls: Newton's method, its steps halved until they come closer.
    fn polish(
        &self,
        walls: &[Wall],
        c: DVec3,
        mut omega: DVec3,
        outcomes: &[Outcome],
        target: &Target,
    ) -> Option<DVec3> {
        let mut out = self.follow(walls, c, omega, outcomes, false)?;
        let mut e = Self::miss(target, &out);
        for _ in 0..STEPS {
            if e.length() < TOLERANCE {
                return Some(omega);
            }
            let [x, y] = across(towards(target, out.p));
            let [s, t] = across(omega);
            let slope = |u: DVec3| -> Option<[f64; 2]> {
                let at = |h: f64| self.follow(walls, c, (omega + u * h).normalize(), outcomes, false);
                let e = Self::miss(target, &at(DIFFERENCE)?) - Self::miss(target, &at(-DIFFERENCE)?);
                Some([e.dot(x), e.dot(y)].map(|e| e / (2.0 * DIFFERENCE)))
            };
            let ([a, b], [f, g]) = (slope(s)?, slope(t)?);
            let (ex, ey) = (e.dot(x), e.dot(y));
            let det = a * g - f * b;
            let step = s * ((f * ey - g * ex) / det) + t * ((b * ex - a * ey) / det);
            let length = step.length();
            if !length.is_finite() {
                return None;
            }
            let mut share = (LONGEST / length).min(1.0);
            let mut left = HALVINGS;
            (omega, out, e) = loop {
                let there = (omega + step * share).normalize();
                if let Some(out) = self.follow(walls, c, there, outcomes, false) {
                    let miss = Self::miss(target, &out);
                    if miss.length() < e.length() {
                        break (there, out, miss);
                    }
                }
                if left == 0 {
                    return None;
                }
                (share, left) = (0.5 * share, left - 1);
            };
        }
        None
    }

    /// Searches for a root from a direction.
    fn search(
        &self,
        c: Vec3,
        mut omega: DVec3,
        outcomes: &[Outcome],
        target: &Target,
        counters: &mut Counters,
    ) -> Option<Root<'a>> {
        let mut walls = self.walls(c, omega, outcomes, counters)?;
        for _ in 0..ROUNDS {
            omega = self.polish(&walls, c.as_dvec3(), omega, outcomes, target)?;
            let there = self.walls(c, omega, outcomes, counters)?;
            if are_same(&there, &walls) {
                return Some(Root { omega, walls: there });
            }
            walls = there;
        }
        None
    }

    /// Returns where to begin: the direction that the surface on the straight way to the target would refract there if it were plane, then again on that way, until the real surface lets it out.
    fn aimed(&self, c: Vec3, target: &Target, counters: &mut Counters) -> Option<DVec3> {
        let eta = f64::from(self.eta);
        let mut omega = towards(target, c.as_dvec3());
        for round in 0..AIMS {
            let (_, at) = self.wall(c, omega, None, counters)?;
            let n = tempered(at.ng, at.ns);
            if round > 0 && turn(omega, at.ng, n, eta, Outcome::Refracted).is_some() {
                return Some(omega);
            }
            let v = towards(target, at.p);
            let k = v.dot(n);
            let cos2 = 1.0 - (1.0 - k * k) / (eta * eta);
            // Where the plane has its back to the target, begin where anything is refracted.
            omega = if k > 0.0 && cos2 > 0.0 { (v / eta + n * (cos2.sqrt() - k / eta)).normalize() } else { n };
        }
        None
    }

    /// Looks for a lamp from a vertex where the walk has the weight `beta` before a direction is chosen; `room` is a lower bound of the depth.
    pub fn connect<const N: usize, P>(
        &self,
        walker: &Walker<N>,
        medium: &Medium<N, P>,
        beta: Spectrum<N>,
        vertex: &impl Scattering<N>,
        room: f32,
        from: From<N>,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) {
        let q = (MOST * (SHALLOW - self.sigma_t * room).exp().min(1.0)).max(LEAST);
        if rng.uniform() >= q {
            return;
        }
        let u = [rng.uniform(), rng.uniform(), rng.uniform()];
        let Some((lamp, probability)) = self.scene.lights.choose_unseen(walker.p, u) else { return };
        let Some(target) = self.scene.lights.target(lamp) else { return };
        let c = walker.p;
        let mut count = |root: &Root, outcomes: &[Outcome], factor: f32, rng: &mut Sampler, counters: &mut Counters| {
            let (value, _) = vertex.towards(root.omega.as_vec3());
            if value.is_black() {
                return;
            }
            let found = self.arriving(root, medium, outcomes, lamp, &target, &from, w, rng, counters);
            if let Some(found) = found {
                light.add(walker.collisions, beta * value * found * (factor / (q * probability)));
            }
        };

        let aimed = self.aimed(c, &target, counters);
        let first = aimed.and_then(|omega| self.search(c, omega, PLAIN, &target, counters));
        if let Some(root) = &first {
            count(root, PLAIN, 1.0, rng, counters);
        }
        // Look for any other root.
        if rng.uniform() >= EXPLORE {
            return;
        }
        let Some((omega, outcomes)) = self.flight(c, vertex, rng, counters) else { return };
        let Some(root) = self.search(c, omega, &outcomes, &target, counters) else { return };
        if outcomes == PLAIN && first.is_some_and(|f| f.is(&root)) {
            return;
        }
        let mut flights = 1;
        while flights < MOST_FLIGHTS {
            let again = self.flight(c, vertex, rng, counters).filter(|f| f.1 == outcomes);
            if again.is_some_and(|f| self.search(c, f.0, &outcomes, &target, counters).is_some_and(|r| r.is(&root))) {
                break;
            }
            flights += 1;
        }
        count(&root, &outcomes, flights as f32 / EXPLORE, rng, counters);
    }

    /// Returns what arrives from the lamp along a root, per value of the vertex in that direction.
    fn arriving<const N: usize, P>(
        &self,
        root: &Root,
        medium: &Medium<N, P>,
        outcomes: &[Outcome],
        lamp: Lamp,
        target: &Target,
        from: &From<N>,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
        counters: &mut Counters,
    ) -> Option<Spectrum<N>> {
        let c = from.p.as_dvec3();
        let out = self.follow(&root.walls, c, root.omega, outcomes, true)?;
        if out.probability == 0.0 {
            return None;
        }
        let x = out.p.as_vec3();
        let (irradiance, wi, distance) = self.scene.lights.irradiance(lamp, x, w)?;

        // The derivative of where the light goes: direction at infinity, or point on the plane across the ray.
        let v = towards(target, out.p);
        let e = across(v);
        let [s, t] = across(root.omega);
        let place = |h: DVec3| -> Option<DVec3> {
            let out = self.follow(&root.walls, c, (root.omega + h * DIFFERENCE).normalize(), outcomes, false)?;
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
            let change = place(u)? - place(-u)?;
            Some(e.map(|e| change.dot(e) / (2.0 * DIFFERENCE)))
        };
        let ([a, c], [b, d]) = (slope(s)?, slope(t)?);
        let stretch = (a * d - b * c).abs();

        let last = root.walls.last()?;
        let object = &self.scene.objects[self.object as usize];
        let point = TexturePoint { p: x, n: wi, uv: Default::default() };
        let mut outside = from.clone();
        outside.p = x;
        outside.cross(self.scene, object, last.hit, &point, true, w);
        let passage = transmittance(self.scene, &outside, wi, distance, w, rng, counters);
        if passage.is_black() || stretch == 0.0 {
            return None;
        }
        let factor = self.eta * self.eta * out.probability / stretch as f32;
        Some(medium.transmittance(out.length as f32) * passage.t * irradiance * (factor * passage.survival))
    }
}

/// Returns the unit direction from x to a target.
fn towards(target: &Target, x: DVec3) -> DVec3 {
    match target {
        Target::Direction(d) => d.as_dvec3().normalize(),
        Target::Point(y) => (y.as_dvec3() - x).normalize(),
    }
}
