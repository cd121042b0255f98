//! Scenes that other people wrote, if they are there.

use std::path::{Path, PathBuf};

use super::*;

#[test]
fn all_scenes_of_other_people_are_read_to_the_end() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    if !folder.is_dir() {
        println!("skipped: there is no folder {}", folder.display());
        return;
    }
    let mut scenes: Vec<PathBuf> = Vec::new();
    let mut folders = vec![folder];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "pbrt") {
                scenes.push(path);
            }
        }
    }
    scenes.sort();
    let (mut complete, mut unexpected) = (0, Vec::new());
    for path in &scenes {
        let name = path.display().to_string();
        // Three million instances: right, but too slow for a test.
        if name.ends_with("menger/scene.pbrt") {
            println!("skipped: {name}");
            continue;
        }
        let options = Options { syntax_only: true, ..Options::default() };
        match load_from_disk(path, &options) {
            Ok(loaded) if loaded.missing.is_empty() => complete += 1,
            Ok(loaded) => println!("skipped: {name} misses {} files", loaded.missing.len()),
            // Scenes that pbrt-v4 refuses too: old syntax, unknown names, a part of another scene.
            Err(error) => {
                println!("refused: {error}");
                let known = [
                    "zero-day/frame35.pbrt",
                    "menger/instancing/instancer_1.pbrt",
                    "prism_dispersion.pbrt",
                    "all_mtypes.pbrt",
                ];
                let unreadable = error.problems().iter().any(|p| p.message.contains("NanoVDB"));
                if !unreadable && !known.iter().any(|k| name.ends_with(k)) {
                    unexpected.push(format!("{name}: {error}"));
                }
            }
        }
    }
    println!("{complete} of {} scenes are complete", scenes.len());
    assert!(unexpected.is_empty(), "{unexpected:#?}");
}
