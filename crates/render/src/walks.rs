//! The ways to walk through bodies, exact and not: what `--subsurface` has besides the models of `moonmilk-optics`.

use moonmilk_optics::profile::{Info, Kind};

use crate::scene::Similarity;

/// A way to walk.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    /// Its description.
    pub info: Info,
    /// The media it walks through in place of those of the scene.
    pub similar: Option<Similarity>,
    /// Whether it leaves out the core of bodies.
    pub hybrid: bool,
    /// Whether it jumps over shifted balls.
    pub shifted: bool,
}

/// All ways, exact first.
pub static WALKS: [Walk; 5] = [
    Walk {
        info: Info {
            name: "path",
            summary: "walks through the medium as it is: exact",
            source: "Miller2019",
            kind: Kind::Whole,
            valid: "everywhere",
            use_when: "it can be afforded; it judges all others.",
            avoid_when: "bodies have thousands of collisions per path and an error of some per cent is allowed.",
        },
        similar: None,
        hybrid: false,
        shifted: false,
    },
    Walk {
        info: Info {
            name: "similarity-1",
            summary: "walks through (1 - g) sigma_s isotropic scatterers: one moment of scattering is kept",
            source: "Wyman1989",
            kind: Kind::Whole,
            valid: "deep inside; half-space of g .8, reduced albedo .9: +7.7 % (index 1), +5.6 % (1.5)",
            use_when: "g is large, bodies are thick and absorb little: 1 / (1 - g) times fewer collisions.",
            avoid_when: "light comes back after a few collisions: thin parts, low albedo, near the light.",
        },
        similar: Some(Similarity::First),
        hybrid: false,
        shifted: false,
    },
    Walk {
        info: Info {
            name: "similarity-3",
            summary: "walks through fewer scatterers that keep three moments of scattering",
            source: "Zhao2014",
            kind: Kind::Whole,
            valid: "half-space of g .8 or .9, reduced albedo .9: -.9 % (index 1), +2.4 % (1.5)",
            use_when: "g is above .5: 2.5 times fewer collisions at .8, 4.4 at .9, a small error.",
            avoid_when: "g is small (nothing is gained), or single scattering is what one looks at: its lobe has another shape.",
        },
        similar: Some(Similarity::Third),
        hybrid: false,
        shifted: false,
    },
    Walk {
        info: Info {
            name: "hybrid",
            summary: "exact walks near the surface, the diffusion equation deeper than two transport mean free paths",
            source: "Li2005",
            kind: Kind::Whole,
            valid: "half-spaces of reduced albedo .9 and .99 within noise (.05 %); a marble dragon 80 transport mean free paths long +.01 +- .16 %",
            use_when: "bodies are many transport mean free paths thick: the cost no longer grows with that.",
            avoid_when: "bodies are thinner than eight transport mean free paths: nothing is gained.",
        },
        similar: None,
        hybrid: true,
        shifted: false,
    },
    Walk {
        info: Info {
            name: "jump-shifted",
            summary: "jumps over balls of the similar isotropic medium, shifted by the mean cosine; flights near the surface",
            source: "Muller1956",
            kind: Kind::Whole,
            valid: "half-spaces of g .5 to .9, reduced albedo .9 to .999: +.1 to +.6 %; a lit ball of g .9, 15 transport mean free paths: +.3 +- .2 %",
            use_when: "g is not 0 and bodies are many transport mean free paths thick: the cost no longer grows with that.",
            avoid_when: "g is 0 (`--walk jump` is exact there); bodies are thinner than six transport mean free paths: nothing is gained.",
        },
        similar: None,
        hybrid: false,
        shifted: true,
    },
];

/// Returns the way of a name.
pub fn find(name: &str) -> Option<&'static Walk> {
    WALKS.iter().find(|w| w.info.name == name)
}
