//! The inside of an object, as the walk sees it.

use std::cell::Cell;

use moonmilk_core::{Random, Vec3};
use moonmilk_geometry::{Facing, Hit, Ray, Room, Surface};
use moonmilk_walk::guide::Outward;
use moonmilk_walk::{Domain, Walker, domain::Wall};

use crate::bsdf::{Crossing, boundary::near, cross};
use crate::nest::{Meeting, Nest};
use crate::scene::{Boundary, Scene, Side};
use crate::through::{Escape, Start, Through};

/// Largest radius of jumps, over the coarseness of the grid, below which distances are measured: 11 mean free paths of coarseness for isotropic scattering, 14 at g .9. A search costs as much as thirty collisions.
const COARSE: f32 = 5.7;
/// Bounds of the grid below this many times what they may be off by are measured anew for jumps; larger ones are good to a quarter.
const FINE: f32 = 4.0;
/// Most point lights among which jumps are looked for.
const MOST_LIGHTS: usize = 16;

/// How far a walk goes on by the same way out, in distances from the middle of the body: by that angle its direction is off in a ball. A search costs as much as thirty collisions.
const TURN: f32 = 0.5;

/// What a path stands on, and on which side of it: decides which hits count next.
#[derive(Clone, Copy, Debug)]
pub enum Standing {
    /// Nothing: it is in mid-air, or at a collision.
    Space,
    /// A surface that bounds nothing.
    On(Hit),
    /// A surface that it passes as if it were not there.
    Through(Hit),
    /// The outer side of a closed object.
    Outside(Hit),
    /// The inner side of a closed object.
    Inside(Hit),
}

impl Standing {
    /// Returns the shape stood on.
    pub(crate) fn shape(&self) -> Option<u32> {
        match self {
            Standing::Space => None,
            Standing::On(h) | Standing::Through(h) | Standing::Outside(h) | Standing::Inside(h) => Some(h.shape),
        }
    }
}

/// How a walk left.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Exit {
    /// Refracted through the object's own smooth boundary; the walker flies outside already. With what connections know of it.
    Outside(Hit, Option<Escape>),
    /// It arrived at a surface where the integrator decides.
    Surface(Hit, Surface),
}

/// The medium inside an object (or around open surfaces), with all surfaces of the scene as walls.
pub(crate) struct Interior<'a> {
    scene: &'a Scene,
    /// The closed object, if it is known which.
    object: Option<u32>,
    /// The object beyond whose box a walk is lost: the closed one, or a translucent one with holes that the walk starts on.
    confines: Option<u32>,
    facing: Facing,
    room: Option<&'a Room>,
    /// How far below the true distance that bound may be, and whether distances can be measured.
    coarseness: f32,
    measures: bool,
    /// Index of the smooth boundary that is crossed inside the walk; `None` if the integrator is to decide.
    smooth: Option<f32>,
    start: Standing,
    segments: Cell<u64>,
    /// Connections through the object's boundary, and where the present flight began.
    through: Option<Through<'a>>,
    began: Cell<Start>,
    /// The collision where the present flight began, if none of its walls was met since.
    flown: Cell<Option<Vec3>>,
    /// The last way out that was looked for, from where, and how far from there it is good.
    out: Cell<Option<(Vec3, Vec3, f32)>>,
    /// The wall that the last query found.
    ahead: Cell<Option<Hit>>,
}

impl<'a> Interior<'a> {
    /// Returns the surroundings of a walk inside `nest` that starts on `standing`. `count_all` hands every surface to the integrator.
    pub fn new(scene: &'a Scene, nest: &Nest, count_all: bool, start: Standing, through: Option<Through<'a>>) -> Self {
        let object = nest.innermost();
        let o = object.map(|i| &scene.objects[i as usize]);
        let body = o.and_then(|o| o.body);
        // Cross the object's own boundary in the walk unless it is none, between equal indices.
        let smooth = object.zip(o).and_then(|(i, o)| match (o.boundary, nest.meet(o, i, true)) {
            (Boundary::Smooth { eta }, Meeting::True(outer)) if !count_all => {
                Some(eta / outer).filter(|&eta| eta != 1.0)
            }
            _ => None,
        });
        let room = object.filter(|_| body.is_some()).map(|i| scene.room(i));
        Self {
            scene,
            object,
            // In vacuum around it, a walk in a medium is inside.
            confines: object.or_else(|| {
                start.shape().filter(|&shape| {
                    let o = &scene.objects[shape as usize];
                    o.inside == Side::Own && o.outside == Side::Vacuum
                })
            }),
            facing: body.map_or(Facing::Any, Facing::Exiting),
            room,
            coarseness: room.map_or(0.0, Room::coarseness),
            measures: room.is_some() && scene.measures,
            smooth,
            start,
            segments: Cell::new(0),
            through,
            began: Cell::new(Start::Wall),
            flown: Cell::new(None),
            out: Cell::new(None),
            ahead: Cell::new(None),
        }
    }

    /// Returns the number of segments cast.
    pub fn segments(&self) -> u64 {
        self.segments.get()
    }

    /// Returns a lower bound of the distance from p to any surface.
    #[inline]
    pub fn room_at(&self, p: Vec3) -> f32 {
        self.room.map_or(0.0, |r| r.bound(p))
    }

    /// Returns about the largest distance to the surface that there is in the body; 0 outside of bodies.
    pub fn depth(&self) -> f32 {
        self.room.map_or(0.0, Room::depth)
    }

    /// Notes where the next flight begins.
    #[inline]
    pub fn set_start(&self, start: Start) {
        self.began.set(start);
    }

    /// Returns where the present flight began.
    #[inline]
    pub fn began(&self) -> Start {
        self.began.get()
    }

    /// Notes the collision where the next flight begins.
    #[inline]
    pub fn set_flown(&self, from: Vec3) {
        self.flown.set(Some(from));
    }

    /// Returns the collision where the present flight began, if no wall was met since.
    #[inline]
    pub fn flown(&self) -> Option<Vec3> {
        self.flown.get()
    }

    /// Returns the point and the normals (geometric, of refraction) of the body's own smooth boundary, which the last query found ahead.
    pub fn ahead(&self, ray: &Ray) -> Option<(Hit, Vec3, Vec3, Vec3)> {
        let hit = self.ahead.get().filter(|h| self.smooth.is_some() && Some(h.shape) == self.object && h.exiting)?;
        let (p, ng, ns) = self.boundary(ray, &hit);
        Some((hit, p, ng, ns))
    }

    /// Returns the point and the normals of the body's boundary at a hit.
    #[inline]
    fn boundary(&self, ray: &Ray, hit: &Hit) -> (Vec3, Vec3, Vec3) {
        let object = &self.scene.objects[hit.shape as usize];
        if self.scene.materials.perturbs_normals(object.material) {
            let surface = self.scene.accel.surface(ray, hit);
            (surface.p, surface.ng, self.scene.boundary_normal(object, &surface))
        } else {
            let (p, ng, ns) = self.scene.accel.point_and_normals(ray, hit);
            (p, ng, near(ng, ns))
        }
    }

    /// Returns whether light sampling inside can reach anything.
    pub fn connects(&self) -> bool {
        self.object.is_none_or(|i| self.scene.objects[i as usize].connects)
    }
}

impl<const N: usize> Domain<N> for Interior<'_> {
    type Wall = Option<Hit>;
    type Exit = Exit;

    #[inline]
    fn start(&self) -> Option<Hit> {
        None
    }

    #[inline]
    fn first(&self) -> Option<Hit> {
        match self.start {
            Standing::Space => None,
            Standing::On(h) | Standing::Through(h) | Standing::Outside(h) | Standing::Inside(h) => Some(h),
        }
    }

    #[inline]
    fn room(&self, p: Vec3) -> f32 {
        self.room.map_or(0.0, |r| r.bound(p))
    }

    #[inline]
    fn clear(&self, p: Vec3, room: f32, least: f32, most: f32) -> f32 {
        let mut clear = room;
        // Where the cells of the grid are many mean free paths wide, measure near the surface.
        if self.measures && COARSE * self.coarseness > most && room < FINE * self.coarseness {
            clear = clear.max(self.scene.accel.clearance(p, least, most.min(room + self.coarseness)));
        }
        if self.connects() {
            // Many lights inside cost more than jumps gain.
            let lights = &self.scene.light_points;
            clear = if lights.len() > MOST_LIGHTS {
                0.0
            } else {
                lights.iter().fold(clear, |clear, l| clear.min(l.distance(p)))
            };
        }
        clear
    }

    fn outward(&self, p: Vec3, room: f32) -> Option<Outward> {
        let object = &self.scene.objects[self.object? as usize];
        let r = (self.depth() - room).max(0.0);
        let known = self.out.get().filter(|(from, _, reach)| from.distance_squared(p) < reach * reach);
        let n = match known {
            Some((_, n, _)) => n,
            None => {
                let n = (self.scene.accel.closest_point_on(object.body?, p)?.p - p).try_normalize()?;
                self.out.set(Some((p, n, TURN * r.max(0.5 * self.depth()))));
                n
            }
        };
        Some(Outward { n, r })
    }

    #[inline]
    fn entry(&self, p: Vec3, d: Vec3) -> Option<Outward> {
        let (Standing::Inside(hit) | Standing::Outside(hit)) = self.start else { return None };
        if self.room.is_none() || Some(hit.shape) != self.object {
            return None;
        }
        // The walker stands on the hit.
        let n = self.scene.accel.point_and_normal(&Ray::new(p, d), &Hit { t: 0.0, ..hit }).1;
        let r = self.depth();
        self.out.set(Some((p, n, TURN * r)));
        Some(Outward { n, r })
    }

    #[inline]
    fn segment(&self, p: Vec3, d: Vec3, t_max: f32, from: &Option<Hit>) -> Option<(f32, Option<Hit>)> {
        self.segments.set(self.segments.get() + 1);
        let mut ray = Ray::new(p, d).up_to(t_max).facing(self.facing);
        if let Some(hit) = from {
            ray = ray.from_prim(hit.prim);
        }
        let hit = self.scene.accel.nearest(&ray);
        self.ahead.set(hit);
        hit.map(|h| (h.t, Some(h)))
    }

    #[inline]
    fn arrive<R: Random>(
        &self,
        wall: Option<Hit>,
        t: f32,
        walker: &mut Walker<N>,
        rng: &mut R,
    ) -> Wall<Option<Hit>, Exit> {
        let hit = wall.expect("a segment that met a wall has a hit");
        let ray = Ray::new(walker.p, walker.d);
        let Some(eta) = self.smooth.filter(|_| Some(hit.shape) == self.object && hit.exiting) else {
            let surface = self.scene.accel.surface(&ray, &hit);
            walker.p = surface.p;
            return Wall::Leave(Exit::Surface(hit, surface));
        };
        let (p, ng, ns) = self.boundary(&ray, &hit);
        walker.p = p;
        // Cross the object's own boundary: most arrivals are reflected inside, many times over.
        let wo = -walker.d;
        let pdf = walker.direction_pdf.take();
        let began = self.began.replace(Start::Wall);
        self.flown.set(None);
        match cross(wo, ng, ns, eta, rng) {
            Crossing::Reflected(d) => walker.d = d,
            Crossing::Transmitted(d) => {
                let escape = self.through.as_ref().and_then(|th| th.escape(began, ray.o, t, ray.d, pdf, ng, ns));
                walker.d = d;
                walker.beta *= eta * eta;
                walker.eta_scale /= eta * eta;
                return Wall::Leave(Exit::Outside(hit, escape));
            }
        }
        Wall::Stay(Some(hit))
    }

    #[inline]
    fn is_outside(&self, p: Vec3) -> bool {
        self.confines.is_some_and(|i| !self.scene.objects[i as usize].reach.contains(p))
    }
}
