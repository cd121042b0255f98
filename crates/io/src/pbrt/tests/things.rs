//! Shapes, materials, media, lights, textures.

use moonmilk_core::Vec2;

use super::*;

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
    assert_eq!(text, "scene.pbrt:1:48: `sigma_a` is given without `sigma_s`");
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
        assert_eq!(stand_in, kind == "measured", "{kind}");
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
    let MediumKind::Homogeneous { scale, g, emission, .. } = &scene.media[0].kind else { panic!("homogeneous") };
    assert_eq!((*scale, *g, emission.clone()), (3.0, 0.5, Some((SpectrumDescription::Blackbody(3000.0), 1.0))));
}

#[test]
fn fields_are_read_with_their_box_and_transform() {
    let kinds = world(
        "Translate 1 2 3 Scale 2 2 2
        MakeNamedMedium \"d\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"integer nz\" 2 \"float density\" [0 1 2 3] \"float scale\" 4
            \"point3 p0\" [-1 -1 -1] \"spectrum sigma_a\" [400 0 800 0] \"float g\" .3 \"float temperature\" [1 2 3 4] \"float temperaturecutoff\" 2
        MakeNamedMedium \"c\" \"string type\" \"rgbgrid\" \"integer ny\" 2 \"rgb sigma_a\" [0 1 2 3 4 5] \"rgb Le\" [1 1 1 2 2 2] \"float Lescale\" 7
        MakeNamedMedium \"w\" \"string type\" \"cloud\" \"float wispiness\" 3",
    )
    .scene
    .media
    .into_iter()
    .map(|m| m.kind)
    .collect::<Vec<_>>();
    let [MediumKind::Densities(d), MediumKind::Colours(c), MediumKind::Cloud(w)] = kinds.as_slice() else {
        panic!("{kinds:?}")
    };
    assert_eq!((d.size, d.density.as_slice(), d.scale, d.g), ([2, 1, 2], &[0.0, 1.0, 2.0, 3.0][..], 4.0, 0.3));
    assert_eq!((d.bounds.p0, d.bounds.p1), (Vec3::splat(-1.0), Vec3::ONE));
    assert_eq!(d.bounds.medium_to_world.transform_point3(Vec3::ONE), Vec3::new(3.0, 4.0, 5.0));
    assert_eq!(d.sigma_s, SpectrumDescription::Constant(1.0));
    assert!(matches!(&d.emission, GridEmission::Temperature { values, offset: 2.0, scale: 1.0 } if values.len() == 4));
    assert_eq!((c.sigma_a.len(), c.sigma_s.len(), c.emission[1], c.emission_scale), (2, 0, [2.0; 3], 7.0));
    assert_eq!((w.wispiness, w.frequency, w.density), (3.0, 5.0, 1.0));
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
        "Texture \"c\" \"spectrum\" \"checkerboard\" \"float uscale\" 4 \"rgb tex1\" [1 0 0] \"rgb tex2\" [1 0 0]
        Material \"diffuse\" \"texture reflectance\" \"c\"",
    )
    .scene;
    let MaterialKind::Diffuse { reflectance } = scene.materials[1].kind else { panic!("diffuse") };
    let SpectrumTexture::Checkerboard { a, b, mapping: TextureMapping::Uv { scale, .. } } =
        &scene.spectrum_textures[reflectance]
    else {
        panic!("checkerboard")
    };
    assert_eq!((a, scale.x), (b, 4.0));
    assert!(matches!(
        scene.spectrum_textures[*a],
        SpectrumTexture::Constant(SpectrumDescription::Rgb([1.0, 0.0, 0.0]))
    ));
}

#[test]
fn every_class_of_textures_is_made() {
    let scene = world(
        r#"Translate 1 0 0
        Texture "dots" "float" "dots" "float inside" 2 "float uscale" 4
        Texture "bilerp" "float" "bilerp" "float v10" 3 "float v01" 7
        Texture "fbm" "float" "fbm" "integer octaves" 5 "float roughness" 0.7
        Texture "wrinkled" "float" "wrinkled"
        Texture "windy" "float" "windy"
        Texture "dir" "float" "directionmix" "vector3 dir" [0 0 2] "float tex1" 0.25 "float tex2" 0.75
        Texture "marble" "spectrum" "marble" "float scale" 2 "float variation" 0.1
        Texture "sdots" "spectrum" "dots" "rgb inside" [1 0 0] "string mapping" "planar" "vector3 v1" [0 0 1]
        Texture "sbilerp" "spectrum" "bilerp" "rgb v11" [0 1 0] "string mapping" "spherical"
        Texture "cyl" "spectrum" "checkerboard" "string mapping" "cylindrical"
        Texture "solid" "spectrum" "checkerboard" "integer dimension" 3"#,
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let s = scene.scene;
    let moved = Mat4::from_translation(-Vec3::X);
    let value = |id: usize| if let FloatTexture::Constant(v) = s.float_textures[id] { v } else { f32::NAN };
    let mut seen = 0;
    for t in &s.float_textures {
        seen += 1;
        match t {
            FloatTexture::Constant(_) => seen -= 1,
            FloatTexture::Dots { mapping: TextureMapping::Uv { scale, .. }, inside, outside } => {
                assert_eq!((scale.x, value(*inside), value(*outside)), (4.0, 2.0, 0.0));
            }
            FloatTexture::Bilerp { v, .. } => assert_eq!(*v, [0.0, 3.0, 7.0, 1.0]),
            FloatTexture::Fbm { to_texture, octaves, roughness } => {
                assert_eq!((*to_texture, *octaves, *roughness), (moved, 5, 0.7));
            }
            FloatTexture::Wrinkled { octaves, roughness, .. } => assert_eq!((*octaves, *roughness), (8, 0.5)),
            FloatTexture::Windy(m) => assert_eq!(*m, moved),
            FloatTexture::DirectionMix { a, b, dir } => assert_eq!((value(*a), value(*b), *dir), (0.75, 0.25, Vec3::Z)),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(seen, 6);
    let colour =
        |id: usize| if let SpectrumTexture::Constant(c) = &s.spectrum_textures[id] { c.clone() } else { panic!() };
    for t in &s.spectrum_textures {
        seen += 1;
        match t {
            SpectrumTexture::Constant(_) => seen -= 1,
            SpectrumTexture::Marble { to_texture, octaves, roughness, scale, variation } => {
                assert_eq!((*to_texture, *octaves, *roughness, *scale, *variation), (moved, 8, 0.5, 2.0, 0.1));
            }
            SpectrumTexture::Dots { mapping: TextureMapping::Planar { v1, .. }, inside, .. } => {
                assert_eq!((*v1, colour(*inside)), (Vec3::Z, SpectrumDescription::Rgb([1.0, 0.0, 0.0])));
            }
            SpectrumTexture::Bilerp { mapping: TextureMapping::Spherical(m), v } => {
                assert_eq!((*m, colour(v[3])), (moved, SpectrumDescription::Rgb([0.0, 1.0, 0.0])));
            }
            SpectrumTexture::Checkerboard { mapping: TextureMapping::Cylindrical(m), .. } => assert_eq!(*m, moved),
            SpectrumTexture::Checkerboard { mapping: TextureMapping::Point(m), .. } => assert_eq!(*m, moved),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(seen, 11);
}

#[test]
fn classes_of_the_other_kind_and_too_many_octaves_are_errors() {
    let (text, help) = problem("WorldBegin Texture \"t\" \"float\" \"marble\"");
    assert_eq!(text, "scene.pbrt:1:33: `marble` is no class of float textures");
    assert!(help.starts_with("it exists as spectrum texture only"), "{help}");
    let (text, _) = problem("WorldBegin Texture \"t\" \"float\" \"fbm\" \"integer octaves\" 65");
    assert_eq!(text, "scene.pbrt:1:56: octaves = 65 is outside [0, 64]");
    let (text, help) = problem("WorldBegin Texture \"t\" \"spectrum\" \"dotts\"");
    assert_eq!(text, "scene.pbrt:1:36: `dotts` is no class of spectrum textures");
    assert!(help.starts_with("did you mean `dots`?"), "{help}");
}

/// The only light of a world that may use the picture `sky.hdr`, n by m pixels.
fn light_with_picture(text: &str, width: u32, height: u32) -> Result<LightDescription, LoadError> {
    let rgb = vec![[1.0; 3]; (width * height) as usize];
    let picture = ImageDescription { name: String::new(), width, height, rgb, alpha: Vec::new() };
    let files = Memory(HashMap::from([
        ("s", format!("WorldBegin Translate 0 0 5 {text}").into_bytes()),
        ("sky.hdr", hdr(&picture)),
    ]));
    load_with(&files, "s", &Options::default()).map(|l| l.scene.lights[0].clone())
}

#[test]
fn lights_with_pictures_are_read_in_pbrts_frames() {
    let text = "LightSource \"goniometric\" \"rgb I\" [1 2 3] \"string filename\" \"sky.hdr\" \"float power\" 9 \"float scale\" 2";
    let l = light_with_picture(text, 4, 4).unwrap_or_else(|e| panic!("{e}"));
    assert!(matches!(
        l.kind,
        LightKind::Goniometric { intensity: SpectrumDescription::Rgb([1.0, 2.0, 3.0]), image: 0 }
    ));
    assert_eq!((l.power, l.scale), (Some(9.0), 2.0));
    // The picture's up is the light's y.
    assert!(l.light_to_world.transform_point3(Vec3::Z).distance(Vec3::new(0.0, 1.0, 5.0)) < 1e-6);
    let text = "LightSource \"projection\" \"string filename\" \"sky.hdr\" \"float fov\" 30";
    let l = light_with_picture(text, 4, 2).unwrap_or_else(|e| panic!("{e}"));
    assert!(matches!(l.kind, LightKind::Projection { fov: 30.0, image: 0 }));
    assert!(l.light_to_world.transform_point3(Vec3::NEG_Y).distance(Vec3::new(0.0, 1.0, 5.0)) < 1e-6);
    let error = light_with_picture("LightSource \"goniometric\" \"string filename\" \"sky.hdr\"", 4, 2)
        .expect_err("not square");
    assert_eq!(error.to_string(), "s:1:73: sky.hdr: 4 x 2 pixels, but a goniometric light takes a square picture");
    assert!(problem("WorldBegin LightSource \"projection\"").0.contains("needs `string filename`"));
    let even = world("LightSource \"goniometric\" \"rgb I\" [1 1 1]");
    assert!(even.warnings[0].message.contains("equally in all directions"));
    assert!(matches!(even.scene.lights[0].kind, LightKind::Point { .. }));
}

#[test]
fn patches_have_their_own_parameters_as_texture_coordinates() {
    let text = "Shape \"bilinearmesh\" \"point3 P\" [0 0 0  1 0 0  0 1 0  1 1 0  2 0 0  2 1 0] \"integer indices\" [0 1 2 3  1 4 3 5]";
    let GeometryDescription::Mesh { positions, uvs, indices, .. } = &*only_shape(text).geometry else {
        panic!("a mesh")
    };
    assert_eq!((positions.len(), uvs.len(), indices.len()), (8, 8, 4));
    assert_eq!((uvs[0], uvs[3], uvs[4], uvs[7]), (Vec2::ZERO, Vec2::ONE, Vec2::ZERO, Vec2::ONE));
    assert_eq!(positions[7], Vec3::new(2.0, 1.0, 0.0));
}

#[test]
fn a_displaced_mesh_has_a_material_of_its_own_with_a_bump_map() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let main = "WorldBegin Texture \"d\" \"float\" \"wrinkled\" Material \"dielectric\" Shape \"plymesh\" \"string filename\" \"a.ply\"
        Shape \"plymesh\" \"string filename\" \"a.ply\" \"texture displacement\" \"d\" \"float displacement.edgelength\" 0.1
        Shape \"plymesh\" \"string filename\" \"a.ply\" \"texture displacement\" \"d\"
        Texture \"e\" \"float\" \"fbm\" Material \"diffuse\" \"texture displacement\" \"e\" Shape \"sphere\"";
    let loaded =
        load_with(&files(&[("s", main), ("a.ply", ply)]), "s", &Options::default()).unwrap_or_else(|e| panic!("{e}"));
    let s = &loaded.scene;
    let bumps: Vec<bool> = s.shapes.iter().map(|x| s.materials[x.material].displacement.is_some()).collect();
    assert_eq!(bumps, [false, true, true, true]);
    assert_eq!(s.shapes[1].material, s.shapes[2].material);
    assert!(matches!(s.materials[s.shapes[1].material].kind, MaterialKind::Dielectric { .. }));
    assert_eq!(loaded.warnings.len(), 2);
    assert!(loaded.warnings.iter().all(|w| w.message.contains("read as a bump map")), "{:?}", loaded.warnings);
}

#[test]
fn hair_has_its_colour_in_four_forms() {
    let of = |parameters: &str| {
        let loaded = world(&format!("Material \"hair\" {parameters}"));
        let MaterialKind::Hair { absorption, .. } = loaded.scene.materials[1].kind.clone() else { panic!("hair") };
        let value =
            |id: usize| if let FloatTexture::Constant(v) = loaded.scene.float_textures[id] { v } else { f32::NAN };
        let found = match absorption {
            HairAbsorption::Coefficient(_) => (0, 0.0, 0.0),
            HairAbsorption::Reflectance(_) => (1, 0.0, 0.0),
            HairAbsorption::Pigments { eumelanin, pheomelanin } => (2, value(eumelanin), value(pheomelanin)),
        };
        (found, loaded.warnings.len())
    };
    assert_eq!(of("\"rgb sigma_a\" [1 2 3] \"float eumelanin\" 1"), ((0, 0.0, 0.0), 1));
    assert_eq!(of("\"rgb color\" [.1 .2 .3]"), ((1, 0.0, 0.0), 0));
    assert_eq!(of("\"float pheomelanin\" 0.5"), ((2, 0.0, 0.5), 0));
    assert_eq!(of(""), ((2, 1.3, 0.0), 0));
}

#[test]
fn curves_become_tubes_that_neighbours_share() {
    let curve = |x: f32, more: &str| {
        format!("Shape \"curve\" \"point3 P\" [{x} 0 0  {x} 1 0  {x} 2 0  {x} 3 0] \"float width\" 0.2 {more}\n")
    };
    let loaded = world(
        &(curve(0.0, "")
            + &curve(1.0, "")
            + "Translate 1 0 0\n"
            + &curve(0.0, "")
            + "Material \"hair\"\n"
            + &curve(0.0, "")),
    );
    let s = &loaded.scene;
    assert_eq!((s.shapes.len(), loaded.warnings.len()), (3, 0));
    let GeometryDescription::Mesh { positions, normals, uvs, indices } = &*s.shapes[0].geometry else {
        panic!("a mesh")
    };
    // Straight curves are one piece of 6 sides, 7 vertices around at both ends.
    assert_eq!((positions.len(), normals.len(), uvs.len(), indices.len()), (28, 28, 28, 24));
    // Half the perimeter of a hexagon over pi times the width: the mean projected width is .2.
    let radius = 0.2 * std::f32::consts::PI / 6.0;
    for (p, n) in positions[..14].iter().zip(normals) {
        assert!((p.with_y(0.0).length() - radius).abs() < 1e-6 && n.y.abs() < 1e-6 && p.with_y(0.0).dot(*n) > 0.0);
    }
    for t in indices {
        let [a, b, c] = t.map(|i| positions[i as usize]);
        let n = t.map(|i| normals[i as usize]).iter().sum::<Vec3>();
        assert!((b - a).cross(c - a).dot(n) > 0.0, "triangles face the way of their normals");
    }
    let ribbon = "\"string type\" \"ribbon\" \"normal N\" [0 0 1 0 0 1]";
    let flat = world(&format!("Material \"hair\" {}", curve(0.0, ribbon)));
    let GeometryDescription::Mesh { positions, normals, .. } = &*flat.scene.shapes[0].geometry else {
        panic!("a mesh")
    };
    assert!(
        positions.iter().all(|p| p.z == 0.0 && (p.x.abs() - 0.1).abs() < 1e-6)
            && normals.iter().all(|n| n.z.abs() > 0.999)
    );
    assert!(flat.warnings[0].message.contains("hair on ribbons"), "{:?}", flat.warnings);
    let (text, help) = problem("WorldBegin Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 1 1 0]");
    assert_eq!(text, "scene.pbrt:1:34: 3 control points make no curve");
    assert_eq!(help, "Bezier segments of degree 3 take 1 + 3 n points");
}

#[test]
fn portals_are_rectangles_in_world_space() {
    let text =
        "Translate 5 0 0 LightSource \"infinite\" \"rgb L\" [1 1 1] \"point3 portal\" [0 0 0  0 1 0  1 1 0  1 0 0]";
    let loaded = world(text);
    assert!(loaded.warnings.is_empty());
    assert_eq!(loaded.scene.lights[0].portal, Some([Vec3::ZERO, Vec3::Y, Vec3::X + Vec3::Y, Vec3::X]));
    let (text, _) = problem("WorldBegin LightSource \"infinite\" \"point3 portal\" [0 0 0 1 1 1]");
    assert_eq!(text, "scene.pbrt:1:43: `portal` takes 4 points, 2 given");
}
