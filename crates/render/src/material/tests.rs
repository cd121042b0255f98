use std::sync::Arc;

use super::*;
use crate::description::*;
use moonmilk_core::estimate::Accumulator;
use moonmilk_core::{Mat4, Random, Spectrum, Stream, WavelengthMode};
use moonmilk_optics::OpticalProperties;
use moonmilk_optics::halfspace::{Illumination, exact_albedo};

fn place() -> Place {
    Place { file: Arc::from("test.pbrt"), line: 7, column: 3 }
}

/// A scene without anything in it.
pub(crate) fn empty_scene() -> SceneDescription {
    SceneDescription {
        camera: CameraDescription {
            kind: CameraKind::Orthographic,
            camera_to_world: Mat4::IDENTITY,
            medium: None,
            screen_window: None,
            frame_aspect_ratio: None,
            lens_radius: 0.0,
            focal_distance: 1.0,
        },
        film: FilmDescription {
            width: 1,
            height: 1,
            crop: [0, 1, 0, 1],
            filename: None,
            imaging_ratio: 1.0,
            max_component_value: None,
        },
        filter: FilterDescription { kind: FilterKind::Box, radius: Vec2::splat(0.5) },
        sampler: SamplerDescription { samples: 1, seed: 0 },
        integrator: IntegratorDescription { name: "volpath".into(), max_depth: 5 },
        media: vec![],
        materials: vec![],
        float_textures: vec![],
        spectrum_textures: vec![],
        images: vec![],
        shapes: vec![],
        objects: vec![],
        instances: vec![],
        lights: vec![],
    }
}

/// A scene with float textures 0, 0.25, 0.5 and spectrum textures 0.5, an orange, 2.
fn scene(kinds: Vec<MaterialKind>) -> SceneDescription {
    let mut d = empty_scene();
    d.float_textures = [0.0, 0.25, 0.5].map(FloatTexture::Constant).to_vec();
    d.spectrum_textures = [
        SpectrumDescription::Constant(0.5),
        SpectrumDescription::Rgb([0.9, 0.5, 0.1]),
        SpectrumDescription::Constant(2.0),
    ]
    .map(SpectrumTexture::Constant)
    .to_vec();
    d.materials = kinds
        .into_iter()
        .map(|kind| MaterialDescription {
            name: None,
            place: place(),
            kind,
            displacement: None,
            normal_map: None,
            set: None,
            priority: None,
        })
        .collect();
    d
}

fn roughness(id: usize) -> Roughness {
    Roughness { u: id, v: id, remap: true }
}

fn surface() -> Surface {
    Surface { p: Vec3::ZERO, ng: Vec3::Z, ns: Vec3::Z, uv: Vec2::splat(0.3), dpdu: Vec3::X, dpdv: Vec3::Y }
}

fn point() -> TexturePoint {
    TexturePoint { p: Vec3::ZERO, n: Vec3::Z, uv: Vec2::splat(0.3) }
}

fn build(d: &SceneDescription) -> (Textures, Result<Materials, MaterialError>) {
    let t = Textures::new(d).unwrap();
    let m = Materials::new(d, &t);
    (t, m)
}

fn subsurface(medium: SubsurfaceMedium, scale: f32, eta: f32) -> MaterialKind {
    MaterialKind::Subsurface { medium, scale, g: 0.5, eta, roughness: roughness(0) }
}

#[test]
fn mixtures_choose_their_parts_with_the_stated_probability() {
    let d = scene(vec![
        MaterialKind::Diffuse { reflectance: 0 },
        MaterialKind::Diffuse { reflectance: 1 },
        MaterialKind::Mix { materials: [0, 1], amount: 1 },
        MaterialKind::Mix { materials: [2, 0], amount: 2 },
    ]);
    let (t, m) = build(&d);
    let m = m.unwrap();
    let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, 0.1);
    let mut u = Stream::new(&[41]);
    let mut a = Accumulator::default();
    for _ in 0..100_000 {
        let b = m.resolve(3, &t, &surface(), &point(), &w, u.uniform());
        a.add(f64::from(u8::from(b.bsdf.albedo() != Spectrum::splat(0.5))));
    }
    // Half of a quarter; 4 standard errors.
    assert!(a.estimate().z(0.125).abs() < 4.0, "{}", a.estimate());
}

#[test]
fn unusable_materials_are_refused_with_their_place() {
    let coat = |depth| MaterialKind::CoatedDiffuse {
        reflectance: 0,
        roughness: roughness(0),
        thickness: 1,
        eta: SpectrumDescription::Constant(1.5),
        g: 0,
        albedo: 0,
        max_depth: depth,
        samples: 1,
    };
    let by_reflectance = SubsurfaceMedium::Reflectance { reflectance: 0, mfp: 2 };
    let cases: Vec<(MaterialKind, &str)> = vec![
        (MaterialKind::Diffuse { reflectance: 2 }, "outside [0, 1]"),
        (MaterialKind::Diffuse { reflectance: 9 }, "does not exist"),
        (MaterialKind::Mix { materials: [0, 0], amount: 0 }, "contains itself"),
        (MaterialKind::Mix { materials: [0, 5], amount: 0 }, "contains itself"),
        (MaterialKind::ThinDielectric { eta: SpectrumDescription::Constant(0.0) }, "eta"),
        (MaterialKind::ThinDielectric { eta: SpectrumDescription::Named("glass".into()) }, "did you mean"),
        (subsurface(by_reflectance.clone(), 1.0, 0.2), "[1/3, 3]"),
        (subsurface(by_reflectance, f32::NAN, 1.3), "scale"),
        (coat(0), "at least one"),
    ];
    for (kind, what) in cases {
        let (_, m) = build(&scene(vec![kind.clone()]));
        let message = m.expect_err("it is unusable").to_string();
        assert!(message.starts_with("test.pbrt:7:3: ") && message.contains(what), "{kind:?}: {message}");
    }
    let (_, m) = build(&scene(vec![coat(10)]));
    assert!(m.is_ok());
}

#[test]
fn measured_albedos_above_one_act_as_one_and_are_told() {
    let mut d = scene(vec![MaterialKind::Diffuse { reflectance: 3 }, MaterialKind::Diffuse { reflectance: 1 }]);
    let peak = SpectrumDescription::Sampled(vec![(400.0, 0.2), (700.0, 1.7)]);
    d.spectrum_textures.push(SpectrumTexture::Constant(peak));
    let (t, m) = build(&d);
    let m = m.unwrap();
    assert_eq!(m.cuts().collect::<Vec<_>>(), [(0, 1.7)]);
    for (nm, expected) in [(400.0, 0.2), (460.0, 0.5), (700.0, 1.0)] {
        let b = m.resolve(0, &t, &surface(), &point(), &Wavelengths::<1>::Fixed(nm), 0.5);
        assert!((b.bsdf.albedo()[0] - expected).abs() < 1e-3, "{nm} nm: {:?}", b.bsdf.albedo());
    }
}

#[test]
fn smooth_boundaries_without_dispersion_are_known_as_such() {
    let glass = |eta: SpectrumDescription, r| MaterialKind::Dielectric { eta, roughness: roughness(r) };
    let constant = SpectrumDescription::Constant(1.5);
    let named = SpectrumDescription::Named("glass-BK7".into());
    let d = scene(vec![glass(constant.clone(), 0), glass(constant, 1), glass(named, 0), MaterialKind::Interface]);
    let (t, m) = build(&d);
    let m = m.unwrap();
    assert_eq!([0, 1, 2, 3].map(|i| m.smooth_eta(i)), [Some(1.5), None, None, None]);
    let w = Wavelengths::<4>::sample(WavelengthMode::Hero, 0.3);
    let flags = [0, 1, 2].map(|i| m.resolve(i, &t, &surface(), &point(), &w, 0.5).wavelength_dependent());
    assert_eq!(flags, [false, false, true]);
}

#[test]
fn both_forms_of_a_medium_give_coefficients() {
    let d = scene(vec![
        subsurface(SubsurfaceMedium::Coefficients { sigma_a: 0, sigma_s: 2 }, 3.0, 1.33),
        subsurface(SubsurfaceMedium::Reflectance { reflectance: 0, mfp: 2 }, 3.0, 1.33),
        MaterialKind::Interface,
    ]);
    let (t, m) = build(&d);
    let m = m.unwrap();
    let w = Wavelengths::<1>::sample(WavelengthMode::MONO, 0.5);
    let a = m.medium_at(0, &t, &point(), &w).unwrap();
    assert_eq!((a.sigma_a[0], a.sigma_s[0], a.g), (1.5, 6.0, 0.5));
    // sigma_t = 1 / (3 * 2); the half-space of this medium, g = .5, has the albedo .5 again, up to the table's 1e-5 and the rounding of f32.
    let b = m.medium_at(1, &t, &point(), &w).unwrap();
    let p = OpticalProperties::new(f64::from(b.sigma_a[0]), f64::from(b.sigma_s[0]), 0.5, 1.33).unwrap();
    let albedo = exact_albedo(&p, Illumination::Normal).unwrap();
    assert!((b.sigma_t[0] - 1.0 / 6.0).abs() < 1e-6 && (albedo - 0.5).abs() < 2e-5, "{b:?} {albedo}");
    assert!(m.medium_at(2, &t, &point(), &w).is_none());
}

#[test]
fn a_displaced_ramp_tilts_the_normal_by_its_slope() {
    // Height .5 u over the unit square of dpdu = x: n is along (-.5, 0, 1).
    let mut d = scene(vec![MaterialKind::Diffuse { reflectance: 0 }]);
    let rgb = (0..64).map(|i| [(i as f32 + 0.5) / 64.0; 3]).collect();
    d.images.push(ImageDescription { name: "ramp".into(), width: 64, height: 1, rgb, alpha: vec![] });
    let mapping = TextureMapping::Uv { scale: Vec2::ONE, delta: Vec2::ZERO };
    d.float_textures.push(FloatTexture::Image {
        image: 0,
        mapping,
        wrap: Wrap::Clamp,
        scale: 0.5,
        invert: false,
        bilinear: true,
    });
    d.materials[0].displacement = Some(3);
    let (t, m) = build(&d);
    let n = m.unwrap().shading_normal(0, &t, &surface(), &point());
    // Differences of f32 heights over a step of 5e-4.
    assert!(n.distance(Vec3::new(-0.5, 0.0, 1.0).normalize()) < 1e-3, "{n}");
}
