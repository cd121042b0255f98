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
