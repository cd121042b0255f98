//! `profile --point-source`: the fluence around a point source in an infinite medium.

use std::f64::consts::PI;

use moonmilk_io::plot::{self, Curve, Point, ProfilePlot};
use moonmilk_lab::infinite::{fluence, shell_mean};
use moonmilk_lab::profile::HalfSpace;
use moonmilk_optics::OpticalProperties;
use moonmilk_optics::point_source::{Exact, classical, grosjean, grosjean_as_printed};
use serde_json::json;
use std::fmt::Write;

use super::{Format, POINTS, Target, centre, percent, words, write_all};
use crate::failure::Failure;
use crate::lab_args::ProfileArgs;
use crate::{Outcome, output};

/// Shells per factor of ten of the radius: the mean of 1 / r^2 over one is .3 % below its middle.
const PER_DECADE: f64 = 24.0;
/// Radius of the first shell \[mean free paths\].
const FIRST: f64 = 0.05;

/// A form of the fluence.
struct Form<'a> {
    name: &'static str,
    fluence: Box<dyn Fn(f64) -> f64 + 'a>,
    shells: Vec<f64>,
    /// Integral of |form - Monte Carlo| over the volume of the shells, over that of Monte Carlo.
    l1: f64,
}

/// Runs the command for a medium.
pub fn run(a: &ProfileArgs, name: &str, m: &OpticalProperties, targets: &[Target]) -> Outcome {
    let half = HalfSpace { sigma_a: m.sigma_a(), sigma_s: m.sigma_s(), g: m.g(), eta: 1.0 };
    // A dozen diffusion lengths, but no more than 30 mean free paths.
    let mfp = 1.0 / m.sigma_t();
    let last = (12.0 / m.sigma_tr()).min(30.0 * mfp).max(6.0 * mfp);
    let n = ((last / (FIRST * mfp)).log10() * PER_DECADE).ceil() as i32;
    let edge = |i: i32| FIRST * mfp * 10f64.powf(f64::from(i) / PER_DECADE);
    let shells: Vec<(f64, f64)> = (0..n).map(|i| (edge(i), edge(i + 1))).collect();
    let measured = fluence(&half, &shells, a.photons, a.seed).map_err(|e| Failure::Input(e.to_string()))?;
    let volume = |s: &(f64, f64)| 4.0 / 3.0 * PI * (s.1.powi(3) - s.0.powi(3));
    let all: f64 = shells.iter().zip(&measured).map(|(s, e)| volume(s) * e.mean).sum();
    let form = |name, f: Box<dyn Fn(f64) -> f64>| {
        let means: Vec<f64> = shells.iter().map(|&s| shell_mean(s, &f)).collect();
        let off: f64 = shells.iter().zip(&measured).zip(&means).map(|((s, e), x)| volume(s) * (x - e.mean).abs()).sum();
        Form { name, fluence: f, shells: means, l1: off / all }
    };
    let (b, c, d) = (*m, *m, *m);
    let mut forms = vec![
        form("classical monopole", Box::new(move |r| classical(r, &b))),
        form("Grosjean", Box::new(move |r| grosjean(r, &c))),
        form("Grosjean as the slide prints it", Box::new(move |r| grosjean_as_printed(r, &d))),
    ];
    // The exact solution is known where scattering is isotropic.
    if m.g() == 0.0 && m.sigma_s() > 0.0 {
        let (exact, sigma_t) = (Exact::new(m.alpha()).map_err(|e| Failure::Input(e.to_string()))?, m.sigma_t());
        forms.push(form("exact", Box::new(move |r| sigma_t * sigma_t * exact.fluence(r * sigma_t))));
    }
    let noise: f64 =
        shells.iter().zip(&measured).map(|(s, e)| volume(s) * e.std_err * (2.0 / PI).sqrt()).sum::<f64>() / all;

    let mut out = format!("{name}: {}\n", words(m, "L"));
    writeln!(
        out,
        "Point source of unit power in an infinite medium, {} paths; 4 pi r^2 phi, and errors of the forms",
        a.photons
    )
    .expect("a string takes everything");
    write!(out, "{:>10} {:>22}", "r", "Monte Carlo").expect("a string takes everything");
    for f in &forms {
        write!(out, " {:>32}", f.name).expect("a string takes everything");
    }
    for i in (0..shells.len()).step_by(8) {
        let (r, e) = (centre(&[shells[i].0, shells[i].1]), measured[i]);
        let factor = 4.0 * PI * r * r;
        write!(out, "\n{r:10.4} {:12.5} +- {:.5}", factor * e.mean, factor * e.std_err)
            .expect("a string takes everything");
        for f in &forms {
            write!(out, " {:>32}", percent(f.shells[i] / e.mean - 1.0)).expect("a string takes everything");
        }
    }
    write!(out, "\n{:>10} {:>20.2} %", "L1 error", 100.0 * noise).expect("a string takes everything");
    for f in &forms {
        write!(out, " {:>30.2} %", 100.0 * f.l1).expect("a string takes everything");
    }
    output::print(&out)?;

    write_all(targets, |format| {
        let picture = || {
            let curves = forms.iter().map(|f| {
                let radius = |i: usize| shells[0].0 * (last / shells[0].0).powf(i as f64 / POINTS as f64);
                let ratios = shells.iter().zip(measured.iter().zip(&f.shells));
                Curve {
                    name: f.name.into(),
                    facts: vec![format!("{:.1} %", 100.0 * f.l1)],
                    points: (0..=POINTS).map(radius).map(|r| (r, (f.fluence)(r))).collect(),
                    ratios: ratios
                        .filter(|(_, (e, _))| e.mean > 0.0 && e.std_err < 0.15 * e.mean)
                        .map(|(s, (e, x))| (centre(&[s.0, s.1]), x / e.mean))
                        .collect(),
                }
            });
            ProfilePlot {
                title: format!("{name}: a point source"),
                subtitle: words(m, &a.unit),
                unit: a.unit.clone(),
                labels: [format!("φ(r)  [1/{}²]", a.unit), "r² φ(r)".into()],
                power: 2,
                columns: vec!["L1 error".into()],
                facts: vec![format!("± {:.1} %", 100.0 * noise)],
                measured: shells
                    .iter()
                    .zip(&measured)
                    .map(|(s, e)| Point { r: centre(&[s.0, s.1]), value: e.mean, std_err: e.std_err })
                    .collect(),
                curves: curves.collect(),
            }
        };
        let drawn = match format {
            Format::Csv => {
                let mut out = String::from("r_from,r_to,fluence,std_err");
                forms.iter().for_each(|f| out.push_str(&format!(",{}", f.name)));
                for (i, (s, e)) in shells.iter().zip(&measured).enumerate() {
                    out.push_str(&format!("\n{:e},{:e},{:e},{:e}", s.0, s.1, e.mean, e.std_err));
                    forms.iter().for_each(|f| out.push_str(&format!(",{:e}", f.shells[i])));
                }
                return Ok((out + "\n").into_bytes());
            }
            Format::Json => {
                let value = json!({
                    "material": name,
                    "medium": { "sigma_a": m.sigma_a(), "sigma_s": m.sigma_s(), "g": m.g() },
                    "shells": shells,
                    "fluence": measured.iter().map(|e| e.mean).collect::<Vec<_>>(),
                    "std_err": measured.iter().map(|e| e.std_err).collect::<Vec<_>>(),
                    "forms": forms.iter().map(|f| json!({ "name": f.name, "shells": f.shells, "l1_error": f.l1 })).collect::<Vec<_>>(),
                });
                return Ok(format!("{value:#}\n").into_bytes());
            }
            Format::Svg => plot::svg(&picture()).map(String::into_bytes),
            Format::Png => plot::png(&picture()),
        };
        drawn.map_err(|e| Failure::Run(e.to_string()))
    })
}
