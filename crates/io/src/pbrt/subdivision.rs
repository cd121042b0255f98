//! Loop subdivision of triangle meshes to the limit surface [Loop1987], with the weights that pbrt uses (Warren's).

use std::collections::HashMap;
use std::f64::consts::TAU;

use moonmilk_core::glam::DVec3;

/// Largest number of triangles that subdivision may produce.
const MAX_TRIANGLES: usize = 1 << 24;

/// A refined mesh on the limit surface.
pub(crate) struct Refined {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub indices: Vec<[u32; 3]>,
}

struct Edge {
    /// Vertices opposite to the edge; the second is missing at a boundary.
    opposite: [u32; 2],
    faces: u8,
    /// Number of the vertex that splits it.
    middle: u32,
}

type Edges = HashMap<(u32, u32), Edge>;

fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// Finds all edges; `Err` names one that more than two triangles share.
fn edges_of(indices: &[[u32; 3]]) -> Result<Edges, String> {
    let mut edges = Edges::with_capacity(indices.len() * 3 / 2);
    for &[a, b, c] in indices {
        for (from, to, opposite) in [(a, b, c), (b, c, a), (c, a, b)] {
            let edge = edges.entry(key(from, to)).or_insert(Edge { opposite: [u32::MAX; 2], faces: 0, middle: 0 });
            if edge.faces == 2 {
                return Err(format!(
                    "more than two triangles share the edge of vertices {} and {}",
                    from.min(to),
                    from.max(to)
                ));
            }
            edge.opposite[usize::from(edge.faces)] = opposite;
            edge.faces += 1;
        }
    }
    Ok(edges)
}

/// Neighbours of all vertices: (sum over all, their number, boundary neighbours).
struct Rings {
    sum: Vec<DVec3>,
    valence: Vec<u32>,
    boundary: Vec<Option<(DVec3, u32)>>,
}

fn rings(positions: &[DVec3], edges: &Edges) -> Rings {
    let n = positions.len();
    let mut rings = Rings { sum: vec![DVec3::ZERO; n], valence: vec![0; n], boundary: vec![None; n] };
    // In the order of the vertices: sums must not depend on the order of a hash map.
    let mut keys: Vec<_> = edges.iter().map(|(k, e)| (*k, e.faces)).collect();
    keys.sort_unstable();
    for ((a, b), faces) in keys {
        for (v, other) in [(a as usize, b as usize), (b as usize, a as usize)] {
            rings.sum[v] += positions[other];
            rings.valence[v] += 1;
            if faces == 1 {
                let (sum, count) = rings.boundary[v].unwrap_or((DVec3::ZERO, 0));
                rings.boundary[v] = Some((sum + positions[other], count + 1));
            }
        }
    }
    rings
}

fn beta(valence: u32) -> f64 {
    if valence == 3 { 3.0 / 16.0 } else { 3.0 / (8.0 * f64::from(valence)) }
}

/// Moves vertex `v` by its ring: interior weight per neighbour `interior(valence)`, boundary weight per neighbour `edge`.
fn moved(positions: &[DVec3], rings: &Rings, v: usize, interior: impl Fn(u32) -> f64, edge: f64) -> DVec3 {
    let p = positions[v];
    match rings.boundary[v] {
        Some((sum, 2)) => p * (1.0 - 2.0 * edge) + sum * edge,
        // A corner where several sheets meet stays where it is.
        Some(_) => p,
        None if rings.valence[v] == 0 => p,
        None => {
            let w = interior(rings.valence[v]);
            p * (1.0 - f64::from(rings.valence[v]) * w) + rings.sum[v] * w
        }
    }
}

/// Refines `levels` times and moves all vertices to the limit surface.
///
/// # Errors
/// An edge of more than two triangles; a repeated vertex in a triangle; more than 2^24 triangles. Indices must be in range.
pub(crate) fn subdivide(mut positions: Vec<DVec3>, mut indices: Vec<[u32; 3]>, levels: u32) -> Result<Refined, String> {
    let count = (levels < 16).then(|| indices.len().checked_mul(4usize.pow(levels))).flatten();
    if count.is_none_or(|n| n > MAX_TRIANGLES) {
        return Err(format!("{} triangles after {levels} levels are more than {MAX_TRIANGLES}", indices.len()));
    }
    if let Some(i) = indices.iter().position(|[a, b, c]| a == b || b == c || c == a) {
        return Err(format!("triangle {i} uses a vertex twice"));
    }
    for _ in 0..levels {
        let mut edges = edges_of(&indices)?;
        let rings = rings(&positions, &edges);
        let mut next: Vec<DVec3> =
            (0..positions.len()).map(|v| moved(&positions, &rings, v, beta, 1.0 / 8.0)).collect();
        let mut faces = Vec::with_capacity(indices.len() * 4);
        for &[a, b, c] in &indices {
            let mut split = |from: u32, to: u32| {
                let edge = edges.get_mut(&key(from, to)).expect("edges_of saw every edge");
                if edge.middle == 0 {
                    let ends = positions[from as usize] + positions[to as usize];
                    let point = if edge.faces == 2 {
                        let sides = positions[edge.opposite[0] as usize] + positions[edge.opposite[1] as usize];
                        ends * (3.0 / 8.0) + sides * (1.0 / 8.0)
                    } else {
                        ends * 0.5
                    };
                    next.push(point);
                    edge.middle = u32::try_from(next.len() - 1).expect("at most 2^24 triangles");
                }
                edge.middle
            };
            let (ab, bc, ca) = (split(a, b), split(b, c), split(c, a));
            faces.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        (positions, indices) = (next, faces);
    }
    let edges = edges_of(&indices)?;
    let rings = rings(&positions, &edges);
    let gamma = |valence: u32| 1.0 / (f64::from(valence) + 3.0 / (8.0 * beta(valence)));
    let limit: Vec<DVec3> = (0..positions.len()).map(|v| moved(&positions, &rings, v, gamma, 1.0 / 5.0)).collect();
    let normals = normals(&positions, &limit, &indices, &rings);
    Ok(Refined { positions: limit, normals, indices })
}

/// Normals of the limit surface from its tangents; at boundaries, of the surrounding triangles.
fn normals(positions: &[DVec3], limit: &[DVec3], indices: &[[u32; 3]], rings: &Rings) -> Vec<DVec3> {
    let mut faces: Vec<Vec<(u32, u32)>> = vec![Vec::new(); positions.len()];
    let mut area = vec![DVec3::ZERO; positions.len()];
    for &[a, b, c] in indices {
        let [p, q, r] = [a, b, c].map(|i| limit[i as usize]);
        for (v, from, to) in [(a, b, c), (b, c, a), (c, a, b)] {
            faces[v as usize].push((from, to));
            area[v as usize] += (q - p).cross(r - p);
        }
    }
    (0..positions.len())
        .map(|v| {
            let n = rings.valence[v];
            if rings.boundary[v].is_none() && n > 0 {
                // Walk around the vertex so that the ring is in order.
                let mut at = faces[v][0].0;
                let (mut s, mut t) = (DVec3::ZERO, DVec3::ZERO);
                let mut steps = 0;
                while steps < n {
                    let (sin, cos) = (TAU * f64::from(steps) / f64::from(n)).sin_cos();
                    s += positions[at as usize] * cos;
                    t += positions[at as usize] * sin;
                    steps += 1;
                    match faces[v].iter().find(|f| f.0 == at) {
                        Some(&(_, next)) => at = next,
                        None => break,
                    }
                }
                if steps == n && at == faces[v][0].0 {
                    let normal = s.cross(t);
                    if normal.length_squared() > 0.0 {
                        return normal.normalize();
                    }
                }
            }
            area[v].normalize_or(DVec3::Z)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn octahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let p = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z];
        let f = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        (p.to_vec(), f.to_vec())
    }

    #[test]
    fn the_limit_does_not_depend_on_the_number_of_levels() {
        let (p, f) = octahedron();
        let coarse = subdivide(p.clone(), f.clone(), 0).expect("a closed mesh");
        let fine = subdivide(p, f, 4).expect("a closed mesh");
        assert_eq!(fine.indices.len(), 8 * 256);
        for v in 0..6 {
            // Rounding of four rounds of averages in f64.
            assert!((coarse.positions[v] - fine.positions[v]).length() < 1e-14);
            assert!((fine.normals[v] - fine.positions[v].normalize()).length() < 1e-12);
        }
        assert!(fine.normals.iter().zip(&fine.positions).all(|(n, p)| n.dot(*p) > 0.0));
    }

    #[test]
    fn a_flat_regular_sheet_stays_flat_and_keeps_its_straight_boundary() {
        let p = vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        let fine = subdivide(p, vec![[0, 1, 2], [0, 2, 3]], 3).expect("a sheet");
        assert!(fine.positions.iter().all(|p| p.z == 0.0 && p.x >= 0.0 && p.x <= 1.0));
        assert!(fine.normals.iter().all(|n| (*n - DVec3::Z).length() < 1e-12));
    }

    #[test]
    fn impossible_meshes_are_errors() {
        let p = vec![DVec3::ZERO; 5];
        assert!(subdivide(p.clone(), vec![[0, 1, 2], [0, 1, 3], [1, 0, 4]], 1).is_err());
        assert!(subdivide(p.clone(), vec![[0, 0, 2]], 1).is_err());
        assert!(subdivide(p, vec![[0, 1, 2]], 30).is_err());
    }
}
