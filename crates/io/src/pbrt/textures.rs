//! `Texture` directives and texture-or-value parameters.
//!
//! As in pbrt, textures are made when the whole scene has been read: image textures first, then the others in the order of
//! the file, so a texture may be used above its definition by anything but another computed texture.

use std::collections::HashMap;

use moonmilk_core::glam::DMat4;
use moonmilk_core::{Vec2, Vec3};
use moonmilk_render::description::{
    FloatTexture, FloatTextureId, SpectrumDescription, SpectrumTexture, SpectrumTextureId, TextureMapping, Wrap,
};

use super::context::Context;
use super::images::Images;
use super::lexer::Spot;
use super::params::{FLOAT_TEXTURE, Param, Params, SPECTRUM_TEXTURE, Type, Values, did_you_mean};
use super::spectra::{self, Role};

/// A `Texture` directive, waiting for the end of the file.
pub(crate) struct TextureEntity {
    pub name: String,
    pub spectrum: bool,
    pub class: (String, Spot),
    pub params: Params,
    pub to_world: DMat4,
}

/// All textures, by number and by name.
#[derive(Default)]
pub(crate) struct Textures {
    pub floats: Vec<FloatTexture>,
    pub spectra: Vec<SpectrumTexture>,
    pub images: Images,
    float_names: HashMap<String, FloatTextureId>,
    spectrum_names: HashMap<String, SpectrumTextureId>,
    float_constants: HashMap<u32, FloatTextureId>,
    spectrum_constants: HashMap<String, SpectrumTextureId>,
}

/// Classes of textures that pbrt knows, with whether they exist as float and as spectrum textures.
const CLASSES: [(&str, bool, bool); 13] = [
    ("constant", true, true),
    ("scale", true, true),
    ("mix", true, true),
    ("directionmix", true, true),
    ("checkerboard", true, true),
    ("imagemap", true, true),
    ("bilerp", true, true),
    ("dots", true, true),
    ("fbm", true, false),
    ("marble", false, true),
    ("ptex", true, true),
    ("windy", true, false),
    ("wrinkled", true, false),
];

/// Most octaves of noise: the 64th has 10^18 times the frequency of the first, far beyond single precision.
const MAX_OCTAVES: u32 = 64;

impl Textures {
    /// The constant texture of `value`, shared by all who use it.
    pub(crate) fn constant(&mut self, value: f32) -> FloatTextureId {
        *self.float_constants.entry(value.to_bits()).or_insert_with(|| {
            self.floats.push(FloatTexture::Constant(value));
            self.floats.len() - 1
        })
    }

    /// The constant texture of a spectrum, shared by all who use it.
    pub(crate) fn constant_spectrum(&mut self, value: SpectrumDescription) -> SpectrumTextureId {
        *self.spectrum_constants.entry(format!("{value:?}")).or_insert_with(|| {
            self.spectra.push(SpectrumTexture::Constant(value));
            self.spectra.len() - 1
        })
    }

    fn texture_name(cx: &mut Context, param: &Param) -> Option<String> {
        match &param.values {
            Values::Strings(names) if names.len() == 1 => Some(names[0].clone()),
            _ => {
                cx.error(param.spot, format!("`{}` takes the name of one texture", param.name));
                None
            }
        }
    }

    pub(crate) fn float_or_none(
        &mut self,
        cx: &mut Context,
        params: &mut Params,
        name: &'static str,
    ) -> Option<FloatTextureId> {
        let param = params.find(name, FLOAT_TEXTURE)?.clone();
        if param.ty == Type::Float {
            return params.float_or_none(cx, name).map(|value| self.constant(value));
        }
        let texture = Self::texture_name(cx, &param)?;
        self.named_float(cx, &texture, param.value)
    }

    /// The float texture of that name; `None` after an error.
    pub(crate) fn named_float(&mut self, cx: &mut Context, name: &str, spot: Spot) -> Option<FloatTextureId> {
        let found = self.float_names.get(name).copied();
        if found.is_none() {
            self.unknown(cx, name, spot, false);
        }
        found
    }

    pub(crate) fn float(
        &mut self,
        cx: &mut Context,
        params: &mut Params,
        name: &'static str,
        default: f32,
    ) -> FloatTextureId {
        self.float_or_none(cx, params, name).unwrap_or_else(|| self.constant(default))
    }

    pub(crate) fn spectrum_or_none(
        &mut self,
        cx: &mut Context,
        params: &mut Params,
        name: &'static str,
        role: Role,
    ) -> Option<SpectrumTextureId> {
        let param = params.find(name, SPECTRUM_TEXTURE)?.clone();
        if param.ty != Type::Texture {
            return spectra::describe(cx, &param, role).map(|value| self.constant_spectrum(value));
        }
        let texture = Self::texture_name(cx, &param)?;
        if let Some(&id) = self.spectrum_names.get(&texture) {
            return Some(id);
        }
        self.unknown(cx, &texture, param.value, true);
        None
    }

    pub(crate) fn spectrum(
        &mut self,
        cx: &mut Context,
        params: &mut Params,
        name: &'static str,
        role: Role,
        default: SpectrumDescription,
    ) -> SpectrumTextureId {
        self.spectrum_or_none(cx, params, name, role).unwrap_or_else(|| self.constant_spectrum(default))
    }

    fn unknown(&self, cx: &mut Context, name: &str, spot: Spot, spectrum: bool) {
        if cx.include_missing {
            return;
        }
        let kind = if spectrum { "spectrum" } else { "float" };
        let other = if spectrum { self.float_names.contains_key(name) } else { self.spectrum_names.contains_key(name) };
        let help = if other {
            format!("`{name}` is a {} texture", if spectrum { "float" } else { "spectrum" })
        } else {
            let mut names: Vec<&str> = if spectrum {
                self.spectrum_names.keys().map(String::as_str).collect()
            } else {
                self.float_names.keys().map(String::as_str).collect()
            };
            names.sort_unstable();
            names.truncate(20);
            did_you_mean(name, &names, "defined")
        };
        cx.error_help(spot, format!("no {kind} texture `{name}` is defined"), help);
    }

    /// Makes all textures of the file.
    pub(crate) fn build(&mut self, cx: &mut Context, entities: Vec<TextureEntity>) {
        let (images, others): (Vec<_>, Vec<_>) = entities.into_iter().partition(|e| e.class.0 == "imagemap");
        for mut entity in images.into_iter().chain(others) {
            if cx.hopeless() {
                return;
            }
            let known = if entity.spectrum {
                self.spectrum_names.contains_key(&entity.name)
            } else {
                self.float_names.contains_key(&entity.name)
            };
            if known {
                cx.error(entity.params.spot, format!("texture `{}` is defined twice", entity.name));
                continue;
            }
            if entity.spectrum {
                let texture = self.make_spectrum(cx, &mut entity);
                self.spectra.push(texture);
                self.spectrum_names.insert(entity.name, self.spectra.len() - 1);
            } else {
                let texture = self.make_float(cx, &mut entity);
                self.floats.push(texture);
                self.float_names.insert(entity.name, self.floats.len() - 1);
            }
            if CLASSES.iter().any(|c| c.0 == entity.class.0 && (if entity.spectrum { c.2 } else { c.1 })) {
                entity.params.finish(cx);
            }
        }
    }

    fn make_float(&mut self, cx: &mut Context, entity: &mut TextureEntity) -> FloatTexture {
        let (class, spot) = entity.class.clone();
        let p = &mut entity.params;
        match class.as_str() {
            "constant" => FloatTexture::Constant(p.float(cx, "value", 1.0)),
            "scale" => FloatTexture::Scale(self.float(cx, p, "tex", 1.0), self.float(cx, p, "scale", 1.0)),
            "mix" => FloatTexture::Mix {
                a: self.float(cx, p, "tex1", 0.0),
                b: self.float(cx, p, "tex2", 1.0),
                amount: self.float(cx, p, "amount", 0.5),
            },
            "directionmix" => {
                let dir = direction(cx, p, entity.to_world);
                FloatTexture::DirectionMix { a: self.float(cx, p, "tex2", 1.0), b: self.float(cx, p, "tex1", 0.0), dir }
            }
            "checkerboard" => FloatTexture::Checkerboard {
                mapping: checker_mapping(cx, p, entity.to_world),
                a: self.float(cx, p, "tex1", 1.0),
                b: self.float(cx, p, "tex2", 0.0),
            },
            "imagemap" => match self.image(cx, p, entity.to_world) {
                Some(i) => FloatTexture::Image {
                    image: i.image,
                    mapping: i.mapping,
                    wrap: i.wrap,
                    scale: i.scale,
                    invert: i.invert,
                    bilinear: i.bilinear,
                },
                None => FloatTexture::Constant(0.5),
            },
            "dots" => FloatTexture::Dots {
                mapping: mapping(cx, p, entity.to_world),
                inside: self.float(cx, p, "inside", 1.0),
                outside: self.float(cx, p, "outside", 0.0),
            },
            "bilerp" => FloatTexture::Bilerp {
                mapping: mapping(cx, p, entity.to_world),
                v: CORNERS.map(|(name, default)| p.float(cx, name, default)),
            },
            "fbm" | "wrinkled" => {
                let to_texture = entity.to_world.inverse().as_mat4();
                let (octaves, roughness) = noise(cx, p);
                match class.as_str() {
                    "fbm" => FloatTexture::Fbm { to_texture, octaves, roughness },
                    _ => FloatTexture::Wrinkled { to_texture, octaves, roughness },
                }
            }
            "windy" => FloatTexture::Windy(entity.to_world.inverse().as_mat4()),
            _ => {
                unsupported(cx, spot, &class, false, p);
                FloatTexture::Constant(0.5)
            }
        }
    }

    fn make_spectrum(&mut self, cx: &mut Context, entity: &mut TextureEntity) -> SpectrumTexture {
        use SpectrumDescription::Constant;
        let (class, spot) = entity.class.clone();
        let p = &mut entity.params;
        // Which law of colour applies depends on the use, so components above 1 are no error here.
        let role = Role::Unbounded;
        match class.as_str() {
            "constant" => SpectrumTexture::Constant(spectra::spectrum(cx, p, "value", role).unwrap_or(Constant(1.0))),
            "scale" => SpectrumTexture::Scale(
                self.spectrum(cx, p, "tex", role, Constant(1.0)),
                self.float(cx, p, "scale", 1.0),
            ),
            "mix" => SpectrumTexture::Mix {
                a: self.spectrum(cx, p, "tex1", role, Constant(0.0)),
                b: self.spectrum(cx, p, "tex2", role, Constant(1.0)),
                amount: self.float(cx, p, "amount", 0.5),
            },
            "directionmix" => {
                let dir = direction(cx, p, entity.to_world);
                // pbrt weighs the first texture by |n . dir|, so it is the one "along".
                SpectrumTexture::DirectionMix {
                    a: self.spectrum(cx, p, "tex2", role, Constant(1.0)),
                    b: self.spectrum(cx, p, "tex1", role, Constant(0.0)),
                    dir,
                }
            }
            "checkerboard" => SpectrumTexture::Checkerboard {
                mapping: checker_mapping(cx, p, entity.to_world),
                a: self.spectrum(cx, p, "tex1", role, Constant(1.0)),
                b: self.spectrum(cx, p, "tex2", role, Constant(0.0)),
            },
            "imagemap" => match self.image(cx, p, entity.to_world) {
                Some(i) => SpectrumTexture::Image {
                    image: i.image,
                    mapping: i.mapping,
                    wrap: i.wrap,
                    scale: i.scale,
                    invert: i.invert,
                    bilinear: i.bilinear,
                },
                None => SpectrumTexture::Constant(Constant(0.5)),
            },
            "dots" => SpectrumTexture::Dots {
                mapping: mapping(cx, p, entity.to_world),
                inside: self.spectrum(cx, p, "inside", role, Constant(1.0)),
                outside: self.spectrum(cx, p, "outside", role, Constant(0.0)),
            },
            "bilerp" => SpectrumTexture::Bilerp {
                mapping: mapping(cx, p, entity.to_world),
                v: CORNERS.map(|(name, default)| self.spectrum(cx, p, name, role, Constant(default))),
            },
            "marble" => {
                let (octaves, roughness) = noise(cx, p);
                SpectrumTexture::Marble {
                    to_texture: entity.to_world.inverse().as_mat4(),
                    octaves,
                    roughness,
                    scale: p.float(cx, "scale", 1.0),
                    variation: p.float(cx, "variation", 0.2),
                }
            }
            _ => {
                unsupported(cx, spot, &class, true, p);
                SpectrumTexture::Constant(Constant(0.5))
            }
        }
    }

    fn image(&mut self, cx: &mut Context, p: &mut Params, to_world: DMat4) -> Option<ImageUse> {
        let mapping = mapping(cx, p, to_world);
        let wrap = match p.choice(cx, "wrap", &["repeat", "black", "clamp", "octahedralsphere"]) {
            "black" => Wrap::Black,
            "clamp" => Wrap::Clamp,
            "octahedralsphere" => Wrap::Octahedral,
            _ => Wrap::Repeat,
        };
        // Filters over the footprint of a pixel have no meaning for a converged picture; all but `point` are bilinear.
        let bilinear = p.choice(cx, "filter", &["bilinear", "point", "trilinear", "ewa", "EWA"]) != "point";
        p.ignore(&[("maxanisotropy", &[Type::Float])]);
        let scale = p.float(cx, "scale", 1.0);
        let invert = p.bool(cx, "invert", false);
        let encoding = p.string(cx, "encoding").map_or_else(|| "sRGB".to_owned(), |e| e.0);
        let Some((path, spot)) = p.string(cx, "filename") else {
            cx.error(p.spot, format!("{} needs `string filename`", p.entity));
            return None;
        };
        let image = self.images.load(cx, &path, spot, &encoding)?;
        Some(ImageUse { image, mapping, wrap, scale, invert, bilinear })
    }
}

/// What float and spectrum image textures have in common.
struct ImageUse {
    image: usize,
    mapping: TextureMapping,
    wrap: Wrap,
    scale: f32,
    invert: bool,
    bilinear: bool,
}

/// Corners of a bilinear texture with pbrt's defaults, in the order of the description.
const CORNERS: [(&str, f32); 4] = [("v00", 0.0), ("v10", 0.0), ("v01", 1.0), ("v11", 1.0)];

/// Octaves of a noise and the factor from one to the next.
fn noise(cx: &mut Context, p: &mut Params) -> (u32, f32) {
    let octaves = p.integer(cx, "octaves", 8, 0);
    if octaves > MAX_OCTAVES {
        let spot = p.spot_of("octaves");
        cx.error(spot, format!("octaves = {octaves} is outside [0, {MAX_OCTAVES}]"));
    }
    (octaves.min(MAX_OCTAVES), p.float(cx, "roughness", 0.5))
}

/// The world direction of a mix by direction.
fn direction(cx: &mut Context, p: &mut Params, to_world: DMat4) -> Vec3 {
    let dir = p.vec3(cx, "dir", &[Type::Vector3], Vec3::Y);
    to_world.as_mat4().transform_vector3(dir).try_normalize().unwrap_or_else(|| {
        let spot = p.spot_of("dir");
        cx.error(spot, "`dir` has no direction");
        Vec3::Y
    })
}

/// A class that is known but not made, or not known at all.
fn unsupported(cx: &mut Context, spot: Spot, class: &str, spectrum: bool, p: &mut Params) {
    if class == "ptex" {
        cx.warn(spot, "textures of class `ptex` are not supported: the constant 0.5 is used");
        p.ignore(&[("filename", &[Type::String]), ("encoding", &[Type::String]), ("scale", &[Type::Float])]);
        return;
    }
    let (kind, other) = if spectrum { ("spectrum", "float") } else { ("float", "spectrum") };
    let names: Vec<&str> = CLASSES.iter().filter(|c| if spectrum { c.2 } else { c.1 }).map(|c| c.0).collect();
    let help = if CLASSES.iter().any(|c| c.0 == class) {
        format!("it exists as {other} texture only; accepted: {}", names.join(", "))
    } else {
        did_you_mean(class, &names, "accepted")
    };
    cx.error_help(spot, format!("`{class}` is no class of {kind} textures"), help);
}

fn mapping(cx: &mut Context, p: &mut Params, to_world: DMat4) -> TextureMapping {
    let to_texture = to_world.inverse().as_mat4();
    let kind = p.choice(cx, "mapping", &["uv", "spherical", "cylindrical", "planar"]);
    let delta = Vec2::new(p.float(cx, "udelta", 0.0), p.float(cx, "vdelta", 0.0));
    let scale = Vec2::new(p.float(cx, "uscale", 1.0), p.float(cx, "vscale", 1.0));
    let v1 = p.vec3(cx, "v1", &[Type::Vector3], Vec3::X);
    let v2 = p.vec3(cx, "v2", &[Type::Vector3], Vec3::Y);
    match kind {
        "spherical" => TextureMapping::Spherical(to_texture),
        "cylindrical" => TextureMapping::Cylindrical(to_texture),
        "planar" => TextureMapping::Planar { to_texture, v1, v2, delta },
        _ => TextureMapping::Uv { scale, delta },
    }
}

fn checker_mapping(cx: &mut Context, p: &mut Params, to_world: DMat4) -> TextureMapping {
    match p.integer(cx, "dimension", 2, 2) {
        2 => mapping(cx, p, to_world),
        3 => TextureMapping::Point(to_world.inverse().as_mat4()),
        n => {
            let spot = p.spot_of("dimension");
            cx.error(spot, format!("dimension = {n} is neither 2 nor 3"));
            mapping(cx, p, to_world)
        }
    }
}
