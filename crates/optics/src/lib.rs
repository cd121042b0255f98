//! Optics of translucent materials: boundaries, phase functions, media, exact half-space solutions, material tables.
//!
//! Usable alone: no files, no threads, no meshes. Conventions: directions are unit vectors away from the point; the
//! cosine of a phase function is that of the deflection, forward = +1; `eta` is the index inside over that outside; coefficients
//! are in \[1/length\] of any one unit. Kernels of rendering are f32, analysis is f64.
//!
//! | question | where |
//! |---|---|
//! | how much is reflected at a boundary, and in the mean over directions? | [`fresnel`] |
//! | where does a collision send light? | [`phase`] |
//! | what is a medium, and what are marble's coefficients? | [`medium`], [`materials`] |
//! | how much does a half-space reflect, exactly? | [`halfspace`] |
//! | which medium has this albedo? | [`inversion`] |
//! | what do slabs and closed bodies do, to test a simulation with? | [`slab`] |
//!
//! Three albedos have three names: `alpha` of one collision, `alpha_prime` reduced by similarity, `albedo` of a surface with all its scattering.

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
