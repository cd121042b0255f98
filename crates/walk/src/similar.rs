//! The scatterers that are similar in the third order: fewer collisions, less forward, with nearly the same radiance.
//!
//! $$ \sigma_s^* = a \sigma_s, \qquad \sigma_s^* (1 - f_n^*) = \sigma_s (1 - g^n), \qquad n = 1, 2, 3, \qquad \sigma_a^* = \sigma_a . $$
//!
//! The law is the smoothest with these moments, that of greatest entropy ([`moonmilk_optics::similarity`]), as a table. The smaller a, the fewer collisions;
//! below a least ratio no law exists, and near it the law is a spike. a is 6/5 of that ratio: 1 at g = 0, .40 at .8, .225 at .9, 2.6 (1 - g) in the limit,
//! so that isotropic media stay what they are and the law's shape hardly depends on g.

use moonmilk_optics::similarity::{MaximumEntropy, least_ratio_3};

use crate::medium::Medium;
use crate::phase::PhaseFunction;
use crate::tabulated::{CELLS, Tabulated};

/// sigma_s* / sigma_s over the least ratio.
const MARGIN: f64 = 1.2;

/// Scatterers that are similar in the third order to those of Henyey and Greenstein.
#[derive(Clone, Debug, PartialEq)]
pub struct Similar {
    /// Asymmetry of the scatterers that they stand for.
    pub g: f32,
    /// sigma_s* / sigma_s.
    pub a: f32,
    /// Their law.
    pub law: Tabulated,
}

impl Similar {
    /// Returns the scatterers that are similar to those of asymmetry g; `None` for g <= 0, where there is nothing to gain.
    ///
    /// *Domain*: g < 1. *Accuracy*: moments to 1e-6 (single precision).
    pub fn new(g: f32) -> Option<Self> {
        let exact = f64::from(g);
        if exact <= 0.0 {
            return None;
        }
        let a = (MARGIN * least_ratio_3(exact)).min(1.0);
        let law = MaximumEntropy::similar(&[exact, exact.powi(2), exact.powi(3)], a)
            .expect("moments well within those of positive functions");
        let values = law.linear(CELLS);
        Some(Self { g, a: a as f32, law: Tabulated::new(&std::array::from_fn(|i| values[i])) })
    }

    /// Returns a medium with these scatterers in place of its own, but for their law: that of Henyey and Greenstein with the same mean cosine stands in
    /// until [`Medium::under`].
    pub fn coefficients<const N: usize>(&self, medium: &Medium<N>) -> Medium<N> {
        Medium::new(medium.sigma_a, medium.sigma_s * self.a, self.law.mean_cosine()).with_emission(medium.emission)
    }
}

#[cfg(test)]
mod tests {
    use moonmilk_core::Spectrum;
    use moonmilk_core::quadrature::Rule;

    use super::*;

    #[test]
    fn three_orders_of_scattering_are_kept() {
        let breaks: Vec<f64> = (0..=CELLS).map(|i| 2.0 * i as f64 / CELLS as f64 - 1.0).collect();
        let rule = Rule::composite(3, &breaks);
        for g in [1e-6f32, 0.1, 0.5, 0.8, 0.9, 0.99, 0.9999] {
            let s = Similar::new(g).unwrap();
            let medium = Medium::<1>::new(Spectrum([0.1]), Spectrum([3.0]), g);
            let thin = s.coefficients(&medium);
            assert_eq!(thin.sigma_a, medium.sigma_a);
            let altered = thin.under(&s.law);
            let legendre = |x: f64| [1.0, x, 1.5 * x * x - 0.5, 2.5 * x * x * x - 1.5 * x];
            for n in 0..=3 {
                let f =
                    rule.integrate(|x| std::f64::consts::TAU * f64::from(altered.law.eval(x as f32)) * legendre(x)[n]);
                let [kept, had] = [f64::from(thin.sigma_s[0]) * (1.0 - f), 3.0 * (1.0 - f64::from(g).powi(n as i32))];
                // Single precision of coefficient and table.
                assert!((kept - had).abs() < 1e-6 * f64::from(thin.sigma_s[0]), "g {g}, order {n}: {kept} {had}");
            }
            println!("g {g}: {:.4} of the collisions", s.a);
        }
        // What the documentation says of a.
        let a = |g: f32| Similar::new(g).unwrap().a;
        assert!((a(1e-6) - 1.0).abs() < 1e-5 && (a(0.8) - 0.397).abs() < 5e-4 && (a(0.9) - 0.2252).abs() < 1e-4);
        assert!(Similar::new(0.0).is_none() && Similar::new(-0.5).is_none());
    }
}
