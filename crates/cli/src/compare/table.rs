//! The findings as a table for a terminal.

use std::fmt::Write;

use super::measure::{Findings, rms, rms_error, three_digits};

fn percent(x: Option<f64>) -> String {
    x.filter(|x| x.is_finite()).map_or_else(|| "-".into(), |x| format!("{:+.1} %", 100.0 * x))
}

/// Returns the findings in a hundred columns.
pub fn text(f: &Findings) -> String {
    let mut out = String::new();
    let mut line = |s: String| writeln!(out, "{s}").expect("a string takes everything");
    let pixels = if f.object_pixels > 0 {
        format!("{} pixels of translucent bodies", f.object_pixels)
    } else {
        "all pixels".into()
    };
    line(format!("{}, {} a picture, against {}, over {pixels}", f.scene, f.budget, f.exact.name));
    line(format!(
        "{:24} {:>16} {:>15} {:>7} {:>8} {:>6} {:>7} {:>7}",
        "model", "energy", "error (bias)", "noise", "relMSE", "FLIP", "spp", "speed"
    ));
    for m in &f.models {
        let o = &m.object;
        line(format!(
            "{:24} {:>+7.2} +- {:.2} % {:>6.2} +- {:.2} % {:>5.1} % {:>8} {:>6.3} {:>7} {:>6}x",
            m.name,
            100.0 * (o.ratio.mean - 1.0),
            100.0 * o.ratio.std_err,
            100.0 * rms(o.bias2.mean),
            100.0 * rms_error(&o.bias2),
            100.0 * rms(o.variance.mean),
            three_digits(o.total.mean),
            m.flip,
            m.cost.spp,
            three_digits(m.speed)
        ));
    }
    let e = &f.exact;
    line(format!(
        "{:24} {:>16} {:>15} {:>5.1} % {:>8} {:>6} {:>7} {:>6}x",
        format!("{} (exact)", e.name),
        "0",
        "0",
        100.0 * rms(e.variance.mean),
        three_digits(e.variance.mean),
        "-",
        e.cost.spp,
        1
    ));
    if e.at_equal.is_finite() {
        line(format!(
            "{} with a model's budget: noise {:.1} %, relMSE {}",
            e.name,
            100.0 * rms(e.at_equal),
            three_digits(e.at_equal)
        ));
    }
    line(String::new());
    line(format!(
        "{:24} {:>22} {:>11} {:>10} {:>22}",
        "where it comes from", "profile: L1, energy", "geometry", "remaining", "pictures: p, g"
    ));
    let planar = f.planar();
    for m in &f.models {
        let b = m.budget(planar);
        line(format!(
            "{:24} {:>11} {:>10} {:>11} {:>10} {:>11} {:>10}",
            m.name,
            percent(b.profile_l1).trim_start_matches('+'),
            percent(b.profile_energy),
            percent(b.geometry_energy),
            percent(b.remaining_energy),
            percent(b.profile_rms).trim_start_matches('+'),
            percent(b.geometry_rms).trim_start_matches('+'),
        ));
    }
    line(String::new());
    for m in &f.models {
        line(format!("{}: {}", m.name, m.verdict()));
    }
    out.push_str(
        "\nenergy: mean over that of the exact picture. error, noise: relative root mean squares of bias and noise; relMSE = bias^2 + noise^2.\n\
         speed: time of the exact picture over the model's at equal noise. (1 + profile) (1 + geometry) (1 + remaining) = energy ratio.\n\
         pictures: root mean square difference from the picture by tabulated (p), and of that from the exact one (g).",
    );
    out
}
