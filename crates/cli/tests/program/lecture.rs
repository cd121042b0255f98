//! `docs/lecture.md`: every command is run, and what it prints and draws is compared with the page.

use std::fs;
use std::path::Path;

use crate::common::Folder;

/// Returns the number that a word holds, and a unit of its last digit.
fn number(word: &str) -> Option<(f64, f64)> {
    let plain = word.trim_matches(|c: char| !c.is_ascii_digit() && !"+-.".contains(c));
    let value: f64 = plain.parse().ok()?;
    let digits = plain.split_once('.').map_or(0, |(_, d)| d.len());
    Some((value, 10f64.powi(-(digits as i32))))
}

/// Checks that two texts have the same words, and numbers within two units of the last digit: on another processor a path or two of
/// a run may turn out otherwise by rounding.
fn agree(page: &str, fresh: &str, what: &str) {
    let (a, b): (Vec<&str>, Vec<&str>) = (page.split_whitespace().collect(), fresh.split_whitespace().collect());
    assert_eq!(a.len(), b.len(), "{what}: the page has\n{page}\nand the program\n{fresh}");
    for (x, y) in a.iter().zip(&b) {
        let same = match (number(x), number(y)) {
            (Some((u, unit)), Some((v, _))) => (u - v).abs() < 2.01 * unit,
            _ => x == y,
        };
        assert!(same, "{what}: the page has {x} where the program says {y}:\n{page}\n{fresh}");
    }
}

/// Returns the texts of an SVG picture.
fn texts(svg: &str) -> String {
    let parts = svg.split("<text").skip(1).filter_map(|t| t.split_once('>').and_then(|(_, t)| t.split_once("</text>")));
    parts.map(|(t, _)| t.trim()).collect::<Vec<_>>().join("\n")
}

#[test]
fn the_walk_through_the_lecture_is_true() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    let page = fs::read_to_string(docs.join("lecture.md")).expect("the page");
    let f = Folder::new();
    fs::create_dir_all(f.path("docs/lecture")).expect("a folder");
    let mut steps = 0;
    for block in page.split("```sh\n").skip(1) {
        let (command, rest) = block.split_once("\n```").expect("a block has an end");
        let printed = rest.split_once("```text\n").and_then(|(_, t)| t.split_once("```")).expect("what is printed").0;
        let arguments = command.strip_prefix("moonmilk ").expect("a command of the program");
        agree(printed, &f.succeed(arguments).stdout, command);
        let picture = arguments.rsplit(' ').next().expect("a picture is written");
        let name = picture.strip_prefix("docs/").expect("pictures stand beside the page");
        assert!(rest.contains(&format!("]({name})")), "{command}: its picture is shown");
        let shown = fs::read_to_string(docs.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        let drawn = String::from_utf8(f.bytes(picture)).expect("text");
        agree(&texts(&shown), &texts(&drawn), name);
        steps += 1;
    }
    assert!(steps >= 11, "{steps} commands");
    let faults = (1..=5).filter(|k| page.contains(&format!("**Fault {k}**"))).count();
    assert_eq!(faults, 5);
}

#[test]
fn the_comparisons_of_the_lecture_run_and_have_a_row_for_every_model() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = fs::read_to_string(root.join("docs/lecture.md")).expect("the page");
    let f = Folder::new();
    let mut steps = 0;
    for block in page.split("```console\n").skip(1) {
        let (command, rest) = block.split_once("\n```").expect("a block has an end");
        let words: Vec<&str> = command.split(' ').collect();
        let &["moonmilk", "compare", scene, "--subsurface", models, ..] = words.as_slice() else { panic!("{command}") };
        // The scene names its command, the page shows its sheet and has a row for each model.
        let path = root.join(scene);
        assert!(fs::read_to_string(&path).expect("a scene").contains(command), "{scene} says {command}");
        let sheet = format!("lecture/compare-{}.png", words.last().expect("a folder"));
        assert!(rest.contains(&format!("]({sheet})")) && root.join("docs").join(&sheet).exists(), "{sheet}");
        let (of_this, _) = rest.split_once("\n#").expect("another heading");
        assert!(models.split(',').chain(["tabulated"]).all(|m| of_this.contains(&format!("| {m} |"))), "{command}");
        // Its models are there, and its scene can be compared: here a corner of the body by the quickest model.
        models.split(',').for_each(|m| drop(f.succeed(&format!("models {m}"))));
        let small = format!("compare {} --subsurface dipole --spp 2 --crop 40,44,22,26 -o a", path.display());
        assert!(f.succeed(&small).stdout.contains("against path, over 16 pixels"), "{small}");
        fs::remove_dir_all(f.path("a")).expect("it was written");
        steps += 1;
    }
    assert_eq!(steps, 4);
}

#[test]
fn texts_that_differ_are_told_apart() {
    let differs = |a: &str, b: &str| std::panic::catch_unwind(|| agree(a, b, "test")).is_err();
    assert!(differs("albedo 0.415", "albedo 0.419") && differs("a b", "a c") && differs("+1.0 %", "+1.0 % x"));
    assert!(!differs("albedo 0.415 +0.12 %", "albedo 0.416 +0.13 %"));
    assert_eq!(texts("<svg><text x=\"1\">\nR(r)\n</text><text>b</text></svg>"), "R(r)\nb");
}
