//! The shipped form of the table: 16 bits per share, and the exact totals.

use moonmilk_optics::halfspace::{Anisotropic, Illumination};
use moonmilk_optics::profile::tabulated::grid::{self, ETAS, GS, ROWS, TOTALS};
use rayon::prelude::*;

use super::Node;

/// Returns the bytes of the table: per asymmetry the rest by index and the shares by ring, number of collisions and index; then [`totals`].
///
/// *Domain*: one node for each asymmetry of the grid, in its order.
pub fn table(nodes: &[Node], totals: &[f64]) -> Vec<u8> {
    assert!(nodes.len() == GS && totals.len() == TOTALS.iter().product::<usize>(), "all of the grid");
    let mut bytes = Vec::new();
    for node in nodes {
        node.rest.iter().for_each(|&r| bytes.extend((r as f32).to_le_bytes()));
        // The innermost and the outermost cell are left out.
        let row = grid::n_nodes(node.g) * ETAS;
        for share in &node.share[row..row * (ROWS + 1)] {
            bytes.extend(grid::pack(*share).to_le_bytes());
        }
    }
    totals.iter().for_each(|&y| bytes.extend((y as f32).to_le_bytes()));
    bytes
}

/// Returns ln(A s / ((1 - A)(1 - s))) of the exact albedo A for normal incidence, by asymmetry, index and s = sqrt(1 - alpha').
pub fn totals() -> Vec<f64> {
    let [gs, etas, ss] = TOTALS;
    (0..gs * etas)
        .into_par_iter()
        .flat_map_iter(|i| {
            let (g, eta) = (grid::total_g(i / etas), grid::total_eta(i % etas));
            let operator = Anisotropic::new(g, eta, Illumination::Normal).expect("within the domain");
            (0..ss).map(move |k| {
                let s = grid::total_s(k);
                let alpha = (1.0 - s) * (1.0 + s) / (1.0 - g * s * s);
                let a = operator.albedo(alpha).expect("within the domain");
                (a / (1.0 - a) * s / (1.0 - s)).ln()
            })
        })
        .collect()
}
