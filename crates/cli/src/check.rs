//! `moonmilk check`: what is wrong with a scene, and what to do about it.

use moonmilk_core::stats::{sidak, z_test};
use moonmilk_io::pbrt::{self, Options};
use moonmilk_render::description::{Place, SceneDescription};
use moonmilk_render::doctor::{self, Body, Finding, Furnace, Report, Severity, Unmeasured};
use serde_json::{Value, json};

use crate::args::{Check, LogFormat};
use crate::failure::Failure;
use crate::{Outcome, output, render};

/// Largest number of objects listed, and measured in the furnace.
const LISTED: usize = 50;

/// Collisions per theorem and object: .1 to 1 % of the path length, within seconds.
const BUDGET: f64 = 1e7;

/// Seed of the furnace.
const SEED: u64 = 0;

/// Chance of a false alarm of the furnace, over all its tests.
const SIGNIFICANCE: f64 = 1e-4;

/// Rounding of the weights along a path in single precision, as the program's own tests bound it.
const ROUNDING: f64 = 1e-5;

/// Runs the command.
pub fn run(a: &Check, format: LogFormat) -> Outcome {
    let json = format == LogFormat::Json;
    if a.syntax {
        return syntax(a, json);
    }
    let loaded = pbrt::load(&a.scene).map_err(Failure::Scene)?;
    render::warn(&loaded.warnings);
    let d = &loaded.scene;
    let report = doctor::examine(d).map_err(|e| Failure::Input(e.to_string()))?;
    let measured = if a.furnace { furnaces(d, &report)? } else { Vec::new() };
    let failed = measured.iter().filter(|m| m.failed()).count();
    if json {
        print_json(a, &report, &measured)?;
    } else {
        print_text(a, &report, &measured)?;
    }
    let problems = report.problems() + failed;
    match problems {
        0 => Ok(()),
        1 => Err(Failure::Check(format!("{}: 1 problem", a.scene.display()))),
        n => Err(Failure::Check(format!("{}: {n} problems", a.scene.display()))),
    }
}

/// Reads the text alone and reports what is wrong with it and which files are missing.
fn syntax(a: &Check, json: bool) -> Outcome {
    let options = Options { syntax_only: true, ..Options::default() };
    let loaded = pbrt::load_from_disk(&a.scene, &options).map_err(Failure::Scene)?;
    render::warn(&loaded.warnings);
    let s = &loaded.scene;
    if json {
        let missing: Vec<Value> =
            loaded.missing.iter().map(|m| json!({"place": place(m.place.as_ref()), "message": m.message})).collect();
        output::print(&json!({"scene": a.scene.display().to_string(), "missing": missing}).to_string())?;
    } else {
        for m in &loaded.missing {
            output::print(&format!("missing  {m}"))?;
        }
        output::print(&format!(
            "{}: read to the end: {}, {}, {}, {}, {}",
            a.scene.display(),
            count(s.shapes.len(), "shape"),
            count(s.materials.len().saturating_sub(1), "material"),
            count(s.media.len(), "medium"),
            count(s.lights.len() + s.shapes.iter().filter(|s| s.area_light.is_some()).count(), "light"),
            count(loaded.missing.len(), "missing file"),
        ))?;
    }
    match loaded.missing.len() {
        0 => Ok(()),
        n => Err(Failure::Check(format!("{}: {}", a.scene.display(), count(n, "missing file")))),
    }
}

/// `1 shape`, `2 shapes`, `3 media`.
fn count(n: usize, what: &str) -> String {
    match (n, what) {
        (1, _) => format!("1 {what}"),
        (_, "medium") => format!("{n} media"),
        _ => format!("{n} {what}s"),
    }
}

fn place(p: Option<&Place>) -> Value {
    p.map_or(Value::Null, |p| Value::String(p.to_string()))
}

/// A measurement of one object with its verdict.
struct Measured<'a> {
    body: &'a Body,
    result: Result<Furnace, Unmeasured>,
    /// Significance of each single test.
    limit: f64,
}

impl Measured<'_> {
    fn white(&self, f: &Furnace) -> bool {
        let off = ((f.radiance.mean - 1.0).abs() - ROUNDING).max(0.0);
        off == 0.0 || z_test(off / f.radiance.std_err) > self.limit
    }

    fn long(&self, f: &Furnace) -> bool {
        z_test(f.path_length.z(1.0)) > self.limit
    }

    fn failed(&self) -> bool {
        self.result.as_ref().is_ok_and(|f| f.exact && !(self.white(f) && self.long(f)))
    }

    /// Returns what the measurement means.
    fn verdict(&self) -> String {
        match &self.result {
            Err(Unmeasured::Open) => "not measured: it is open".into(),
            Err(Unmeasured::Empty) => "not measured: its medium is empty".into(),
            Err(Unmeasured::Dense) => "not measured: more than 100000 mean free paths thick".into(),
            Ok(f) if !f.exact => {
                format!("no verdict: its rough boundary loses light by its model, {:.2} % here", 100.0 * (1.0 - f.radiance.mean))
            }
            Ok(f) => match (self.white(f), self.long(f)) {
                (true, true) => "sound".into(),
                (false, _) => format!(
                    "FAILED: {:.2} % of the light is lost in it ({} walks found no wall)",
                    100.0 * (1.0 - f.radiance.mean),
                    f.counters.lost
                ),
                (true, false) => {
                    "FAILED: light stays for another length than its volume and surface say: the surface does not enclose that volume once".into()
                }
            },
        }
    }
}

/// Measures the listed objects.
fn furnaces<'a>(d: &SceneDescription, report: &'a Report) -> Result<Vec<Measured<'a>>, Failure> {
    let list = &report.bodies[..report.bodies.len().min(LISTED)];
    // Two tests per object.
    let limit = sidak(SIGNIFICANCE, 2 * list.len().max(1));
    let measure = |body: &'a Body| {
        let result = doctor::furnace(d, body, BUDGET, SEED).map_err(|e| Failure::Input(e.to_string()))?;
        Ok(Measured { body, result, limit })
    };
    list.iter().map(measure).collect()
}

fn print_text(a: &Check, report: &Report, measured: &[Measured]) -> Outcome {
    let unit = a.unit.name;
    let scene = a.scene.display();
    output::print(&format!(
        "{scene}: {} ({} around a medium), {}",
        count(report.shapes, "shape"),
        report.bodies.iter().map(|b| b.count).sum::<usize>(),
        count(report.lights, "light")
    ))?;
    for b in report.bodies.iter().take(LISTED) {
        let copies = if b.count > 1 { format!(", {} copies", b.count) } else { String::new() };
        let form = if b.triangles > 0 { count(b.triangles, "triangle") } else { "analytic".into() };
        output::print(&format!("\n{}  {} ({form}, {}{copies})", b.place, b.name, b.medium))?;
        match b.chord() {
            Some(chord) => {
                output::print(&format!(
                    "  volume {:.4} {unit}^3, surface {:.4} {unit}^2, mean chord 4V/S {:.4} {unit}",
                    Short(b.volume),
                    Short(b.area),
                    Short(chord)
                ))?;
                output::print(&format!("  size in mean free paths (red, green, blue): {}", thickness(b, chord)))?;
                output::print(&format!(
                    "  mean path of light that enters, were nothing absorbed: 4 eta^2 V/S = {:.4} {unit} (eta {:.4}), about {} collisions",
                    Short(b.path_length().unwrap_or_default()),
                    Short(b.eta),
                    Short(b.size().map_or(0.0, |s| s[1]) * b.eta * b.eta)
                ))?;
                let alpha = b.alpha.map(|x| Short(f64::from(x)).to_string()).join(" ");
                output::print(&format!("  albedo of a collision {alpha}, g {}", Short(f64::from(b.g))))?;
            }
            None => {
                output::print(&format!("  open: no volume, surface {} {unit}^2", Short(b.area)))?;
            }
        }
    }
    if report.bodies.len() > LISTED {
        output::print(&format!("\nand {} more objects", report.bodies.len() - LISTED))?;
    }
    if !measured.is_empty() {
        output::print("\nfurnace: each object alone in uniform light, with its own density and nothing that absorbs")?;
    }
    for m in measured {
        let values = match &m.result {
            Ok(f) => format!(
                "radiance {} +- {} (should be 1), path length {} +- {} of 4 eta^2 V/S (should be 1); {} mean free paths, {} rays: ",
                Short(f.radiance.mean),
                Short(f.radiance.std_err),
                Short(f.path_length.mean),
                Short(f.path_length.std_err),
                Short(f.size),
                f.radiance.n
            ),
            Err(_) => String::new(),
        };
        output::print(&format!("  {}  {}: {values}{}", m.body.place, m.body.name, m.verdict()))?;
    }
    if !report.findings.is_empty() {
        output::print("")?;
    }
    for f in &report.findings {
        let place = f.place.as_ref().map_or(String::new(), |p| format!("{p}: "));
        let severity = if f.severity == Severity::Problem { "problem" } else { "note" };
        output::print(&format!("{severity}: {place}{}\n  what to do: {}", f.message, f.advice))?;
    }
    let failed = measured.iter().filter(|m| m.failed()).count();
    let notes = report.findings.len() - report.problems();
    output::print(&format!("\n{}, {}", count(report.problems() + failed, "problem"), count(notes, "note")))?;
    Ok(())
}

/// A number with four significant digits.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let x = self.0;
        let size = x.abs();
        if x == 0.0 || !x.is_finite() {
            return write!(f, "{x}");
        }
        if !(1e-4..1e7).contains(&size) {
            return write!(f, "{x:.3e}");
        }
        // Digits behind the point so that four count.
        let digits = (3 - size.log10().floor() as i32).clamp(0, 8) as usize;
        let text = format!("{x:.digits$}");
        f.write_str(if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text })
    }
}

/// Returns the optical thickness per channel, as a range where it varies over the surface.
fn thickness(b: &Body, chord: f64) -> String {
    let [low, high] = b.sigma_t.map(|s| s.map(|s| f64::from(s) * chord));
    let channel = |c: usize| {
        if high[c] - low[c] <= 1e-6 * high[c] {
            Short(high[c]).to_string()
        } else {
            format!("{}..{}", Short(low[c]), Short(high[c]))
        }
    };
    [0, 1, 2].map(channel).join("  ")
}

fn print_json(a: &Check, report: &Report, measured: &[Measured]) -> Outcome {
    let finding = |f: &Finding| {
        json!({
            "severity": if f.severity == Severity::Problem { "problem" } else { "note" },
            "code": f.code,
            "object": f.object,
            "place": place(f.place.as_ref()),
            "message": f.message,
            "advice": f.advice,
        })
    };
    let body = |b: &Body| {
        json!({
            "name": b.name,
            "place": b.place.to_string(),
            "medium": b.medium,
            "copies": b.count,
            "triangles": b.triangles,
            "closed": b.closed,
            "volume": b.volume,
            "area": b.area,
            "mean_chord": b.chord(),
            "path_length": b.path_length(),
            "eta": b.eta,
            "g": b.g,
            "alpha": b.alpha,
            "mean_free_paths": b.chord().map(|c| b.sigma_t.map(|s| s.map(|s| f64::from(s) * c))),
        })
    };
    let furnace = |m: &Measured| {
        let values = m.result.as_ref().ok();
        json!({
            "name": m.body.name,
            "place": m.body.place.to_string(),
            "radiance": values.map(|f| f.radiance.mean),
            "radiance_std_err": values.map(|f| f.radiance.std_err),
            "path_length_ratio": values.map(|f| f.path_length.mean),
            "path_length_ratio_std_err": values.map(|f| f.path_length.std_err),
            "rays": values.map(|f| f.radiance.n),
            "mean_free_paths": values.map(|f| f.size),
            "failed": m.failed(),
            "verdict": m.verdict(),
        })
    };
    let document = json!({
        "scene": a.scene.display().to_string(),
        "unit": a.unit.name,
        "shapes": report.shapes,
        "lights": report.lights,
        "objects": report.bodies.iter().map(body).collect::<Vec<_>>(),
        "findings": report.findings.iter().map(finding).collect::<Vec<_>>(),
        "furnace": measured.iter().map(furnace).collect::<Vec<_>>(),
    });
    output::print(&document.to_string())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits_that_count() {
        for (x, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (12.3456, "12.35"),
            (0.012_346, "0.01235"),
            (123_456.0, "123456"),
            (1e9, "1.000e9"),
            (2.5, "2.5"),
        ] {
            assert_eq!(Short(x).to_string(), text);
        }
    }
}
