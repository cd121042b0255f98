//! Writing finished pictures, and making sure beforehand that they can be written.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use moonmilk_core::random::SCRAMBLINGS;
use moonmilk_io::atomic::write_atomically;
use moonmilk_io::image::{Picture, Value, Window};
use moonmilk_io::metrics::{BLOCK_VARIANCE, MEAN_VARIANCE, VARIANCE_SAMPLES};
use moonmilk_io::{exr, png};
use moonmilk_render::film::{Aov, Film};

use crate::failure::Failure;
use crate::settings::Settings;

/// Formats of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// OpenEXR.
    Exr,
    /// PNG.
    Png,
}

/// Returns the format of a file name, if it is one that is written.
pub fn format(path: &Path) -> Option<Format> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "exr" => Some(Format::Exr),
        "png" => Some(Format::Png),
        _ => None,
    }
}

/// Returns the format of a file name, or the failure to be told.
pub fn require_format(path: &Path) -> Result<Format, Failure> {
    format(path).ok_or_else(|| Failure::Usage(format!("{}: pictures are written as .exr or .png", path.display())))
}

/// Returns where the checkpoint of a picture lies.
pub fn checkpoint_path(picture: &Path) -> PathBuf {
    let mut s = picture.as_os_str().to_owned();
    s.push(".checkpoint");
    s.into()
}

/// Returns an error if a file cannot be written at this path: hours of rendering must not end in a missing folder.
///
/// A hidden file is created in the folder and removed, since that and a renaming is how the picture will come to be.
pub fn check_writable(path: &Path) -> Result<(), Failure> {
    let fail = |reason: String| Failure::Run(format!("{} cannot be written: {reason}", path.display()));
    if path.is_dir() {
        return Err(fail("it is a folder".into()));
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        return Err(fail(format!("there is no folder {}", folder.display())));
    }
    let name = path.file_name().ok_or_else(|| fail("it does not name a file".into()))?.to_string_lossy();
    let probe = folder.join(format!(".{name}.{}.probe", std::process::id()));
    OpenOptions::new().write(true).create_new(true).open(&probe).map_err(|e| fail(e.to_string()))?;
    fs::remove_file(&probe).map_err(|e| fail(e.to_string()))
}

/// Removes what a killed run left of the atomic writing of this file: `.NAME.PID-N.tmp`.
pub fn remove_leftovers(path: &Path) {
    let Some(name) = path.file_name().and_then(|n| n.to_str()) else {
        return;
    };
    let prefix = format!(".{name}.");
    let is_left_over = |file: &str| {
        file.strip_prefix(&prefix)
            .and_then(|rest| rest.strip_suffix(".tmp")?.split_once('-'))
            .is_some_and(|(a, b)| [a, b].iter().all(|s| !s.is_empty() && s.bytes().all(|c| c.is_ascii_digit())))
    };
    for entry in fs::read_dir(folder_of(path)).into_iter().flatten().flatten() {
        if entry.file_name().to_str().is_some_and(is_left_over) {
            // Who cannot remove it loses a little space, nothing else.
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Returns the smallest and largest number of samples of a tile.
pub fn levels(film: &Film) -> [u64; 2] {
    (0..film.tile_count())
        .map(|i| film.tile(i).samples)
        .fold(None, |range: Option<[u64; 2]>, n| Some(range.map_or([n, n], |[a, b]| [a.min(n), b.max(n)])))
        .unwrap_or([0, 0])
}

/// Returns the picture of a film, with layers and attributes.
pub fn picture(film: &Film, settings: Option<&Settings>, factor: f32) -> Result<Picture, Failure> {
    let fail = |e: moonmilk_io::image::Error| Failure::Run(e.to_string());
    let d = film.develop(factor);
    let [x0, _, y0, _] = film.crop;
    let mut p = Picture::from_rgb(d.width as usize, d.height as usize, &d.rgb).map_err(fail)?;
    p.offset = [x0 as i32, y0 as i32];
    p.display = Window { x: 0, y: 0, width: film.size[0] as usize, height: film.size[1] as usize };
    if film.aovs.contains(&Aov::Variance) {
        for (c, name) in Aov::Variance.channels().iter().enumerate() {
            p.push(name, d.variance.iter().map(|v| v[c]).collect()).map_err(fail)?;
        }
        // The variance is that between scramblings, as many as every pixel has.
        let parts = film.samples().min(SCRAMBLINGS) as i32;
        if parts >= 2 {
            p.attributes.insert(VARIANCE_SAMPLES.into(), Value::Int(parts));
        }
        // Pixels may share errors: means over many have variances of their own.
        if d.mean_variance.iter().all(|v| v.is_finite()) {
            for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
                let plane = d.block_variance.iter().map(|v| v[c]).collect();
                p.push(&format!("{BLOCK_VARIANCE}.{name}"), plane).map_err(fail)?;
                p.attributes.insert(format!("{MEAN_VARIANCE}{name}"), Value::Float(d.mean_variance[c]));
            }
        }
    }
    for (name, values) in d.extra {
        p.push(name, values).map_err(fail)?;
    }
    let mut put = |name: &str, text: &str| p.attributes.insert(name.into(), Value::Text(text.into()));
    put("moonmilk.version", env!("CARGO_PKG_VERSION"));
    put("moonmilk.spp", &film.samples().to_string());
    if let Some(settings) = settings {
        put("moonmilk.settings", &settings.text());
        for (key, name) in [("version", "moonmilk.version"), ("scene", "moonmilk.scene"), ("seed", "moonmilk.seed")] {
            if let Some(s) = settings.get(key) {
                put(name, s);
            }
        }
    }
    Ok(p)
}

/// Writes a picture by the extension of its file name: .exr or .png.
pub fn write(path: &Path, picture: &Picture) -> Result<(), Failure> {
    let fail = |e: String| Failure::Run(format!("{}: {e}", path.display()));
    let bytes = match require_format(path)? {
        Format::Exr => exr::encode(picture),
        Format::Png => png::encode(picture),
    };
    write_atomically(path, &bytes.map_err(|e| fail(e.to_string()))?).map_err(|e| fail(e.to_string()))
}

/// Writes a line of data to standard output; returns whether anybody still reads it.
pub fn print(line: &str) -> Result<bool, Failure> {
    match writeln!(std::io::stdout(), "{line}") {
        Ok(()) => Ok(true),
        // `| head` has seen enough.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(false),
        Err(e) => Err(Failure::Run(format!("standard output: {e}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_leftovers_of_this_very_file_are_removed() {
        let folder = std::env::temp_dir().join(format!("moonmilk-leftovers-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("temporary folder");
        let kept = ["a.exr", ".a.exr.tmp", ".a.exr.1-x.tmp", ".b.exr.1-2.tmp", ".a.exr.checkpoint.1-2.tmp"];
        for name in kept.iter().chain(&[".a.exr.123-0.tmp"]) {
            fs::write(folder.join(name), "").expect("written");
        }
        remove_leftovers(&folder.join("a.exr"));
        assert!(kept.iter().all(|name| folder.join(name).exists()));
        assert!(!folder.join(".a.exr.123-0.tmp").exists());
        fs::remove_dir_all(&folder).expect("removed");
    }
}
