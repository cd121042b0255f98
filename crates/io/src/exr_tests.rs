//! Round trips, foreign files and damaged files.

use super::*;
use crate::image::MAX_SAMPLES;
use ::exr::prelude::{Layer, SmallVec, f16};

/// Values that a careless path would change: denormal, negative zero, infinities, NaN, the largest number.
fn sample(width: usize, height: usize) -> Picture {
    let mut p = Picture::new(width, height);
    p.offset = [-3, 7];
    p.display = Window { x: -10, y: 0, width: width + 20, height: height + 9 };
    for (k, name) in ["R", "G", "B", "Albedo.R", "Variance.R", "S0.550,0nm"].into_iter().enumerate() {
        let odd = [0.0, -0.0, 1e-42, f32::MAX, f32::INFINITY, -1.5];
        p.push(name, (0..width * height).map(|i| odd[(i + k) % 6] + if i > 40 { i as f32 } else { 0.0 }).collect())
            .unwrap();
    }
    p.attributes = [
        ("moonmilk.seed".to_owned(), Value::Text("18446744073709551615".into())),
        ("moonmilk.scene".to_owned(), Value::Text("Wachs-Körper, 蠟".into())),
        ("moonmilk.spp".to_owned(), Value::Int(-1024)),
        ("moonmilk.time".to_owned(), Value::Float(0.1)),
        ("moonmilk.empty".to_owned(), Value::Text(String::new())),
        ("software".to_owned(), Value::Text("moonmilk 0.1.0".into())),
        ("owner".to_owned(), Value::Text("Jörg".into())),
        ("comments".to_owned(), Value::Text("none".into())),
    ]
    .into();
    p
}

fn by_name(mut p: Picture) -> Picture {
    p.channels.sort_by(|a, b| a.name.cmp(&b.name));
    p
}

#[test]
fn a_written_picture_is_read_back_bit_by_bit() {
    for (w, h) in [(1, 1), (17, 33), (64, 16)] {
        let p = sample(w, h);
        let q = decode(&encode(&p).unwrap()).unwrap();
        let bits = |p: &Picture| {
            p.channels.iter().map(|c| c.data.iter().map(|x| x.to_bits()).collect()).collect::<Vec<Vec<u32>>>()
        };
        let p = by_name(p);
        assert_eq!(bits(&p), bits(&q));
        assert_eq!(p, q);
    }
}

#[test]
fn the_same_picture_gives_the_same_bytes() {
    let first = encode(&sample(40, 50)).unwrap();
    // Eight custom attributes have 40320 orders in a hash map; a new map is seeded differently each time.
    for _ in 0..8 {
        assert!(encode(&sample(40, 50)).unwrap() == first);
    }
}

#[test]
fn nan_survives_a_round_trip() {
    let mut p = Picture::new(1, 1);
    p.push("Y", vec![f32::NAN]).unwrap();
    assert!(decode(&encode(&p).unwrap()).unwrap().channels[0].data[0].is_nan());
}

#[test]
fn reserved_attributes_and_bad_pictures_are_refused() {
    let mut p = sample(2, 2);
    p.attributes.insert("dataWindow".into(), Value::Int(1));
    assert!(encode(&p).unwrap_err().to_string().contains("dataWindow"));
    let mut p = sample(2, 2);
    p.channels[0].data.pop();
    assert!(encode(&p).is_err());
    assert!(encode(&Picture::new(2, 2)).is_err());
}

type Samples = AnyChannel<FlatSamples>;

fn part(
    name: Option<&str>,
    at: (i32, i32),
    size: (usize, usize),
    compression: Compression,
    list: Vec<Samples>,
) -> Layer<AnyChannels<FlatSamples>> {
    let blocks = if compression == Compression::PIZ { Blocks::Tiles(Vec2(5, 3)) } else { Blocks::ScanLines };
    let attributes =
        LayerAttributes { layer_name: name.map(text), layer_position: Vec2(at.0, at.1), ..Default::default() };
    Layer::new(
        size,
        attributes,
        Encoding { compression, blocks, line_order: LineOrder::Increasing },
        AnyChannels::sort(SmallVec::from_vec(list)),
    )
}

fn write(layers: Vec<Layer<AnyChannels<FlatSamples>>>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let image = Image::from_layers(ImageAttributes::new(IntegerBounds::new((0, 0), (30, 20))), layers);
    image.write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn half_float_and_integer_channels_become_f32() {
    for compression in [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::PIZ] {
        let n = 11 * 7;
        let half = AnyChannel::new("half", FlatSamples::F16((0..n).map(|i| f16::from_f32(i as f32 * 0.25)).collect()));
        let uint = AnyChannel::new("id", FlatSamples::U32((0..n as u32).collect()));
        let float = AnyChannel::new("Z", FlatSamples::F32((0..n).map(|i| i as f32 / 3.0).collect()));
        let p = decode(&write(vec![part(None, (4, -2), (11, 7), compression, vec![half, uint, float])])).unwrap();
        assert_eq!((p.width, p.height, p.offset), (11, 7, [4, -2]));
        for i in 0..n {
            assert_eq!(p.channel("half").unwrap()[i], i as f32 * 0.25);
            assert_eq!(p.channel("id").unwrap()[i], i as f32);
            assert_eq!(p.channel("Z").unwrap()[i], i as f32 / 3.0);
        }
    }
}

#[test]
fn parts_are_joined_into_the_union_of_their_windows() {
    let float = |name: &str, n: usize, v: f32| AnyChannel::new(name, FlatSamples::F32(vec![v; n]));
    let bytes = write(vec![
        part(Some("beauty"), (0, 0), (4, 2), Compression::ZIP16, vec![float("R", 8, 1.0), float("beauty.G", 8, 2.0)]),
        part(Some("mask"), (3, 1), (2, 2), Compression::ZIP16, vec![float("Y", 4, 5.0)]),
    ]);
    let p = decode(&bytes).unwrap();
    assert_eq!(p.window(), Window { x: 0, y: 0, width: 5, height: 3 });
    assert_eq!(p.channel("beauty.R").unwrap(), [1., 1., 1., 1., 0., 1., 1., 1., 1., 0., 0., 0., 0., 0., 0.]);
    assert_eq!(p.channel("beauty.G").unwrap().iter().sum::<f32>(), 16.0);
    assert_eq!(p.channel("mask.Y").unwrap(), [0., 0., 0., 0., 0., 0., 0., 0., 5., 5., 0., 0., 0., 5., 5.]);
}

#[test]
fn a_file_cut_anywhere_is_an_error_and_says_so() {
    let bytes = encode(&sample(20, 40)).unwrap();
    assert!(bytes.len() > 1500);
    let mut truncated = 0;
    for length in 0..bytes.len() {
        let e = decode(&bytes[..length]).expect_err("a part of a file");
        truncated += usize::from(matches!(e.kind, ErrorKind::Truncated(_)));
    }
    // Nearly all cuts are named for what they are; a cut inside a header may look like another damage.
    assert!(truncated * 10 > bytes.len() * 9, "{truncated} of {}", bytes.len());
}

#[test]
fn damaged_bytes_never_panic() {
    let bytes = encode(&sample(9, 20)).unwrap();
    let mut refused = 0;
    // Every byte of the header with three patterns, and every seventh behind it.
    for at in (0..bytes.len()).filter(|&i| i < 1200 || i % 7 == 0) {
        for pattern in [0xff, 0x80, 0x01] {
            let mut b = bytes.clone();
            b[at] ^= pattern;
            refused += usize::from(decode(&b).is_err());
        }
    }
    assert!(refused > 0);
}

#[test]
fn other_files_are_named_as_such() {
    assert!(decode(b"\x89PNG\r\n\x1a\n").unwrap_err().to_string().contains("not a picture in a known format"));
    assert!(matches!(decode(b"").unwrap_err().kind, ErrorKind::Truncated(_)));
}

#[test]
fn absurd_sizes_are_refused_before_memory_is_asked_for() {
    let bytes = encode(&sample(9, 20)).unwrap();
    // Overwrite the data window (four i32 behind name, type and size) by half of the plane.
    let at = bytes.windows(11).position(|w| w == b"dataWindow\0").unwrap() + 11 + 6 + 4;
    for (size, too_large) in [(1i32 << 29, true), (16000, true), (9000, false)] {
        let mut b = bytes.clone();
        for (k, v) in [0, 0, size - 1, size - 1].into_iter().enumerate() {
            b[at + 4 * k..at + 4 * k + 4].copy_from_slice(&v.to_le_bytes());
        }
        let kind = decode(&b).unwrap_err().kind;
        assert_eq!(matches!(kind, ErrorKind::TooLarge { .. }), too_large, "{size}: {kind:?}");
        assert!(too_large || matches!(kind, ErrorKind::Truncated(_)));
    }
    assert!(6 * 16000u64.pow(2) > MAX_SAMPLES && 6 * 9000u64.pow(2) < MAX_SAMPLES);
}

#[test]
fn primaries_other_than_those_of_srgb_are_noticed() {
    let mut picture = Picture::new(1, 1);
    for name in ["R", "G", "B"] {
        picture.push(name, vec![0.5]).expect("a channel");
    }
    let plain = encode(&picture).expect("a file");
    assert!(!has_other_primaries(&plain) && !has_other_primaries(b"no picture"));
    let with = |values: [f32; 8]| {
        // An attribute more, in front of the others: name, type, length, values.
        let mut bytes = plain[..8].to_vec();
        bytes.extend(b"chromaticities\0chromaticities\0");
        bytes.extend(32i32.to_le_bytes());
        bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(&plain[8..]);
        bytes
    };
    assert!(!has_other_primaries(&with([0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329])));
    assert!(has_other_primaries(&with([0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767])));
}
