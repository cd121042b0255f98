//! The state of a scene while its directives are read: transforms, attributes, and everything said so far.
//!
//! Textures and materials are made at the end of the files, as in pbrt; so a name may be used above its definition.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use moonmilk_core::glam::{DMat4, DVec3};
use moonmilk_render::description::{
    AreaLightDescription, GeometryDescription, LightDescription, MaterialId, MaterialKind, MediumDescription, MediumId,
    MediumInterface, Place, SceneDescription, ShapeDescription,
};

use super::camera::{self, Entity};
use super::context::Context;
use super::lexer::Spot;
use super::lights;
use super::materials::{self, MaterialEntity};
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
}

impl Builder {
    pub(crate) fn new(start: Spot) -> Self {
        let state = State {
            ctm: [DMat4::IDENTITY; 2],
            active: [true; 2],
            reverse_orientation: false,
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
        }
    }

    // Transforms.

    fn transform(&mut self, change: impl Fn(DMat4) -> DMat4) {
        for (matrix, active) in self.state.ctm.iter_mut().zip(self.state.active) {
            if active {
                *matrix = change(*matrix);
            }
        }
    }

    pub(crate) fn identity(&mut self) {
        self.transform(|_| DMat4::IDENTITY);
    }

    pub(crate) fn translate(&mut self, by: [f64; 3]) {
        self.transform(|m| m * DMat4::from_translation(by.into()));
    }

    pub(crate) fn scale(&mut self, by: [f64; 3]) {
        self.transform(|m| m * DMat4::from_scale(by.into()));
    }

    pub(crate) fn rotate(&mut self, cx: &mut Context, spot: Spot, [degrees, x, y, z]: [f64; 4]) {
        match DVec3::new(x, y, z).try_normalize() {
            Some(axis) => self.transform(|m| m * DMat4::from_axis_angle(axis, degrees.to_radians())),
            None => cx.error(spot, "the axis of Rotate has no direction"),
        }
    }

    pub(crate) fn look_at(&mut self, cx: &mut Context, spot: Spot, v: [f64; 9]) {
        let [eye, at, up] = [0, 3, 6].map(|i| DVec3::new(v[i], v[i + 1], v[i + 2]));
        let forward = (at - eye).try_normalize();
        let right = forward.and_then(|f| up.try_normalize()?.cross(f).try_normalize());
        let (Some(forward), Some(right)) = (forward, right) else {
            cx.error(spot, "LookAt: the eye is the point looked at, or the up vector is parallel to the view");
            return;
        };
        // Columns of camera to world: right, up, forward, eye.
        let camera_to_world =
            DMat4::from_cols(right.extend(0.0), forward.cross(right).extend(0.0), forward.extend(0.0), eye.extend(1.0));
        self.transform(|m| m * camera_to_world.inverse());
    }

    /// pbrt writes matrices column by column, the translation last.
    pub(crate) fn set_transform(&mut self, values: [f64; 16]) {
        self.transform(|_| DMat4::from_cols_array(&values));
    }

    pub(crate) fn concat_transform(&mut self, values: [f64; 16]) {
        self.transform(|m| m * DMat4::from_cols_array(&values));
    }

    pub(crate) fn transform_times(&mut self, cx: &mut Context, spot: Spot, _: [f64; 2]) {
        self.before_world(cx, spot, "TransformTimes");
    }

    pub(crate) fn active_transform(&mut self, start: bool, end: bool) {
        self.state.active = [start, end];
    }

    pub(crate) fn coordinate_system(&mut self, name: String) {
        self.coordinate_systems.insert(name, self.state.ctm);
    }

    pub(crate) fn coord_sys_transform(&mut self, cx: &mut Context, at: Spot, name: &str) {
        match self.coordinate_systems.get(name) {
            Some(ctm) => self.state.ctm = *ctm,
            None => cx.warn(at, format!("no coordinate system `{name}` is defined: the transform stays as it is")),
        }
    }

    /// The transform in force; a moving one counts as it is at the start.
    fn placement(&self, cx: &mut Context, spot: Spot) -> DMat4 {
        if self.state.ctm[0] != self.state.ctm[1] {
            cx.warn_once(spot, "moving objects are not supported yet: they stay where they start");
        }
        if !self.state.ctm[0].as_mat4().is_finite() {
            cx.error(spot, "the transform in force has values that are not finite");
            return DMat4::IDENTITY;
        }
        self.state.ctm[0]
    }

    // Blocks.

    /// Reports a directive that belongs below WorldBegin, once.
    fn in_world(&mut self, cx: &mut Context, spot: Spot, what: &str) {
        if !self.in_world && !std::mem::replace(&mut self.misplaced, true) {
            let (message, help) =
                (format!("{what} must come after WorldBegin"), "is this file meant to be included by another?");
            if cx.options.syntax_only {
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
        const SPACES: [&str; 4] = ["srgb", "rec2020", "aces2065-1", "dci-p3"];
        match name {
            "srgb" => {}
            _ if SPACES.contains(&name) => {
                cx.warn(at, format!("color space `{name}` is not supported yet: its values are read as srgb"));
            }
            _ => cx.error_help(at, format!("`{name}` is no color space"), did_you_mean(name, &SPACES, "accepted")),
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
        if plain == "seed" {
            match cx.text(value).parse::<i64>() {
                Ok(seed) => self.seed = seed as u64,
                Err(_) => cx.error(value, "the seed is an integer"),
            }
        }
    }

    // Objects.

    pub(crate) fn object_begin(&mut self, cx: &mut Context, spot: Spot, at: Spot, name: String) {
        self.in_world(cx, spot, "ObjectBegin");
        self.push(cx, spot, true);
        if let Some((outer, _)) = &self.object {
            let message = format!("object `{name}` begins within object `{outer}`");
            cx.error(spot, message);
        } else if self.objects.contains_key(&name) {
            cx.error(at, format!("object `{name}` is defined twice"));
        } else {
            self.object = Some((name, Vec::new()));
        }
    }

    pub(crate) fn object_end(&mut self, cx: &mut Context, spot: Spot) {
        if self.stack.len() <= self.floor() || self.stack.last().is_none_or(|s| !s.object) {
            cx.error(spot, "ObjectEnd without ObjectBegin, or with an attribute block still open");
            return;
        }
        if let Some(saved) = self.stack.pop() {
            self.state = saved.state;
        }
        if let Some((name, shapes)) = self.object.take() {
            self.objects.insert(name, shapes);
        }
    }

    pub(crate) fn object_instance(&mut self, cx: &mut Context, at: Spot, name: String) {
        self.in_world(cx, at, "ObjectInstance");
        if self.object.is_some() {
            cx.error(at, "ObjectInstance cannot stand within ObjectBegin and ObjectEnd");
            return;
        }
        let placement = self.placement(cx, at);
        self.instances.push((name, at, placement));
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
        let params =
            Params::new(format!("texture \"{}\"", class.0), name.1, own, self.state.attributes.texture.clone());
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
        let plain = |what: &str, own: Vec<Param>| Params::new(format!("{what} \"{kind}\""), spot, own, Arc::default());
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
            "Accelerator" => {}
            "Attribute" => self.attribute(cx, &kind, at, own),
            "MakeNamedMedium" => {
                if self.medium_names.contains_key(&kind) {
                    cx.error(at, format!("medium `{kind}` is defined twice"));
                    return;
                }
                let params = Params::new(format!("medium \"{kind}\""), spot, own, attributes.medium);
                self.medium_names.insert(kind.clone(), self.media.len());
                self.media.push(media::medium(cx, kind, params));
            }
            "MakeNamedMaterial" => {
                self.in_world(cx, spot, directive);
                let params = Params::new(format!("material \"{kind}\""), spot, own, attributes.material);
                self.known_materials.insert(kind.clone());
                self.named_materials.push(MaterialEntity { name: Some(kind), kind: None, params });
            }
            "Material" => {
                self.in_world(cx, spot, directive);
                let params = Params::new(format!("material \"{kind}\""), spot, own, attributes.material);
                self.state.material = MaterialRef::Unnamed(self.unnamed_materials.len());
                self.unnamed_materials.push(MaterialEntity { name: None, kind: Some((kind, at)), params });
            }
            "LightSource" => {
                self.in_world(cx, spot, directive);
                let placement = self.placement(cx, spot);
                let params = Params::new(format!("light \"{kind}\""), spot, own, attributes.light);
                if let Some(light) = lights::light(cx, &mut self.textures.images, &kind, at, params, placement, None) {
                    self.lights.push((light, self.state.outside.clone()));
                }
            }
            "AreaLightSource" => {
                self.in_world(cx, spot, directive);
                let params = Params::new(format!("area light \"{kind}\""), spot, own, attributes.light);
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
        };
        match &mut self.object {
            Some((_, shapes)) => shapes.push(pending),
            None => self.shapes.push(pending),
        }
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
        for param in own {
            // A newer value replaces the older one, so that the list stays short.
            list.retain(|p| p.name != param.name || p.ty != param.ty);
            list.push(param);
        }
    }

    // The end.

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
        let (camera, shutter) = camera::camera(cx, self.camera.take(), self.camera_transform, camera_medium);
        let film = camera::film(cx, self.film.take(), shutter);
        let filter = camera::filter(cx, self.filter.take());
        let sampler = camera::sampler(cx, self.sampler.take(), self.seed);
        let integrator = camera::integrator(cx, self.integrator.take());

        let entities = std::mem::take(&mut self.texture_entities);
        self.textures.build(cx, entities);
        // Named materials come first, as in pbrt; the numbers of the others follow.
        let first_unnamed = self.named_materials.len();
        let mut entities = std::mem::take(&mut self.named_materials);
        entities.append(&mut self.unnamed_materials);
        let (materials, names) = materials::build(cx, &mut self.textures, entities);

        for (name, spot) in std::mem::take(&mut self.early_materials) {
            if names.contains_key(&name) {
                cx.warn(spot, format!("material `{name}` is used above its definition"));
            }
        }

        let lights = std::mem::take(&mut self.lights);
        let lights = lights
            .into_iter()
            .map(|(light, medium)| LightDescription { medium: self.medium(cx, &medium), ..light })
            .collect();

        let mut shapes = Vec::with_capacity(self.shapes.len());
        let mut reported = HashMap::new();
        for pending in std::mem::take(&mut self.shapes) {
            if cx.hopeless() {
                break;
            }
            shapes.push(self.resolve(cx, &pending, &names, first_unnamed, &materials, &mut reported));
        }
        self.expand(cx, &mut shapes, &names, first_unnamed, &materials, &mut reported);
        SceneDescription {
            camera,
            film,
            filter,
            sampler,
            integrator,
            media: self.media,
            materials,
            float_textures: self.textures.floats,
            spectrum_textures: self.textures.spectra,
            images: self.textures.images.list,
            shapes,
            lights,
        }
    }

    /// Copies the shapes of objects to where their instances stand.
    fn expand(
        &mut self,
        cx: &mut Context,
        out: &mut Vec<ShapeDescription>,
        names: &HashMap<String, MaterialId>,
        first_unnamed: usize,
        materials: &[moonmilk_render::description::MaterialDescription],
        reported: &mut HashMap<Arc<str>, ()>,
    ) {
        if let Some((name, shapes)) = self.object.take() {
            self.objects.insert(name, shapes);
        }
        let objects = std::mem::take(&mut self.objects);
        let mut resolved: HashMap<String, Vec<ShapeDescription>> = HashMap::new();
        for (name, spot, placement) in std::mem::take(&mut self.instances) {
            if cx.hopeless() {
                return;
            }
            let Some(shapes) = objects.get(&name) else {
                if !cx.include_missing {
                    let mut known: Vec<&str> = objects.keys().map(String::as_str).collect();
                    known.sort_unstable();
                    known.truncate(20);
                    cx.error_help(
                        spot,
                        format!("no object `{name}` is defined"),
                        did_you_mean(&name, &known, "defined"),
                    );
                }
                continue;
            };
            if !resolved.contains_key(&name) {
                let list =
                    shapes.iter().map(|p| self.resolve(cx, p, names, first_unnamed, materials, reported)).collect();
                resolved.insert(name.clone(), list);
            }
            if out.len() + shapes.len() > cx.options.max_shapes {
                let message = format!(
                    "the scene has more than {} shapes once its objects are copied to their instances",
                    cx.options.max_shapes
                );
                if cx.options.syntax_only {
                    cx.warn(spot, message + ": the rest is left out");
                } else {
                    cx.error(spot, message);
                }
                return;
            }
            let list = resolved.get(&name).map(Vec::as_slice).unwrap_or_default();
            out.extend(list.iter().zip(shapes).map(|(shape, pending)| ShapeDescription {
                object_to_world: (placement * pending.object_to_world).as_mat4(),
                ..shape.clone()
            }));
        }
    }

    fn resolve(
        &mut self,
        cx: &mut Context,
        pending: &Pending,
        names: &HashMap<String, MaterialId>,
        first_unnamed: usize,
        materials: &[moonmilk_render::description::MaterialDescription],
        reported: &mut HashMap<Arc<str>, ()>,
    ) -> ShapeDescription {
        let material = match &pending.material {
            MaterialRef::Unnamed(n) => first_unnamed + n,
            MaterialRef::Named(name, spot) => match names.get(&**name) {
                Some(&id) => id,
                None => {
                    // One report per name is enough.
                    if !cx.include_missing && reported.insert(name.clone(), ()).is_none() {
                        let mut known: Vec<&str> = names.keys().map(String::as_str).collect();
                        known.sort_unstable();
                        let help = did_you_mean(name, &known[..known.len().min(20)], "defined");
                        cx.error_help(*spot, format!("no material `{name}` is defined"), help);
                    }
                    first_unnamed
                }
            },
        };
        let (inside, outside) = (self.medium(cx, &pending.inside), self.medium(cx, &pending.outside));
        let mut area_light = pending.area_light.as_deref().cloned();
        if area_light.is_some() && matches!(materials[material].kind, MaterialKind::Interface) {
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
