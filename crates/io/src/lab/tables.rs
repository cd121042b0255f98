//! Results as text: CSV and JSON.

use std::fmt::Write;

use moonmilk_lab::Results;
use serde_json::{Value, json};

/// Returns results as CSV in the long form: one line per number, with the bounds of its cell.
///
/// Columns: quantity, unit, then name, lower and upper bound of up to two axes, mean, standard error. The line `QUANTITY` with
/// axis `outside` holds what fell outside of a grid, as a share of the power.
pub fn csv(r: &Results) -> String {
    let mut out = String::from("quantity,unit,axis_1,from_1,to_1,axis_2,from_2,to_2,mean,std_err\n");
    let mut line = |name: &str, unit: &str, axes: [(&str, String); 2], mean: f64, std_err: f64| {
        let [a, b] =
            axes.map(|(name, range)| if name.is_empty() { ",,".to_owned() } else { format!("{name},{range}") });
        writeln!(out, "{},{unit},{a},{b},{mean:e},{std_err:e}", quoted(name)).expect("a string takes everything");
    };
    let none = || ("", String::new());
    for s in &r.scalars {
        line(&s.name, &s.unit, [none(), none()], s.value.mean, s.value.std_err);
    }
    for g in &r.grids {
        for (i, c) in g.cells.iter().enumerate() {
            let fast = g.axes[g.axes.len() - 1].cells();
            let range = |axis: &moonmilk_lab::plan::Axis, k: usize| format!("{},{}", axis.edges[k], axis.edges[k + 1]);
            let axes = match &g.axes[..] {
                [a] => [(a.name, range(a, i)), none()],
                [a, b, ..] => [(a.name, range(a, i / fast)), (b.name, range(b, i % fast))],
                [] => [none(), none()],
            };
            line(g.name, &g.unit, axes, c.mean, c.std_err);
        }
        line(g.name, "1", [("outside", ",".into()), none()], g.outside.mean, g.outside.std_err);
    }
    out
}

/// Quotes a field where CSV asks for it.
fn quoted(s: &str) -> String {
    if s.contains([',', '"', '\n']) { format!("\"{}\"", s.replace('"', "\"\"")) } else { s.to_owned() }
}

/// Returns results as JSON: `scalars` by name, `grids` with axes, edges, means and standard errors.
pub fn json(r: &Results) -> Value {
    let scalars: serde_json::Map<String, Value> = r
        .scalars
        .iter()
        .map(|s| {
            (
                s.name.clone(),
                json!({ "mean": s.value.mean, "std_err": s.value.std_err, "unit": s.unit, "about": s.about }),
            )
        })
        .collect();
    let grids: serde_json::Map<String, Value> = r
        .grids
        .iter()
        .map(|g| {
            let axes: Vec<Value> =
                g.axes.iter().map(|a| json!({ "name": a.name, "unit": a.unit, "edges": a.edges })).collect();
            let mean: Vec<f64> = g.cells.iter().map(|c| c.mean).collect();
            let std_err: Vec<f64> = g.cells.iter().map(|c| c.std_err).collect();
            let value = json!({
                "unit": g.unit, "axes": axes, "mean": mean, "std_err": std_err,
                "outside": { "mean": g.outside.mean, "std_err": g.outside.std_err },
            });
            (g.name.to_owned(), value)
        })
        .collect();
    json!({ "photons": r.photons, "seed": r.seed, "lost": r.lost, "scalars": scalars, "grids": grids })
}
