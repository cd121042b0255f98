//! The geometry's contract: closed, outward, clean, and no two surfaces cross.

use std::collections::{HashMap, HashSet};

use glam::{DVec3, IVec3};

use crate::layout::{CLEARANCE, showcase};
use crate::mesh::Mesh;

#[test]
fn every_mesh_is_closed_and_consistently_oriented() {
    for (name, mesh) in showcase() {
        assert_eq!(mesh.faults(), Vec::<String>::new(), "{name}");
    }
}

#[test]
fn an_open_a_turned_and_an_infinite_mesh_are_found_faulty() {
    let whole = showcase().remove(0).1;
    let mut open = whole.clone();
    open.triangles.pop();
    let mut turned = whole.clone();
    turned.triangles[5].swap(0, 1);
    let mut infinite = whole.clone();
    infinite.positions[3].x = f64::NAN;
    for mesh in [open, turned, infinite] {
        assert_ne!(mesh.faults(), Vec::<String>::new());
    }
}

#[test]
fn normals_point_outward() {
    for (name, mesh) in showcase() {
        assert!(mesh.volume() > 0.0, "{name}: {}", mesh.volume());
    }
}

#[test]
fn no_triangle_is_degenerate_in_the_file() {
    // Positions are stored in 32 bits; at 100 mm their spacing is 8e-6 mm, so heights above 1e-3 mm survive rounding.
    for (name, mesh) in showcase() {
        for t in 0..mesh.triangles.len() {
            let p = mesh.corners(t);
            let longest = (0..3).map(|k| p[k].distance(p[(k + 1) % 3])).fold(0.0, f64::max);
            let height = (p[1] - p[0]).cross(p[2] - p[0]).length() / longest;
            assert!(height > 1e-3, "{name}: triangle {t} at {} has height {height}", p[0]);
        }
    }
}

#[test]
fn vertex_normals_agree_with_the_faces_around_them() {
    // A face that turns its back on a vertex normal would send smooth-shaded light to the wrong side.
    for (name, mesh) in showcase() {
        let normals = mesh.vertex_normals();
        for t in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(t);
            let face = (b - a).cross(c - a).normalize();
            for i in mesh.triangles[t] {
                let cosine = normals[i as usize].dot(face);
                assert!(cosine > 0.2, "{name}: vertex {i} at {}, cosine {cosine}", mesh.positions[i as usize]);
            }
        }
    }
}

#[test]
fn every_object_stays_above_the_table() {
    for (name, mesh) in showcase() {
        let lowest = mesh.bounds().0.z;
        assert!(lowest >= CLEARANCE - 1e-9, "{name} reaches down to {lowest}");
    }
}

#[test]
fn no_surface_crosses_another_or_itself() {
    let scene = showcase();
    for (k, (name, mesh)) in scene.iter().enumerate() {
        assert_eq!(crossing(mesh, mesh, true), None, "{name} crosses itself");
        for (other_name, other) in &scene[k + 1..] {
            assert_eq!(crossing(mesh, other, false), None, "{name} and {other_name}");
            assert_eq!(crossing(other, mesh, false), None, "{other_name} and {name}");
        }
    }
}

#[test]
fn the_committed_files_are_what_the_generator_makes() {
    for (name, mesh) in showcase() {
        let path = format!("{}/../showcase/geometry/{name}.ply", env!("CARGO_MANIFEST_DIR"));
        let bytes = std::fs::read(&path).expect("the geometry is committed");
        let mut made = Vec::new();
        mesh.write_ply(&mut made).expect("writing to memory succeeds");
        assert_eq!(bytes.len(), made.len(), "{name}: size");
        let text = String::from_utf8_lossy(&made);
        let start = text.find("end_header\n").expect("a PLY header ends") + "end_header\n".len();
        assert_eq!(bytes[..start], made[..start], "{name}: header");
        // Allow for sines and cosines that differ in the last bit between platforms; a micrometre is far more than that.
        for (k, (a, b)) in
            bytes[start..].chunks_exact(4).zip(made[start..].chunks_exact(4)).take(6 * mesh.positions.len()).enumerate()
        {
            let [a, b] = [a, b].map(|x| f32::from_le_bytes(x.try_into().expect("chunks of four")));
            assert!((a - b).abs() < 1e-3, "{name}: value {k} is {a}, made {b}");
        }
    }
}

/// Where an edge of `a` pierces a triangle of `b`, if anywhere; with `same`, pairs that share a vertex are not counted.
fn crossing(a: &Mesh, b: &Mesh, same: bool) -> Option<DVec3> {
    const CELL: f64 = 1.5;
    let (low, high) = (a.bounds().0.max(b.bounds().0), a.bounds().1.min(b.bounds().1));
    if low.cmpgt(high).any() {
        return None;
    }
    let cells = |points: &[DVec3]| {
        let low = points.iter().fold(DVec3::INFINITY, |m, p| m.min(*p));
        let high = points.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
        let [low, high] = [low, high].map(|p| (p / CELL).floor().as_ivec3());
        (low.x..=high.x)
            .flat_map(move |x| (low.y..=high.y).flat_map(move |y| (low.z..=high.z).map(move |z| IVec3::new(x, y, z))))
    };
    let mut grid: HashMap<IVec3, Vec<usize>> = HashMap::new();
    for t in 0..b.triangles.len() {
        for cell in cells(&b.corners(t)) {
            grid.entry(cell).or_default().push(t);
        }
    }
    let mut tested = HashSet::new();
    for triangle in &a.triangles {
        for k in 0..3 {
            let [i, j] = [triangle[k], triangle[(k + 1) % 3]];
            if i > j {
                continue;
            }
            let [p, q] = [a.positions[i as usize], a.positions[j as usize]];
            tested.clear();
            for t in cells(&[p, q]).filter_map(|cell| grid.get(&cell)).flatten() {
                if same && b.triangles[*t].iter().any(|v| *v == i || *v == j) || !tested.insert(*t) {
                    continue;
                }
                if pierces(p, q, b.corners(*t)) {
                    return Some(p);
                }
            }
        }
    }
    None
}

/// Whether the segment from `p` to `q` passes through the triangle, by the signs of the tetrahedra they span.
fn pierces(p: DVec3, q: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
    // Rounding decides the side of a point in the triangle's plane, as on flat parts: ask for a real distance [mm].
    let area = (b - a).cross(c - a).length();
    let [above, below] = [volume(a, b, c, p) / area, volume(a, b, c, q) / area];
    let turns = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)];
    above * below < 0.0
        && above.abs().min(below.abs()) > 1e-9
        && (turns.iter().all(|v| *v > 0.0) || turns.iter().all(|v| *v < 0.0))
}
