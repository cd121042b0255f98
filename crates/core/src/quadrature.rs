//! Gauss-Legendre quadrature on intervals, simple and composite.

use std::num::NonZeroUsize;

use gauss_quad::legendre::GaussLegendre;

/// Nodes and weights of a quadrature rule: the integral of f is about the sum of w f(x).
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// Nodes, increasing.
    pub nodes: Vec<f64>,
    /// Weights, one per node.
    pub weights: Vec<f64>,
}

impl Rule {
    /// Returns the n-point Gauss-Legendre rule on \[a, b\]: exact for polynomials of degree 2n - 1.
    ///
    /// *Domain*: n of 0 acts as 1.
    pub fn gauss(n: usize, a: f64, b: f64) -> Self {
        let rule = GaussLegendre::new(NonZeroUsize::new(n).unwrap_or(NonZeroUsize::MIN));
        let (centre, half) = (0.5 * (a + b), 0.5 * (b - a));
        let mut pairs: Vec<(f64, f64)> =
            rule.as_node_weight_pairs().iter().map(|&(x, w)| (centre + half * x, half * w)).collect();
        pairs.sort_by(|p, q| p.0.total_cmp(&q.0));
        let (nodes, weights) = pairs.into_iter().unzip();
        Self { nodes, weights }
    }

    /// Returns the composite rule: n Gauss-Legendre points on each interval between consecutive breaks.
    ///
    /// Put a break at every kink of the integrand. *Domain*: increasing breaks.
    pub fn composite(n: usize, breaks: &[f64]) -> Self {
        let reference = Self::gauss(n, -1.0, 1.0);
        let mut rule = Self { nodes: Vec::new(), weights: Vec::new() };
        for w in breaks.windows(2) {
            let (centre, half) = (0.5 * (w[0] + w[1]), 0.5 * (w[1] - w[0]));
            rule.nodes.extend(reference.nodes.iter().map(|x| centre + half * x));
            rule.weights.extend(reference.weights.iter().map(|x| half * x));
        }
        rule
    }

    /// Returns the integral of f.
    pub fn integrate(&self, mut f: impl FnMut(f64) -> f64) -> f64 {
        self.nodes.iter().zip(&self.weights).map(|(&x, &w)| w * f(x)).sum()
    }

    /// Returns (node, weight) pairs.
    pub fn iter(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.nodes.iter().copied().zip(self.weights.iter().copied())
    }

    /// Returns the number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Returns whether the rule has no nodes.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_up_to_degree_2n_minus_1_are_exact() {
        for n in [1usize, 2, 5, 32] {
            let rule = Rule::gauss(n, -1.0, 3.0);
            for d in 0..2 * n as i32 {
                let exact = (3f64.powi(d + 1) - (-1f64).powi(d + 1)) / f64::from(d + 1);
                // Rounding of the sum.
                assert!((rule.integrate(|x| x.powi(d)) / exact - 1.0).abs() < 1e-11, "{n} {d}");
            }
        }
    }

    #[test]
    fn breaks_at_kinks_restore_the_accuracy() {
        let f = |x: f64| (x - 0.3).abs();
        let exact = 0.5 * (0.09 + 0.49);
        assert!((Rule::composite(4, &[0.0, 0.3, 1.0]).integrate(f) - exact).abs() < 1e-15);
        assert!((Rule::gauss(8, 0.0, 1.0).integrate(f) - exact).abs() > 1e-5);
    }
}
