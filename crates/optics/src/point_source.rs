//! An isotropic point source in an infinite, isotropically scattering medium: exact, classical diffusion, and Grosjean's correction.
//!
//! | form | fluence of unit power at distance r |
//! |---|---|
//! | classical | $\phi = \dfrac{e^{-\kappa r}}{4\pi D r}$, the lecture's $\dfrac{3\sigma_t}{4\pi} \dfrac{e^{-\sqrt{3\sigma_a\sigma_t}\, r}}{r}$ |
//! | Grosjean 1956 | $\phi = \dfrac{e^{-\sigma_t r}}{4\pi r^2} + \alpha' \dfrac{e^{-\kappa_G r}}{4\pi D_G r}$ |
//! | exact | $\phi = \dfrac{1}{4\pi r}\left[ N e^{-\kappa_0 r} + \displaystyle\int_0^1 \frac{e^{-r/\mu} \mu^{-2}\, d\mu}{(1 - \alpha\mu\operatorname{artanh}\mu)^2 + (\pi\alpha\mu/2)^2} \right]$ for sigma_t = 1 |
//!
//! All integrate to 1 / sigma_a. The lecture's slide of Grosjean's correction has two faults: a minus between the terms (they add up: light that has not
//! collided, and light that has), and the classical monopole in place of alpha' times that of D_G.
//!
//! *Source*: \[Grosjean1956\], \[Case1953\], \[DEon2011\]; values by two independent forms (physics notes, 3.3).

use std::f64::consts::PI;

use moonmilk_core::Real;
use moonmilk_core::quadrature::Rule;

use crate::error::{Error, within};
use crate::profile::image::monopole_fluence;
use crate::properties::OpticalProperties;

/// Returns the fluence of classical diffusion \[1/L^2\]. *Domain*: r > 0.
///
/// 75 % too low at .1 mean free paths for every alpha, 8 to 35 % too high in the middle, 90 % too low at 10 for alpha = .3 (test).
pub fn classical<T: Real>(r: T, medium: &OpticalProperties<T>) -> T {
    monopole_fluence(r, medium.diffusion(), medium.sigma_tr())
}

/// Returns Grosjean's fluence \[1/L^2\]: uncollided light plus alpha' times the monopole of D_G. *Domain*: r > 0.
///
/// *Accuracy*: within 5 % of the exact solution to 3 mean free paths at every alpha, and to 10 at alpha >= .8; 23 % at 10 for alpha = .3 (test).
/// With anisotropic scattering the uncollided term keeps the true sigma_t (as photon beam diffusion does; other codes put sigma_t' there).
pub fn grosjean<T: Real>(r: T, medium: &OpticalProperties<T>) -> T {
    let uncollided = (-(medium.sigma_t() * r)).exp() / (r * r).scale(4.0 * PI);
    let diffuse = monopole_fluence(r, medium.diffusion_grosjean(), medium.sigma_tr_grosjean());
    uncollided + medium.alpha_prime() * diffuse
}

/// Returns the "correction" as a lecture's slide prints it \[1/L^2\]: uncollided light minus the classical monopole. Wrong, and kept to show how: negative beyond .3 mean
/// free paths for alpha = .9. *Domain*: r > 0.
pub fn grosjean_as_printed<T: Real>(r: T, medium: &OpticalProperties<T>) -> T {
    (-(medium.sigma_t() * r)).exp() / (r * r).scale(4.0 * PI) - classical(r, medium)
}

/// The exact solution for one single-scattering albedo, in units of the mean free path.
#[derive(Clone, Debug)]
pub struct Exact {
    kappa_0: f64,
    asymptotic: f64,
    /// (1 / mu, weight) of the continuous part.
    continuous: Vec<[f64; 2]>,
}

impl Exact {
    /// Returns the solution for a single-scattering albedo.
    ///
    /// *Errors*: alpha outside (0, 1).
    pub fn new(alpha: f64) -> Result<Self, Error> {
        within("alpha", alpha as f32, alpha > 0.0 && alpha < 1.0, "(0, 1)")?;
        let kappa_0 = diffusion_root(alpha);
        let k2 = kappa_0 * kappa_0;
        // kappa_0^2 - 1 + alpha cancels near alpha = 1 and the residue tends to 3: use -d(kappa_0^2)/d(alpha) in the form of the root's equation.
        let asymptotic = 2.0 * k2 * (1.0 - k2) / (alpha * (k2 - (1.0 - alpha)));
        // nu = 1 / mu from 1 to infinity; near 1 the artanh is logarithmic, at large nu exp(-nu r) cuts off: grade both.
        let mut breaks = vec![0.0];
        breaks.extend((0..=60).map(|i| 1e-9 * 2f64.powi(i)));
        let continuous = Rule::composite(10, &breaks)
            .iter()
            .map(|(x, w)| {
                // mu = 1 / (1 + x), d(mu) / mu^2 = dx, artanh mu = ln(1 + 2 / x) / 2.
                let mu = 1.0 / (1.0 + x);
                let a = 1.0 - alpha * mu * 0.5 * (2.0 / x).ln_1p();
                let b = 0.5 * PI * alpha * mu;
                [1.0 + x, w / (a * a + b * b)]
            })
            .collect();
        Ok(Self { kappa_0, asymptotic, continuous })
    }

    /// Returns the asymptotic attenuation per mean free path: the root of alpha artanh(kappa_0) = kappa_0.
    pub fn kappa_0(&self) -> f64 {
        self.kappa_0
    }

    /// Returns the fluence at an optical distance r in (0, 1e3] \[1/mfp^2\].
    pub fn fluence(&self, r: f64) -> f64 {
        let sum: f64 = self.continuous.iter().map(|[nu, w]| w * (-nu * r).exp()).sum();
        (self.asymptotic * (-self.kappa_0 * r).exp() + sum) / (4.0 * PI * r)
    }

    /// Returns the asymptotic term alone: right far from the source, 17 % low at one mean free path for alpha = .9.
    pub fn asymptotic(&self, r: f64) -> f64 {
        self.asymptotic * (-self.kappa_0 * r).exp() / (4.0 * PI * r)
    }
}

/// Returns the root kappa_0 in (0, 1) of alpha artanh(k) = k, by Newton steps on tau = artanh(k).
///
/// *Domain*: alpha in (0, 1). *Accuracy*: 1e-13 of 1 - kappa_0 or kappa_0, whichever is less.
pub fn diffusion_root(alpha: f64) -> f64 {
    // tanh(tau) / tau = alpha decreases in tau from 1 to 0: bisect, then polish.
    let (mut low, mut high) = (0.0, 1.0 / alpha);
    for _ in 0..200 {
        let tau = 0.5 * (low + high);
        if f64::tanh(tau) > alpha * tau { low = tau } else { high = tau }
    }
    f64::tanh(0.5 * (low + high))
}

/// Returns the published fit of [`diffusion_root`]: sqrt(1 - alpha^(2.4429445 + .5786368 / alpha - .0215813 alpha)).
///
/// *Accuracy*: 1e-4 for alpha in \[.2, .99\] (test). *Source*: d'Eon, as production renderers use it for guiding.
pub fn diffusion_root_fit(alpha: f64) -> f64 {
    (1.0 - alpha.powf(2.4429445 + 0.5786368 / alpha - 0.0215813 * alpha)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::table::radial_rule;

    /// (r; 4 pi r^2 phi for alpha .3, .6, .9, .99): physics notes, 3.3.
    const TABLE: [[f64; 5]; 9] = [
        [0.1, 0.964400, 1.033876, 1.120792, 1.157118],
        [0.2, 0.919650, 1.048736, 1.234243, 1.327903],
        [0.5, 0.770755, 1.025699, 1.516864, 1.870459],
        [1.0, 0.542036, 0.879822, 1.800558, 2.767047],
        [2.0, 0.243980, 0.532568, 1.866176, 4.271405],
        [3.0, 0.103592, 0.285435, 1.599200, 5.308021],
        [5.0, 0.017245, 0.069433, 0.915814, 6.233465],
        [7.0, 0.002719, 0.015076, 0.446757, 6.177362],
        [10.0, 0.000162, 0.001367, 0.131818, 5.259142],
    ];
    const ALPHAS: [f64; 4] = [0.3, 0.6, 0.9, 0.99];

    #[test]
    fn the_exact_solution_agrees_with_the_reference_table() {
        for (k, alpha) in ALPHAS.into_iter().enumerate() {
            let exact = Exact::new(alpha).unwrap();
            for row in TABLE {
                let value = 4.0 * PI * row[0] * row[0] * exact.fluence(row[0]);
                // Rounding of the table's last digit.
                assert!((value - row[k + 1]).abs() < 6e-7, "{alpha} {} {value}", row[0]);
            }
            let k0 = [0.9974138168920, 0.9073323166453, 0.5254295126580, 0.1725110699751][k];
            assert!((exact.kappa_0() - k0).abs() < 1e-12, "{alpha} {}", exact.kappa_0());
            // More digits: physics notes, 3.3.
            let one = [4.313383e-2, 7.001398e-2, 1.432839e-1, 2.201946e-1][k];
            let ten = [1.285295e-7, 1.087794e-6, 1.048972e-4, 4.185092e-3][k];
            assert!((exact.fluence(1.0) / one - 1.0).abs() < 1e-6, "{alpha}");
            assert!((exact.fluence(10.0) / ten - 1.0).abs() < 1e-6, "{alpha} {:e}", exact.fluence(10.0));
        }
    }

    #[test]
    fn every_form_integrates_to_the_mean_absorption_length() {
        for alpha in ALPHAS {
            let m = OpticalProperties::from_albedo(1.0, alpha, 0.0, 1.0).unwrap();
            let exact = Exact::new(alpha).unwrap();
            let forms: [&dyn Fn(f64) -> f64; 3] = [&|r| classical(r, &m), &|r| grosjean(r, &m), &|r| exact.fluence(r)];
            for (k, f) in forms.into_iter().enumerate() {
                let sum = radial_rule(1e-3, 300.0, 16).integrate(|r| 4.0 * PI * r * r * f(r));
                // Quadrature of smooth functions; the tail at kappa = .17 is e^(-51).
                assert!((sum * (1.0 - alpha) - 1.0).abs() < 1e-7, "{alpha} form {k}: {sum}");
            }
        }
    }

    #[test]
    fn the_errors_of_diffusion_are_the_published_ones() {
        // (alpha, largest error of Grosjean to r = 3, to r = 10): physics notes, 3.4, printed digits.
        for (alpha, near, far) in
            [(0.3, 0.028, 0.23), (0.5, 0.023, 0.14), (0.7, 0.009, 0.017), (0.9, 0.024, 0.024), (0.99, 0.049, 0.049)]
        {
            let m = OpticalProperties::from_albedo(1.0, alpha, 0.0, 1.0).unwrap();
            let exact = Exact::new(alpha).unwrap();
            let error = |r: f64| (grosjean(r, &m) / exact.fluence(r) - 1.0).abs();
            let worst = |last: i32| (1..=last).map(|i| error(0.05 * f64::from(i))).fold(0.0, f64::max);
            let digit = if far > 0.1 { 0.006 } else { 0.0006 };
            assert!(
                (worst(60) - near).abs() < 0.0006 && (worst(200) - far).abs() < digit,
                "{alpha} {} {}",
                worst(60),
                worst(200)
            );
            let low = classical(0.1, &m) / exact.fluence(0.1) - 1.0;
            assert!((-0.78..-0.68).contains(&low), "{alpha} {low}");
        }
        let (m, exact) = (OpticalProperties::from_albedo(1.0, 0.9, 0.0, 1.0).unwrap(), Exact::new(0.9).unwrap());
        assert!((exact.asymptotic(1.0) / exact.fluence(1.0) - 1.0 + 0.17).abs() < 0.006);
        // As the slide prints it, the "correction" is negative beyond .3 mean free paths.
        assert!(grosjean_as_printed(0.25, &m) > 0.0 && grosjean_as_printed(0.35, &m) < 0.0);
    }

    #[test]
    fn the_fit_of_the_root_has_its_stated_error() {
        for i in 20..=99 {
            let alpha = f64::from(i) / 100.0;
            assert!((diffusion_root_fit(alpha) / diffusion_root(alpha) - 1.0).abs() < 1e-4, "{alpha}");
        }
    }
}
