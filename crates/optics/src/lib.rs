//! Optics of translucent materials: boundaries, phase functions, media, exact half-space solutions, material tables.
//!
//! Usable alone: no files, no threads, no meshes. Conventions: directions are unit vectors away from the point; the
//! cosine of a phase function is that of the deflection, forward = +1; `eta` is the index inside over that outside; coefficients
//! are in \[1/length\] of any one unit. Kernels of rendering are f32, analysis is f64.

pub mod error;
pub mod fresnel;
pub mod halfspace;
pub mod inversion;
pub mod materials;
pub mod medium;
pub mod phase;
pub mod slab;

pub use error::{Error, ErrorKind};
pub use inversion::AlbedoTable;
pub use medium::Homogeneous;
pub use phase::HenyeyGreenstein;
