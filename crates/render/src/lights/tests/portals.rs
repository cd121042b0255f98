//! Light through portals against that of the same rectangle as a lamp, and against rays.

use super::*;
use crate::lights::LightError;

/// A window of 2 x 1 at z = 1 that is looked through towards +z.
const WINDOW: [Vec3; 4] =
    [Vec3::new(-1.0, -0.5, 1.0), Vec3::new(-1.0, 0.5, 1.0), Vec3::new(1.0, 0.5, 1.0), Vec3::new(1.0, -0.5, 1.0)];

fn behind(portal: [Vec3; 4], kind: LightKind, images: Vec<ImageDescription>) -> Lights {
    let mut scene = empty();
    scene.images = images;
    let mut l = light(kind);
    l.portal = Some(portal);
    scene.lights.push(l);
    Lights::of_scene(&scene).expect("valid")
}

#[test]
fn a_window_under_an_even_sky_shines_like_a_lamp_of_its_size() {
    let sky = behind(WINDOW, LightKind::Constant { radiance: SpectrumDescription::Rgb([1.5; 3]) }, vec![]);
    let mut scene = empty();
    let [a, b, c, d] = WINDOW;
    scene.shapes.push(shape(mesh(vec![a, b, c, a, c, d]), Mat4::IDENTITY, area_light(1.5, false)));
    let lamp = Lights::of_scene(&scene).expect("valid");
    let mut r = Stream::new(&[81]);
    for k in 0..10 {
        let p = point(&mut r, 1.0) - Vec3::Z * 0.2;
        let n = (direction(&mut r) * 0.5 + Vec3::Z).normalize();
        let [o1, e1] = moments(&sky, p, n, false, 40_000, 900 + k);
        let [o2, e2] = moments(&lamp, p, n, false, 40_000, 950 + k);
        for (a, b) in [(o1, o2), (e1, e2)] {
            let (a, b) = (a.estimate(), b.estimate());
            // 20 comparisons; where all is above the horizon the lamp's solid angle has no variance but rounding.
            let off = (a.mean - b.mean).abs() - 1e-5 * b.mean;
            assert!(off < 4.7 * a.std_err.hypot(b.std_err), "point {k}: {a} {b}");
        }
        // From the other side there is no light.
        let outside = Vec3::new(p.x, p.y, 1.5);
        assert!(sky.sample(outside, None, &grey(), uniform3(&mut r)).is_none_or(|s| s.radiance[0] == 0.0));
        assert_eq!(sky.environment(outside, -Vec3::Z, &grey())[0], 0.0);
        assert_eq!(sky.environment(outside, Vec3::Z, &grey())[0], 0.0);
    }
}

#[test]
fn a_picture_behind_a_window_is_found_with_its_stated_density() {
    let sky = picture(16, |x, y| [x as f32 * 0.05, y as f32 * 0.03, if x == 3 && y == 9 { 40.0 } else { 0.0 }]);
    let lights = behind(WINDOW, LightKind::Environment { image: 0 }, vec![sky]);
    let mut r = Stream::new(&[82]);
    let (mut open, mut shut) = (0, 0);
    for _ in 0..6 {
        let p = point(&mut r, 1.0) - Vec3::Z * 0.5;
        let n = (direction(&mut r) * 0.3 + Vec3::Z).normalize();
        // Uniform directions over the sphere against the lights' own samples.
        let mut brute = Accumulator::default();
        for _ in 0..400_000 {
            let d = direction(&mut r);
            brute.add(f64::from(lights.environment(p, d, &grey())[0] * n.dot(d).max(0.0)) * 4.0 * PI);
        }
        let e = moments(&lights, p, n, false, 200_000, 990)[1].estimate();
        let b = brute.estimate();
        // 6 comparisons.
        assert!(b.z_against(&e).abs() < 4.5, "{e} {b}");
        for _ in 0..2000 {
            if let Some(s) = lights.sample(p, None, &grey(), uniform3(&mut r)) {
                let again = lights.pdf_environment(p, None, s.wi);
                assert!((again / s.pdf - 1.0).abs() < 1e-4, "{again} {}", s.pdf);
                assert_eq!(lights.environment(p, s.wi, &grey()), s.radiance);
                if s.radiance[0] > 0.0 { open += 1 } else { shut += 1 }
            }
        }
    }
    assert!(open > 3000 && shut > 0, "{open} {shut}");
}

#[test]
fn portals_that_are_no_rectangles_are_refused() {
    let mut scene = empty();
    let mut l = light(LightKind::Constant { radiance: SpectrumDescription::Rgb([1.0; 3]) });
    for bad in
        [[Vec3::ZERO; 4], [Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y], [WINDOW[0], WINDOW[2], WINDOW[1], WINDOW[3]]]
    {
        l.portal = Some(bad);
        scene.lights = vec![l.clone()];
        assert!(matches!(Lights::of_scene(&scene), Err(LightError::Portal { .. })), "{bad:?}");
    }
}
