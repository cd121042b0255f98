//! Solid angles, irradiances and powers against closed forms.

use super::*;
use crate::lights::octahedral::direction_of;
use crate::lights::spherical_triangle::solid_angle;

/// Lambert's formula: irradiance at the origin, normal n, of a triangle of radiance 1 that lies wholly above the horizon.
fn lambert(v: [Vec3; 3], p: Vec3, n: Vec3) -> f64 {
    let v = v.map(|v| (v - p).as_dvec3().normalize());
    let sum: f64 = (0..3)
        .map(|i| {
            let (a, b) = (v[i], v[(i + 1) % 3]);
            let across = a.cross(b);
            across.length().atan2(a.dot(b)) * across.normalize().dot(n.as_dvec3())
        })
        .sum();
    0.5 * sum.abs()
}

#[test]
fn triangles_have_their_solid_angle_and_lamberts_irradiance() {
    // Distances from 0.02 to 50 times the triangle's size: both ways of sampling are met.
    let mut r = Stream::new(&[42]);
    let mut tested = 0;
    while tested < 40 {
        let v = [point(&mut r, 1.0), point(&mut r, 1.0), point(&mut r, 1.0)];
        let p = direction(&mut r) * 10f32.powf(3.4 * r.uniform() - 1.7);
        let n = ((v[0] + v[1] + v[2]) / 3.0 - p).normalize();
        // Points in front of it, triangle above the horizon.
        let front = (v[1] - v[0]).cross(v[2] - v[0]);
        if front.dot(p - v[0]) <= 0.02 * front.length() || v.iter().any(|v| n.dot(*v - p) <= 0.0) {
            continue;
        }
        tested += 1;
        let mut scene = empty();
        scene.shapes.push(shape(mesh(v.to_vec()), Mat4::IDENTITY, area_light(3.0, false)));
        let lights = Lights::of_scene(&scene).expect("valid");
        let [omega, e] = moments(&lights, p, n, tested % 2 == 0, 20_000, tested);
        let exact = solid_angle(&v.map(|v| (v - p).as_dvec3()));
        let irradiance = 3.0 * lambert(v, p, n);
        for (sum, exact) in [(omega, exact), (e, irradiance)] {
            let s = sum.estimate();
            // Solid-angle sampling has no variance in the first moment: allow the rounding of f32 densities.
            let error = (s.mean - exact).abs();
            assert!(error < 4.8 * s.std_err + 2e-6 * exact, "{s} against {exact} from {p}");
        }
    }
}

#[test]
fn spheres_have_their_solid_angle_and_form_factor() {
    // A sphere above the horizon at distance d in direction w: irradiance pi (r / d)^2 cos(n, w). From inside: 4 pi and, with an
    // emission inwards, pi on any plane.
    let mut r = Stream::new(&[43]);
    for k in 0..20u64 {
        let center = point(&mut r, 5.0);
        let radius = 10f32.powf(2.0 * r.uniform() - 2.0);
        let d = radius * (1.0 + 10f32.powf(4.0 * r.uniform() - 2.0));
        let p = center + direction(&mut r) * d;
        let to = (center - p) / d;
        let mut scene = empty();
        scene.shapes.push(shape(
            sphere(1.0),
            Mat4::from_translation(center) * Mat4::from_scale(Vec3::splat(radius)),
            area_light(2.0, false),
        ));
        let lights = Lights::of_scene(&scene).expect("valid");
        let d = f64::from(p.distance(center));
        let sin2 = (f64::from(radius) / d).powi(2);
        let omega = 2.0 * PI * sin2 / (1.0 + (1.0 - sin2).sqrt());
        let [o, e] = moments(&lights, p, to, k % 2 == 0, 20_000, 100 + k);
        // The position rounds to f32: relative error 1e-6 of d, amplified by 1 / (d - r).
        let rounding = 2e-6 * d / (d - f64::from(radius));
        assert!((o.estimate().mean / omega - 1.0).abs() < 1e-5 + rounding, "{} {omega}", o.estimate());
        let exact = 2.0 * PI * sin2;
        assert!(
            (e.estimate().mean - exact).abs() < 4.8 * e.estimate().std_err + (1e-5 + rounding) * exact,
            "{} {exact}",
            e.estimate()
        );
    }
    let mut scene = empty();
    let mut inside = shape(sphere(2.0), Mat4::IDENTITY, area_light(1.5, false));
    inside.reverse_orientation = true;
    scene.shapes.push(inside);
    let lights = Lights::of_scene(&scene).expect("valid");
    for k in 0..5 {
        let [o, e] = moments(&lights, direction(&mut r) * 1.9, direction(&mut r), false, 20_000, 200 + k);
        assert!((o.estimate().mean / (4.0 * PI) - 1.0).abs() < 1e-6);
        assert!(e.estimate().z(1.5 * PI).abs() < 4.8, "{}", e.estimate());
    }
}

#[test]
fn disks_have_the_irradiance_of_their_form_factor() {
    // On the axis at height h, facing the disk: pi L R^2 / (h^2 + R^2), and solid angle 2 pi (1 - h / sqrt(h^2 + R^2)).
    for (k, h) in [0.2f32, 1.0, 7.0].into_iter().enumerate() {
        let mut scene = empty();
        let turn = Mat4::from_rotation_x(0.7) * Mat4::from_scale(Vec3::splat(0.5));
        scene.shapes.push(shape(disk(1.0), turn, area_light(1.0, false)));
        let lights = Lights::of_scene(&scene).expect("valid");
        let up = turn.transform_vector3(Vec3::Z).normalize();
        let (h, r2) = (f64::from(h), 0.25);
        let [o, e] = moments(&lights, up * h as f32, -up, true, 40_000, 300 + k as u64);
        assert!(o.estimate().z(2.0 * PI * (1.0 - h / (h * h + r2).sqrt())).abs() < 4.5, "{}", o.estimate());
        assert!(e.estimate().z(PI * r2 / (h * h + r2)).abs() < 4.5, "{}", e.estimate());
        // Behind it there is nothing.
        assert!(lights.sample(-up * h as f32, None, &grey(), [0.5; 3]).is_none());
    }
}

#[test]
fn a_sun_in_a_sky_is_found_with_little_variance() {
    // One pixel of 64 x 64 holds 1000 times the rest together.
    let mut scene = empty();
    let sun = (20, 31);
    scene.images.push(picture(64, |x, y| [if (x, y) == sun { 4.0e6 } else { 1.0 }; 3]));
    scene.lights.push(light(LightKind::Environment { image: 0 }));
    let lights = Lights::of_scene(&scene).expect("valid");
    let toward_sun = direction_of([20.5 / 64.0, 31.5 / 64.0]);
    let m = 1280;
    for n in [toward_sun, (toward_sun + Vec3::X).normalize()] {
        let exact: f64 = (0..m * m)
            .map(|i| {
                let d =
                    direction_of([(f64::from(i % m) + 0.5) / f64::from(m), (f64::from(i / m) + 0.5) / f64::from(m)]);
                // Without a normal only what is aimed at is found.
                let aimed = lights.pdf_environment(Vec3::ZERO, None, d) > 0.0;
                let radiance = if aimed { lights.aimed_environment(Vec3::ZERO, d, &grey())[0] } else { 0.0 };
                f64::from(radiance * n.dot(d).max(0.0)) * 4.0 * PI / f64::from(m * m)
            })
            .sum();
        let e = moments(&lights, Vec3::ZERO, n, false, 50_000, 600)[1].estimate();
        // Quadrature with 20 x 20 points in the sun's pixel: 1e-5 of its cosine.
        assert!((e.mean - exact).abs() < 4.5 * e.std_err + 2e-5 * exact, "{e} against {exact}");
        // Uniform sampling would have a standard deviation of 60 times the mean.
        let deviation = e.std_err * 50_000f64.sqrt() / e.mean;
        assert!(deviation < 0.1, "{deviation}");
    }
}

#[test]
fn a_constant_environment_with_a_normal_has_no_variance() {
    let mut scene = empty();
    scene.lights.push(light(LightKind::Constant { radiance: SpectrumDescription::Rgb([0.5; 3]) }));
    let lights = Lights::of_scene(&scene).expect("valid");
    let [_, e] = moments(&lights, Vec3::ZERO, Vec3::new(0.6, 0.0, 0.8), true, 1000, 700);
    // Rounding of the cosine in f32.
    assert!((e.estimate().mean / (0.5 * PI) - 1.0).abs() < 1e-5 && e.variance() < 1e-8, "{}", e.estimate());
    // From a medium it is left to chance.
    assert!(lights.sample(Vec3::ZERO, None, &grey(), [0.5; 3]).is_none() && !lights.samples_in_media());
    assert!(lights.pdf_environment(Vec3::ZERO, None, Vec3::Z) == 0.0);
}

#[test]
fn powers_are_the_powers_emitted() {
    // An area light of power 12 over two triangles of area 1 in all; two-sided halves the radiance.
    for (two_sided, radiance) in [(false, 12.0 / std::f32::consts::PI), (true, 6.0 / std::f32::consts::PI)] {
        let mut scene = empty();
        let quad = vec![Vec3::ZERO, Vec3::X, Vec3::ONE - Vec3::Z, Vec3::ZERO, Vec3::ONE - Vec3::Z, Vec3::Y];
        let mut lamp = area_light(1.0, two_sided);
        lamp.power = Some(12.0);
        scene.shapes.push(shape(mesh(quad), Mat4::IDENTITY, lamp));
        let lights = Lights::of_scene(&scene).expect("valid");
        let l = lights.emitted(lights.light_of(0, 1).expect("it emits"), Vec2::ZERO, Vec3::Z, Vec3::Z, &grey());
        assert!((l[0] / radiance - 1.0).abs() < 1e-6);
        let back = lights.emitted(0, Vec2::ZERO, Vec3::Z, -Vec3::Z, &grey());
        assert_eq!(back[0], if two_sided { l[0] } else { 0.0 });
    }
    // Spot: the integral of its intensity over the sphere, by quadrature in the cosine.
    let mut scene = empty();
    let (from, to) = (Vec3::ZERO, Vec3::Z);
    let intensity = SpectrumDescription::Rgb([1.0; 3]);
    let mut spot = light(LightKind::Spot { from, to, intensity, cone_angle: 50.0, cone_delta_angle: 20.0 });
    spot.power = Some(7.0);
    scene.lights.push(spot);
    let lights = Lights::of_scene(&scene).expect("valid");
    let n = 20_000;
    let power: f64 = (0..n)
        .map(|i| {
            let z = -1.0 + 2.0 * (f64::from(i) + 0.5) / f64::from(n);
            let d = Vec3::new((1.0 - z * z).sqrt() as f32, 0.0, z as f32);
            let s = lights.sample(d, None, &grey(), [0.5; 3]);
            s.map_or(0.0, |s| f64::from(s.radiance[0] / s.pdf)) * 4.0 * PI / f64::from(n)
        })
        .sum();
    // Midpoint rule over a smooth function.
    assert!((power / 7.0 - 1.0).abs() < 1e-4, "{power}");
}
