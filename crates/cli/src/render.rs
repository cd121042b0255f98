//! `moonmilk render`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use moonmilk_core::wavelengths::WavelengthMode;
use moonmilk_io::checkpoint;
use moonmilk_io::image::Value;
use moonmilk_io::pbrt::{self, Loaded};
use moonmilk_render::description::{SceneDescription, Warning};
use moonmilk_render::film::Film;
use moonmilk_render::integrator::Integrator;
use moonmilk_render::scene::{OpenPolicy, Scene, SceneOptions};
use moonmilk_render::session::{self, Statistics};
use moonmilk_walk::Roulette;

use crate::Outcome;
use crate::args::{MaxDepth, Open, Render};
use crate::budget::Budget;
use crate::display::Display;
use crate::failure::Failure;
use crate::job::{Done, Job};
use crate::output;
use crate::progress::Progress;

/// Runs the command.
pub fn run(a: &Render, quiet: bool) -> Outcome {
    if let Some(n) = a.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(n as usize)
            .build_global()
            .map_err(|e| Failure::Run(format!("cannot start {n} threads: {e}")))?;
    }
    let loaded = pbrt::load(&a.scene).map_err(|e| Failure::Report(e.into()))?;
    warn(&loaded.warnings);
    let scene = build(&loaded.scene, a.open)?;
    let d = &loaded.scene;
    let integrator = Integrator {
        seed: a.seed.unwrap_or(d.sampler.seed),
        wavelengths: a.wavelengths,
        roulette: Roulette::default(),
        max_depth: match a.max_depth {
            None => None,
            Some(MaxDepth::Scene) => Some(d.integrator.max_depth),
            Some(MaxDepth::Count(n)) => Some(n),
        },
    };
    if a.max_depth.is_none() && d.integrator.max_depth < 100 {
        tracing::info!(
            "the file's maxdepth {} is not applied: light goes on until it is absorbed or leaves (--max-depth scene truncates as the file says)",
            d.integrator.max_depth
        );
    }
    if let Some([x, y]) = a.pixel {
        return replay(a, d, &scene, &integrator, [x, y]);
    }

    let path = output_path(a, d);
    output::extension(&path)?;
    let crop = match a.crop {
        Some(c) if c[1] > d.film.width || c[3] > d.film.height => {
            return Err(Failure::Usage(format!(
                "--crop ends beyond the picture of {} x {} pixels",
                d.film.width, d.film.height
            )));
        }
        Some(c) => c,
        None => d.film.crop,
    };
    let aovs = a.aov.as_ref().map_or(&[][..], |l| &l.0);
    let settings = settings(&loaded, &integrator, a, crop, aovs.iter().map(|a| a.name()).collect());
    let checkpoint_path = with_suffix(&path, ".checkpoint");
    let first = a.samples.map_or(0, |s| s.0);
    let film = if a.resume {
        resumed(&checkpoint_path, &settings)?
    } else {
        Film::new([d.film.width, d.film.height], crop, first, aovs)
    };
    let budget = match (a.samples, a.spp, a.time, a.error) {
        (Some((_, end)), ..) => Budget::Samples(end),
        (_, Some(n), ..) => Budget::Samples(n),
        (_, _, Some(t), _) => Budget::Time(t),
        (.., Some(e)) => Budget::Error(e),
        _ => Budget::Samples(u64::from(d.sampler.samples)),
    };
    let job = Job {
        scene: &scene,
        integrator: &integrator,
        film: &film,
        budget,
        checkpoint: Some((checkpoint_path, settings.clone())),
        checkpoint_every: (a.checkpoint_every > 0).then(|| Duration::from_secs(a.checkpoint_every)),
        factor: d.film.imaging_ratio,
    };
    let mut display = Display::connect(a.display.as_deref(), &path.display().to_string());
    let done = job.run(&Progress::new(quiet), &mut display)?;
    let picture = output::picture(&film, d.film.imaging_ratio, &attributes(&settings, &film))?;
    output::write(&path, &picture)?;
    report(&done, a.stats, &scene);
    if done.interrupted {
        return Err(Failure::Interrupted(format!(
            "interrupted; {} and its checkpoint are written, --resume goes on",
            path.display()
        )));
    }
    tracing::info!("{}: {} samples per pixel in {:.1} s", path.display(), film.samples(), done.elapsed.as_secs_f64());
    Ok(())
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
pub fn build(d: &SceneDescription, open: Option<Open>) -> Result<Scene, Failure> {
    let open = match open {
        None => OpenPolicy::Refuse,
        Some(Open::Cap) => OpenPolicy::Cap,
        Some(Open::Kill) => OpenPolicy::Kill,
        Some(Open::Profile) => {
            return Err(Failure::Usage(
                "--open profile needs a BSSRDF, which is not in this version; available: cap, kill".into(),
            ));
        }
    };
    let (scene, warnings) = Scene::new(d, &SceneOptions { open }).map_err(|e| {
        let help = if matches!(e, moonmilk_render::scene::SceneError::Open { .. }) {
            " (--open cap or --open kill renders it all the same)"
        } else {
            ""
        };
        Failure::Input(format!("{e}{help}"))
    })?;
    warn(&warnings);
    Ok(scene)
}

fn output_path(a: &Render, d: &SceneDescription) -> PathBuf {
    let named = || {
        d.film.filename.as_ref().map(|f| PathBuf::from(f).file_name().map_or_else(|| PathBuf::from(f), PathBuf::from))
    };
    a.output.clone().or_else(named).unwrap_or_else(|| "moonmilk.exr".into())
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut s = path.as_os_str().to_owned();
    s.push(suffix);
    s.into()
}

/// Returns the text that must agree between a checkpoint and the run that resumes it.
fn settings(loaded: &Loaded, integrator: &Integrator, a: &Render, crop: [u32; 4], aovs: Vec<&str>) -> String {
    let wavelengths = match integrator.wavelengths {
        WavelengthMode::Hero => "hero".into(),
        WavelengthMode::Rgb => "rgb".into(),
        WavelengthMode::Mono(nm) => format!("{nm} nm"),
    };
    let hash: String = loaded.hash.iter().map(|b| format!("{b:02x}")).collect();
    let depth = integrator.max_depth.map_or_else(|| "none".into(), |d| d.to_string());
    serde_json::json!({
        "version": env!("CARGO_PKG_VERSION"),
        "scene": hash,
        "seed": integrator.seed.to_string(),
        "wavelengths": wavelengths,
        "subsurface": a.subsurface,
        // Names the estimator, not the request: auto is classic in this version.
        "walk": "classic",
        "max_depth": depth,
        "open": a.open.map_or_else(|| "refuse".into(), |o| format!("{o:?}").to_lowercase()),
        "crop": crop,
        "aov": aovs,
        "factor": loaded.scene.film.imaging_ratio,
    })
    .to_string()
}

/// Reads the checkpoint to resume, and refuses one of another render.
fn resumed(path: &Path, settings: &str) -> Result<Film, Failure> {
    let (recorded, film) =
        checkpoint::load(path).map_err(|e| Failure::Input(format!("{e}; without --resume the render starts anew")))?;
    if recorded != settings {
        let parse = |s: &str| serde_json::from_str::<serde_json::Map<String, serde_json::Value>>(s).unwrap_or_default();
        let (old, new) = (parse(&recorded), parse(settings));
        let differing: Vec<String> = new
            .iter()
            .filter(|(k, v)| old.get(*k) != Some(v))
            .map(|(k, v)| {
                format!("{k} is {v}, was {}", old.get(k).map_or_else(|| "absent".into(), ToString::to_string))
            })
            .collect();
        return Err(Failure::Input(format!(
            "{}: the checkpoint is of another render: {}",
            path.display(),
            differing.join("; ")
        )));
    }
    Ok(film)
}

/// Returns what is recorded in the picture.
pub fn attributes(settings: &str, film: &Film) -> Vec<(&'static str, Value)> {
    let mut list = vec![
        ("moonmilk.settings", Value::Text(settings.into())),
        ("moonmilk.spp", Value::Text(film.samples().to_string())),
    ];
    if let Ok(map) = serde_json::from_str::<serde_json::Map<String, serde_json::Value>>(settings) {
        for (key, name) in [("version", "moonmilk.version"), ("scene", "moonmilk.scene"), ("seed", "moonmilk.seed")] {
            if let Some(serde_json::Value::String(s)) = map.get(key) {
                list.push((name, Value::Text(s.clone())));
            }
        }
    }
    list
}

/// Renders one pixel and prints its samples.
fn replay(a: &Render, d: &SceneDescription, scene: &Scene, integrator: &Integrator, pixel: [u32; 2]) -> Outcome {
    if pixel[0] >= d.film.width || pixel[1] >= d.film.height {
        return Err(Failure::Usage(format!(
            "--pixel is outside the picture of {} x {} pixels",
            d.film.width, d.film.height
        )));
    }
    let (from, to) = a.samples.unwrap_or((0, a.spp.unwrap_or(u64::from(d.sampler.samples))));
    let mut statistics = Statistics::default();
    let mut sum = [0.0f64; 3];
    println!("sample,R,G,B");
    for s in from..to {
        let v = session::sample(scene, integrator, pixel, s, &mut statistics.counters);
        println!("{s},{},{},{}", v.rgb[0], v.rgb[1], v.rgb[2]);
        sum.iter_mut().zip(v.rgb).for_each(|(a, b)| *a += f64::from(b));
    }
    let n = (to - from) as f64;
    eprintln!("mean of {n} samples: {:.6} {:.6} {:.6}", sum[0] / n, sum[1] / n, sum[2] / n);
    Ok(())
}

/// Reports invalid samples always, and all figures on request.
pub fn report(done: &Done, all: bool, scene: &Scene) {
    let Statistics { counters: c, invalid, examples, samples } = &done.statistics;
    if *invalid > 0 {
        let list: Vec<String> = examples
            .iter()
            .map(|e| format!("pixel {},{} sample {} ({:?})", e.pixel[0], e.pixel[1], e.sample, e.rgb))
            .collect();
        tracing::warn!(
            "{invalid} invalid samples were left out; replay with --pixel X,Y --samples N..N+1: {}",
            list.join("; ")
        );
    }
    if c.lost > 0 || c.endless > 0 {
        tracing::warn!(
            "{} paths left through holes of their object and {} never ended; their light is missing",
            c.lost,
            c.endless
        );
    }
    if all {
        let s = done.elapsed.as_secs_f64();
        println!("samples             {samples} in {s:.2} s ({:.3e} per s)", *samples as f64 / s);
        println!("collisions          {} ({:.3e} per s)", c.collisions, c.collisions as f64 / s);
        println!("rays                {} outside, {} segments inside, {} to lights", c.rays, c.segments, c.shadow_rays);
        println!(
            "closed bodies       {} entered, {} left, {} ended inside, {} set back, {} lost",
            c.entered, c.left, c.ended_inside, c.rescued, c.lost
        );
        println!("sides               {} hits contrary to the known side", c.contrary);
        println!("invalid, endless    {invalid}, {}", c.endless);
        println!("scene               {:.1} MB", scene.memory() as f64 / 1e6);
    }
}
