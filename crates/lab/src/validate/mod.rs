//! Published and exact values, measured again.
//!
//! | what | where |
//! |---|---|
//! | reflectance and transmittance of slabs and half-spaces, mean path lengths | `layers` |
//! | Chandrasekhar's H function, and how much light leaves at which angle | `angles` |
//! | a point source in an infinite medium, and the errors of classical diffusion and of Grosjean's form | `point` |
//! | the errors of the models of the registry: albedo, R at five radii, L1 | `models` |

mod angles;
mod layers;
mod models;
mod point;

use moonmilk_core::Estimate;

use crate::error::Error;

pub use models::{MediumErrors, ModelErrors};

/// How much is to be spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Number of walks per experiment.
    pub walks: u64,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// A value measured again.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// What it is.
    pub name: String,
    /// Its unit, empty for numbers.
    pub unit: &'static str,
    /// Where the expected value comes from.
    pub source: &'static str,
    /// The value expected.
    pub expected: f64,
    /// Its own error: rounding of what was printed, or a standard error.
    pub uncertainty: f64,
    /// What was measured.
    pub measured: Estimate,
}

impl Check {
    /// Returns the distance in combined standard errors.
    pub fn z(&self) -> f64 {
        let d = self.measured.mean - self.expected;
        if d == 0.0 { 0.0 } else { d / self.measured.std_err.hypot(self.uncertainty) }
    }
}

/// All that was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Validation {
    /// Values, in the order of the table above.
    pub values: Vec<Check>,
    /// The models' errors.
    pub models: Vec<MediumErrors>,
}

impl Validation {
    /// Returns all comparisons.
    pub fn checks(&self) -> impl Iterator<Item = &Check> {
        self.values.iter().chain(self.models.iter().flat_map(MediumErrors::checks))
    }
}

/// Measures everything.
///
/// *Errors*: fewer walks than batches.
pub fn validate(settings: &Settings) -> Result<Validation, Error> {
    let mut values = layers::checks(settings)?;
    values.extend(angles::checks(settings)?);
    values.extend(point::checks(settings)?);
    Ok(Validation { values, models: models::errors(settings)? })
}
