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
