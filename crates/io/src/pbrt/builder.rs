//! The state of a scene while its directives are read: transforms, attributes, and everything said so far.
//!
//! Textures and materials are made at the end of the files, as in pbrt; so a name may be used above its definition.

mod finish;
mod objects;
mod transforms;

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use moonmilk_core::color_space::{self, ColorSpace};
use moonmilk_core::glam::DMat4;
use moonmilk_render::description::{
    AreaLightDescription, GeometryDescription, LightDescription, MediumDescription, MediumId, Place,
};

use super::camera::Entity;
use super::context::Context;
use super::lexer::Spot;
use super::lights;
use super::materials::MaterialEntity;
use super::media;
use super::params::{Param, Params, Type, did_you_mean};
use super::shapes::{self, Alpha, Meshes};
use super::textures::{TextureEntity, Textures};

/// Deepest nesting of attribute blocks.
const MAX_NESTING: usize = 10_000;

/// A name with the place where it is used; empty means none.
type Name = Option<(Arc<str>, Spot)>;

#[derive(Clone)]
enum MaterialRef {
    /// Number among the unnamed materials.
    Unnamed(usize),
    Named(Arc<str>, Spot),
}

/// What AttributeBegin saves and AttributeEnd restores.
#[derive(Clone)]
struct State {
    /// Object to world at the start and the end of the shutter's time.
    ctm: [DMat4; 2],
    active: [bool; 2],
    reverse_orientation: bool,
    color_space: ColorSpace,
    material: MaterialRef,
    inside: Name,
    outside: Name,
    area_light: Option<Arc<AreaLightDescription>>,
    attributes: Attributes,
}

/// Defaults set by the `Attribute` directive, per target.
#[derive(Clone, Default)]
struct Attributes {
    shape: Arc<Vec<Param>>,
    light: Arc<Vec<Param>>,
    material: Arc<Vec<Param>>,
    medium: Arc<Vec<Param>>,
    texture: Arc<Vec<Param>>,
}

struct Saved {
    state: State,
    object: bool,
    spot: Spot,
}

/// A shape whose names are looked up at the end of the files.
#[derive(Clone)]
struct Pending {
    place: Place,
    spot: Spot,
    name: Arc<str>,
    geometry: Arc<GeometryDescription>,
    object_to_world: DMat4,
    reverse_orientation: bool,
    material: MaterialRef,
    inside: Name,
    outside: Name,
    area_light: Option<Arc<AreaLightDescription>>,
    alpha: Option<Alpha>,
    displacement: Name,
}

/// Most triangles of a mesh that curves share.
const MAX_SHARED: usize = 1 << 20;

impl Pending {
    /// Takes over the triangles of a curve if nothing else tells the two apart.
    fn absorb(&mut self, other: &Pending) -> bool {
        let same = |a: &Name, b: &Name| a.as_ref().map(|n| &n.0) == b.as_ref().map(|n| &n.0);
        let material = match (&self.material, &other.material) {
            (MaterialRef::Unnamed(a), MaterialRef::Unnamed(b)) => a == b,
            (MaterialRef::Named(a, _), MaterialRef::Named(b, _)) => a == b,
            _ => false,
        };
        let plain = |p: &Pending| p.area_light.is_none() && p.alpha.is_none() && p.displacement.is_none();
        let alike = material
            && self.name == other.name
            && self.object_to_world == other.object_to_world
            && self.reverse_orientation == other.reverse_orientation
            && same(&self.inside, &other.inside)
            && same(&self.outside, &other.outside)
            && plain(self)
            && plain(other);
        let (Some(mine), GeometryDescription::Mesh { positions, normals, uvs, indices }) =
            (Arc::get_mut(&mut self.geometry).filter(|_| alike), &*other.geometry)
        else {
            return false;
        };
        match mine {
            GeometryDescription::Mesh { positions: p, normals: n, uvs: u, indices: i }
                if i.len() + indices.len() <= MAX_SHARED =>
            {
                let first = p.len() as u32;
                p.extend_from_slice(positions);
                n.extend_from_slice(normals);
                u.extend_from_slice(uvs);
                i.extend(indices.iter().map(|t| t.map(|v| v + first)));
                true
            }
            _ => false,
        }
    }
}

/// All that has been said.
pub(crate) struct Builder {
    state: State,
    stack: Vec<Saved>,
    /// State and depth of the stack at the start of each file that is being imported.
    imports: Vec<(State, usize)>,
    in_world: bool,
    misplaced: bool,
    coordinate_systems: HashMap<String, [DMat4; 2]>,
    camera: Option<Entity>,
    camera_transform: DMat4,
    camera_medium: Name,
    film: Option<Entity>,
    filter: Option<Entity>,
    sampler: Option<Entity>,
    integrator: Option<Entity>,
    seed: u64,
    textures: Textures,
    texture_entities: Vec<TextureEntity>,
    named_materials: Vec<MaterialEntity>,
    known_materials: HashSet<String>,
    /// Named materials used above their definition, or never defined.
    early_materials: Vec<(String, Spot)>,
    unnamed_materials: Vec<MaterialEntity>,
    media: Vec<MediumDescription>,
    medium_names: HashMap<String, MediumId>,
    meshes: Meshes,
    shapes: Vec<Pending>,
    lights: Vec<(LightDescription, Name)>,
    object: Option<(String, Vec<Pending>)>,
    objects: HashMap<String, Vec<Pending>>,
    instances: Vec<(String, Spot, DMat4)>,
    /// More instances than the options allow.
    too_many: bool,
}

impl Builder {
    pub(crate) fn new(start: Spot) -> Self {
        let state = State {
            ctm: [DMat4::IDENTITY; 2],
            active: [true; 2],
            reverse_orientation: false,
            color_space: ColorSpace::Srgb,
            material: MaterialRef::Unnamed(0),
            inside: None,
            outside: None,
            area_light: None,
            attributes: Attributes::default(),
        };
        // Until a Material is named, shapes are diffuse with pbrt's defaults.
        let params = Params::new("material \"diffuse\"".into(), start, Vec::new(), Arc::default());
        let default = MaterialEntity { name: None, kind: Some(("diffuse".into(), start)), params };
        Builder {
            state,
            stack: Vec::new(),
            imports: Vec::new(),
            in_world: false,
            misplaced: false,
            coordinate_systems: HashMap::new(),
            camera: None,
            camera_transform: DMat4::IDENTITY,
            camera_medium: None,
            film: None,
            filter: None,
            sampler: None,
            integrator: None,
            seed: 0,
            textures: Textures::default(),
            texture_entities: Vec::new(),
            named_materials: Vec::new(),
            known_materials: HashSet::new(),
            early_materials: Vec::new(),
            unnamed_materials: vec![default],
            media: Vec::new(),
            medium_names: HashMap::new(),
            meshes: Meshes::new(),
            shapes: Vec::new(),
            lights: Vec::new(),
            object: None,
            objects: HashMap::new(),
            instances: Vec::new(),
            too_many: false,
        }
    }

    // Blocks.

    /// Reports a directive that belongs below WorldBegin, once.
    fn in_world(&mut self, cx: &mut Context, spot: Spot, what: &str) {
        if !self.in_world && !std::mem::replace(&mut self.misplaced, true) {
            let (message, help) =
                (format!("{what} must come after WorldBegin"), "is this file meant to be included by another?");
            if cx.options.syntax_only {
                // A part of a scene: what it does not define, the other parts may.
                cx.include_missing = true;
                cx.warn(spot, format!("{message}; {help}"));
            } else {
                cx.error_help(spot, message, help);
            }
        }
    }

    fn before_world(&mut self, cx: &mut Context, spot: Spot, what: &str) {
        if self.in_world {
            cx.error(spot, format!("{what} must come before WorldBegin"));
        }
    }

    pub(crate) fn world_begin(&mut self, cx: &mut Context, spot: Spot) {
        if self.in_world {
            cx.error(spot, "WorldBegin stands twice");
        }
        self.in_world = true;
        self.state.ctm = [DMat4::IDENTITY; 2];
        self.state.active = [true; 2];
        self.coordinate_systems.insert("world".into(), self.state.ctm);
    }

    fn push(&mut self, cx: &mut Context, spot: Spot, object: bool) {
        if self.stack.len() >= MAX_NESTING {
            if self.stack.len() == MAX_NESTING {
                cx.error(spot, format!("attribute blocks are nested more than {MAX_NESTING} levels deep"));
            }
            return;
        }
        self.stack.push(Saved { state: self.state.clone(), object, spot });
    }

    pub(crate) fn attribute_begin(&mut self, cx: &mut Context, spot: Spot) {
        self.in_world(cx, spot, "AttributeBegin");
        self.push(cx, spot, false);
    }

    /// Depth of the stack that the current file may not go below.
    fn floor(&self) -> usize {
        self.imports.last().map_or(0, |i| i.1)
    }

    pub(crate) fn attribute_end(&mut self, cx: &mut Context, spot: Spot) {
        if self.stack.len() <= self.floor() {
            cx.warn(spot, "AttributeEnd without AttributeBegin: ignored, as pbrt does");
            return;
        }
        if let Some(saved) = self.stack.pop_if(|s| !s.object) {
            self.state = saved.state;
        } else {
            let from = self.stack.last().map_or(String::new(), |s| cx.place(s.spot).to_string());
            cx.error(spot, format!("AttributeEnd stands where ObjectEnd is expected (ObjectBegin at {from})"));
        }
    }

    pub(crate) fn reverse_orientation(&mut self, cx: &mut Context, spot: Spot) {
        self.in_world(cx, spot, "ReverseOrientation");
        self.state.reverse_orientation = !self.state.reverse_orientation;
    }

    pub(crate) fn color_space(&mut self, cx: &mut Context, at: Spot, name: &str) {
        match ColorSpace::named(name) {
            Some(space) => self.state.color_space = space,
            None => {
                let names = color_space::NAMES.map(|n| n.0);
                cx.error_help(at, format!("`{name}` is no color space"), did_you_mean(name, &names, "accepted"));
            }
        }
    }

    pub(crate) fn may_import(&mut self, cx: &mut Context, spot: Spot) -> bool {
        self.in_world(cx, spot, "Import");
        self.in_world || cx.options.syntax_only
    }

    pub(crate) fn begin_import(&mut self) {
        self.imports.push((self.state.clone(), self.stack.len()));
    }

    /// What an imported file does to the state ends with it.
    pub(crate) fn end_import(&mut self, cx: &mut Context, spot: Spot) {
        if let Some((state, depth)) = self.imports.pop() {
            if self.stack.len() > depth {
                cx.warn(spot, "the imported file ends without its AttributeEnd");
                self.stack.truncate(depth);
            }
            self.state = state;
        }
    }

    pub(crate) fn option(&mut self, cx: &mut Context, at: Spot, name: &str, value: Spot) {
        const NAMES: [&str; 13] = [
            "disablepixeljitter",
            "disabletexturefiltering",
            "disablewavelengthjitter",
            "displacementedgescale",
            "forcediffuse",
            "fullscreen",
            "gpu",
            "msereferenceimage",
            "msereferenceout",
            "pixelstats",
            "rendercoordsys",
            "seed",
            "wavefront",
        ];
        // pbrt ignores case, - and _ in the names of options. Some exporters put a type before the name.
        let plain: String = name
            .rsplit(' ')
            .next()
            .unwrap_or(name)
            .chars()
            .filter(|c| !matches!(c, '-' | '_'))
            .collect::<String>()
            .to_lowercase();
        if !NAMES.contains(&plain.as_str()) {
            cx.error_unless_lenient(at, format!("`{name}` is no option"), did_you_mean(name, &NAMES, "accepted"));
            return;
        }
        // The others change how pbrt works, not what it converges to.
        let changes = match plain.as_str() {
            "forcediffuse" => "materials stay as they are",
            "disablepixeljitter" => "samples are spread over the pixel by its filter",
            "disablewavelengthjitter" => "wavelengths are random",
            _ => "",
        };
        if !changes.is_empty() && cx.text(value) == "true" {
            cx.warn(at, format!("option `{name}` is not supported: {changes}"));
        }
        if plain == "seed" {
            match cx.text(value).parse::<i64>() {
                Ok(seed) => self.seed = seed as u64,
                Err(_) => cx.error(value, "the seed is an integer"),
            }
        }
    }

    // Things.

    pub(crate) fn named_material(&mut self, cx: &mut Context, at: Spot, name: String) {
        self.in_world(cx, at, "NamedMaterial");
        let known = self.known_materials.contains(&name);
        if !known && self.early_materials.len() < 1000 && !self.early_materials.iter().any(|(n, _)| *n == name) {
            self.early_materials.push((name.clone(), at));
        }
        self.state.material = MaterialRef::Named(name.into(), at);
    }

    pub(crate) fn medium_interface(&mut self, inside: (String, Spot), outside: (String, Spot)) {
        let name = |(name, spot): (String, Spot)| (!name.is_empty()).then(|| (name.into(), spot));
        (self.state.inside, self.state.outside) = (name(inside), name(outside));
    }

    pub(crate) fn texture(
        &mut self,
        cx: &mut Context,
        name: (String, Spot),
        kind: (String, Spot),
        class: (String, Spot),
        own: Vec<Param>,
    ) {
        self.in_world(cx, name.1, "Texture");
        let spectrum = match kind.0.as_str() {
            "float" => false,
            "spectrum" => true,
            other => {
                let help =
                    if other == "color" { "pbrt-v3 syntax: write `spectrum`" } else { "accepted: float, spectrum" };
                cx.error_help(kind.1, format!("`{other}` is no kind of texture"), help);
                return;
            }
        };
        let mut to_world = self.placement(cx, name.1);
        if !to_world.inverse().is_finite() {
            cx.error(name.1, "the transform in force at Texture has no inverse");
            to_world = DMat4::IDENTITY;
        }
        let entity = format!("texture \"{}\"", class.0);
        let params = Params::within(self.state.color_space, entity, name.1, own, self.state.attributes.texture.clone());
        self.texture_entities.push(TextureEntity { name: name.0, spectrum, class, params, to_world });
    }

    /// A directive of the form `Directive "kind" parameters`; `spot` is the directive's, `at` the kind's place.
    pub(crate) fn entity(
        &mut self,
        cx: &mut Context,
        directive: &str,
        spot: Spot,
        kind: String,
        at: Spot,
        own: Vec<Param>,
    ) {
        let attributes = self.state.attributes.clone();
        let space = self.state.color_space;
        let plain = |what: &str, own: Vec<Param>| {
            Params::within(space, format!("{what} \"{kind}\""), spot, own, Arc::default())
        };
        match directive {
            "Camera" | "Film" | "PixelFilter" | "Sampler" | "Integrator" => {
                self.before_world(cx, spot, directive);
                let what = if directive == "PixelFilter" { "filter".to_owned() } else { directive.to_lowercase() };
                let params = plain(&what, own);
                let entity = Some(Entity { kind, at, params });
                match directive {
                    "Camera" => {
                        self.camera = entity;
                        self.camera_transform = self.placement(cx, spot);
                        self.camera_medium = self.state.outside.clone();
                        self.coordinate_systems.insert("camera".into(), self.state.ctm.map(|m| m.inverse()));
                    }
                    "Film" => self.film = entity,
                    "PixelFilter" => self.filter = entity,
                    "Sampler" => self.sampler = entity,
                    _ => self.integrator = entity,
                }
            }
            // How rays find shapes makes no difference to the picture.
            "Accelerator" => {
                let mut params = plain("accelerator", own);
                match kind.as_str() {
                    "bvh" => params.ignore(&[("maxnodeprims", &[Type::Integer]), ("splitmethod", &[Type::String])]),
                    "kdtree" => params.ignore(&[
                        ("intersectcost", &[Type::Integer]),
                        ("traversalcost", &[Type::Integer]),
                        ("emptybonus", &[Type::Float]),
                        ("maxprims", &[Type::Integer]),
                        ("maxdepth", &[Type::Integer]),
                    ]),
                    _ => {
                        let help = did_you_mean(&kind, &["bvh", "kdtree"], "accepted");
                        cx.error_help(at, format!("`{kind}` is no type of accelerator"), help);
                        return;
                    }
                }
                params.finish(cx);
            }
            "Attribute" => self.attribute(cx, &kind, at, own),
            "MakeNamedMedium" => {
                if self.medium_names.contains_key(&kind) {
                    cx.error(at, format!("medium `{kind}` is defined twice"));
                    return;
                }
                let params = Params::within(space, format!("medium \"{kind}\""), spot, own, attributes.medium);
                self.medium_names.insert(kind.clone(), self.media.len());
                let to_world = self.placement(cx, spot).as_mat4();
                self.media.push(media::medium(cx, kind, params, to_world));
            }
            "MakeNamedMaterial" => {
                self.in_world(cx, spot, directive);
                let params = Params::within(space, format!("material \"{kind}\""), spot, own, attributes.material);
                self.known_materials.insert(kind.clone());
                self.named_materials.push(MaterialEntity { name: Some(kind), kind: None, params });
            }
            "Material" => {
                self.in_world(cx, spot, directive);
                let params = Params::within(space, format!("material \"{kind}\""), spot, own, attributes.material);
                self.state.material = MaterialRef::Unnamed(self.unnamed_materials.len());
                self.unnamed_materials.push(MaterialEntity { name: None, kind: Some((kind, at)), params });
            }
            "LightSource" => {
                self.in_world(cx, spot, directive);
                let placement = self.placement(cx, spot);
                let params = Params::within(space, format!("light \"{kind}\""), spot, own, attributes.light);
                if let Some(light) = lights::light(cx, &mut self.textures.images, &kind, at, params, placement, None) {
                    self.lights.push((light, self.state.outside.clone()));
                }
            }
            "AreaLightSource" => {
                self.in_world(cx, spot, directive);
                let params = Params::within(space, format!("area light \"{kind}\""), spot, own, attributes.light);
                self.state.area_light =
                    lights::area_light(cx, &mut self.textures.images, &kind, at, params).map(Arc::new);
            }
            _ => self.shape(cx, spot, &kind, at, own),
        }
    }

    fn shape(&mut self, cx: &mut Context, spot: Spot, kind: &str, at: Spot, own: Vec<Param>) {
        self.in_world(cx, spot, "Shape");
        let params = Params::new(format!("shape \"{kind}\""), spot, own, self.state.attributes.shape.clone());
        let Some(form) = shapes::shape(cx, &mut self.meshes, kind, at, params) else {
            return;
        };
        let mut area_light = self.state.area_light.clone();
        if self.object.is_some() && area_light.take().is_some() {
            cx.warn_once(spot, "area lights within objects do not shine, as in pbrt");
        }
        let pending = Pending {
            place: cx.place(spot),
            spot,
            name: form.name,
            geometry: form.geometry,
            object_to_world: self.placement(cx, spot),
            reverse_orientation: self.state.reverse_orientation,
            material: self.state.material.clone(),
            inside: self.state.inside.clone(),
            outside: self.state.outside.clone(),
            area_light,
            alpha: form.alpha,
            displacement: form.displacement,
        };
        if self.shapes.len() >= cx.options.max_shapes {
            if self.shapes.len() == cx.options.max_shapes {
                cx.error(spot, format!("the scene has more than {} shapes", cx.options.max_shapes));
                self.shapes.push(pending);
            }
            return;
        }
        let list = match &mut self.object {
            Some((_, shapes)) => shapes,
            None => &mut self.shapes,
        };
        // Hair comes as a shape per strand: neighbours of one kind share a mesh.
        if kind == "curve" && list.last_mut().is_some_and(|last| last.absorb(&pending)) {
            return;
        }
        list.push(pending);
    }

    fn attribute(&mut self, cx: &mut Context, target: &str, at: Spot, own: Vec<Param>) {
        const TARGETS: [&str; 5] = ["shape", "light", "material", "medium", "texture"];
        /// Our extensions: target, name, type.
        const EXTENSIONS: [(&str, &str, Type); 2] =
            [("material", "moonmilk.set", Type::String), ("material", "moonmilk.priority", Type::Integer)];
        let attributes = &mut self.state.attributes;
        let list = match target {
            "shape" => &mut attributes.shape,
            "light" => &mut attributes.light,
            "material" => &mut attributes.material,
            "medium" => &mut attributes.medium,
            "texture" => &mut attributes.texture,
            _ => {
                cx.error_help(
                    at,
                    format!("`{target}` is no target of Attribute"),
                    did_you_mean(target, &TARGETS, "accepted"),
                );
                return;
            }
        };
        for param in &own {
            let known = EXTENSIONS.iter().any(|(t, name, ty)| *t == target && *name == param.name && *ty == param.ty);
            if param.name.starts_with("moonmilk.") && !known {
                let names: Vec<&str> = EXTENSIONS.iter().filter(|e| e.0 == target).map(|e| e.1).collect();
                let types: Vec<String> = EXTENSIONS
                    .iter()
                    .filter(|e| e.0 == target)
                    .map(|e| format!("\"{} {}\"", e.2.name(), e.1))
                    .collect();
                let near = super::suggest::nearest(&param.name, names)
                    .map(|n| format!("did you mean `{n}`? "))
                    .unwrap_or_default();
                let list = if types.is_empty() {
                    format!("a {target} has none")
                } else {
                    format!("accepted: {}", types.join(", "))
                };
                cx.error_help(
                    param.spot,
                    format!("`{} {}` is no extension", param.ty.name(), param.name),
                    near + &list,
                );
            }
        }
        let list = Arc::make_mut(list);
        for mut param in own {
            param.color_space = self.state.color_space;
            // A newer value replaces the older one, so that the list stays short.
            list.retain(|p| p.name != param.name || p.ty != param.ty);
            list.push(param);
        }
    }
}
