//! `LightSource` and `AreaLightSource`.
//!
//! pbrt's `power` and `illuminance` are resolved into `scale` wherever they do not need the scene's geometry. Its rule that a
//! light's spectrum is divided by its luminance (so that `L` of any spectral shape and `scale` 1 means one nit) is left to the
//! renderer: it applies to every emission in the description that is not `Rgb`.

use moonmilk_core::Vec3;
use moonmilk_core::glam::{DMat4, DVec3, DVec4};
use moonmilk_render::description::{
    AreaLightDescription, ImageDescription, ImageId, LightDescription, LightKind, MediumId,
};

use super::context::Context;
use super::images::Images;
use super::lexer::Spot;
use super::params::{Params, Type, did_you_mean};
use super::spectra::{Role, spectrum, white};

const KINDS: [&str; 6] = ["distant", "goniometric", "infinite", "point", "projection", "spot"];

use std::f32::consts::PI;

/// The light of a `LightSource`; `None` after an error.
pub(crate) fn light(
    cx: &mut Context,
    images: &mut Images,
    kind: &str,
    at: Spot,
    mut p: Params,
    to_world: DMat4,
    medium: Option<MediumId>,
) -> Option<LightDescription> {
    let place = cx.place(p.spot);
    let mut scale = p.float(cx, "scale", 1.0);
    let mut placement = to_world;
    let (mut power, mut portal) = (None, None);
    let kind = match kind {
        "point" => {
            let intensity = spectrum(cx, &mut p, "I", Role::Illuminant).unwrap_or_else(|| white(p.color_space));
            scale *= target(cx, &mut p, "power", 4.0 * PI);
            let from = p.vec3(cx, "from", &[Type::Point3], Vec3::ZERO);
            LightKind::Point { from, intensity }
        }
        "spot" => {
            let intensity = spectrum(cx, &mut p, "I", Role::Illuminant).unwrap_or_else(|| white(p.color_space));
            let cone_angle = p.float_in(cx, "coneangle", 30.0, |a| a > 0.0 && a <= 180.0, "(0, 180] degrees");
            let cone_delta_angle = p.float_in(cx, "conedeltaangle", 5.0, |a| a >= 0.0, "[0, inf) degrees");
            scale *= target(cx, &mut p, "power", spot_solid_angle(cone_angle, cone_delta_angle));
            let from = p.vec3(cx, "from", &[Type::Point3], Vec3::ZERO);
            let to = p.vec3(cx, "to", &[Type::Point3], Vec3::Z);
            distinct(cx, &p, from, to);
            LightKind::Spot { from, to, intensity, cone_angle, cone_delta_angle }
        }
        "distant" => {
            let irradiance = spectrum(cx, &mut p, "L", Role::Illuminant).unwrap_or_else(|| white(p.color_space));
            scale *= target(cx, &mut p, "illuminance", 1.0);
            let from = p.vec3(cx, "from", &[Type::Point3], Vec3::ZERO);
            let to = p.vec3(cx, "to", &[Type::Point3], Vec3::Z);
            distinct(cx, &p, from, to);
            LightKind::Distant { from, to, irradiance }
        }
        "infinite" => {
            portal = corners(cx, &mut p)?;
            infinite(cx, images, &mut p, &mut scale)?
        }
        "goniometric" => {
            let intensity = spectrum(cx, &mut p, "I", Role::Illuminant).unwrap_or_else(|| white(p.color_space));
            power = p.float_or_none(cx, "power").filter(|&power| power > 0.0);
            // pbrt exchanges y and z of the light: the middle of the picture is up.
            placement = to_world * DMat4::from_cols(DVec4::X, DVec4::Z, DVec4::Y, DVec4::W);
            match p.string(cx, "filename").filter(|(path, _)| !path.is_empty()) {
                None => {
                    cx.warn(p.spot, "a goniometric light without `filename` shines equally in all directions");
                    LightKind::Point { from: Vec3::ZERO, intensity }
                }
                Some((path, spot)) => {
                    let image = images.load(cx, &path, spot, "sRGB")?;
                    square(cx, images, image, &path, spot, "a goniometric light")?;
                    LightKind::Goniometric { intensity, image }
                }
            }
        }
        "projection" => {
            let fov = p.float_in(cx, "fov", 90.0, |a| a > 0.0 && a < 180.0, "(0, 180) degrees");
            power = p.float_or_none(cx, "power").filter(|&power| power > 0.0);
            // pbrt mirrors y, so that the picture stands upright where y is up.
            placement = to_world * DMat4::from_scale(DVec3::new(1.0, -1.0, 1.0));
            let Some((path, spot)) = p.string(cx, "filename").filter(|(path, _)| !path.is_empty()) else {
                cx.error(p.spot, "a projection light needs `string filename`");
                return None;
            };
            LightKind::Projection { image: images.load(cx, &path, spot, "sRGB")?, fov }
        }
        _ => {
            cx.error_help(at, format!("`{kind}` is no type of light"), did_you_mean(kind, &KINDS, "accepted"));
            return None;
        }
    };
    p.finish(cx);
    if !placement.is_finite() {
        placement = DMat4::IDENTITY;
    }
    Some(LightDescription { place, light_to_world: placement.as_mat4(), scale, power, kind, medium, portal })
}

fn distinct(cx: &mut Context, p: &Params, from: Vec3, to: Vec3) {
    if from == to {
        let spot = p.spot_of("to");
        cx.error(spot, "`from` and `to` are the same point");
    }
}

/// Factor that makes a light of unit luminance emit the power (or illuminance) asked for; 1 if nothing is asked for.
fn target(cx: &mut Context, p: &mut Params, name: &'static str, of_unit: f32) -> f32 {
    match p.float_or_none(cx, name) {
        Some(value) if value > 0.0 => value / of_unit,
        _ => 1.0,
    }
}

/// Integral of pbrt's spot profile over directions: the cone inside the soft edge plus half of the edge.
fn spot_solid_angle(cone_angle: f32, delta: f32) -> f32 {
    let (end, start) = (cone_angle.to_radians().cos(), (cone_angle - delta).to_radians().cos());
    2.0 * PI * ((1.0 - start) + (start - end) / 2.0)
}

/// The corners of a portal, in world space whatever transform is in force, as pbrt; `None` after an error.
fn corners(cx: &mut Context, p: &mut Params) -> Option<Option<[Vec3; 4]>> {
    let Some((points, spot)) = p.vec3s(cx, "portal", &[Type::Point3]) else {
        return Some(None);
    };
    let found = <[Vec3; 4]>::try_from(points.as_slice());
    if found.is_err() {
        cx.error(spot, format!("`portal` takes 4 points, {} given", points.len()));
    }
    found.ok().map(Some)
}

fn infinite(cx: &mut Context, images: &mut Images, p: &mut Params, scale: &mut f32) -> Option<LightKind> {
    let radiance = spectrum(cx, p, "L", Role::Illuminant);
    let file = p.string(cx, "filename").filter(|(path, _)| !path.is_empty());
    let Some((path, spot)) = file else {
        *scale *= target(cx, p, "illuminance", PI);
        return Some(LightKind::Constant { radiance: radiance.unwrap_or_else(|| white(p.color_space)) });
    };
    if radiance.is_some() {
        let spot = p.spot_of("L");
        cx.error(spot, "an infinite light takes either `L` or `filename`, not both");
    }
    let image = images.load(cx, &path, spot, "sRGB")?;
    square(cx, images, image, &path, spot, "an infinite light")?;
    let picture = &images.list[image];
    *scale *= target(cx, p, "illuminance", upper_illuminance(picture));
    Some(LightKind::Environment { image })
}

/// Checks that a picture of directions is square; `None` after an error.
fn square(cx: &mut Context, images: &Images, image: ImageId, path: &str, spot: Spot, what: &str) -> Option<()> {
    let (w, h) = (images.list[image].width, images.list[image].height);
    if w != h {
        cx.error_help(
            spot,
            format!("{path}: {w} x {h} pixels, but {what} takes a square picture"),
            "pbrt-v4 uses the equal-area octahedral map; `imgtool makeequiarea` converts latitude-longitude pictures",
        );
        return None;
    }
    Some(())
}

/// Illuminance of a horizontal plane under an equal-area picture: the luminance integrated against the cosine over z > 0.
fn upper_illuminance(picture: &ImageDescription) -> f32 {
    let n = picture.width;
    let mut sum = 0.0f64;
    for (i, rgb) in picture.rgb.iter().enumerate() {
        let (x, y) = (i as u32 % n, i as u32 / n);
        let z = octahedral_z((x as f32 + 0.5) / n as f32, (y as f32 + 0.5) / n as f32);
        if z > 0.0 {
            // Rec. 709 luminance.
            sum += f64::from(z)
                * (0.212_639 * f64::from(rgb[0]) + 0.715_169 * f64::from(rgb[1]) + 0.072_192 * f64::from(rgb[2]));
        }
    }
    // Every texel has the solid angle 4 pi / n^2. pbrt multiplies by 2 pi / n^2 here; its result must be met, not corrected.
    (sum * 2.0 * std::f64::consts::PI / (f64::from(n) * f64::from(n))) as f32
}

/// z of the direction at (u, v) of the equal-area octahedral map [Clarberg2008].
fn octahedral_z(u: f32, v: f32) -> f32 {
    let (u, v) = ((2.0 * u - 1.0).abs(), (2.0 * v - 1.0).abs());
    let distance = 1.0 - (u + v);
    let r = 1.0 - distance.abs();
    (1.0 - r * r).copysign(distance)
}

/// The emission of an `AreaLightSource`; `None` after an error.
pub(crate) fn area_light(
    cx: &mut Context,
    images: &mut Images,
    kind: &str,
    at: Spot,
    mut p: Params,
) -> Option<AreaLightDescription> {
    if kind != "diffuse" {
        let help = if kind == "area" {
            "pbrt-v3 syntax: write `diffuse`".to_owned()
        } else {
            did_you_mean(kind, &["diffuse"], "accepted")
        };
        cx.error_help(at, format!("`{kind}` is no type of area light"), help);
        return None;
    }
    let place = cx.place(p.spot);
    let given = spectrum(cx, &mut p, "L", Role::Illuminant);
    let image = p
        .string(cx, "filename")
        .filter(|(path, _)| !path.is_empty())
        .and_then(|(path, spot)| images.load(cx, &path, spot, "sRGB"));
    if given.is_some() && image.is_some() {
        let spot = p.spot_of("L");
        cx.error(spot, "an area light takes either `L` or `filename`, not both");
    }
    let light = AreaLightDescription {
        place,
        radiance: given.unwrap_or_else(|| white(p.color_space)),
        scale: p.float(cx, "scale", 1.0),
        two_sided: p.bool(cx, "twosided", false),
        power: p.float_or_none(cx, "power").filter(|&power| power > 0.0),
        image,
    };
    p.finish(cx);
    Some(light)
}
