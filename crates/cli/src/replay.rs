//! `--pixel`: the samples of one pixel, as the picture had them.

use std::sync::atomic::AtomicBool;

use moonmilk_render::description::SceneDescription;
use moonmilk_render::effort::{Effort, PILOT};
use moonmilk_render::film::{Film, LARGEST};
use moonmilk_render::integrator::Integrator;
use moonmilk_render::scene::Scene;
use moonmilk_render::session::{self, Statistics};

use crate::args::Render;
use crate::failure::Failure;
use crate::{Outcome, output};

/// Renders one pixel and prints its samples on standard output as CSV, multiplied by the film's imaging ratio.
pub fn run(a: &Render, d: &SceneDescription, scene: &Scene, integrator: &Integrator, pixel: [u32; 2]) -> Outcome {
    if pixel[0] >= d.film.width || pixel[1] >= d.film.height {
        return Err(Failure::Usage(format!(
            "--pixel is outside the picture of {} x {} pixels",
            d.film.width, d.film.height
        )));
    }
    let (from, to) = a.samples.unwrap_or((0, a.spp.unwrap_or(u64::from(d.sampler.samples))));
    let mut statistics = Statistics::default();
    let (mut sum, mut invalid) = ([0.0f64; 3], 0u64);
    if !output::print("sample,R,G,B,valid")? {
        return Ok(());
    }
    // Later samples have as many paths as the noise of the first ones around says.
    let effort = if Effort::applies(integrator) && to > PILOT {
        let film = Film::new([d.film.width, d.film.height], d.film.crop, 0, &[]);
        Effort::of(scene, integrator, &film, &AtomicBool::new(false), &mut statistics.counters)
    } else {
        None
    };
    let mut integrator = integrator.clone();
    for s in from..to {
        integrator = integrator.for_sample(scene, s);
        let paths = effort.as_ref().filter(|_| s >= PILOT).map_or(1, |e| e.paths(pixel));
        let v = session::mean_sample(scene, &integrator, pixel, s, paths, &mut statistics.counters);
        // The film's own rule: what is not finite or too large counts as zero.
        let valid = v.rgb.iter().all(|c| c.is_finite() && c.abs() <= LARGEST);
        let rgb = v.rgb.map(|c| c * d.film.imaging_ratio);
        if valid {
            sum.iter_mut().zip(rgb).for_each(|(a, b)| *a += f64::from(b));
        } else {
            invalid += 1;
        }
        if !output::print(&format!("{s},{},{},{},{}", rgb[0], rgb[1], rgb[2], u8::from(valid)))? {
            return Ok(());
        }
    }
    let n = (to - from) as f64;
    let m = sum.map(|s| s / n);
    tracing::info!(
        "mean of {n} samples: {:.6} {:.6} {:.6}, {invalid} of them invalid (counted as 0)",
        m[0],
        m[1],
        m[2]
    );
    Ok(())
}
