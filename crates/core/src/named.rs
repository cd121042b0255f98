//! Standard spectra under the names that pbrt-v4 scenes use: metals, glasses, CIE illuminants.
//!
//! Metals: complex index n + ik. Ag, Al, Au, Cu, MgO, TiO2 are the values of pbrt-v4's `spectrum.cpp` (from the SOPRA and Palik
//! collections), every second point over the visible range; brass (CuZn) is Cu70Zn30 of \[Querry1985\] as in the CC0 data base
//! refractiveindex.info. Glasses: Sellmeier's formula with the coefficients of the Schott catalogue. Illuminants: the tables of
//! CIE 15:2018 (crate `colorimetry`), as lights of unit luminance.

use colorimetry::illuminant::CieIlluminant;

use crate::color::{LAMBDA_MIN, OBSERVED, locate, spectrum_of, trapezoid};
use crate::spectra::Spectra;

/// All names that [`Spectra::named`] accepts.
pub const NAMES: [&str; 36] = [
    "metal-Ag-eta",
    "metal-Ag-k",
    "metal-Al-eta",
    "metal-Al-k",
    "metal-Au-eta",
    "metal-Au-k",
    "metal-Cu-eta",
    "metal-Cu-k",
    "metal-CuZn-eta",
    "metal-CuZn-k",
    "metal-MgO-eta",
    "metal-MgO-k",
    "metal-TiO2-eta",
    "metal-TiO2-k",
    "glass-BK7",
    "glass-BAF10",
    "glass-FK51A",
    "glass-LASF9",
    "glass-F5",
    "glass-F10",
    "glass-F11",
    "stdillum-A",
    "stdillum-D50",
    "stdillum-D65",
    "stdillum-F1",
    "stdillum-F2",
    "stdillum-F3",
    "stdillum-F4",
    "stdillum-F5",
    "stdillum-F6",
    "stdillum-F7",
    "stdillum-F8",
    "stdillum-F9",
    "stdillum-F10",
    "stdillum-F11",
    "stdillum-F12",
];

/// Other spellings of the glasses: their catalogue names.
const ALIASES: [(&str, &str); 3] =
    [("glass-SF5", "glass-F5"), ("glass-SF10", "glass-F10"), ("glass-SF11", "glass-F11")];

/// Wavelengths [nm] of the tables of Ag, Al, Au and Cu: photon energies 3.3, 3.2, ... 1.5 eV.
const EV: [f32; 19] = [
    375.710, 387.451, 399.949, 413.281, 427.532, 442.801, 459.201, 476.862, 495.937, 516.601, 539.062, 563.564,
    590.401, 619.921, 652.548, 688.801, 729.319, 774.901, 826.561,
];
const AG_N: [f32; 19] = [
    0.2, 0.192, 0.173, 0.173, 0.16, 0.157, 0.144, 0.132, 0.13, 0.13, 0.129, 0.12, 0.121, 0.131, 0.14, 0.14, 0.148,
    0.143, 0.145,
];
const AG_K: [f32; 19] =
    [1.67, 1.81, 1.95, 2.11, 2.26, 2.4, 2.56, 2.72, 2.88, 3.07, 3.25, 3.45, 3.66, 3.88, 4.15, 4.44, 4.74, 5.09, 5.5];
const AL_N: [f32; 19] = [
    0.432, 0.46, 0.49, 0.523, 0.558, 0.598, 0.644, 0.695, 0.755, 0.826, 0.912, 1.02, 1.15, 1.3, 1.49, 1.74, 2.14, 2.63,
    2.74,
];
// 6.28 is a measured k, not 2 pi.
#[allow(clippy::approx_constant)]
const AL_K: [f32; 19] =
    [4.56, 4.71, 4.86, 5.02, 5.2, 5.38, 5.58, 5.8, 6.03, 6.28, 6.55, 6.85, 7.15, 7.48, 7.82, 8.21, 8.57, 8.6, 8.31];
const AU_N: [f32; 19] = [
    1.696, 1.674, 1.658, 1.636, 1.616, 1.562, 1.426, 1.242, 0.916, 0.608, 0.402, 0.306, 0.236, 0.194, 0.166, 0.16,
    0.164, 0.176, 0.188,
];
const AU_K: [f32; 19] = [
    1.906, 1.936, 1.956, 1.958, 1.94, 1.904, 1.846, 1.796, 1.84, 2.12, 2.54, 2.88, 2.97, 3.06, 3.15, 3.8, 4.357, 4.86,
    5.39,
];
const CU_N: [f32; 19] = [
    1.225, 1.18, 1.175, 1.18, 1.175, 1.17, 1.16, 1.15, 1.135, 1.12, 1.04, 0.826, 0.468, 0.272, 0.214, 0.213, 0.223,
    0.25, 0.26,
];
const CU_K: [f32; 19] = [
    2.015, 2.21, 2.13, 2.21, 2.289, 2.362, 2.433, 2.504, 2.564, 2.605, 2.583, 2.599, 2.809, 3.24, 3.67, 4.05, 4.43,
    4.817, 5.26,
];

/// (wavelength in nm, n, k) of brass, Cu70Zn30.
const BRASS: [(f32, f32, f32); 21] = [
    (380.0, 1.487, 1.818),
    (400.0, 1.445, 1.805),
    (420.0, 1.35, 1.786),
    (440.0, 1.191, 1.797),
    (460.0, 0.994, 1.883),
    (480.0, 0.816, 2.046),
    (500.0, 0.686, 2.25),
    (520.0, 0.602, 2.464),
    (540.0, 0.549, 2.668),
    (560.0, 0.505, 2.86),
    (580.0, 0.468, 3.059),
    (600.0, 0.45, 3.253),
    (620.0, 0.449, 3.434),
    (640.0, 0.444, 3.609),
    (660.0, 0.445, 3.778),
    (680.0, 0.444, 3.943),
    (700.0, 0.446, 4.106),
    (720.0, 0.45, 4.266),
    (740.0, 0.455, 4.424),
    (760.0, 0.458, 4.579),
    (780.0, 0.464, 4.737),
];
/// (wavelength in nm, n) of magnesium oxide; k is 0.
const MGO: [(f32, f32); 8] = [
    (386.712, 1.7655),
    (435.782, 1.75471),
    (486.005, 1.74711),
    (546.167, 1.74077),
    (589.259, 1.73737),
    (656.326, 1.73335),
    (706.439, 1.73101),
    (767.678, 1.72872),
];
/// (wavelength in nm, n) of rutile; k is 0 above 420 nm and taken as 0 throughout.
const TIO2: [(f32, f32); 20] = [
    (388.04, 3.49),
    (399.94, 3.4),
    (419.99, 3.29),
    (439.96, 3.2),
    (460.04, 3.13),
    (479.99, 3.08),
    (499.92, 3.03),
    (520.05, 3.0),
    (539.98, 2.97),
    (559.98, 2.94),
    (579.89, 2.92),
    (600.1, 2.9),
    (619.9, 2.88),
    (640.06, 2.87),
    (659.82, 2.85),
    (680.09, 2.84),
    (700.06, 2.83),
    (719.98, 2.82),
    (740.18, 2.81),
    (779.75, 2.8),
];

/// Sellmeier coefficients B1, B2, B3 and C1, C2, C3 [um^2] of the Schott catalogue.
const GLASSES: [(&str, [f64; 3], [f64; 3]); 7] = [
    ("glass-BK7", [1.03961212, 0.231792344, 1.01046945], [0.00600069867, 0.0200179144, 103.560653]),
    ("glass-BAF10", [1.5851495, 0.143559385, 1.08521269], [0.00926681282, 0.0424489805, 105.613573]),
    ("glass-FK51A", [0.971247817, 0.216901417, 0.904651666], [0.00472301995, 0.0153575612, 168.68133]),
    ("glass-LASF9", [2.00029547, 0.298926886, 1.80691843], [0.0121426017, 0.0538736236, 156.530829]),
    ("glass-F5", [1.52481889, 0.187085527, 1.42729015], [0.011254756, 0.0588995392, 129.141675]),
    ("glass-F10", [1.62153902, 0.256287842, 1.64447552], [0.0122241457, 0.0595736775, 147.468793]),
    ("glass-F11", [1.73759695, 0.313747346, 1.89878101], [0.013188707, 0.0623068142, 155.23629]),
];

/// Returns the standard spectrum of a name, if there is one.
pub(crate) fn find(name: &str) -> Option<Spectra> {
    let name = ALIASES.iter().find(|a| a.0 == name).map_or(name, |a| a.1);
    if let Some(metal) = name.strip_prefix("metal-") {
        let (element, part) = metal.rsplit_once('-')?;
        return property(match part {
            "eta" => index(element, true)?,
            "k" => index(element, false)?,
            _ => return None,
        });
    }
    if let Some(illuminant) = name.strip_prefix("stdillum-") {
        return Some(standard_light(cie(illuminant)?));
    }
    let (_, b, c) = GLASSES.iter().find(|g| g.0 == name)?;
    // Steps of 10 nm: linear interpolation is off by at most n'' h^2 / 8 = 2e-5.
    property((36..=80).map(|i| (10.0 * i as f32, sellmeier(b, c, 0.01 * f64::from(i)) as f32)).collect())
}

fn property(points: Vec<(f32, f32)>) -> Option<Spectra> {
    Some(Spectra::sampled(points).expect("the tables are valid"))
}

/// Returns the points of n (`real`) or k of a metal or oxide.
fn index(element: &str, real: bool) -> Option<Vec<(f32, f32)>> {
    let join = |v: [f32; 19]| EV.into_iter().zip(v).collect();
    let transparent = |n: &[(f32, f32)]| if real { n.to_vec() } else { vec![(550.0, 0.0)] };
    Some(match (element, real) {
        ("Ag", true) => join(AG_N),
        ("Ag", false) => join(AG_K),
        ("Al", true) => join(AL_N),
        ("Al", false) => join(AL_K),
        ("Au", true) => join(AU_N),
        ("Au", false) => join(AU_K),
        ("Cu", true) => join(CU_N),
        ("Cu", false) => join(CU_K),
        ("CuZn", _) => BRASS.iter().map(|&(l, n, k)| (l, if real { n } else { k })).collect(),
        ("MgO", _) => transparent(&MGO),
        ("TiO2", _) => transparent(&TIO2),
        _ => return None,
    })
}

/// Returns n(lambda in um) = sqrt(1 + sum B lambda^2 / (lambda^2 - C)).
fn sellmeier(b: &[f64; 3], c: &[f64; 3], lambda: f64) -> f64 {
    let l2 = lambda * lambda;
    (1.0 + b.iter().zip(c).map(|(b, c)| b * l2 / (l2 - c)).sum::<f64>()).sqrt()
}

fn cie(name: &str) -> Option<CieIlluminant> {
    use CieIlluminant::*;
    Some(match name {
        "A" => A,
        "D50" => D50,
        "D65" => D65,
        "F1" => F1,
        "F2" => F2,
        "F3" => F3,
        "F4" => F4,
        "F5" => F5,
        "F6" => F6,
        "F7" => F7,
        "F8" => F8,
        "F9" => F9,
        "F10" => F10,
        "F11" => F11,
        "F12" => F12,
        _ => return None,
    })
}

/// Returns an illuminant as a light of unit luminance.
fn standard_light(illuminant: CieIlluminant) -> Spectra {
    let table = spectrum_of(illuminant);
    let y = |t: &[f64]| trapezoid(|i| t[i] * OBSERVED.xyz_bar[i][1]);
    let scale = y(&OBSERVED.d65) / y(&table);
    Spectra::light(|l| {
        let (i, t) = locate(l as f32).expect("lights are tabulated over the visible range");
        let t = f64::from(t);
        scale * if t == 0.0 { table[i] } else { (1.0 - t) * table[i] + t * table[i + 1] }
    })
}

/// Returns Planck's spectral radiance per wavelength over its peak value, at a wavelength in nm and a temperature in K.
pub fn planck_over_peak(lambda: f64, temperature: f64) -> f64 {
    /// Second radiation constant hc/k [nm K], CODATA 2018 (exact in the SI).
    const C2: f64 = 1.438_776_877e7;
    /// Root of x = 5 (1 - exp(-x)): Wien's displacement law for wavelengths.
    const PEAK: f64 = 4.965_114_231_744_276;
    let x = C2 / (lambda * temperature);
    // Dividing by e^x avoids overflow at low temperatures.
    (x / PEAK).powi(5) * PEAK.exp_m1() * (-x).exp() / -(-x).exp_m1()
}

/// First wavelength of the tables; kept so that a change of range breaks the build of the tables above.
const _: () = assert!(LAMBDA_MIN == 380.0);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectra::Spectra;

    #[test]
    fn every_listed_name_is_found() {
        for name in NAMES {
            let s = Spectra::named(name).unwrap();
            assert!(s.eval(550.0).is_finite() && (s.eval(550.0) > 0.0 || name.ends_with("-k")), "{name}");
        }
        assert_eq!(Spectra::named("glass-SF11").unwrap(), Spectra::named("glass-F11").unwrap());
    }

    #[test]
    fn glasses_have_their_catalogue_index() {
        // n_d at 587.56 nm (Schott). Tolerance: linear interpolation (2e-5) and rounding of the catalogue (5e-6).
        for (name, nd) in [
            ("glass-BK7", 1.51680),
            ("glass-BAF10", 1.67003),
            ("glass-FK51A", 1.48656),
            ("glass-LASF9", 1.85025),
            ("glass-F5", 1.67271),
            ("glass-F10", 1.72828),
            ("glass-F11", 1.78472),
        ] {
            let n = Spectra::named(name).unwrap().eval(587.56);
            assert!((n - nd).abs() < 3e-5, "{name} {n}");
        }
    }

    #[test]
    fn lights_have_unit_luminance_and_their_chromaticities() {
        for name in NAMES.iter().filter(|n| n.starts_with("stdillum")) {
            assert!((Spectra::named(name).unwrap().luminance() - 1.0).abs() < 1e-5, "{name}");
        }
        // CIE 15: (x, y) of A, D50 and F11. The published values are sums at 5 nm.
        for (name, x, y) in [("A", 0.44757, 0.40745), ("D50", 0.34567, 0.35850), ("F11", 0.38054, 0.37692)] {
            let s = Spectra::named(&format!("stdillum-{name}")).unwrap();
            let o = &*OBSERVED;
            let xyz =
                [0, 1, 2].map(|k| trapezoid(|i| o.d65[i] * o.xyz_bar[i][k] * f64::from(s.eval(380.0 + i as f32))));
            let sum: f64 = xyz.iter().sum();
            assert!(
                (xyz[0] / sum - x).abs() < 2e-4 && (xyz[1] / sum - y).abs() < 2e-4,
                "{name} {} {}",
                xyz[0] / sum,
                xyz[1] / sum
            );
        }
    }

    #[test]
    fn planck_peaks_at_wiens_wavelength_with_value_one() {
        // Wien: 2.897771955e6 nm K.
        let peak = 2.897_771_955e6 / 5000.0;
        assert!((planck_over_peak(peak, 5000.0) - 1.0).abs() < 1e-12);
        assert!(planck_over_peak(peak * 1.01, 5000.0) < 1.0 && planck_over_peak(peak * 0.99, 5000.0) < 1.0);
        assert!(planck_over_peak(400.0, 10.0) == 0.0);
    }

    #[test]
    fn metals_reflect_as_they_do() {
        // Normal reflectance ((n-1)^2 + k^2) / ((n+1)^2 + k^2): gold is yellow, silver white.
        let r = |m: &str, l: f32| {
            let n = Spectra::named(&format!("metal-{m}-eta")).unwrap().eval(l);
            let k = Spectra::named(&format!("metal-{m}-k")).unwrap().eval(l);
            ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k)
        };
        assert!(r("Au", 650.0) > 0.9 && r("Au", 450.0) < 0.45 && r("Ag", 450.0) > 0.9 && r("CuZn", 450.0) < 0.5);
        assert!((r("TiO2", 589.0) - 0.238).abs() < 0.005);
    }
}
