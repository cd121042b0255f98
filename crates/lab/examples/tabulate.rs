//! Makes the table of the profile `tabulated`: `tabulate DIR [THOUSANDTHS]` simulates into DIR and writes DIR/tabulated.bin, which is shipped as
//! `crates/optics/src/profile/tabulated/tabulated.bin`.
//!
//! All walks take about two and a half hours of one core; THOUSANDTHS says how many of them to simulate. The table must exist to compile this; any
//! file will do. Simulations that lie in DIR already are not repeated, so an interrupted run goes on.
//! Seeds are fixed: equal walks make equal bits.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use moonmilk_lab::tabulate::{Node, node, pack};
use moonmilk_optics::profile::tabulated::grid::{self, ETAS, GS};

/// Walks of one simulation of every asymmetry, and the number of simulations, with seeds 1, 2, ...
const WALKS: [(u64, u64); GS] = [
    (5_000_000, 4),
    (5_000_000, 4),
    (5_000_000, 4),
    (5_000_000, 4),
    (5_000_000, 6),
    (4_000_000, 6),
    (10_000_000, 24),
    (5_000_000, 24),
    (4_500_000, 24),
    (3_000_000, 24),
    (3_200_000, 24),
    (2_800_000, 24),
];

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let dir = Path::new(args.first().ok_or("tabulate DIR [THOUSANDTHS]")?);
    let thousandths: u64 = args.get(1).map_or(Ok(1000), |s| s.parse())?;
    // Seed by seed, so that an interrupted run has about as many of every asymmetry.
    let most = WALKS.iter().map(|w| w.1).max().unwrap_or(0);
    for seed in 1..=most {
        for (i, (walks, runs)) in WALKS.into_iter().enumerate() {
            let path = part(dir, i, seed);
            if seed > runs || path.exists() {
                continue;
            }
            let start = Instant::now();
            let n = node(grid::g(i), &grid::etas(), (walks * thousandths).div_ceil(1000), seed);
            std::fs::write(&path, written(&n))?;
            let per_walk = n.collisions as f64 / n.walks as f64;
            println!("g {:.4}: {per_walk:.0} collisions per walk, {:.0} s", n.g, start.elapsed().as_secs_f64());
        }
    }
    let mut nodes = Vec::new();
    for (i, (_, runs)) in WALKS.into_iter().enumerate() {
        let mut joined: Option<Node> = None;
        for seed in 1..=runs {
            let n = read(&std::fs::read(part(dir, i, seed))?)?;
            match &mut joined {
                Some(all) => all.join(&n),
                None => joined = Some(n),
            }
        }
        let n = joined.ok_or("at least one run")?;
        let left: f64 = n.share.iter().skip(ETAS - 1).step_by(ETAS).sum();
        println!(
            "g {:.4}: {} walks; at eta 2 {left:.5} left after 2 or more collisions, rest {:.5}",
            n.g,
            n.walks,
            n.rest[ETAS - 1]
        );
        nodes.push(n);
    }
    let bytes = pack::table(&nodes, &pack::totals());
    println!("{} bytes", bytes.len());
    std::fs::write(dir.join("tabulated.bin"), bytes)?;
    Ok(())
}

/// Returns the file of one simulation.
fn part(dir: &Path, asymmetry: usize, seed: u64) -> PathBuf {
    dir.join(format!("g{asymmetry:02}s{seed}.bin"))
}

fn written(n: &Node) -> Vec<u8> {
    [n.g, n.walks as f64].iter().chain(&n.rest).chain(&n.share).flat_map(|x| x.to_le_bytes()).collect()
}

fn read(bytes: &[u8]) -> Result<Node, Box<dyn Error>> {
    let x: Vec<f64> = bytes.as_chunks().0.iter().map(|c| f64::from_le_bytes(*c)).collect();
    let (head, share) = x.split_at_checked(2 + ETAS).ok_or("a simulation is cut short")?;
    let rest = std::array::from_fn(|k| head[2 + k]);
    Ok(Node { g: head[0], share: share.to_vec(), rest, walks: head[1] as u64, collisions: 0 })
}
