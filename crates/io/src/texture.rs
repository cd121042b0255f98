//! Textures and environment maps from PNG, JPEG, Radiance HDR and EXR files, as linear f32.
//!
//! The contents decide the format, not the file's name: scenes in the wild carry pictures with wrong suffixes.

use std::io::Cursor;
use std::str::FromStr;

use ::image::error::{ImageError, LimitErrorKind};
use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::image::{Error, ErrorKind, MAX_SAMPLES, Picture, check_size, guarded};
use crate::png::srgb_decode;

/// How the integers of a PNG or JPEG file stand for light. Files with floating-point samples are always linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Encoding {
    /// The sRGB transfer function (the default of colour textures).
    Srgb,
    /// Proportional (data: roughness, normals, masks).
    Linear,
    /// `linear = code^exponent`, exponent positive.
    Gamma(f32),
}

impl Encoding {
    /// Returns the linear value of a code in \[0, 1\].
    pub fn decode(self, code: f64) -> f64 {
        match self {
            Encoding::Srgb => srgb_decode(code),
            Encoding::Linear => code,
            Encoding::Gamma(exponent) => code.powf(f64::from(exponent)),
        }
    }
}

impl FromStr for Encoding {
    type Err = Error;

    /// Reads pbrt's names: `sRGB`, `linear`, `gamma 2.2`.
    fn from_str(s: &str) -> Result<Self, Error> {
        match s {
            "sRGB" => Ok(Encoding::Srgb),
            "linear" => Ok(Encoding::Linear),
            _ => match s.strip_prefix("gamma ").and_then(|g| g.trim().parse().ok()) {
                Some(g) if g > 0.0 && g < f32::INFINITY => Ok(Encoding::Gamma(g)),
                _ => Err(ErrorKind::BadEncoding(s.into()).into()),
            },
        }
    }
}

/// Returns a picture in linear f32: channels `R G B`, `R G B A`, `Y` or `Y A`; of an EXR file, whatever it has.
///
/// Alpha is never decoded (it is linear in all formats) and colour is not multiplied by it.
///
/// `name` is only used in error messages. *Errors*: unknown format, truncated or damaged file, more than
/// [`MAX_SAMPLES`] samples (refused from the header). Never panics.
pub fn load_texture(bytes: &[u8], name: &str, encoding: Encoding) -> Result<Picture, Error> {
    if crate::exr::is_exr(bytes) {
        return crate::exr::decode(bytes);
    }
    let unknown = || Error::from(ErrorKind::UnknownFormat(name.into()));
    let format = ::image::guess_format(bytes).map_err(|_| unknown())?;
    let label = match format {
        ImageFormat::Png => "PNG",
        ImageFormat::Jpeg => "JPEG",
        ImageFormat::Hdr => "Radiance HDR",
        _ => return Err(unknown()),
    };
    guarded(label, || {
        let mut limits = Limits::no_limits();
        // The decoder's own memory; the largest admitted picture has four bytes per sample in Radiance files.
        limits.max_alloc = Some(4 * MAX_SAMPLES);
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        reader.limits(limits);
        let decoder = reader.into_decoder().map_err(|e| from_image(label, e))?;
        let (width, height) = decoder.dimensions();
        let channels = u64::from(decoder.color_type().channel_count());
        check_size(width.into(), height.into(), channels)?;
        // A header that promises more than the bytes can hold is damaged: no memory for it.
        let samples = u64::from(width) * u64::from(height) * channels;
        if samples > SMALL && samples / packed(format) > bytes.len() as u64 {
            return Err(ErrorKind::Truncated(label).into());
        }
        let image = DynamicImage::from_decoder(decoder).map_err(|e| from_image(label, e))?;
        planes(image, encoding)
    })
}

/// Number of samples that is granted to a picture of any number of bytes: 4 MiB.
const SMALL: u64 = 1 << 20;

/// Returns how many samples a byte of a file of this format can stand for at most.
///
/// PNG: deflate packs 1032 to 1, and a byte may hold eight samples. JPEG: a block of 64 samples takes a bit or more, four blocks of
/// colour may be halved twice. Radiance: runs of old files double their length with every pixel.
fn packed(format: ImageFormat) -> u64 {
    match format {
        ImageFormat::Hdr => 1 << 16,
        _ => 8 * 1032,
    }
}

/// Splits decoded pixels into linear planes.
fn planes(image: DynamicImage, encoding: Encoding) -> Result<Picture, Error> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let bytes_of = |table: &[f32], alpha: &[f32], data: &[u8], n| {
        split(data, n, |v, a| (if a { alpha } else { table })[usize::from(v)])
    };
    // Tables over all codes: 256 or 65536 entries instead of a power function per sample.
    let table = |codes: usize, e: Encoding| -> Vec<f32> {
        (0..codes).map(|v| e.decode(v as f64 / (codes - 1) as f64) as f32).collect()
    };
    let channels = usize::from(image.color().channel_count());
    let split = match &image {
        DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageRgb8(_)
        | DynamicImage::ImageRgba8(_) => {
            bytes_of(&table(256, encoding), &table(256, Encoding::Linear), image.as_bytes(), channels)
        }
        DynamicImage::ImageLuma16(b) => words(b.as_raw(), channels, &table(65536, encoding)),
        DynamicImage::ImageLumaA16(b) => words(b.as_raw(), channels, &table(65536, encoding)),
        DynamicImage::ImageRgb16(b) => words(b.as_raw(), channels, &table(65536, encoding)),
        DynamicImage::ImageRgba16(b) => words(b.as_raw(), channels, &table(65536, encoding)),
        DynamicImage::ImageRgb32F(b) => split(b.as_raw(), channels, |v, _| v),
        DynamicImage::ImageRgba32F(b) => split(b.as_raw(), channels, |v, _| v),
        other => {
            let reason = format!("pixels of type {:?}", other.color());
            return Err(ErrorKind::Unsupported { format: "picture", reason }.into());
        }
    };
    let names = [&["Y"][..], &["Y", "A"], &["R", "G", "B"], &["R", "G", "B", "A"]][channels - 1];
    let mut picture = Picture::new(width, height);
    for (name, data) in names.iter().zip(split) {
        picture.push(name, data)?;
    }
    picture.check()?;
    Ok(picture)
}

fn words(data: &[u16], channels: usize, table: &[f32]) -> Vec<Vec<f32>> {
    split(data, channels, |v, alpha| if alpha { f32::from(v) / 65535.0 } else { table[usize::from(v)] })
}

/// Returns one plane per channel of interleaved samples; `convert` is told whether a sample is alpha (2nd of 2, 4th of 4).
fn split<T: Copy>(data: &[T], channels: usize, convert: impl Fn(T, bool) -> f32) -> Vec<Vec<f32>> {
    let plane = |c: usize| {
        let alpha = channels.is_multiple_of(2) && c + 1 == channels;
        data.iter().skip(c).step_by(channels).map(|&v| convert(v, alpha)).collect()
    };
    (0..channels).map(plane).collect()
}

fn from_image(format: &'static str, error: ImageError) -> Error {
    match error {
        ImageError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => ErrorKind::Truncated(format),
        ImageError::Limits(e)
            if matches!(e.kind(), LimitErrorKind::InsufficientMemory | LimitErrorKind::DimensionError) =>
        {
            ErrorKind::Unsupported { format, reason: "more memory than is granted".into() }
        }
        ImageError::Unsupported(e) => ErrorKind::Unsupported { format, reason: e.to_string() },
        other => ErrorKind::Damaged { format, reason: other.to_string() },
    }
    .into()
}

#[cfg(test)]
#[path = "texture_tests.rs"]
mod tests;
