//! Files of the laboratory: experiments in TOML and MCML's `.mci`, results as CSV, JSON and NPZ.

pub mod experiment_toml;
pub mod mci;
pub mod npz;
pub mod tables;
#[cfg(test)]
mod tests;
