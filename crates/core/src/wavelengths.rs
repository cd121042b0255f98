//! The wavelengths, or the colour channels, that the lanes of one light path stand for.

use std::sync::LazyLock;

use crate::color::{LAMBDA_MAX, LAMBDA_MIN, OBSERVED, SAMPLES, locate};
use crate::spectrum::Spectrum;

/// How a render treats colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WavelengthMode {
    /// N wavelengths per path, the first of them the hero: use N = 4.
    Hero,
    /// Three monochromatic problems, one per channel of linear sRGB: use N = 3.
    Rgb,
    /// One fixed wavelength in nm: use N = 1.
    Mono(f32),
}

impl WavelengthMode {
    /// The monochromatic mode at the default wavelength, 550 nm.
    pub const MONO: Self = Self::Mono(550.0);
}

/// What the N lanes of a path are; lane 0 is the hero, for which directions and distances are sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wavelengths<const N: usize> {
    /// Sampled wavelengths; each lane alone is a sample of the density `pdf` \[1/nm\].
    Sampled {
        /// Wavelengths \[nm\].
        lambda: [f32; N],
        /// Density of each wavelength \[1/nm\].
        pdf: [f32; N],
    },
    /// Lane i is the problem of colour channel `channel[i]` (0 red, 1 green, 2 blue).
    Channels {
        /// Channel of each lane: a rotation of (0, 1, 2).
        channel: [u8; N],
    },
    /// Every lane has the same fixed wavelength \[nm\].
    Fixed(f32),
}

impl<const N: usize> Wavelengths<N> {
    /// Samples the lanes of a path from one uniform variate u in (0, 1).
    ///
    /// Hero: lane i takes the variate u + i/N modulo 1, so that the N wavelengths are stratified while each one alone follows
    /// the density of [`visible_pdf`] \[Wilkie2014\]. Rgb: u chooses the channel of the hero, the others follow in order.
    pub fn sample(mode: WavelengthMode, u: f32) -> Self {
        match mode {
            WavelengthMode::Hero => {
                let lambda = std::array::from_fn(|i| {
                    let v = u + i as f32 / N as f32;
                    sample_visible(if v >= 1.0 { v - 1.0 } else { v })
                });
                Self::Sampled { lambda, pdf: lambda.map(visible_pdf) }
            }
            WavelengthMode::Rgb => {
                let first = ((u * 3.0) as usize).min(2);
                Self::Channels { channel: std::array::from_fn(|i| ((first + i) % 3) as u8) }
            }
            WavelengthMode::Mono(lambda) => Self::Fixed(lambda),
        }
    }

    /// Returns the linear sRGB estimate of a path's radiance (relative to D65, see [`crate::color`]).
    ///
    /// Sampled lanes: the mean over the lanes of L w_c / pdf, whose expectation is the integral of L w_c. Channels: the lanes, put
    /// back into the order red, green, blue. Fixed: the mean of the lanes in all three channels.
    pub fn to_rgb(&self, radiance: Spectrum<N>) -> [f32; 3] {
        // Parts of a picture are mostly nothing.
        if radiance.is_black() {
            return [0.0; 3];
        }
        match self {
            Self::Sampled { lambda, pdf } => {
                let mut rgb = [0.0f32; 3];
                let observed = &*OBSERVED;
                for i in 0..N {
                    let w = observed.response_at(lambda[i]);
                    let l = radiance[i] / (N as f32 * pdf[i]);
                    rgb.iter_mut().zip(w).for_each(|(c, w)| *c += l * w);
                }
                rgb
            }
            Self::Channels { channel } => {
                let mut rgb = [0.0f32; 3];
                for i in 0..N {
                    rgb[channel[i] as usize] += radiance[i] * (3.0 / N as f32);
                }
                rgb
            }
            Self::Fixed(_) => [radiance.mean(); 3],
        }
    }
}

/// Returns the linear sRGB estimate of a path's radiance; see [`Wavelengths::to_rgb`].
#[inline]
pub fn to_rgb<const N: usize>(radiance: Spectrum<N>, wavelengths: &Wavelengths<N>) -> [f32; 3] {
    wavelengths.to_rgb(radiance)
}

/// Density of sampled wavelengths at 1 nm steps, linear between them, and its cumulative distribution.
struct Visible {
    pdf: Vec<f32>,
    cdf: Vec<f32>,
}

/// A broad sech^2 plus a Gaussian in the blue, their four parameters searched on a grid for the least summed variance of the three channels of
/// white light with four stratified wavelengths per path: .020, against .31 for pbrt-v4's density sech^2(.0072 (lambda - 538))
/// and .23 for the norm of the responses, which is the best choice only without stratification.
static VISIBLE: LazyLock<Visible> = LazyLock::new(|| {
    const BLUE: f64 = 0.2;
    let broad: Vec<f64> = (0..SAMPLES).map(|i| (0.007 * (380.0 + i as f64 - 570.0)).cosh().powi(-2)).collect();
    let blue: Vec<f64> = (0..SAMPLES).map(|i| (-0.5 * ((380.0 + i as f64 - 440.0) / 25.0).powi(2)).exp()).collect();
    let (broad_sum, blue_sum) = (broad.iter().sum::<f64>(), blue.iter().sum::<f64>());
    let mixed: Vec<f64> =
        broad.iter().zip(&blue).map(|(a, b)| (1.0 - BLUE) * a / broad_sum + BLUE * b / blue_sum).collect();
    let mut cdf = vec![0.0f64; SAMPLES];
    for i in 1..SAMPLES {
        cdf[i] = cdf[i - 1] + 0.5 * (mixed[i - 1] + mixed[i]);
    }
    let total = cdf[SAMPLES - 1];
    Visible {
        pdf: mixed.iter().map(|x| (x / total) as f32).collect(),
        cdf: cdf.iter().map(|x| (x / total) as f32).collect(),
    }
});

/// Returns the density with which the hero mode samples a wavelength \[1/nm\]; 0 outside 380..780 nm.
pub fn visible_pdf(lambda: f32) -> f32 {
    match locate(lambda) {
        Some((i, t)) => (1.0 - t) * VISIBLE.pdf[i] + t * VISIBLE.pdf[i + 1],
        None => 0.0,
    }
}

/// Returns the wavelength in nm at which the cumulative distribution of [`visible_pdf`] equals u, for u in \[0, 1).
pub fn sample_visible(u: f32) -> f32 {
    let Visible { pdf, cdf } = &*VISIBLE;
    let i = cdf.partition_point(|&c| c <= u).clamp(1, SAMPLES - 1) - 1;
    // Solve a t + (b - a) t^2 / 2 = u - cdf_i for t in [0, 1], in the form that is stable for b near a.
    let (a, b, r) = (f64::from(pdf[i]), f64::from(pdf[i + 1]), f64::from(u) - f64::from(cdf[i]));
    let t = 2.0 * r / (a + (a * a + 2.0 * (b - a) * r).max(0.0).sqrt());
    (LAMBDA_MIN + i as f32 + (t.clamp(0.0, 1.0) as f32)).min(LAMBDA_MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::Accumulator;
    use crate::random::{Random, Stream};
    use crate::stats::{chi_square, sidak};

    #[test]
    fn white_light_is_measured_as_white_without_bias() {
        // 3 channels tested; |z| < 4.4 is a two-sided significance of 1e-5 each.
        let mut sums = [Accumulator::default(); 3];
        let mut r = Stream::new(&[1, 2]);
        for _ in 0..100_000 {
            let w = Wavelengths::<4>::sample(WavelengthMode::Hero, r.uniform());
            w.to_rgb(Spectrum::ONE).iter().zip(&mut sums).for_each(|(&c, s)| s.add(f64::from(c)));
        }
        for s in sums {
            assert!(s.estimate().z(1.0).abs() < 4.4, "{}", s.estimate());
        }
        // The variances that the density was chosen for (.011, .007, .002), and a tenth more for their own error.
        assert!(sums.iter().map(|s| s.variance()).sum::<f64>() < 0.0215);
    }

    #[test]
    fn every_lane_follows_the_stated_density() {
        let n = 100_000u32;
        for lane in 0..4usize {
            let mut counts = vec![0.0; 80];
            let mut r = Stream::new(&[3, lane as u64]);
            for _ in 0..n {
                if let Wavelengths::Sampled { lambda, pdf } =
                    Wavelengths::<4>::sample(WavelengthMode::Hero, r.uniform())
                {
                    assert!(pdf[lane] > 0.0);
                    counts[(((lambda[lane] - LAMBDA_MIN) / 5.0) as usize).min(79)] += 1.0;
                }
            }
            let expected: Vec<f64> = (0..80)
                .map(|k| {
                    let a = LAMBDA_MIN + 5.0 * k as f32;
                    // Integrate the piecewise linear density exactly.
                    let p: f32 =
                        (0..5).map(|j| 0.5 * (visible_pdf(a + j as f32) + visible_pdf(a + j as f32 + 1.0))).sum();
                    f64::from(p) * f64::from(n)
                })
                .collect();
            assert!(chi_square(&counts, &expected, 0) > sidak(1e-4, 4), "lane {lane}");
        }
    }

    #[test]
    fn the_lanes_of_rgb_return_to_their_channels() {
        for k in 0..3 {
            let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, (k as f32 + 0.5) / 3.0);
            let Wavelengths::Channels { channel } = w else { unreachable!() };
            assert_eq!(channel[0], k);
            let colour = [0.1, 0.5, 0.9];
            let lanes = Spectrum(channel.map(|c| colour[c as usize]));
            assert_eq!(w.to_rgb(lanes), colour);
        }
    }
}
