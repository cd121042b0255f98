//! What an experiment found: every number an estimate with its unit.

use moonmilk_core::Estimate;

use crate::plan::Axis;

/// A number for the whole experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Scalar {
    /// Its name; those of a layer are `NAME.LAYER`.
    pub name: String,
    /// What it is.
    pub about: String,
    /// Its unit.
    pub unit: String,
    /// Its value.
    pub value: Estimate,
}

/// A quantity on a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridResult {
    /// Its name.
    pub name: &'static str,
    /// Unit of the values: per unit of the source's power.
    pub unit: String,
    /// Axes, slowest first.
    pub axes: Vec<Axis>,
    /// One value per cell, the last axis fastest.
    pub cells: Vec<Estimate>,
    /// What fell outside the axes, not divided by any measure.
    pub outside: Estimate,
}

/// The results of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Results {
    /// Number of paths.
    pub photons: u64,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Paths lost by rounding; 0 in all that was ever run.
    pub lost: u64,
    /// Numbers for the whole, all of the source's power.
    pub scalars: Vec<Scalar>,
    /// Quantities on grids.
    pub grids: Vec<GridResult>,
}

impl Results {
    /// Returns a number by its name.
    pub fn scalar(&self, name: &str) -> Option<Estimate> {
        self.scalars.iter().find(|s| s.name == name).map(|s| s.value)
    }

    /// Returns a grid by its name.
    pub fn grid(&self, name: &str) -> Option<&GridResult> {
        self.grids.iter().find(|g| g.name == name)
    }
}
