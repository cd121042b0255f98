//! A piecewise constant density over the pixels of a picture, sampled from the top of a pyramid of sums.
//!
//! Walking down the pyramid keeps neighbouring variates in neighbouring pixels (stratification survives), costs log2 of the width,
//! and its density is exactly value / mean: no cumulative sums, in which dark pixels beside a sun would vanish.

/// A density over the unit square, constant in each pixel of a grid.
#[derive(Clone, Debug)]
pub struct PixelDistribution {
    /// Level 0 holds the pixels, each further one the sums of 2 x 2 cells, the last one a single cell.
    levels: Vec<Level>,
    /// 1 / mean of the pixel values.
    inverse_mean: f64,
}

#[derive(Clone, Debug)]
struct Level {
    width: usize,
    height: usize,
    sums: Vec<f32>,
}

impl Level {
    #[inline]
    fn at(&self, x: usize, y: usize) -> f32 {
        if x < self.width && y < self.height { self.sums[y * self.width + x] } else { 0.0 }
    }
}

impl PixelDistribution {
    /// Builds the density of non-negative finite pixel values, rows first; `None` if all are 0.
    pub fn new(width: usize, height: usize, values: &[f32]) -> Option<Self> {
        debug_assert_eq!(values.len(), width * height);
        let largest = values.iter().copied().fold(0.0, f32::max);
        if largest <= 0.0 {
            return None;
        }
        // Scale by the largest value, so that no sum overflows.
        let sums: Vec<f32> = values.iter().map(|v| v / largest).collect();
        let total: f64 = sums.iter().map(|&v| f64::from(v)).sum();
        let mut levels = vec![Level { width, height, sums }];
        while let Some(below) = levels.last().filter(|l| l.sums.len() > 1) {
            let (width, height) = (below.width.div_ceil(2), below.height.div_ceil(2));
            let sums = (0..width * height)
                .map(|i| {
                    let (x, y) = (2 * (i % width), 2 * (i / width));
                    below.at(x, y) + below.at(x + 1, y) + below.at(x, y + 1) + below.at(x + 1, y + 1)
                })
                .collect();
            levels.push(Level { width, height, sums });
        }
        Some(Self { levels, inverse_mean: (width * height) as f64 / total })
    }

    /// Returns a point of the unit square distributed with [`PixelDistribution::pdf`], for two variates in \[0, 1).
    pub fn sample(&self, mut u: [f64; 2]) -> [f64; 2] {
        let (mut x, mut y) = (0, 0);
        for level in self.levels.iter().rev().skip(1) {
            (x, y) = (2 * x, 2 * y);
            let cells = [[level.at(x, y), level.at(x + 1, y)], [level.at(x, y + 1), level.at(x + 1, y + 1)]];
            let row = choose(&mut u[1], cells[0][0] + cells[0][1], cells[1][0] + cells[1][1]);
            let column = choose(&mut u[0], cells[row][0], cells[row][1]);
            (x, y) = (x + column, y + row);
        }
        let pixels = &self.levels[0];
        [(x as f64 + u[0]) / pixels.width as f64, (y as f64 + u[1]) / pixels.height as f64]
    }

    /// Returns the density at a point of the unit square, per unit area of the square.
    pub fn pdf(&self, p: [f64; 2]) -> f64 {
        let l = &self.levels[0];
        f64::from(l.sums[pixel_of(l.width, l.height, p)]) * self.inverse_mean
    }
}

/// Returns the number of the pixel that holds a point of the unit square.
#[inline]
pub fn pixel_of(width: usize, height: usize, p: [f64; 2]) -> usize {
    let x = ((p[0] * width as f64) as usize).min(width - 1);
    let y = ((p[1] * height as f64) as usize).min(height - 1);
    y * width + x
}

/// Chooses 0 or 1 in proportion to two weights that are not both 0, and stretches the variate over what was chosen.
#[inline]
fn choose(u: &mut f64, a: f32, b: f32) -> usize {
    let p = f64::from(a) / (f64::from(a) + f64::from(b));
    if *u < p {
        *u /= p;
        0
    } else {
        *u = ((*u - p) / (1.0 - p)).min(1.0 - f64::EPSILON);
        1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Random, Stream};

    #[test]
    fn pixels_are_chosen_in_proportion_to_their_values() {
        // 7 x 5 pixels, one black: chi-square over 34 cells against the density; the bound is the 1 - 1e-4 quantile for 33 degrees of
        // freedom (Wilson-Hilferty).
        let (w, h) = (7, 5);
        let values: Vec<f32> = (0..w * h).map(|i| ((i * 17) % 35) as f32).collect();
        let d = PixelDistribution::new(w, h, &values).expect("not black");
        let mut r = Stream::new(&[31]);
        let n = 200_000;
        let mut counts = vec![0u32; w * h];
        for _ in 0..n {
            let q = d.sample([f64::from(r.uniform()), f64::from(r.uniform())]);
            assert!(d.pdf(q) > 0.0);
            counts[pixel_of(w, h, q)] += 1;
        }
        let total: f32 = values.iter().sum();
        let mut chi2 = 0.0;
        for (&c, &v) in counts.iter().zip(&values) {
            let expected = f64::from(n) * f64::from(v / total);
            if v == 0.0 {
                assert_eq!(c, 0);
            } else {
                chi2 += (f64::from(c) - expected).powi(2) / expected;
            }
        }
        let k: f64 = 33.0;
        let bound = k * (1.0 - 2.0 / (9.0 * k) + 3.719 * (2.0 / (9.0 * k)).sqrt()).powi(3);
        assert!(chi2 < bound, "{chi2} >= {bound}");
    }

    #[test]
    fn a_dark_pixel_beside_a_sun_keeps_its_density() {
        let mut values = vec![1e-6f32; 64 * 64];
        values[100] = 1e9;
        let d = PixelDistribution::new(64, 64, &values).expect("not black");
        let total = 1e9 + 1e-6 * 4095.0;
        // f32 rounding of the values.
        assert!((d.pdf([0.9, 0.9]) / (1e-6 * 4096.0 / total) - 1.0).abs() < 1e-6);
    }
}
