//! What makes a scene unusable.

use thiserror::Error;

use crate::description::Place;
use crate::lights::LightError;
use crate::material::MaterialError;

/// Why a scene cannot be rendered.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A shape is not usable.
    #[error("{place}: {name}: {reason}")]
    Shape {
        /// Where it was said.
        place: Place,
        /// Its name.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A translucent object has holes.
    #[error(
        "{place}: {name} is open: {edges} boundary edges, the first near ({x:.4}, {y:.4}, {z:.4}); light inside would have nowhere to go"
    )]
    Open {
        /// Where it was said.
        place: Place,
        /// Its name.
        name: String,
        /// Number of edges with one triangle.
        edges: usize,
        /// A boundary vertex, x.
        x: f32,
        /// A boundary vertex, y.
        y: f32,
        /// A boundary vertex, z.
        z: f32,
    },
    /// An instance cannot stand where it should.
    #[error("{place}: the transform of this instance of \"{name}\" is singular or not finite")]
    Instance {
        /// Where it was said.
        place: Place,
        /// Name of the object.
        name: String,
    },
    /// A medium is not usable.
    #[error("{place}: medium \"{name}\": {reason}")]
    Medium {
        /// Where it was said.
        place: Place,
        /// Its name.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A light is not usable.
    #[error(transparent)]
    Light(#[from] LightError),
    /// The model cannot render a body.
    #[error("{place}: {name}: the model {model} cannot render it: {reason}")]
    Model {
        /// Where it was said.
        place: Place,
        /// The shape.
        name: String,
        /// The model.
        model: &'static str,
        /// What it rejects.
        reason: String,
    },
    /// A material is not usable.
    #[error(transparent)]
    Material(#[from] MaterialError),
}
