//! Which cells are recorded, and what they mean.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::error::Error;
use crate::experiment::{Bins, Experiment};

/// Most cells of one run: beyond it the memory of the batches would be gigabytes.
const MOST_CELLS: usize = 4_000_000;

/// The event that a grid records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Light leaves above, scattered.
    Reflected,
    /// Light leaves below, scattered or not.
    Transmitted,
    /// Light is absorbed (collision estimator).
    Absorbed,
    /// Light flies (track-length estimator).
    Fluence,
}

/// The quantity of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Distance from the z axis.
    Radius,
    /// Depth.
    Depth,
    /// Exit angle from the normal.
    Angle,
    /// x of the exit point.
    X,
    /// y of the exit point.
    Y,
    /// z of a point in a body.
    Z,
    /// Path length.
    Path,
    /// Time of flight.
    Time,
    /// Number of collisions.
    Collisions,
}

/// An axis of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What it counts.
    pub quantity: Quantity,
    /// Name in results.
    pub name: &'static str,
    /// Unit in results.
    pub unit: String,
    /// Edges of the cells, one more than cells.
    pub edges: Vec<f64>,
}

impl Axis {
    /// Returns the number of cells.
    pub fn cells(&self) -> usize {
        self.edges.len() - 1
    }

    /// Returns the cell of a value.
    #[inline]
    pub(crate) fn cell(&self, x: f64) -> Option<usize> {
        let n = self.cells();
        let (first, last) = (self.edges[0], self.edges[n]);
        if !(x >= first && x < last) {
            return None;
        }
        if self.quantity == Quantity::Collisions {
            return Some((x as u32).ilog2() as usize);
        }
        // Equal bins begin at 0 (or on the other side of it), those of equal ratio above it.
        let t = if first > 0.0 { (x / first).ln() / (last / first).ln() } else { (x - first) / (last - first) };
        Some(((t * n as f64) as usize).min(n - 1))
    }

    /// Returns the measure of a cell: width, area of a ring, solid angle; 1 for counts.
    fn measure(&self, i: usize) -> f64 {
        let (a, b) = (self.edges[i], self.edges[i + 1]);
        match self.quantity {
            Quantity::Radius => PI * (b * b - a * a),
            Quantity::Angle => 2.0 * PI * (a.cos() - b.cos()),
            Quantity::Collisions => 1.0,
            _ => b - a,
        }
    }
}

/// A grid of cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Name in results.
    pub name: &'static str,
    /// Unit of the values.
    pub unit: String,
    /// What it records.
    pub event: Event,
    /// Its axes, slowest first.
    pub axes: Vec<Axis>,
    /// Place of its first cell among all sums; the sum behind its last cell holds what fell outside.
    pub(crate) offset: usize,
}

impl Grid {
    /// Returns the number of cells.
    pub fn cells(&self) -> usize {
        self.axes.iter().map(Axis::cells).product()
    }

    /// Returns the measure of a cell, which sums are divided by.
    pub(crate) fn measure(&self, mut cell: usize) -> f64 {
        let mut m = 1.0;
        for axis in self.axes.iter().rev() {
            m *= axis.measure(cell % axis.cells());
            cell /= axis.cells();
        }
        m
    }
}

/// The scalars that every run records, before those of the layers.
pub(crate) const SCALARS: [(&str, &str); 6] = [
    ("specular", "light reflected at the surface, and out of the stack without any collision"),
    ("reflected", "light that left above after collisions (diffuse reflectance)"),
    ("transmitted", "light that left below after collisions (diffuse transmittance)"),
    ("ballistic", "light that left below without any collision"),
    ("absorbed", "light absorbed"),
    ("unfinished", "light still inside after the largest number of collisions"),
];

/// What is recorded per layer.
pub(crate) const PER_LAYER: [(&str, &str); 3] = [
    ("absorbed", "light absorbed in the layer, by collisions"),
    ("absorbed_track", "the same, by track length"),
    ("path", "path length in the layer of light that left above, times its weight"),
];

/// All sums of a run: scalars, layers, grids.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The grids.
    pub grids: Vec<Grid>,
    /// Number of sums.
    pub(crate) sums: usize,
}

impl Plan {
    /// Lays out what an experiment records.
    ///
    /// *Errors*: too many cells.
    pub fn new(e: &Experiment) -> Result<Self, Error> {
        let unit = e.unit.symbol();
        let even = |a: f64, b: f64, n: usize| (0..=n).map(|i| a + (b - a) * i as f64 / n as f64).collect::<Vec<_>>();
        let axis = |quantity, name, unit: &str, edges| Axis { quantity, name, unit: unit.into(), edges };
        let t = &e.tallies;
        let from_zero = |b: Bins| match b.first {
            0.0 => even(0.0, b.max, b.bins),
            first => (0..=b.bins).map(|i| first * (b.max / first).powf(i as f64 / b.bins as f64)).collect(),
        };
        let r = t.radius.map(|b| axis(Quantity::Radius, "r", unit, from_zero(b)));
        let z = t.depth.map(|b| axis(Quantity::Depth, "z", unit, from_zero(b)));
        let angle = t.angle.map(|n| axis(Quantity::Angle, "angle", "rad", even(0.0, FRAC_PI_2, n)));
        let path = t.path.map(|b| axis(Quantity::Path, "path", unit, from_zero(b)));
        let time = t.time.map(|b| axis(Quantity::Time, "time", "ps", from_zero(b)));
        let n = t
            .collisions
            .map(|n| axis(Quantity::Collisions, "collisions", "1", (0..=n).map(|k| (k as f64).exp2()).collect()));
        let plane = t.plane.map(|b| {
            let edges = even(-b.max, b.max, b.bins);
            (axis(Quantity::X, "x", unit, edges.clone()), axis(Quantity::Y, "y", unit, edges))
        });
        let mut plan = Self { grids: Vec::new(), sums: SCALARS.len() + PER_LAYER.len() * e.layers.len() };
        let mut cells = 0usize;
        let mut add = |name: &'static str, unit: String, event: Event, axes: Vec<Axis>| {
            let grid = Grid { name, unit, event, axes, offset: plan.sums };
            let count = grid.axes.iter().fold(1usize, |n, a| n.saturating_mul(a.cells()));
            cells = cells.saturating_add(count);
            plan.sums = plan.sums.saturating_add(count).saturating_add(1);
            plan.grids.push(grid);
        };
        let (area, volume) = (format!("1/{unit}^2"), format!("1/{unit}^3"));
        for (event, names) in [
            (
                Event::Reflected,
                [
                    "reflectance_r",
                    "reflectance_angle",
                    "reflectance_r_angle",
                    "reflectance_xy",
                    "reflectance_path",
                    "reflectance_time",
                    "reflectance_r_time",
                    "reflectance_collisions",
                ],
            ),
            (
                Event::Transmitted,
                [
                    "transmittance_r",
                    "transmittance_angle",
                    "transmittance_r_angle",
                    "transmittance_xy",
                    "transmittance_path",
                    "transmittance_time",
                    "transmittance_r_time",
                    "transmittance_collisions",
                ],
            ),
        ] {
            if let Some(r) = &r {
                add(names[0], area.clone(), event, vec![r.clone()]);
            }
            if let Some(a) = &angle {
                add(names[1], "1/sr".into(), event, vec![a.clone()]);
            }
            if let (Some(r), Some(a)) = (&r, &angle) {
                add(names[2], format!("1/({unit}^2 sr)"), event, vec![r.clone(), a.clone()]);
            }
            if let Some((x, y)) = &plane {
                add(names[3], area.clone(), event, vec![x.clone(), y.clone()]);
            }
            if let Some(p) = &path {
                add(names[4], format!("1/{unit}"), event, vec![p.clone()]);
            }
            if let Some(t) = &time {
                add(names[5], "1/ps".into(), event, vec![t.clone()]);
            }
            if let (Some(r), Some(t)) = (&r, &time) {
                add(names[6], format!("1/({unit}^2 ps)"), event, vec![r.clone(), t.clone()]);
            }
            if let Some(n) = &n {
                add(names[7], "1".into(), event, vec![n.clone()]);
            }
        }
        if let Some(z) = &z {
            add("absorption_z", format!("1/{unit}"), Event::Absorbed, vec![z.clone()]);
            add("fluence_z", "1".into(), Event::Fluence, vec![z.clone()]);
        }
        if let (Some(r), Some(z)) = (&r, &z) {
            add("absorption_rz", volume, Event::Absorbed, vec![r.clone(), z.clone()]);
            add("fluence_rz", area, Event::Fluence, vec![r.clone(), z.clone()]);
        }
        if cells > MOST_CELLS {
            return Err(Error::TooManyCells { cells, most: MOST_CELLS });
        }
        Ok(plan)
    }

    /// Returns the place of a layer's sum, `which` of [`PER_LAYER`].
    pub(crate) fn of_layer(layer: usize, which: usize) -> usize {
        SCALARS.len() + PER_LAYER.len() * layer + which
    }
}
