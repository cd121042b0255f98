//! A scene as plain data: what a file said, with defaults filled in and nothing computed.
//!
//! Readers of file formats (`moonmilk-io`) produce a [`SceneDescription`]; [`crate::scene::Scene::new`] turns it into
//! something that can be traced. No handle, no path, no lazy loading: pictures and meshes are already in memory.

use std::sync::Arc;

use moonmilk_core::{Mat4, Vec2, Vec3};

mod lights;
mod materials;
mod media;
mod shapes;
mod textures;

pub use lights::{AreaLightDescription, LightDescription, LightKind};
pub use materials::{
    ConductorColor, HairAbsorption, IndexSpectrum, MaterialDescription, MaterialKind, Roughness, SubsurfaceMedium,
};
pub use media::{
    CloudDescription, ColourGrid, DensityGrid, FieldBox, FieldFault, GridEmission, MediumDescription, MediumKind,
};
pub use shapes::{GeometryDescription, InstanceDescription, MediumInterface, ObjectDescription, ShapeDescription};
pub use textures::{FloatTexture, ImageDescription, SpectrumTexture, TextureMapping, Wrap};

/// Where in a file a thing was said; reported in warnings and errors.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Place {
    /// Name of the file as the user knows it.
    pub file: Arc<str>,
    /// Line, from 1.
    pub line: u32,
    /// Column, from 1.
    pub column: u32,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}:{}", self.file, self.line, self.column)
    }
}

/// Index into [`SceneDescription::media`].
pub type MediumId = usize;
/// Index into [`SceneDescription::materials`].
pub type MaterialId = usize;
/// Index into [`SceneDescription::float_textures`].
pub type FloatTextureId = usize;
/// Index into [`SceneDescription::spectrum_textures`].
pub type SpectrumTextureId = usize;
/// Index into [`SceneDescription::images`].
pub type ImageId = usize;

/// A whole scene.
#[derive(Clone, Debug)]
pub struct SceneDescription {
    /// The camera.
    pub camera: CameraDescription,
    /// Size and name of the picture.
    pub film: FilmDescription,
    /// The pixel reconstruction filter.
    pub filter: FilterDescription,
    /// Samples per pixel and seed of the file.
    pub sampler: SamplerDescription,
    /// The file's integrator settings.
    pub integrator: IntegratorDescription,
    /// Participating media.
    pub media: Vec<MediumDescription>,
    /// Materials.
    pub materials: Vec<MaterialDescription>,
    /// Textures of one number.
    pub float_textures: Vec<FloatTexture>,
    /// Textures of spectra.
    pub spectrum_textures: Vec<SpectrumTexture>,
    /// Decoded pictures.
    pub images: Vec<ImageDescription>,
    /// Shapes that stand in the world, in the order of the file.
    pub shapes: Vec<ShapeDescription>,
    /// Objects that stand where [`SceneDescription::instances`] say.
    pub objects: Vec<ObjectDescription>,
    /// Places of objects.
    pub instances: Vec<InstanceDescription>,
    /// Lights that are not shapes.
    pub lights: Vec<LightDescription>,
}

/// A spectrum as given: which colour law applies depends on where it is used.
#[derive(Clone, Debug, PartialEq)]
pub enum SpectrumDescription {
    /// The same value at all wavelengths.
    Constant(f32),
    /// Linear sRGB values.
    Rgb([f32; 3]),
    /// Piecewise linear samples (wavelength in nm, value), increasing in wavelength.
    Sampled(Vec<(f32, f32)>),
    /// Black body of a temperature in kelvin, peak 1.
    Blackbody(f32),
    /// A standard spectrum by name, e.g. `metal-Au-eta`; known to exist.
    Named(String),
}

/// Perspective or other camera.
#[derive(Clone, Debug)]
pub struct CameraDescription {
    /// What kind of projection.
    pub kind: CameraKind,
    /// Camera space (looking along +z, y up, x right) to world space.
    pub camera_to_world: Mat4,
    /// Medium around the camera.
    pub medium: Option<MediumId>,
    /// Screen window (x0, x1, y0, y1) if the file gave one.
    pub screen_window: Option<[f32; 4]>,
    /// Frame aspect ratio if the file gave one.
    pub frame_aspect_ratio: Option<f32>,
    /// Radius of the lens, 0 for a pinhole [scene units].
    pub lens_radius: f32,
    /// Distance of the plane in focus [scene units].
    pub focal_distance: f32,
}

/// Kinds of projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraKind {
    /// Perspective; angle of view across the shorter axis \[degrees\].
    Perspective {
        /// Angle of view \[degrees\].
        fov: f32,
    },
    /// Orthographic.
    Orthographic,
    /// Full sphere of directions.
    Spherical {
        /// Equal-area mapping instead of latitude and longitude.
        equal_area: bool,
    },
}

/// Size and name of the picture.
#[derive(Clone, Debug)]
pub struct FilmDescription {
    /// Width \[pixels\].
    pub width: u32,
    /// Height \[pixels\].
    pub height: u32,
    /// Pixels to render: x0, x1, y0, y1, end exclusive.
    pub crop: [u32; 4],
    /// File name that the scene asks for.
    pub filename: Option<String>,
    /// Factor on the finished picture: exposure time x iso / 100 as pbrt's `Film` applies it (1 by default).
    pub imaging_ratio: f32,
    /// Largest RGB component that a sample may have; the file's `maxcomponentvalue`. Reported, never applied.
    pub max_component_value: Option<f32>,
}

/// Pixel reconstruction filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterDescription {
    /// Kind of filter.
    pub kind: FilterKind,
    /// Half width in x and y \[pixels\].
    pub radius: Vec2,
}

/// Kinds of pixel filters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FilterKind {
    /// Constant.
    Box,
    /// Tent.
    Triangle,
    /// Gaussian of standard deviation sigma, shifted to 0 at the radius.
    Gaussian {
        /// Standard deviation \[pixels\].
        sigma: f32,
    },
    /// Mitchell-Netravali with parameters B and C.
    Mitchell {
        /// Parameter B.
        b: f32,
        /// Parameter C.
        c: f32,
    },
    /// Windowed sinc with parameter tau.
    Sinc {
        /// Number of cycles of the window.
        tau: f32,
    },
}

/// Samples and seed asked for by the file.
#[derive(Clone, Copy, Debug)]
pub struct SamplerDescription {
    /// Samples per pixel.
    pub samples: u32,
    /// Seed.
    pub seed: u64,
}

/// The file's integrator.
#[derive(Clone, Debug)]
pub struct IntegratorDescription {
    /// Its name in the file.
    pub name: String,
    /// Largest number of bounces as the file counts.
    pub max_depth: u32,
}

/// A matter that a reader of a file noticed and that the user should know.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// Where.
    pub place: Option<Place>,
    /// What, and what is done instead.
    pub message: String,
}
