//! `moonmilk validate`.

use moonmilk_core::stats::{sidak, t_test};
use moonmilk_lab::run::BATCHES;
use moonmilk_lab::validate::validate;

use crate::failure::Failure;
use crate::lab_args::Validate;
use crate::{Outcome, output};

/// Significance of the whole list.
const SIGNIFICANCE: f64 = 1e-4;

/// Runs the command.
pub fn run(a: &Validate) -> Outcome {
    let checks = validate(a.photons, a.seed).map_err(|e| Failure::Usage(e.to_string()))?;
    let limit = sidak(SIGNIFICANCE, checks.len());
    let freedom = (BATCHES.min(a.photons) - 1) as f64;
    output::print(&format!(
        "{:52} {:>10} {:>10}    {:>8} {:>6}        source",
        "value", "expected", "measured", "std err", "z"
    ))?;
    let mut failed = 0;
    for c in &checks {
        let ok = t_test(c.z(), freedom) >= limit;
        failed += usize::from(!ok);
        let verdict = if ok { "pass" } else { "FAIL" };
        output::print(&format!(
            "{:52} {:10.6} {:10.6} +- {:8.6} {:6.2}  {verdict}  {}",
            c.name,
            c.expected,
            c.measured.mean,
            c.measured.std_err,
            c.z(),
            c.source
        ))?;
    }
    output::print(&format!(
        "{} of {} agree (significance {SIGNIFICANCE:.0e} over the list, {} paths each, seed {})",
        checks.len() - failed,
        checks.len(),
        a.photons,
        a.seed
    ))?;
    if failed > 0 { Err(Failure::Check(format!("{failed} published values were not found again"))) } else { Ok(()) }
}
