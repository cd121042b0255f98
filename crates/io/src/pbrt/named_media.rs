//! Named media of pbrt, from the table in `moonmilk-optics`, spelled exactly as pbrt spells them.

use moonmilk_optics::materials::MATERIALS;

/// Absorption and reduced scattering coefficient of a named medium [1/mm]; the latter goes with g = 0.
pub(crate) fn find(name: &str) -> Option<([f32; 3], [f32; 3])> {
    MATERIALS.iter().find(|material| material.name == name).map(|material| (material.sigma_a, material.sigma_s_prime))
}

/// All names.
pub(crate) fn names() -> Vec<&'static str> {
    MATERIALS.iter().map(|material| material.name).collect()
}
