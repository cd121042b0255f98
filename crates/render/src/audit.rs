//! The audit: a share of the samples of a picture once more by plain walks, and the difference with its confidence interval.
//!
//! Both paths of a pair begin with the same camera ray and the same random numbers, so that they enter a body at the same place in the same direction; from there each walks by its own
//! means. A policy of exact walks must show no difference; an approximation shows its bias, on the scene at hand.

use moonmilk_core::Estimate;
use moonmilk_core::estimate::Accumulator;
use moonmilk_core::random::mix;
use moonmilk_core::stats::{normal_score, sidak, z_test};
use rayon::prelude::*;

use crate::balls;
use crate::integrator::{Counters, Integrator, Policy};
use crate::scene::Scene;
use crate::session;

/// Side of the blocks of pixels that are compared one by one.
const BLOCK: u32 = 16;

/// Fewest sample numbers that are compared where the pixels of each share their errors.
const FEWEST: u64 = 8;

/// What an audit found.
#[derive(Clone, Debug)]
pub struct Audit {
    /// Number of pairs of paths.
    pub pairs: u64,
    /// Mean radiance of the pairs (mean of the three colour channels) by plain walks.
    pub plain: Estimate,
    /// Mean of the differences, audited less plain; of its independent values there are as many as pairs, or as sample numbers where the pixels of each share their errors.
    pub difference: Estimate,
    /// Standard score of the block of 16 x 16 pixels that differs most.
    pub worst_block: f64,
    /// Number of blocks with enough light to compare.
    pub blocks: u32,
    /// Pairs left out, as one of them was not finite.
    pub invalid: u64,
}

impl Audit {
    /// Returns the difference over the mean, and its 95 % confidence interval's half width.
    pub fn relative(&self) -> (f64, f64) {
        (self.difference.mean / self.plain.mean, 1.96 * self.difference.std_err / self.plain.mean)
    }

    /// Returns whether the mean differs by more than 4 standard errors, or as improbably where its values are few.
    pub fn differs(&self) -> bool {
        score(&self.difference).abs() > 4.0
    }

    /// Returns whether some block differs, at a significance of .01 over all of them (Sidak).
    pub fn blocks_differ(&self) -> bool {
        self.blocks > 0 && z_test(self.worst_block) < sidak(0.01, self.blocks as usize)
    }
}

/// Returns the standard score of a mean that should be 0.
fn score(e: &Estimate) -> f64 {
    if e.mean == 0.0 { 0.0 } else { normal_score(e.z(0.0), (e.n - 1) as f64) }
}

/// Follows `samples` samples of each pixel of a window (x0, x1, y0, y1) twice: as `scene` and `integrator` say, and in `plain` flight by flight.
///
/// `plain` is the same description built without an approximation. Bodies of a model are looked at by lines alone: the points that share the work are common to all pixels, and so
/// would be their error. Where exact walks share vertices of light's paths, at least 8 sample numbers are followed, and each is one value. A pure function of scenes, settings and window.
pub fn audit(scene: &Scene, integrator: &Integrator, plain: &Scene, window: [u32; 4], samples: u64) -> Audit {
    // Numbers of their own: the audit is no part of the picture.
    let mut seeded = integrator.clone();
    seeded.seed = mix(integrator.seed, 0xA0D1);
    let classic = seeded.clone().with_policy(Policy::Classic);
    let [x0, x1, y0, y1] = window;
    let [columns, rows] = [x1 - x0, y1 - y0].map(|n| n.div_ceil(BLOCK));
    let shared = integrator.prepares_much(scene);
    let samples = if shared { samples.max(FEWEST) } else { samples };
    // Of each block all pairs, its means per sample number, and pairs left out.
    let mut blocks = vec![([Accumulator::default(); 2], Accumulator::default(), 0u64); (columns * rows) as usize];
    let mut means = Accumulator::default();
    let mut last = seeded;
    // Go through sample numbers together: what is made once for them serves all blocks.
    let step = if shared { 1 } else { balls::GROUP };
    for from in (0..samples).step_by(step as usize) {
        last = last.for_walks(scene, from);
        let seeded = &last;
        let sums: Vec<Accumulator> = blocks
            .par_iter_mut()
            .enumerate()
            .map(|(b, (sums, means, invalid))| {
                let b = b as u32;
                let (x, y) = (x0 + b % columns * BLOCK, y0 + b / columns * BLOCK);
                let mut differences = Accumulator::default();
                for s in from..samples.min(from + step) {
                    for pixel in (y..(y + BLOCK).min(y1)).flat_map(|y| (x..(x + BLOCK).min(x1)).map(move |x| [x, y])) {
                        let [a, b] = [(scene, seeded), (plain, &classic)].map(|(scene, by)| {
                            let rgb = session::sample(scene, by, pixel, s, &mut Counters::default()).rgb;
                            f64::from(rgb[0] + rgb[1] + rgb[2]) / 3.0
                        });
                        if a.is_finite() && b.is_finite() {
                            sums[0].add(b);
                            differences.add(a - b);
                        } else {
                            *invalid += 1;
                        }
                    }
                }
                sums[1].merge(&differences);
                means.add(differences.estimate().mean);
                differences
            })
            .collect();
        let mut all = Accumulator::default();
        sums.iter().for_each(|s| all.merge(s));
        means.add(all.estimate().mean);
    }
    let mut sums = [Accumulator::default(); 2];
    let (mut worst, mut count) = (0.0f64, 0);
    for (block, block_means, _) in &blocks {
        sums.iter_mut().zip(block).for_each(|(s, b)| s.merge(b));
        let difference = if shared { block_means } else { &block[1] }.estimate();
        if difference.std_err > 0.0 {
            let z = score(&difference);
            count += 1;
            worst = if z.abs() > worst.abs() { z } else { worst };
        }
    }
    let [plain, difference] = sums.map(|s| s.estimate());
    let invalid = blocks.iter().map(|b| b.2).sum();
    let difference = if shared { means.estimate() } else { difference };
    Audit { pairs: plain.n, plain, difference, worst_block: worst, blocks: count, invalid }
}
