//! Whether there is light, and whether it can get to what should be seen.

use moonmilk_core::{Random, Stream, Vec3};
use moonmilk_geometry::{Accel, Bounds, Ray};

use super::surface::point;
use super::{Body, Patient, Severity, enclosed, transmits};
use crate::description::{LightDescription, LightKind, MediumKind, SpectrumDescription};
use crate::lights::position;

/// Points of an area light from which it is looked at what stands in front.
const LOOKS: usize = 32;

/// Largest number of point lights that are looked for inside opaque bodies.
const MOST_LIGHTS: usize = 1000;

/// Direction in which crossings are counted, along no likely edge.
const PROBE: Vec3 = Vec3::new(0.267_261_24, 0.534_522_5, 0.801_783_74);

/// Examines lights and camera.
pub fn examine(p: &mut Patient, bodies: &[Body]) {
    let d = p.d;
    let emitters = d.shapes.iter().filter(|s| s.area_light.is_some()).count();
    let glows = d.media.iter().any(emits);
    if d.lights.is_empty() && emitters == 0 && !glows {
        let advice = "add e.g. `LightSource \"infinite\" \"rgb L\" [1 1 1]`, or an AreaLightSource above a shape";
        p.add(Severity::Problem, "no-light", None, "the scene has no light: the picture will be black".into(), advice);
        return;
    }
    let dark = |l: &LightDescription| l.scale == 0.0 || l.power == Some(0.0) || spectrum(l).is_some_and(is_black);
    let black = d.lights.iter().filter(|l| dark(l)).count()
        + d.shapes
            .iter()
            .filter_map(|s| s.area_light.as_ref())
            .filter(|a| a.scale == 0.0 || is_black(&a.radiance))
            .count();
    if black == d.lights.len() + emitters && !glows {
        p.add(
            Severity::Problem,
            "black-light",
            None,
            "every light of the scene is black".into(),
            "give a light a radiance or intensity and a scale above 0",
        );
        return;
    }
    if black > 0 {
        let message = format!("{black} of {} lights are black", d.lights.len() + emitters);
        p.add(Severity::Note, "black-light", None, message, "give them a radiance or intensity and a scale above 0");
    }
    points_alone(p, bodies, emitters > 0 || glows);
    facing_away(p);
    inside_something(p);
}

fn emits(m: &crate::description::MediumDescription) -> bool {
    match &m.kind {
        MediumKind::Homogeneous { emission: Some((s, scale)), .. } => *scale > 0.0 && !is_black(s),
        field => field.emits(),
    }
}

fn is_black(s: &SpectrumDescription) -> bool {
    match s {
        SpectrumDescription::Constant(x) => *x == 0.0,
        SpectrumDescription::Rgb(c) => *c == [0.0; 3],
        SpectrumDescription::Sampled(points) => points.iter().all(|p| p.1 == 0.0),
        _ => false,
    }
}

fn spectrum(l: &LightDescription) -> Option<&SpectrumDescription> {
    match &l.kind {
        LightKind::Point { intensity, .. } | LightKind::Spot { intensity, .. } => Some(intensity),
        LightKind::Distant { irradiance, .. } => Some(irradiance),
        LightKind::Constant { radiance } => Some(radiance),
        _ => None,
    }
}

/// Returns whether a light can be met by chance: it fills a solid angle.
fn has_extent(l: &LightDescription) -> bool {
    matches!(l.kind, LightKind::Constant { .. } | LightKind::Environment { .. })
}

/// Returns why light from points and parallel beams is not found behind a smooth refractive boundary, if it is not.
fn hides(p: &Patient, body: &Body) -> Option<&'static str> {
    let s = &p.d.shapes[body.shape];
    let refracts = body.eta != 1.0;
    if !body.smooth {
        None
    } else if refracts && !body.closed {
        Some("its surface is open")
    } else if refracts && p.scene.materials.perturbs_normals(s.material) {
        Some("a map turns its normals")
    } else {
        let mut rng = Stream::new(&[0x11a, body.shape as u64]);
        let (at, _) = surface_point(&p.shapes[body.shape], &mut rng)?;
        let mut others = around(p, at).into_iter().filter(|&i| i != body.shape);
        let mapped = |i: usize| {
            let material = p.d.shapes[i].material;
            let refracts = p.scene.materials.smooth_eta(material).is_some_and(|eta| eta != 1.0);
            refracts && p.scene.materials.perturbs_normals(material)
        };
        others.any(mapped).then_some("it is inside another refractive object, whose normals a map turns")
    }
}

/// Reports lights without extent where smooth boundaries hide the inside from them.
fn points_alone(p: &mut Patient, bodies: &[Body], others: bool) {
    let lost: Vec<&LightDescription> = p.d.lights.iter().filter(|l| !has_extent(l)).collect();
    let hidden: Vec<(&Body, &str)> = bodies.iter().filter_map(|b| Some((b, hides(p, b)?))).collect();
    let (Some(first), Some((body, reason))) = (lost.first(), hidden.first()) else {
        return;
    };
    let only = lost.len() == p.d.lights.len() && !others;
    let what = if only { "all lights are".to_owned() } else { format!("{} of the lights are", lost.len()) };
    let message = format!(
        "{what} points or parallel beams (the first at {}); none of their light is found inside {} ({}){}, behind a smooth refractive boundary, because {reason}",
        first.place,
        body.name,
        body.place,
        if hidden.len() > 1 { format!(" and {} other objects", hidden.len() - 1) } else { String::new() }
    );
    let advice = "replace such a light by a small sphere with an AreaLightSource (of the same power), or make the boundary slightly rough";
    let severity = if only { Severity::Problem } else { Severity::Note };
    p.add(severity, "point-lights", Some(body.shape), message, advice);
}

/// Reports one-sided area lights with nothing in front of them.
fn facing_away(p: &mut Patient) {
    let d = p.d;
    let camera = d.camera.camera_to_world.transform_point3(Vec3::ZERO);
    let corners: Vec<[Vec3; 8]> = p.shapes.iter().map(|s| corners(s.bounds())).collect();
    for (i, s) in d.shapes.iter().enumerate() {
        if s.area_light.as_ref().is_none_or(|a| a.two_sided) {
            continue;
        }
        let mut rng = Stream::new(&[0xd0c, i as u64]);
        let points: Vec<(Vec3, Vec3)> = (0..LOOKS).filter_map(|_| surface_point(&p.shapes[i], &mut rng)).collect();
        // A corner of another object's box in front of the light is enough: what stands between does not matter here.
        let reach = 1e-4 * p.shapes[i].bounds().extent().length();
        let in_front = |q: Vec3| points.iter().any(|&(o, n)| (q - o).dot(n) > reach);
        let lit = corners.iter().enumerate().any(|(j, c)| j != i && c.iter().any(|&q| in_front(q)));
        if !lit && d.shapes.len() > 1 {
            let seen = in_front(camera);
            let more = if seen { "" } else { ", nor is the camera" };
            let message = format!("{}: its light shines away from the scene: nothing is in front of it{more}", s.name);
            let severity = if seen { Severity::Note } else { Severity::Problem };
            let advice = "add or remove ReverseOrientation above it, turn it round, or say `\"bool twosided\" true`";
            p.add(severity, "light-faces-away", Some(i), message, advice);
        }
    }
}

fn corners(b: Bounds) -> [Vec3; 8] {
    std::array::from_fn(|i| {
        let pick = |bit: usize, k: usize| if i & bit != 0 { b.max[k] } else { b.min[k] };
        Vec3::new(pick(1, 0), pick(2, 1), pick(4, 2))
    })
}

/// Returns a point of a shape and its normal there.
fn surface_point(shape: &moonmilk_geometry::Shape, rng: &mut Stream) -> Option<(Vec3, Vec3)> {
    let (o, n) = match (shape.mesh(), shape.quadric()) {
        (Some(m), _) => {
            let t = (rng.uniform() * m.indices().len() as f32) as u32 % m.indices().len() as u32;
            let (o, _) = moonmilk_geometry::sample::sample_triangle(m.corners(t), rng.uniform2());
            (o, m.area_normal(t).try_normalize()?)
        }
        (_, Some(q)) => {
            let (o, n, _) = q.sample_area(rng.uniform2());
            (o, n)
        }
        _ => return None,
    };
    Some((o, if shape.reverse { -n } else { n }))
}

/// Reports a camera inside a body, or in a medium that no wall ends, and point lights inside opaque bodies.
fn inside_something(p: &mut Patient) {
    let d = p.d;
    let camera = d.camera.camera_to_world.transform_point3(Vec3::ZERO);
    let with_camera = around(p, camera);
    // The innermost body around the camera decides what it looks through.
    let inner = with_camera.iter().copied().filter(|&i| super::bounds_medium(d, &d.shapes[i]));
    let volume = |i: &usize| p.shapes[*i].volume().abs();
    if let Some(i) = inner.min_by(|a, b| volume(a).total_cmp(&volume(b))) {
        let s = &d.shapes[i];
        let filled = enclosed(s, p.shapes[i].volume() > 0.0);
        if let Some(said) = d.camera.medium.filter(|_| super::is_subsurface(d, s) || filled != d.camera.medium) {
            let message = format!("the camera is inside {}, but its medium is \"{}\"", s.name, d.media[said].name);
            let advice =
                "say the object's own medium before Camera, or none: then the medium of the bodies around it counts";
            p.problem("camera-inside", i, message, advice);
        } else if d.camera.medium.is_none() {
            let message = format!("the camera is inside {}, and looks through its medium", s.name);
            p.note("camera-inside", i, message, "fine if meant; else move the camera out");
        }
    }
    if let Some(medium) = d.camera.medium {
        let walled = with_camera.iter().any(|&i| enclosed(&d.shapes[i], p.shapes[i].volume() > 0.0) == Some(medium));
        if !walled {
            let name = &d.media[medium].name;
            let message = format!(
                "the medium \"{name}\" around the camera has no wall: it fills all space, lights at infinity cannot be seen through it, and only absorption ends its walks"
            );
            let advice = "put an object with `Material \"interface\"` and `MediumInterface \"NAME\" \"\"` around the scene and the camera";
            p.add(Severity::Problem, "unbounded-medium", None, message, advice);
            if let Some(last) = p.findings.last_mut() {
                last.place = Some(d.media[medium].place.clone());
            }
        }
    }
    let lights: Vec<(usize, Vec3)> =
        d.lights.iter().enumerate().filter_map(|(i, l)| Some((i, position(l)?))).take(MOST_LIGHTS).collect();
    for (l, at) in lights {
        let shut =
            around(p, at).into_iter().find(|&i| !transmits(d, d.shapes[i].material) && !with_camera.contains(&i));
        if let Some(i) = shut {
            let message =
                format!("the light of {} at {} is shut up in {}", d.lights[l].place, point(at), d.shapes[i].name);
            p.problem("light-inside", i, message, "move the light out of the object: nothing of it comes out");
        }
    }
}

/// Returns the closed shapes without cut-outs around a point.
fn around(p: &Patient, at: Vec3) -> Vec<usize> {
    let near =
        |i: &usize| p.d.shapes[*i].alpha.is_none() && p.shapes[*i].bounds().contains(at) && p.shapes[*i].is_closed();
    let list: Vec<usize> = (0..p.shapes.len()).filter(near).collect();
    // Crossings outward minus inward: 0 from outside, +-1 from inside.
    let accel = Accel::build(list.iter().map(|&i| p.shapes[i].clone()).collect());
    let mut balance = vec![0; list.len()];
    accel.all_hits(&Ray::new(at, PROBE), |h| balance[h.shape as usize] += if h.exiting { 1 } else { -1 });
    list.into_iter().zip(balance).filter(|(_, n)| *n != 0).map(|(i, _)| i).collect()
}
