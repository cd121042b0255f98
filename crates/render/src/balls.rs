//! Balls of media that do not scatter isotropically, or that emit, for a few samples of all pixels: banks of simulated exits ([`moonmilk_walk::jump::Bank`]).
//!
//! Each group of [`GROUP`] sample numbers has banks of its own, a pure function of scene, seed and group. All pixels share them: so the errors of one group are correlated, as those of
//! [`crate::cloud`] are, by what the luck of some thousand records makes; the mean over groups is free of bias.

use moonmilk_core::random::mix;
use moonmilk_core::{Vec2, Vec3, WavelengthMode, Wavelengths};
use moonmilk_walk::Jumps;
use moonmilk_walk::jump::Bank;
use moonmilk_walk::phase::HenyeyGreenstein;
use rayon::prelude::*;

use crate::integrator::{Integrator, Policy};
use crate::media::Matter;
use crate::scene::Scene;
use crate::texture::TexturePoint;

/// Sample numbers that share their banks.
pub(crate) const GROUP: u64 = 4;
/// Word that separates the random numbers of banks from those of pixels.
const BALLS: u64 = 0xBA115;
/// Records of a level per pixel of the whole picture, and fewest and most: with them a record is used about as often as there are jumps per path, and a bank holds half a megabyte.
const PER_PIXEL: f64 = 0.125;
const RECORDS: [f64; 2] = [256.0, 8192.0];
/// Collisions per record grow with the transport mean free path; above this asymmetry there are fewer records, at the same cost.
const DEAR: f64 = 0.9;
/// Records of the first level simulated together; the largest have a sixteenth of them, still more than walks that are advanced at a time.
const BATCH: u32 = 256;
/// Largest balls over the depth of a body in mean free paths at one place and wavelength.
const MARGIN: f32 = 1.2;
/// Most different media with banks.
const MOST: usize = 16;

/// Banks of the media of a scene, for one group of sample numbers.
#[derive(Debug)]
pub(crate) struct Balls {
    /// Number of the group.
    pub group: u64,
    banks: Vec<Bank>,
}

/// A law of scattering that has banks: its asymmetry, and the largest ball [mean free paths].
pub(crate) type Wanted = (f32, f32);

/// Returns the laws of the media in which walks by a policy jump over such balls.
pub(crate) fn wanted(scene: &Scene, policy: Policy) -> Vec<Wanted> {
    let mut found: Vec<Wanted> = Vec::new();
    if scene.hybrid || scene.shifted {
        return found;
    }
    let wavelengths = Wavelengths::<4>::sample(WavelengthMode::Hero, 0.5);
    for (i, o) in scene.objects.iter().enumerate() {
        if o.body.is_none() || !o.hollow || scene.bank(o).is_some() || found.len() == MOST {
            continue;
        }
        let at = TexturePoint { p: o.common.center(), n: Vec3::Z, uv: Vec2::ZERO };
        let Some(Matter::Homogeneous(medium)) = scene.medium_inside(o, &at, &wavelengths, None) else { continue };
        if medium.g == 0.0 && medium.emission.is_none() || medium.sigma_s.is_black() {
            continue;
        }
        let depth = scene.room(i as u32).depth();
        if policy == Policy::Jump || policy == Policy::Auto && Jumps::pays_by_bank(&medium, depth) {
            // Colours and textures may be denser than what was looked at.
            let most = MARGIN * depth * medium.sigma_t.max_value();
            match found.iter_mut().find(|f| f.0 == medium.g) {
                Some(f) => f.1 = f.1.max(most),
                None => found.push((medium.g, most)),
            }
        }
    }
    found
}

impl Balls {
    /// Returns the banks of a group of sample numbers; `None` where walks need none.
    pub fn new(scene: &Scene, integrator: &Integrator, group: u64) -> Option<Self> {
        let wanted = scene.wanted_balls(integrator.policy);
        if wanted.is_empty() || integrator.max_depth.is_some() {
            return None;
        }
        let seed = mix(mix(integrator.seed, BALLS), group);
        let bank = |&(g, most): &Wanted| {
            let dear = ((1.0 - f64::from(g)) / (1.0 - DEAR)).min(1.0);
            let count = (scene.pixels * PER_PIXEL * dear).clamp(RECORDS[0], RECORDS[1]) as u32;
            let count = (count + 1).next_power_of_two() / 2;
            let key = mix(seed, u64::from(g.to_bits()));
            let parts: Vec<_> = (0..count / BATCH)
                .into_par_iter()
                .map(|b| Bank::part(&HenyeyGreenstein { g }, key, b * BATCH..(b + 1) * BATCH, most))
                .collect();
            Bank::join(g, parts)
        };
        Some(Self { group, banks: wanted.iter().map(bank).collect() })
    }

    /// Returns the bank of an asymmetry.
    #[inline]
    pub fn bank(&self, g: f32) -> Option<&Bank> {
        self.banks.iter().find(|b| b.g() == g)
    }
}
