//! What can be wrong with a light.

use moonmilk_core::SpectraError;

use crate::description::Place;

/// Why a light was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LightError {
    /// Its spectrum is invalid.
    #[error("{place}: the light's spectrum: {source}")]
    Spectrum {
        /// Where the light was defined.
        place: Place,
        /// What is wrong with it.
        source: SpectraError,
    },
    /// A factor or a power is negative or not finite.
    #[error("{place}: the light's {what} {value} is outside [0, inf)")]
    Value {
        /// Where the light was defined.
        place: Place,
        /// Name of the parameter.
        what: &'static str,
        /// Its value.
        value: f32,
    },
    /// A picture holds values that are not finite, or nothing at all.
    #[error("{place}: picture {name} cannot be a light: it is empty or holds infinite or NaN pixels")]
    Picture {
        /// Where the light was defined.
        place: Place,
        /// Name of the picture.
        name: String,
    },
    /// An environment picture is not square.
    #[error("{place}: environment {name} has {width} x {height} pixels; the equal-area octahedral map is square")]
    NotSquare {
        /// Where the light was defined.
        place: Place,
        /// Name of the picture.
        name: String,
        /// Width \[pixels\].
        width: u32,
        /// Height \[pixels\].
        height: u32,
    },
    /// A light shines from a point to the same point, or its transform flattens space.
    #[error("{place}: the light has no direction: its two points coincide or its transform is singular")]
    Direction {
        /// Where the light was defined.
        place: Place,
    },
    /// The corners of a portal are no rectangle.
    #[error("{place}: the four corners of the portal are not those of a rectangle, in order")]
    Portal {
        /// Where the light was defined.
        place: Place,
    },
    /// A shape has no area to emit from.
    #[error("{place}: {name} cannot emit light: its transform is singular")]
    Shape {
        /// Where the shape was defined.
        place: Place,
        /// Its name.
        name: String,
    },
}
