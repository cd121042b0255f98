//! A lower bound of the distance to the surface, in one memory access.
//!
//! A walk in a dense medium asks before every flight whether it can end before the wall. The answer comes from a grid
//! over the body: each cell holds a lower bound of the distance from any of its points to the nearest surface.
//!
//! 1. Mark the cells that a surface passes through (never too few).
//! 2. For every cell, find the squared distance of the nearest marked cell as boxes, not as centres: per axis
//!    `max(|i - j| - 1, 0)`, which is the plain distance to the marks grown by one cell, so that the separable exact
//!    Euclidean distance transform \[Felzenszwalb2012\] applies.
//! 3. Store it in a byte, rounded down, on a quadratic scale (fine near the surface).
//!
//! Balls need no grid: their distance is in closed form.

use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

use moonmilk_core::Vec3;
use moonmilk_core::glam::{IVec3, UVec3};
use rayon::prelude::*;

use crate::bounds::Bounds;
use crate::shape::{Form, Shape};

/// Default number of cells: 128^3, two megabytes.
pub const DEFAULT_CELLS: usize = 1 << 21;
/// Largest number of cells along an axis.
const MAX_SIDE: u32 = 1024;
/// Distances saturate here [cells]; the square fits 16 bits.
const FAR: u32 = 255;
/// No surface in reach.
const NOWHERE: u16 = u16::MAX;
/// What rounding may move a point or a surface by, in cells: coordinates up to 1024 in f32 are good to 1e-4.
const ROUNDING: f32 = 1e-3;

/// A lower bound of the distance to a set of surfaces, inside a box.
#[derive(Clone, Debug)]
pub struct Clearance {
    bounds: Bounds,
    balls: Vec<(Vec3, f32)>,
    grid: Option<Grid>,
}

#[derive(Clone, Debug)]
struct Grid {
    min: Vec3,
    inv_cell: f32,
    size: UVec3,
    size_f: Vec3,
    /// Bound of a cell is its byte squared times this [L].
    scale: f32,
    /// Cells in the order y, z, x (slowest first).
    codes: Vec<u8>,
}

impl Clearance {
    /// Builds the bound over a box (that of a body) from all surfaces that may lie in it, with about `max_cells` bytes.
    ///
    /// *Use when* many queries follow: 2^21 cells take about 50 ms on two cores. The work is linear in cells and triangles.
    pub fn build(shapes: &[&Shape], bounds: Bounds, max_cells: usize) -> Self {
        let ball = |s: &&Shape| s.quadric().and_then(|q| q.as_ball()).map(|(c, r)| (c.as_vec3(), r as f32));
        let mut balls: Vec<_> = shapes.iter().filter_map(ball).collect();
        let few = balls.len() <= 4;
        if !few {
            balls.clear();
        }
        let others: Vec<&Shape> =
            shapes.iter().copied().filter(|s| !(few && ball(s).is_some() || outside(s, &bounds))).collect();
        let mark = |marks: &Marks| others.iter().for_each(|s| marks.add(s));
        let grid = if others.is_empty() { None } else { Grid::build(mark, bounds, max_cells.max(1)) };
        Self { bounds, balls, grid }
    }

    /// Builds the bound over a box from what `mark` marks; `None` if that is nothing.
    pub(crate) fn of_marks(mark: impl FnOnce(&Marks), bounds: Bounds, max_cells: usize) -> Option<Self> {
        let mut any = false;
        let mark = |marks: &Marks| {
            mark(marks);
            any = marks.cells.iter().any(|c| c.load(Relaxed) != 0);
        };
        let grid = Grid::build(mark, bounds, max_cells.max(1));
        any.then_some(Self { bounds, balls: Vec::new(), grid })
    }

    /// Returns a lower bound of the distance from p to the surfaces \[L\]; 0 outside the box, and for NaN.
    #[inline]
    pub fn bound(&self, p: Vec3) -> f32 {
        let mut d = match &self.grid {
            Some(g) => g.bound(p),
            None if self.bounds.contains(p) => f32::INFINITY,
            None => 0.0,
        };
        for &(c, r) in &self.balls {
            // Rounding of centre, radius and distance: a few 2^-24 of the coordinates involved.
            let rounding = 1e-6 * (r + c.abs().max_element());
            d = d.min((p.distance(c) - r).abs() - rounding);
        }
        d.max(0.0)
    }

    /// Returns about the largest distance to a surface that there is in the box \[L\].
    pub fn depth(&self) -> f32 {
        self.grid.as_ref().map_or(0.5 * self.bounds.extent().min_element(), |g| 255.0 * 255.0 * g.scale)
    }

    /// Returns how far below the true distance a bound may be, near surfaces: 0 for balls, else what cells and their corners add up to \[L\].
    pub fn coarseness(&self) -> f32 {
        self.grid.as_ref().map_or(0.0, |g| 3.5 / g.inv_cell)
    }

    /// Returns the bytes held.
    pub fn memory(&self) -> usize {
        size_of::<Self>() + self.balls.capacity() * 16 + self.grid.as_ref().map_or(0, |g| g.codes.capacity())
    }

    /// Returns the number of cells along x, y and z; zero if balls are all there is.
    pub fn size(&self) -> [u32; 3] {
        self.grid.as_ref().map_or([0; 3], |g| g.size.to_array())
    }
}

fn outside(s: &Shape, b: &Bounds) -> bool {
    let o = s.bounds();
    o.min.cmpgt(b.max).any() || o.max.cmplt(b.min).any()
}

impl Grid {
    fn build(mark: impl FnOnce(&Marks), bounds: Bounds, max_cells: usize) -> Option<Self> {
        let extent = bounds.extent();
        let longest = extent.max_element();
        if bounds.is_empty() || !longest.is_finite() || longest <= 0.0 {
            return None;
        }
        // Find the finest cubic cell that the budget allows.
        let size_of_cell = |cell: f32| (extent / cell).floor().as_uvec3() + 1;
        let fits = |cell: f32| {
            let s = size_of_cell(cell);
            s.max_element() <= MAX_SIDE && s.to_array().iter().map(|&n| n as usize).product::<usize>() <= max_cells
        };
        let (mut fine, mut coarse) = (longest / MAX_SIDE as f32, longest * 1.01);
        for _ in 0..40 {
            let middle = 0.5 * (fine + coarse);
            if fits(middle) { coarse = middle } else { fine = middle }
        }
        let (cell, size) = (coarse, size_of_cell(coarse));
        let inv_cell = 1.0 / cell;

        // Mark the cells with surface in them, then transform along x, y and z.
        let marks = Marks::new(bounds.min, inv_cell, size);
        mark(&marks);
        let squares = along_z(along_y(along_x(&marks), size), size);

        // Encode: the largest bound maps to 255, smaller ones to the root of their share, rounded down.
        let highest = squares.par_iter().copied().max().unwrap_or(0).min((FAR * FAR) as u16);
        let length = |square: u16| (f32::from(square).sqrt() - 4.0 * ROUNDING).max(0.0);
        let max_length = length(highest).max(f32::MIN_POSITIVE);
        let table: Vec<u8> = (0..=highest).map(|s| (255.0 * (length(s) / max_length).sqrt()).floor() as u8).collect();
        let codes = squares.par_iter().map(|&s| table[s.min(highest) as usize]).collect();
        let scale = cell * max_length / (255.0 * 255.0) * (1.0 - 1e-5);
        Some(Self { min: bounds.min, inv_cell, size, size_f: size.as_vec3(), scale, codes })
    }

    #[inline]
    fn bound(&self, p: Vec3) -> f32 {
        let q = (p - self.min) * self.inv_cell;
        if !(q.cmpge(Vec3::ZERO) & q.cmplt(self.size_f)).all() {
            return 0.0;
        }
        let (x, y, z) = (q.x as usize, q.y as usize, q.z as usize);
        let c = f32::from(self.codes[(y * self.size.z as usize + z) * self.size.x as usize + x]);
        c * c * self.scale
    }
}

/// Cells with surface in them, in the order z, y, x.
pub(crate) struct Marks {
    min: Vec3,
    inv_cell: f32,
    size: UVec3,
    cells: Vec<AtomicU8>,
}

impl Marks {
    fn new(min: Vec3, inv_cell: f32, size: UVec3) -> Self {
        let n = size.x as usize * size.y as usize * size.z as usize;
        Self { min, inv_cell, size, cells: (0..n).map(|_| AtomicU8::new(0)).collect() }
    }

    /// Marks what a shape passes through.
    pub(crate) fn add(&self, shape: &Shape) {
        let local = |p: Vec3| (p - self.min) * self.inv_cell;
        match &shape.form {
            Form::Mesh(m) => (0..m.indices().len() as u32)
                .into_par_iter()
                .with_min_len(4096)
                .for_each(|i| self.add_triangle(m.corners(i).map(local))),
            Form::Quadric(q) => {
                // Test each cell in the quadric's box against the bound of the distance from its centre.
                let b = q.bounds();
                let Some((low, high)) = self.range(local(b.min), local(b.max)) else {
                    return;
                };
                let radius = f64::from((0.5 * 3f32.sqrt() + ROUNDING) / self.inv_cell);
                (low.z..=high.z).into_par_iter().for_each(|z| {
                    for y in low.y..=high.y {
                        for x in low.x..=high.x {
                            let center = (IVec3::new(x, y, z).as_vec3() + 0.5) / self.inv_cell + self.min;
                            if q.is_near(center, radius) {
                                self.set(x, y, z);
                            }
                        }
                    }
                });
            }
        }
    }

    /// Returns the side of a cell \[L\].
    pub(crate) fn cell(&self) -> f32 {
        1.0 / self.inv_cell
    }

    /// Marks all that a box touches.
    pub(crate) fn add_box(&self, b: &Bounds) {
        let Some((low, high)) = self.range((b.min - self.min) * self.inv_cell, (b.max - self.min) * self.inv_cell)
        else {
            return;
        };
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                (low.x..=high.x).for_each(|x| self.set(x, y, z));
            }
        }
    }

    /// Marks what a triangle passes through.
    pub(crate) fn add_corners(&self, corners: [Vec3; 3]) {
        self.add_triangle(corners.map(|p| (p - self.min) * self.inv_cell));
    }

    /// Marks the cells that a triangle (in cell coordinates) may touch.
    fn add_triangle(&self, [a, b, c]: [Vec3; 3]) {
        let Some((low, high)) = self.range(a.min(b).min(c), a.max(b).max(c)) else {
            return;
        };
        let span = high - low;
        if span.max_element() > 4 {
            // Halve the longest edge, so that boxes hug the triangle.
            let (ab, bc, ca) = (a.distance_squared(b), b.distance_squared(c), c.distance_squared(a));
            let (p, q, r) = if ab >= bc.max(ca) {
                (a, b, c)
            } else if bc >= ca {
                (b, c, a)
            } else {
                (c, a, b)
            };
            if p.distance_squared(q) > 1.0 {
                let middle = p.midpoint(q);
                self.add_triangle([p, middle, r]);
                self.add_triangle([middle, q, r]);
                return;
            }
        }
        let n = (b - a).cross(c - a);
        // A cell's corners reach this far from its centre along n; rounding of n is relative to its edges.
        let reach = (0.5 + 2.0 * ROUNDING) * (n.x.abs() + n.y.abs() + n.z.abs());
        let all = span.x + span.y + span.z <= 1;
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let center = IVec3::new(x, y, z).as_vec3() + 0.5;
                    if all || n.dot(center - a).abs() <= reach {
                        self.set(x, y, z);
                    }
                }
            }
        }
    }

    /// Returns the cells (first, last) that a box in cell coordinates touches; `None` outside the grid.
    fn range(&self, low: Vec3, high: Vec3) -> Option<(IVec3, IVec3)> {
        let last = self.size.as_ivec3() - 1;
        let (low, high) = ((low - ROUNDING).floor().as_ivec3(), (high + ROUNDING).floor().as_ivec3());
        if high.cmplt(IVec3::ZERO).any() || low.cmpgt(last).any() {
            return None;
        }
        Some((low.max(IVec3::ZERO), high.min(last)))
    }

    fn set(&self, x: i32, y: i32, z: i32) {
        let i = (z as usize * self.size.y as usize + y as usize) * self.size.x as usize + x as usize;
        self.cells[i].store(1, Relaxed);
    }
}

/// Returns the squared distance along x to the nearest mark, one cell taken off; order z, y, x.
fn along_x(marks: &Marks) -> Vec<u16> {
    let n = marks.size.x as usize;
    let mut out = vec![NOWHERE; marks.cells.len()];
    out.par_chunks_mut(n).zip(marks.cells.par_chunks(n)).with_min_len(256).for_each(|(out, row)| {
        let square = |d: u32| if d > FAR { NOWHERE } else { (d * d) as u16 };
        let mut d = FAR + 2;
        for (o, m) in out.iter_mut().zip(row) {
            d = if m.load(Relaxed) != 0 { 0 } else { d.saturating_add(1).min(FAR + 2) };
            *o = square(d.saturating_sub(1));
        }
        d = FAR + 2;
        for (o, m) in out.iter_mut().zip(row).rev() {
            d = if m.load(Relaxed) != 0 { 0 } else { d.saturating_add(1).min(FAR + 2) };
            *o = (*o).min(square(d.saturating_sub(1)));
        }
    });
    out
}

/// Transforms along y in place; order z, y, x.
fn along_y(mut cells: Vec<u16>, size: UVec3) -> Vec<u16> {
    let (nx, ny) = (size.x as usize, size.y as usize);
    cells.par_chunks_mut(nx * ny).for_each_init(
        || Envelope::new(ny),
        |env, slice| {
            for x in 0..nx {
                env.column((0..ny).map(|y| slice[y * nx + x]));
                env.evaluate(|y, d| slice[y * nx + x] = d);
            }
        },
    );
    cells
}

/// Transforms along z; order z, y, x to y, z, x, so that each thread owns what it writes.
fn along_z(cells: Vec<u16>, size: UVec3) -> Vec<u16> {
    let (nx, ny, nz) = (size.x as usize, size.y as usize, size.z as usize);
    let mut out = vec![0; cells.len()];
    out.par_chunks_mut(nx * nz).enumerate().for_each_init(
        || Envelope::new(nz),
        |env, (y, slice)| {
            for x in 0..nx {
                env.column((0..nz).map(|z| cells[(z * ny + y) * nx + x]));
                env.evaluate(|z, d| slice[z * nx + x] = d);
            }
        },
    );
    out
}

/// The lower envelope of parabolas `f(j) + (i - j)^2` over a column [Felzenszwalb2012, Alg. 1].
struct Envelope {
    column: Vec<u16>,
    /// Vertices of the parabolas on the envelope and where each takes over.
    vertex: Vec<i32>,
    from: Vec<i32>,
}

impl Envelope {
    fn new(n: usize) -> Self {
        Self { column: Vec::with_capacity(n), vertex: Vec::with_capacity(n), from: Vec::with_capacity(n) }
    }

    /// Takes a column, grown by one cell on each side (the minimum of three neighbours).
    fn column(&mut self, values: impl Iterator<Item = u16>) {
        self.column.clear();
        let (mut before, mut here) = (NOWHERE, NOWHERE);
        for (i, after) in values.enumerate() {
            if i > 0 {
                self.column.push(before.min(here).min(after));
            }
            (before, here) = (here, after);
        }
        self.column.push(before.min(here));
    }

    /// Calls `write` with every position and its squared distance, saturated.
    fn evaluate(&mut self, mut write: impl FnMut(usize, u16)) {
        let f = |j: i32| i32::from(self.column[j as usize]);
        let n = self.column.len() as i32;
        self.vertex.clear();
        self.from.clear();
        for q in 0..n {
            if self.column[q as usize] == NOWHERE {
                continue;
            }
            // Drop parabolas that the new one undercuts from where they start.
            let mut start = i32::MIN;
            while let (Some(&v), Some(&from)) = (self.vertex.last(), self.from.last()) {
                // First position where the new parabola is not above: rounded up.
                let s = (f(q) + q * q - f(v) - v * v + 2 * (q - v) - 1).div_euclid(2 * (q - v));
                if s <= from {
                    self.vertex.pop();
                    self.from.pop();
                } else {
                    start = s;
                    break;
                }
            }
            if start < n {
                self.vertex.push(q);
                self.from.push(start);
            }
        }
        let mut k = 0;
        for i in 0..n {
            if self.vertex.is_empty() {
                write(i as usize, NOWHERE);
                continue;
            }
            while k + 1 < self.from.len() && self.from[k + 1] <= i {
                k += 1;
            }
            let v = self.vertex[k];
            let d = f(v) + (i - v) * (i - v);
            write(i as usize, d.min((FAR * FAR) as i32) as u16);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Accel, Quadric, generate};
    use moonmilk_core::{Mat4, Random, Stream};

    /// Checks bound <= distance at random points; returns the mean of both over interior points farther than `far`.
    fn check(accel: &Accel, c: &Clearance, bounds: Bounds, n: usize) -> (f64, f64) {
        let mut r = Stream::new(&[11]);
        let (mut bound, mut exact) = (0.0, 0.0);
        for _ in 0..n {
            let p = bounds.min + bounds.extent() * Vec3::new(r.uniform(), r.uniform(), r.uniform());
            let (b, d) = (c.bound(p), accel.closest_point(p).unwrap().distance);
            assert!(b <= d, "bound {b} above distance {d} at {p}");
            bound += f64::from(b);
            exact += f64::from(d);
        }
        (bound / n as f64, exact / n as f64)
    }

    #[test]
    fn the_transform_equals_brute_force() {
        let mut r = Stream::new(&[12]);
        let mut env = Envelope::new(60);
        for _ in 0..300 {
            let f: Vec<u16> =
                (0..60).map(|_| if r.uniform() < 0.7 { NOWHERE } else { (r.uniform() * 300.0) as u16 }).collect();
            env.column(f.iter().copied());
            env.evaluate(|i, d| {
                let square = |j: usize| {
                    let k = (i.abs_diff(j) as u32).saturating_sub(1);
                    k * k
                };
                let brute = (0..60).filter(|&j| f[j] != NOWHERE).map(|j| u32::from(f[j]) + square(j)).min();
                assert_eq!(u32::from(d), brute.unwrap_or(u32::from(NOWHERE)));
            });
        }
    }

    #[test]
    fn the_bound_of_meshes_is_below_the_distance_and_close_to_it_at_every_scale() {
        for mesh in [
            generate::bumpy_sphere(5, 0.3),
            generate::cuboid(Vec3::splat(-1.0), Vec3::new(1.0, 0.5, 2.0)),
            generate::sheet(20, 0.1),
        ] {
            for scale in [1.0 / 1024.0, 1.0, 1000.0] {
                let m = Mat4::from_scale(Vec3::splat(scale))
                    * Mat4::from_translation(Vec3::new(3.0, -1.0, 0.5))
                    * Mat4::from_rotation_x(0.3);
                let shape = Shape::from(mesh.transformed(&m).unwrap());
                let bounds = shape.bounds();
                let c = Clearance::build(&[&shape], bounds, 1 << 18);
                assert!(c.memory() < (1 << 18) + 4096);
                let (bound, exact) = check(&Accel::build(vec![shape]), &c, bounds, 20_000);
                // Lost on average: half a cell diagonal for the point, half for the surface, a little for the quantisation.
                let cell =
                    f64::from(bounds.extent().max_element()) / f64::from(c.size().iter().copied().max().unwrap());
                assert!(exact - bound < 1.9 * cell, "{bound} of {exact}, cell {cell}");
                assert_eq!(c.bound(bounds.max + bounds.extent()), 0.0);
            }
        }
    }

    #[test]
    fn all_surfaces_inside_the_body_count() {
        let shell = Shape::from(generate::cuboid(Vec3::splat(-1.0), Vec3::splat(1.0)));
        let stretched = Mat4::from_translation(Vec3::new(0.3, 0.0, 0.0)) * Mat4::from_scale(Vec3::new(0.2, 0.4, 0.3));
        let full = |r: f64| crate::QuadricKind::Sphere { radius: r, z_min: -r, z_max: r, phi_max: 7.0 };
        let ellipsoid = Shape::from(Quadric::new(full(1.0), &stretched).unwrap());
        let ball = Shape::from(Quadric::sphere(Vec3::new(-0.5, 0.2, 0.1), 0.25).unwrap());
        let c = Clearance::build(&[&shell, &ellipsoid, &ball], shell.bounds(), 1 << 18);
        // A mesh stands for the ellipsoid, whose closest point has no closed form; its sag is below the rounding down.
        let mesh = Shape::from(generate::bumpy_sphere(6, 0.0).transformed(&stretched).unwrap());
        let bounds = shell.bounds();
        let (bound, exact) = check(&Accel::build(vec![shell, mesh, ball]), &c, bounds, 20_000);
        assert!(bound > 0.7 * exact, "{bound} of {exact}");
    }

    #[test]
    fn a_ball_alone_has_its_distance_in_closed_form() {
        let ball = Shape::from(Quadric::sphere(Vec3::splat(1000.0), 2.0).unwrap());
        let c = Clearance::build(&[&ball], ball.bounds(), DEFAULT_CELLS);
        let b = c.bound(Vec3::new(1001.0, 1000.0, 1000.0));
        // Coordinates near 1000 cost 1e-6 of 1000.
        assert!(b <= 1.0 && b > 0.998 && c.bound(Vec3::ZERO) == 0.0);
    }
}
