//! Makes the table of the profile `tabulated`, node by node: `tabulate DIR SECONDS [NODE...]` simulates nodes into files of DIR; all of
//! them take about SECONDS on one core.
//!
//! Nodes are numbered index by index, asymmetry by asymmetry. The seed is fixed: the same number of walks makes the same bits.

use std::error::Error;
use std::path::Path;

use moonmilk_lab::tabulate::{grid, node};

/// Collisions per second and core, to choose the number of walks.
const RATE: f64 = 20e6;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let dir = Path::new(args.first().ok_or("tabulate DIR SECONDS [NODE...]")?);
    let nodes = grid::ETA.len() * grid::G.len();
    let seconds: f64 = args.get(1).ok_or("SECONDS is missing")?.parse()?;
    let chosen: Vec<usize> = match &args[2..] {
        [] => (0..nodes).collect(),
        list => list.iter().map(|s| s.parse()).collect::<Result<_, _>>()?,
    };
    // The sum of the variances is least if times go like the roots of the costs of a walk, about 1 / (1 - g) and more for larger eta.
    let at = |i: usize| (grid::ETA[i / grid::G.len()], grid::G[i % grid::G.len()]);
    let share = |i: usize| ((3.0 * at(i).0 - 2.0) / (1.0 - at(i).1)).sqrt();
    let sum: f64 = (0..nodes).map(share).sum();
    for i in chosen {
        let (eta, g) = at(i);
        // A first small run tells the cost of a walk.
        let pilot = node(eta, g, 1 << 13, 0);
        let cost = pilot.collisions as f64 / f64::from(1 << 13);
        let walks = (seconds * share(i) / sum * RATE / cost) as u64;
        let n = node(eta, g, walks, 1);
        let albedo: f64 = n.share.iter().sum();
        println!(
            "node {i}: eta {eta}, g {g}, {walks} walks, {cost:.0} collisions each, left {albedo:.5}, rest {:.5}",
            n.rest
        );
        let mut bytes = Vec::new();
        for x in [eta, g, walks as f64, n.rest] {
            bytes.extend((x as f32).to_le_bytes());
        }
        n.share.iter().for_each(|&x| bytes.extend((x as f32).to_le_bytes()));
        std::fs::write(dir.join(format!("node{i:02}.bin")), bytes)?;
    }
    Ok(())
}
