//! PNG files for screens: sRGB, 8 bits per channel; and the sRGB transfer function itself.
//!
//! For looking only: values outside \[0, 1\] are clipped and layers are dropped. Data belong into an EXR file.

use std::sync::LazyLock;

use ::image::codecs::png::{CompressionType, FilterType, PngEncoder};
use ::image::{ExtendedColorType, ImageEncoder};

use crate::image::{Error, ErrorKind, Picture, guarded};

/// Returns the sRGB code of a linear value: `12.92 c` up to 0.0031308, above it `1.055 c^(1/2.4) - 0.055`.
///
/// *Domain*: any number; the callers here clip to \[0, 1\] first. *Source*: IEC 61966-2-1.
pub fn srgb_encode(c: f64) -> f64 {
    if c <= 0.0031308 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}

/// Returns the linear value of an sRGB code: `c / 12.92` up to 0.04045, above it `((c + 0.055) / 1.055)^2.4`.
///
/// *Domain*: any number. *Source*: IEC 61966-2-1.
pub fn srgb_decode(c: f64) -> f64 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Smallest f32 that is coded as k + 1, for k = 0..255: where `255 srgb_encode` passes k + 1/2.
static THRESHOLDS: LazyLock<[f32; 255]> =
    LazyLock::new(|| std::array::from_fn(|k| srgb_decode((k as f64 + 0.5) / 255.0) as f32));

/// Returns the 8-bit sRGB code nearest to a linear value; what is not a number or negative gives 0, above 1 gives 255.
///
/// A search in the 255 thresholds: exact, and no power function per pixel.
pub fn srgb_byte(linear: f32) -> u8 {
    // A NaN compares as false with everything and lands at 0.
    THRESHOLDS.partition_point(|&t| linear >= t) as u8
}

/// Returns the bytes of an RGB PNG file of the picture's colour ([`Picture::rgb`]), clipped to \[0, 1\].
///
/// The same picture gives the same bytes.
///
/// *Errors*: [`Picture::check`]; no colour channels.
pub fn encode(picture: &Picture) -> Result<Vec<u8>, Error> {
    let planes = picture.require_rgb()?;
    let mut pixels = Vec::with_capacity(3 * picture.width * picture.height);
    for i in 0..picture.width * picture.height {
        pixels.extend(planes.map(|p| srgb_byte(p[i])));
    }
    let size = |n: usize| u32::try_from(n).map_err(|_| failed("a side exceeds 2^32 pixels"));
    let (width, height) = (size(picture.width)?, size(picture.height)?);
    let mut bytes = Vec::new();
    guarded("PNG", || {
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
            .write_image(&pixels, width, height, ExtendedColorType::Rgb8)
            .map_err(|e| failed(&e.to_string()))
    })?;
    Ok(bytes)
}

fn failed(reason: &str) -> Error {
    ErrorKind::Encode { format: "PNG", reason: reason.into() }.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::{Encoding, load_texture};

    #[test]
    fn every_code_survives_decoding_and_encoding() {
        for k in 0..=255u8 {
            assert_eq!(srgb_byte(srgb_decode(f64::from(k) / 255.0) as f32), k);
        }
    }

    #[test]
    fn the_byte_is_the_rounded_transfer_function() {
        for i in 0..=100_000 {
            let c = i as f32 / 100_000.0;
            let exact = 255.0 * srgb_encode(f64::from(c));
            // Half a code plus the rounding of the threshold to f32 (6e-8 relative, slope of the curve at most 12.92).
            assert!((f64::from(srgb_byte(c)) - exact).abs() <= 0.5 + 255.0 * 12.92 * 6e-8);
        }
        let edge = [f32::NAN, -1.0, f32::NEG_INFINITY, 2.0, f32::INFINITY].map(srgb_byte);
        assert_eq!(edge, [0, 0, 0, 255, 255]);
    }

    #[test]
    fn the_two_branches_of_the_transfer_function_meet() {
        // The standard's constants leave a step of about 3e-8 in the code at the joint.
        assert!((12.92 * 0.0031308 - (1.055 * 0.0031308f64.powf(1.0 / 2.4) - 0.055)).abs() < 1e-7);
        for c in [0.0, 0.001, 0.02, 0.5, 1.0] {
            // Rounding of two powers in f64.
            assert!((srgb_decode(srgb_encode(c)) - c).abs() < 1e-12);
        }
    }

    #[test]
    fn a_written_png_is_read_back_within_half_a_code() {
        let pixels: Vec<[f32; 3]> = (0..35 * 20).map(|i| [i as f32 / 700.0, 1.0 - i as f32 / 700.0, 0.25]).collect();
        let p = Picture::from_rgb(35, 20, &pixels).unwrap();
        let bytes = encode(&p).unwrap();
        assert_eq!(bytes, encode(&p).unwrap());
        let q = load_texture(&bytes, "a.png", Encoding::Srgb).unwrap();
        assert_eq!((q.width, q.height), (35, 20));
        for (a, b) in p.rgb().unwrap().concat().into_iter().zip(q.rgb().unwrap().concat()) {
            assert!((255.0 * (srgb_encode(a.into()) - srgb_encode(b.into()))).abs() < 0.501);
        }
    }
}
