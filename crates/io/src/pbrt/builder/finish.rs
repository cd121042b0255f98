//! The end of the files: names are looked up, and the description is made.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use moonmilk_render::description::{
    FloatTextureId, InstanceDescription, LightDescription, MaterialDescription, MaterialId, MaterialKind, MediumId,
    MediumInterface, ObjectDescription, SceneDescription, ShapeDescription, SpectrumDescription,
};

use super::super::camera;
use super::super::context::Context;
use super::super::lexer::Spot;
use super::super::materials;
use super::super::params::did_you_mean;
use super::super::shapes::{Alpha, RIBBON};
use super::super::textures::Textures;
use super::{Builder, MaterialRef, Name, Pending};

/// The scene's materials, for shapes that refer to them.
struct Known {
    list: Vec<MaterialDescription>,
    names: HashMap<String, MaterialId>,
    first_unnamed: usize,
    /// Unknown names that have been reported: one report per name is enough.
    reported: HashSet<Arc<str>>,
    /// Copies of materials with the displacement of a mesh.
    displaced: HashMap<(MaterialId, FloatTextureId), MaterialId>,
    brown: Option<MaterialId>,
}

impl Known {
    /// What ribbons with hair are shown as.
    fn brown(&mut self, textures: &mut Textures) -> MaterialId {
        if let Some(id) = self.brown {
            return id;
        }
        let reflectance = textures.constant_spectrum(SpectrumDescription::Rgb([0.25, 0.14, 0.08]));
        let place = self.list[self.first_unnamed].place.clone();
        let kind = MaterialKind::StandIn { reflectance };
        let (displacement, normal_map) = (None, None);
        self.list.push(MaterialDescription {
            name: None,
            place,
            kind,
            displacement,
            normal_map,
            set: None,
            priority: None,
        });
        self.brown = Some(self.list.len() - 1);
        self.list.len() - 1
    }

    /// The material with that displacement instead of its own.
    fn displaced(&mut self, cx: &mut Context, spot: Spot, material: MaterialId, by: FloatTextureId) -> MaterialId {
        if let Some(&known) = self.displaced.get(&(material, by)) {
            return known;
        }
        let mut copy = self.list[material].clone();
        if copy.displacement.is_some() || copy.normal_map.is_some() {
            cx.warn(spot, "the map of the material is not used on this mesh: that of the mesh takes its place");
        }
        if let MaterialKind::Mix { materials, .. } = &mut copy.kind {
            // A mixture has no surface of its own; its parts have.
            let parts = *materials;
            let parts = parts.map(|part| self.displaced(cx, spot, part, by));
            copy.kind = match copy.kind {
                MaterialKind::Mix { amount, .. } => MaterialKind::Mix { materials: parts, amount },
                other => other,
            };
        } else {
            (copy.displacement, copy.normal_map) = (Some(by), None);
        }
        self.list.push(copy);
        self.displaced.insert((material, by), self.list.len() - 1);
        self.list.len() - 1
    }
}

impl Builder {
    pub(crate) fn end_of_files(&mut self, cx: &mut Context, last: Spot) {
        if !self.in_world && !self.misplaced {
            if cx.options.syntax_only {
                cx.warn(last, "the file has no WorldBegin");
            } else if !cx.include_missing {
                cx.error(last, "the file ends without WorldBegin");
            }
        }
        if let Some(saved) = self.stack.first() {
            let (what, end) =
                if saved.object { ("ObjectBegin", "ObjectEnd") } else { ("AttributeBegin", "AttributeEnd") };
            cx.warn(saved.spot, format!("{what} without {end} until the end of the file (pbrt refuses such a file)"));
        }
    }

    fn medium(&self, cx: &mut Context, name: &Name) -> Option<MediumId> {
        let (name, spot) = name.as_ref()?;
        let found = self.medium_names.get(&**name).copied();
        if found.is_none() && !cx.include_missing {
            let names: Vec<&str> = self.media.iter().map(|m| m.name.as_str()).take(20).collect();
            cx.error_help(*spot, format!("no medium `{name}` is defined"), did_you_mean(name, &names, "defined"));
        }
        found
    }

    /// Makes the description.
    pub(crate) fn finish(mut self, cx: &mut Context) -> SceneDescription {
        let camera_medium = self.medium(cx, &self.camera_medium);
        let (mut camera, shutter, lens) = camera::camera(cx, self.camera.take(), self.camera_transform, camera_medium);
        let (film, diagonal) = camera::film(cx, self.film.take(), shutter);
        if let Some(lens) = lens {
            lens.focus(&mut camera, &film, diagonal);
        }
        let filter = camera::filter(cx, self.filter.take());
        let sampler = camera::sampler(cx, self.sampler.take(), self.seed);
        let integrator = camera::integrator(cx, self.integrator.take());

        let entities = std::mem::take(&mut self.texture_entities);
        self.textures.build(cx, entities);
        // Named materials come first, as in pbrt; the numbers of the others follow.
        let first_unnamed = self.named_materials.len();
        let mut entities = std::mem::take(&mut self.named_materials);
        entities.append(&mut self.unnamed_materials);
        let (list, names) = materials::build(cx, &mut self.textures, entities);
        let mut known =
            Known { list, names, first_unnamed, reported: HashSet::new(), displaced: HashMap::new(), brown: None };

        for (name, spot) in std::mem::take(&mut self.early_materials) {
            if known.names.contains_key(&name) {
                cx.warn(spot, format!("material `{name}` is used above its definition"));
            }
        }

        let lights = std::mem::take(&mut self.lights);
        let lights = lights
            .into_iter()
            .map(|(light, medium)| LightDescription { medium: self.medium(cx, &medium), ..light })
            .collect();

        let mut shapes = Vec::with_capacity(self.shapes.len());
        for pending in std::mem::take(&mut self.shapes) {
            if cx.hopeless() {
                break;
            }
            shapes.push(self.resolve(cx, &pending, &mut known));
        }
        let (objects, instances) = self.place(cx, shapes.len(), &mut known);
        SceneDescription {
            camera,
            film,
            filter,
            sampler,
            integrator,
            media: self.media,
            materials: known.list,
            float_textures: self.textures.floats,
            spectrum_textures: self.textures.spectra,
            images: self.textures.images.list,
            shapes,
            objects,
            instances,
            lights,
        }
    }

    /// Makes the objects that have instances, and the instances; `count` shapes stand in the world already.
    fn place(
        &mut self,
        cx: &mut Context,
        mut count: usize,
        known: &mut Known,
    ) -> (Vec<ObjectDescription>, Vec<InstanceDescription>) {
        if let Some((name, shapes)) = self.object.take() {
            self.objects.insert(name, shapes);
        }
        let pending = std::mem::take(&mut self.objects);
        let mut numbers: HashMap<String, usize> = HashMap::new();
        let (mut objects, mut instances) = (Vec::<ObjectDescription>::new(), Vec::new());
        for (name, spot, placement) in std::mem::take(&mut self.instances) {
            if cx.hopeless() {
                break;
            }
            let Some(shapes) = pending.get(&name) else {
                if !cx.include_missing {
                    let mut defined: Vec<&str> = pending.keys().map(String::as_str).collect();
                    defined.sort_unstable();
                    defined.truncate(20);
                    cx.error_help(
                        spot,
                        format!("no object `{name}` is defined"),
                        did_you_mean(&name, &defined, "defined"),
                    );
                }
                continue;
            };
            count += shapes.len();
            if self.too_many || count > cx.options.max_shapes {
                let message = format!(
                    "the scene has more than {} shapes, counted once for each instance of their objects",
                    cx.options.max_shapes
                );
                if cx.options.syntax_only {
                    cx.warn(spot, message + ": the rest is left out");
                } else {
                    cx.error(spot, message);
                }
                break;
            }
            if shapes.iter().any(|s| !(placement * s.object_to_world).as_mat4().is_finite()) {
                cx.error(spot, "the transform of this instance has values that are not finite");
                continue;
            }
            let object = match numbers.get(&name) {
                Some(&object) => object,
                None => {
                    let list = shapes.iter().map(|p| self.resolve(cx, p, known)).collect();
                    objects.push(ObjectDescription { name: name.clone(), shapes: list });
                    numbers.insert(name, objects.len() - 1);
                    objects.len() - 1
                }
            };
            instances.push(InstanceDescription { place: cx.place(spot), object, object_to_world: placement.as_mat4() });
        }
        (objects, instances)
    }

    fn resolve(&mut self, cx: &mut Context, pending: &Pending, known: &mut Known) -> ShapeDescription {
        let material = match &pending.material {
            MaterialRef::Unnamed(n) => known.first_unnamed + n,
            MaterialRef::Named(name, spot) => match known.names.get(&**name) {
                Some(&id) => id,
                None => {
                    if !cx.include_missing && known.reported.insert(name.clone()) {
                        let mut defined: Vec<&str> = known.names.keys().map(String::as_str).collect();
                        defined.sort_unstable();
                        let help = did_you_mean(name, &defined[..defined.len().min(20)], "defined");
                        cx.error_help(*spot, format!("no material `{name}` is defined"), help);
                    }
                    known.first_unnamed
                }
            },
        };
        let material = if &*pending.name == RIBBON && matches!(known.list[material].kind, MaterialKind::Hair { .. }) {
            cx.warn_once(pending.spot, "hair on ribbons is not supported: a diffuse brown is used");
            known.brown(&mut self.textures)
        } else {
            material
        };
        let material = match &pending.displacement {
            None => material,
            Some((name, spot)) => match self.textures.named_float(cx, name, *spot) {
                Some(by) => known.displaced(cx, *spot, material, by),
                None => material,
            },
        };
        let (inside, outside) = (self.medium(cx, &pending.inside), self.medium(cx, &pending.outside));
        let mut area_light = pending.area_light.as_deref().cloned();
        if area_light.is_some() && matches!(known.list[material].kind, MaterialKind::Interface) {
            cx.warn(pending.spot, "an interface does not shine, as in pbrt: its area light is not used");
            area_light = None;
        }
        let alpha = match &pending.alpha {
            None => None,
            Some(Alpha::Value(value)) => Some(self.textures.constant(*value)),
            Some(Alpha::Texture(name, spot)) => self.textures.named_float(cx, name, *spot),
        };
        ShapeDescription {
            place: pending.place.clone(),
            name: pending.name.to_string(),
            geometry: pending.geometry.clone(),
            object_to_world: pending.object_to_world.as_mat4(),
            reverse_orientation: pending.reverse_orientation,
            material,
            // Where both sides are the same, pbrt leaves the ray in the medium that it is in.
            media: (inside != outside).then_some(MediumInterface { inside, outside }),
            area_light,
            alpha,
        }
    }
}
