//! A scene ready to be traced.

mod error;
mod instances;
mod models;
mod objects;
mod similar;

use std::sync::{Arc, OnceLock};

use moonmilk_core::{Spectrum, Vec3, Wavelengths};
use moonmilk_geometry::{Accel, Body, Bounds, Facing, Hit, Ray, Room, Surface};
use moonmilk_optics::profile::Model;
use moonmilk_walk::{Medium, Similar};

use crate::apart::apart;
use crate::balls::{self, Wanted};
use crate::bsdf::boundary::near;
use crate::bssrdf::Bank;
use crate::camera::Camera;
use crate::cloud::{self, Site};
use crate::description::{FloatTextureId, MediumId, Place, SceneDescription, Warning};
use crate::filter::Filter;
use crate::integrator::Policy;
use crate::lights::{self, Lights};
use crate::material::Materials;
use crate::media::{FieldAt, Matter, SceneMedium};
use crate::mirrors::Mirrors;
use crate::nest::{Meeting, Nest};
use crate::texture::{TexturePoint, Textures};
use crate::tint::Tints;
use crate::vertices::{self, Lit};
pub use error::SceneError;
use instances::Built;
pub use objects::build_shape;
use objects::finish_objects;
pub use similar::Similarity;

/// Cells of a body's grid of free room, one byte each.
const CLEARANCE_CELLS: usize = 1 << 21;

/// The model that renders open meshes where walks render the rest: the exact profile.
pub const OPEN_MODEL: &str = "tabulated";

/// What to do with open meshes around a medium.
///
/// A model ([`SceneOptions::model`]) needs no inside: it renders those that are not capped, whatever this says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OpenPolicy {
    /// Refuse the scene, naming mesh and edges.
    #[default]
    Refuse,
    /// Close holes with flat caps.
    Cap,
    /// Let paths be lost through the holes, and count them.
    Kill,
    /// Render the mesh by the profile [`OPEN_MODEL`] instead of a walk.
    Profile,
}

/// Settings of the making of a scene.
#[derive(Clone, Copy, Debug, Default)]
pub struct SceneOptions {
    /// Open meshes around a medium.
    pub open: OpenPolicy,
    /// The model that renders translucent bodies; `None` for exact walks inside.
    pub model: Option<&'static Model>,
    /// The similar media that homogeneous ones are exchanged for; `None` for none.
    pub similar: Option<Similarity>,
    /// Whether walks leave out the core of bodies, where the diffusion equation holds ([`moonmilk_walk::hybrid`]).
    pub hybrid: bool,
    /// Whether walks jump over shifted balls of the similar isotropic medium ([`moonmilk_walk::Jumps::shifted`]).
    pub shifted: bool,
}

/// What happens at a surface, as far as walks need to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Boundary {
    /// Nothing but a change of medium.
    Interface,
    /// A smooth refractive boundary; eta = inside / outside.
    Smooth {
        /// Relative index.
        eta: f32,
    },
    /// A surface with a BSDF.
    Scattering,
}

/// What is on one side of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The same as on the other side: the surface does not bound media.
    Same,
    /// Vacuum.
    Vacuum,
    /// A medium of the scene.
    Medium(MediumId),
    /// The medium of the object's own `subsurface` material.
    Own,
}

/// A shape with what the transport needs of it.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name for messages.
    pub name: Arc<str>,
    /// Where it was said.
    pub place: Place,
    /// Material.
    pub material: usize,
    /// What happens at its surface.
    pub boundary: Boundary,
    /// What is opposite to the normal.
    pub inside: Side,
    /// What is on the side of the normal.
    pub outside: Side,
    /// The closed surface, if it is one.
    pub body: Option<Body>,
    /// The open surface, if it is one that a profile renders: each of its sides is the outer one of a body of its own.
    pub open: Option<Body>,
    /// Box beyond which a point is certainly outside.
    pub reach: Bounds,
    /// Opacity.
    pub alpha: Option<FloatTextureId>,
    /// A fibre of hair: rays from inside pass its walls.
    pub fibre: bool,
    /// Whether light sampling inside can reach a light.
    pub connects: bool,
    /// Whether some rays of light may pass straight: interfaces, cut-outs, boundaries that overlap others.
    pub passable: bool,
    /// The material's priority among overlapping dielectrics, if it has one.
    pub priority: Option<i32>,
    /// Whether its index is against vacuum: a dielectric with a priority.
    pub absolute: bool,
    /// Place of a body in the order of all bodies: where several overlap, the highest is there ([`crate::nest`]).
    pub rank: u32,
    /// Whether its surface is none within a body of higher rank: dielectrics and interfaces.
    pub yields: bool,
    /// The material's index, at 550 nm if it varies; 1 for surfaces without one.
    pub index: f32,
    /// Whether light can be inside of it at all.
    pub hollow: bool,
    /// Volume of a body \[length³\].
    pub volume: f64,
    /// How far rounding may move its walls and those of objects that it may touch \[length\]; 0 if there are none.
    pub touch: f32,
    /// Whether it is a refractive body that light gets through without scattering: connections lead on through its boundary.
    pub clear: bool,
    /// Number of the profiles that render it, if it is not walked through.
    bank: Option<u32>,
    /// Number of the set of bodies that act as one with it.
    set: u32,
    /// Box around them.
    pub common: Bounds,
    room: OnceLock<Room>,
}

impl Object {
    /// Returns the number of the set of bodies that act as one with it.
    pub(crate) fn set(&self) -> u32 {
        self.set
    }

    /// Returns whether its boundary is smooth and turns light, seen from vacuum or by its relative index.
    #[inline]
    pub(crate) fn refracts(&self) -> bool {
        matches!(self.boundary, Boundary::Smooth { eta } if eta != 1.0)
    }

    /// Returns whether light that leaves this body may have entered another one.
    #[inline]
    pub(crate) fn is_one_with(&self, other: &Object) -> bool {
        self.set == other.set
    }

    /// Returns whether light goes straight through the surface where it meets it so.
    #[inline]
    pub(crate) fn is_open_to_light(&self, meeting: Meeting, exiting: bool) -> bool {
        match meeting {
            Meeting::False => true,
            // What is inside of it is in its profile.
            Meeting::True(_) if self.bank.is_some() && (!exiting || self.open.is_some()) => false,
            Meeting::True(outer) => match self.boundary {
                Boundary::Interface => true,
                Boundary::Smooth { eta } => eta / outer == 1.0,
                Boundary::Scattering => false,
            },
        }
    }
}

/// A scene ready to be traced; immutable.
#[derive(Debug)]
pub struct Scene {
    /// All surfaces.
    pub accel: Accel,
    /// One per shape of `accel`, those of instances included.
    pub objects: Vec<Object>,
    /// Textures.
    pub textures: Textures,
    /// Materials.
    pub materials: Materials,
    /// Lights.
    pub lights: Lights,
    /// Camera.
    pub camera: Camera,
    /// Pixel filter.
    pub filter: Filter,
    /// Medium around the camera.
    pub camera_medium: Option<MediumId>,
    /// Box around all bodies that light can be inside of: beyond it a point is in none.
    bodies: Bounds,
    /// The middle of the camera, the radius of a ball around it that no surface reaches into, and the bodies that this ball is in.
    eye: (Vec3, f32, Nest),
    /// The file's limit of bounces.
    pub max_depth: u32,
    media: Vec<SceneMedium>,
    banks: Vec<Bank>,
    /// Bodies of a model on which points are placed.
    sites: Vec<Site>,
    similar: Option<Similarity>,
    /// Whether walks jump through the core of bodies.
    pub(crate) hybrid: bool,
    /// Whether walks jump over shifted balls.
    pub(crate) shifted: bool,
    /// Whether distances to surfaces can be measured ([`Accel::measures`]).
    pub(crate) measures: bool,
    /// Places of lights without a surface, which no jump may pass over.
    pub(crate) light_points: Vec<Vec3>,
    scatterers: Vec<Similar>,
    /// Pixels of the whole picture, and along either side.
    pub(crate) pixels: f64,
    pub(crate) resolution: [f32; 2],
    /// Laws of scattering with banks, per policy.
    wanted_balls: [OnceLock<Vec<Wanted>>; Policy::ALL.len()],
    /// Pixels with edges of lamps' mirror images, found at first use.
    mirrors: OnceLock<Mirrors>,
    tints: OnceLock<Tints>,
    /// Whether there are clear bodies ([`Object::clear`]).
    pub(crate) has_clear: bool,
    /// Bodies that light is followed into.
    lit: OnceLock<Vec<Lit>>,
}

impl Scene {
    /// Builds a scene; also returns what the user should know.
    ///
    /// *Errors*: whatever makes the scene unusable, with its place in the file.
    pub fn new(d: &SceneDescription, options: &SceneOptions) -> Result<(Self, Vec<Warning>), SceneError> {
        let mut warnings = Vec::new();
        let textures = Textures::new(d)?;
        let materials = Materials::new(d, &textures)?;
        warnings.extend(materials.cuts().map(|(id, most)| {
            let m = &d.materials[id];
            let name = m.name.as_deref().unwrap_or("without name");
            let message = format!("material {name}: an albedo of up to {most} acts as 1 where it is more, as in pbrt");
            Warning { place: Some(m.place.clone()), message }
        }));
        let media = d.media.iter().map(SceneMedium::new).collect::<Result<Vec<_>, _>>()?;
        let Built { shapes, mut objects, emitters, groups, places } =
            instances::build(d, &materials, options, &mut warnings)?;
        let lights = Lights::new(d, emitters)?;
        if lights.is_empty() && !d.media.iter().any(|m| m.kind.emits()) {
            warnings.push(Warning { place: None, message: "the scene has no light: the picture will be black".into() });
        }
        let accel = instances::accelerate(d, shapes, groups, &places)?;
        let points: Vec<Vec3> = d.lights.iter().filter_map(lights::position).collect();
        finish_objects(&mut objects, &accel, d, &points);
        if options.similar.is_some() {
            similar::warn(d, &mut warnings);
        }
        let scatterers = match options.similar {
            Some(Similarity::Third) => similar::scatterers(d),
            _ => vec![],
        };
        let banks = match (options.model, options.open) {
            (Some(model), _) => models::choose(model, false, d, &mut objects, &mut warnings)?,
            (None, OpenPolicy::Profile) => models::choose(models::for_open(), true, d, &mut objects, &mut warnings)?,
            (None, _) => vec![],
        };
        let bodies = (0..objects.len())
            .filter(|&i| objects[i].hollow && objects[i].body.is_some())
            .fold(Bounds::EMPTY, |all, i| all.union(accel.shape_bounds(i as u32)));
        let measures = accel.measures();
        let mut scene = Self {
            accel,
            objects,
            textures,
            materials,
            lights,
            camera: Camera::new(&d.camera, &d.film),
            filter: Filter::new(&d.filter),
            camera_medium: d.camera.medium,
            bodies,
            eye: (Vec3::NAN, 0.0, Nest::default()),
            max_depth: d.integrator.max_depth,
            media,
            banks,
            sites: vec![],
            similar: options.similar,
            hybrid: options.hybrid,
            shifted: options.shifted,
            measures,
            light_points: points,
            scatterers,
            pixels: f64::from(d.film.width) * f64::from(d.film.height),
            resolution: [d.film.width as f32, d.film.height as f32],
            wanted_balls: Default::default(),
            mirrors: OnceLock::new(),
            tints: OnceLock::new(),
            has_clear: false,
            lit: OnceLock::new(),
        };
        scene.find_clear();
        scene.sites = cloud::sites(&scene);
        let eye = scene.camera.origin();
        scene.eye = (eye, scene.free_radius(eye), scene.nest_at(eye));
        Ok((scene, warnings))
    }

    /// Marks the clear bodies.
    fn find_clear(&mut self) {
        let scatters = |side| match side {
            Side::Same | Side::Vacuum => false,
            Side::Own => true,
            Side::Medium(id) => match self.medium(id, &Wavelengths::<3>::Channels { channel: [0, 1, 2] }) {
                Some(Matter::Homogeneous(m)) => !m.sigma_s.is_black(),
                Some(_) => true,
                None => false,
            },
        };
        let is_clear = |o: &Object| {
            o.refracts() && o.body.is_some() && o.alpha.is_none() && o.bank.is_none() && !o.fibre && !scatters(o.inside)
        };
        let clear: Vec<bool> = self.objects.iter().map(is_clear).collect();
        self.has_clear = clear.contains(&true);
        self.objects.iter_mut().zip(clear).for_each(|(o, clear)| o.clear = clear);
    }

    /// Returns the profiles that render an object, if it is not walked through.
    #[inline]
    pub(crate) fn bank(&self, object: &Object) -> Option<&Bank> {
        object.bank.map(|i| &self.banks[i as usize])
    }

    /// Returns the laws of scattering for which walks by a policy want banks of exits, found at first use.
    pub(crate) fn wanted_balls(&self, policy: Policy) -> &[Wanted] {
        self.wanted_balls[policy as usize].get_or_init(|| balls::wanted(self, policy))
    }

    /// Returns the bodies that light is followed into where walks go by a policy, found at first use.
    pub(crate) fn lit(&self, policy: Policy) -> &[Lit] {
        match policy {
            Policy::Auto => self.lit.get_or_init(|| vertices::bodies(self)),
            Policy::Classic | Policy::Jump | Policy::Guided => &[],
        }
    }

    /// Returns the pixels with edges of lamps' mirror images.
    pub(crate) fn mirrors(&self) -> &Mirrors {
        self.mirrors.get_or_init(|| Mirrors::new(self))
    }

    /// Returns what is known of the noise of colour in each block of pixels.
    pub(crate) fn tints(&self) -> &Tints {
        self.tints.get_or_init(|| Tints::new(self))
    }

    /// Returns the bodies of a model on which points are placed.
    pub(crate) fn sites(&self) -> &[Site] {
        &self.sites
    }

    /// Returns the site of an object and its number, if it has one.
    pub(crate) fn site(&self, object: &Object) -> Option<(usize, &Site)> {
        self.sites.iter().enumerate().find(|(_, s)| s.set == object.set)
    }

    /// Returns a medium at the wavelengths of a path; `None` if it is empty.
    pub(crate) fn medium<const N: usize>(&self, id: MediumId, w: &Wavelengths<N>) -> Option<Matter<N>> {
        match &self.media[id] {
            SceneMedium::Homogeneous(m) => m.sample(w).map(|m| self.homogeneous(m)),
            SceneMedium::Field(_) => Some(Matter::Field(id)),
        }
    }

    /// Returns a field of the scene at the wavelengths of a path.
    pub(crate) fn field<const N: usize>(&self, id: MediumId, w: &Wavelengths<N>) -> FieldAt<'_, N> {
        match &self.media[id] {
            SceneMedium::Field(f) => f.at(w),
            SceneMedium::Homogeneous(_) => unreachable!("`medium` makes fields of fields alone"),
        }
    }

    /// Returns a homogeneous medium of a medium's mean coefficients; `None` if it is empty.
    pub(crate) fn mean_medium<const N: usize>(&self, id: MediumId, w: &Wavelengths<N>) -> Option<Medium<N>> {
        self.medium(id, w).map(|m| match m {
            Matter::Homogeneous(m) | Matter::Similar(m, _) => m,
            Matter::Field(id) => self.field(id, w).mean(),
        })
    }

    fn side<const N: usize>(&self, side: Side, w: &Wavelengths<N>, current: Option<Matter<N>>) -> Option<Matter<N>> {
        match side {
            Side::Same => current,
            Side::Vacuum | Side::Own => None,
            Side::Medium(id) => self.medium(id, w),
        }
    }

    /// Returns the medium inside an object, entered at a point.
    pub(crate) fn medium_inside<const N: usize>(
        &self,
        object: &Object,
        point: &TexturePoint,
        w: &Wavelengths<N>,
        current: Option<Matter<N>>,
    ) -> Option<Matter<N>> {
        match object.inside {
            Side::Own => {
                self.materials.medium_at(object.material, &self.textures, point, w).map(|m| self.homogeneous(m))
            }
            side => self.side(side, w, current),
        }
    }

    /// Returns the medium on one side of a surface that bounds no body.
    pub(crate) fn medium_beyond<const N: usize>(
        &self,
        object: &Object,
        outward: bool,
        point: &TexturePoint,
        w: &Wavelengths<N>,
        current: Option<Matter<N>>,
    ) -> Option<Matter<N>> {
        if outward { self.medium_outside(object, w, current) } else { self.medium_inside(object, point, w, current) }
    }

    /// Returns the media at a place where light is looked for from: what the file says is around the camera, what the bodies there are made of, and what is around all bodies.
    ///
    /// What the file says is there; it is around all bodies if the camera is in none with a medium.
    pub(crate) fn around<const N: usize>(&self, inside: &Nest, w: &Wavelengths<N>) -> [Option<Matter<N>>; 3] {
        let said = self.camera_medium.and_then(|m| self.medium::<N>(m, w));
        let found = inside.medium(self, w, None);
        [said, found, if found.is_none() { said } else { None }]
    }

    /// Returns a radius within which there is no surface around a point; 0 where distances are not exact (cut or squashed quadrics).
    fn free_radius(&self, p: Vec3) -> f32 {
        let world = self.accel.world_count();
        let exact = |s: u32| self.accel.shape(s).quadric().is_none_or(|q| s < world && q.as_ball().is_some());
        if !(0..self.accel.shape_count() as u32).all(exact) {
            return 0.0;
        }
        // A part in 1e4 is far more than the rounding of the distance.
        self.accel.closest_point(p).map_or(f32::INFINITY, |c| c.distance * 0.9999)
    }

    /// Returns the bodies that a point is inside of, by the crossings of their surfaces on the way out.
    ///
    /// *Accuracy*: exact except within rounding of a surface, where either answer is right; a line through an edge or a vertex
    /// counts it more than once, so two of three lines decide.
    pub fn nest_at(&self, p: Vec3) -> Nest {
        let (eye, radius, there) = &self.eye;
        if p == *eye || p.distance(*eye) < *radius {
            return there.clone();
        }
        let mut nest = Nest::default();
        if !self.bodies.contains(p) {
            return nest;
        }
        // Directions along which no mesh is likely to be laid out.
        const LINES: [Vec3; 3] = [
            Vec3::new(0.5377, 0.3191, 0.7808),
            Vec3::new(-0.8217, 0.2706, -0.5016),
            Vec3::new(0.1414, -0.9511, 0.2747),
        ];
        let mut counts: Vec<(u32, [i32; 3])> = Vec::new();
        for (line, d) in LINES.into_iter().enumerate() {
            self.accel.all_hits(&Ray::new(p, d.normalize()), |h| {
                let o = &self.objects[h.shape as usize];
                if o.body.is_none() || !o.hollow {
                    return;
                }
                let i = counts.iter().position(|c| c.0 == h.shape).unwrap_or_else(|| {
                    counts.push((h.shape, [0; 3]));
                    counts.len() - 1
                });
                counts[i].1[line] += if h.exiting { 1 } else { -1 };
            });
        }
        // Enter the lowest first, so that indices are relative to what is around.
        counts.retain(|c| c.1.iter().filter(|&&n| n > 0).count() >= 2);
        counts.sort_by_key(|c| self.objects[c.0 as usize].rank);
        for (shape, _) in counts {
            let o = &self.objects[shape as usize];
            let point = o.body.and_then(|b| self.accel.closest_point_on(b, p)).map_or(
                TexturePoint { p, n: Vec3::Z, uv: Default::default() },
                |c| {
                    let (shape, index) = self.accel.locate(c.prim);
                    let s = self.accel.triangle_surface(shape, index, c.b);
                    TexturePoint {
                        p: c.p,
                        n: s.map_or(Vec3::Z, |s| s.ns),
                        uv: s.map_or_else(Default::default, |s| s.uv),
                    }
                },
            );
            nest.step_into(o, shape, point);
        }
        nest
    }

    /// Returns the medium outside an object.
    pub(crate) fn medium_outside<const N: usize>(
        &self,
        object: &Object,
        w: &Wavelengths<N>,
        current: Option<Matter<N>>,
    ) -> Option<Matter<N>> {
        self.side(object.outside, w, current)
    }

    /// Returns the bounds of free room inside a closed object, built at first use.
    pub(crate) fn room(&self, object: u32) -> &Room {
        self.objects[object as usize].room.get_or_init(|| apart(|| self.accel.room(object, CLEARANCE_CELLS)))
    }

    /// Returns the bytes held by geometry, media and, where built, clearance.
    pub fn memory(&self) -> usize {
        self.accel.memory()
            + self.media.iter().map(SceneMedium::memory).sum::<usize>()
            + self.objects.iter().filter_map(|o| o.room.get()).map(Room::memory).sum::<usize>()
    }

    /// Returns the normal about which a smooth boundary refracts: interpolated, then turned by a map if the material has one.
    #[inline]
    pub(crate) fn boundary_normal(&self, object: &Object, surface: &Surface) -> Vec3 {
        let ns = near(surface.ng, surface.ns);
        if !self.materials.perturbs_normals(object.material) {
            return ns;
        }
        let point = TexturePoint { p: surface.p, n: surface.ng, uv: surface.uv };
        self.materials.shading_normal(object.material, &self.textures, &Surface { ns, ..*surface }, &point)
    }

    /// Returns the surface of an object nearest to a point that rounding put outside it.
    pub(crate) fn rescue(&self, object: u32, p: Vec3, d: Vec3) -> Option<(Hit, Surface)> {
        let body = self.objects[object as usize].body?;
        let hit = self.accel.rescue(body, p, d, true)?;
        let ray = Ray::new(p, d).facing(Facing::Exiting(body));
        Some((hit, self.accel.surface(&ray, &hit)))
    }

    /// Returns an albedo for auxiliary pictures: the surface's own, or what a half-space of its medium reflects.
    ///
    /// For media A = (1 - s)(1 - 0.139 s) / (1 + 1.17 s), s = sqrt((1 - alpha) / (1 - alpha g)) [vandeHulst1980; Kulla2017]:
    /// index-matched, within 0.002 of the exact diffuse albedo; only ever shown to denoisers.
    pub(crate) fn albedo<const N: usize>(
        &self,
        object: &Object,
        surface: &Surface,
        point: &TexturePoint,
        w: &Wavelengths<N>,
    ) -> Spectrum<N> {
        let medium = match object.inside {
            Side::Own | Side::Medium(_) => self.medium_inside(object, point, w, None),
            _ => None,
        };
        let medium = medium.map(|m| match m {
            Matter::Homogeneous(m) | Matter::Similar(m, _) => m,
            Matter::Field(id) => self.field(id, w).mean(),
        });
        match medium {
            Some(m) => Spectrum(std::array::from_fn(|i| {
                let alpha = if m.sigma_t[i] > 0.0 { m.sigma_s[i] / m.sigma_t[i] } else { 0.0 };
                let s = ((1.0 - alpha) / (1.0 - alpha * m.g)).sqrt();
                (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)
            })),
            None => self.materials.resolve(object.material, &self.textures, surface, point, w, 0.5).bsdf.albedo(),
        }
    }
}
