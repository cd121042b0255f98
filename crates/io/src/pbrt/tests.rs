//! Tests of the loader: snippets per directive, a whole description, exact texts of errors, damaged input, real files.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

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

// Transforms and blocks.

#[test]
fn transforms_multiply_from_the_right() {
    let at = |text: &str| only_shape(&format!("{text}\nShape \"sphere\"")).object_to_world;
    assert!(close(at("Translate 1 2 3"), Mat4::from_translation(Vec3::new(1.0, 2.0, 3.0))));
    assert!(close(
        at("Translate 1 0 0 Scale 2 3 4"),
        Mat4::from_translation(Vec3::X) * Mat4::from_scale(Vec3::new(2.0, 3.0, 4.0))
    ));
    assert!(close(at("Rotate 90 0 0 1"), Mat4::from_rotation_z(std::f32::consts::FRAC_PI_2)));
    assert!(close(at("Translate 1 0 0 Identity"), Mat4::IDENTITY));
    let matrix = "[1 0 0 0  0 1 0 0  0 0 1 0  5 6 7 1]";
    assert!(close(at(&format!("Scale 2 2 2 Transform {matrix}")), Mat4::from_translation(Vec3::new(5.0, 6.0, 7.0))));
    assert!(close(
        at(&format!("Scale 2 2 2 ConcatTransform {matrix}")),
        Mat4::from_scale(Vec3::splat(2.0)) * Mat4::from_translation(Vec3::new(5.0, 6.0, 7.0))
    ));
    assert!(close(
        at("Translate 1 1 1 CoordinateSystem \"here\" Identity CoordSysTransform \"here\""),
        Mat4::from_translation(Vec3::ONE)
    ));
}

#[test]
fn look_at_puts_the_eye_at_the_origin_of_a_camera_that_looks_along_z() {
    let camera = scene("LookAt 1 2 3  1 2 8  0 1 0\nCamera \"perspective\"\nWorldBegin").camera;
    let m = camera.camera_to_world;
    assert!((m.transform_point3(Vec3::ZERO) - Vec3::new(1.0, 2.0, 3.0)).length() < 1e-6);
    assert!((m.transform_vector3(Vec3::Z) - Vec3::Z).length() < 1e-6);
    assert!((m.transform_vector3(Vec3::Y) - Vec3::Y).length() < 1e-6);
    // Mirrored scenes are common: the transform stays a plain inverse.
    let mirrored =
        scene("Scale -1 1 1\nLookAt 0 0 5  0 0 0  0 1 0\nCamera \"perspective\"\nWorldBegin").camera.camera_to_world;
    assert!(mirrored.determinant() < 0.0);
    assert!((mirrored.transform_point3(Vec3::ZERO) - Vec3::new(0.0, 0.0, 5.0)).length() < 1e-6);
}

#[test]
fn blocks_restore_the_state() {
    let scene = world(
        "AttributeBegin Translate 1 0 0 ReverseOrientation Material \"dielectric\" AttributeEnd Shape \"sphere\"\nTransformBegin Scale 2 2 2 TransformEnd Shape \"disk\"",
    )
    .scene;
    for shape in &scene.shapes {
        assert_eq!((shape.object_to_world, shape.reverse_orientation), (Mat4::IDENTITY, false));
        assert!(matches!(scene.materials[shape.material].kind, MaterialKind::Diffuse { .. }));
    }
}

#[test]
fn moving_objects_stay_where_they_start_and_the_user_is_told() {
    let loaded = world("ActiveTransform EndTime Translate 9 0 0 ActiveTransform All Translate 0 1 0 Shape \"sphere\"");
    assert!(close(loaded.scene.shapes[0].object_to_world, Mat4::from_translation(Vec3::Y)));
    assert_eq!(loaded.warnings.len(), 1);
    assert!(loaded.warnings[0].message.contains("moving"), "{}", loaded.warnings[0].message);
}

#[test]
fn objects_are_copied_to_their_instances_and_share_geometry() {
    let scene = world(
        "ObjectBegin \"o\" Translate 0 1 0 Shape \"sphere\" Shape \"disk\" ObjectEnd\nTranslate 5 0 0 ObjectInstance \"o\" Translate 5 0 0 ObjectInstance \"o\"",
    )
    .scene;
    assert_eq!(scene.shapes.len(), 4);
    assert!(close(scene.shapes[2].object_to_world, Mat4::from_translation(Vec3::new(10.0, 1.0, 0.0))));
    assert!(std::sync::Arc::ptr_eq(&scene.shapes[0].geometry, &scene.shapes[2].geometry));
}

#[test]
fn included_files_change_the_state_and_imported_ones_do_not() {
    let main = "WorldBegin Include \"a.pbrt\" Shape \"sphere\" Import \"b.pbrt\" Shape \"sphere\"";
    let list = files(&[("s", main), ("a.pbrt", "Translate 1 0 0"), ("b.pbrt", "Translate 7 0 0 Shape \"disk\"")]);
    let scene = load_with(&list, "s", &Options::default()).unwrap_or_else(|e| panic!("{e}")).scene;
    let x: Vec<f32> = scene.shapes.iter().map(|s| s.object_to_world.w_axis.x).collect();
    assert_eq!(x, [1.0, 8.0, 1.0]);
}

#[test]
fn parameters_after_an_include_continue_its_last_directive() {
    let list = files(&[("s", "WorldBegin Include \"a.pbrt\" \"float radius\" 3"), ("a.pbrt", "Shape \"sphere\"")]);
    let scene = load_with(&list, "s", &Options::default()).unwrap_or_else(|e| panic!("{e}")).scene;
    assert!(matches!(*scene.shapes[0].geometry, GeometryDescription::Sphere { radius, .. } if radius == 3.0));
}

#[test]
fn packed_files_are_unpacked() {
    use std::io::Write;
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packer.write_all(b"WorldBegin Shape \"sphere\"").expect("memory");
    let list = Memory(HashMap::from([("s.pbrt.gz", packer.finish().expect("memory"))]));
    assert_eq!(load_with(&list, "s.pbrt.gz", &Options::default()).expect("a scene").scene.shapes.len(), 1);
    let tight = Options { max_bytes: 10, ..Options::default() };
    assert!(load_with(&list, "s.pbrt.gz", &tight).is_err());
}

#[test]
fn attribute_sets_defaults_and_carries_our_extensions() {
    let scene = world(
        "Attribute \"shape\" \"float radius\" 2\nAttribute \"material\" \"string moonmilk.set\" \"skin\" \"integer moonmilk.priority\" 3\nMaterial \"dielectric\"\nShape \"sphere\" Shape \"sphere\" \"float radius\" 5",
    )
    .scene;
    let radii: Vec<f32> = scene
        .shapes
        .iter()
        .map(|s| if let GeometryDescription::Sphere { radius, .. } = *s.geometry { radius } else { 0.0 })
        .collect();
    assert_eq!(radii, [2.0, 5.0]);
    let material = &scene.materials[scene.shapes[0].material];
    assert_eq!((material.set.as_deref(), material.priority), (Some("skin"), Some(3)));
    let (text, help) = problem("WorldBegin Attribute \"material\" \"string moonmilk.sett\" \"skin\"");
    assert_eq!(text, "scene.pbrt:1:41: `string moonmilk.sett` is no extension");
    assert!(help.starts_with("did you mean `moonmilk.set`?"), "{help}");
}

// Options block.

#[test]
fn the_options_block_is_read_with_pbrts_defaults() {
    let s = scene("WorldBegin");
    assert_eq!(s.camera.kind, CameraKind::Perspective { fov: 90.0 });
    assert_eq!((s.film.width, s.film.height, s.film.crop), (1280, 720, [0, 1280, 0, 720]));
    assert_eq!((s.filter.kind, s.filter.radius.x), (FilterKind::Gaussian { sigma: 0.5 }, 1.5));
    assert_eq!((s.sampler.samples, s.integrator.max_depth), (16, 5));
    let s = scene(
        "Option \"seed\" 7\nFilm \"rgb\" \"integer xresolution\" 100 \"integer yresolution\" [50] \"float cropwindow\" [.25 .5 0 1] \"float iso\" 200 \"string filename\" \"a.exr\"
        Camera \"spherical\"\nCamera \"perspective\" \"float fov\" 30 \"float screenwindow\" [-1 1 -2 2] \"float shutterclose\" 0.5 \"float frameaspectratio\" 2
        PixelFilter \"mitchell\" \"float B\" 0.5\nSampler \"stratified\" \"integer xsamples\" 3 \"integer ysamples\" 5\nIntegrator \"path\" \"integer maxdepth\" 9 \"string lightsampler\" \"bvh\"
        Accelerator \"kdtree\" \"integer maxprims\" 3\nColorSpace \"srgb\"\nWorldBegin",
    );
    assert_eq!(s.camera.kind, CameraKind::Perspective { fov: 30.0 });
    assert_eq!((s.camera.screen_window, s.camera.frame_aspect_ratio), (Some([-1.0, 1.0, -2.0, 2.0]), Some(2.0)));
    assert_eq!((s.film.crop, s.film.filename.as_deref(), s.film.imaging_ratio), ([25, 50, 0, 50], Some("a.exr"), 1.0));
    assert_eq!(s.filter.kind, FilterKind::Mitchell { b: 0.5, c: 1.0 / 3.0 });
    assert_eq!((s.sampler.samples, s.sampler.seed, s.integrator.max_depth), (15, 7, 9));
}

// Shapes.

#[test]
fn meshes_are_read_and_checked() {
    let shape = only_shape(
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0] \"normal N\" [0 0 1 0 0 1 0 0 1] \"point2 uv\" [0 0 1 0 0 1]",
    );
    let GeometryDescription::Mesh { positions, normals, uvs, indices } = &*shape.geometry else { panic!("a mesh") };
    assert_eq!((positions.len(), normals.len(), uvs.len(), indices.as_slice()), (3, 3, 3, &[[0, 1, 2]][..]));
    let (text, _) =
        problem("WorldBegin Shape \"trianglemesh\" \"integer indices\" [0 1 3] \"point3 P\" [0 0 0  1 0 0  0 1 0]");
    assert_eq!(text, "scene.pbrt:1:42: entry 2 of `indices` is 3, but the vertices are 0 to 2");
}

#[test]
fn bilinear_patches_become_triangles_that_face_the_same_way() {
    let shape = only_shape("Shape \"bilinearmesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0  1 1 0]");
    let GeometryDescription::Mesh { positions, indices, uvs, .. } = &*shape.geometry else { panic!("a mesh") };
    assert_eq!((indices.len(), uvs.len()), (2, 4));
    for [a, b, c] in indices.iter().map(|t| t.map(|i| positions[i as usize])) {
        assert_eq!((b - a).cross(c - a), Vec3::Z);
    }
    let twisted = only_shape("Shape \"bilinearmesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0  1 1 1]");
    let GeometryDescription::Mesh { positions, indices, .. } = &*twisted.geometry else { panic!("a mesh") };
    assert_eq!(indices.len(), 128);
    // Points of the patch z = x y: rounding only.
    assert!(positions.iter().all(|p| (p.z - p.x * p.y).abs() < 1e-6));
}

#[test]
fn quadrics_and_alpha_are_read() {
    let scene = world(
        "Texture \"a\" \"float\" \"constant\" \"float value\" 0.25\nShape \"sphere\" \"float radius\" 2 \"float zmin\" -1 \"texture alpha\" \"a\"\nShape \"disk\" \"float height\" 3 \"float innerradius\" 0.5\nShape \"cylinder\" \"float phimax\" 90 \"float alpha\" 0.5",
    )
    .scene;
    assert!(matches!(
        *scene.shapes[0].geometry,
        GeometryDescription::Sphere { radius: 2.0, z_min: -1.0, z_max: 2.0, phi_max: 360.0 }
    ));
    assert!(matches!(
        *scene.shapes[1].geometry,
        GeometryDescription::Disk { height: 3.0, radius: 1.0, inner_radius: 0.5, .. }
    ));
    assert!(matches!(
        *scene.shapes[2].geometry,
        GeometryDescription::Cylinder { z_min: -1.0, z_max: 1.0, phi_max: 90.0, .. }
    ));
    let alphas: Vec<Option<f32>> = scene
        .shapes
        .iter()
        .map(|s| s.alpha.map(|a| if let FloatTexture::Constant(v) = scene.float_textures[a] { v } else { -1.0 }))
        .collect();
    assert_eq!(alphas, [Some(0.25), None, Some(0.5)]);
}

#[test]
fn subdivision_surfaces_are_refined() {
    let text = "Shape \"loopsubdiv\" \"integer levels\" 2 \"point3 P\" [1 1 1  -1 -1 1  -1 1 -1  1 -1 -1] \"integer indices\" [0 1 2 0 3 1 0 2 3 1 3 2]";
    let GeometryDescription::Mesh { indices, positions, normals, .. } = &*only_shape(text).geometry else {
        panic!("a mesh")
    };
    assert_eq!(indices.len(), 64);
    assert_eq!(normals.len(), positions.len());
}

// Materials, media, lights, textures.

#[test]
fn every_form_of_subsurface_is_read() {
    let of = |parameters: &str| {
        let scene = world(&format!(
            "Texture \"t\" \"spectrum\" \"constant\" \"rgb value\" [.1 .2 .3]\nMaterial \"subsurface\" {parameters}"
        ))
        .scene;
        let MaterialKind::Subsurface { medium, scale, g, eta, .. } = scene.materials[1].kind.clone() else {
            panic!("subsurface")
        };
        let value = |id: usize| {
            if let SpectrumTexture::Constant(v) = &scene.spectrum_textures[id] { v.clone() } else { panic!("constant") }
        };
        let (first, pair) = match medium {
            SubsurfaceMedium::Coefficients { sigma_a, sigma_s } => (true, (value(sigma_a), value(sigma_s))),
            SubsurfaceMedium::Reflectance { reflectance, mfp } => (false, (value(reflectance), value(mfp))),
        };
        (first, pair, scale, g, eta)
    };
    use SpectrumDescription::{Constant, Rgb};
    let default = (Rgb([0.0011, 0.0024, 0.014]), Rgb([2.55, 3.21, 3.77]));
    assert_eq!(of(""), (true, default, 1.0, 0.0, 1.33));
    let marble = (Rgb([0.0021, 0.0041, 0.0071]), Rgb([2.19, 2.62, 3.0]));
    assert_eq!(of("\"string name\" \"Marble\" \"float g\" 0.8 \"float scale\" 10"), (true, marble, 10.0, 0.0, 1.33));
    let given = (Rgb([1.0, 2.0, 3.0]), Constant(0.0));
    let (_, pair, _, g, eta) =
        of("\"rgb sigma_a\" [1 2 3] \"spectrum sigma_s\" [400 1 700 1] \"float g\" 0.5 \"float eta\" 1.5");
    assert_eq!(
        (pair.0, pair.1, g, eta),
        (given.0, SpectrumDescription::Sampled(vec![(400.0, 1.0), (700.0, 1.0)]), 0.5, 1.5)
    );
    assert_eq!(of("\"texture reflectance\" \"t\"").1, (Rgb([0.1, 0.2, 0.3]), Constant(1.0)));
    assert_eq!(of("\"rgb reflectance\" [.5 .5 .5] \"rgb mfp\" [1 2 3]").1, (Rgb([0.5; 3]), Rgb([1.0, 2.0, 3.0])));
    let (text, _) = problem("WorldBegin Material \"subsurface\" \"rgb sigma_a\" [1 1 1]");
    assert_eq!(text, "scene.pbrt:1:52: `sigma_a` is given without `sigma_s`");
}

#[test]
fn all_materials_of_pbrt_are_known() {
    let kinds = [
        "",
        "none",
        "interface",
        "diffuse",
        "coateddiffuse",
        "coatedconductor",
        "conductor",
        "dielectric",
        "thindielectric",
        "diffusetransmission",
        "subsurface",
        "hair",
        "measured",
    ];
    for kind in kinds {
        let loaded = world(&format!("Material \"{kind}\" Shape \"sphere\""));
        let stand_in = matches!(loaded.scene.materials[1].kind, MaterialKind::StandIn { .. });
        assert_eq!(stand_in, matches!(kind, "hair" | "measured"), "{kind}");
        assert_eq!(loaded.warnings.len(), usize::from(stand_in), "{kind}");
    }
    let scene = world("MakeNamedMaterial \"a\" \"string type\" \"diffuse\" MakeNamedMaterial \"b\" \"string type\" \"dielectric\" \"spectrum eta\" \"glass-BK7\"\nMaterial \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" 0.3").scene;
    assert!(matches!(scene.materials[3].kind, MaterialKind::Mix { materials: [0, 1], .. }));
    assert!(
        matches!(&scene.materials[1].kind, MaterialKind::Dielectric { eta: SpectrumDescription::Named(n), .. } if n == "glass-BK7")
    );
}

#[test]
fn media_lie_where_the_interface_says() {
    let scene = world(
        "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [1 1 1] \"rgb sigma_s\" [2 2 2] \"float g\" .5 \"float scale\" 3 \"blackbody Le\" 3000\nMakeNamedMedium \"n\" \"string type\" \"homogeneous\" \"string preset\" \"Wholemilk\"
        MediumInterface \"m\" \"n\" Shape \"sphere\" MediumInterface \"m\" \"\" Shape \"sphere\" MediumInterface \"m\" Shape \"sphere\" MediumInterface \"\" \"\" Shape \"sphere\"",
    )
    .scene;
    let media: Vec<_> = scene.shapes.iter().map(|s| s.media.map(|m| (m.inside, m.outside))).collect();
    assert_eq!(media, [Some((Some(0), Some(1))), Some((Some(0), None)), None, None]);
    let MediumKind::Homogeneous { scale, g, emission, .. } = &scene.media[0].kind;
    assert_eq!((*scale, *g, emission.clone()), (3.0, 0.5, Some((SpectrumDescription::Blackbody(3000.0), 1.0))));
}

#[test]
fn lights_resolve_power_and_illuminance() {
    let light = |text: &str| world(text).scene.lights[0].clone();
    let four_pi = 4.0 * std::f32::consts::PI;
    assert!(
        (light("LightSource \"point\" \"float power\" 100 \"float scale\" 2").scale - 200.0 / four_pi).abs() < 1e-5
    );
    assert_eq!(light("LightSource \"distant\" \"float illuminance\" 7").scale, 7.0);
    assert!(
        (light("LightSource \"infinite\" \"rgb L\" [1 1 1] \"float illuminance\" 3").scale
            - 3.0 / std::f32::consts::PI)
            .abs()
            < 1e-6
    );
    let LightKind::Spot { cone_angle, cone_delta_angle, to, .. } =
        light("LightSource \"spot\" \"point3 to\" [0 1 0]").kind
    else {
        panic!("spot")
    };
    assert_eq!((cone_angle, cone_delta_angle, to), (30.0, 5.0, Vec3::Y));
    let shape = only_shape(
        "AreaLightSource \"diffuse\" \"rgb L\" [4 4 4] \"float power\" 60 \"bool twosided\" true Shape \"sphere\"",
    );
    let area = shape.area_light.expect("a light");
    assert_eq!(
        (area.radiance, area.power, area.two_sided, area.scale),
        (SpectrumDescription::Rgb([4.0; 3]), Some(60.0), true, 1.0)
    );
    assert!(world("AreaLightSource \"diffuse\"").scene.shapes.is_empty());
}

#[test]
fn the_octahedral_map_has_equal_areas() {
    let n = 64;
    let picture = ImageDescription {
        name: String::new(),
        width: n,
        height: n,
        rgb: vec![[1.0; 3]; (n * n) as usize],
        alpha: Vec::new(),
    };
    // A uniform sky of luminance 1 lights a plane with pi; pbrt's factor counts half of it (midpoint rule on 64 x 64 texels: 1e-3).
    let files = Memory(HashMap::from([
        ("s", b"WorldBegin LightSource \"infinite\" \"string filename\" \"sky.hdr\" \"float illuminance\" 1".to_vec()),
        ("sky.hdr", hdr(&picture)),
    ]));
    let light = load_with(&files, "s", &Options::default()).unwrap_or_else(|e| panic!("{e}")).scene.lights[0].clone();
    assert!((light.scale * std::f32::consts::FRAC_PI_2 - 1.0).abs() < 1e-3, "{}", light.scale);
}

/// A Radiance file without run lengths.
fn hdr(picture: &ImageDescription) -> Vec<u8> {
    let mut bytes =
        format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", picture.height, picture.width).into_bytes();
    for rgb in &picture.rgb {
        // Exponent 129 stands for mantissa / 128.
        bytes.extend(rgb.map(|c| (c * 128.0) as u8));
        bytes.push(129);
    }
    bytes
}

#[test]
fn textures_are_made_and_constants_shared() {
    let scene = world(
        "Texture \"c\" \"spectrum\" \"checkerboard\" \"float uscale\" 4 \"rgb tex1\" [1 0 0] \"texture tex2\" \"s\"\nTexture \"s\" \"spectrum\" \"imagemap\" \"string filename\" \"sky.hdr\"\nMaterial \"diffuse\" \"texture reflectance\" \"c\"".replace("\"sky.hdr\"", "\"none.png\"").as_str().replace("\"texture tex2\" \"s\"", "\"rgb tex2\" [1 0 0]").replace("Texture \"s\" \"spectrum\" \"imagemap\" \"string filename\" \"none.png\"\n", "").as_str(),
    )
    .scene;
    let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!("diffuse") };
    let SpectrumTexture::Checkerboard { a, b, mapping: TextureMapping::Uv { scale, .. } } =
        &scene.spectrum_textures[reflectance]
    else {
        panic!("checkerboard")
    };
    assert_eq!((a, scale.x), (b, 4.0));
    assert_eq!(scene.spectrum_textures[*a].clone_constant(), SpectrumDescription::Rgb([1.0, 0.0, 0.0]));
}

trait CloneConstant {
    fn clone_constant(&self) -> SpectrumDescription;
}

impl CloneConstant for SpectrumTexture {
    fn clone_constant(&self) -> SpectrumDescription {
        match self {
            SpectrumTexture::Constant(v) => v.clone(),
            other => panic!("not constant: {other:?}"),
        }
    }
}

// Texts of errors.

#[test]
fn errors_have_exact_texts() {
    let cases = [
        (
            "Camera \"perspective\" \"float fv\" 30\nWorldBegin",
            "scene.pbrt:1:29: camera \"perspective\" has no parameter `fv`",
            "did you mean `fov`? accepted: ",
        ),
        ("WorldBegin\n  Shpe \"sphere\"", "scene.pbrt:2:3: `Shpe` is no directive", "did you mean `Shape`?"),
        (
            "WorldBegin\nWorldEnd",
            "scene.pbrt:2:1: `WorldEnd` is pbrt-v3 syntax",
            "remove it: in pbrt-v4 the world ends with the file",
        ),
        (
            "Film \"rgb\" \"float scale\" 2\nWorldBegin",
            "scene.pbrt:1:19: film \"rgb\" has no parameter `scale`",
            "pbrt-v3 syntax: write `float iso` with 100 times the value",
        ),
        (
            "WorldBegin Material \"matte\"",
            "scene.pbrt:1:22: `matte` is no type of material",
            "pbrt-v3 syntax: write `diffuse` with `reflectance`",
        ),
        (
            "WorldBegin Material \"diffuse\" \"color reflectance\" [1 1 1]",
            "scene.pbrt:1:32: `color` is no type of parameters",
            "pbrt-v3 syntax: write `rgb`",
        ),
        (
            "WorldBegin Material \"diffuse\" \"float reflectance\" 1",
            "scene.pbrt:1:32: `reflectance` of material \"diffuse\" is not of type float",
            "write `rgb|spectrum|blackbody|texture reflectance`",
        ),
        (
            "WorldBegin NamedMaterial \"gold\" Shape \"sphere\"",
            "scene.pbrt:1:27: no material `gold` is defined",
            "defined: none",
        ),
        (
            "WorldBegin Material \"subsurface\" \"string name\" \"skin1\"",
            "scene.pbrt:1:48: `skin1` is no named medium",
            "did you mean `Skin1`? accepted: Apple, ",
        ),
        (
            "WorldBegin MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"float g\" 1.2",
            "scene.pbrt:1:70: g = 1.2 is outside (-1, 1)",
            "",
        ),
        ("WorldBegin Shape \"sphere\" \"float radius\" [1 2]", "scene.pbrt:1:34: `radius` takes 1 number, 2 given", ""),
        (
            "WorldBegin Shape \"sphere\" \"float radius\" \"1\"",
            "scene.pbrt:1:43: `radius` expects a number here, without quotes",
            "",
        ),
        (
            "WorldBegin Include \"none.pbrt\"",
            "scene.pbrt:1:21: file `none.pbrt` is not there",
            "paths are relative to the folder of the main scene file",
        ),
        ("WorldBegin \"sphere", "scene.pbrt:1:12: this string has no closing quote on its line", ""),
        (
            "Shape \"sphere\"",
            "scene.pbrt:1:1: Shape must come after WorldBegin",
            "is this file meant to be included by another?",
        ),
        ("WorldBegin Camera \"perspective\"", "scene.pbrt:1:12: Camera must come before WorldBegin", ""),
        ("", "scene.pbrt:1:1: the file ends without WorldBegin", ""),
        ("WorldBegin Rotate 1 2 x 4", "scene.pbrt:1:23: Rotate expects a number here", ""),
        (
            "WorldBegin Material \"conductor\" \"spectrum eta\" \"metal-Auu-eta\"",
            "scene.pbrt:1:49: `metal-Auu-eta` is no standard spectrum",
            "did you mean `metal-Au-eta`? ",
        ),
    ];
    for (text, expected, help) in cases {
        let found = problem(text);
        assert_eq!(found.0, expected, "{text}");
        assert!(found.1.starts_with(help) && found.1.is_empty() == help.is_empty(), "{text}: {}", found.1);
    }
}

#[test]
fn all_unknown_parameters_are_reported_at_once_in_the_order_of_the_text() {
    let error = load_text("Camera \"perspective\" \"float a\" 1 \"float b\" 2\nWorldBegin\nShape \"sphere\" \"float c\" 3\nMaterial \"diffuse\" \"float d\" 1").expect_err("errors");
    let places: Vec<(u32, u32)> =
        error.problems().iter().map(|p| p.place.as_ref().map_or((0, 0), |p| (p.line, p.column))).collect();
    assert_eq!(places, [(1, 29), (1, 41), (3, 23), (4, 27)]);
    assert_eq!(error.to_string(), "scene.pbrt:1:29: camera \"perspective\" has no parameter `a` (and 3 more)");
    assert_eq!(error.related().expect("more").count(), 3);
    let lenient = Options { lenient: true, ..Options::default() };
    let loaded = load_with(&files(&[("s", "WorldBegin Shape \"sphere\" \"float c\" 3 Flim \"rgb\"")]), "s", &lenient)
        .expect("a scene");
    assert_eq!(loaded.warnings.len(), 2);
}

#[test]
fn the_word_is_underlined_even_on_a_very_long_line() {
    let text = format!("WorldBegin Shape \"trianglemesh\" \"point3 P\" [{}] \"float sigm\" 3", "0 1 2 ".repeat(5000));
    let error = load_text(&text).expect_err("an error");
    let shown = format!("{:?}", miette::Report::new(error));
    assert!(shown.contains("sigm") && shown.len() < 4000, "{}", shown.len());
}

#[test]
fn missing_files_are_listed_once_when_only_the_text_matters() {
    let text = "WorldBegin Include \"a.pbrt\" Shape \"plymesh\" \"string filename\" \"b.ply\" Shape \"plymesh\" \"string filename\" \"b.ply\"\nNamedMaterial \"from a\" Shape \"sphere\"";
    let options = Options { syntax_only: true, ..Options::default() };
    let loaded = load_with(&files(&[("s", text)]), "s", &options).expect("missing files are no errors here");
    assert_eq!(loaded.missing.len(), 2);
    assert!(load_text(text).is_err());
}

#[test]
fn files_that_include_themselves_end_with_a_message() {
    let list = files(&[("s", "WorldBegin Include \"s2\""), ("s2", "Include \"s2\"")]);
    let error = load_with(&list, "s", &Options::default()).expect_err("an error");
    assert_eq!(error.problems()[0].message, "files include each other more than 32 levels deep");
}

#[test]
fn quirks_of_real_files_are_understood() {
    // Blanks in a declaration, a parameter given twice (the last counts), an area light without a shape, an open block.
    let loaded = world(
        "AttributeBegin LightSource \"point\" \" float  scale \" 2 \"float scale\" 3 AreaLightSource \"diffuse\"",
    );
    assert_eq!(loaded.scene.lights[0].scale, 3.0);
    assert_eq!(loaded.warnings.len(), 1);
    // A material used above its definition: pbrt looks names up at the end.
    let loaded = world("NamedMaterial \"m\" Shape \"sphere\" MakeNamedMaterial \"m\" \"string type\" \"dielectric\"");
    assert!(matches!(loaded.scene.materials[loaded.scene.shapes[0].material].kind, MaterialKind::Dielectric { .. }));
    assert_eq!(loaded.warnings[0].message, "material `m` is used above its definition");
}

#[test]
fn the_hash_covers_every_file() {
    let hash = |included: &str| {
        let list = files(&[("s", "WorldBegin Include \"a\""), ("a", included)]);
        load_with(&list, "s", &Options::default()).expect("a scene").hash
    };
    assert_eq!(hash("Identity"), hash("Identity"));
    assert_ne!(hash("Identity"), hash("Identity "));
}

// A whole scene.

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
    let MediumKind::Homogeneous { sigma_a, sigma_s, scale, g, emission } = &s.media[0].kind;
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

// Damaged input.

/// A small generator of pseudo-random numbers [Marsaglia2003, xorshift64], fixed seed per test.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % n.max(1) as u64) as usize
    }
}

const PIECES: [&str; 24] = [
    "[",
    "]",
    "\"",
    "\\",
    "#",
    "\n",
    "-1e999",
    "nan",
    "1e-40",
    "99999999999",
    "AttributeBegin ",
    "AttributeEnd ",
    "ObjectBegin \"o\" ",
    "ObjectEnd ",
    "ObjectInstance \"o\" ",
    "Include \"scene.pbrt\" ",
    "Import \"scene.pbrt\" ",
    "Scale 0 0 0 ",
    "WorldBegin ",
    "\"float x\" ",
    "Shape \"bilinearmesh\" ",
    "Texture \"t\" \"float\" \"mix\" ",
    "\u{0}",
    "\u{fffd}",
];

#[test]
fn damaged_scenes_never_panic() {
    let seeds = [
        MILK,
        "WorldBegin Texture \"t\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [1 0 0] Material \"subsurface\" \"texture reflectance\" \"t\" \"rgb mfp\" [1 2 3] ObjectBegin \"o\" Shape \"loopsubdiv\" \"integer levels\" 1 \"point3 P\" [1 1 1  -1 -1 1  -1 1 -1  1 -1 -1] \"integer indices\" [0 1 2 0 3 1 0 2 3 1 3 2] ObjectEnd ObjectInstance \"o\" Shape \"bilinearmesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0  1 1 1] Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] Attribute \"material\" \"string moonmilk.set\" \"s\" MakeNamedMaterial \"a\" \"string type\" \"coatedconductor\" Material \"mix\" \"string materials\" [\"a\" \"a\"] LightSource \"spot\" LightSource \"infinite\" \"blackbody L\" 3000",
    ];
    let mut dice = Dice(0x9e37_79b9_7f4a_7c15);
    let mut failed = 0;
    for round in 0..6000 {
        let mut bytes = seeds[round % 2].as_bytes().to_vec();
        for _ in 0..1 + dice.roll(4) {
            let (a, b) = (dice.roll(bytes.len()), dice.roll(bytes.len()));
            match dice.roll(5) {
                0 => drop(bytes.drain(a.min(b)..a.max(b).min(a.min(b) + 40))),
                1 => bytes[a] = dice.roll(256) as u8,
                2 => drop(bytes.splice(a..a, PIECES[dice.roll(PIECES.len())].bytes())),
                3 => bytes.truncate(a.max(1)),
                _ => {
                    let piece = bytes[a.min(b)..a.max(b).min(a.min(b) + 60)].to_vec();
                    drop(bytes.splice(a..a, piece));
                }
            }
            if bytes.is_empty() {
                bytes.push(b' ');
            }
        }
        let list = Memory(HashMap::from([("scene.pbrt", bytes)]));
        let options = Options { lenient: dice.roll(2) == 0, syntax_only: dice.roll(2) == 0, ..Options::default() };
        match load_with(&list, "scene.pbrt", &options) {
            Ok(_) => {}
            Err(error) => {
                failed += 1;
                assert!(!error.to_string().is_empty());
                if round % 50 == 0 {
                    assert!(!format!("{:?}", miette::Report::new(error)).is_empty());
                }
            }
        }
    }
    // The mutations must reach both outcomes, else they test nothing.
    assert!(failed > 1000 && failed < 5900, "{failed}");
}

// Real files.

#[test]
fn all_scenes_of_other_people_are_read_to_the_end() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    if !folder.is_dir() {
        println!("skipped: there is no folder {}", folder.display());
        return;
    }
    let mut scenes: Vec<PathBuf> = Vec::new();
    let mut folders = vec![folder];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "pbrt") {
                scenes.push(path);
            }
        }
    }
    scenes.sort();
    let (mut complete, mut unexpected) = (0, Vec::new());
    for path in &scenes {
        let name = path.display().to_string();
        // Three million instances: right, but too slow for a test.
        if name.ends_with("menger/scene.pbrt") {
            println!("skipped: {name}");
            continue;
        }
        let options = Options { syntax_only: true, ..Options::default() };
        match load_from_disk(path, &options) {
            Ok(loaded) if loaded.missing.is_empty() => complete += 1,
            Ok(loaded) => println!("skipped: {name} misses {} files", loaded.missing.len()),
            // Scenes that pbrt-v4 refuses too: old syntax, unknown names, a part of another scene.
            Err(error) => {
                println!("refused: {error}");
                let known = [
                    "zero-day/frame35.pbrt",
                    "menger/instancing/instancer_1.pbrt",
                    "prism_dispersion.pbrt",
                    "all_mtypes.pbrt",
                ];
                if !known.iter().any(|k| name.ends_with(k)) {
                    unexpected.push(format!("{name}: {error}"));
                }
            }
        }
    }
    println!("{complete} of {} scenes are complete", scenes.len());
    assert!(unexpected.is_empty(), "{unexpected:#?}");
}
