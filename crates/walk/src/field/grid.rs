//! Values at the centres of voxels in the unit cube.
//!
//! Interpolation is trilinear between centres and falls to 0 half a voxel outside the outermost ones, so that it is halved on
//! the faces of the cube, as in pbrt-v4 (`SampledGrid`).

use moonmilk_core::{Random, Vec3};

/// nx x ny x nz values, x fastest.
#[derive(Clone, Debug)]
pub struct Grid<T> {
    size: [u32; 3],
    values: Vec<T>,
}

impl<T> Grid<T> {
    /// Returns a grid; `None` unless there are nx ny nz > 0 values.
    pub fn new(size: [u32; 3], values: Vec<T>) -> Option<Self> {
        let expected = size.iter().try_fold(1usize, |n, &s| n.checked_mul(s as usize))?;
        (expected > 0 && expected == values.len() && size.iter().all(|&s| s <= 1 << 24))
            .then_some(Self { size, values })
    }

    /// Returns the numbers of voxels along x, y, z.
    pub fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Returns all values, x fastest.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// Returns the voxel below a point of the unit cube, and how far towards the next one it lies.
    #[inline]
    fn locate(&self, u: Vec3) -> ([i32; 3], Vec3) {
        let q = u * Vec3::new(self.size[0] as f32, self.size[1] as f32, self.size[2] as f32) - 0.5;
        let floor = q.floor();
        (floor.to_array().map(|x| x as i32), q - floor)
    }

    /// Returns the number of a voxel, `None` outside the grid.
    #[inline]
    fn voxel(&self, i: [i32; 3]) -> Option<usize> {
        let [nx, ny, nz] = self.size.map(|n| n as i32);
        let inside = (0..nx).contains(&i[0]) && (0..ny).contains(&i[1]) && (0..nz).contains(&i[2]);
        inside.then(|| (i[2] as usize * ny as usize + i[1] as usize) * nx as usize + i[0] as usize)
    }

    /// Returns the number of one of the eight voxels around a point of the unit cube, each with the probability of its weight in
    /// trilinear interpolation; `None` outside the grid, where values are 0.
    #[inline]
    pub fn choose(&self, u: Vec3, rng: &mut impl Random) -> Option<usize> {
        let (mut i, f) = self.locate(u);
        let [a, b] = rng.uniform2();
        i[0] += i32::from(a < f.x);
        i[1] += i32::from(b < f.y);
        i[2] += i32::from(rng.uniform() < f.z);
        self.voxel(i)
    }

    /// Returns the value of a voxel chosen by [`Grid::choose`].
    #[inline]
    pub fn pick(&self, u: Vec3, rng: &mut impl Random) -> Option<&T> {
        self.choose(u, rng).map(|i| &self.values[i])
    }

    /// Calls f with each of the up to eight voxels around a point of the unit cube and its weight.
    #[inline]
    pub fn around(&self, u: Vec3, mut f: impl FnMut(&T, f32)) {
        let (i, w) = self.locate(u);
        for corner in 0..8 {
            let bit = |k: i32| (corner >> k) & 1;
            let weight = |k: i32, w: f32| if bit(k) == 1 { w } else { 1.0 - w };
            if let Some(n) = self.voxel([i[0] + bit(0), i[1] + bit(1), i[2] + bit(2)]) {
                f(&self.values[n], weight(0, w.x) * weight(1, w.y) * weight(2, w.z));
            }
        }
    }
}

impl Grid<f32> {
    /// Returns the interpolated value at a point of the unit cube.
    #[inline]
    pub fn interpolate(&self, u: Vec3) -> f32 {
        let mut sum = 0.0;
        self.around(u, |v, w| sum += w * v);
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::Stream;

    fn ramp() -> Grid<f32> {
        Grid::new([4, 3, 2], (0..24).map(|i| (i % 4) as f32 + 10.0 * (i / 4 % 3) as f32).collect()).expect("24 values")
    }

    #[test]
    fn sizes_must_match_the_number_of_values() {
        assert!(Grid::new([2, 2, 2], vec![0.0; 7]).is_none() && Grid::new([0, 2, 2], Vec::<f32>::new()).is_none());
        assert!(Grid::new([u32::MAX; 3], vec![0.0; 8]).is_none());
    }

    #[test]
    fn interpolation_is_linear_between_centres_and_halved_on_the_faces() {
        let g = ramp();
        // x = 1.25 voxels from the first centre: u = (1.25 + .5) / 4.
        let v = g.interpolate(Vec3::new(1.75 / 4.0, 0.5, 0.5));
        assert!((v - 11.25).abs() < 1e-5, "{v}");
        let face = g.interpolate(Vec3::new(1.0, 0.5, 0.5));
        assert!((face - 6.5).abs() < 1e-5, "{face}");
        assert_eq!(g.interpolate(Vec3::new(2.0, 0.5, 0.5)), 0.0);
    }

    #[test]
    fn picked_voxels_have_the_interpolated_value_as_their_mean() {
        let g = ramp();
        let mut rng = Stream::new(&[3]);
        for u in [Vec3::new(0.3, 0.6, 0.7), Vec3::new(0.02, 0.98, 0.5)] {
            let n = 200_000;
            let (mut s1, mut s2) = (0.0f64, 0.0f64);
            for _ in 0..n {
                let v = f64::from(g.pick(u, &mut rng).copied().unwrap_or(0.0));
                s1 += v;
                s2 += v * v;
            }
            let mean = s1 / f64::from(n);
            let error = ((s2 / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
            let exact = f64::from(g.interpolate(u));
            // 4.9 standard errors: 1e-6 two-sided.
            assert!((mean - exact).abs() < 4.9 * error, "{mean} against {exact}");
        }
    }
}
