//! Radial profiles: what a point of the surface gives back of the light that enters at another.
//!
//! A pencil beam of unit entering power goes in along the normal; the *diffuse reflectance profile* $R(r)$ \[1/L²\] is the exitance at distance r.
//! Its integral is the albedo of the light that entered, and the BSSRDF made of it is
//!
//! $$ S(x_i, \omega_i, x_o, \omega_o) = T(\eta, \omega_i)\, \frac{R(|x_o - x_i|)}{\pi N}\, T(\eta, \omega_o), \qquad N = 1 - 2 C_1(1/\eta) $$
//!
//! with $T = 1 - F$ from outside; N makes $\int S \cos\theta_o\, d\omega_o = T(\omega_i) R$. All models are free of scale: $R(r; \sigma) = \sigma_t'^2 \hat R(r \sigma_t')$.
//!
//! **Use a model by name**, from the list [`MODELS`], as a boxed [`Profile`]:
//!
//! ```
//! use moonmilk_optics::{OpticalProperties, profile};
//!
//! // Whole milk, green, per mm.
//! let milk = OpticalProperties::new(0.0024, 3.21, 0.0, 1.3)?;
//! for name in ["dipole", "photon-beam", "normalized"] {
//!     let model = profile::find(name)?.build(&milk)?;
//!     println!("{name}: R(1 mm) = {:.4}, albedo {:.3}", model.eval(1.0), model.total());
//!     let sample = model.sample(0.5);
//!     assert!((sample.weight / model.total() - 1.0).abs() < 0.05);
//! }
//! # Ok::<(), moonmilk_optics::Error>(())
//! ```
//!
//! **Use a formula directly**, with any number type; dual numbers give derivatives:
//!
//! ```
//! use moonmilk_optics::OpticalProperties;
//! use moonmilk_optics::profile::dipole::Dipole;
//! use moonmilk_optics::profile::RadialModel;
//!
//! let medium = OpticalProperties::new(0.1, 1.0, 0.0, 1.3)?;
//! let dipole = Dipole::new(&medium)?;
//! assert!(dipole.eval(1.0) > dipole.eval(2.0));
//! # Ok::<(), moonmilk_optics::Error>(())
//! ```
//!
//! **Bake a model for rendering** with [`Model::prepare`]: a table that evaluates in nanoseconds ([`Prepared`]).
//!
//! A new model is one file here and one line in [`MODELS`]; the program's list, its plots and the contract tests follow the list.

pub mod better_dipole;
pub mod bssrdf;
pub mod dipole;
pub mod directional_dipole;
pub mod distance;
pub mod dual_beam;
pub mod gaussian;
pub mod gaussian_sum;
pub mod image;
pub mod monopole;
pub mod multipole;
pub mod normalized;
pub mod photon_beam;
pub mod published_errors;
pub mod quantized;
pub mod single;
pub mod tabulated;

mod model;
mod oblique;
mod prepared;
mod registry;
pub mod table;

pub use bssrdf::{Bssrdf, Directed, Placement};
pub use distance::{Distance, distance};
pub use model::{RadialModel, Slopes};
pub use prepared::Prepared;
pub use registry::{MODELS, Model, find};

use crate::properties::OpticalProperties;

/// What a model is, for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Info {
    /// Name on the command line.
    pub name: &'static str,
    /// What it is, in a few words.
    pub summary: &'static str,
    /// Keys in references.bib.
    pub source: &'static str,
    /// What kind of description it gives.
    pub kind: Kind,
    /// Where it is valid, with measured errors.
    pub valid: &'static str,
    /// When to use it.
    pub use_when: &'static str,
    /// When not to.
    pub avoid_when: &'static str,
}

/// What a model describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// All of the reflected light.
    Whole,
    /// A part of it: one order of scattering.
    Part,
}

/// A radial profile of one medium.
///
/// *Conventions*: r > 0 \[L\]; light along the normal, per unit of entered power; specular reflection is not part of it.
pub trait Profile: Send + Sync {
    /// Returns the description of the model.
    fn info(&self) -> &'static Info;

    /// Returns the medium that the profile was built for.
    fn medium(&self) -> &OpticalProperties;

    /// Returns R(r) \[1/L^2\].
    fn eval(&self, r: f64) -> f64;

    /// Returns R(r) with its derivatives.
    fn gradient(&self, r: f64) -> Gradient;

    /// Returns the integral of R over the surface: the model's albedo.
    fn total(&self) -> f64;

    /// Returns the albedo with its derivatives; that by the radius is 0.
    fn total_gradient(&self) -> Gradient;

    /// Returns the density with which [`Profile::sample`] finds a radius, per unit radius \[1/L\]; divide by 2 pi r for that per area.
    fn pdf(&self, r: f64) -> f64;

    /// Returns the probability that a sampled radius is below r.
    fn cdf(&self, r: f64) -> f64;

    /// Returns the radius below which the probability is u, for u in \[0, 1).
    fn inverse_cdf(&self, u: f64) -> f64;

    /// Samples a radius; the weight 2 pi r R / pdf has the albedo as its mean and is nearly constant.
    fn sample(&self, u: f64) -> RadialSample {
        let r = self.inverse_cdf(u);
        let pdf = self.pdf(r);
        RadialSample { r, pdf, weight: 2.0 * std::f64::consts::PI * r * self.eval(r) / pdf }
    }
}

/// A sampled radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialSample {
    /// The radius \[L\].
    pub r: f64,
    /// Its density per unit radius \[1/L\].
    pub pdf: f64,
    /// 2 pi r R / pdf.
    pub weight: f64,
}

/// A value with its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gradient {
    /// The value.
    pub value: f64,
    /// Derivative by the radius.
    pub r: f64,
    /// Derivative by the absorption coefficient, at constant sigma_s.
    pub sigma_a: f64,
    /// Derivative by the scattering coefficient, at constant sigma_a.
    pub sigma_s: f64,
    /// Derivative by the asymmetry.
    pub g: f64,
    /// Derivative by the relative index.
    pub eta: f64,
}

impl From<Slopes> for Gradient {
    fn from(d: Slopes) -> Self {
        let [r, sigma_a, sigma_s, g, eta] = d.partials;
        Self { value: d.value, r, sigma_a, sigma_s, g, eta }
    }
}
