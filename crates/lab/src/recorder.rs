//! Adds the events of walks to the sums of a batch.

use moonmilk_core::{Random, Spectrum};
use moonmilk_walk::domain::planar::Face;
use moonmilk_walk::layers::StackTally;
use moonmilk_walk::{Medium, Tally, Walker};

use crate::plan::{Event, Grid, Plan, Quantity};

/// Speed of light in vacuum \[mm/ps\].
const LIGHT: f64 = 0.299_792_458;

/// What is true of a layer for all walks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerFacts {
    pub top: f64,
    pub n: f64,
    pub sigma_a: f64,
}

/// Records walks one after another.
pub(crate) struct Recorder<'a> {
    pub sums: &'a mut [f64],
    layers: &'a [LayerFacts],
    exits: Vec<&'a Grid>,
    absorbed: Vec<&'a Grid>,
    fluence: Vec<&'a Grid>,
    /// Length unit in mm.
    unit: f64,
    layer: usize,
    path: f64,
    optical: f64,
    partial: Vec<f64>,
    /// Distances along a flight at which it changes its cell.
    cuts: Vec<f64>,
}

/// Coordinates of an event, by quantity.
struct At {
    x: f64,
    y: f64,
    depth: f64,
    angle: f64,
    path: f64,
    time: f64,
    collisions: f64,
}

impl At {
    fn get(&self, q: Quantity) -> f64 {
        match q {
            Quantity::Radius => self.x.hypot(self.y),
            Quantity::Depth | Quantity::Z => self.depth,
            Quantity::Angle => self.angle,
            Quantity::X => self.x,
            Quantity::Y => self.y,
            Quantity::Path => self.path,
            Quantity::Time => self.time,
            Quantity::Collisions => self.collisions,
        }
    }
}

/// Returns the edges whose image under a rising function lies strictly between a and b; none if a = b lies on one.
fn between(edges: &[f64], a: f64, b: f64, f: impl Fn(f64) -> f64) -> &[f64] {
    let first = edges.partition_point(|&e| f(e) <= a);
    &edges[first..edges.partition_point(|&e| f(e) < b).max(first)]
}

/// Adds a weight to the cell of an event.
fn score(sums: &mut [f64], grid: &Grid, at: &At, weight: f64) {
    let mut cell = 0;
    for axis in &grid.axes {
        match axis.cell(at.get(axis.quantity)) {
            Some(i) => cell = cell * axis.cells() + i,
            None => {
                sums[grid.offset + grid.cells()] += weight;
                return;
            }
        }
    }
    sums[grid.offset + cell] += weight;
}

impl<'a> Recorder<'a> {
    pub fn new(plan: &'a Plan, layers: &'a [LayerFacts], unit: f64, sums: &'a mut [f64]) -> Self {
        let of = |events: &[Event]| plan.grids.iter().filter(|g| events.contains(&g.event)).collect();
        Self {
            sums,
            layers,
            exits: of(&[Event::Reflected, Event::Transmitted]),
            absorbed: of(&[Event::Absorbed]),
            fluence: of(&[Event::Fluence]),
            unit,
            layer: 0,
            path: 0.0,
            optical: 0.0,
            partial: vec![0.0; layers.len()],
            cuts: Vec::new(),
        }
    }

    /// Begins a new walk.
    pub fn begin(&mut self) {
        self.path = 0.0;
        self.optical = 0.0;
        self.partial.fill(0.0);
    }

    /// Records a walk that left through a face; `specular` is where unscattered light above counts.
    pub fn leave(&mut self, walker: &Walker<1>, face: Face) {
        let weight = f64::from(walker.beta[0]);
        let scattered = walker.collisions > 0;
        let (scalar, event) = match (face, scattered) {
            (Face::Front, false) => (0, None),
            (Face::Front, true) => (1, Some(Event::Reflected)),
            (Face::Back, true) => (2, Some(Event::Transmitted)),
            (Face::Back, false) => (3, Some(Event::Transmitted)),
        };
        self.sums[scalar] += weight;
        if scalar == 1 {
            for (i, l) in self.partial.iter().enumerate() {
                self.sums[Plan::of_layer(i, 2)] += weight * l;
            }
        }
        let Some(event) = event else { return };
        if self.exits.is_empty() {
            return;
        }
        let at = At {
            x: f64::from(walker.p.x),
            y: f64::from(walker.p.y),
            depth: 0.0,
            angle: f64::from(walker.d.z.abs().min(1.0)).acos(),
            path: self.path,
            time: self.optical * self.unit / LIGHT,
            collisions: f64::from(walker.collisions),
        };
        for grid in self.exits.iter().filter(|g| g.event == event) {
            score(self.sums, grid, &at, weight);
        }
    }

    /// Spreads a flight of weight w over the cells that it crosses.
    fn spread(&mut self, walker: &Walker<1>, t: f64) {
        let (p, d) = (walker.p.as_dvec3(), walker.d.as_dvec3());
        let z = p.z + self.layers[self.layer].top;
        let weight = f64::from(walker.beta[0]);
        for grid in &self.fluence {
            // Collect where the flight crosses planes and cylinders between cells.
            self.cuts.clear();
            for axis in &grid.axes {
                match axis.quantity {
                    Quantity::Depth => {
                        let (a, b) = (z.min(z + t * d.z), z.max(z + t * d.z));
                        self.cuts.extend(between(&axis.edges, a, b, |e| e).iter().map(|e| (e - z) / d.z));
                    }
                    Quantity::Radius => {
                        let (a, b, c) = (d.x * d.x + d.y * d.y, p.x * d.x + p.y * d.y, p.x * p.x + p.y * p.y);
                        if a > 0.0 {
                            let closest = (-b / a).clamp(0.0, t);
                            let square = |s: f64| c + s * (2.0 * b + s * a);
                            let (least, most) = (square(closest), square(0.0).max(square(t)));
                            for e in between(&axis.edges, least, most, |e| e * e) {
                                let root = (b * b - a * (c - e * e)).max(0.0).sqrt();
                                self.cuts.extend([(-b - root) / a, (-b + root) / a]);
                            }
                        }
                    }
                    _ => {}
                }
            }
            self.cuts.retain(|s| *s > 0.0 && *s < t);
            self.cuts.sort_unstable_by(f64::total_cmp);
            self.cuts.push(t);
            let mut from = 0.0;
            for &to in &self.cuts {
                let s = 0.5 * (from + to);
                let at = At {
                    x: p.x + s * d.x,
                    y: p.y + s * d.y,
                    depth: z + s * d.z,
                    angle: 0.0,
                    path: 0.0,
                    time: 0.0,
                    collisions: 0.0,
                };
                score(self.sums, grid, &at, weight * (to - from));
                from = to;
            }
        }
    }
}

impl<R: Random, P> Tally<1, R, P> for Recorder<'_> {
    #[inline]
    fn flight(&mut self, walker: &Walker<1>, t: f32) {
        let t = f64::from(t);
        let facts = self.layers[self.layer];
        self.path += t;
        self.optical += facts.n * t;
        self.partial[self.layer] += t;
        self.sums[Plan::of_layer(self.layer, 1)] += facts.sigma_a * f64::from(walker.beta[0]) * t;
        if !self.fluence.is_empty() {
            self.spread(walker, t);
        }
    }

    #[inline]
    fn collision(&mut self, walker: &mut Walker<1>, medium: &Medium<1, P>, arrived: Spectrum<1>, _rng: &mut R) {
        let weight = f64::from(arrived[0] * medium.sigma_a[0]);
        self.sums[Plan::of_layer(self.layer, 0)] += weight;
        if self.absorbed.is_empty() || weight == 0.0 {
            return;
        }
        let at = At {
            x: f64::from(walker.p.x),
            y: f64::from(walker.p.y),
            depth: f64::from(walker.p.z) + self.layers[self.layer].top,
            angle: 0.0,
            path: 0.0,
            time: 0.0,
            collisions: 0.0,
        };
        for grid in &self.absorbed {
            score(self.sums, grid, &at, weight);
        }
    }
}

impl<R: Random, P> StackTally<R, P> for Recorder<'_> {
    fn enter(&mut self, layer: usize) {
        self.layer = layer;
    }
}

#[cfg(test)]
mod tests {
    use super::between;

    #[test]
    fn flights_along_an_edge_cross_none() {
        let edges = [0.0, 1.0, 2.0, 3.0];
        assert_eq!(between(&edges, 1.0, 1.0, |e| e), [0.0; 0]);
        assert_eq!(between(&edges, 0.5, 2.5, |e| e), [1.0, 2.0]);
        assert_eq!(between(&edges, 1.0, 2.0, |e| e), [0.0; 0]);
        assert_eq!(between(&edges, 0.5, 5.0, |e| e * e), [1.0, 2.0]);
    }
}
