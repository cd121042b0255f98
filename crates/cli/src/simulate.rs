//! `moonmilk simulate`: layers from TOML and MCML's files, bodies from scenes.

mod scene;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use moonmilk_io::atomic::write_atomically;
use moonmilk_io::lab::{experiment_toml, mci, npz, tables};
use moonmilk_lab::bodies::{self, Bodies};
use moonmilk_lab::{Error, Experiment, Results, run};

use crate::failure::Failure;
use crate::lab_args::Simulate;
use crate::{Outcome, output};

/// What is simulated.
enum Job {
    Layers(Box<Experiment>),
    Bodies(Box<Bodies>),
}

impl Job {
    fn set(&mut self, photons: Option<u64>, seed: Option<u64>) {
        let (p, s) = match self {
            Self::Layers(e) => (&mut e.photons, &mut e.seed),
            Self::Bodies(e) => (&mut e.photons, &mut e.seed),
        };
        *p = photons.unwrap_or(*p);
        *s = seed.unwrap_or(*s);
    }

    fn run(&self) -> Result<Results, Error> {
        match self {
            Self::Layers(e) => run(e),
            Self::Bodies(e) => bodies::run(e),
        }
    }

    fn max_collisions(&self) -> u32 {
        match self {
            Self::Layers(e) => e.max_collisions,
            Self::Bodies(e) => e.max_collisions,
        }
    }
}

/// Formats of results.
#[derive(Clone, Copy)]
enum Format {
    Csv,
    Json,
    Npz,
}

fn format(path: &Path) -> Result<Format, Failure> {
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("csv") => Ok(Format::Csv),
        Some("json") => Ok(Format::Json),
        Some("npz") => Ok(Format::Npz),
        _ => Err(Failure::Usage(format!("{}: results are written as .csv, .json or .npz", path.display()))),
    }
}

/// Runs the command.
pub fn run_command(a: &Simulate) -> Outcome {
    let target = a.output.as_deref().map(|p| format(p).map(|f| (p, f))).transpose()?;
    let fail = |e: String| Failure::Input(format!("{}: {e}", a.file.display()));
    let name = a.file.display().to_string();
    let extension = a.file.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let text = || std::fs::read_to_string(&a.file).map_err(|e| fail(e.to_string()));
    let is_scene = [".pbrt", ".pbrt.gz"].iter().any(|e| name.to_ascii_lowercase().ends_with(e));
    if !is_scene && !a.tally.is_empty() {
        return Err(Failure::Usage("--tally is for scenes: layers have their tallies in the file".into()));
    }
    let mut runs: Vec<(String, Job)> = match extension.as_deref() {
        _ if is_scene => vec![(String::new(), Job::Bodies(Box::new(scene::read(a)?)))],
        Some("toml") => {
            let e = experiment_toml::parse(&name, &text()?).map_err(Failure::Scene)?;
            vec![(String::new(), Job::Layers(Box::new(e)))]
        }
        Some("mci") => {
            let file = mci::parse(&name, &text()?).map_err(Failure::Scene)?;
            file.warnings.iter().for_each(|w| tracing::warn!("{w}"));
            file.runs.into_iter().map(|r| (r.output, Job::Layers(Box::new(r.experiment)))).collect()
        }
        _ => return Err(fail("experiments are read from .toml or .mci, bodies from .pbrt".into())),
    };
    if let Some((path, _)) = target {
        output::check_writable(path)?;
    }
    let several = runs.len() > 1;
    for (k, (name, job)) in runs.iter_mut().enumerate() {
        job.set(a.photons, a.seed.map(|s| s.wrapping_add(k as u64)));
        let results = on_threads(a.threads, || job.run())?.map_err(|e| Failure::Input(e.to_string()))?;
        if results.lost > 0 {
            tracing::warn!("{} paths were lost by rounding", results.lost);
        }
        let unfinished = results.scalar("unfinished").map_or(0.0, |u| u.mean);
        if unfinished > 0.0 {
            tracing::warn!("{unfinished:.2e} of the light was still inside after {} collisions", job.max_collisions());
        }
        match target {
            None => {
                if several {
                    output::print(&format!("run {} ({name})", k + 1))?;
                }
                output::print(&summary(&results))?;
            }
            Some((path, format)) => {
                let path = if several { numbered(path, k + 1) } else { path.to_owned() };
                let bytes = match format {
                    Format::Csv => tables::csv(&results).into_bytes(),
                    Format::Json => format!("{:#}\n", tables::json(&results)).into_bytes(),
                    Format::Npz => npz::encode(&results),
                };
                write_atomically(&path, &bytes).map_err(|e| Failure::Run(format!("{}: {e}", path.display())))?;
            }
        }
    }
    Ok(())
}

/// Does something on a number of threads, which changes nothing but the time.
pub fn on_threads<T: Send>(threads: Option<u64>, work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(n) = threads {
        pool = pool.num_threads(n as usize);
    }
    let pool = pool.build().map_err(|e| Failure::Run(format!("threads: {e}")))?;
    Ok(pool.install(work))
}

/// Returns `NAME-k.EXT`.
fn numbered(path: &Path, k: usize) -> PathBuf {
    let mut name = OsString::from(path.file_stem().unwrap_or_default());
    name.push(format!("-{k}"));
    if let Some(e) = path.extension() {
        name.push(".");
        name.push(e);
    }
    path.with_file_name(name)
}

/// Returns the totals as a table, and what the grids are.
fn summary(r: &Results) -> String {
    let mut lines = vec![format!("{} paths, seed {}", r.photons, r.seed)];
    let width = r.scalars.iter().map(|s| s.name.len()).max().unwrap_or(0);
    for s in &r.scalars {
        let unit = if s.unit == "1" { "" } else { &s.unit };
        lines.push(format!("{:width$}  {:10.6} +- {:.6} {unit:3} {}", s.name, s.value.mean, s.value.std_err, s.about));
    }
    for g in &r.grids {
        let axes: Vec<String> =
            g.axes.iter().map(|a| format!("{} [{}] x {}", a.name, a.unit, a.edges.len() - 1)).collect();
        lines.push(format!(
            "{:width$}  recorded over {} [{}]: write them with -o FILE.csv, .json or .npz",
            g.name,
            axes.join(", "),
            g.unit
        ));
    }
    lines.join("\n")
}
