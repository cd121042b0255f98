//! `moonmilk render`.

use std::path::{Path, PathBuf};

use moonmilk_io::checkpoint;
use moonmilk_io::pbrt;
use moonmilk_render::description::{SceneDescription, Warning};
use moonmilk_render::film::Film;
use moonmilk_render::integrator::Integrator;
use moonmilk_render::integrator::Policy;
use moonmilk_render::scene::{OpenPolicy, Scene, SceneOptions};
use moonmilk_render::walks;
use moonmilk_walk::Roulette;

use crate::args::{MaxDepth, Open, Render};
use crate::budget::Budget;
use crate::display::Display;
use crate::failure::Failure;
use crate::job::{Checkpoint, Job};
use crate::progress::Progress;
use crate::settings::Settings;
use crate::{Outcome, audit, output, replay, report};

/// Runs the command; `bar` allows a progress bar.
pub fn run(a: &Render, bar: bool) -> Outcome {
    use_threads(a.threads)?;
    // What is named on the command line is checked before a large scene is read.
    if let Some(path) = &a.output {
        prepare(path)?;
    }
    let loaded = pbrt::load(&a.scene).map_err(Failure::Scene)?;
    warn(&loaded.warnings);
    let d = &loaded.scene;
    let path = output_path(a, d);
    if a.pixel.is_none() && a.output.is_none() {
        prepare(&path)?;
    }
    let crop = crop(a.crop, d)?;
    let scene = build(d, a.open, &a.subsurface)?;
    let integrator = integrator(a, d);
    let flown = Policy::flown(d);
    if a.walk == Policy::Jump && a.subsurface == "path" && flown > 0 {
        tracing::warn!("--walk jump: {flown} media are walked through flight by flight: they vary in space");
    }
    if a.walk == Policy::Guided && a.subsurface == "path" && (flown > 0 || integrator.max_depth.is_some()) {
        let which = if integrator.max_depth.is_some() {
            "all media, as depth is limited,".into()
        } else {
            format!("{flown} media that vary in space")
        };
        tracing::warn!("--walk guided: {which} are walked through flight by flight");
    }
    if let Some(pixel) = a.pixel {
        return replay::run(a, d, &scene, &integrator, pixel);
    }

    let aovs = a.aov.as_ref().map_or(&[][..], |l| &l.0);
    if !aovs.is_empty() && output::format(&path) == Some(output::Format::Png) {
        tracing::warn!("a PNG file holds no layers; those of --aov are in the checkpoint alone");
    }
    let settings = Settings::new(&loaded, &integrator, &a.subsurface, a.open, crop, aovs);
    let checkpoint_path = output::checkpoint_path(&path);
    let asked = match (a.samples, a.spp, a.time, a.error) {
        (Some((_, end)), ..) => Some(Budget::Samples(end)),
        (_, Some(n), ..) => Some(Budget::Samples(n)),
        (_, _, Some(t), _) => Some(Budget::Time(t)),
        (.., e) => e.map(Budget::Error),
    };
    let by_scene = Budget::Samples(u64::from(d.sampler.samples));
    let (film, budget) = if a.resume {
        let (film, recorded) = resumed(&checkpoint_path, &settings, a, asked)?;
        (film, asked.or(recorded).unwrap_or(by_scene))
    } else {
        let first = a.samples.map_or(0, |s| s.0);
        (Film::new([d.film.width, d.film.height], crop, first, aovs), asked.unwrap_or(by_scene))
    };

    let recorded = settings.record(&budget);
    let job = Job {
        scene: &scene,
        integrator: &integrator,
        film: &film,
        budget,
        checkpoint: Some(Checkpoint {
            path: checkpoint_path.clone(),
            record: Box::new(|_| recorded.clone()),
            every: Some(a.checkpoint_every).filter(|t| !t.is_zero()),
        }),
        factor: settings.factor(),
    };
    let display = Display::connect(a.display.as_deref(), &path.display().to_string());
    let done = job.run(&Progress::new(bar), display)?;
    let written = output::picture(&film, Some(&settings), settings.factor()).and_then(|p| output::write(&path, &p));
    report::warnings(&done, &film);
    if a.stats {
        report::statistics(&done, &scene)?;
    }
    match (written, &done.saved) {
        (Err(Failure::Run(e)), Ok(())) => {
            return Err(Failure::Run(format!(
                "{e}; all samples are safe in {}: --resume writes the picture without rendering them again",
                checkpoint_path.display()
            )));
        }
        (Err(Failure::Run(e)), Err(saved)) => {
            return Err(Failure::Run(format!("{e}; nor could the last checkpoint be written: {saved}")));
        }
        (Err(e), _) => return Err(e),
        (Ok(()), Err(e)) if done.interrupted => {
            return Err(Failure::Run(format!(
                "interrupted; {} is written, but not its checkpoint: {e}",
                path.display()
            )));
        }
        (Ok(()), Err(e)) => tracing::warn!("{e}; --resume will not be possible"),
        (Ok(()), Ok(())) => {}
    }
    if done.interrupted {
        return Err(Failure::Interrupted(format!(
            "interrupted; {} and its checkpoint are written, --resume goes on",
            path.display()
        )));
    }
    tracing::info!("{}: {} samples per pixel in {:.1} s", path.display(), film.samples(), done.elapsed.as_secs_f64());
    if a.audit {
        return audit::run(a, d, &scene, &integrator, crop, output::levels(&film)[1]);
    }
    Ok(())
}

/// Makes all rendering use a number of threads.
pub fn use_threads(threads: Option<u64>) -> Outcome {
    let Some(n) = threads else {
        return Ok(());
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n as usize).build_global();
    pool.map_err(|e| Failure::Run(format!("cannot start {n} threads: {e}")))
}

/// Checks that a picture and its checkpoint can be written, and tidies up after a killed run.
fn prepare(path: &Path) -> Outcome {
    output::require_format(path)?;
    for file in [path, &output::checkpoint_path(path)] {
        output::check_writable(file)?;
        output::remove_leftovers(file);
    }
    Ok(())
}

fn integrator(a: &Render, d: &SceneDescription) -> Integrator {
    if a.max_depth.is_none() && d.integrator.max_depth < 100 {
        tracing::info!(
            "the file's maxdepth {} is not applied: light goes on until it is absorbed or leaves (--max-depth scene truncates as the file says)",
            d.integrator.max_depth
        );
    }
    let max_depth = match a.max_depth {
        None => None,
        Some(MaxDepth::Scene) => Some(d.integrator.max_depth),
        Some(MaxDepth::Count(n)) => Some(n),
    };
    Integrator::new(a.seed.unwrap_or(d.sampler.seed), a.wavelengths, Roulette::default(), max_depth).with_policy(a.walk)
}

/// Returns the part of the picture to render: the one asked for, which must be within, or the file's.
pub fn crop(asked: Option<[u32; 4]>, d: &SceneDescription) -> Result<[u32; 4], Failure> {
    match asked {
        Some(c) if c[1] > d.film.width || c[3] > d.film.height => Err(Failure::Usage(format!(
            "--crop ends beyond the picture of {} x {} pixels",
            d.film.width, d.film.height
        ))),
        Some(c) => Ok(c),
        None => Ok(d.film.crop),
    }
}

/// Prints warnings of the reader or the scene.
pub fn warn(warnings: &[Warning]) {
    for w in warnings {
        match &w.place {
            Some(p) => tracing::warn!("{p}: {}", w.message),
            None => tracing::warn!("{}", w.message),
        }
    }
}

/// Builds the scene and prints its warnings.
///
/// `subsurface` is the name of a walk or of a model.
pub fn build(d: &SceneDescription, open: Option<Open>, subsurface: &str) -> Result<Scene, Failure> {
    let (scene, warnings) = make(d, open, subsurface)?;
    warn(&warnings);
    Ok(scene)
}

/// Builds the scene; also returns its warnings.
pub fn make(d: &SceneDescription, open: Option<Open>, subsurface: &str) -> Result<(Scene, Vec<Warning>), Failure> {
    let open = match open {
        None => OpenPolicy::Refuse,
        Some(Open::Cap) => OpenPolicy::Cap,
        Some(Open::Kill) => OpenPolicy::Kill,
        Some(Open::Profile) => OpenPolicy::Profile,
    };
    let walk = walks::find(subsurface);
    let model = match walk {
        Some(_) => None,
        None => Some(moonmilk_optics::profile::find(subsurface).map_err(|e| Failure::Usage(e.to_string()))?),
    };
    let (similar, hybrid, shifted) = walk.map_or((None, false, false), |w| (w.similar, w.hybrid, w.shifted));
    Scene::new(d, &SceneOptions { open, model, similar, hybrid, shifted }).map_err(|e| {
        let help = if matches!(e, moonmilk_render::scene::SceneError::Open { .. }) {
            " (--open cap|profile|kill renders it all the same)"
        } else {
            ""
        };
        Failure::Input(format!("{e}{help}"))
    })
}

/// Returns the picture to write: the one asked for, or the scene's in the current folder.
fn output_path(a: &Render, d: &SceneDescription) -> PathBuf {
    if let Some(path) = &a.output {
        return path.clone();
    }
    let named = d.film.filename.as_ref().and_then(|f| Path::new(f).file_name()).map(PathBuf::from);
    match named {
        None => "moonmilk.exr".into(),
        Some(path) if output::format(&path).is_some() => path,
        Some(path) => {
            let exr = path.with_extension("exr");
            tracing::info!("{} is written, since the file's {} is no .exr or .png", exr.display(), path.display());
            exr
        }
    }
}

/// Reads the checkpoint to resume and the budget it was made for; refuses one of another render.
fn resumed(
    path: &Path,
    settings: &Settings,
    a: &Render,
    asked: Option<Budget>,
) -> Result<(Film, Option<Budget>), Failure> {
    let refuse = |reason: String| Failure::Input(format!("{}: {reason}", path.display()));
    if !path.exists() {
        return Err(refuse("there is no checkpoint to resume; without --resume the render starts anew".into()));
    }
    let (text, film) =
        checkpoint::load(path).map_err(|e| Failure::Input(format!("{e}; without --resume the render starts anew")))?;
    let (recorded, budget) =
        Settings::parse(&text).ok_or_else(|| refuse("its settings cannot be read; remove it to start anew".into()))?;
    let mut differences = settings.differences(&recorded);
    // A range that is asked for must begin where the recorded one does.
    let first = a.samples.map(|s| s.0).or(asked.map(|_| 0)).unwrap_or(film.first);
    if first != film.first {
        differences.push(format!("the first sample is {first}, was {}", film.first));
    }
    if !differences.is_empty() {
        return Err(refuse(format!("the checkpoint is of another render: {}", differences.join("; "))));
    }
    let held = film.first + output::levels(&film)[1];
    if let Some(Budget::Samples(end)) = asked
        && held > end
    {
        return Err(refuse(format!("it holds samples up to {held} per pixel already, {end} are asked for")));
    }
    Ok((film, budget))
}
