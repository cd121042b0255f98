//! Collisions per second and core of half-space walks: `cargo run --release -p moonmilk-walk --example collisions`.

use std::hint::black_box;
use std::time::Instant;

use moonmilk_core::{Random, Spectrum, Stream, Vec3};
use moonmilk_walk::domain::ball::Ball;
use moonmilk_walk::domain::planar::Slab;
use moonmilk_walk::phase::{HenyeyGreenstein, Isotropic};
use moonmilk_walk::{Jumps, Medium, NoTally, PhaseFunction, Roulette, Walker, walk, walk_with};

/// Least time per case, long against the clock's resolution.
const SECONDS: f64 = 2.0;

/// Returns millions of collisions per second of walks into a half-space.
fn rate<P: PhaseFunction>(alpha: f32, eta: f32, law: P) -> f64 {
    let slab = Slab { thickness: f32::INFINITY, eta };
    let medium = Medium::with_law(Spectrum([1.0 - alpha]), Spectrum([alpha]), law);
    let limits = Roulette::default().into();
    let (mut collisions, mut i) = (0u64, 0u64);
    let start = Instant::now();
    while start.elapsed().as_secs_f64() < SECONDS {
        for _ in 0..1000 {
            let mut rng = Stream::new(&[1, i]);
            i += 1;
            let mut walker = Walker::new(Vec3::ZERO, Vec3::Z);
            black_box(walk(&slab, &medium, &limits, &mut walker, &mut NoTally, &mut rng));
            collisions += u64::from(walker.collisions);
        }
    }
    collisions as f64 / start.elapsed().as_secs_f64() * 1e-6
}

/// Returns (events per walk, nanoseconds per walk) in a ball of a radius in mean free paths, by flights or by jumps.
fn ball(radius: f32, alpha: f32, jumps: bool) -> (f64, f64) {
    let (ball, medium) =
        (Ball { radius, eta: 1.33 }, Medium::<1>::new(Spectrum([1.0 - alpha]), Spectrum([alpha]), 0.0));
    let jumps = Jumps::new(&medium).filter(|_| jumps);
    let limits = Roulette::default().into();
    // The first walks make the tables.
    let (mut events, mut walks, mut start) = (0u64, 0u64, Instant::now());
    for i in 0.. {
        if i == 20_000 {
            (events, walks, start) = (0, 0, Instant::now());
        }
        if i > 20_000 && i % 1000 == 0 && start.elapsed().as_secs_f64() > SECONDS {
            break;
        }
        let mut rng = Stream::new(&[3, i]);
        let mut walker = Walker::new(Vec3::Z * radius, -Vec3::Z);
        black_box(walk_with(&ball, &medium, jumps.as_ref(), &limits, &mut walker, &mut NoTally, &mut rng));
        events += u64::from(walker.collisions);
        walks += 1;
    }
    (events as f64 / walks as f64, start.elapsed().as_secs_f64() * 1e9 / walks as f64)
}

fn main() {
    let mut rng = Stream::new(&[2]);
    let start = Instant::now();
    let sum: f32 = (0..20_000_000).map(|_| rng.uniform()).sum();
    println!("random numbers      {:6.1} M/s (sum {sum:.0})", 20.0 / start.elapsed().as_secs_f64());
    println!("law                alpha  eta   M collisions/s");
    for alpha in [0.9, 0.99, 0.999] {
        for eta in [1.0, 1.33] {
            println!("isotropic          {alpha:<6} {eta:<5} {:6.1}", rate(alpha, eta, Isotropic));
        }
    }
    // g as the program sees it: known at run time alone.
    for g in [0.0f32, 0.75, 0.9] {
        println!("Henyey-Greenstein {g:<4} .99  1.33 {:6.1}", rate(0.99, 1.33, HenyeyGreenstein { g: black_box(g) }));
    }
    println!("balls of index 1.33     radius  alpha     events and ns per walk, by flights    by jumps");
    for (radius, alpha) in [(10.0, 0.999), (100.0, 0.999), (1000.0, 0.9999)] {
        let ([e, t], [f, u]) = (ball(radius, alpha, false).into(), ball(radius, alpha, true).into());
        println!("                        {radius:<7} {alpha:<8} {e:8.1} {t:10.0}                 {f:8.1} {u:8.0}");
    }
}
