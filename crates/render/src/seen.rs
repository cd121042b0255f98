//! What the camera sees of translucent bodies, pixel by pixel: medium, local thickness, angle, curvature.
//!
//! Maps that tell where an approximation fails, not parts of a picture: one ray through the middle of each pixel, no lens, no filter.

use moonmilk_core::{Frame, Vec2, Vec3, Wavelengths};
use moonmilk_geometry::{Facing, Ray};
use rayon::prelude::*;

use crate::media::Matter;
use crate::scene::{Boundary, Scene};
use crate::texture::TexturePoint;

/// Red, green and blue.
const RGB: Wavelengths<3> = Wavelengths::Channels { channel: [0, 1, 2] };
/// Clear surfaces (glass around milk) that a ray goes straight through before it gives up.
const CLEAR: usize = 8;

/// What a pixel shows first.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Number of the object in [`Scene::objects`].
    pub object: u32,
    /// Point.
    pub p: Vec3,
    /// Shading normal.
    pub n: Vec3,
    /// Cosine between normal and view: 0 at a silhouette.
    pub cosine: f32,
    /// Local thickness \[L\]: the shortest way to another surface along the negative normal and along four directions at 45 degrees to it.
    pub thickness: f32,
    /// Largest curvature towards a neighbouring pixel on the same object, |dn| / |dp| \[1/L\].
    pub curvature: f32,
    /// Absorption coefficient \[1/L\] at red, green and blue.
    pub sigma_a: [f32; 3],
    /// Scattering coefficient \[1/L\] at red, green and blue.
    pub sigma_s: [f32; 3],
    /// Asymmetry.
    pub g: f32,
}

impl Seen {
    /// Returns the reduced extinction coefficient \[1/L\] of a channel.
    pub fn sigma_t_prime(&self, channel: usize) -> f32 {
        self.sigma_a[channel] + (1.0 - self.g) * self.sigma_s[channel]
    }

    /// Returns the reduced albedo of a channel.
    pub fn alpha_prime(&self, channel: usize) -> f32 {
        (1.0 - self.g) * self.sigma_s[channel] / self.sigma_t_prime(channel)
    }
}

/// Returns what each pixel of a crop (x0, x1, y0, y1) shows, row by row; `None` where that is no body around a homogeneous medium that scatters.
pub fn seen(scene: &Scene, crop: [u32; 4]) -> Vec<Option<Seen>> {
    let [x0, x1, y0, y1] = crop;
    let width = (x1 - x0) as usize;
    let mut map: Vec<Option<Seen>> = (y0..y1)
        .into_par_iter()
        .flat_map_iter(|y| (x0..x1).map(move |x| look(scene, Vec2::new(x as f32 + 0.5, y as f32 + 0.5))))
        .collect();
    // Curvatures by differences, once all points are known.
    let curvatures: Vec<f32> = (0..map.len()).map(|i| curvature(&map, width, i)).collect();
    for (seen, curvature) in map.iter_mut().zip(curvatures) {
        if let Some(s) = seen {
            s.curvature = curvature;
        }
    }
    map
}

fn look(scene: &Scene, film: Vec2) -> Option<Seen> {
    let (o, d) = scene.camera.ray(film, [0.0; 2]);
    let mut ray = Ray::new(o, d);
    for _ in 0..CLEAR {
        let hit = scene.accel.nearest(&ray)?;
        let object = &scene.objects[hit.shape as usize];
        let surface = scene.accel.surface(&ray, &hit);
        let point = TexturePoint { p: surface.p, n: surface.ng, uv: surface.uv };
        let medium = object.body.and_then(|body| Some((body, scene.medium_inside::<3>(object, &point, &RGB, None)?)));
        if let Some((body, Matter::Homogeneous(m) | Matter::Similar(m, _))) = medium
            && !m.sigma_s.is_black()
        {
            let frame = Frame::new(surface.ng);
            let depth = |w: Vec3| {
                let inward = Ray::new(surface.p, w.normalize()).from_prim(hit.prim).facing(Facing::Exiting(body));
                scene.accel.nearest(&inward).map_or(f32::INFINITY, |h| h.t)
            };
            let around = [Vec3::ZERO, frame.s, -frame.s, frame.t, -frame.t];
            let thickness = around.iter().map(|&a| depth(a - frame.n)).fold(f32::INFINITY, f32::min);
            return Some(Seen {
                object: hit.shape,
                p: surface.p,
                n: surface.ns,
                cosine: surface.ns.dot(d).abs(),
                thickness,
                curvature: 0.0,
                sigma_a: m.sigma_a.0,
                sigma_s: m.sigma_s.0,
                g: m.g,
            });
        }
        // Look through what is clear; the bend of the ray is left out.
        if object.boundary == Boundary::Scattering || medium.is_some() {
            return None;
        }
        ray = Ray::new(surface.p, d).from_prim(hit.prim);
    }
    None
}

fn curvature(map: &[Option<Seen>], width: usize, i: usize) -> f32 {
    let Some(here) = &map[i] else {
        return 0.0;
    };
    let x = i % width;
    let neighbours = [
        (x > 0).then(|| i - 1),
        (x + 1 < width).then(|| i + 1),
        i.checked_sub(width),
        (i + width < map.len()).then(|| i + width),
    ];
    neighbours
        .into_iter()
        .flatten()
        .filter_map(|j| map[j].as_ref())
        .filter(|other| other.object == here.object)
        .map(|other| here.n.distance(other.n) / here.p.distance(other.p).max(f32::MIN_POSITIVE))
        .fold(0.0, f32::max)
}
