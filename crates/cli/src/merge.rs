//! `moonmilk merge`: consecutive sample ranges into the very bits of one run.

use moonmilk_io::checkpoint;

use crate::args::Merge;
use crate::budget::Budget;
use crate::failure::Failure;
use crate::settings::Settings;
use crate::{Outcome, output};

/// Runs the command.
pub fn run(a: &Merge) -> Outcome {
    output::require_format(&a.output)?;
    let checkpoint_path = output::checkpoint_path(&a.output);
    output::check_writable(&a.output)?;
    output::check_writable(&checkpoint_path)?;
    let mut parts = Vec::new();
    for path in &a.parts {
        let (text, film) = checkpoint::load(path).map_err(|e| Failure::Input(e.to_string()))?;
        let (settings, _) = Settings::parse(&text)
            .ok_or_else(|| Failure::Input(format!("{}: its settings cannot be read", path.display())))?;
        parts.push((path, settings, film));
    }
    parts.sort_by_key(|p| p.2.first);
    let mut parts = parts.into_iter();
    let (_, settings, mut film) = parts.next().ok_or_else(|| Failure::Usage("give at least one checkpoint".into()))?;
    for (path, s, f) in parts {
        let differences = s.differences(&settings);
        if !differences.is_empty() {
            return Err(Failure::Input(format!(
                "{}: of another render than the first part: {}",
                path.display(),
                differences.join("; ")
            )));
        }
        film.append(&f).map_err(|e| Failure::Input(format!("{}: {e}", path.display())))?;
    }
    let [least, most] = output::levels(&film);
    if least != most {
        tracing::warn!(
            "the last part was interrupted: its tiles have {least} to {most} samples; resume it and merge again"
        );
    }
    let picture = output::picture(&film, Some(&settings), settings.factor())?;
    output::write(&a.output, &picture)?;
    let recorded = settings.record(&Budget::Samples(film.first + least));
    checkpoint::save(&checkpoint_path, &recorded, &film).map_err(|e| Failure::Run(e.to_string()))
}
