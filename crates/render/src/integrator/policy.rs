//! The policies of exact walks.

use crate::description::{MediumKind, SceneDescription};

/// How exact walks are sampled; the expectation is the same for all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Policy {
    /// Flight by flight.
    Classic,
    /// Over balls of collisions at once ([`moonmilk_walk::jump`]).
    Jump,
    /// Chosen per medium and body: jumps where scattering is isotropic and the body thick, walks split by importance where it is forward, else flights.
    #[default]
    Auto,
}

impl Policy {
    /// All policies.
    pub const ALL: [Self; 3] = [Self::Classic, Self::Jump, Self::Auto];

    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Classic => "classic",
            Self::Jump => "jump",
            Self::Auto => "auto",
        }
    }

    /// Returns how many media of a scene [`Policy::Jump`] walks through flight by flight all the same: those that vary in space.
    pub fn flown(d: &SceneDescription) -> usize {
        d.media.iter().filter(|m| !matches!(m.kind, MediumKind::Homogeneous { .. })).count()
    }
}
