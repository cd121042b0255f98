//! Errors of the models against Monte Carlo, pinned, so that an accidental factor shows.

use std::f64::consts::PI;

use moonmilk_core::quadrature::Rule;
use moonmilk_optics::halfspace::{Illumination, exact_albedo};
use moonmilk_optics::{OpticalProperties, profile};

/// Radii of the table in mean free paths.
const RADII: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 10.0];

#[test]
fn models_have_their_measured_errors() {
    let (mut medium, mut mc, mut rows) = (None, [0.0; 5], 0);
    for line in include_str!("data/model_errors.csv").lines().filter(|l| !l.starts_with('#')) {
        let (name, fields) = line.split_once(',').expect("a name and numbers");
        let texts: Vec<&str> = fields.split(',').collect();
        let x: Vec<f64> = texts.iter().map(|f| f.parse().expect("a number")).collect();
        if name == "medium" {
            let m = OpticalProperties::from_albedo(1.0, x[0], 0.0, x[1]).expect("valid");
            medium = Some(m);
            mc.copy_from_slice(&x[2..7]);
            continue;
        }
        let m = medium.expect("a medium first");
        let p = profile::find(name).expect("registered").build(&m).expect("valid");
        let albedo = 100.0 * (p.total() / exact_albedo(&m, Illumination::Normal).expect("valid") - 1.0);
        // One printed decimal, and the quadratures behind the table.
        assert!((albedo - x[0]).abs() < 0.1, "{name} {m:?}: albedo {albedo:+.2} %, printed {}", texts[0]);
        for (k, r) in RADII.into_iter().enumerate() {
            let (a, b) = (r / 1.05, r * 1.05);
            let mean = Rule::gauss(6, a, b).integrate(|r| 2.0 * PI * r * p.eval(r)) / (PI * (b * b - a * a));
            let error = 100.0 * (mean / mc[k] - 1.0);
            // Half of the last printed digit of the error, and that of the simulation's four digits.
            let digit = if texts[k + 1].contains('.') { 0.06 } else { 0.6 };
            assert!(
                (error - x[k + 1]).abs() < digit + 0.06 * (1.0 + x[k + 1].abs() / 100.0),
                "{name} {m:?} r = {r}: {error:+.2} %, printed {}",
                texts[k + 1]
            );
        }
        rows += 1;
    }
    assert_eq!(rows, 15 * 8);
}
