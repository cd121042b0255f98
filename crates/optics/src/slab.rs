//! Exact and asymptotic results for slabs and closed bodies, to validate simulations with.

/// Extrapolation length of Milne's problem in mean free paths (Hopf's constant): isotropic scattering, no absorption.
///
/// The ratio of the second to the first moment of H at alpha = 1 (test). *Source*: \[Chandrasekhar1960\].
pub const HOPF: f64 = 0.710_446_089_6;

/// H(1) of conservative isotropic scattering.
pub const H_CONSERVATIVE_NORMAL: f64 = 2.907_810_5;

/// Returns the transmittance for normal incidence of an index-matched, conservative, isotropically scattering slab of optical thickness tau.
///
/// T = (H(1) / sqrt 3) / (tau + 2 q), q = [`HOPF`]; unscattered light included. *Domain*: tau >= 5; the
/// corrections fall like exp(-tau). *Source*: Milne's problem at both faces \[Chandrasekhar1960\].
pub fn conservative_transmittance(tau: f64) -> f64 {
    H_CONSERVATIVE_NORMAL / 3f64.sqrt() / (tau + 2.0 * HOPF)
}

/// Returns the transmittance of the same slab for Lambertian light: (4/3) / (tau + 2 q). *Domain*: tau >= 5.
pub fn conservative_transmittance_diffuse(tau: f64) -> f64 {
    4.0 / 3.0 / (tau + 2.0 * HOPF)
}

/// Reflectance and transmittance (unscattered light included) of van de Hulst's slab: optical thickness 2, alpha = .9, Henyey-Greenstein
/// g = .75, index-matched, normal incidence. *Source*: van de Hulst 1980, table 35, as used to validate MCML.
pub const VAN_DE_HULST: (f64, f64) = (0.09739, 0.66096);

/// Returns the mean path length inside a closed body per ray that meets it, under uniform isotropic light: 4 eta^2 V / S \[L\].
///
/// Holds for any shape, index, phase function and density as long as nothing absorbs. *Source*: \[BlancoFournier2003\]; with a
/// refractive boundary the radiance inside is eta^2 times that outside.
pub fn mean_path_length(eta: f64, volume: f64, surface: f64) -> f64 {
    4.0 * eta * eta * volume / surface
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::halfspace::HFunction;
    use moonmilk_core::quadrature::Rule;

    #[test]
    fn the_constants_follow_from_h() {
        let h = HFunction::new(1.0).unwrap();
        assert!((h.eval(1.0) - H_CONSERVATIVE_NORMAL).abs() < 1e-7, "{}", h.eval(1.0));
        assert!((h.moment(2) / h.moment(1) - HOPF).abs() < 1e-8, "{}", h.moment(2) / h.moment(1));
        // Lambertian light is the mean of H(mu) / sqrt 3 over 2 mu dmu.
        let mean = Rule::gauss(48, 0.0, 1.0).integrate(|x| 2.0 * x * 2.0 * x * x * h.eval(x * x)) / 3f64.sqrt();
        assert!((mean - 4.0 / 3.0).abs() < 1e-8);
    }

    #[test]
    fn a_slab_of_ten_mean_free_paths_transmits_as_measured() {
        // Monte Carlo of the physics notes, 1.8: .1465 +- .0007; 4 standard errors.
        assert!((conservative_transmittance(10.0) - 0.1465).abs() < 4.0 * 0.0007);
        assert!((mean_path_length(1.0, 4.0 / 3.0, 4.0) - 4.0 / 3.0).abs() < 1e-15);
    }
}
