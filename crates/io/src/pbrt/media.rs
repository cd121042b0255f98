//! `MakeNamedMedium`.

use moonmilk_render::description::{MediumDescription, MediumKind, SpectrumDescription};

use super::context::Context;
use super::named_media;
use super::params::{Params, Type, did_you_mean};
use super::spectra::{self, Role};

const KINDS: [&str; 5] = ["homogeneous", "uniformgrid", "rgbgrid", "cloud", "nanovdb"];

/// pbrt's default absorption and scattering coefficients [1/mm], those of whole milk [Jensen2001].
pub(crate) const DEFAULT_COEFFICIENTS: ([f32; 3], [f32; 3]) = ([0.0011, 0.0024, 0.014], [2.55, 3.21, 3.77]);

/// The medium of a `MakeNamedMedium`; an unusable one becomes vacuum after its error was recorded.
pub(crate) fn medium(cx: &mut Context, name: String, mut params: Params) -> MediumDescription {
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
        Some("homogeneous") => homogeneous(cx, params, 1.0),
        Some(kind @ ("uniformgrid" | "rgbgrid")) => {
            let density = mean_density(&mut params, kind);
            cx.warn(params.spot, format!("media of type `{kind}` are not supported yet: `{name}` is homogeneous with the mean of its coefficients"));
            grid(cx, params, kind, density)
        }
        Some(kind) => {
            cx.warn(params.spot, format!("media of type `{kind}` are not supported yet: `{name}` is vacuum"));
            vacuum()
        }
        None => vacuum(),
    };
    MediumDescription { name, place, kind }
}

fn vacuum() -> MediumKind {
    let zero = SpectrumDescription::Constant(0.0);
    MediumKind::Homogeneous { sigma_a: zero.clone(), sigma_s: zero, scale: 0.0, g: 0.0, emission: None }
}

fn homogeneous(cx: &mut Context, mut params: Params, density: f32) -> MediumKind {
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
    let scale = params.float_in(cx, "scale", 1.0, |s| s >= 0.0, "[0, inf)") * density;
    let g = params.float_in(cx, "g", 0.0, |g| g > -1.0 && g < 1.0, "(-1, 1)");
    let emission = spectra::spectrum(cx, &mut params, "Le", Role::Illuminant);
    let emission_scale = if emission.is_some() { params.float(cx, "Lescale", 1.0) } else { 1.0 };
    params.ignore(&[("Lescale", &[Type::Float])]);
    params.finish(cx);
    MediumKind::Homogeneous { sigma_a, sigma_s, scale, g, emission: emission.map(|e| (e, emission_scale)) }
}

/// Mean of the grid of densities, 1 without one.
fn mean_density(params: &mut Params, kind: &str) -> f32 {
    match (kind, params.floats("density", &[Type::Float])) {
        ("uniformgrid", Some((values, _))) if !values.is_empty() => {
            (values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64) as f32
        }
        _ => 1.0,
    }
}

/// A homogeneous stand-in; emission of grids is left out.
fn grid(cx: &mut Context, mut params: Params, kind: &str, density: f32) -> MediumKind {
    use Type::{Float, Integer, Point3, Rgb};
    params.ignore(&[("nx", &[Integer]), ("ny", &[Integer]), ("nz", &[Integer]), ("p0", &[Point3]), ("p1", &[Point3])]);
    params.ignore(&[
        ("temperature", &[Float]),
        ("temperatureoffset", &[Float]),
        ("temperaturescale", &[Float]),
        ("temperaturecutoff", &[Float]),
    ]);
    // The emission is left out; its values are not even looked at.
    params.drop("Le");
    params.drop("Lescale");
    params.ignore(&[("density", &[Float, Rgb])]);
    if kind == "rgbgrid" {
        let mut mean = |name: &'static str| {
            params.floats(name, &[Rgb]).filter(|(v, _)| v.len() >= 3).map(|(v, _)| {
                let n = (v.len() / 3) as f32;
                v.chunks_exact(3).fold([0.0; 3], |sum, c| [sum[0] + c[0] / n, sum[1] + c[1] / n, sum[2] + c[2] / n])
            })
        };
        let (a, s) = (mean("sigma_a").unwrap_or([1.0; 3]), mean("sigma_s").unwrap_or([1.0; 3]));
        let scale = params.float(cx, "scale", 1.0);
        let g = params.float_in(cx, "g", 0.0, |g| g > -1.0 && g < 1.0, "(-1, 1)");
        return MediumKind::Homogeneous {
            sigma_a: SpectrumDescription::Rgb(a),
            sigma_s: SpectrumDescription::Rgb(s),
            scale,
            g,
            emission: None,
        };
    }
    homogeneous(cx, params, density)
}
