//! The audit: a share of the samples of a picture once more by plain walks, and the difference with its confidence interval.
//!
//! Both paths of a pair begin with the same camera ray and the same random numbers, so that they enter a body at the same place in the same direction; from there each walks by its own
//! means. A policy of exact walks must show no difference; an approximation shows its bias, on the scene at hand.

use moonmilk_core::Estimate;
use moonmilk_core::estimate::Accumulator;
use moonmilk_core::random::mix;
use moonmilk_core::stats::{sidak, z_test};
use rayon::prelude::*;

use crate::balls;
use crate::integrator::{Counters, Integrator, Policy};
use crate::scene::Scene;
use crate::session;

/// Side of the blocks of pixels that are compared one by one.
const BLOCK: u32 = 16;

/// What an audit found.
#[derive(Clone, Debug)]
pub struct Audit {
    /// Mean radiance of the pairs (mean of the three colour channels) by plain walks.
    pub plain: Estimate,
    /// Mean of the differences, audited less plain.
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

    /// Returns whether the mean differs by more than 4 standard errors.
    pub fn differs(&self) -> bool {
        self.difference.z(0.0).abs() > 4.0
    }

    /// Returns whether some block differs, at a significance of .01 over all of them (Sidak).
    pub fn blocks_differ(&self) -> bool {
        self.blocks > 0 && z_test(self.worst_block) < sidak(0.01, self.blocks as usize)
    }
}

/// Follows `samples` samples of each pixel of a window (x0, x1, y0, y1) twice: as `scene` and `integrator` say, and in `plain` flight by flight.
///
/// `plain` is the same description built without an approximation. Bodies of a model are looked at by lines alone: the points that share the work are common to all pixels, and so
/// would be their error. A pure function of scenes, settings and window.
pub fn audit(scene: &Scene, integrator: &Integrator, plain: &Scene, window: [u32; 4], samples: u64) -> Audit {
    // Numbers of their own: the audit is no part of the picture.
    let mut seeded = integrator.clone();
    seeded.seed = mix(integrator.seed, 0xA0D1);
    let classic = seeded.clone().with_policy(Policy::Classic);
    let [x0, x1, y0, y1] = window;
    let [columns, rows] = [x1 - x0, y1 - y0].map(|n| n.div_ceil(BLOCK));
    let mut blocks = vec![([Accumulator::default(); 2], 0u64); (columns * rows) as usize];
    let mut last = seeded;
    // Go through sample numbers together: their banks serve all blocks.
    for from in (0..samples).step_by(balls::GROUP as usize) {
        last = last.with_balls(scene, from);
        let seeded = &last;
        blocks.par_iter_mut().enumerate().for_each(|(b, (sums, invalid))| {
            let b = b as u32;
            let (x, y) = (x0 + b % columns * BLOCK, y0 + b / columns * BLOCK);
            for s in from..samples.min(from + balls::GROUP) {
                for pixel in (y..(y + BLOCK).min(y1)).flat_map(|y| (x..(x + BLOCK).min(x1)).map(move |x| [x, y])) {
                    let [a, b] = [(scene, seeded), (plain, &classic)].map(|(scene, by)| {
                        let rgb = session::sample(scene, by, pixel, s, &mut Counters::default()).rgb;
                        f64::from(rgb[0] + rgb[1] + rgb[2]) / 3.0
                    });
                    if a.is_finite() && b.is_finite() {
                        sums[0].add(b);
                        sums[1].add(a - b);
                    } else {
                        *invalid += 1;
                    }
                }
            }
        });
    }
    let mut sums = [Accumulator::default(); 2];
    let (mut worst, mut count) = (0.0f64, 0);
    for (block, _) in &blocks {
        sums.iter_mut().zip(block).for_each(|(s, b)| s.merge(b));
        let difference = block[1].estimate();
        if difference.std_err > 0.0 {
            let z = difference.z(0.0);
            count += 1;
            worst = if z.abs() > worst.abs() { z } else { worst };
        }
    }
    let [plain, difference] = sums.map(|s| s.estimate());
    let invalid = blocks.iter().map(|b| b.1).sum();
    Audit { plain, difference, worst_block: worst, blocks: count, invalid }
}
