//! Tests of the loader: snippets per directive, a whole description, exact texts of errors, damaged input, real files.

mod complete;
mod damage;
mod directives;
mod errors;
mod real_tests;
mod things;

use std::borrow::Cow;
use std::collections::HashMap;
use std::io;

use miette::Diagnostic;
use moonmilk_core::{Mat4, Vec3};
use moonmilk_render::description::*;

use super::*;

/// Files of a test.
struct Memory(HashMap<&'static str, Vec<u8>>);

impl Files for Memory {
    fn read(&self, path: &str) -> io::Result<Cow<'static, [u8]>> {
        self.0.get(path).map(|bytes| Cow::Owned(bytes.clone())).ok_or_else(|| io::ErrorKind::NotFound.into())
    }
}

fn files(list: &[(&'static str, &str)]) -> Memory {
    Memory(list.iter().map(|(name, text)| (*name, text.as_bytes().to_vec())).collect())
}

fn load_text(text: &str) -> Result<Loaded, LoadError> {
    load_with(&files(&[("scene.pbrt", text)]), "scene.pbrt", &Options::default())
}

fn scene(text: &str) -> SceneDescription {
    load_text(text).unwrap_or_else(|e| panic!("{e}")).scene
}

/// The world `text` below the least that a scene needs.
fn world(text: &str) -> Loaded {
    load_text(&format!("WorldBegin\n{text}")).unwrap_or_else(|e| panic!("{e}"))
}

fn only_shape(text: &str) -> ShapeDescription {
    let scene = world(text).scene;
    assert_eq!(scene.shapes.len(), 1);
    scene.shapes[0].clone()
}

/// Text and advice of the only problem of a scene.
fn problem(text: &str) -> (String, String) {
    let error = load_text(text).expect_err("an error");
    assert_eq!(error.problems().len(), 1, "{:?}", error.problems());
    let problem = &error.problems()[0];
    (problem.to_string(), problem.help.clone().unwrap_or_default())
}

/// Transforms are accumulated in f64 and stored in f32: rounding of the entries.
fn close(a: Mat4, b: Mat4) -> bool {
    a.abs_diff_eq(b, 1e-6)
}

const MILK: &str = r#"# milk
Scale -1 1 1
LookAt 0 0 25  0 0 0  0 1 0
Camera "perspective" "float fov" [30]
Film "rgb" "string filename" "milk.exr" "integer xresolution" [256] "integer yresolution" [256] "bool savefp16" false
PixelFilter "box" "float xradius" [0.5] "float yradius" [0.5]
Sampler "independent" "integer pixelsamples" [256] "integer seed" [0]
Integrator "volpath" "integer maxdepth" [100000]
WorldBegin
LightSource "infinite" "rgb L" [0.2 0.2 0.2]
MakeNamedMedium "m" "string type" "homogeneous" "spectrum sigma_a" [ 200 0.0025 1000 0.0025 ] "rgb sigma_s" [ 12.2 12.2 12.2 ] "float g" [0.9]
AttributeBegin
  MediumInterface "m" ""
  Material "dielectric" "float eta" [1.33]
  Shape "sphere" "float radius" [5.0]
AttributeEnd
"#;

#[test]
fn a_small_scene_has_this_description() {
    let loaded = load_text(MILK).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.warnings.is_empty());
    let s = loaded.scene;
    let place = |line, column| Place { file: "scene.pbrt".into(), line, column };
    assert_eq!(s.camera.kind, CameraKind::Perspective { fov: 30.0 });
    assert_eq!((s.film.width, s.film.height, s.film.imaging_ratio), (256, 256, 1.0));
    assert_eq!(s.filter, FilterDescription { kind: FilterKind::Box, radius: moonmilk_core::Vec2::splat(0.5) });
    assert_eq!((s.sampler.samples, s.sampler.seed), (256, 0));
    assert_eq!((s.integrator.name.as_str(), s.integrator.max_depth), ("volpath", 100_000));
    assert_eq!((s.media.len(), s.media[0].place.clone()), (1, place(11, 1)));
    let MediumKind::Homogeneous { sigma_a, sigma_s, scale, g, emission } = &s.media[0].kind else {
        panic!("homogeneous")
    };
    assert_eq!(*sigma_a, SpectrumDescription::Sampled(vec![(200.0, 0.0025), (1000.0, 0.0025)]));
    assert_eq!((sigma_s, *scale, *g, emission), (&SpectrumDescription::Rgb([12.2; 3]), 1.0, 0.9, &None));
    let [shape] = s.shapes.as_slice() else { panic!("one shape") };
    assert_eq!((shape.place.clone(), shape.name.as_str()), (place(15, 3), "sphere"));
    assert_eq!(shape.media, Some(MediumInterface { inside: Some(0), outside: None }));
    let MaterialKind::Dielectric { eta, roughness } = &s.materials[shape.material].kind else { panic!("dielectric") };
    assert_eq!(*eta, SpectrumDescription::Constant(1.33));
    assert!(matches!(s.float_textures[roughness.u], FloatTexture::Constant(0.0)) && roughness.remap);
    let [light] = s.lights.as_slice() else { panic!("one light") };
    assert!(matches!(&light.kind, LightKind::Constant { radiance: SpectrumDescription::Rgb([0.2, 0.2, 0.2]) }));
}
