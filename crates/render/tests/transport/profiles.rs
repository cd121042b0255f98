//! Bodies rendered by a model's profile, against integrals of that profile in closed form (physics notes 7.4).
//!
//! In uniform light of radiance 1 a point of the boundary looks F + (1 - F) I, with I the integral of R over the surface. Chords of a sphere have the
//! area element 2 pi c dc, so that I = A cdf(2 rho) there; a slab adds the far face, I = A (2 - cdf(t)). Random numbers decide which wavelength, axis and hit.

use std::f64::consts::PI;

use moonmilk_core::{Vec3, Wavelengths};
use moonmilk_geometry::Mesh;
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_optics::OpticalProperties;
use moonmilk_optics::fresnel::{moment_1, reflectance_f64};
use moonmilk_optics::profile::{Profile, find};
use moonmilk_render::description::{MediumKind, SpectrumDescription};
use moonmilk_render::scene::{Scene, SceneOptions};

use crate::common::{Tracer, World, assert_equal, assert_exact, ball, flat, measure, samples, uniform_ray};

/// Interpolation in albedo and radius: measured in `bssrdf`, as a share of the integral.
const BAKED: f64 = 1e-3;

fn tracer(world: &World, model: &str) -> Tracer {
    let options = SceneOptions { model: Some(find(model).unwrap()), ..Default::default() };
    Tracer::new(Scene::new(&world.0, &options).unwrap().0)
}

fn profile(model: &str, (sigma_a, sigma_s, g, eta): (f32, f32, f32, f32)) -> Box<dyn Profile> {
    let [a, s, g, eta] = [sigma_a, sigma_s, g, eta].map(f64::from);
    find(model).unwrap().build(&OpticalProperties::new(a, s, g, eta).unwrap()).unwrap()
}

fn body(
    geometry: &std::sync::Arc<moonmilk_render::description::GeometryDescription>,
    m: (f32, f32, f32, f32),
) -> World {
    let mut world = World::new();
    let medium = world.medium(m.0, m.1, m.2);
    let boundary = world.dielectric(m.3, 0.0);
    world.body(geometry, boundary, Some(medium), None);
    world
}

const MODELS: [&str; 5] = ["dipole", "better-dipole", "photon-beam", "normalized", "gaussian-sum"];

#[test]
fn a_half_space_gives_back_the_total_of_its_model() {
    for model in MODELS {
        for m in [(0.1f32, 0.9f32, 0.0f32, 1.0f32), (0.01, 1.5, 0.3, 1.4)] {
            let world = body(&flat(&cuboid(Vec3::new(-1e4, -1e4, -500.0), Vec3::new(1e4, 1e4, 0.0))), m);
            let eta = f64::from(m.3);
            let total = profile(model, m).total();
            let (f, mu) = (reflectance_f64(1.0, eta), 0.6f64);
            let look = |t: &Tracer, i| t.radiance(i, Vec3::new(3.0, 2.0, 1.0), -Vec3::Z);
            let t = tracer(&world.clone().environment(1.0), model);
            let [e] = measure(samples(20_000, 16), |i| [look(&t, i)]);
            let exact = f + (1.0 - f) * total;
            assert_exact(&format!("half-space, {model}, {m:?}"), e, exact, BAKED * exact);
            // One direction of light, found by light sampling alone.
            let towards = Vec3::new(0.8, 0.0, 0.6);
            let t = tracer(&world.distant(towards, 2.0), model);
            let [e] = measure(samples(20_000, 16), |i| [look(&t, i)]);
            let norm = 1.0 - 2.0 * moment_1(1.0 / eta);
            let exact = (1.0 - f) * (1.0 - reflectance_f64(mu, eta)) * mu * 2.0 * total / (PI * norm);
            assert_exact(&format!("half-space under distant light, {model}, {m:?}"), e, exact, BAKED * exact);
        }
    }
}

#[test]
fn spheres_and_slabs_give_back_what_their_shape_says() {
    for model in MODELS {
        for (sigma, eta) in [(0.5f32, 1.0f32), (2.0, 1.4), (10.0, 1.3)] {
            let m = (0.1 * sigma, 0.9 * sigma, 0.0, eta);
            let p = profile(model, m);
            let f = reflectance_f64(1.0, f64::from(eta));
            let t = tracer(&body(&ball(1.0), m).environment(1.0), model);
            let [e] = measure(samples(40_000, 8), |i| [t.radiance(i, Vec3::Z * 3.0, -Vec3::Z)]);
            let exact = f + (1.0 - f) * p.total() * p.cdf(2.0);
            assert_exact(&format!("sphere of extinction {sigma}, {model}"), e, exact, BAKED * exact);
            let slab = flat(&cuboid(Vec3::new(-2e4, -2e4, -1.0), Vec3::new(2e4, 2e4, 0.0)));
            let t = tracer(&body(&slab, m).environment(1.0), model);
            let [e] = measure(samples(40_000, 8), |i| [t.radiance(i, Vec3::Z * 3.0, -Vec3::Z)]);
            let exact = f + (1.0 - f) * p.total() * (2.0 - p.cdf(1.0));
            assert_exact(&format!("slab of extinction {sigma}, {model}"), e, exact, BAKED * exact);
        }
    }
}

#[test]
fn every_wavelength_has_its_own_profile_whatever_the_others_are() {
    let mut world = World::new();
    let [a, s] = [[(400.0, 0.5), (700.0, 0.01)], [(400.0, 1.0), (700.0, 6.0)]];
    let sampled = |x: [(f32, f32); 2]| SpectrumDescription::Sampled(x.to_vec());
    let kind = MediumKind::Homogeneous { sigma_a: sampled(a), sigma_s: sampled(s), scale: 1.0, g: 0.0, emission: None };
    let medium = world.medium_of(kind);
    let boundary = world.dielectric(1.3, 0.0);
    world.body(&ball(1.0), boundary, Some(medium), None);
    let t = tracer(&world.environment(1.0), "photon-beam");
    let at = |x: [(f32, f32); 2], nm: f32| x[0].1 + (x[1].1 - x[0].1) * (nm - 400.0) / 300.0;
    let f = reflectance_f64(1.0, 1.3);
    let lambda = [420.0f32, 500.0, 610.0, 690.0];
    let w = Wavelengths::Sampled { lambda, pdf: [1.0; 4] };
    let lanes: [_; 4] = measure(samples(60_000, 16), |i| {
        let (light, _) = t.follow(i, Vec3::Z * 3.0, -Vec3::Z, &w);
        std::array::from_fn(|k| light.orders.iter().map(|o| f64::from(o[k])).sum::<f64>())
    });
    for (nm, e) in lambda.into_iter().zip(lanes) {
        let p = profile("photon-beam", (at(a, nm), at(s, nm), 0.0, 1.3));
        let exact = f + (1.0 - f) * p.total() * p.cdf(2.0);
        assert_exact(&format!("sphere at {nm} nm"), e, exact, BAKED * exact);
    }
}

/// Cuts every triangle in four.
fn finer(mesh: &Mesh) -> Mesh {
    let mut positions = Vec::new();
    for t in 0..mesh.indices().len() as u32 {
        let [a, b, c] = mesh.corners(t);
        let [d, e, f] = [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
        positions.extend([a, d, f, d, b, e, f, e, c, d, e, f]);
    }
    let indices = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh::new(positions, vec![], vec![], indices).unwrap()
}

#[test]
fn finer_triangles_look_the_same() {
    let m = (0.2f32, 3.0f32, 0.0f32, 1.3f32);
    let coarse = bumpy_sphere(2, 0.2);
    let [a, b] = [(coarse.clone(), 90), (finer(&coarse), 91)].map(|(mesh, seed)| {
        let t = tracer(&body(&flat(&mesh), m).environment(1.0), "normalized");
        let [e] = measure(samples(60_000, 16), |i| {
            let (o, d) = uniform_ray(seed, i, 1.3);
            [t.radiance(i, o, d)]
        });
        // All ways inside are the profile's, those of mirrored branches too.
        let c = t.assert_sound();
        assert!(c.probes > 0 && c.collisions == 0, "{c:?}");
        e
    });
    assert_equal("coarse and fine triangles", a, b);
}
