//! What one point lets out at a distance, as a table.

use moonmilk_core::Spectrum;
use moonmilk_walk::Medium;

use super::Exit;

/// R w_c / n of one medium over the squared distance, in equal steps of its significand: no logarithm, no exponential.
///
/// *Accuracy*: linear between 64 nodes per octave: 1e-4 of what all distances together let out; of R itself, within ten mean free paths, 1e-3, where the profile is steepest (`normalized` at albedo .3) 3e-3 (test).
#[derive(Debug)]
pub(crate) struct Kernel {
    sigma_a: [f32; 4],
    sigma_s: [f32; 4],
    /// Leading bits of the first node.
    first: u32,
    nodes: Vec<[f32; 4]>,
    means: Vec<f32>,
    /// Squared distances outside of which it is 0.
    range: [f32; 2],
}

/// Bits of the fraction within a step of [`Kernel`].
const STEP_BITS: u32 = 23 - 6;

impl Kernel {
    /// Tabulates an exit's kernel.
    pub fn new<const N: usize>(exit: &Exit<N>, medium: &Medium<N>) -> Self {
        let four = |s: Spectrum<N>| std::array::from_fn(|k| if k < N { s[k] } else { 0.0 });
        let range = exit.range.map(|r| (r * r) as f32);
        let [first, last] = range.map(|r2| r2.to_bits() >> STEP_BITS);
        let inside = |r2: f32| (r2.sqrt()).clamp(1.000_001 * exit.range[0] as f32, 0.999_999 * exit.range[1] as f32);
        let nodes: Vec<[f32; 4]> =
            (first..=last + 1).map(|key| exit.per_point(inside(f32::from_bits(key << STEP_BITS)))).collect();
        let means = nodes.iter().map(|n| n.iter().sum::<f32>() / N as f32).collect();
        Self { sigma_a: four(medium.sigma_a), sigma_s: four(medium.sigma_s), first, nodes, means, range }
    }

    /// Returns whether it was made for a medium.
    pub fn is_for<const N: usize>(&self, medium: &Medium<N>) -> bool {
        (0..N).all(|k| self.sigma_a[k] == medium.sigma_a[k] && self.sigma_s[k] == medium.sigma_s[k])
    }

    #[inline]
    fn step(&self, r2: f32) -> (usize, f32) {
        let bits = r2.to_bits();
        let i = (bits >> STEP_BITS) - self.first;
        (i as usize, (bits & ((1 << STEP_BITS) - 1)) as f32 * (1.0 / (1u32 << STEP_BITS) as f32))
    }

    /// Returns R w_c / n per lane; 0 outside its range, where lines do all.
    #[inline]
    pub fn eval(&self, r2: f32) -> [f32; 4] {
        if !(r2 > self.range[0] && r2 < self.range[1]) {
            return [0.0; 4];
        }
        let (i, t) = self.step(r2);
        let (a, b) = (&self.nodes[i], &self.nodes[i + 1]);
        std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
    }

    /// Returns the mean over the lanes; below its range, that at its beginning.
    #[inline]
    pub fn mean(&self, r2: f32) -> f32 {
        if r2 >= self.range[1] {
            return 0.0;
        }
        let (i, t) = self.step(r2.max(self.range[0]));
        self.means[i] + t * (self.means[i + 1] - self.means[i])
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use moonmilk_optics::profile::find;

    use super::super::Bank;
    use super::*;

    #[test]
    fn the_table_is_what_it_tabulates() {
        for (name, albedo) in
            [("dipole", [0.9f32, 0.99, 0.5]), ("photon-beam", [0.999, 0.6, 0.95]), ("normalized", [0.3, 0.8, 0.97])]
        {
            let bank = Bank::new(find(name).unwrap(), 0.2, 1.3).unwrap();
            let sigma_t = Spectrum([3.0, 1.0, 2.0]);
            let sigma_s = sigma_t * Spectrum(albedo);
            let medium = Medium::<3>::new(sigma_t + sigma_s * -1.0, sigma_s, 0.2);
            let exit = Exit::new(&bank, &medium, 500.0).unwrap();
            assert!(exit.has_points());
            let kernel = Kernel::new(&exit, &medium);
            assert!(kernel.is_for(&medium));
            let (mut sums, mut worst) = ([[0.0f64; 2]; 3], 0.0f64);
            let mut r = exit.range[0] * 1.001;
            while r < exit.range[1] * 0.999 {
                let (t, e) = (kernel.eval((r * r) as f32), exit.per_point(r as f32));
                let ring = 2.0 * PI * r * r * 1e-3;
                for k in 0..3 {
                    sums[k][0] += ring * f64::from(t[k]);
                    sums[k][1] += ring * f64::from(e[k]);
                    if r < 10.0 / f64::from(sigma_t[k]) {
                        worst = worst.max((f64::from(t[k] / e[k]) - 1.0).abs());
                    }
                }
                let mean = f64::from(t.iter().sum::<f32>() / 3.0);
                assert!((f64::from(kernel.mean((r * r) as f32)) / mean - 1.0).abs() < 1e-5);
                r *= 1.001;
            }
            for s in sums {
                println!("{name}: {:.1e} of the sum, {worst:.1e} of a value", s[0] / s[1] - 1.0);
                assert!(
                    (s[0] / s[1] - 1.0).abs() < 1e-4 && worst < if name == "normalized" { 3.1e-3 } else { 1e-3 },
                    "{name}: {s:?} {worst}"
                );
            }
            let outside = [exit.range[0] * 0.9, exit.range[1] * 1.1].map(|r| (r * r) as f32);
            assert!(outside.iter().all(|&r2| kernel.eval(r2) == [0.0; 4]) && kernel.mean(outside[1]) == 0.0);
        }
    }
}
