//! The generator of exact tables against exact albedos.

use moonmilk_core::estimate::Accumulator;
use moonmilk_lab::tabulate::grid::{R_CELLS, n_cells, n_end};
use moonmilk_lab::tabulate::node;

#[test]
fn reweighted_conservative_walks_have_the_exact_albedos() {
    // (alpha, eta, albedo): exact solution for isotropic scattering. Numbers of collisions beyond 16 lie in cells of ratio 1.09, whose mean is that of
    // their ends; what that is off by is below 1e-4 of the albedo.
    for (alpha, eta, exact) in [(0.8f64, 1.0, 0.285255), (0.95, 1.33, 0.395918), (0.99, 1.5, 0.585397)] {
        let columns = n_cells(0.0);
        let (mut albedo, mut whole) = (Accumulator::default(), Accumulator::default());
        for seed in 0..24 {
            let n = node(eta, 0.0, 8192, seed);
            let weight = |c: usize| {
                let (a, b) = (if c == 0 { 1 } else { n_end(c - 1) + 1 }, n_end(c));
                // The mean of alpha^N under N^(-3/2).
                let (sum, norm) = (a..=b).fold((0.0, 0.0), |(s, w), k| {
                    let p = f64::from(k).powf(-1.5);
                    (s + p * alpha.powi(k as i32), w + p)
                });
                sum / norm
            };
            let sum: f64 = (0..R_CELLS * columns).map(|i| n.share[i] * weight(i % columns)).sum();
            albedo.add(sum);
            whole.add(n.share.iter().sum::<f64>() + n.rest);
        }
        // Student's t with 23 degrees of freedom, six comparisons: 5.8 is 1e-5 each.
        let (a, w) = (albedo.estimate(), whole.estimate());
        assert!(
            (a.mean - exact).abs() < 5.8 * a.std_err + 1e-4 * exact,
            "alpha {alpha}, eta {eta}: {a} against {exact}"
        );
        assert!(w.z(1.0).abs() < 5.8, "light is neither lost nor gained: {w}");
        assert!(a.relative_error() < 0.01);
    }
}
