//! Which bodies light is followed into, and how much of it.

use moonmilk_core::{Random, Sampler, Spectrum, Vec2, Vec3, WavelengthMode, Wavelengths};
use moonmilk_geometry::{Bounds, Ray};
use moonmilk_walk::{Medium, Roulette};
use rayon::prelude::*;

use super::{Beam, LIGHT};
use crate::cloud::Lines;
use crate::integrator::policy;
use crate::media::Matter;
use crate::scene::{Boundary, Scene};
use crate::texture::TexturePoint;
use crate::touch;
use crate::window;

/// Vertices per pixel in which a camera sees the body: as few as the first, up to the second where there would not be enough.
const PER_PIXEL: [f64; 2] = [15.0, 60.0];
/// Vertices in a cube of the mean free path: those that are enough, most of them, and most of all.
///
/// Showcase (16 samples, eight seeds), 15 a pixel, then up to 60 for 1.5, 3, 5: variance per sample 5.53, 5.00, 4.63, 4.36 at .643, .650, .692, .747 CPU s. The marble dragon at twice its density, 1.5, 3: .652, .459 at 1.48, 1.74.
const WANTED: f64 = 3.0;
const DENSEST: f64 = 15.0;
const VERTICES: f64 = 1_048_576.0;
/// Rays of the camera that find out where it sees a body.
const LOOKS: u32 = 4096;
/// Walls of clear bodies that such a ray passes at most.
const MOST_CLEAR: u32 = 16;
/// Fewest vertices in a cube of the mean free path. The marble dragon at 1, 1.5, 2, 3 times its density with 15 a pixel has 12, 3.7, 1.5, .5: 4.0, 2.7, 1.8, .7 times the efficiency of flights; with 1.2 at 3 times 1.1.
const ENOUGH: f64 = 1.2;
/// Share of the light that lamps must give. What comes from all around flights find with little noise: the dragon with its lamp 1, .7, .5, .3, .1 times as wide and high has shares of .85, .73, .58, .33, .05, and vertices
/// 4.2, 3.1, 2.0, 1.05, .2 times the efficiency of flights.
const LAMPS: f32 = 0.35;
/// Points of the surface per path of light: each yields two beams to draw from.
const POINTS: f64 = 0.25;
/// Paths that measure how many collisions there are on each.
const PILOT: u32 = 256;
/// Bodies with vertices: of more each would have too few.
const MOST: usize = 16;
/// Size of parts of other surfaces, over the body's, below which what is so near to a ball counts as inside; and most rays and distances that find out whether a body is alone, some 2 us each.
const NEAREST: f32 = 1e-3;
const QUERIES: u32 = 1_000_000;

/// A body that light is followed into.
#[derive(Clone, Debug)]
pub(crate) struct Lit {
    pub shape: u32,
    pub through: Lines,
    /// Lines per sample number, and points of the surface per area that they meet \[1/L^2\].
    pub lines: u32,
    pub points: f64,
    /// Paths of light per sample number.
    pub paths: u32,
    /// n \[1/L^3\].
    pub density: f32,
}

/// Returns the bodies of a scene that light is followed into: homogeneous media that scatter, not mainly forward, behind a boundary of one index, smooth or rough, or none, with nothing else inside.
pub(crate) fn bodies(scene: &Scene) -> Vec<Lit> {
    if scene.hybrid || scene.shifted || scene.lights.is_empty() {
        return vec![];
    }
    let wavelengths = Wavelengths::<4>::sample(WavelengthMode::Hero, 0.5);
    let fit = |shape: u32| {
        let o = &scene.objects[shape as usize];
        let rough = scene.materials.is_rough_dielectric(o.material);
        let bounded = rough || matches!(o.boundary, Boundary::Smooth { .. } | Boundary::Interface);
        let shut = o.body.is_some() && o.hollow && bounded && o.alpha.is_none() && scene.bank(o).is_none();
        if !shut || scene.lights.light_of(shape, 0).is_some() {
            return None;
        }
        let at = TexturePoint { p: o.reach.center(), n: Vec3::Z, uv: Vec2::ZERO };
        let Some(Matter::Homogeneous(medium)) = scene.medium_inside(o, &at, &wavelengths, None) else { return None };
        let scatters = !medium.sigma_s.is_black() && medium.emission.is_none() && medium.g.abs() < window::FORWARD;
        let guided = || policy::guides(scene, &medium, scene.room(shape).depth(), o.reach.center()).is_some();
        let smooth = matches!(o.boundary, Boundary::Smooth { .. });
        // What connections do not find they must not share, nor what light's own paths do not: points and parallel light through a glass.
        let perturbed = scene.materials.perturbs_normals(o.material);
        if smooth && (perturbed || scene.has_clear) && scene.lights.has_unseen() {
            return None;
        }
        let lamps = !(smooth || rough) || scene.lights.share_of_lamps(o.reach.center()) > LAMPS;
        (scatters && lamps && !guided()).then_some((shape, medium))
    };
    let mut found: Vec<(u32, Medium<4>)> = (0..scene.objects.len() as u32).filter_map(fit).take(MOST + 1).collect();
    if found.len() > MOST {
        return vec![];
    }
    found.retain(|body| is_alone(scene, body.0));
    let pixels = pixels(scene, &found);
    let most = VERTICES / pixels.iter().sum::<f64>();
    found
        .iter()
        .zip(pixels)
        .filter_map(|((shape, medium), pixels)| {
            let object = &scene.objects[*shape as usize];
            let through = Lines::around(object.reach);
            let volume = object.volume * f64::from(medium.sigma_t.mean()).powi(3);
            let per_pixel = (WANTED * volume / pixels).clamp(PER_PIXEL[0].min(most), PER_PIXEL[1].min(most));
            let vertices = (pixels * per_pixel).min(volume * DENSEST);
            if pixels == 0.0 || vertices < ENOUGH * volume {
                return None;
            }
            let (points, collisions) = pilot(scene, *shape, &through, medium, &wavelengths)?;
            let paths = (vertices / collisions).ceil().max(1.0);
            let lines = (POINTS * paths / points).ceil().min(f64::from(u32::MAX));
            Some(Lit {
                shape: *shape,
                through,
                lines: lines as u32,
                points: lines / through.area(),
                paths: paths as u32,
                density: (paths * collisions / object.volume) as f32,
            })
        })
        .collect()
}

/// Returns in how many pixels a camera sees each of some bodies first of all, about.
fn pixels(scene: &Scene, bodies: &[(u32, Medium<4>)]) -> Vec<f64> {
    let [width, height] = scene.resolution;
    let seen: Vec<Option<usize>> = (0..LOOKS)
        .into_par_iter()
        .map(|i| {
            let mut rng = Sampler::new(LIGHT, u32::MAX, 0, u64::from(i));
            let ([x, y], lens) = (rng.uniform2(), rng.uniform2());
            let (o, d) = scene.camera.ray(Vec2::new(x * width, y * height), lens);
            // What is clear shows what is behind it.
            let mut ray = Ray::new(o, d);
            for _ in 0..MOST_CLEAR {
                let hit = scene.accel.nearest(&ray)?;
                if !scene.objects[hit.shape as usize].clear {
                    return bodies.iter().position(|b| b.0 == hit.shape);
                }
                ray = Ray::new(ray.o + d * hit.t, d).from_prim(hit.prim);
            }
            None
        })
        .collect();
    let per_look = f64::from(width) * f64::from(height) / f64::from(LOOKS);
    (0..bodies.len()).map(|k| seen.iter().filter(|s| **s == Some(k)).count() as f64 * per_look).collect()
}

/// Returns whether nothing but its medium is inside a body, and it in no other; no where that would take long to find out, and where something comes near its surface from outside.
fn is_alone(scene: &Scene, shape: u32) -> bool {
    let bounds = scene.accel.shape_bounds(shape);
    let object = &scene.objects[shape as usize];
    // What touches it within rounding is outside.
    let core = bounds.grown(-touch::REACH * object.touch);
    let overlapping: Vec<u32> = (0..scene.objects.len() as u32)
        .filter(|&i| i != shape && scene.accel.shape_bounds(i).overlaps(&core))
        .collect();
    let points: Vec<Vec3> = scene.light_points.iter().copied().filter(|p| core.contains(*p)).collect();
    if overlapping.is_empty() && points.is_empty() {
        return true;
    }
    let Some(body) = object.body else { return false };
    let own = scene.accel.shape(shape);
    // Distances to other quadrics are upper bounds only.
    if own.quadric().is_some_and(|q| shape >= scene.accel.world_count() || q.as_ball().is_none()) {
        return false;
    }
    let mut apart = Apart { scene, shape, body, core, least: NEAREST * bounds.extent().length(), budget: QUERIES };
    let on_surface = scene.accel.closest_point_on(body, bounds.center()).map_or(bounds.center(), |c| c.p);
    let in_others = scene.nest_at(on_surface).bodies().iter().any(|b| b.shape != shape);
    !in_others && points.iter().all(|&p| !apart.is_inside(p)) && overlapping.iter().all(|&i| apart.is_off(i))
}

/// The search for parts of other surfaces inside a body.
struct Apart<'a> {
    scene: &'a Scene,
    shape: u32,
    body: moonmilk_geometry::Body,
    /// Box beyond which nothing is inside.
    core: Bounds,
    /// Size of the parts of a surface that are cut no further.
    least: f32,
    /// Queries that may still be made.
    budget: u32,
}

impl Apart<'_> {
    fn is_inside(&self, p: Vec3) -> bool {
        self.scene.nest_at(p).contains(self.shape)
    }

    /// Returns the distance from p to the body's surface; `None` where no more are to be measured.
    fn distance(&mut self, p: Vec3) -> Option<f32> {
        self.budget = self.budget.checked_sub(1)?;
        Some(self.scene.accel.closest_point_on(self.body, p)?.distance)
    }

    /// Returns whether another surface is outside of the body.
    fn is_off(&mut self, other: u32) -> bool {
        let accel = &self.scene.accel;
        match accel.shape(other).quadric() {
            None if accel.shape(self.shape).mesh().is_some() => self.is_mesh_off(other),
            None => (0..accel.shape(other).prim_count()).all(|i| {
                let corners = accel.corners(other, i);
                corners.is_some_and(|c| self.is_triangle_off(c))
            }),
            // A ball beside it, or around it.
            Some(q) => q.as_ball().filter(|_| other < accel.world_count()).is_some_and(|(center, radius)| {
                let (center, radius) = (center.as_vec3(), radius as f32);
                let b = accel.shape_bounds(self.shape);
                let corner = (b.max - center).abs().max((b.min - center).abs());
                let around = corner.length() < radius;
                around || (!self.is_inside(center) && self.distance(center).is_some_and(|d| d > radius))
            }),
        }
    }

    /// Returns whether another mesh is outside of the body, a mesh: no edge of either crosses the other, and no triangle lies inside.
    fn is_mesh_off(&mut self, other: u32) -> bool {
        let (accel, shape, core) = (&self.scene.accel, self.shape, self.core);
        let bounds = accel.shape_bounds(other);
        (0..accel.shape(other).prim_count()).all(|i| {
            let Some(corners) = accel.corners(other, i) else { return false };
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            !Bounds::of(corners).overlaps(&core) || (!self.crosses(corners, shape) && !self.is_inside(middle))
        }) && (0..accel.shape(shape).prim_count()).all(|i| {
            let Some(corners) = accel.corners(shape, i) else { return false };
            !Bounds::of(corners).overlaps(&bounds) || !self.crosses(corners, other)
        })
    }

    /// Returns whether an edge of a triangle crosses the surface of a shape, or may, where no more queries are to be made.
    fn crosses(&mut self, [a, b, c]: [Vec3; 3], shape: u32) -> bool {
        let Some(budget) = self.budget.checked_sub(4) else { return true };
        self.budget = budget;
        [(a, b), (b, c), (c, a)].into_iter().any(|(p, q)| {
            let length = p.distance(q);
            let ray = || Ray::new(p, (q - p) / length).up_to(length);
            length > 0.0 && self.scene.accel.occluded(&ray(), |h| h.shape == shape)
        })
    }

    /// Returns whether a triangle is outside of the body: its surface is farther off than the triangle reaches, or it is that for every quarter.
    fn is_triangle_off(&mut self, [a, b, c]: [Vec3; 3]) -> bool {
        if !Bounds::of([a, b, c]).overlaps(&self.core) {
            return true;
        }
        let middle = (a + b + c) / 3.0;
        let reach = [a, b, c].map(|v| v.distance(middle)).into_iter().fold(0.0, f32::max);
        match self.distance(middle) {
            None => false,
            Some(d) if d > reach => !self.is_inside(middle),
            Some(_) if reach < self.least => false,
            Some(_) => {
                let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| 0.5 * (p + q));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]].into_iter().all(|t| self.is_triangle_off(t))
            }
        }
    }
}

/// Returns the points of a body's surface per line, and the collisions per path of light from all around; `None` where there are none.
fn pilot(scene: &Scene, shape: u32, through: &Lines, medium: &Medium<4>, w: &Wavelengths<4>) -> Option<(f64, f64)> {
    let lines: Vec<(usize, u64, u64)> = (0..PILOT)
        .into_par_iter()
        .map(|j| {
            let mut rng = Sampler::new(LIGHT, shape, 0, u64::from(j));
            let (ray, hits) = through.meet(scene, &mut rng, |s| s == shape);
            let (mut paths, mut collisions, mut vertices) = (0, 0, Vec::new());
            for hit in hits.iter().filter(|h| !h.exiting) {
                let surface = scene.accel.surface(&ray, hit);
                let beam = Beam { hit: *hit, surface, wi: -ray.d, flux: Spectrum::<4>::ONE };
                collisions += beam.walk(scene, medium, w, Roulette::default(), &mut vertices, &mut rng)[0];
                paths += 1;
            }
            (hits.len(), paths, collisions)
        })
        .collect();
    let points: usize = lines.iter().map(|l| l.0).sum();
    let paths: u64 = lines.iter().map(|l| l.1).sum();
    let collisions: u64 = lines.iter().map(|l| l.2).sum();
    (collisions > 0).then(|| (points as f64 / f64::from(PILOT), collisions as f64 / paths as f64))
}
