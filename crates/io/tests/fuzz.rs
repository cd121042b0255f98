//! Mutated files: no panic, no hang, whatever the bytes. Named kinds of damage: an error or a warning each.
//!
//! The corpus is a generator with a seed (`corpus/mod.rs`); a failure names kind and number of the file. With
//! `MOONMILK_SLOW=1` there are 100 000 files; `cargo run --release -p moonmilk-io --example fuzz_corpus` prints figures.

mod corpus;

use std::borrow::Cow;
use std::collections::HashMap;
use std::time::{Duration, Instant};

use corpus::{Corpus, Kind, gzip};
use moonmilk_io::pbrt::{Files, LoadError, Loaded, Options, load_with};
use moonmilk_io::{fuzz, ply};
use moonmilk_render::scene::{OpenPolicy, Scene, SceneOptions};

/// Longest time for one file.
const HANG: Duration = Duration::from_secs(10);

const SEED: u64 = 1;

fn run(kind: Kind, usual: u64, slow: u64) {
    let corpus = Corpus::new();
    let n = if std::env::var_os("MOONMILK_SLOW").is_some() { slow } else { usual };
    let mut accepted = 0;
    for i in 0..n {
        let bytes = corpus.file(kind, SEED, i);
        let start = Instant::now();
        let outcome = std::panic::catch_unwind(|| match kind {
            Kind::Scene => fuzz::scene(&bytes, &corpus.others),
            Kind::Ply => fuzz::ply(&bytes),
            Kind::Exr => fuzz::exr(&bytes),
            Kind::Png => fuzz::texture(&bytes),
        });
        let took = start.elapsed();
        accepted += u64::from(outcome.unwrap_or_else(|_| panic!("{kind:?} {i} of seed {SEED} panics")));
        assert!(took < HANG, "{kind:?} {i} of seed {SEED} takes {took:?}");
    }
    // The mutations must reach both outcomes, else they test nothing.
    assert!(accepted > n / 100 && accepted < n - n / 100, "{kind:?}: {accepted} of {n} accepted");
}

#[test]
fn mutated_scenes_never_panic_or_hang() {
    run(Kind::Scene, 1500, 40_000);
}

#[test]
fn mutated_meshes_never_panic_or_hang() {
    run(Kind::Ply, 2000, 20_000);
}

#[test]
fn mutated_exr_files_never_panic_or_hang() {
    run(Kind::Exr, 1500, 20_000);
}

#[test]
fn mutated_pictures_never_panic_or_hang() {
    run(Kind::Png, 1500, 20_000);
}

struct Memory(HashMap<String, Vec<u8>>);

impl Files for Memory {
    fn read(&self, path: &str) -> std::io::Result<Cow<'static, [u8]>> {
        self.0.get(path).map(|b| Cow::Owned(b.clone())).ok_or_else(|| std::io::ErrorKind::NotFound.into())
    }
}

fn load(text: &str, others: &[(&str, Vec<u8>)]) -> Result<Loaded, LoadError> {
    let mut files: HashMap<String, Vec<u8>> = others.iter().map(|(n, b)| ((*n).to_owned(), b.clone())).collect();
    files.insert("scene.pbrt".into(), text.as_bytes().to_vec());
    load_with(&Memory(files), "scene.pbrt", &Options::default())
}

/// The problems of a scene, each with its place.
fn problems(text: &str, others: &[(&str, Vec<u8>)]) -> Vec<String> {
    load(text, others).err().map_or(vec![], |e| e.problems().iter().map(ToString::to_string).collect())
}

fn told(list: &[String], what: &str) {
    assert!(list.iter().any(|p| p.contains(what)), "{what}: {list:?}");
}

/// Warnings of reading and building a scene that is accepted.
fn warnings(text: &str, others: &[(&str, Vec<u8>)]) -> Vec<String> {
    let loaded = load(text, others).unwrap_or_else(|e| panic!("{e}"));
    let (_, more) = Scene::new(&loaded.scene, &SceneOptions { open: OpenPolicy::Refuse, ..Default::default() })
        .unwrap_or_else(|e| panic!("{e}"));
    loaded.warnings.iter().chain(&more).map(|w| w.message.clone()).collect()
}

#[test]
fn a_truncated_gzip_file_is_an_error_that_names_it() {
    let whole = gzip(&b"Shape \"sphere\" \"float radius\" 2\n".repeat(40));
    for (text, name) in [
        ("WorldBegin\n  Include \"a.pbrt.gz\"", "a.pbrt.gz"),
        ("WorldBegin\n  Import \"a.pbrt.gz\"", "a.pbrt.gz"),
        ("WorldBegin\n  Shape \"plymesh\" \"string filename\" \"a.pbrt.gz\"", "a.pbrt.gz"),
    ] {
        let list = problems(text, &[(name, whole[..whole.len() / 2].to_vec())]);
        assert!(list.len() == 1 && list[0].starts_with("scene.pbrt:2:") && list[0].contains(name), "{list:?}");
    }
}

#[test]
fn files_that_include_each_other_end_with_one_error() {
    let others = [("a", b"Include \"b\"\n".to_vec()), ("b", b"Include \"a\" Include \"a\"\n".to_vec())];
    let list = problems("WorldBegin Include \"a\"", &others);
    assert_eq!(list.len(), 1, "{list:?}");
    told(&list, "include each other more than 32 levels deep");
    let imports = [("a", b"Import \"a\" Import \"a\"\n".to_vec())];
    told(&problems("WorldBegin Import \"a\"", &imports), "levels deep");
}

#[test]
fn headers_that_promise_a_thousand_million_triangles_reserve_nothing() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for (vertices, faces) in [(3u64, 1_000_000_000u64), (1_000_000_000, 1), (u64::MAX / 3, u64::MAX / 3)] {
            let text = format!(
                "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 0 0 0 1 0 3 0 1 2"
            );
            let start = Instant::now();
            let error = ply::read(text.as_bytes()).expect_err("the data are not there");
            assert!(start.elapsed() < Duration::from_millis(500) && !error.to_string().is_empty());
            let text = "WorldBegin Shape \"plymesh\" \"string filename\" \"a.ply\"";
            told(&problems(text, &[("a.ply", format!("{error}").into_bytes())]), "a.ply: is not a PLY file");
        }
    }
}

#[test]
fn blocks_a_hundred_levels_deep_are_read_and_ten_thousand_refused() {
    let nested =
        |n: usize| format!("WorldBegin {} Shape \"sphere\" {}", "AttributeBegin ".repeat(n), "AttributeEnd ".repeat(n));
    assert!(load(&nested(100), &[]).is_ok_and(|l| l.scene.shapes.len() == 1 && l.warnings.is_empty()));
    told(&problems(&nested(10_001), &[]), "nested more than 10000 levels deep");
}

#[test]
fn coordinates_that_are_no_numbers_are_errors_with_their_place() {
    for word in ["nan", "inf", "-inf", "1e39"] {
        let text = format!("WorldBegin\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 {word} 0 1 0]");
        let list = problems(&text, &[]);
        assert!(list[0].starts_with("scene.pbrt:2:44: a number is expected here"), "{list:?}");
        let mesh = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 {word}\n0 1 0\n3 0 1 2\n"
        );
        let list =
            problems("WorldBegin Shape \"plymesh\" \"string filename\" \"a.ply\"", &[("a.ply", mesh.into_bytes())]);
        told(&list, "a.ply: vertex 1: coordinate is");
    }
}

/// A tetrahedron of a medium with more triangles after its four.
fn tetrahedron(more: &str) -> String {
    format!(
        "WorldBegin LightSource \"infinite\" Material \"subsurface\" Shape \"trianglemesh\" \"point3 P\" [1 1 1  -1 -1 1  -1 1 -1  1 -1 -1] \"integer indices\" [0 2 1 0 1 3 0 3 2 1 2 3 {more}]"
    )
}

#[test]
fn triangles_without_area_and_triangles_that_stand_twice_are_told() {
    assert_eq!(warnings(&tetrahedron(""), &[]), Vec::<String>::new());
    told(&warnings(&tetrahedron("0 0 1 2 2 2"), &[]), "2 triangles without area are left out");
    let twice = load(&tetrahedron("1 2 3"), &[]).expect("it can be read").scene;
    let report = moonmilk_render::doctor::examine(&twice).expect("it can be examined");
    let found: Vec<String> = report.findings.iter().map(|f| f.message.clone()).collect();
    told(&found, "1 triangles stand twice");
    // A mesh of nothing but such triangles is an error.
    let flat =
        load("WorldBegin\n Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 2 0 0]", &[]).expect("it can be read");
    let error =
        Scene::new(&flat.scene, &SceneOptions { open: OpenPolicy::Refuse, ..Default::default() }).expect_err("no area");
    assert!(error.to_string().starts_with("scene.pbrt:2:2: ") && error.to_string().contains("1 degenerate"), "{error}");
}

#[test]
fn several_faults_of_one_file_are_told_at_once() {
    let text = "WorldBegin\nShape \"sphere\" \"float radius\" [ 1 x ]\nTranslate 1 2\nRotate 1 0 0 \"a\"\nShape \"disk\" \"float radius\" \"1\nMaterial \"diffuse\"\nShape \"sphere\" \"float radius\"\nShape \"disk\" \"flaot height\" 2\n";
    let list = problems(text, &[]);
    let lines: Vec<&str> = list.iter().map(|p| p.split(':').nth(1).unwrap_or_default()).collect();
    assert_eq!(lines, ["2", "4", "4", "5", "8", "8"], "{list:#?}");
}
