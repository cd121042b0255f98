//! Measured media by name: the tables that pbrt-v4's `subsurface` "name" and medium "preset" accept.
//!
//! Reduced scattering coefficient sigma_s' and absorption coefficient sigma_a in 1/mm for red, green, blue. *Sources*: \[Jensen2001\], diffusion fits;
//! \[Narasimhan2006\], dilution measurements, given there as sigma_s and g and reduced here to sigma_s (1 - g) as in pbrt-v4. Used as a medium
//! they scatter isotropically (g = 0): the anisotropy is already in sigma_s'.

use moonmilk_core::Spectra;
use moonmilk_core::spectra::nearest;

use crate::error::{Error, ErrorKind};
use crate::medium::Homogeneous;
use crate::properties::OpticalProperties;

/// A measured medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Name, as pbrt-v4 spells it.
    pub name: &'static str,
    /// Reduced scattering coefficient \[1/mm\], linear sRGB.
    pub sigma_s_prime: [f32; 3],
    /// Absorption coefficient \[1/mm\], linear sRGB.
    pub sigma_a: [f32; 3],
    /// Index of refraction over that of air that the source uses.
    pub eta: f32,
    /// Key of the publication.
    pub source: &'static str,
}

/// Scattering coefficients \[1/mm\] and asymmetries as measured, for red, green and blue, where this table holds them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anisotropic {
    /// Name of the material in [`MATERIALS`].
    pub name: &'static str,
    /// Scattering coefficient \[1/mm\].
    pub sigma_s: [f32; 3],
    /// Asymmetry.
    pub g: [f32; 3],
}

impl Material {
    /// Returns scattering coefficient and asymmetry as measured, if known; else only the reduced coefficient is.
    pub fn anisotropic(&self) -> Option<&'static Anisotropic> {
        ANISOTROPIC.iter().find(|a| a.name == self.name)
    }

    /// Returns the properties of one of the three colours in 1/mm: as measured where g is known, else reduced with g = 0.
    ///
    /// *Errors*: a colour that neither absorbs nor scatters.
    pub fn properties(&self, colour: usize) -> Result<OpticalProperties, Error> {
        let (s, g) = self.anisotropic().map_or((self.sigma_s_prime[colour], 0.0), |a| (a.sigma_s[colour], a.g[colour]));
        OpticalProperties::new(decimal(self.sigma_a[colour]), decimal(s), decimal(g), decimal(self.eta))
    }

    /// Returns the isotropically scattering medium with these coefficients, in 1/mm.
    pub fn medium(&self) -> Homogeneous {
        let spectrum = |rgb| Spectra::rgb_unbounded(rgb).expect("the table holds valid coefficients");
        Homogeneous::scattering(spectrum(self.sigma_a), spectrum(self.sigma_s_prime), 0.0)
            .expect("the table holds valid coefficients")
    }
}

/// Returns the material of a name; case and spaces do not matter.
///
/// *Errors*: an unknown name, with the nearest known one.
pub fn find(name: &str) -> Result<&'static Material, Error> {
    let plain = |s: &str| s.chars().filter(|c| !c.is_whitespace()).collect::<String>().to_lowercase();
    MATERIALS.iter().find(|m| plain(m.name) == plain(name)).ok_or_else(|| {
        ErrorKind::Material { name: name.to_owned(), nearest: nearest(name, MATERIALS.iter().map(|m| m.name)) }.into()
    })
}

const fn jensen(name: &'static str, sigma_s_prime: [f32; 3], sigma_a: [f32; 3], eta: f32) -> Material {
    Material { name, sigma_s_prime, sigma_a, eta, source: "Jensen2001" }
}

const fn narasimhan(name: &'static str, sigma_s_prime: [f32; 3], sigma_a: [f32; 3]) -> Material {
    Material { name, sigma_s_prime, sigma_a, eta: 1.33, source: "Narasimhan2006" }
}

/// All materials.
pub const MATERIALS: [Material; 47] = [
    jensen("Apple", [2.29, 2.39, 1.97], [0.0030, 0.0034, 0.046], 1.3),
    jensen("Chicken1", [0.15, 0.21, 0.38], [0.015, 0.077, 0.19], 1.3),
    jensen("Chicken2", [0.19, 0.25, 0.32], [0.018, 0.088, 0.20], 1.3),
    jensen("Cream", [7.38, 5.47, 3.15], [0.0002, 0.0028, 0.0163], 1.3),
    jensen("Ketchup", [0.18, 0.07, 0.03], [0.061, 0.97, 1.45], 1.3),
    jensen("Marble", [2.19, 2.62, 3.00], [0.0021, 0.0041, 0.0071], 1.5),
    jensen("Potato", [0.68, 0.70, 0.55], [0.0024, 0.0090, 0.12], 1.3),
    jensen("Skimmilk", [0.70, 1.22, 1.90], [0.0014, 0.0025, 0.0142], 1.3),
    jensen("Skin1", [0.74, 0.88, 1.01], [0.032, 0.17, 0.48], 1.3),
    jensen("Skin2", [1.09, 1.59, 1.79], [0.013, 0.070, 0.145], 1.3),
    jensen("Spectralon", [11.6, 20.4, 14.9], [0.0, 0.0, 0.0], 1.3),
    jensen("Wholemilk", [2.55, 3.21, 3.77], [0.0011, 0.0024, 0.014], 1.3),
    narasimhan("Lowfat Milk", [0.89187, 1.5136, 2.532], [0.002875, 0.00575, 0.0115]),
    narasimhan("Reduced Milk", [2.4858, 3.1669, 4.5214], [0.0025556, 0.0051111, 0.012778]),
    narasimhan("Regular Milk", [4.5513, 5.8294, 7.136], [0.0015333, 0.0046, 0.019933]),
    narasimhan("Espresso", [0.72378, 0.84557, 1.0247], [4.7984, 6.5751, 8.8493]),
    narasimhan("Mint Mocha Coffee", [0.31602, 0.38538, 0.48131], [3.772, 5.8228, 7.82]),
    narasimhan("Lowfat Soy Milk", [0.30576, 0.34233, 0.61664], [0.0014375, 0.0071875, 0.035937]),
    narasimhan("Regular Soy Milk", [0.59223, 0.73866, 1.4693], [0.0019167, 0.0095833, 0.065167]),
    narasimhan("Lowfat Chocolate Milk", [0.64925, 0.83916, 1.1057], [0.0115, 0.0368, 0.1564]),
    narasimhan("Regular Chocolate Milk", [1.4585, 2.1289, 2.9527], [0.010063, 0.043125, 0.14375]),
    narasimhan("Coke", [8.9053e-05, 8.372e-05, 0.0], [0.10014, 0.16503, 0.2468]),
    narasimhan("Pepsi", [6.1697e-05, 4.2564e-05, 0.0], [0.091641, 0.14158, 0.20729]),
    narasimhan("Sprite", [6.0306e-06, 6.4139e-06, 6.5504e-06], [0.001886, 0.0018308, 0.0020025]),
    narasimhan("Gatorade", [0.0024574, 0.003007, 0.0037325], [0.024794, 0.019289, 0.008878]),
    narasimhan("Chardonnay", [1.7982e-05, 1.3758e-05, 1.2023e-05], [0.010782, 0.011855, 0.023997]),
    narasimhan("White Zinfandel", [1.7501e-05, 1.9069e-05, 1.288e-05], [0.012072, 0.016184, 0.019843]),
    narasimhan("Merlot", [2.1129e-05, 0.0, 0.0], [0.11632, 0.25191, 0.29434]),
    narasimhan("Budweiser Beer", [2.4356e-05, 2.4079e-05, 1.0564e-05], [0.011492, 0.024911, 0.057786]),
    narasimhan("Coors Light Beer", [5.0922e-05, 4.301e-05, 0.0], [0.006164, 0.013984, 0.034983]),
    narasimhan("Clorox", [0.0024035, 0.0031373, 0.003991], [0.0033542, 0.014892, 0.026297]),
    narasimhan("Apple Juice", [0.00013612, 0.00015836, 0.000227], [0.012957, 0.023741, 0.052184]),
    narasimhan("Cranberry Juice", [0.00010402, 0.00011646, 7.8139e-05], [0.039437, 0.094223, 0.12426]),
    narasimhan("Grape Juice", [5.382e-05, 0.0, 0.0], [0.10404, 0.23958, 0.29325]),
    narasimhan("Ruby Grapefruit Juice", [0.011002, 0.010927, 0.011036], [0.085867, 0.18314, 0.25262]),
    narasimhan("White Grapefruit Juice", [0.22826, 0.23998, 0.32748], [0.0138, 0.018831, 0.056781]),
    narasimhan("Shampoo", [0.0007176, 0.0008303, 0.0009016], [0.014107, 0.045693, 0.061717]),
    narasimhan("Strawberry Shampoo", [0.00015671, 0.00015947, 1.518e-05], [0.01449, 0.05796, 0.075823]),
    narasimhan("Head & Shoulders Shampoo", [0.023805, 0.028804, 0.034306], [0.084621, 0.15688, 0.20365]),
    narasimhan("Lemon Tea Powder", [0.040224, 0.045264, 0.051081], [2.4288, 4.5757, 7.2127]),
    narasimhan("Orange Powder", [0.00015617, 0.00017482, 0.0001762], [0.001449, 0.003441, 0.007863]),
    narasimhan("Pink Lemonade Powder", [0.00012103, 0.00013073, 0.00012528], [0.001165, 0.002366, 0.003195]),
    narasimhan("Cappuccino Powder", [1.8436, 2.5851, 2.1662], [35.844, 49.547, 61.084]),
    narasimhan("Salt Powder", [0.027333, 0.032451, 0.031979], [0.28415, 0.3257, 0.34148]),
    narasimhan("Sugar Powder", [0.00022272, 0.00025513, 0.000271], [0.012638, 0.031051, 0.050124]),
    narasimhan("Suisse Mocha Powder", [2.7979, 3.5452, 4.3365], [17.502, 27.004, 35.433]),
    narasimhan("Pacific Ocean Surface Water", [0.0001764, 0.00032095, 0.00019617], [0.031845, 0.031324, 0.030147]),
];

/// Returns the decimal that an f32 was written as.
fn decimal(x: f32) -> f64 {
    x.to_string().parse().expect("digits of a number")
}

const fn anisotropic(name: &'static str, sigma_s: [f32; 3], g: [f32; 3]) -> Anisotropic {
    Anisotropic { name, sigma_s, g }
}

/// What \[Narasimhan2006\] measured of the scattering, for the materials at hand. sigma_s (1 - g) agrees with the reduced table within the digits of g.
pub const ANISOTROPIC: [Anisotropic; 16] = [
    anisotropic("Lowfat Milk", [13.1157, 15.4445, 17.9572], [0.932, 0.902, 0.859]),
    anisotropic("Reduced Milk", [13.7335, 15.6003, 17.8007], [0.819, 0.797, 0.746]),
    anisotropic("Regular Milk", [18.2052, 20.3826, 22.3698], [0.750, 0.714, 0.681]),
    anisotropic("Espresso", [7.78262, 8.13050, 8.53875], [0.907, 0.896, 0.880]),
    anisotropic("Mint Mocha Coffee", [3.51133, 4.14383, 5.59667], [0.910, 0.907, 0.914]),
    anisotropic("Lowfat Soy Milk", [2.03838, 2.32875, 3.90281], [0.850, 0.853, 0.842]),
    anisotropic("Regular Soy Milk", [4.66325, 5.20183, 8.74575], [0.873, 0.858, 0.832]),
    anisotropic("Lowfat Chocolate Milk", [9.83710, 11.4954, 13.1629], [0.934, 0.927, 0.916]),
    anisotropic("Regular Chocolate Milk", [10.5685, 13.1416, 15.2202], [0.862, 0.838, 0.806]),
    anisotropic("Coke", [0.00254, 0.00299, 0.0], [0.965, 0.972, 0.0]),
    anisotropic("Gatorade", [0.03668, 0.04488, 0.05742], [0.933, 0.933, 0.935]),
    anisotropic("White Grapefruit Juice", [0.50499, 0.52742, 0.75282], [0.548, 0.545, 0.565]),
    anisotropic("Ruby Grapefruit Juice", [0.15496, 0.15391, 0.15995], [0.929, 0.929, 0.931]),
    anisotropic("Head & Shoulders Shampoo", [0.26747, 0.27696, 0.29574], [0.911, 0.896, 0.884]),
    anisotropic("Cappuccino Powder", [12.2094, 16.4659, 29.2727], [0.849, 0.843, 0.926]),
    anisotropic("Pacific Ocean Surface Water", [0.00180, 0.00183, 0.00228], [0.902, 0.825, 0.914]),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inversion::AlbedoTable;

    #[test]
    fn reduced_coefficients_agree_with_the_anisotropic_measurements() {
        // Digits: g has three, so sigma_s (1 - g) is off by .0005 / (1 - g); sigma_s of the dilute ones has three as well.
        for a in &ANISOTROPIC {
            let m = find(a.name).unwrap();
            assert_eq!(m.anisotropic(), Some(a));
            for k in 0..3 {
                let reduced = a.sigma_s[k] * (1.0 - a.g[k]);
                let tolerance = 0.00055 / (1.0 - a.g[k]) + if a.sigma_s[k] < 0.1 { 0.002 } else { 0.0 };
                assert!(
                    (m.sigma_s_prime[k] - reduced).abs() <= tolerance * reduced,
                    "{} {k}: {} {reduced}",
                    a.name,
                    m.sigma_s_prime[k]
                );
            }
        }
    }

    #[test]
    fn properties_are_as_measured_where_that_is_known() {
        let milk = find("Regular Milk").unwrap().properties(0).unwrap();
        assert_eq!((milk.sigma_s(), milk.g(), milk.eta()), (18.2052, 0.75, 1.33));
        assert_eq!(find("Marble").unwrap().properties(2).unwrap().sigma_s(), 3.0);
    }

    #[test]
    fn albedos_agree_with_the_recomputed_ones() {
        // Exact albedo for normal incidence (physics notes, 8.6), three digits.
        let rows = [
            ("Apple", [0.855, 0.849, 0.537]),
            ("Chicken1", [0.307, 0.140, 0.111]),
            ("Chicken2", [0.315, 0.144, 0.093]),
            ("Cream", [0.977, 0.906, 0.737]),
            ("Ketchup", [0.148, 0.005, 0.002]),
            ("Marble", [0.838, 0.799, 0.761]),
            ("Potato", [0.775, 0.624, 0.198]),
            ("Skimmilk", [0.825, 0.823, 0.694]),
            ("Skin1", [0.439, 0.213, 0.115]),
            ("Skin2", [0.634, 0.437, 0.339]),
            ("Spectralon", [1.0, 1.0, 1.0]),
            ("Wholemilk", [0.913, 0.888, 0.771]),
        ];
        for (name, expected) in rows {
            let m = find(name).unwrap();
            let table = AlbedoTable::new(f64::from(m.eta), 0.0).unwrap();
            for (k, expected) in expected.into_iter().enumerate() {
                let (a, s) = (f64::from(m.sigma_a[k]), f64::from(m.sigma_s_prime[k]));
                assert!((table.albedo(s / (a + s)) - expected).abs() < 6e-4, "{name} {k}");
            }
        }
    }

    #[test]
    fn names_are_found_and_suggested() {
        assert_eq!(find("skimmilk").unwrap().name, "Skimmilk");
        assert_eq!(find("Whole milk").unwrap().name, "Wholemilk");
        let e = find("Marbel").unwrap_err();
        assert_eq!(e.to_string(), "unknown material \"Marbel\"; did you mean \"Marble\"?");
        assert!(MATERIALS.iter().all(|m| find(m.name).unwrap() == m && m.medium().g() == 0.0));
    }
}
