//! Quadrics of every form as lights, and lights with pictures, against rays and quadrature.

use moonmilk_geometry::{Accel, Quadric, Ray, Shape};

use super::*;
use crate::lights::octahedral::direction_of;

/// Irradiance at p on a plane of normal n, and solid angle counted once per crossing of the emitting side, by casting rays to the form itself.
fn by_rays(s: &ShapeDescription, p: Vec3, n: Vec3, two_sided: bool, rays: u32) -> [Accumulator; 2] {
    let form = Quadric::new(s.geometry.quadric().expect("a quadric"), &s.object_to_world).expect("valid");
    let accel = Accel::build(vec![Shape::from(form.clone())]);
    let mut r = Stream::new(&[71]);
    let mut sums = [Accumulator::default(); 2];
    for _ in 0..rays {
        let d = direction(&mut r);
        let (mut omega, mut e) = (0.0, 0.0);
        accel.all_hits(&Ray::new(p, d), |h| {
            let out = accel.surface(&Ray::new(p, d), h).ng.dot(d) < 0.0;
            if two_sided || out != s.reverse_orientation {
                omega += 4.0 * PI;
                e += 4.0 * PI * f64::from(n.dot(d).max(0.0));
            }
        });
        sums[0].add(omega);
        sums[1].add(e);
    }
    sums
}

#[test]
fn all_quadrics_shine_as_rays_see_them() {
    let turn = Mat4::from_rotation_x(0.4);
    let squash = turn * Mat4::from_scale(Vec3::new(1.0, 0.5, 1.7));
    let mirror = squash * Mat4::from_scale(Vec3::new(1.0, 1.0, -1.0));
    let part = GeometryDescription::Sphere { radius: 1.0, z_min: -0.4, z_max: 0.8, phi_max: 200.0 };
    let ring = GeometryDescription::Disk { height: 0.2, radius: 1.0, inner_radius: 0.4, phi_max: 300.0 };
    let cases = [
        (cylinder(0.7, 360.0), turn),
        (cylinder(0.7, 120.0), mirror),
        (sphere(1.0), squash),
        (sphere(1.0), mirror),
        (part, squash),
        (ring, squash),
    ];
    let mut r = Stream::new(&[72]);
    for (k, (geometry, m)) in cases.into_iter().enumerate() {
        for (two_sided, reverse) in [(false, false), (false, true), (true, false)] {
            let mut s = shape(geometry.clone(), m, area_light(1.0, two_sided));
            s.reverse_orientation = reverse;
            let mut scene = empty();
            scene.shapes.push(s.clone());
            let lights = Lights::of_scene(&scene).expect("valid");
            let p = direction(&mut r) * 2.2;
            let n = (direction(&mut r) * 0.6 - p.normalize()).normalize();
            let seen = by_rays(&s, p, n, two_sided, 100_000);
            let sampled = moments(&lights, p, n, false, 100_000, 800 + k as u64);
            for (a, b) in seen.iter().zip(&sampled) {
                let (a, b) = (a.estimate(), b.estimate());
                if a.mean == 0.0 {
                    assert_eq!(b.mean, 0.0, "case {k}");
                    continue;
                }
                // 36 comparisons at 1e-4 in all.
                let z = a.z_against(&b);
                assert!(
                    z.abs() < 4.7,
                    "case {k}, two-sided {two_sided}, reversed {reverse}: {a} by rays, {b} by sampling, z = {z}"
                );
            }
        }
    }
}

#[test]
fn hits_and_samples_agree_about_the_front_of_mirrored_forms() {
    let mirror = Mat4::from_scale(Vec3::new(1.0, 1.0, -1.0));
    for geometry in [sphere(1.0), cylinder(1.0, 360.0)] {
        for reverse in [false, true] {
            let mut s = shape(geometry.clone(), mirror, area_light(1.0, false));
            s.reverse_orientation = reverse;
            let mut scene = empty();
            scene.shapes.push(s);
            let lights = Lights::of_scene(&scene).expect("valid");
            // The scene's normals of a mirrored form point outwards, inwards with ReverseOrientation.
            let ng = if reverse { -Vec3::X } else { Vec3::X };
            let outwards = lights.emitted(0, Vec2::ZERO, ng, Vec3::X, &grey())[0];
            assert_eq!(outwards, if reverse { 0.0 } else { 1.0 });
            let mut r = Stream::new(&[73]);
            let found = (0..100).any(|_| {
                lights.sample(Vec3::X * 3.0, None, &grey(), uniform3(&mut r)).is_some_and(|s| s.point.x > 0.5)
            });
            assert_eq!(found, !reverse, "seen from outside, its near side shines unless it is reversed");
        }
    }
}

/// Integral of the intensity of a light at the origin over all directions, by a midpoint rule on n^2 cells.
fn power_of(lights: &Lights, n: u32) -> f64 {
    let cell = 4.0 * PI / f64::from(n * n);
    (0..n * n)
        .map(|i| {
            let d = direction_of([(f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n)]);
            lights.sample(d, None, &grey(), [0.5; 3]).map_or(0.0, |s| f64::from(s.radiance[0] / s.pdf)) * cell
        })
        .sum()
}

#[test]
fn lights_with_pictures_emit_the_power_asked_for() {
    for kind in [
        LightKind::Goniometric { intensity: SpectrumDescription::Rgb([2.0; 3]), image: 0 },
        LightKind::Projection { image: 1, fov: 60.0 },
    ] {
        let mut scene = empty();
        scene.images.push(picture(8, |x, y| [(x + 2 * y) as f32 * 0.1; 3]));
        let rgb = (0..80 * 40).map(|i| [0.2 + 0.01 * (i % 80) as f32; 3]).collect();
        scene.images.push(ImageDescription { name: "slide".into(), width: 80, height: 40, rgb, alpha: vec![] });
        let mut l = light(kind);
        l.power = Some(7.0);
        l.light_to_world = Mat4::from_rotation_x(0.8);
        scene.lights.push(l);
        let lights = Lights::of_scene(&scene).expect("valid");
        let power = power_of(&lights, 800);
        // The goniometric intensity is 2 relative to its spectrum's colour, which `power` does not undo (pbrt-v4: colours keep theirs).
        let expected = if matches!(scene.lights[0].kind, LightKind::Goniometric { .. }) { 14.0 } else { 7.0 };
        // Pixels cut by the edge of the slide: 1e-3 of the power at 800 cells per side.
        assert!((power / expected - 1.0).abs() < 2e-3, "{power}");
    }
}

#[test]
fn a_slide_is_thrown_the_right_way_round() {
    // Four pixels; light space looks along +z, the first row at negative y and the first column at negative x.
    let mut scene = empty();
    scene.images.push(picture(2, |x, y| [1.0 + x as f32 + 2.0 * y as f32; 3]));
    scene.lights.push(light(LightKind::Projection { image: 0, fov: 90.0 }));
    let lights = Lights::of_scene(&scene).expect("valid");
    let at = |x: f32, y: f32, z: f32| {
        let p = Vec3::new(x, y, z);
        lights.sample(p, None, &grey(), [0.5; 3]).map(|s| s.radiance[0] * p.length_squared())
    };
    let close = |a: Option<f32>, b: f32| assert!(a.is_some_and(|a| (a - b).abs() < 1e-5), "{a:?} {b}");
    close(at(-0.5, -0.5, 1.0), 1.0);
    close(at(0.5, -0.5, 1.0), 2.0);
    close(at(-0.5, 0.5, 1.0), 3.0);
    close(at(1.9, 1.9, 2.0), 4.0);
    assert_eq!((at(1.1, 0.0, 1.0), at(0.0, 0.0, -1.0)), (None, None));
}

#[test]
fn a_goniometric_light_shines_by_its_picture() {
    let mut scene = empty();
    scene.images.push(picture(4, |x, y| [x as f32 + 4.0 * y as f32, 0.0, 0.0]));
    scene.lights.push(light(LightKind::Goniometric { intensity: SpectrumDescription::Rgb([3.0; 3]), image: 0 }));
    let lights = Lights::of_scene(&scene).expect("valid");
    for i in 0..16u32 {
        let d = direction_of([(f64::from(i % 4) + 0.4) / 4.0, (f64::from(i / 4) + 0.3) / 4.0]);
        let l = lights.sample(d * 2.0, None, &grey(), [0.5; 3]).map_or(0.0, |s| s.radiance[0] * 4.0);
        assert!((l - i as f32).abs() < 1e-4, "pixel {i}: {l}");
    }
}

#[test]
fn lamps_with_opacity_zero_are_found_by_sampling_alone() {
    let mut scene = empty();
    scene.float_textures = vec![FloatTexture::Constant(0.0), FloatTexture::Constant(0.25)];
    for alpha in [0, 1] {
        let mut s = shape(disk(1.0), Mat4::IDENTITY, area_light(1.0, false));
        s.alpha = Some(alpha);
        scene.shapes = vec![s];
        let lights = Lights::of_scene(&scene).expect("valid");
        let s = lights.sample(Vec3::Z, None, &grey(), [0.5, 0.2, 0.3]).expect("it shines");
        assert_eq!((s.is_delta, s.alpha), if alpha == 0 { (true, None) } else { (false, Some(1)) });
    }
}
