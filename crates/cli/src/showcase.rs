//! The built-in showcase: `moonmilk` without a command.

use std::path::Path;
use std::time::Duration;

use moonmilk_core::wavelengths::WavelengthMode;
use moonmilk_io::pbrt;
use moonmilk_render::film::Film;
use moonmilk_render::integrator::Integrator;
use moonmilk_walk::Roulette;

use crate::Outcome;
use crate::budget::Budget;
use crate::display::Display;
use crate::failure::Failure;
use crate::job::Job;
use crate::progress::Progress;
use crate::{output, render, report};

/// Time spent on the picture: with reading, building and writing within a minute.
const TIME: Duration = Duration::from_secs(54);

/// Size of the picture in pixels: small enough that a minute on two cores leaves an nMSE of .01 on the objects (5.3 per sample; the
/// file's own 480 x 300 would need five minutes).
const SIZE: [u32; 2] = [216, 135];

/// The pictures written.
const NAMES: [&str; 2] = ["moonmilk.exr", "moonmilk.png"];

/// Renders the showcase into the current folder.
pub fn run(bar: bool) -> Outcome {
    for name in NAMES {
        output::check_writable(Path::new(name))?;
    }
    let mut loaded =
        pbrt::load_with(&moonmilk_io::showcase::Embedded, moonmilk_io::showcase::SCENE, &pbrt::Options::default())
            .map_err(Failure::Scene)?;
    render::warn(&loaded.warnings);
    let film = &mut loaded.scene.film;
    [film.width, film.height] = SIZE;
    film.crop = [0, SIZE[0], 0, SIZE[1]];
    let d = &loaded.scene;
    let scene = render::build(d, None, "path")?;
    let integrator = Integrator::new(d.sampler.seed, WavelengthMode::Hero, Roulette::default(), None);
    let film = Film::new([d.film.width, d.film.height], d.film.crop, 0, &[]);
    let job = Job {
        scene: &scene,
        integrator: &integrator,
        film: &film,
        budget: Budget::Time(TIME),
        checkpoint: None,
        factor: d.film.imaging_ratio,
    };
    tracing::info!("rendering the showcase for {} s; moonmilk render SCENE renders yours", TIME.as_secs());
    let done = job.run(&Progress::new(bar), Display::connect(None, "moonmilk"))?;
    let error = film.develop(1.0).relative_error();
    let picture = output::picture(&film, None, d.film.imaging_ratio)?;
    for name in NAMES {
        output::write(Path::new(name), &picture)?;
    }
    report::warnings(&done, &film);
    if done.interrupted {
        return Err(Failure::Interrupted("interrupted; moonmilk.png and moonmilk.exr hold what was done".into()));
    }
    tracing::info!("moonmilk.png, moonmilk.exr: {} samples per pixel, error {:.1} %", film.samples(), 100.0 * error);
    Ok(())
}
