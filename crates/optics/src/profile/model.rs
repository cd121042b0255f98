//! From a formula to an object: what a model file writes, and the wrapper that registers it.

use std::sync::OnceLock;

use moonmilk_core::{Dual, Real};

use crate::error::{Error, within};
use crate::properties::{OpticalProperties, VARIABLES};

use super::table::RadialTable;
use super::{Gradient, Info, Profile};

/// The number that carries derivatives by radius, sigma_a, sigma_s, g and eta.
pub type Slopes = Dual<VARIABLES>;

/// A radial model as its file writes it: one source for values (`f64`) and derivatives ([`Slopes`]).
pub trait RadialModel<T: Real>: Sized + Send + Sync + 'static {
    /// Prepares everything that does not depend on the radius.
    ///
    /// *Errors*: what lies outside the model's domain.
    fn new(medium: &OpticalProperties<T>) -> Result<Self, Error>;

    /// Returns R(r) for r > 0 \[1/L^2\].
    fn eval(&self, r: T) -> T;

    /// Returns the integral of R over the surface.
    fn total(&self) -> T;

    /// Returns the share of the energy within a radius, where it has a closed form.
    fn cdf(&self, r: f64) -> Option<f64> {
        let _ = r;
        None
    }

    /// Returns the inverse of [`RadialModel::cdf`], where it has a closed form.
    fn inverse_cdf(&self, u: f64) -> Option<f64> {
        let _ = u;
        None
    }
}

/// A formula as a registered profile.
struct Registered<V, G> {
    info: &'static Info,
    medium: OpticalProperties,
    value: V,
    total: f64,
    slopes: OnceLock<G>,
    table: OnceLock<RadialTable>,
}

/// Builds the registered object of a model from its two instances.
///
/// *Errors*: no scattering, and what the model rejects.
pub(crate) fn build<V, G>(info: &'static Info, medium: &OpticalProperties) -> Result<Box<dyn Profile>, Error>
where
    V: RadialModel<f64>,
    G: RadialModel<Slopes>,
{
    within("sigma_s", medium.sigma_s() as f32, medium.sigma_s() > 0.0, "(0, inf)")?;
    let value = V::new(medium)?;
    let total = value.total();
    Ok(Box::new(Registered {
        info,
        medium: *medium,
        value,
        total,
        slopes: OnceLock::<G>::new(),
        table: OnceLock::new(),
    }))
}

impl<V: RadialModel<f64>, G: RadialModel<Slopes>> Registered<V, G> {
    /// The instance that carries derivatives, made when they are first asked for.
    fn slopes(&self) -> &G {
        self.slopes.get_or_init(|| G::new(&self.medium.variables()).expect("the same medium as the instance of values"))
    }

    fn table(&self) -> &RadialTable {
        // The smallest length on which a profile changes.
        let length = 1.0 / self.medium.sigma_t().max(self.medium.sigma_t_prime());
        self.table.get_or_init(|| RadialTable::new(length, |r| self.value.eval(r)))
    }
}

impl<V: RadialModel<f64>, G: RadialModel<Slopes>> Profile for Registered<V, G> {
    fn info(&self) -> &'static Info {
        self.info
    }

    fn medium(&self) -> &OpticalProperties {
        &self.medium
    }

    fn eval(&self, r: f64) -> f64 {
        self.value.eval(r)
    }

    fn gradient(&self, r: f64) -> Gradient {
        self.slopes().eval(Slopes::variable(r, 0)).into()
    }

    fn total(&self) -> f64 {
        self.total
    }

    fn total_gradient(&self) -> Gradient {
        self.slopes().total().into()
    }

    fn pdf(&self, r: f64) -> f64 {
        match self.value.cdf(r) {
            Some(_) => 2.0 * std::f64::consts::PI * r * self.value.eval(r) / self.total,
            None => self.table().pdf(r),
        }
    }

    fn cdf(&self, r: f64) -> f64 {
        self.value.cdf(r).unwrap_or_else(|| self.table().cdf(r))
    }

    fn inverse_cdf(&self, u: f64) -> f64 {
        self.value.inverse_cdf(u).unwrap_or_else(|| self.table().inverse_cdf(u))
    }
}
