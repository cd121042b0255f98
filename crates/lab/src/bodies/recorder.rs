//! Adds what light does in and around bodies to the sums of a batch.

use moonmilk_core::{DVec3, Random, Spectrum};
use moonmilk_walk::{Medium, Tally, Walker};

/// What is summed for the whole.
pub(super) const SCALARS: [(&str, &str); 4] = [
    ("missed", "light that met neither a body nor a detector"),
    ("escaped", "light that met a body and flew away in the end"),
    ("absorbed", "light absorbed in all bodies, by collisions"),
    ("unfinished", "light still inside after the largest number of collisions"),
];

/// What is summed for each body; units are those of a length where marked.
pub(super) const PER_BODY: [(&str, &str, bool); 5] = [
    ("incident", "light that arrived at the body from outside, each time", false),
    ("entered", "light that was not reflected there", false),
    ("absorbed", "light absorbed in the body, by collisions", false),
    ("absorbed_track", "the same, by track length", false),
    ("path", "integral of the fluence over the body: path length times weight", true),
];

/// A grid of cubic cells.
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// Lower corner.
    pub min: DVec3,
    /// Side of a cell.
    pub size: f64,
    /// Cells along x, y and z.
    pub count: [usize; 3],
    /// Place of its first sum; the one behind its last is for what lies outside by rounding.
    pub offset: usize,
}

impl Cells {
    pub fn total(&self) -> usize {
        self.count.iter().product()
    }

    /// Returns the place of the sum for a point.
    fn place(&self, p: DVec3) -> usize {
        let at = (p - self.min) / self.size;
        let mut index = 0;
        for k in 0..3 {
            let i = at[k].floor();
            if !(i >= 0.0 && i < self.count[k] as f64) {
                return self.offset + self.total();
            }
            index = index * self.count[k] + i as usize;
        }
        self.offset + index
    }

    /// Calls `add` with the place of each cell that a flight crosses and the length in it.
    fn cross(&self, p: DVec3, d: DVec3, t: f64, cuts: &mut Vec<f64>, mut add: impl FnMut(usize, f64)) {
        cuts.clear();
        for k in 0..3 {
            if d[k] == 0.0 {
                continue;
            }
            // Planes strictly between the ends.
            let (a, b) = ((p[k] - self.min[k]) / self.size, (p[k] + t * d[k] - self.min[k]) / self.size);
            let (low, high) = (a.min(b).max(0.0).ceil(), a.max(b).min(self.count[k] as f64).floor());
            let mut plane = low;
            while plane <= high {
                cuts.push((self.min[k] + plane * self.size - p[k]) / d[k]);
                plane += 1.0;
            }
        }
        cuts.retain(|s| *s > 0.0 && *s < t);
        cuts.sort_unstable_by(f64::total_cmp);
        cuts.push(t);
        let mut from = 0.0;
        for &to in cuts.iter() {
            add(self.place(p + d * (0.5 * (from + to))), to - from);
            from = to;
        }
    }
}

/// Records the walk in one body.
pub(super) struct Recorder<'a> {
    pub sums: &'a mut [f64],
    pub cuts: &'a mut Vec<f64>,
    pub fluence: Option<&'a Cells>,
    pub absorption: Option<&'a Cells>,
    /// Place of the body's first sum.
    pub body: usize,
    pub sigma_a: f64,
}

impl<R: Random> Tally<1, R> for Recorder<'_> {
    #[inline]
    fn flight(&mut self, walker: &Walker<1>, t: f32) {
        let (weight, t) = (f64::from(walker.beta[0]), f64::from(t));
        self.sums[self.body + 3] += self.sigma_a * weight * t;
        self.sums[self.body + 4] += weight * t;
        if let Some(cells) = self.fluence {
            let (p, d) = (walker.p.as_dvec3(), walker.d.as_dvec3());
            let sums = &mut *self.sums;
            cells.cross(p, d, t, self.cuts, |place, length| sums[place] += weight * length);
        }
    }

    #[inline]
    fn collision(&mut self, walker: &mut Walker<1>, medium: &Medium<1>, arrived: Spectrum<1>, _rng: &mut R) {
        let weight = f64::from(arrived[0] * medium.sigma_a[0]);
        self.sums[self.body + 2] += weight;
        if let Some(cells) = self.absorption {
            self.sums[cells.place(walker.p.as_dvec3())] += weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flights_are_spread_over_the_cells_that_they_cross() {
        let cells = Cells { min: DVec3::new(-1.0, 0.0, 0.0), size: 0.5, count: [4, 2, 3], offset: 7 };
        let mut sums = vec![0.0; 7 + 25];
        let (p, d) = (DVec3::new(-0.9, 0.1, 0.2), DVec3::new(2.0, 0.5, 0.7).normalize());
        cells.cross(p, d, 1.6, &mut Vec::new(), |place, length| sums[place] += length);
        assert!((sums.iter().sum::<f64>() - 1.6).abs() < 1e-12 && sums[..7].iter().all(|s| *s == 0.0));
        // Compare with points along the flight.
        let mut points = vec![0.0; sums.len()];
        let n = 200_000;
        (0..n).for_each(|i| points[cells.place(p + d * (1.6 * (i as f64 + 0.5) / n as f64))] += 1.6 / n as f64);
        for (a, b) in sums.iter().zip(&points) {
            assert!((a - b).abs() < 3.0 * 1.6 / n as f64, "{a} {b}");
        }
        // Along a plane between cells, and out of the grid.
        let mut length = 0.0;
        cells.cross(DVec3::new(-0.5, 0.5, 0.5), DVec3::X, 5.0, &mut Vec::new(), |_, l| length += l);
        assert!((length - 5.0).abs() < 1e-12);
        assert_eq!(cells.place(DVec3::new(5.0, 0.5, 0.5)), 7 + 24);
    }
}
