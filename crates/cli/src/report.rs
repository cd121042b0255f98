//! What a render has to tell besides its picture.

use moonmilk_render::film::Film;
use moonmilk_render::scene::Scene;
use moonmilk_render::session::Statistics;

use crate::failure::Failure;
use crate::job::Done;
use crate::output;

/// Warns of everything that the picture alone does not show.
pub fn warnings(done: &Done, film: &Film) {
    sentences(done, film).iter().for_each(|s| tracing::warn!("{s}"));
}

/// Returns everything to be warned of that the picture alone does not show.
pub fn sentences(done: &Done, film: &Film) -> Vec<String> {
    let mut told = Vec::new();
    let Statistics { counters: c, invalid, examples, .. } = &done.statistics;
    if *invalid > 0 {
        let list: Vec<String> = examples
            .iter()
            .map(|e| format!("pixel {},{} sample {} ({:?})", e.pixel[0], e.pixel[1], e.sample, e.rgb))
            .collect();
        told.push(format!(
            "{invalid} samples were not finite or beyond 2^24 and count as 0; replay one with --pixel X,Y --samples N..N+1: {}",
            list.join("; ")
        ));
    }
    if c.lost > 0 || c.endless > 0 {
        told.push(format!(
            "{} paths left through holes of their object and {} never ended; their light is missing",
            c.lost, c.endless
        ));
    }
    if output::levels(film)[0] == 0 {
        told.push("parts of the picture are black: there was no time for a first sample".into());
    }
    told
}

/// Prints all figures on standard output.
pub fn statistics(done: &Done, scene: &Scene) -> Result<(), Failure> {
    let Statistics { counters: c, invalid, samples, .. } = &done.statistics;
    let s = done.elapsed.as_secs_f64();
    let lines = [
        format!("samples             {samples} in {s:.2} s ({:.3e} per s)", *samples as f64 / s),
        format!(
            "collisions          {} ({:.3e} per s), {} null, {} jumps over balls of collisions",
            c.collisions,
            c.collisions as f64 / s,
            c.null_collisions,
            c.jumps
        ),
        format!("rays                {} outside, {} segments inside, {} to lights", c.rays, c.segments, c.shadow_rays),
        format!(
            "closed bodies       {} entered, {} left, {} ended inside, {} set back, {} lost",
            c.entered, c.left, c.ended_inside, c.rescued, c.lost
        ),
        format!("profiles            {} ways through bodies that a model renders", c.probes),
        format!("sides               {} hits contrary to the known side", c.contrary),
        format!("invalid, endless    {invalid}, {}", c.endless),
        format!("scene               {:.1} MB", scene.memory() as f64 / 1e6),
    ];
    output::print(&lines.join("\n")).map(drop)
}
