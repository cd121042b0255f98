//! Foundations of moonmilk without physics: vectors and frames, sampled spectra, keyed random numbers, quadrature,
//! estimates and statistical tests.

pub mod estimate;
pub mod frame;
pub mod random;
pub mod spectrum;

pub use estimate::Estimate;
pub use frame::Frame;
pub use glam::{self, DVec3, Mat4, Vec2, Vec3, Vec3A};
pub use random::{Random, Sampler, Stream};
pub use spectrum::Spectrum;
