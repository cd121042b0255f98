//! Reads pbrt scenes, and prints what they hold, how long it took, and what is wrong with them.
//!
//! `cargo run --release -p moonmilk-io --example read -- [--syntax] FILES`

use std::path::Path;
use std::time::Instant;

use moonmilk_io::pbrt::{self, Options};

fn main() {
    let mut options = Options::default();
    for argument in std::env::args().skip(1) {
        if argument == "--syntax" {
            options.syntax_only = true;
            continue;
        }
        let start = Instant::now();
        let result = pbrt::load_from_disk(Path::new(&argument), &options);
        let seconds = start.elapsed().as_secs_f64();
        match result {
            Ok(loaded) => {
                let s = &loaded.scene;
                println!(
                    "{argument}: {} shapes, {} materials, {} media, {} lights, {} pictures, {seconds:.3} s",
                    s.shapes.len(),
                    s.materials.len(),
                    s.media.len(),
                    s.lights.len(),
                    s.images.len()
                );
                for missing in &loaded.missing {
                    println!("  missing: {missing}");
                }
                for warning in &loaded.warnings {
                    let place = warning.place.as_ref().map(|p| format!("{p}: ")).unwrap_or_default();
                    println!("  warning: {place}{}", warning.message);
                }
            }
            Err(error) => {
                println!("{argument}: {seconds:.3} s");
                eprintln!("{:?}", miette::Report::new(error));
            }
        }
    }
}
