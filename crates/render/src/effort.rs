//! How many paths a sample of a pixel has: more where the picture is noisy.
//!
//! The first [`PILOT`] samples of every pixel are one path each. Their variance v, as a mean over the 3 x 3 pixels around, says how many paths each later sample is the mean of:
//!
//! $$ k = \sqrt{v / \bar v}\ \text{rounded, in}\ [1, 8], $$
//!
//! the mean over all pixels with any variance; paths in proportion to the root of the variance have the least noise in their time. All samples of a pixel weigh the same, whatever the number of their paths, and that
//! is known before they are taken: each has the pixel's value for its mean, so that nothing is biased. (Means over paths, by contrast, would be: a pixel that seems dark would stay so.)
//!
//! *Measured* on the marble dragon: 1.4 paths a sample; .75 of the variance in 1.2 times the time at 64 samples.
//!
//! *Source*: optimal allocation \[Neyman1934\]; adaptive sampling in two stages and its bias \[Kirk1991\].

use std::sync::atomic::{AtomicBool, AtomicU64};

use crate::film::Film;
use crate::integrator::{Counters, Integrator, Policy};
use crate::scene::Scene;
use crate::session;

/// Samples by which noise is known: one of each scrambling.
pub const PILOT: u64 = moonmilk_core::random::SCRAMBLINGS;
/// Most paths of a sample.
const MOST: f64 = 8.0;

/// Numbers of paths of each pixel of a film.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Effort {
    crop: [u32; 4],
    paths: Vec<u8>,
}

impl Effort {
    /// Returns whether an integrator takes more paths where there is more noise.
    pub fn applies(integrator: &Integrator) -> bool {
        integrator.policy == Policy::Auto
    }

    /// Returns that of a film's picture, from the first samples of that: the film's own if it holds just these, else by taking them again, so that it does not depend on how the work is divided.
    ///
    /// `None` if stopped before that is done. Adds to `counters` what had to be taken again.
    pub fn of(
        scene: &Scene,
        integrator: &Integrator,
        film: &Film,
        stop: &AtomicBool,
        counters: &mut Counters,
    ) -> Option<Self> {
        if film.first == 0 && (0..film.tile_count()).all(|i| film.tile(i).samples == PILOT) {
            return Some(Self::from_pilot(film));
        }
        let pilot = Film::new(film.size, film.crop, 0, &[]);
        counters.merge(&session::render(scene, integrator, &pilot, PILOT, stop, &AtomicU64::new(0)).counters);
        (pilot.samples() == PILOT).then(|| Self::from_pilot(&pilot))
    }

    fn from_pilot(film: &Film) -> Self {
        let pilot = film.develop(1.0);
        let (w, h) = (pilot.width as usize, pilot.height as usize);
        let own: Vec<f64> = pilot.variance.iter().map(|v| v.iter().map(|&v| f64::from(v)).sum()).collect();
        let around = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        let mut variances = Vec::with_capacity(own.len());
        for y in 0..h {
            for x in 0..w {
                let near = || around(y, h).flat_map(|y| around(x, w).map(move |x| y * w + x));
                variances.push(near().map(|at| own[at]).sum::<f64>() / near().count() as f64);
            }
        }
        let noisy = variances.iter().filter(|&&v| v > 0.0).count();
        let mean = variances.iter().sum::<f64>() / noisy as f64;
        let paths = |v: &f64| if *v > 0.0 { (v / mean).sqrt().round().clamp(1.0, MOST) as u8 } else { 1 };
        Self { crop: film.crop, paths: variances.iter().map(paths).collect() }
    }

    /// Returns the number of paths of a sample of a pixel.
    pub fn paths(&self, [x, y]: [u32; 2]) -> u32 {
        let [x0, x1, y0, _] = self.crop;
        u32::from(self.paths[((y - y0) * (x1 - x0) + x - x0) as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::PixelSample;
    use moonmilk_core::{Random, Stream};

    #[test]
    fn paths_go_where_the_noise_is() {
        // A dark third, an even third, and one with ten times the noise.
        let film = Film::new([48, 16], [0, 48, 0, 16], 0, &[]);
        for i in 0..film.tile_count() {
            let tile = film.tile(i).clone();
            let mut update = film.update(&tile);
            for p in 0..tile.width * tile.height {
                for s in 0..PILOT {
                    let noise = [0.0, 1.0, 10.0][(tile.x0 / 16) as usize];
                    let x = noise * Stream::new(&[u64::from(tile.x0), u64::from(p), s]).uniform();
                    let sample = PixelSample { rgb: [x; 3], ..Default::default() };
                    assert!(film.add(&mut update, p as usize, s, &sample, || 0.5));
                }
            }
            film.commit(i, update, PILOT);
        }
        let effort = Effort::from_pilot(&film);
        let mean = |x0: u32| {
            let all: u32 = (0..16).flat_map(|y| (x0 + 2..x0 + 14).map(move |x| [x, y])).map(|p| effort.paths(p)).sum();
            f64::from(all) / (12.0 * 16.0)
        };
        // Of variances 0, 1 and 100 the mean of what there is is 50.5, but for the edges: roots of .02 and 2.
        assert_eq!((mean(0), mean(16)), (1.0, 1.0));
        assert!((1.0..2.0).contains(&mean(32)), "{}", mean(32));
    }

    #[test]
    fn a_picture_without_noise_has_one_path_everywhere() {
        let film = Film::new([4, 4], [0, 4, 0, 4], 0, &[]);
        let tile = film.tile(0).clone();
        film.commit(0, film.update(&tile), PILOT);
        let effort = Effort::from_pilot(&film);
        assert!((0..16).all(|i| effort.paths([i % 4, i / 4]) == 1));
    }
}
