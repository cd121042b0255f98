//! Experiments in bodies from pbrt scenes: what of a scene the laboratory takes, and what it refuses.

use std::path::Path;

use moonmilk_core::Vec3;
use moonmilk_io::pbrt;
use moonmilk_lab::bodies::{Bodies, BodySpec, DetectorSpec, Grids, Light};
use moonmilk_lab::experiment::Unit;
use moonmilk_render::description::{LightDescription, LightKind, MaterialKind, MediumKind, Place, SceneDescription};
use moonmilk_render::doctor::{self, Body};
use moonmilk_render::scene::build_shape;

use crate::failure::Failure;
use crate::lab_args::Simulate;
use crate::render;

/// Reads a scene as an experiment: bodies of homogeneous media, one light, and all other shapes as detectors.
pub fn read(a: &Simulate) -> Result<Bodies, Failure> {
    let loaded = pbrt::load(&a.file).map_err(Failure::Scene)?;
    render::warn(&loaded.warnings);
    let d = &loaded.scene;
    let report = doctor::examine(d).map_err(|e| Failure::Input(e.to_string()))?;
    refuse_instances(&a.file, d)?;
    let mut names = Vec::new();
    let mut name = |s: &str| {
        let stem = Path::new(s).file_stem().map_or_else(|| s.to_owned(), |s| s.to_string_lossy().into_owned());
        let same = names.iter().filter(|n| **n == stem).count();
        names.push(stem.clone());
        if same == 0 { stem } else { format!("{stem}-{}", same + 1) }
    };
    let (mut bodies, mut detectors, mut shining) = (Vec::new(), Vec::new(), Vec::new());
    for s in &d.shapes {
        if s.area_light.as_ref().is_some_and(|l| l.image.is_some()) {
            return Err(refuse(&s.place, "shapes that shine with a picture are not simulated"));
        }
        if s.alpha.is_some() {
            return Err(refuse(&s.place, "shapes with `alpha` are not simulated"));
        }
        if s.media.is_some_and(|m| m.outside.is_some() && m.inside != m.outside) {
            return Err(refuse(&s.place, "media outside of bodies are not simulated"));
        }
        let mut warnings = Vec::new();
        let mut shape = build_shape(s, &mut warnings).map_err(|e| Failure::Input(e.to_string()))?;
        render::warn(&warnings);
        let called = name(&s.name);
        let material = &d.materials[s.material].kind;
        let here: Vec<&Body> = report.bodies.iter().filter(|b| b.place == s.place).collect();
        match here.iter().find(|b| b.source.material == s.material) {
            Some(_) if s.area_light.is_some() => {
                return Err(refuse(&s.place, "bodies that shine are not simulated"));
            }
            Some(b) => {
                if shape.is_closed() && shape.volume() < 0.0 {
                    tracing::warn!("{}: {called} is inside out and was turned", s.place);
                    shape = shape.reversed();
                }
                let (sigma_a, sigma_s) = coefficients(d, b, a.channel.index())?;
                bodies.push(BodySpec { name: called, shape, n: b.eta, sigma_a, sigma_s, g: f64::from(b.g) });
            }
            None if !here.is_empty()
                || matches!(material, MaterialKind::Dielectric { .. } | MaterialKind::ThinDielectric { .. }) =>
            {
                return Err(refuse(
                    &s.place,
                    "a refractive surface without a medium is not simulated: give it one, without absorption and scattering if it is clear",
                ));
            }
            None => {
                tracing::info!("{called} bounds no medium: it is a detector, which takes all light that meets it");
                if let Some(light) = &s.area_light {
                    if shape.mesh().is_none() {
                        return Err(refuse(&s.place, "of the shapes that shine, meshes alone are simulated"));
                    }
                    shining.push(Light::Surface { detector: detectors.len(), two_sided: light.two_sided });
                }
                detectors.push(DetectorSpec { name: called, shape });
            }
        }
    }
    let light = match (&shining[..], &d.lights[..]) {
        ([one], []) => *one,
        ([], [one]) => light(one)?,
        _ => {
            let n = shining.len() + d.lights.len();
            let why = "one is simulated: point, spot, distant, infinite, or a mesh that shines";
            return Err(Failure::Input(format!("{}: there are {n} lights, and {why}", a.file.display())));
        }
    };
    let mut e = Bodies::new(bodies, light);
    e.unit = unit(&a.unit)?;
    e.detectors = detectors;
    e.grids = grids(a)?;
    Ok(e)
}

fn refuse(place: &Place, why: &str) -> Failure {
    Failure::Input(format!("{place}: {why}"))
}

fn refuse_instances(file: &Path, d: &SceneDescription) -> Result<(), Failure> {
    if d.camera.medium.is_some() {
        return Err(Failure::Input(format!("{}: a medium around the camera is not simulated", file.display())));
    }
    match d.instances.first() {
        Some(i) => Err(refuse(&i.place, "instances of objects are not simulated: write the shape where it stands")),
        None => Ok(()),
    }
}

/// Returns the absorption and scattering coefficients of a body in one channel \[1/L\].
fn coefficients(d: &SceneDescription, b: &Body, channel: usize) -> Result<(f64, f64), Failure> {
    if !b.smooth {
        return Err(refuse(&b.place, "rough boundaries are not simulated"));
    }
    let medium = d.media.iter().find(|m| m.name == b.medium);
    let homogeneous = |kind: &MediumKind| matches!(kind, MediumKind::Homogeneous { emission: None, .. });
    if medium.is_some_and(|m| !homogeneous(&m.kind)) {
        return Err(refuse(&b.place, "media that vary from place to place, or shine, are not simulated"));
    }
    let [a, s] = [b.sigma_a, b.sigma_s].map(|[low, high]| (low[channel], high[channel]));
    if a.0 != a.1 || s.0 != s.1 {
        return Err(refuse(&b.place, "textured coefficients are not simulated"));
    }
    Ok((f64::from(a.0), f64::from(s.0)))
}

/// Returns a light that is not a shape.
fn light(light: &LightDescription) -> Result<Light, Failure> {
    let LightDescription { place, light_to_world: m, kind, portal, .. } = light;
    if portal.is_some() {
        return Err(refuse(place, "portals are not simulated"));
    }
    let at = |p: &Vec3| m.transform_point3(*p);
    Ok(match kind {
        LightKind::Constant { .. } => Light::Uniform,
        LightKind::Distant { from, to, .. } => Light::Parallel { direction: at(to) - at(from) },
        LightKind::Point { from, .. } => Light::point(at(from)),
        LightKind::Spot { from, to, cone_angle, cone_delta_angle, .. } => {
            let cosine = |degrees: f32| degrees.clamp(0.0, 180.0).to_radians().cos();
            let cosines = (cosine(cone_angle - cone_delta_angle), cosine(*cone_angle));
            Light::Point { at: at(from), axis: at(to) - at(from), cosines }
        }
        LightKind::Goniometric { .. } | LightKind::Projection { .. } | LightKind::Environment { .. } => {
            return Err(refuse(
                place,
                "lights with pictures are not simulated: use a point, spot, distant or constant infinite light",
            ));
        }
    })
}

fn unit(symbol: &str) -> Result<Unit, Failure> {
    let known = || Unit::ALL.map(|u| u.1).join(", ");
    let found = Unit::ALL.into_iter().find(|u| u.1 == symbol);
    found.map(|u| u.0).ok_or_else(|| Failure::Usage(format!("--unit {symbol}: one of {}", known())))
}

/// Returns the grids that were asked for, such as `fluence=32,absorption=32`.
fn grids(a: &Simulate) -> Result<Grids, Failure> {
    let mut grids = Grids::default();
    for part in a.tally.iter().flat_map(|t| t.split(',')) {
        let wrong =
            || Failure::Usage(format!("--tally {part}: fluence=N or absorption=N, N cells along the longest side"));
        let (name, n) = part.split_once('=').ok_or_else(wrong)?;
        let n = Some(n.trim().parse().map_err(|_| wrong())?);
        match name.trim() {
            "fluence" => grids.fluence = n,
            "absorption" => grids.absorption = n,
            _ => return Err(wrong()),
        }
    }
    Ok(grids)
}
