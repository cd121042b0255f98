//! The arrows between crates, as the design draws them, read from the manifests.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Which crates of ours each crate may use.
const ALLOWED: [(&str, &[&str]); 8] = [
    ("core", &[]),
    ("optics", &["core"]),
    ("geometry", &["core"]),
    ("walk", &["core", "optics", "geometry"]),
    ("lab", &["core", "optics", "geometry", "walk"]),
    ("render", &["core", "optics", "geometry", "walk"]),
    ("io", &["core", "optics", "geometry", "walk", "lab", "render"]),
    ("cli", &["core", "optics", "geometry", "walk", "lab", "render", "io"]),
];

fn crates() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Names of our crates in the `[dependencies]` of a manifest.
fn dependencies(manifest: &str) -> BTreeSet<String> {
    let start = manifest.find("[dependencies]").expect("every crate has dependencies");
    let section = &manifest[start + 14..];
    let section = &section[..section.find("\n[").unwrap_or(section.len())];
    section
        .lines()
        .filter_map(|l| l.strip_prefix("moonmilk-"))
        .map(|l| l.split([' ', '.', '=']).next().unwrap_or(l).to_owned())
        .collect()
}

#[test]
fn crates_use_only_what_the_arrows_allow() {
    let allowed: BTreeMap<_, _> = ALLOWED.into_iter().collect();
    let mut seen = 0;
    for entry in fs::read_dir(crates()).expect("the folder of crates") {
        let path = entry.expect("readable").path();
        let name = path.file_name().and_then(|n| n.to_str()).expect("a name").to_owned();
        let Ok(manifest) = fs::read_to_string(path.join("Cargo.toml")) else {
            continue;
        };
        let allowed = allowed.get(name.as_str()).unwrap_or_else(|| panic!("crate {name} is not in the design"));
        for d in dependencies(&manifest) {
            assert!(allowed.contains(&d.as_str()), "{name} must not use {d}");
        }
        seen += 1;
    }
    assert_eq!(seen, ALLOWED.len());
}

#[test]
fn nothing_below_the_program_prints_or_exits_or_reads_the_clock() {
    let forbidden = ["println!", "eprintln!", "print!(", "dbg!", "process::exit", "Instant::now", "SystemTime"];
    for (name, _) in ALLOWED.into_iter().filter(|(n, _)| *n != "cli") {
        let mut folders = vec![crates().join(name).join("src")];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(&folder).expect("a source folder") {
                let path = entry.expect("readable").path();
                if path.is_dir() {
                    // Tests in a folder of their own may print as well.
                    if path.file_name().is_some_and(|n| n != "tests") {
                        folders.push(path);
                    }
                    continue;
                }
                let file = path.file_name().and_then(|n| n.to_str()).unwrap_or_default().to_owned();
                if !file.ends_with(".rs") || file.contains("test") {
                    continue;
                }
                let text = fs::read_to_string(&path).expect("source text");
                // Unit tests at the end of a file may print what they measured.
                let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or(&text);
                for (number, line) in code.lines().enumerate().filter(|(_, l)| !l.trim_start().starts_with("//")) {
                    for f in forbidden {
                        assert!(!line.contains(f), "{}:{}: {f} below the program", path.display(), number + 1);
                    }
                }
            }
        }
    }
}
