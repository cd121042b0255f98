//! Measures the error of the profile `tabulated` between the nodes of its table: `tabulated_error G WALKS [SEED]`.
//!
//! Walks of another seed at the asymmetry G and at indices in the middle between the table's, with a little of the noise of plain Monte Carlo (they are
//! those of `moonmilk_lab::tabulate`; plain walks confirm them in the test `tabulated`). Columns: albedo, L1 error, its noise, the worst ring of those with r^2 R above 1e-5 of
//! the largest and known to .3 %, how many of all those rings are known so well.

use std::error::Error;

use moonmilk_core::Estimate;
use moonmilk_core::estimate::Accumulator;
use moonmilk_lab::profile::{Measured, compare};
use moonmilk_lab::tabulate::{Node, node};
use moonmilk_optics::profile::tabulated::grid::{self, ETAS, ROWS};
use moonmilk_optics::{OpticalProperties, profile};

/// Parts into which the walks are divided for their error.
const PARTS: u64 = 16;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let g: f64 = args.first().ok_or("tabulated_error G WALKS [SEED]")?.parse()?;
    let walks: f64 = args.get(1).ok_or("WALKS is missing")?.parse()?;
    let seed: u64 = args.get(2).map_or(Ok(1000), |s| s.parse())?;
    let etas: [f64; ETAS] =
        std::array::from_fn(
            |k| {
                if k + 1 == ETAS { grid::ETA_RANGE.1 } else { 0.5 * (grid::eta(k) + grid::eta(k + 1)) }
            },
        );
    let nodes: Vec<Node> = (0..PARTS).map(|i| node(g, &etas, walks as u64 / PARTS, seed + i)).collect();
    println!(
        "{:>8} {:>8} {:>8} {:>9} {:>8} {:>8} {:>8} rings",
        "alpha'", "alpha", "eta", "albedo %", "L1 %", "noise %", "worst %"
    );
    for alpha_prime in [0.1, 0.3, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99] {
        let alpha = alpha_prime / (1.0 - g + g * alpha_prime);
        for (lane, &eta) in etas.iter().enumerate() {
            let medium = OpticalProperties::from_albedo(1.0, alpha, g, eta)?;
            let table = profile::find("tabulated")?.build(&medium)?;
            let (m, resolved) = reweighted(&nodes, &medium, lane)?;
            let worth = compare(&m, |r| table.eval(r));
            let energy = |k: usize| m.edges[k + 1] * m.edges[k] * worth.rings[k];
            let top = (0..ROWS).map(energy).fold(0.0, f64::max);
            let bright: Vec<usize> = (0..ROWS).filter(|&k| energy(k) > 1e-5 * top).collect();
            let known: Vec<usize> =
                bright.iter().copied().filter(|&k| resolved[k] && m.rings[k].relative_error() < 0.003).collect();
            let errors = known.iter().map(|&k| worth.rings[k] / m.rings[k].mean - 1.0);
            let worst = errors.fold(0.0, |w: f64, e| if e.abs() > w.abs() { e } else { w });
            println!(
                "{alpha_prime:>8} {alpha:>8.5} {eta:>8.4} {:>+9.3} {:>8.3} {:>8.3} {:>+8.2} {} of {}",
                100.0 * (table.total() / m.albedo.mean - 1.0),
                100.0 * worth.l1,
                100.0 * worth.noise,
                100.0 * worst,
                known.len(),
                bright.len()
            );
        }
    }
    Ok(())
}

/// Returns the profile of a medium from conservative walks, and the rings whose error is that of many hits; light scattered once is exact.
fn reweighted(
    nodes: &[Node],
    medium: &OpticalProperties,
    lane: usize,
) -> Result<(Measured, Vec<bool>), Box<dyn Error>> {
    let (g, alpha) = (medium.g(), medium.alpha());
    let columns = grid::n_nodes(g);
    let once = profile::find("single")?.build(medium)?;
    // Radii of the cells in mean free paths.
    let edges: Vec<f64> = (0..=ROWS).map(|i| grid::r_edge(i + 1) / (1.0 - g)).collect();
    let mut rings = vec![Accumulator::default(); ROWS];
    let mut albedo = Accumulator::default();
    for n in nodes {
        let mut all = 0.0;
        for row in 0..grid::R_CELLS {
            let cells = &n.share[row * columns * ETAS..][..columns * ETAS];
            let sum: f64 =
                cells.iter().skip(lane).step_by(ETAS).enumerate().map(|(c, s)| s * alpha.powf(grid::n_node(c))).sum();
            all += sum;
            if (1..=ROWS).contains(&row) {
                let area = std::f64::consts::PI * (edges[row] * edges[row] - edges[row - 1] * edges[row - 1]);
                rings[row - 1].add(sum / area);
            }
        }
        albedo.add(all + once.total());
    }
    let mut m = Measured { edges, rings: Vec::new(), albedo: albedo.estimate(), unfinished: 0.0 };
    m.rings = rings.iter().map(Accumulator::estimate).collect();
    let resolved = m.rings.iter().map(|r| r.relative_error() < 0.1).collect();
    let single = compare(&m, |r| once.eval(r)).rings;
    m.rings.iter_mut().zip(single).for_each(|(r, s)| *r = Estimate { mean: r.mean + s, ..*r });
    Ok((m, resolved))
}
