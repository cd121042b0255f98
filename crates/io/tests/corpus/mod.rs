//! Mutated files out of nothing but a seed: small valid files of every kind, and ways to damage them.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use moonmilk_core::{Random, Stream};
use moonmilk_io::image::Picture;
use moonmilk_io::{exr, png};

/// Parsers under test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Scene,
    Ply,
    Exr,
    Png,
}

/// Valid files, made once.
pub struct Corpus {
    scenes: Vec<Vec<u8>>,
    plys: Vec<Vec<u8>>,
    exrs: Vec<Vec<u8>>,
    pngs: Vec<Vec<u8>>,
    /// What scenes may refer to.
    pub others: Vec<(&'static str, Vec<u8>)>,
}

impl Corpus {
    pub fn new() -> Self {
        let (plys, exrs, pngs) = (plys(), exrs(), pngs());
        let others = vec![
            (
                "inc.pbrt",
                b"Translate 0 1 0\nMaterial \"diffuse\" \"rgb reflectance\" [.2 .3 .4]\nShape \"sphere\" ".to_vec(),
            ),
            ("inc.pbrt.gz", gzip(b"AttributeBegin Shape \"disk\" AttributeEnd\n")),
            ("cut.pbrt.gz", gzip(b"Shape \"disk\" Shape \"sphere\"\n")[..30].to_vec()),
            ("mesh.ply", plys[1].clone()),
            ("mesh.ply.gz", gzip(&plys[0])),
            ("tex.png", pngs[0].clone()),
            ("env.exr", exrs[0].clone()),
            ("s.spd", b"400 .1\n500 .4\n700 .2\n".to_vec()),
        ];
        let scenes = SCENES.iter().map(|s| s.as_bytes().to_vec()).collect();
        Self { scenes, plys, exrs, pngs, others }
    }

    /// Returns file number `index` of a kind: a valid one with one to eight mutations, mostly few, so that many are accepted.
    pub fn file(&self, kind: Kind, seed: u64, index: u64) -> Vec<u8> {
        let mut dice = Dice(Stream::new(&[seed, kind as u64, index]));
        let seeds = match kind {
            Kind::Scene => &self.scenes,
            Kind::Ply => &self.plys,
            Kind::Exr => &self.exrs,
            Kind::Png => &self.pngs,
        };
        let mut bytes = seeds[dice.roll(seeds.len())].clone();
        let other = &seeds[dice.roll(seeds.len())];
        for _ in 0..[1, 1, 1, 1, 2, 2, 3, 8][dice.roll(8)] {
            mutate(&mut bytes, other, kind, &mut dice);
        }
        // A PNG whose sums are wrong is refused before its contents are looked at: mend most of them.
        if kind == Kind::Png && dice.roll(4) > 0 {
            mend_png(&mut bytes);
        }
        // Scene and PLY may come packed, and cut short.
        if kind == Kind::Scene && dice.roll(16) == 0 {
            bytes = gzip(&bytes);
            if dice.roll(2) == 0 {
                bytes.truncate(dice.roll(bytes.len()));
            }
        }
        bytes
    }
}

struct Dice(Stream);

impl Dice {
    fn roll(&mut self, n: usize) -> usize {
        ((f64::from(self.0.uniform()) * n as f64) as usize).min(n.saturating_sub(1))
    }

    fn byte(&mut self) -> u8 {
        self.0.bits() as u8
    }
}

/// Bytes and words that break readers.
const NUMBERS: [&str; 20] = [
    "0",
    "-1",
    "1000000000",
    "4294967296",
    "2147483647",
    "-2147483648",
    "99999999999999999999",
    "1e999",
    "-1e999",
    "1e-40",
    "nan",
    "inf",
    "0.0000001",
    "1e38",
    "3.5e38",
    "255",
    "65536",
    "-0",
    ".",
    "1e",
];

const WORDS: [&str; 44] = [
    "[",
    "]",
    "\"",
    "\\",
    "#",
    "\n",
    "AttributeBegin ",
    "AttributeEnd ",
    "ObjectBegin \"o\" ",
    "ObjectEnd ",
    "ObjectInstance \"o\" ",
    "Include \"scene.pbrt\" ",
    "Import \"scene.pbrt\" ",
    "Include \"inc.pbrt\" ",
    "Import \"inc.pbrt.gz\" ",
    "Include \"cut.pbrt.gz\" ",
    "Scale 0 0 0 ",
    "Scale 1e20 1e20 1e20 ",
    "WorldBegin ",
    "\"float x\" ",
    "\"texture alpha\" \"t\" ",
    "\"float alpha\" 0 ",
    "Shape \"bilinearmesh\" ",
    "Shape \"sphere\" \"float radius\" ",
    "Shape \"plymesh\" \"string filename\" \"mesh.ply\" ",
    "Shape \"plymesh\" \"string filename\" \"mesh.ply.gz\" ",
    "Texture \"t\" \"float\" \"mix\" ",
    "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"tex.png\" ",
    "LightSource \"infinite\" \"string filename\" \"env.exr\" ",
    "\"spectrum L\" \"s.spd\" ",
    "MediumInterface \"m\" \"\" ",
    "AreaLightSource \"diffuse\" ",
    "ReverseOrientation ",
    "ActiveTransform EndTime ",
    "Rotate 30 0 0 0 ",
    "LookAt 0 0 0 0 0 0 0 0 0 ",
    "Attribute \"shape\" \"float radius\" 2 ",
    "Option \"seed\" 3 ",
    "CoordSysTransform \"camera\" ",
    "Material \"mix\" \"string materials\" [\"a\" \"a\"] ",
    "NamedMaterial \"a\" ",
    "\u{0}",
    "\u{fffd}",
    "\u{feff}",
];

fn mutate(bytes: &mut Vec<u8>, other: &[u8], kind: Kind, dice: &mut Dice) {
    if bytes.is_empty() {
        bytes.push(b' ');
    }
    let (a, b) = (dice.roll(bytes.len()), dice.roll(bytes.len()));
    let (low, high) = (a.min(b), a.max(b));
    match dice.roll(if kind == Kind::Scene { 12 } else { 9 }) {
        0 => bytes[a] = dice.byte(),
        1 => bytes[a] ^= 1 << dice.roll(8),
        2 => drop(bytes.drain(low..high.min(low + 40))),
        3 => bytes.truncate(a.max(1)),
        4 => {
            let piece = bytes[low..high.min(low + 64)].to_vec();
            drop(bytes.splice(a..a, piece));
        }
        5 => {
            // A piece of another file of the kind.
            let from = dice.roll(other.len());
            let to = (from + 1 + dice.roll(64)).min(other.len());
            drop(bytes.splice(a..a, other[from..to].iter().copied()));
        }
        6 => {
            // A word of two, four or eight bytes with an extreme value.
            let word: [u8; 8] =
                [0u64, u64::MAX, 0x7fff_ffff, 0x8000_0000, 1_000_000_000, 0x7ff0_0000_0000_0000, 0x7fc0_0000, 1]
                    [dice.roll(8)]
                .to_le_bytes();
            let n = [2, 4, 8][dice.roll(3)];
            for (i, w) in word[..n].iter().enumerate() {
                if let Some(x) = bytes.get_mut(a + i) {
                    *x = *w;
                }
            }
        }
        7 | 8 => replace_number(bytes, a, NUMBERS[dice.roll(NUMBERS.len())]),
        9 | 10 => drop(bytes.splice(a..a, WORDS[dice.roll(WORDS.len())].bytes())),
        _ => {
            // A block many times over.
            let piece = bytes[low..high.min(low + 30)].to_vec();
            let many = piece.repeat(1 + dice.roll(200));
            drop(bytes.splice(a..a, many));
        }
    }
    // Mutations that double must not make files that are large in themselves.
    bytes.truncate(1 << 16);
}

/// Replaces the next decimal number at or after a place.
fn replace_number(bytes: &mut Vec<u8>, from: usize, by: &str) {
    let digit = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'-');
    let Some(start) = bytes[from..].iter().position(digit).map(|i| i + from) else {
        return;
    };
    let end = bytes[start..].iter().position(|b| !digit(b)).map_or(bytes.len(), |i| i + start);
    drop(bytes.splice(start..end, by.bytes()));
}

/// Makes the sums of all chunks right that can be walked to.
fn mend_png(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(head) = bytes.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(end) = at.checked_add(8).and_then(|x| x.checked_add(length)).filter(|&e| e + 4 <= bytes.len()) else {
            return;
        };
        let mut crc = flate2::Crc::new();
        crc.update(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&crc.sum().to_be_bytes());
        at = end + 4;
    }
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = GzEncoder::new(Vec::new(), Compression::default());
    out.write_all(bytes).expect("memory");
    out.finish().expect("memory")
}

fn plys() -> Vec<Vec<u8>> {
    let ascii = b"ply\nformat ascii 1.0\ncomment a tetrahedron\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float u\nproperty float v\nelement face 3\nproperty list uchar int vertex_indices\nproperty int label\nend_header\n0 0 0 0 0 1 0 0\n1 0 0 0 0 1 1 0\n0 1 0 0 0 1 0 1\n0 0 1 0 0 1 1 1\n3 0 1 2 7\n4 0 1 3 2 8\n3 1 2 3 9\n".to_vec();
    let binary = |big: bool, plain: bool| {
        let order = if big { "big" } else { "little" };
        let extra = if plain { "" } else { "property double weight\nproperty list uchar short marks\n" };
        let list = if plain { "uchar int" } else { "ushort uint" };
        let mut out = format!("ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{extra}element edge 1\nproperty int a\nelement face 4\nproperty list {list} vertex_index\nend_header\n").into_bytes();
        macro_rules! put {
            ($x:expr) => {
                out.extend(if big { $x.to_be_bytes().to_vec() } else { $x.to_le_bytes().to_vec() })
            };
        }
        for p in [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
            p.iter().for_each(|x| put!(x));
            if !plain {
                put!(0.5f64);
                put!(2u8);
                put!(7i16);
                put!(-7i16);
            }
        }
        put!(3i32);
        for f in [[0u32, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] {
            if plain {
                put!(3u8)
            } else {
                put!(3u16)
            }
            f.iter().for_each(|v| put!(v));
        }
        out
    };
    vec![ascii, binary(false, true), binary(true, true), binary(false, false), binary(true, false)]
}

fn colours(width: usize, height: usize) -> Picture {
    let pixel = |i: usize| [i as f32 / 50.0, (i % 7) as f32 / 7.0, 0.25];
    Picture::from_rgb(width, height, &(0..width * height).map(pixel).collect::<Vec<_>>()).expect("a picture")
}

fn exrs() -> Vec<Vec<u8>> {
    use ::exr::prelude::*;
    let mut layers = colours(9, 5);
    layers.push("Variance.R", vec![0.5; 45]).expect("a channel");
    layers.offset = [2, 3];
    layers.attributes.insert("seed".into(), moonmilk_io::image::Value::Text("7".into()));
    let mut list = vec![exr::encode(&colours(8, 8)).expect("encoded"), exr::encode(&layers).expect("encoded")];
    let compressions = [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::PIZ,
        Compression::PXR24,
        Compression::B44,
    ];
    for (i, compression) in compressions.into_iter().enumerate() {
        let half = |k: usize| (0..300).map(|j| f16::from_f32((j * (k + 1)) as f32 * 0.01)).collect::<Vec<_>>();
        let channel = |(k, name): (usize, &str)| AnyChannel::new(name, FlatSamples::F16(half(k)));
        let channels = AnyChannels::sort(["B", "G", "R"].into_iter().enumerate().map(channel).collect());
        let blocks = if i % 2 == 0 { Blocks::ScanLines } else { Blocks::Tiles(Vec2(16, 16)) };
        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
        let layer = Layer::new((20, 15), LayerAttributes::named("main"), encoding, channels);
        let mut bytes = std::io::Cursor::new(Vec::new());
        Image::from_layer(layer).write().to_buffered(&mut bytes).expect("written");
        list.push(bytes.into_inner());
    }
    list
}

fn pngs() -> Vec<Vec<u8>> {
    use ::image::{ExtendedColorType, ImageEncoder};
    let data: Vec<u8> = (0..16 * 12 * 8).map(|i| (i * 37 % 251) as u8).collect();
    let mut list = vec![png::encode(&colours(16, 12)).expect("encoded")];
    for (kind, bytes) in [
        (ExtendedColorType::L8, 1),
        (ExtendedColorType::La8, 2),
        (ExtendedColorType::Rgba8, 4),
        (ExtendedColorType::L16, 2),
        (ExtendedColorType::Rgb16, 6),
    ] {
        let mut out = Vec::new();
        let encoder = ::image::codecs::png::PngEncoder::new(&mut out);
        encoder.write_image(&data[..16 * 12 * bytes], 16, 12, kind).expect("encoded");
        list.push(out);
    }
    let mut jpeg = Vec::new();
    ::image::codecs::jpeg::JpegEncoder::new(&mut jpeg)
        .write_image(&data[..16 * 12 * 3], 16, 12, ExtendedColorType::Rgb8)
        .expect("encoded");
    list.push(jpeg);
    // Radiance: a header, and flat pixels without run lengths.
    let mut hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 4\n".to_vec();
    hdr.extend((0..64).map(|i| (i * 5 + 100) as u8));
    list.push(hdr);
    list
}

/// Small scenes that say about everything that can be said.
const SCENES: [&str; 4] = [
    r#"LookAt 0 1 -4  0 0 0  0 1 0
Camera "perspective" "float fov" [40] "float lensradius" .01 "float focaldistance" 4
Film "rgb" "string filename" "scene.exr" "integer xresolution" 16 "integer yresolution" [16] "float iso" 100
Sampler "independent" "integer pixelsamples" 4
PixelFilter "gaussian" "float sigma" .5
Integrator "volpath" "integer maxdepth" 1000
MakeNamedMedium "m" "string type" "homogeneous" "rgb sigma_s" [4 3 2] "rgb sigma_a" [.1 .2 .4] "float g" .3 "float scale" 2
WorldBegin
LightSource "infinite" "rgb L" [.4 .5 .6]
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [6 5 4] "bool twosided" true
  Translate -1 3 -1
  Rotate 90 1 0 0
  Shape "disk" "float radius" 1
AttributeEnd
AttributeBegin
  MediumInterface "m" ""
  Material "dielectric" "float eta" 1.33
  Shape "sphere" "float radius" [1.5]
AttributeEnd
Include "inc.pbrt" "float radius" .5
"#,
    r#"Scale -1 1 1
Camera "orthographic" "float screenwindow" [-1 1 -1 1]
Film "gbuffer" "integer xresolution" 8 "integer yresolution" 8
WorldBegin
Texture "t" "spectrum" "checkerboard" "rgb tex1" [1 0 0] "rgb tex2" [.1 .2 .3] "float uscale" 4
Texture "f" "float" "imagemap" "string filename" "tex.png"
Texture "mix" "spectrum" "scale" "texture tex" "t" "texture scale" "f"
MakeNamedMaterial "a" "string type" "coatedconductor" "spectrum conductor.eta" "metal-Cu-eta" "float thickness" .01
MakeNamedMaterial "b" "string type" "diffusetransmission" "texture reflectance" "mix"
Material "subsurface" "texture reflectance" "t" "rgb mfp" [1 2 3] "float scale" .1 "float roughness" .2
ObjectBegin "o"
  Shape "loopsubdiv" "integer levels" 2 "point3 P" [1 1 1  -1 -1 1  -1 1 -1  1 -1 -1] "integer indices" [0 1 2 0 3 1 0 2 3 1 3 2]
ObjectEnd
ObjectInstance "o"
AttributeBegin Translate 3 0 0 ObjectInstance "o" AttributeEnd
Attribute "material" "string moonmilk.set" "skin" "integer moonmilk.priority" 3
Material "mix" "string materials" ["a" "b"] "float amount" .4
Shape "bilinearmesh" "point3 P" [0 0 0  1 0 0  0 1 .3  1 1 1] "point2 uv" [0 0 1 0 0 1 1 1]
Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "normal N" [0 0 1 0 0 1 0 0 1] "integer indices" [0 1 2]
LightSource "spot" "point3 from" [1 2 3] "blackbody I" 3000 "float coneangle" 20
LightSource "distant" "spectrum L" [400 1 700 2] "float illuminance" 3
"#,
    r#"Option "seed" 5
ColorSpace "srgb"
Transform [1 0 0 0 0 1 0 0 0 0 1 0 0 0 5 1]
Camera "spherical" "string mapping" "equalarea"
WorldBegin
CoordinateSystem "here"
TransformBegin ConcatTransform [2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1] TransformEnd
CoordSysTransform "here"
Material "coateddiffuse" "rgb reflectance" [.5 .4 .3] "float roughness" 0
Shape "plymesh" "string filename" "mesh.ply" "float alpha" .5
Material "conductor" "rgb reflectance" [.9 .8 .7] "bool remaproughness" false
Shape "cylinder" "float zmin" -1 "float zmax" 1 "float phimax" 180
Material "thindielectric" "spectrum eta" "glass-BK7"
Shape "disk" "float innerradius" .3
Material "hair" "float eumelanin" 1
Shape "curve" "point3 P" [0 0 0 0 1 0 1 1 0 2 2 1] "float width" .1 "string type" "flat"
MakeNamedMedium "g" "string type" "uniformgrid" "float density" [0 .1 .2 .3 .4 .5 .6 .7] "integer nx" 2 "integer ny" 2 "integer nz" 2 "rgb sigma_s" 1
MakeNamedMedium "c" "string type" "cloud"
MediumInterface "g" ""
Material "interface"
Shape "sphere"
LightSource "infinite" "string filename" "env.exr" "float scale" 2
LightSource "projection" "string filename" "tex.png"
LightSource "goniometric" "string filename" "env.exr"
"#,
    r#"Camera "realistic"
WorldBegin
AttributeBegin
ReverseOrientation
ActiveTransform EndTime
Translate 0 1 0
ActiveTransform All
TransformTimes 0 1
Texture "d" "float" "fbm" "integer octaves" 4
Texture "w" "spectrum" "marble" "float scale" 2
Texture "x" "float" "dots" "float inside" 1 "float outside" .2
Texture "y" "spectrum" "directionmix" "rgb tex1" [1 1 1] "vector3 dir" [0 1 0]
Material "diffuse" "texture reflectance" "w" "texture displacement" "d"
Shape "sphere" "float zmin" -.5
Material "measured" "string filename" "none.bsdf"
Shape "plymesh" "string filename" "mesh.ply.gz"
AttributeEnd
Import "inc.pbrt.gz"
Material "subsurface" "string name" "Skin1"
Shape "trianglemesh" "point3 P" [1 1 1  -1 -1 1  -1 1 -1  1 -1 -1] "integer indices" [0 1 2 0 3 1 0 2 3 1 3 2]
LightSource "point" "spectrum I" "s.spd" "float power" 30
"#,
];
