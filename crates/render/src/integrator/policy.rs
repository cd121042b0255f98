//! The policies of exact walks.

use moonmilk_core::Vec3;
use moonmilk_walk::{Guide, Medium};

use crate::description::{MediumKind, SceneDescription};
use crate::integrator::Integrator;
use crate::interior::Interior;
use crate::scene::Scene;

/// Share of the light that comes from lamps above which `auto` does not guide walks: under lamps alone they gain .8 to 1.5 times the efficiency, under a sky and a lamp 2.1 to 4.3.
const MOST_OF_LAMPS: f32 = 0.8;

/// How exact walks are sampled; the expectation is the same for all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Policy {
    /// Flight by flight.
    Classic,
    /// Over balls of collisions at once ([`moonmilk_walk::jump`]).
    Jump,
    /// Towards the nearest wall where the medium absorbs ([`moonmilk_walk::guide`]).
    Guided,
    /// Chosen per medium and body: guided where much is absorbed and a sky shines, jumps in thick bodies, walks split by importance where scattering is forward, two walks from the camera's first boundary where it is not, else flights.
    #[default]
    Auto,
}

impl Policy {
    /// All policies.
    pub const ALL: [Self; 4] = [Self::Classic, Self::Jump, Self::Guided, Self::Auto];

    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Classic => "classic",
            Self::Jump => "jump",
            Self::Guided => "guided",
            Self::Auto => "auto",
        }
    }

    /// Returns how many media of a scene [`Policy::Jump`] and [`Policy::Guided`] walk through flight by flight all the same: those that vary in space. (Guided walks do so where nothing absorbs, too, and outside of closed
    /// bodies.)
    pub fn flown(d: &SceneDescription) -> usize {
        d.media.iter().filter(|m| !matches!(m.kind, MediumKind::Homogeneous { .. })).count()
    }
}

/// Returns what guided walks need in a body of a depth, where they pay at p.
pub(crate) fn guides<const N: usize>(scene: &Scene, medium: &Medium<N>, depth: f32, p: Vec3) -> Option<Guide<N>> {
    // Light of lamps is what connections find, and it does not come from the nearest wall.
    Guide::new(medium).filter(|g| g.pays(depth) && scene.lights.share_of_lamps(p) < MOST_OF_LAMPS)
}

impl Integrator {
    /// Returns what guided walks from p need, if walks are to be guided.
    pub(super) fn guide<const N: usize>(
        &self,
        scene: &Scene,
        medium: &Medium<N>,
        interior: &Interior,
        p: Vec3,
    ) -> Option<Guide<N>> {
        if scene.hybrid || scene.shifted || self.max_depth.is_some() || interior.depth() == 0.0 {
            return None;
        }
        match self.policy {
            Policy::Guided => Guide::new(medium),
            Policy::Auto => guides(scene, medium, interior.depth(), p)
                .filter(|g| g.beats_jumps() || self.jumps(scene, medium).is_none_or(|j| !j.pays(interior.depth()))),
            Policy::Classic | Policy::Jump => None,
        }
    }
}
