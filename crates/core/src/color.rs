//! From spectral radiance to linear sRGB: the CIE 1931 observer, the illuminant D65 and the sRGB primaries.
//!
//! **Radiance is carried relative to D65.** A lane of a path holds spectral radiance divided by that of the illuminant D65 of
//! unit luminance at the same wavelength. Light of linear colour (1, 1, 1) is then exactly 1 at every wavelength, grey
//! scenes stay grey bit for bit, and the sensor's response contains D65:
//!
//! $$ c = \int L(\lambda)\, w_c(\lambda)\, d\lambda, \qquad w_c \propto S_{D65}(\lambda)\, \bar c(\lambda), \qquad \int w_c\,d\lambda = 1 . $$
//!
//! Transport is linear per wavelength (no fluorescence), so nothing is lost. The observer's tables (crate `colorimetry`) span
//! 380 to 780 nm; what lies outside contributes less than 1e-5 of the luminance of D65 and is taken as invisible.

use std::sync::LazyLock;

use colorimetry::illuminant::CieIlluminant;
use colorimetry::observer::Observer;
use colorimetry::traits::Light;

/// Shortest visible wavelength \[nm\].
pub const LAMBDA_MIN: f32 = 380.0;
/// Longest visible wavelength \[nm\].
pub const LAMBDA_MAX: f32 = 780.0;
/// Number of tabulated wavelengths: one per nm, both ends included.
pub const SAMPLES: usize = 401;

/// CIE chromaticities (x, y) of the sRGB primaries red, green, blue (ITU-R BT.709).
const PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];

/// Tables at 1 nm steps from 380 nm, and the matrices between XYZ and linear sRGB.
pub struct Observed {
    /// Colour matching functions x, y, z of CIE 1931.
    pub xyz_bar: Vec<[f64; 3]>,
    /// Illuminant D65, normalised to unit luminance: sum of D65 ybar / sum of ybar = 1.
    pub d65: Vec<f64>,
    /// Linear sRGB from XYZ; maps the XYZ of the tabulated D65 to (1, 1, 1).
    pub rgb_from_xyz: [[f64; 3]; 3],
    /// The inverse of `rgb_from_xyz`.
    pub xyz_from_rgb: [[f64; 3]; 3],
    /// Sensor response w_c for radiance relative to D65 \[1/nm\]; each channel integrates to 1 by the trapezoidal rule.
    pub response: Vec<[f32; 3]>,
}

/// The tables of the standard observer, made once from constants.
pub static OBSERVED: LazyLock<Observed> = LazyLock::new(Observed::new);

impl Observed {
    fn new() -> Self {
        let xyz_bar: Vec<[f64; 3]> = (0..SAMPLES)
            .map(|i| {
                Observer::Cie1931.xyz_at_wavelength(380 + i).expect("the observer covers 380 to 780 nm").to_array()
            })
            .collect();
        let y_integral = trapezoid(|i| xyz_bar[i][1]);
        let mut d65 = spectrum_of(CieIlluminant::D65);
        let scale = y_integral / trapezoid(|i| d65[i] * xyz_bar[i][1]);
        d65.iter_mut().for_each(|x| *x *= scale);
        let white = [0, 1, 2].map(|k| trapezoid(|i| d65[i] * xyz_bar[i][k]) / y_integral);
        let rgb_from_xyz = rgb_from_xyz(white);
        let response = (0..SAMPLES)
            .map(|i| multiply(&rgb_from_xyz, xyz_bar[i]).map(|x| (x * d65[i] / y_integral) as f32))
            .collect();
        Self { xyz_bar, d65, rgb_from_xyz, xyz_from_rgb: inverse(rgb_from_xyz), response }
    }

    /// Returns the response of the three channels at a wavelength, linear between the tabulated ones and 0 outside.
    #[inline]
    pub fn response_at(&self, lambda: f32) -> [f32; 3] {
        match locate(lambda) {
            Some((i, t)) => std::array::from_fn(|c| (1.0 - t) * self.response[i][c] + t * self.response[i + 1][c]),
            None => [0.0; 3],
        }
    }

    /// Returns the linear sRGB colour of radiance relative to D65, given as a function of the wavelength in nm.
    pub fn rgb_of(&self, mut relative: impl FnMut(f32) -> f32) -> [f64; 3] {
        let values: Vec<f64> = (0..SAMPLES).map(|i| f64::from(relative(LAMBDA_MIN + i as f32))).collect();
        [0, 1, 2].map(|c| trapezoid(|i| values[i] * f64::from(self.response[i][c])))
    }

    /// Returns D65 of unit luminance at a wavelength; the end values continue outside.
    #[inline]
    pub fn d65_at(&self, lambda: f32) -> f64 {
        let (i, t) = locate(lambda.clamp(LAMBDA_MIN, LAMBDA_MAX)).expect("clamped to the table");
        let t = f64::from(t);
        (1.0 - t) * self.d65[i] + t * self.d65[i + 1]
    }
}

/// Returns the interval of the 1 nm table that holds a wavelength, and the fraction within it.
#[inline]
pub(crate) fn locate(lambda: f32) -> Option<(usize, f32)> {
    let x = lambda - LAMBDA_MIN;
    if !(0.0..=LAMBDA_MAX - LAMBDA_MIN).contains(&x) {
        return None;
    }
    let i = (x as usize).min(SAMPLES - 2);
    Some((i, x - i as f32))
}

/// Returns a CIE illuminant at 1 nm steps, in the units of its table.
pub(crate) fn spectrum_of(illuminant: CieIlluminant) -> Vec<f64> {
    illuminant.spectrum().as_array().to_vec()
}

/// Integrates f(i) over the table by the trapezoidal rule at steps of 1 nm.
pub(crate) fn trapezoid(f: impl Fn(usize) -> f64) -> f64 {
    (1..SAMPLES - 1).map(&f).sum::<f64>() + 0.5 * (f(0) + f(SAMPLES - 1))
}

pub(crate) fn multiply(m: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Inverts the matrix whose columns are the XYZ of the primaries, scaled so that they add up to white.
fn rgb_from_xyz(white: [f64; 3]) -> [[f64; 3]; 3] {
    let columns = PRIMARIES.map(|[x, y]| [x / y, 1.0, (1.0 - x - y) / y]);
    let unscaled = inverse(std::array::from_fn(|r| std::array::from_fn(|c| columns[c][r])));
    let luminance = multiply(&unscaled, white);
    std::array::from_fn(|c| unscaled[c].map(|x| x / luminance[c]))
}

/// Inverts a matrix by cofactors; a singular one gives infinities or NaN.
pub(crate) fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant = (0..3).map(|c| m[0][c] * cofactor(0, c)).sum::<f64>();
    std::array::from_fn(|r| std::array::from_fn(|c| cofactor(c, r) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_observer_integrates_to_its_published_luminance() {
        // 106.856895 over 360..830 nm (CIE 1931 at 1 nm); the ends that are cut off hold 1.6e-3 of it at most.
        let y = trapezoid(|i| OBSERVED.xyz_bar[i][1]);
        assert!((y - 106.856_895).abs() < 2e-3, "{y}");
    }

    #[test]
    fn the_white_point_of_d65_is_the_published_one() {
        let o = &*OBSERVED;
        let y = trapezoid(|i| o.d65[i] * o.xyz_bar[i][1]);
        let x = trapezoid(|i| o.d65[i] * o.xyz_bar[i][0]) / y;
        let z = trapezoid(|i| o.d65[i] * o.xyz_bar[i][2]) / y;
        // Published .95047 and 1.08883 are sums at 5 nm over 360..780 nm; the table at 1 nm differs by 1e-4.
        assert!((x - 0.95047).abs() < 2e-4 && (z - 1.08883).abs() < 3e-4, "{x} {z}");
    }

    #[test]
    fn light_like_d65_is_white_and_every_response_integrates_to_one() {
        let rgb = OBSERVED.rgb_of(|_| 1.0);
        // Rounding of the responses to f32.
        assert!(rgb.iter().all(|c| (c - 1.0).abs() < 1e-6), "{rgb:?}");
    }

    #[test]
    fn the_matrix_is_that_of_the_srgb_standard() {
        // IEC 61966-2-1; its white is (.3127, .3290), ours the tabulated D65: the entries differ by 1e-3.
        let standard = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
        let ours = OBSERVED.rgb_from_xyz;
        assert!(ours.iter().flatten().zip(standard.iter().flatten()).all(|(a, b)| (a - b).abs() < 2e-3), "{ours:?}");
    }
}
