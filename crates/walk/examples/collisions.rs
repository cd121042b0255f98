//! Collisions per second and core of half-space walks: `cargo run --release -p moonmilk-walk --example collisions`.

use std::hint::black_box;
use std::time::Instant;

use moonmilk_core::{Random, Spectrum, Stream, Vec3};
use moonmilk_walk::domain::planar::Slab;
use moonmilk_walk::phase::{HenyeyGreenstein, Isotropic};
use moonmilk_walk::{Medium, NoTally, PhaseFunction, Roulette, Walker, walk};

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
}
