//! `Shape`: forms in object space.
//!
//! Bilinear patches become triangles: two per flat patch, 2 x 8 x 8 per twisted one. Without `uv` in the file, each patch has its own
//! parameters as texture coordinates, as in pbrt. Loop subdivision surfaces become the triangles of the asked level, moved to the limit surface, with its normals.

use std::collections::HashMap;
use std::sync::Arc;

use moonmilk_core::{Vec2, Vec3};
use moonmilk_render::description::GeometryDescription;

use super::context::Context;
use super::curves::curve;
use super::files::gunzip;
use super::lexer::Spot;
use super::params::{FLOAT_TEXTURE, Params, Type, Values, did_you_mean};
use super::subdivision::subdivide;
use crate::ply;

/// Name of curves that lie flat, which hair cannot be.
pub(crate) const RIBBON: &str = "curve of type ribbon";

/// A shape's opacity as the file gives it.
#[derive(Clone, Debug)]
pub(crate) enum Alpha {
    Value(f32),
    Texture(Arc<str>, Spot),
}

/// What a `Shape` says about itself.
pub(crate) struct Form {
    pub name: Arc<str>,
    pub geometry: Arc<GeometryDescription>,
    pub alpha: Option<Alpha>,
    /// A displacement of a mesh, read as a bump map.
    pub displacement: Option<(Arc<str>, Spot)>,
}

/// Meshes read from files, each once.
pub(crate) type Meshes = HashMap<String, Option<Arc<GeometryDescription>>>;

const KINDS: [&str; 8] =
    ["bilinearmesh", "curve", "cylinder", "disk", "loopsubdiv", "plymesh", "sphere", "trianglemesh"];

/// The form of a `Shape`; `None` if it is skipped.
pub(crate) fn shape(cx: &mut Context, meshes: &mut Meshes, kind: &str, at: Spot, mut p: Params) -> Option<Form> {
    use GeometryDescription::{Cylinder, Disk, Sphere};
    let positive = |x: f32| x > 0.0;
    let mut name: Arc<str> = kind.into();
    let mut displacement = None;
    let geometry = match kind {
        "sphere" => {
            let radius = p.float_in(cx, "radius", 1.0, positive, "(0, inf)");
            let (z_min, z_max) = (p.float(cx, "zmin", -radius), p.float(cx, "zmax", radius));
            let phi_max = sweep(cx, &mut p);
            Some(Arc::new(Sphere {
                radius,
                z_min: z_min.min(z_max).clamp(-radius, radius),
                z_max: z_min.max(z_max).clamp(-radius, radius),
                phi_max,
            }))
        }
        "disk" => {
            let radius = p.float_in(cx, "radius", 1.0, positive, "(0, inf)");
            let inner_radius = p.float_in(cx, "innerradius", 0.0, |r| r >= 0.0 && r < radius, "[0, radius)");
            let height = p.float(cx, "height", 0.0);
            Some(Arc::new(Disk { height, radius, inner_radius, phi_max: sweep(cx, &mut p) }))
        }
        "cylinder" => {
            let radius = p.float_in(cx, "radius", 1.0, positive, "(0, inf)");
            let (z_min, z_max) = (p.float(cx, "zmin", -1.0), p.float(cx, "zmax", 1.0));
            let phi_max = sweep(cx, &mut p);
            Some(Arc::new(Cylinder { radius, z_min: z_min.min(z_max), z_max: z_min.max(z_max), phi_max }))
        }
        "trianglemesh" => triangle_mesh(cx, &mut p),
        "bilinearmesh" => bilinear_mesh(cx, &mut p),
        "loopsubdiv" => loop_subdivision(cx, &mut p),
        "plymesh" => {
            p.ignore(&[
                ("edgelength", &[Type::Float]),
                ("displacement.edgelength", &[Type::Float]),
                ("displacement.uvscale", &[Type::Float]),
            ]);
            if let Some(param) = p.find("displacement", &[Type::Texture]).cloned() {
                match param.values {
                    Values::Strings(names) if names.len() == 1 => {
                        let message = "displacement of meshes is read as a bump map: normals move, the surface stays";
                        cx.warn(param.value, message);
                        displacement = Some((names[0].as_str().into(), param.value));
                    }
                    _ => cx.error(param.spot, "`displacement` takes the name of one texture"),
                }
            }
            match p.string(cx, "filename") {
                Some((path, spot)) => {
                    name = path.as_str().into();
                    ply_mesh(cx, meshes, &path, spot)
                }
                None => {
                    cx.error(p.spot, format!("{} needs `string filename`", p.entity));
                    None
                }
            }
        }
        "curve" => {
            let (geometry, ribbon) = curve(cx, &mut p);
            if ribbon {
                name = RIBBON.into();
            }
            geometry
        }
        _ => {
            let help = match kind {
                "cone" | "paraboloid" | "hyperboloid" | "heightfield" | "nurbs" => {
                    "pbrt-v3 syntax: pbrt-v4 has no such shape; write it as a mesh".to_owned()
                }
                _ => did_you_mean(kind, &KINDS, "accepted"),
            };
            cx.error_help(at, format!("`{kind}` is no type of shape"), help);
            return None;
        }
    };
    let alpha = match p.find("alpha", FLOAT_TEXTURE).map(|param| (param.ty, param.values.clone(), param.value)) {
        Some((Type::Texture, Values::Strings(names), spot)) if names.len() == 1 => {
            Some(Alpha::Texture(names[0].as_str().into(), spot))
        }
        Some((Type::Float, _, _)) => p.float_or_none(cx, "alpha").filter(|&a| a < 1.0).map(Alpha::Value),
        _ => None,
    };
    p.finish(cx);
    Some(Form { name, geometry: geometry?, alpha, displacement })
}

fn sweep(cx: &mut Context, p: &mut Params) -> f32 {
    p.float_in(cx, "phimax", 360.0, |x| x > 0.0 && x <= 360.0, "(0, 360] degrees")
}

/// Vertex lists of a mesh: positions, and normals and texture coordinates if there are as many.
struct Vertices {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
}

fn vertices(cx: &mut Context, p: &mut Params) -> Option<Vertices> {
    let positions = p.vec3s(cx, "P", &[Type::Point3]);
    let normals = p.vec3s(cx, "N", &[Type::Normal]);
    let uvs = p.vec2s(cx, "uv", &[Type::Point2]);
    p.ignore(&[("S", &[Type::Vector3]), ("faceIndices", &[Type::Integer])]);
    let Some((positions, _)) = positions else {
        if !p.has("P") {
            cx.error(p.spot, format!("{} needs `point3 P`", p.entity));
        }
        return None;
    };
    let n = positions.len();
    let mut vertices = Vertices { positions, normals: Vec::new(), uvs: Vec::new() };
    match normals {
        Some((normals, _)) if normals.len() == n => vertices.normals = normals,
        Some((normals, spot)) => {
            cx.warn(spot, format!("{} normals for {n} vertices: they are left out", normals.len()))
        }
        None => {}
    }
    match uvs {
        Some((uvs, _)) if uvs.len() == n => vertices.uvs = uvs,
        Some((uvs, spot)) => {
            cx.warn(spot, format!("{} texture coordinates for {n} vertices: they are left out", uvs.len()))
        }
        None => {}
    }
    Some(vertices)
}

/// The faces of a mesh, `N` vertices each; `alone` says what a list of just `N` vertices means without `indices`.
fn faces<const N: usize>(cx: &mut Context, p: &mut Params, vertices: usize) -> Option<Vec<[u32; N]>> {
    let Some((indices, spot)) = p.integers("indices") else {
        if vertices == N {
            return Some(vec![std::array::from_fn(|i| i as u32)]);
        }
        if !p.has("indices") {
            cx.error(p.spot, format!("{} needs `integer indices`", p.entity));
        }
        return None;
    };
    if indices.is_empty() {
        cx.error(spot, "`indices` is empty");
        return None;
    }
    if indices.len() % N != 0 {
        cx.warn(
            spot,
            format!("{} indices are no multiple of {N}: the last {} are left out", indices.len(), indices.len() % N),
        );
    }
    let limit = vertices as u64;
    if let Some((i, index)) = indices.iter().enumerate().find(|&(_, &i)| u64::try_from(i).map_or(true, |i| i >= limit))
    {
        cx.error(spot, format!("entry {i} of `indices` is {index}, but the vertices are 0 to {}", vertices as i64 - 1));
        return None;
    }
    Some(indices.chunks_exact(N).map(|face| std::array::from_fn(|i| face[i] as u32)).collect())
}

fn triangle_mesh(cx: &mut Context, p: &mut Params) -> Option<Arc<GeometryDescription>> {
    let Vertices { positions, normals, uvs } = vertices(cx, p)?;
    let indices = faces::<3>(cx, p, positions.len())?;
    Some(Arc::new(GeometryDescription::Mesh { positions, normals, uvs, indices }))
}

/// Cells per side of a twisted patch.
const PATCH_CELLS: u32 = 8;

fn bilinear_mesh(cx: &mut Context, p: &mut Params) -> Option<Arc<GeometryDescription>> {
    let Vertices { mut positions, mut normals, mut uvs } = vertices(cx, p)?;
    if p.find("emissionfilename", &[Type::String]).is_some() {
        let spot = p.spot_of("emissionfilename");
        cx.warn(spot, "`emissionfilename` only steers sampling: it is not used");
    }
    let mut patches = faces::<4>(cx, p, positions.len())?;
    if uvs.is_empty() {
        // Give each patch vertices of its own, with its parameters.
        let own = |list: &[Vec3]| -> Vec<Vec3> { patches.iter().flatten().map(|&i| list[i as usize]).collect() };
        positions = own(&positions);
        if !normals.is_empty() {
            normals = own(&normals);
        }
        let count = patches.len() as u32;
        uvs = patches.iter().flat_map(|_| [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE]).collect();
        patches = (0..count).map(|i| std::array::from_fn(|k| 4 * i + k as u32)).collect();
    }
    let mut indices = Vec::with_capacity(2 * patches.len());
    for patch in patches {
        let [p00, p10, p01, p11] = patch.map(|i| positions[i as usize]);
        // Flat within single precision of its size: two triangles are the patch.
        let (a, b, c) = (p10 - p00, p01 - p00, p11 - p00);
        let twist = a.cross(b).dot(c).abs();
        if twist <= 1e-5 * a.length() * b.length() * c.length() {
            let [i00, i10, i01, i11] = patch;
            indices.extend([[i00, i10, i11], [i00, i11, i01]]);
            continue;
        }
        let first = positions.len() as u32;
        let n = PATCH_CELLS;
        if !cx.may_generate(2 * (n * n) as usize, p.spot) {
            return None;
        }
        for j in 0..=n {
            for i in 0..=n {
                let (u, v) = (i as f32 / n as f32, j as f32 / n as f32);
                let w = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
                let blend = |list: &[Vec3]| (0..4).map(|k| list[patch[k] as usize] * w[k]).sum::<Vec3>();
                let point = blend(&positions);
                positions.push(point);
                if !normals.is_empty() {
                    let normal = blend(&normals).normalize_or_zero();
                    normals.push(normal);
                }
                if !uvs.is_empty() {
                    let uv = (0..4).map(|k| uvs[patch[k] as usize] * w[k]).sum();
                    uvs.push(uv);
                }
            }
        }
        for j in 0..n {
            for i in 0..n {
                let at = |i: u32, j: u32| first + j * (n + 1) + i;
                indices
                    .extend([[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]);
            }
        }
    }
    Some(Arc::new(GeometryDescription::Mesh { positions, normals, uvs, indices }))
}

fn loop_subdivision(cx: &mut Context, p: &mut Params) -> Option<Arc<GeometryDescription>> {
    let levels = p.integer(cx, "levels", 3, 0);
    p.ignore(&[("scheme", &[Type::String])]);
    let (positions, _) = match p.vec3s(cx, "P", &[Type::Point3]) {
        Some(positions) => positions,
        None => {
            cx.error(p.spot, format!("{} needs `point3 P`", p.entity));
            return None;
        }
    };
    let indices = faces::<3>(cx, p, positions.len())?;
    // Without overflow: the surface itself refuses more levels.
    let triangles = indices.len().saturating_mul(4usize.saturating_pow(levels.min(15)));
    if !cx.may_generate(triangles, p.spot) {
        return None;
    }
    match subdivide(positions.into_iter().map(Vec3::as_dvec3).collect(), indices, levels) {
        Ok(fine) => Some(Arc::new(GeometryDescription::Mesh {
            positions: fine.positions.iter().map(|p| p.as_vec3()).collect(),
            normals: fine.normals.iter().map(|n| n.as_vec3()).collect(),
            uvs: Vec::new(),
            indices: fine.indices,
        })),
        Err(reason) => {
            cx.error(p.spot, format!("loopsubdiv: {reason}"));
            None
        }
    }
}

fn ply_mesh(cx: &mut Context, meshes: &mut Meshes, path: &str, spot: Spot) -> Option<Arc<GeometryDescription>> {
    if let Some(known) = meshes.get(path) {
        return known.clone();
    }
    let geometry = cx.fetch(path, Some(spot)).and_then(|packed| {
        let result = gunzip(packed, cx.options.max_bytes)
            .map_err(|e| e.to_string())
            .and_then(|bytes| ply::read(&bytes).map_err(|e| e.to_string()));
        match result {
            Ok(ply::Mesh { positions, normals, uvs, indices }) => {
                Some(Arc::new(GeometryDescription::Mesh { positions, normals, uvs, indices }))
            }
            Err(reason) => {
                cx.error(spot, format!("{path}: {reason}"));
                None
            }
        }
    });
    meshes.insert(path.to_owned(), geometry.clone());
    geometry
}
