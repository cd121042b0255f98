//! Writing finished pictures.

use std::path::Path;

use moonmilk_io::atomic::write_atomically;
use moonmilk_io::image::{Picture, Value, Window};
use moonmilk_io::{exr, png};
use moonmilk_render::film::{Aov, Film};

use crate::failure::Failure;

/// Returns the picture of a film, with layers and attributes.
pub fn picture(film: &Film, factor: f32, attributes: &[(&str, Value)]) -> Result<Picture, Failure> {
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
    }
    for (name, values) in d.extra {
        p.push(name, values).map_err(fail)?;
    }
    for (name, value) in attributes {
        p.attributes.insert((*name).into(), value.clone());
    }
    Ok(p)
}

/// Writes a picture by the extension of its file name: .exr or .png.
pub fn write(path: &Path, picture: &Picture) -> Result<(), Failure> {
    let fail = |e: String| Failure::Run(format!("{}: {e}", path.display()));
    let bytes = match extension(path)? {
        Format::Exr => exr::encode(picture),
        Format::Png => png::encode(picture),
    };
    write_atomically(path, &bytes.map_err(|e| fail(e.to_string()))?).map_err(|e| fail(e.to_string()))
}

/// Formats of pictures.
pub enum Format {
    /// OpenEXR.
    Exr,
    /// PNG.
    Png,
}

/// Returns the format of a file name.
pub fn extension(path: &Path) -> Result<Format, Failure> {
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("exr") => Ok(Format::Exr),
        Some("png") => Ok(Format::Png),
        _ => Err(Failure::Usage(format!("{}: pictures are written as .exr or .png", path.display()))),
    }
}
