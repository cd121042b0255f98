//! The axes of the table behind [`super`]: relative index, asymmetry, radius, number of collisions.

use std::f64::consts::PI;

/// Number of relative indices.
pub const ETAS: usize = 8;
/// Number of asymmetries.
pub const GS: usize = 12;
/// Least and largest relative index.
pub const ETA_RANGE: (f64, f64) = (1.0, 2.0);
/// Least and largest asymmetry.
pub const G_RANGE: (f64, f64) = (-0.5, 0.95);
/// Cells of the radius per octave.
pub const R_PER_OCTAVE: usize = 4;
/// Exponent of the first edge: 2^-11 transport mean free paths.
pub const R_FIRST: i32 = -11;
/// Octaves of the radius; the last edge is 2^8 transport mean free paths.
pub const R_OCTAVES: usize = 19;
/// Cells of the radius in a simulation: one below the first edge, the octaves, and one beyond the last edge.
pub const R_CELLS: usize = R_OCTAVES * R_PER_OCTAVE + 2;
/// Cells of the radius in the table: the octaves.
pub const ROWS: usize = R_OCTAVES * R_PER_OCTAVE;
/// Number of asymmetries, indices and absorptions of the exact totals.
pub const TOTALS: [usize; 3] = [16, 12, 20];
/// The last of the numbers of collisions that are nodes one by one; the first is 2.
pub const N_SINGLE: u32 = 16;
/// Nodes of the number of collisions per octave beyond.
pub const N_PER_OCTAVE: u32 = 8;
/// Number of collisions after which diffusion takes over, times 1 - g.
pub const N_LAST: f64 = 2048.0;

/// Returns where a relative index lies among the nodes: 1 - 1 / eta^2, the squared critical cosine.
pub fn eta_coordinate(eta: f64) -> f64 {
    (1.0 - 1.0 / eta) * (1.0 + 1.0 / eta)
}

/// Returns where an asymmetry lies among the nodes: artanh g, which has both ends of what a phase function does, 1 - g and 1 + g.
pub fn g_coordinate(g: f64) -> f64 {
    g.atanh()
}

/// Returns the i-th of n Chebyshev-Lobatto nodes between two ends.
fn lobatto(i: usize, n: usize, ends: (f64, f64)) -> f64 {
    // From the nearer end, so that both ends are exact.
    let t = PI * i as f64 / (n - 1) as f64;
    if 2 * i < n {
        ends.0 + 0.5 * (1.0 - t.cos()) * (ends.1 - ends.0)
    } else {
        ends.1 - 0.5 * (1.0 + t.cos()) * (ends.1 - ends.0)
    }
}

/// Returns the asymmetry of node i of the totals.
pub fn total_g(i: usize) -> f64 {
    lobatto(i, TOTALS[0], (g_coordinate(G_RANGE.0), g_coordinate(G_RANGE.1))).tanh()
}

/// Returns the relative index of node i of the totals.
pub fn total_eta(i: usize) -> f64 {
    1.0 / (1.0 - lobatto(i, TOTALS[1], (eta_coordinate(ETA_RANGE.0), eta_coordinate(ETA_RANGE.1)))).sqrt()
}

/// Returns s = sqrt(1 - alpha') of node i of the totals: Chebyshev-Gauss nodes of (0, 1).
pub fn total_s(i: usize) -> f64 {
    let half = 0.5 * PI * (i as f64 + 0.5) / TOTALS[2] as f64;
    half.sin() * half.sin()
}

/// Returns the weights of the polynomials through the nodes of the totals, for asymmetry, index and s.
pub fn total_weights(g: f64, eta: f64, s: f64) -> ([f64; TOTALS[0]], [f64; TOTALS[1]], [f64; TOTALS[2]]) {
    let by_g = weights(g_coordinate(g), (g_coordinate(G_RANGE.0), g_coordinate(G_RANGE.1)));
    let by_eta = weights(eta_coordinate(eta), (eta_coordinate(ETA_RANGE.0), eta_coordinate(ETA_RANGE.1)));
    let mut by_s = [0.0; TOTALS[2]];
    let mut sum = 0.0;
    for (i, weight) in by_s.iter_mut().enumerate() {
        let d = s - total_s(i);
        if d.abs() < 1e-14 {
            by_s = [0.0; TOTALS[2]];
            by_s[i] = 1.0;
            return (by_g, by_eta, by_s);
        }
        // Barycentric form for these nodes: alternating sines.
        let sine = (PI * (i as f64 + 0.5) / TOTALS[2] as f64).sin();
        *weight = if i % 2 == 0 { sine } else { -sine } / d;
        sum += *weight;
    }
    (by_g, by_eta, by_s.map(|w| w / sum))
}

/// Returns the bits that stand for a share: a sign and 15 bits of the logarithm, 512 steps per octave, down to 2^-63.99.
pub fn pack(x: f64) -> u16 {
    let steps = (-512.0 * x.abs().log2()).round();
    if steps >= 32767.0 {
        return 0;
    }
    let magnitude = steps.max(0.0) as u16 + 1;
    if x < 0.0 { magnitude | 0x8000 } else { magnitude }
}

/// Returns the share that bits stand for; `powers` are those of 2^(-1/512) from 0 to 511.
pub fn unpack(bits: u16, powers: &[f32; 512]) -> f32 {
    let magnitude = bits & 0x7FFF;
    if magnitude == 0 {
        return 0.0;
    }
    let steps = magnitude - 1;
    // Halve by the exponent.
    let x = powers[usize::from(steps % 512)] * f32::from_bits((127 - u32::from(steps / 512)) << 23);
    if bits & 0x8000 == 0 { x } else { -x }
}

/// Returns the powers of 2^(-1/512) that [`unpack`] needs.
pub fn powers() -> [f32; 512] {
    std::array::from_fn(|k| (-(k as f32) / 512.0).exp2())
}

/// Returns the relative index of node i, increasing: Chebyshev-Lobatto nodes in [`eta_coordinate`].
pub fn eta(i: usize) -> f64 {
    let w = lobatto(i, ETAS, (eta_coordinate(ETA_RANGE.0), eta_coordinate(ETA_RANGE.1)));
    1.0 / (1.0 - w).sqrt()
}

/// Returns the relative indices of all nodes.
pub fn etas() -> [f64; ETAS] {
    std::array::from_fn(eta)
}

/// Returns the asymmetry of node i, increasing: Chebyshev-Lobatto nodes in [`g_coordinate`].
pub fn g(i: usize) -> f64 {
    lobatto(i, GS, (g_coordinate(G_RANGE.0), g_coordinate(G_RANGE.1))).tanh()
}

/// Returns the weights of the polynomial through n Chebyshev-Lobatto nodes between two ends, at a point between them.
pub fn weights<const N: usize>(x: f64, ends: (f64, f64)) -> [f64; N] {
    let mut weights = [0.0; N];
    let mut sum = 0.0;
    for (i, weight) in weights.iter_mut().enumerate() {
        let d = x - lobatto(i, N, ends);
        if d.abs() < 1e-14 * (ends.1 - ends.0) {
            let mut exact = [0.0; N];
            exact[i] = 1.0;
            return exact;
        }
        // Barycentric form: alternating signs, half weight at the ends.
        let half = if i == 0 || i == N - 1 { 0.5 } else { 1.0 };
        *weight = if i % 2 == 0 { half } else { -half } / d;
        sum += *weight;
    }
    weights.map(|w| w / sum)
}

/// Returns the polynomial's weights for a relative index in [`ETA_RANGE`].
pub fn eta_weights(eta: f64) -> [f64; ETAS] {
    weights(eta_coordinate(eta), (eta_coordinate(ETA_RANGE.0), eta_coordinate(ETA_RANGE.1)))
}

/// Returns the polynomial's weights for an asymmetry in [`G_RANGE`].
pub fn g_weights(g: f64) -> [f64; GS] {
    weights(g_coordinate(g), (g_coordinate(G_RANGE.0), g_coordinate(G_RANGE.1)))
}

/// Returns the largest number of collisions that is simulated for an asymmetry.
pub fn n_last(g: f64) -> u32 {
    (N_LAST / (1.0 - g)) as u32
}

/// Returns the number of nodes of the number of collisions for an asymmetry.
pub fn n_nodes(g: f64) -> usize {
    let octaves = (f64::from(n_last(g)) / f64::from(N_SINGLE)).log2();
    N_SINGLE as usize - 1 + (octaves * f64::from(N_PER_OCTAVE)).ceil() as usize
}

/// Returns the number of collisions of node i: 2, 3, ... 16, then eight per octave.
pub fn n_node(i: usize) -> f64 {
    let single = N_SINGLE as usize - 2;
    if i <= single {
        return i as f64 + 2.0;
    }
    f64::from(N_SINGLE) * ((i - single) as f64 / f64::from(N_PER_OCTAVE)).exp2()
}

/// Returns the first of four nodes among `nodes`, and the weights with which a function of the number of collisions at them makes its value at n.
///
/// The cubic through the two nodes on either side; n = 2 ... 16 are nodes themselves. *Domain*: n >= 2.
pub fn n_weights(n: u32, nodes: usize) -> (usize, [f64; 4]) {
    let x = f64::from(n);
    let below = if n <= N_SINGLE {
        n as usize - 2
    } else {
        N_SINGLE as usize - 2 + ((x / f64::from(N_SINGLE)).log2() * f64::from(N_PER_OCTAVE)) as usize
    };
    let first = below.saturating_sub(1).min(nodes - 4);
    let at: [f64; 4] = std::array::from_fn(|k| n_node(first + k));
    let weights = std::array::from_fn(|k| (0..4).filter(|&j| j != k).map(|j| (x - at[j]) / (at[k] - at[j])).product());
    (first, weights)
}

/// Returns the inner edge of cell `row` of the radius, in transport mean free paths; cell 0 begins at 0.
pub fn r_edge(row: usize) -> f64 {
    if row == 0 { 0.0 } else { (f64::from(R_FIRST) + (row - 1) as f64 / R_PER_OCTAVE as f64).exp2() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_increase_and_end_where_the_domain_ends() {
        assert!(eta(0) == 1.0 && (eta(ETAS - 1) - 2.0).abs() < 1e-15);
        assert!((g(0) + 0.5).abs() < 1e-15 && (g(GS - 1) - 0.95).abs() < 1e-15);
        assert!((1..ETAS).all(|i| eta(i) > eta(i - 1)) && (1..GS).all(|i| g(i) > g(i - 1)));
        assert!((1..200).all(|i| n_node(i) > n_node(i - 1)));
        for i in 0..GS {
            let nodes = n_nodes(g(i));
            assert!(n_node(nodes - 1) >= f64::from(n_last(g(i))) && n_node(nodes - 2) < f64::from(n_last(g(i))));
        }
    }

    #[test]
    fn shares_are_packed_to_a_thousandth() {
        let powers = powers();
        for i in 0..10_000 {
            let x = (-f64::from(i) * 0.0044).exp();
            for x in [x, -x] {
                // Half a step of 2^(1/512).
                assert!((f64::from(unpack(pack(x), &powers)) / x - 1.0).abs() < 7e-4, "{x:e}");
            }
        }
        assert!(unpack(pack(0.0), &powers) == 0.0 && unpack(pack(1e-30), &powers) == 0.0);
    }

    #[test]
    fn polynomials_are_met_between_the_nodes() {
        for x in [1.0, 1.2, 1.9, 2.0] {
            let w = eta_weights(x);
            let f = |eta: f64| eta_coordinate(eta).powi(7) - 2.0 * eta_coordinate(eta);
            let sum: f64 = (0..ETAS).map(|i| w[i] * f(eta(i))).sum();
            assert!((sum - f(x)).abs() < 1e-13);
        }
        for x in [-0.5, 0.0, 0.3, 0.95] {
            let w = g_weights(x);
            let f = |g: f64| g_coordinate(g).powi(11) - g_coordinate(g);
            let sum: f64 = (0..GS).map(|i| w[i] * f(g(i))).sum();
            assert!((sum - f(x)).abs() < 1e-10 * f(0.95));
        }
        let (g, eta, s) = total_weights(0.3, 1.37, 0.21);
        let f =
            |g: f64, eta: f64, s: f64| g_coordinate(g).powi(5) * eta_coordinate(eta).powi(3) * (s.powi(9) - 2.0 * s);
        let mut sum = 0.0;
        for (i, a) in g.iter().enumerate() {
            for (j, b) in eta.iter().enumerate() {
                sum += (0..TOTALS[2]).map(|k| a * b * s[k] * f(total_g(i), total_eta(j), total_s(k))).sum::<f64>();
            }
        }
        assert!((sum - f(0.3, 1.37, 0.21)).abs() < 1e-13, "{sum}");
    }

    #[test]
    fn powers_of_the_albedo_are_met_between_the_numbers_of_collisions() {
        // Where alpha^n matters, above e^-5, the cubic is good to 1e-3 of it.
        for alpha in [0.3f64, 0.8, 0.95, 0.999] {
            for n in 2..2000u32 {
                let exact = alpha.powi(n as i32);
                if exact < (-5f64).exp() {
                    break;
                }
                let (first, w) = n_weights(n, n_nodes(0.0));
                let value: f64 = (0..4).map(|k| w[k] * alpha.powf(n_node(first + k))).sum();
                assert!((value / exact - 1.0).abs() < 1e-3, "{alpha} {n} {}", value / exact - 1.0);
            }
        }
    }
}
