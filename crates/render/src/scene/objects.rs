//! From the description of a shape to its geometry and to what transport needs to know of it.

use std::sync::OnceLock;

use moonmilk_core::Vec3;
use moonmilk_geometry::{Accel, Body, Bounds, Mesh, Quadric, Shape, WORLD};

use super::{Boundary, Object, OpenPolicy, SceneError, SceneOptions, Side, models};
use crate::description::{GeometryDescription, MaterialKind, MediumId, SceneDescription, ShapeDescription, Warning};
use crate::lights;
use crate::material::Materials;

/// A surface whose primitives have no numbers yet.
const UNNUMBERED: Body = Body { instance: WORLD, first: 0, end: 0, slack: 0.0 };

/// Makes the geometry of a shape in world space.
///
/// *Errors*: a mesh that is none, a transform that is singular or not finite, with the shape's place.
pub fn build_shape(s: &ShapeDescription, warnings: &mut Vec<Warning>) -> Result<Shape, SceneError> {
    let fail = |reason: String| SceneError::Shape { place: s.place.clone(), name: s.name.clone(), reason };
    let m = &s.object_to_world;
    let flat = || fail("its transform is singular or not finite, or its size is not positive".into());
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
        other => Shape::from(other.quadric().and_then(|kind| Quadric::new(kind, m)).ok_or_else(flat)?),
    };
    // A mirror image keeps its outward side outward, as in pbrt; what the file reverses is reversed.
    if s.reverse_orientation {
        shape = shape.reversed();
    }
    Ok(shape)
}

/// Decides what a shape bounds.
pub(super) fn build_object(
    d: &SceneDescription,
    s: &ShapeDescription,
    mut shape: Shape,
    materials: &Materials,
    options: &SceneOptions,
    warnings: &mut Vec<Warning>,
) -> Result<(Shape, Object), SceneError> {
    let kind = &d.materials[s.material].kind;
    let priority = d.materials[s.material].priority;
    let absolute =
        priority.is_some() && matches!(kind, MaterialKind::Dielectric { .. } | MaterialKind::Subsurface { .. });
    let boundary = match kind {
        MaterialKind::Interface => Boundary::Interface,
        MaterialKind::Dielectric { .. } | MaterialKind::Subsurface { .. } => match materials.smooth_eta(s.material) {
            // Against vacuum; within another body it may be one that refracts.
            Some(1.0) if !absolute => Boundary::Interface,
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
    }
    let mut closed = shape.is_closed();
    let bounds_medium = translucent || matches!((inside, outside), (Side::Medium(_), _));
    let yields =
        matches!(kind, MaterialKind::Interface | MaterialKind::Dielectric { .. } | MaterialKind::Subsurface { .. });
    let by_profile = match (options.model, options.open) {
        (Some(model), _) => Some(model),
        (None, OpenPolicy::Profile) => Some(models::for_open()),
        (None, _) => None,
    }
    .filter(|_| yields && matches!(models::asymmetry(d, s.material, inside), Ok(Some(_))));
    if bounds_medium
        && !closed
        && options.open == OpenPolicy::Cap
        && let Some(mesh) = shape.mesh()
    {
        let edges = mesh.topology().boundary;
        let capped = mesh.capped();
        let message = format!("{}: holes with {edges} boundary edges are closed with flat caps", s.name);
        warnings.push(Warning { place: Some(s.place.clone()), message });
        shape = Shape { form: moonmilk_geometry::Form::Mesh(capped), reverse: shape.reverse };
        closed = shape.is_closed();
    }
    let open = bounds_medium && !closed;
    if open {
        let topology = shape.mesh().map(|m| m.topology());
        let edges = topology.as_ref().map_or_else(String::new, |t| format!(" ({} boundary edges)", t.boundary));
        let message = match (by_profile, &topology) {
            (Some(model), _) => format!(
                "{} is open{edges}: the profile {} renders it, each side as the surface of a body of its own",
                s.name, model.info.name
            ),
            (None, Some(t)) if translucent && options.open == OpenPolicy::Refuse => {
                let p = t.boundary_edges.first().map_or(Vec3::ZERO, |e| e[0]);
                return Err(SceneError::Open {
                    place: s.place.clone(),
                    name: s.name.clone(),
                    edges: t.boundary,
                    x: p.x,
                    y: p.y,
                    z: p.z,
                });
            }
            _ => format!("{} is open{edges} and bounds a medium: paths that find no wall are counted as lost", s.name),
        };
        warnings.push(Warning { place: Some(s.place.clone()), message });
    }
    if translucent && closed && shape.volume() < 0.0 {
        // pbrt decides inside and outside by the normal; a translucent object turned inside out is a mistake of the file.
        let message = format!("{}: its normals point inwards; the object is turned right side out", s.name);
        warnings.push(Warning { place: Some(s.place.clone()), message });
        shape = shape.reversed();
    }
    // Around an open object nothing tells which medium it stands in.
    if translucent && !closed && outside == Side::Same {
        outside = Side::Vacuum;
    }
    let volume = if closed { shape.volume() } else { 0.0 };
    let object = Object {
        name: s.name.as_str().into(),
        place: s.place.clone(),
        material: s.material,
        boundary,
        inside,
        outside,
        // Marked here, filled in once primitives have numbers. A closed surface whose normals point inwards encloses nothing.
        body: (volume > 0.0).then_some(UNNUMBERED),
        open: (open && by_profile.is_some()).then_some(UNNUMBERED),
        reach: shape.bounds(),
        alpha: s.alpha,
        connects: true,
        passable: matches!(boundary, Boundary::Interface | Boundary::Smooth { eta: 1.0 })
            || s.alpha.is_some()
            || materials.is_fibre(s.material),
        fibre: materials.is_fibre(s.material),
        priority: priority.filter(|_| yields),
        absolute,
        rank: 0,
        yields,
        index: materials.index(s.material),
        hollow: yields
            || matches!(
                kind,
                MaterialKind::DiffuseTransmission { .. }
                    | MaterialKind::ThinDielectric { .. }
                    | MaterialKind::Hair { .. }
                    | MaterialKind::Mix { .. }
            ),
        volume,
        touch: 0.0,
        clear: false,
        bank: None,
        set: u32::MAX,
        common: Bounds::EMPTY,
        room: OnceLock::new(),
    };
    Ok((shape, object))
}

/// Completes what depends on the whole scene.
pub(super) fn finish_objects(objects: &mut [Object], accel: &Accel, d: &SceneDescription, points: &[Vec3]) {
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
        if o.open.is_some() {
            o.open = Some(accel.body(i as u32..i as u32 + 1));
            o.reach = bounds;
        }
        // Behind a refractive boundary a straight connection reaches only lights that are inside too.
        o.connects = matches!(o.boundary, Boundary::Interface | Boundary::Smooth { eta: 1.0 })
            || o.body.is_none()
            || points.iter().any(|&p| bounds.contains(p))
            || emitters.iter().any(|e| e.overlaps(&bounds));
    }
    rank(objects);
    find_overlaps(objects, accel);
}

/// Orders the bodies: by priority, then the smaller the higher, then the later in the file.
fn rank(objects: &mut [Object]) {
    let mut order: Vec<usize> = (0..objects.len()).filter(|&i| objects[i].body.is_some()).collect();
    order.sort_by(|&a, &b| {
        let (a, b) = (&objects[a], &objects[b]);
        a.priority.unwrap_or(0).cmp(&b.priority.unwrap_or(0)).then(b.volume.total_cmp(&a.volume))
    });
    order.into_iter().enumerate().for_each(|(rank, i)| objects[i].rank = rank as u32);
}

/// Most comparisons of boxes in the search for bodies that may overlap; beyond it all of them may.
const MOST_PAIRS: usize = 50_000_000;

/// Marks the objects that may overlap or touch bodies that paths go into: light may pass the boundaries of such bodies, and walls may coincide.
fn find_overlaps(objects: &mut [Object], accel: &Accel) {
    let is_room = |o: &Object| o.yields && o.body.is_some();
    let mut list: Vec<(Bounds, f32, usize)> = (0..objects.len())
        .filter(|&i| is_room(&objects[i]) || !objects[i].hollow)
        .map(|i| {
            let slack = accel.body(i as u32..i as u32 + 1).slack;
            (accel.shape_bounds(i as u32).grown(slack), slack, i)
        })
        .collect();
    list.sort_by(|a, b| a.0.min.x.total_cmp(&b.0.min.x));
    let mut pairs = 0;
    for (k, &(box_a, slack_a, a)) in list.iter().enumerate() {
        for &(box_b, slack_b, b) in list[k + 1..].iter().take_while(|b| b.0.min.x <= box_a.max.x) {
            pairs += 1;
            let rooms = (is_room(&objects[a]), is_room(&objects[b]));
            if rooms == (false, false) || !box_a.overlaps(&box_b) {
                continue;
            }
            // Into another body of its own index a straight line may lead to light.
            let (x, y) = (&objects[a], &objects[b]);
            let alike = x.absolute && y.absolute && x.index == y.index;
            for i in [a, b] {
                objects[i].touch = objects[i].touch.max(slack_a).max(slack_b);
                if rooms == (true, true) {
                    objects[i].passable = true;
                    objects[i].connects |= alike;
                }
            }
        }
        if pairs > MOST_PAIRS {
            let most = list.iter().fold(0.0f32, |m, x| m.max(x.1));
            for (_, _, i) in list {
                objects[i].touch = most;
                if is_room(&objects[i]) {
                    (objects[i].passable, objects[i].connects) = (true, true);
                }
            }
            return;
        }
    }
}

/// Returns the emitting surfaces of a shape in the order of its primitives.
pub(super) fn emitting_surfaces(s: &ShapeDescription, shape: &Shape) -> Result<Vec<lights::Surface>, SceneError> {
    let Some(mesh) = shape.mesh() else {
        let mut list = lights::surfaces_of(s)?;
        for l in &mut list {
            if let lights::Surface::Sphere { turned, .. } | lights::Surface::Quadric { turned, .. } = l {
                *turned = shape.reverse != s.reverse_orientation;
            }
        }
        return Ok(list);
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
