//! Arguments of `compare`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use moonmilk_core::wavelengths::WavelengthMode;

use crate::args::{MOST_SAMPLES, Open};
use crate::values;

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub struct Compare {
    /// The scene, a pbrt-v4 file (also .pbrt.gz).
    pub scene: PathBuf,
    /// Models to compare: names separated by commas, or `all` that render the whole light (default: dipole, better-dipole, quantized,
    /// photon-beam, normalized, tabulated). `tabulated` is always among them, since errors are parted by it.
    #[arg(long, value_name = "all|LIST", value_parser = values::subsurface_list)]
    pub subsurface: Option<values::SubsurfaceList>,
    /// What the models are compared with.
    #[arg(long, default_value = "path", value_name = "MODE", value_parser = values::subsurface)]
    pub against: String,
    /// Folder to write (default: the scene's name with -compare, in the current folder).
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Number of threads (default: all cores). It never changes the result of equal samples.
    #[arg(long, visible_alias = "nthreads", value_name = "N", value_parser = clap::value_parser!(u64).range(1..=4096))]
    pub threads: Option<u64>,

    /// Time for each picture, e.g. 30s, 5m (default: 60s).
    #[arg(long, group = "budget", allow_negative_numbers = true, value_parser = values::duration, help_heading = "When it is done")]
    pub time: Option<Duration>,
    /// Samples per pixel of each picture, in place of a time.
    #[arg(long, group = "budget", value_name = "N", help_heading = "When it is done",
          value_parser = clap::value_parser!(u64).range(2..=MOST_SAMPLES))]
    pub spp: Option<u64>,
    /// Time for the exact picture (default: four times that of a model, so that its noise hardly counts).
    #[arg(long, group = "exact", allow_negative_numbers = true, value_parser = values::duration, help_heading = "When it is done")]
    pub reference_time: Option<Duration>,
    /// Samples per pixel of the exact picture (default: four times those of a model).
    #[arg(long, group = "exact", value_name = "N", help_heading = "When it is done",
          value_parser = clap::value_parser!(u64).range(2..=MOST_SAMPLES))]
    pub reference_spp: Option<u64>,
    /// A picture to take for the exact one, rendered before: of an earlier comparison, or by `render --aov variance`.
    #[arg(long, group = "exact", value_name = "FILE", help_heading = "When it is done")]
    pub reference: Option<PathBuf>,
    /// Go on with an interrupted comparison: the same command with this option. What is finished is not rendered again.
    #[arg(long, help_heading = "When it is done")]
    pub resume: bool,
    /// Time between checkpoints of the running picture, in seconds or with a unit; 0 writes one at an interruption alone.
    #[arg(long, default_value = "20", value_name = "TIME", allow_negative_numbers = true,
          value_parser = values::interval, help_heading = "When it is done")]
    pub checkpoint_every: Duration,

    /// Part of the picture to render, in pixels: x0,x1,y0,y1 (ends exclusive).
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = values::crop, help_heading = "What is rendered")]
    pub crop: Option<[u32; 4]>,
    /// Wavelengths: rgb (three monochromatic problems, exact by definition), hero, mono, or one wavelength in nm.
    #[arg(long, default_value = "rgb", value_name = "W", value_parser = values::wavelengths, help_heading = "What is rendered")]
    pub wavelengths: WavelengthMode,
    /// Seed of all random numbers (default: the scene's).
    #[arg(long, value_name = "N", help_heading = "What is rendered")]
    pub seed: Option<u64>,
    /// What to do with open meshes around a medium (default: refuse them).
    #[arg(long, value_enum, value_name = "HOW", help_heading = "What is rendered")]
    pub open: Option<Open>,
}
