//! EXR files: one part, `R G B` at the root, `Layer.Channel` names, f32, lossless (ZIP), attributes, crops.
//!
//! Writing is deterministic: the same picture gives the same bytes (no time, no random order). Reading takes any flat
//! file: half, float or integer samples, scan lines or tiles, one or several parts, any data window; it does not take deep
//! data or sub-sampled channels, and of several resolutions it takes the largest.
//!
//! The `exr` crate stands in the way of both in one point each: it writes custom attributes in the random order of a hash
//! map (cured by sorting the header afterwards), and it allocates before it has seen whether the file can be that large
//! (cured by a look at the headers first).

use std::io::Cursor;

use ::exr::error::Error as ExrError;
use ::exr::image::read::image::ReadLayers;
use ::exr::image::read::layers::ReadChannels;
use ::exr::image::write::WritableImage;
use ::exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatImage, FlatSamples, Image, Layer};
use ::exr::math::Vec2;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{AttributeValue, IntegerBounds, LineOrder, Text};
use ::exr::meta::header::{ImageAttributes, LayerAttributes};
use ::exr::prelude::Compression;

use crate::image::{Error, ErrorKind, Picture, Value, Window, check_size, guarded};

const FORMAT: &str = "EXR";

/// Most samples that a byte of a file can stand for: more than deflate's 1032 bytes per byte, and than PXR24's three bytes of
/// four behind it, in samples of two bytes.
const PACKED: u64 = 1024;

/// The first bytes of every EXR file.
const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Returns whether these bytes begin like an EXR file.
pub fn is_exr(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// Returns the bytes of an EXR file: one part, f32, ZIP over blocks of 16 lines, all channels and attributes.
///
/// Channels are stored in alphabetic order, as the format demands; attributes `owner`, `comments` and `software` become
/// the standard ones of that name, all others custom ones (text as UTF-8 bytes).
///
/// *Errors*: [`Picture::check`]; an attribute name that the format reserves; a window beyond +-2^30.
pub fn encode(picture: &Picture) -> Result<Vec<u8>, Error> {
    picture.check()?;
    let channels = picture.channels.iter().map(|c| AnyChannel::new(text(&c.name), FlatSamples::F32(c.data.clone())));
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let layer = Layer::new(
        (picture.width, picture.height),
        layer_attributes(picture),
        encoding,
        AnyChannels::sort(channels.collect()),
    );
    let d = picture.display;
    let display = IntegerBounds::new((d.x, d.y), (d.width, d.height));
    let image = Image::from_layers(ImageAttributes::new(display), vec![layer]);
    let mut bytes = Cursor::new(Vec::new());
    let failed = |reason: String| Error::from(ErrorKind::Encode { format: FORMAT, reason });
    guarded(FORMAT, || image.write().to_buffered(&mut bytes).map_err(|e| failed(e.to_string())))?;
    sort_header(bytes.into_inner()).ok_or_else(|| failed("its header is not readable".into()))
}

fn text(s: &str) -> Text {
    Text::from_bytes_unchecked(s.as_bytes().into())
}

/// Returns the text of a file's bytes: UTF-8 as we write it, else one character per byte as others do.
fn string(t: &Text) -> String {
    match std::str::from_utf8(t.as_slice()) {
        Ok(s) => s.to_owned(),
        Err(_) => t.as_slice().iter().map(|&b| char::from(b)).collect(),
    }
}

fn layer_attributes(picture: &Picture) -> LayerAttributes {
    let mut attributes =
        LayerAttributes { layer_position: Vec2(picture.offset[0], picture.offset[1]), ..Default::default() };
    for (name, value) in &picture.attributes {
        match (name.as_str(), value) {
            ("owner", Value::Text(s)) => attributes.owner = Some(text(s)),
            ("comments", Value::Text(s)) => attributes.comments = Some(text(s)),
            ("software", Value::Text(s)) => attributes.software_name = Some(text(s)),
            (_, value) => {
                let value = match value {
                    Value::Text(s) => AttributeValue::Text(text(s)),
                    Value::Int(i) => AttributeValue::I32(*i),
                    Value::Float(x) => AttributeValue::F64(*x),
                };
                attributes.other.insert(text(name), value);
            }
        }
    }
    attributes
}

/// Returns the file with the attributes of its only header in alphabetic order, or nothing if the header cannot be walked.
///
/// An attribute is: name, zero, type, zero, size (i32, little endian), value; an empty name ends the header. Their order is
/// free and the header keeps its length, so that the table of offsets behind it stays valid.
fn sort_header(mut bytes: Vec<u8>) -> Option<Vec<u8>> {
    // Skip magic number and version.
    let start = 8;
    let mut end = start;
    let mut attributes = Vec::new();
    while *bytes.get(end)? != 0 {
        let name = end..end + bytes[end..].iter().position(|&b| b == 0)?;
        let size = name.end + 1 + bytes.get(name.end + 1..)?.iter().position(|&b| b == 0)? + 1;
        let length = i32::from_le_bytes(bytes.get(size..size + 4)?.try_into().ok()?);
        let next = size + 4 + usize::try_from(length).ok()?;
        attributes.push((bytes[name].to_vec(), bytes.get(end..next)?.to_vec()));
        end = next;
    }
    attributes.sort();
    let sorted: Vec<u8> = attributes.into_iter().flat_map(|(_, attribute)| attribute).collect();
    bytes[start..end].copy_from_slice(&sorted);
    Some(bytes)
}

/// Returns the picture in the bytes of an EXR file.
///
/// A single part keeps its channel names. Of several parts each channel is called `PART.CHANNEL` (unless it begins like
/// that already), all in one picture that covers the union of their windows, zero where a part has no pixels.
/// Integers and halves become f32 (integers above 2^24 are rounded). Attributes of other types than text and numbers
/// are dropped.
///
/// *Errors*: not an EXR file, truncated, damaged, deep or sub-sampled data, more than [`crate::image::MAX_SAMPLES`]
/// samples (found before memory is asked for). Never panics.
pub fn decode(bytes: &[u8]) -> Result<Picture, Error> {
    if !is_exr(bytes) {
        return Err(if MAGIC.starts_with(bytes) {
            ErrorKind::Truncated(FORMAT)
        } else {
            ErrorKind::UnknownFormat("the file".into())
        }
        .into());
    }
    guarded(FORMAT, || decode_unguarded(bytes))
}

fn decode_unguarded(bytes: &[u8]) -> Result<Picture, Error> {
    check_headers(bytes)?;
    // One thread: a panic in a pool of threads could not be caught.
    let image: FlatImage = ::exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(from_exr)?;
    assemble(image)
}

/// Returns whether a file says that its primaries or its white are others than those of sRGB (ITU-R BT.709), which are meant if it says nothing.
pub fn has_other_primaries(bytes: &[u8]) -> bool {
    let said = guarded(FORMAT, || {
        let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(from_exr)?;
        Ok(meta.headers.first().and_then(|h| h.shared_attributes.chromaticities))
    });
    let Ok(Some(c)) = said else {
        return false;
    };
    let srgb = [(c.red, [0.64, 0.33]), (c.green, [0.30, 0.60]), (c.blue, [0.15, 0.06]), (c.white, [0.3127, 0.3290])];
    // Files round; pbrt-v4 takes 1e-3 for equal.
    srgb.iter().any(|(p, [x, y])| (p.0 - x).abs() > 1e-3 || (p.1 - y).abs() > 1e-3)
}

/// Refuses what cannot be true or is not wanted before memory for pixels is allocated.
fn check_headers(bytes: &[u8]) -> Result<(), Error> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(from_exr)?;
    let unsupported = |reason: &str| Error::from(ErrorKind::Unsupported { format: FORMAT, reason: reason.into() });
    let (mut chunks, mut samples) = (0u64, 0u64);
    for header in &meta.headers {
        if header.deep {
            return Err(unsupported("deep data"));
        }
        if let Some(c) = header.channels.list.iter().find(|c| c.sampling != Vec2(1, 1)) {
            return Err(unsupported(&format!("the sub-sampled channel {}", string(&c.name))));
        }
        check_size(header.layer_size.0 as u64, header.layer_size.1 as u64, header.channels.list.len() as u64)?;
        chunks = chunks.saturating_add(header.chunk_count as u64);
        samples =
            samples.saturating_add((header.layer_size.0 * header.layer_size.1 * header.channels.list.len()) as u64);
    }
    // Every chunk takes an offset of 8 bytes and a prefix of at least 8: a picture that needs more is not in the file.
    // Nor does any compression pack more than a thousandfold (deflate: 1032 to 1) into samples of two bytes.
    if chunks.saturating_mul(16) > bytes.len() as u64 || samples > PACKED.saturating_mul(bytes.len() as u64) {
        return Err(ErrorKind::Truncated(FORMAT).into());
    }
    let window = union(meta.headers.iter().map(|h| (h.own_attributes.layer_position, h.layer_size)));
    let channels = meta.headers.iter().map(|h| h.channels.list.len() as u64).sum();
    check_size(window.width as u64, window.height as u64, channels)
}

/// Returns the smallest window around all given ones.
fn union(windows: impl Iterator<Item = (Vec2<i32>, Vec2<usize>)>) -> Window {
    let far = |position: i32, size: usize| i64::from(position).saturating_add(i64::try_from(size).unwrap_or(i64::MAX));
    let mut bounds: Option<[i64; 4]> = None;
    for (p, s) in windows {
        let b = [i64::from(p.0), i64::from(p.1), far(p.0, s.0), far(p.1, s.1)];
        bounds = Some(bounds.map_or(b, |a| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]));
    }
    let [x0, y0, x1, y1] = bounds.unwrap_or([0; 4]);
    // The corner is one of the positions, which are i32; the size is positive.
    Window { x: x0 as i32, y: y0 as i32, width: (x1 - x0) as usize, height: (y1 - y0) as usize }
}

/// Builds the picture out of the parts of the file.
fn assemble(image: FlatImage) -> Result<Picture, Error> {
    let window = union(image.layer_data.iter().map(|l| (l.attributes.layer_position, l.size)));
    let d = image.attributes.display_window;
    let mut picture = Picture::new(window.width, window.height);
    picture.offset = [window.x, window.y];
    picture.display = Window { x: d.position.0, y: d.position.1, width: d.size.0, height: d.size.1 };
    read_attributes(&mut picture, image.attributes.other.iter());
    let several = image.layer_data.len() > 1;
    for (i, layer) in image.layer_data.into_iter().enumerate() {
        let part = layer.attributes.layer_name.as_ref().map_or_else(|| format!("part{i}"), string);
        read_attributes(&mut picture, layer.attributes.other.iter());
        let a = &layer.attributes;
        for (name, value) in [("owner", &a.owner), ("comments", &a.comments), ("software", &a.software_name)] {
            read_attributes(
                &mut picture,
                value.as_ref().map(|t| (text(name), AttributeValue::Text(t.clone()))).iter().map(|(n, v)| (n, v)),
            );
        }
        let at = [(a.layer_position.0 - window.x) as usize, (a.layer_position.1 - window.y) as usize];
        for channel in layer.channel_data.list {
            let own = string(&channel.name);
            let name = if several && !own.starts_with(&format!("{part}.")) { format!("{part}.{own}") } else { own };
            let data = match channel.sample_data {
                FlatSamples::F32(data) => data,
                other => other.values_as_f32().collect(),
            };
            picture.push(&name, paste(data, [layer.size.0, layer.size.1], at, [window.width, window.height]))?;
        }
    }
    picture.check()?;
    Ok(picture)
}

/// Returns the samples placed into a larger rectangle of zeros, or themselves if they fill it.
fn paste(data: Vec<f32>, size: [usize; 2], at: [usize; 2], full: [usize; 2]) -> Vec<f32> {
    if size == full {
        return data;
    }
    let mut out = vec![0.0; full[0] * full[1]];
    for (row, line) in data.chunks_exact(size[0].max(1)).enumerate() {
        let start = (at[1] + row) * full[0] + at[0];
        out[start..start + line.len()].copy_from_slice(line);
    }
    out
}

/// Adds attributes of the known types; the first part to name one decides.
fn read_attributes<'a>(picture: &mut Picture, attributes: impl Iterator<Item = (&'a Text, &'a AttributeValue)>) {
    for (name, value) in attributes {
        let value = match value {
            AttributeValue::Text(s) => Value::Text(string(s)),
            AttributeValue::I32(i) => Value::Int(*i),
            AttributeValue::F32(x) => Value::Float(f64::from(*x)),
            AttributeValue::F64(x) => Value::Float(*x),
            _ => continue,
        };
        picture.attributes.entry(string(name)).or_insert(value);
    }
}

fn from_exr(error: ExrError) -> Error {
    match error {
        // The crate's sentence for the end of the stream.
        ExrError::Invalid(reason) if reason == "reference to missing bytes" => ErrorKind::Truncated(FORMAT),
        ExrError::Io(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => ErrorKind::Truncated(FORMAT),
        ExrError::NotSupported(reason) => ErrorKind::Unsupported { format: FORMAT, reason: reason.into_owned() },
        other => ErrorKind::Damaged { format: FORMAT, reason: other.to_string() },
    }
    .into()
}

#[cfg(test)]
#[path = "exr_tests.rs"]
mod tests;
