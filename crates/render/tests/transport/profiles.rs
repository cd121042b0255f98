//! Bodies rendered by a model's profile, against integrals of that profile in closed form (physics notes 7.4).
//!
//! In uniform light of radiance 1 a point of the boundary looks F + (1 - F) I, with I the integral of R over the surface. Chords of a sphere have the
//! area element 2 pi c dc, so that I = A cdf(2 rho) there; a slab adds the far face, I = A (2 - cdf(t)). Random numbers decide which wavelength, axis and hit.

use std::f64::consts::PI;

use moonmilk_core::quadrature::Rule;
use moonmilk_core::{Estimate, Mat4, Random, Stream, Vec3, Wavelengths};
use moonmilk_geometry::Mesh;
use moonmilk_geometry::generate::{bumpy_sphere, cuboid};
use moonmilk_optics::OpticalProperties;
use moonmilk_optics::fresnel::{moment_1, reflectance_f64};
use moonmilk_optics::halfspace::HFunction;
use moonmilk_optics::profile::{Placement, Profile, find};
use moonmilk_render::description::{
    MediumKind, SpectrumDescription, SpectrumTexture, SubsurfaceMedium, TextureMapping,
};
use moonmilk_render::scene::{OpenPolicy, Scene, SceneOptions};

use crate::common::{
    Tracer, World, Z, assert_equal, assert_exact, ball, flat, measure, rectangle, samples, uniform_ray,
};

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

/// Returns the mean of what some rays see by the points of many sample numbers; `looks` rays each.
fn by_points<const N: usize>(
    t: &Tracer,
    numbers: u64,
    looks: u64,
    w: impl Fn(u64) -> Wavelengths<N> + Sync,
    ray: impl Fn(u64) -> (Vec3, Vec3) + Sync,
) -> [moonmilk_core::Estimate; N] {
    measure(numbers, |i| {
        let integrator = t.integrator.for_sample(&t.scene, i);
        let mut sum = [0.0; N];
        for j in i * looks..(i + 1) * looks {
            let (o, d) = ray(j);
            let (light, _) = t.follow_by(&integrator, j, o, d, &w(i));
            (0..N).for_each(|k| sum[k] += light.orders.iter().map(|l| f64::from(l[k])).sum::<f64>() / looks as f64);
        }
        sum
    })
}

#[test]
fn points_and_lines_together_give_what_lines_alone_give() {
    // All shares between the two: from lines alone (few points within reach) to hardly any.
    for (sigma, eta) in [(0.5f32, 1.0f32), (2.0, 1.4), (10.0, 1.3), (60.0, 1.3)] {
        let m = (0.03 * sigma, 0.97 * sigma, 0.0, eta);
        let p = profile("photon-beam", m);
        let f = reflectance_f64(1.0, f64::from(eta));
        let t = tracer(&body(&ball(1.0), m).environment(1.0), "photon-beam");
        let fixed = |_| Wavelengths::<1>::Fixed(550.0);
        let straight = |j| {
            let n = crate::common::direction(Stream::new(&[29, j]).uniform2());
            (n * 3.0, -n)
        };
        let [e] = by_points(&t, samples(300, 8), 100, fixed, straight);
        let exact = f + (1.0 - f) * p.total() * p.cdf(2.0);
        assert_exact(&format!("points on a sphere of extinction {sigma}"), e, exact, BAKED * exact);
        // A slab as thin as a mean free path, whose faces light each other.
        let slab = flat(&cuboid(Vec3::new(-20.0, -20.0, -1.0 / sigma), Vec3::new(20.0, 20.0, 0.0)));
        let t = tracer(&body(&slab, m).environment(1.0), "photon-beam");
        let [e] = by_points(&t, samples(200, 8), 40, fixed, |_| (Vec3::Z * 3.0, -Vec3::Z));
        let [lines] = measure(samples(10_000, 8), |i| [t.radiance(i, Vec3::Z * 3.0, -Vec3::Z)]);
        assert_equal(&format!("points on a slab of extinction {sigma}, and lines"), e, lines);
    }
}

#[test]
fn points_find_indirect_light_as_lines_do() {
    // A bumpy ball over a white floor, lit from one side: what the points get has shadows and comes back from the floor and from the ball.
    let m = (0.2f32, 3.0f32, 0.0f32, 1.3f32);
    let mut world = body(&flat(&bumpy_sphere(3, 0.3)), m);
    let floor = world.diffuse(0.8);
    world.surface(&crate::common::rectangle(Vec3::Y * -1.4, Vec3::Z * 4.0, Vec3::X * 4.0), floor);
    let t = tracer(&world.distant(Vec3::new(0.6, 0.8, 0.0), 2.0), "dipole");
    let ray = |i| uniform_ray(17, i, 1.3);
    let [a] = by_points(&t, samples(200, 8), 100, |_| Wavelengths::<1>::Fixed(550.0), ray);
    let [b] = measure(samples(60_000, 8), |i| {
        let (o, d) = ray(i);
        [t.radiance(i, o, d)]
    });
    assert_equal("indirect light by points and by lines", a, b);
}

#[test]
fn points_serve_textured_coefficients_and_know_what_is_around_them() {
    // Coefficients in squares of .5, seen from within a box of fog that ends before the ball: the points are not in the fog, however the camera is.
    let mut world = World::new();
    let mut squares = |x: [f32; 2]| {
        let [a, b] = x.map(|x| world.spectrum(SpectrumDescription::Constant(x)));
        let mapping = TextureMapping::Point(Mat4::from_scale(Vec3::splat(2.0)));
        world.0.spectrum_textures.push(SpectrumTexture::Checkerboard { mapping, a, b });
        world.0.spectrum_textures.len() - 1
    };
    let (sigma_a, sigma_s) = (squares([0.2, 0.02]), squares([2.0, 4.0]));
    let material = world.subsurface(SubsurfaceMedium::Coefficients { sigma_a, sigma_s }, 0.0, 1.3);
    world.surface(&ball(1.0), material);
    let fog = world.medium(0.5, 0.0, 0.0);
    let none = world.dielectric(1.0, 0.0);
    world.body(&flat(&cuboid(Vec3::new(-1.0, -1.0, 3.0), Vec3::new(1.0, 1.0, 5.0))), none, Some(fog), None);
    world.0.camera.medium = Some(fog);
    let t = tracer(&world.environment(1.0), "dipole");
    let ray = |i| {
        let [u, v] = Stream::new(&[41, i]).uniform2();
        let o = Vec3::new(0.0, 0.0, 4.0);
        (o, (Vec3::new(1.6 * u - 0.8, 1.6 * v - 0.8, 0.0) - o).normalize())
    };
    let [a] = by_points(&t, samples(200, 8), 100, |_| Wavelengths::<1>::Fixed(550.0), ray);
    let [b] = measure(samples(60_000, 8), |i| {
        let (o, d) = ray(i);
        [t.radiance(i, o, d)]
    });
    assert_equal("textured coefficients by points and by lines, from within fog", a, b);
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

#[test]
fn rough_boundaries_let_in_what_they_let_out() {
    let space = flat(&cuboid(Vec3::new(-1e4, -1e4, -500.0), Vec3::new(1e4, 1e4, 0.0)));
    let look = |model: &str, albedo: f32, roughness: f32, towards: Option<Vec3>, view: Vec3| {
        let mut world = World::new();
        let medium = world.medium(1.0 - albedo, albedo, 0.0);
        let boundary = world.dielectric(1.4, roughness);
        world.body(&space, boundary, Some(medium), None);
        let world = match towards {
            Some(d) => world.distant(d, 2.0),
            None => world.environment(1.0),
        };
        let t = tracer(&world, model);
        let [e] = measure(samples(60_000, 16), |i| [t.radiance(i, view * 2.0 + Vec3::new(3.0, 2.0, 0.0), -view)]);
        e
    };
    let tilted = Vec3::new(0.6, 0.0, 0.8);
    // Hardly rough is smooth.
    let [a, b] = [0.0, 0.0011].map(|r| look("dipole", 0.95, r, Some(tilted), Vec3::Z));
    let off = (a.mean / b.mean - 1.0).abs();
    assert!(off < Z * (a.std_err / a.mean).hypot(b.std_err / b.mean) + 2e-3, "smooth {a}, hardly rough {b}");
    // Light from one side, seen from another, and the other way round: the mirror's part is the same both ways, what the body adds follows T(w_i) T(w_o).
    let other = Vec3::new(-0.28, 0.0, 0.96);
    let forth = look("dipole", 0.95, 0.4, Some(tilted), other);
    let back = look("dipole", 0.95, 0.4, Some(other), tilted);
    let per_cosine =
        |e: Estimate, c: f32| Estimate { mean: e.mean / f64::from(c), std_err: e.std_err / f64::from(c), ..e };
    assert_equal("there and back through a rough boundary", per_cosine(forth, tilted.z), per_cosine(back, other.z));
    // In uniform light: T(w_o) A besides the mirror's part, whatever N is.
    let totals = [0.6f32, 0.95].map(|x| profile("dipole", (1.0 - x, x, 0.0, 1.4)).total());
    let seen = [0.6, 0.95].map(|x| look("dipole", x, 0.4, None, Vec3::Z));
    // Without scattering nothing comes back.
    let dark = look("dipole", 0.0, 0.4, None, Vec3::Z);
    let through = seen.map(|s| s.mean - dark.mean);
    let error = |k: usize| seen[k].std_err.hypot(dark.std_err) / through[k];
    let off = (through[1] / through[0]) / (totals[1] / totals[0]) - 1.0;
    assert!(off.abs() < Z * error(0).hypot(error(1)) + 2.0 * BAKED, "{through:?} {totals:?} {off}");
    assert!(through[1] / totals[1] < 1.0 && through[1] / totals[1] > 0.9, "{through:?} {totals:?}");
}

#[test]
fn models_that_know_directions_are_evaluated_in_full() {
    // A half-space under distant light along the normal is that of the radial profile; at a slant it is the integral of the BSSRDF, which for a model made
    // of beams equals its plane albedo. Here that integral comes from quadrature over the plane.
    let m = (0.05f32, 0.95f32, 0.2f32, 1.3f32);
    let world = body(&flat(&cuboid(Vec3::new(-1e4, -1e4, -500.0), Vec3::new(1e4, 1e4, 0.0))), m);
    let eta = f64::from(m.3);
    let norm = 1.0 - 2.0 * moment_1(1.0 / eta);
    for model in ["directional-dipole", "photon-beam-oblique"] {
        let [a, s, g, n] = [m.0, m.1, m.2, m.3].map(f64::from);
        let medium = OpticalProperties::new(a, s, g, n).unwrap();
        let full = find(model).unwrap().bssrdf(&medium).unwrap().unwrap();
        for towards in [Vec3::Z, Vec3::new(0.8, 0.0, 0.6)] {
            // Over all exits around one entry: the sum over entries around one exit on a plane.
            let rings = 160;
            let total: f64 = (0..rings)
                .map(|i| {
                    let r = 1e-4 * (2e6f64).powf((f64::from(i) + 0.5) / f64::from(rings));
                    let step = (2e6f64).ln() / f64::from(rings);
                    let around: f64 = (0..48)
                        .map(|k| {
                            let (sin, cos) = (PI * (f64::from(k) + 0.5) / 24.0).sin_cos();
                            full.exitance(&Placement::on_plane(r * cos, r * sin, towards.as_dvec3()))
                        })
                        .sum();
                    2.0 * PI * r * r * step * around / 48.0
                })
                .sum();
            let t = tracer(&world.clone().distant(towards, 2.0), model);
            let look = |i| t.radiance(i, Vec3::new(3.0, 2.0, 1.0), -Vec3::Z);
            let [e] = measure(samples(60_000, 16), |i| [look(i)]);
            let (f, mu) = (reflectance_f64(1.0, eta), f64::from(towards.z));
            let exact = (1.0 - f) * (1.0 - reflectance_f64(mu, eta)) * mu * 2.0 * total / (PI * norm);
            // The midpoint rules, measured by doubling them, and the baked radial profile.
            assert_exact(&format!("half-space, {model}, light from {towards}"), e, exact, 3e-3 * exact);
        }
    }
}

#[test]
fn the_dual_beam_shows_where_one_looks_from() {
    // Index-matched, isotropic, in uniform light: by reciprocity the plane looks like its albedo for light along the view. The model is within 4 % of that (normal
    // light: 2 %, notes 5.11), but spreads single scattering, (alpha / 2) (1 - mu ln(1 + 1 / mu)), over all views.
    let m = (0.1f32, 0.9f32, 0.0f32, 1.0f32);
    let world = body(&flat(&cuboid(Vec3::new(-1e4, -1e4, -500.0), Vec3::new(1e4, 1e4, 0.0))), m);
    let t = tracer(&world.environment(1.0), "dual-beam");
    let h = HFunction::new(0.9).unwrap();
    let single = |mu: f64| 0.45 * (1.0 - mu * (1.0 + 1.0 / mu).ln());
    let spread = Rule::gauss(32, 0.0, 1.0).integrate(|mu| 2.0 * mu * single(mu));
    for (mu, excess) in [(1.0f32, 0.020), (0.6, 0.025), (0.3, 0.035)] {
        let d = Vec3::new((1.0 - mu * mu).sqrt(), 0.0, -mu);
        let [e] = measure(samples(60_000, 16), |i| [t.radiance(i, -2.0 * d + Vec3::new(3.0, 2.0, 0.0), d)]);
        let mu = f64::from(mu);
        let exact = h.plane_albedo(mu) - single(mu) + spread;
        // Excess as measured with a million paths, to .3 %; the slack is about twice that.
        assert_exact(&format!("dual beam, view at the cosine {mu}"), e, exact * (1.0 + excess), 6e-3 * exact);
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

/// Returns a square of a medium's surface, with nothing below.
fn square(m: (f32, f32, f32, f32)) -> World {
    let mut world = World::new();
    let medium = world.medium(m.0, m.1, m.2);
    let boundary = world.dielectric(m.3, 0.0);
    world.body(&rectangle(Vec3::ZERO, Vec3::X * 1e4, Vec3::Y * 1e4), boundary, Some(medium), None);
    world
}

#[test]
fn an_open_square_gives_back_the_total_of_its_model_on_both_sides() {
    // To .3 % of the total; slow .1 %. The model that was asked for, or the exact profile in place of a walk.
    for (m, model) in [
        ((0.1f32, 0.9f32, 0.0f32, 1.0f32), Some("dipole")),
        ((0.01, 1.5, 0.3, 1.4), Some("tabulated")),
        ((0.05, 0.95, 0.0, 1.3), None),
    ] {
        let options = SceneOptions {
            model: model.map(|m| find(m).unwrap()),
            open: if model.is_none() { OpenPolicy::Profile } else { OpenPolicy::Refuse },
            ..Default::default()
        };
        let (scene, warnings) = Scene::new(&square(m).environment(1.0).0, &options).unwrap();
        let name = model.unwrap_or("tabulated");
        let told = format!("shape is open (4 boundary edges): the profile {name} renders it");
        assert!(warnings.iter().any(|w| w.message.starts_with(&told)), "{warnings:?}");
        let t = Tracer::new(scene);
        let (f, total) = (reflectance_f64(1.0, f64::from(m.3)), profile(name, m).total());
        let exact = f + (1.0 - f) * total;
        for side in [1.0, -1.0] {
            let [e] = measure(samples(300_000, 8), |i| [t.radiance(i, Vec3::new(3.0, 2.0, side), -Vec3::Z * side)]);
            assert!(e.std_err < 0.003 * exact, "{e}");
            assert_exact(&format!("open square from {side}, {name}, {m:?}"), e, exact, BAKED * exact);
        }
        let c = t.assert_sound();
        assert!(c.probes > 0 && c.collisions == 0 && c.entered == 0, "{c:?}");
    }
}

#[test]
fn an_open_bowl_is_lit_inside_and_outside_and_its_instances_alike() {
    // A bumpy ball without its upper part, white by a distant light from above: light that the inside sends to itself makes it brighter.
    let whole = bumpy_sphere(3, 0.1);
    let below = |t: &[u32; 3]| t.iter().all(|&v| whole.positions()[v as usize].z < 0.3);
    let indices: Vec<_> = whole.indices().iter().copied().filter(below).collect();
    let bowl = flat(&Mesh::new(whole.positions().to_vec(), vec![], vec![], indices).unwrap());
    let bodies = |first: bool| {
        let mut world = World::new();
        let [sigma_a, sigma_s] = [0.05f32, 20.0].map(|x| world.spectrum(SpectrumDescription::Constant(x)));
        let wax = world.subsurface(SubsurfaceMedium::Coefficients { sigma_a, sigma_s }, 0.0, 1.4);
        world.surface(&bowl, wax);
        if !first {
            world.instances(0, &[Mat4::IDENTITY, Mat4::from_translation(Vec3::X * 100.0)]);
        }
        let options = SceneOptions { open: OpenPolicy::Profile, ..Default::default() };
        let mut t = Tracer::new(Scene::new(&world.distant(Vec3::Z, 1.0).0, &options).unwrap().0);
        t.integrator.seed = 1 + u64::from(first);
        t
    };
    let [once, twice] = [true, false].map(|first| {
        let t = bodies(first);
        let e: [_; 2] = measure(samples(60_000, 8), |i| {
            let l = [4.0, -4.0].map(|z| t.radiance(i, Vec3::new(0.1, 0.2, z), Vec3::new(0.0, 0.05, -z).normalize()));
            assert!(l.iter().all(|l| l.is_finite() && *l >= 0.0), "{l:?}");
            l
        });
        let c = t.assert_sound();
        assert!(c.probes > 0 && c.collisions == 0, "{c:?}");
        e
    });
    for (k, what) in ["inside of a bowl", "outside of a bowl"].into_iter().enumerate() {
        assert_equal(what, once[k], twice[k]);
    }
    // The outside lies in the shadow of the rest: each side is a body of its own.
    assert!(once[0].mean > 0.1 && once[1].mean < 0.02 * once[0].mean, "{once:?}");
}

#[test]
fn caps_come_before_profiles_and_holes_that_kill_walks_do_not_matter_to_them() {
    let m = (0.1f32, 0.9f32, 0.0f32, 1.0f32);
    let whole = bumpy_sphere(2, 0.1);
    let mesh = Mesh::new(whole.positions().to_vec(), vec![], vec![], whole.indices()[40..].to_vec()).unwrap();
    let world = body(&flat(&mesh), m).environment(1.0);
    let build = |open| {
        let options = SceneOptions { open, model: Some(find("dipole").unwrap()), ..Default::default() };
        Scene::new(&world.0, &options).unwrap()
    };
    let (capped, warnings) = build(OpenPolicy::Cap);
    assert!(capped.objects[0].body.is_some() && warnings[0].message.contains("closed with flat caps"), "{warnings:?}");
    let (killed, warnings) = build(OpenPolicy::Kill);
    assert!(killed.objects[0].open.is_some() && warnings[0].message.contains("the profile dipole renders it"));
    let t = Tracer::new(killed);
    measure(2000, |i| {
        let (o, d) = uniform_ray(94, i, 1.3);
        [t.radiance(i, o, d)]
    });
    assert!(t.assert_sound().probes > 100);
}
