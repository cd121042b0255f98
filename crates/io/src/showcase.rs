//! The built-in showcase: its scene and meshes, inside the program.

use std::borrow::Cow;
use std::io;

use crate::pbrt::Files;

/// Name of the scene file.
pub const SCENE: &str = "showcase.pbrt";

/// The files of the showcase, as they are in `scenes/showcase` of the project.
#[derive(Clone, Copy, Debug, Default)]
pub struct Embedded;

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../../../scenes/showcase/", $name)))),*]
    };
}

/// Path in the scene's folder, and content.
const FILES: &[(&str, &[u8])] = files![
    "showcase.pbrt",
    "geometry/candle.ply",
    "geometry/flame.ply",
    "geometry/leaf.ply",
    "geometry/milk.ply",
    "geometry/pawn.ply",
    "geometry/queen.ply",
    "geometry/rook.ply",
    "geometry/soap.ply",
    "geometry/tumbler.ply",
    "geometry/wick.ply",
];

impl Files for Embedded {
    fn read(&self, path: &str) -> io::Result<Cow<'static, [u8]>> {
        match FILES.iter().find(|(name, _)| *name == path) {
            Some((_, bytes)) => Ok(Cow::Borrowed(bytes)),
            None => Err(io::Error::new(io::ErrorKind::NotFound, format!("{path} is not part of the showcase"))),
        }
    }
}
