//! `moonmilk profile`: models of R(r) against Monte Carlo; with an option, what lies below them: radiance, point sources, paths.

mod journeys;
mod point;
mod radiance;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use moonmilk_io::atomic::write_atomically;
use moonmilk_io::plot::{self, Curve, Point, ProfilePlot};
use moonmilk_lab::profile::{HalfSpace, Measured, Worth, compare, measure};
use moonmilk_optics::profile::{Kind, MODELS, Profile, find};
use moonmilk_optics::{OpticalProperties, materials};
use serde_json::json;

use crate::failure::Failure;
use crate::lab_args::ProfileArgs;
use crate::{Outcome, output};

/// Models that are compared unless others are named.
const USUAL: [&str; 6] = ["monopole", "dipole", "better-dipole", "quantized", "photon-beam", "normalized"];
/// Points of a curve.
const POINTS: usize = 300;

/// Formats of what is written.
#[derive(Clone, Copy)]
enum Format {
    Svg,
    Png,
    Csv,
    Json,
}

fn format(path: &Path) -> Result<Format, Failure> {
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("svg") => Ok(Format::Svg),
        Some("png") => Ok(Format::Png),
        Some("csv") => Ok(Format::Csv),
        Some("json") => Ok(Format::Json),
        _ => Err(Failure::Usage(format!("{}: profiles are written as .svg, .png, .csv or .json", path.display()))),
    }
}

/// A model with what it is worth.
struct Judged {
    name: &'static str,
    profile: Box<dyn Profile>,
    worth: Worth,
}

/// Runs the command.
pub fn run(a: &ProfileArgs) -> Outcome {
    let targets = a
        .output
        .iter()
        .map(|p| Ok(Target { path: p.clone(), format: format(p)? }))
        .collect::<Result<Vec<_>, Failure>>()?;
    for t in &targets {
        output::check_writable(&t.path)?;
    }
    let (name, medium) = material(a)?;
    super::simulate::on_threads(a.threads, || {
        if a.radiance {
            radiance::run(a, &name, &medium, &targets)
        } else if a.point_source {
            point::run(a, &name, &medium, &targets)
        } else if a.brownian {
            journeys::run(a, &name, &medium, &targets)
        } else {
            profiles(a, &name, &medium, &targets)
        }
    })?
}

/// Judges models of R(r).
fn profiles(a: &ProfileArgs, name: &str, medium: &OpticalProperties, targets: &[Target]) -> Outcome {
    let names: Vec<&str> = match a.models.as_deref() {
        None => USUAL.to_vec(),
        Some("all") => MODELS.iter().filter(|m| m.info.kind == Kind::Whole).map(|m| m.info.name).collect(),
        Some(list) => list.split(',').map(str::trim).collect(),
    };
    let mut profiles = Vec::new();
    for n in names {
        let model = find(n).map_err(|e| Failure::Usage(e.to_string()))?;
        match model.build(medium) {
            Ok(p) => profiles.push((model.info.name, p)),
            Err(e) if a.models.is_some() && a.models.as_deref() != Some("all") => {
                return Err(Failure::Input(format!("{n}: {e}")));
            }
            Err(e) => tracing::warn!("{n} is left out: {e}"),
        }
    }

    // Look as far as light goes: a dozen diffusion lengths.
    let reach = (12.0 * medium.sigma_t_prime() / medium.sigma_tr().max(1e-9)).clamp(6.0, 60.0);
    let half = HalfSpace { sigma_a: medium.sigma_a(), sigma_s: medium.sigma_s(), g: medium.g(), eta: medium.eta() };
    let measured = measure(&half, reach, a.photons, a.seed).map_err(|e| Failure::Input(e.to_string()))?;
    if measured.unfinished > 0.0 {
        tracing::warn!("{:.2e} of the light was still inside when its paths were given up", measured.unfinished);
    }
    let judged: Vec<Judged> = profiles
        .into_iter()
        .map(|(name, profile)| {
            let worth = compare(&measured, |r| profile.eval(r));
            Judged { name, profile, worth }
        })
        .collect();

    output::print(&table(name, medium, &measured, &judged))?;
    write_all(targets, |format| {
        let drawn = match format {
            Format::Csv => return Ok(csv(&measured, &judged).into_bytes()),
            Format::Json => return Ok(format!("{:#}\n", as_json(name, medium, &measured, &judged)).into_bytes()),
            Format::Svg => plot::svg(&picture(name, &a.unit, medium, &measured, &judged)).map(String::into_bytes),
            Format::Png => plot::png(&picture(name, &a.unit, medium, &measured, &judged)),
        };
        drawn.map_err(|e| Failure::Run(e.to_string()))
    })
}

/// A file to write.
struct Target {
    path: PathBuf,
    format: Format,
}

/// Writes all files that were asked for.
fn write_all(targets: &[Target], bytes: impl Fn(Format) -> Result<Vec<u8>, Failure>) -> Outcome {
    for t in targets {
        write_atomically(&t.path, &bytes(t.format)?).map_err(|e| Failure::Run(format!("{}: {e}", t.path.display())))?;
    }
    Ok(())
}

/// Returns the middle of a ring or shell on a logarithmic axis.
fn centre(edges: &[f64]) -> f64 {
    (edges[0] * edges[1]).sqrt()
}

/// Returns the medium that the argument means: a name from the tables, or `key=value` pairs.
fn material(a: &ProfileArgs) -> Result<(String, OpticalProperties), Failure> {
    let fail = |e: String| Failure::Input(e);
    if !a.material.contains('=') {
        let m = materials::find(&a.material).map_err(|e| fail(e.to_string()))?;
        let properties = m.properties(a.channel.index()).map_err(|e| fail(e.to_string()))?;
        return Ok((format!("{}, {}", m.name, a.channel.name()), properties));
    }
    let mut values = [0.0, 1.0, 0.0, 1.0];
    const KEYS: [&str; 4] = ["sigma_a", "sigma_s", "g", "eta"];
    for pair in a.material.split(',') {
        let known = || fail(format!("\"{pair}\" is not one of sigma_a=A, sigma_s=S, g=G, eta=N"));
        let (key, value) = pair.split_once('=').ok_or_else(known)?;
        let k = KEYS.iter().position(|k| *k == key.trim()).ok_or_else(known)?;
        values[k] = value.trim().parse().map_err(|_| fail(format!("{key} = {value} is not a number")))?;
    }
    let [sigma_a, sigma_s, g, eta] = values;
    let properties = OpticalProperties::new(sigma_a, sigma_s, g, eta).map_err(|e| fail(e.to_string()))?;
    let name = if a.radiance || a.point_source || a.brownian { "Medium" } else { "Half-space" };
    Ok((name.into(), properties))
}

/// Returns the medium in words.
fn words(m: &OpticalProperties, unit: &str) -> String {
    format!(
        "σa {:.5}, σs {:.5} /{unit}, g {:.3}, η {:.3};  reduced albedo {:.5}, transport mean free path {:.4} {unit}",
        m.sigma_a(),
        m.sigma_s(),
        m.g(),
        m.eta(),
        m.alpha_prime(),
        1.0 / m.sigma_t_prime()
    )
}

fn percent(x: f64) -> String {
    format!("{:+.2} %", 100.0 * x)
}

fn table(name: &str, m: &OpticalProperties, measured: &Measured, judged: &[Judged]) -> String {
    let a = measured.albedo;
    let mut out = format!("{name}: {}\n", words(m, "L"));
    writeln!(out, "{:24} {:>10} {:>10} {:>10}", "model", "albedo", "error", "L1 error")
        .expect("a string takes everything");
    writeln!(out, "{:24} {:10.6} +- {:.6}", "Monte Carlo", a.mean, a.std_err).expect("a string takes everything");
    for j in judged {
        let error = j.profile.total() / a.mean - 1.0;
        writeln!(out, "{:24} {:10.6} {:>10} {:>8.2} %", j.name, j.profile.total(), percent(error), 100.0 * j.worth.l1)
            .expect("a string takes everything");
    }
    let noise = judged.first().map_or(0.0, |j| j.worth.noise);
    write!(out, "noise of Monte Carlo: {:.2} % of L1, {} paths", 100.0 * noise, a.n)
        .expect("a string takes everything");
    out
}

fn csv(measured: &Measured, judged: &[Judged]) -> String {
    let mut out = String::from("r_from,r_to,monte_carlo,std_err");
    judged.iter().for_each(|j| out.push_str(&format!(",{}", j.name)));
    out.push('\n');
    for (i, (e, m)) in measured.edges.windows(2).zip(&measured.rings).enumerate() {
        out.push_str(&format!("{:e},{:e},{:e},{:e}", e[0], e[1], m.mean, m.std_err));
        judged.iter().for_each(|j| out.push_str(&format!(",{:e}", j.worth.rings[i])));
        out.push('\n');
    }
    out
}

fn as_json(name: &str, m: &OpticalProperties, measured: &Measured, judged: &[Judged]) -> serde_json::Value {
    let models: Vec<_> = judged
        .iter()
        .map(|j| {
            let error = j.profile.total() / measured.albedo.mean - 1.0;
            json!({ "name": j.name, "albedo": j.profile.total(), "albedo_error": error, "l1_error": j.worth.l1, "rings": j.worth.rings })
        })
        .collect();
    let rings: Vec<f64> = measured.rings.iter().map(|r| r.mean).collect();
    let errors: Vec<f64> = measured.rings.iter().map(|r| r.std_err).collect();
    json!({
        "material": name,
        "medium": { "sigma_a": m.sigma_a(), "sigma_s": m.sigma_s(), "g": m.g(), "eta": m.eta() },
        "monte_carlo": { "edges": measured.edges, "rings": rings, "std_err": errors, "paths": measured.albedo.n,
                         "albedo": measured.albedo.mean, "albedo_std_err": measured.albedo.std_err },
        "models": models,
    })
}

fn picture(name: &str, unit: &str, m: &OpticalProperties, measured: &Measured, judged: &[Judged]) -> ProfilePlot {
    let a = measured.albedo;
    let (first, last) = (measured.edges[0], measured.edges[measured.edges.len() - 1]);
    let curves = judged.iter().map(|j| {
        let radius = |i: usize| first * (last / first).powf(i as f64 / POINTS as f64);
        let points = (0..=POINTS).map(radius).map(|r| (r, j.profile.eval(r))).collect();
        let ratios = measured
            .edges
            .windows(2)
            .zip(measured.rings.iter().zip(&j.worth.rings))
            // Beyond 15 % of noise a ratio says nothing.
            .filter(|(_, (m, _))| m.mean > 0.0 && m.std_err < 0.15 * m.mean)
            .map(|(e, (m, x))| (centre(e), x / m.mean))
            .collect();
        let facts = vec![
            format!("{:.4}", j.profile.total()),
            percent(j.profile.total() / a.mean - 1.0),
            format!("{:.1} %", 100.0 * j.worth.l1),
        ];
        Curve { name: j.name.into(), facts, points, ratios }
    });
    let measured_points = measured.edges.windows(2).zip(&measured.rings);
    ProfilePlot {
        title: name.into(),
        subtitle: words(m, unit),
        unit: unit.into(),
        labels: [format!("R(r)  [1/{unit}²]"), format!("r R(r)  [1/{unit}]")],
        power: 1,
        columns: vec!["albedo".into(), "error".into(), "L1 error".into()],
        facts: vec![
            format!("{:.4}", a.mean),
            format!("± {:.2} %", 100.0 * a.relative_error()),
            format!("± {:.1} %", 100.0 * judged.first().map_or(0.0, |j| j.worth.noise)),
        ],
        measured: measured_points.map(|(e, m)| Point { r: centre(e), value: m.mean, std_err: m.std_err }).collect(),
        curves: curves.collect(),
    }
}
