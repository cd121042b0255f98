//! The walls between a collision and a lamp: those of the body itself, then those of other bodies on the way, and its own again from outside.

use moonmilk_core::{DVec3, Vec3, Wavelengths};
use moonmilk_geometry::{Contact, Facing, Hit, Patch, Prim, Ray, Surface};

use crate::bsdf::boundary::{NEAR, branches, near};
use crate::connect::From;
use crate::integrator::Counters;
use crate::interior::Standing;
use crate::lights::Target;
use crate::media::Matter;
use crate::nest::Meeting;
use crate::scene::{Boundary, Scene};
use crate::texture::TexturePoint;
use crate::touch;

/// Most lamps of opacity 0 that a path passes between two walls.
const MOST_LAMPS: u32 = 64;

/// What a path does at a wall: the outcomes of [`branches`] in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    Mirrored = 0,
    Refracted = 1,
    Crossed = 2,
    Aside = 3,
}

const OUTCOMES: [Outcome; 4] = [Outcome::Mirrored, Outcome::Refracted, Outcome::Crossed, Outcome::Aside];

impl Outcome {
    pub fn is_transmitted(self) -> bool {
        matches!(self, Outcome::Refracted | Outcome::Crossed)
    }
}

/// A wall that a path meets.
#[derive(Clone, Copy)]
pub(super) struct Wall<'a> {
    pub hit: Hit,
    pub patch: Patch<'a>,
    /// Its distance, about.
    pub t: f64,
    /// Index of the body over that beyond; 1 where paths go straight on.
    pub eta: f32,
}

impl<'a> Wall<'a> {
    /// Returns the wall and where a path from o along d meets it.
    fn met(self, o: DVec3, d: DVec3) -> Option<(Self, Contact)> {
        let at = self.patch.meet(o, d, self.t)?;
        Some((self, at))
    }

    /// Returns the direction in which an outcome goes on; `None` if there is none.
    pub fn turn(&self, d: DVec3, at: &Contact, outcome: Outcome) -> Option<DVec3> {
        let (ns, eta) = (tempered(at.ng, at.ns), f64::from(self.eta));
        if self.eta == 1.0 {
            Some(d)
        } else if self.hit.exiting {
            turn(d, at.ng, ns, eta, outcome)
        } else {
            turn(d, -at.ng, -ns, 1.0 / eta, outcome)
        }
    }

    /// Returns the probabilities of the outcomes.
    pub fn probabilities(&self, d: DVec3, at: &Contact) -> [f32; 4] {
        if self.eta == 1.0 {
            return [0.0, 1.0, 0.0, 0.0];
        }
        branches(-d.as_vec3(), at.ng.as_vec3(), tempered(at.ng, at.ns).as_vec3(), self.eta).map(|b| b.0)
    }

    /// Returns the outcome that a variate draws.
    pub fn draw(&self, d: DVec3, at: &Contact, mut u: f32) -> Outcome {
        let all = self.probabilities(d, at);
        let last = all.iter().rposition(|&p| p > 0.0).unwrap_or(0);
        let chosen = all.iter().position(|p| {
            u -= p;
            u < 0.0
        });
        OUTCOMES[chosen.unwrap_or(last)]
    }

    /// Puts a place on the side of the wall where an outcome leads.
    pub fn pass<const N: usize>(
        &self,
        scene: &Scene,
        place: &mut From<N>,
        at: &Contact,
        d: Vec3,
        outcome: Outcome,
        w: &Wavelengths<N>,
    ) {
        let object = &scene.objects[self.hit.shape as usize];
        place.p = at.p.as_vec3();
        if self.eta == 1.0 || outcome.is_transmitted() {
            let point = TexturePoint { p: place.p, n: at.ng.as_vec3(), uv: Default::default() };
            let outward = if object.body.is_some() { self.hit.exiting } else { d.dot(point.n) > 0.0 };
            place.cross(scene, object, self.hit, &point, outward, w);
        } else {
            place.standing = if self.hit.exiting { Standing::Inside(self.hit) } else { Standing::Outside(self.hit) };
        }
    }
}

/// Returns whether two paths meet the same primitives.
pub(super) fn are_same(a: &[Wall], b: &[Wall]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.hit.prim == b.hit.prim)
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
pub(super) fn tempered(ng: DVec3, ns: DVec3) -> DVec3 {
    // Only where it turns the normal, so that elsewhere no digits are lost.
    if near(ng.as_vec3(), ns.as_vec3()) == ns.as_vec3() {
        return ns;
    }
    let tangent = ns - ng * ns.dot(ng);
    let angle = f64::from(NEAR).acos();
    tangent.try_normalize().map_or(ng, |t| ng * angle.cos() + t * angle.sin())
}

/// What a path meets next.
#[expect(clippy::large_enum_variant, reason = "walls are the rule, and a box would be an allocation a ray")]
pub(super) enum Next<'a> {
    /// A wall that it is turned at or passes, where, and whether it comes closest to the lamp before that: it may end there instead.
    Wall(Wall<'a>, Contact, bool),
    /// No more such walls: only something that ends it, or lets it pass straight on, may be between it and the lamp.
    Clear,
    /// It is not inside the body where it should be.
    Lost,
}

/// The body that a path begins in and whose wall turns it first, and its index over that beyond.
#[derive(Clone, Copy)]
pub(super) struct Own {
    pub object: u32,
    pub eta: f32,
}

/// Where a path begins, and its lamp.
#[derive(Clone, Copy)]
pub(super) struct Setting<'a, 'b, const N: usize> {
    pub scene: &'a Scene,
    /// `None` where the innermost body has no such wall.
    pub wall: Option<Own>,
    pub target: &'b Target,
    pub w: &'b Wavelengths<N>,
    /// Whether there may be more walls behind that.
    pub goes_on: bool,
}

/// A path on its way from wall to wall.
pub(super) struct Trail<'a, 'b, const N: usize> {
    setting: Setting<'a, 'b, N>,
    /// Where it is; of the last wall on, once it is outside.
    place: From<N>,
    o: DVec3,
    pub d: DVec3,
    /// The primitive that it stands on, and whether it has not left the body yet whose wall comes first.
    from: Option<Prim>,
    pub is_inside: bool,
}

impl<'a, 'b, const N: usize> Trail<'a, 'b, N> {
    /// Returns the path that leaves a collision along d.
    pub fn new(setting: Setting<'a, 'b, N>, place: From<N>, d: DVec3) -> Self {
        Self { setting, o: place.p.as_dvec3(), place, d, from: None, is_inside: setting.wall.is_some() }
    }

    /// Returns whether it has met a wall.
    pub fn has_met(&self) -> bool {
        self.from.is_some()
    }

    /// Returns the extinction around it outside of the body, where that is known.
    pub fn sigma_t(&self) -> f32 {
        match &self.place.medium {
            Some(Matter::Homogeneous(m) | Matter::Similar(m, _)) => m.sigma_t[0],
            Some(Matter::Field(_)) | None => 0.0,
        }
    }

    /// Returns what it meets next.
    pub fn next(&mut self, counters: &mut Counters) -> Next<'a> {
        if self.is_inside {
            return self.within(counters).map_or(Next::Lost, |(wall, at)| Next::Wall(wall, at, false));
        }
        let Some((wall, at)) = self.beyond(counters) else { return Next::Clear };
        let passes = match self.setting.target {
            Target::Direction(_) => false,
            Target::Point(y) => (0.0..at.t).contains(&(y.as_dvec3() - self.o).dot(self.d)),
        };
        Next::Wall(wall, at, passes)
    }

    /// Returns the wall of the body.
    fn within(&self, counters: &mut Counters) -> Option<(Wall<'a>, Contact)> {
        let Setting { scene, wall, .. } = self.setting;
        let Own { object, eta } = wall?;
        counters.segments += 1;
        let own = &scene.objects[object as usize];
        let mut ray = Ray::new(self.o.as_vec3(), self.d.as_vec3()).facing(Facing::Exiting(own.body?));
        if let Some(prim) = self.from {
            ray = ray.from_prim(prim);
        }
        let (hit, t) = if own.touch == 0.0 {
            let hit = scene.accel.nearest(&ray)?;
            (hit, hit.t)
        } else {
            let (hit, _, t) = touch::nearest(scene, &self.place.inside, ray)?;
            (hit, t)
        };
        if hit.shape != object || !hit.exiting {
            return None;
        }
        Wall { hit, patch: scene.accel.patch(&hit), t: f64::from(t), eta }.met(self.o, self.d)
    }

    /// Returns the next wall outside that turns it or lets it pass.
    fn beyond(&mut self, counters: &mut Counters) -> Option<(Wall<'a>, Contact)> {
        let scene = self.setting.scene;
        if !self.setting.goes_on {
            return None;
        }
        for _ in 0..MOST_LAMPS {
            let (p, d) = (self.place.p, self.d.as_vec3());
            counters.shadow_rays += 1;
            let (hit, surface) = self.meets(p, d)?;
            let object = &scene.objects[hit.shape as usize];
            let light = scene.lights.light_of(hit.shape, hit.index);
            if light.is_some_and(|l| scene.lights.is_hidden(l)) {
                (self.place.p, self.place.standing) = (surface.p, Standing::Through(hit));
                continue;
            }
            let contrary = object.body.is_some() && hit.exiting != self.place.inside.contains(hit.shape);
            if object.alpha.is_some() || contrary || light.is_some() {
                return None;
            }
            let is_body = object.body.is_some() && !object.fibre && scene.bank(object).is_none();
            let meeting = self.place.inside.meet(object, hit.shape, hit.exiting);
            let eta = match (object.boundary, meeting) {
                _ if object.is_open_to_light(meeting, hit.exiting) => 1.0,
                (Boundary::Smooth { eta }, Meeting::True(outer)) if is_body => eta / outer,
                _ => return None,
            };
            if eta != 1.0 && scene.materials.perturbs_normals(object.material) {
                return None;
            }
            let t = (surface.p.as_dvec3() - self.o).dot(self.d);
            return Wall { hit, patch: scene.accel.patch(&hit), t, eta }.met(self.o, self.d);
        }
        None
    }

    /// Returns what it meets outside.
    fn meets(&self, p: Vec3, d: Vec3) -> Option<(Hit, Surface)> {
        let (scene, place) = (self.setting.scene, &self.place);
        touch::departure(scene, &place.inside, &place.standing, p, d).or_else(|| {
            let ray = match place.medium {
                None => place.standing.ray(scene, p, d),
                Some(_) => place.standing.ray_inside(scene, place.inside.innermost(), p, d),
            };
            touch::nearest(scene, &place.inside, ray).map(|(hit, surface, _)| (hit, surface))
        })
    }

    /// Goes on from a wall by an outcome; returns whether there is that.
    pub fn go(&mut self, wall: &Wall, at: &Contact, outcome: Outcome) -> bool {
        let Some(d) = wall.turn(self.d, at, outcome) else { return false };
        let leaves = self.is_inside && outcome.is_transmitted();
        // What is around matters where there may be more walls.
        if self.setting.goes_on && (leaves || !self.is_inside) {
            wall.pass(self.setting.scene, &mut self.place, at, self.d.as_vec3(), outcome, self.setting.w);
        }
        self.is_inside &= !leaves;
        (self.o, self.d, self.from) = (at.p, d, Some(wall.hit.prim));
        true
    }
}
