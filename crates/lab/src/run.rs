//! Runs an experiment on all cores, with the same bits for any number of them.

use moonmilk_core::{Estimate, Random, Stream, Vec3};
use moonmilk_walk::math::{sin_cos_turn, uniform_sphere};
use moonmilk_walk::phase::HenyeyGreenstein;
use moonmilk_walk::{Limits, Outcome, PhaseFunction, Roulette, Stack, Walker, walk_stack};
use rayon::prelude::*;

use crate::error::Error;
use crate::experiment::{Experiment, Source, enter};
use crate::law::Law;
use crate::plan::{PER_LAYER, Plan, SCALARS};
use crate::recorder::{LayerFacts, Recorder};
use crate::results::{GridResult, Results, Scalar};

/// Batches of a run: the standard error is that between them, with one less degrees of freedom, and they are summed in their order.
pub const BATCHES: u64 = 64;
/// Batches held in memory at a time; no more cores than that are used.
const GROUP: u64 = 16;

/// Sums of a batch.
struct Batch {
    sums: Vec<f64>,
    lost: u64,
}

/// Follows the experiment's paths and returns what they did.
///
/// *Errors*: what [`Experiment::check`] and [`Plan::new`] find.
pub fn run(e: &Experiment) -> Result<Results, Error> {
    e.check()?;
    let plan = Plan::new(e)?;
    // Let the compiler know the law where all layers share the common one.
    let all_hg = e.layers.iter().all(|l| matches!(l.law, Law::HenyeyGreenstein(_)));
    let (mean, square, lost) = if all_hg {
        let stack = e.stack(|law| match law {
            Law::HenyeyGreenstein(g) => HenyeyGreenstein { g: *g },
            _ => unreachable!("all layers follow Henyey and Greenstein"),
        });
        simulate(e, &plan, &stack)
    } else {
        simulate(e, &plan, &e.stack(Law::clone))
    };
    Ok(collect(e, &plan, &mean, &square, lost))
}

/// Returns means over the batches, sums of squared deviations, and the number of lost paths.
fn simulate<P: PhaseFunction + Sync>(e: &Experiment, plan: &Plan, stack: &Stack<P>) -> (Vec<f64>, Vec<f64>, u64) {
    let batches = BATCHES.min(e.photons);
    let (mut mean, mut square, mut lost) = (vec![0.0; plan.sums], vec![0.0; plan.sums], 0);
    let mut done = 0.0;
    for first in (0..batches).step_by(GROUP as usize) {
        let group: Vec<Batch> =
            (first..(first + GROUP).min(batches)).into_par_iter().map(|b| batch(e, plan, stack, b, batches)).collect();
        // Welford's update, batch by batch.
        for b in group {
            done += 1.0;
            lost += b.lost;
            for ((m, s), x) in mean.iter_mut().zip(&mut square).zip(b.sums) {
                let d = x - *m;
                *m += d / done;
                *s += d * (x - *m);
            }
        }
    }
    (mean, square, lost)
}

/// Follows the paths of one batch; sums are per path.
fn batch<P: PhaseFunction>(e: &Experiment, plan: &Plan, stack: &Stack<P>, b: u64, batches: u64) -> Batch {
    // Batches differ by one path at most.
    let split = |k: u64| (u128::from(k) * u128::from(e.photons) / u128::from(batches)) as u64;
    let (first, end) = (split(b), split(b + 1));
    let mut top = 0.0;
    let layers: Vec<LayerFacts> = e
        .layers
        .iter()
        .map(|l| {
            let facts = LayerFacts { top, n: l.n, sigma_a: f64::from(l.sigma_a as f32) };
            top += l.thickness;
            facts
        })
        .collect();
    let mut sums = vec![0.0; plan.sums];
    let mut lost = 0;
    let mut recorder = Recorder::new(plan, &layers, e.unit.in_mm(), &mut sums);
    let limits = Limits { roulette: Roulette::default(), collisions: e.max_collisions };
    let eta = (e.layers[0].n / e.n_above) as f32;
    for i in first..end {
        let mut rng = Stream::new(&[e.seed, i]);
        let (mut walker, layer) = match start(e, eta, &mut recorder, &mut rng) {
            Some(begun) => begun,
            None => continue,
        };
        recorder.begin();
        match walk_stack(stack, layer, &limits, &mut walker, &mut recorder, &mut rng) {
            Outcome::Left(face) => recorder.leave(&walker, face),
            Outcome::Ended if walker.collisions >= e.max_collisions => recorder.sums[5] += f64::from(walker.beta[0]),
            Outcome::Ended => {}
            Outcome::Lost => lost += 1,
        }
    }
    let n = (end - first) as f64;
    for i in 0..e.layers.len() {
        sums[4] += sums[Plan::of_layer(i, 0)];
    }
    sums.iter_mut().for_each(|x| *x /= n);
    Batch { sums, lost }
}

/// Starts a path: the walker and its layer, or nothing if all was reflected.
fn start(e: &Experiment, eta: f32, recorder: &mut Recorder<'_>, rng: &mut Stream) -> Option<(Walker<1>, usize)> {
    let outside = match e.source {
        Source::Pencil { angle } => Vec3::new(angle.sin() as f32, 0.0, angle.cos() as f32),
        Source::Lambertian => {
            let u = rng.uniform2();
            let (s, c) = sin_cos_turn(u[1]);
            let r = (1.0 - u[0]).sqrt();
            Vec3::new(r * c, r * s, u[0].sqrt())
        }
        Source::Point { depth } => {
            let (layer, z) = e.locate(depth);
            return Some((Walker::new(Vec3::new(0.0, 0.0, z as f32), uniform_sphere(rng.uniform2())), layer));
        }
    };
    let (reflected, inside) = enter(outside, eta);
    recorder.sums[0] += f64::from(reflected);
    let mut walker = Walker::new(Vec3::ZERO, inside?);
    walker.beta *= 1.0 - reflected;
    Some((walker, 0))
}

/// Turns sums into named estimates.
fn collect(e: &Experiment, plan: &Plan, mean: &[f64], square: &[f64], lost: u64) -> Results {
    let batches = BATCHES.min(e.photons) as f64;
    let estimate = |i: usize, measure: f64| Estimate {
        mean: mean[i] / measure,
        std_err: (square[i] / (batches - 1.0) / batches).sqrt() / measure,
        n: e.photons,
    };
    let mut scalars: Vec<Scalar> = SCALARS
        .iter()
        .enumerate()
        .map(|(i, (name, about))| Scalar {
            name: (*name).into(),
            about: (*about).into(),
            unit: "1".into(),
            value: estimate(i, 1.0),
        })
        .collect();
    for (i, layer) in e.layers.iter().enumerate() {
        for (k, (name, about)) in PER_LAYER.iter().enumerate() {
            scalars.push(Scalar {
                name: format!("{name}.{}", layer.name),
                about: (*about).into(),
                unit: if k == 2 { e.unit.symbol().into() } else { "1".into() },
                value: estimate(Plan::of_layer(i, k), 1.0),
            });
        }
    }
    let grids = plan.grids.iter().map(|g| GridResult {
        name: g.name,
        unit: g.unit.clone(),
        axes: g.axes.clone(),
        cells: (0..g.cells()).map(|c| estimate(g.offset + c, g.measure(c))).collect(),
        outside: estimate(g.offset + g.cells(), 1.0),
    });
    Results { photons: e.photons, seed: e.seed, lost, scalars, grids: grids.collect() }
}
