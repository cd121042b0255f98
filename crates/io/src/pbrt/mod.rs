//! Scenes in the format of pbrt-v4.
//!
//! [`load`] reads a file with everything it includes into a [`SceneDescription`]. The meaning of directives and parameters is
//! that of pbrt-v4 (its `parser.cpp`, `scene.cpp` and the `Create` functions). Where this loader does less than pbrt, a
//! [`Warning`] says what it does instead; where a file says something that pbrt would refuse, a [`LoadError`] names the
//! place and what would be accepted. Nothing is ignored in silence but settings that cannot change a converged picture
//! (accelerators, sampler kinds, texture filters).
//!
//! Extensions of the format go through pbrt's `Attribute` directive: `Attribute "material" "string moonmilk.set" "skin"` and
//! `"integer moonmilk.priority"`; pbrt ignores them.
//!
//! Bad input never panics: included files nest at most 32 deep, attribute blocks 10 000; files and what gzip unpacks are
//! limited in size; a header's promises reserve no memory.

mod builder;
mod camera;
mod context;
mod curves;
mod error;
mod fields;
mod files;
mod images;
mod lexer;
mod lights;
mod materials;
mod media;
mod named_media;
pub(crate) mod number;
mod params;
mod parser;
mod shapes;
mod spectra;
mod subdivision;
mod suggest;
mod textures;

#[cfg(test)]
mod tests;

use std::path::Path;

use moonmilk_render::description::{SceneDescription, Warning};

pub use error::{LoadError, Problem};
pub use files::{DEFAULT_MAX_BYTES, Disk, Embedded, Files};

use builder::Builder;
use context::Context;
use lexer::{Cursor, Spot};

/// How to read.
#[derive(Clone, Debug)]
pub struct Options {
    /// Unknown directives, parameters and options are warnings, not errors.
    pub lenient: bool,
    /// Only look at the text: missing files are listed in [`Loaded::missing`] and stand in as grey pictures or nothing.
    pub syntax_only: bool,
    /// Largest number of shapes, instances counted one by one.
    pub max_shapes: usize,
    /// Largest number of triangles made of patches and subdivision surfaces; the default takes about 1 GB.
    pub max_generated: usize,
    /// Largest size of an unpacked file \[bytes\].
    pub max_bytes: u64,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            lenient: false,
            syntax_only: false,
            max_shapes: 2_000_000,
            max_generated: 1 << 25,
            max_bytes: DEFAULT_MAX_BYTES,
        }
    }
}

/// A scene that was read.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: SceneDescription,
    /// What the user should know, in the order found.
    pub warnings: Vec<Warning>,
    /// Files that are not there, each once; empty unless [`Options::syntax_only`].
    pub missing: Vec<Problem>,
    /// BLAKE3 over names and bytes of all files read: scene, included files, meshes, pictures, spectra.
    pub hash: [u8; 32],
}

/// Reads the scene at `path` with all files that it refers to.
///
/// # Errors
/// Everything that is wrong with the scene as far as reading can go on, at least the first problem; missing files last.
pub fn load(path: &Path) -> Result<Loaded, LoadError> {
    load_from_disk(path, &Options::default())
}

/// As [`load`], with options.
///
/// # Errors
/// See [`load`].
pub fn load_from_disk(path: &Path, options: &Options) -> Result<Loaded, LoadError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut disk = Disk::new(folder);
    disk.max_bytes = options.max_bytes;
    let main = path.file_name().unwrap_or_default().to_string_lossy();
    read(&disk, &main, &path.display().to_string(), options)
}

/// Reads the scene `main` out of `files`.
///
/// # Errors
/// See [`load`].
pub fn load_with(files: &dyn Files, main: &str, options: &Options) -> Result<Loaded, LoadError> {
    read(files, main, main, options)
}

fn read(files: &dyn Files, main: &str, shown: &str, options: &Options) -> Result<Loaded, LoadError> {
    let mut cx = Context::new(files, options);
    let Some((source, id)) = cx.open(main, shown, None) else {
        cx.problems.append(&mut cx.missing);
        return Err(LoadError::new(cx.problems));
    };
    let start = Spot { source: id, start: 0, end: 0, line: 1, line_start: 0 };
    let mut builder = Builder::new(start);
    let stopped = parser::parse(&mut cx, &mut builder, Cursor::new(source, id), start).is_err();
    // After a syntax error something was skipped: names that it may define are not missed.
    cx.include_missing |= stopped;
    let scene = builder.finish(&mut cx);
    if !cx.options.syntax_only || !cx.problems.is_empty() {
        cx.problems.append(&mut cx.missing);
    }
    if !cx.problems.is_empty() {
        return Err(LoadError::new(cx.problems));
    }
    Ok(Loaded { scene, warnings: cx.warnings, missing: cx.missing, hash: *cx.hasher.finalize().as_bytes() })
}
