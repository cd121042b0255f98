//! How bright a light is, and of what colour: pbrt-v4's conventions of `L`, `I`, `scale` and `power`.
//!
//! A light's spectrum gives its colour, `scale` its brightness: every spectrum except a colour is first brought to luminance 1; a
//! colour (rgb) keeps its components and multiplies D65 of luminance 1. Values are relative to D65, see
//! [`moonmilk_core::color`]. *Source*: pbrt-v4, `lights.cpp` (`SpectrumToPhotometric`).

use std::sync::Arc;

use moonmilk_core::upsampling::sample_unbounded;
use moonmilk_core::{Spectra, Spectrum, Vec2, Wavelengths};

use super::distribution::pixel_of;
use super::error::LightError;
use crate::description::{ImageDescription, Place, SpectrumDescription};

/// Weights of linear sRGB in luminance (ITU-R BT.709).
pub const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// The emission of a light over its surface or sphere: one spectrum, or one per pixel.
#[derive(Clone, Debug)]
pub enum Emission {
    /// The same everywhere.
    Uniform(Spectra),
    /// A picture times a factor.
    Picture(Arc<Picture>, f32),
}

impl Emission {
    /// Returns the value at texture coordinates, bilinear in a picture (v upwards, as pbrt-v4).
    #[inline]
    pub fn at<const N: usize>(&self, uv: Vec2, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        match self {
            Self::Uniform(s) => s.sample(wavelengths),
            Self::Picture(p, factor) => sample_unbounded(p.bilinear(uv), wavelengths) * *factor,
        }
    }

    /// Returns a mean over wavelengths and surface, positive unless the light is black: a guide for sampling, no more.
    pub fn mean(&self) -> f64 {
        match self {
            Self::Uniform(s) => mean_of(s),
            Self::Picture(p, factor) => p.mean_of(|[r, g, b]| (r + g + b) / 3.0) * f64::from(*factor),
        }
    }
}

/// Returns the spectrum of a light, or of an emitting medium, as described, times a factor.
///
/// *Errors*: an invalid spectrum or factor.
pub fn emission(spectrum: &SpectrumDescription, factor: f32, place: &Place) -> Result<Spectra, LightError> {
    let light = match spectrum {
        SpectrumDescription::Constant(x) => Spectra::sampled(vec![(550.0, *x)]),
        SpectrumDescription::Rgb(rgb) => Spectra::rgb_illuminant(*rgb),
        SpectrumDescription::Sampled(points) => Spectra::sampled_light(points.clone()).map(normalised),
        SpectrumDescription::Blackbody(kelvin) => Spectra::blackbody(*kelvin).map(normalised),
        SpectrumDescription::Named(name) => Spectra::named(name).map(normalised),
    };
    let light = light.map_err(|source| LightError::Spectrum { place: place.clone(), source })?;
    Ok(light.scaled(checked("scale", factor, place)?))
}

/// Returns a mean of a light's spectrum over the wavelengths, positive unless it is black: a guide for sampling, no more.
pub fn mean_of(s: &Spectra) -> f64 {
    let [r, g, b] = s.rgb();
    // A spectral line outside the gamut still counts.
    (f64::from(r + g + b) / 3.0).max(1e-3 * f64::from(s.max_value()))
}

/// Brings a light's spectrum to luminance 1; one without visible part becomes black.
fn normalised(s: Spectra) -> Spectra {
    let y = s.luminance();
    if y > 0.0 { s.scaled(1.0 / y) } else { Spectra::Constant(0.0) }
}

/// A picture of radiance in linear sRGB, negative components set to 0.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Width [pixels].
    pub width: usize,
    /// Height [pixels].
    pub height: usize,
    /// Rows from the top.
    pub rgb: Vec<[f32; 3]>,
}

impl Picture {
    /// Checks a picture and takes its colours.
    pub fn new(image: &ImageDescription, place: &Place) -> Result<Self, LightError> {
        let (width, height) = (image.width as usize, image.height as usize);
        let finite = image.rgb.iter().flatten().all(|x| x.is_finite());
        if width * height == 0 || image.rgb.len() != width * height || !finite {
            return Err(LightError::Picture { place: place.clone(), name: image.name.clone() });
        }
        Ok(Self { width, height, rgb: image.rgb.iter().map(|c| c.map(|x| x.max(0.0))).collect() })
    }

    /// Returns the colour of the pixel that holds a point of the unit square, v downwards.
    #[inline]
    pub fn nearest(&self, p: [f64; 2]) -> [f32; 3] {
        self.rgb[pixel_of(self.width, self.height, p)]
    }

    /// Returns the colour between pixel centres at (u, v), v upwards; beyond the outer centres that of the edge.
    pub fn bilinear(&self, uv: Vec2) -> [f32; 3] {
        let place = |x: f32, n: usize| {
            let x = (x.clamp(0.0, 1.0) * n as f32 - 0.5).clamp(0.0, (n - 1) as f32);
            let i = (x as usize).min(n.saturating_sub(2));
            (i, (i + 1).min(n - 1), x - i as f32)
        };
        let (x0, x1, tx) = place(uv.x, self.width);
        let (y0, y1, ty) = place(1.0 - uv.y, self.height);
        let at = |x: usize, y: usize| self.rgb[y * self.width + x];
        std::array::from_fn(|c| {
            let top = at(x0, y0)[c] * (1.0 - tx) + at(x1, y0)[c] * tx;
            let bottom = at(x0, y1)[c] * (1.0 - tx) + at(x1, y1)[c] * tx;
            top * (1.0 - ty) + bottom * ty
        })
    }

    /// Returns the mean of a function of the colour over all pixels.
    pub fn mean_of(&self, f: impl Fn([f32; 3]) -> f32) -> f64 {
        self.rgb.iter().map(|&c| f64::from(f(c))).sum::<f64>() / self.rgb.len() as f64
    }

    /// Returns the mean luminance.
    pub fn luminance(&self) -> f64 {
        self.mean_of(|c| c.iter().zip(LUMINANCE).map(|(x, w)| x * w).sum())
    }
}

/// Returns a factor or power that is not negative and finite, or an error that names it.
pub fn checked(what: &'static str, value: f32, place: &Place) -> Result<f32, LightError> {
    if value >= 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(LightError::Value { place: place.clone(), what, value })
    }
}

/// Returns the factor on a light's spectrum: `scale`, and, if a `power` is asked for, that over what the light emits at factor 1.
pub fn factor(scale: f32, power: Option<f32>, emitted_at_one: f64, place: &Place) -> Result<f32, LightError> {
    let scale = checked("scale", scale, place)?;
    match power {
        // pbrt-v4 ignores a power that is not positive.
        Some(p) if p > 0.0 && emitted_at_one > 0.0 => {
            Ok((f64::from(scale) * f64::from(checked("power", p, place)?) / emitted_at_one) as f32)
        }
        _ => Ok(scale),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place() -> Place {
        Place { file: "test.pbrt".into(), line: 1, column: 1 }
    }

    #[test]
    fn spectra_have_luminance_one_and_colours_keep_theirs() {
        for s in [
            SpectrumDescription::Blackbody(5000.0),
            SpectrumDescription::Sampled(vec![(400.0, 7.0), (700.0, 3.0)]),
            SpectrumDescription::Named("stdillum-F11".into()),
            SpectrumDescription::Constant(1.0),
        ] {
            let e = emission(&s, 2.5, &place()).expect("valid");
            // Rounding of a sum of 401 f32 values.
            assert!((e.luminance() - 2.5).abs() < 1e-5, "{s:?}: {}", e.luminance());
        }
        let rgb = SpectrumDescription::Rgb([3.0, 2.0, 0.5]);
        let e = emission(&rgb, 2.0, &place()).expect("valid");
        assert_eq!(e.rgb(), [6.0, 4.0, 1.0]);
    }

    #[test]
    fn bilinear_pictures_return_their_pixels_at_the_centres_with_the_first_row_on_top() {
        let image = ImageDescription {
            name: "checker".into(),
            width: 2,
            height: 2,
            rgb: vec![[1.0; 3], [2.0; 3], [3.0; 3], [4.0; 3]],
            alpha: vec![],
        };
        let p = Picture::new(&image, &place()).expect("valid");
        for (uv, v) in
            [((0.25, 0.75), 1.0), ((0.75, 0.75), 2.0), ((0.25, 0.25), 3.0), ((0.5, 0.5), 2.5), ((0.0, 1.0), 1.0)]
        {
            assert_eq!(p.bilinear(Vec2::new(uv.0, uv.1))[0], v);
        }
    }

    #[test]
    fn bad_values_are_named() {
        let e = factor(-1.0, None, 1.0, &place()).expect_err("negative");
        assert_eq!(e.to_string(), "test.pbrt:1:1: the light's scale -1 is outside [0, inf)");
        assert!(emission(&SpectrumDescription::Rgb([1.0, f32::NAN, 0.0]), 1.0, &place()).is_err());
    }
}
