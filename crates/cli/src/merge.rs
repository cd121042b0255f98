//! `moonmilk merge`: consecutive sample ranges into the very bits of one run.

use moonmilk_io::checkpoint;

use crate::Outcome;
use crate::args::Merge;
use crate::failure::Failure;
use crate::{output, render};

/// Runs the command.
pub fn run(a: &Merge) -> Outcome {
    let input = |e: checkpoint::CheckpointError| Failure::Input(e.to_string());
    let mut parts = a
        .parts
        .iter()
        .map(|p| checkpoint::load(p).map(|(s, f)| (p, s, f)))
        .collect::<Result<Vec<_>, _>>()
        .map_err(input)?;
    parts.sort_by_key(|p| p.2.first);
    let mut parts = parts.into_iter();
    let (_, settings, mut film) = parts.next().ok_or_else(|| Failure::Usage("give at least one checkpoint".into()))?;
    for (path, s, f) in parts {
        if s != settings {
            return Err(Failure::Input(format!("{}: of another render than the first part", path.display())));
        }
        film.append(&f).map_err(|e| Failure::Input(format!("{}: {e}", path.display())))?;
    }
    let factor =
        serde_json::from_str::<serde_json::Value>(&settings).ok().and_then(|v| v["factor"].as_f64()).unwrap_or(1.0)
            as f32;
    let picture = output::picture(&film, factor, &render::attributes(&settings, &film))?;
    output::write(&a.output, &picture)?;
    let mut checkpoint_path = a.output.clone().into_os_string();
    checkpoint_path.push(".checkpoint");
    checkpoint::save(checkpoint_path.as_ref(), &settings, &film).map_err(|e| Failure::Run(e.to_string()))
}
