//! Media of a scene: before wavelengths are chosen ([`SceneMedium`]), and around a path ([`Matter`]).

use moonmilk_core::{Spectra, Wavelengths};
use moonmilk_walk::Medium;

use crate::description::{MediumDescription, MediumId, MediumKind, Place, SpectrumDescription};
use crate::lights;
use crate::scene::SceneError;

mod blackbody;
mod field;
mod noise;

pub(crate) use field::{FieldAt, FieldMedium};

/// A medium of the scene, before wavelengths are chosen.
#[derive(Debug)]
pub(crate) enum SceneMedium {
    /// The same everywhere.
    Homogeneous(Homogeneous),
    /// Different from place to place.
    Field(Box<FieldMedium>),
}

/// A homogeneous medium, before wavelengths are chosen.
#[derive(Clone, Debug)]
pub(crate) struct Homogeneous {
    sigma_a: Spectra,
    sigma_s: Spectra,
    g: f32,
    emission: Option<Spectra>,
}

/// What is around a path.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Matter<const N: usize> {
    /// A homogeneous medium, not empty.
    Homogeneous(Medium<N>),
    /// The coefficients of one that is walked through in its stead, and the number of its scatterers ([`crate::scene::Scene::scatterers`]).
    Similar(Medium<N>, u32),
    /// A medium of the scene that differs from place to place.
    Field(MediumId),
}

impl Homogeneous {
    /// Returns the medium at the wavelengths of a path; `None` if it is empty.
    pub(crate) fn sample<const N: usize>(&self, w: &Wavelengths<N>) -> Option<Medium<N>> {
        let medium = Medium::new(self.sigma_a.sample(w), self.sigma_s.sample(w), self.g)
            .with_emission(self.emission.as_ref().map(|e| e.sample(w)));
        (!medium.sigma_t.is_black()).then_some(medium)
    }
}

impl SceneMedium {
    /// Validates a medium.
    pub(crate) fn new(d: &MediumDescription) -> Result<Self, SceneError> {
        let fail = |reason: String| SceneError::Medium { place: d.place.clone(), name: d.name.clone(), reason };
        let field = match &d.kind {
            MediumKind::Homogeneous { sigma_a, sigma_s, scale, g, emission } => {
                if !(*g > -1.0 && *g < 1.0) {
                    return Err(fail(format!("g = {g} is outside (-1, 1)")));
                }
                if !(*scale >= 0.0 && scale.is_finite()) {
                    return Err(fail(format!("scale = {scale} is outside [0, inf)")));
                }
                let emission = match emission {
                    Some((s, factor)) => Some(lights::emission(s, *factor, &d.place)?),
                    None => None,
                };
                return Ok(Self::Homogeneous(Homogeneous {
                    sigma_a: coefficient(sigma_a, "sigma_a", *scale).map_err(fail)?,
                    sigma_s: coefficient(sigma_s, "sigma_s", *scale).map_err(fail)?,
                    g: *g,
                    emission,
                }));
            }
            MediumKind::Densities(grid) => {
                grid.check().map_err(|f| fail(f.reason))?;
                FieldMedium::densities(grid, &fail, &d.place)?
            }
            MediumKind::Colours(grid) => {
                grid.check().map_err(|f| fail(f.reason))?;
                FieldMedium::colours(grid)
            }
            MediumKind::Cloud(cloud) => {
                cloud.check().map_err(|f| fail(f.reason))?;
                FieldMedium::cloud(cloud, &fail)?
            }
        };
        Ok(Self::Field(Box::new(field)))
    }

    /// Returns the bytes of a field.
    pub(crate) fn memory(&self) -> usize {
        match self {
            Self::Homogeneous(_) => 0,
            Self::Field(f) => f.memory(),
        }
    }
}

/// Returns a coefficient's spectrum times a factor, or what is wrong with it.
fn coefficient(s: &SpectrumDescription, what: &str, scale: f32) -> Result<Spectra, String> {
    let spectrum = match s {
        SpectrumDescription::Constant(x) => Ok(Spectra::Constant(*x)),
        SpectrumDescription::Rgb(rgb) => Spectra::rgb_unbounded(*rgb),
        SpectrumDescription::Sampled(points) => Spectra::sampled(points.clone()),
        SpectrumDescription::Blackbody(t) => Spectra::blackbody(*t),
        SpectrumDescription::Named(n) => Spectra::named(n),
    };
    match spectrum {
        Ok(Spectra::Constant(x)) if !(x >= 0.0 && x.is_finite()) => Err(format!("{what} = {x} is outside [0, inf)")),
        Ok(s) => Ok(s.scaled(scale)),
        Err(e) => Err(format!("{what}: {e}")),
    }
}

/// Returns the emission of a field, or the scene's error.
fn glow(s: &SpectrumDescription, place: &Place) -> Result<Spectra, SceneError> {
    Ok(lights::emission(s, 1.0, place)?)
}
