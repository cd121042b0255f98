//! `moonmilk compare`: which model of subsurface scattering is good enough for a scene, and at what cost.
//!
//! One picture after the other is rendered into a folder ([`shoot`]), the exact one first. Then the pictures are measured ([`measure`], [`bins`], [`bodies`])
//! and the findings written: a table on standard output, `metrics.json`, a contact sheet, and a report that needs nothing but a browser.

pub mod args;
mod bins;
mod bodies;
mod cost;
mod html;
mod json;
mod measure;
mod shoot;
mod table;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

use moonmilk_core::wavelengths::WavelengthMode;
use moonmilk_io::atomic::write_atomically;
use moonmilk_io::image::Picture;
use moonmilk_io::pbrt::{self, Loaded};
use moonmilk_io::sheet::{self, Cell};
use moonmilk_io::split::{Halves, Reference, weights};
use moonmilk_optics::profile::{Kind, find};
use moonmilk_render::integrator::Integrator;
use moonmilk_render::seen::{Seen, seen};
use moonmilk_walk::Roulette;

use crate::budget::Budget;
use crate::failure::Failure;
use crate::settings::Settings;
use crate::{Outcome, output, render, values};
use args::Compare;
use bodies::{BodySeen, EXACT_PROFILE, Worth};
use measure::{Bench, Exact, Findings};
use shoot::{AOVS, Studio};

/// Models that are compared unless others are named.
const USUAL: [&str; 6] = ["dipole", "better-dipole", "quantized", "photon-beam", "normalized", EXACT_PROFILE];
/// Time for each picture unless something else is said.
const TIME: Duration = Duration::from_secs(60);
/// How much more the exact picture may use: its noise then adds at most a quarter to that of an equally noisy model.
const MORE: u32 = 4;

/// The files written beside the pictures.
const REPORT: &str = "report.html";
const SHEET: &str = "contact-sheet.png";
const METRICS: &str = "metrics.json";

/// Runs the command; `bar` allows a progress bar.
pub fn run(a: &Compare, bar: bool) -> Outcome {
    render::use_threads(a.threads)?;
    let folder = folder(a);
    std::fs::create_dir_all(&folder).map_err(|e| Failure::Run(format!("{} cannot be made: {e}", folder.display())))?;
    for name in [REPORT, SHEET, METRICS] {
        output::check_writable(&folder.join(name))?;
        output::remove_leftovers(&folder.join(name));
    }
    let given = a.reference.as_deref().map(shoot::read).transpose()?;
    let loaded = pbrt::load(&a.scene).map_err(Failure::Scene)?;
    render::warn(&loaded.warnings);
    let d = &loaded.scene;
    let crop = render::crop(a.crop, d)?;
    let plan = plan(a, &loaded, crop)?;
    let (budget, exact_budget) = budgets(a);

    let base = Integrator::new(a.seed.unwrap_or(d.sampler.seed), a.wavelengths, Roulette::default(), None);
    let studio = Studio {
        folder: &folder,
        size: [d.film.width, d.film.height],
        crop,
        factor: d.film.imaging_ratio,
        resume: a.resume,
        every: Some(a.checkpoint_every).filter(|t| !t.is_zero()),
        bar,
    };
    let mut list: Vec<(&str, Budget)> = plan.models.iter().map(|n| (n.as_str(), budget)).collect();
    if given.is_none() {
        list.insert(0, (&a.against, exact_budget));
    }
    let settled: Vec<(&str, Budget, Integrator, Settings)> = list
        .into_iter()
        .map(|(name, budget)| {
            let mut integrator = base.clone();
            integrator.seed = seed(base.seed, name, &a.against);
            let settings = Settings::new(&loaded, &integrator, name, a.open, crop, &AOVS);
            (name, budget, integrator, settings)
        })
        .collect();
    // What is there and of another comparison is found before anything is rendered.
    let mut finished = 0;
    for (name, budget, _, settings) in &settled {
        output::check_writable(&studio.path(name))?;
        output::remove_leftovers(&studio.path(name));
        finished += usize::from(studio.is_finished(name, settings, budget)?);
    }
    tracing::info!(
        "{} pictures in {}, {finished} of them finished; {} for a model, {} for {}",
        settled.len(),
        folder.display(),
        budget.words(),
        exact_budget.words(),
        a.against
    );
    for (i, (name, budget, integrator, settings)) in settled.iter().enumerate() {
        let scene = || render::make(d, a.open, name).map(|s| s.0);
        studio.shoot(name, integrator, settings, *budget, scene).map_err(|e| match e {
            Failure::Interrupted(_) => Failure::Interrupted(format!(
                "interrupted; {i} of {} pictures are finished in {} and {name} has a checkpoint: the same command with --resume goes on",
                settled.len(),
                folder.display()
            )),
            other => other,
        })?;
    }

    let findings = find_out(a, &loaded, plan, &studio, given, [budget, exact_budget], &base)?;
    write(&folder, &findings)?;
    output::print(&table::text(&findings))?;
    tracing::info!("{}", folder.join(REPORT).display());
    Ok(())
}

/// What is to be rendered.
struct Plan {
    models: Vec<String>,
    left_out: Vec<(String, String)>,
    bodies: Vec<BodySeen>,
    seen: Vec<Option<Seen>>,
}

/// Returns the folder to write.
fn folder(a: &Compare) -> PathBuf {
    a.output.clone().unwrap_or_else(|| {
        let name = a.scene.file_name().map_or_else(|| "scene".into(), |n| n.to_string_lossy().into_owned());
        let stem = name.strip_suffix(".gz").unwrap_or(&name);
        format!("{}-compare", stem.strip_suffix(".pbrt").unwrap_or(stem)).into()
    })
}

/// Returns the budgets of a model and of the exact picture.
fn budgets(a: &Compare) -> (Budget, Budget) {
    let budget = match (a.spp, a.time) {
        (Some(n), _) => Budget::Samples(n),
        (None, t) => Budget::Time(t.unwrap_or(TIME)),
    };
    let exact = match (a.reference_time, a.reference_spp, budget) {
        (Some(t), ..) => Budget::Time(t),
        (_, Some(n), _) => Budget::Samples(n),
        (.., Budget::Time(t)) => Budget::Time(t * MORE),
        (.., Budget::Samples(n)) => Budget::Samples(n.saturating_mul(u64::from(MORE))),
        (.., other) => other,
    };
    (budget, exact)
}

/// Returns the seed of a picture: that of the comparison for the exact one, others of their own for the models.
///
/// With one seed for all, samples of the same number would share their random numbers, and the noise of a model would be in part that of the exact
/// picture: differences would look smaller than they are.
fn seed(base: u64, name: &str, against: &str) -> u64 {
    // FNV-1a: names differ, so do their hashes.
    let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
    if name == against { base } else { base ^ hash }
}

/// Decides what is rendered, and looks at what the camera sees.
///
/// *Errors*: a scene that cannot be built; a model that was asked for by name and cannot render it.
fn plan(a: &Compare, loaded: &Loaded, crop: [u32; 4]) -> Result<Plan, Failure> {
    let d = &loaded.scene;
    let asked: Option<Vec<String>> = match &a.subsurface {
        None => Some(USUAL.map(String::from).to_vec()),
        Some(values::SubsurfaceList(list)) => list.clone(),
    };
    // All that render the whole light: what this version has, without those that are a part of a model.
    let is_whole = |name: &str| find(name).map_or(true, |m| m.info.kind == Kind::Whole);
    let all = || values::subsurface_names().filter(|n| is_whole(n)).map(String::from).collect();
    let mut names: Vec<String> = asked.clone().unwrap_or_else(all);
    if !names.iter().any(|n| n == EXACT_PROFILE) {
        names.push(EXACT_PROFILE.into());
    }
    names.retain(|n| *n != a.against);

    let (scene, warnings) = render::make(d, a.open, &a.against)?;
    render::warn(&warnings);
    let seen = seen(&scene, crop);
    let bodies = bodies::bodies(&scene, &seen);
    if bodies.is_empty() {
        tracing::warn!(
            "the camera sees no closed body around a homogeneous medium that scatters: models change nothing that it sees at once"
        );
    }
    drop(scene);
    let mut told: BTreeSet<String> = warnings.iter().map(|w| w.message.clone()).collect();
    let (mut models, mut left_out) = (Vec::new(), Vec::new());
    for name in names {
        // A scene is built for each model to hear what it rejects, and dropped again: many at once would fill the memory.
        match render::make(d, a.open, &name) {
            Ok((_, warnings)) => {
                for w in warnings {
                    if told.insert(w.message.clone()) {
                        render::warn(&[w]);
                    }
                }
                models.push(name);
            }
            Err(e) => {
                let by_name = asked.as_ref().is_some_and(|l| l.contains(&name)) && a.subsurface.is_some();
                let Failure::Input(reason) = e else {
                    return Err(e);
                };
                if by_name {
                    return Err(Failure::Input(reason));
                }
                tracing::warn!("{name} is left out: {reason}");
                left_out.push((name, reason));
            }
        }
    }
    Ok(Plan { models, left_out, bodies, seen })
}

/// Measures the pictures.
fn find_out(
    a: &Compare,
    loaded: &Loaded,
    plan: Plan,
    studio: &Studio,
    given: Option<Picture>,
    [budget, exact_budget]: [Budget; 2],
    base: &Integrator,
) -> Result<Findings, Failure> {
    let fail = |e: moonmilk_io::image::Error| Failure::Input(format!("the exact picture: {e}"));
    let mut notes = bodies::thin(&plan.bodies);
    let exact_picture = match given {
        Some(p) => p,
        None => shoot::read(&studio.path(&a.against))?,
    };
    let [x0, x1, y0, y1] = studio.crop;
    let size = [(x1 - x0) as usize, (y1 - y0) as usize];
    if [exact_picture.width, exact_picture.height] != size {
        return Err(Failure::Input(format!(
            "--reference has {} x {} pixels, the scene {} x {}",
            exact_picture.width, exact_picture.height, size[0], size[1]
        )));
    }
    let (reference, known) = Reference::of_picture(&exact_picture).map_err(fail)?;
    if !known {
        notes.push("the reference has neither halves nor variance: it is taken as free of noise, so its noise counts as bias (render it with --aov variance)".into());
    }
    notes.iter().for_each(|n| tracing::warn!("{n}"));
    let exact_cost = shoot::cost_of(&exact_picture);
    let weights = weights(&reference.mean, size[0]);
    let planar = match plan.models.iter().any(|m| m == EXACT_PROFILE) {
        true => Halves::of(&shoot::read(&studio.path(EXACT_PROFILE))?),
        false => None,
    };
    let stops = measure::exposure(&reference.mean, &plan.seen);
    let shown = measure::for_screens(&reference.mean, size[0], stops);
    let mut bench = Bench { width: size[0], reference, weights, seen: plan.seen, planar, exact_work: f64::NAN, stops };
    // The exact picture against itself: its deviation is half the difference of its halves.
    let d = &bench.reference.deviation;
    let halves = Halves { a: d.clone(), b: d.clone().map(|p| p.iter().map(|x| -x).collect()) };
    let zero = Reference { mean: d.clone().map(|p| vec![0.0; p.len()]), deviation: d.clone() };
    let variance = bench.object(&halves, &zero)?.variance;
    let units = |c: &shoot::Cost| match (budget, exact_budget) {
        (Budget::Samples(n), _) => (c.spp as f64) / n as f64,
        (Budget::Time(t), _) => c.seconds / t.as_secs_f64(),
        _ => f64::NAN,
    };
    bench.exact_work = variance.mean * exact_cost.cpu.unwrap_or(exact_cost.seconds);

    let mut models = Vec::new();
    for name in &plan.models {
        let picture = shoot::read(&studio.path(name))?;
        let cost = shoot::cost_of(&picture);
        let worth = match find(name) {
            Ok(model) => bodies::worth(model, &plan.bodies),
            Err(_) => Worth::default(),
        };
        worth.warnings.iter().for_each(|w| tracing::warn!("{name}: {w}"));
        models.push(bench.measure(name, &picture, cost, worth)?);
    }
    let scale = measure::scale(&models, &bench.seen);
    let file = a.reference.as_ref().map_or_else(|| format!("{}.exr", a.against), |p| p.display().to_string());
    Ok(Findings {
        scene: a.scene.file_name().map_or_else(|| a.scene.display().to_string(), |n| n.to_string_lossy().into_owned()),
        hash: loaded.hash.iter().map(|b| format!("{b:02x}")).collect(),
        size,
        budget: budget.words(),
        settings: vec![("seed", base.seed.to_string()), ("wavelengths", wavelengths(base.wavelengths))],
        exact: Exact {
            name: a.against.clone(),
            file,
            at_equal: variance.mean * units(&exact_cost),
            variance,
            cost: exact_cost,
            known,
            shown,
        },
        object_pixels: bench.seen.iter().flatten().count() as u64,
        bodies: plan.bodies,
        models,
        left_out: plan.left_out,
        notes,
        scale,
        stops,
    })
}

fn wavelengths(mode: WavelengthMode) -> String {
    match mode {
        WavelengthMode::Hero => "hero".into(),
        WavelengthMode::Rgb => "rgb".into(),
        WavelengthMode::Mono(nm) => format!("{nm} nm"),
    }
}

/// Writes everything but the pictures.
fn write(folder: &Path, f: &Findings) -> Outcome {
    let put = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        write_atomically(&path, bytes).map_err(|e| Failure::Run(format!("{}: {e}", path.display())))
    };
    let fail = |e: moonmilk_io::plot::PlotError| Failure::Run(e.to_string());
    put(METRICS, format!("{:#}\n", json::of(f)).as_bytes())?;
    let exact = Cell { label: f.exact.name.clone(), note: "exact".into(), pictures: vec![f.exact.shown.clone()] };
    let cells = f.models.iter().map(|m| Cell {
        label: m.name.clone(),
        note: format!(
            "energy {:+.1} %, error {:.1} %",
            100.0 * (m.object.ratio.mean - 1.0),
            100.0 * measure::rms(m.object.bias2.mean)
        ),
        pictures: vec![m.shown.clone(), measure::error_picture(&m.error, f.size[0], f.scale)],
    });
    let cells: Vec<Cell> = std::iter::once(exact).chain(cells).collect();
    let title = format!("{}: models of subsurface scattering", f.scene);
    let subtitle =
        format!("{} a picture, exposure {:+.2} stops; beside each picture its signed error", f.budget, f.stops);
    put(SHEET, &sheet::png(&title, &subtitle, f.scale, 3, &cells).map_err(fail)?)?;
    put(REPORT, html::page(f)?.as_bytes())
}
