//! Mirror images of lamps by rays of their own: as bright as by the camera's paths, and less noisy.

use moonmilk_core::{Estimate, Mat4, Vec2, Vec3, WavelengthMode};
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_render::description::FilterKind;
use moonmilk_render::integrator::{Counters, Integrator, Policy};
use moonmilk_render::session;

use crate::common::{World, assert_equal, ball, flat, measure, rectangle, samples, smooth};

/// Returns the mean of all pixels over n sample numbers by a policy.
fn mean(world: &World, policy: Policy, n: u64) -> Estimate {
    let scene = world.scene();
    let integrator =
        Integrator::new(7 + policy as u64, WavelengthMode::Rgb, Default::default(), None).with_policy(policy);
    let pixels = world.0.film.width;
    let [mean] = measure(n, |s| {
        let all = (0..pixels * pixels).map(|i| [i % pixels, i / pixels]);
        let radiance = |p| f64::from(session::sample(&scene, &integrator, p, s, &mut Counters::default()).rgb[1]);
        [all.map(radiance).sum::<f64>() / f64::from(pixels * pixels)]
    });
    mean
}

/// Returns a world with a small picture of things that absorb what gets in.
fn world(what: &str) -> World {
    let mut world = World::new();
    let film = &mut world.0.film;
    (film.width, film.height, film.crop) = (16, 16, [0, 16, 0, 16]);
    let ink = world.medium(1e5, 0.0, 0.0);
    let glass = world.dielectric(1.5, 0.0);
    match what {
        "ball" => world.body(&ball(1.0), glass, Some(ink), None),
        "facets" => world.body(&flat(&bumpy_sphere(3, 0.2)), glass, Some(ink), None),
        "smooth normals" => world.body(&smooth(&bumpy_sphere(4, 0.1)), glass, Some(ink), None),
        "glass" => world.body(&ball(1.0), glass, None, None),
        "air in front of a pane" => {
            let bubble = world.dielectric(0.7, 0.0);
            let bubble = world.body(&ball(0.6), bubble, None, None);
            world.0.shapes[bubble].object_to_world = Mat4::from_translation(Vec3::Z);
            world.body(&flat(&cuboid(Vec3::new(-2.0, -2.0, -0.3), Vec3::new(2.0, 2.0, 0.0))), glass, Some(ink), None)
        }
        "wide filter" => {
            world.0.filter.kind = FilterKind::Gaussian { sigma: 0.5 };
            world.0.filter.radius = Vec2::splat(1.5);
            world.body(&ball(1.0), glass, Some(ink), None)
        }
        _ => unreachable!("no such world"),
    };
    // Facets meet a small lamp nowhere.
    let half = Vec3::splat(if what == "facets" { 0.4 } else { 0.1 });
    let middle = Vec3::new(1.0, 1.5, 2.7);
    world.emitter(&flat(&cuboid(middle - half, middle + half)), 1.0 / half.x.powi(2));
    world
}

#[test]
fn mirror_images_are_as_bright_by_rays_of_their_own() {
    for what in ["ball", "facets", "smooth normals", "glass", "air in front of a pane", "wide filter"] {
        let world = world(what);
        let [classic, auto] = [Policy::Classic, Policy::Auto].map(|p| mean(&world, p, samples(1500, 16)));
        assert_equal(what, auto, classic);
    }
}

#[test]
fn mirror_images_are_less_noisy_by_rays_of_their_own() {
    for what in ["ball", "facets"] {
        let world = world(what);
        let [classic, auto] = [Policy::Classic, Policy::Auto].map(|p| mean(&world, p, 500).std_err);
        println!("{what}: standard errors {classic:.2e} and {auto:.2e}");
        assert!(auto < 0.3 * classic, "{what}: {auto} {classic}");
    }
}

#[test]
fn what_stands_before_a_lamp_hides_its_image() {
    let mut world = world("ball");
    let black = world.diffuse(0.0);
    world.surface(&rectangle(Vec3::new(0.9, 1.25, 2.4), Vec3::X * 0.6, Vec3::Y * 0.6), black);
    let auto = mean(&world, Policy::Auto, 50);
    let classic = mean(&world, Policy::Classic, 50);
    assert!(auto.mean < 1e-3 && classic.mean < 1e-3, "{auto} {classic}");
}
