//! What connections aim at: densities against each other, the whole of them, and at the edges of pixels.

use super::*;
use crate::lights::Target;
use crate::lights::octahedral::direction_of;

/// Returns a picture that is not even: a hot pixel in a dim gradient.
fn hot(size: u32, at: [u32; 2]) -> ImageDescription {
    picture(size, |x, y| if [x, y] == at { [500.0; 3] } else { [0.001 * x as f32; 3] })
}

/// Returns two uneven pictures, one stretched, an even one and constant radiance, and lamps if asked for.
fn skies(lamps: bool) -> Lights {
    let mut scene = if lamps { everything() } else { empty() };
    scene.lights.clear();
    scene.images = vec![hot(16, [3, 9]), hot(8, [4, 1]), picture(4, |_, _| [2.0; 3])];
    scene.lights = (0..3).map(|image| light(LightKind::Environment { image })).collect();
    scene.lights[1].light_to_world = Mat4::from_rotation_y(1.0) * Mat4::from_scale(Vec3::new(1.0, 2.0, -0.7));
    scene.lights.push(light(LightKind::Constant { radiance: SpectrumDescription::Rgb([3.0; 3]) }));
    Lights::of_scene(&scene).expect("valid")
}

#[test]
fn directions_aimed_at_have_their_stated_density() {
    for lamps in [false, true] {
        let lights = skies(lamps);
        let mut r = Stream::new(&[91]);
        let (mut far, mut near, mut off) = (0, 0, 0);
        for _ in 0..50_000 {
            let p = point(&mut r, 4.0);
            let n = (r.uniform() < 0.5).then(|| direction(&mut r));
            let Some(aimed) = lights.aim(p, n, &grey(), uniform3(&mut r)) else { continue };
            let again = lights.aimed_pdf_environment(p, n, aimed.wi);
            match aimed.target {
                Target::Direction(d) => {
                    assert_eq!(d, aimed.wi);
                    assert!(aimed.environment > 0.0);
                    far += 1;
                }
                Target::Point(q) => {
                    assert!((q - p).normalize().distance(aimed.wi) < 1e-4);
                    near += 1;
                }
            }
            // But for directions that rounding puts beyond the edge of their pixel.
            off += u32::from((again - aimed.environment).abs() > 1e-4 * again);
        }
        println!("environment {far}, surfaces {near}, off {off}");
        assert!(far > 10_000 && (near > 5000) == lamps && off < 10, "{far} {near} {off}");
    }
}

#[test]
fn densities_of_what_is_aimed_at_sum_to_its_share() {
    // Uniform directions, 400 and more of which are in a hot pixel of the smallest: 5 comparisons, |z| below 4.5.
    let lights = skies(false);
    let mut r = Stream::new(&[92]);
    for _ in 0..5 {
        let p = point(&mut r, 4.0);
        let mut sum = Accumulator::default();
        for _ in 0..200_000 {
            sum.add(f64::from(lights.aimed_pdf_environment(p, None, direction(&mut r))) * 4.0 * PI);
        }
        let e = sum.estimate();
        assert!(e.z(1.0).abs() < 4.5, "{e}");
    }
}

#[test]
fn what_is_even_and_what_is_not_add_up_to_the_environment() {
    let lights = skies(false);
    let mut r = Stream::new(&[93]);
    for _ in 0..1000 {
        let (p, d) = (point(&mut r, 4.0), direction(&mut r));
        let even = lights.even_environment(d, &grey());
        assert!((even[0] - 5.0).abs() < 1e-4, "{even:?}");
        assert_eq!((even + lights.aimed_environment(p, d, &grey()))[0], lights.environment(p, d, &grey())[0]);
    }
}

#[test]
fn a_direction_drawn_at_the_edge_of_a_sun_has_the_density_of_the_sun() {
    // Evaluated anew, the density of some is that of the pixel beside it: a factor of 1e6.
    let mut scene = empty();
    scene.images.push(picture(1024, |x, y| if [x, y] == [700, 300] { [1e5; 3] } else { [0.01; 3] }));
    scene.lights.push(light(LightKind::Environment { image: 0 }));
    let lights = Lights::of_scene(&scene).expect("valid");
    let sun = lights.aimed_pdf_environment(Vec3::ZERO, None, direction_of([700.5 / 1024.0, 300.5 / 1024.0]));
    let mut r = Stream::new(&[94]);
    let mut beyond = 0;
    for _ in 0..1_000_000 {
        let aimed = lights.aim(Vec3::ZERO, None, &grey(), uniform3(&mut r)).expect("there is a sun");
        assert!((aimed.environment / sun - 1.0).abs() < 1e-6, "{}", aimed.environment);
        beyond += u32::from(lights.aimed_pdf_environment(Vec3::ZERO, None, aimed.wi) < 0.5 * sun);
    }
    println!("{beyond} directions in 1e6 lie beyond the edge");
    assert!(beyond > 0);
}
