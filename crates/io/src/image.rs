//! A picture in memory: named channels of one size, a window, attributes.
//!
//! One type for everything that is read or written: a render with its layers, a texture, an environment map, a map of
//! errors. Channels are called as in a file of the OpenEXR format: `R`, `G`, `B` for the picture itself,
//! `Layer.Channel` for what accompanies it (`Albedo.R`, `N.X`, `Variance.R`).
//!
//! Not meant for accumulation (sums belong to the film) nor for filtering textures: it only carries samples.

use std::collections::BTreeMap;
use std::fmt;

/// Largest number of samples (pixels times channels) that is read or written: 2^29, that is 2 GiB of f32.
///
/// It admits a picture of 13 000 x 13 000 pixels in RGB and stops a damaged header before memory is asked for. Raising it
/// needs no other change.
pub const MAX_SAMPLES: u64 = 1 << 29;

/// What went wrong with a picture; the sentence is in [`ErrorKind`].
#[derive(Debug, thiserror::Error)]
#[error("{kind}")]
pub struct Error {
    /// The kind of failure, with the values that matter.
    pub kind: ErrorKind,
}

/// The ways in which reading, writing or comparing a picture fails.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ErrorKind {
    /// The bytes are of none of the formats that are read.
    #[error("{0} is not a picture in a known format (EXR, PNG, JPEG and Radiance HDR are read)")]
    UnknownFormat(String),
    /// The file ends before the picture does.
    #[error("the {0} file ends too early: it is truncated")]
    Truncated(&'static str),
    /// The contents contradict the format.
    #[error("the {format} file is damaged: {reason}")]
    Damaged {
        /// Name of the format.
        format: &'static str,
        /// What the decoder said.
        reason: String,
    },
    /// The file is valid, but uses a feature that is not read.
    #[error("the {format} file uses a feature that is not supported: {reason}")]
    Unsupported {
        /// Name of the format.
        format: &'static str,
        /// The feature.
        reason: String,
    },
    /// The header asks for more memory than is granted.
    #[error(
        "a picture of {width} x {height} pixels with {channels} channels exceeds the limit of {MAX_SAMPLES} samples"
    )]
    TooLarge {
        /// Width in pixels.
        width: u64,
        /// Height in pixels.
        height: u64,
        /// Number of channels.
        channels: u64,
    },
    /// A picture without pixels or without channels.
    #[error("a picture of {width} x {height} pixels with {channels} channels is empty")]
    Empty {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Number of channels.
        channels: usize,
    },
    /// A channel does not have one sample per pixel.
    #[error("channel {name} has {found} samples, {expected} are needed")]
    ChannelSize {
        /// Name of the channel.
        name: String,
        /// Samples present.
        found: usize,
        /// Width times height.
        expected: usize,
    },
    /// A channel's or attribute's name cannot be stored.
    #[error("{0:?} cannot be a channel or attribute name: 1 to 255 bytes, no zero byte, each name once")]
    BadName(String),
    /// The picture has no colour to show or compare.
    #[error("the picture has no colour channels (R, G, B or Y); it has: {0}")]
    NoColour(String),
    /// Two pictures that should be compared cover different pixels.
    #[error("the pictures cover different pixels: {test} against {reference}")]
    DifferentWindows {
        /// Window of the tested picture.
        test: Window,
        /// Window of the reference.
        reference: Window,
    },
    /// A transfer function that is not known.
    #[error("{0:?} is not a colour encoding: sRGB, linear or \"gamma 2.2\" are accepted")]
    BadEncoding(String),
    /// The encoder failed.
    #[error("the {format} file could not be encoded: {reason}")]
    Encode {
        /// Name of the format.
        format: &'static str,
        /// What the encoder said.
        reason: String,
    },
}

impl From<ErrorKind> for Error {
    fn from(kind: ErrorKind) -> Self {
        Error { kind }
    }
}

/// Value of an attribute, in the types that an EXR file can hold without loss.
///
/// A 64-bit seed is a `Text`: the format has no such integer.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Text in UTF-8.
    Text(String),
    /// A 32-bit integer.
    Int(i32),
    /// A 64-bit floating-point number.
    Float(f64),
}

/// A rectangle of pixels in the plane of the full picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Column of the leftmost pixel.
    pub x: i32,
    /// Row of the topmost pixel.
    pub y: i32,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} x {} pixels at ({}, {})", self.width, self.height, self.x, self.y)
    }
}

/// One channel: a name and a sample per pixel, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// `R`, `Albedo.R`, ...
    pub name: String,
    /// `width * height` samples, rows from the top, pixels from the left.
    pub data: Vec<f32>,
}

/// A picture: channels of one size, where they lie in the full picture, and attributes.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns of the stored pixels.
    pub width: usize,
    /// Rows of the stored pixels.
    pub height: usize,
    /// Column and row of the first stored pixel in the full picture (not zero for a crop).
    pub offset: [i32; 2],
    /// The full picture (display window), of which the stored pixels may be a crop.
    pub display: Window,
    /// The channels.
    pub channels: Vec<Channel>,
    /// Scene hash, seed, samples per pixel, version and the like.
    pub attributes: BTreeMap<String, Value>,
}

/// A colour as three planes of `width * height` samples each.
pub type Planes<'a> = [&'a [f32]; 3];

impl Picture {
    /// Returns a picture without channels that is not a crop.
    pub fn new(width: usize, height: usize) -> Self {
        let display = Window { x: 0, y: 0, width, height };
        Picture { width, height, offset: [0, 0], display, channels: Vec::new(), attributes: BTreeMap::new() }
    }

    /// Returns a picture with the channels `R`, `G`, `B` from one triple per pixel.
    ///
    /// *Errors*: `pixels` does not have `width * height` entries.
    pub fn from_rgb(width: usize, height: usize, pixels: &[[f32; 3]]) -> Result<Self, Error> {
        let mut picture = Picture::new(width, height);
        for (i, name) in ["R", "G", "B"].into_iter().enumerate() {
            picture.push(name, pixels.iter().map(|p| p[i]).collect())?;
        }
        Ok(picture)
    }

    /// Adds a channel at the end.
    ///
    /// *Errors*: the number of samples is not `width * height`; the name is unfit or already taken.
    pub fn push(&mut self, name: &str, data: Vec<f32>) -> Result<(), Error> {
        let expected = self.width * self.height;
        if data.len() != expected {
            return Err(ErrorKind::ChannelSize { name: name.into(), found: data.len(), expected }.into());
        }
        if !fit_name(name) || self.channel(name).is_some() {
            return Err(ErrorKind::BadName(name.into()).into());
        }
        self.channels.push(Channel { name: name.into(), data });
        Ok(())
    }

    /// Adds the colour of another picture as the layer `LAYER.R`, `LAYER.G`, `LAYER.B`.
    ///
    /// It joins what other programs keep in two files, for instance a mean and its variance.
    ///
    /// *Errors*: the other picture has no colour or covers other pixels; the layer exists already.
    pub fn add_layer(&mut self, layer: &str, other: &Picture) -> Result<(), Error> {
        if self.window() != other.window() {
            return Err(ErrorKind::DifferentWindows { test: self.window(), reference: other.window() }.into());
        }
        let planes = other.require_rgb()?;
        for (plane, name) in planes.into_iter().zip(["R", "G", "B"]) {
            self.push(&format!("{layer}.{name}"), plane.to_vec())?;
        }
        Ok(())
    }

    /// Returns the samples of the channel of that exact name.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|c| c.name == name).map(|c| c.data.as_slice())
    }

    /// Returns the colour planes of a layer: its `R`, `G`, `B`, or its `Y` three times.
    ///
    /// The empty name stands for the picture itself (`R`, `G`, `B` without a prefix).
    pub fn layer(&self, layer: &str) -> Option<Planes<'_>> {
        let get = |c: &str| {
            if layer.is_empty() { self.channel(c) } else { self.channel(&format!("{layer}.{c}")) }
        };
        match (get("R"), get("G"), get("B"), get("Y")) {
            (Some(r), Some(g), Some(b), _) => Some([r, g, b]),
            (_, _, _, Some(y)) => Some([y, y, y]),
            _ => None,
        }
    }

    /// Returns the colour of the picture.
    ///
    /// That is `R`, `G`, `B` or `Y`; failing these, the first layer that has them; failing that, the only channel there is.
    pub fn rgb(&self) -> Option<Planes<'_>> {
        let layers = self.channels.iter().filter_map(|c| c.name.rsplit_once('.').map(|(layer, _)| layer));
        let mut found = self.layer("").or_else(|| layers.filter_map(|l| self.layer(l)).next());
        if let (None, [only]) = (found, self.channels.as_slice()) {
            found = Some([&only.data; 3]);
        }
        found
    }

    /// Returns the colour of the picture as [`Picture::rgb`] does, or an error that lists the channels.
    pub fn require_rgb(&self) -> Result<Planes<'_>, Error> {
        self.check()?;
        let names = || self.channels.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ");
        self.rgb().ok_or_else(|| ErrorKind::NoColour(names()).into())
    }

    /// Returns the rectangle of the stored pixels in the full picture.
    pub fn window(&self) -> Window {
        Window { x: self.offset[0], y: self.offset[1], width: self.width, height: self.height }
    }

    /// Returns an error if the public fields contradict each other.
    ///
    /// *Errors*: no pixels or channels, more than [`MAX_SAMPLES`], a channel of the wrong length, an unfit or doubled name.
    pub fn check(&self) -> Result<(), Error> {
        let channels = self.channels.len();
        if self.width == 0 || self.height == 0 || channels == 0 {
            return Err(ErrorKind::Empty { width: self.width, height: self.height, channels }.into());
        }
        check_size(self.width as u64, self.height as u64, channels as u64)?;
        let expected = self.width * self.height;
        for (i, c) in self.channels.iter().enumerate() {
            if c.data.len() != expected {
                return Err(ErrorKind::ChannelSize { name: c.name.clone(), found: c.data.len(), expected }.into());
            }
            if !fit_name(&c.name) || self.channels[..i].iter().any(|other| other.name == c.name) {
                return Err(ErrorKind::BadName(c.name.clone()).into());
            }
        }
        match self.attributes.keys().find(|name| !fit_name(name)) {
            Some(name) => Err(ErrorKind::BadName(name.clone()).into()),
            None => Ok(()),
        }
    }
}

/// Returns whether a name can stand in a file: 1 to 255 bytes without a zero.
fn fit_name(name: &str) -> bool {
    (1..=255).contains(&name.len()) && !name.contains('\0')
}

/// Returns an error if so many samples exceed [`MAX_SAMPLES`]; never overflows.
pub(crate) fn check_size(width: u64, height: u64, channels: u64) -> Result<(), Error> {
    let samples = width.checked_mul(height).and_then(|n| n.checked_mul(channels));
    match samples {
        Some(n) if n <= MAX_SAMPLES => Ok(()),
        _ => Err(ErrorKind::TooLarge { width, height, channels }.into()),
    }
}

/// Runs a decoder of another crate and turns a panic inside it into an error.
///
/// A damaged file must never end the program. No panic of the decoders is known (none in 595 000 randomly damaged files: PNG,
/// and EXR in all compressions but DWA), but they are large and fed with whatever a user has: this is the net. The
/// panic's message still appears on stderr through the panic hook.
pub(crate) fn guarded<T>(format: &'static str, decode: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
    // The closure owns or only reads what it touches, hence nothing half-changed can be seen afterwards.
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(decode)).unwrap_or_else(|_| {
        let reason = "its contents broke the decoder".into();
        Err(ErrorKind::Damaged { format, reason }.into())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_is_found_at_the_root_in_a_layer_or_in_a_single_channel() {
        let mut p = Picture::new(2, 1);
        p.push("depth", vec![3.0, 4.0]).unwrap();
        assert_eq!(p.rgb().unwrap()[1], [3.0, 4.0]);
        for (i, c) in ["View.R", "View.G", "View.B"].into_iter().enumerate() {
            p.push(c, vec![i as f32; 2]).unwrap();
        }
        assert_eq!(p.rgb().unwrap()[2], [2.0, 2.0]);
        p.push("Y", vec![9.0; 2]).unwrap();
        assert_eq!(p.rgb().unwrap()[0], [9.0, 9.0]);
        assert!(p.layer("Variance").is_none());
    }

    #[test]
    fn contradictions_are_refused_with_one_sentence() {
        let mut p = Picture::new(2, 2);
        assert!(p.push("R", vec![0.0; 3]).unwrap_err().to_string().contains("3 samples, 4 are needed"));
        p.push("R", vec![0.0; 4]).unwrap();
        assert!(p.push("R", vec![0.0; 4]).is_err() && p.push("", vec![0.0; 4]).is_err());
        p.width = usize::MAX;
        assert!(matches!(p.check().unwrap_err().kind, ErrorKind::TooLarge { .. }));
        assert!(matches!(Picture::new(0, 3).check().unwrap_err().kind, ErrorKind::Empty { .. }));
        let mut q = Picture::new(1, 1);
        q.push("Z", vec![0.0]).unwrap();
        q.push("N.X", vec![0.0]).unwrap();
        assert!(q.require_rgb().unwrap_err().to_string().contains("Z, N.X"));
    }

    #[test]
    fn a_panic_in_a_decoder_becomes_an_error() {
        let e = guarded::<()>("EXR", || panic!("provoked by the test")).unwrap_err();
        assert_eq!(e.to_string(), "the EXR file is damaged: its contents broke the decoder");
    }
}
