//! Makes the table behind the profile `tabulated`: where and after how many collisions light leaves a conservative half-space.
//!
//! Absorption only weighs: a path of N collisions reaches the surface with alpha^N, whatever else happened. So one conservative
//! simulation per index and phase function holds the profiles of all albedos. Each upward flight scores its probability of
//! leaving, which is the mean of what the walk does next and less noisy. Walks end by roulette at powers of four of the
//! transport time, and at [`grid::N_LAST`], beyond which diffusion is exact enough: what is left then is [`Node::rest`].

pub mod grid;

use moonmilk_core::{Random, Spectrum, Stream, Vec3};
use moonmilk_optics::fresnel;
use moonmilk_walk::domain::layer::Layer;
use moonmilk_walk::phase::HenyeyGreenstein;
use moonmilk_walk::{Limits, Medium, Outcome, Roulette, Tally, Walker, walk};
use rayon::prelude::*;

use grid::{N_LAST, R_CELLS, R_FIRST, R_PER_OCTAVE, n_cells, n_end};

/// Walks of a batch; batches are summed in their order, so that threads cannot change a bit.
const BATCH: u64 = 1 << 12;
/// Batches held in memory at a time.
const GROUP: usize = 32;
/// Optical depth beyond which a flight's probability of leaving (1e-9) is not scored but found by chance.
const DEEP: f32 = 20.0;

/// The table of one index and asymmetry.
#[derive(Clone, Debug)]
pub struct Node {
    /// Relative index, inside / outside.
    pub eta: f64,
    /// Asymmetry of the Henyey-Greenstein law.
    pub g: f64,
    /// Share of the entered light that leaves per cell: row of radius (see [`grid`]), column of number of collisions.
    pub share: Vec<f64>,
    /// Share of the entered light still inside after [`grid::N_LAST`] transport mean free paths.
    pub rest: f64,
    /// Collisions simulated.
    pub collisions: u64,
}

/// Sums of a batch of walks.
struct Sums {
    share: Vec<f64>,
    rest: f64,
    collisions: u64,
}

/// Scores the probability of leaving of every upward flight, and sends long walks to the roulette.
struct Exits<'a> {
    sums: &'a mut Sums,
    columns: usize,
    eta: f32,
    /// Radii are counted in transport mean free paths.
    scale: f32,
    /// Column of the present number of collisions, and the largest number in it.
    cell: usize,
    end: u32,
    /// Number of collisions at which every second walk ends next, and whether the present one was that.
    stop: u32,
    played: bool,
    next: f64,
}

/// The roulette of [`Exits`]: a walk whose weight is made to look like `LOW` ends in one case of two.
const LOW: f32 = 0.1;
const ROULETTE: Roulette = Roulette { threshold: 0.15, survivor: 0.2 };

impl<R: Random> Tally<1, R> for Exits<'_> {
    #[inline]
    fn flight(&mut self, walker: &Walker<1>, _t: f32) {
        if walker.d.z >= 0.0 || walker.p.z >= DEEP * -walker.d.z || walker.collisions == 0 {
            return;
        }
        while walker.collisions > self.end {
            self.cell += 1;
            self.end = n_end(self.cell);
        }
        let t = walker.p.z / -walker.d.z;
        let through = 1.0 - fresnel::reflectance(-walker.d.z, 1.0 / self.eta);
        if through <= 0.0 {
            return;
        }
        let (x, y) = (walker.p.x + walker.d.x * t, walker.p.y + walker.d.y * t);
        // Cells are quarters of octaves of r, so halves of octaves of r^2.
        let octaves = 0.5 * ((x * x + y * y) * self.scale * self.scale).max(1e-30).log2() - R_FIRST as f32;
        let row = if octaves < 0.0 { 0 } else { 1 + (octaves * R_PER_OCTAVE as f32) as usize };
        self.sums.share[row.min(R_CELLS - 1) * self.columns + self.cell] +=
            f64::from(walker.beta[0] * through * (-t).exp());
    }

    #[inline]
    fn collision(&mut self, walker: &mut Walker<1>, _medium: &Medium<1>, arrived: Spectrum<1>, _rng: &mut R) {
        if walker.collisions < self.stop {
            return;
        }
        // The scale makes the weight look low for one collision, then like one again.
        if self.played {
            walker.eta_scale = 1.0 / arrived[0];
            self.next *= 4.0;
            self.stop = self.next as u32;
        } else {
            walker.eta_scale = LOW / arrived[0];
            self.stop += 1;
        }
        self.played = !self.played;
    }
}

/// Simulates one node with a number of walks, rounded up to whole batches.
///
/// *Domain*: eta > 0, |g| < 1. Random numbers are keyed by seed, eta and g.
pub fn node(eta: f64, g: f64, walks: u64, seed: u64) -> Node {
    let columns = n_cells(g);
    let batches = walks.div_ceil(BATCH);
    let empty = || Sums { share: vec![0.0; R_CELLS * columns], rest: 0.0, collisions: 0 };
    let mut total = empty();
    for first in (0..batches).step_by(GROUP) {
        let done: Vec<Sums> = (first..(first + GROUP as u64).min(batches))
            .into_par_iter()
            .map(|b| {
                let mut sums = empty();
                batch(eta, g, &[seed, eta.to_bits(), g.to_bits(), b], &mut sums);
                sums
            })
            .collect();
        for s in done {
            total.share.iter_mut().zip(&s.share).for_each(|(a, b)| *a += b);
            total.rest += s.rest;
            total.collisions += s.collisions;
        }
    }
    let n = (batches * BATCH) as f64;
    total.share.iter_mut().for_each(|x| *x /= n);
    Node { eta, g, share: total.share, rest: total.rest / n, collisions: total.collisions }
}

/// Adds a batch of walks.
fn batch(eta: f64, g: f64, key: &[u64; 4], sums: &mut Sums) {
    let domain = Layer { thickness: f32::INFINITY, eta_front: eta as f32, eta_back: 1.0 };
    let medium = Medium::with_law(Spectrum([0.0]), Spectrum([1.0]), HenyeyGreenstein { g: g as f32 });
    let first = 16.0 / (1.0 - g);
    let last = (N_LAST / (1.0 - g)) as u32;
    let limits = Limits { roulette: ROULETTE, collisions: last };
    for i in 0..BATCH {
        let mut rng = Stream::new(&[key[0], key[1], key[2], key[3], i]);
        let mut walker = Walker::new(Vec3::ZERO, Vec3::Z);
        let mut tally = Exits {
            sums,
            columns: n_cells(g),
            eta: eta as f32,
            scale: (1.0 - g) as f32,
            cell: 0,
            end: 1,
            stop: first as u32,
            played: false,
            next: first,
        };
        match walk(&domain, &medium, &limits, &mut walker, &mut tally, &mut rng) {
            Outcome::Ended if walker.collisions == last => sums.rest += f64::from(walker.beta[0]),
            // A lost position lies far above the surface by rounding: never seen, and counted as what stays inside.
            Outcome::Lost => sums.rest += f64::from(walker.beta[0]),
            Outcome::Ended | Outcome::Left(_) => {}
        }
        sums.collisions += u64::from(walker.collisions);
    }
}
