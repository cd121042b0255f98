//! The baked form of a profile for rendering: no virtual call, no quadrature, any model.

use super::Profile;
use super::table::RadialTable;

/// A profile as tables: R by cubics of its logarithm, radii by exact inversion of a nearby density.
///
/// *Accuracy*: 1e-3 of R between 1e-3 mean free paths and the radius with 1e-9 of the energy beyond it (test); sampling is unbiased whatever
/// the interpolation: weights are R / density. Negative values of a model are taken as 0 and counted in [`Prepared::negative`].
///
/// Cells are equal steps of the significand, so that the bits of a radius name its cell and no logarithm is taken.
#[derive(Clone, Debug)]
pub struct Prepared {
    table: RadialTable,
    /// Leading bits of the radius of the first cell.
    first: u64,
    /// Coefficients of ln R over the fraction of the cell.
    cells: Vec<[f64; 4]>,
    total: f64,
    negative: usize,
}

/// Bits of the significand that name a cell: 16 cells per octave.
const CELL_BITS: u32 = 4;
/// Bits of the fraction within a cell.
const FRACTION_BITS: u32 = 52 - CELL_BITS;

/// Returns the radius at which a cell begins.
fn radius(key: u64) -> f64 {
    f64::from_bits(key << FRACTION_BITS)
}

impl Prepared {
    /// Bakes a profile.
    pub fn new(profile: &dyn Profile) -> Self {
        let m = profile.medium();
        let length = 1.0 / m.sigma_t().max(m.sigma_t_prime());
        let table = RadialTable::new(length, |r| profile.eval(r));
        let begin = 1e-4 * length;
        let end = table.inverse_cdf(1.0 - 1e-12).max(10.0 * begin);
        let (first, last) = (begin.to_bits() >> FRACTION_BITS, (end.to_bits() >> FRACTION_BITS) + 1);
        let mut negative = 0;
        // One node more at either end, for the slopes.
        let nodes: Vec<[f64; 2]> = (first - 1..=last + 2)
            .map(|key| {
                let r = radius(key);
                let value = profile.eval(r);
                negative += usize::from(value < 0.0);
                [r, value.max(f64::MIN_POSITIVE).ln()]
            })
            .collect();
        // The slope of the parabola through three nodes; steps double from octave to octave.
        let slope = |w: &[[f64; 2]]| {
            let (left, right) = (w[1][0] - w[0][0], w[2][0] - w[1][0]);
            ((w[1][1] - w[0][1]) / left * right + (w[2][1] - w[1][1]) / right * left) / (left + right)
        };
        let cells = nodes
            .windows(4)
            .map(|w| {
                let (step, rise) = (w[2][0] - w[1][0], w[2][1] - w[1][1]);
                let (p, q) = (step * slope(&w[..3]), step * slope(&w[1..]));
                [w[1][1], p, 3.0 * rise - 2.0 * p - q, p + q - 2.0 * rise]
            })
            .collect();
        Self { table, first, cells, total: profile.total(), negative }
    }

    /// Returns R(r) \[1/L^2\] for r > 0; outside the table the end slopes of ln R over ln r continue, outwards none that rises.
    #[inline]
    pub fn eval(&self, r: f64) -> f64 {
        self.ln_eval(r).exp()
    }

    /// Returns ln R(r), as [`Prepared::eval`]: what to interpolate between media.
    #[inline]
    pub fn ln_eval(&self, r: f64) -> f64 {
        let bits = r.to_bits();
        let i = (bits >> FRACTION_BITS).wrapping_sub(self.first) as usize;
        let Some([a, b, c, d]) = self.cells.get(i) else {
            return self.beyond(r);
        };
        let t = (bits & ((1 << FRACTION_BITS) - 1)) as f64 * (1.0 / (1u64 << FRACTION_BITS) as f64);
        a + t * (b + t * (c + t * d))
    }

    /// Returns ln R outside the table.
    #[cold]
    fn beyond(&self, r: f64) -> f64 {
        let last = self.cells.len() - 1;
        let key = |i: usize| self.first + i as u64;
        let inner = r < radius(self.first);
        let (i, at) = if inner { (0, 0) } else { (last, last + 1) };
        let (r0, r1) = (radius(key(i)), radius(key(i + 1)));
        let [a, b, c, d] = self.cells[i];
        let (y0, y1) = (a, a + b + c + d);
        let slope = (y1 - y0) / (r1 / r0).ln();
        let (y, slope) = if inner { (y0, slope) } else { (y1, slope.min(0.0)) };
        y + slope * (r / radius(key(at))).ln()
    }

    /// Returns the density of [`Prepared::sample`] per unit radius \[1/L\].
    #[inline]
    pub fn pdf(&self, r: f64) -> f64 {
        self.table.pdf(r)
    }

    /// Returns a radius for u in \[0, 1).
    #[inline]
    pub fn sample(&self, u: f64) -> f64 {
        self.table.inverse_cdf(u)
    }

    /// Returns the integral of the profile.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Returns the number of nodes at which the model was negative and is taken as 0.
    pub fn negative(&self) -> usize {
        self.negative
    }
}
