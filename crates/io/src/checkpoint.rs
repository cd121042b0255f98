//! Checkpoints: a film's exact sums in one file that is whole or not there.
//!
//! Layout: 8 bytes magic, 32 bytes blake3 hash of all that follows, then zlib-compressed: length and text of the settings
//! (what must agree for a resume), size, crop, first sample, recorded layers, and per tile its sample count and sums, all
//! little endian. A file with a wrong hash is refused, never half used.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use moonmilk_render::film::{Aov, Film};
use thiserror::Error;

const MAGIC: &[u8; 8] = b"MOONMILK";

/// No deflate stream expands further: 1032 bytes out of one.
const LARGEST_EXPANSION: u64 = 1032;

/// Largest number of samples per pixel that is believed.
const MOST_SAMPLES: u64 = 1 << 48;

/// Largest decompressed checkpoint that is read [bytes]: a picture of 2^27 pixels.
const LARGEST: u64 = 1 << 35;

/// Why a checkpoint cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// Reading or writing failed.
    #[error("{path}: {source}")]
    File {
        /// File.
        path: String,
        /// Cause.
        source: std::io::Error,
    },
    /// The content is not a checkpoint or was damaged.
    #[error("{path}: not a moonmilk checkpoint, or damaged ({reason})")]
    Damaged {
        /// File.
        path: String,
        /// What was found.
        reason: &'static str,
    },
}

/// Writes a film and the settings behind it; the file appears whole or not at all.
///
/// Tiles are locked one at a time: rendering goes on meanwhile, each tile is consistent in itself.
pub fn save(path: &Path, settings: &str, film: &Film) -> Result<(), CheckpointError> {
    let fail = |source| CheckpointError::File { path: path.display().to_string(), source };
    let mut z = ZlibEncoder::new(Vec::new(), Compression::fast());
    let mut body = || -> std::io::Result<()> {
        let put = |z: &mut ZlibEncoder<Vec<u8>>, x: u64| z.write_all(&x.to_le_bytes());
        put(&mut z, settings.len() as u64)?;
        z.write_all(settings.as_bytes())?;
        for x in film.size.iter().chain(&film.crop) {
            put(&mut z, u64::from(*x))?;
        }
        put(&mut z, film.first)?;
        let aovs: u64 = Aov::ALL.iter().enumerate().map(|(i, a)| u64::from(film.aovs.contains(a)) << i).sum();
        put(&mut z, aovs)?;
        let mut bytes = Vec::new();
        for i in 0..film.tile_count() {
            let t = film.tile(i);
            bytes.clear();
            bytes.extend_from_slice(&t.samples.to_le_bytes());
            t.sums.iter().chain(&t.extra).for_each(|s| bytes.extend_from_slice(&s.to_le_bytes()));
            drop(t);
            z.write_all(&bytes)?;
        }
        Ok(())
    };
    body().map_err(fail)?;
    let body = z.finish().map_err(fail)?;
    let mut file = Vec::with_capacity(body.len() + 40);
    file.extend_from_slice(MAGIC);
    file.extend_from_slice(blake3::hash(&body).as_bytes());
    file.extend_from_slice(&body);
    crate::atomic::write_atomically(path, &file).map_err(fail)
}

/// Reads a checkpoint: its settings and film.
pub fn load(path: &Path) -> Result<(String, Film), CheckpointError> {
    let name = path.display().to_string();
    let fail = |source| CheckpointError::File { path: name.clone(), source };
    let damaged = |reason| CheckpointError::Damaged { path: name.clone(), reason };
    let mut file = Vec::new();
    File::open(path).and_then(|mut f| f.read_to_end(&mut file)).map_err(fail)?;
    if file.len() < 40 || &file[..8] != MAGIC {
        return Err(damaged("no checkpoint header"));
    }
    if blake3::hash(&file[40..]).as_bytes() != &file[8..40] {
        return Err(damaged("its hash does not match"));
    }
    let mut z = ZlibDecoder::new(&file[40..]).take(LARGEST);
    let short = |_| damaged("it ends early");
    let get = |z: &mut dyn Read| -> Result<u64, CheckpointError> {
        let mut b = [0; 8];
        z.read_exact(&mut b).map_err(short)?;
        Ok(u64::from_le_bytes(b))
    };
    let n = get(&mut z)?;
    if n > 1 << 20 {
        return Err(damaged("its settings are too long"));
    }
    let mut settings = vec![0; n as usize];
    z.read_exact(&mut settings).map_err(short)?;
    let settings = String::from_utf8(settings).map_err(|_| damaged("its settings are not text"))?;
    let mut head = [0u32; 6];
    for h in &mut head {
        *h = u32::try_from(get(&mut z)?).map_err(|_| damaged("its size is out of range"))?;
    }
    let [w, h, x0, x1, y0, y1] = head;
    if x0 >= x1 || y0 >= y1 || x1 > w || y1 > h || u64::from(w) * u64::from(h) > 1 << 27 {
        return Err(damaged("its size is out of range"));
    }
    let first = get(&mut z)?;
    let bits = get(&mut z)?;
    if bits >> Aov::ALL.len() != 0 || first > MOST_SAMPLES {
        return Err(damaged("its layers or samples are out of range"));
    }
    let aovs: Vec<Aov> = Aov::ALL.iter().enumerate().filter(|(i, _)| bits >> i & 1 == 1).map(|(_, a)| *a).collect();
    // Memory is asked for only if the file can hold that much.
    let per_pixel = {
        let one = Film::new([1, 1], [0, 1, 0, 1], 0, &aovs);
        let tile = one.tile(0);
        tile.sums.len() + tile.extra.len()
    };
    let bytes = u64::from(x1 - x0) * u64::from(y1 - y0) * per_pixel as u64 * 8;
    if bytes > LARGEST_EXPANSION * file.len() as u64 {
        return Err(damaged("it is too short for its size"));
    }
    let film = Film::new([w, h], [x0, x1, y0, y1], first, &aovs);
    for i in 0..film.tile_count() {
        let mut t = film.tile(i);
        t.samples = get(&mut z)?;
        if t.samples > MOST_SAMPLES {
            return Err(damaged("its layers or samples are out of range"));
        }
        let mut bytes = vec![0; (t.sums.len() + t.extra.len()) * 8];
        z.read_exact(&mut bytes).map_err(short)?;
        let mut values =
            bytes.chunks_exact(8).map(|c| i64::from_le_bytes(c.try_into().expect("chunks of eight bytes")));
        let t = &mut *t;
        t.sums.iter_mut().chain(&mut t.extra).for_each(|s| *s = values.next().expect("as many values as sums"));
    }
    if z.read(&mut [0]).map_err(short)? != 0 {
        return Err(damaged("it does not end where it should"));
    }
    Ok((settings, film))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn films_survive_a_round_trip_and_damage_is_refused() {
        let film = Film::new([40, 30], [3, 40, 0, 29], 16, &[Aov::Depth, Aov::Variance, Aov::Order]);
        for i in 0..film.tile_count() {
            let mut t = film.tile(i);
            t.samples = 5 + i as u64;
            t.sums.iter_mut().enumerate().for_each(|(k, s)| *s = k as i64 * 77 - 1000);
            t.extra.iter_mut().enumerate().for_each(|(k, s)| *s = -(k as i64));
        }
        let dir = std::env::temp_dir().join(format!("moonmilk-checkpoint-test-{}", std::process::id()));
        std::fs::create_dir_all(&dir).expect("temporary folder");
        let path = dir.join("a.checkpoint");
        save(&path, "seed 1", &film).expect("written");
        let (settings, back) = load(&path).expect("read");
        assert_eq!((settings.as_str(), back.size, back.crop, back.first), ("seed 1", film.size, film.crop, 16));
        for i in 0..film.tile_count() {
            assert_eq!(*film.tile(i), *back.tile(i));
        }
        let good = std::fs::read(&path).expect("read");
        for cut in [0, 7, 39, 60, good.len() - 1] {
            std::fs::write(&path, &good[..cut]).expect("written");
            assert!(matches!(load(&path), Err(CheckpointError::Damaged { .. })));
        }
        let mut bad = good.clone();
        *bad.last_mut().expect("not empty") ^= 1;
        std::fs::write(&path, &bad).expect("written");
        assert!(load(&path).is_err());
        // A hash is no promise that a size is meant: a short file that claims 2^26 pixels must not cost their memory.
        for (pixels, tail, reason) in [(8192u64, 0, "it is too short for its size"), (1, 9, "it does not end")] {
            let mut z = ZlibEncoder::new(Vec::new(), Compression::fast());
            let numbers = [0, pixels, pixels, 0, pixels, 0, pixels, 0, 0].into_iter().chain([0; 25]);
            let body: Vec<u8> = numbers.flat_map(u64::to_le_bytes).chain(vec![0; tail]).collect();
            z.write_all(&body).expect("in memory");
            let body = z.finish().expect("in memory");
            std::fs::write(&path, [&MAGIC[..], blake3::hash(&body).as_bytes(), &body].concat()).expect("written");
            let error = load(&path).expect_err("refused").to_string();
            assert!(error.contains(reason), "{error}");
        }
        std::fs::remove_dir_all(&dir).expect("removed");
    }
}
