//! Maps of numbers as pictures: black for 0 over purple and orange to pale yellow for 1, evenly brighter to the eye.

use crate::image::{Error, Picture};
use crate::png::srgb_decode;

/// Seventeen evenly spaced sRGB colours of the map "magma".
///
/// *Source*: N. Smith and S. van der Walt, matplotlib (CC0); every sixteenth of the 256 entries of matplotlib 3.11, four
/// digits. Linear interpolation stays within 0.010 of the full table.
const MAGMA: [[f32; 3]; 17] = [
    [0.0015, 0.0005, 0.0139],
    [0.0394, 0.0309, 0.1330],
    [0.1124, 0.0653, 0.2756],
    [0.2104, 0.0622, 0.4173],
    [0.3151, 0.0712, 0.4848],
    [0.4128, 0.1096, 0.5045],
    [0.5105, 0.1473, 0.5077],
    [0.6108, 0.1809, 0.4990],
    [0.7132, 0.2139, 0.4762],
    [0.8135, 0.2542, 0.4381],
    [0.9013, 0.3165, 0.3899],
    [0.9592, 0.4135, 0.3599],
    [0.9859, 0.5300, 0.3801],
    [0.9959, 0.6477, 0.4423],
    [0.9970, 0.7633, 0.5296],
    [0.9928, 0.8776, 0.6335],
    [0.9871, 0.9914, 0.7495],
];

/// Returns the sRGB-coded colour of a value; below 0 counts as 0, above 1 as 1.
///
/// What is not a number becomes green, a colour that the map does not contain.
pub fn magma(value: f32) -> [f32; 3] {
    if value.is_nan() {
        return [0.0, 1.0, 0.0];
    }
    let at = value.clamp(0.0, 1.0) * 16.0;
    let i = (at as usize).min(15);
    let f = at - i as f32;
    std::array::from_fn(|c| MAGMA[i][c] * (1.0 - f) + MAGMA[i + 1][c] * f)
}

/// Nine evenly spaced sRGB codes from -1 to 1: blue over white to red.
///
/// *Source*: C. Brewer's scheme RdBu of nine classes, reversed (colorbrewer2.org, Apache 2.0); its hues are told apart with any colour vision.
const BLUE_RED: [[u8; 3]; 9] = [
    [33, 102, 172],
    [67, 147, 195],
    [146, 197, 222],
    [209, 229, 240],
    [247, 247, 247],
    [253, 219, 199],
    [244, 165, 130],
    [214, 96, 77],
    [178, 24, 43],
];

/// Returns the sRGB-coded colour of a signed value: blue for -1, white for 0, red for 1; values beyond count as -1 or 1.
///
/// What is not a number becomes green, a colour that the map does not contain.
pub fn blue_red(value: f32) -> [f32; 3] {
    if value.is_nan() {
        return [0.0, 1.0, 0.0];
    }
    let at = (value.clamp(-1.0, 1.0) + 1.0) * 4.0;
    let i = (at as usize).min(7);
    let f = at - i as f32;
    std::array::from_fn(|c| (f32::from(BLUE_RED[i][c]) * (1.0 - f) + f32::from(BLUE_RED[i + 1][c]) * f) / 255.0)
}

/// Returns the map as a picture: channels `R G B`, linear, so that a PNG of it shows the colours of [`magma`].
///
/// `white` is the value shown as the brightest colour; FLIP uses 1.
///
/// *Errors*: `map` does not have `width * height` entries.
pub fn false_color(map: &[f32], width: usize, height: usize, white: f32) -> Result<Picture, Error> {
    let linear = |v: f32| magma(v / white).map(|c| srgb_decode(f64::from(c)) as f32);
    Picture::from_rgb(width, height, &map.iter().map(|&v| linear(v)).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_is_brighter_without_exception() {
        let luminance = |v: f32| {
            let [r, g, b] = magma(v).map(|c| srgb_decode(f64::from(c)));
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for i in 0..1000 {
            assert!(luminance((i + 1) as f32 / 1000.0) > luminance(i as f32 / 1000.0), "{i}");
        }
    }

    #[test]
    fn signed_values_are_white_in_the_middle_blue_below_and_red_above() {
        assert_eq!(blue_red(0.0), [247.0 / 255.0; 3]);
        for i in 1..=20 {
            let (low, high) = (blue_red(-0.05 * i as f32), blue_red(0.05 * i as f32));
            assert!(low[2] > low[0] && high[0] > high[2], "{i}");
        }
        assert_eq!((blue_red(-9.0), blue_red(9.0), blue_red(f32::NAN)[1]), (blue_red(-1.0), blue_red(1.0), 1.0));
    }

    #[test]
    fn ends_and_strange_values_have_a_color() {
        assert_eq!(magma(-3.0), MAGMA[0]);
        assert_eq!(magma(1e9), MAGMA[16]);
        assert_eq!(magma(f32::NAN), [0.0, 1.0, 0.0]);
        let p = false_color(&[0.0, 5.0], 2, 1, 5.0).unwrap();
        let top = srgb_decode(f64::from(MAGMA[16][1])) as f32;
        assert_eq!(p.channel("G").unwrap()[1], top);
        assert!(false_color(&[0.0], 2, 1, 1.0).is_err());
    }
}
