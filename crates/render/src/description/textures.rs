//! Textures and their mappings, as a file says them.

use moonmilk_core::{Mat4, Vec2};

use super::*;

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
