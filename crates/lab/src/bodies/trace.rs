//! Follows light from its source through bodies to where it ends.

use moonmilk_core::{DVec3, Estimate, Frame, Random, Spectrum, Stream, Vec3};
use moonmilk_geometry::sample::sample_triangle;
use moonmilk_geometry::{Accel, Body, Facing, Hit, Prim, Ray, Room, Shape, WORLD};
use moonmilk_walk::domain::{Wall, smooth_boundary};
use moonmilk_walk::math::{sin_cos_turn, uniform_sphere};
use moonmilk_walk::{Domain, Limits, Medium, Outcome, Roulette, Walker, walk};
use rayon::prelude::*;

use super::recorder::{Cells, PER_BODY, Recorder, SCALARS};
use super::{Bodies, Light};
use crate::error::Error;
use crate::plan::{Axis, Quantity};
use crate::results::{GridResult, Results, Scalar};
use crate::run::BATCHES;

/// Cells of the grid of free room in each body: 128^3 bytes at most.
const ROOM_CELLS: usize = 1 << 21;
/// Batches held in memory at a time.
const GROUP: u64 = 16;

/// The inside of a body as the walk sees it.
struct Inside<'a> {
    accel: &'a Accel,
    room: &'a Room,
    body: Body,
    shape: u32,
    eta: f32,
    start: Option<Hit>,
}

/// How a walk left a body.
#[derive(Clone, Copy)]
enum Exit {
    /// Through its surface.
    Outside(Hit),
    /// It met the surface of something else inside.
    Foreign(u32),
}

impl Domain<1> for Inside<'_> {
    type Wall = Option<Hit>;
    type Exit = Exit;

    fn start(&self) -> Option<Hit> {
        None
    }

    fn first(&self) -> Option<Hit> {
        self.start
    }

    #[inline]
    fn room(&self, p: Vec3) -> f32 {
        self.room.bound(p)
    }

    #[inline]
    fn segment(&self, p: Vec3, d: Vec3, t_max: f32, from: &Option<Hit>) -> Option<(f32, Option<Hit>)> {
        let mut ray = Ray::new(p, d).up_to(t_max).facing(Facing::Exiting(self.body));
        if let Some(hit) = from {
            ray = ray.from_prim(hit.prim);
        }
        self.accel.nearest(&ray).map(|h| (h.t, Some(h)))
    }

    fn arrive<R: Random>(
        &self,
        wall: Option<Hit>,
        _t: f32,
        walker: &mut Walker<1>,
        rng: &mut R,
    ) -> Wall<Option<Hit>, Exit> {
        let hit = wall.expect("a segment that met a wall has a hit");
        if hit.shape != self.shape {
            return Wall::Leave(Exit::Foreign(hit.shape));
        }
        let surface = self.accel.surface(&Ray::new(walker.p, walker.d), &hit);
        walker.p = surface.p;
        let (d, left) = smooth_boundary(walker.d, surface.ng, self.eta, rng);
        walker.d = d;
        if left { Wall::Leave(Exit::Outside(hit)) } else { Wall::Stay(Some(hit)) }
    }

    fn is_outside(&self, p: Vec3) -> bool {
        let b = self.accel.shape_bounds(self.shape);
        !b.grown(1e-3 * b.extent().max_element()).contains(p)
    }
}

/// An experiment made ready.
struct Ready<'a> {
    e: &'a Bodies,
    accel: Accel,
    rooms: Vec<Room>,
    media: Vec<Medium<1>>,
    /// A ball around everything.
    centre: Vec3,
    radius: f32,
    fluence: Option<Cells>,
    absorption: Option<Cells>,
    /// Sums of the areas of the triangles that shine.
    shining: Vec<f64>,
    sums: usize,
}

impl<'a> Ready<'a> {
    fn new(e: &'a Bodies) -> Self {
        let shapes = e.bodies.iter().map(|b| b.shape.clone()).chain(e.detectors.iter().map(|d| d.shape.clone()));
        let accel = Accel::build(shapes.collect());
        let all = accel.bounds();
        let rooms = (0..e.bodies.len() as u32).map(|i| accel.room(i, ROOM_CELLS)).collect();
        let media = e
            .bodies
            .iter()
            .map(|b| Medium::new(Spectrum([b.sigma_a as f32]), Spectrum([b.sigma_s as f32]), b.g as f32));
        let mut sums = SCALARS.len() + PER_BODY.len() * e.bodies.len() + e.detectors.len();
        let mut cells = |n: Option<usize>| {
            n.map(|n| {
                let axes = e.axes(n);
                let count = [0, 1, 2].map(|k: usize| axes[k].len() - 1);
                let min = DVec3::new(axes[0][0], axes[1][0], axes[2][0]);
                let cells = Cells { min, size: axes[0][1] - axes[0][0], count, offset: sums };
                sums += cells.total() + 1;
                cells
            })
        };
        let shining = match e.light {
            Light::Surface { detector, .. } => areas(&e.detectors[detector].shape),
            _ => Vec::new(),
        };
        let (fluence, absorption) = (cells(e.grids.fluence), cells(e.grids.absorption));
        Self {
            e,
            rooms,
            media: media.collect(),
            centre: all.center(),
            radius: 0.5 * all.extent().length() * (1.0 + 1e-4),
            accel,
            fluence,
            absorption,
            shining,
            sums,
        }
    }

    fn of_body(&self, body: usize) -> usize {
        SCALARS.len() + PER_BODY.len() * body
    }

    fn of_detector(&self, detector: usize) -> usize {
        self.of_body(self.e.bodies.len()) + detector
    }

    fn overlap(&self, a: u32, b: u32) -> Error {
        let name = |i: u32| {
            let (i, n) = (i as usize, self.e.bodies.len());
            if i < n { self.e.bodies[i].name.clone() } else { self.e.detectors[i - n].name.clone() }
        };
        Error::Overlap { a: name(a), b: name(b) }
    }

    /// Returns the ray on which a path starts.
    fn emit(&self, rng: &mut Stream) -> Ray {
        let (p, d) = match self.e.light {
            Light::Surface { detector, two_sided } => return self.emit_from(detector, two_sided, rng),
            Light::Uniform => {
                // Lambertian light inwards from the ball around everything.
                let n = uniform_sphere(rng.uniform2());
                let u = rng.uniform2();
                let (s, c) = sin_cos_turn(u[1]);
                let r = (1.0 - u[0]).sqrt();
                let d = Frame::new(-n).to_world(Vec3::new(r * c, r * s, u[0].sqrt()));
                (self.centre + n * self.radius, d)
            }
            Light::Parallel { direction } => {
                let d = direction.normalize();
                let u = rng.uniform2();
                let (s, c) = sin_cos_turn(u[1]);
                let r = u[0].sqrt() * self.radius;
                let across = Frame::new(d).to_world(Vec3::new(r * c, r * s, 0.0));
                (self.centre + across - d * self.radius, d)
            }
            Light::Point { at, axis, cosines: (start, end) } => {
                let frame = Frame::new(axis.normalize());
                // Even over the cone, then thinned out in its soft edge.
                loop {
                    let u = rng.uniform2();
                    let z = if start >= 1.0 && end >= 1.0 { 1.0 } else { 1.0 - u[0] * (1.0 - end) };
                    let x = ((z - end) / (start - end)).clamp(0.0, 1.0);
                    if start > end && z < start && rng.uniform() >= x * x * (3.0 - 2.0 * x) {
                        continue;
                    }
                    let (s, c) = sin_cos_turn(u[1]);
                    let r = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
                    break (at, frame.to_world(Vec3::new(r * c, r * s, z)));
                }
            }
        };
        Ray::new(p, d)
    }

    /// Returns a ray of Lambertian light from a detector's mesh.
    fn emit_from(&self, detector: usize, two_sided: bool, rng: &mut Stream) -> Ray {
        let shape = (self.e.bodies.len() + detector) as u32;
        let u = f64::from(rng.uniform()) * self.shining[self.shining.len() - 1];
        let triangle = self.shining.partition_point(|&a| a <= u).min(self.shining.len() - 1) as u32;
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let (_, b) = sample_triangle(corners, rng.uniform2());
        let surface = self.accel.triangle_surface(shape, triangle, b).expect("checked to be a mesh");
        let back = two_sided && rng.uniform() < 0.5;
        let n = if back { -surface.ng } else { surface.ng };
        let u = rng.uniform2();
        let (s, c) = sin_cos_turn(u[1]);
        let r = (1.0 - u[0]).sqrt();
        let d = Frame::new(n).to_world(Vec3::new(r * c, r * s, u[0].sqrt()));
        let first = self.accel.body(shape..shape + 1).first;
        Ray::new(surface.p, d).from_prim(Prim { instance: WORLD, number: first + triangle })
    }

    /// Follows one path.
    fn follow(&self, rng: &mut Stream, sums: &mut [f64], cuts: &mut Vec<f64>) -> Result<bool, Error> {
        let bodies = self.e.bodies.len() as u32;
        let mut ray = self.emit(rng);
        let mut walker = Walker::new(ray.o, ray.d);
        // The body met last.
        let mut last = None;
        loop {
            let weight = f64::from(walker.beta[0]);
            let Some(hit) = self.accel.nearest(&ray) else {
                sums[usize::from(last.is_some())] += weight;
                return Ok(true);
            };
            if hit.shape >= bodies {
                sums[self.of_detector((hit.shape - bodies) as usize)] += weight;
                return Ok(true);
            }
            let i = hit.shape as usize;
            let body = self.accel.body(hit.shape..hit.shape + 1);
            let mut inside = Inside {
                accel: &self.accel,
                room: &self.rooms[i],
                body,
                shape: hit.shape,
                eta: self.e.bodies[i].n as f32,
                start: None,
            };
            if hit.exiting {
                // Only a source may be inside of a body from the beginning.
                if let Some(last) = last {
                    return Err(self.overlap(last, hit.shape));
                }
                // Light may be reflected for ever in a clear body, since nothing there changes its direction.
                if self.media[i].sigma_t[0] == 0.0 && inside.eta != 1.0 {
                    return Err(Error::Trapped { body: self.e.bodies[i].name.clone() });
                }
            } else {
                let surface = self.accel.surface(&ray, &hit);
                walker.p = surface.p;
                let at = self.of_body(i);
                sums[at] += weight;
                let (d, through) = smooth_boundary(walker.d, -surface.ng, 1.0 / inside.eta, rng);
                walker.d = d;
                if !through {
                    last = Some(hit.shape);
                    ray = Ray::new(walker.p, walker.d).from_prim(hit.prim).facing(Facing::Entering(body));
                    continue;
                }
                sums[at + 1] += weight;
                inside.start = Some(hit);
            }
            last = Some(hit.shape);
            walker.room = 0.0;
            let mut recorder = Recorder {
                sums: &mut *sums,
                cuts: &mut *cuts,
                fluence: self.fluence.as_ref(),
                absorption: self.absorption.as_ref(),
                body: self.of_body(i),
                sigma_a: f64::from(self.media[i].sigma_a[0]),
            };
            let limits = Limits { roulette: Roulette::default(), collisions: self.e.max_collisions };
            match walk(&inside, &self.media[i], &limits, &mut walker, &mut recorder, rng) {
                Outcome::Left(Exit::Outside(hit)) => {
                    ray = Ray::new(walker.p, walker.d).from_prim(hit.prim).facing(Facing::Entering(body));
                }
                Outcome::Left(Exit::Foreign(other)) => return Err(self.overlap(i as u32, other)),
                Outcome::Ended if walker.collisions >= self.e.max_collisions => {
                    sums[3] += f64::from(walker.beta[0]);
                    return Ok(true);
                }
                Outcome::Ended => return Ok(true),
                Outcome::Lost => return Ok(false),
            }
        }
    }
}

/// Returns the sums of the areas of a mesh's triangles, one by one.
fn areas(shape: &Shape) -> Vec<f64> {
    let mesh = shape.mesh().expect("checked to be a mesh");
    let mut sum = 0.0;
    (0..mesh.indices().len() as u32)
        .map(|i| {
            let [a, b, c] = mesh.corners(i).map(Vec3::as_dvec3);
            sum += 0.5 * (b - a).cross(c - a).length();
            sum
        })
        .collect()
}

/// Follows the experiment's paths and returns what they did; the same bits on any number of threads.
///
/// *Errors*: what [`Bodies::check`] finds; bodies or detectors that overlap or touch.
pub fn run(e: &Bodies) -> Result<Results, Error> {
    e.check()?;
    let ready = Ready::new(e);
    let (mut mean, mut square, mut lost, mut done) = (vec![0.0; ready.sums], vec![0.0; ready.sums], 0, 0.0);
    for first in (0..BATCHES).step_by(GROUP as usize) {
        let group: Vec<Result<(Vec<f64>, u64), Error>> =
            (first..first + GROUP).into_par_iter().map(|b| batch(&ready, b)).collect();
        for b in group {
            let (sums, more) = b?;
            lost += more;
            done += 1.0;
            // Welford's update, batch by batch.
            for ((m, s), x) in mean.iter_mut().zip(&mut square).zip(sums) {
                let d = x - *m;
                *m += d / done;
                *s += d * (x - *m);
            }
        }
    }
    Ok(collect(&ready, &mean, &square, lost))
}

/// Follows the paths of one batch; sums are per path.
fn batch(ready: &Ready<'_>, b: u64) -> Result<(Vec<f64>, u64), Error> {
    let e = ready.e;
    let split = |k: u64| (u128::from(k) * u128::from(e.photons) / u128::from(BATCHES)) as u64;
    let (first, end) = (split(b), split(b + 1));
    let (mut sums, mut lost, mut cuts) = (vec![0.0; ready.sums], 0, Vec::new());
    for i in first..end {
        let mut rng = Stream::new(&[e.seed, i]);
        if !ready.follow(&mut rng, &mut sums, &mut cuts)? {
            lost += 1;
        }
    }
    sums[2] = (0..e.bodies.len()).map(|i| sums[ready.of_body(i) + 2]).sum();
    sums.iter_mut().for_each(|x| *x /= (end - first) as f64);
    Ok((sums, lost))
}

/// Returns the results by name.
fn collect(ready: &Ready<'_>, mean: &[f64], square: &[f64], lost: u64) -> Results {
    let e = ready.e;
    let n = BATCHES as f64;
    let estimate = |i: usize, measure: f64| Estimate {
        mean: mean[i] / measure,
        std_err: (square[i] / (n - 1.0) / n).sqrt() / measure,
        n: e.photons,
    };
    let unit = e.unit.symbol();
    let scalar =
        |name: String, about: &str, unit: &str, value| Scalar { name, about: about.into(), unit: unit.into(), value };
    let mut scalars: Vec<Scalar> = SCALARS
        .iter()
        .enumerate()
        .map(|(i, (name, about))| scalar((*name).into(), about, "1", estimate(i, 1.0)))
        .collect();
    for (k, d) in e.detectors.iter().enumerate() {
        let about = "light that met the detector";
        scalars.push(scalar(format!("detected.{}", d.name), about, "1", estimate(ready.of_detector(k), 1.0)));
    }
    for (i, b) in e.bodies.iter().enumerate() {
        for (k, (name, about, length)) in PER_BODY.iter().enumerate() {
            let unit = if *length { unit } else { "1" };
            scalars.push(scalar(format!("{name}.{}", b.name), about, unit, estimate(ready.of_body(i) + k, 1.0)));
        }
    }
    if matches!(e.light, Light::Uniform | Light::Parallel { .. }) {
        let radius = Estimate { mean: f64::from(ready.radius), std_err: 0.0, n: e.photons };
        scalars.push(scalar(
            "radius".into(),
            "radius of the ball around everything that the light falls on",
            unit,
            radius,
        ));
    }
    let mut grids = Vec::new();
    for (name, cells, grid_unit) in [
        ("fluence_xyz", &ready.fluence, format!("1/{unit}^2")),
        ("absorption_xyz", &ready.absorption, format!("1/{unit}^3")),
    ] {
        let Some(cells) = cells else { continue };
        let axis = |k: usize, quantity, name| Axis {
            quantity,
            name,
            unit: unit.into(),
            edges: (0..=cells.count[k]).map(|i| cells.min[k] + cells.size * i as f64).collect(),
        };
        grids.push(GridResult {
            name,
            unit: grid_unit,
            axes: vec![axis(0, Quantity::X, "x"), axis(1, Quantity::Y, "y"), axis(2, Quantity::Z, "z")],
            cells: (0..cells.total()).map(|c| estimate(cells.offset + c, cells.size.powi(3))).collect(),
            outside: estimate(cells.offset + cells.total(), 1.0),
        });
    }
    Results { photons: e.photons, seed: e.seed, lost, scalars, grids }
}
