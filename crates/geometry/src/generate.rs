//! Closed meshes for tests, benchmarks and showcases.

use std::collections::HashMap;

use moonmilk_core::Vec3;

use crate::mesh::Mesh;

/// Returns an axis-parallel box of 12 triangles over 8 vertices, normals outward.
///
/// *Domain*: `min < max` in all coordinates.
pub fn cuboid(min: Vec3, max: Vec3) -> Mesh {
    let pick = |i: usize, bit: usize, k: usize| if i & bit != 0 { max[k] } else { min[k] };
    let positions = (0..8).map(|i| Vec3::new(pick(i, 1, 0), pick(i, 2, 1), pick(i, 4, 2))).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let indices = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh::new(positions, vec![], vec![], indices).expect("a box with min < max is a mesh")
}

/// Returns a unit icosphere of 20 x 4^levels triangles whose radius is modulated by smooth bumps of relative height
/// `bump` (0: a sphere; 7 levels make 327 680 triangles), flat (without normals), outward.
pub fn bumpy_sphere(levels: u32, bump: f32) -> Mesh {
    // Vertices of an icosahedron: cyclic permutations of (0, +-1, +-golden ratio).
    let g = 0.5 * (1.0 + 5f32.sqrt());
    let mut positions: Vec<Vec3> = Vec::new();
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        positions.extend([Vec3::new(a, b, 0.0), Vec3::new(0.0, a, b), Vec3::new(b, 0.0, a)]);
    }
    positions.iter_mut().for_each(|p| *p = p.normalize());
    let mut indices: Vec<[u32; 3]> = Vec::new();
    for a in 0..12u32 {
        for b in 0..12 {
            for c in 0..12 {
                // Faces join vertices at the edge length; take each once, counter-clockwise from outside.
                let p = |i: u32| positions[i as usize];
                let near = |i: u32, j: u32| (p(i).distance(p(j)) - 1.0515).abs() < 0.01;
                if a < b && a < c && near(a, b) && near(b, c) && near(c, a) && p(a).dot(p(b).cross(p(c))) > 0.0 {
                    indices.push([a, b, c]);
                }
            }
        }
    }

    // Divide every triangle into four.
    for _ in 0..levels {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut next = Vec::with_capacity(indices.len() * 4);
        for &[a, b, c] in &indices {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    positions.push((positions[i as usize] + positions[j as usize]).normalize());
                    positions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        indices = next;
    }
    for p in &mut positions {
        let waves = (7.0 * p.x).sin() * (5.0 * p.y + 1.0).sin() + (11.0 * p.z).sin() * (6.0 * p.x - 2.0).cos();
        *p *= 1.0 + 0.5 * bump * waves;
    }
    Mesh::new(positions, vec![], vec![], indices).expect("a divided icosahedron is a mesh")
}

/// Returns a wavy closed sheet over the unit square with n x n cells per side and the given thickness: two layers and a rim.
pub fn sheet(n: u32, thickness: f32) -> Mesh {
    let m = n + 1;
    let mut positions = Vec::new();
    for layer in 0..2 {
        for j in 0..m {
            for i in 0..m {
                let (x, y) = (i as f32 / n as f32, j as f32 / n as f32);
                positions.push(Vec3::new(x, y, 0.05 * (9.0 * x).sin() * (7.0 * y).cos() + thickness * layer as f32));
            }
        }
    }
    let at = |layer: u32, i: u32, j: u32| layer * m * m + j * m + i;
    let mut indices = Vec::new();
    let mut quad = |a, b, c, d| indices.extend([[a, b, c], [a, c, d]]);
    for j in 0..n {
        for i in 0..n {
            quad(at(1, i, j), at(1, i + 1, j), at(1, i + 1, j + 1), at(1, i, j + 1));
            quad(at(0, i, j), at(0, i, j + 1), at(0, i + 1, j + 1), at(0, i + 1, j));
        }
        quad(at(0, j, 0), at(0, j + 1, 0), at(1, j + 1, 0), at(1, j, 0));
        quad(at(0, j + 1, n), at(0, j, n), at(1, j, n), at(1, j + 1, n));
        quad(at(0, 0, j + 1), at(0, 0, j), at(1, 0, j), at(1, 0, j + 1));
        quad(at(0, n, j), at(0, n, j + 1), at(1, n, j + 1), at(1, n, j));
    }
    Mesh::new(positions, vec![], vec![], indices).expect("a sheet with n >= 1 and thickness > 0 is a mesh")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generated_bodies_are_closed_and_outward() {
        for (m, triangles) in
            [(cuboid(Vec3::ZERO, Vec3::ONE), 12), (bumpy_sphere(3, 0.2), 1280), (sheet(8, 0.01), 2 * 2 * 64 + 8 * 8)]
        {
            let t = m.topology();
            assert!(t.is_closed() && t.components == 1 && m.volume() > 0.0 && m.indices().len() == triangles, "{t:?}");
        }
        assert_eq!(bumpy_sphere(7, 0.1).indices().len(), 327_680);
    }
}
