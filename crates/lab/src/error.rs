//! What the laboratory rejects.

/// Why an experiment cannot be done.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A quantity is outside its range.
    #[error("{name} = {value} is outside {range}")]
    Range {
        /// Name of the quantity, with the layer it belongs to.
        name: String,
        /// The value given.
        value: f64,
        /// The range allowed, in interval notation or words.
        range: &'static str,
    },
    /// There is no layer.
    #[error("an experiment needs at least one layer")]
    NoLayers,
    /// There is no body.
    #[error("an experiment needs at least one body with a medium")]
    NoBodies,
    /// A body's surface encloses no volume.
    #[error("{body}: its surface is open; a body needs a closed one")]
    Open {
        /// Name of the body.
        body: String,
    },
    /// A body's normals point inwards.
    #[error("{body}: its surface is inside out (volume {volume})")]
    InsideOut {
        /// Name of the body.
        body: String,
        /// Its signed volume.
        volume: f64,
    },
    /// Two surfaces cut each other, or one is within the other.
    #[error("{a} and {b} overlap or touch: bodies and detectors must be apart")]
    Overlap {
        /// Name of one.
        a: String,
        /// Name of the other.
        b: String,
    },
    /// A source stands in a clear refractive body, where light may be reflected for ever.
    #[error("{body}: the light is inside of a clear refractive body, where it may be reflected for ever")]
    Trapped {
        /// Name of the body.
        body: String,
    },
    /// Too many cells are to be recorded.
    #[error("{cells} cells are to be recorded, and {most} are the most: fewer bins or fewer axes together")]
    TooManyCells {
        /// The number asked for.
        cells: usize,
        /// The largest number allowed.
        most: usize,
    },
}

/// Returns an error unless `ok`.
pub(crate) fn within(name: impl Into<String>, value: f64, ok: bool, range: &'static str) -> Result<(), Error> {
    if ok { Ok(()) } else { Err(Error::Range { name: name.into(), value, range }) }
}
