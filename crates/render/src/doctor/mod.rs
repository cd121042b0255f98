//! What makes translucent objects black, dull or endless, found before rendering.
//!
//! [`examine`] looks at every object that bounds a medium: whether its surface encloses one volume and which way it faces
//! (`surface.rs`), how large it is in mean free paths (`medium.rs`), whether light is there and can get in (`light.rs`). What it
//! finds is data; whoever prints it knows the names of options. [`furnace`] measures two theorems on the user's own objects.
//!
//! Not for speed: large scenes take as long as their building does. Nothing here changes a scene.

mod furnace;
mod light;
mod medium;
mod overlap;
mod surface;

use std::sync::Arc;

use moonmilk_geometry::Shape;

use crate::description::{MaterialKind, MediumId, Place, SceneDescription, ShapeDescription};
use crate::scene::{OpenPolicy, Scene, SceneError, SceneOptions, build_shape};

pub use furnace::{Furnace, Unmeasured, furnace};
pub use medium::SENSIBLE;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The picture will be wrong, black or endless.
    Problem,
    /// Worth knowing.
    Note,
}

/// One thing that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// Name of the kind of finding, for programs.
    pub code: &'static str,
    /// Name of the object, if it is about one.
    pub object: Option<String>,
    /// Where the object was said.
    pub place: Option<Place>,
    /// What was found.
    pub message: String,
    /// What to do about it.
    pub advice: String,
}

/// An object that bounds a medium.
#[derive(Clone, Debug)]
pub struct Body {
    /// Its number among the shapes examined.
    shape: usize,
    /// Its description in world space; of an object that stands in several places, where the first instance stands.
    pub source: ShapeDescription,
    /// Name for messages.
    pub name: String,
    /// Where it was said.
    pub place: Place,
    /// The medium in words: `subsurface`, or the medium's name.
    pub medium: String,
    /// Number of shapes of the same place, name and form: instances.
    pub count: usize,
    /// Number of triangles; 0 for an analytic shape.
    pub triangles: usize,
    /// Whether its surface encloses a volume.
    pub closed: bool,
    /// Volume \[L^3\]; of a closed surface, whichever way it faces.
    pub volume: f64,
    /// Area \[L^2\].
    pub area: f64,
    /// Index inside / outside.
    pub eta: f64,
    /// Whether its boundary is smooth, or none at all.
    pub smooth: bool,
    /// Absorption coefficient \[1/L\] at red, green and blue: smallest and largest over the surface.
    pub sigma_a: [[f32; 3]; 2],
    /// Scattering coefficient, likewise.
    pub sigma_s: [[f32; 3]; 2],
    /// Extinction coefficient \[1/L\] at red, green and blue: smallest and largest over the surface.
    pub sigma_t: [[f32; 3]; 2],
    /// Scattering coefficient over extinction coefficient at red, green and blue, largest over the surface.
    pub alpha: [f32; 3],
    /// Asymmetry of the phase function.
    pub g: f32,
}

impl Body {
    /// Returns the mean chord 4 V / S \[L\]; `None` for an open surface.
    pub fn chord(&self) -> Option<f64> {
        (self.closed && self.area > 0.0).then(|| 4.0 * self.volume / self.area)
    }

    /// Returns the smallest and the largest optical thickness sigma_t 4 V / S over surface and channels, in mean free paths.
    pub fn size(&self) -> Option<[f64; 2]> {
        let [low, high] = self.sigma_t;
        let chord = self.chord()?;
        let least = low.into_iter().fold(f32::INFINITY, f32::min);
        Some([least, high.into_iter().fold(0.0, f32::max)].map(|s| f64::from(s) * chord))
    }

    /// Returns the mean path length 4 eta^2 V / S \[L\] of light that enters the body if nothing absorbs, under uniform light
    /// \[BlancoFournier2003\].
    pub fn path_length(&self) -> Option<f64> {
        Some(self.eta * self.eta * self.chord()?)
    }
}

/// What [`examine`] found.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Objects that bound media, in the order of the scene.
    pub bodies: Vec<Body>,
    /// Findings, problems first, each group in the order of the scene.
    pub findings: Vec<Finding>,
    /// Number of shapes, instances counted one by one.
    pub shapes: usize,
    /// Number of lights: emitting shapes and others.
    pub lights: usize,
}

impl Report {
    /// Returns the number of problems.
    pub fn problems(&self) -> usize {
        self.findings.iter().filter(|f| f.severity == Severity::Problem).count()
    }
}

/// What the parts of the examination share.
struct Patient<'a> {
    /// The scene, with the first instance of each object among its shapes.
    d: &'a SceneDescription,
    scene: Scene,
    /// Shapes in world space as the file has them, not turned or capped.
    shapes: Vec<Shape>,
    findings: Vec<Finding>,
}

impl Patient<'_> {
    fn add(&mut self, severity: Severity, code: &'static str, shape: Option<usize>, message: String, advice: &str) {
        let shape = shape.map(|s| &self.d.shapes[s]);
        self.findings.push(Finding {
            severity,
            code,
            object: shape.map(|s| s.name.clone()),
            place: shape.map(|s| s.place.clone()),
            message,
            advice: advice.into(),
        });
    }

    fn problem(&mut self, code: &'static str, shape: usize, message: String, advice: &str) {
        self.add(Severity::Problem, code, Some(shape), message, advice);
    }

    fn note(&mut self, code: &'static str, shape: usize, message: String, advice: &str) {
        self.add(Severity::Note, code, Some(shape), message, advice);
    }
}

/// Returns whether light gets through a material.
fn transmits(d: &SceneDescription, material: usize) -> bool {
    match &d.materials[material].kind {
        MaterialKind::Interface
        | MaterialKind::Dielectric { .. }
        | MaterialKind::ThinDielectric { .. }
        | MaterialKind::DiffuseTransmission { .. }
        | MaterialKind::Subsurface { .. } => true,
        // A mixture is known to be free of circles once the scene is built.
        MaterialKind::Mix { materials, .. } => materials.iter().any(|&m| transmits(d, m)),
        _ => false,
    }
}

fn is_subsurface(d: &SceneDescription, s: &ShapeDescription) -> bool {
    matches!(d.materials[s.material].kind, MaterialKind::Subsurface { .. })
}

/// Returns the medium of the scene on the side that a shape encloses: behind its normals if they point outward.
fn enclosed(s: &ShapeDescription, outward: bool) -> Option<MediumId> {
    s.media.and_then(|m| if outward { m.inside } else { m.outside })
}

/// Returns whether light enters a medium through a shape.
fn bounds_medium(d: &SceneDescription, s: &ShapeDescription) -> bool {
    let has_media = s.media.is_some_and(|m| m.inside.is_some() || m.outside.is_some());
    is_subsurface(d, s) || (has_media && transmits(d, s.material))
}

/// Returns the scene with each object where its first instance stands, and how often each of these shapes stands in all.
fn first_instances(d: &SceneDescription) -> (SceneDescription, Vec<usize>) {
    let mut flat = d.clone();
    let mut times = vec![1; d.shapes.len()];
    for (number, object) in d.objects.iter().enumerate() {
        let mut places = d.instances.iter().filter(|i| i.object == number);
        let Some(first) = places.next() else {
            continue;
        };
        let n = 1 + places.count();
        for s in &object.shapes {
            flat.shapes
                .push(ShapeDescription { object_to_world: first.object_to_world * s.object_to_world, ..s.clone() });
            times.push(n);
        }
    }
    (flat, times)
}

/// Examines a scene. Of an object that stands in several places, the first is examined; the others are counted.
///
/// *Errors*: what makes the scene unusable altogether, as [`Scene::new`] has it; open meshes are findings here.
pub fn examine(d: &SceneDescription) -> Result<Report, SceneError> {
    let (scene, _) = Scene::new(d, &SceneOptions { open: OpenPolicy::Kill, ..Default::default() })?;
    let (flat, times) = first_instances(d);
    let d = &flat;
    let shapes = d.shapes.iter().map(|s| build_shape(s, &mut Vec::new())).collect::<Result<Vec<_>, _>>()?;
    let mut p = Patient { d, scene, shapes, findings: Vec::new() };
    let mut bodies: Vec<Body> = Vec::new();
    for (shape, (s, &times)) in d.shapes.iter().zip(&times).enumerate() {
        // Examine copies of one form once.
        let known =
            bodies.iter_mut().rev().take(64).find(|b| {
                b.place == s.place && b.name == s.name && Arc::ptr_eq(&d.shapes[b.shape].geometry, &s.geometry)
            });
        if let Some(body) = known {
            body.count += times;
        } else if bounds_medium(d, s) {
            let closed = surface::examine(&mut p, shape);
            bodies.extend(medium::examine(&mut p, shape, closed).map(|b| Body { count: times, ..b }));
        } else {
            surface::examine_opaque(&mut p, shape);
            medium::examine_opaque(&mut p, shape);
        }
    }
    overlap::examine(&mut p, &bodies);
    medium::examine_unused(&mut p);
    light::examine(&mut p, &bodies);
    let mut findings = p.findings;
    findings.sort_by_key(|f| f.severity);
    let emitters = d.shapes.iter().filter(|s| s.area_light.is_some()).count();
    Ok(Report { bodies, findings, shapes: times.iter().sum(), lights: emitters + d.lights.len() })
}
