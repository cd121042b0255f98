//! Cameras: from a point of the film to a ray.

use std::f32::consts::PI;

use moonmilk_core::{Mat4, Vec2, Vec3};

use crate::description::{CameraDescription, CameraKind, FilmDescription};

/// A camera ready for use.
#[derive(Clone, Debug)]
pub struct Camera {
    kind: CameraKind,
    camera_to_world: Mat4,
    window: [f32; 4],
    scale: f32,
    size: [f32; 2],
    lens_radius: f32,
    focal_distance: f32,
}

impl Camera {
    /// Returns the camera of a description for a film.
    ///
    /// The screen window defaults to \[-1, 1\] along the shorter axis; a perspective camera's field of view spans that axis.
    pub fn new(d: &CameraDescription, film: &FilmDescription) -> Self {
        let size = [film.width as f32, film.height as f32];
        let aspect = d.frame_aspect_ratio.unwrap_or(size[0] / size[1]);
        let window = d.screen_window.unwrap_or(if aspect > 1.0 {
            [-aspect, aspect, -1.0, 1.0]
        } else {
            [-1.0, 1.0, -1.0 / aspect, 1.0 / aspect]
        });
        let scale = match d.kind {
            CameraKind::Perspective { fov } => (0.5 * fov.to_radians()).tan(),
            _ => 1.0,
        };
        Self {
            kind: d.kind,
            camera_to_world: d.camera_to_world,
            window,
            scale,
            size,
            lens_radius: d.lens_radius,
            focal_distance: d.focal_distance,
        }
    }

    /// Returns the origin of all rays of a pinhole, or the middle of the lens or film.
    pub fn origin(&self) -> Vec3 {
        self.camera_to_world.transform_point3(Vec3::ZERO)
    }

    /// Returns origin and unit direction of the ray through a point of the film \[pixels\]; `lens` are uniform variates.
    pub fn ray(&self, film: Vec2, lens: [f32; 2]) -> (Vec3, Vec3) {
        let [x0, x1, y0, y1] = self.window;
        let s = Vec2::new(x0 + (x1 - x0) * film.x / self.size[0], y1 - (y1 - y0) * film.y / self.size[1]);
        let (mut o, mut d) = match self.kind {
            CameraKind::Perspective { .. } => (Vec3::ZERO, Vec3::new(s.x * self.scale, s.y * self.scale, 1.0)),
            CameraKind::Orthographic => (Vec3::new(s.x, s.y, 0.0), Vec3::Z),
            CameraKind::Spherical { equal_area } => {
                let uv = Vec2::new(film.x / self.size[0], film.y / self.size[1]);
                let d = if equal_area {
                    crate::lights::octahedral::to_sphere(uv)
                } else {
                    let (theta, phi) = (PI * uv.y, 2.0 * PI * uv.x);
                    Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
                };
                // Put z up in the file's terms: pbrt swaps y and z here.
                (Vec3::ZERO, Vec3::new(d.x, d.z, d.y))
            }
        };
        // Bend the ray through a point of the thin lens towards the plane in focus.
        if self.lens_radius > 0.0 {
            let focus = o + d * (self.focal_distance / d.z);
            let (r, phi) = (self.lens_radius * lens[0].sqrt(), 2.0 * PI * lens[1]);
            o += Vec3::new(r * phi.cos(), r * phi.sin(), 0.0);
            d = focus - o;
        }
        (self.camera_to_world.transform_point3(o), self.camera_to_world.transform_vector3(d).normalize())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_field_of_view_spans_the_shorter_axis() {
        let d = CameraDescription {
            kind: CameraKind::Perspective { fov: 60.0 },
            camera_to_world: Mat4::IDENTITY,
            medium: None,
            screen_window: None,
            frame_aspect_ratio: None,
            lens_radius: 0.0,
            focal_distance: 1.0,
        };
        let film = FilmDescription {
            width: 300,
            height: 100,
            crop: [0, 300, 0, 100],
            filename: None,
            imaging_ratio: 1.0,
            max_component_value: None,
        };
        let c = Camera::new(&d, &film);
        let (_, top) = c.ray(Vec2::new(150.0, 0.0), [0.5; 2]);
        assert!((top.y / top.z - 30f32.to_radians().tan()).abs() < 1e-6 && top.x.abs() < 1e-6);
        let (_, right) = c.ray(Vec2::new(300.0, 50.0), [0.5; 2]);
        assert!((right.x / right.z - 3.0 * 30f32.to_radians().tan()).abs() < 1e-5);
    }
}
