//! Noise of colour: what lanes weigh is known on average, and what it happens to be is taken off.
//!
//! A path that is sampled for one wavelength and serves others counts for lane j with the density ratio r_j = p_j / mean_i p_i. Where what it finds hardly depends on where it goes, as under a sky, r_j is all its
//! noise: a walk through a few hundred collisions of a coloured medium leaves each lane with 0 or N. But r is a martingale: whatever a walk did until it ended, the mean of r over all heroes and all walks is the r
//! that it began with. So for any c that does not depend on the walk
//!
//! $$ L_j - c_j\, b_j\, (r_j - r_j^0), \qquad b_j = \beta_j^0 / r_j^0 $$
//!
//! has the mean of L_j (control variate). It has the least variance where c is the slope of L_j against b_j (r_j - r_j^0), about the radiance that a walk finds: nothing is left of the noise in a white furnace. The slope is
//! found out beforehand for blocks of pixels, by paths of their own, so that it depends on no sample of the picture.
//!
//! *Errors*: none, for any c.
//!
//! *Source*: spectral weights \[Wilkie2014\] \[Miller2019\]; control variates are of the textbooks, r as one was found for moonmilk.

use std::sync::OnceLock;

use moonmilk_core::{Random, Sampler, Spectrum, Stream, Vec2, WavelengthMode, Wavelengths};
use moonmilk_walk::{Medium, Roulette, Walker};

use crate::apart::apart;
use crate::integrator::{Counters, Integrator, Light};
use crate::media::Matter;
use crate::scene::Scene;
use crate::texture::TexturePoint;

/// Side of the blocks of pixels that share their slopes.
const BLOCK: u32 = 32;
/// Paths by which a block's slopes are found, in so many groups: of an even number of groups the mean of the middle two counts, as one path that meets a bright lamp says nothing about the others. An even radiance
/// loses one part in this number of paths, at most.
const PATHS: usize = 256;
const GROUPS: usize = 4;
/// Wavelengths \[nm\] of blue, green and red slopes, linear between them.
const BANDS: [f32; 3] = [460.0, 540.0, 610.0];
/// Seed of the paths: one for all pictures of a scene.
const SEED: u64 = 0x7147;

/// The lanes of a walk when it began.
#[derive(Clone, Copy)]
pub(crate) struct Lanes<const N: usize> {
    base: Spectrum<N>,
    ratio: Spectrum<N>,
}

impl<const N: usize> Lanes<N> {
    /// Returns those of a walker that is about to walk.
    #[inline]
    pub fn of(walker: &Walker<N>) -> Self {
        // Nothing is known of lanes that were lost to rounding.
        let base = walker.beta.zip(walker.ratio, |b, r| if r > f32::MIN_POSITIVE { b / r } else { 0.0 });
        Self { base, ratio: walker.ratio }
    }

    /// Notes what the walker has drifted to since, and begins anew with what it is now.
    #[inline]
    pub fn settle(&mut self, walker: &Walker<N>, light: &mut Light<N>) {
        light.drift += self.base * (walker.ratio - self.ratio);
        *self = Self::of(walker);
    }
}

/// Slopes per block of pixels.
#[derive(Debug, Default)]
pub(crate) struct Tints {
    /// What follows the paths that find slopes: with banks of its own, so that these cost no more in dense media than those of a picture.
    pilot: Option<Integrator>,
    across: u32,
    blocks: Vec<OnceLock<[f32; 3]>>,
}

impl Tints {
    /// Returns those of a scene, of which no block is known yet; of a scene without coloured media nothing is ever asked.
    pub fn new(scene: &Scene) -> Self {
        if !is_coloured(scene) {
            return Self::default();
        }
        let [across, down] = scene.resolution.map(|n| (n as u32).div_ceil(BLOCK));
        let pilot = Integrator::new(SEED, WavelengthMode::Hero, Roulette::default(), None);
        let pilot = Some(apart(|| pilot.with_balls(scene, 0)));
        Self { pilot, across, blocks: (0..across * down).map(|_| OnceLock::new()).collect() }
    }

    /// Takes the mean of nothing off a sample of a pixel.
    #[inline]
    pub fn take_off<const N: usize>(&self, scene: &Scene, pixel: [u32; 2], w: &Wavelengths<N>, light: &mut Light<N>) {
        if N == 1 || light.drift.is_black() {
            return;
        }
        let [x, y] = pixel.map(|k| k / BLOCK);
        let block = self.blocks.get((y * self.across + x) as usize);
        let (Some(block), Some(pilot)) = (block, &self.pilot) else { return };
        let slopes = block.get_or_init(|| slopes(scene, pilot, [x * BLOCK, y * BLOCK]));
        light.orders[2] += light.drift * Spectrum::from_fn(|k| -at(slopes, w, k));
    }
}

/// Returns the slope of a lane.
fn at<const N: usize>(slopes: &[f32; 3], w: &Wavelengths<N>, lane: usize) -> f32 {
    match w {
        Wavelengths::Channels { channel } => slopes[2 - usize::from(channel[lane])],
        Wavelengths::Fixed(_) => 0.0,
        Wavelengths::Sampled { lambda, .. } => {
            let l = lambda[lane].clamp(BANDS[0], BANDS[2]);
            let k = usize::from(l > BANDS[1]);
            let t = (l - BANDS[k]) / (BANDS[k + 1] - BANDS[k]);
            slopes[k] + t * (slopes[k + 1] - slopes[k])
        }
    }
}

/// Returns the slopes of a block of pixels from its first.
fn slopes(scene: &Scene, pilot: &Integrator, [x0, y0]: [u32; 2]) -> [f32; 3] {
    let mut groups = [[Slope::default(); 3]; GROUPS];
    for i in 0..PATHS {
        let mut at = Stream::new(&[SEED, u64::from(x0), u64::from(y0), i as u64]);
        let film = at.uniform2().map(|u| u * BLOCK as f32);
        let film =
            Vec2::new((x0 as f32 + film[0]).min(scene.resolution[0]), (y0 as f32 + film[1]).min(scene.resolution[1]));
        let (o, d) = scene.camera.ray(film, at.uniform2());
        let w = Wavelengths::<4>::sample(WavelengthMode::Hero, (i as f32 + at.uniform()) / PATHS as f32);
        let mut rng = Sampler::new(SEED, x0, y0, i as u64);
        let mut light = Light::<4>::default();
        pilot.trace(scene, o, d, &w, &mut rng, &mut light, &mut Counters::default());
        let found = light.orders[0] + light.orders[1] + light.orders[2];
        let Wavelengths::Sampled { lambda, .. } = w else { continue };
        for k in 0..4 {
            let band = BANDS.windows(2).filter(|b| lambda[k] > 0.5 * (b[0] + b[1])).count();
            groups[i % GROUPS][band].add(light.drift[k], found[k]);
        }
    }
    std::array::from_fn(|band| {
        let mut all = groups.map(|g| g[band].value());
        all.sort_by(f32::total_cmp);
        (0.5 * (all[GROUPS / 2 - 1] + all[GROUPS / 2])).max(0.0)
    })
}

/// Sums for the slope of y against x.
#[derive(Clone, Copy, Debug, Default)]
struct Slope {
    n: f32,
    x: f32,
    y: f32,
    xx: f32,
    xy: f32,
}

impl Slope {
    fn add(&mut self, x: f32, y: f32) {
        if x.is_finite() && y.is_finite() {
            self.n += 1.0;
            self.x += x;
            self.y += y;
            self.xx += x * x;
            self.xy += x * y;
        }
    }

    /// Returns the slope of least squares, 0 where x does not vary.
    fn value(&self) -> f32 {
        let spread = self.n * self.xx - self.x * self.x;
        if spread > 1e-6 * self.n * self.xx { (self.n * self.xy - self.x * self.y) / spread } else { 0.0 }
    }
}

/// Returns whether lanes may part somewhere in a scene.
fn is_coloured(scene: &Scene) -> bool {
    let w = Wavelengths::<4>::sample(WavelengthMode::Hero, 0.5);
    let parts = |m: &Matter<4>| match m {
        Matter::Homogeneous(m) | Matter::Similar(m, _) => is_parting(m),
        Matter::Field(_) => true,
    };
    let camera = scene.camera_medium.and_then(|m| scene.medium(m, &w));
    let within = |o: &crate::scene::Object| {
        let at = TexturePoint { p: o.common.center(), n: moonmilk_core::Vec3::Z, uv: Vec2::ZERO };
        [scene.medium_inside(o, &at, &w, None), scene.medium_outside(o, &w, None)]
    };
    camera.is_some_and(|m| parts(&m))
        || scene.objects.iter().flat_map(within).flatten().any(|m| parts(&m))
        || scene.materials.disperses()
}

fn is_parting(m: &Medium<4>) -> bool {
    !m.sigma_s.is_black() && !m.is_gray()
}
