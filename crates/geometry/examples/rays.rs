//! Prints build times, memory and Mray/s on a bumpy sphere of 327 680 triangles (or the mesh of another level):
//! `cargo run --release -p moonmilk-geometry --example rays [levels]`.

use std::time::Instant;

use moonmilk_core::{Random, Stream, Vec3};
use moonmilk_geometry::bvh::{Quality, Search};
use moonmilk_geometry::{Accel, Clearance, Facing, NONE, Ray, Shape, clearance, generate};

fn direction(r: &mut Stream) -> Vec3 {
    let (z, phi) = (2.0 * r.uniform() - 1.0, std::f32::consts::TAU * r.uniform());
    let s = (1.0 - z * z).sqrt();
    Vec3::new(s * phi.cos(), s * phi.sin(), z)
}

/// Prints the rate and the share of hits for rays.
fn rate(name: &str, accel: &Accel, rays: &[Ray]) {
    let (mut best, mut hits) = (f64::INFINITY, 0);
    for _ in 0..3 {
        let start = Instant::now();
        hits = rays.iter().filter(|r| accel.nearest(r).is_some()).count();
        best = best.min(start.elapsed().as_secs_f64());
    }
    println!(
        "  {name:<34} {:6.2} Mray/s  ({:.4} hit)",
        rays.len() as f64 / best * 1e-6,
        hits as f64 / rays.len() as f64
    );
}

/// Prints the time per segment of a random walk inside: flights, collisions, specular reflection at the wall.
fn walk(accel: &Accel, mfp: f32) {
    let body = accel.body(0..1);
    let mut r = Stream::new(&[2]);
    let (mut p, mut d, mut skip) = (Vec3::ZERO, Vec3::X, NONE);
    let (count, mut walls, mut rescued) = (1_000_000, 0, 0);
    let start = Instant::now();
    for _ in 0..count {
        let t = -mfp * r.uniform().ln();
        let ray = Ray::new(p, d).up_to(t).from_prim(skip).facing(Facing::Exiting(body));
        match accel.nearest(&ray) {
            None => (p, d, skip) = (ray.at(t), direction(&mut r), NONE),
            Some(hit) => {
                let (q, n) = accel.point_and_normal(&ray, &hit);
                walls += 1;
                rescued += u32::from(hit.rescued);
                (p, d, skip) = (q, (d - n * (2.0 * d.dot(n))).normalize(), hit.prim);
            }
        }
    }
    let ns = start.elapsed().as_secs_f64() * 1e9 / f64::from(count);
    println!(
        "  walk, mean free path {mfp}: {ns:.0} ns per segment ({walls} at the wall, {rescued} rescued; ends at {p})"
    );
}

/// Peak resident memory of the process so far in bytes, where the system tells.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM:")).unwrap_or("VmHWM: 0 kB");
    line.split_whitespace().nth(1).and_then(|n| n.parse::<f64>().ok()).unwrap_or(0.0) * 1024.0
}

fn main() {
    let levels = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(7);
    let mesh = generate::bumpy_sphere(levels, 0.2);
    let n = mesh.indices().len();
    println!("{n} triangles, mesh {:.1} bytes per triangle", mesh.memory() as f64 / n as f64);

    // Make the rays once.
    let mut r = Stream::new(&[1]);
    let count = 500_000;
    let inside: Vec<Ray> =
        (0..count).map(|_| Ray::new(direction(&mut r) * 0.5 * r.uniform(), direction(&mut r))).collect();
    let outside: Vec<Ray> = (0..count)
        .map(|_| {
            let (o, to) = (direction(&mut r) * 4.0, direction(&mut r) * r.uniform());
            Ray::new(o, (to - o).normalize())
        })
        .collect();

    for (name, search, reinsertion, leaf) in [
        ("minimum, 0, 1", Search::Minimum, 0.0, 1),
        ("minimum, 0, 3", Search::Minimum, 0.0, 3),
        ("low, .02, 1", Search::Low, 0.02, 1),
        ("low, .02, 3", Search::Low, 0.02, 3),
        ("medium, .05, 3", Search::Medium, 0.05, 3),
    ] {
        let shape = Shape::from(mesh.clone());
        let before = peak();
        let start = Instant::now();
        let accel = Accel::build_with(vec![shape], Quality { search, reinsertion, leaf });
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{name}: build {seconds:.3} s, {:.1} bytes per triangle with the mesh; peak grew by {:.1} per triangle",
            accel.memory() as f64 / n as f64,
            (peak() - before) / n as f64
        );
        // Start short segments at points below the surface.
        let body = accel.body(0..1);
        let mut short = Vec::new();
        let mut walk_rays = Vec::new();
        for ray in &inside {
            let Some(hit) = accel.nearest(ray) else {
                continue;
            };
            let below = Ray::new(ray.at(hit.t * 0.99), direction(&mut r)).up_to(0.02);
            short.push(below);
            walk_rays.push(below.facing(Facing::Exiting(body)));
        }
        rate("inside out", &accel, &inside);
        rate("outside, incoherent", &accel, &outside);
        rate("short (0.02) below the surface", &accel, &short);
        rate("the same, exits only", &accel, &walk_rays);
        walk(&accel, 0.02);
        walk(&accel, 0.2);
    }

    let shape = Shape::from(mesh);
    for cells in [1 << 18, clearance::DEFAULT_CELLS] {
        let start = Instant::now();
        let c = Clearance::build(&[&shape], shape.bounds(), cells);
        let built = start.elapsed().as_secs_f64();
        let points: Vec<Vec3> = inside.iter().map(|r| r.o + r.d * 0.3).collect();
        let start = Instant::now();
        let sum: f64 = points.iter().map(|&p| f64::from(c.bound(p))).sum();
        let ns = start.elapsed().as_secs_f64() * 1e9 / points.len() as f64;
        println!(
            "clearance {:?}: build {built:.3} s, {} bytes, {ns:.1} ns per query, mean {:.4}",
            c.size(),
            c.memory(),
            sum / points.len() as f64
        );
    }
}
