//! Gradient noise \[Perlin2002\] and sums of its octaves.
//!
//! Noise of one octave is 0 at the points of the integer lattice, has a random gradient there, and is blended between them by
//! `6 t^5 - 15 t^4 + 10 t^3`, so that second derivatives are continuous. The lattice repeats after 256. Conventions (which of the twelve
//! gradients belongs to which hash, 1.99 between octaves) are pbrt-v4's, so that the same file shows the same pattern.

use moonmilk_core::Vec3;

/// The permutation of 0 to 255 published with \[Perlin2002\], which orders the gradients.
const SHUFFLED: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225, 140, 36, 103, 30, 69, 142, 8, 99, 37, 240,
    21, 10, 23, 190, 6, 148, 247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219, 203, 117, 35, 11, 32, 57, 177, 33, 88,
    237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175, 74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83,
    111, 229, 122, 60, 211, 133, 230, 220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54, 65, 25, 63, 161, 1, 216,
    80, 73, 209, 76, 132, 187, 208, 89, 18, 169, 200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173, 186,
    3, 64, 52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212, 207, 206, 59, 227, 47, 16, 58, 17,
    182, 189, 28, 42, 223, 183, 170, 213, 119, 248, 152, 2, 44, 154, 163, 70, 221, 153, 101, 155, 167, 43, 172, 9, 129,
    22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232, 178, 185, 112, 104, 218, 246, 97, 228, 251, 34, 242, 193, 238,
    210, 144, 12, 191, 179, 162, 241, 81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157, 184,
    84, 204, 176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93, 222, 114, 67, 29, 24, 72, 243, 141, 128, 195,
    78, 66, 215, 61, 156, 180,
];

/// Coordinates are taken modulo this, beyond which lattice points do not fit an integer; an f32 has no fraction there anyway.
const FARTHEST: f32 = (1 << 30) as f32;

/// Ratio of frequencies of successive octaves: a little below 2, so that their zeros do not coincide.
const LACUNARITY: f32 = 1.99;

/// Mean of |noise| that [`turbulence`] assumes for the octave after the last.
const MEAN_ABSOLUTE: f32 = 0.2;

/// Returns the noise at p, in \[-1, 1\]; 0 where p is not finite.
pub(crate) fn noise(p: Vec3) -> f32 {
    if !p.is_finite() {
        return 0.0;
    }
    let p = p % FARTHEST;
    let cell = p.floor();
    let lattice = cell.as_ivec3();
    let d = p - cell;
    let blend = d * d * d * (d * (d * 6.0 - 15.0) + 10.0);
    let lerp = |t: f32, a: f32, b: f32| (1.0 - t) * a + t * b;
    // Blend along x, then y, then z.
    let corner = |x: i32, y: i32, z: i32| {
        let hash = gradient_hash(lattice.x + x, lattice.y + y, lattice.z + z);
        along_gradient(hash, d - Vec3::new(x as f32, y as f32, z as f32))
    };
    let edge = |y: i32, z: i32| lerp(blend.x, corner(0, y, z), corner(1, y, z));
    let face = |z: i32| lerp(blend.y, edge(0, z), edge(1, z));
    lerp(blend.z, face(0), face(1))
}

/// Returns a number from 0 to 15 for a lattice point.
#[inline]
fn gradient_hash(x: i32, y: i32, z: i32) -> u8 {
    // A sum of two table entries runs on into a second copy of the table: indices modulo 256.
    let shuffled = |i: i32| i32::from(SHUFFLED[(i & 255) as usize]);
    (shuffled(shuffled(shuffled(x) + (y & 255)) + (z & 255)) & 15) as u8
}

/// Returns the product of an offset with one of the twelve gradients to the edges of a cube; four of them count twice.
#[inline]
fn along_gradient(hash: u8, d: Vec3) -> f32 {
    let (u, v) = match hash {
        0..4 | 12 | 13 => (d.x, d.y),
        4..8 => (d.x, d.z),
        _ => (d.y, d.z),
    };
    (if hash & 1 == 0 { u } else { -u }) + (if hash & 2 == 0 { v } else { -v })
}

/// Returns the sum over octaves i of `omega^i noise(1.99^i p)`.
pub(super) fn fbm(p: Vec3, omega: f32, octaves: u32) -> f32 {
    octave_sum(p, omega, octaves, |x| x).0
}

/// Returns the sum over octaves i of `omega^i |noise(1.99^i p)|`, and 0.2 omega^octaves for the octave after the last, as pbrt-v4.
pub(super) fn turbulence(p: Vec3, omega: f32, octaves: u32) -> f32 {
    let (sum, next) = octave_sum(p, omega, octaves, f32::abs);
    sum + next * MEAN_ABSOLUTE
}

/// Returns the sum and the weight of the octave after the last.
fn octave_sum(p: Vec3, omega: f32, octaves: u32, shape: impl Fn(f32) -> f32) -> (f32, f32) {
    let (mut sum, mut frequency, mut weight) = (0.0, 1.0, 1.0);
    for _ in 0..octaves {
        sum += weight * shape(noise(p * frequency));
        frequency *= LACUNARITY;
        weight *= omega;
    }
    (sum, weight)
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Random, Stream};

    fn anywhere(u: &mut Stream, size: f32) -> Vec3 {
        Vec3::new(u.uniform(), u.uniform(), u.uniform()) * (2.0 * size) - size
    }

    #[test]
    fn the_table_holds_every_number_once() {
        let mut seen = [false; 256];
        SHUFFLED.iter().for_each(|&i| seen[i as usize] = true);
        assert!(seen.iter().all(|&s| s));
    }

    #[test]
    fn noise_vanishes_on_the_lattice_is_bounded_and_has_mean_zero() {
        let mut u = Stream::new(&[61]);
        let (mut sum, n) = (0.0f64, 100_000);
        for _ in 0..n {
            let p = anywhere(&mut u, 128.0);
            assert_eq!(noise(p.round()), 0.0, "{p}");
            let x = noise(p);
            assert!(x.abs() <= 1.0, "{x} at {p}");
            sum += f64::from(x);
        }
        // The standard deviation of the noise is about .25; 4.5 standard errors.
        assert!((sum / f64::from(n)).abs() < 4.5 * 0.25 / f64::from(n).sqrt(), "{}", sum / f64::from(n));
    }

    #[test]
    fn noise_repeats_after_256_and_has_the_gradient_of_its_lattice_point() {
        let mut u = Stream::new(&[62]);
        for _ in 0..1000 {
            let p = anywhere(&mut u, 100.0);
            // Multiples of 1/64 are exact at both places.
            let q = (p * 64.0).round() / 64.0;
            assert_eq!(noise(q), noise(q + Vec3::new(256.0, -256.0, 512.0)));
            // Gradients are (+-1, +-1, 0) and permutations: a step h along x changes the noise by 0 or h, to third order (10 h^3).
            let lattice = p.round();
            let h = 1.0 / 64.0;
            let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|e| (noise(lattice + e * h) / h).round());
            assert_eq!([x, y, z].iter().filter(|g| g.abs() == 1.0).count(), 2, "{lattice}: {x} {y} {z}");
            assert!((noise(lattice + Vec3::X * h) - x * h).abs() < 20.0 * h * h * h);
        }
    }

    #[test]
    fn values_are_those_of_the_published_reference() {
        // Perlin's reference implementation has other gradients for the hashes 12 to 15; at these points the hash of every corner that
        // counts is below 12. Middle of the edge from (0, 0, 0) to (1, 0, 0): half of g0 . (.5, 0, 0) + g1 . (-.5, 0, 0), by hand from the
        // table: hash(0, 0, 0) = P[P[P[0]]] = P[P[151]] = P[17] = 36, & 15 = 4; hash(1, 0, 0) = P[P[160]] = P[119] = 86, & 15 = 6.
        let [h0, h1] = [gradient_hash(0, 0, 0), gradient_hash(1, 0, 0)];
        let g = |h: u8| along_gradient(h, Vec3::X);
        let by_hand = 0.5 * (0.5 * g(h0) - 0.5 * g(h1));
        assert_eq!(noise(Vec3::new(0.5, 0.0, 0.0)), by_hand);
        assert_eq!((h0, h1), (4, 6));
    }

    #[test]
    fn octaves_add_up_with_their_weights() {
        let p = Vec3::new(0.3, -1.7, 2.2);
        let (a, b) = (noise(p), noise(p * LACUNARITY));
        assert_eq!(fbm(p, 0.5, 0), 0.0);
        assert_eq!(fbm(p, 0.5, 2), a + 0.5 * b);
        // Rounding of one sum.
        assert!((turbulence(p, 0.5, 2) - (a.abs() + 0.5 * b.abs() + 0.25 * 0.2)).abs() < 1e-7);
        assert!(fbm(p, 0.5, 64).is_finite() && turbulence(Vec3::splat(1e30), 1.0, 64).is_finite());
        assert_eq!(noise(Vec3::new(f32::NAN, 0.0, f32::INFINITY)), 0.0);
    }
}
