//! A scene ready to be traced.

use std::sync::OnceLock;

use moonmilk_core::{Spectra, Spectrum, Vec3, Wavelengths};
use moonmilk_geometry::{Accel, Body, Bounds, Clearance, Facing, Hit, Mesh, Quadric, QuadricKind, Ray, Shape, Surface};
use moonmilk_walk::Medium;
use thiserror::Error;

use crate::camera::Camera;
use crate::description::{
    FloatTextureId, GeometryDescription, MaterialKind, MediumId, MediumKind, Place, SceneDescription, ShapeDescription,
    SpectrumDescription, Warning,
};
use crate::filter::Filter;
use crate::lights::{self, LightError, Lights};
use crate::material::{MaterialError, Materials};
use crate::texture::{TexturePoint, Textures};

/// Cells of a body's grid of free room, one byte each.
const CLEARANCE_CELLS: usize = 1 << 21;

/// What to do with open meshes around a medium.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpenPolicy {
    /// Refuse the scene, naming mesh and edges.
    Refuse,
    /// Close holes with flat caps.
    Cap,
    /// Let paths be lost through the holes, and count them.
    Kill,
}

/// Settings of the making of a scene.
#[derive(Clone, Copy, Debug)]
pub struct SceneOptions {
    /// Open meshes around a medium.
    pub open: OpenPolicy,
}

/// Why a scene cannot be rendered.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A shape is not usable.
    #[error("{place}: {name}: {reason}")]
    Shape {
        /// Where it was said.
        place: Place,
        /// Its name.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A translucent object has holes.
    #[error(
        "{place}: {name} is open: {edges} boundary edges, the first near ({x:.4}, {y:.4}, {z:.4}); light inside would have nowhere to go"
    )]
    Open {
        /// Where it was said.
        place: Place,
        /// Its name.
        name: String,
        /// Number of edges with one triangle.
        edges: usize,
        /// A boundary vertex, x.
        x: f32,
        /// A boundary vertex, y.
        y: f32,
        /// A boundary vertex, z.
        z: f32,
    },
    /// A medium is not usable.
    #[error("{place}: medium \"{name}\": {reason}")]
    Medium {
        /// Where it was said.
        place: Place,
        /// Its name.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A light is not usable.
    #[error(transparent)]
    Light(#[from] LightError),
    /// A material is not usable.
    #[error(transparent)]
    Material(#[from] MaterialError),
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
#[derive(Debug)]
pub struct Object {
    /// Name for messages.
    pub name: String,
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
    /// Box beyond which a point is certainly outside.
    pub reach: Bounds,
    /// Opacity.
    pub alpha: Option<FloatTextureId>,
    /// Whether light sampling inside can reach a light.
    pub connects: bool,
    clearance: OnceLock<Clearance>,
}

/// A medium of the scene, before wavelengths are chosen.
#[derive(Clone, Debug)]
struct SceneMedium {
    sigma_a: Spectra,
    sigma_s: Spectra,
    g: f32,
    emission: Option<Spectra>,
}

/// A scene ready to be traced; immutable.
#[derive(Debug)]
pub struct Scene {
    /// All surfaces.
    pub accel: Accel,
    /// One per shape of `accel`.
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
    /// Whether some surface lets shadow rays through (index-matched boundaries, cut-outs).
    pub has_passages: bool,
    /// The file's limit of bounces.
    pub max_depth: u32,
    media: Vec<SceneMedium>,
}

impl Scene {
    /// Builds a scene; also returns what the user should know.
    ///
    /// *Errors*: whatever makes the scene unusable, with its place in the file.
    pub fn new(d: &SceneDescription, options: &SceneOptions) -> Result<(Self, Vec<Warning>), SceneError> {
        let mut warnings = Vec::new();
        let textures = Textures::new(d)?;
        let materials = Materials::new(d, &textures)?;
        let media = d.media.iter().map(|m| scene_medium(&m.kind, &m.place, &m.name)).collect::<Result<Vec<_>, _>>()?;
        let mut shapes = Vec::with_capacity(d.shapes.len());
        let mut objects = Vec::with_capacity(d.shapes.len());
        let mut emitters = Vec::new();
        for (i, s) in d.shapes.iter().enumerate() {
            let shape = build_shape(s, &mut warnings)?;
            let (shape, object) = build_object(d, s, shape, &materials, options, &mut warnings)?;
            if s.area_light.is_some() {
                emitters.push((i, emitting_surfaces(s, &shape)?));
            }
            shapes.push(shape);
            objects.push(object);
        }
        let lights = Lights::new(d, emitters)?;
        if lights.is_empty()
            && !d.media.iter().any(|m| matches!(&m.kind, MediumKind::Homogeneous { emission: Some(_), .. }))
        {
            warnings.push(Warning { place: None, message: "the scene has no light: the picture will be black".into() });
        }
        let accel = Accel::build(shapes);
        let points: Vec<Vec3> = d.lights.iter().filter_map(lights::position).collect();
        finish_objects(&mut objects, &accel, d, &points);
        let has_passages = objects.iter().any(|o| o.boundary == Boundary::Interface || o.alpha.is_some());
        let scene = Self {
            accel,
            objects,
            textures,
            materials,
            lights,
            camera: Camera::new(&d.camera, &d.film),
            filter: Filter::new(&d.filter),
            camera_medium: d.camera.medium,
            has_passages,
            max_depth: d.integrator.max_depth,
            media,
        };
        Ok((scene, warnings))
    }

    /// Returns a medium at the wavelengths of a path; `None` if it is empty.
    pub(crate) fn medium<const N: usize>(&self, id: MediumId, w: &Wavelengths<N>) -> Option<Medium<N>> {
        let m = &self.media[id];
        let medium = Medium::new(m.sigma_a.sample(w), m.sigma_s.sample(w), m.g)
            .with_emission(m.emission.as_ref().map(|e| e.sample(w)));
        (!medium.sigma_t.is_black()).then_some(medium)
    }

    fn side<const N: usize>(&self, side: Side, w: &Wavelengths<N>, current: Option<Medium<N>>) -> Option<Medium<N>> {
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
        current: Option<Medium<N>>,
    ) -> Option<Medium<N>> {
        match object.inside {
            Side::Own => self.materials.medium_at(object.material, &self.textures, point, w),
            side => self.side(side, w, current),
        }
    }

    /// Returns the medium outside an object.
    pub(crate) fn medium_outside<const N: usize>(
        &self,
        object: &Object,
        w: &Wavelengths<N>,
        current: Option<Medium<N>>,
    ) -> Option<Medium<N>> {
        self.side(object.outside, w, current)
    }

    /// Returns the bounds of free room inside a closed object, built at first use.
    pub(crate) fn clearance(&self, object: u32) -> &Clearance {
        self.objects[object as usize].clearance.get_or_init(|| {
            // All surfaces that may lie inside count, not the object's own alone.
            let bounds = self.accel.shape_bounds(object);
            let inside = |s: &u32| overlap(&self.accel.shape_bounds(*s), &bounds);
            let shapes: Vec<&Shape> =
                (0..self.objects.len() as u32).filter(inside).map(|s| &self.accel.shapes()[s as usize]).collect();
            Clearance::build(&shapes, bounds, CLEARANCE_CELLS)
        })
    }

    /// Returns the bytes held by geometry and, where built, clearance.
    pub fn memory(&self) -> usize {
        self.accel.memory()
            + self.objects.iter().filter_map(|o| o.clearance.get()).map(Clearance::memory).sum::<usize>()
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

/// Validates a medium.
fn scene_medium(kind: &MediumKind, place: &Place, name: &str) -> Result<SceneMedium, SceneError> {
    let MediumKind::Homogeneous { sigma_a, sigma_s, scale, g, emission } = kind;
    let fail = |reason: String| SceneError::Medium { place: place.clone(), name: name.into(), reason };
    if !(*g > -1.0 && *g < 1.0) {
        return Err(fail(format!("g = {g} is outside (-1, 1)")));
    }
    if !(*scale >= 0.0 && scale.is_finite()) {
        return Err(fail(format!("scale = {scale} is outside [0, inf)")));
    }
    let coefficient = |s: &SpectrumDescription, what: &str| {
        let spectrum = match s {
            SpectrumDescription::Constant(x) => Ok(Spectra::Constant(*x)),
            SpectrumDescription::Rgb(rgb) => Spectra::rgb_unbounded(*rgb),
            SpectrumDescription::Sampled(points) => Spectra::sampled(points.clone()),
            SpectrumDescription::Blackbody(t) => Spectra::blackbody(*t),
            SpectrumDescription::Named(n) => Spectra::named(n),
        };
        match spectrum.map_err(|e| e.to_string()) {
            Ok(Spectra::Constant(x)) if !(x >= 0.0 && x.is_finite()) => {
                Err(fail(format!("{what} = {x} is outside [0, inf)")))
            }
            Ok(s) => Ok(s.scaled(*scale)),
            Err(e) => Err(fail(format!("{what}: {e}"))),
        }
    };
    let emission = match emission {
        Some((s, factor)) => Some(lights::emission(s, *factor, place)?),
        None => None,
    };
    Ok(SceneMedium {
        sigma_a: coefficient(sigma_a, "sigma_a")?,
        sigma_s: coefficient(sigma_s, "sigma_s")?,
        g: *g,
        emission,
    })
}

/// Makes the geometry of a shape in world space.
fn build_shape(s: &ShapeDescription, warnings: &mut Vec<Warning>) -> Result<Shape, SceneError> {
    let fail = |reason: String| SceneError::Shape { place: s.place.clone(), name: s.name.clone(), reason };
    let m = &s.object_to_world;
    let flat = || fail("its transform is singular or not finite, or its size is not positive".into());
    let degrees = |x: f32| f64::from(x).to_radians();
    let mut shape = match &*s.geometry {
        GeometryDescription::Mesh { positions, normals, uvs, indices } => {
            let mesh = Mesh::new(positions.clone(), normals.clone(), uvs.clone(), indices.clone())
                .map_err(|e| fail(e.to_string()))?;
            if mesh.dropped() > 0 {
                let message = format!("{}: {} triangles without area are left out", s.name, mesh.dropped());
                warnings.push(Warning { place: Some(s.place.clone()), message });
            }
            Shape::from(mesh.transformed(m).map_err(|e| fail(e.to_string()))?)
        }
        GeometryDescription::Sphere { radius, z_min, z_max, phi_max } => {
            let kind = QuadricKind::Sphere {
                radius: f64::from(*radius),
                z_min: f64::from(*z_min),
                z_max: f64::from(*z_max),
                phi_max: degrees(*phi_max),
            };
            Shape::from(Quadric::new(kind, m).ok_or_else(flat)?)
        }
        GeometryDescription::Disk { height, radius, inner_radius, phi_max } => {
            let kind = QuadricKind::Disk {
                height: f64::from(*height),
                radius: f64::from(*radius),
                inner_radius: f64::from(*inner_radius),
                phi_max: degrees(*phi_max),
            };
            Shape::from(Quadric::new(kind, m).ok_or_else(flat)?)
        }
        GeometryDescription::Cylinder { radius, z_min, z_max, phi_max } => {
            let kind = QuadricKind::Cylinder {
                radius: f64::from(*radius),
                z_min: f64::from(*z_min),
                z_max: f64::from(*z_max),
                phi_max: degrees(*phi_max),
            };
            Shape::from(Quadric::new(kind, m).ok_or_else(flat)?)
        }
    };
    // pbrt flips normals for either reason, not for both.
    if s.reverse_orientation != (m.determinant() < 0.0) {
        shape = shape.reversed();
    }
    Ok(shape)
}

/// Decides what a shape bounds.
fn build_object(
    d: &SceneDescription,
    s: &ShapeDescription,
    mut shape: Shape,
    materials: &Materials,
    options: &SceneOptions,
    warnings: &mut Vec<Warning>,
) -> Result<(Shape, Object), SceneError> {
    let kind = &d.materials[s.material].kind;
    let boundary = match kind {
        MaterialKind::Interface => Boundary::Interface,
        MaterialKind::Dielectric { .. } | MaterialKind::Subsurface { .. } => match materials.smooth_eta(s.material) {
            Some(1.0) => Boundary::Interface,
            Some(eta) => Boundary::Smooth { eta },
            None => Boundary::Scattering,
        },
        _ => Boundary::Scattering,
    };
    let side = |m: Option<MediumId>| m.map_or(Side::Vacuum, Side::Medium);
    let (mut inside, outside) = s.media.map_or((Side::Same, Side::Same), |i| (side(i.inside), side(i.outside)));
    let translucent = matches!(kind, MaterialKind::Subsurface { .. });
    let mut outside = outside;
    if translucent {
        inside = Side::Own;
        if outside == Side::Same {
            outside = Side::Vacuum;
        }
    }
    let mut closed = shape.is_closed();
    let bounds_medium = translucent || matches!((inside, outside), (Side::Medium(_), _));
    if bounds_medium
        && !closed
        && let Some(mesh) = shape.mesh()
    {
        let topology = mesh.topology();
        match options.open {
            OpenPolicy::Cap => {
                let capped = mesh.capped();
                let message =
                    format!("{}: holes with {} boundary edges are closed with flat caps", s.name, topology.boundary);
                warnings.push(Warning { place: Some(s.place.clone()), message });
                shape = Shape { form: moonmilk_geometry::Form::Mesh(capped), reverse: shape.reverse };
                closed = shape.is_closed();
            }
            OpenPolicy::Refuse if translucent => {
                let p = topology.boundary_edges.first().map_or(Vec3::ZERO, |e| e[0]);
                return Err(SceneError::Open {
                    place: s.place.clone(),
                    name: s.name.clone(),
                    edges: topology.boundary,
                    x: p.x,
                    y: p.y,
                    z: p.z,
                });
            }
            _ => {
                let message = format!(
                    "{} is open ({} boundary edges) and bounds a medium: paths that find no wall are counted as lost",
                    s.name, topology.boundary
                );
                warnings.push(Warning { place: Some(s.place.clone()), message });
            }
        }
    }
    if translucent && closed && shape.volume() < 0.0 {
        // pbrt decides inside and outside by the normal; a translucent object turned inside out is a mistake of the file.
        let message = format!("{}: its normals point inwards; the object is turned right side out", s.name);
        warnings.push(Warning { place: Some(s.place.clone()), message });
        shape = shape.reversed();
    }
    let object = Object {
        name: s.name.clone(),
        place: s.place.clone(),
        material: s.material,
        boundary,
        inside,
        outside,
        // Marked here, filled in once primitives have numbers. A closed surface whose normals point inwards encloses nothing.
        body: (closed && shape.volume() > 0.0).then_some(Body { first: 0, end: 0, slack: 0.0 }),
        reach: shape.bounds(),
        alpha: s.alpha,
        connects: true,
        clearance: OnceLock::new(),
    };
    Ok((shape, object))
}

/// Completes what depends on the whole scene.
fn finish_objects(objects: &mut [Object], accel: &Accel, d: &SceneDescription, points: &[Vec3]) {
    let emitters: Vec<Bounds> = d
        .shapes
        .iter()
        .enumerate()
        .filter(|(_, s)| s.area_light.is_some())
        .map(|(i, _)| accel.shape_bounds(i as u32))
        .collect();
    for (i, o) in objects.iter_mut().enumerate() {
        let bounds = accel.shape_bounds(i as u32);
        if o.body.is_some() {
            o.body = Some(accel.body(i as u32..i as u32 + 1));
            o.reach = bounds.grown(1e-4 * bounds.extent().max_element());
        }
        // Behind a refractive boundary a straight connection reaches only lights that are inside too.
        o.connects = o.boundary == Boundary::Interface
            || o.body.is_none()
            || points.iter().any(|&p| bounds.contains(p))
            || emitters.iter().any(|e| overlap(e, &bounds));
    }
}

/// Returns whether two boxes share a point.
fn overlap(a: &Bounds, b: &Bounds) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

/// Returns the emitting surfaces of a shape in the order of its primitives.
fn emitting_surfaces(s: &ShapeDescription, shape: &Shape) -> Result<Vec<lights::Surface>, SceneError> {
    let Some(mesh) = shape.mesh() else {
        return Ok(lights::surfaces_of(s)?);
    };
    let corners = |i: u32| {
        let p = mesh.corners(i);
        let n = (p[1] - p[0]).cross(p[2] - p[0]).normalize();
        let t = mesh.indices()[i as usize];
        let uv = match mesh.uvs() {
            [] => lights::DEFAULT_UVS,
            uvs => t.map(|v| uvs[v as usize]),
        };
        lights::Surface::Triangle { p, uv, front: if shape.reverse { -n } else { n } }
    };
    Ok((0..mesh.indices().len() as u32).map(corners).collect())
}
