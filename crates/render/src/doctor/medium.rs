//! How large objects are in mean free paths, and whether their media make sense and can be reached.

use moonmilk_core::{Vec2, Vec3, Wavelengths};
use moonmilk_geometry::{Accel, Ray, Shape};

use super::{Body, Patient, Severity, enclosed, is_subsurface, transmits};
use crate::description::{
    IndexSpectrum, MaterialKind, SceneDescription, ShapeDescription, SpectrumTexture, SubsurfaceMedium,
};
use crate::scene::Scene;
use crate::texture::{TexturePoint, property};

/// Optical thicknesses between which an object looks translucent and can be rendered in a sensible time \[mean free paths\].
pub const SENSIBLE: [f64; 2] = [0.1, 1e4];

/// Points of a surface at which textured coefficients are looked up.
const LOOKS: u32 = 256;

/// Red, green and blue.
const RGB: Wavelengths<3> = Wavelengths::Channels { channel: [0, 1, 2] };

/// Examines the medium of an object and returns it; `None` if it encloses none.
pub fn examine(p: &mut Patient, shape: usize, closed: bool) -> Option<Body> {
    let d = p.d;
    let s = &d.shapes[shape];
    let subsurface = is_subsurface(d, s);
    let volume = p.shapes[shape].volume();
    let id = enclosed(s, !closed || volume > 0.0);
    let medium = match (subsurface, id) {
        (true, _) => "subsurface".to_owned(),
        (false, Some(id)) => d.media[id].name.clone(),
        (false, None) => return None,
    };
    let found = coefficients(d, &p.scene, s, &p.shapes[shape], id);
    let mut body = Body {
        shape,
        source: s.clone(),
        name: s.name.clone(),
        place: s.place.clone(),
        medium,
        count: 1,
        triangles: p.shapes[shape].mesh().map_or(0, |m| m.indices().len()),
        closed,
        volume: volume.abs(),
        area: p.shapes[shape].area(),
        eta: eta(d, s.material),
        smooth: is_interface(d, s.material) || p.scene.materials.smooth_eta(s.material).is_some(),
        sigma_a: [[f32::INFINITY; 3], [0.0; 3]],
        sigma_s: [[f32::INFINITY; 3], [0.0; 3]],
        sigma_t: [[f32::INFINITY; 3], [0.0; 3]],
        alpha: [0.0; 3],
        g: 0.0,
    };
    for (sigma_a, sigma_s, g) in found {
        body.g = g;
        for c in 0..3 {
            let t = sigma_a[c] + sigma_s[c];
            for (range, x) in [(&mut body.sigma_a, sigma_a[c]), (&mut body.sigma_s, sigma_s[c]), (&mut body.sigma_t, t)]
            {
                range[0][c] = range[0][c].min(x);
                range[1][c] = range[1][c].max(x);
            }
            body.alpha[c] = body.alpha[c].max(if t > 0.0 { sigma_s[c] / t } else { 0.0 });
        }
    }
    sizes(p, &body);
    Some(body)
}

/// Reports a medium inside a surface that lets no light through.
pub fn examine_opaque(p: &mut Patient, shape: usize) {
    let s = &p.d.shapes[shape];
    if s.media.is_some_and(|m| m.inside.is_some()) && !transmits(p.d, s.material) {
        let message = format!("{}: no path can reach the medium inside: its material lets no light through", s.name);
        let advice = "use `Material \"interface\"` or `\"dielectric\"` for the boundary of a medium";
        p.problem("unreachable-medium", shape, message, advice);
    }
}

fn is_interface(d: &SceneDescription, material: usize) -> bool {
    matches!(d.materials[material].kind, MaterialKind::Interface)
}

/// Returns the index of a material's boundary in the green, 1 if it has none.
fn eta(d: &SceneDescription, material: usize) -> f64 {
    let at = |s: &IndexSpectrum| property(s).map_or(1.0, |s| f64::from(s.eval(550.0)));
    match &d.materials[material].kind {
        MaterialKind::Dielectric { eta, .. } => at(eta),
        MaterialKind::Subsurface { eta, .. } => f64::from(*eta),
        _ => 1.0,
    }
}

/// Returns the coefficients found over a surface: absorption, scattering, asymmetry.
fn coefficients(
    d: &SceneDescription,
    scene: &Scene,
    s: &ShapeDescription,
    shape: &Shape,
    id: Option<usize>,
) -> Vec<([f32; 3], [f32; 3], f32)> {
    let MaterialKind::Subsurface { medium, .. } = &d.materials[s.material].kind else {
        let empty = ([0.0; 3], [0.0; 3], 0.0);
        return vec![
            id.and_then(|id| scene.mean_medium::<3>(id, &RGB)).map_or(empty, |m| (m.sigma_a.0, m.sigma_s.0, m.g)),
        ];
    };
    let points = if is_textured(d, medium) { surface_points(shape) } else { vec![(Vec3::ZERO, Vec3::Z, Vec2::ZERO)] };
    let at = |(p, n, uv): (Vec3, Vec3, Vec2)| {
        let point = TexturePoint { p, n, uv };
        let medium = scene.materials.medium_at::<3>(s.material, &scene.textures, &point, &RGB);
        medium.map_or(([0.0; 3], [0.0; 3], 0.0), |m| (m.sigma_a.0, m.sigma_s.0, m.g))
    };
    points.into_iter().map(at).collect()
}

fn is_textured(d: &SceneDescription, medium: &SubsurfaceMedium) -> bool {
    let varies = |id: usize| !matches!(d.spectrum_textures[id], SpectrumTexture::Constant(_));
    match *medium {
        SubsurfaceMedium::Coefficients { sigma_a, sigma_s } => varies(sigma_a) || varies(sigma_s),
        SubsurfaceMedium::Reflectance { reflectance, mfp } => varies(reflectance) || varies(mfp),
    }
}

/// Returns points spread over a surface with their normals and texture coordinates.
fn surface_points(shape: &Shape) -> Vec<(Vec3, Vec3, Vec2)> {
    let accel = Accel::build(vec![shape.clone()]);
    if let Some(mesh) = shape.mesh() {
        let n = mesh.indices().len() as u32;
        let pick = |i: u32| (u64::from(i) * u64::from(n) / u64::from(LOOKS.min(n))) as u32;
        let third = [1.0 / 3.0; 2];
        let surfaces = (0..LOOKS.min(n)).filter_map(|i| accel.triangle_surface(0, pick(i), third));
        return surfaces.map(|s| (s.p, s.ns, s.uv)).collect();
    }
    // Look at an analytic shape along lines through its middle.
    let (bounds, golden) = (shape.bounds(), 2.399_963_2_f32);
    let reach = bounds.extent().length();
    let line = |i: u32| {
        let z = 1.0 - 2.0 * (i as f32 + 0.5) / LOOKS as f32;
        let (sin, cos) = (golden * i as f32).sin_cos();
        let r = (1.0 - z * z).sqrt();
        let d = Vec3::new(r * cos, r * sin, z);
        let ray = Ray::new(bounds.center() - d * reach, d);
        accel.nearest(&ray).map(|hit| accel.surface(&ray, &hit))
    };
    (0..LOOKS).filter_map(line).map(|s| (s.p, s.ns, s.uv)).collect()
}

/// Reports objects that are too thin or too dense, and factors of units that would explain it.
fn sizes(p: &mut Patient, body: &Body) {
    let name = &body.name;
    let Some([low, high]) = body.size() else {
        return;
    };
    if high == 0.0 {
        let message = format!("{name}: its medium is empty: all coefficients are 0");
        p.note("empty-medium", body.shape, message, "give it coefficients above 0, or leave the medium out");
        return;
    }
    let geometry = "the mean chord 4 V / S over the mean free path";
    let by_length = matches!(
        &p.d.materials[p.d.shapes[body.shape].material].kind,
        MaterialKind::Subsurface { medium: SubsurfaceMedium::Reflectance { .. }, .. }
    );
    let (code, message) = if high < SENSIBLE[0] {
        (
            "thin",
            format!(
                "{name} is {high:.2e} mean free paths thick ({geometry}), less than {}: it will look like clear glass",
                SENSIBLE[0]
            ),
        )
    } else if high > SENSIBLE[1] {
        (
            "dense",
            format!(
                "{name} is {high:.2e} mean free paths thick ({geometry}), more than {:.0}: it will look opaque, and its walks are long",
                SENSIBLE[1]
            ),
        )
    } else if low < SENSIBLE[0] && low > 0.0 {
        let message =
            format!("{name} is between {low:.2e} and {high:.3} mean free paths thick, depending on colour and place");
        p.note("thin", body.shape, message, "fine if meant: where it is below 0.1 it looks like clear glass");
        return;
    } else {
        return;
    };
    // A factor of length units that makes it sensible is the likely mistake.
    let factors: &[(f64, &str)] = if code == "thin" {
        &[
            (10.0, "mm and the scene is in cm"),
            (100.0, "cm and the scene is in m"),
            (1000.0, "mm and the scene is in m"),
        ]
    } else {
        &[(0.1, "cm and the scene is in mm"), (0.01, "m and the scene is in cm"), (0.001, "m and the scene is in mm")]
    };
    // Of several, the one that comes closest to ten mean free paths: what people mean when they say translucent.
    let from_ten = |f: f64| (high * f / 10.0).ln().abs();
    let likely = factors.iter().filter(|f| from_ten(f.0) < 6.0).min_by(|a, b| from_ten(a.0).total_cmp(&from_ten(b.0)));
    let advice = match likely {
        Some((factor, units)) if by_length => format!(
            "a mistake of units? If its mean free path is in {units}, `float scale` {} makes it {:.3} mean free paths",
            1.0 / factor,
            high * factor
        ),
        Some((factor, units)) => format!(
            "a mistake of units? If its coefficients are per {units}, `float scale` {factor} makes it {:.3} mean free paths",
            high * factor
        ),
        None => {
            "check the coefficients and their unit: they are per scene unit of length (pbrt's named media are per mm)"
                .into()
        }
    };
    p.problem(code, body.shape, message, &advice);
}

/// Reports media that nothing uses.
pub fn examine_unused(p: &mut Patient) {
    let d = p.d;
    for (id, medium) in d.media.iter().enumerate() {
        let of_shape = |s: &ShapeDescription| s.media.is_some_and(|m| m.inside == Some(id) || m.outside == Some(id));
        let used = d.camera.medium == Some(id)
            || d.lights.iter().any(|l| l.medium == Some(id))
            || d.shapes.iter().any(of_shape);
        if !used {
            let message = format!("medium \"{}\" is defined, but no object and no camera is in it", medium.name);
            p.add(
                Severity::Note,
                "unused-medium",
                None,
                message,
                "name it in a MediumInterface above a shape, with two different sides",
            );
            if let Some(last) = p.findings.last_mut() {
                last.place = Some(medium.place.clone());
            }
        }
    }
}
