//! Two theorems measured on an object of the user: the white furnace, and the mean path length 4 eta^2 V / S.
//!
//! The object stands alone under uniform light of radiance 1, with a medium that has its own extinction and asymmetry but
//! absorbs nothing. Then it cannot be seen: every direction shows 1, unless light is lost in it. And light that enters stays
//! for 4 eta^2 V / S on average, whatever the shape and the medium \[BlancoFournier2003\], unless the surface does not enclose the volume
//! that it seems to.

use std::f64::consts::PI;

use moonmilk_core::estimate::Accumulator;
use moonmilk_core::random::SOBOL_DIMENSIONS;
use moonmilk_core::{Estimate, Frame, Random, Sampler, Stream, Vec3, WavelengthMode, Wavelengths};
use moonmilk_walk::Roulette;
use rayon::prelude::*;

use super::Body;
use crate::description::{
    LightDescription, LightKind, MaterialDescription, MaterialKind, MediumDescription, MediumInterface, MediumKind,
    SceneDescription, SpectrumDescription,
};
use crate::integrator::{Counters, Integrator, Light};
use crate::scene::{OpenPolicy, Scene, SceneError, SceneOptions, build_shape};

/// Share of absorption that emission needs and that f32 does not notice.
const UNNOTICED: f32 = 1.0 / 1_073_741_824.0;

/// Density above which a measurement would take minutes \[mean free paths\].
const DENSEST: f64 = 1e5;

/// Fewest and most rays of a measurement.
const RAYS: [f64; 2] = [500.0, 200_000.0];

/// Parts of a measurement, summed apart, so that the result does not depend on threads.
const PARTS: u64 = 256;

/// What was measured on one object.
#[derive(Clone, Copy, Debug)]
pub struct Furnace {
    /// Mean radiance under uniform light of radiance 1; exactly 1 if nothing is lost.
    pub radiance: Estimate,
    /// Mean path length over 4 eta^2 V / S; 1 for a closed body.
    pub path_length: Estimate,
    /// Number of mean free paths of the measurement: sigma_t 4 V / S in the green.
    pub size: f64,
    /// Whether the theorems hold exactly: the boundary is smooth. Rough ones lose light by their model.
    pub exact: bool,
    /// What the transport did in both measurements.
    pub counters: Counters,
}

/// Why an object was not measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unmeasured {
    /// Its surface encloses no volume.
    Open,
    /// Its medium is empty in the green.
    Empty,
    /// It is more than 1e5 mean free paths thick.
    Dense,
}

/// Measures an object of a scene with about `budget` collisions per theorem.
///
/// *Errors*: those of [`Scene::new`].
pub fn furnace(
    d: &SceneDescription,
    body: &Body,
    budget: f64,
    seed: u64,
) -> Result<Result<Furnace, Unmeasured>, SceneError> {
    let Some(chord) = body.chord() else {
        return Ok(Err(Unmeasured::Open));
    };
    // The green of the middle between the thinnest and the densest place.
    let sigma = 0.5 * (body.sigma_t[0][1] + body.sigma_t[1][1]);
    let size = f64::from(sigma) * chord;
    if !(sigma > 0.0 && sigma.is_finite()) {
        return Ok(Err(Unmeasured::Empty));
    }
    if size > DENSEST {
        return Ok(Err(Unmeasured::Dense));
    }
    let n = (budget / (1.0 + size * body.eta * body.eta)).clamp(RAYS[0], RAYS[1]) as u64;
    let scattering = |sigma_a, emission| MediumKind::Homogeneous {
        sigma_a: SpectrumDescription::Constant(sigma_a),
        sigma_s: SpectrumDescription::Constant(sigma),
        scale: 1.0,
        g: body.g,
        emission,
    };
    let white = alone(d, body, scattering(0.0, None), 1.0)?;
    let (radiance, mut counters) = measure(&white, n, seed, Roulette { threshold: 0.0, survivor: 1.0 });
    // A medium that emits radiance 1 per unit length shows the length of each path, over eta^2 as all radiance from inside.
    let sigma_a = sigma * UNNOTICED;
    let unit = (SpectrumDescription::Rgb([1.0; 3]), 1.0 / sigma_a);
    let shining = alone(d, body, scattering(sigma_a, Some(unit)), 0.0)?;
    let (length, more) = measure(&shining, n, seed ^ 1, Roulette::default());
    counters.merge(&more);
    // Rays of uniform light through a sphere of radius B collect 4 V / S on S / (4 pi B^2) of them.
    let exact = body.volume / (PI * shining.reach.powi(2));
    let path_length = Estimate { mean: length.mean / exact, std_err: length.std_err / exact, n: length.n };
    Ok(Ok(Furnace { radiance, path_length, size, exact: body.smooth, counters }))
}

/// A scene of one object, with the sphere around it.
struct Alone {
    scene: Scene,
    center: Vec3,
    reach: f64,
}

/// Makes the scene of one object with a medium of its own, under uniform light.
fn alone(d: &SceneDescription, body: &Body, kind: MediumKind, radiance: f32) -> Result<Alone, SceneError> {
    let mut shape = body.source.clone();
    let own = &d.materials[shape.material];
    // A subsurface material is a dielectric around a medium.
    let boundary = match &own.kind {
        MaterialKind::Subsurface { eta, roughness, .. } => {
            MaterialKind::Dielectric { eta: SpectrumDescription::Constant(*eta), roughness: *roughness }
        }
        other => other.clone(),
    };
    let mut alone = d.clone();
    alone.shapes.clear();
    alone.objects.clear();
    alone.instances.clear();
    alone.lights.clear();
    alone.media.clear();
    alone.camera.medium = None;
    alone.materials.push(MaterialDescription { kind: boundary, ..own.clone() });
    shape.material = alone.materials.len() - 1;
    shape.media = Some(MediumInterface { inside: Some(0), outside: None });
    shape.area_light = None;
    let world = build_shape(&shape, &mut Vec::new())?;
    shape.reverse_orientation ^= world.volume() < 0.0;
    let bounds = world.bounds();
    alone.media.push(MediumDescription { name: body.medium.clone(), place: body.place.clone(), kind });
    alone.shapes.push(shape);
    if radiance > 0.0 {
        alone.lights.push(LightDescription {
            place: body.place.clone(),
            light_to_world: moonmilk_core::Mat4::IDENTITY,
            scale: 1.0,
            power: None,
            kind: LightKind::Constant { radiance: SpectrumDescription::Rgb([radiance; 3]) },
            portal: None,
            medium: None,
        });
    }
    let (scene, _) = Scene::new(&alone, &SceneOptions { open: OpenPolicy::Kill, ..Default::default() })?;
    Ok(Alone { scene, center: bounds.center(), reach: 0.5005 * f64::from(bounds.extent().length()) })
}

/// Returns the mean radiance of n rays of uniform light through the sphere around the object.
fn measure(alone: &Alone, n: u64, seed: u64, roulette: Roulette) -> (Estimate, Counters) {
    let integrator = Integrator::new(seed, WavelengthMode::MONO, roulette, None);
    let w = Wavelengths::<1>::Fixed(550.0);
    let parts: Vec<(Accumulator, Counters)> = (0..PARTS)
        .into_par_iter()
        .map(|part| {
            let (mut sum, mut counters) = (Accumulator::default(), Counters::default());
            for i in n * part / PARTS..n * (part + 1) / PARTS {
                let (o, d) = uniform_ray(seed, i, alone);
                // Every path has a stream of its own: their spread is that of independent samples.
                let mut rng = Sampler::new(seed, i as u32, (i >> 32) as u32, 0);
                rng.skip_to(SOBOL_DIMENSIONS);
                let mut light = Light::default();
                integrator.trace(&alone.scene, o, d, &w, &mut rng, &mut light, &mut counters);
                sum.add(light.orders.iter().map(|l| f64::from(l[0])).sum());
            }
            (sum, counters)
        })
        .collect();
    let (mut sum, mut counters) = (Accumulator::default(), Counters::default());
    for (s, c) in &parts {
        sum.merge(s);
        counters.merge(c);
    }
    (sum.estimate(), counters)
}

/// Returns a ray of uniform light into the sphere: uniform entry point, cosine-distributed direction.
fn uniform_ray(seed: u64, i: u64, alone: &Alone) -> (Vec3, Vec3) {
    let mut rng = Stream::new(&[seed, 0xf0, i]);
    let u = rng.uniform2();
    let z = 1.0 - 2.0 * u[0];
    let r = (4.0 * u[0] * (1.0 - u[0])).sqrt();
    let (s, c) = (std::f32::consts::TAU * u[1]).sin_cos();
    let n = Vec3::new(r * c, r * s, z);
    let v = rng.uniform2();
    let (r, (s, c)) = (v[0].sqrt(), (std::f32::consts::TAU * v[1]).sin_cos());
    let d = Frame::new(-n).to_world(Vec3::new(r * c, r * s, (1.0 - v[0]).sqrt())).normalize();
    (alone.center + n * alone.reach as f32, d)
}
