//! All lights of a scene as one: choose a light and a direction towards it, and the density of that choice for any direction.
//!
//! Three groups share the samples: the light tree (surfaces, points and spots: `tree`), the environment (constant radiance
//! and pictures, one mixture: `environment`) and each distant light. Half of the samples go to the groups in equal parts, half in
//! proportion to the irradiance that each may cause at the point; a group that provably cannot contribute gets none.
//!
//! Densities include the probability of the choice of the light. They are functions of the reference point (position and normal) and
//! the direction alone, so that [`Lights::pdf_hit`] and [`Lights::pdf_environment`] return exactly what [`Lights::sample`] would.
//!
//! **The normal.** `Some(n)`: only light from the side of n counts (n . wi > 0); directions below may never be chosen. `None`: light from
//! all sides counts, as in a medium and at boundaries that transmit; there the even part of the environment is never chosen and left to chance, which finds it with less noise and without rays.

mod aimed;
mod bounds;
mod distribution;
mod emission;
mod emitters;
mod environment;
mod error;
pub mod octahedral;
mod portal;
mod punctual;
mod spherical_triangle;
mod surface;
#[cfg(test)]
mod tests;
mod tree;
mod unseen;

use moonmilk_core::random::mix;
use moonmilk_core::{Spectrum, Vec2, Vec3, Wavelengths};

pub use aimed::Aimed;
pub use emission::emission;
pub use emitters::{DEFAULT_UVS, surfaces_of};
pub use error::LightError;
pub use punctual::position;
pub use surface::Surface;
pub use unseen::{Lamp, Target};

use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::Arc;

use emission::{Emission, Picture, factor};
use environment::{Environment, PictureLight};
use portal::Portal;
use punctual::{Distant, Punctual};
use tree::LightTree;
use unseen::Unseen;

use crate::description::{
    AreaLightDescription, FloatTexture, FloatTextureId, ImageId, LightDescription, LightKind, SceneDescription,
};

/// Share of the samples that goes to the groups in equal parts: bounds the loss where the estimates of irradiance are bad.
const EQUAL_SHARE: f64 = 0.5;

/// All lights of a scene.
#[derive(Debug, Default)]
pub struct Lights {
    /// Lights with a position: surfaces first, in the order of their shapes, then points and spots.
    placed: Vec<Placed>,
    tree: LightTree,
    emissions: Vec<Emission>,
    /// For each shape, the number of its first light.
    first_of_shape: Vec<Option<u32>>,
    environment: Environment,
    distant: Vec<Distant>,
    /// Box around all lights that have a surface.
    surfaces: Option<(Vec3, Vec3)>,
    unseen: Unseen,
}

#[derive(Debug)]
enum Placed {
    Surface { surface: Surface, emission: u32, two_sided: bool, cut: Cut },
    Punctual(Punctual),
}

/// How much of a light's surface is there.
#[derive(Clone, Copy, Debug)]
enum Cut {
    /// All of it.
    Whole,
    /// By an opacity.
    Alpha(FloatTextureId),
    /// No ray finds it: an opacity of 0 everywhere makes an invisible lamp, as in pbrt-v4.
    Hidden,
}

/// A direction in which light may arrive, and how it was chosen.
#[derive(Clone, Copy, Debug)]
pub struct LightSample<const N: usize> {
    /// Radiance that arrives from `wi` if nothing is in the way; for a delta light, irradiance on a plane that faces it.
    pub radiance: Spectrum<N>,
    /// Unit direction from the reference point towards the light.
    pub wi: Vec3,
    /// Distance to the light; infinite for distant ones.
    pub distance: f32,
    /// Solid angle density including the choice of the light [1/sr]; for a delta light the probability of the choice alone.
    pub pdf: f32,
    /// Whether the light has a single direction, which nothing else can find.
    pub is_delta: bool,
    /// Number of the light, `u32::MAX` for lights at infinity.
    pub light: u32,
    /// The point of the light; meaningless if `distance` is infinite.
    pub point: Vec3,
    /// Texture coordinates of that point.
    pub uv: Vec2,
    /// Normal of the emitting side there.
    pub front: Vec3,
    /// Opacity of the light's surface: the sample counts with its value at the point.
    pub alpha: Option<FloatTextureId>,
}

impl Lights {
    /// Builds the lights of a scene from its shapes' own geometry, see [`surfaces_of`].
    ///
    /// *Errors*: invalid spectra, factors and pictures; emitting shapes without area.
    pub fn of_scene(scene: &SceneDescription) -> Result<Self, LightError> {
        let emitting = scene.shapes.iter().enumerate().filter(|(_, s)| s.area_light.is_some());
        let surfaces = emitting.map(|(i, s)| Ok((i, surfaces_of(s)?))).collect::<Result<Vec<_>, LightError>>()?;
        Self::new(scene, surfaces)
    }

    /// Builds the lights of a scene from surfaces in world space, given with the number of the shape that they belong to: those of
    /// a shape in the order of its primitives.
    ///
    /// *Errors*: invalid spectra, factors and pictures. Shapes without an area light are ignored.
    pub fn new(
        scene: &SceneDescription,
        surfaces: impl IntoIterator<Item = (usize, Vec<Surface>)>,
    ) -> Result<Self, LightError> {
        let mut lights = Self { first_of_shape: vec![None; scene.shapes.len()], ..Self::default() };
        let mut pictures = HashMap::new();
        for (shape, surfaces) in surfaces {
            let Some(s) = scene.shapes.get(shape) else { continue };
            if let Some(light) = &s.area_light {
                lights.first_of_shape[shape] = Some(lights.placed.len() as u32);
                lights.add_surfaces(scene, light, surfaces, s.alpha, &mut pictures)?;
            }
        }
        for light in &scene.lights {
            lights.add_light(scene, light)?;
        }
        let means: Vec<f64> = lights.emissions.iter().map(Emission::mean).collect();
        let bounds: Vec<_> = lights
            .placed
            .iter()
            .map(|l| match l {
                Placed::Surface { surface, emission, two_sided, .. } => {
                    Some(surface.bounds(means[*emission as usize], *two_sided))
                }
                Placed::Punctual(p) => Some(p.bounds()),
            })
            .collect();
        for (light, bounds) in lights.placed.iter().zip(&bounds) {
            if let (Placed::Surface { .. }, Some(b)) = (light, bounds) {
                let all = lights.surfaces.unwrap_or((b.min, b.max));
                lights.surfaces = Some((all.0.min(b.min), all.1.max(b.max)));
            }
        }
        lights.unseen = Unseen::new(&lights.placed, &bounds);
        lights.tree = LightTree::new(&bounds);
        Ok(lights)
    }

    fn add_surfaces(
        &mut self,
        scene: &SceneDescription,
        light: &AreaLightDescription,
        surfaces: Vec<Surface>,
        alpha: Option<FloatTextureId>,
        pictures: &mut HashMap<ImageId, Arc<Picture>>,
    ) -> Result<(), LightError> {
        let area: f64 = surfaces.iter().map(Surface::area).sum();
        let sides = if light.two_sided { 2.0 } else { 1.0 };
        let emission = match light.image {
            Some(id) => {
                let picture = match pictures.get(&id) {
                    Some(p) => Arc::clone(p),
                    None => Arc::new(Picture::new(&scene.images[id], &light.place)?),
                };
                pictures.insert(id, Arc::clone(&picture));
                let f = factor(light.scale, light.power, sides * area * PI * picture.luminance(), &light.place)?;
                Emission::Picture(picture, f)
            }
            None => {
                let f = factor(light.scale, light.power, sides * area * PI, &light.place)?;
                Emission::Uniform(emission(&light.radiance, f, &light.place)?)
            }
        };
        let number = self.emissions.len() as u32;
        self.emissions.push(emission);
        let cut = match alpha {
            None => Cut::Whole,
            Some(id) => match scene.float_textures.get(id) {
                Some(FloatTexture::Constant(a)) if *a <= 0.0 => Cut::Hidden,
                _ => Cut::Alpha(id),
            },
        };
        let placed = |surface| Placed::Surface { surface, emission: number, two_sided: light.two_sided, cut };
        self.placed.extend(surfaces.into_iter().map(placed));
        Ok(())
    }

    fn add_light(&mut self, scene: &SceneDescription, light: &LightDescription) -> Result<(), LightError> {
        match &light.kind {
            LightKind::Point { .. }
            | LightKind::Spot { .. }
            | LightKind::Goniometric { .. }
            | LightKind::Projection { .. } => {
                self.placed.push(Placed::Punctual(Punctual::new(light, &scene.images)?));
            }
            LightKind::Distant { .. } => self.distant.push(Distant::new(light)?),
            LightKind::Constant { radiance } => {
                let f = factor(light.scale, light.power, PI, &light.place)?;
                let radiance = emission(radiance, f, &light.place)?;
                match light.portal {
                    Some(p) => self.environment.add_constant_behind(Portal::new(p, &light.place)?, radiance),
                    None => self.environment.add_constant(radiance),
                }
            }
            LightKind::Environment { image } => {
                let image = &scene.images[*image];
                let picture = PictureLight::new(image, &light.light_to_world, light.scale, light.power, &light.place)?;
                match light.portal {
                    Some(p) => self.environment.add_picture_behind(Portal::new(p, &light.place)?, picture),
                    None => self.environment.add_picture(picture),
                }
            }
        }
        Ok(())
    }

    /// Returns whether there is no light at all.
    pub fn is_empty(&self) -> bool {
        self.tree.is_empty() && self.distant.is_empty() && !self.has_environment()
    }

    /// Returns whether [`Lights::sample`] may find anything from a point without a normal.
    pub fn samples_in_media(&self) -> bool {
        !self.tree.is_empty() || !self.distant.is_empty() || self.aims_at_environment()
    }

    /// Returns whether rays that escape may find light.
    pub fn has_environment(&self) -> bool {
        self.environment.importance() > 0.0
    }

    /// Returns the number of lights that have a position.
    pub fn placed_count(&self) -> usize {
        self.placed.len()
    }

    /// Returns the light of a primitive (triangle of a mesh, else 0) of a shape.
    #[inline]
    pub fn light_of(&self, shape: u32, primitive: u32) -> Option<u32> {
        self.first_of_shape.get(shape as usize).copied().flatten().map(|first| first + primitive)
    }

    /// Chooses a light and a direction from p towards it, for three uniform variates: the first chooses the light.
    ///
    /// `None` if no light can contribute, or the one chosen shows its back. For the normal see the top of this module.
    pub fn sample<const N: usize>(
        &self,
        p: Vec3,
        n: Option<Vec3>,
        wavelengths: &Wavelengths<N>,
        u: [f32; 3],
    ) -> Option<LightSample<N>> {
        let shares = self.shares(p, n);
        let mut choice = refined(u);
        let u = [f64::from(u[1]), f64::from(u[2])];

        let share = shares.of(shares.tree);
        if choice < share {
            return self.sample_placed(p, n, wavelengths, choice / share, u, share);
        }
        choice -= share;
        let share = shares.of(shares.environment);
        if choice < share {
            if n.is_none() {
                let (wi, pdf) = self.environment.aim(p, choice / share, u)?;
                let radiance = self.environment.aimed_radiance(p, wi, wavelengths);
                return at_infinity(radiance, wi, share as f32 * pdf, false);
            }
            let wi = self.environment.sample(p, n, choice / share, u)?;
            let pdf = share as f32 * self.environment.pdf(p, n, wi);
            let radiance = self.environment.radiance(p, wi, wavelengths);
            return at_infinity(radiance, wi, pdf, false);
        }
        choice -= share;
        for light in &self.distant {
            let share = shares.of(f64::from(light.importance(n)));
            if choice < share {
                return at_infinity(light.irradiance(wavelengths), light.towards, share as f32, true);
            }
            choice -= share;
        }
        None
    }

    fn sample_placed<const N: usize>(
        &self,
        p: Vec3,
        n: Option<Vec3>,
        wavelengths: &Wavelengths<N>,
        choice: f64,
        u: [f64; 2],
        share: f64,
    ) -> Option<LightSample<N>> {
        let (light, probability) = self.tree.sample(p, n, choice)?;
        let probability = share * f64::from(probability);
        match &self.placed[light as usize] {
            Placed::Surface { surface, emission, two_sided, cut } => {
                let s = surface.sample(p, u)?;
                if !two_sided && s.front.dot(s.wi) >= 0.0 {
                    return None;
                }
                let radiance = self.emissions[*emission as usize].at(s.uv, wavelengths);
                let pdf = (probability * s.pdf) as f32;
                (pdf > 0.0 && pdf.is_finite()).then_some(LightSample {
                    radiance,
                    wi: s.wi,
                    distance: s.distance,
                    pdf,
                    is_delta: matches!(cut, Cut::Hidden),
                    light,
                    point: s.point,
                    uv: s.uv,
                    front: s.front,
                    alpha: if let Cut::Alpha(id) = cut { Some(*id) } else { None },
                })
            }
            Placed::Punctual(lamp) => {
                let (irradiance, wi, distance) = lamp.sample(p, wavelengths)?;
                Some(LightSample {
                    radiance: irradiance,
                    wi,
                    distance,
                    pdf: probability as f32,
                    is_delta: true,
                    light,
                    point: lamp.position(),
                    uv: Vec2::ZERO,
                    front: -wi,
                    alpha: None,
                })
            }
        }
    }

    /// Returns the density with which [`Lights::sample`] from (p, n) yields the direction to the point q of a light's surface.
    ///
    /// q is where the ray from p first meets that surface. 0 for lights that no ray can hit.
    pub fn pdf_hit(&self, p: Vec3, n: Option<Vec3>, light: u32, q: Vec3) -> f32 {
        match self.placed.get(light as usize) {
            Some(Placed::Surface { surface, .. }) => {
                (f64::from(self.probability(p, n, light)) * surface.pdf(p, q)) as f32
            }
            _ => 0.0,
        }
    }

    /// Returns the probability with which [`Lights::sample`] from (p, n) takes a light that has a position.
    pub fn probability(&self, p: Vec3, n: Option<Vec3>, light: u32) -> f32 {
        let shares = self.shares(p, n);
        shares.of(shares.tree) as f32 * self.tree.probability(p, n, light)
    }

    /// Returns the radiance that leaves a light's surface at texture coordinates `uv` towards the unit direction `w_out`.
    ///
    /// `ng` is the normal of the hit; it decides for curved surfaces only, flat ones know their front. A hidden lamp (opacity 0) is not
    /// to be asked: no path stops at it.
    pub fn emitted<const N: usize>(
        &self,
        light: u32,
        uv: Vec2,
        ng: Vec3,
        w_out: Vec3,
        wavelengths: &Wavelengths<N>,
    ) -> Spectrum<N> {
        match self.placed.get(light as usize) {
            Some(Placed::Surface { surface, emission, two_sided, .. })
                if *two_sided || surface.emits_towards(w_out, ng) =>
            {
                self.emissions[*emission as usize].at(uv, wavelengths)
            }
            _ => Spectrum::ZERO,
        }
    }

    /// Returns the radiance that arrives from infinity at p, from where the unit direction `d` leaves the scene.
    #[inline]
    pub fn environment<const N: usize>(&self, p: Vec3, d: Vec3, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        self.environment.radiance(p, d, wavelengths)
    }

    /// Returns the density with which [`Lights::sample`] from (p, n) yields the direction `d` to infinity.
    pub fn pdf_environment(&self, p: Vec3, n: Option<Vec3>, d: Vec3) -> f32 {
        if !self.has_environment() {
            return 0.0;
        }
        let shares = self.shares(p, n);
        let share = shares.of(shares.environment) as f32;
        match n {
            None if share > 0.0 => share * self.environment.aimed_pdf(p, d),
            None => 0.0,
            Some(_) => share * self.environment.pdf(p, n, d),
        }
    }

    /// Estimates what each group may contribute at a point.
    #[inline]
    fn shares(&self, p: Vec3, n: Option<Vec3>) -> Shares {
        let environment = match n {
            None => self.environment.aimed_importance(),
            Some(_) => self.environment.importance(),
        };
        self.shares_with(p, n, environment)
    }

    #[inline]
    fn shares_with(&self, p: Vec3, n: Option<Vec3>, environment: f32) -> Shares {
        let (tree, environment) = (f64::from(self.tree.importance(p, n)), f64::from(environment));
        let mut shares = Shares { tree, environment, sum: 0.0, count: 0.0 };
        let distant = self.distant.iter().map(|l| f64::from(l.importance(n)));
        for e in [tree, environment].into_iter().chain(distant).filter(|&e| e > 0.0) {
            shares.sum += e;
            shares.count += 1.0;
        }
        shares
    }
}

/// Estimates of irradiance of the groups of lights at a point.
struct Shares {
    tree: f64,
    environment: f64,
    sum: f64,
    count: f64,
}

impl Shares {
    /// Returns the share of the samples of a group with estimate e; the shares of all groups add up to 1.
    #[inline]
    fn of(&self, e: f64) -> f64 {
        if e <= 0.0 {
            0.0
        } else if self.sum.is_finite() {
            EQUAL_SHARE / self.count + (1.0 - EQUAL_SHARE) * e / self.sum
        } else {
            1.0 / self.count
        }
    }
}

fn at_infinity<const N: usize>(radiance: Spectrum<N>, wi: Vec3, pdf: f32, is_delta: bool) -> Option<LightSample<N>> {
    (pdf > 0.0 && pdf.is_finite()).then_some(LightSample {
        radiance,
        wi,
        distance: f32::INFINITY,
        pdf,
        is_delta,
        light: u32::MAX,
        point: Vec3::ZERO,
        uv: Vec2::ZERO,
        front: -wi,
        alpha: None,
    })
}

/// Returns the first variate with digits below its 2^-23, taken from a hash of the other two.
///
/// A walk down the light tree stretches the variate by 1 / probability; without further digits, lights of probability 1e-7
/// would be chosen always or never.
fn refined(u: [f32; 3]) -> f64 {
    let hash = mix(u64::from(u[1].to_bits()), u64::from(u[2].to_bits()));
    let fraction = (hash >> 11) as f64 / (1u64 << 53) as f64;
    (f64::from(u[0]) + (fraction - 0.5) / f64::from(1 << 23)).clamp(0.0, 1.0 - f64::EPSILON)
}
