//! Phase functions in f64, by name: values, exact inversion sampling, Legendre moments.
//!
//! All are densities per steradian over the cosine of the deflection (forward = +1) and integrate to 1 over the sphere, so that sampling has weight 1 and the density of a
//! sample is the value.
//!
//! | function | value times 4 pi | mean cosine |
//! |---|---|---|
//! | isotropic | 1 | 0 |
//! | Henyey-Greenstein \[Henyey1941\] | $(1-g^2)(1+g^2-2g\mu)^{-3/2}$ | g |
//! | two lobes | $w\, HG(g_1) + (1-w)\, HG(g_2)$ | $w g_1 + (1-w) g_2$ |
//! | Rayleigh | $\tfrac34 (1 + \mu^2)$ | 0 |
//! | Cornette-Shanks \[Cornette1992\] | $\tfrac32 \frac{(1-g^2)(1+\mu^2)}{(2+g^2)(1+g^2-2g\mu)^{3/2}}$ | $\frac{3g(4+g^2)}{5(2+g^2)}$ |
//! | von Mises-Fisher \[Fisher1953\] | $\frac{\kappa}{\sinh\kappa} e^{\kappa\mu}$ | $\coth\kappa - 1/\kappa$ |
//! | tabulated | linear between nodes | |

use std::f64::consts::PI;

use moonmilk_core::quadrature::Rule;

use crate::error::{Error, ErrorKind, within};

/// A phase function.
#[derive(Clone, Debug, PartialEq)]
pub enum PhaseFunction {
    /// Equal in all directions.
    Isotropic,
    /// Henyey-Greenstein of asymmetry g.
    HenyeyGreenstein(f64),
    /// A share w of Henyey-Greenstein of g_1, the rest of g_2: a forward and a backward lobe.
    TwoLobes {
        /// Asymmetry of the first lobe.
        g_1: f64,
        /// Asymmetry of the second lobe.
        g_2: f64,
        /// Share of the first lobe.
        w: f64,
    },
    /// Scattering by particles much smaller than the wavelength, unpolarised.
    Rayleigh,
    /// Rayleigh times Henyey-Greenstein, normalised; the parameter g is not the mean cosine.
    CornetteShanks(f64),
    /// The normal distribution of the sphere, with concentration kappa.
    VonMisesFisher(f64),
    /// Linear between nodes.
    Tabulated(Tabulated),
}

impl PhaseFunction {
    /// Returns Henyey-Greenstein of asymmetry g. *Errors*: g outside (-1, 1).
    pub fn henyey_greenstein(g: f64) -> Result<Self, Error> {
        within("g", g as f32, g.abs() < 1.0, "(-1, 1)")?;
        Ok(Self::HenyeyGreenstein(g))
    }

    /// Returns the sum of two Henyey-Greenstein lobes. *Errors*: an asymmetry outside (-1, 1), a share outside \[0, 1\].
    pub fn two_lobes(g_1: f64, g_2: f64, w: f64) -> Result<Self, Error> {
        within("g_1", g_1 as f32, g_1.abs() < 1.0, "(-1, 1)")?;
        within("g_2", g_2 as f32, g_2.abs() < 1.0, "(-1, 1)")?;
        within("w", w as f32, (0.0..=1.0).contains(&w), "[0, 1]")?;
        Ok(Self::TwoLobes { g_1, g_2, w })
    }

    /// Returns Cornette-Shanks of parameter g. *Errors*: g outside (-1, 1).
    pub fn cornette_shanks(g: f64) -> Result<Self, Error> {
        within("g", g as f32, g.abs() < 1.0, "(-1, 1)")?;
        Ok(Self::CornetteShanks(g))
    }

    /// Returns von Mises-Fisher of concentration kappa. *Errors*: kappa outside (0, 1e6\].
    pub fn von_mises_fisher(kappa: f64) -> Result<Self, Error> {
        within("kappa", kappa as f32, kappa > 0.0 && kappa <= 1e6, "(0, 1e6]")?;
        Ok(Self::VonMisesFisher(kappa))
    }

    /// Returns the value at a cosine of the deflection \[1/sr\]; also the density of a sampled direction.
    pub fn eval(&self, cos: f64) -> f64 {
        match self {
            Self::Isotropic => 0.25 / PI,
            Self::HenyeyGreenstein(g) => henyey_greenstein(cos, *g),
            Self::TwoLobes { g_1, g_2, w } => {
                w * henyey_greenstein(cos, *g_1) + (1.0 - w) * henyey_greenstein(cos, *g_2)
            }
            Self::Rayleigh => 3.0 / (16.0 * PI) * (1.0 + cos * cos),
            Self::CornetteShanks(g) => 1.5 * (1.0 + cos * cos) / (2.0 + g * g) * henyey_greenstein(cos, *g),
            Self::VonMisesFisher(k) => k / (-2.0 * PI * (-2.0 * k).exp_m1()) * (k * (cos - 1.0)).exp(),
            Self::Tabulated(t) => t.eval(cos),
        }
    }

    /// Returns the cosine below which the probability is u, for u in (0, 1).
    ///
    /// Closed forms; two lobes split u, so that they are not monotone in it; Cornette-Shanks bisects its closed distribution function.
    pub fn sample(&self, u: f64) -> f64 {
        match self {
            Self::Isotropic => 2.0 * u - 1.0,
            Self::HenyeyGreenstein(g) => sample_henyey_greenstein(u, *g),
            Self::TwoLobes { g_1, g_2, w } => {
                if u < *w {
                    sample_henyey_greenstein(u / w, *g_1)
                } else {
                    sample_henyey_greenstein((u - w) / (1.0 - w), *g_2)
                }
            }
            Self::Rayleigh => {
                // mu^3 + 3 mu = 8 u - 4, by Cardano through sinh.
                2.0 * ((4.0 * u - 2.0).asinh() / 3.0).sinh()
            }
            Self::CornetteShanks(g) => {
                let (mut low, mut high) = (-1.0, 1.0);
                for _ in 0..52 {
                    let middle = 0.5 * (low + high);
                    if cornette_shanks_cdf(middle, *g) < u { low = middle } else { high = middle }
                }
                0.5 * (low + high)
            }
            Self::VonMisesFisher(k) => 1.0 + ((1.0 - u) * (-2.0 * k).exp_m1()).ln_1p() / k,
            Self::Tabulated(t) => t.sample(u),
        }
        .clamp(-1.0, 1.0)
    }

    /// Returns the Legendre moment of order n: the mean of P_n over the deflections.
    ///
    /// Closed where it is, else by quadrature graded towards the poles: 1e-9.
    pub fn moment(&self, n: u32) -> f64 {
        match self {
            _ if n == 0 => 1.0,
            Self::Isotropic => 0.0,
            Self::HenyeyGreenstein(g) => g.powi(n as i32),
            Self::TwoLobes { g_1, g_2, w } => w * g_1.powi(n as i32) + (1.0 - w) * g_2.powi(n as i32),
            Self::Rayleigh => {
                if n == 2 {
                    0.1
                } else {
                    0.0
                }
            }
            Self::CornetteShanks(g) if n == 1 => 3.0 * g * (4.0 + g * g) / (5.0 * (2.0 + g * g)),
            // Langevin's function; its series where the two terms cancel.
            Self::VonMisesFisher(k) if n == 1 && *k < 1e-2 => k / 3.0 - k * k * k / 45.0,
            Self::VonMisesFisher(k) if n == 1 => 1.0 / k.tanh() - 1.0 / k,
            Self::Tabulated(t) => t.mean(|cos| legendre(n, cos), n),
            _ => sphere_rule().integrate(|c| 2.0 * PI * self.eval(c) * legendre(n, c)),
        }
    }

    /// Returns the mean cosine of the deflection.
    pub fn g(&self) -> f64 {
        self.moment(1)
    }
}

/// A phase function that is linear between nodes, normalised.
#[derive(Clone, Debug, PartialEq)]
pub struct Tabulated {
    cos: Vec<f64>,
    value: Vec<f64>,
    cdf: Vec<f64>,
}

impl Tabulated {
    /// Returns the phase function of values at increasing cosines from -1 to 1; they are scaled to integrate to 1.
    ///
    /// *Shapes*: equal lengths of at least 2. *Errors*: cosines that do not increase from -1 to 1; a value that is negative or not finite; all of them 0.
    pub fn new(cos: &[f64], value: &[f64]) -> Result<Self, Error> {
        let n = cos.len();
        let ends = n >= 2 && n == value.len() && cos[0] == -1.0 && cos[n - 1] == 1.0;
        if !ends || cos.windows(2).any(|w| w[0].partial_cmp(&w[1]) != Some(std::cmp::Ordering::Less)) {
            return Err(ErrorKind::Nodes { nodes: n, values: value.len() }.into());
        }
        for &v in value {
            within("phase function", v as f32, v >= 0.0 && v.is_finite(), "[0, inf)")?;
        }
        let mut cdf = vec![0.0];
        for i in 1..n {
            cdf.push(cdf[i - 1] + PI * (cos[i] - cos[i - 1]) * (value[i] + value[i - 1]));
        }
        let total = cdf[n - 1];
        within("integral of the phase function", total as f32, total > 0.0, "(0, inf)")?;
        cdf.iter_mut().for_each(|c| *c /= total);
        Ok(Self { cos: cos.to_vec(), value: value.iter().map(|v| v / total).collect(), cdf })
    }

    fn eval(&self, cos: f64) -> f64 {
        let i = self.cos.partition_point(|&c| c <= cos).clamp(1, self.cos.len() - 1);
        let t = (cos - self.cos[i - 1]) / (self.cos[i] - self.cos[i - 1]);
        self.value[i - 1] + t * (self.value[i] - self.value[i - 1])
    }

    fn sample(&self, u: f64) -> f64 {
        let i = self.cdf.partition_point(|&c| c <= u).clamp(1, self.cos.len() - 1);
        let (a, b) = (self.value[i - 1], self.value[i]);
        let width = self.cos[i] - self.cos[i - 1];
        // Solve width t (a + t (b - a) / 2) = rest, in the form without cancellation.
        let rest = (u - self.cdf[i - 1]) / (2.0 * PI * width);
        let t = 2.0 * rest / (a + (a * a + 2.0 * (b - a) * rest).max(0.0).sqrt());
        self.cos[i - 1] + width * t.min(1.0)
    }

    /// Integrates value times a polynomial of degree n, exactly: Gauss points for degree n + 1 in each interval.
    fn mean(&self, f: impl Fn(f64) -> f64, n: u32) -> f64 {
        Rule::composite(n as usize / 2 + 2, &self.cos).integrate(|c| 2.0 * PI * self.eval(c) * f(c))
    }
}

fn henyey_greenstein(cos: f64, g: f64) -> f64 {
    // 1 + g^2 - 2 g cos without cancellation where the peak is.
    let d = (1.0 - g.abs()).powi(2) + 2.0 * g.abs() * (1.0 - cos * g.signum());
    (1.0 - g) * (1.0 + g) / (4.0 * PI * d * d.sqrt())
}

fn sample_henyey_greenstein(u: f64, g: f64) -> f64 {
    // The textbook inverse rearranged: no division by g (see the f32 form).
    let s = 2.0 * u - 1.0;
    let d = 1.0 + g * s;
    s + 2.0 * g * u * (1.0 - u) * (3.0 + 2.0 * g * s - g * g) / (d * d)
}

/// Returns the distribution function of Cornette-Shanks.
fn cornette_shanks_cdf(cos: f64, g: f64) -> f64 {
    let factor = 0.75 * (1.0 - g * g) / (2.0 + g * g);
    if g.abs() < 0.02 {
        // The closed form cancels like g^-3; here the integrand is smooth.
        return Rule::gauss(12, -1.0, cos)
            .integrate(|c| factor * (1.0 + c * c) / (1.0 + g * g - 2.0 * g * c).powf(1.5));
    }
    // With s^2 = 1 + g^2 - 2 g c the integral of (1 + c^2) / s^3 dc is that of (1 + c^2) / (g s^2) over falling s.
    let b = 1.0 + g * g;
    let primitive =
        |s: f64| (-(1.0 + b * b / (4.0 * g * g)) / s - b * s / (2.0 * g * g) + s.powi(3) / (12.0 * g * g)) / g;
    factor * (primitive(1.0 + g) - primitive((b - 2.0 * g * cos).max(0.0).sqrt()))
}

/// Returns P_n(x) by its recurrence.
pub fn legendre(n: u32, x: f64) -> f64 {
    let (mut p, mut q) = (1.0, x);
    for k in 1..n {
        let k = f64::from(k);
        (p, q) = (q, ((2.0 * k + 1.0) * x * q - k * p) / (k + 1.0));
    }
    if n == 0 { p } else { q }
}

/// A rule over the cosine, graded towards both poles.
fn sphere_rule() -> Rule {
    let mut breaks = vec![-1.0];
    breaks.extend((0..24).map(|i| -1.0 + 0.5f64.powi(23 - i)));
    breaks.extend((1..24).map(|i| 1.0 - 0.5f64.powi(i)));
    breaks.push(1.0);
    Rule::composite(16, &breaks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use moonmilk_core::stats::{kolmogorov_smirnov, sidak};
    use moonmilk_core::{Random, Stream};

    fn all() -> Vec<PhaseFunction> {
        let mut list = vec![PhaseFunction::Isotropic, PhaseFunction::Rayleigh];
        list.extend([-0.9, 0.0, 1e-6, 0.5, 0.95].map(|g| PhaseFunction::henyey_greenstein(g).unwrap()));
        list.extend([-0.6, 0.01, 0.03, 0.8].map(|g| PhaseFunction::cornette_shanks(g).unwrap()));
        list.extend([1e-3, 0.7, 30.0, 1e3].map(|k| PhaseFunction::von_mises_fisher(k).unwrap()));
        list.push(PhaseFunction::two_lobes(0.8, -0.3, 0.7).unwrap());
        list.push(PhaseFunction::Tabulated(Tabulated::new(&[-1.0, -0.2, 0.9, 1.0], &[1.0, 0.0, 2.0, 9.0]).unwrap()));
        list
    }

    /// Integrates over the sphere with a break at every kink of the table above.
    fn sphere(f: impl Fn(f64) -> f64) -> f64 {
        let mut breaks: Vec<f64> = (0..24).map(|i| -1.0 + 0.5f64.powi(23 - i)).collect();
        breaks.extend([-1.0, -0.2, 0.9, 1.0]);
        breaks.extend((1..24).map(|i| 1.0 - 0.5f64.powi(i)));
        breaks.sort_by(f64::total_cmp);
        Rule::composite(16, &breaks).integrate(|c| 2.0 * PI * f(c))
    }

    #[test]
    fn every_function_is_normalised_and_has_its_moments() {
        for p in all() {
            assert!((sphere(|c| p.eval(c)) - 1.0).abs() < 1e-10, "{p:?}");
            for n in 1..6 {
                let sum = sphere(|c| p.eval(c) * legendre(n, c));
                assert!((p.moment(n) - sum).abs() < 1e-9, "{p:?} {n} {} {sum}", p.moment(n));
            }
            assert_eq!(p.moment(0), 1.0);
        }
    }

    #[test]
    fn samples_follow_the_values() {
        let list = all();
        for (k, p) in list.iter().enumerate() {
            let mut rng = Stream::new(&[23, k as u64]);
            let mut cos: Vec<f64> = (0..5000).map(|_| p.sample(f64::from(rng.uniform()))).collect();
            let cdf = |x: f64| {
                // Breaks at the kinks of the table, graded towards both poles, where peaks are.
                let mut breaks: Vec<f64> = vec![-1.0, -0.2, 0.9];
                breaks.extend((0..14).flat_map(|i| [-1.0 + 0.5f64.powi(i), 1.0 - 0.5f64.powi(i)]));
                breaks.retain(|&b| b < x);
                breaks.push(x);
                breaks.sort_by(f64::total_cmp);
                Rule::composite(6, &breaks).integrate(|c| 2.0 * PI * p.eval(c))
            };
            let p_value = kolmogorov_smirnov(&mut cos, cdf);
            assert!(p_value > sidak(1e-4, list.len()), "{p:?}: {p_value:e}");
        }
    }

    #[test]
    fn invalid_functions_are_refused_by_name() {
        assert_eq!(PhaseFunction::henyey_greenstein(1.0).unwrap_err().to_string(), "g = 1 is outside (-1, 1)");
        assert!(PhaseFunction::two_lobes(0.1, -0.2, 1.5).is_err() && PhaseFunction::von_mises_fisher(0.0).is_err());
        assert!(
            Tabulated::new(&[-1.0, 0.5], &[1.0, 1.0]).is_err() && Tabulated::new(&[-1.0, 1.0], &[0.0, 0.0]).is_err()
        );
        let e = Tabulated::new(&[-1.0, 0.0, 0.0, 1.0], &[1.0; 4]).unwrap_err();
        assert!(e.to_string().contains("increase from -1 to 1"), "{e}");
    }
}
