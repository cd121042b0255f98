//! Makes the geometry of the built-in showcase: `moonmilk-showcase-generator DIRECTORY` writes one PLY file per object.
//!
//! The result depends on nothing but this program. The files in `scenes/showcase/geometry` are its output; a test
//! compares them with what the program makes now.

#[cfg(test)]
mod checks;
mod chess;
mod layout;
mod leaf;
mod mesh;
mod profile;
mod soap;
mod vessels;

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

fn main() -> io::Result<()> {
    let here = concat!(env!("CARGO_MANIFEST_DIR"), "/../showcase/geometry");
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from(here), PathBuf::from);
    fs::create_dir_all(&folder)?;
    for (name, mesh) in layout::showcase() {
        if let Some(fault) = mesh.faults().first() {
            return Err(io::Error::other(format!("{name}: {fault}")));
        }
        let mut file = BufWriter::new(File::create(folder.join(format!("{name}.ply")))?);
        mesh.write_ply(&mut file)?;
        file.flush()?;
        let (low, high) = mesh.bounds();
        println!(
            "{name:8} {:6} vertices {:6} triangles, 4V/S = {:5.2} mm, x {:.1}..{:.1} y {:.1}..{:.1} z {:.2}..{:.2}",
            mesh.positions.len(),
            mesh.triangles.len(),
            4.0 * mesh.volume() / mesh.area(),
            low.x,
            high.x,
            low.y,
            high.y,
            low.z,
            high.z
        );
    }
    Ok(())
}
