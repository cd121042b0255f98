//! `profile --radiance`: radiance rebuilt from two moments, against the exact one.

use std::f64::consts::PI;
use std::fmt::Write;

use moonmilk_io::plot::Point;
use moonmilk_io::plot::radiance::{Panel, RadiancePlot, png, svg};
use moonmilk_lab::profile::HalfSpace;
use moonmilk_lab::radiance::{Body, Slice, radiance};
use moonmilk_optics::OpticalProperties;
use moonmilk_optics::p1::{Field, lit};
use serde_json::{Value, json};

use super::{Format, Target, percent, words, write_all};
use crate::failure::Failure;
use crate::lab_args::ProfileArgs;
use crate::{Outcome, output};

/// Depths in the half-space \[transport mean free paths\]; the first stands for the surface.
const HALF_SPACE: [f64; 3] = [1e-4, 1.0, 4.0];
/// Radius of the ball \[transport mean free paths\], unless asked for.
const RADIUS: f64 = 2.0;
/// Depths in the ball over its radius; the first stands for the surface.
const BALL: [f64; 3] = [1e-4, 0.35, 0.7];
/// Names of the two curves.
const NAMES: [&str; 2] = ["P1 from the exact fluence and flux", "P1 from those of diffusion"];

/// A depth of a body with what P1 makes of it.
struct Place {
    body: &'static str,
    slice: Slice,
    /// The exact moments, and those of the diffusion equation.
    fields: [Field; 2],
}

impl Place {
    fn radiance(&self, k: usize, mu: f64) -> f64 {
        (self.fields[k].phi + 3.0 * mu * self.fields[k].flux.z) / (4.0 * PI)
    }

    fn l1(&self, k: usize) -> f64 {
        self.slice.l1(|mu| self.radiance(k, mu))
    }

    fn phi_error(&self) -> f64 {
        self.fields[1].phi / self.slice.phi.mean - 1.0
    }
}

/// Runs the command for a medium.
pub fn run(a: &ProfileArgs, name: &str, medium: &OpticalProperties, targets: &[Target]) -> Outcome {
    let length = 1.0 / medium.sigma_t_prime();
    let radius = a.radius.unwrap_or(RADIUS * length);
    let half = HalfSpace { sigma_a: medium.sigma_a(), sigma_s: medium.sigma_s(), g: medium.g(), eta: medium.eta() };
    let mut places = Vec::new();
    for (body, shape, depths) in [
        ("half-space", Body::HalfSpace, HALF_SPACE.map(|x| x * length)),
        ("ball", Body::Ball { radius }, BALL.map(|x| x * radius)),
    ] {
        let answer = radiance(&half, shape, &depths, a.photons, a.seed).map_err(|e| Failure::Input(e.to_string()))?;
        if answer.unfinished > 0.0 {
            tracing::warn!(
                "{body}: {:.2e} of the light was still inside when its paths were given up",
                answer.unfinished
            );
        }
        for slice in answer.slices {
            let diffusion = lit::diffusion(medium, shape, slice.depth).map_err(|e| Failure::Input(e.to_string()))?;
            let mut exact = diffusion;
            (exact.phi, exact.flux.z) = (slice.phi.mean, slice.flux.mean);
            places.push(Place { body, slice, fields: [exact, diffusion] });
        }
    }
    output::print(&table(name, medium, a, radius, &places))?;
    write_all(targets, |format| {
        let drawn = match format {
            Format::Csv => return Ok(csv(&places).into_bytes()),
            Format::Json => return Ok(format!("{:#}\n", as_json(name, medium, radius, &places)).into_bytes()),
            Format::Svg => svg(&picture(name, medium, a, radius, &places)).map(String::into_bytes),
            Format::Png => png(&picture(name, medium, a, radius, &places)),
        };
        drawn.map_err(|e| Failure::Run(e.to_string()))
    })
}

fn table(name: &str, m: &OpticalProperties, a: &ProfileArgs, radius: f64, places: &[Place]) -> String {
    let mut out = format!("{name}: {}\n", words(m, "L"));
    writeln!(
        out,
        "Uniform diffuse light from outside, unit power enters per area; ball of radius {radius:.4}; {} paths each",
        a.photons
    )
    .expect("a string takes everything");
    writeln!(
        out,
        "{:10} {:>10} {:>18} {:>18} {:>10} {:>10} {:>12} {:>12} {:>8}",
        "body", "depth", "fluence", "outward flux", "diffusion", "3|E|/phi", "L1, exact", "L1, diffusion", "noise"
    )
    .expect("a string takes everything");
    for p in places {
        let s = &p.slice;
        writeln!(
            out,
            "{:10} {:10.4} {:9.4} +- {:.4} {:9.4} +- {:.4} {:>10} {:10.3} {:>10.2} % {:>11.2} % {:>6.2} %",
            p.body,
            s.depth,
            s.phi.mean,
            s.phi.std_err,
            s.flux.mean,
            s.flux.std_err,
            percent(p.phi_error()),
            3.0 * s.flux.mean.abs() / s.phi.mean,
            100.0 * p.l1(0),
            100.0 * p.l1(1),
            100.0 * s.noise()
        )
        .expect("a string takes everything");
    }
    write!(
        out,
        "diffusion: error of its fluence. L1: integral of |P1 - L| over the directions, over that of L, with the exact moments and with those of diffusion.\n\
         Where 3|E| > phi the rebuilt radiance is negative in some directions."
    )
    .expect("a string takes everything");
    out
}

fn csv(places: &[Place]) -> String {
    let mut out = String::from("body,depth,cosine_from,cosine_to,radiance,std_err,p1_exact_moments,p1_diffusion\n");
    for p in places {
        for (i, l) in p.slice.radiance.iter().enumerate() {
            let ((from, to), mu) = (Slice::edges(i), Slice::centre(i));
            out.push_str(&format!(
                "{},{:e},{from:.2},{to:.2},{:e},{:e},{:e},{:e}\n",
                p.body,
                p.slice.depth,
                l.mean,
                l.std_err,
                p.radiance(0, mu),
                p.radiance(1, mu)
            ));
        }
    }
    out
}

fn as_json(name: &str, m: &OpticalProperties, radius: f64, places: &[Place]) -> Value {
    let places: Vec<Value> = places
        .iter()
        .map(|p| {
            let s = &p.slice;
            json!({
                "body": p.body, "depth": s.depth,
                "fluence": s.phi.mean, "fluence_std_err": s.phi.std_err,
                "outward_flux": s.flux.mean, "outward_flux_std_err": s.flux.std_err,
                "diffusion_fluence": p.fields[1].phi, "diffusion_outward_flux": p.fields[1].flux.z,
                "cosines": (0..s.radiance.len()).map(Slice::centre).collect::<Vec<_>>(),
                "radiance": s.radiance.iter().map(|l| l.mean).collect::<Vec<_>>(),
                "std_err": s.radiance.iter().map(|l| l.std_err).collect::<Vec<_>>(),
                "l1_exact_moments": p.l1(0), "l1_diffusion": p.l1(1), "noise": s.noise(),
            })
        })
        .collect();
    json!({
        "material": name,
        "medium": { "sigma_a": m.sigma_a(), "sigma_s": m.sigma_s(), "g": m.g(), "eta": m.eta() },
        "ball_radius": radius,
        "places": places,
    })
}

fn picture(name: &str, m: &OpticalProperties, a: &ProfileArgs, radius: f64, places: &[Place]) -> RadiancePlot {
    let unit = &a.unit;
    let panel = |p: &Place| {
        let s = &p.slice;
        // Isotropic light of the same fluence is 1.
        let scale = 4.0 * PI / s.phi.mean;
        let points = s.radiance.iter().enumerate();
        Panel {
            title: if s.depth * m.sigma_t_prime() < 1e-3 {
                "at the surface".into()
            } else {
                format!("{:.3} {unit} deep", s.depth)
            },
            measured: points
                .map(|(i, l)| Point { r: Slice::centre(i), value: l.mean * scale, std_err: l.std_err * scale })
                .collect(),
            curves: (0..2).map(|k| [-1.0, 1.0].map(|mu| (mu, p.radiance(k, mu) * scale)).to_vec()).collect(),
            facts: vec![percent(p.phi_error()), format!("{:.1} %, {:.1} %", 100.0 * p.l1(0), 100.0 * p.l1(1))],
        }
    };
    let row = |body: &str| places.iter().filter(|p| p.body == body).map(panel).collect();
    RadiancePlot {
        title: format!("{name}: the radiance inside"),
        subtitle: words(m, unit),
        quantity: "4π L / φ".into(),
        names: NAMES.map(String::from).to_vec(),
        heads: vec!["error of diffusion's fluence".into(), "L1 errors of the two".into()],
        rows: vec![
            ("Half-space under uniform diffuse light".into(), row("half-space")),
            (format!("Ball of radius {radius:.3} {unit}, the same light"), row("ball")),
        ],
    }
}
