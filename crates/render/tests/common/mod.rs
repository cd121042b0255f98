//! What the tests of transport share: scenes as plain data, rays, and measurements with their errors.

use std::sync::{Arc, Mutex};

use moonmilk_core::estimate::Accumulator;
use moonmilk_core::random::SOBOL_DIMENSIONS;
use moonmilk_core::{Estimate, Frame, Mat4, Random, Sampler, Stream, Vec2, Vec3, WavelengthMode, Wavelengths};
use moonmilk_geometry::Mesh;
use moonmilk_render::description::*;
use moonmilk_render::integrator::{Counters, Integrator, Light, Policy};
use moonmilk_render::scene::{OpenPolicy, Scene, SceneOptions, Similarity};
use moonmilk_walk::Roulette;
use rayon::prelude::*;

/// Standard errors that a comparison accepts: 1e-6 two-sided.
pub const Z: f64 = 4.9;

/// Returns the number of samples of a measurement: `usual`, or `slow` times as many if `MOONMILK_SLOW` is 1, and k times more than
/// that if it is k.
pub fn samples(usual: u64, slow: u64) -> u64 {
    match std::env::var("MOONMILK_SLOW") {
        Ok(k) => usual * slow * k.parse::<u64>().expect("MOONMILK_SLOW is a number"),
        Err(_) => usual,
    }
}

/// Returns means and standard errors of the K numbers that f yields for 0..n, the same whatever the threads.
pub fn measure<const K: usize>(n: u64, f: impl Fn(u64) -> [f64; K] + Sync) -> [Estimate; K] {
    const PARTS: u64 = 256;
    let parts: Vec<[Accumulator; K]> = (0..PARTS)
        .into_par_iter()
        .map(|part| {
            let mut sums = [Accumulator::default(); K];
            for i in n * part / PARTS..n * (part + 1) / PARTS {
                sums.iter_mut().zip(f(i)).for_each(|(s, x)| s.add(x));
            }
            sums
        })
        .collect();
    let mut sums = [Accumulator::default(); K];
    parts.iter().for_each(|p| sums.iter_mut().zip(p).for_each(|(s, x)| s.merge(x)));
    sums.map(|s| s.estimate())
}

/// Reports an estimate and asserts that it is `exact` within [`Z`] standard errors and `slack`, the stated error of `exact` itself.
pub fn assert_exact(what: &str, e: Estimate, exact: f64, slack: f64) {
    let off = ((e.mean - exact).abs() - slack).max(0.0);
    println!("{what}: {e}, exact {exact:.6}, z {:+.2}, precision {:.4} %", e.z(exact), 100.0 * e.std_err / exact.abs());
    assert!(off <= Z * e.std_err, "{what}: {e} against {exact}");
}

/// Reports two independent estimates and asserts that they agree within [`Z`] standard errors.
pub fn assert_equal(what: &str, a: Estimate, b: Estimate) {
    let precision = 100.0 * a.std_err.hypot(b.std_err) / b.mean.abs();
    println!("{what}: {a} and {b}, z {:+.2}, precision {precision:.4} %", a.z_against(&b));
    assert!(b.std_err > 0.0 && a.z_against(&b).abs() < Z, "{what}: {a} against {b}");
}

/// No roulette: weights may become as small as they like.
pub const KEEP_ALL: Roulette = Roulette { threshold: 0.0, survivor: 1.0 };

/// A scene under construction.
#[derive(Clone)]
pub struct World(pub SceneDescription);

pub fn place() -> Place {
    Place { file: "test".into(), line: 1, column: 1 }
}

pub fn rgb(x: f32) -> SpectrumDescription {
    SpectrumDescription::Rgb([x; 3])
}

impl World {
    /// Returns a scene of nothing, seen by a perspective camera at (0, 0, 4) that looks along -z at 16 x 16 pixels.
    pub fn new() -> Self {
        let camera_to_world =
            Mat4::from_translation(Vec3::new(0.0, 0.0, 4.0)) * Mat4::from_rotation_y(std::f32::consts::PI);
        Self(SceneDescription {
            camera: CameraDescription {
                kind: CameraKind::Perspective { fov: 40.0 },
                camera_to_world,
                medium: None,
                screen_window: None,
                frame_aspect_ratio: None,
                lens_radius: 0.0,
                focal_distance: 1.0,
            },
            film: FilmDescription {
                width: 16,
                height: 16,
                crop: [0, 16, 0, 16],
                filename: None,
                imaging_ratio: 1.0,
                max_component_value: None,
            },
            filter: FilterDescription { kind: FilterKind::Box, radius: Vec2::splat(0.5) },
            sampler: SamplerDescription { samples: 16, seed: 0 },
            integrator: IntegratorDescription { name: "volpath".into(), max_depth: 5 },
            media: vec![],
            materials: vec![],
            float_textures: vec![],
            spectrum_textures: vec![],
            images: vec![],
            shapes: vec![],
            objects: vec![],
            instances: vec![],
            lights: vec![],
        })
    }

    /// Gives all materials a displacement of noise times a factor.
    pub fn displace_all(&mut self, factor: f32) {
        let to_texture = Mat4::from_scale(Vec3::splat(3.0));
        self.0.float_textures.push(FloatTexture::Fbm { to_texture, octaves: 2, roughness: 0.5 });
        let noise = self.0.float_textures.len() - 1;
        let factor = self.float(factor);
        self.0.float_textures.push(FloatTexture::Scale(noise, factor));
        let displacement = Some(self.0.float_textures.len() - 1);
        self.0.materials.iter_mut().for_each(|m| m.displacement = displacement);
    }

    pub fn float(&mut self, x: f32) -> FloatTextureId {
        self.0.float_textures.push(FloatTexture::Constant(x));
        self.0.float_textures.len() - 1
    }

    pub fn spectrum(&mut self, s: SpectrumDescription) -> SpectrumTextureId {
        self.0.spectrum_textures.push(SpectrumTexture::Constant(s));
        self.0.spectrum_textures.len() - 1
    }

    pub fn material(&mut self, kind: MaterialKind) -> MaterialId {
        self.0.materials.push(MaterialDescription {
            name: None,
            place: place(),
            kind,
            displacement: None,
            normal_map: None,
            set: None,
            priority: None,
        });
        self.0.materials.len() - 1
    }

    /// Returns a boundary of relative index eta, which at eta = 1 is no surface at all; `roughness` is GGX's alpha.
    pub fn dielectric(&mut self, eta: f32, roughness: f32) -> MaterialId {
        let alpha = self.float(roughness);
        let roughness = Roughness { u: alpha, v: alpha, remap: false };
        self.material(MaterialKind::Dielectric { eta: SpectrumDescription::Constant(eta), roughness })
    }

    pub fn subsurface(&mut self, medium: SubsurfaceMedium, g: f32, eta: f32) -> MaterialId {
        let alpha = self.float(0.0);
        let roughness = Roughness { u: alpha, v: alpha, remap: false };
        self.material(MaterialKind::Subsurface { medium, scale: 1.0, g, eta, roughness })
    }

    pub fn diffuse(&mut self, reflectance: f32) -> MaterialId {
        let reflectance = self.spectrum(SpectrumDescription::Constant(reflectance));
        self.material(MaterialKind::Diffuse { reflectance })
    }

    pub fn medium_of(&mut self, kind: MediumKind) -> MediumId {
        self.0.media.push(MediumDescription { name: "medium".into(), place: place(), kind });
        self.0.media.len() - 1
    }

    /// Returns a grey medium.
    pub fn medium(&mut self, sigma_a: f32, sigma_s: f32, g: f32) -> MediumId {
        let [sigma_a, sigma_s] = [sigma_a, sigma_s].map(SpectrumDescription::Constant);
        self.medium_of(MediumKind::Homogeneous { sigma_a, sigma_s, scale: 1.0, g, emission: None })
    }

    /// Returns a grey medium whose emission is `radiance` times sigma_a per unit length.
    pub fn glow(&mut self, sigma_a: f32, sigma_s: f32, g: f32, radiance: f32) -> MediumId {
        self.medium_of(glow(sigma_a, sigma_s, g, radiance))
    }

    /// Adds a shape that bounds nothing; returns its number.
    pub fn surface(&mut self, geometry: &Arc<GeometryDescription>, material: MaterialId) -> usize {
        self.0.shapes.push(ShapeDescription {
            place: place(),
            name: "shape".into(),
            geometry: geometry.clone(),
            object_to_world: Mat4::IDENTITY,
            reverse_orientation: false,
            material,
            media: None,
            area_light: None,
            alpha: None,
        });
        self.0.shapes.len() - 1
    }

    /// Adds a boundary between two media; returns its number.
    pub fn body(
        &mut self,
        geometry: &Arc<GeometryDescription>,
        material: MaterialId,
        inside: Option<MediumId>,
        outside: Option<MediumId>,
    ) -> usize {
        let shape = self.surface(geometry, material);
        self.0.shapes[shape].media = Some(MediumInterface { inside, outside });
        shape
    }

    /// Turns the shapes from number `first` on into an object, and puts it where `places` say.
    pub fn instances(&mut self, first: usize, places: &[Mat4]) {
        let shapes = self.0.shapes.split_off(first);
        self.0.objects.push(ObjectDescription { name: "object".into(), shapes });
        let object = self.0.objects.len() - 1;
        let instance = |&object_to_world: &Mat4| InstanceDescription { place: place(), object, object_to_world };
        self.0.instances.extend(places.iter().map(instance));
    }

    /// Gives a material a priority among overlapping bodies.
    pub fn with_priority(&mut self, material: MaterialId, priority: i32) -> MaterialId {
        self.0.materials[material].priority = Some(priority);
        material
    }

    /// Adds a black surface that emits on the side of its normal; returns its number.
    pub fn emitter(&mut self, geometry: &Arc<GeometryDescription>, radiance: f32) -> usize {
        let black = self.diffuse(0.0);
        let shape = self.surface(geometry, black);
        self.0.shapes[shape].area_light = Some(AreaLightDescription {
            place: place(),
            radiance: rgb(radiance),
            scale: 1.0,
            two_sided: false,
            power: None,
            image: None,
        });
        shape
    }

    pub fn light(&mut self, kind: LightKind) {
        self.0.lights.push(LightDescription {
            place: place(),
            light_to_world: Mat4::IDENTITY,
            scale: 1.0,
            power: None,
            kind,
            medium: None,
            portal: None,
        });
    }

    /// Adds the same radiance from all directions.
    pub fn environment(mut self, radiance: f32) -> Self {
        self.light(LightKind::Constant { radiance: rgb(radiance) });
        self
    }

    /// Adds parallel light from the direction `towards` it; irradiance on a plane that faces it.
    pub fn distant(mut self, towards: Vec3, irradiance: f32) -> Self {
        self.light(LightKind::Distant { from: towards, to: Vec3::ZERO, irradiance: rgb(irradiance) });
        self
    }

    pub fn scene(&self) -> Scene {
        Scene::new(&self.0, &SceneOptions { open: OpenPolicy::Refuse, ..Default::default() })
            .expect("a scene of the tests is valid")
            .0
    }

    pub fn tracer(&self) -> Tracer {
        Tracer::new(self.scene())
    }

    /// Returns the scene walked through by the hybrid.
    pub fn hybrid(&self) -> Tracer {
        let options = SceneOptions { hybrid: true, ..Default::default() };
        Tracer::new(Scene::new(&self.0, &options).expect("a scene of the tests is valid").0)
    }

    /// Returns the scene walked through by shifted jumps.
    pub fn shifted(&self) -> Tracer {
        let options = SceneOptions { shifted: true, ..Default::default() };
        Tracer::new(Scene::new(&self.0, &options).expect("a scene of the tests is valid").0)
    }

    /// Returns the scene with its media exchanged for similar ones.
    pub fn similar(&self, similarity: Similarity) -> Tracer {
        let options = SceneOptions { similar: Some(similarity), ..Default::default() };
        Tracer::new(Scene::new(&self.0, &options).expect("a scene of the tests is valid").0)
    }
}

/// Returns a grey medium whose emission is `radiance` times sigma_a per unit length.
pub fn glow(sigma_a: f32, sigma_s: f32, g: f32, radiance: f32) -> MediumKind {
    let [sigma_a, sigma_s] = [sigma_a, sigma_s].map(SpectrumDescription::Constant);
    MediumKind::Homogeneous { sigma_a, sigma_s, scale: 1.0, g, emission: Some((rgb(radiance), 1.0)) }
}

/// Returns a sphere around the origin.
pub fn ball(radius: f32) -> Arc<GeometryDescription> {
    Arc::new(GeometryDescription::Sphere { radius, z_min: -radius, z_max: radius, phi_max: 360.0 })
}

/// Returns a mesh without shading normals.
pub fn flat(mesh: &Mesh) -> Arc<GeometryDescription> {
    Arc::new(GeometryDescription::Mesh {
        positions: mesh.positions().to_vec(),
        normals: vec![],
        uvs: vec![],
        indices: mesh.indices().to_vec(),
    })
}

/// Returns a mesh with normals at its vertices: the sums of the neighbouring triangles' area vectors.
pub fn smooth(mesh: &Mesh) -> Arc<GeometryDescription> {
    let p = mesh.positions();
    let mut normals = vec![Vec3::ZERO; p.len()];
    for &[a, b, c] in mesh.indices() {
        let [a, b, c] = [a as usize, b as usize, c as usize];
        let n = (p[b] - p[a]).cross(p[c] - p[a]);
        [a, b, c].into_iter().for_each(|v| normals[v] += n);
    }
    let normals = normals.into_iter().map(Vec3::normalize).collect();
    Arc::new(GeometryDescription::Mesh {
        positions: p.to_vec(),
        normals,
        uvs: vec![],
        indices: mesh.indices().to_vec(),
    })
}

/// Returns a rectangle around a centre, spanned by half edges s and t; its normal is along s x t.
pub fn rectangle(center: Vec3, s: Vec3, t: Vec3) -> Arc<GeometryDescription> {
    Arc::new(GeometryDescription::Mesh {
        positions: vec![center - s - t, center + s - t, center + s + t, center - s + t],
        normals: vec![],
        uvs: vec![],
        indices: vec![[0, 1, 2], [0, 2, 3]],
    })
}

/// A scene with the means to send paths into it.
pub struct Tracer {
    pub scene: Scene,
    pub integrator: Integrator,
    counters: Mutex<Counters>,
    /// Integrators with banks of their own, if asked for.
    banks: Vec<Integrator>,
}

impl Tracer {
    pub fn new(scene: Scene) -> Self {
        let integrator = Integrator::new(1, WavelengthMode::MONO, Default::default(), None);
        Self { scene, integrator, counters: Mutex::default(), banks: vec![] }
    }

    /// The same with so many banks of exits, of which path i takes number i: where as many records as paths take errors are those of independent samples.
    pub fn with_banks(mut self, count: u64) -> Self {
        // Banks serve four samples.
        self.banks = (0..count).map(|k| self.integrator.for_sample(&self.scene, 4 * k)).collect();
        self
    }

    /// The same scene by a policy of exact walks, with random numbers of its own.
    pub fn by(mut self, policy: Policy) -> Self {
        self.integrator = self.integrator.with_policy(policy);
        self.integrator.seed = 1 + policy as u64;
        self
    }

    /// Lets weights become as small as they like.
    pub fn keep_all(&mut self) {
        self.integrator.roulette = KEEP_ALL;
        self.banks.iter_mut().for_each(|b| b.roulette = KEEP_ALL);
    }

    /// Returns what path number i finds from a point in a direction, and what it did.
    pub fn follow<const N: usize>(&self, i: u64, o: Vec3, d: Vec3, w: &Wavelengths<N>) -> (Light<N>, Counters) {
        let banked = self.banks.get(i as usize % self.banks.len().max(1));
        self.follow_by(banked.unwrap_or(&self.integrator), i, o, d, w)
    }

    /// The same by another integrator.
    pub fn follow_by<const N: usize>(
        &self,
        integrator: &Integrator,
        i: u64,
        o: Vec3,
        d: Vec3,
        w: &Wavelengths<N>,
    ) -> (Light<N>, Counters) {
        // Give every path a stream of its own, so that errors are those of independent samples.
        let mut rng = Sampler::new(self.integrator.seed, i as u32, (i >> 32) as u32, 0);
        rng.skip_to(SOBOL_DIMENSIONS);
        let (mut light, mut counters) = (Light::default(), Counters::default());
        integrator.trace(&self.scene, o, d, w, &mut rng, &mut light, &mut counters);
        self.counters.lock().expect("no test panics while it holds this").merge(&counters);
        (light, counters)
    }

    /// Returns the radiance that path number i finds, at one wavelength.
    pub fn radiance(&self, i: u64, o: Vec3, d: Vec3) -> f64 {
        let (light, _) = self.follow(i, o, d, &Wavelengths::<1>::Fixed(550.0));
        light.orders.iter().map(|l| f64::from(l[0])).sum()
    }

    pub fn counters(&self) -> Counters {
        *self.counters.lock().expect("no test panics while it holds this")
    }

    /// Asserts that closed bodies were never left but through their surfaces; returns the counters.
    ///
    /// A path may be set back onto a surface (`rescued`) and meet a surface from the wrong side (`contrary`) only where
    /// rounding of a position can cause it: less than once in 1e5 segments.
    pub fn assert_sound(&self) -> Counters {
        let c = self.counters();
        assert!(c.lost == 0 && c.endless == 0, "{c:?}");
        let rare = 1e-5 * (c.segments + c.rays) as f64;
        assert!((c.rescued as f64) < rare && (c.contrary as f64) < rare, "{c:?}");
        c
    }
}

/// Returns a ray of uniform light from all directions through a sphere around the origin: its entry point is uniform, its direction
/// cosine-distributed.
pub fn uniform_ray(seed: u64, i: u64, radius: f32) -> (Vec3, Vec3) {
    let mut rng = Stream::new(&[seed, i]);
    let n = direction(rng.uniform2());
    (n * radius, cosine(rng.uniform2(), -n))
}

/// Returns a uniform direction.
pub fn direction(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let r = (4.0 * u[0] * (1.0 - u[0])).sqrt();
    let (s, c) = (std::f32::consts::TAU * u[1]).sin_cos();
    Vec3::new(r * c, r * s, z)
}

/// Returns a direction around n whose density is cosine / pi.
pub fn cosine(u: [f32; 2], n: Vec3) -> Vec3 {
    let (r, (s, c)) = (u[0].sqrt(), (std::f32::consts::TAU * u[1]).sin_cos());
    Frame::new(n).to_world(Vec3::new(r * c, r * s, (1.0 - u[0]).sqrt())).normalize()
}
