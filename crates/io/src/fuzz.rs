//! One function per parser for fuzzers: arbitrary bytes go in, a panic is a finding.
//!
//! `tests/fuzz.rs` and the example `fuzz_corpus` feed them with mutated files; the folder `fuzz` of the project has the targets
//! of `cargo fuzz` over the same functions. Each returns whether the bytes were accepted.

use std::borrow::Cow;
use std::io;

use moonmilk_render::doctor;
use moonmilk_render::scene::{OpenPolicy, Scene, SceneOptions};

use crate::image::Error;
use crate::pbrt::{Files, Options, load_with};
use crate::texture::{Encoding, load_texture};
use crate::{exr, ply};

/// Name of the scene file that the bytes become.
const MAIN: &str = "scene.pbrt";

/// The scene under test, and what it may refer to.
struct Tested<'a> {
    main: &'a [u8],
    others: &'a [(&'a str, Vec<u8>)],
}

impl Files for Tested<'_> {
    fn read(&self, path: &str) -> io::Result<Cow<'static, [u8]>> {
        if path == MAIN {
            return Ok(Cow::Owned(self.main.to_vec()));
        }
        let found = self.others.iter().find(|(name, _)| *name == path);
        found.map(|(_, bytes)| Cow::Owned(bytes.clone())).ok_or_else(|| io::ErrorKind::NotFound.into())
    }
}

/// Reads a scene, builds it, and examines it if it can be built; `others` are the files that it may refer to.
///
/// Limits are those of small scenes: 10 000 shapes, 65 536 generated triangles, 16 MiB per unpacked file.
pub fn scene(data: &[u8], others: &[(&str, Vec<u8>)]) -> bool {
    let files = Tested { main: data, others };
    let syntax_only = data.len() % 2 == 1;
    let options = Options {
        lenient: data.len() % 3 == 1,
        syntax_only,
        max_shapes: 10_000,
        max_generated: 1 << 16,
        max_bytes: 1 << 24,
    };
    match load_with(&files, MAIN, &options) {
        Ok(loaded) if !syntax_only => {
            let built =
                Scene::new(&loaded.scene, &SceneOptions { open: OpenPolicy::Cap, ..Default::default() }).is_ok();
            if built && loaded.scene.shapes.len() < 100 {
                // A scene that can be built may still be one that nothing can be said of.
                let _ = doctor::examine(&loaded.scene);
            }
            true
        }
        Ok(_) => true,
        Err(error) => {
            assert!(error.problems().iter().all(|p| !p.message.is_empty()));
            false
        }
    }
}

/// Reads a mesh.
pub fn ply(data: &[u8]) -> bool {
    match ply::read(data) {
        Ok(mesh) => {
            let n = mesh.positions.len();
            assert!(mesh.indices.iter().flatten().all(|&v| (v as usize) < n));
            assert!(mesh.positions.iter().all(|p| p.is_finite()));
            true
        }
        Err(_) => false,
    }
}

/// Reads an EXR picture.
pub fn exr(data: &[u8]) -> bool {
    picture(exr::decode(data))
}

/// Reads a picture of any format, told by its content.
pub fn texture(data: &[u8]) -> bool {
    picture(load_texture(data, "picture", Encoding::Srgb))
}

fn picture(result: Result<crate::image::Picture, Error>) -> bool {
    match result {
        Ok(picture) => {
            picture.check().expect("a decoded picture is consistent");
            true
        }
        Err(error) => {
            let text = error.to_string();
            assert!(!text.contains("broke the decoder"), "a decoder panicked: {text}");
            false
        }
    }
}
