//! Materials, as a file says them.

use super::*;

/// A material with its place in the file.
#[derive(Clone, Debug)]
pub struct MaterialDescription {
    /// Name, if it is a named material.
    pub name: Option<String>,
    /// Where it was defined.
    pub place: Place,
    /// Its kind and parameters.
    pub kind: MaterialKind,
    /// Displacement or bump map.
    pub displacement: Option<FloatTextureId>,
    /// Normal map.
    pub normal_map: Option<ImageId>,
    /// Objects that share a set act as one translucent object (`moonmilk.set`).
    pub set: Option<String>,
    /// Priority among overlapping dielectrics (`moonmilk.priority`).
    pub priority: Option<i32>,
}

/// Roughness of a microfacet surface in x and y, as in the file.
#[derive(Clone, Copy, Debug)]
pub struct Roughness {
    /// Along the first tangent.
    pub u: FloatTextureId,
    /// Along the second tangent.
    pub v: FloatTextureId,
    /// Whether the numbers are perceptual (alpha = sqrt(roughness) in pbrt) or alpha itself.
    pub remap: bool,
}

/// Refractive index of a dielectric.
pub type IndexSpectrum = SpectrumDescription;

/// Kinds of materials.
#[derive(Clone, Debug)]
pub enum MaterialKind {
    /// No surface at all: rays pass, only the medium changes (index-matched boundary).
    Interface,
    /// Lambertian reflection.
    Diffuse {
        /// Albedo.
        reflectance: SpectrumTextureId,
    },
    /// Lambertian reflection and transmission.
    DiffuseTransmission {
        /// Albedo of reflection, scale applied.
        reflectance: SpectrumTextureId,
        /// Albedo of transmission.
        transmittance: SpectrumTextureId,
        /// Factor on both.
        scale: f32,
    },
    /// A dielectric boundary around the other parameters' base layer.
    CoatedDiffuse {
        /// Albedo of the base.
        reflectance: SpectrumTextureId,
        /// Roughness of the coat.
        roughness: Roughness,
        /// Thickness of the coat.
        thickness: FloatTextureId,
        /// Index of the coat.
        eta: IndexSpectrum,
        /// Asymmetry of the medium in the coat.
        g: FloatTextureId,
        /// Albedo of the medium in the coat.
        albedo: SpectrumTextureId,
        /// Largest depth of the layered walk.
        max_depth: u32,
        /// Samples of the layered walk.
        samples: u32,
    },
    /// A conductor under a coat.
    CoatedConductor {
        /// Roughness of the coat.
        interface_roughness: Roughness,
        /// Thickness of the coat.
        thickness: FloatTextureId,
        /// Index of the coat.
        interface_eta: IndexSpectrum,
        /// Asymmetry of the medium in the coat.
        g: FloatTextureId,
        /// Albedo of the medium in the coat.
        albedo: SpectrumTextureId,
        /// The metal.
        conductor: ConductorColor,
        /// Roughness of the metal.
        conductor_roughness: Roughness,
        /// Largest depth of the layered walk.
        max_depth: u32,
        /// Samples of the layered walk.
        samples: u32,
    },
    /// A metal.
    Conductor {
        /// Its complex index or its reflectance at normal incidence.
        color: ConductorColor,
        /// Roughness.
        roughness: Roughness,
    },
    /// A boundary between two transparent media.
    Dielectric {
        /// Relative index inside / outside.
        eta: IndexSpectrum,
        /// Roughness.
        roughness: Roughness,
    },
    /// A thin pane: two parallel boundaries in one.
    ThinDielectric {
        /// Index of the pane.
        eta: IndexSpectrum,
    },
    /// A dielectric boundary around a scattering medium of its own.
    Subsurface {
        /// The medium, in one of the forms that pbrt accepts.
        medium: SubsurfaceMedium,
        /// Factor on the coefficients (pbrt's `scale`, default 1).
        scale: f32,
        /// Asymmetry of the Henyey-Greenstein phase function.
        g: f32,
        /// Relative index inside / outside.
        eta: f32,
        /// Roughness of the boundary.
        roughness: Roughness,
    },
    /// A random choice between two materials.
    Mix {
        /// The two materials.
        materials: [MaterialId; 2],
        /// Share of the second.
        amount: FloatTextureId,
    },
    /// A fibre of hair or fur.
    Hair {
        /// What its core absorbs.
        absorption: HairAbsorption,
        /// Index of the core.
        eta: FloatTextureId,
        /// Longitudinal roughness.
        beta_m: FloatTextureId,
        /// Azimuthal roughness.
        beta_n: FloatTextureId,
        /// Tilt of the scales \[degrees\].
        alpha: FloatTextureId,
    },
    /// A material that is read but shown as something else; `io` has warned.
    StandIn {
        /// Grey or coloured diffuse stand-in.
        reflectance: SpectrumTextureId,
    },
}

/// How the colour of hair is described.
#[derive(Clone, Debug)]
pub enum HairAbsorption {
    /// Absorption coefficient per radius of the fibre.
    Coefficient(SpectrumTextureId),
    /// Colour of a mass of such hair.
    Reflectance(SpectrumTextureId),
    /// Concentrations of the two pigments.
    Pigments {
        /// Brown to black.
        eumelanin: FloatTextureId,
        /// Yellow to red.
        pheomelanin: FloatTextureId,
    },
}

/// How a metal is described.
#[derive(Clone, Debug)]
pub enum ConductorColor {
    /// Complex refractive index eta + i k.
    Index {
        /// Real part.
        eta: SpectrumTextureId,
        /// Imaginary part.
        k: SpectrumTextureId,
    },
    /// Reflectance at normal incidence.
    Reflectance(SpectrumTextureId),
}

/// The forms of a `subsurface` material's medium.
#[derive(Clone, Debug)]
pub enum SubsurfaceMedium {
    /// Absorption and scattering coefficients [1/scene unit] (also of a named medium, g = 0 there).
    Coefficients {
        /// Absorption coefficient.
        sigma_a: SpectrumTextureId,
        /// Scattering coefficient.
        sigma_s: SpectrumTextureId,
    },
    /// Surface albedo and mean free path [scene unit].
    Reflectance {
        /// Albedo of the half-space at normal incidence, of the light that entered.
        reflectance: SpectrumTextureId,
        /// Mean free path 1 / sigma_t.
        mfp: SpectrumTextureId,
    },
}
