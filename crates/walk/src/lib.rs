//! The one random walk of light inside a scattering medium.
//!
//! A walk alternates free flights, whose lengths follow exp(-sigma_t t), and collisions, which absorb by weight and
//! turn the direction by the phase function. It is generic over a [`Domain`] (where is the wall, what happens there) and
//! a [`Tally`] (what is recorded), and knows neither scenes nor files. Renderer and laboratory both call [`classic::walk`],
//! or [`heterogeneous::walk`] where coefficients depend on the place ([`Field`]).
//!
//! *Weights.* A walk carries several wavelengths. Flights are sampled for lane 0, the hero; lane j follows with the
//! weight f_j / mean_i p_i (balance heuristic over the lanes, \[Wilkie2014\], \[Miller2019\]). [`Walker::beta`] is that
//! weight, [`Walker::ratio`] is p_j / mean_i p_i; both are renormalised at every event, so that neither over- nor
//! underflows in walks of any length.

pub mod classic;
pub mod domain;
pub mod field;
pub mod guide;
pub mod guided;
pub mod heterogeneous;
pub mod hybrid;
pub mod jump;
pub mod layers;
pub mod math;
pub mod medium;
pub mod phase;
pub mod similar;
pub mod tabulated;
pub mod tally;
pub mod walker;

pub use classic::{Limits, Outcome, Roulette, walk, walk_with};
pub use domain::{Domain, Wall};
pub use field::{Field, Grid, Majorants};
pub use guide::Guide;
pub use jump::Jumps;
pub use layers::{Stack, walk_stack};
pub use medium::Medium;
pub use phase::PhaseFunction;
pub use similar::Similar;
pub use tally::{NoTally, PathLength, Tally};
pub use walker::Walker;
