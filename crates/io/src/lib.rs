//! moonmilk-io.

pub mod atomic;
pub mod checkpoint;
pub mod exr;
pub mod false_color;
pub mod flip;
pub mod image;
pub mod metrics;
pub mod pbrt;
pub mod ply;
pub mod png;
pub mod showcase;
pub mod texture;
pub mod ztest;
