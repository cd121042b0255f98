//! Spectra in parameters: `rgb`, `blackbody`, inline samples, names of standard spectra, `.spd` files.

use moonmilk_core::Spectra;
use moonmilk_core::color_space::{ColorSpace, into_gamut};
use moonmilk_core::named::NAMES;
use moonmilk_render::description::SpectrumDescription;

use super::context::Context;
use super::lexer::Spot;
use super::number;
use super::params::{Param, Params, SPECTRUM, Type, Values};
use super::suggest::nearest;

/// What a spectrum stands for; it decides which values are allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// A reflectance or albedo: rgb values within \[0, 1\].
    Albedo,
    /// A coefficient or index: not negative.
    Unbounded,
    /// An emission: not negative.
    Illuminant,
}

/// The spectrum of parameter `name`, if given.
pub(crate) fn spectrum(
    cx: &mut Context,
    params: &mut Params,
    name: &'static str,
    role: Role,
) -> Option<SpectrumDescription> {
    let param = params.find(name, SPECTRUM)?.clone();
    describe(cx, &param, role)
}

/// The spectrum that a parameter of type `rgb`, `blackbody` or `spectrum` gives; `None` after recording an error.
pub(crate) fn describe(cx: &mut Context, param: &Param, role: Role) -> Option<SpectrumDescription> {
    let name = &param.name;
    match (&param.values, param.ty) {
        (Values::Floats(v), Type::Rgb) => {
            let Ok(rgb) = <[f32; 3]>::try_from(v.as_slice()) else {
                cx.error(param.spot, format!("an rgb value is 3 numbers, {} given", v.len()));
                return None;
            };
            if rgb.iter().any(|&c| c < 0.0) {
                cx.error(param.value, format!("`{name}` has a negative component"));
                return None;
            }
            if role == Role::Albedo && rgb.iter().any(|&c| c > 1.0) {
                cx.error(param.value, format!("`{name}` is an albedo; its components must be within [0, 1]"));
                return None;
            }
            Some(SpectrumDescription::Rgb(to_srgb(cx, rgb, param.color_space, role, param.value)))
        }
        (Values::Floats(v), Type::Blackbody) => match v.as_slice() {
            [kelvin] if *kelvin > 0.0 => Some(SpectrumDescription::Blackbody(*kelvin)),
            [kelvin] => {
                cx.error(param.value, format!("temperature = {kelvin} is outside (0, inf) kelvin"));
                None
            }
            [_, _] => {
                cx.error_help(
                    param.spot,
                    "a blackbody value is 1 number, 2 given",
                    "pbrt-v3 syntax: move the factor to `float scale`",
                );
                None
            }
            _ => {
                cx.error(param.spot, format!("a blackbody value is 1 number, {} given", v.len()));
                None
            }
        },
        (Values::Floats(v), _) => samples(cx, v, param.spot, &format!("`{name}`")).map(SpectrumDescription::Sampled),
        (Values::Strings(names), _) => match names.as_slice() {
            [one] => named_or_file(cx, one, param.value),
            _ => {
                cx.error(param.spot, format!("`{name}` takes one name or file, {} given", names.len()));
                None
            }
        },
        _ => None,
    }
}

/// A colour of some space in linear sRGB; one that sRGB lacks is desaturated, with a warning.
fn to_srgb(cx: &mut Context, rgb: [f32; 3], space: ColorSpace, role: Role, spot: Spot) -> [f32; 3] {
    if space == ColorSpace::Srgb {
        return rgb;
    }
    let (converted, most) = match role {
        Role::Illuminant => (space.light_to_srgb(rgb), f32::INFINITY),
        // A texture's colour may turn out to be an albedo: what was within [0, 1] stays within it.
        Role::Unbounded if rgb.iter().any(|&c| c > 1.0) => (space.reflectance_to_srgb(rgb), f32::INFINITY),
        Role::Unbounded | Role::Albedo => (space.reflectance_to_srgb(rgb), 1.0),
    };
    let (inside, changed) = into_gamut(converted, most);
    if changed {
        let [r, g, b] = rgb;
        let message = format!(
            "colour ({r} {g} {b}) of {} lies outside sRGB: it is desaturated at constant luminance to ({:.4} {:.4} {:.4})",
            space.name(),
            inside[0],
            inside[1],
            inside[2]
        );
        cx.warn(spot, message);
    }
    inside
}

/// The light that a colour space calls white: the default of pbrt's lights.
pub(crate) fn white(space: ColorSpace) -> SpectrumDescription {
    SpectrumDescription::Rgb(into_gamut(space.light_to_srgb([1.0; 3]), f32::INFINITY).0)
}

fn samples(cx: &mut Context, values: &[f32], spot: Spot, what: &str) -> Option<Vec<(f32, f32)>> {
    if values.is_empty() || !values.len().is_multiple_of(2) {
        cx.error(spot, format!("{what} takes pairs of wavelength [nm] and value, {} numbers given", values.len()));
        return None;
    }
    let pairs: Vec<(f32, f32)> = values.chunks_exact(2).map(|p| (p[0], p[1])).collect();
    if let Some(w) = pairs.windows(2).find(|w| w[1].0 <= w[0].0) {
        cx.error(spot, format!("{what}: wavelengths must increase, {} nm follows {} nm", w[1].0, w[0].0));
        return None;
    }
    if let Some(pair) = pairs.iter().find(|p| p.1 < 0.0) {
        cx.error(spot, format!("{what}: the value at {} nm is negative", pair.0));
        return None;
    }
    Some(pairs)
}

fn named_or_file(cx: &mut Context, name: &str, spot: Spot) -> Option<SpectrumDescription> {
    if Spectra::named(name).is_ok() {
        return Some(SpectrumDescription::Named(name.to_owned()));
    }
    // pbrt takes any other word for a file name; one without a suffix or folder was surely meant as a name.
    if !name.contains(['.', '/', '\\']) {
        let near = nearest(name, NAMES).map(|n| format!("did you mean `{n}`? ")).unwrap_or_default();
        cx.error_help(
            spot,
            format!("`{name}` is no standard spectrum"),
            format!("{near}accepted: {}, or a .spd file", NAMES.join(", ")),
        );
        return None;
    }
    let bytes = cx.fetch(name, Some(spot))?;
    let values = match read_spd(&bytes) {
        Ok(values) => values,
        Err(line) => {
            cx.error(spot, format!("{name}:{line}: a number is expected"));
            return None;
        }
    };
    samples(cx, &values, spot, name).map(SpectrumDescription::Sampled)
}

/// The numbers of a `.spd` file: blank-separated, `#` starts a comment. `Err`: the line of the first other word.
pub(crate) fn read_spd(bytes: &[u8]) -> Result<Vec<f32>, usize> {
    let mut out = Vec::new();
    for (i, line) in bytes.split(|&b| b == b'\n').enumerate() {
        let line = line.split(|&b| b == b'#').next().unwrap_or_default();
        for word in line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()) {
            match number::float(word) {
                Some((value, used)) if used == word.len() && (value as f32).is_finite() => out.push(value as f32),
                _ => return Err(i + 1),
            }
        }
    }
    Ok(out)
}
