//! `moonmilk validate`.

use moonmilk_core::stats::{sidak, t_test};
use moonmilk_lab::run::BATCHES;
use moonmilk_lab::validate::{Check, MediumErrors, Settings, Validation, validate};

use crate::failure::Failure;
use crate::lab_args::Validate;
use crate::{Outcome, output};

/// Significance of the whole list.
const SIGNIFICANCE: f64 = 1e-4;

/// What counts as agreement.
struct Judge {
    limit: f64,
    freedom: f64,
}

impl Judge {
    fn agrees(&self, c: &Check) -> bool {
        t_test(c.z(), self.freedom) >= self.limit
    }
}

/// Runs the command.
pub fn run(a: &Validate) -> Outcome {
    let found = super::simulate::on_threads(a.threads, || validate(&Settings { walks: a.photons, seed: a.seed }))?
        .map_err(|e| Failure::Usage(e.to_string()))?;
    let count = found.checks().count();
    let judge = Judge { limit: sidak(SIGNIFICANCE, count), freedom: (BATCHES - 1) as f64 };
    output::print(&report(&found, &judge))?;
    let failed = found.checks().filter(|c| !judge.agrees(c)).count();
    output::print(&format!(
        "{} of {count} agree (significance {SIGNIFICANCE:.0e} over all of them, {} walks each, seed {})",
        count - failed,
        a.photons,
        a.seed
    ))?;
    if failed > 0 { Err(Failure::Check(format!("{failed} published values were not found again"))) } else { Ok(()) }
}

fn report(found: &Validation, judge: &Judge) -> String {
    let mut lines = vec![format!(
        "{:62} {:>10} {:>10}    {:>8} {:>6}        source",
        "value", "expected", "measured", "std err", "z"
    )];
    lines.extend(found.values.iter().map(|c| line(c, judge)));
    lines.push("\nErrors of the models against Monte Carlo [%], light along the normal, isotropic scattering, radii in mean free paths;".into());
    lines.push("+- is the standard error of this measurement, `!` where it does not agree with what was printed, - where nothing was or too little light arrived.".into());
    for m in &found.models {
        lines.push(String::new());
        lines.extend(table(m, judge));
    }
    // Tell again what fails, with the printed value.
    let failed: Vec<&Check> = found.models.iter().flat_map(MediumErrors::checks).filter(|c| !judge.agrees(c)).collect();
    lines.push(String::new());
    lines.extend(failed.into_iter().map(|c| line(c, judge)));
    lines.join("\n")
}

fn line(c: &Check, judge: &Judge) -> String {
    let verdict = if judge.agrees(c) { "pass" } else { "FAIL" };
    let name = if c.unit.is_empty() { c.name.clone() } else { format!("{} [{}]", c.name, c.unit) };
    format!(
        "{name:62} {:10.6} {:10.6} +- {:8.6} {:6.2}  {verdict}  {}",
        c.expected,
        c.measured.mean,
        c.measured.std_err,
        c.z(),
        c.source
    )
}

/// Returns the table of one medium: a line per model, a column per quantity.
fn table(m: &MediumErrors, judge: &Judge) -> Vec<String> {
    let cell = |c: Option<&Check>| match c {
        None => format!("{:>17}", "-"),
        Some(c) => {
            let mark = if judge.agrees(c) { ' ' } else { '!' };
            format!("{:>+9.1} +- {:3.1}{mark}", c.measured.mean, c.measured.std_err)
        }
    };
    let head = ["albedo", "R(.1)", "R(.3)", "R(1)", "R(3)", "R(10)", "L1"];
    let mut lines =
        vec![format!("{:28}{}", format!("alpha {}, n {}", m.alpha, m.eta), head.map(|h| format!("{h:>17}")).concat())];
    let row = |name: &str, cells: Vec<Option<&Check>>| {
        format!("  {name:26}{}", cells.into_iter().map(cell).collect::<String>())
    };
    lines.push(row("Monte Carlo / expected", m.simulation.iter().map(Option::as_ref).collect()));
    lines.extend(m.models.iter().map(|model| row(model.name, model.errors.iter().map(Option::as_ref).collect())));
    lines
}
