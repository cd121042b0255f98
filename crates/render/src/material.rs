//! Materials: from a description to what light meets at one point of a surface.
//!
//! [`Materials::new`] validates and prepares what does not vary (indices, tables); [`Materials::resolve`] evaluates textures
//! at a point and returns the BSDF there. A `subsurface` material is a boundary ([`Materials::smooth_eta`]) around a medium
//! ([`Materials::medium_at`]). Parameters mean what they mean in pbrt-v4; where that is not obvious it is said beside them.

use std::cell::Cell;

use moonmilk_core::upsampling::sample_unbounded;
use moonmilk_core::{Frame, Spectra, Vec2, Vec3, Wavelengths};
use moonmilk_geometry::Surface;
use moonmilk_optics::AlbedoTable;
use moonmilk_walk::Medium;
use thiserror::Error;

use crate::bsdf::ggx::{SMOOTH_ALPHA, roughness_to_alpha};
use crate::bsdf::{Base, Bsdf, Conductor, Dielectric, Diffuse, DiffuseTransmission, Ggx, Hair, Layered, Shaded};
use crate::description::{
    ConductorColor, FloatTextureId, HairAbsorption, IndexSpectrum, MaterialId, MaterialKind, Place, Roughness,
    SceneDescription, SpectrumTextureId, SubsurfaceMedium,
};
use crate::texture::{Role, TexturePoint, Textures, property};

/// Step of the parameters with which a displacement is differentiated, pbrt-v4's where it knows no better.
const BUMP_STEP: f32 = 5e-4;

/// Absorption of the pigments of hair at concentration 1, linear sRGB, as pbrt-v4 (`bxdfs.cpp`) after \[DEon2011b\].
const EUMELANIN: [f32; 3] = [0.419, 0.697, 1.37];
const PHEOMELANIN: [f32; 3] = [0.187, 0.4, 1.05];

/// Why a material or texture is not usable.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}{reason}", .place.as_ref().map(|p| format!("{p}: ")).unwrap_or_default())]
pub struct MaterialError {
    /// Where it was said, if known.
    pub place: Option<Place>,
    /// What is wrong.
    pub reason: String,
}

impl MaterialError {
    pub(crate) fn texture(reason: String) -> Self {
        Self { place: None, reason }
    }
}

/// The index of a dielectric, and whether it depends on the wavelength.
#[derive(Clone, Debug)]
struct Index {
    spectrum: Spectra,
    dispersive: bool,
}

impl Index {
    /// Returns the hero's index and whether the other lanes have different ones.
    #[inline]
    fn at<const N: usize>(&self, w: &Wavelengths<N>) -> (f32, bool) {
        let s = self.spectrum.sample(w);
        (s[0], self.dispersive && !s.is_gray())
    }
}

/// A material with what was prepared for it.
#[derive(Clone, Debug)]
struct Prepared {
    kind: MaterialKind,
    displacement: Option<FloatTextureId>,
    normal_map: Option<usize>,
    /// Index of a dielectric or of a coat.
    index: Option<Index>,
    /// Inverse albedo of a `subsurface` given by reflectance.
    albedo: Option<AlbedoTable>,
    /// Diffuse internal reflectance of a coat that is the same everywhere.
    internal: Option<f32>,
    /// Maximum of an albedo that is cut at 1.
    cut: Option<f32>,
}

/// The materials of a scene.
#[derive(Clone, Debug)]
pub struct Materials {
    list: Vec<Prepared>,
    smooth_eta: Vec<Option<f32>>,
}

impl Materials {
    /// Prepares and validates the materials of a scene.
    ///
    /// *Errors*: missing textures or materials, a `mix` that contains itself, reflectances outside \[0, 1\], indices that are not
    /// positive, |g| of 1 or more, and for a `subsurface` by reflectance an index outside \[1, 3\]; each with the material's place.
    pub fn new(d: &SceneDescription, textures: &Textures) -> Result<Self, MaterialError> {
        let mut list = Vec::with_capacity(d.materials.len());
        for (id, m) in d.materials.iter().enumerate() {
            let prepared = prepare(d, id, textures).map_err(|reason| MaterialError {
                place: Some(m.place.clone()),
                reason: format!("material {}: {reason}", m.name.as_deref().unwrap_or("without name")),
            })?;
            list.push(prepared);
        }
        let smooth_eta = list.iter().map(|m| smooth_eta(m, textures)).collect();
        Ok(Self { list, smooth_eta })
    }

    /// Returns whether some boundary refracts colours apart.
    pub(crate) fn disperses(&self) -> bool {
        self.list.iter().any(|m| m.index.as_ref().is_some_and(|i| i.dispersive))
    }

    /// Returns the materials with a measured albedo that exceeds 1 and is cut there, with its maximum.
    pub(crate) fn cuts(&self) -> impl Iterator<Item = (MaterialId, f32)> {
        self.list.iter().enumerate().filter_map(|(id, m)| m.cut.map(|x| (id, x)))
    }

    /// Returns inside / outside index of a `dielectric` or `subsurface` that is smooth everywhere and has one index for all wavelengths: the
    /// boundaries that [`crate::bsdf::cross`] handles. `None` for all others.
    #[inline]
    pub fn smooth_eta(&self, id: MaterialId) -> Option<f32> {
        self.smooth_eta[id]
    }

    /// Returns whether the material is a `dielectric` or `subsurface` that is rough somewhere and has one index for all wavelengths.
    pub(crate) fn is_rough_dielectric(&self, id: MaterialId) -> bool {
        let m = &self.list[id];
        let refracts = matches!(m.kind, MaterialKind::Dielectric { .. } | MaterialKind::Subsurface { .. });
        refracts && self.smooth_eta[id].is_none() && m.index.as_ref().is_some_and(|i| !i.dispersive)
    }

    /// Returns the index of a `dielectric` or `subsurface`, inside / outside, at 550 nm if it varies; 1 for all others.
    pub fn index(&self, id: MaterialId) -> f32 {
        let m = &self.list[id];
        match (&m.kind, &m.index) {
            (MaterialKind::Dielectric { .. } | MaterialKind::Subsurface { .. }, Some(i)) => i.spectrum.eval(550.0),
            _ => 1.0,
        }
    }

    /// Returns whether the material is hair: light that enters such a fibre leaves it on any side, so that its walls stop nothing from inside.
    pub fn is_fibre(&self, id: MaterialId) -> bool {
        match &self.list[id].kind {
            MaterialKind::Hair { .. } => true,
            MaterialKind::Mix { materials, .. } => materials.iter().all(|&part| self.is_fibre(part)),
            _ => false,
        }
    }

    /// Returns whether the material perturbs shading normals.
    pub fn perturbs_normals(&self, id: MaterialId) -> bool {
        self.list[id].displacement.is_some() || self.list[id].normal_map.is_some()
    }

    /// Returns the shading normal, perturbed by normal map or displacement; always on the side of `surface.ng`.
    ///
    /// A displacement t moves the surface along its normal; its tangents become `dp/du + n dt/du`, `dp/dv + n dt/dv`, with differences
    /// over steps of 5e-4 in u and v (the curvature of the base surface is left out).
    pub fn shading_normal(&self, id: MaterialId, textures: &Textures, surface: &Surface, at: &TexturePoint) -> Vec3 {
        let m = &self.list[id];
        let perturbed = if let Some(image) = m.normal_map {
            textures.normal(image, at.uv).and_then(|c| {
                let local = Vec3::from(c) * 2.0 - Vec3::ONE;
                Frame::with_tangent(surface.ns, surface.dpdu).to_world(local).try_normalize()
            })
        } else if let Some(t) = m.displacement {
            let here = textures.eval_float(t, at);
            let moved = |du: f32, dv: f32| TexturePoint {
                p: at.p + surface.dpdu * du + surface.dpdv * dv,
                uv: at.uv + Vec2::new(du, dv),
                ..*at
            };
            let slope_u = (textures.eval_float(t, &moved(BUMP_STEP, 0.0)) - here) / BUMP_STEP;
            let slope_v = (textures.eval_float(t, &moved(0.0, BUMP_STEP)) - here) / BUMP_STEP;
            let (u, v) = (surface.dpdu + surface.ns * slope_u, surface.dpdv + surface.ns * slope_v);
            let n = u.cross(v);
            (if n.dot(surface.ns) < 0.0 { -n } else { n }).try_normalize()
        } else {
            None
        };
        match perturbed {
            Some(n) if n.dot(surface.ng) > 0.0 => n,
            _ => surface.ns,
        }
    }

    /// Returns the BSDF at a point for the wavelengths of a path; `u` in (0, 1) chooses within mixtures and keys the walks of coats.
    ///
    /// An interface, which should never be asked, is a boundary of equal indices.
    pub fn resolve<const N: usize>(
        &self,
        id: MaterialId,
        textures: &Textures,
        surface: &Surface,
        at: &TexturePoint,
        w: &Wavelengths<N>,
        mut u: f32,
    ) -> Shaded<N> {
        // Choose within mixtures, stretching what is left of the variate.
        let mut id = id;
        while let MaterialKind::Mix { materials, amount } = &self.list[id].kind {
            let p = textures.eval_float(*amount, at).clamp(0.0, 1.0);
            if u < p {
                (id, u) = (materials[1], u / p);
            } else {
                (id, u) = (materials[0], (u - p) / (1.0 - p));
            }
        }
        let ns = if self.perturbs_normals(id) { self.shading_normal(id, textures, surface, at) } else { surface.ns };
        Shaded { bsdf: self.bsdf(id, textures, at, w, u), frame: Frame::with_tangent(ns, surface.dpdu), ng: surface.ng }
    }

    /// Returns the BSDF of a material that is not a mixture; `u` keys the walks of coats, which so differ from sample to sample.
    fn bsdf<const N: usize>(
        &self,
        id: MaterialId,
        t: &Textures,
        at: &TexturePoint,
        w: &Wavelengths<N>,
        u: f32,
    ) -> Bsdf<N> {
        let m = &self.list[id];
        let albedo = |id: SpectrumTextureId| t.eval_spectrum(id, at, w, Role::Albedo);
        let dielectric = |ggx: Option<Ggx>| {
            let (eta, dispersive) = m.index.as_ref().map_or((1.0, false), |i| i.at(w));
            Dielectric { eta, ggx, dispersive }
        };
        let conductor = |color: &ConductorColor, roughness: &Roughness| {
            let ggx = ggx(roughness, t, at);
            match color {
                ConductorColor::Index { eta, k } => {
                    let value = |id| t.eval_spectrum(id, at, w, Role::Unbounded);
                    Conductor { eta: value(*eta), k: value(*k), ggx }
                }
                ConductorColor::Reflectance(r) => Conductor::from_reflectance(albedo(*r), ggx),
            }
        };
        let layered = |coat: Dielectric, base: Base<N>, thickness, g, layer, max_depth, samples| {
            let thickness = t.eval_float(thickness, at).max(f32::MIN_POSITIVE);
            // Only a smooth coat over a diffuse base has a closed form that needs this.
            let internal = match base {
                Base::Diffuse(_) if coat.ggx.is_none() => {
                    m.internal.unwrap_or_else(|| Layered::<N>::internal_reflectance(&coat, thickness))
                }
                _ => 0.0,
            };
            let g = t.eval_float(g, at).clamp(-0.999, 0.999);
            let seed = u64::from(u.to_bits());
            Bsdf::Layered(Layered {
                coat,
                base,
                thickness,
                g,
                albedo: albedo(layer),
                max_depth,
                samples,
                seed,
                internal,
            })
        };
        match &m.kind {
            MaterialKind::Diffuse { reflectance } | MaterialKind::StandIn { reflectance } => {
                Bsdf::Diffuse(Diffuse { reflectance: albedo(*reflectance) })
            }
            MaterialKind::DiffuseTransmission { reflectance, transmittance, scale } => {
                Bsdf::DiffuseTransmission(DiffuseTransmission {
                    reflectance: albedo(*reflectance) * *scale,
                    transmittance: albedo(*transmittance) * *scale,
                })
            }
            MaterialKind::Conductor { color, roughness } => Bsdf::Conductor(conductor(color, roughness)),
            MaterialKind::Dielectric { roughness, .. } | MaterialKind::Subsurface { roughness, .. } => {
                Bsdf::Dielectric(dielectric(ggx(roughness, t, at)))
            }
            MaterialKind::ThinDielectric { .. } => Bsdf::ThinDielectric(dielectric(None).eta),
            MaterialKind::CoatedDiffuse {
                reflectance,
                roughness,
                thickness,
                g,
                albedo: layer,
                max_depth,
                samples,
                ..
            } => {
                let base = Base::Diffuse(Diffuse { reflectance: albedo(*reflectance) });
                layered(dielectric(ggx(roughness, t, at)), base, *thickness, *g, *layer, *max_depth, *samples)
            }
            MaterialKind::CoatedConductor {
                interface_roughness,
                thickness,
                g,
                albedo: layer,
                conductor: color,
                conductor_roughness,
                max_depth,
                samples,
                ..
            } => {
                // The metal borders on the coat: its index is relative to it.
                let coat = dielectric(ggx(interface_roughness, t, at));
                let mut metal = conductor(color, conductor_roughness);
                metal.eta /= coat.eta;
                metal.k /= coat.eta;
                layered(coat, Base::Conductor(metal), *thickness, *g, *layer, *max_depth, *samples)
            }
            MaterialKind::Hair { absorption, eta, beta_m, beta_n, alpha } => {
                // Textures may leave the domain of the fits; pbrt-v4 takes its ends.
                let rough = |id| t.eval_float(id, at).clamp(0.01, 1.0);
                let beta_n = rough(*beta_n);
                let sigma_a = match absorption {
                    HairAbsorption::Coefficient(s) => t.eval_spectrum(*s, at, w, Role::Unbounded),
                    HairAbsorption::Reflectance(r) => Hair::absorption_of(albedo(*r), beta_n),
                    HairAbsorption::Pigments { eumelanin, pheomelanin } => {
                        let (e, p) = (t.eval_float(*eumelanin, at).max(0.0), t.eval_float(*pheomelanin, at).max(0.0));
                        sample_unbounded(std::array::from_fn(|c| e * EUMELANIN[c] + p * PHEOMELANIN[c]), w)
                    }
                };
                let eta = t.eval_float(*eta, at).max(1e-3);
                Bsdf::Hair(Hair::new(sigma_a, eta, rough(*beta_m), beta_n, t.eval_float(*alpha, at).to_radians()))
            }
            MaterialKind::Interface | MaterialKind::Mix { .. } => Bsdf::Dielectric(dielectric(None)),
        }
    }

    /// Returns the medium of a `subsurface` material as found at a point of its surface; `None` for all others and for an empty one.
    ///
    /// `scale` multiplies coefficients, or the mean free path if the medium is given by its reflectance (as in pbrt-v4). There,
    /// the single-scattering albedo is the exact inverse of the half-space albedo ([`moonmilk_optics::inversion`]).
    pub fn medium_at<const N: usize>(
        &self,
        id: MaterialId,
        t: &Textures,
        at: &TexturePoint,
        w: &Wavelengths<N>,
    ) -> Option<Medium<N>> {
        let m = &self.list[id];
        let MaterialKind::Subsurface { medium, scale, g, .. } = &m.kind else {
            return None;
        };
        let value = |id: SpectrumTextureId, role| t.eval_spectrum(id, at, w, role);
        let (sigma_a, sigma_s) = match medium {
            SubsurfaceMedium::Coefficients { sigma_a, sigma_s } => {
                (value(*sigma_a, Role::Unbounded) * *scale, value(*sigma_s, Role::Unbounded) * *scale)
            }
            SubsurfaceMedium::Reflectance { reflectance, mfp } => {
                let table = m.albedo.as_ref().expect("prepared for this form");
                // Texels may say a mean free path of 0; its limit is an opaque body, kept finite.
                let mfp = (value(*mfp, Role::Unbounded) * *scale).map(|l| l.max(1e-20));
                table.coefficients(value(*reflectance, Role::Albedo), mfp)
            }
        };
        let medium = Medium::new(sigma_a, sigma_s, *g);
        (!medium.sigma_t.is_black()).then_some(medium)
    }
}

/// Returns the microfacets of a roughness at a point.
#[inline]
fn ggx(r: &Roughness, t: &Textures, at: &TexturePoint) -> Option<Ggx> {
    Ggx::new(Vec2::new(
        roughness_to_alpha(t.eval_float(r.u, at), r.remap),
        roughness_to_alpha(t.eval_float(r.v, at), r.remap),
    ))
}

fn smooth_eta(m: &Prepared, t: &Textures) -> Option<f32> {
    let (MaterialKind::Dielectric { roughness, .. } | MaterialKind::Subsurface { roughness, .. }) = &m.kind else {
        return None;
    };
    let smooth = |id| t.constant_float(id).is_some_and(|r| roughness_to_alpha(r, roughness.remap) < SMOOTH_ALPHA);
    let index = m.index.as_ref()?;
    (smooth(roughness.u) && smooth(roughness.v) && !index.dispersive).then(|| index.spectrum.eval(550.0))
}

/// Validates one material and computes what does not vary.
fn prepare(d: &SceneDescription, id: MaterialId, t: &Textures) -> Result<Prepared, String> {
    let m = &d.materials[id];
    let cut = Cell::new(None);
    let albedo = |id: SpectrumTextureId| {
        cut.set(t.cut_of_albedo(id).or(cut.get()));
        t.check_spectrum(id, Role::Albedo)
    };
    let value = |id: SpectrumTextureId| t.check_spectrum(id, Role::Unbounded);
    let float = |id: FloatTextureId| t.check_float(id);
    let rough = |r: &Roughness| float(r.u).and_then(|()| float(r.v));
    let color = |c: &ConductorColor| match c {
        ConductorColor::Index { eta, k } => value(*eta).and_then(|()| value(*k)),
        ConductorColor::Reflectance(r) => albedo(*r),
    };
    let walk = |depth: u32, samples: u32| match (depth, samples) {
        (0, _) | (_, 0) => Err(format!("a coat needs at least one sample and depth 1, not {samples} and {depth}")),
        _ => Ok(()),
    };
    let mut prepared = Prepared {
        kind: m.kind.clone(),
        displacement: m.displacement,
        normal_map: m.normal_map,
        index: None,
        albedo: None,
        internal: None,
        cut: None,
    };
    m.displacement.map_or(Ok(()), float)?;
    match &m.kind {
        MaterialKind::Interface => {}
        MaterialKind::Diffuse { reflectance } | MaterialKind::StandIn { reflectance } => albedo(*reflectance)?,
        MaterialKind::DiffuseTransmission { reflectance, transmittance, scale } => {
            albedo(*reflectance).and_then(|()| albedo(*transmittance))?;
            if !(*scale >= 0.0 && scale.is_finite()) {
                return Err(format!("scale = {scale} is outside [0, inf)"));
            }
        }
        MaterialKind::CoatedDiffuse {
            reflectance,
            roughness,
            thickness,
            eta,
            g,
            albedo: layer,
            max_depth,
            samples,
        } => {
            albedo(*reflectance).and_then(|()| albedo(*layer)).and_then(|()| rough(roughness))?;
            float(*thickness).and_then(|()| float(*g)).and_then(|()| walk(*max_depth, *samples))?;
            let coat = index(eta)?;
            if let (Some(d), false) = (t.constant_float(*thickness), coat.dispersive) {
                let eta = coat.spectrum.eval(550.0);
                let coat = Dielectric { eta, ggx: None, dispersive: false };
                prepared.internal = Some(Layered::<1>::internal_reflectance(&coat, d.max(f32::MIN_POSITIVE)));
            }
            prepared.index = Some(coat);
        }
        MaterialKind::CoatedConductor {
            interface_roughness,
            thickness,
            interface_eta,
            g,
            albedo: layer,
            conductor,
            conductor_roughness,
            max_depth,
            samples,
        } => {
            rough(interface_roughness).and_then(|()| rough(conductor_roughness)).and_then(|()| color(conductor))?;
            float(*thickness)
                .and_then(|()| float(*g))
                .and_then(|()| albedo(*layer))
                .and_then(|()| walk(*max_depth, *samples))?;
            prepared.index = Some(index(interface_eta)?);
        }
        MaterialKind::Conductor { color: c, roughness } => color(c).and_then(|()| rough(roughness))?,
        MaterialKind::Dielectric { eta, roughness } => {
            rough(roughness)?;
            prepared.index = Some(index(eta)?);
        }
        MaterialKind::ThinDielectric { eta } => prepared.index = Some(index(eta)?),
        MaterialKind::Subsurface { medium, scale, g, eta, roughness } => {
            rough(roughness)?;
            if !(*scale >= 0.0 && scale.is_finite()) {
                return Err(format!("scale = {scale} is outside [0, inf)"));
            }
            if !(*g > -1.0 && *g < 1.0) {
                return Err(format!("g = {g} is outside (-1, 1)"));
            }
            prepared.index = Some(index(&IndexSpectrum::Constant(*eta))?);
            match medium {
                SubsurfaceMedium::Coefficients { sigma_a, sigma_s } => {
                    value(*sigma_a).and_then(|()| value(*sigma_s))?
                }
                SubsurfaceMedium::Reflectance { reflectance, mfp } => {
                    albedo(*reflectance).and_then(|()| value(*mfp))?;
                    prepared.albedo =
                        Some(AlbedoTable::new(f64::from(*eta), f64::from(*g)).map_err(|e| e.to_string())?);
                }
            }
        }
        MaterialKind::Hair { absorption, eta, beta_m, beta_n, alpha } => {
            [eta, beta_m, beta_n, alpha].into_iter().try_for_each(|&id| float(id))?;
            for (id, what) in [(beta_m, "beta_m"), (beta_n, "beta_n")] {
                if let Some(x) = t.constant_float(*id).filter(|x| !(*x > 0.0 && *x <= 1.0)) {
                    return Err(format!("{what} = {x} is outside (0, 1]"));
                }
            }
            match absorption {
                HairAbsorption::Coefficient(s) => value(*s)?,
                HairAbsorption::Reflectance(r) => albedo(*r)?,
                HairAbsorption::Pigments { eumelanin, pheomelanin } => {
                    float(*eumelanin).and_then(|()| float(*pheomelanin))?;
                }
            }
        }
        MaterialKind::Mix { amount, .. } => {
            float(*amount)?;
            acyclic(d, id, &mut vec![Mark::Unknown; d.materials.len()])?;
        }
    }
    prepared.cut = cut.get();
    Ok(prepared)
}

/// What is known of a material while mixtures are followed.
#[derive(Clone, Copy, PartialEq)]
enum Mark {
    Unknown,
    OnThePath,
    Ends,
}

/// Checks that a material exists and that following mixtures from it ends.
fn acyclic(d: &SceneDescription, id: MaterialId, marks: &mut [Mark]) -> Result<(), String> {
    match d.materials.get(id).map(|m| &m.kind) {
        None => Err(format!("a mixture names material {id}, which does not exist")),
        Some(MaterialKind::Mix { materials, .. }) => match marks[id] {
            Mark::OnThePath => Err("a mixture contains itself".into()),
            Mark::Ends => Ok(()),
            Mark::Unknown => {
                marks[id] = Mark::OnThePath;
                materials.iter().try_for_each(|&part| acyclic(d, part, marks))?;
                marks[id] = Mark::Ends;
                Ok(())
            }
        },
        Some(_) => Ok(()),
    }
}

fn index(eta: &IndexSpectrum) -> Result<Index, String> {
    let spectrum = property(eta).map_err(|e| format!("eta: {e}"))?;
    let rgb = spectrum.rgb();
    if !(0..=40).all(|i| spectrum.eval(380.0 + 10.0 * i as f32) > 0.0) || rgb.iter().any(|&x| x <= 0.0) {
        return Err("eta must be positive at every wavelength".into());
    }
    let dispersive = !matches!(spectrum, Spectra::Constant(_));
    Ok(Index { spectrum, dispersive })
}

#[cfg(test)]
pub(crate) mod tests;
