//! Exact texts of errors, and files that are not there.

use super::*;

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
            "scene.pbrt:1:49: `skin1` is no named medium",
            "did you mean `Skin1`? accepted: Apple, ",
        ),
        (
            "WorldBegin MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"float g\" 1.2",
            "scene.pbrt:1:70: g = 1.2 is outside (-1, 1)",
            "",
        ),
        (
            "WorldBegin MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"float density\" [1 2 3] \"integer nx\" 2",
            "scene.pbrt:1:76: `density` has 3 values, but nx * ny * nz = 2 * 1 * 1 = 2",
            "",
        ),
        (
            "WorldBegin MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"float density\" [1 -2] \"integer nx\" 2",
            "scene.pbrt:1:76: value 2 of `density` is -2, not in [0, inf)",
            "",
        ),
        (
            "WorldBegin MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"rgb density\" [1 2 3]",
            "scene.pbrt:1:61: `density` of medium \"m\" is not of type rgb",
            "write `float density`",
        ),
        (
            "WorldBegin MakeNamedMedium \"m\" \"string type\" \"rgbgrid\"",
            "scene.pbrt:1:47: `sigma_a` or `sigma_s` is needed",
            "",
        ),
        (
            "WorldBegin MakeNamedMedium \"m\" \"string type\" \"rgbgrid\" \"rgb sigma_s\" [1 2 3 4]",
            "scene.pbrt:1:61: `sigma_s` takes triples of numbers, 4 given",
            "",
        ),
        (
            "WorldBegin MakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" \"smoke.nvdb\"",
            "scene.pbrt:1:12: medium `m` is a NanoVDB file, which cannot be read: no maintained reader in Rust exists",
            "convert the grid into a `uniformgrid`",
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
