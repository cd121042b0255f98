//! Arguments of the laboratory's commands.

use std::path::PathBuf;

use clap::Args;

/// Arguments of `simulate`.
#[derive(Debug, Args)]
pub struct Simulate {
    /// The experiment: layers, source and tallies in TOML, or an input file of MCML (.mci).
    pub file: PathBuf,
    /// Results to write: .csv, .json or .npz (default: the totals, on standard output). A file of several runs writes NAME-1, NAME-2, ...
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Number of paths (default: the file's).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..))]
    pub photons: Option<u64>,
    /// Seed of the random numbers (default: the file's, or 1); run k of a file has this seed + k.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Number of threads (default: all cores). It never changes the result.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=4096))]
    pub threads: Option<u64>,
}

/// Arguments of `validate`.
#[derive(Debug, Args)]
pub struct Validate {
    /// Number of paths per value.
    #[arg(long, default_value_t = 300_000, value_name = "N", value_parser = clap::value_parser!(u64).range(1000..))]
    pub photons: u64,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
}
