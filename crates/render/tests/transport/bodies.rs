//! The closed bodies that furnace and path lengths are measured on.

use std::sync::Arc;

use moonmilk_core::{Mat4, Vec3};
use moonmilk_geometry::Mesh;
use moonmilk_geometry::generate::{bumpy_sphere, sheet};
use moonmilk_render::description::GeometryDescription;

use crate::common::{World, ball, flat, smooth};

/// A body with what theorems about it need.
pub struct Body {
    pub name: &'static str,
    pub geometry: Arc<GeometryDescription>,
    pub volume: f64,
    pub surface: f64,
    /// Radius of a sphere around the origin that encloses it.
    pub reach: f32,
}

impl Body {
    fn of_mesh(name: &'static str, mesh: &Mesh, smooth_normals: bool) -> Self {
        Self {
            name,
            geometry: if smooth_normals { smooth(mesh) } else { flat(mesh) },
            volume: mesh.volume(),
            surface: mesh.area(),
            reach: 1.001 * mesh.positions().iter().map(|p| p.length()).fold(0.0, f32::max),
        }
    }

    pub fn ball() -> Self {
        let unit = std::f64::consts::PI * 4.0;
        Self { name: "ball", geometry: ball(1.0), volume: unit / 3.0, surface: unit, reach: 1.001 }
    }

    /// 1280 triangles, concave in places.
    pub fn bumpy() -> Self {
        Self::of_mesh("bumpy mesh", &bumpy_sphere(3, 0.3), false)
    }

    /// 320 triangles whose shading normals differ from the true ones by 20 degrees and more.
    pub fn smooth() -> Self {
        Self::of_mesh("bumpy mesh with smooth normals", &bumpy_sphere(2, 0.3), true)
    }

    /// A wavy sheet, fifty times as wide as thick.
    pub fn sheet() -> Self {
        let mesh = sheet(12, 0.02).transformed(&Mat4::from_translation(Vec3::new(-0.5, -0.5, 0.0)));
        Self::of_mesh("sheet", &mesh.expect("a translation keeps a mesh valid"), false)
    }

    pub fn all() -> [Self; 4] {
        [Self::ball(), Self::bumpy(), Self::smooth(), Self::sheet()]
    }

    /// Returns the scattering coefficient at which the mean chord 4 V / S is `tau` mean free paths long.
    pub fn sigma_s(&self, tau: f64) -> f32 {
        (tau * self.surface / (4.0 * self.volume)) as f32
    }

    /// Returns a world with this body, filled with a medium that only scatters.
    pub fn world(&self, tau: f64, g: f32, eta: f32) -> World {
        let mut world = World::new();
        let medium = world.medium(0.0, self.sigma_s(tau), g);
        let boundary = world.dielectric(eta, 0.0);
        world.body(&self.geometry, boundary, Some(medium), None);
        world
    }
}

/// Index and scattering coefficient of the outer and inner shell.
pub const SHELLS: [(f32, f32); 2] = [(1.33, 3.0), (1.5, 8.0)];

/// Returns a mesh in a mesh around an empty ball, two media of different indices with smooth boundaries; the radius of a sphere around
/// it; and the volumes of the media.
pub fn shells() -> (World, f32, [f64; 2]) {
    let (outer, inner, hollow) = (bumpy_sphere(3, 0.2), bumpy_sphere(2, 0.1), 0.3f32);
    let inner = inner.transformed(&Mat4::from_scale(Vec3::splat(0.6))).expect("a scaling keeps a mesh valid");
    let [(n1, s1), (n2, s2)] = SHELLS;
    let mut world = World::new();
    let media = [world.medium(0.0, s1, 0.6), world.medium(0.0, s2, -0.3)];
    let boundaries = [n1, n2 / n1, 1.0 / n2].map(|eta| world.dielectric(eta, 0.0));
    let body = Body::of_mesh("shells", &outer, false);
    world.body(&body.geometry, boundaries[0], Some(media[0]), None);
    world.body(&smooth(&inner), boundaries[1], Some(media[1]), Some(media[0]));
    world.body(&ball(hollow), boundaries[2], None, Some(media[1]));
    let cavity = 4.0 / 3.0 * std::f64::consts::PI * f64::from(hollow).powi(3);
    (world, body.reach, [outer.volume() - inner.volume(), inner.volume() - cavity])
}
