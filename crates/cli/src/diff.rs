//! `moonmilk diff`.

use std::path::Path;

use moonmilk_io::atomic::write_atomically;
use moonmilk_io::image::Picture;
use moonmilk_io::metrics;
use moonmilk_io::texture::{Encoding, load_texture};
use moonmilk_io::{exr, png};

use crate::args::Diff;
use crate::failure::Failure;
use crate::{Outcome, output};

/// Significance below which `--test` reports a difference.
const SIGNIFICANCE: f64 = 1e-4;

/// Runs the command.
pub fn run(a: &Diff) -> Outcome {
    if let Some(path) = &a.output {
        if output::format(path) != Some(output::Format::Png) {
            return Err(Failure::Usage(format!("{}: the error picture is written as .png", path.display())));
        }
        output::check_writable(path)?;
    }
    let (test, reference) = (read(&a.a)?, read(&a.b)?);
    let report = metrics::diff(&test, &reference).map_err(|e| Failure::Input(e.to_string()))?;
    output::print(&report.to_string())?;
    if let Some(path) = &a.output {
        let picture = report.flip_picture().and_then(|p| png::encode(&p)).map_err(|e| Failure::Run(e.to_string()))?;
        write_atomically(path, &picture).map_err(|e| Failure::Run(format!("{}: {e}", path.display())))?;
    }
    match (a.test, report.p()) {
        (true, None) => {
            Err(Failure::Input("--test needs Variance layers in both pictures (render with --aov variance)".into()))
        }
        (true, Some(p)) if p < SIGNIFICANCE => {
            Err(Failure::Check(format!("the means differ: p = {p:.2e} < {SIGNIFICANCE:.0e}")))
        }
        _ => Ok(()),
    }
}

fn read(path: &Path) -> Result<Picture, Failure> {
    let fail = |e: String| Failure::Input(format!("{}: {e}", path.display()));
    let bytes = std::fs::read(path).map_err(|e| fail(e.to_string()))?;
    let picture = if exr::is_exr(&bytes) {
        exr::decode(&bytes)
    } else {
        load_texture(&bytes, &path.display().to_string(), Encoding::Srgb)
    };
    picture.map_err(|e| fail(e.to_string()))
}
