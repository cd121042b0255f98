//! Spectra that a scene may hold, and their values at the wavelengths of a path.
//!
//! Two uses, two constructors. *Properties* (reflectances, coefficients, indices) are plain functions of the wavelength:
//! [`Spectra::Constant`], [`Spectra::rgb_albedo`], [`Spectra::rgb_unbounded`], [`Spectra::sampled`]. *Lights* are
//! stored relative to D65 (see [`crate::color`]): [`Spectra::rgb_illuminant`], [`Spectra::blackbody`],
//! [`Spectra::sampled_light`]; a constant light has the colour of D65. [`Spectra::named`] returns either.
//!
//! In rgb mode a colour returns its own components exactly; any other spectrum returns its projection on the sRGB
//! primaries under D65, kept within the spectrum's own range (a projection leaves that range only when
//! the spectrum's colour lies outside the sRGB gamut, and a negative coefficient has no meaning).

use std::sync::Arc;

use crate::color::{LAMBDA_MIN, OBSERVED, SAMPLES, locate};
use crate::named;
use crate::spectrum::Spectrum;
use crate::upsampling::{RgbSpectrum, lanes};
use crate::wavelengths::Wavelengths;

/// Why a spectrum was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpectraError {
    /// A component of an albedo is outside its range.
    #[error("albedo component {0} is outside [0, 1]")]
    Albedo(f32),
    /// A value is negative, infinite or NaN.
    #[error("value {0} is outside [0, inf)")]
    Value(f32),
    /// A table of samples holds nothing.
    #[error("a sampled spectrum needs at least one (wavelength, value) pair")]
    Empty,
    /// Wavelengths do not increase.
    #[error("wavelength {1} nm follows {0} nm; they must increase")]
    Order(f32, f32),
    /// A wavelength is not a positive number.
    #[error("wavelength {0} nm is outside (0, inf)")]
    Wavelength(f32),
    /// A temperature is not a positive number.
    #[error("temperature {0} K is outside (0, inf)")]
    Temperature(f32),
    /// No standard spectrum has this name.
    #[error("unknown spectrum \"{name}\"; did you mean \"{nearest}\"?")]
    Name {
        /// The name asked for.
        name: String,
        /// The known name that is nearest to it.
        nearest: &'static str,
    },
}

/// A spectrum of a scene. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectra {
    /// The same value at every wavelength and in every channel; as a light, of the colour of D65.
    Constant(f32),
    /// A linear sRGB colour with its smooth spectrum.
    Rgb(RgbSpectrum),
    /// Values over the wavelength.
    Tabulated(Arc<Tabulated>),
}

/// Values at increasing wavelengths, linear between them and constant beyond the ends, with their projection on sRGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Tabulated {
    points: Vec<(f32, f32)>,
    uniform: bool,
    rgb: [f32; 3],
}

impl Tabulated {
    /// Makes a table of valid points: at least one, wavelengths increasing.
    fn new(points: Vec<(f32, f32)>) -> Self {
        let uniform = points.len() == SAMPLES && points.iter().enumerate().all(|(i, p)| p.0 == LAMBDA_MIN + i as f32);
        let mut table = Self { points, uniform, rgb: [0.0; 3] };
        let (low, high) = table.points.iter().fold((f32::INFINITY, 0.0f32), |(a, b), p| (a.min(p.1), b.max(p.1)));
        table.rgb = OBSERVED.rgb_of(|l| table.eval(l)).map(|x| (x as f32).clamp(low, high));
        table
    }

    /// Makes a table of 401 values at 1 nm steps from 380 nm.
    fn per_nm(values: impl Iterator<Item = f64>) -> Self {
        Self::new(values.enumerate().map(|(i, v)| (LAMBDA_MIN + i as f32, v as f32)).collect())
    }

    /// Returns the value at a wavelength in nm.
    #[inline]
    pub fn eval(&self, lambda: f32) -> f32 {
        let p = &self.points;
        let (i, t) = if self.uniform
            && let Some(found) = locate(lambda)
        {
            found
        } else {
            let i = p.partition_point(|q| q.0 <= lambda);
            if i == 0 {
                return p[0].1;
            }
            if i == p.len() {
                return p[i - 1].1;
            }
            (i - 1, (lambda - p[i - 1].0) / (p[i].0 - p[i - 1].0))
        };
        p[i].1 + t * (p[i + 1].1 - p[i].1)
    }

    /// Returns the linear sRGB projection under D65, within the range of the values.
    pub fn rgb(&self) -> [f32; 3] {
        self.rgb
    }

    /// Returns the points (wavelength in nm, value).
    pub fn points(&self) -> &[(f32, f32)] {
        &self.points
    }
}

impl Spectra {
    /// Returns the spectrum of a reflectance or albedo of linear sRGB colour.
    ///
    /// *Errors*: a component outside \[0, 1\].
    pub fn rgb_albedo(rgb: [f32; 3]) -> Result<Self, SpectraError> {
        match rgb.iter().find(|x| !(0.0..=1.0).contains(*x)) {
            Some(&x) => Err(SpectraError::Albedo(x)),
            None => Ok(Self::colour(RgbSpectrum::albedo(rgb).refined())),
        }
    }

    /// Returns the spectrum of a non-negative quantity, such as a coefficient, given as a colour.
    ///
    /// *Errors*: a component that is negative or not finite.
    pub fn rgb_unbounded(rgb: [f32; 3]) -> Result<Self, SpectraError> {
        rgb.iter().try_for_each(|&x| valid(x))?;
        Ok(Self::colour(RgbSpectrum::unbounded(rgb).refined()))
    }

    /// Returns a light of linear sRGB colour: relative to D65 the same function as [`Spectra::rgb_unbounded`].
    ///
    /// *Errors*: a component that is negative or not finite.
    pub fn rgb_illuminant(rgb: [f32; 3]) -> Result<Self, SpectraError> {
        Self::rgb_unbounded(rgb)
    }

    /// Returns the light of a black body, its spectral radiance normalised to the peak value 1 (as pbrt-v4 does).
    ///
    /// *Domain*: temperature in K, positive. *Errors*: any other. To fix the luminance instead, divide by [`Spectra::luminance`].
    pub fn blackbody(temperature: f32) -> Result<Self, SpectraError> {
        if !(temperature > 0.0 && temperature.is_finite()) {
            return Err(SpectraError::Temperature(temperature));
        }
        Ok(Self::light(|l| named::planck_over_peak(l, f64::from(temperature))))
    }

    /// Returns a black body's curve, peak 1, as a property: a reflectance or coefficient of that shape, not divided by D65.
    ///
    /// *Domain* and *Errors*: as [`Spectra::blackbody`].
    pub fn blackbody_curve(temperature: f32) -> Result<Self, SpectraError> {
        if !(temperature > 0.0 && temperature.is_finite()) {
            return Err(SpectraError::Temperature(temperature));
        }
        let curve = |i| named::planck_over_peak(f64::from(LAMBDA_MIN) + i as f64, f64::from(temperature));
        Ok(Self::Tabulated(Arc::new(Tabulated::per_nm((0..SAMPLES).map(curve)))))
    }

    /// Returns a property (reflectance, coefficient, index) from (wavelength in nm, value) pairs.
    ///
    /// Linear between the points; the end values continue beyond them. *Errors*: no points, wavelengths that do not
    /// increase, negative or non-finite values.
    pub fn sampled(points: Vec<(f32, f32)>) -> Result<Self, SpectraError> {
        check(&points)?;
        if points.iter().all(|p| p.1 == points[0].1) {
            return Ok(Self::Constant(points[0].1));
        }
        Ok(Self::Tabulated(Arc::new(Tabulated::new(points))))
    }

    /// Returns a light from (wavelength in nm, spectral radiance) pairs: the same function divided by D65 of unit luminance.
    ///
    /// *Errors*: as [`Spectra::sampled`].
    pub fn sampled_light(points: Vec<(f32, f32)>) -> Result<Self, SpectraError> {
        check(&points)?;
        let raw = Tabulated::new(points);
        Ok(Self::light(|l| f64::from(raw.eval(l as f32))))
    }

    /// Returns a standard spectrum by its pbrt-v4 name: `metal-Au-eta`, `glass-BK7` (properties), `stdillum-D50` (lights of
    /// unit luminance). [`crate::named::NAMES`] lists them.
    ///
    /// *Errors*: an unknown name, with the nearest known one.
    pub fn named(name: &str) -> Result<Self, SpectraError> {
        named::find(name).ok_or_else(|| SpectraError::Name {
            name: name.to_owned(),
            nearest: nearest(name, named::NAMES.iter().copied()),
        })
    }

    /// Makes a light of unit-independent spectral radiance f(lambda in nm), relative to D65.
    pub(crate) fn light(f: impl Fn(f64) -> f64) -> Self {
        let values = (0..SAMPLES).map(|i| f(f64::from(LAMBDA_MIN) + i as f64) / OBSERVED.d65[i]);
        Self::Tabulated(Arc::new(Tabulated::per_nm(values)))
    }

    fn colour(s: RgbSpectrum) -> Self {
        if s.rgb[0] == s.rgb[1] && s.rgb[1] == s.rgb[2] { Self::Constant(s.rgb[0]) } else { Self::Rgb(s) }
    }

    /// Returns the value at a wavelength in nm (of a light: relative to D65).
    #[inline]
    pub fn eval(&self, lambda: f32) -> f32 {
        match self {
            Self::Constant(c) => *c,
            Self::Rgb(s) => s.eval(lambda),
            Self::Tabulated(t) => t.eval(lambda),
        }
    }

    /// Returns the values in the lanes of a path.
    #[inline]
    pub fn sample<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        match self {
            Self::Constant(c) => Spectrum::splat(*c),
            Self::Rgb(s) => s.sample(wavelengths),
            Self::Tabulated(t) => lanes(t.rgb, wavelengths, |l| t.eval(l)),
        }
    }

    /// Returns the linear sRGB colour: the one given, or the projection that rgb mode uses.
    pub fn rgb(&self) -> [f32; 3] {
        match self {
            Self::Constant(c) => [*c; 3],
            Self::Rgb(s) => s.rgb,
            Self::Tabulated(t) => t.rgb,
        }
    }

    /// Returns the luminance of a light: 1 for a constant light 1 and for D65 itself.
    pub fn luminance(&self) -> f32 {
        // The row of XYZ's Y in linear sRGB follows from the response of Y: integrate it directly.
        let o = &*OBSERVED;
        let (mut y, mut total) = (0.0, 0.0);
        for i in 0..SAMPLES {
            let w = o.d65[i] * o.xyz_bar[i][1];
            y += w * f64::from(self.eval(LAMBDA_MIN + i as f32));
            total += w;
        }
        (y / total) as f32
    }

    /// Returns the largest value over 380..780 nm and over the channels of rgb mode.
    pub fn max_value(&self) -> f32 {
        let channels = self.rgb().into_iter().fold(0.0, f32::max);
        match self {
            Self::Constant(c) => *c,
            _ => (0..SAMPLES).map(|i| self.eval(LAMBDA_MIN + i as f32)).fold(channels, f32::max),
        }
    }

    /// Returns whether the spectrum is zero everywhere.
    pub fn is_black(&self) -> bool {
        self.max_value() == 0.0
    }

    /// Returns the spectrum times a factor.
    ///
    /// *Domain*: a non-negative, finite factor.
    pub fn scaled(&self, factor: f32) -> Self {
        match self {
            _ if factor == 1.0 => self.clone(),
            Self::Constant(c) => Self::Constant(c * factor),
            Self::Rgb(s) => Self::Rgb(s.scaled(factor)),
            Self::Tabulated(t) => Self::Tabulated(Arc::new(Tabulated {
                points: t.points.iter().map(|&(l, v)| (l, v * factor)).collect(),
                uniform: t.uniform,
                rgb: t.rgb.map(|x| x * factor),
            })),
        }
    }
}

impl From<f32> for Spectra {
    fn from(value: f32) -> Self {
        Self::Constant(value)
    }
}

/// Returns the candidate of least edit distance to a name (optimal string alignment, letters compared without case).
///
/// *Domain*: at least one candidate.
pub fn nearest(name: &str, candidates: impl Iterator<Item = &'static str>) -> &'static str {
    candidates.min_by_key(|c| distance(name, c)).expect("there are candidates")
}

fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.to_lowercase().chars().collect(), b.to_lowercase().chars().collect());
    let mut rows = vec![(0..=b.len()).collect::<Vec<_>>()];
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let same = usize::from(a[i - 1] != b[j - 1]);
            row[j] = (rows[i - 1][j] + 1).min(row[j - 1] + 1).min(rows[i - 1][j - 1] + same);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(rows[i - 2][j - 2] + 1);
            }
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}

fn valid(x: f32) -> Result<(), SpectraError> {
    if x >= 0.0 && x.is_finite() { Ok(()) } else { Err(SpectraError::Value(x)) }
}

fn check(points: &[(f32, f32)]) -> Result<(), SpectraError> {
    if points.is_empty() {
        return Err(SpectraError::Empty);
    }
    for p in points {
        if !(p.0 > 0.0 && p.0.is_finite()) {
            return Err(SpectraError::Wavelength(p.0));
        }
        valid(p.1)?;
    }
    match points.windows(2).find(|w| w[0].0 >= w[1].0) {
        Some(w) => Err(SpectraError::Order(w[0].0, w[1].0)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wavelengths::WavelengthMode;

    fn grey_in_every_mode(s: &Spectra, value: f32) {
        for i in 0..50 {
            let u = (i as f32 + 0.5) / 50.0;
            let hero = s.sample(&Wavelengths::<4>::sample(WavelengthMode::Hero, u));
            let rgb = s.sample(&Wavelengths::<3>::sample(WavelengthMode::Rgb, u));
            let mono = s.sample(&Wavelengths::<1>::sample(WavelengthMode::MONO, u));
            assert!(hero.is_gray() && hero[0] == value && rgb.is_gray() && rgb[0] == value && mono[0] == value);
        }
    }

    #[test]
    fn grey_is_exactly_grey_in_every_mode() {
        for x in [0.0f32, 0.1, 0.7, 1.0] {
            grey_in_every_mode(&Spectra::Constant(x), x);
            grey_in_every_mode(&Spectra::rgb_albedo([x; 3]).unwrap(), x);
            grey_in_every_mode(&Spectra::rgb_unbounded([x; 3]).unwrap(), x);
            grey_in_every_mode(&Spectra::rgb_illuminant([x; 3]).unwrap(), x);
            grey_in_every_mode(&Spectra::sampled(vec![(400.0, x), (700.0, x)]).unwrap(), x);
        }
    }

    #[test]
    fn d65_is_white_light_of_value_one() {
        let d65 = Spectra::named("stdillum-D65").unwrap();
        // Rounding of the quotient of equal tables to f32.
        assert!((0..401).all(|i| (d65.eval(380.0 + i as f32) - 1.0).abs() < 1e-6));
        assert!((d65.luminance() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn equal_energy_light_has_the_known_colour() {
        let e = Spectra::sampled_light(vec![(300.0, 1.0), (900.0, 1.0)]).unwrap();
        // XYZ = (1, 1, 1) through the matrix of IEC 61966-2-1: (1.2048, .9484, .9087); its white differs from ours by 1e-3.
        let rgb = e.rgb();
        assert!([1.2048, 0.9484, 0.9087].iter().zip(rgb).all(|(a, b): (&f32, f32)| (a - b).abs() < 3e-3), "{rgb:?}");
        assert!((e.luminance() - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_colour_returns_its_components_in_rgb_mode() {
        let s = Spectra::rgb_unbounded([0.0011, 0.0024, 0.014]).unwrap();
        let w = Wavelengths::<3>::sample(WavelengthMode::Rgb, 0.5);
        assert_eq!(w.to_rgb(s.sample(&w)), [0.0011, 0.0024, 0.014]);
    }

    #[test]
    fn tables_interpolate_linearly_and_continue_their_ends() {
        let s = Spectra::sampled(vec![(400.0, 1.0), (500.0, 3.0), (600.0, 2.0)]).unwrap();
        for (l, v) in [(350.0, 1.0), (400.0, 1.0), (450.0, 2.0), (500.0, 3.0), (575.0, 2.25), (800.0, 2.0)] {
            assert!((s.eval(l) - v).abs() < 1e-6, "{l}");
        }
    }

    #[test]
    fn black_bodies_have_their_colours() {
        let hot = Spectra::blackbody(6504.0).unwrap().rgb();
        let warm = Spectra::blackbody(2856.0).unwrap();
        assert!(warm.rgb()[0] > 2.0 * warm.rgb()[2] && hot.iter().all(|c| (c / hot[1] - 1.0).abs() < 0.12), "{hot:?}");
        // Illuminant A is a black body of 2856 K (to CIE's constants): relative spectra agree to 1e-3.
        let a = Spectra::named("stdillum-A").unwrap();
        let k = a.luminance() / warm.luminance();
        assert!(
            (0..401).all(|i| { (a.eval(380.0 + i as f32) / (k * warm.eval(380.0 + i as f32)) - 1.0).abs() < 1e-3 })
        );
    }

    #[test]
    fn errors_name_the_value_and_the_range() {
        assert_eq!(
            Spectra::rgb_albedo([0.2, 1.5, 0.1]).unwrap_err().to_string(),
            "albedo component 1.5 is outside [0, 1]"
        );
        assert_eq!(Spectra::rgb_unbounded([0.2, -1.5, 0.1]).unwrap_err().to_string(), "value -1.5 is outside [0, inf)");
        assert_eq!(Spectra::sampled(vec![(500.0, 1.0), (400.0, 2.0)]).unwrap_err(), SpectraError::Order(500.0, 400.0));
        assert_eq!(
            Spectra::named("metal-au-ets").unwrap_err().to_string(),
            "unknown spectrum \"metal-au-ets\"; did you mean \"metal-Au-eta\"?"
        );
        // Wien: the peak of 5000 K is at 579.6 nm; the table's points are 1 nm apart.
        let curve = Spectra::blackbody_curve(5000.0).unwrap();
        assert!(
            (curve.eval(579.6) - 1.0).abs() < 1e-5
                && curve.max_value() <= 1.0
                && (curve.eval(380.0) - 0.60444).abs() < 1e-4
        );
        assert!(Spectra::blackbody_curve(-1.0).is_err());
        assert!(Spectra::blackbody(0.0).is_err() && Spectra::blackbody(f32::NAN).is_err());
    }
}
