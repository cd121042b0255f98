//! The exact profile `tabulated` against independent walks between the nodes of its table.

use moonmilk_lab::profile::{HalfSpace, compare, measure};
use moonmilk_optics::{OpticalProperties, profile};

/// (alpha', g, eta) between the nodes, thousands of paths.
const CASES: [(f64, f64, f64, u64); 8] = [
    (0.30, 0.28, 1.24, 400),
    (0.80, -0.42, 1.75, 300),
    (0.80, 0.57, 1.08, 200),
    (0.95, 0.05, 1.33, 200),
    (0.95, 0.91, 1.44, 60),
    (0.99, 0.75, 1.90, 40),
    (0.999, 0.30, 1.50, 40),
    (0.60, 0.93, 1.40, 100),
];

/// Largest error of a ring's mean that is granted to the table, of which it promises 1 %.
const POINTWISE: f64 = 0.01;
/// Largest error of the albedo that is granted to the table.
const TOTAL: f64 = 0.001;

#[test]
fn the_table_agrees_with_walks_between_its_nodes() {
    // MOONMILK_SLOW=k takes 20 k times the paths.
    let more = std::env::var("MOONMILK_SLOW").ok().map_or(1, |k| 20 * k.parse().unwrap_or(1).max(1));
    for (i, (alpha_prime, g, eta, thousands)) in CASES.into_iter().enumerate() {
        let alpha = alpha_prime / (1.0 - g + g * alpha_prime);
        let medium = HalfSpace { sigma_a: 1.0 - alpha, sigma_s: alpha, g, eta };
        let m = measure(&medium, 60.0, thousands * 1000 * more, 71 + i as u64).expect("valid");
        let p = OpticalProperties::new(medium.sigma_a, medium.sigma_s, g, eta).expect("valid");
        let table = profile::find("tabulated").expect("registered").build(&p).expect("within the table");
        let worth = compare(&m, |r| table.eval(r));
        // Rings whose r^2 R is above 1e-5 of the largest and that have enough paths for an error.
        let energy = |k: usize| m.edges[k + 1] * m.edges[k] * worth.rings[k];
        let top = (0..m.rings.len()).map(energy).fold(0.0, f64::max);
        let (mut chi2, mut rings) = (0.0, 0);
        for (k, (&model, ring)) in worth.rings.iter().zip(&m.rings).enumerate() {
            // Not a number where nothing arrived.
            let known = ring.relative_error() < 0.1;
            if energy(k) < 1e-5 * top || !known {
                continue;
            }
            let error = model / ring.mean - 1.0;
            let z = error / ring.relative_error();
            chi2 += z * z;
            rings += 1;
            // Student's t with 63 degrees of freedom over some 300 rings: 6 is 1e-7 each. Errors of poor rings are skewed, which their limit of a tenth bounds.
            assert!(
                error.abs() < POINTWISE + 6.0 * ring.relative_error(),
                "alpha' {alpha_prime} g {g} eta {eta} r {}: {error:+.4} +- {:.4}",
                m.edges[k],
                ring.relative_error()
            );
        }
        let albedo = table.total() / m.albedo.mean - 1.0;
        println!(
            "alpha' {alpha_prime} g {g} eta {eta}: albedo {:+.3} +- {:.3} %, L1 {:.3} % of which noise {:.3} %, chi2 {:.2} of {rings}",
            100.0 * albedo,
            100.0 * m.albedo.relative_error(),
            100.0 * worth.l1,
            100.0 * worth.noise,
            chi2 / f64::from(rings),
        );
        assert!(albedo.abs() < TOTAL + 5.0 * m.albedo.relative_error(), "{alpha_prime} {g} {eta}: {albedo:e}");
        // The mean of |table - walks| is at most the table's error and the noise, which varies by a tenth with so many rings.
        assert!(worth.l1 < 0.003 + 1.5 * worth.noise, "{alpha_prime} {g} {eta}: {} {}", worth.l1, worth.noise);
        assert!(rings > 15);
    }
}
