//! Random walks inside closed bodies must always find their way out, at every scale: zero losses allowed.

use moonmilk_core::glam::{DAffine3, DQuat, DVec3};
use moonmilk_core::{Mat4, Random, Stream, Vec3};
use moonmilk_geometry::{Accel, Body, Bounds, Facing, Hit, NONE, Quadric, Ray, Shape, generate};

const SCALES: [f32; 3] = [1e-3, 1.0, 1e3];

fn direction(r: &mut Stream) -> Vec3 {
    let (z, phi) = (2.0 * r.uniform() - 1.0, std::f32::consts::TAU * r.uniform());
    let s = (1.0 - z * z).sqrt();
    Vec3::new(s * phi.cos(), s * phi.sin(), z)
}

/// One of the 6 axis directions, zeros with random signs.
fn axis(r: &mut Stream) -> Vec3 {
    let mut d = [0f32; 3].map(|z| if r.uniform() < 0.5 { -z } else { z });
    d[(r.uniform() * 3.0) as usize] = if r.uniform() < 0.5 { 1.0 } else { -1.0 };
    Vec3::from_array(d)
}

/// What a walk met.
#[derive(Debug, Default)]
struct Count {
    segments: u64,
    exits: u64,
    lost: u64,
    outside: u64,
    rescued: u64,
}

struct Walker<'a> {
    accel: &'a Accel,
    body: Body,
    /// Bounds grown by the slack.
    bounds: Bounds,
    size: f32,
}

impl Walker<'_> {
    /// Walks from a point inside: flights of random length, reflection at the wall, collisions in space.
    fn walk(&self, mut p: Vec3, mut d: Vec3, segments: u32, mfp: f32, r: &mut Stream, c: &mut Count) {
        let mut skip = NONE;
        for _ in 0..segments {
            c.segments += 1;
            // A probe without end must find the wall; the flight then ends before it or there.
            let ray = Ray::new(p, d).from_prim(skip).facing(Facing::Exiting(self.body));
            let Some(hit) = self.accel.nearest(&ray) else {
                c.lost += 1;
                return;
            };
            let flight = -mfp * self.size * r.uniform().ln();
            if flight < hit.t {
                p = ray.at(flight);
                (d, skip) = (direction(r), NONE);
            } else {
                c.exits += 1;
                c.rescued += u64::from(hit.rescued);
                let (q, n) = self.accel.point_and_normal(&ray, &hit);
                // A line that rounding h put outside touches a sphere of radius R at a cosine of up to sqrt(2 h / R).
                let grazing = (8.0 * self.body.slack / self.size).sqrt().max(1e-5);
                assert!(hit.exiting && n.dot(d) > -grazing, "an inside walk met an entering hit: {ray:?} {hit:?} {n}");
                // Reflect to the inside: specularly, sometimes grazing, sometimes anywhere.
                d = match (r.uniform() * 3.0) as u32 {
                    0 => (d - n * (2.0 * d.dot(n))).normalize(),
                    1 => (d - n * (1.0001 * d.dot(n))).try_normalize().unwrap_or(-n),
                    _ => direction(r),
                };
                if d.dot(n) > 0.0 {
                    d = (d - n * (2.0 * d.dot(n))).normalize();
                }
                (p, skip) = (q, hit.prim);
            }
            if !self.bounds.contains(p) {
                c.outside += 1;
                return;
            }
        }
    }
}

fn walks(name: &str, shape: Shape, inside: impl Fn(&mut Stream) -> Vec3, budget: u64) {
    walks_in(name, &Accel::build(vec![shape]), 0, inside, budget);
}

/// Walks in one shape of a scene.
fn walks_in(name: &str, accel: &Accel, shape: u32, inside: impl Fn(&mut Stream) -> Vec3, budget: u64) {
    let bounds = accel.shape_bounds(shape);
    let body = accel.body(shape..shape + 1);
    let w = Walker { accel, body, bounds: bounds.grown(body.slack), size: bounds.extent().max_element() };
    let mut r = Stream::new(&[31]);
    let mut c = Count::default();
    let mut k = 0;
    while c.segments < budget {
        let mfp = [0.003, 0.03, 0.3, 10.0][k % 4];
        let d = if k % 5 == 0 { axis(&mut r) } else { direction(&mut r) };
        w.walk(inside(&mut r), d, 1000, mfp, &mut r, &mut c);
        k += 1;
    }
    println!("{name}: {c:?}");
    assert!(c.lost == 0 && c.outside == 0 && c.exits > budget / 20, "{name}: {c:?}");
}

#[test]
fn walks_in_a_bumpy_sphere_of_327_680_triangles_never_leak() {
    let mesh = generate::bumpy_sphere(7, 0.2);
    for scale in SCALES {
        let m = mesh.transformed(&Mat4::from_scale(Vec3::splat(scale))).unwrap();
        walks("bumpy sphere", m.into(), |r| direction(r) * 0.3 * scale, 1_000_000);
    }
}

#[test]
fn walks_in_a_cube_never_leak() {
    for scale in SCALES {
        for offset in [Vec3::ZERO, Vec3::new(3.0, -7.0, 0.5)] {
            let (low, high) = ((Vec3::splat(-1.0) + offset) * scale, (Vec3::splat(1.0) + offset) * scale);
            let start = |r: &mut Stream| (offset + Vec3::new(r.uniform(), r.uniform(), r.uniform()) - 0.5) * scale;
            walks("cube", generate::cuboid(low, high).into(), start, 400_000);
        }
    }
}

#[test]
fn walks_in_a_turned_cube_far_from_the_origin_never_leak() {
    let cube = generate::cuboid(Vec3::splat(-1.0), Vec3::splat(1.0));
    let m = Mat4::from_translation(Vec3::new(300.0, -200.0, 900.0))
        * Mat4::from_euler(moonmilk_core::glam::EulerRot::XYZ, 0.3, 0.7, 1.1);
    let center = Vec3::new(300.0, -200.0, 900.0);
    walks("turned cube", cube.transformed(&m).unwrap().into(), |r| center + direction(r) * 0.5, 1_000_000);
}

#[test]
fn walks_in_a_thin_sheet_never_leak() {
    // As thick as a hundredth of its width; waves of a twentieth make concave and convex edges.
    let mesh = generate::sheet(40, 0.01);
    for scale in SCALES {
        let m = mesh.transformed(&Mat4::from_scale(Vec3::splat(scale))).unwrap();
        let start = |r: &mut Stream| {
            let (x, y) = (0.1 + 0.8 * r.uniform(), 0.1 + 0.8 * r.uniform());
            Vec3::new(x, y, 0.05 * (9.0 * x).sin() * (7.0 * y).cos() + 0.005) * scale
        };
        walks("sheet", m.into(), start, 1_000_000);
    }
}

#[test]
fn walks_in_a_sphere_primitive_far_from_the_origin_never_leak() {
    for scale in SCALES {
        for center in [Vec3::ZERO, Vec3::new(1e3, -1e3, 1e3)] {
            let s = Quadric::sphere(center * scale, scale).unwrap();
            walks("sphere", s.into(), |r| (center + direction(r) * 0.5) * scale, 500_000);
        }
    }
}

#[test]
fn walks_in_an_ellipsoid_never_leak() {
    let kind = moonmilk_geometry::QuadricKind::Sphere { radius: 1.0, z_min: -1.0, z_max: 1.0, phi_max: 7.0 };
    let m = Mat4::from_translation(Vec3::splat(50.0))
        * Mat4::from_rotation_y(0.5)
        * Mat4::from_scale(Vec3::new(2.0, 0.05, 1.0));
    let q = Quadric::new(kind, &m).unwrap();
    walks("ellipsoid", q.into(), |r| Vec3::splat(50.0) + direction(r) * 0.03, 500_000);
}

/// Where instances stand in the tests: turned, small and large, mirrored, squashed, sheared, far from the origin.
fn placements() -> Vec<DAffine3> {
    let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.2);
    let place = |scale: DVec3, at: DVec3| DAffine3::from_scale_rotation_translation(scale, turn, at);
    let mut shear = place(DVec3::ONE, DVec3::new(-9.0, 4.0, 0.0));
    shear.matrix3.y_axis += shear.matrix3.x_axis * 0.7;
    vec![
        DAffine3::IDENTITY,
        place(DVec3::splat(1e-3), DVec3::new(3.0, 3.0, 0.0)),
        place(DVec3::splat(1e3), DVec3::new(0.0, 5e3, 0.0)),
        place(DVec3::new(-1.0, 1.0, 1.0), DVec3::new(0.0, 0.0, 6.0)),
        place(DVec3::new(2.0, 0.05, -1.0), DVec3::new(0.0, -8.0, 0.0)),
        shear,
        place(DVec3::splat(1.0), DVec3::new(300.0, -200.0, 900.0)),
    ]
}

#[test]
fn walks_in_instances_never_leak_whatever_their_transform() {
    let objects =
        vec![vec![generate::bumpy_sphere(6, 0.2).into(), Quadric::sphere(Vec3::X * 3.0, 0.5).unwrap().into()]];
    let places: Vec<_> = placements().into_iter().map(|m| (0, m)).collect();
    let aside = generate::sheet(20, 0.1).transformed(&Mat4::from_translation(Vec3::X * 9.0)).unwrap();
    let accel = Accel::with_instances(vec![aside.into()], objects, &places).unwrap();
    for (i, (_, m)) in places.iter().enumerate() {
        for (shape, center, radius) in [(0, DVec3::ZERO, 0.3), (1, DVec3::X * 3.0, 0.2)] {
            let start = |r: &mut Stream| m.transform_point3(center + direction(r).as_dvec3() * radius).as_vec3();
            walks_in(&format!("instance {i}, shape {shape}"), &accel, 1 + 2 * i as u32 + shape, start, 200_000);
        }
    }
}

#[test]
fn lines_cross_every_instance_inward_and_outward_in_turn() {
    let mesh = generate::bumpy_sphere(5, 0.5);
    let mut places: Vec<_> = placements().into_iter().map(|m| (0, m)).collect();
    // A neighbour that overlaps the first one.
    places.push((0, DAffine3::from_translation(DVec3::new(0.8, 0.1, 0.0))));
    let accel = Accel::with_instances(vec![], vec![vec![mesh.clone().into()]], &places).unwrap();
    let mut r = Stream::new(&[37]);
    let (mut hits, mut crossed) = (Vec::<Hit>::new(), 0);
    for k in 0..200_000u32 {
        let i = k as usize % places.len();
        let m = &places[i].1;
        // Through vertices and through the middle, from all over and from inside.
        let p = if k % 3 == 0 { mesh.corners(k % mesh.indices().len() as u32)[0] } else { direction(&mut r) * 0.6 };
        let target = m.transform_point3(p.as_dvec3()).as_vec3();
        let from = direction(&mut r).as_dvec3() * if k % 5 == 0 { 0.2 } else { 5.0 };
        let o = m.transform_point3(from).as_vec3();
        let ray = Ray::new(o, (target - o).normalize());
        hits.clear();
        accel.all_hits(&ray, |h| hits.push(*h));
        let inside = i32::from(k % 5 == 0);
        for j in 0..places.len() as u32 {
            let of_one = || hits.iter().filter(|h| h.prim.instance == j);
            let count: i32 = of_one().map(|h| if h.exiting { 1 } else { -1 }).sum();
            if k % 3 != 0 && j == i as u32 {
                assert_eq!(count, inside, "ray {k}, instance {j}: {hits:?}");
                crossed += usize::from(of_one().count() > 0);
            }
            if k % 3 == 0 && j == i as u32 && inside == 1 {
                assert!(of_one().any(|h| h.exiting), "ray {k} found no way out of instance {j}");
            }
        }
        let nearest = hits.iter().map(|h| h.t).fold(f32::INFINITY, f32::min);
        assert_eq!(accel.nearest(&ray).map_or(f32::INFINITY, |h| h.t), nearest, "ray {k}");
    }
    assert!(crossed > 100_000, "{crossed}");
}

#[test]
fn no_ray_at_a_vertex_or_an_edge_midpoint_slips_through() {
    let mesh = generate::bumpy_sphere(6, 0.2);
    for scale in SCALES {
        let m = mesh.transformed(&Mat4::from_scale(Vec3::splat(scale))).unwrap();
        let accel = Accel::build(vec![m.clone().into()]);
        let body = accel.body(0..1);
        let mut r = Stream::new(&[32]);
        let mut lost = 0;
        for i in 0..1_000_000u32 {
            let c = m.corners((r.uniform() * m.indices().len() as f32) as u32);
            let target = match i % 3 {
                0 => c[0],
                1 => c[0].midpoint(c[1]),
                _ => c[0].lerp(c[1], r.uniform()),
            };
            // From inside, along random directions from random points, and from the axes.
            let o = if i % 7 == 0 { target * Vec3::new(0.5, 1.0, 1.0) * 0.5 } else { direction(&mut r) * 0.5 * scale };
            let d = (target - o).normalize();
            lost += u32::from(accel.nearest(&Ray::new(o, d)).is_none());
            lost += u32::from(accel.nearest(&Ray::new(o, d).facing(Facing::Exiting(body))).is_none());
        }
        assert_eq!(lost, 0, "scale {scale}");
    }
}

#[test]
fn pencil_beams_along_the_axes_hit_whatever_the_signs_of_their_zeros() {
    // Rays exactly through vertices and along grid lines of an axis-parallel mesh.
    let accel = Accel::build(vec![
        generate::cuboid(Vec3::splat(-1.0), Vec3::splat(1.0)).into(),
        generate::sheet(16, 0.5).into(),
    ]);
    let mut r = Stream::new(&[33]);
    for _ in 0..200_000 {
        let d = axis(&mut r);
        let on_grid = |x: f32| ((x * 16.0).round() / 16.0 - 0.5) * 1.9;
        let p = Vec3::new(on_grid(r.uniform()), on_grid(r.uniform()), on_grid(r.uniform()));
        let o = p - d * (p.dot(d) + 3.0);
        assert!(accel.nearest(&Ray::new(o, d)).is_some_and(|h| h.t <= 2.0), "{o} {d}");
    }
}

#[test]
fn lines_cross_a_closed_surface_inward_and_outward_in_turn() {
    for (mesh, scale) in [
        (generate::bumpy_sphere(5, 0.6), 1e-3f32),
        (generate::bumpy_sphere(6, 0.6), 1.0),
        (generate::sheet(60, 0.02), 1e3),
    ] {
        let m = mesh.transformed(&Mat4::from_scale(Vec3::splat(scale))).unwrap();
        let accel = Accel::build(vec![m.clone().into()]);
        let mut r = Stream::new(&[34]);
        let (mut hits, mut crossed) = (Vec::<Hit>::new(), 0);
        for i in 0..200_000u32 {
            let target =
                if i % 2 == 0 { m.corners(i % m.indices().len() as u32)[0] } else { direction(&mut r) * 0.7 * scale };
            let o = direction(&mut r) * 5.0 * scale;
            hits.clear();
            accel.all_hits(&Ray::new(o, (target - o).normalize()), |h| hits.push(*h));
            // The signed number of crossings is zero, except that an edge or vertex exactly on the ray counts once per
            // triangle; near a silhouette depths agree to rounding, so that the order is tested away from them.
            if i % 2 == 1 {
                assert_eq!(hits.iter().map(|h| if h.exiting { 1 } else { -1 }).sum::<i32>(), 0, "ray {i}: {hits:?}");
            }
            hits.sort_by(|a, b| a.t.total_cmp(&b.t));
            let apart = hits.windows(2).all(|w| w[1].t - w[0].t > 1e-5 * scale);
            if apart {
                assert_eq!(hits.len() % 2, 0, "ray {i}: {hits:?}");
                assert!(hits.iter().enumerate().all(|(k, h)| h.exiting == (k % 2 == 1)), "ray {i}: {hits:?}");
                crossed += usize::from(!hits.is_empty());
            }
        }
        assert!(crossed > 50_000, "{crossed}");
    }
}

#[test]
fn a_body_may_consist_of_several_open_shapes() {
    // A cylinder with two disks: the walk exits through whichever it meets, also at the rims.
    use moonmilk_geometry::QuadricKind::{Cylinder, Disk};
    let m = Mat4::from_translation(Vec3::new(5.0, 6.0, 7.0)) * Mat4::from_rotation_x(0.4);
    let full = std::f64::consts::TAU;
    let side = Quadric::new(Cylinder { radius: 1.0, z_min: 0.0, z_max: 2.0, phi_max: full }, &m).unwrap();
    let disk = |height| Quadric::new(Disk { height, radius: 1.0, inner_radius: 0.0, phi_max: full }, &m).unwrap();
    let accel = Accel::build(vec![side.into(), Shape::from(disk(0.0)).reversed(), disk(2.0).into()]);
    let body = accel.body(0..3);
    let bounds = accel.bounds();
    let w = Walker { accel: &accel, body, bounds: bounds.grown(body.slack), size: 2.0 };
    let mut r = Stream::new(&[35]);
    let mut c = Count::default();
    while c.segments < 500_000 {
        w.walk(m.transform_point3(Vec3::Z), direction(&mut r), 200, 0.5, &mut r, &mut c);
    }
    // Rims of quadrics are no shared edges: a ray within rounding of one may pass between cylinder and disk.
    assert!(c.lost + c.outside <= 1, "{c:?}");
}

#[test]
fn a_light_ray_that_leaves_a_convex_corner_does_not_hit_its_neighbours() {
    let cube = generate::cuboid(Vec3::splat(0.1), Vec3::splat(0.7));
    let accel = Accel::build(vec![cube.into()]);
    let body = accel.body(0..1);
    let mut r = Stream::new(&[36]);
    for _ in 0..200_000 {
        // Start within rounding of an edge of the face x = 0.7 and leave outward.
        let inward = Ray::new(Vec3::new(2.0, 0.7 - 1e-7 * r.uniform(), 0.1 + 0.6 * r.uniform()), Vec3::NEG_X);
        let Some(h) = accel.nearest(&inward) else {
            continue;
        };
        let (p, n) = accel.point_and_normal(&inward, &h);
        let d = direction(&mut r);
        let d = if d.dot(n) < 0.0 { d - n * (2.0 * d.dot(n)) } else { d };
        let out = Ray::new(p, d).from_prim(h.prim).facing(Facing::Entering(body));
        assert!(accel.nearest(&out).is_none(), "{out:?}");
    }
}
