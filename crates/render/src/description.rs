//! A scene as plain data: what a file said, with defaults filled in and nothing computed.
//!
//! Readers of file formats (`moonmilk-io`) produce a [`SceneDescription`]; [`crate::scene::Scene::new`] turns it into
//! something that can be traced. No handle, no path, no lazy loading: pictures and meshes are already in memory.

use std::sync::Arc;

use moonmilk_core::{Mat4, Vec2, Vec3};

mod media;

pub use media::{
    CloudDescription, ColourGrid, DensityGrid, FieldBox, FieldFault, GridEmission, MediumDescription, MediumKind,
};

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

/// How texture coordinates come about.
#[derive(Clone, Debug)]
pub enum TextureMapping {
    /// Surface parameters: (su u + du, sv v + dv).
    Uv {
        /// Scales.
        scale: Vec2,
        /// Offsets.
        delta: Vec2,
    },
    /// Spherical coordinates in texture space.
    Spherical(Mat4),
    /// Cylindrical coordinates in texture space.
    Cylindrical(Mat4),
    /// Projection on a plane: (d_u + p . v1, d_v + p . v2) with p in texture space.
    Planar {
        /// World to texture space.
        to_texture: Mat4,
        /// First axis.
        v1: Vec3,
        /// Second axis.
        v2: Vec3,
        /// Offsets.
        delta: Vec2,
    },
    /// World point to 3D texture space.
    Point(Mat4),
}

/// What lies outside the unit square of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Repeats.
    Repeat,
    /// Black.
    Black,
    /// Clamped to the edge.
    Clamp,
    /// Goes on as the sphere does whose equal-area octahedral map the picture is.
    Octahedral,
}

/// A texture that yields one number.
#[derive(Clone, Debug)]
pub enum FloatTexture {
    /// A constant.
    Constant(f32),
    /// A product of two textures.
    Scale(FloatTextureId, FloatTextureId),
    /// Linear interpolation.
    Mix {
        /// Value at amount 0.
        a: FloatTextureId,
        /// Value at amount 1.
        b: FloatTextureId,
        /// Amount.
        amount: FloatTextureId,
    },
    /// An image (mean of its channels, or its alpha).
    Image {
        /// The picture.
        image: ImageId,
        /// Coordinates.
        mapping: TextureMapping,
        /// Outside the picture.
        wrap: Wrap,
        /// Factor.
        scale: f32,
        /// max(0, 1 - scale * value), as in pbrt.
        invert: bool,
        /// Bilinear interpolation rather than the nearest texel.
        bilinear: bool,
    },
    /// Two textures in a checkerboard.
    Checkerboard {
        /// Coordinates (2D or 3D).
        mapping: TextureMapping,
        /// Value of even squares.
        a: FloatTextureId,
        /// Value of odd squares.
        b: FloatTextureId,
    },
    /// Mix by the direction of the normal: amount = |n . dir|.
    DirectionMix {
        /// Value where the normal is across.
        a: FloatTextureId,
        /// Value where the normal is along.
        b: FloatTextureId,
        /// World direction, unit length.
        dir: Vec3,
    },
    /// Bilinear interpolation between the corners of the unit square, continued beyond it.
    Bilerp {
        /// Coordinates.
        mapping: TextureMapping,
        /// Values at (0, 0), (1, 0), (0, 1), (1, 1).
        v: [f32; 4],
    },
    /// Randomly placed dots of radius 0.35 in about two of five unit cells.
    Dots {
        /// Coordinates.
        mapping: TextureMapping,
        /// Value in dots.
        inside: FloatTextureId,
        /// Value around them.
        outside: FloatTextureId,
    },
    /// Sum of octaves of noise.
    Fbm {
        /// World to texture space.
        to_texture: Mat4,
        /// Number of octaves.
        octaves: u32,
        /// Factor from one octave to the next.
        roughness: f32,
    },
    /// Sum of octaves of the absolute value of noise.
    Wrinkled {
        /// World to texture space.
        to_texture: Mat4,
        /// Number of octaves.
        octaves: u32,
        /// Factor from one octave to the next.
        roughness: f32,
    },
    /// Waves on water under a wind that varies; world to texture space.
    Windy(Mat4),
}

/// A texture that yields a spectrum.
#[derive(Clone, Debug)]
pub enum SpectrumTexture {
    /// A constant.
    Constant(SpectrumDescription),
    /// A product of a spectrum texture and a number texture.
    Scale(SpectrumTextureId, FloatTextureId),
    /// Linear interpolation.
    Mix {
        /// Value at amount 0.
        a: SpectrumTextureId,
        /// Value at amount 1.
        b: SpectrumTextureId,
        /// Amount.
        amount: FloatTextureId,
    },
    /// Mix by the direction of the normal: amount = |n . dir|.
    DirectionMix {
        /// Value where the normal is across.
        a: SpectrumTextureId,
        /// Value where the normal is along.
        b: SpectrumTextureId,
        /// World direction.
        dir: Vec3,
    },
    /// An image in linear sRGB.
    Image {
        /// The picture.
        image: ImageId,
        /// Coordinates.
        mapping: TextureMapping,
        /// Outside the picture.
        wrap: Wrap,
        /// Factor.
        scale: f32,
        /// max(0, 1 - scale * value), as in pbrt.
        invert: bool,
        /// Bilinear interpolation rather than the nearest texel.
        bilinear: bool,
    },
    /// Two textures in a checkerboard.
    Checkerboard {
        /// Coordinates (2D or 3D).
        mapping: TextureMapping,
        /// Value of even squares.
        a: SpectrumTextureId,
        /// Value of odd squares.
        b: SpectrumTextureId,
    },
    /// Bilinear interpolation between the corners of the unit square, continued beyond it.
    Bilerp {
        /// Coordinates.
        mapping: TextureMapping,
        /// Values at (0, 0), (1, 0), (0, 1), (1, 1).
        v: [SpectrumTextureId; 4],
    },
    /// Randomly placed dots of radius 0.35 in about two of five unit cells.
    Dots {
        /// Coordinates.
        mapping: TextureMapping,
        /// Value in dots.
        inside: SpectrumTextureId,
        /// Value around them.
        outside: SpectrumTextureId,
    },
    /// Veins of marble: a sine along y, bent by noise.
    Marble {
        /// World to texture space.
        to_texture: Mat4,
        /// Octaves of the noise.
        octaves: u32,
        /// Factor from one octave to the next.
        roughness: f32,
        /// Factor on texture space.
        scale: f32,
        /// How far the noise bends the veins.
        variation: f32,
    },
}

/// A decoded picture, linear.
#[derive(Clone, Debug)]
pub struct ImageDescription {
    /// Name, for messages.
    pub name: String,
    /// Width \[pixels\].
    pub width: u32,
    /// Height \[pixels\].
    pub height: u32,
    /// Row-major linear RGB, top row first.
    pub rgb: Vec<[f32; 3]>,
    /// Alpha, empty if there is none.
    pub alpha: Vec<f32>,
}

/// The media on both sides of a surface; `None` is vacuum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MediumInterface {
    /// On the side opposite to the normal.
    pub inside: Option<MediumId>,
    /// On the side of the normal.
    pub outside: Option<MediumId>,
}

/// A shape in the scene.
#[derive(Clone, Debug)]
pub struct ShapeDescription {
    /// Where it was said.
    pub place: Place,
    /// File or kind, for messages: `dragon.ply`, `sphere`.
    pub name: String,
    /// Its form in object space.
    pub geometry: Arc<GeometryDescription>,
    /// Object to world space.
    pub object_to_world: Mat4,
    /// The file's ReverseOrientation.
    pub reverse_orientation: bool,
    /// Its material.
    pub material: MaterialId,
    /// `Some` if a MediumInterface with different sides is in force; otherwise a ray stays in the medium that it is in.
    pub media: Option<MediumInterface>,
    /// Its emission.
    pub area_light: Option<AreaLightDescription>,
    /// Opacity: a stochastic cut-out.
    pub alpha: Option<FloatTextureId>,
}

/// Shapes that stand together in several places, or in none.
#[derive(Clone, Debug)]
pub struct ObjectDescription {
    /// Name in the file.
    pub name: String,
    /// Its shapes; `object_to_world` leads to the object's space instead. None of them emits.
    pub shapes: Vec<ShapeDescription>,
}

/// A place of an object.
#[derive(Clone, Debug)]
pub struct InstanceDescription {
    /// Where it was said.
    pub place: Place,
    /// Index into [`SceneDescription::objects`].
    pub object: usize,
    /// The object's space to world space.
    pub object_to_world: Mat4,
}

/// Forms of shapes in object space.
#[derive(Clone, Debug)]
pub enum GeometryDescription {
    /// Triangles.
    Mesh {
        /// Vertex positions.
        positions: Vec<Vec3>,
        /// Normals per vertex, or empty.
        normals: Vec<Vec3>,
        /// Texture coordinates per vertex, or empty.
        uvs: Vec<Vec2>,
        /// Three vertex numbers per triangle.
        indices: Vec<[u32; 3]>,
    },
    /// A sphere around the origin, possibly partial.
    Sphere {
        /// Radius.
        radius: f32,
        /// Lower cut in z.
        z_min: f32,
        /// Upper cut in z.
        z_max: f32,
        /// Sweep \[degrees\].
        phi_max: f32,
    },
    /// A disk across the z axis.
    Disk {
        /// Height along z.
        height: f32,
        /// Radius.
        radius: f32,
        /// Radius of the hole.
        inner_radius: f32,
        /// Sweep \[degrees\].
        phi_max: f32,
    },
    /// A cylinder around the z axis.
    Cylinder {
        /// Radius.
        radius: f32,
        /// Lower end.
        z_min: f32,
        /// Upper end.
        z_max: f32,
        /// Sweep \[degrees\].
        phi_max: f32,
    },
}

/// Emission of a shape.
#[derive(Clone, Debug)]
pub struct AreaLightDescription {
    /// Where it was said.
    pub place: Place,
    /// Emitted radiance before `scale`.
    pub radiance: SpectrumDescription,
    /// Factor, with `power` already resolved to `None` or kept there.
    pub scale: f32,
    /// Emits on both sides.
    pub two_sided: bool,
    /// Total power asked for.
    pub power: Option<f32>,
    /// Image of the radiance over (u, v).
    pub image: Option<ImageId>,
}

/// A light that is not a shape.
#[derive(Clone, Debug)]
pub struct LightDescription {
    /// Where it was said.
    pub place: Place,
    /// Light to world space.
    pub light_to_world: Mat4,
    /// Factor on its emission.
    pub scale: f32,
    /// Total power or illuminance asked for (meaning per kind as in pbrt).
    pub power: Option<f32>,
    /// Kind and parameters.
    pub kind: LightKind,
    /// Medium around the light.
    pub medium: Option<MediumId>,
    /// Corners in world space of a rectangle through which alone an infinite light shines.
    pub portal: Option<[Vec3; 4]>,
}

/// Kinds of lights.
#[derive(Clone, Debug)]
pub enum LightKind {
    /// A point that shines equally in all directions; intensity [power per solid angle].
    Point {
        /// Position in light space.
        from: Vec3,
        /// Intensity.
        intensity: SpectrumDescription,
    },
    /// A cone of light.
    Spot {
        /// Position in light space.
        from: Vec3,
        /// Point looked at.
        to: Vec3,
        /// Intensity on the axis.
        intensity: SpectrumDescription,
        /// Half angle of the cone \[degrees\].
        cone_angle: f32,
        /// Width of the soft edge \[degrees\].
        cone_delta_angle: f32,
    },
    /// A point whose intensity is multiplied by a picture over the sphere of directions.
    Goniometric {
        /// Intensity where the picture is 1.
        intensity: SpectrumDescription,
        /// Square equal-area octahedral picture in light space, of which the mean of the components counts.
        image: ImageId,
    },
    /// A point that throws a picture along +z; its first row is at negative y, its first column at negative x.
    Projection {
        /// Picture, whose colours are intensities.
        image: ImageId,
        /// Angle across its shorter side \[degrees\].
        fov: f32,
    },
    /// Parallel light; radiance x solid angle [irradiance on a facing plane].
    Distant {
        /// Where the light comes from, in light space.
        from: Vec3,
        /// Where it goes to.
        to: Vec3,
        /// Irradiance on a plane that faces it.
        irradiance: SpectrumDescription,
    },
    /// The same radiance from all directions.
    Constant {
        /// Radiance.
        radiance: SpectrumDescription,
    },
    /// Radiance from an equal-area octahedral picture, in light space.
    Environment {
        /// Square picture.
        image: ImageId,
    },
}

/// A matter that a reader of a file noticed and that the user should know.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// Where.
    pub place: Option<Place>,
    /// What, and what is done instead.
    pub message: String,
}
