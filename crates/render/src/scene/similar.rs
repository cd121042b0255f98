//! Homogeneous media exchanged for similar ones: `--subsurface similarity-1` and `similarity-3`.

use moonmilk_walk::{Medium, Similar};

use super::Scene;
use crate::description::{MaterialKind, MediumKind, SceneDescription, Warning};
use crate::media::Matter;

/// How many Legendre moments of scattering similar media keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Similarity {
    /// One: (1 - g) sigma_s isotropic scatterers, see [`Medium::similar`].
    First,
    /// Three, see [`Similar`].
    Third,
}

/// Returns the scatterers of third order for every asymmetry in the scene, by increasing asymmetry.
pub(super) fn scatterers(d: &SceneDescription) -> Vec<Similar> {
    let media = d.media.iter().filter_map(|m| match m.kind {
        MediumKind::Homogeneous { g, .. } => Some(g),
        _ => None,
    });
    let materials = d.materials.iter().filter_map(|m| match m.kind {
        MaterialKind::Subsurface { g, .. } => Some(g),
        _ => None,
    });
    let mut all: Vec<f32> = media.chain(materials).collect();
    all.sort_by(f32::total_cmp);
    all.dedup();
    all.into_iter().filter_map(Similar::new).collect()
}

/// Warns of media that stay what they are.
pub(super) fn warn(d: &SceneDescription, warnings: &mut Vec<Warning>) {
    if d.media.iter().any(|m| !matches!(m.kind, MediumKind::Homogeneous { .. })) {
        let message = "media that differ from place to place are walked through as they are, without similarity".into();
        warnings.push(Warning { place: None, message });
    }
}

impl Scene {
    /// Returns a homogeneous medium as it is walked through.
    pub(super) fn homogeneous<const N: usize>(&self, medium: Medium<N>) -> Matter<N> {
        match self.similar {
            None => Matter::Homogeneous(medium),
            Some(Similarity::First) => Matter::Homogeneous(medium.similar()),
            Some(Similarity::Third) => match self.scatterers.binary_search_by(|s| s.g.total_cmp(&medium.g)) {
                Ok(i) => Matter::Similar(self.scatterers[i].coefficients(&medium), i as u32),
                // All others scatter backwards or alike in all directions: they are similar to themselves.
                Err(_) => Matter::Homogeneous(medium),
            },
        }
    }

    /// Returns scatterers by the number that [`Matter::Similar`] has.
    #[inline]
    pub(crate) fn scatterers(&self, i: u32) -> &Similar {
        &self.scatterers[i as usize]
    }
}
