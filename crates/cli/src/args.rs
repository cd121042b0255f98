//! The command line: names are fixed by the design, values are checked here.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use moonmilk_core::wavelengths::WavelengthMode;
use moonmilk_render::film::Aov;

/// Renders, measures and explains translucent materials. Without a command it renders the built-in showcase.
#[derive(Debug, Parser)]
#[command(name = "moonmilk", version, about, propagate_version = true)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Format of messages on standard error.
    #[arg(long, global = true, value_enum, default_value = "text")]
    pub log_format: LogFormat,
    /// Show errors alone.
    #[arg(long, short, global = true)]
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
    /// Compare two pictures: mean ratio, MSE, relMSE, FLIP, z-test where variances are known; error picture.
    Diff(Diff),
    /// Join the checkpoints of consecutive sample ranges into one picture.
    Merge(Merge),
}

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct Render {
    /// The scene, a pbrt-v4 file (also .pbrt.gz).
    pub scene: PathBuf,
    /// Picture to write: .exr or .png; the scene's own file name if absent.
    #[arg(short, long, visible_alias = "outfile")]
    pub output: Option<PathBuf>,
    /// Samples per pixel (default: the scene's).
    #[arg(long, group = "budget", value_parser = clap::value_parser!(u64).range(1..))]
    pub spp: Option<u64>,
    /// Time to spend, e.g. 90s, 5m, 1h.
    #[arg(long, group = "budget", value_parser = duration)]
    pub time: Option<Duration>,
    /// Relative error to reach, e.g. 1% or 0.01: sqrt(mean variance) / mean radiance over non-empty pixels.
    #[arg(long, group = "budget", value_parser = fraction)]
    pub error: Option<f64>,
    /// How the inside of translucent objects is solved.
    #[arg(long, default_value = "path", value_parser = subsurface)]
    pub subsurface: String,
    /// How exact walks are sampled; the mean is the same for all.
    #[arg(long, default_value = "auto", value_parser = walk)]
    pub walk: String,
    /// Wavelengths: hero, rgb, mono, or one wavelength in nm.
    #[arg(long, default_value = "hero", value_parser = wavelengths)]
    pub wavelengths: WavelengthMode,
    /// Seed of all random numbers (default: the scene's).
    #[arg(long)]
    pub seed: Option<u64>,
    /// Number of threads (default: all cores). It never changes the result.
    #[arg(long, visible_alias = "nthreads", value_parser = clap::value_parser!(u64).range(1..=4096))]
    pub threads: Option<u64>,
    /// Part of the picture to render, in pixels: x0,x1,y0,y1 (ends exclusive).
    #[arg(long, value_parser = crop)]
    pub crop: Option<[u32; 4]>,
    /// Go on from the checkpoint beside the output.
    #[arg(long)]
    pub resume: bool,
    /// Only the samples A..B of every pixel; `merge` joins such ranges to the very bits of one run.
    #[arg(long, value_parser = range, conflicts_with_all = ["time", "error"])]
    pub samples: Option<(u64, u64)>,
    /// Show the picture in a running tev viewer.
    #[arg(long, value_name = "HOST:PORT", visible_alias = "display-server")]
    pub display: Option<String>,
    /// Additional layers: albedo, normal, depth, variance, order, subsurface, diffuse, or all.
    #[arg(long, value_name = "LIST", value_parser = aovs)]
    pub aov: Option<AovList>,
    /// Largest number of bounces, or `scene` for the file's own count (default: no limit).
    #[arg(long, value_name = "N|scene", value_parser = max_depth)]
    pub max_depth: Option<MaxDepth>,
    /// What to do with open meshes around a medium.
    #[arg(long, value_enum)]
    pub open: Option<Open>,
    /// Render one pixel alone and print its samples.
    #[arg(long, value_name = "X,Y", value_parser = pixel)]
    pub pixel: Option<[u32; 2]>,
    /// Print what the transport did.
    #[arg(long)]
    pub stats: bool,
    /// Seconds between checkpoints; 0 writes none but that of an interruption.
    #[arg(long, default_value = "20", value_name = "SECONDS")]
    pub checkpoint_every: u64,
}

/// Arguments of `diff`.
#[derive(Debug, Args)]
pub struct Diff {
    /// The picture under test.
    pub a: PathBuf,
    /// The reference.
    pub b: PathBuf,
    /// Where to write the error picture (.png).
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Exit with 4 if the z-test finds a difference (both pictures need Variance layers).
    #[arg(long)]
    pub test: bool,
}

/// Arguments of `merge`.
#[derive(Debug, Args)]
pub struct Merge {
    /// Checkpoints of consecutive sample ranges.
    #[arg(required = true)]
    pub parts: Vec<PathBuf>,
    /// Picture to write.
    #[arg(short, long)]
    pub output: PathBuf,
}

/// What to do with open meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Open {
    /// Close the holes with flat caps.
    Cap,
    /// Use a BSSRDF for the object.
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

/// Names of the ways to solve the inside, in the order of the design; the first is available.
const SUBSURFACE: [&str; 18] = [
    "path",
    "tabulated",
    "gaussian",
    "gaussian-sum",
    "monopole",
    "dipole",
    "better-dipole",
    "quantized",
    "photon-beam",
    "normalized",
    "multipole",
    "directional-dipole",
    "dual-beam",
    "hybrid",
    "similarity-1",
    "similarity-3",
    "jump-shifted",
    "diffusion",
];
const WALKS: [&str; 4] = ["classic", "jump", "guided", "auto"];

fn subsurface(s: &str) -> Result<String, String> {
    match s {
        "path" => Ok(s.into()),
        _ if SUBSURFACE.contains(&s) => Err(format!("\"{s}\" is planned but not in this version; available: path")),
        _ => Err(format!("there is no \"{s}\"; did you mean \"{}\"? (available: path)", nearest(s, &SUBSURFACE))),
    }
}

fn walk(s: &str) -> Result<String, String> {
    match s {
        "classic" | "auto" => Ok(s.into()),
        _ if WALKS.contains(&s) => {
            Err(format!("\"{s}\" is planned but not in this version; available: classic, auto (= classic)"))
        }
        _ => Err(format!("there is no \"{s}\"; did you mean \"{}\"? (available: classic, auto)", nearest(s, &WALKS))),
    }
}

/// Returns the known name that shares most with s.
fn nearest(s: &str, names: &[&'static str]) -> &'static str {
    moonmilk_core::spectra::nearest(s, names.iter().copied())
}

fn duration(s: &str) -> Result<Duration, String> {
    let (number, unit) = s.split_at(s.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(s.len()));
    let factor = match unit {
        "" | "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        "ms" => 1e-3,
        _ => return Err(format!("unit \"{unit}\" is none of ms, s, m, h")),
    };
    match number.parse::<f64>() {
        Ok(x) if x > 0.0 && x * factor < 3.2e7 => Ok(Duration::from_secs_f64(x * factor)),
        _ => Err("give a positive time of at most a year, e.g. 90s, 5m, 1h".into()),
    }
}

fn fraction(s: &str) -> Result<f64, String> {
    let (number, factor) = s.strip_suffix('%').map_or((s, 1.0), |n| (n, 0.01));
    match number.trim().parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x * factor),
        _ => Err("give a positive error, e.g. 1% or 0.01".into()),
    }
}

fn wavelengths(s: &str) -> Result<WavelengthMode, String> {
    match s {
        "hero" => Ok(WavelengthMode::Hero),
        "rgb" => Ok(WavelengthMode::Rgb),
        "mono" => Ok(WavelengthMode::MONO),
        _ => match s.parse::<f32>() {
            Ok(nm) if (380.0..=780.0).contains(&nm) => Ok(WavelengthMode::Mono(nm)),
            Ok(nm) => Err(format!("wavelength {nm} nm is outside 380..780")),
            Err(_) => Err("give hero, rgb, mono, or one wavelength in nm".into()),
        },
    }
}

fn numbers<const N: usize>(s: &str) -> Option<[u32; N]> {
    let v: Vec<u32> = s.split(',').map(|x| x.trim().parse().ok()).collect::<Option<_>>()?;
    v.try_into().ok()
}

fn crop(s: &str) -> Result<[u32; 4], String> {
    match numbers(s) {
        Some([x0, x1, y0, y1]) if x0 < x1 && y0 < y1 => Ok([x0, x1, y0, y1]),
        _ => Err("give four pixel numbers x0,x1,y0,y1 with x0 < x1 and y0 < y1".into()),
    }
}

fn pixel(s: &str) -> Result<[u32; 2], String> {
    numbers(s).ok_or_else(|| "give two pixel numbers X,Y".into())
}

fn range(s: &str) -> Result<(u64, u64), String> {
    let parse = || {
        let (a, b) = s.split_once("..")?;
        let (a, b) = (a.parse().ok()?, b.parse().ok()?);
        (a < b).then_some((a, b))
    };
    parse().ok_or_else(|| "give a range of sample numbers A..B with A < B".into())
}

fn aovs(s: &str) -> Result<AovList, String> {
    if s == "all" {
        return Ok(AovList(Aov::ALL.to_vec()));
    }
    let names: Vec<&str> = Aov::ALL.iter().map(|a| a.name()).collect();
    let find = |name: &str| {
        Aov::ALL.into_iter().find(|a| a.name() == name).ok_or_else(|| {
            format!(
                "there is no layer \"{name}\"; did you mean \"{}\"? ({}, all)",
                nearest(name, &names),
                names.join(", ")
            )
        })
    };
    let mut list = s.split(',').map(|n| find(n.trim())).collect::<Result<Vec<_>, _>>()?;
    list.sort_by_key(|a| Aov::ALL.iter().position(|b| a == b));
    list.dedup();
    Ok(AovList(list))
}

fn max_depth(s: &str) -> Result<MaxDepth, String> {
    if s == "scene" {
        return Ok(MaxDepth::Scene);
    }
    s.parse().map(MaxDepth::Count).map_err(|_| "give a number of bounces, or scene".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn values_are_checked_and_units_understood() {
        assert_eq!(duration("1.5m"), Ok(Duration::from_secs(90)));
        assert!(duration("5d").is_err() && duration("-1").is_err() && duration("").is_err());
        assert!((fraction("2%").expect("valid") - 0.02).abs() < 1e-15);
        assert!(fraction("0").is_err() && crop("1,1,0,2").is_err() && range("5..5").is_err());
        assert_eq!(
            subsurface("photn-beam").expect_err("unknown"),
            "there is no \"photn-beam\"; did you mean \"photon-beam\"? (available: path)"
        );
        assert_eq!(aovs("depth,albedo").expect("valid").0, vec![Aov::Albedo, Aov::Depth]);
    }
}
