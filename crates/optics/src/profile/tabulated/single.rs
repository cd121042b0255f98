//! Light scattered once, fast for many radii of one medium: [`super::super::single`] by the angle at the surface.

use std::f64::consts::FRAC_PI_2;
use std::sync::LazyLock;

use moonmilk_core::quadrature::Rule;

use super::super::single::{henyey_greenstein, transmitted};

/// Nodes of v in (0, 1), graded towards 0, where radii far below the mean free path are decided.
static RULE: LazyLock<Rule> = LazyLock::new(|| {
    let mut breaks = vec![0.0];
    breaks.extend((0..9).map(|k| 4f64.powi(k - 8)));
    Rule::composite(8, &breaks)
});

/// alpha / r times the integral of e^(-r cot(theta / 2)) p(-cos theta) (1 - F) cos theta over the angles that are let out, in mean free paths.
pub(super) struct Once {
    /// cot(theta / 2) and everything else at the nodes.
    terms: Vec<[f64; 2]>,
}

impl Once {
    /// Prepares a medium. *Domain*: eta >= 1.
    pub(super) fn new(alpha: f64, g: f64, eta: f64) -> Self {
        let critical = if eta > 1.0 { (1.0 / eta).asin() } else { FRAC_PI_2 };
        // Between the grading at 0 and the root of the transmitted share at the critical angle: theta = critical v (2 - v).
        let terms = RULE
            .iter()
            .map(|(v, w)| {
                let theta = critical * v * (2.0 - v);
                let jacobian = 2.0 * critical * (1.0 - v);
                let cos = theta.cos();
                let value = alpha * henyey_greenstein(-cos, g) * transmitted(cos, eta) * cos;
                [1.0 / (0.5 * theta).tan(), w * jacobian * value]
            })
            .collect();
        Self { terms }
    }

    /// Returns R_1(r) in inverse squared mean free paths. *Accuracy*: 1e-5 from 1e-5 to 3 mean free paths (test); beyond, it is less than 1e-5 of its value there.
    pub(super) fn eval(&self, r: f64) -> f64 {
        self.terms.iter().map(|[c, f]| f * (-r * c).exp()).sum::<f64>() / r
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OpticalProperties;
    use crate::profile::RadialModel;
    use crate::profile::single::Single;

    #[test]
    fn both_quadratures_agree() {
        for (g, eta) in [(0.0, 1.0), (-0.5, 1.3), (0.8, 1.5), (0.95, 2.0), (0.3, 1.01)] {
            let medium = OpticalProperties::from_albedo(1.0, 0.7, g, eta).unwrap();
            let (a, b) = (Single::new(&medium).unwrap(), Once::new(0.7, g, eta));
            for r in [1e-5, 1e-3, 0.03, 0.3, 1.0, 3.0] {
                let (x, y): (f64, f64) = (a.eval(r), b.eval(r));
                assert!((x / y - 1.0).abs() < 1e-5, "{g} {eta} {r}: {x:e} {y:e}");
            }
        }
    }
}
