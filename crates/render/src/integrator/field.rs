//! Paths through media that differ from place to place.

use moonmilk_core::{Sampler, Wavelengths};
use moonmilk_walk::{Outcome, classic, heterogeneous};

use super::{Counters, ENDLESS, Integrator, Light, Path};
use crate::connect;
use crate::description::MediumId;
use crate::interior::Interior;
use crate::manifold::Manifold;
use crate::media::Matter;
use crate::scene::Scene;
use crate::tint::Lanes;

impl Integrator {
    /// Walks through a field until a wall leaves something to decide; returns whether the path goes on.
    ///
    /// Lights of some extent behind the object's own smooth boundary are left to chance: connections through it know homogeneous media only.
    pub(super) fn step_field<const N: usize>(
        &self,
        scene: &Scene,
        path: &mut Path<N>,
        id: MediumId,
        wavelengths: &Wavelengths<N>,
        rng: &mut Sampler,
        light: &mut Light<N>,
        counters: &mut Counters,
    ) -> bool {
        let field = scene.field(id, wavelengths);
        let interior = Interior::new(scene, &path.inside, self.max_depth.is_some(), path.standing, None);
        let collisions = path.walker.collisions;
        let limit = self.max_depth.map_or(ENDLESS as u32, |m| m - path.depth.min(m));
        let manifold = if self.max_depth.is_none() { Manifold::new(scene, &path.inside) } else { None };
        let mut tally = connect::InMedium {
            scene,
            wavelengths,
            light,
            counters,
            interior: &interior,
            inside: &path.inside,
            ambient: path.ambient,
            around: Matter::Field(id),
            connects: scene.lights.samples_in_media() && interior.connects(),
            through: None,
            manifold,
            seen: None,
            window: None,
            copies: Vec::new(),
            lanes: Some(Lanes::of(&path.walker)),
            unseen: 1.0,
            core: None,
        };
        let limits = classic::Limits { roulette: self.roulette, collisions: collisions.saturating_add(limit) };
        let outcome = heterogeneous::walk(&interior, &field, &limits, &mut path.walker, &mut tally, rng);
        tally.settle(&path.walker);
        counters.segments += interior.segments();
        let outcome = match outcome {
            Outcome::Left(Some(exit)) => Outcome::Left(exit),
            Outcome::Left(None) => {
                // Past all matter: what is left is the sky.
                if path.walker.collisions > collisions {
                    path.normal = None;
                }
                self.environment(scene, path, wavelengths, light, counters);
                return false;
            }
            Outcome::Ended => Outcome::Ended,
            Outcome::Lost => Outcome::Lost,
        };
        self.after_walk(scene, path, outcome, collisions, wavelengths, rng, light, counters)
    }
}
