//! Transforms, blocks, files, and the options above WorldBegin.

use super::*;

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
fn objects_stand_once_in_the_description_and_instances_say_where() {
    let scene = world(
        "ObjectBegin \"o\" Translate 0 1 0 Shape \"sphere\" Shape \"disk\" ObjectEnd\nObjectBegin \"unused\" Shape \"disk\" ObjectEnd\nTranslate 5 0 0 ObjectInstance \"o\" Translate 5 0 0 ObjectInstance \"o\"",
    )
    .scene;
    assert!(scene.shapes.is_empty());
    let [object] = scene.objects.as_slice() else { panic!("one object has instances: {:?}", scene.objects) };
    assert_eq!((object.name.as_str(), object.shapes.len()), ("o", 2));
    assert!(close(object.shapes[1].object_to_world, Mat4::from_translation(Vec3::Y)));
    let places: Vec<_> = scene.instances.iter().map(|i| (i.object, i.object_to_world)).collect();
    assert_eq!(places.len(), 2);
    assert!(places.iter().all(|p| p.0 == 0));
    assert!(close(places[0].1, Mat4::from_translation(Vec3::X * 5.0)));
    assert!(close(places[1].1, Mat4::from_translation(Vec3::X * 10.0)));
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

#[test]
fn color_spaces_are_part_of_the_state_and_converted() {
    let loaded = world(
        r#"Attribute "material" "rgb reflectance" [.1 .2 .3]
        AttributeBegin
          ColorSpace "Rec2020"
          Material "diffuse" "rgb reflectance" [.5 .5 .5]
          Material "diffuse" "rgb reflectance" [.2 .3 .1]
          Material "diffuse" "rgb reflectance" [0 1 0]
          Material "diffuse"
          ColorSpace "aces2065-1"
          LightSource "point"
        AttributeEnd
        LightSource "point"
        Material "diffuse" "rgb reflectance" [.2 .3 .1]"#,
    );
    let s = &loaded.scene;
    let rgb = |d: &SpectrumDescription| if let SpectrumDescription::Rgb(c) = d { *c } else { panic!("{d:?}") };
    let colour = |material: usize| match &s.materials[material].kind {
        MaterialKind::Diffuse { reflectance } => match &s.spectrum_textures[*reflectance] {
            SpectrumTexture::Constant(d) => rgb(d),
            other => panic!("{other:?}"),
        },
        other => panic!("{other:?}"),
    };
    let near =
        |a: [f32; 3], b: [f32; 3], e: f32| assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < e), "{a:?} {b:?}");
    near(colour(1), [0.5; 3], 1e-5);
    // ITU-R BT.2087 with four digits.
    near(colour(2), [0.1485, 0.3141, 0.0781], 2e-3);
    // Pure green of Rec. 2020 has the luminance .678 and no red.
    let green = colour(3);
    assert!(green[0] < 1e-6 && green[1] < 1.0 && green[2] > 0.0, "{green:?}");
    near([0.2126 * green[0] + 0.7152 * green[1] + 0.0722 * green[2]; 3], [0.678; 3], 2e-3);
    assert_eq!((colour(4), colour(5)), ([0.1, 0.2, 0.3], [0.2, 0.3, 0.1]));
    let light = |i: usize| match &s.lights[i].kind {
        LightKind::Point { intensity, .. } => rgb(intensity),
        other => panic!("{other:?}"),
    };
    // The white of ACES is a little warmer than D65.
    assert!(light(0)[0] > 1.02 && light(0)[2] < 0.98, "{:?}", light(0));
    assert_eq!(light(1), [1.0; 3]);
    let messages: Vec<&str> = loaded.warnings.iter().map(|w| w.message.as_str()).collect();
    assert_eq!(messages.len(), 1, "{messages:?}");
    assert!(messages[0].starts_with("colour (0 1 0) of rec2020 lies outside sRGB: it is desaturated"), "{messages:?}");
    let (text, help) = problem("ColorSpace \"rec202\" WorldBegin");
    assert_eq!(text, "scene.pbrt:1:13: `rec202` is no color space");
    assert!(help.starts_with("did you mean `rec2020`?"), "{help}");
    let film = load_text("ColorSpace \"rec2020\" Film \"rgb\" WorldBegin").expect("a scene");
    assert!(film.warnings[0].message.contains("written in linear sRGB"));
}

#[test]
fn realistic_cameras_become_thin_lenses_of_the_same_field_of_view() {
    // A thin biconvex lens of index 1.5 and radii 50 mm has f = 50 mm; thickness 1e-6 mm. Then the stop.
    let lens = "# a lens\n50 0.000001 1.5 20\n-50 5 1 20\n0 5 0 10\n";
    let main = "Film \"rgb\" \"integer xresolution\" 300 \"integer yresolution\" 200 \"float diagonal\" 43.2666
        Camera \"realistic\" \"string lensfile\" \"lens.dat\" \"float focusdistance\" 5 \"float aperturediameter\" 4 WorldBegin";
    let list = files(&[("s", main), ("lens.dat", lens)]);
    let loaded = load_with(&list, "s", &Options::default()).unwrap_or_else(|e| panic!("{e}"));
    let camera = &loaded.scene.camera;
    let CameraKind::Perspective { fov } = camera.kind else { panic!("{:?}", camera.kind) };
    // The shorter side is 24 mm, the image at 1 / (1 / 50 - 1 / 5000) mm.
    let image = 1.0 / (1.0 / 50.0 - 1.0 / 5000.0);
    let expected = 2.0 * (12.0f32 / image).atan().to_degrees();
    assert!((fov - expected).abs() < 1e-3, "{fov} {expected}");
    assert_eq!((camera.lens_radius, camera.focal_distance), (0.002, 5.0));
    assert_eq!(loaded.warnings.len(), 1);
    assert!(loaded.warnings[0].message.contains("50.0 mm"), "{:?}", loaded.warnings);
    let bad = files(&[("s", main), ("lens.dat", "50 1 1.5")]);
    let error = load_with(&bad, "s", &Options::default()).expect_err("a bad lens").to_string();
    assert!(error.contains("lens.dat: 3 numbers; rows of curvature radius"), "{error}");
    let (text, _) = problem("Camera \"realistic\" WorldBegin");
    assert_eq!(text, "scene.pbrt:1:1: a realistic camera needs `string lensfile`");
}

#[test]
fn options_that_would_change_the_picture_are_reported() {
    let warnings = |text: &str| load_text(&format!("{text} WorldBegin")).expect("a scene").warnings;
    for (option, what) in
        [("forcediffuse", "materials"), ("disablepixeljitter", "filter"), ("disable-wavelength-jitter", "random")]
    {
        let list = warnings(&format!("Option \"{option}\" true"));
        assert!(list.len() == 1 && list[0].message.contains(what), "{option}: {list:?}");
        assert!(warnings(&format!("Option \"{option}\" false")).is_empty());
    }
    assert!(warnings("Option \"rendercoordsys\" \"world\" Option \"bool gpu\" true").is_empty());
}
