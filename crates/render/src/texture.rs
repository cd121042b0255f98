//! Textures: functions of the surface point with one number or one spectrum as value.
//!
//! A texture refers only to textures before it in its list (and float textures freely from spectrum textures), so that evaluation ends; this is
//! checked when they are made. Pictures are bilinear or nearest, without prefiltering: many samples per pixel do that.
//! Meanings are pbrt-v4's: v points up in pictures; the picture is scaled first, then inverted, then kept non-negative.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use moonmilk_core::upsampling::{sample_albedo, sample_unbounded};
use moonmilk_core::{Spectra, SpectraError, Spectrum, Vec2, Vec3, Wavelengths};

use crate::description::{
    FloatTexture, FloatTextureId, ImageDescription, SceneDescription, SpectrumDescription, SpectrumTexture,
    SpectrumTextureId, TextureMapping, Wrap,
};
use crate::material::MaterialError;

pub(crate) mod noise;
mod procedural;

/// Where a texture is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexturePoint {
    /// World point.
    pub p: Vec3,
    /// World unit normal of the true surface, as pbrt-v4 gives it to textures.
    pub n: Vec3,
    /// Surface parameters.
    pub uv: Vec2,
}

/// What the colour of a texture means: decides the smooth spectrum that stands for an rgb value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A reflectance, transmittance or albedo in \[0, 1\]; picture values outside it act as its ends.
    Albedo,
    /// Any non-negative quantity: a coefficient, an index, a length.
    Unbounded,
    /// A light relative to D65 (`moonmilk_core::color`).
    Illuminant,
}

/// A constant in each of its roles.
#[derive(Clone, Debug)]
struct Constant {
    albedo: Option<Spectra>,
    unbounded: Spectra,
    illuminant: Spectra,
    /// Whether it was given as values over wavelengths: noise may take such above 1.
    measured: bool,
}

/// A spectrum texture with its constants prepared.
#[derive(Clone, Debug)]
enum Node {
    Constant(Box<Constant>),
    Other(SpectrumTexture),
}

/// All textures of a scene, with the pictures that they use.
#[derive(Clone, Debug)]
pub struct Textures {
    floats: Vec<FloatTexture>,
    spectra: Vec<Node>,
    images: Vec<Option<ImageDescription>>,
}

/// Turns a description into a spectrum of a property (not of a light).
pub(crate) fn property(d: &SpectrumDescription) -> Result<Spectra, SpectraError> {
    match d {
        SpectrumDescription::Constant(x) => Spectra::sampled(vec![(550.0, *x)]),
        SpectrumDescription::Rgb(rgb) => Spectra::rgb_unbounded(*rgb),
        SpectrumDescription::Sampled(points) => Spectra::sampled(points.clone()),
        SpectrumDescription::Blackbody(t) => Spectra::blackbody_curve(*t),
        SpectrumDescription::Named(name) => Spectra::named(name),
    }
}

impl Constant {
    fn new(d: &SpectrumDescription) -> Result<Self, SpectraError> {
        let unbounded = property(d)?;
        // A value above 1 is an error only where the texture is used as an albedo.
        let albedo = match d {
            SpectrumDescription::Rgb(rgb) => Spectra::rgb_albedo(*rgb).ok(),
            _ => (unbounded.max_value() <= 1.0).then(|| unbounded.clone()),
        };
        let illuminant = match d {
            SpectrumDescription::Rgb(rgb) => Spectra::rgb_illuminant(*rgb)?,
            SpectrumDescription::Sampled(points) => Spectra::sampled_light(points.clone())?,
            SpectrumDescription::Blackbody(t) => Spectra::blackbody(*t)?,
            _ => unbounded.clone(),
        };
        let measured = matches!(d, SpectrumDescription::Sampled(_) | SpectrumDescription::Named(_));
        Ok(Self { albedo, unbounded, illuminant, measured })
    }

    fn sample<const N: usize>(&self, w: &Wavelengths<N>, role: Role) -> Spectrum<N> {
        match role {
            Role::Albedo => {
                self.albedo.as_ref().map_or_else(|| self.unbounded.sample(w).map(|x| x.min(1.0)), |s| s.sample(w))
            }
            Role::Unbounded => self.unbounded.sample(w),
            Role::Illuminant => self.illuminant.sample(w),
        }
    }
}

impl Textures {
    /// Prepares the textures of a scene; pictures that no texture uses are not kept.
    ///
    /// *Errors*: a reference to a later or missing texture or picture, an empty picture, an invalid constant.
    pub fn new(d: &SceneDescription) -> Result<Self, MaterialError> {
        let mut images = vec![None; d.images.len()];
        let mut keep = |id: usize, name: &str| -> Result<(), MaterialError> {
            let image = d
                .images
                .get(id)
                .ok_or_else(|| MaterialError::texture(format!("{name} uses picture {id}, which does not exist")))?;
            if image.width == 0 || image.height == 0 || image.rgb.len() != image.width as usize * image.height as usize
            {
                return Err(MaterialError::texture(format!("picture {} is empty or incomplete", image.name)));
            }
            if images[id].is_none() {
                images[id] = Some(image.clone());
            }
            Ok(())
        };
        for (i, t) in d.float_textures.iter().enumerate() {
            let name = format!("float texture {i}");
            let (refers, image) = match t {
                FloatTexture::Constant(_)
                | FloatTexture::Bilerp { .. }
                | FloatTexture::Fbm { .. }
                | FloatTexture::Wrinkled { .. }
                | FloatTexture::Windy(_) => (vec![], None),
                FloatTexture::Scale(a, b)
                | FloatTexture::DirectionMix { a, b, .. }
                | FloatTexture::Checkerboard { a, b, .. }
                | FloatTexture::Dots { inside: a, outside: b, .. } => (vec![*a, *b], None),
                FloatTexture::Mix { a, b, amount } => (vec![*a, *b, *amount], None),
                FloatTexture::Image { image, .. } => (vec![], Some(*image)),
            };
            before(&name, &refers, i)?;
            image.map_or(Ok(()), |image| keep(image, &name))?;
        }
        let mut spectra = Vec::with_capacity(d.spectrum_textures.len());
        for (i, t) in d.spectrum_textures.iter().enumerate() {
            let name = format!("spectrum texture {i}");
            let (refers, floats, image) = match t {
                SpectrumTexture::Constant(_) => (vec![], vec![], None),
                SpectrumTexture::Scale(a, f) => (vec![*a], vec![*f], None),
                SpectrumTexture::Mix { a, b, amount } => (vec![*a, *b], vec![*amount], None),
                SpectrumTexture::DirectionMix { a, b, .. }
                | SpectrumTexture::Checkerboard { a, b, .. }
                | SpectrumTexture::Dots { inside: a, outside: b, .. } => (vec![*a, *b], vec![], None),
                SpectrumTexture::Bilerp { v, .. } => (v.to_vec(), vec![], None),
                SpectrumTexture::Marble { .. } => (vec![], vec![], None),
                SpectrumTexture::Image { image, .. } => (vec![], vec![], Some(*image)),
            };
            before(&name, &refers, i)?;
            before(&name, &floats, d.float_textures.len())?;
            image.map_or(Ok(()), |image| keep(image, &name))?;
            spectra.push(match t {
                SpectrumTexture::Constant(s) => Node::Constant(Box::new(
                    Constant::new(s).map_err(|e| MaterialError::texture(format!("{name}: {e}")))?,
                )),
                other => Node::Other(other.clone()),
            });
        }
        // Normal maps are pictures, too.
        for m in &d.materials {
            if let Some(image) = m.normal_map {
                keep(image, "a normal map")?;
            }
        }
        Ok(Self { floats: d.float_textures.clone(), spectra, images })
    }

    /// Returns the value of a float texture.
    pub fn eval_float(&self, id: FloatTextureId, at: &TexturePoint) -> f32 {
        match &self.floats[id] {
            FloatTexture::Constant(x) => *x,
            FloatTexture::Scale(a, b) => self.eval_float(*a, at) * self.eval_float(*b, at),
            FloatTexture::Mix { a, b, amount } => {
                let t = self.eval_float(*amount, at);
                self.eval_float(*a, at) * (1.0 - t) + self.eval_float(*b, at) * t
            }
            FloatTexture::Image { image, mapping, wrap, scale, invert, bilinear } => {
                let Some(image) = &self.images[*image] else {
                    return 0.0;
                };
                let x = if image.alpha.is_empty() {
                    let [r, g, b] = lookup(image, mapping, *wrap, *bilinear, at, |i| image.rgb[i]);
                    (r + g + b) / 3.0
                } else {
                    lookup(image, mapping, *wrap, *bilinear, at, |i| [image.alpha[i]])[0]
                };
                finish(x, *scale, *invert)
            }
            FloatTexture::Checkerboard { mapping, a, b } => {
                self.eval_float(if even(mapping, at) { *a } else { *b }, at)
            }
            FloatTexture::DirectionMix { a, b, dir } => {
                let t = at.n.dot(*dir).abs();
                self.eval_float(*a, at) * (1.0 - t) + self.eval_float(*b, at) * t
            }
            FloatTexture::Bilerp { mapping, v } => {
                procedural::bilinear(coordinates(mapping, at)).iter().zip(v).map(|(w, v)| w * v).sum()
            }
            FloatTexture::Dots { mapping, inside, outside } => {
                self.eval_float(if procedural::in_dot(coordinates(mapping, at)) { *inside } else { *outside }, at)
            }
            FloatTexture::Fbm { to_texture, octaves, roughness } => {
                noise::fbm(to_texture.transform_point3(at.p), *roughness, *octaves)
            }
            FloatTexture::Wrinkled { to_texture, octaves, roughness } => {
                noise::turbulence(to_texture.transform_point3(at.p), *roughness, *octaves)
            }
            FloatTexture::Windy(to_texture) => procedural::waves(to_texture.transform_point3(at.p)),
        }
    }

    /// Returns the value of a spectrum texture in the lanes of a path.
    pub fn eval_spectrum<const N: usize>(
        &self,
        id: SpectrumTextureId,
        at: &TexturePoint,
        w: &Wavelengths<N>,
        role: Role,
    ) -> Spectrum<N> {
        let texture = match &self.spectra[id] {
            Node::Constant(c) => return c.sample(w, role),
            Node::Other(t) => t,
        };
        let mix = |a: usize, b: usize, t: f32| {
            self.eval_spectrum(a, at, w, role) * (1.0 - t) + self.eval_spectrum(b, at, w, role) * t
        };
        match texture {
            SpectrumTexture::Constant(_) => Spectrum::ZERO,
            SpectrumTexture::Scale(a, f) => self.eval_spectrum(*a, at, w, role) * self.eval_float(*f, at),
            SpectrumTexture::Mix { a, b, amount } => mix(*a, *b, self.eval_float(*amount, at)),
            SpectrumTexture::DirectionMix { a, b, dir } => mix(*a, *b, at.n.dot(*dir).abs()),
            SpectrumTexture::Image { image, mapping, wrap, scale, invert, bilinear } => {
                let Some(image) = &self.images[*image] else {
                    return Spectrum::ZERO;
                };
                let rgb =
                    lookup(image, mapping, *wrap, *bilinear, at, |i| image.rgb[i]).map(|x| finish(x, *scale, *invert));
                match role {
                    Role::Albedo => sample_albedo(rgb.map(|x| x.min(1.0)), w),
                    Role::Unbounded | Role::Illuminant => sample_unbounded(rgb, w),
                }
            }
            SpectrumTexture::Checkerboard { mapping, a, b } => {
                self.eval_spectrum(if even(mapping, at) { *a } else { *b }, at, w, role)
            }
            SpectrumTexture::Bilerp { mapping, v } => procedural::bilinear(coordinates(mapping, at))
                .iter()
                .zip(v)
                .fold(Spectrum::ZERO, |sum, (f, v)| sum + self.eval_spectrum(*v, at, w, role) * *f),
            SpectrumTexture::Dots { mapping, inside, outside } => {
                let dot = procedural::in_dot(coordinates(mapping, at));
                self.eval_spectrum(if dot { *inside } else { *outside }, at, w, role)
            }
            SpectrumTexture::Marble { to_texture, octaves, roughness, scale, variation } => {
                let p = to_texture.transform_point3(at.p) * *scale;
                let rgb = procedural::marble(p, *roughness, *octaves, *variation);
                match role {
                    Role::Albedo => sample_albedo(rgb, w),
                    Role::Unbounded | Role::Illuminant => sample_unbounded(rgb, w),
                }
            }
        }
    }

    /// Returns the constant value of a float texture, `None` if it varies.
    pub fn constant_float(&self, id: FloatTextureId) -> Option<f32> {
        match self.floats.get(id)? {
            FloatTexture::Constant(x) => Some(*x),
            FloatTexture::Scale(a, b) => Some(self.constant_float(*a)? * self.constant_float(*b)?),
            _ => None,
        }
    }

    /// Returns the colour of a picture at surface parameters, wrapped around, as a normal map stores it.
    pub(crate) fn normal(&self, image: usize, uv: Vec2) -> Option<[f32; 3]> {
        let image = self.images.get(image)?.as_ref()?;
        let mapping = TextureMapping::Uv { scale: Vec2::ONE, delta: Vec2::ZERO };
        let at = TexturePoint { p: Vec3::ZERO, n: Vec3::Z, uv };
        Some(lookup(image, &mapping, Wrap::Repeat, true, &at, |i| image.rgb[i]))
    }

    /// Checks that spectrum texture `id` exists and, if it is a constant, may serve as an albedo.
    pub(crate) fn check_spectrum(&self, id: SpectrumTextureId, role: Role) -> Result<(), String> {
        match self.spectra.get(id) {
            None => Err(format!("spectrum texture {id} does not exist")),
            Some(Node::Constant(c)) if role == Role::Albedo && c.albedo.is_none() && !c.measured => {
                Err(format!("a reflectance of {} is outside [0, 1]", c.unbounded.max_value()))
            }
            Some(_) => Ok(()),
        }
    }

    /// Returns the maximum of a measured spectrum that exceeds 1, where an albedo cannot: it acts as 1 there, as in pbrt.
    pub(crate) fn cut_of_albedo(&self, id: SpectrumTextureId) -> Option<f32> {
        match self.spectra.get(id) {
            Some(Node::Constant(c)) if c.albedo.is_none() && c.measured => Some(c.unbounded.max_value()),
            _ => None,
        }
    }

    /// Checks that float texture `id` exists.
    pub(crate) fn check_float(&self, id: FloatTextureId) -> Result<(), String> {
        if id < self.floats.len() { Ok(()) } else { Err(format!("float texture {id} does not exist")) }
    }
}

fn before(name: &str, refers: &[usize], limit: usize) -> Result<(), MaterialError> {
    match refers.iter().find(|&&r| r >= limit) {
        Some(r) => Err(MaterialError::texture(format!("{name} refers to texture {r}, which is not defined before it"))),
        None => Ok(()),
    }
}

#[inline]
fn finish(x: f32, scale: f32, invert: bool) -> f32 {
    let x = x * scale;
    (if invert { 1.0 - x } else { x }).max(0.0)
}

/// Returns texture coordinates on the plane [pbrt-v4, TextureMapping2D].
fn coordinates(mapping: &TextureMapping, at: &TexturePoint) -> Vec2 {
    match mapping {
        TextureMapping::Uv { scale, delta } => at.uv * *scale + *delta,
        TextureMapping::Spherical(m) => {
            let v = m.transform_point3(at.p).normalize_or_zero();
            Vec2::new(v.z.clamp(-1.0, 1.0).acos() * FRAC_1_PI, v.y.atan2(v.x).rem_euclid(TAU) / TAU)
        }
        TextureMapping::Cylindrical(m) => {
            let v = m.transform_point3(at.p);
            Vec2::new((PI + v.y.atan2(v.x)) / TAU, v.z)
        }
        TextureMapping::Planar { to_texture, v1, v2, delta } => {
            let v = to_texture.transform_point3(at.p);
            *delta + Vec2::new(v.dot(*v1), v.dot(*v2))
        }
        TextureMapping::Point(m) => m.transform_point3(at.p).truncate(),
    }
}

/// Returns whether the point lies in an even cell of the checkerboard: squares of the plane, or cubes for a 3D mapping.
fn even(mapping: &TextureMapping, at: &TexturePoint) -> bool {
    let sum = match mapping {
        TextureMapping::Point(m) => m.transform_point3(at.p).floor().element_sum(),
        _ => coordinates(mapping, at).floor().element_sum(),
    };
    sum.rem_euclid(2.0) < 0.5
}

/// Returns the texel that lies as far inside an edge as x lies outside.
#[inline]
fn beyond(x: i64, n: i64) -> i64 {
    if x < 0 { x.saturating_neg().saturating_sub(1) } else { (2 * n - 1).saturating_sub(x) }
}

/// Returns the interpolated value of a picture; texel centres lie at half-integers, v points up.
fn lookup<const C: usize>(
    image: &ImageDescription,
    mapping: &TextureMapping,
    wrap: Wrap,
    bilinear: bool,
    at: &TexturePoint,
    texel: impl Fn(usize) -> [f32; C],
) -> [f32; C] {
    let st = coordinates(mapping, at);
    let (width, height) = (i64::from(image.width), i64::from(image.height));
    let fetch = |x: i64, y: i64| {
        let inside = (0..width).contains(&x) && (0..height).contains(&y);
        let (x, y) = match wrap {
            _ if inside => (x, y),
            Wrap::Black => return [0.0; C],
            Wrap::Repeat => (x.rem_euclid(width), y.rem_euclid(height)),
            Wrap::Clamp => (x.clamp(0, width - 1), y.clamp(0, height - 1)),
            Wrap::Octahedral => {
                // An edge of the octahedral square is glued to itself, turned over about its middle.
                let (x, y) = if (0..width).contains(&x) { (x, y) } else { (beyond(x, width), height - 1 - y) };
                let (x, y) = if (0..height).contains(&y) { (x, y) } else { (width - 1 - x, beyond(y, height)) };
                (x.clamp(0, width - 1), y.clamp(0, height - 1))
            }
        };
        texel((y * width + x) as usize)
    };
    let (x, y) = (st.x * width as f32, (1.0 - st.y) * height as f32);
    if !bilinear {
        return fetch(x.floor() as i64, y.floor() as i64);
    }
    let (x, y) = (x - 0.5, y - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let (dx, dy) = (x - x0, y - y0);
    let (i, j) = (x0 as i64, y0 as i64);
    let corners = [
        (fetch(i, j), (1.0 - dx) * (1.0 - dy)),
        (fetch(i.saturating_add(1), j), dx * (1.0 - dy)),
        (fetch(i, j.saturating_add(1)), (1.0 - dx) * dy),
        (fetch(i.saturating_add(1), j.saturating_add(1)), dx * dy),
    ];
    std::array::from_fn(|c| corners.iter().map(|(v, w)| v[c] * w).sum())
}

#[cfg(test)]
mod tests;
