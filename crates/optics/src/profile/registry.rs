//! The list of all radial models.

use moonmilk_core::spectra::nearest;

use crate::error::{Error, ErrorKind};
use crate::properties::OpticalProperties;

use super::bssrdf::{Bssrdf, BuildBssrdf, BuildDirected, Directed};
use super::model::build;
use super::{Info, Prepared, Profile};
use super::{
    better_dipole, dipole, directional_dipole, dual_beam, gaussian, gaussian_sum, monopole, multipole, normalized,
    oblique, photon_beam, quantized, single, tabulated,
};

/// How a registered model is built.
type Build = fn(&'static Info, &OpticalProperties) -> Result<Box<dyn Profile>, Error>;

/// A registered model.
#[derive(Clone, Copy, Debug)]
pub struct Model {
    /// Its description.
    pub info: &'static Info,
    build: Build,
    bssrdf: Option<BuildBssrdf>,
    directed: Option<BuildDirected>,
}

impl Model {
    /// Returns the model's profile for a medium.
    ///
    /// *Errors*: no scattering, or what the model rejects, named with value and range.
    pub fn build(&self, medium: &OpticalProperties) -> Result<Box<dyn Profile>, Error> {
        (self.build)(self.info, medium)
    }

    /// Returns the model as a BSSRDF that knows directions, if it is one: at normal incidence it equals the profile.
    ///
    /// *Errors*: as [`Model::build`].
    pub fn bssrdf(&self, medium: &OpticalProperties) -> Option<Result<Box<dyn Bssrdf>, Error>> {
        self.bssrdf.map(|f| f(medium))
    }

    /// Returns the model in full for rendering, if it knows directions; at normal incidence and over all directions of view it is the profile.
    ///
    /// *Errors*: as [`Model::build`].
    pub fn directed(&self, medium: &OpticalProperties) -> Option<Result<Box<dyn Directed>, Error>> {
        self.directed.map(|f| f(medium))
    }

    /// Returns the profile baked for rendering.
    ///
    /// *Errors*: as [`Model::build`].
    pub fn prepare(&self, medium: &OpticalProperties) -> Result<Prepared, Error> {
        Ok(Prepared::new(self.build(medium)?.as_ref()))
    }
}

macro_rules! model {
    ($info:expr, $model:ident :: $name:ident) => {
        Model { info: &$info, build: build::<$model::$name<f64>, $model::$name<super::Slopes>>, bssrdf: None, directed: None }
    };
    ($info:expr, $model:ident :: $name:ident, $($field:ident: $build:expr),+) => {
        Model { $($field: Some($build),)+ ..model!($info, $model::$name) }
    };
}

/// All models, simplest first.
pub static MODELS: &[Model] = &[
    model!(gaussian::INFO, gaussian::Gaussian),
    model!(gaussian_sum::INFO, gaussian_sum::GaussianSum),
    model!(monopole::INFO, monopole::Monopole),
    model!(dipole::INFO, dipole::Dipole),
    model!(dipole::ROBIN, dipole::Robin),
    model!(better_dipole::INFO, better_dipole::BetterDipole),
    model!(quantized::INFO, quantized::Quantized),
    model!(quantized::AS_PUBLISHED, quantized::Gaussians),
    model!(photon_beam::INFO, photon_beam::PhotonBeam, bssrdf: oblique::bssrdf),
    model!(oblique::INFO, photon_beam::PhotonBeam, bssrdf: oblique::bssrdf, directed: oblique::directed),
    model!(directional_dipole::INFO, directional_dipole::DirectionalDipole, bssrdf: directional_dipole::bssrdf, directed: directional_dipole::directed),
    model!(dual_beam::INFO, dual_beam::DualBeam, directed: dual_beam::directed::corrected),
    model!(dual_beam::AS_PUBLISHED, dual_beam::AsPublished, directed: dual_beam::directed::as_published),
    model!(multipole::INFO, multipole::HalfSpace),
    model!(multipole::AS_PUBLISHED, multipole::AsPublished),
    model!(normalized::INFO, normalized::Normalized),
    model!(normalized::AS_PUBLISHED, normalized::AsPublished),
    model!(normalized::DIFFUSE, normalized::Diffuse),
    model!(normalized::DMFP, normalized::Dmfp),
    model!(single::INFO, single::Single),
    model!(tabulated::INFO, tabulated::Tabulated),
];

/// Returns the model of a name.
///
/// *Errors*: an unknown name, with the nearest known one.
pub fn find(name: &str) -> Result<&'static Model, Error> {
    MODELS.iter().find(|m| m.info.name == name).ok_or_else(|| {
        ErrorKind::Model { name: name.to_owned(), nearest: nearest(name, MODELS.iter().map(|m| m.info.name)) }.into()
    })
}
