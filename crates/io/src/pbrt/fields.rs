//! Media of `MakeNamedMedium` whose coefficients depend on the place: `uniformgrid`, `rgbgrid`, `cloud`.

use moonmilk_core::{Mat4, Vec3};
use moonmilk_render::description::{
    CloudDescription, ColourGrid, DensityGrid, FieldBox, FieldFault, GridEmission, MediumKind, SpectrumDescription,
};

use super::context::Context;
use super::params::{Params, Type};
use super::spectra::{self, Role};

/// The box of a field, p0 = (0, 0, 0) and p1 = (1, 1, 1) by default.
fn bounds(cx: &mut Context, params: &mut Params, medium_to_world: Mat4) -> FieldBox {
    let p0 = params.vec3(cx, "p0", &[Type::Point3], Vec3::ZERO);
    let p1 = params.vec3(cx, "p1", &[Type::Point3], Vec3::ONE);
    FieldBox { medium_to_world, p0, p1 }
}

fn size(cx: &mut Context, params: &mut Params) -> [u32; 3] {
    ["nx", "ny", "nz"].map(|name| params.integer(cx, name, 1, 1))
}

fn coefficient(cx: &mut Context, params: &mut Params, name: &'static str) -> SpectrumDescription {
    spectra::spectrum(cx, params, name, Role::Unbounded).unwrap_or(SpectrumDescription::Constant(1.0))
}

fn numbers(params: &mut Params, name: &'static str) -> Vec<f32> {
    params.floats(name, &[Type::Float]).map_or_else(Vec::new, |(values, _)| values)
}

fn colours(cx: &mut Context, params: &mut Params, name: &'static str) -> Vec<[f32; 3]> {
    let Some((values, spot)) = params.floats(name, &[Type::Rgb]) else { return Vec::new() };
    if values.len() % 3 != 0 {
        cx.error(spot, format!("`{name}` takes triples of numbers, {} given", values.len()));
        return Vec::new();
    }
    values.as_chunks::<3>().0.to_vec()
}

/// Completes a medium: reports what is wrong with it, at the parameter that says so, and what nobody asked for.
/// `before` is the number of problems before it.
fn finish(
    cx: &mut Context,
    params: Params,
    kind: MediumKind,
    fault: Result<(), FieldFault>,
    before: usize,
) -> Option<MediumKind> {
    let place = fault.as_ref().err().map(|f| params.spot_of(f.parameter));
    params.finish(cx);
    match (fault, place) {
        (Err(fault), Some(spot)) => {
            // A value that was no good is missing as well: one error says enough.
            if cx.problems.len() == before {
                cx.error(spot, fault.reason);
            }
            None
        }
        _ => Some(kind),
    }
}

/// A `uniformgrid`; `None` after an error.
pub(crate) fn uniform_grid(cx: &mut Context, mut params: Params, medium_to_world: Mat4) -> Option<MediumKind> {
    let before = cx.problems.len();
    let size = size(cx, &mut params);
    let density = numbers(&mut params, "density");
    let temperature = numbers(&mut params, "temperature");
    let le = spectra::spectrum(cx, &mut params, "Le", Role::Illuminant);
    if le.is_some() && !temperature.is_empty() {
        let spot = params.spot_of("temperature");
        cx.error(spot, "`Le` and `temperature` exclude each other");
    }
    // pbrt accepts both names; the first wins.
    let cutoff = params.float(cx, "temperaturecutoff", 0.0);
    let offset = params.float(cx, "temperatureoffset", cutoff);
    let scale = params.float(cx, "temperaturescale", 1.0);
    let emission = match le {
        Some(spectrum) => GridEmission::Spectrum(spectrum),
        None if temperature.is_empty() => GridEmission::None,
        None => GridEmission::Temperature { values: temperature, offset, scale },
    };
    let grid = DensityGrid {
        bounds: bounds(cx, &mut params, medium_to_world),
        size,
        density,
        sigma_a: coefficient(cx, &mut params, "sigma_a"),
        sigma_s: coefficient(cx, &mut params, "sigma_s"),
        scale: params.float(cx, "scale", 1.0),
        g: params.float(cx, "g", 0.0),
        emission,
        emission_scale: numbers(&mut params, "Lescale"),
    };
    let fault = grid.check();
    finish(cx, params, MediumKind::Densities(Box::new(grid)), fault, before)
}

/// An `rgbgrid`; `None` after an error.
pub(crate) fn rgb_grid(cx: &mut Context, mut params: Params, medium_to_world: Mat4) -> Option<MediumKind> {
    let before = cx.problems.len();
    let grid = ColourGrid {
        size: size(cx, &mut params),
        sigma_a: colours(cx, &mut params, "sigma_a"),
        sigma_s: colours(cx, &mut params, "sigma_s"),
        emission: colours(cx, &mut params, "Le"),
        emission_scale: params.float(cx, "Lescale", 1.0),
        scale: params.float(cx, "scale", 1.0),
        g: params.float(cx, "g", 0.0),
        bounds: bounds(cx, &mut params, medium_to_world),
    };
    let fault = grid.check();
    finish(cx, params, MediumKind::Colours(Box::new(grid)), fault, before)
}

/// A `cloud`; `None` after an error.
pub(crate) fn cloud(cx: &mut Context, mut params: Params, medium_to_world: Mat4) -> Option<MediumKind> {
    let before = cx.problems.len();
    let cloud = CloudDescription {
        bounds: bounds(cx, &mut params, medium_to_world),
        sigma_a: coefficient(cx, &mut params, "sigma_a"),
        sigma_s: coefficient(cx, &mut params, "sigma_s"),
        g: params.float(cx, "g", 0.0),
        density: params.float(cx, "density", 1.0),
        wispiness: params.float(cx, "wispiness", 1.0),
        frequency: params.float(cx, "frequency", 5.0),
    };
    let fault = cloud.check();
    finish(cx, params, MediumKind::Cloud(Box::new(cloud)), fault, before)
}
