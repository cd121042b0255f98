//! `simulate` and `validate`.

use crate::common::Folder;

/// MCML's first case, and a half-space, as MCML's users write them.
const CASES: &str = "1.0 # version
2
slab.mco A
20000
0.002 0.01
10 20 9
1
1.0
1 10 90 0.75 0.02
1.0
half.mco A
4000
0.01 0.01
4 5 1
1
1.0
1.5 10 90 0 1e9
1.0
";

const LAYERS: &str = "unit = \"mm\"
photons = 4000
[[layer]]
name = \"skin\"
thickness = inf
n = 1.4
sigma_a = 0.1
sigma_s = 10
g = 0.8
[tally]
radius = { first = 0.01, max = 5, bins = 8 }
time = { max = 100, bins = 5 }
";

/// Returns a number of the table that `simulate` prints.
fn number(text: &str, name: &str) -> f64 {
    let line =
        text.lines().find(|l| l.split_whitespace().next() == Some(name)).unwrap_or_else(|| panic!("{name}: {text}"));
    line.split_whitespace().nth(1).and_then(|w| w.parse().ok()).expect("a number")
}

#[test]
fn mcml_files_run_and_find_the_published_reflectance() {
    let f = Folder::new();
    f.write("cases.mci", CASES);
    let out = f.succeed("simulate cases.mci").stdout;
    let (first, second) = out.split_once("run 2").expect("two runs");
    assert!(first.contains("slab.mco") && second.contains("half.mco"));
    // 20000 paths: standard error .0011 of .09739; 5 of them. Light is accounted for.
    assert!((number(first, "reflected") - 0.09739).abs() < 5.0 * 0.0011);
    assert!((number(second, "specular") - 0.04).abs() < 1e-6);
    f.succeed("simulate cases.mci --photons 2000 -o out.npz");
    assert!(f.exists("out-1.npz") && f.exists("out-2.npz") && !f.exists("out.npz"));
    assert!(f.bytes("out-1.npz").starts_with(b"PK\x03\x04"));
}

#[test]
fn layers_in_toml_are_simulated_alike_on_any_number_of_threads() {
    let f = Folder::new();
    f.write("skin.toml", LAYERS);
    f.succeed("simulate skin.toml --threads 1 -o a.csv");
    f.succeed("simulate skin.toml --threads 3 -o b.csv");
    assert_eq!(f.bytes("a.csv"), f.bytes("b.csv"));
    f.succeed("simulate skin.toml --seed 2 -o c.csv");
    assert!(f.bytes("a.csv") != f.bytes("c.csv"));
    f.succeed("simulate skin.toml -o a.json");
    assert!(String::from_utf8(f.bytes("a.json")).unwrap().contains("\"reflectance_r_time\""));
}

#[test]
fn wrong_experiments_end_with_3_and_their_place() {
    let f = Folder::new();
    for (name, text, told) in [
        ("a.toml", LAYERS.replace("sigma_s", "sigma_z"), "a.toml:8:1"),
        ("b.toml", LAYERS.replace("g = 0.8", "g = 1.8"), "outside (-1, 1)"),
        ("c.toml", LAYERS.replace("inf", "-2"), "layer 1 (skin): thickness = -2"),
        ("d.mci", CASES.replace("0.75", "x"), "d.mci:9:9"),
        ("e.mci", CASES.split("1 10 90").next().expect("a beginning").to_owned(), "the file ends where"),
        ("f.txt", CASES.to_owned(), ".toml or .mci"),
    ] {
        f.write(name, text);
        let r = f.run(&format!("simulate {name}"));
        assert_eq!(r.code, Some(3), "{name}: {r:#?}");
        assert!(r.stderr.contains(told), "{name}: {}", r.stderr);
    }
    assert_eq!(f.run("simulate missing.toml").code, Some(3));
    assert_eq!(f.run("simulate a.toml -o a.xls").code, Some(2));
    assert_eq!(f.run("simulate d.mci -o no/where.csv").code, Some(3));
}

#[test]
fn published_values_are_found_again() {
    let f = Folder::new();
    let r = f.succeed("validate --photons 10000 --threads 1");
    assert!(!r.stdout.contains("FAIL") && r.stdout.contains(" agree (significance"), "{}", r.stdout);
    for what in ["Giovanelli", "Chandrasekhar's H(0.5)", "intensity", "Grosjean", "alpha 0.99, n 1.5", "dual-beam"] {
        assert!(r.stdout.contains(what), "{what}: {}", r.stdout);
    }
    assert_eq!(r.stdout, f.succeed("validate --photons 10000 --threads 3").stdout);
}
