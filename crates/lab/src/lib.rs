//! Experiments on light in translucent bodies without a renderer.
//!
//! An [`Experiment`] is a stack of layers, a source and what is to be recorded; [`run()`] follows photons through it with the walk of
//! [`moonmilk_walk`] and returns [`Results`], every number with its standard error.
//!
//! ```
//! use moonmilk_lab::{Experiment, LayerSpec, Law, Source, run};
//!
//! // van de Hulst's slab: optical thickness 2, alpha = .9, g = .75.
//! let layer = LayerSpec { name: "slab".into(), thickness: 0.02, n: 1.0, sigma_a: 10.0, sigma_s: 90.0, law: Law::HenyeyGreenstein(0.75) };
//! let mut slab = Experiment::new(vec![layer], Source::Pencil { angle: 0.0 });
//! slab.photons = 20_000;
//! let results = run(&slab)?;
//! let reflected = results.scalar("reflected").expect("always recorded");
//! assert!(reflected.z(0.09739).abs() < 5.0);
//! # Ok::<(), moonmilk_lab::Error>(())
//! ```
//!
//! | question | where |
//! |---|---|
//! | how much is reflected, transmitted, absorbed, and where, when, at which angle? | [`run()`] |
//! | how far does light get, and how bright is it around a point source? | [`infinite`] |
//! | which radiance is there inside a half-space or a ball, direction by direction? | [`radiance`] |
//! | the same for bodies of any shape, with detectors around them? | [`bodies`] |
//! | what do walks into a half-space say about several albedos at once? | [`spread`] |
//! | which published values are found again? | [`validate`] |
//! | where does the table of the profile `tabulated` come from? | [`tabulate`] |
//!
//! This crate is kept apart from `moonmilk-render` on purpose: neither may use the other.

pub mod bodies;
pub mod error;
pub mod experiment;
pub mod infinite;
pub mod law;
pub mod plan;
pub mod profile;
pub mod radiance;
mod recorder;
pub mod results;
pub mod run;
pub mod spread;
pub mod tabulate;
pub mod validate;

pub use error::Error;
pub use experiment::{Bins, Experiment, LayerSpec, Source, Tallies};
pub use law::Law;
pub use results::{GridResult, Results, Scalar};
pub use run::run;
