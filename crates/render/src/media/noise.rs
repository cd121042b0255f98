//! What pbrt-v4's cloud makes of gradient noise.

use moonmilk_core::Vec3;

pub(crate) use crate::texture::noise::noise;

/// An upper bound of the noise's absolute value: the largest known is 1.0364, the margin is for rounding.
pub(crate) const MOST: f32 = 1.04;

/// Returns pbrt's difference quotients of the noise over .01: near its gradient, and part of what its cloud is.
#[inline]
pub(crate) fn differences(p: Vec3) -> Vec3 {
    const DELTA: f32 = 0.01;
    let n = noise(p);
    Vec3::from_array([Vec3::X, Vec3::Y, Vec3::Z].map(|e| (noise(p + e * DELTA) - n) / DELTA))
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::{Random, Stream};

    #[test]
    fn noise_stays_below_the_bound_of_the_cloud() {
        let mut rng = Stream::new(&[1]);
        for _ in 0..400_000 {
            let p = Vec3::new(rng.uniform(), rng.uniform(), rng.uniform()) * 40.0 - 20.0;
            assert!(noise(p).abs() <= MOST);
        }
    }
}
