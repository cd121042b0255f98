//! Errors of the models against Monte Carlo, pinned, so that an accidental factor shows.

use std::f64::consts::PI;

use moonmilk_core::quadrature::Rule;
use moonmilk_optics::halfspace::{Illumination, exact_albedo};
use moonmilk_optics::profile::published_errors::{RADII, table};
use moonmilk_optics::{OpticalProperties, profile};

#[test]
fn models_have_their_measured_errors() {
    let mut rows = 0;
    for medium in table() {
        let m = OpticalProperties::from_albedo(1.0, medium.alpha, 0.0, medium.eta).expect("valid");
        for model in &medium.models {
            let p = profile::find(model.name).expect("registered").build(&m).expect("valid");
            let albedo = 100.0 * (p.total() / exact_albedo(&m, Illumination::Normal).expect("valid") - 1.0);
            // One printed decimal, and the quadratures behind the table.
            let printed = model.albedo.value;
            assert!((albedo - printed).abs() < 0.1, "{} {m:?}: albedo {albedo:+.2} %, printed {printed}", model.name);
            for (k, r) in RADII.into_iter().enumerate() {
                let Some(printed) = model.rings[k] else { continue };
                let (a, b) = (r / 1.05, r * 1.05);
                let mean = Rule::gauss(6, a, b).integrate(|r| 2.0 * PI * r * p.eval(r)) / (PI * (b * b - a * a));
                let error = 100.0 * (mean / medium.rings[k].value - 1.0);
                // Half of the last printed digit of the error, and that of the simulation's four digits.
                let tolerance = 1.2 * printed.half_digit + 0.06 * (1.0 + printed.value.abs() / 100.0);
                assert!(
                    (error - printed.value).abs() < tolerance,
                    "{} {m:?} r = {r}: {error:+.2} %, printed {}",
                    model.name,
                    printed.value
                );
            }
            rows += 1;
        }
    }
    assert_eq!(rows, 15 * 8 + 10);
}
