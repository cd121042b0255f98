//! Prints build times, memory and Mray/s on a bumpy sphere of 327 680 triangles, on that of another level, or on a closed PLY mesh:
//! `cargo run --release -p moonmilk-io --example rays [LEVELS | MESH.ply]`.

use std::time::Instant;

use moonmilk_core::{Random, Stream, Vec3};
use moonmilk_geometry::bvh::{Quality, Search};
use moonmilk_geometry::{Accel, Clearance, Facing, Mesh, NONE, Ray, Shape, clearance, generate};

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
fn walk(accel: &Accel, start: Vec3, mfp: f32) {
    let body = accel.body(0..1);
    let mut r = Stream::new(&[2]);
    let (mut p, mut d, mut skip) = (start, Vec3::X, NONE);
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

/// Returns points inside a closed mesh: on random lines through its box, between where they enter it and where they leave it.
fn points_inside(accel: &Accel, count: usize, r: &mut Stream) -> Vec<Vec3> {
    let bounds = accel.bounds();
    let (center, radius) = (bounds.center(), 0.5 * bounds.extent().length());
    let body = accel.body(0..1);
    let mut points = Vec::with_capacity(count);
    while points.len() < count {
        let (o, to) = (direction(r) * 2.0 * radius, direction(r) * radius * r.uniform());
        let line = Ray::new(center + o, (to - o).normalize()).facing(Facing::Entering(body));
        let Some(entry) = accel.nearest(&line) else { continue };
        let inward = Ray::new(line.at(entry.t), line.d).from_prim(entry.prim).facing(Facing::Exiting(body));
        if let Some(exit) = accel.nearest(&inward) {
            points.push(inward.at(exit.t * r.uniform()));
        }
    }
    points
}

/// Returns the mesh that the first argument says.
fn mesh() -> Mesh {
    let argument = std::env::args().nth(1).unwrap_or_else(|| "7".into());
    if let Ok(levels) = argument.parse() {
        return generate::bumpy_sphere(levels, 0.2);
    }
    let bytes = std::fs::read(&argument).expect("the mesh can be read");
    let read = moonmilk_io::ply::read(&bytes).expect("the mesh is a PLY file");
    Mesh::new(read.positions, read.normals, read.uvs, read.indices).expect("the mesh is valid")
}

fn main() {
    let mesh = mesh();
    let n = mesh.indices().len();
    println!("{n} triangles, mesh {:.1} bytes per triangle", mesh.memory() as f64 / n as f64);

    // Make the rays once. Lengths are in units of half the longest side.
    let mut r = Stream::new(&[1]);
    let count = 500_000;
    let bounds = mesh.bounds();
    let (center, unit) = (bounds.center(), 0.5 * bounds.extent().max_element());
    let points = points_inside(&Accel::build(vec![Shape::from(mesh.clone())]), count, &mut r);
    let inside: Vec<Ray> = points.iter().map(|&p| Ray::new(p, direction(&mut r))).collect();
    let outside: Vec<Ray> = (0..count)
        .map(|_| {
            let (o, to) = (direction(&mut r) * 4.0 * unit, direction(&mut r) * unit * r.uniform());
            Ray::new(center + o, (to - o).normalize())
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
            let below = Ray::new(ray.at(hit.t * 0.99), direction(&mut r)).up_to(0.02 * unit);
            short.push(below);
            walk_rays.push(below.facing(Facing::Exiting(body)));
        }
        rate("inside out", &accel, &inside);
        rate("outside, incoherent", &accel, &outside);
        rate("short (0.02) below the surface", &accel, &short);
        rate("the same, exits only", &accel, &walk_rays);
        walk(&accel, points[0], 0.02 * unit);
        walk(&accel, points[0], 0.2 * unit);
    }

    let shape = Shape::from(mesh);
    for cells in [1 << 18, clearance::DEFAULT_CELLS] {
        let start = Instant::now();
        let c = Clearance::build(&[&shape], shape.bounds(), cells);
        let built = start.elapsed().as_secs_f64();
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
