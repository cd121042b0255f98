//! `check`: what it finds, its exit codes, and that it says where and what to do.

use crate::common::{BALL, CLOUD, FLOOR, Folder, LIGHTS, head};

/// A tetrahedron of a `subsurface` material, with some of its four triangles.
fn tetrahedron(indices: &str) -> String {
    format!(
        "Material \"subsurface\" \"rgb sigma_s\" [3 3 3] \"rgb sigma_a\" [.1 .1 .1]\nShape \"trianglemesh\" \"point3 P\" [1 1 1  -1 -1 1  -1 1 -1  1 -1 -1] \"integer indices\" [{indices}]\n"
    )
}

#[test]
fn a_sound_scene_passes_with_its_figures() {
    let f = Folder::with_scene(&[&head([16, 16], 4), LIGHTS, FLOOR, CLOUD, BALL]);
    // The ball of radius .9 lies in the cloud of radius 1.
    let r = f.succeed("check scene.pbrt --unit cm");
    // 4 V / S of a ball is 4/3 of its radius.
    assert!(r.stdout.contains("mean chord 4V/S 1.333 cm") && r.stdout.contains("volume 4.189 cm^3"), "{r:?}");
    assert!(r.stdout.contains("mean free paths (red, green, blue): 5.467  4.267  3.2"), "{r:?}");
    assert!(r.stdout.contains("4 eta^2 V/S = 2.352 cm (eta 1.4)"), "{r:?}");
    assert!(r.stdout.contains("0 problems, 0 notes"), "{r:?}");
}

#[test]
fn faults_are_named_with_object_and_place_and_end_with_code_4() {
    let f = Folder::new();
    f.write("open.pbrt", [&head([16, 16], 4), LIGHTS, &tetrahedron("0 2 1 0 1 3 0 3 2")].concat());
    let r = f.run("check open.pbrt");
    assert_eq!(r.code, Some(4), "{r:?}");
    assert!(
        r.stdout.contains("problem: open.pbrt:15:1: trianglemesh is open: 3 of its 6 edges")
            && r.stdout.contains("--open cap"),
        "{r:?}"
    );
    f.write("dark.pbrt", head([16, 16], 4) + &tetrahedron("0 2 1 0 1 3 0 3 2 1 2 3"));
    let r = f.run("check dark.pbrt");
    assert!(r.code == Some(4) && r.stdout.contains("the scene has no light"), "{r:?}");
    let r = f.run("check dark.pbrt --log-format json");
    let document: serde_json::Value = serde_json::from_str(&r.stdout).expect("one JSON document");
    assert_eq!((r.code, document["findings"][0]["code"].as_str()), (Some(4), Some("no-light")), "{document}");
    assert_eq!(document["objects"][0]["closed"], true, "{document}");
    // A scene that cannot be read is another matter.
    f.write("wrong.pbrt", [&head([16, 16], 4), "Shpe \"sphere\"\n"].concat());
    assert_eq!(f.run("check wrong.pbrt").code, Some(3));
    assert_eq!(f.run("check nowhere.pbrt").code, Some(3));
    assert_eq!(f.run("check open.pbrt --unit parsec").code, Some(2));
}

#[test]
fn an_open_mesh_is_refused_with_the_ways_out_and_a_profile_renders_it() {
    let f = Folder::new();
    f.write("open.pbrt", [&head([8, 8], 2), LIGHTS, &tetrahedron("0 2 1 0 1 3 0 3 2")].concat());
    let r = f.run("render open.pbrt -o a.exr");
    assert!(r.code == Some(3) && r.stderr.contains("--open cap|profile|kill"), "{r:?}");
    for (options, told) in [
        ("--open cap", "closed with flat caps"),
        ("--open kill", "counted as lost"),
        ("--open profile", "open (3 boundary edges): the profile tabulated renders it"),
        ("--subsurface dipole", "open (3 boundary edges): the profile dipole renders it"),
        ("--subsurface dipole --open kill", "the profile dipole renders it"),
        ("--subsurface dipole --open cap", "closed with flat caps"),
    ] {
        let r = f.succeed(&format!("render open.pbrt {options} -o a.exr"));
        assert!(r.stderr.contains(told), "{options}: {r:?}");
    }
}

#[test]
fn syntax_reads_on_past_missing_files_and_names_each_once() {
    let f = Folder::new();
    let mesh = "Shape \"plymesh\" \"string filename\" \"geometry/a.ply\"\n";
    let text =
        [&head([16, 16], 4), LIGHTS, "Include \"part.pbrt\"\n", mesh, mesh, "NamedMaterial \"of the part\"\n", FLOOR]
            .concat();
    f.write("scene.pbrt", &text);
    let r = f.run("check scene.pbrt --syntax");
    assert_eq!(r.code, Some(4), "{r:?}");
    let missing: Vec<&str> = r.stdout.lines().filter(|l| l.starts_with("missing")).collect();
    assert_eq!(
        missing,
        [
            "missing  scene.pbrt:14:10: file `part.pbrt` is not there",
            "missing  scene.pbrt:15:36: file `geometry/a.ply` is not there"
        ]
    );
    assert!(r.stdout.contains("2 missing files"), "{r:?}");
    // Faults of the text are all told, missing files as well, with code 3.
    f.write("scene.pbrt", text.replace("Translate -1 3 -1", "Translate -1 3").replace("Rotate -90", "Rotat -90"));
    let r = f.run("check scene.pbrt --syntax");
    assert_eq!(r.code, Some(3), "{r:?}");
    for told in ["scene.pbrt:11:", "did you mean `Rotate`?", "part.pbrt", "geometry/a.ply"] {
        assert!(r.stderr.contains(told), "{told}: {}", r.stderr);
    }
    f.write("part.pbrt", "");
    f.write("scene.pbrt", [&head([16, 16], 4), LIGHTS, "Include \"part.pbrt\"\n"].concat());
    assert_eq!(f.succeed("check scene.pbrt --syntax").code, Some(0));
}

#[test]
fn the_furnace_measures_the_scenes_own_objects() {
    let f = Folder::with_scene(&[&head([16, 16], 4), LIGHTS, FLOOR, CLOUD]);
    let r = f.succeed("check scene.pbrt --furnace");
    let line = r.stdout.lines().find(|l| l.contains("path length") && l.contains("radiance")).expect("a measurement");
    assert!(line.contains("+-") && line.ends_with("sound"), "{line}");
    // A mesh whose two halves overlap fails, and its cause is among the findings.
    let twice = "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [1 1 1] \"rgb sigma_a\" [0 0 0]\nMediumInterface \"m\" \"\"\nMaterial \"interface\"\nShape \"trianglemesh\" \"point3 P\" [1 1 1  -1 -1 1  -1 1 -1  1 -1 -1  1.5 1 1  -.5 -1 1  -.5 1 -1  1.5 -1 -1] \"integer indices\" [0 2 1 0 1 3 0 3 2 1 2 3 4 6 5 4 5 7 4 7 6 5 6 7]\n";
    f.write("twice.pbrt", [&head([16, 16], 4), LIGHTS, twice].concat());
    let r = f.run("check twice.pbrt --furnace");
    assert!(r.code == Some(4) && r.stdout.contains("FAILED: light stays for another length"), "{r:?}");
    assert!(r.stdout.contains("has pieces that cut through each other"), "{r:?}");
}
