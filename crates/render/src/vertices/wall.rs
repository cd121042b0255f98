//! How light's paths go into a body and turn at its wall.

use moonmilk_core::{Random, Sampler, Spectrum, Vec3, Wavelengths};
use moonmilk_geometry::Surface;

use crate::bsdf::{Bsdf, Crossing, Kind, cross};
use crate::nest::Meeting;
use crate::scene::{Boundary, Object, Scene};
use crate::texture::TexturePoint;
use crate::through;

/// The boundary of a body, as light's paths cross it.
#[derive(Clone, Copy)]
pub(super) enum Wall {
    /// Nothing, or nothing but a change of medium.
    None,
    /// A smooth one of this relative index.
    Smooth(f32),
    /// A rough one, and the index beyond where its own is against vacuum.
    Rough(f32),
}

impl Wall {
    /// Returns the boundary of an object to what is outside.
    pub fn of(scene: &Scene, object: &Object, outside: Meeting) -> Self {
        match (object.boundary, outside) {
            (Boundary::Smooth { eta }, Meeting::True(outer)) => Self::Smooth(eta / outer),
            (Boundary::Scattering, Meeting::True(outer)) if scene.materials.is_rough_dielectric(object.material) => {
                Self::Rough(outer)
            }
            _ => Self::None,
        }
    }

    /// Returns how light that comes from outside, from the direction `wi`, goes on inside, and with what share of its flux; `None` if it does not.
    pub fn enter<const N: usize>(
        self,
        scene: &Scene,
        object: &Object,
        s: &Surface,
        wi: Vec3,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
    ) -> Option<(Vec3, Spectrum<N>)> {
        match self {
            Self::None => Some((-wi, Spectrum::ONE)),
            Self::Smooth(eta) => {
                let u = rng.uniform();
                let ns = scene.boundary_normal(object, s);
                through::transmit(wi, s.ng, ns, eta, || u).map(|(d, _, share)| (d, Spectrum::splat(share)))
            }
            Self::Rough(outer) => {
                let (d, share, kind) = scatter(scene, object, outer, s, wi, w, rng)?;
                (kind == Kind::Transmission).then_some((d, share))
            }
        }
    }

    /// Returns how light that flies along d inside goes on from the wall, and with what share; `None` if it leaves.
    pub fn turn<const N: usize>(
        self,
        scene: &Scene,
        object: &Object,
        s: &Surface,
        d: Vec3,
        w: &Wavelengths<N>,
        rng: &mut Sampler,
    ) -> Option<(Vec3, Spectrum<N>)> {
        match self {
            Self::None => None,
            Self::Smooth(eta) => {
                let ns = scene.boundary_normal(object, s);
                match cross(-d, s.ng, ns, eta, rng) {
                    Crossing::Reflected(d) => Some((d, Spectrum::ONE)),
                    Crossing::Transmitted(_) => None,
                }
            }
            Self::Rough(outer) => {
                let (d, share, kind) = scatter(scene, object, outer, s, -d, w, rng)?;
                (kind == Kind::Reflection).then_some((d, share))
            }
        }
    }
}

/// Draws where a rough boundary sends light from the direction `wi`, and returns its share of the flux: where a camera's path from `wo` has the factor f(wo, wi) |wi . ns|,
///
/// $$ \frac{f(\omega_o, \omega_i)\, |\omega_i \cdot n_s|}{|\omega_i \cdot n_g|} \cdot \frac{|\omega_o \cdot n_g|}{p(\omega_o)} , \qquad f(\omega_o, \omega_i) = \frac{n_o^2}{n_i^2} f(\omega_i, \omega_o) . $$
fn scatter<const N: usize>(
    scene: &Scene,
    object: &Object,
    outer: f32,
    surface: &Surface,
    wi: Vec3,
    w: &Wavelengths<N>,
    rng: &mut Sampler,
) -> Option<(Vec3, Spectrum<N>, Kind)> {
    let at = TexturePoint { p: surface.p, n: surface.ng, uv: surface.uv };
    let mut bsdf = scene.materials.resolve(object.material, &scene.textures, surface, &at, w, 0.0);
    if let Bsdf::Dielectric(d) = &mut bsdf.bsdf {
        d.eta /= outer;
    }
    let (uc, u) = (rng.uniform(), rng.uniform2());
    let s = bsdf.sample(wi, uc, u)?;
    let cosines = bsdf.cos(wi) * s.wi.dot(surface.ng).abs() / wi.dot(surface.ng).abs();
    let share = s.f * (s.eta * s.eta * cosines / s.pdf);
    (share.is_finite() && !share.is_black()).then_some((s.wi, share, s.kind))
}
