//! Objects that stand in several places: which are copied, which are instanced, and how their parts are numbered.
//!
//! The numbers of shapes are those of [`moonmilk_geometry::Accel`]: shapes of the world first (as described, then copies), then
//! the shapes of each instance. An object is copied where that costs no more than an instance would: if it stands once, or
//! consists of at most [`FEW`] primitives.

use moonmilk_core::Mat4;
use moonmilk_core::glam::{DAffine3, DMat4};
use moonmilk_geometry::{Accel, Shape};

use super::objects::{build_object, build_shape, emitting_surfaces};
use super::{Object, SceneError, SceneOptions};
use crate::description::{InstanceDescription, ObjectDescription, SceneDescription, ShapeDescription, Warning};
use crate::lights;
use crate::material::Materials;

/// Largest object that is copied: its triangles weigh about as much as one instance.
const FEW: u32 = 4;

/// What the description makes.
pub(super) struct Built {
    /// Shapes in world space.
    pub shapes: Vec<Shape>,
    /// One per shape of the world, then one per shape of each instance.
    pub objects: Vec<Object>,
    /// Emitting surfaces, with the number of their shape.
    pub emitters: Vec<(usize, Vec<lights::Surface>)>,
    /// Shapes of each object that is instanced, in a space of its own.
    pub groups: Vec<Vec<Shape>>,
    /// Group of each instance, with the number of the instance in the description.
    pub places: Vec<(u32, usize)>,
}

/// Makes all shapes and objects of a scene.
pub(super) fn build(
    d: &SceneDescription,
    materials: &Materials,
    options: &SceneOptions,
    warnings: &mut Vec<Warning>,
) -> Result<Built, SceneError> {
    let mut made = Built { shapes: vec![], objects: vec![], emitters: vec![], groups: vec![], places: vec![] };
    let make = |s: &ShapeDescription, warnings: &mut Vec<Warning>| {
        build_object(d, s, build_shape(s, warnings)?, materials, options, warnings)
    };
    for (i, s) in d.shapes.iter().enumerate() {
        let (shape, object) = make(s, warnings)?;
        if s.area_light.is_some() {
            made.emitters.push((i, emitting_surfaces(s, &shape)?));
        }
        made.shapes.push(shape);
        made.objects.push(object);
    }

    // Make each object that stands anywhere once, in its own space.
    let mut uses = vec![0usize; d.objects.len()];
    d.instances.iter().for_each(|i| uses[i.object] += 1);
    let mut parts: Vec<Option<Vec<(Shape, Object)>>> = Vec::with_capacity(d.objects.len());
    for (object, &uses) in d.objects.iter().zip(&uses) {
        let made = match uses {
            0 | 1 => None,
            _ => Some(object.shapes.iter().map(|s| make(s, warnings)).collect::<Result<Vec<_>, _>>()?),
        };
        parts.push(made.filter(|parts| parts.iter().map(|(s, _)| s.prim_count()).sum::<u32>() > FEW));
    }

    // Copy what is not worth an instance.
    for instance in &d.instances {
        if parts[instance.object].is_none() {
            let object = &d.objects[instance.object];
            for s in &object.shapes {
                let s = moved(s, object, instance)?;
                let (shape, object) = make(&s, warnings)?;
                made.shapes.push(shape);
                made.objects.push(object);
            }
        }
    }

    // Number the parts of the others behind all that stands in the world.
    let mut group_of = vec![u32::MAX; parts.len()];
    let mut templates = Vec::new();
    for (of, parts) in group_of.iter_mut().zip(parts) {
        if let Some(parts) = parts {
            *of = made.groups.len() as u32;
            let (shapes, objects): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
            made.groups.push(shapes);
            templates.push(objects);
        }
    }
    for (i, instance) in d.instances.iter().enumerate() {
        let group = group_of[instance.object];
        if group != u32::MAX {
            let stretch = f64::from(instance.object_to_world.determinant()).abs();
            let part = |o: &Object| Object { volume: o.volume * stretch, ..o.clone() };
            made.objects.extend(templates[group as usize].iter().map(part));
            made.places.push((group, i));
        }
    }
    Ok(made)
}

/// Returns a shape of an object where an instance of it stands.
fn moved(
    s: &ShapeDescription,
    object: &ObjectDescription,
    instance: &InstanceDescription,
) -> Result<ShapeDescription, SceneError> {
    let object_to_world = instance.object_to_world * s.object_to_world;
    if !object_to_world.is_finite() {
        return Err(singular(object, instance));
    }
    Ok(ShapeDescription { object_to_world, ..s.clone() })
}

fn singular(object: &ObjectDescription, instance: &InstanceDescription) -> SceneError {
    SceneError::Instance { place: instance.place.clone(), name: object.name.clone() }
}

/// Builds the acceleration structure.
pub(super) fn accelerate(
    d: &SceneDescription,
    shapes: Vec<Shape>,
    groups: Vec<Vec<Shape>>,
    places: &[(u32, usize)],
) -> Result<Accel, SceneError> {
    if places.is_empty() {
        return Ok(Accel::build(shapes));
    }
    let affine = |m: &Mat4| DAffine3::from_mat4(DMat4::from_cols_array(&m.to_cols_array().map(f64::from)));
    let list: Vec<_> = places.iter().map(|&(group, i)| (group, affine(&d.instances[i].object_to_world))).collect();
    Accel::with_instances(shapes, groups, &list).map_err(|i| {
        let instance = &d.instances[places[i].1];
        singular(&d.objects[instance.object], instance)
    })
}
