//! Arguments of the laboratory's commands.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

/// Arguments of `simulate`.
#[derive(Debug, Args)]
pub struct Simulate {
    /// The experiment: layers, source and tallies in TOML, an input file of MCML (.mci), or a scene of pbrt: closed bodies with homogeneous media, one light, and
    /// all other shapes as detectors that take the light that meets them.
    pub file: PathBuf,
    /// Grids to record in the bodies of a scene: fluence=N, absorption=N, with N cubic cells along the longest side.
    #[arg(long, value_name = "LIST")]
    pub tally: Vec<String>,
    /// Colour of a scene's coefficients.
    #[arg(long, value_enum, default_value = "green", value_name = "COLOUR")]
    pub channel: Channel,
    /// Unit of length of a scene, a label: um, mm, cm, m.
    #[arg(long, default_value = "mm", value_name = "UNIT")]
    pub unit: String,
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
    /// Number of paths per experiment; errors fall with its root.
    #[arg(long, default_value_t = 300_000, value_name = "N", value_parser = clap::value_parser!(u64).range(1000..=1_000_000_000_000))]
    pub photons: u64,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
    /// Number of threads (default: all cores). It never changes the result.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=4096))]
    pub threads: Option<u64>,
}

/// Arguments of `profile`.
#[derive(Debug, Args)]
pub struct ProfileArgs {
    /// A material by its name, or coefficients such as sigma_a=0.01,sigma_s=1,g=0,eta=1.3.
    pub material: String,
    /// Models to compare, separated by commas, or all (default: six usual ones; `moonmilk models` lists them).
    #[arg(long, value_name = "LIST")]
    pub models: Option<String>,
    /// Instead of profiles: the radiance inside a half-space and a ball under diffuse light, exact and rebuilt from fluence and flux (P1).
    #[arg(long, conflicts_with_all = ["models", "point_source", "brownian"])]
    pub radiance: bool,
    /// Instead of profiles: the fluence around a point source in an infinite medium, exact, of diffusion, and of Grosjean's form.
    #[arg(long, conflicts_with_all = ["models", "brownian"])]
    pub point_source: bool,
    /// Instead of profiles: paths of light beside Brownian motion of the same diffusion coefficient.
    #[arg(long, conflicts_with = "models")]
    pub brownian: bool,
    /// Radius of the ball of --radiance (default: two transport mean free paths).
    #[arg(long, value_name = "LENGTH", requires = "radiance", allow_negative_numbers = true)]
    pub radius: Option<f64>,
    /// Colour of a named material.
    #[arg(long, value_enum, default_value = "green", value_name = "COLOUR")]
    pub channel: Channel,
    /// Unit of length for labels.
    #[arg(long, default_value = "mm", value_name = "UNIT")]
    pub unit: String,
    /// Number of Monte Carlo paths.
    #[arg(long, default_value_t = 300_000, value_name = "N", value_parser = clap::value_parser!(u64).range(1000..))]
    pub photons: u64,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
    /// Number of threads (default: all cores). It never changes the result.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=4096))]
    pub threads: Option<u64>,
    /// Plot or data to write, .svg, .png, .csv or .json; may be given several times.
    #[arg(short, long, value_name = "FILE")]
    pub output: Vec<PathBuf>,
}

/// A colour of a named material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Channel {
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
}

impl Channel {
    /// Returns its place in triples.
    pub fn index(self) -> usize {
        self as usize
    }

    /// Returns its name.
    pub fn name(self) -> &'static str {
        ["red", "green", "blue"][self.index()]
    }
}
