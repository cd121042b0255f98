//! Results as text: CSV and JSON.

use std::fmt::Write;

use moonmilk_lab::Results;
use serde_json::{Value, json};

/// Returns results as CSV in the long form: one line per number, with the bounds of its cell.
///
/// Columns: quantity, unit, then name, lower and upper bound of two axes (three if a grid has as many), mean, standard error. The line `QUANTITY` with
/// axis `outside` holds what fell outside of a grid, as a share of the power.
pub fn csv(r: &Results) -> String {
    let most = r.grids.iter().map(|g| g.axes.len()).fold(2, usize::max);
    let heads: String = (1..=most).map(|k| format!("axis_{k},from_{k},to_{k},")).collect();
    let mut out = format!("quantity,unit,{heads}mean,std_err\n");
    let mut line = |name: &str, unit: &str, axes: &[String], mean: f64, std_err: f64| {
        let axes: String = (0..most).map(|k| axes.get(k).map_or(",,,".into(), |a| format!("{a},"))).collect();
        writeln!(out, "{},{unit},{axes}{mean:e},{std_err:e}", quoted(name)).expect("a string takes everything");
    };
    for s in &r.scalars {
        line(&s.name, &s.unit, &[], s.value.mean, s.value.std_err);
    }
    for g in &r.grids {
        for (i, c) in g.cells.iter().enumerate() {
            let mut rest = i;
            let mut axes: Vec<String> = Vec::new();
            for a in g.axes.iter().rev() {
                let k = rest % a.cells();
                rest /= a.cells();
                axes.insert(0, format!("{},{},{}", a.name, a.edges[k], a.edges[k + 1]));
            }
            line(g.name, &g.unit, &axes, c.mean, c.std_err);
        }
        line(g.name, "1", &["outside,,".into()], g.outside.mean, g.outside.std_err);
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
