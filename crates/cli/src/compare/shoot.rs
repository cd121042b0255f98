//! The pictures of a comparison: rendered one after the other, each with its halves, and kept as EXR files.
//!
//! A finished picture is `NAME.exr`, with the layers `HalfA` (samples of even number), `HalfB` (odd) and `Variance`, and what it cost as attributes; one under way is
//! `NAME.exr.checkpoint`. Consecutive samples belong to different scramblings, which are independent: so are the halves.

use std::path::{Path, PathBuf};
use std::time::Duration;

use moonmilk_core::random::SCRAMBLINGS;
use moonmilk_io::image::{Picture, Value};
use moonmilk_io::split::LAYERS;
use moonmilk_io::{checkpoint, exr};
use moonmilk_render::film::{Aov, Film, QUANTUM};
use moonmilk_render::integrator::Integrator;
use moonmilk_render::scene::Scene;
use serde_json::{Map, Value as Json, json};

use crate::budget::Budget;
use crate::display::Display;
use crate::failure::Failure;
use crate::job::{Checkpoint, Job};
use crate::progress::Progress;
use crate::settings::Settings;
use crate::{output, report};

use super::cost;

/// Layers that every picture of a comparison records beside its halves.
pub const AOVS: [Aov; 1] = [Aov::Variance];

/// What a picture took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cost {
    /// Time of rendering \[s\].
    pub seconds: f64,
    /// Processor time \[s\].
    pub cpu: Option<f64>,
    /// Peak of the process's memory while it was rendered \[bytes\].
    pub memory: Option<f64>,
    /// Smallest number of samples of a pixel.
    pub spp: u64,
    /// What the rendering has to tell.
    pub warnings: Vec<String>,
}

/// How all pictures of a comparison are rendered.
pub struct Studio<'a> {
    /// Folder of the pictures.
    pub folder: &'a Path,
    /// Full size of the picture.
    pub size: [u32; 2],
    /// Pixels rendered.
    pub crop: [u32; 4],
    /// Factor on the finished picture.
    pub factor: f32,
    /// Whether to go on with what is there.
    pub resume: bool,
    /// Time between checkpoints.
    pub every: Option<Duration>,
    /// Whether a progress bar is allowed.
    pub bar: bool,
}

/// Attributes of a finished picture.
const BUDGET: &str = "moonmilk.budget";
const SETTINGS: &str = "moonmilk.settings";
const SECONDS: &str = "moonmilk.seconds";
const CPU: &str = "moonmilk.cpu";
const MEMORY: &str = "moonmilk.memory";
const WARNINGS: &str = "moonmilk.warnings";

/// Where a picture stands before it is rendered.
enum Standing {
    Finished,
    Begun(Film, Cost),
    New,
}

impl Studio<'_> {
    /// Returns the file of a picture.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}.exr"))
    }

    /// Returns whether a picture is finished already; checks that what is there belongs to this comparison.
    ///
    /// *Errors*: with `resume`, a picture or checkpoint of other settings.
    pub fn is_finished(&self, name: &str, settings: &Settings, budget: &Budget) -> Result<bool, Failure> {
        Ok(matches!(self.standing(name, settings, budget)?, Standing::Finished))
    }

    fn standing(&self, name: &str, settings: &Settings, budget: &Budget) -> Result<Standing, Failure> {
        let path = self.path(name);
        let begun = output::checkpoint_path(&path);
        if !self.resume {
            return Ok(Standing::New);
        }
        let refuse = |file: &Path, list: Vec<String>| {
            Failure::Input(format!(
                "{}: of another comparison: {}; another folder (-o), or none of --resume, starts anew",
                file.display(),
                list.join("; ")
            ))
        };
        let differences = |recorded: &Settings, their_budget: &str| {
            let mut list = settings.differences(recorded);
            if their_budget != budget.to_string() {
                list.push(format!("the budget is {budget}, was {their_budget}"));
            }
            list
        };
        if begun.exists() {
            let (text, film) = checkpoint::load(&begun).map_err(|e| Failure::Input(e.to_string()))?;
            let mut map: Map<String, Json> = serde_json::from_str(&text)
                .map_err(|_| Failure::Input(format!("{}: its settings cannot be read", begun.display())))?;
            let number = |v: Option<Json>| v.and_then(|v| v.as_f64());
            let cost = Cost {
                seconds: number(map.remove("spent")).unwrap_or(0.0),
                cpu: number(map.remove("cpu")),
                memory: number(map.remove("memory")),
                ..Cost::default()
            };
            let their_budget = map.remove("budget").and_then(|b| Some(b.as_str()?.to_owned())).unwrap_or_default();
            let recorded = Settings::parse(&Json::Object(map).to_string()).map(|s| s.0);
            let list = recorded.map_or_else(|| vec!["no settings".into()], |s| differences(&s, &their_budget));
            return if list.is_empty() { Ok(Standing::Begun(film, cost)) } else { Err(refuse(&begun, list)) };
        }
        if path.exists() {
            let picture = read(&path)?;
            let recorded = Settings::parse(text(&picture, SETTINGS)).map(|s| s.0);
            let list = recorded.map_or_else(|| vec!["no settings".into()], |s| differences(&s, text(&picture, BUDGET)));
            return if list.is_empty() { Ok(Standing::Finished) } else { Err(refuse(&path, list)) };
        }
        Ok(Standing::New)
    }

    /// Renders a picture, or goes on with it; nothing is done if it is finished.
    ///
    /// *Errors*: interrupted (the checkpoint is written); too little time for two samples of every pixel; files that cannot be written.
    pub fn shoot(
        &self,
        name: &str,
        integrator: &Integrator,
        settings: &Settings,
        budget: Budget,
        scene: impl FnOnce() -> Result<Scene, Failure>,
    ) -> Result<(), Failure> {
        let (film, before) = match self.standing(name, settings, &budget)? {
            Standing::Finished => return Ok(()),
            Standing::Begun(film, cost) => (film, cost),
            Standing::New => (Film::new(self.size, self.crop, 0, &AOVS), Cost::default()),
        };
        let scene = scene()?;
        let path = self.path(name);
        let left = match budget {
            Budget::Time(t) => Budget::Time(t.saturating_sub(Duration::from_secs_f64(before.seconds))),
            other => other,
        };
        let (start, can_reset) = (cost::cpu_seconds(), cost::reset_peak());
        let so_far = |elapsed: Duration| Cost {
            seconds: before.seconds + elapsed.as_secs_f64(),
            cpu: cost::cpu_seconds().zip(start).map(|(now, then)| now - then + before.cpu.unwrap_or(0.0)),
            memory: cost::peak_bytes().filter(|_| can_reset).map(|m| (m as f64).max(before.memory.unwrap_or(0.0))),
            ..Cost::default()
        };
        let job = Job {
            scene: &scene,
            integrator,
            film: &film,
            budget: left,
            checkpoint: Some(Checkpoint {
                path: output::checkpoint_path(&path),
                record: Box::new(|elapsed| {
                    let cost = so_far(elapsed);
                    let more = json!({"spent": cost.seconds, "cpu": cost.cpu, "memory": cost.memory});
                    settings.record_with(&budget, &more)
                }),
                every: self.every,
            }),
            factor: self.factor,
        };
        let done = job.run(&Progress::new(self.bar), Display::connect(None, name))?;
        let warnings = report::sentences(&done, &film);
        warnings.iter().for_each(|w| tracing::warn!("{name}: {w}"));
        if let Err(e) = &done.saved {
            tracing::warn!("{e}; --resume will begin this picture anew");
        }
        if done.interrupted {
            return Err(Failure::Interrupted(String::new()));
        }
        let cost = Cost { spp: film.samples(), warnings, ..so_far(done.elapsed) };
        if cost.spp < 2 {
            return Err(Failure::Run(format!(
                "{name}: there was time for {} samples of a pixel, and halves need two: give more --time",
                cost.spp
            )));
        }
        let mut picture = output::picture(&film, Some(settings), self.factor)?;
        let fail = |e: moonmilk_io::image::Error| Failure::Run(e.to_string());
        for (layer, half) in LAYERS.iter().zip(halves(&film, self.factor)) {
            for (channel, plane) in ["R", "G", "B"].iter().zip(half) {
                picture.push(&format!("{layer}.{channel}"), plane).map_err(fail)?;
            }
        }
        let attributes = &mut picture.attributes;
        attributes.insert(BUDGET.into(), Value::Text(budget.to_string()));
        attributes.insert(SECONDS.into(), Value::Float(cost.seconds));
        attributes.insert(WARNINGS.into(), Value::Text(cost.warnings.join("\n")));
        for (name, value) in [(CPU, cost.cpu), (MEMORY, cost.memory)] {
            if let Some(v) = value {
                attributes.insert(name.into(), Value::Float(v));
            }
        }
        output::write(&path, &picture)?;
        // The picture holds all that is needed from here on.
        let _ = std::fs::remove_file(output::checkpoint_path(&path));
        tracing::info!("{name}: {} samples per pixel in {:.1} s", cost.spp, cost.seconds);
        Ok(())
    }
}

/// Returns the means of the samples of even and of odd number, as planes.
fn halves(film: &Film, factor: f32) -> [[Vec<f32>; 3]; 2] {
    let [x0, x1, y0, y1] = film.crop;
    let (width, n) = ((x1 - x0) as usize, ((x1 - x0) * (y1 - y0)) as usize);
    let mut out = [0, 1].map(|_| [0, 1, 2].map(|_| vec![0.0f32; n]));
    let k = SCRAMBLINGS as usize;
    for i in 0..film.tile_count() {
        let t = film.tile(i);
        for p in 0..(t.width * t.height) as usize {
            let (x, y) = (p % t.width as usize, p / t.width as usize);
            let at = ((t.y0 - y0) as usize + y) * width + (t.x0 - x0) as usize + x;
            for (half, planes) in out.iter_mut().enumerate() {
                // Sample s is in scrambling s mod 8, an even number of them: even numbers are in even ones. The film begins at sample 0.
                let samples = (t.samples + 1 - half as u64) / 2;
                for (c, plane) in planes.iter_mut().enumerate() {
                    let sum: i64 = (half..k).step_by(2).map(|s| t.sums[(p * k + s) * 3 + c]).sum();
                    plane[at] = (f64::from(factor) * QUANTUM * sum as f64 / samples.max(1) as f64) as f32;
                }
            }
        }
    }
    out
}

/// Reads an EXR file.
pub fn read(path: &Path) -> Result<Picture, Failure> {
    let fail = |e: String| Failure::Input(format!("{}: {e}", path.display()));
    let bytes = std::fs::read(path).map_err(|e| fail(e.to_string()))?;
    exr::decode(&bytes).map_err(|e| fail(e.to_string()))
}

/// Returns what a finished picture took, as far as it says.
pub fn cost_of(picture: &Picture) -> Cost {
    let number = |name: &str| match picture.attributes.get(name) {
        Some(Value::Float(x)) => Some(*x),
        _ => None,
    };
    Cost {
        seconds: number(SECONDS).unwrap_or(f64::NAN),
        cpu: number(CPU),
        memory: number(MEMORY),
        spp: text(picture, "moonmilk.spp").parse().unwrap_or(0),
        warnings: text(picture, WARNINGS).lines().map(Into::into).collect(),
    }
}

/// Returns an attribute that is text; empty if there is none.
pub fn text<'a>(picture: &'a Picture, name: &str) -> &'a str {
    match picture.attributes.get(name) {
        Some(Value::Text(s)) => s,
        _ => "",
    }
}
