//! What stands above `WorldBegin`: camera, film, filter, sampler, integrator.

use moonmilk_core::glam::DMat4;
use moonmilk_core::{ColorSpace, Vec2};
use moonmilk_render::description::{
    CameraDescription, CameraKind, FilmDescription, FilterDescription, FilterKind, IntegratorDescription, MediumId,
    SamplerDescription,
};

use super::context::Context;
use super::lexer::Spot;
use super::params::{Params, Type, did_you_mean};
use super::spectra::read_spd;

/// A directive with a type: `Camera "perspective" ...`.
pub(crate) struct Entity {
    pub kind: String,
    pub at: Spot,
    pub params: Params,
}

fn unknown(cx: &mut Context, at: Spot, kind: &str, what: &str, accepted: &[&str], former: Option<&str>) {
    let help = match former {
        Some(now) => format!("pbrt-v3 syntax: write `{now}`"),
        None => did_you_mean(kind, accepted, "accepted"),
    };
    cx.error_help(at, format!("`{kind}` is no type of {what}"), help);
}

/// The camera, the time that its shutter is open [s], and the lens of a realistic camera, which needs the film ([`Lens::focus`]).
pub(crate) fn camera(
    cx: &mut Context,
    entity: Option<Entity>,
    world_to_camera: DMat4,
    medium: Option<MediumId>,
) -> (CameraDescription, f32, Option<Lens>) {
    let mut description = CameraDescription {
        kind: CameraKind::Perspective { fov: 90.0 },
        camera_to_world: world_to_camera.inverse().as_mat4(),
        medium,
        screen_window: None,
        frame_aspect_ratio: None,
        lens_radius: 0.0,
        focal_distance: 1e6,
    };
    let Some(Entity { kind, at, params: mut p }) = entity else {
        return (description, 1.0, None);
    };
    if world_to_camera.determinant() == 0.0 || !world_to_camera.inverse().is_finite() {
        cx.error(p.spot, "the transform in force at Camera has no inverse");
        description.camera_to_world = moonmilk_core::Mat4::IDENTITY;
    }
    let shutter = p.float(cx, "shutterclose", 1.0) - p.float(cx, "shutteropen", 0.0);
    if shutter <= 0.0 {
        cx.error(p.spot, "the shutter closes before it opens: the picture would be black");
    }
    let mut checked = true;
    let mut lens = None;
    match kind.as_str() {
        "perspective" => {
            let fov = p.float_in(cx, "fov", 90.0, |f| f > 0.0 && f < 180.0, "(0, 180) degrees");
            description.kind = CameraKind::Perspective { fov };
            projective(cx, &mut p, &mut description);
        }
        "orthographic" => {
            description.kind = CameraKind::Orthographic;
            projective(cx, &mut p, &mut description);
        }
        "spherical" => {
            let equal_area = p.choice(cx, "mapping", &["equalarea", "equirectangular"]) == "equalarea";
            description.kind = CameraKind::Spherical { equal_area };
            projective(cx, &mut p, &mut description);
        }
        "realistic" => lens = realistic(cx, &mut p, at),
        _ => {
            let former = (kind == "environment").then_some("spherical");
            unknown(cx, at, &kind, "camera", &["orthographic", "perspective", "realistic", "spherical"], former);
            checked = false;
        }
    }
    if checked {
        p.finish(cx);
    }
    (description, if shutter > 0.0 { shutter } else { 1.0 }, lens)
}

/// The thin lens that stands in for the lens system of a realistic camera; lengths in scene units, which are metres to pbrt.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lens {
    focal_length: f64,
    /// Distance in focus.
    distance: f64,
    /// Radius of the entrance.
    radius: f64,
}

impl Lens {
    /// Makes the camera see what the lens throws on a film of that diagonal [mm]: the picture lies at 1 / (1 / f - 1 / d) behind the lens.
    pub(crate) fn focus(&self, camera: &mut CameraDescription, film: &FilmDescription, diagonal: f32) {
        let image = 1.0 / (1.0 / self.focal_length - 1.0 / self.distance);
        let (w, h) = (f64::from(film.width), f64::from(film.height));
        let shorter = f64::from(diagonal) * 1e-3 * w.min(h) / w.hypot(h);
        let fov = 2.0 * (0.5 * shorter / image).atan();
        camera.kind = CameraKind::Perspective { fov: fov.to_degrees() as f32 };
        (camera.lens_radius, camera.focal_distance) = (self.radius as f32, self.distance as f32);
    }
}

/// A realistic camera: its lens system is read, and replaced by the thin lens of the same focal length.
fn realistic(cx: &mut Context, p: &mut Params, at: Spot) -> Option<Lens> {
    let distance = f64::from(p.float_in(cx, "focusdistance", 10.0, |d| d > 0.0, "(0, inf)"));
    let opening = f64::from(p.float_in(cx, "aperturediameter", 1.0, |d| d >= 0.0, "[0, inf) mm"));
    if let Some((shape, spot)) = p.string(cx, "aperture").filter(|(shape, _)| shape != "circular") {
        cx.warn(spot, format!("aperture `{shape}` is not supported: the aperture is circular"));
    }
    let Some((path, spot)) = p.string(cx, "lensfile") else {
        cx.error(p.spot, "a realistic camera needs `string lensfile`");
        return None;
    };
    let bytes = cx.fetch(&path, Some(spot))?;
    let rows = match read_spd(&bytes) {
        Ok(numbers) if numbers.len() >= 4 && numbers.len().is_multiple_of(4) => numbers,
        Ok(numbers) => {
            let reason = "rows of curvature radius, thickness, index and diameter are expected";
            cx.error(spot, format!("{path}: {} numbers; {reason}", numbers.len()));
            return None;
        }
        Err(line) => {
            cx.error(spot, format!("{path}:{line}: a number is expected"));
            return None;
        }
    };
    let Some((focal_length, stop)) = focal_length(&rows).filter(|(f, _)| *f * 1e-3 < distance) else {
        cx.error(spot, format!("{path}: this lens does not focus at `focusdistance` {distance}"));
        return None;
    };
    // The stop may not open farther than the lens file says.
    let radius = 0.5e-3 * opening.min(stop);
    cx.warn(
        at,
        format!(
            "realistic cameras are not supported: a thin lens of the same focal length, {focal_length:.1} mm, is used"
        ),
    );
    Some(Lens { focal_length: focal_length * 1e-3, distance, radius })
}

/// Focal length of a lens system and diameter of its stop [mm], from rows (curvature radius, thickness, index behind, diameter), front first.
///
/// A ray parallel to the axis at height 1 is followed in the paraxial approximation; it leaves with slope -1 / f. A radius of 0 marks the stop.
fn focal_length(rows: &[f32]) -> Option<(f64, f64)> {
    let (mut y, mut slope, mut index, mut stop) = (1.0f64, 0.0f64, 1.0f64, f64::INFINITY);
    for row in rows.chunks_exact(4) {
        let [radius, thickness, behind, diameter] = std::array::from_fn(|i| f64::from(row[i]));
        let behind = if behind == 0.0 { 1.0 } else { behind };
        if radius == 0.0 {
            stop = stop.min(diameter);
        } else {
            // n' u' = n u - y (n' - n) / R
            slope = (index * slope - y * (behind - index) / radius) / behind;
            index = behind;
        }
        y += slope * thickness;
    }
    let f = -1.0 / slope;
    (f.is_finite() && f > 0.0).then_some((f, stop))
}

fn projective(cx: &mut Context, p: &mut Params, camera: &mut CameraDescription) {
    camera.lens_radius = p.float_in(cx, "lensradius", 0.0, |r| r >= 0.0, "[0, inf)");
    camera.focal_distance = p.float_in(cx, "focaldistance", 1e6, |d| d > 0.0, "(0, inf)");
    let aspect = p.float_in(cx, "frameaspectratio", f32::NAN, |a| a > 0.0, "(0, inf)");
    camera.frame_aspect_ratio = (!aspect.is_nan()).then_some(aspect);
    if let Some((window, spot)) = p.floats("screenwindow", &[Type::Float]) {
        match <[f32; 4]>::try_from(window.as_slice()) {
            Ok(w) if w[0] != w[1] && w[2] != w[3] => camera.screen_window = Some(w),
            Ok(_) => cx.error(spot, "`screenwindow` is empty"),
            Err(_) => cx.error(spot, format!("`screenwindow` takes 4 numbers, {} given", window.len())),
        }
    }
}

/// Largest side of a picture [pixels].
const MAX_SIDE: u32 = 65_536;

/// The film and its diagonal [mm]; `shutter` is the exposure time.
pub(crate) fn film(cx: &mut Context, entity: Option<Entity>, shutter: f32) -> (FilmDescription, f32) {
    let mut film = FilmDescription {
        width: 1280,
        height: 720,
        crop: [0, 1280, 0, 720],
        filename: None,
        imaging_ratio: shutter,
        max_component_value: None,
    };
    let Some(Entity { kind, at, params: mut p }) = entity else {
        return (film, 35.0);
    };
    match kind.as_str() {
        "rgb" => {}
        "gbuffer" => p.ignore(&[("coordinatesystem", &[Type::String])]),
        "spectral" => {
            cx.warn(at, "spectral films are not supported yet: the picture is RGB");
            p.ignore(&[("nbuckets", &[Type::Integer]), ("lambdamin", &[Type::Float]), ("lambdamax", &[Type::Float])]);
        }
        _ => {
            unknown(cx, at, &kind, "film", &["rgb", "gbuffer", "spectral"], (kind == "image").then_some("rgb"));
            return (film, 35.0);
        }
    }
    film.filename = p.string(cx, "filename").map(|f| f.0).filter(|f| !f.is_empty());
    film.width = p.integer(cx, "xresolution", 1280, 1);
    film.height = p.integer(cx, "yresolution", 720, 1);
    for (name, side) in [("xresolution", film.width), ("yresolution", film.height)] {
        if side > MAX_SIDE {
            let spot = p.spot_of(name);
            cx.error(spot, format!("{name} = {side} is outside [1, {MAX_SIDE}]"));
            (film.width, film.height) = (film.width.min(MAX_SIDE), film.height.min(MAX_SIDE));
        }
    }
    film.crop = crop(cx, &mut p, film.width, film.height);
    let iso = p.float_in(cx, "iso", 100.0, |x| x > 0.0, "(0, inf)");
    let exposure = p.float_in(cx, "exposuretime", 1.0, |x| x > 0.0, "(0, inf)");
    film.imaging_ratio = shutter * exposure * iso / 100.0;
    film.max_component_value = p.float_or_none(cx, "maxcomponentvalue");
    if film.max_component_value.is_some() {
        let spot = p.spot_of("maxcomponentvalue");
        cx.warn(spot, "`maxcomponentvalue` is not applied: cutting bright samples would darken the picture");
    }
    if let Some((sensor, spot)) = p.string(cx, "sensor").filter(|(s, _)| s != "cie1931") {
        cx.warn(spot, format!("sensor `{sensor}` is not supported yet: the CIE 1931 observer is used"));
    }
    if p.float(cx, "whitebalance", 0.0) != 0.0 {
        let spot = p.spot_of("whitebalance");
        cx.warn(spot, "white balance is not supported yet: the picture keeps the colour of its light");
    }
    if p.color_space != ColorSpace::Srgb {
        let message = format!("the picture is written in linear sRGB, not in {}", p.color_space.name());
        cx.warn(p.spot, message);
    }
    let diagonal = p.float_in(cx, "diagonal", 35.0, |d| d > 0.0, "(0, inf) mm");
    p.ignore(&[("savefp16", &[Type::Bool])]);
    p.finish(cx);
    (film, diagonal)
}

/// Pixels to render from `pixelbounds` or `cropwindow`; the latter wins, as in pbrt.
fn crop(cx: &mut Context, p: &mut Params, width: u32, height: u32) -> [u32; 4] {
    let mut crop = [0, width, 0, height];
    let bounds = p.integers("pixelbounds");
    let window = p.floats("cropwindow", &[Type::Float]);
    let mut spot = p.spot;
    if let Some((b, at)) = bounds {
        spot = at;
        match <[i32; 4]>::try_from(b.as_slice()) {
            Ok(b) => {
                let clamp = |v: i32, most: u32| u32::try_from(v.max(0)).unwrap_or(0).min(most);
                crop = [clamp(b[0], width), clamp(b[1], width), clamp(b[2], height), clamp(b[3], height)];
                if b[0] < 0 || b[2] < 0 || i64::from(b[1]) > i64::from(width) || i64::from(b[3]) > i64::from(height) {
                    cx.warn(at, "`pixelbounds` reaches beyond the picture: it is cut there");
                }
                if window.is_some() {
                    cx.warn(at, "`pixelbounds` is not used: `cropwindow` wins");
                }
            }
            Err(_) => cx.error(at, format!("`pixelbounds` takes 4 integers, {} given", b.len())),
        }
    }
    if let Some((w, at)) = window {
        spot = at;
        match <[f32; 4]>::try_from(w.as_slice()) {
            Ok(w) => {
                let edge = |a: f32, side: u32| (side as f32 * a.clamp(0.0, 1.0)).ceil() as u32;
                crop = [
                    edge(w[0].min(w[1]), width),
                    edge(w[0].max(w[1]), width),
                    edge(w[2].min(w[3]), height),
                    edge(w[2].max(w[3]), height),
                ];
            }
            Err(_) => cx.error(at, format!("`cropwindow` takes 4 numbers, {} given", w.len())),
        }
    }
    if crop[0] >= crop[1] || crop[2] >= crop[3] {
        cx.error(spot, "no pixel is left to render");
        return [0, width, 0, height];
    }
    crop
}

/// The filter with pbrt's defaults.
pub(crate) fn filter(cx: &mut Context, entity: Option<Entity>) -> FilterDescription {
    let default = FilterDescription { kind: FilterKind::Gaussian { sigma: 0.5 }, radius: Vec2::splat(1.5) };
    let Some(Entity { kind, at, params: mut p }) = entity else {
        return default;
    };
    let (radius, kind) = match kind.as_str() {
        "box" => (0.5, FilterKind::Box),
        "triangle" => (2.0, FilterKind::Triangle),
        "gaussian" => (1.5, FilterKind::Gaussian { sigma: p.float_in(cx, "sigma", 0.5, |s| s > 0.0, "(0, inf)") }),
        "mitchell" => (2.0, FilterKind::Mitchell { b: p.float(cx, "B", 1.0 / 3.0), c: p.float(cx, "C", 1.0 / 3.0) }),
        "sinc" => (4.0, FilterKind::Sinc { tau: p.float_in(cx, "tau", 3.0, |t| t > 0.0, "(0, inf)") }),
        _ => {
            unknown(cx, at, &kind, "filter", &["box", "gaussian", "mitchell", "sinc", "triangle"], None);
            return default;
        }
    };
    let valid = |r: f32| r > 0.0 && r <= 64.0;
    let radius = Vec2::new(
        p.float_in(cx, "xradius", radius, valid, "(0, 64]"),
        p.float_in(cx, "yradius", radius, valid, "(0, 64]"),
    );
    p.finish(cx);
    FilterDescription { kind, radius }
}

/// Number of samples and seed; the kind of the sampler makes no difference to the expectation.
pub(crate) fn sampler(cx: &mut Context, entity: Option<Entity>, option_seed: u64) -> SamplerDescription {
    const KINDS: [&str; 7] = ["halton", "independent", "paddedsobol", "pmj02bn", "sobol", "stratified", "zsobol"];
    let default = SamplerDescription { samples: 16, seed: option_seed };
    let Some(Entity { kind, at, params: mut p }) = entity else {
        return default;
    };
    if !KINDS.contains(&kind.as_str()) {
        let former = match kind.as_str() {
            "random" => Some("independent"),
            "lowdiscrepancy" | "02sequence" => Some("paddedsobol"),
            "maxmindist" => Some("pmj02bn"),
            _ => None,
        };
        unknown(cx, at, &kind, "sampler", &KINDS, former);
        return default;
    }
    p.ignore(&[("randomization", &[Type::String])]);
    let samples = if kind == "stratified" {
        p.ignore(&[("jitter", &[Type::Bool])]);
        p.integer(cx, "xsamples", 4, 1).saturating_mul(p.integer(cx, "ysamples", 4, 1))
    } else {
        p.integer(cx, "pixelsamples", 16, 1)
    };
    let seed = p.integer_or_none(cx, "seed").map_or(option_seed, |seed| i64::from(seed) as u64);
    p.finish(cx);
    SamplerDescription { samples, seed }
}

/// Integrators that pbrt has, with the parameters that they take beside `maxdepth`.
const INTEGRATORS: [(&str, &[(&str, Type)]); 11] = {
    use Type::{Bool, Float, Integer, String};
    [
        ("ao", &[("cossample", Bool), ("maxdistance", Float)]),
        ("bdpt", &[("regularize", Bool), ("visualizestrategies", Bool), ("visualizeweights", Bool)]),
        ("function", &[("function", String), ("filename", String), ("skipbad", Bool), ("imagefilename", String)]),
        ("lightpath", &[]),
        (
            "mlt",
            &[
                ("bootstrapsamples", Integer),
                ("chains", Integer),
                ("mutationsperpixel", Integer),
                ("largestepprobability", Float),
                ("sigma", Float),
                ("regularize", Bool),
            ],
        ),
        ("path", &[("regularize", Bool), ("lightsampler", String)]),
        ("randomwalk", &[]),
        ("simplepath", &[("samplebsdf", Bool), ("samplelights", Bool)]),
        ("simplevolpath", &[]),
        ("sppm", &[("photonsperiteration", Integer), ("radius", Float), ("seed", Integer), ("regularize", Bool)]),
        ("volpath", &[("regularize", Bool), ("lightsampler", String)]),
    ]
};

/// The integrator's name and depth.
pub(crate) fn integrator(cx: &mut Context, entity: Option<Entity>) -> IntegratorDescription {
    let default = IntegratorDescription { name: "volpath".into(), max_depth: 5 };
    let Some(Entity { kind, at, params: mut p }) = entity else {
        return default;
    };
    let Some((_, accepted)) = INTEGRATORS.iter().find(|(name, _)| *name == kind) else {
        let former = match kind.as_str() {
            "directlighting" => Some("path\" \"integer maxdepth\" 1"),
            "whitted" | "pathtracer" => Some("path"),
            "ambientocclusion" => Some("ao"),
            _ => None,
        };
        let names: Vec<&str> = INTEGRATORS.iter().map(|(name, _)| *name).collect();
        unknown(cx, at, &kind, "integrator", &names, former);
        return default;
    };
    let max_depth = p.integer(cx, "maxdepth", 5, 0);
    for &(name, ty) in *accepted {
        let types: &'static [Type] = match ty {
            Type::Bool => &[Type::Bool],
            Type::Float => &[Type::Float],
            Type::Integer => &[Type::Integer],
            _ => &[Type::String],
        };
        p.ignore(&[(name, types)]);
    }
    match kind.as_str() {
        "path" | "volpath" | "simplepath" | "simplevolpath" => {}
        "ao" | "function" => {
            cx.warn(at, format!("integrator `{kind}` computes something else than light: path tracing is used"))
        }
        _ => cx.warn(at, format!("integrator `{kind}` is not needed: path tracing computes the same picture")),
    }
    p.finish(cx);
    IntegratorDescription { name: kind, max_depth }
}
