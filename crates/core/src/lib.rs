//! Foundations of moonmilk without physics: vectors and frames, sampled spectra and colour, keyed random numbers, quadrature,
//! estimates and statistical tests.

pub mod color;
pub mod estimate;
pub mod frame;
pub mod named;
pub mod quadrature;
pub mod random;
pub mod spectra;
pub mod spectrum;
pub mod stats;
pub mod upsampling;
pub mod wavelengths;

pub use estimate::Estimate;
pub use frame::Frame;
pub use glam::{self, DVec3, Mat4, Vec2, Vec3, Vec3A};
pub use random::{Random, Sampler, Stream};
pub use spectra::{Spectra, SpectraError};
pub use spectrum::Spectrum;
pub use wavelengths::{WavelengthMode, Wavelengths};
