//! The command line: names are fixed by the design, values are checked in [`crate::values`].

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use moonmilk_core::wavelengths::WavelengthMode;
use moonmilk_render::film::Aov;
use moonmilk_render::integrator::Policy;

use crate::compare::args::Compare;
use crate::lab_args::{ProfileArgs, Simulate, Validate};
use crate::values;

const EXAMPLES: &str = "\
Examples:
  moonmilk                                 the showcase: moonmilk.png and .exr within a minute
  moonmilk render a.pbrt -o a.exr          a scene of yours
  moonmilk render a.pbrt --error 1%        until the noise is one per cent of the mean
  moonmilk render a.pbrt --time 5m         for five minutes
  moonmilk render a.pbrt --resume          goes on with an interrupted run
  moonmilk render a.pbrt --resume --spp 512  goes on to more samples
  moonmilk compare a.pbrt --time 60s       which model of subsurface scattering is good enough
  moonmilk check a.pbrt                    why objects are black, dull or endless
  moonmilk diff a.exr reference.exr        how two pictures differ, and whether by more than noise

`moonmilk help render` explains every option. Exit codes: 0 done, 1 failed, 2 wrong usage,
3 wrong scene or input, 4 a check failed, 130 interrupted with the checkpoint written.";

/// Renders translucent materials exactly, and measures pictures. Without a command it renders the built-in showcase.
#[derive(Debug, Parser)]
#[command(name = "moonmilk", version, propagate_version = true, after_help = EXAMPLES, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Format of messages on standard error.
    #[arg(long, global = true, value_enum, default_value = "text", value_name = "FORMAT", help_heading = "Messages")]
    pub log_format: LogFormat,
    /// Show errors alone.
    #[arg(long, short, global = true, help_heading = "Messages")]
    pub quiet: bool,
}

/// How messages look.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// Lines for people.
    Text,
    /// One JSON object per line.
    Json,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a pbrt-v4 scene.
    Render(Box<Render>),
    /// Render a scene by several models of subsurface scattering and exactly, and report which one is good enough at what cost.
    Compare(Box<Compare>),
    /// Compare two pictures: mean ratio, MSE, relMSE, FLIP, z-test where variances are known; error picture.
    Diff(Diff),
    /// Plot R(r) of subsurface models against Monte Carlo, with a table of their errors.
    Profile(ProfileArgs),
    /// Simulate light in layers or in the bodies of a scene: reflectance, transmittance, absorption and fluence, each with its error.
    Simulate(Simulate),
    /// Measure published and exact values again.
    Validate(Validate),
    /// Join the checkpoints of consecutive sample ranges into one picture.
    Merge(Merge),
    /// List the models of subsurface scattering: source, validity, when to use them.
    Models(Models),
    /// Print a measured material in the numbers of any program, or list the materials.
    Material(Material),
    /// Find what makes translucent objects black, dull or endless, and say what to do about it.
    Check(Check),
}

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct Render {
    /// The scene, a pbrt-v4 file (also .pbrt.gz).
    pub scene: PathBuf,
    /// Picture to write: .exr or .png (default: the scene's own file name, in the current folder).
    #[arg(short, long, visible_alias = "outfile", value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Show the picture in a running tev viewer.
    #[arg(long, value_name = "HOST:PORT", visible_alias = "display-server")]
    pub display: Option<String>,
    /// Number of threads (default: all cores). It never changes the result.
    #[arg(long, visible_alias = "nthreads", value_name = "N", value_parser = clap::value_parser!(u64).range(1..=4096))]
    pub threads: Option<u64>,
    /// Print what the transport did, on standard output.
    #[arg(long)]
    pub stats: bool,
    /// Afterwards follow a sixteenth of the samples once more by plain walks, and print the difference with its confidence interval:
    /// the bias of an approximation, and nothing beyond noise for a policy of exact walks (else exit code 4).
    #[arg(long, conflicts_with = "pixel")]
    pub audit: bool,

    /// Samples per pixel (default: the scene's).
    #[arg(long, group = "budget", value_name = "N", help_heading = "When it is done",
          value_parser = clap::value_parser!(u64).range(1..=MOST_SAMPLES))]
    pub spp: Option<u64>,
    /// Time to spend on rendering, e.g. 90s, 5m, 1h.
    #[arg(long, group = "budget", allow_negative_numbers = true, value_parser = values::duration, help_heading = "When it is done")]
    pub time: Option<Duration>,
    /// Relative error to reach, e.g. 1% or 0.01: sqrt(mean variance) / mean radiance over non-empty pixels, tested whenever
    /// the number of samples has doubled.
    #[arg(long, group = "budget", allow_negative_numbers = true, value_parser = values::fraction, help_heading = "When it is done")]
    pub error: Option<f64>,
    /// Only the samples A..B of every pixel; `merge` joins such ranges to the very bits of one run.
    #[arg(long, group = "budget", value_name = "A..B", value_parser = values::range, help_heading = "When it is done")]
    pub samples: Option<(u64, u64)>,
    /// Go on from the checkpoint beside the output (OUTPUT.checkpoint), to its own end or to the one given here.
    #[arg(long, help_heading = "When it is done")]
    pub resume: bool,
    /// Time between checkpoints, in seconds or with a unit; 0 writes one at the end or interruption alone.
    #[arg(long, default_value = "20", value_name = "TIME", allow_negative_numbers = true,
          value_parser = values::interval, help_heading = "When it is done")]
    pub checkpoint_every: Duration,

    /// Part of the picture to render, in pixels: x0,x1,y0,y1 (ends exclusive).
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = values::crop, help_heading = "What is recorded")]
    pub crop: Option<[u32; 4]>,
    /// Additional layers: albedo, normal, depth, variance, order, subsurface, diffuse, or all.
    #[arg(long, value_name = "LIST", value_parser = values::aovs, help_heading = "What is recorded")]
    pub aov: Option<AovList>,
    /// Render one pixel alone and print its samples on standard output; no picture is written.
    #[arg(long, value_name = "X,Y", value_parser = values::pixel, help_heading = "What is recorded",
          conflicts_with_all = ["time", "error", "resume", "output", "display", "crop", "aov"])]
    pub pixel: Option<[u32; 2]>,

    /// How the inside of translucent objects is solved.
    #[arg(long, default_value = "path", value_name = "MODE", value_parser = values::subsurface, help_heading = "Transport")]
    pub subsurface: String,
    /// How exact walks are sampled; the mean is the same for all: classic (flight by flight), jump (over balls of the
    /// medium at once), guided (towards the nearest wall where much is absorbed), or auto.
    #[arg(long, default_value = "auto", value_name = "POLICY", value_parser = values::walk, help_heading = "Transport")]
    pub walk: Policy,
    /// Wavelengths: hero, rgb, mono, or one wavelength in nm.
    #[arg(long, default_value = "hero", value_name = "W", value_parser = values::wavelengths, help_heading = "Transport")]
    pub wavelengths: WavelengthMode,
    /// Seed of all random numbers (default: the scene's).
    #[arg(long, value_name = "N", help_heading = "Transport")]
    pub seed: Option<u64>,
    /// Largest number of bounces, or `scene` for the file's own count (default: no limit).
    #[arg(long, value_name = "N|scene", value_parser = values::max_depth, help_heading = "Transport")]
    pub max_depth: Option<MaxDepth>,
    /// What to do with open meshes around a medium (default: refuse them).
    #[arg(long, value_enum, value_name = "HOW", help_heading = "Transport")]
    pub open: Option<Open>,
}

/// Largest number of samples per pixel: the film's sums stay exact for 2^16 samples of the largest value in each of
/// eight scramblings, and far longer for any real picture; 2^40 is beyond any patience.
pub const MOST_SAMPLES: u64 = 1 << 40;

/// Arguments of `diff`.
#[derive(Debug, Args)]
pub struct Diff {
    /// The picture under test.
    pub a: PathBuf,
    /// The reference.
    pub b: PathBuf,
    /// Where to write the error picture (.png).
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Exit with 4 if the z-test finds a difference (both pictures need Variance layers: --aov variance).
    #[arg(long)]
    pub test: bool,
}

/// Arguments of `merge`.
#[derive(Debug, Args)]
pub struct Merge {
    /// Checkpoints of consecutive sample ranges, in any order.
    #[arg(required = true)]
    pub parts: Vec<PathBuf>,
    /// Picture to write: .exr or .png.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}

/// Arguments of `models`.
#[derive(Debug, Args)]
pub struct Models {
    /// One model to describe (default: list all).
    pub name: Option<String>,
}

/// Arguments of `material`.
#[derive(Debug, Args)]
pub struct Material {
    /// Name of the material (default: list all).
    pub name: Option<String>,
    /// Convention to print it in; each print says what it loses.
    #[arg(long = "as", value_enum, default_value = "coefficients", value_name = "CONVENTION")]
    pub convention: Convention,
}

/// Conventions of other programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Convention {
    /// Absorption and scattering coefficient, asymmetry.
    Coefficients,
    /// Reduced coefficients and what diffusion makes of them.
    Reduced,
    /// Surface albedos and mean free paths.
    AlbedoMfp,
    /// pbrt-v4's `subsurface` material.
    Pbrt,
    /// A Mitsuba 3 medium behind a dielectric.
    Mitsuba,
    /// The subsurface inputs of OpenPBR.
    Openpbr,
    /// Blender's Principled BSDF.
    Cycles,
    /// glTF extensions, partly drafts.
    Gltf,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct Check {
    /// The scene, a pbrt-v4 file (also .pbrt.gz).
    pub scene: PathBuf,
    /// Only read the text, to its end even where meshes, pictures or included files are missing; report each of them once.
    #[arg(long, conflicts_with = "furnace")]
    pub syntax: bool,
    /// Measure the white furnace and the mean path length on the scene's own objects.
    #[arg(long)]
    pub furnace: bool,
    /// The scene's unit of length, for labels: nm, um, mm, cm, m, in, ft.
    #[arg(long, default_value = "mm", value_name = "UNIT", value_parser = values::unit)]
    pub unit: Unit,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Its symbol.
    pub name: &'static str,
}

/// What to do with open meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Open {
    /// Close the holes with flat caps.
    Cap,
    /// Render the mesh by the profile `tabulated` instead of a walk; under a model of --subsurface by that model.
    Profile,
    /// End paths that leave through holes, and count them.
    Kill,
}

/// Limit of the number of bounces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaxDepth {
    /// The scene file's.
    Scene,
    /// A number.
    Count(u32),
}

/// A list of additional layers.
#[derive(Clone, Debug)]
pub struct AovList(pub Vec<Aov>);

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_option_is_documented() {
        for command in std::iter::once(&Cli::command()).chain(Cli::command().get_subcommands()) {
            for a in command.get_arguments().filter(|a| !a.is_hide_set()) {
                let text = a.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(text.len() > 10, "{} {}: \"{text}\"", command.get_name(), a.get_id());
            }
        }
    }
}
