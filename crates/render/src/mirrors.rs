//! Mirror images of lamps in smooth boundaries that the camera sees: more rays where a pixel holds the edge of one.
//!
//! A lamp of radiance L whose mirror image fills a share of a pixel is met by that share of the pixel's samples, at a weight of R L: where L is a hundred times what comes out of a body, a few hundred pixels have most of
//! a picture's noise, and nothing that a walk does can help. Which pixels these are is found out beforehand by rays through their middles: where a reflected direction, give or take what it differs by from one ray to the
//! next, may meet a lamp. There a sample sends [`SIDE`] squared rays of its own, spread over the pixel filter, each to the boundary and to the lamp and no farther, and its path leaves out what they look for: a lamp
//! that is the first thing met after the reflection at the first boundary. A pixel that is judged wrongly is noisier, not wrong.

use std::sync::OnceLock;

use moonmilk_core::{Random, Sampler, Spectrum, Stream, Vec2, Vec3, Wavelengths};
use moonmilk_geometry::{Hit, Ray, Surface};

use crate::bsdf::Crossing;
use crate::bsdf::boundary::branches;
use crate::integrator::Counters;
use crate::interior::Standing;
use crate::nest::{Meeting, Nest};
use crate::scene::{Boundary, Object, Scene};
use crate::touch;

/// Rays along each side of the square that a sample sends them in. On the marble dragon 4 and 8 leave the same variance per sample, .235 (.305 without), at .86 and .95 CPU s; with a lamp of a hundredth of the area and the same power 3.2 and 2.9.
const SIDE: u32 = 4;
/// The same for finding out whether to.
const PILOT: u32 = 4;
/// Most lamps that are looked for: images of more are everywhere.
const LAMPS: usize = 16;
/// Side of the squares of pixels that are looked at together.
const BLOCK: u32 = 32;
/// Largest angle that reflected directions of one pixel are taken to differ by, and the least \[rad\].
const WIDEST: f32 = 1.0;
const LEAST: f32 = 0.02;

/// What a camera's path looks for on its flight from the camera to the first surface, and from there to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Sight {
    /// Everything.
    #[default]
    All,
    /// Everything, but the mirror images of lamps are left to other rays.
    First,
    /// Everything but a lamp: this is the mirror's branch.
    Mirrored,
}

/// The pixels with edges of mirror images.
#[derive(Debug, Default)]
pub(crate) struct Mirrors {
    /// Spheres around the lamps.
    lamps: Vec<(Vec3, f32)>,
    /// Blocks of pixels in a row, and what is known of each; none where there are no such images.
    across: u32,
    blocks: Vec<OnceLock<Vec<bool>>>,
}

/// Returns the relative index of a boundary whose mirror images other rays may look for, met from outside.
pub(crate) fn reflects(object: &Object, hit: &Hit, nest: &Nest) -> Option<f32> {
    let Boundary::Smooth { eta } = object.boundary else { return None };
    let alone = object.body.is_some() && object.alpha.is_none() && object.touch == 0.0 && !object.fibre;
    let Meeting::True(outer) = nest.meet(object, hit.shape, hit.exiting) else { return None };
    (alone && !hit.exiting && nest.bodies().is_empty() && eta != outer).then_some(eta / outer)
}

/// Where a ray of the camera meets such a boundary: the hit, its surface with the normal of refraction, the index.
fn first(scene: &Scene, o: Vec3, d: Vec3) -> Option<(Hit, Surface, f32)> {
    let nest = Nest::default();
    let (hit, surface, _) = touch::nearest(scene, &nest, Ray::new(o, d))?;
    let object = &scene.objects[hit.shape as usize];
    let eta = reflects(object, &hit, &nest).filter(|_| scene.lights.light_of(hit.shape, hit.index).is_none())?;
    let ns = scene.boundary_normal(object, &surface);
    Some((hit, Surface { ns, ..surface }, eta))
}

/// Returns the lamp that a reflected ray meets first, with its surface.
fn lamp(scene: &Scene, hit: &Hit, p: Vec3, d: Vec3, counters: &mut Counters) -> Option<(u32, Surface)> {
    if !scene.lights.may_meet_surface(p, d) {
        return None;
    }
    counters.shadow_rays += 1;
    let (met, s, _) = touch::nearest(scene, &Nest::default(), Standing::Outside(*hit).ray(scene, p, d))?;
    let light = scene.lights.light_of(met.shape, met.index)?;
    scene.objects[met.shape as usize].alpha.is_none().then_some((light, s))
}

/// A reflected direction, from where, and what it meets.
#[derive(Clone, Copy)]
struct Image {
    shape: u32,
    p: Vec3,
    d: Vec3,
    meets: bool,
}

fn angle(a: Vec3, b: Vec3) -> f32 {
    a.dot(b).clamp(-1.0, 1.0).acos()
}

impl Image {
    fn new(scene: &Scene, o: Vec3, d: Vec3) -> Option<Self> {
        let (hit, s, _) = first(scene, o, d)?;
        let n = if s.ns.dot(d) < 0.0 { s.ns } else { s.ng };
        let r = (d - n * (2.0 * n.dot(d))).normalize();
        let met = lamp(scene, &hit, s.p, r, &mut Counters::default());
        let meets = met.is_some_and(|(l, there)| scene.lights.shines(l, there.ng, -r));
        Some(Self { shape: hit.shape, p: s.p, d: r, meets })
    }

    /// Returns how far off a lamp is from the direction, 0 within the sphere around it.
    fn gap(&self, lamps: &[(Vec3, f32)]) -> f32 {
        let gap = |&(center, radius): &(Vec3, f32)| {
            let to = center - self.p;
            let half = (radius / to.length()).min(1.0).asin();
            (angle(self.d, to.normalize()) - half).max(0.0)
        };
        lamps.iter().map(gap).fold(f32::INFINITY, f32::min)
    }

    /// Returns by how much the directions beside it differ from its own, at least and at most something.
    fn spread(&self, beside: impl Iterator<Item = Option<Self>>) -> f32 {
        let differs = |other: Option<Self>| match other {
            Some(o) if o.shape == self.shape => angle(self.d, o.d),
            _ => LEAST,
        };
        beside.map(differs).fold(LEAST, f32::max).min(WIDEST)
    }
}

/// Returns those of a row-wise map that are beside i, up to eight.
fn beside(images: &[Option<Image>], width: usize, i: usize) -> impl Iterator<Item = Option<Image>> + '_ {
    let (x, y, height) = (i % width, i / width, images.len() / width);
    let rows = y.saturating_sub(1)..(y + 2).min(height);
    rows.flat_map(move |v| (x.saturating_sub(1)..(x + 2).min(width)).map(move |u| images[v * width + u]))
}

impl Mirrors {
    /// Returns the map of a scene, of which no pixel is known yet.
    pub fn new(scene: &Scene) -> Self {
        let lamps: Vec<(Vec3, f32)> = (0..scene.objects.len() as u32)
            .filter(|&i| scene.lights.light_of(i, 0).is_some() && scene.objects[i as usize].alpha.is_none())
            .map(|i| scene.accel.shape_bounds(i))
            .map(|b| (b.center(), 0.5 * b.extent().length()))
            .take(LAMPS + 1)
            .collect();
        let mirror = |o: &Object| matches!(o.boundary, Boundary::Smooth { .. }) && o.body.is_some();
        // Only a camera in vacuum, outside of all bodies.
        let eye = scene.camera.origin();
        let outside = scene.camera_medium.is_none() && scene.nest_at(eye).bodies().is_empty();
        if lamps.is_empty() || lamps.len() > LAMPS || !outside || !scene.objects.iter().any(mirror) {
            return Self::default();
        }
        let [across, down] = scene.resolution.map(|n| (n as u32).div_ceil(BLOCK));
        Self { lamps, across, blocks: (0..across * down).map(|_| OnceLock::new()).collect() }
    }

    /// Returns whether a pixel holds the edge of a mirror image.
    pub fn is_near(&self, scene: &Scene, [x, y]: [u32; 2]) -> bool {
        let block = self.blocks.get((y / BLOCK * self.across + x / BLOCK) as usize);
        // Whoever comes first finds out for the block, alone: threads that wait for each other inside of it would never end.
        let find = || self.find(scene, [x / BLOCK * BLOCK, y / BLOCK * BLOCK]);
        block.is_some_and(|b| b.get_or_init(find)[(y % BLOCK * BLOCK + x % BLOCK) as usize])
    }

    /// Finds out for a block from its first pixel.
    fn find(&self, scene: &Scene, [x0, y0]: [u32; 2]) -> Vec<bool> {
        // Of every pixel next to it the image may reach into one, and spreads are those among pixels next to that.
        const WIDTH: usize = BLOCK as usize + 4;
        let images: Vec<Option<Image>> = (0..WIDTH * WIDTH)
            .map(|i| {
                let [x, y] = [x0 as f32 + (i % WIDTH) as f32 - 1.5, y0 as f32 + (i / WIDTH) as f32 - 1.5];
                let (o, d) = scene.camera.ray(Vec2::new(x, y), [0.5; 2]);
                Image::new(scene, o, d)
            })
            .collect();
        let may: Vec<bool> = (0..images.len())
            .map(|i| images[i].is_some_and(|m| m.gap(&self.lamps) < m.spread(beside(&images, WIDTH, i))))
            .collect();
        (0..BLOCK * BLOCK)
            .map(|i| {
                let (x, y) = (i % BLOCK, i / BLOCK);
                let at = |u: u32, v: u32| may[(y + 1 + v) as usize * WIDTH + (x + 1 + u) as usize];
                (0..3).any(|v| (0..3).any(|u| at(u, v))) && has_edge(scene, &self.lamps, x0 + x, y0 + y)
            })
            .collect()
    }
}

/// Returns whether a pixel holds the edge of a mirror image, by rays in the middle of the strata of its filter.
fn has_edge(scene: &Scene, lamps: &[(Vec3, f32)], x: u32, y: u32) -> bool {
    let images: Vec<Option<Image>> = (0..PILOT * PILOT)
        .map(|i| {
            let u = [i % PILOT, i / PILOT].map(|k| (k as f32 + 0.5) / PILOT as f32);
            let (offset, _) = scene.filter.sample(u);
            let film = Vec2::new(x as f32 + 0.5 + offset[0], y as f32 + 0.5 + offset[1]);
            let (o, d) = scene.camera.ray(film, [0.5; 2]);
            Image::new(scene, o, d)
        })
        .collect();
    let meet = images.iter().filter(|i| i.is_some_and(|i| i.meets)).count();
    let width = PILOT as usize;
    let close = |(i, image): (usize, &Option<Image>)| {
        image.is_some_and(|image| image.gap(lamps) < image.spread(beside(&images, width, i)))
    };
    meet < images.len() && (meet > 0 || images.iter().enumerate().any(close))
}

/// Returns the light of the mirror images that a pixel holds, by rays of its own, with the weights of the filter.
pub(crate) fn images<const N: usize>(
    scene: &Scene,
    pixel: [u32; 2],
    w: &Wavelengths<N>,
    rng: &mut Sampler,
    counters: &mut Counters,
) -> Spectrum<N> {
    let mut rng = Stream::new(&[rng.stream().bits()]);
    let mut sum = Spectrum::ZERO;
    for i in 0..SIDE * SIDE {
        let [a, b] = rng.uniform2();
        let u = [((i % SIDE) as f32 + a) / SIDE as f32, ((i / SIDE) as f32 + b) / SIDE as f32];
        let ([dx, dy], weight) = scene.filter.sample(u);
        let film = Vec2::new(pixel[0] as f32 + 0.5 + dx, pixel[1] as f32 + 0.5 + dy);
        let (o, d) = scene.camera.ray(film, rng.uniform2());
        counters.rays += 1;
        let Some((hit, s, eta)) = first(scene, o, d).filter(|_| scene.nest_at(o).bodies().is_empty()) else { continue };
        for (p, crossing) in branches(-d, s.ng, s.ns, eta) {
            let Crossing::Reflected(r) = crossing else { continue };
            if p > 0.0
                && let Some((light, there)) = lamp(scene, &hit, s.p, r, counters)
            {
                sum += scene.lights.emitted(light, there.uv, there.ng, -r, w) * (p * weight);
            }
        }
    }
    sum * (1.0 / (SIDE * SIDE) as f32)
}
