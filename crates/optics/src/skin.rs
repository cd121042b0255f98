//! Spectral skin: two layers whose colour comes from melanin and blood.
//!
//! Absorption over the wavelength lambda \[nm\], in 1/cm as its sources have it (the functions return 1/mm):
//!
//! | what | coefficient \[1/cm\] |
//! |---|---|
//! | bloodless, unpigmented tissue | $0.244 + 85.3\, e^{-(\lambda - 154)/66.2}$ |
//! | eumelanin (brown) | $6.6\cdot 10^{11}\, \lambda^{-3.33}$ |
//! | pheomelanin (red) | $2.9\cdot 10^{15}\, \lambda^{-4.75}$ |
//! | whole blood | $\ln 10\; \varepsilon(\lambda)\; \dfrac{150\ \mathrm{g/l}}{64500\ \mathrm{g/mol}}$, with the molar extinction of haemoglobin |
//! | reduced scattering of the epidermis | $147.4\, \lambda^{-0.22} + 2.2\cdot 10^{12}\, \lambda^{-4}$; half of it in the dermis |
//!
//! **Unit trap**: in 1/mm the same laws read 0.0244 + 8.53 e^..., 6.6e10, 2.9e14; public codes mix them. One public code has 2e12 for the Rayleigh
//! term; this is the paper's 2.2e12. *Source*: \[Donner2006\], \[Jacques1998\]; haemoglobin \[Prahl1999\], `data/haemoglobin.csv`, 380 to 780 nm.

use std::sync::LazyLock;

use crate::error::{Error, within};
use crate::properties::OpticalProperties;

/// The four parameters of skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Skin {
    /// Volume fraction of melanosomes in the epidermis: .001 (very light) to .5 (dark).
    pub melanin: f64,
    /// Share of eumelanin in the melanin.
    pub eumelanin: f64,
    /// Volume fraction of blood in the dermis: .001 to .1.
    pub blood: f64,
    /// Share of oxygenated haemoglobin, about .75.
    pub oxygenation: f64,
}

/// Index of refraction of skin over air. *Source*: \[Donner2006\].
pub const ETA: f64 = 1.4;

/// Shortest and longest wavelength of the haemoglobin table \[nm\].
pub const RANGE_NM: (f64, f64) = (380.0, 780.0);

/// Rows (wavelength, oxygenated, deoxygenated) of the shipped table.
static HAEMOGLOBIN: LazyLock<Vec<[f64; 3]>> = LazyLock::new(|| {
    include_str!("../data/haemoglobin.csv")
        .lines()
        .filter(|l| !l.starts_with('#'))
        .map(|l| {
            let mut fields = l.split(',').map(|f| f.parse().expect("the shipped table holds numbers"));
            std::array::from_fn(|_| fields.next().expect("three columns"))
        })
        .collect()
});

impl Skin {
    /// Returns the skin of four fractions.
    ///
    /// *Errors*: a fraction outside \[0, 1\].
    pub fn new(melanin: f64, eumelanin: f64, blood: f64, oxygenation: f64) -> Result<Self, Error> {
        let named = [("melanin", melanin), ("eumelanin", eumelanin), ("blood", blood), ("oxygenation", oxygenation)];
        for (name, x) in named {
            within(name, x as f32, (0.0..=1.0).contains(&x), "[0, 1]")?;
        }
        Ok(Self { melanin, eumelanin, blood, oxygenation })
    }

    /// Returns the absorption coefficient of the epidermis \[1/mm\].
    pub fn epidermis_sigma_a(&self, wavelength_nm: f64) -> f64 {
        let l = wavelength_nm;
        let melanin = self.eumelanin * 6.6e11 * l.powf(-3.33) + (1.0 - self.eumelanin) * 2.9e15 * l.powf(-4.75);
        0.1 * (self.melanin * melanin + (1.0 - self.melanin) * baseline(l))
    }

    /// Returns the absorption coefficient of the dermis \[1/mm\].
    ///
    /// *Errors*: a wavelength outside [`RANGE_NM`].
    pub fn dermis_sigma_a(&self, wavelength_nm: f64) -> Result<f64, Error> {
        let blood = blood_sigma_a(wavelength_nm, self.oxygenation)?;
        Ok(0.1 * (self.blood * blood + (1.0 - self.blood) * baseline(wavelength_nm)))
    }

    /// Returns epidermis and dermis as optical properties in 1/mm, isotropically scattering, behind a boundary of index 1.4.
    ///
    /// *Errors*: a wavelength outside [`RANGE_NM`].
    pub fn layers(&self, wavelength_nm: f64) -> Result<[OpticalProperties; 2], Error> {
        let s = epidermis_sigma_s_prime(wavelength_nm);
        Ok([
            OpticalProperties::new(self.epidermis_sigma_a(wavelength_nm), s, 0.0, ETA)?,
            OpticalProperties::new(self.dermis_sigma_a(wavelength_nm)?, 0.5 * s, 0.0, ETA)?,
        ])
    }
}

/// Returns the absorption of tissue without blood and pigment \[1/cm\].
fn baseline(wavelength_nm: f64) -> f64 {
    0.244 + 85.3 * (-(wavelength_nm - 154.0) / 66.2).exp()
}

/// Returns the absorption of whole blood \[1/cm\].
fn blood_sigma_a(wavelength_nm: f64, oxygenation: f64) -> Result<f64, Error> {
    let (first, last) = RANGE_NM;
    within("wavelength_nm", wavelength_nm as f32, (first..=last).contains(&wavelength_nm), "[380, 780]")?;
    let x = (wavelength_nm - first) / 2.0;
    let i = (x as usize).min(HAEMOGLOBIN.len() - 2);
    let t = x - i as f64;
    let at = |k: usize| (1.0 - t) * HAEMOGLOBIN[i][k] + t * HAEMOGLOBIN[i + 1][k];
    let extinction = oxygenation * at(1) + (1.0 - oxygenation) * at(2);
    Ok(std::f64::consts::LN_10 * extinction * 150.0 / 64_500.0)
}

/// Returns the reduced scattering coefficient of the epidermis \[1/mm\]; that of the dermis is half of it.
pub fn epidermis_sigma_s_prime(wavelength_nm: f64) -> f64 {
    0.1 * (147.4 * wavelength_nm.powf(-0.22) + 2.2e12 * wavelength_nm.powi(-4))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::halfspace::{Illumination, exact_albedo};

    #[test]
    fn coefficients_agree_with_their_sources() {
        // Physics notes, 5.13: molar extinctions at 500, 600, 650 and 700 nm; blood = 2.303 e 150 / 64500.
        for (l, oxy, deoxy) in
            [(500.0, 20_932.8, 20_862.0), (600.0, 3200.0, 14_677.2), (650.0, 368.0, 3750.12), (700.0, 290.0, 1794.28)]
        {
            assert!((blood_sigma_a(l, 1.0).unwrap() - std::f64::consts::LN_10 * oxy * 150.0 / 64_500.0).abs() < 1e-3);
            assert!((blood_sigma_a(l, 0.0).unwrap() - std::f64::consts::LN_10 * deoxy * 150.0 / 64_500.0).abs() < 1e-3);
        }
        // In 1/mm: .0244 + 8.53 e^..., melanin 6.6e10 lambda^-3.33, scattering 14.74 lambda^-.22 + 2.2e11 lambda^-4.
        let dark = Skin::new(1.0, 1.0, 0.0, 0.75).unwrap();
        assert!((dark.epidermis_sigma_a(550.0) / (6.6e10 * 550f64.powf(-3.33)) - 1.0).abs() < 1e-12);
        let bare = Skin::new(0.0, 1.0, 0.0, 0.75).unwrap();
        let base = 0.0244 + 8.53 * (-(550.0f64 - 154.0) / 66.2).exp();
        assert!(
            (bare.epidermis_sigma_a(550.0) - base).abs() < 1e-12
                && (bare.dermis_sigma_a(550.0).unwrap() - base).abs() < 1e-12
        );
        assert!(
            (epidermis_sigma_s_prime(550.0) - (14.74 * 550f64.powf(-0.22) + 2.2e11 * 550f64.powi(-4))).abs() < 1e-12
        );
        assert_eq!(HAEMOGLOBIN.len(), 201);
    }

    #[test]
    fn blood_makes_the_dermis_red_and_melanin_makes_the_epidermis_dark() {
        let skin = Skin::new(0.02, 0.7, 0.02, 0.75).unwrap();
        let albedo = |l: f64| exact_albedo(&skin.layers(l).unwrap()[1], Illumination::Normal).unwrap();
        assert!(albedo(650.0) > albedo(460.0) && albedo(460.0) > albedo(415.0));
        assert!(Skin { melanin: 0.3, ..skin }.epidermis_sigma_a(500.0) > 5.0 * skin.epidermis_sigma_a(500.0));
        assert_eq!(skin.layers(900.0).unwrap_err().to_string(), "wavelength_nm = 900 is outside [380, 780]");
        assert_eq!(Skin::new(1.5, 0.5, 0.1, 0.7).unwrap_err().to_string(), "melanin = 1.5 is outside [0, 1]");
    }
}
