//! Files of moonmilk: scenes and meshes in, pictures and checkpoints out, and how two pictures differ.
//!
//! | file | read | written |
//! |---|---|---|
//! | pbrt-v4 scenes (`.pbrt`, `.pbrt.gz`) | [`mod@pbrt`] | |
//! | PLY meshes | [`ply`] | |
//! | textures and environments: PNG, JPEG, Radiance HDR, EXR | [`texture`] | |
//! | pictures | [`mod@exr`], [`texture`] | [`mod@exr`], [`png`] |
//! | checkpoints of a film | [`checkpoint`] | [`checkpoint`] |
//!
//! [`metrics`] compares two [`image::Picture`]s: mean ratio, squared errors, [`flip`], and the z-tests of [`ztest`] where variances are known.
//! [`mod@split`] parts the error of a picture that comes in halves into bias and variance; [`sheet`] lays pictures out on one.
//! [`showcase`] is the built-in scene.
//!
//! *Input is not trusted.* No file makes the reader panic or reserve memory for more than its bytes can hold; a problem names file, line and
//! column where there are lines. *Output is whole.* Files appear at once or not at all ([`atomic`]), and the same picture gives the same bytes.
//! No physics here: a scene leaves as [`moonmilk_render::description::SceneDescription`], as the file says it.

pub mod atomic;
pub mod checkpoint;
pub mod exr;
pub mod false_color;
pub mod flip;
pub mod fuzz;
pub mod image;
pub mod lab;
pub mod metrics;
pub mod pbrt;
pub mod plot;
pub mod ply;
pub mod png;
pub mod sheet;
pub mod showcase;
pub mod split;
pub mod texture;
pub mod ztest;
