//! `profile --brownian`: paths of light beside Brownian motion.

use std::fmt::Write;

use moonmilk_io::plot::Point;
use moonmilk_io::plot::journeys::{Drawing, JourneysPlot, png, svg};
use moonmilk_lab::infinite::{Journeys, beyond, journeys, mean_square};
use moonmilk_lab::profile::HalfSpace;
use moonmilk_optics::OpticalProperties;
use serde_json::{Value, json};

use super::{Format, Target, words, write_all};
use crate::failure::Failure;
use crate::lab_args::ProfileArgs;
use crate::{Outcome, output};

/// Path lengths \[transport mean free paths\].
const LENGTHS: [f64; 9] = [0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 40.0];

/// Runs the command for a medium.
pub fn run(a: &ProfileArgs, name: &str, medium: &OpticalProperties, targets: &[Target]) -> Outcome {
    let transport = 1.0 / medium.sigma_s_prime();
    let half = HalfSpace { sigma_a: 0.0, sigma_s: medium.sigma_s(), g: medium.g(), eta: 1.0 };
    let lengths = LENGTHS.map(|x| x * transport);
    let j = journeys(&half, &lengths, a.photons, a.seed).map_err(|e| Failure::Input(e.to_string()))?;
    output::print(&table(name, medium, a, transport, &j))?;
    write_all(targets, |format| {
        let drawn = match format {
            Format::Csv => return Ok(csv(transport, &j).into_bytes()),
            Format::Json => return Ok(format!("{:#}\n", as_json(name, medium, transport, &j)).into_bytes()),
            Format::Svg => svg(&picture(name, medium, a, transport, &j)).map(String::into_bytes),
            Format::Png => png(&picture(name, medium, a, transport, &j)),
        };
        drawn.map_err(|e| Failure::Run(e.to_string()))
    })
}

fn table(name: &str, m: &OpticalProperties, a: &ProfileArgs, transport: f64, j: &Journeys) -> String {
    let mut out = format!("{name}: {}\n", words(m, "L"));
    writeln!(
        out,
        "Paths of light and of Brownian motion from a point, {} each; l' = 1 / sigma_s' = {transport:.4}",
        a.photons
    )
    .expect("a string takes everything");
    writeln!(
        out,
        "{:>8} {:>26} {:>12} {:>12} {:>16} {:>20}",
        "path/l'", "mean r^2 of light / l'^2", "exact", "6 D s", "light/Brownian", "Brownian r > path"
    )
    .expect("a string takes everything");
    let l2 = transport * transport;
    for (s, r2) in j.lengths.iter().zip(&j.light) {
        writeln!(
            out,
            "{:8.1} {:15.4} +- {:7.4} {:12.4} {:12.4} {:16.4} {:>18.2} %",
            s / transport,
            r2.mean / l2,
            r2.std_err / l2,
            mean_square(*s, transport) / l2,
            2.0 * s / transport,
            r2.mean / (2.0 * transport * s),
            100.0 * beyond(*s, transport)
        )
        .expect("a string takes everything");
    }
    out.pop();
    out
}

fn csv(transport: f64, j: &Journeys) -> String {
    let mut out = String::from(
        "path,light_r2,std_err,exact_r2,brownian_r2,brownian_std_err,brownian_exact,brownian_beyond_path\n",
    );
    for ((s, l), b) in j.lengths.iter().zip(&j.light).zip(&j.brownian) {
        out.push_str(&format!(
            "{s:e},{:e},{:e},{:e},{:e},{:e},{:e},{:e}\n",
            l.mean,
            l.std_err,
            mean_square(*s, transport),
            b.mean,
            b.std_err,
            2.0 * transport * s,
            beyond(*s, transport)
        ));
    }
    out
}

fn as_json(name: &str, m: &OpticalProperties, transport: f64, j: &Journeys) -> Value {
    let means = |e: &[moonmilk_core::Estimate]| e.iter().map(|e| e.mean).collect::<Vec<_>>();
    let errors = |e: &[moonmilk_core::Estimate]| e.iter().map(|e| e.std_err).collect::<Vec<_>>();
    let paths = |p: &[Vec<moonmilk_core::DVec3>]| -> Vec<Vec<[f64; 3]>> {
        p.iter().map(|p| p.iter().map(|x| x.to_array()).collect()).collect()
    };
    json!({
        "material": name,
        "medium": { "sigma_a": m.sigma_a(), "sigma_s": m.sigma_s(), "g": m.g(), "eta": m.eta() },
        "transport_mean_free_path": transport,
        "path": j.lengths,
        "light": { "r2": means(&j.light), "std_err": errors(&j.light), "paths": paths(&j.light_paths),
                   "exact": j.lengths.iter().map(|s| mean_square(*s, transport)).collect::<Vec<_>>() },
        "brownian": { "r2": means(&j.brownian), "std_err": errors(&j.brownian), "paths": paths(&j.brownian_paths) },
    })
}

fn picture(name: &str, m: &OpticalProperties, a: &ProfileArgs, transport: f64, j: &Journeys) -> JourneysPlot {
    let drawing = |title: &str, subtitle: String, paths: &[Vec<moonmilk_core::DVec3>]| Drawing {
        title: title.into(),
        subtitle,
        paths: paths.iter().map(|p| p.iter().map(|x| (x.x, x.z)).collect()).collect(),
    };
    let last = j.lengths[j.lengths.len() - 1];
    let brownian = 2.0 * transport;
    let curve = |f: &dyn Fn(f64) -> f64| {
        (0..=200).map(|i| 0.08 * 600f64.powf(f64::from(i) / 200.0)).map(|x| (x, f(x))).collect::<Vec<_>>()
    };
    JourneysPlot {
        title: format!("{name}: light and Brownian motion"),
        subtitle: words(m, &a.unit),
        unit: a.unit.clone(),
        drawings: [
            drawing("Light", format!("six paths of {last:.1} {}, straight between collisions", a.unit), &j.light_paths),
            drawing("Brownian motion", "of the same diffusion coefficient and duration".into(), &j.brownian_paths),
        ],
        // Two standard deviations of a coordinate at the end.
        reach: 2.0 * (brownian * last / 3.0).sqrt(),
        axes: ["path length / transport mean free path".into(), "⟨r²⟩ / 6 D s".into()],
        measured: j
            .lengths
            .iter()
            .zip(&j.light)
            .map(|(s, e)| Point {
                r: s / transport,
                value: e.mean / (brownian * s),
                std_err: e.std_err / (brownian * s),
            })
            .collect(),
        curves: vec![
            ("light, exact".into(), curve(&|x| mean_square(x, 1.0) / (2.0 * x))),
            ("Brownian motion".into(), curve(&|_| 1.0)),
            ("share of Brownian paths that outrun light".into(), curve(&|x| beyond(x, 1.0))),
        ],
    }
}
