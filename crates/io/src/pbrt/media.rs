//! `MakeNamedMedium`.

use moonmilk_core::Mat4;
use moonmilk_render::description::{MediumDescription, MediumKind, SpectrumDescription};

use super::context::Context;
use super::fields;
use super::named_media;
use super::params::{Params, Type, did_you_mean};
use super::spectra::{self, Role};

const KINDS: [&str; 5] = ["homogeneous", "uniformgrid", "rgbgrid", "cloud", "nanovdb"];

/// pbrt's default absorption and scattering coefficients [1/mm], those of whole milk [Jensen2001].
pub(crate) const DEFAULT_COEFFICIENTS: ([f32; 3], [f32; 3]) = ([0.0011, 0.0024, 0.014], [2.55, 3.21, 3.77]);

/// The medium of a `MakeNamedMedium`; an unusable one becomes vacuum after its error was recorded.
pub(crate) fn medium(cx: &mut Context, name: String, mut params: Params, medium_to_world: Mat4) -> MediumDescription {
    let place = cx.place(params.spot);
    let kind = match params.string(cx, "type") {
        None => {
            if !params.has("type") {
                cx.error_help(
                    params.spot,
                    format!("medium `{name}` needs `string type`"),
                    format!("accepted: {}", KINDS.join(", ")),
                );
            }
            None
        }
        Some((kind, spot)) if !KINDS.contains(&kind.as_str()) => {
            let help = if kind == "heterogeneous" {
                "pbrt-v3 syntax: write `uniformgrid`".to_owned()
            } else {
                did_you_mean(&kind, &KINDS, "accepted")
            };
            cx.error_help(spot, format!("`{kind}` is no type of medium"), help);
            None
        }
        Some((kind, _)) => Some(kind),
    };
    let kind = match kind.as_deref() {
        Some("homogeneous") => Some(homogeneous(cx, params)),
        Some("uniformgrid") => fields::uniform_grid(cx, params, medium_to_world),
        Some("rgbgrid") => fields::rgb_grid(cx, params, medium_to_world),
        Some("cloud") => fields::cloud(cx, params, medium_to_world),
        Some(_) => {
            cx.error_help(
                params.spot,
                format!("medium `{name}` is a NanoVDB file, which cannot be read: no maintained reader in Rust exists"),
                "convert the grid into a `uniformgrid` with `float density`",
            );
            None
        }
        None => None,
    };
    let kind = kind.unwrap_or_else(vacuum);
    MediumDescription { name, place, kind }
}

fn vacuum() -> MediumKind {
    let zero = SpectrumDescription::Constant(0.0);
    MediumKind::Homogeneous { sigma_a: zero.clone(), sigma_s: zero, scale: 0.0, g: 0.0, emission: None }
}

fn homogeneous(cx: &mut Context, mut params: Params) -> MediumKind {
    let mut preset = None;
    if let Some((name, spot)) = params.string(cx, "preset").filter(|(name, _)| !name.is_empty()) {
        preset = named_media::find(&name);
        if preset.is_none() {
            let help = did_you_mean(&name, &named_media::names(), "accepted");
            cx.error_help(spot, format!("`{name}` is no named medium"), help);
        }
    }
    let given_a = spectra::spectrum(cx, &mut params, "sigma_a", Role::Unbounded);
    let given_s = spectra::spectrum(cx, &mut params, "sigma_s", Role::Unbounded);
    let (sigma_a, sigma_s) = match preset {
        Some((a, s)) => (SpectrumDescription::Rgb(a), SpectrumDescription::Rgb(s)),
        None => (
            given_a.unwrap_or(SpectrumDescription::Rgb(DEFAULT_COEFFICIENTS.0)),
            given_s.unwrap_or(SpectrumDescription::Rgb(DEFAULT_COEFFICIENTS.1)),
        ),
    };
    let scale = params.float_in(cx, "scale", 1.0, |s| s >= 0.0, "[0, inf)");
    let g = params.float_in(cx, "g", 0.0, |g| g > -1.0 && g < 1.0, "(-1, 1)");
    let emission = spectra::spectrum(cx, &mut params, "Le", Role::Illuminant);
    let emission_scale = if emission.is_some() { params.float(cx, "Lescale", 1.0) } else { 1.0 };
    params.ignore(&[("Lescale", &[Type::Float])]);
    params.finish(cx);
    MediumKind::Homogeneous { sigma_a, sigma_s, scale, g, emission: emission.map(|e| (e, emission_scale)) }
}
