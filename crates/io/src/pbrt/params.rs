//! Parameter lists: typed values by name, with defaults, and a report of what nobody asked for.
//!
//! A getter notes the name and the types it would have taken. What is left when an entity is complete is an error, and the
//! notes are what the error suggests; so the list of accepted names can never drift from the code that reads them.

use std::sync::Arc;

use moonmilk_core::{ColorSpace, Vec2, Vec3};

use super::context::Context;
use super::lexer::Spot;
use super::suggest::nearest;

/// Types of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Type {
    Bool,
    Float,
    Integer,
    Point2,
    Vector2,
    Point3,
    Vector3,
    Normal,
    String,
    Texture,
    Rgb,
    Spectrum,
    Blackbody,
}

use Type::*;

impl Type {
    pub(crate) const ALL: [Type; 13] =
        [Bool, Float, Integer, Point2, Vector2, Point3, Vector3, Normal, String, Texture, Rgb, Spectrum, Blackbody];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Bool => "bool",
            Float => "float",
            Integer => "integer",
            Point2 => "point2",
            Vector2 => "vector2",
            Point3 => "point3",
            Vector3 => "vector3",
            Normal => "normal",
            String => "string",
            Texture => "texture",
            Rgb => "rgb",
            Spectrum => "spectrum",
            Blackbody => "blackbody",
        }
    }

    /// The type of that name; otherwise, if the name is known from older files, the type of today and what to write instead.
    pub(crate) fn parse(name: &str) -> Result<Type, Option<(Type, &'static str)>> {
        Type::ALL.into_iter().find(|t| t.name() == name).ok_or(match name {
            "point" => Some((Point3, "pbrt-v3 syntax: write `point3`")),
            "vector" => Some((Vector3, "pbrt-v3 syntax: write `vector3`")),
            "color" => Some((Rgb, "pbrt-v3 syntax: write `rgb`")),
            "normal3" => Some((Normal, "write `normal`")),
            "xyz" => Some((Rgb, "pbrt-v3 syntax: convert the values and write `rgb`")),
            _ => None,
        })
    }
}

/// Values of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    Floats(Vec<f32>),
    Ints(Vec<i32>),
    Strings(Vec<std::string::String>),
    Bools(Vec<bool>),
}

/// One parameter.
#[derive(Clone, Debug)]
pub(crate) struct Param {
    pub ty: Type,
    pub name: std::string::String,
    pub values: Values,
    /// The name within the declaration.
    pub spot: Spot,
    /// The type within the declaration.
    pub type_spot: Spot,
    /// The first value.
    pub value: Spot,
    /// Space of an rgb value.
    pub color_space: ColorSpace,
}

/// Accepted types where a spectrum or a texture of spectra may stand.
pub(crate) const SPECTRUM_TEXTURE: &[Type] = &[Rgb, Spectrum, Blackbody, Texture];
/// Accepted types where a spectrum may stand.
pub(crate) const SPECTRUM: &[Type] = &[Rgb, Spectrum, Blackbody];
/// Accepted types where a number or a texture of numbers may stand.
pub(crate) const FLOAT_TEXTURE: &[Type] = &[Float, Texture];

/// Parameters of one entity, with those that `Attribute` directives set for its kind.
#[derive(Clone, Debug)]
pub(crate) struct Params {
    /// What the parameters belong to, e.g. `material "diffuse"`.
    pub entity: std::string::String,
    /// Where the entity is named.
    pub spot: Spot,
    own: Vec<Param>,
    used: Vec<bool>,
    attributes: Arc<Vec<Param>>,
    /// Space of the entity's own colours, and of its default lights.
    pub color_space: ColorSpace,
    asked: Vec<(&'static str, &'static [Type])>,
}

impl Params {
    pub(crate) fn new(entity: std::string::String, spot: Spot, own: Vec<Param>, attributes: Arc<Vec<Param>>) -> Self {
        let used = vec![false; own.len()];
        Params { entity, spot, own, used, attributes, color_space: ColorSpace::Srgb, asked: Vec::new() }
    }

    /// As [`Params::new`], with colours in a space.
    pub(crate) fn within(
        space: ColorSpace,
        entity: std::string::String,
        spot: Spot,
        mut own: Vec<Param>,
        attributes: Arc<Vec<Param>>,
    ) -> Self {
        own.iter_mut().for_each(|p| p.color_space = space);
        Params { color_space: space, ..Params::new(entity, spot, own, attributes) }
    }

    /// Finds a parameter: the last of that name in the list, else the last that `Attribute` set, as pbrt does.
    fn index(&mut self, name: &'static str, types: &'static [Type]) -> Option<usize> {
        self.asked.push((name, types));
        let mut found = None;
        for (i, param) in self.own.iter().enumerate().rev() {
            if param.name == name && types.contains(&param.ty) {
                // Earlier ones of the same name are shadowed, which pbrt allows.
                self.used[i] = true;
                found = found.or(Some(i));
            } else if param.name == name && found.is_some() {
                self.used[i] = true;
            }
        }
        found
    }

    /// The parameter `name` if it was given with one of `types`.
    pub(crate) fn find(&mut self, name: &'static str, types: &'static [Type]) -> Option<&Param> {
        match self.index(name, types) {
            Some(i) => Some(&self.own[i]),
            None => self.attributes.iter().rev().find(|p| p.name == name && types.contains(&p.ty)),
        }
    }

    /// As [`Params::find`], but moves the parameter's values out: for large lists.
    fn take(&mut self, name: &'static str, types: &'static [Type]) -> Option<(Values, Spot)> {
        match self.index(name, types) {
            Some(i) => {
                let spot = self.own[i].spot;
                Some((std::mem::replace(&mut self.own[i].values, Values::Floats(Vec::new())), spot))
            }
            None => self
                .attributes
                .iter()
                .rev()
                .find(|p| p.name == name && types.contains(&p.ty))
                .map(|p| (p.values.clone(), p.spot)),
        }
    }

    /// Where `name` was said, else where the entity is.
    pub(crate) fn spot_of(&self, name: &str) -> Spot {
        self.own.iter().rev().find(|p| p.name == name).map_or(self.spot, |p| p.value)
    }

    /// Whether a parameter of that name was given, of any type.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.own.iter().any(|p| p.name == name) || self.attributes.iter().any(|p| p.name == name)
    }

    fn fixed<const N: usize>(
        &mut self,
        cx: &mut Context,
        name: &'static str,
        types: &'static [Type],
    ) -> Option<[f32; N]> {
        let param = self.find(name, types)?;
        let Values::Floats(values) = &param.values else {
            return None;
        };
        match <[f32; N]>::try_from(values.as_slice()) {
            Ok(values) => Some(values),
            Err(_) => {
                let message = format!("`{name}` takes {}, {} given", count(N, "number"), values.len());
                let spot = param.spot;
                cx.error(spot, message);
                None
            }
        }
    }

    pub(crate) fn float_or_none(&mut self, cx: &mut Context, name: &'static str) -> Option<f32> {
        self.fixed::<1>(cx, name, &[Float]).map(|[x]| x)
    }

    pub(crate) fn float(&mut self, cx: &mut Context, name: &'static str, default: f32) -> f32 {
        self.float_or_none(cx, name).unwrap_or(default)
    }

    /// A number that must satisfy `valid`; `domain` says what that is.
    pub(crate) fn float_in(
        &mut self,
        cx: &mut Context,
        name: &'static str,
        default: f32,
        valid: impl Fn(f32) -> bool,
        domain: &str,
    ) -> f32 {
        match self.float_or_none(cx, name) {
            Some(x) if valid(x) => x,
            Some(x) => {
                let spot = self.spot_of(name);
                cx.error(spot, format!("{name} = {x} is outside {domain}"));
                default
            }
            None => default,
        }
    }

    pub(crate) fn vec3(&mut self, cx: &mut Context, name: &'static str, types: &'static [Type], default: Vec3) -> Vec3 {
        self.fixed::<3>(cx, name, types).map_or(default, Vec3::from_array)
    }

    pub(crate) fn integer_or_none(&mut self, cx: &mut Context, name: &'static str) -> Option<i32> {
        let param = self.find(name, &[Integer])?;
        match &param.values {
            Values::Ints(values) if values.len() == 1 => Some(values[0]),
            Values::Ints(values) => {
                let message = format!("`{name}` takes 1 integer, {} given", values.len());
                let spot = param.spot;
                cx.error(spot, message);
                None
            }
            _ => None,
        }
    }

    /// An integer that must be at least `least`.
    pub(crate) fn integer(&mut self, cx: &mut Context, name: &'static str, default: u32, least: u32) -> u32 {
        match self.integer_or_none(cx, name) {
            Some(n) if i64::from(n) >= i64::from(least) => n as u32,
            Some(n) => {
                let spot = self.spot_of(name);
                cx.error(spot, format!("{name} = {n} is less than {least}"));
                default
            }
            None => default,
        }
    }

    pub(crate) fn bool(&mut self, cx: &mut Context, name: &'static str, default: bool) -> bool {
        let Some(param) = self.find(name, &[Bool]) else {
            return default;
        };
        match &param.values {
            Values::Bools(values) if values.len() == 1 => values[0],
            _ => {
                let spot = param.spot;
                cx.error(spot, format!("`{name}` takes one of true, false"));
                default
            }
        }
    }

    /// A single string with its place.
    pub(crate) fn string(&mut self, cx: &mut Context, name: &'static str) -> Option<(std::string::String, Spot)> {
        let param = self.find(name, &[String])?;
        match &param.values {
            Values::Strings(values) if values.len() == 1 => Some((values[0].clone(), param.value)),
            _ => {
                let spot = param.spot;
                cx.error(spot, format!("`{name}` takes one string"));
                None
            }
        }
    }

    /// A string that must be one of `accepted`, of which the first is the default.
    pub(crate) fn choice(&mut self, cx: &mut Context, name: &'static str, accepted: &[&'static str]) -> &'static str {
        let Some((given, spot)) = self.string(cx, name) else {
            return accepted[0];
        };
        if let Some(found) = accepted.iter().find(|a| **a == given) {
            return found;
        }
        cx.error_help(spot, format!("`{given}` is no value of `{name}`"), did_you_mean(&given, accepted, "accepted"));
        accepted[0]
    }

    pub(crate) fn strings(&mut self, name: &'static str) -> Vec<std::string::String> {
        match self.find(name, &[String]).map(|p| &p.values) {
            Some(Values::Strings(values)) => values.clone(),
            _ => Vec::new(),
        }
    }

    pub(crate) fn floats(&mut self, name: &'static str, types: &'static [Type]) -> Option<(Vec<f32>, Spot)> {
        match self.take(name, types)? {
            (Values::Floats(values), spot) => Some((values, spot)),
            _ => None,
        }
    }

    pub(crate) fn integers(&mut self, name: &'static str) -> Option<(Vec<i32>, Spot)> {
        match self.take(name, &[Integer])? {
            (Values::Ints(values), spot) => Some((values, spot)),
            _ => None,
        }
    }

    /// A list of points, vectors or normals.
    pub(crate) fn vec3s(
        &mut self,
        cx: &mut Context,
        name: &'static str,
        types: &'static [Type],
    ) -> Option<(Vec<Vec3>, Spot)> {
        let (values, spot) = self.floats(name, types)?;
        if values.len() % 3 != 0 {
            cx.error(spot, format!("`{name}` takes triples of numbers, {} given", count(values.len(), "number")));
            return None;
        }
        Some((values.chunks_exact(3).map(Vec3::from_slice).collect(), spot))
    }

    /// A list of pairs.
    pub(crate) fn vec2s(
        &mut self,
        cx: &mut Context,
        name: &'static str,
        types: &'static [Type],
    ) -> Option<(Vec<Vec2>, Spot)> {
        let (values, spot) = self.floats(name, types)?;
        if values.len() % 2 != 0 {
            cx.error(spot, format!("`{name}` takes pairs of numbers, {} given", count(values.len(), "number")));
            return None;
        }
        Some((values.chunks_exact(2).map(Vec2::from_slice).collect(), spot))
    }

    /// Marks parameters as read whose value makes no difference here.
    pub(crate) fn ignore(&mut self, names: &[(&'static str, &'static [Type])]) {
        for &(name, types) in names {
            self.index(name, types);
        }
    }

    /// Reports what nobody asked for.
    pub(crate) fn finish(self, cx: &mut Context) {
        for (param, _) in self.own.iter().zip(&self.used).filter(|(_, used)| !**used) {
            let name = param.name.as_str();
            if let Some((_, types)) = self.asked.iter().find(|(asked, _)| *asked == name) {
                let message = format!("`{name}` of {} is not of type {}", self.entity, param.ty.name());
                cx.error_unless_lenient(param.type_spot, message, format!("write `{}`", alternatives(types, name)));
                continue;
            }
            let message = format!("{} has no parameter `{name}`", self.entity);
            let help = match former(&self.entity, name) {
                Some(advice) => format!("pbrt-v3 syntax: {advice}"),
                None => {
                    let near = nearest(name, self.asked.iter().map(|(n, _)| *n))
                        .map(|n| format!("did you mean `{n}`? "))
                        .unwrap_or_default();
                    let mut list: Vec<std::string::String> = Vec::new();
                    for (asked, types) in &self.asked {
                        let item = format!("`{}`", alternatives(types, asked));
                        if !list.contains(&item) {
                            list.push(item);
                        }
                    }
                    if list.is_empty() {
                        format!("{near}it takes none")
                    } else {
                        format!("{near}accepted: {}", list.join(", "))
                    }
                }
            };
            cx.error_unless_lenient(param.spot, message, help);
        }
    }
}

/// `1 number`, `2 numbers`.
pub(crate) fn count(n: usize, what: &str) -> std::string::String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

fn alternatives(types: &[Type], name: &str) -> std::string::String {
    let types: Vec<&str> = types.iter().map(|t| t.name()).collect();
    format!("{} {name}", types.join("|"))
}

/// "did you mean `x`? accepted: a, b, c".
pub(crate) fn did_you_mean(given: &str, accepted: &[&str], what: &str) -> std::string::String {
    let near = nearest(given, accepted.iter().copied()).map(|n| format!("did you mean `{n}`? ")).unwrap_or_default();
    if accepted.is_empty() { format!("{what}: none") } else { format!("{near}{what}: {}", accepted.join(", ")) }
}

/// What became of a parameter of pbrt-v3.
fn former(entity: &str, name: &str) -> Option<&'static str> {
    Some(match name {
        "Kd" if entity.contains("transmission") => "write `rgb reflectance`",
        "Kd" => "write `reflectance`",
        "Ks" | "Kr" => {
            "pbrt-v4 has no `Ks` and `Kr`: choose a material (`coateddiffuse`, `conductor`, `dielectric`) and its `reflectance`, `eta` or `roughness`"
        }
        "Kt" => "write `transmittance` on a `diffusetransmission` material",
        "opacity" => "write `texture alpha` on the shape",
        "index" => "write `float eta`",
        "bumpmap" => "write `texture displacement`",
        "mapname" => "write `string filename`",
        "trilinear" => "write `string filter` with \"trilinear\" or \"bilinear\"",
        "maxsampleluminance" => "write `float maxcomponentvalue`",
        "scale" if entity.starts_with("film") => "write `float iso` with 100 times the value",
        "xwidth" => "write `float xradius`",
        "ywidth" => "write `float yradius`",
        "alpha" if entity.starts_with("filter") => "write `float sigma` with 1 / sqrt(2 alpha)",
        "nsamples" | "samples" if entity.contains("light") => "remove it: pbrt-v4's lights take no sample count",
        "st" => "write `point2 uv`",
        "rrthreshold" => "remove it: pbrt-v4 has no such setting",
        "meanfreepath" => "write `mfp`",
        _ => return None,
    })
}
