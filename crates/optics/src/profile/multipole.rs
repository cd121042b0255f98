//! Slabs: rows of images between two boundaries, and stacks of slabs.
//!
//! A source at depth $z_s$ in a slab of thickness d, extrapolated boundaries at $-z_0$ and $d + z_d$ ($z = 2 A D$ of each side), $L = d + z_0 + z_d$. Over the surface's wave number k,
//! with $\gamma = \sqrt{\kappa^2 + k^2}$, the row of images has a closed sum (the Hankel transform of the fluence):
//!
//! $$ \hat\phi(z) = \frac{\sinh \gamma (z_< + z_0)\; \sinh \gamma (d + z_d - z_>)}{D \gamma \sinh \gamma L} $$
//!
//! At k = 0 it is the total, at any k it is what stacks combine ([`add`]); at radius r it is a sum over images near the source and over modes, $\sin(m\pi(z+z_0)/L)\, K_0(r\gamma_m)$, far
//! from it. Both are used here, each where it converges.
//!
//! | model | source | exitance |
//! |---|---|---|
//! | `multipole` | $\alpha'^2 \sigma_t' e^{-\sigma_t' z}$ along the beam, D_G; exact single scattering | $C_\phi \phi + C_E E$ |
//! | `multipole-as-published` \[Donner2005\] | one point at the depth 1 / sigma_t', D; alpha'; A by the classic dipole's fit | flux |
//!
//! **Measured** (normal incidence, isotropic, alpha .99): as published is within 3 % at d = 5 and fails for slabs thinner than 1 / sigma_t': its source lies
//! outside, T < 0. The extended source gives R 8 to 55 % too large and T -15 to +55 %, worst in thin matched slabs, best at eta 1.5; it never turns negative. On a half-space `multipole` is quantized diffusion. Unscattered light is not part of R and T.
//!
//! **Stacks** combine in the transform of the *plane* (a one-dimensional convolution of radial profiles, as some codes do, is wrong). Diffusion is not closed under splitting: two
//! halves glued differ from the whole by 2 % in R and 7 % in T (test). *Source*: \[Donner2005\], \[Contini1997\].

use std::f64::consts::PI;

use moonmilk_core::quadrature::Rule;

use crate::boundary::Boundary;
use crate::error::{Error, within};
use crate::properties::OpticalProperties;

use super::dipole::{Dipole, diffuse_reflectance_fit};
use super::image::{monopole_fluence, monopole_flux};
use super::quantized::Quantized;
use super::single::{henyey_greenstein, transmitted};
use super::table::growing_breaks;
use super::{Info, Kind};

/// Description of the model with an extended source.
pub const INFO: Info = Info {
    name: "multipole",
    summary: "slabs by rows of images along the beam, exact single scattering; on a half-space as quantized",
    source: "Donner2005",
    kind: Kind::Whole,
    valid: "slabs of any thickness, never negative; R +8 to +55 %, T -15 to +55 %, best at eta 1.5 and thick slabs",
    use_when: "for leaves, sheets and layers of skin",
    avoid_when: "where no energy may be gained",
};

/// Description of the published model.
pub const AS_PUBLISHED: Info = Info {
    name: "multipole-as-published",
    summary: "slabs by a row of point sources, flux as exitance; on a half-space a dipole",
    source: "Donner2005",
    kind: Kind::Whole,
    valid: "slabs of 5 reduced mean free paths or more: R and T within 3 % at alpha = .99; negative T below one",
    use_when: "to compare with other programs",
    avoid_when: "for slabs thinner than two mean free paths",
};

/// The published model on a half-space: the classic dipole, with its fit of the boundary factor.
pub type AsPublished<T = f64> = Dipole<T>;

/// The extended-source model on a half-space: quantized diffusion.
pub type HalfSpace<T = f64> = Quantized<T>;

/// Which source a slab has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// Along the beam, with exact single scattering.
    Extended,
    /// One point, as published.
    Point,
}

/// A slab of one medium between two boundaries of the same outside.
#[derive(Clone, Copy, Debug)]
pub struct Slab {
    medium: OpticalProperties,
    thickness: f64,
    source: Source,
    diffusion: f64,
    kappa: f64,
    amplitude: f64,
    boundary: Boundary,
    /// Extrapolation distance on both sides.
    z_e: f64,
}

/// Light that comes back and light that goes through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exitance {
    /// On the side where the light enters.
    pub reflected: f64,
    /// On the other side.
    pub transmitted: f64,
}

/// Fluence and upward flux.
type PhiFlux = (f64, f64);

impl Slab {
    /// Returns the slab of a thickness \[L\].
    ///
    /// *Errors*: a thickness that is not positive and finite; no scattering.
    pub fn new(medium: &OpticalProperties, thickness: f64, source: Source) -> Result<Self, Error> {
        within("thickness", thickness as f32, thickness > 0.0 && thickness.is_finite(), "(0, inf)")?;
        within("sigma_s", medium.sigma_s() as f32, medium.sigma_s() > 0.0, "(0, inf)")?;
        let eta = medium.eta();
        let exact = Boundary::exact(eta);
        let (diffusion, kappa, amplitude, boundary) = match source {
            Source::Extended => {
                (medium.diffusion_grosjean(), medium.sigma_tr_grosjean(), medium.alpha_prime().powi(2), exact)
            }
            Source::Point => {
                let flux_alone = Boundary { two_c1: 1.0, three_c2: -1.0 };
                (medium.diffusion(), medium.sigma_tr(), medium.alpha_prime(), flux_alone)
            }
        };
        let z_e = match source {
            Source::Extended => exact.extrapolation(diffusion),
            Source::Point => {
                within("eta", eta as f32, (0.5..=3.0).contains(&eta), "[0.5, 3], where the fit of its boundary holds")?;
                let f = diffuse_reflectance_fit(eta);
                2.0 * (1.0 + f) / (1.0 - f) * diffusion
            }
        };
        Ok(Self { medium: *medium, thickness, source, diffusion, kappa, amplitude, boundary, z_e })
    }

    /// Returns the thickness between the extrapolated boundaries.
    fn extrapolated(&self) -> f64 {
        self.thickness + 2.0 * self.z_e
    }

    /// Returns transformed fluence and upward flux at depth z of a source at z_s.
    fn transform(&self, k: f64, z: f64, z_s: f64) -> PhiFlux {
        let (gamma, length) = (self.kappa.hypot(k).max(1e-9 / self.extrapolated()), self.extrapolated());
        // sinh and cosh over e^(gamma length / 2), so that nothing overflows: everything is a product of two over one.
        let sinh = |x: f64| 0.5 * (1.0 - (-2.0 * gamma * x).exp());
        let cosh = |x: f64| 0.5 * (1.0 + (-2.0 * gamma * x).exp());
        let (low, high) = (z.min(z_s) + self.z_e, length - z.max(z_s) - self.z_e);
        let common = (gamma * (low + high - length)).exp() / sinh(length);
        let phi = sinh(low) * sinh(high) * common / (self.diffusion * gamma);
        // D dphi/dz, the flux towards smaller z; a source in the face itself sends half of its light to either side.
        let (up, down) = (cosh(low) * sinh(high) * common, -sinh(low) * cosh(high) * common);
        let flux = match z.total_cmp(&z_s) {
            std::cmp::Ordering::Less => up,
            std::cmp::Ordering::Equal => 0.5 * (up + down),
            std::cmp::Ordering::Greater => down,
        };
        (phi, flux)
    }

    /// Returns fluence and upward flux at depth z and radius r of a source at z_s, by images near the axis.
    fn images(&self, r: f64, z: f64, z_s: f64) -> PhiFlux {
        let period = 2.0 * self.extrapolated();
        let (mut phi, mut flux) = (0.0, 0.0);
        for i in -IMAGES..=IMAGES {
            let z_r = f64::from(i) * period + z_s - z;
            let z_v = f64::from(i) * period - z_s - 2.0 * self.z_e - z;
            let (d_r, d_v) = (r.hypot(z_r), r.hypot(z_v));
            phi +=
                monopole_fluence(d_r, self.diffusion, self.kappa) - monopole_fluence(d_v, self.diffusion, self.kappa);
            flux += monopole_flux(z_r, d_r, self.kappa) - monopole_flux(z_v, d_v, self.kappa);
        }
        (phi, flux)
    }

    /// Returns fluence and upward flux of the whole source by modes, for radii far from the axis.
    fn modes(&self, r: f64, z: f64) -> PhiFlux {
        let (length, sigma, d) = (self.extrapolated(), self.medium.sigma_t_prime(), self.thickness);
        let (mut phi, mut flux) = (0.0, 0.0);
        for m in 1..=MODES {
            let k = f64::from(m) * PI / length;
            let k0 = bessel_k0(r * self.kappa.hypot(k));
            let source = match self.source {
                Source::Point => (k * (1.0 / sigma + self.z_e)).sin(),
                // The integral of sigma e^(-sigma z) sin(k (z + z_e)) through the slab.
                Source::Extended => {
                    let part = |z: f64| {
                        let (s, c) = (k * (z + self.z_e)).sin_cos();
                        (-sigma * z).exp() * (sigma * s + k * c)
                    };
                    sigma / (sigma * sigma + k * k) * (part(0.0) - part(d))
                }
            };
            let (s, c) = (k * (z + self.z_e)).sin_cos();
            phi += source * s * k0 / (PI * self.diffusion * length);
            flux += source * c * k * k0 / (PI * length);
        }
        (phi, flux)
    }

    /// Combines fields at the two faces to exitances.
    fn exitance(&self, top: PhiFlux, bottom: PhiFlux) -> Exitance {
        Exitance {
            reflected: self.amplitude * self.boundary.exitance(top.0, top.1),
            transmitted: self.amplitude * self.boundary.exitance(bottom.0, -bottom.1),
        }
    }

    /// Returns exitances at radius r \[1/L^2\]; r is measured from the axis of the beam on both faces.
    ///
    /// *Accuracy*: 1e-4 against the totals (test).
    pub fn eval(&self, r: f64) -> Exitance {
        let (d, sigma) = (self.thickness, self.medium.sigma_t_prime());
        if r > 0.25 * self.extrapolated() {
            let far = self.exitance(self.modes(r, 0.0), self.modes(r, d));
            return far + self.single(r);
        }
        match self.source {
            Source::Point => self.exitance(self.images(r, 0.0, 1.0 / sigma), self.images(r, d, 1.0 / sigma)),
            Source::Extended => {
                // Resolve the radius at both faces and the mean free path along the beam.
                let mut breaks = growing_breaks(r.min(1.0 / sigma), 0.5 * d);
                breaks.extend(growing_breaks(r, 0.5 * d).into_iter().rev().skip(1).map(|b| d - b));
                let mut sum = Exitance { reflected: 0.0, transmitted: 0.0 };
                for (z, w) in Rule::composite(10, &breaks).iter() {
                    let e = self.exitance(self.images(r, 0.0, z), self.images(r, d, z));
                    sum = sum + e * (w * sigma * (-sigma * z).exp());
                }
                sum + self.single(r)
            }
        }
    }

    /// Returns total reflectance and transmittance of entered light, without what is not scattered.
    pub fn total(&self) -> Exitance {
        self.hankel(0.0) + self.single_total()
    }

    /// Returns the transform at wave number k \[1/L\] of the multiple-scattering part: the integral of its exitance times J_0(k r) over the surface.
    pub fn hankel(&self, k: f64) -> Exitance {
        let (d, sigma) = (self.thickness, self.medium.sigma_t_prime());
        let at = |z: f64| self.exitance(self.transform(k, 0.0, z), self.transform(k, d, z));
        match self.source {
            Source::Point => at(1.0 / sigma),
            Source::Extended => {
                let scale = 1.0 / sigma.max(k);
                let mut breaks = growing_breaks(scale, 0.5 * d);
                breaks.extend(growing_breaks(scale, 0.5 * d).into_iter().rev().skip(1).map(|b| d - b));
                Rule::composite(10, &breaks)
                    .iter()
                    .fold(Exitance { reflected: 0.0, transmitted: 0.0 }, |sum, (z, w)| {
                        sum + at(z) * (w * sigma * (-sigma * z).exp())
                    })
            }
        }
    }

    /// Single scattering at radius r; none for the published model. Light reflected inside before or after it is left out.
    fn single(&self, r: f64) -> Exitance {
        let none = Exitance { reflected: 0.0, transmitted: 0.0 };
        if self.source == Source::Point {
            return none;
        }
        let (m, d) = (&self.medium, self.thickness);
        let (sigma_t, eta) = (m.sigma_t(), m.eta());
        let critical = if eta > 1.0 { r * (eta * eta - 1.0).sqrt() } else { 0.0 };
        if critical >= d {
            return none;
        }
        // h is the distance from the scattering point to the face that the light leaves by.
        let sum = |g_sign: f64, beam: &dyn Fn(f64) -> f64| {
            let breaks = growing_breaks(r.min(1.0 / sigma_t).sqrt(), (d - critical).sqrt());
            m.sigma_s()
                * Rule::composite(10, &breaks).integrate(|w| {
                    let h = critical + w * w;
                    let s = r.hypot(h);
                    let cos = h / s;
                    let phase = henyey_greenstein(g_sign * cos, m.g());
                    2.0 * w * (-sigma_t * (beam(h) + s)).exp() * phase * transmitted(cos, eta) * cos / (s * s)
                })
        };
        Exitance { reflected: sum(-1.0, &|h| h), transmitted: sum(1.0, &|h| d - h) }
    }

    fn single_total(&self) -> Exitance {
        if self.source == Source::Point {
            return Exitance { reflected: 0.0, transmitted: 0.0 };
        }
        let m = &self.medium;
        let (tau, eta) = (m.sigma_t() * self.thickness, m.eta());
        let critical2 = (1.0 - 1.0 / (eta * eta)).max(0.0);
        let end = (1.0 - critical2).sqrt();
        let mut sum = Exitance { reflected: 0.0, transmitted: 0.0 };
        for (x, w) in Rule::composite(16, &growing_breaks(0.05, 1.0)).iter() {
            let t = end * x;
            let mu = (critical2 + t * t).sqrt();
            let weight = w * end * t / mu * 2.0 * PI * transmitted(mu, eta) * m.alpha();
            let (up, down) = (1.0 + 1.0 / mu, 1.0 / mu - 1.0);
            let through = if down * tau < 1e-9 { tau } else { -(-down * tau).exp_m1() / down };
            sum = sum
                + Exitance {
                    reflected: weight * henyey_greenstein(-mu, m.g()) * -(-up * tau).exp_m1() / up,
                    transmitted: weight * henyey_greenstein(mu, m.g()) * (-tau).exp() * through,
                };
        }
        sum
    }
}

/// Images on either side: the rest falls like 1 / n^2 and is below 1e-5 for radii below a quarter of the slab.
const IMAGES: i32 = 60;
/// Modes: beyond a quarter of the slab's thickness they fall like e^(-m pi / 4).
const MODES: u32 = 48;

impl std::ops::Add for Exitance {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self { reflected: self.reflected + o.reflected, transmitted: self.transmitted + o.transmitted }
    }
}

impl std::ops::Mul<f64> for Exitance {
    type Output = Self;
    fn mul(self, k: f64) -> Self {
        Self { reflected: self.reflected * k, transmitted: self.transmitted * k }
    }
}

/// Returns the transform of two layers, from those of each at the same wave number: all inter-reflections summed.
///
/// R = R_1 + T_1^2 R_2 / (1 - R_1 R_2), T = T_1 T_2 / (1 - R_1 R_2), for layers that look the same from both sides. *Source*: \[Donner2005\].
pub fn add(upper: Exitance, lower: Exitance) -> Exitance {
    let loop_gain = 1.0 / (1.0 - upper.reflected * lower.reflected);
    Exitance {
        reflected: upper.reflected + upper.transmitted * upper.transmitted * lower.reflected * loop_gain,
        transmitted: upper.transmitted * lower.transmitted * loop_gain,
    }
}

/// Returns the exitances at radius r of a stack of slabs, uppermost first, by the inverse transform of their combined row.
///
/// *Domain*: point sources (the transform of an extended source falls too slowly); r up to some 100 lengths. *Accuracy*: 1e-5 of the value at the axis.
///
/// *Errors*: no slab, or one with an extended source.
pub fn stack(slabs: &[Slab], r: f64) -> Result<Exitance, Error> {
    let extended = slabs.iter().filter(|s| s.source == Source::Extended).count();
    within("number of slabs", slabs.len() as f32, !slabs.is_empty(), "[1, inf)")?;
    within("number of extended sources", extended as f32, extended == 0, "[0, 0]")?;
    // e^(-k z) of the shallowest source ends the integral; J_0 turns every pi / r.
    let depth = slabs.iter().map(|s| 1.0 / s.medium.sigma_t_prime()).fold(f64::INFINITY, f64::min);
    let end = 25.0 / depth;
    let step = (0.25 / depth).min(PI / r.max(1e-9));
    let cells = (end / step).ceil() as usize;
    let breaks: Vec<f64> = (0..=cells).map(|i| end * i as f64 / cells as f64).collect();
    let zero = Exitance { reflected: 0.0, transmitted: 0.0 };
    Ok(Rule::composite(8, &breaks).iter().fold(zero, |sum, (k, w)| {
        let layers = slabs[1..].iter().fold(slabs[0].hankel(k), |upper, s| add(upper, s.hankel(k)));
        sum + layers * (w * k * bessel_j0(k * r) / (2.0 * PI))
    }))
}

/// Returns the Bessel function J_0: the mean of cos(x sin t), by the trapezoidal rule, which is exact for periodic functions up to rounding.
fn bessel_j0(x: f64) -> f64 {
    let n = 24 + (0.6 * x.abs()) as usize;
    (0..n).map(|i| (x * (PI * (i as f64 + 0.5) / n as f64).sin()).cos()).sum::<f64>() / n as f64
}

/// Returns the modified Bessel function K_0 for x > 0: the integral of e^(-x cosh t), whose ends fall doubly exponentially.
fn bessel_k0(x: f64) -> f64 {
    let h = 0.1;
    let last = ((1.0 + 45.0 / x).acosh() / h).ceil() as i32;
    h * (0.5 * (-x).exp() + (1..=last).map(|i| (-x * (h * f64::from(i)).cosh()).exp()).sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::RadialModel;
    use crate::profile::table::radial_rule;

    fn slab(eta: f64, d: f64, alpha: f64, source: Source) -> Slab {
        Slab::new(&OpticalProperties::from_albedo(1.0, alpha, 0.0, eta).unwrap(), d, source).unwrap()
    }

    #[test]
    fn totals_agree_with_the_reference_table() {
        // (eta, d, alpha; point R, T; extended and single R, T): physics notes, 5.12, three digits.
        for (eta, d, alpha, point, extended) in [
            (1.0, 0.5, 0.99, [0.090, -0.091], [0.309, 0.291]),
            (1.0, 1.0, 0.9, [0.217, 0.156], [0.368, 0.303]),
            (1.0, 1.0, 0.99, [0.278, 0.207], [0.468, 0.389]),
            (1.0, 2.0, 0.9, [0.332, 0.332], [0.466, 0.264]),
            (1.0, 2.0, 0.99, [0.478, 0.478], [0.640, 0.393]),
            (1.0, 5.0, 0.9, [0.384, 0.063], [0.516, 0.073]),
            (1.0, 5.0, 0.99, [0.674, 0.219], [0.826, 0.220]),
            (1.5, 0.5, 0.99, [0.353, -0.367], [0.218, 0.214]),
            (1.5, 1.0, 0.9, [0.260, 0.017], [0.199, 0.178]),
            (1.5, 2.0, 0.99, [0.454, 0.454], [0.468, 0.366]),
            (1.5, 5.0, 0.9, [0.274, 0.052], [0.255, 0.046]),
            (1.5, 5.0, 0.99, [0.540, 0.256], [0.581, 0.245]),
        ] {
            for (source, [r, t]) in [(Source::Point, point), (Source::Extended, extended)] {
                let e = slab(eta, d, alpha, source).total();
                // The reference cuts its row of point images after ten: .09026 where the whole row has .08911, in the thinnest matched slab.
                let digit = if source == Source::Point && d < 1.0 && eta == 1.0 { 1.3e-3 } else { 6e-4 };
                assert!((e.reflected - r).abs() < digit, "{eta} {d} {alpha} {source:?} {e:?}");
                assert!((e.transmitted - t).abs() < digit, "{eta} {d} {alpha} {source:?} {e:?}");
            }
        }
    }

    #[test]
    fn profiles_integrate_to_their_totals_across_both_series() {
        for (eta, d, alpha) in [(1.0, 2.0, 0.9), (1.4, 5.0, 0.99), (1.33, 1.5, 1.0)] {
            for source in [Source::Point, Source::Extended] {
                let s = slab(eta, d, alpha, source);
                let zero = Exitance { reflected: 0.0, transmitted: 0.0 };
                let sum =
                    radial_rule(1e-3, 100.0, 8).iter().fold(zero, |sum, (r, w)| sum + s.eval(r) * (2.0 * PI * r * w));
                let total = s.total();
                assert!((sum.reflected / total.reflected - 1.0).abs() < 1e-3, "{eta} {d} {source:?} {sum:?} {total:?}");
                assert!(
                    (sum.transmitted / total.transmitted - 1.0).abs() < 1e-3,
                    "{eta} {d} {source:?} {sum:?} {total:?}"
                );
                // Images and modes agree where they meet.
                let r = 0.25 * s.extrapolated();
                let (a, b) = (s.eval(r * 0.999_999), s.eval(r * 1.000_001));
                assert!(
                    (a.reflected / b.reflected - 1.0).abs() < 1e-3
                        && (a.transmitted / b.transmitted - 1.0).abs() < 1e-3,
                    "{a:?} {b:?}"
                );
            }
        }
    }

    #[test]
    fn a_thick_slab_is_a_half_space() {
        let m = OpticalProperties::from_albedo(1.0, 0.9, 0.0, 1.33).unwrap();
        let (thick, half) = (Slab::new(&m, 60.0, Source::Extended).unwrap(), HalfSpace::new(&m).unwrap());
        assert!((thick.total().reflected / half.total() - 1.0).abs() < 1e-9);
        for r in [0.1, 1.0, 5.0] {
            assert!((thick.eval(r).reflected / half.eval(r) - 1.0).abs() < 1e-5, "{r}");
        }
        let (thick, half) = (Slab::new(&m, 60.0, Source::Point).unwrap(), AsPublished::new(&m).unwrap());
        assert!((thick.total().reflected / half.total() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn glued_halves_differ_from_the_whole_as_measured() {
        // Physics notes, 5.12: glued R, T; whole R, T.
        for (d, glued, whole) in [(10.0, [0.7328, 0.0880], [0.7350, 0.0836]), (5.0, [0.6621, 0.2344], [0.6735, 0.2192])]
        {
            let half = slab(1.0, 0.5 * d, 0.99, Source::Point);
            let (g, w) = (add(half.total(), half.total()), slab(1.0, d, 0.99, Source::Point).total());
            assert!((g.reflected - glued[0]).abs() < 6e-5 && (g.transmitted - glued[1]).abs() < 6e-5, "{g:?}");
            assert!((w.reflected - whole[0]).abs() < 6e-5 && (w.transmitted - whole[1]).abs() < 6e-5, "{w:?}");
        }
        // One slab through the transform is the slab itself.
        let s = slab(1.4, 5.0, 0.95, Source::Point);
        for r in [0.2, 1.0, 4.0] {
            let (a, b) = (stack(&[s], r).unwrap(), s.eval(r));
            assert!(
                (a.reflected - b.reflected).abs() < 1e-5 && (a.transmitted - b.transmitted).abs() < 1e-5,
                "{r} {a:?} {b:?}"
            );
        }
        assert!(stack(&[], 1.0).is_err() && stack(&[slab(1.0, 1.0, 0.9, Source::Extended)], 1.0).is_err());
        let m = OpticalProperties::new(0.1, 1.0, 0.0, 1.3).unwrap();
        assert_eq!(Slab::new(&m, 0.0, Source::Point).unwrap_err().to_string(), "thickness = 0 is outside (0, inf)");
    }

    #[test]
    fn bessel_functions_have_their_tabulated_values() {
        for (x, j) in [
            (0.0, 1.0),
            (1.0, 0.765_197_686_557_966_6),
            (10.0, -0.245_935_764_451_348_33),
            (50.0, 0.055_812_327_669_251_82),
        ] {
            assert!((bessel_j0(x) - j).abs() < 1e-12, "{x} {}", bessel_j0(x));
        }
        for (x, k) in [(0.1, 2.427_069_024_702_017), (1.0, 0.421_024_438_240_708_3), (10.0, 1.778_006_231_616_765e-5)] {
            assert!((bessel_k0(x) / k - 1.0).abs() < 1e-12, "{x} {}", bessel_k0(x));
        }
    }
}
