//! What optics rejects, and the sentence that says why.

/// An error of this crate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{kind}")]
pub struct Error {
    /// What was wrong.
    pub kind: ErrorKind,
}

/// What was wrong.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A quantity is outside its range.
    #[error("{name} = {value} is outside {range}")]
    Range {
        /// Name of the quantity.
        name: &'static str,
        /// The value given.
        value: f32,
        /// The range allowed, in interval notation.
        range: &'static str,
    },
    /// No model has this name.
    #[error("unknown model \"{name}\"; did you mean \"{nearest}\"?")]
    Model {
        /// The name asked for.
        name: String,
        /// The known name that is nearest to it.
        nearest: &'static str,
    },
    /// Legendre moments that no positive phase function has.
    #[error(
        "no positive phase function has the Legendre moments {moments}; a larger sigma_s* / sigma_s or a lower order would be accepted"
    )]
    Moments {
        /// The moments asked for.
        moments: String,
    },
    /// The nodes of a table do not fit.
    #[error(
        "a table of {nodes} cosines and {values} values; equal numbers of at least 2 are accepted, cosines that increase from -1 to 1"
    )]
    Nodes {
        /// Number of cosines.
        nodes: usize,
        /// Number of values.
        values: usize,
    },
    /// No material has this name.
    #[error("unknown material \"{name}\"; did you mean \"{nearest}\"?")]
    Material {
        /// The name asked for.
        name: String,
        /// The known name that is nearest to it.
        nearest: &'static str,
    },
}

impl From<ErrorKind> for Error {
    fn from(kind: ErrorKind) -> Self {
        Self { kind }
    }
}

/// Returns the value if `ok`, else the error that names it and its range.
pub(crate) fn within(name: &'static str, value: f32, ok: bool, range: &'static str) -> Result<f32, Error> {
    if ok { Ok(value) } else { Err(ErrorKind::Range { name, value, range }.into()) }
}
