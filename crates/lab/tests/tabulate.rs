//! The generator of exact tables against exact albedos.

use moonmilk_core::estimate::Accumulator;
use moonmilk_lab::tabulate::node;
use moonmilk_optics::halfspace::{Anisotropic, Illumination};
use moonmilk_optics::profile::tabulated::grid::{ETAS, etas, n_node};
use moonmilk_optics::{OpticalProperties, profile};

#[test]
fn reweighted_conservative_walks_have_the_exact_albedos() {
    for (g, walks) in [(0.0, 30_000), (0.85, 30_000)] {
        let nodes: Vec<_> = (0..24).map(|seed| node(g, &etas(), walks, seed)).collect();
        for lane in [0, 4, ETAS - 1] {
            let eta = etas()[lane];
            let mut whole = Accumulator::default();
            for n in &nodes {
                whole.add(n.share.iter().skip(lane).step_by(ETAS).sum::<f64>() + n.rest[lane]);
            }
            let once = |alpha| {
                let medium = OpticalProperties::from_albedo(1.0, alpha, g, eta).expect("valid");
                profile::find("single").expect("registered").build(&medium).expect("valid").total()
            };
            // Student's t with 23 degrees of freedom, 24 comparisons: 6.5 is 1e-6 each.
            let w = whole.estimate();
            assert!(w.z(1.0 - once(1.0)).abs() < 6.5, "light is neither lost nor gained: {g} {eta} {w}");
            for alpha in [0.6f64, 0.9, 0.98] {
                let mut albedo = Accumulator::default();
                for n in &nodes {
                    let cells = n.share.iter().skip(lane).step_by(ETAS).enumerate();
                    let columns = n.share.len() / ETAS / moonmilk_optics::profile::tabulated::grid::R_CELLS;
                    albedo.add(cells.map(|(i, s)| s * alpha.powf(n_node(i % columns))).sum());
                }
                let half = Anisotropic::new(g, eta, Illumination::Normal).expect("valid");
                let exact = half.albedo(alpha).expect("valid") - once(alpha);
                let a = albedo.estimate();
                // Interpolation between numbers of collisions: 1e-4.
                assert!((a.mean - exact).abs() < 6.5 * a.std_err + 1e-4 * exact, "{g} {eta} {alpha}: {a} {exact}");
                assert!(a.relative_error() < 0.02, "{g} {eta} {alpha}: {a}");
            }
        }
    }
}
