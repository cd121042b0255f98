//! RGB colour spaces of scene files, and their way into linear sRGB.
//!
//! A colour of a *reflectance* keeps white white: (1, 1, 1) reflects everything in every space, so between spaces of different white points
//! the colour is adapted (Bradford). A colour of a *light* keeps its chromaticity: (1, 1, 1) of ACES is a light of its white point, a little warmer
//! than D65. Spaces that are wider than sRGB have colours that sRGB lacks; [`into_gamut`] brings them in.
//!
//! *Source*: primaries and white points of ITU-R BT.2020, SMPTE RP 431-2 with D65 ("P3-D65"), and SMPTE ST 2065-1, as in pbrt-v4's `colorspace.cpp`.

use std::sync::LazyLock;

use crate::color::{OBSERVED, inverse, multiply};

/// A colour space of pbrt-v4.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorSpace {
    /// Linear sRGB (BT.709 primaries, D65).
    #[default]
    Srgb,
    /// P3 primaries, D65.
    DciP3,
    /// BT.2020 primaries, D65.
    Rec2020,
    /// ACES2065-1 (AP0 primaries, ACES white).
    Aces2065,
}

/// Names of the spaces, as in files.
pub const NAMES: [(&str, ColorSpace); 4] = [
    ("srgb", ColorSpace::Srgb),
    ("dci-p3", ColorSpace::DciP3),
    ("rec2020", ColorSpace::Rec2020),
    ("aces2065-1", ColorSpace::Aces2065),
];

/// Chromaticities of red, green, blue, and of the white if it is not D65.
type Definition = ([[f64; 2]; 3], Option<[f64; 2]>);

const P3: Definition = ([[0.680, 0.320], [0.265, 0.690], [0.150, 0.060]], None);
const REC2020: Definition = ([[0.708, 0.292], [0.170, 0.797], [0.131, 0.046]], None);
const ACES: Definition = ([[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077]], Some([0.32168, 0.33767]));

/// XYZ to the cone responses of Bradford's adaptation (CIE TC 8-04; as in the ICC specification).
const BRADFORD: [[f64; 3]; 3] = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

/// Linear sRGB from a space: for reflectances and for lights.
struct Matrices {
    reflectance: [[f64; 3]; 3],
    light: [[f64; 3]; 3],
}

static TABLES: LazyLock<[Matrices; 3]> = LazyLock::new(|| [P3, REC2020, ACES].map(|d| Matrices::new(&d)));

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| (0..3).map(|k| a[r][k] * b[k][c]).sum()))
}

impl Matrices {
    fn new((primaries, white): &Definition) -> Self {
        let observed = &*OBSERVED;
        let d65 = multiply(&observed.xyz_from_rgb, [1.0; 3]);
        let white = white.map_or(d65, |[x, y]| [x / y, 1.0, (1.0 - x - y) / y]);
        // Columns: XYZ of the primaries, scaled so that they add up to white. The blue of ACES has a negative y: scale x, y, z instead.
        let columns = primaries.map(|[x, y]| [x, y, 1.0 - x - y]);
        let unscaled: [[f64; 3]; 3] = std::array::from_fn(|r| std::array::from_fn(|c| columns[c][r]));
        let amounts = multiply(&inverse(unscaled), white);
        let xyz_from_rgb: [[f64; 3]; 3] = std::array::from_fn(|r| std::array::from_fn(|c| unscaled[r][c] * amounts[c]));
        // Scale the cone responses from the one white to the other.
        let (from, to) = (multiply(&BRADFORD, white), multiply(&BRADFORD, d65));
        let scaled: [[f64; 3]; 3] = std::array::from_fn(|r| BRADFORD[r].map(|x| x * to[r] / from[r]));
        let adapt = product(&inverse(BRADFORD), &scaled);
        let light = product(&observed.rgb_from_xyz, &xyz_from_rgb);
        let reflectance = product(&observed.rgb_from_xyz, &product(&adapt, &xyz_from_rgb));
        Self { reflectance, light }
    }
}

impl ColorSpace {
    /// Returns the space of that name, whatever its case.
    pub fn named(name: &str) -> Option<Self> {
        NAMES.iter().find(|(n, _)| n.eq_ignore_ascii_case(name)).map(|(_, space)| *space)
    }

    /// Returns the name.
    pub fn name(self) -> &'static str {
        NAMES.iter().find(|(_, space)| *space == self).map_or("srgb", |(n, _)| n)
    }

    fn matrices(self) -> Option<&'static Matrices> {
        match self {
            Self::Srgb => None,
            Self::DciP3 => Some(&TABLES[0]),
            Self::Rec2020 => Some(&TABLES[1]),
            Self::Aces2065 => Some(&TABLES[2]),
        }
    }

    /// Returns the linear sRGB of a reflectance or coefficient; components may be negative or above those given.
    pub fn reflectance_to_srgb(self, rgb: [f32; 3]) -> [f32; 3] {
        self.matrices().map_or(rgb, |m| multiply(&m.reflectance, rgb.map(f64::from)).map(|x| x as f32))
    }

    /// Returns the linear sRGB of a light; components may be negative or above those given.
    pub fn light_to_srgb(self, rgb: [f32; 3]) -> [f32; 3] {
        self.matrices().map_or(rgb, |m| multiply(&m.light, rgb.map(f64::from)).map(|x| x as f32))
    }
}

/// How far a component may be out of range by rounding and still count as in it.
const ROUNDING: f32 = 1e-5;

/// Returns a linear sRGB colour within \[0, most\] and whether it had to be changed by more than rounding: it is mixed with the grey of the same
/// luminance until no component is out of range. Without luminance (imaginary colours) negative components become 0.
pub fn into_gamut(rgb: [f32; 3], most: f32) -> ([f32; 3], bool) {
    let weights = OBSERVED.xyz_from_rgb[1].map(|w| w as f32);
    let y: f32 = rgb.iter().zip(weights).map(|(c, w)| c * w).sum();
    let scale = rgb.iter().fold(0.0f32, |m, c| m.max(c.abs())).max(f32::MIN_POSITIVE);
    let outside = rgb.iter().any(|&c| c < -ROUNDING * scale || c > most + ROUNDING);
    let has_grey = y > 0.0 && y < most;
    if !(outside && has_grey) {
        return (rgb.map(|c| c.clamp(0.0, most)), outside);
    }
    let keep = rgb.iter().fold(1.0f32, |t, &c| {
        let limit = if c < 0.0 {
            y / (y - c)
        } else if c > most {
            (most - y) / (c - y)
        } else {
            1.0
        };
        t.min(limit)
    });
    (rgb.map(|c| (y + keep * (c - y)).clamp(0.0, most)), true)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(space: ColorSpace, published: [[f64; 3]; 3], tolerance: f64) {
        let ours = &space.matrices().expect("not srgb").reflectance;
        let off = ours.iter().flatten().zip(published.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < tolerance, "{space:?}: {ours:?}, off by {off}");
    }

    #[test]
    fn matrices_are_the_published_ones() {
        // ITU-R BT.2087 (rounded to 4 digits; its D65 is (.3127, .3290), ours the tabulated one: 1e-3); the same for P3-D65.
        close(
            ColorSpace::Rec2020,
            [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]],
            2e-3,
        );
        close(ColorSpace::DciP3, [[1.2249, -0.2247, 0.0], [-0.0420, 1.0419, 0.0], [-0.0197, -0.0786, 1.0979]], 2e-3);
        // ACES to sRGB is published with several adaptations, which differ by 5e-3.
        close(
            ColorSpace::Aces2065,
            [[2.5217, -1.1341, -0.3876], [-0.2765, 1.3727, -0.0962], [-0.0154, -0.1530, 1.1683]],
            6e-3,
        );
    }

    #[test]
    fn white_reflects_everything_in_every_space_and_lights_keep_their_chromaticity() {
        for (name, space) in NAMES {
            assert_eq!(ColorSpace::named(&name.to_uppercase()), Some(space));
            assert_eq!(space.name(), name);
            let white = space.reflectance_to_srgb([1.0; 3]);
            assert!(white.iter().all(|c| (c - 1.0).abs() < 1e-5), "{name}: {white:?}");
        }
        assert_eq!(ColorSpace::named("adobe"), None);
        // The white of ACES as a light has its published chromaticity.
        let rgb = ColorSpace::Aces2065.light_to_srgb([1.0; 3]);
        let xyz = multiply(&OBSERVED.xyz_from_rgb, rgb.map(f64::from));
        let sum: f64 = xyz.iter().sum();
        assert!((xyz[0] / sum - 0.32168).abs() < 1e-6 && (xyz[1] / sum - 0.33767).abs() < 1e-6, "{xyz:?}");
        assert_eq!(ColorSpace::Rec2020.light_to_srgb([0.3; 3]).map(|c| (c * 1e5).round()), [3e4; 3]);
    }

    #[test]
    fn colours_outside_are_desaturated_at_constant_luminance() {
        let luminance = |c: [f32; 3]| -> f64 { multiply(&OBSERVED.xyz_from_rgb, c.map(f64::from))[1] };
        let green = ColorSpace::Rec2020.reflectance_to_srgb([0.0, 1.0, 0.0]);
        assert!(green[0] < -0.5);
        let (inside, changed) = into_gamut(green, 1.0);
        assert!(changed && inside.iter().all(|c| (0.0..=1.0).contains(c)), "{inside:?}");
        // Rounding of f32 sums.
        assert!((luminance(inside) - luminance(green)).abs() < 1e-6, "{inside:?}");
        assert_eq!(into_gamut([0.2, 0.3, 1.0], 1.0), ([0.2, 0.3, 1.0], false));
        assert_eq!(into_gamut([-1e-7, 0.5, 1.000_001], 1.0), ([0.0, 0.5, 1.0], false));
        // The blue of ACES has negative luminance.
        let (blue, changed) = into_gamut(ColorSpace::Aces2065.light_to_srgb([0.0, 0.0, 1.0]), f32::INFINITY);
        assert!(changed && blue.iter().all(|&c| c >= 0.0), "{blue:?}");
    }
}
