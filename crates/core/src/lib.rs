//! Foundations of moonmilk without physics: vectors and frames, sampled spectra and colour, keyed random numbers, quadrature,
//! estimates and statistical tests.
//!
//! | need | where |
//! |---|---|
//! | the values of one path at its wavelengths | [`Spectrum`], N lanes; [`Wavelengths`] says what the lanes are |
//! | a spectrum of a scene: constant, colour, table, black body, by name | [`Spectra`], evaluated by [`Spectra::sample`] |
//! | from radiance to linear sRGB | [`Wavelengths::to_rgb`], with the observer in [`color`] |
//! | uniform variates | [`Sampler`] for the samples of a pixel, [`Stream`] for everything else, both [`Random`] |
//! | a mean with its error | [`Estimate`], never a bare number |
//! | does it agree? | [`stats`]: chi-square, Kolmogorov-Smirnov, z, Sidak's correction |
//! | integrals | [`quadrature`] |
//! | one formula for values and for derivatives | [`Real`], [`Dual`] |
//!
//! Two conventions reach into all other crates. Radiance is carried *relative to D65*, so that white is 1 in every lane ([`color`]).
//! A random number is a *pure function* of seed, pixel, sample and dimension, so that neither threads nor
//! interruptions can change a picture ([`random`]).
//!
//! ```
//! use moonmilk_core::{Random, Sampler, Spectra, WavelengthMode, Wavelengths};
//!
//! // The first sample of pixel (3, 4) under seed 0: four wavelengths from its first random number.
//! let mut rng = Sampler::new(0, 3, 4, 0);
//! let wavelengths = Wavelengths::<4>::sample(WavelengthMode::Hero, rng.uniform());
//! let jade = Spectra::rgb_albedo([0.3, 0.6, 0.4]).expect("components within [0, 1]");
//! let lanes = jade.sample(&wavelengths);
//! assert!((0..4).all(|i| (0.0..=1.0).contains(&lanes[i])));
//! ```

pub mod color;
pub mod color_space;
pub mod estimate;
pub mod frame;
pub mod named;
pub mod quadrature;
pub mod random;
pub mod real;
pub mod spectra;
pub mod spectrum;
pub mod stats;
pub mod upsampling;
pub mod wavelengths;

pub use color_space::ColorSpace;
pub use estimate::Estimate;
pub use frame::Frame;
pub use glam::{self, DVec3, Mat4, Vec2, Vec3, Vec3A};
pub use random::{Random, Sampler, Stream};
pub use real::{Dual, Real};
pub use spectra::{Spectra, SpectraError};
pub use spectrum::Spectrum;
pub use wavelengths::{WavelengthMode, Wavelengths};
