//! How fast scene text is read: a mesh written out in the scene file, in MB/s, and the time of a million triangles.
//!
//! `cargo run --release -p moonmilk-io --example parse_speed -- [TRIANGLES]`

use std::borrow::Cow;
use std::fmt::Write;
use std::time::Instant;

use moonmilk_io::pbrt::{Files, Options, load_with};

struct Memory(Vec<u8>);

impl Files for Memory {
    fn read(&self, _: &str) -> std::io::Result<Cow<'static, [u8]>> {
        Ok(Cow::Owned(self.0.clone()))
    }
}

/// Writes a wavy sheet of about n triangles as exporters do: six digits behind the point, normals, a line per vertex.
fn sheet(n: usize) -> String {
    let side = ((n / 2) as f64).sqrt().ceil() as usize;
    let mut out = String::from("WorldBegin\nShape \"trianglemesh\"\n  \"point3 P\" [\n");
    let each = |out: &mut String, f: &dyn Fn(f64, f64) -> [f64; 3]| {
        for j in 0..=side {
            for i in 0..=side {
                let [x, y, z] = f(i as f64 / side as f64, j as f64 / side as f64);
                writeln!(out, "    {x:.6} {y:.6} {z:.6}").expect("memory");
            }
        }
    };
    each(&mut out, &|u, v| [40.0 * u - 20.0, 40.0 * v - 20.0, (9.0 * u).sin() * (7.0 * v).cos()]);
    out.push_str("  ]\n  \"normal N\" [\n");
    each(&mut out, &|u, v| [0.1 * (9.0 * u).cos(), 0.1 * (7.0 * v).sin(), 0.99]);
    out.push_str("  ]\n  \"integer indices\" [\n");
    for j in 0..side {
        for i in 0..side {
            let at = |i: usize, j: usize| j * (side + 1) + i;
            writeln!(
                out,
                "    {} {} {} {} {} {}",
                at(i, j),
                at(i + 1, j),
                at(i + 1, j + 1),
                at(i, j),
                at(i + 1, j + 1),
                at(i, j + 1)
            )
            .expect("memory");
        }
    }
    out.push_str("  ]\n");
    out
}

fn main() {
    let n = std::env::args().nth(1).map_or(1_000_000, |a| a.parse().expect("a number of triangles"));
    let files = Memory(sheet(n).into_bytes());
    let megabytes = files.0.len() as f64 / 1e6;
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        let loaded = load_with(&files, "scene.pbrt", &Options::default()).unwrap_or_else(|e| panic!("{e}"));
        let seconds = start.elapsed().as_secs_f64();
        assert_eq!(loaded.scene.shapes.len(), 1);
        best = best.min(seconds);
    }
    println!("{n} triangles, {megabytes:.1} MB of text: {best:.3} s, {:.0} MB/s (best of 5)", megabytes / best);
}
