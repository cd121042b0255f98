//! Limits of paths, scenes that are refused, and the film's bookkeeping.

use std::sync::atomic::{AtomicBool, AtomicU64};

use moonmilk_core::{Vec3, Wavelengths};
use moonmilk_geometry::Mesh;
use moonmilk_geometry::generate::bumpy_sphere;
use moonmilk_optics::fresnel::reflectance_f64;
use moonmilk_optics::profile::find;
use moonmilk_render::description::{MediumKind, SpectrumDescription, SubsurfaceMedium};
use moonmilk_render::effort::PILOT;
use moonmilk_render::film::{Film, QUANTUM};
use moonmilk_render::integrator::Counters;
use moonmilk_render::scene::{OpenPolicy, Scene, SceneError, SceneOptions};
use moonmilk_render::session;

use crate::bodies::{Body, shells};
use crate::common::{Tracer, World, assert_exact, ball, flat, measure, samples, uniform_ray};

#[test]
fn bounces_are_counted_as_pbrt_does() {
    // A clear ball under uniform light, seen at the distance b from its centre: depth 1 shows the mirror image F; depth n adds
    // (1 - F)^2 F^k for k = 0..n - 2, since all inner reflections happen at the same angle.
    let mut world = World::new();
    let glass = world.dielectric(1.5, 0.0);
    world.body(&ball(1.0), glass, None, None);
    let mut tracer = world.environment(1.0).tracer();
    let b = 0.97f32;
    let f = reflectance_f64((1.0 - f64::from(b * b)).sqrt(), 1.5);
    let eye = |tracer: &Tracer, i: u64| tracer.radiance(i, Vec3::new(b, 0.0, 3.0), -Vec3::Z);
    tracer.integrator.max_depth = Some(0);
    assert_eq!(eye(&tracer, 0), 0.0);
    for n in 1..=4 {
        tracer.integrator.max_depth = Some(n);
        let [l] = measure(samples(40_000, 16), |i| [eye(&tracer, i)]);
        let inside: f64 = (0..n - 1).map(|k| (1.0 - f).powi(2) * f.powi(k as i32)).sum();
        // Rounding of F near grazing angles.
        assert_exact(&format!("clear ball, depth {n}"), l, f + inside, 1e-5);
    }
    // A ray past the ball sees the sky at any depth.
    tracer.integrator.max_depth = Some(0);
    assert_eq!(tracer.radiance(0, Vec3::new(1.01, 0.0, 3.0), -Vec3::Z), 1.0);
}

#[test]
fn a_limit_of_bounces_only_ever_darkens_and_is_kept() {
    for eta in [1.0f32, 1.4] {
        let body = Body::bumpy();
        let mut tracer = body.world(5.0, 0.3, eta).environment(1.0).tracer();
        let w = Wavelengths::<1>::Fixed(550.0);
        let mut last = 0.0;
        for limit in [1, 2, 4, 8, 16, 64, 256, 4096] {
            tracer.integrator.max_depth = Some(limit);
            let [l] = measure(samples(8000, 16), |i| {
                let (o, d) = uniform_ray(91, i, body.reach);
                let (light, counters) = tracer.follow(i, o, d, &w);
                // The mirror image and the light behind it may be followed both, each within the limit.
                let branches = if eta == 1.0 { 1 } else { 2 };
                assert!(counters.collisions <= branches * u64::from(limit), "path {i}: {}", counters.collisions);
                if limit == 1 {
                    assert_eq!(light.orders[2][0], 0.0, "path {i} collided twice");
                }
                [light.orders.iter().map(|l| f64::from(l[0])).sum()]
            });
            println!("eta {eta}, limit {limit}: {l}");
            // Where all paths end within the limit each finds 1.
            assert!(l.mean >= last - 4.9 * l.std_err - 1e-6, "limit {limit}: {l} after {last}");
            last = l.mean;
            if limit >= 4096 {
                // Less than one path in 1e3 is longer; the furnace is white again.
                assert!((l.mean - 1.0).abs() < 4.9 * l.std_err + 1e-3, "eta {eta}: {l}");
            }
            if limit == 1 {
                assert!(l.mean < 0.9, "eta {eta}: {l}");
            }
        }
    }
}

fn build(world: &World, open: OpenPolicy) -> Result<Scene, SceneError> {
    Scene::new(&world.0, &SceneOptions { open, ..Default::default() }).map(|s| s.0)
}

#[test]
fn media_that_cannot_be_are_refused() {
    let kind = |sigma_a: f32, sigma_s: f32, scale: f32, g: f32| {
        let [sigma_a, sigma_s] = [sigma_a, sigma_s].map(SpectrumDescription::Constant);
        MediumKind::Homogeneous { sigma_a, sigma_s, scale, g, emission: None }
    };
    for (bad, word) in [
        (kind(-0.1, 1.0, 1.0, 0.0), "sigma_a"),
        (kind(0.1, -1.0, 1.0, 0.0), "sigma_s"),
        (kind(0.1, f32::NAN, 1.0, 0.0), "sigma_s"),
        (kind(f32::INFINITY, 1.0, 1.0, 0.0), "sigma_a"),
        (kind(0.1, 1.0, -1.0, 0.0), "scale"),
        (kind(0.1, 1.0, f32::NAN, 0.0), "scale"),
        (kind(0.1, 1.0, 1.0, 1.0), "g = 1"),
        (kind(0.1, 1.0, 1.0, -1.0), "g = -1"),
        (kind(0.1, 1.0, 1.0, f32::NAN), "g = NaN"),
    ] {
        let mut world = World::new();
        world.medium_of(bad);
        let e = build(&world, OpenPolicy::Refuse).expect_err(word);
        assert!(matches!(&e, SceneError::Medium { .. }) && e.to_string().contains(word), "{word}: {e}");
        assert!(e.to_string().starts_with("test:1:1"), "{e}");
    }
    // The same of a material's own medium.
    for (sigma_a, sigma_s, g, eta, word) in [
        (-0.1, 1.0, 0.0, 1.3, "outside"),
        (0.1, -1.0, 0.0, 1.3, "outside"),
        (0.1, 1.0, 1.0, 1.3, "g = 1"),
        (0.1, 1.0, 0.0, 0.0, "eta"),
    ] {
        let mut world = World::new();
        let [sigma_a, sigma_s] = [sigma_a, sigma_s].map(|x| world.spectrum(SpectrumDescription::Constant(x)));
        let material = world.subsurface(SubsurfaceMedium::Coefficients { sigma_a, sigma_s }, g, eta);
        world.surface(&ball(1.0), material);
        let e = build(&world, OpenPolicy::Refuse).expect_err(word);
        assert!(matches!(&e, SceneError::Material(_)), "{e}");
        assert!(e.to_string().contains(word), "{word}: {e}");
    }
}

/// Returns a translucent mesh with triangles missing.
fn leaky(missing: usize, sigma_a: f32) -> World {
    let whole = bumpy_sphere(2, 0.1);
    let indices = whole.indices()[missing..].to_vec();
    let mesh = Mesh::new(whole.positions().to_vec(), vec![], vec![], indices).expect("triangles of a mesh are one");
    let mut world = World::new();
    let [sigma_a, sigma_s] = [sigma_a, 5.0].map(|x| world.spectrum(SpectrumDescription::Constant(x)));
    let material = world.subsurface(SubsurfaceMedium::Coefficients { sigma_a, sigma_s }, 0.0, 1.3);
    world.surface(&flat(&mesh), material);
    world.environment(1.0)
}

#[test]
fn an_open_translucent_mesh_is_refused_and_named() {
    let e = build(&leaky(1, 0.1), OpenPolicy::Refuse).expect_err("a hole");
    let SceneError::Open { name, edges, x, y, z, .. } = &e else { panic!("{e}") };
    assert_eq!((name.as_str(), *edges), ("shape", 3));
    let first = bumpy_sphere(2, 0.1);
    let corners = first.indices()[0].map(|v| first.positions()[v as usize]);
    assert!(corners.contains(&Vec3::new(*x, *y, *z)), "{e}");
    assert!(e.to_string().contains("3 boundary edges"), "{e}");
    assert!(build(&leaky(0, 0.1), OpenPolicy::Refuse).is_ok());
}

#[test]
fn paths_that_leave_through_a_hole_are_counted_and_end() {
    // Whether the medium absorbs or not: nothing but the object's box can end a walk that only scatters.
    for sigma_a in [0.1, 0.0] {
        let tracer = Tracer::new(build(&leaky(40, sigma_a), OpenPolicy::Kill).expect("holes are allowed"));
        let n = 5000;
        let [l] = measure(n, |i| {
            let (o, d) = uniform_ray(92, i, 1.3);
            [tracer.radiance(i, o, d)]
        });
        let c = tracer.counters();
        assert!(c.lost > 20 && c.lost < n && c.endless == 0, "{c:?}");
        assert!(l.mean > 0.1 && l.mean < 1.0, "{l}");
    }
}

#[test]
fn a_capped_mesh_loses_nothing() {
    let tracer = Tracer::new(build(&leaky(40, 0.1), OpenPolicy::Cap).expect("holes are closed"));
    measure(5000, |i| {
        let (o, d) = uniform_ray(93, i, 1.3);
        [tracer.radiance(i, o, d)]
    });
    assert!(tracer.assert_sound().collisions > 1000);
}

#[test]
fn a_replayed_sample_is_what_the_film_holds() {
    let (world, _, _) = shells();
    replays(world.distant(Vec3::Z, 0.0).environment(0.7).tracer());
}

#[test]
fn a_replayed_sample_of_a_model_with_points_is_what_the_film_holds() {
    let mut world = World::new();
    let medium = world.medium(0.1, 2.0, 0.0);
    let boundary = world.dielectric(1.3, 0.0);
    world.body(&ball(1.0), boundary, Some(medium), None);
    let world = world.distant(Vec3::Z, 1.0).environment(0.7);
    let options = SceneOptions { model: Some(find("dipole").unwrap()), ..Default::default() };
    replays(Tracer::new(Scene::new(&world.0, &options).unwrap().0));
}

/// Asserts that a film rendered in two goes holds the samples as they are found one by one.
fn replays(mut tracer: Tracer) {
    for mode in [moonmilk_core::WavelengthMode::Hero, moonmilk_core::WavelengthMode::Rgb] {
        tracer.integrator.wavelengths = mode;
        let first = 1237;
        let film = Film::new([16, 16], [3, 9, 5, 11], first, &[]);
        let (stop, progress) = (AtomicBool::new(false), AtomicU64::new(0));
        let mut done = session::render(&tracer.scene, &tracer.integrator, &film, first + 1, &stop, &progress);
        done.merge(&session::render(&tracer.scene, &tracer.integrator, &film, first + 3, &stop, &progress));
        assert_eq!((done.samples, done.invalid), (36 * 3, 0));
        let developed = film.develop(1.0);
        let mut replayed = Counters::default();
        let integrators = [0, 1, 2].map(|s| tracer.integrator.for_sample(&tracer.scene, first + s));
        integrators.iter().flat_map(|i| i.preparation()).for_each(|p| replayed.merge(p.0));
        // The first samples say how many paths the later ones have, and were taken for that.
        let effort = film.effort(|| None).expect("known");
        let mut last = tracer.integrator.clone();
        for s in 0..PILOT {
            last = last.for_sample(&tracer.scene, s);
            last.preparation().for_each(|p| replayed.merge(p.0));
            for i in 0..36 {
                session::sample(&tracer.scene, &last, [3 + i % 6, 5 + i / 6], s, &mut replayed);
            }
        }
        for (i, pixel) in developed.rgb.iter().enumerate() {
            let at = [3 + i as u32 % 6, 5 + i as u32 / 6];
            let mut sum = [0.0f64; 3];
            for s in first..first + 3 {
                let (integrator, paths) = (&integrators[(s - first) as usize], effort.paths(at));
                let value = session::mean_sample(&tracer.scene, integrator, at, s, paths, &mut replayed);
                sum.iter_mut().zip(value.rgb).for_each(|(a, b)| *a += f64::from(b) / 3.0);
            }
            for c in 0..3 {
                // The film rounds each sample to a quantum, and the mean to f32.
                let off = (f64::from(pixel[c]) - sum[c]).abs();
                assert!(off < QUANTUM + 1e-7 * sum[c].abs(), "{mode:?}, pixel {at:?}: {pixel:?} for {sum:?}");
            }
        }
        assert_eq!(done.counters, replayed, "{mode:?}");
    }
}
