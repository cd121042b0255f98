//! Pictures that a scene refers to, each decoded once.

use std::collections::HashMap;
use std::str::FromStr;

use moonmilk_render::description::{ImageDescription, ImageId};

use super::context::Context;
use super::lexer::Spot;
use crate::texture::{Encoding, load_texture};

#[derive(Default)]
pub(crate) struct Images {
    pub list: Vec<ImageDescription>,
    known: HashMap<(String, String), Option<ImageId>>,
}

impl Images {
    /// The picture at `path`. A missing one is recorded and stands in as one grey pixel; `None` after any other error.
    pub(crate) fn load(&mut self, cx: &mut Context, path: &str, spot: Spot, encoding: &str) -> Option<ImageId> {
        let key = (path.to_owned(), encoding.to_owned());
        if let Some(known) = self.known.get(&key) {
            return *known;
        }
        let image = match cx.fetch(path, Some(spot)) {
            Some(bytes) => decode(cx, &bytes, path, spot, encoding),
            None => Some(ImageDescription {
                name: path.to_owned(),
                width: 1,
                height: 1,
                rgb: vec![[0.5; 3]],
                alpha: Vec::new(),
            }),
        };
        let id = image.map(|image| {
            self.list.push(image);
            self.list.len() - 1
        });
        self.known.insert(key, id);
        id
    }
}

fn decode(cx: &mut Context, bytes: &[u8], path: &str, spot: Spot, encoding: &str) -> Option<ImageDescription> {
    let Ok(encoding) = Encoding::from_str(encoding) else {
        cx.error_help(spot, format!("`{encoding}` is no encoding"), "accepted: sRGB, linear, gamma G");
        return None;
    };
    if crate::exr::is_exr(bytes) && crate::exr::has_other_primaries(bytes) {
        cx.warn(spot, format!("{path}: its primaries are not those of sRGB, but its values are read as if they were"));
    }
    let described = load_texture(bytes, path, encoding).and_then(|picture| {
        let [r, g, b] = picture.require_rgb()?;
        let rgb = r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect();
        let alpha = picture.channel("A").map(<[f32]>::to_vec).unwrap_or_default();
        Ok(ImageDescription {
            name: path.to_owned(),
            width: picture.width as u32,
            height: picture.height as u32,
            rgb,
            alpha,
        })
    });
    match described {
        Ok(image) if image.rgb.iter().flatten().all(|c| c.is_finite()) => Some(image),
        Ok(_) => {
            cx.error(spot, format!("{path}: the picture has values that are not finite"));
            None
        }
        Err(error) => {
            let text = error.to_string();
            cx.error(spot, if text.contains(path) { text } else { format!("{path}: {text}") });
            None
        }
    }
}
