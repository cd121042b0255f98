//! The axes of the table behind `tabulated`.

/// Relative indices of the nodes; interpolation runs over 1 / eta^2, which dominates the transmission from inside.
pub const ETA: [f64; 6] = [1.0, 1.1, 1.22, 1.4, 1.65, 2.0];
/// Asymmetries of the nodes; interpolation runs over ln(1 - g).
pub const G: [f64; 6] = [-0.5, 0.0, 0.5, 0.75, 0.89, 0.95];
/// Cells of the radius per octave.
pub const R_PER_OCTAVE: usize = 4;
/// Exponent of the smallest edge: 2^-11 transport mean free paths.
pub const R_FIRST: i32 = -11;
/// Octaves of the radius; the last edge is 2^8 transport mean free paths.
pub const R_OCTAVES: usize = 19;
/// Cells of the radius: one below the first edge, then the octaves.
pub const R_CELLS: usize = 1 + R_OCTAVES * R_PER_OCTAVE;
/// Collisions counted one by one; beyond, there are [`N_PER_OCTAVE`] cells per octave.
pub const N_SINGLE: u32 = 16;
/// Cells of the number of collisions per octave.
pub const N_PER_OCTAVE: u32 = 8;
/// Collisions after which diffusion takes over, in transport mean free paths.
pub const N_LAST: f64 = 2048.0;

/// Returns the number of cells of the number of collisions for an asymmetry.
pub fn n_cells(g: f64) -> usize {
    let octaves = (N_LAST / (1.0 - g) / f64::from(N_SINGLE)).log2();
    N_SINGLE as usize + (octaves * f64::from(N_PER_OCTAVE)).ceil() as usize
}

/// Returns the largest number of collisions that a cell holds; the first cell holds 1.
pub fn n_end(cell: usize) -> u32 {
    if cell < N_SINGLE as usize {
        return cell as u32 + 1;
    }
    let k = (cell + 1 - N_SINGLE as usize) as f64 / f64::from(N_PER_OCTAVE);
    (f64::from(N_SINGLE) * k.exp2()).floor() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_of_collisions_follow_one_another() {
        for g in G {
            let ends: Vec<u32> = (0..n_cells(g)).map(n_end).collect();
            assert!(ends.windows(2).all(|w| w[0] < w[1]) && ends[0] == 1);
            assert!(f64::from(ends[ends.len() - 1]) * (1.0 - g) >= N_LAST - 1.0);
        }
    }
}
