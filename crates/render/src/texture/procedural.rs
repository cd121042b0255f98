//! Textures made by a formula: bilinear corners, dots, waves, marble. Meanings are pbrt-v4's (`textures.cpp`).

use moonmilk_core::{Vec2, Vec3};

use super::noise::{fbm, noise};

/// Returns the weights of the corners (0, 0), (1, 0), (0, 1), (1, 1) at a point; beyond the unit square some are negative.
#[inline]
pub(super) fn bilinear(st: Vec2) -> [f32; 4] {
    let (s, t) = (st.x, st.y);
    [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t]
}

/// Radius of a dot; its centre moves by at most the rest of its cell.
const DOT_RADIUS: f32 = 0.35;

/// Returns whether a point lies in a dot. Cells are centred at integers; noise decides whether a cell has a dot, and moves it.
pub(super) fn in_dot(st: Vec2) -> bool {
    let cell = (st + 0.5).floor();
    // pbrt-v4 gives plane noise the third coordinate .5, and these offsets.
    let at = |x: f32, y: f32| noise(Vec3::new(cell.x + x, cell.y + y, 0.5));
    if at(0.5, 0.5) <= 0.0 {
        return false;
    }
    let shift = Vec2::new(at(1.5, 2.8), at(4.5, 9.8)) * (0.5 - DOT_RADIUS);
    (st - cell - shift).length_squared() < DOT_RADIUS * DOT_RADIUS
}

/// Returns the height of waves: three octaves of slow wind times six of waves.
pub(super) fn waves(p: Vec3) -> f32 {
    fbm(p * 0.1, 0.5, 3).abs() * fbm(p, 0.5, 6)
}

/// Colours that marble runs through, linear sRGB before the factor 1.5.
const VEINS: [[f32; 3]; 9] = {
    const LIGHT: [f32; 3] = [0.58, 0.58, 0.6];
    [LIGHT, LIGHT, LIGHT, [0.5, 0.5, 0.5], [0.6, 0.59, 0.58], LIGHT, LIGHT, [0.2, 0.2, 0.33], LIGHT]
};

/// Returns the colour of marble, linear sRGB within \[0, 0.9\]: at t = (1 + sin(y + variation fbm(p))) / 2 of six Bezier segments.
pub(super) fn marble(p: Vec3, omega: f32, octaves: u32, variation: f32) -> [f32; 3] {
    let t = 0.5 + 0.5 * (p.y + variation * fbm(p, omega, octaves)).sin();
    let segments = VEINS.len() - 3;
    let x = if t.is_finite() { t * segments as f32 } else { 0.0 };
    let first = (x as usize).min(segments - 1);
    let x = x - first as f32;
    // Bernstein's polynomials of degree 3.
    let y = 1.0 - x;
    let weights = [y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x];
    std::array::from_fn(|c| 1.5 * weights.iter().zip(&VEINS[first..]).map(|(w, rgb)| w * rgb[c]).sum::<f32>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Random, Stream};

    #[test]
    fn dots_stay_in_their_cells_and_fill_two_of_five() {
        let mut u = Stream::new(&[63]);
        let (mut cells, mut covered) = (0.0, 0.0);
        for i in 0..2000 {
            let cell = Vec2::new((i % 50) as f32, (i / 50) as f32);
            // A dot reaches at most the border of its cell.
            for side in [Vec2::X, Vec2::Y, -Vec2::X, -Vec2::Y] {
                assert!(
                    !in_dot(cell + side * 0.49999 + side.perp() * (u.uniform() - 0.5))
                        || noise(Vec3::new(cell.x + 0.5, cell.y + 0.5, 0.5)) > 0.0
                );
            }
            let hits = (0..64).filter(|_| in_dot(cell + Vec2::new(u.uniform(), u.uniform()) - 0.5)).count();
            cells += f64::from(u8::from(hits > 0));
            covered += hits as f64 / 64.0;
        }
        // A dot covers pi .35^2 = .385 of its cell; 2000 x 64 points, of which dots hold about half: 4.5 standard errors are .009.
        assert!((covered / cells - 0.3848).abs() < 0.009, "{}", covered / cells);
        // The noise at the middle of a lattice cell is the mean of 16 numbers +-1/2: positive with probability (1 - C(16, 8) / 2^16) / 2 =
        // .402 if the table were random; one table and neighbouring cells that share gradients: .05.
        assert!((cells / 2000.0 - 0.402f64).abs() < 0.05, "{}", cells / 2000.0);
    }

    #[test]
    fn marble_stays_among_its_colours() {
        let mut u = Stream::new(&[64]);
        for _ in 0..10_000 {
            let p = Vec3::new(u.uniform(), u.uniform(), u.uniform()) * 40.0 - 20.0;
            let rgb = marble(p, 0.5, 8, 0.2);
            // The convex hull of the control points.
            assert!(rgb.iter().all(|&c| (0.3 - 1e-6..=0.9 + 1e-6).contains(&c)), "{rgb:?}");
        }
        // Without noise: t = 1/2 at y = 0 is the start of the fourth segment, whose first control point is (.5, .5, .5).
        let rgb = marble(Vec3::ZERO, 0.5, 0, 0.0);
        assert!(rgb.iter().all(|&c| (c - 0.75).abs() < 1e-6), "{rgb:?}");
        assert!(marble(Vec3::splat(f32::INFINITY), 0.5, 8, 0.2).iter().all(|c| c.is_finite()));
    }

    #[test]
    fn bilinear_weights_pick_corners_and_add_up() {
        assert_eq!(bilinear(Vec2::new(1.0, 0.0)), [0.0, 1.0, 0.0, 0.0]);
        assert_eq!(bilinear(Vec2::new(0.0, 1.0)), [0.0, 0.0, 1.0, 0.0]);
        assert_eq!(bilinear(Vec2::new(1.5, -2.0)).iter().sum::<f32>(), 1.0);
    }
}
