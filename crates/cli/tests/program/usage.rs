//! What newcomers type.

use crate::common::{Folder, LIGHTS, head};

fn scene() -> Folder {
    Folder::with_scene(&[&head([8, 8], 2), LIGHTS])
}

#[test]
fn wrong_usage_ends_with_2_and_says_what_would_be_accepted() {
    let f = scene();
    for (arguments, told) in [
        ("--spp 0", "1..="),
        ("--spp many", "invalid digit"),
        ("--spp 4 --time 3s", "cannot be used with"),
        ("--spp 4 --error 1%", "cannot be used with"),
        ("--time 3s --error 1%", "cannot be used with"),
        ("--samples 0..4 --spp 8", "cannot be used with"),
        ("--samples 4..4", "A..B"),
        ("--time 3d", "none of ms, s, m, h"),
        ("--time 0", "positive time"),
        ("--error 0", "positive error"),
        ("--error one", "e.g. 1% or 0.01"),
        ("--crop 0,4,4,4", "x0 < x1 and y0 < y1"),
        ("--crop 0,9,0,8", "8 x 8 pixels"),
        ("--pixel 8,0", "8 x 8 pixels"),
        ("--pixel 1,1 --resume", "cannot be used with"),
        ("--threads 0", "1..=4096"),
        ("--aov albdo", "did you mean \"albedo\"?"),
        ("--subsurface diffusion", "planned"),
        ("--subsurface dipol", "did you mean \"dipole\"?"),
        ("--walk jmp", "did you mean \"jump\"?"),
        ("--wavelengths 900", "380..780"),
        ("--open lid", "[possible values: cap, profile, kill]"),
        ("--max-depth all", "or scene"),
        ("--checkpoint-every -1", "--checkpoint-every"),
        ("--ssp 4", "--spp"),
        ("-o a.tif", ".exr or .png"),
        ("extra.pbrt", "extra.pbrt"),
    ] {
        let r = f.run(&format!("render scene.pbrt {arguments}"));
        assert_eq!((r.code, r.stdout.as_str()), (Some(2), ""), "{arguments}: {r:?}");
        assert!(r.stderr.contains(told), "{arguments}: {}", r.stderr);
    }
    assert_eq!(f.run("render").code, Some(2));
    assert_eq!(f.run("merge -o a.exr").code, Some(2));
    assert!(!f.exists("scene.exr"));
}

#[test]
fn a_scene_without_a_command_is_told_the_command() {
    let f = scene();
    for arguments in ["scene.pbrt", "scene.pbrt --spp 4", "--spp 4 scene.pbrt", "missing.pbrt -o a.exr"] {
        let r = f.run(arguments);
        assert_eq!(r.code, Some(2));
        assert!(r.stderr.contains(&format!("moonmilk render {arguments}\n")), "{arguments}: {}", r.stderr);
    }
    let r = f.run("solve scene.pbrt");
    assert!(r.stderr.contains("moonmilk render") || r.stderr.contains("planned"), "{}", r.stderr);
    let r = f.run("rendr scene.png");
    assert!(r.code == Some(2) && r.stderr.contains("render"), "{}", r.stderr);
}

#[test]
fn help_and_version_are_data() {
    let f = scene();
    let help = f.succeed("--help");
    for word in ["render", "compare", "diff", "merge", "showcase", "Examples:", "Exit codes", "--log-format"] {
        assert!(help.stdout.contains(word), "{word}: {}", help.stdout);
    }
    let options = f.succeed("help render").stdout;
    for option in [
        "--output",
        "--spp",
        "--time",
        "--error",
        "--subsurface",
        "--walk",
        "--wavelengths",
        "--seed",
        "--threads",
        "--crop",
        "--resume",
        "--display",
        "--aov",
        "--max-depth",
        "--open",
        "--pixel",
        "--stats",
        "--audit",
        "--samples",
        "--checkpoint-every",
    ] {
        assert!(options.contains(option), "{option}");
    }
    // Wide enough for a sentence, narrow enough for a terminal; the examples are not broken.
    assert!(options.lines().chain(help.stdout.lines()).all(|l| l.chars().count() <= 100), "{options}");
    assert!(help.stdout.lines().filter(|l| l.starts_with("  moonmilk")).all(|l| l.contains("  ")));
    assert!(help.stdout.contains("whether by more than noise\n"));
    assert_eq!(f.succeed("--version").stdout, format!("moonmilk {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn without_an_output_the_picture_takes_the_name_in_the_scene() {
    let f = scene();
    f.succeed("render scene.pbrt");
    assert!(f.exists("scene.exr"));
    let text = String::from_utf8(f.bytes("scene.pbrt")).expect("text");
    f.write("b.pbrt", text.replace("scene.exr", "some/folder/picture.png"));
    f.succeed("render b.pbrt");
    assert_eq!(f.bytes("picture.png")[1..4], *b"PNG");
    f.write("c.pbrt", text.replace("scene.exr", "picture.pfm"));
    let r = f.succeed("render c.pbrt");
    assert!(f.exists("picture.exr") && r.stderr.contains("picture.pfm"), "{r:?}");
}

#[test]
fn models_and_materials_are_listed_and_described() {
    let f = scene();
    let list = f.succeed("models").stdout;
    assert!(
        list.contains("photon-beam") && list.contains("Habel2013") && list.contains("normalized-as-published"),
        "{list}"
    );
    assert!(f.succeed("models dipole").stdout.contains("avoid"));
    let r = f.run("models dipol");
    assert!(r.code == Some(2) && r.stderr.contains("did you mean \"dipole\"?"), "{r:?}");
    assert!(f.succeed("material").stdout.contains("Marble"));
    let marble = f.succeed("material Marble --as pbrt").stdout;
    assert!(marble.contains("\"rgb sigma_s\" [ 2.19 2.62 3 ]") && marble.contains("# lost:"), "{marble}");
    let r = f.run("material Marble --as renderman");
    assert!(r.code == Some(2) && r.stderr.contains("albedo-mfp"), "{r:?}");
}
