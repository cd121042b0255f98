//! Results as NPZ, NumPy's archive of arrays: a zip file without compression, one `.npy` per array.

use std::collections::BTreeMap;

use flate2::Crc;
use moonmilk_lab::Results;

/// Returns the bytes of an `.npz` of results.
///
/// Arrays: every scalar by its name and every grid (shape of its axes), each with NAME_std_err; `edges_AXIS`; `units`, a JSON text
/// of the units by name; `photons`.
pub fn encode(r: &Results) -> Vec<u8> {
    let mut arrays: Vec<(String, Vec<u8>)> = Vec::new();
    let mut units = BTreeMap::new();
    let mut pair = |name: &str, unit: &str, shape: &[usize], values: Vec<(f64, f64)>| {
        let (mean, error): (Vec<f64>, Vec<f64>) = values.into_iter().unzip();
        arrays.push((name.to_owned(), npy(shape, &mean)));
        arrays.push((format!("{name}_std_err"), npy(shape, &error)));
        units.insert(name.to_owned(), unit.to_owned());
    };
    for s in &r.scalars {
        pair(&s.name, &s.unit, &[], vec![(s.value.mean, s.value.std_err)]);
    }
    let mut edges = BTreeMap::new();
    for g in &r.grids {
        let shape: Vec<usize> = g.axes.iter().map(moonmilk_lab::plan::Axis::cells).collect();
        pair(g.name, &g.unit, &shape, g.cells.iter().map(|c| (c.mean, c.std_err)).collect());
        for a in &g.axes {
            edges.insert(a.name, a);
        }
    }
    for (name, axis) in edges {
        arrays.push((format!("edges_{name}"), npy(&[axis.edges.len()], &axis.edges)));
        units.insert(format!("edges_{name}"), axis.unit.clone());
    }
    arrays.push(("photons".into(), npy(&[], &[r.photons as f64])));
    let units = serde_json::to_string(&units).expect("strings are JSON");
    arrays.push(("units".into(), npy_text(&units)));
    zip(&arrays)
}

/// Returns an array of doubles in version 1.0 of the format.
fn npy(shape: &[usize], values: &[f64]) -> Vec<u8> {
    let mut bytes = header("<f8", shape);
    values.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes
}

/// Returns a text as an array without dimensions.
fn npy_text(text: &str) -> Vec<u8> {
    let mut bytes = header(&format!("<U{}", text.chars().count()), &[]);
    text.chars().for_each(|c| bytes.extend(u32::from(c).to_le_bytes()));
    bytes
}

fn header(kind: &str, shape: &[usize]) -> Vec<u8> {
    let dimensions: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({}), }}", dimensions.trim_end());
    // Data begin at a multiple of 64 bytes; the preamble has 10.
    let padded = (10 + text.len() + 1).div_ceil(64) * 64;
    text.push_str(&" ".repeat(padded - 10 - text.len() - 1));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.bytes());
    bytes
}

/// Returns a zip archive of stored (not compressed) files `NAME.npy`; sizes below 4 GiB, which the laboratory's limit on cells keeps.
fn zip(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, data) in files {
        let name = format!("{name}.npy");
        let mut crc = Crc::new();
        crc.update(data);
        // What both the local header and the directory say: version, UTF-8 names, method 0, the earliest date, checksum, sizes.
        let mut common = Vec::new();
        for x in [20u16, 0x0800, 0, 0, 0x21] {
            common.extend(x.to_le_bytes());
        }
        for x in [crc.sum(), data.len() as u32, data.len() as u32] {
            common.extend(x.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        common.extend(0u16.to_le_bytes());
        let offset = out.len() as u32;
        out.extend(b"PK\x03\x04");
        out.extend(&common);
        out.extend(name.bytes());
        out.extend(data);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        // No comment, first disk, no attributes.
        directory.extend([0u8; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.bytes());
    }
    let start = out.len() as u32;
    let count = (files.len() as u16).to_le_bytes();
    out.extend(&directory);
    out.extend(b"PK\x05\x06\x00\x00\x00\x00");
    out.extend(count);
    out.extend(count);
    out.extend((directory.len() as u32).to_le_bytes());
    out.extend(start.to_le_bytes());
    out.extend([0u8; 2]);
    out
}
