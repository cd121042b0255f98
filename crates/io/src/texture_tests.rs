//! Every format and depth, and damaged files.

use super::*;
use ::image::codecs::hdr::HdrEncoder;
use ::image::codecs::jpeg::JpegEncoder;
use ::image::codecs::png::PngEncoder;
use ::image::{ExtendedColorType, ImageEncoder, Rgb};

const W: usize = 12;
const H: usize = 9;

fn png(data: &[u8], color: ExtendedColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(data, W as u32, H as u32, color).unwrap();
    bytes
}

fn codes(n: usize) -> Vec<u8> {
    (0..W * H * n).map(|i| (i * 37 % 256) as u8).collect()
}

#[test]
fn png_of_every_channel_count_is_decoded_with_alpha_left_linear() {
    use ExtendedColorType::{L8, La8, Rgb8, Rgba8};
    for (n, color, names) in [(1, L8, "Y"), (2, La8, "YA"), (3, Rgb8, "RGB"), (4, Rgba8, "RGBA")] {
        let data = codes(n);
        let bytes = png(&data, color);
        for encoding in [Encoding::Srgb, Encoding::Linear, Encoding::Gamma(2.2)] {
            let p = load_texture(&bytes, "t.png", encoding).unwrap();
            assert_eq!(p.channels.iter().map(|c| c.name.as_str()).collect::<String>(), names);
            for (c, channel) in p.channels.iter().enumerate() {
                let e = if channel.name == "A" { Encoding::Linear } else { encoding };
                for (i, &v) in channel.data.iter().enumerate() {
                    assert_eq!(v, e.decode(f64::from(data[i * n + c]) / 255.0) as f32);
                }
            }
        }
    }
}

#[test]
fn sixteen_bits_keep_their_precision() {
    let values: Vec<u16> = (0..W * H * 3).map(|i| (i * 257 % 65536) as u16).collect();
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_ne_bytes()).collect();
    let p = load_texture(&png(&data, ExtendedColorType::Rgb16), "t.png", Encoding::Linear).unwrap();
    for (i, &v) in p.channel("G").unwrap().iter().enumerate() {
        assert_eq!(v, (f64::from(values[3 * i + 1]) / 65535.0) as f32);
    }
}

fn jpeg() -> Vec<u8> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 100)
        .write_image(&[128; W * H * 3], W as u32, H as u32, ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

fn hdr() -> Vec<u8> {
    let mut bytes = Vec::new();
    let pixels: Vec<Rgb<f32>> = (0..W * H).map(|i| Rgb([i as f32, 1000.0, 0.5])).collect();
    HdrEncoder::new(&mut bytes).encode(&pixels, W, H).unwrap();
    bytes
}

#[test]
fn jpeg_is_decoded_and_radiance_stays_linear() {
    let p = load_texture(&jpeg(), "wrong.png", Encoding::Srgb).unwrap();
    for c in p.rgb().unwrap() {
        // A flat grey of 128; the codec may be off by one code.
        assert!((c[5] - srgb_decode(128.0 / 255.0) as f32).abs() < 0.005, "{}", c[5]);
    }
    let p = load_texture(&hdr(), "t.hdr", Encoding::Srgb).unwrap();
    for (i, &v) in p.channel("G").unwrap().iter().enumerate() {
        // Eight bits of mantissa relative to the largest channel.
        assert!((v - 1000.0).abs() < 1000.0 / 128.0 && (p.channel("R").unwrap()[i] - i as f32).abs() < 8.0);
    }
}

#[test]
fn exr_passes_through() {
    let p = Picture::from_rgb(2, 1, &[[1.0, 20.0, 0.5], [0.0, -1.0, 2.0]]).unwrap();
    let q = load_texture(&crate::exr::encode(&p).unwrap(), "t", Encoding::Srgb).unwrap();
    assert_eq!(p.rgb(), q.rgb());
}

#[test]
fn truncated_and_damaged_textures_are_errors_or_pictures_never_panics() {
    let files = [png(&codes(3), ExtendedColorType::Rgb8), jpeg(), hdr()];
    for (k, bytes) in files.iter().enumerate() {
        let mut refused = 0;
        for length in 0..bytes.len() {
            refused += usize::from(load_texture(&bytes[..length], "t", Encoding::Srgb).is_err());
        }
        // A PNG without its last chunk and a JPEG without its last bytes still show the whole picture.
        assert!(
            refused + 16 >= bytes.len() || k == 1 && refused > bytes.len() / 2,
            "{k}: {refused} of {}",
            bytes.len()
        );
        for at in 0..bytes.len() {
            let mut b = bytes.clone();
            b[at] ^= 0x55;
            let _ = load_texture(&b, "t", Encoding::Srgb);
        }
    }
}

#[test]
fn a_png_header_of_absurd_size_is_refused() {
    let mut bytes = png(&codes(3), ExtendedColorType::Rgb8);
    // Width and height of the IHDR chunk, then its checksum.
    bytes[16..24].copy_from_slice(&[0x00, 0x10, 0, 0, 0x00, 0x10, 0, 0]);
    let mut crc = flate2::Crc::new();
    crc.update(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&crc.sum().to_be_bytes());
    let e = load_texture(&bytes, "t", Encoding::Srgb).unwrap_err();
    assert!(matches!(e.kind, ErrorKind::TooLarge { .. }), "{e}");
}

#[test]
fn unknown_formats_and_encodings_are_named() {
    let e = load_texture(b"GIF89a and more", "a.gif", Encoding::Srgb).unwrap_err();
    assert!(e.to_string().starts_with("a.gif is not a picture"), "{e}");
    assert!(load_texture(b"", "a", Encoding::Srgb).is_err());
    assert_eq!("gamma 2.2".parse::<Encoding>().unwrap(), Encoding::Gamma(2.2));
    assert_eq!("sRGB".parse::<Encoding>().unwrap(), Encoding::Srgb);
    for bad in ["srgb", "gamma", "gamma -1", "gamma inf", "gamma x"] {
        assert!(bad.parse::<Encoding>().is_err());
    }
}
