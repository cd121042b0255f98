//! `Shape "curve"`: Bezier curves and uniform B-splines of degree 2 and 3, as triangles.
//!
//! pbrt intersects strips that turn towards every ray. Here `flat` and `cylinder` become open tubes of [`SIDES`] sides with round normals, whose mean
//! projected width is the curve's (Cauchy: perimeter / pi), and `ribbon` a strip that lies where its normals say. So a `flat` curve is
//! shaded as a cylinder. Pieces are as long as a deviation of a twentieth of the width allows, at most 64 per segment; `splitdepth` has no meaning then.
//! u runs along each segment, v around the tube or across the ribbon. Neighbouring curves share one mesh (`builder.rs`).

use std::sync::Arc;

use moonmilk_core::{Vec2, Vec3};
use moonmilk_render::description::GeometryDescription;

use super::context::Context;
use super::params::{Params, Type};

/// Sides of a tube.
const SIDES: u32 = 6;
/// Most pieces of a segment.
const MAX_PIECES: u32 = 64;
/// Largest deviation of the pieces from the curve, in widths.
const DEVIATION: f32 = 0.05;

/// A point of a curve.
struct Station {
    p: Vec3,
    /// Unit tangent.
    t: Vec3,
    /// Unit normal: carried along a tube, given for a ribbon.
    n: Vec3,
    u: f32,
    width: f32,
}

/// The triangles of a `curve`, `None` after an error, and whether it is a ribbon.
pub(crate) fn curve(cx: &mut Context, p: &mut Params) -> (Option<Arc<GeometryDescription>>, bool) {
    let ribbon = p.choice(cx, "type", &["flat", "ribbon", "cylinder"]) == "ribbon";
    (triangles(cx, p, ribbon), ribbon)
}

fn triangles(cx: &mut Context, p: &mut Params, ribbon: bool) -> Option<Arc<GeometryDescription>> {
    let width = p.float_in(cx, "width", 1.0, |w| w >= 0.0, "[0, inf)");
    let widths = [
        p.float_in(cx, "width0", width, |w| w >= 0.0, "[0, inf)"),
        p.float_in(cx, "width1", width, |w| w >= 0.0, "[0, inf)"),
    ];
    p.ignore(&[("splitdepth", &[Type::Integer])]);
    let bspline = p.choice(cx, "basis", &["bezier", "bspline"]) == "bspline";
    let degree = p.integer(cx, "degree", 3, 0) as usize;
    let normals = p.vec3s(cx, "N", &[Type::Normal]);
    let Some((points, spot)) = p.vec3s(cx, "P", &[Type::Point3]) else {
        if !p.has("P") {
            cx.error(p.spot, format!("{} needs `point3 P`", p.entity));
        }
        return None;
    };
    if !matches!(degree, 2 | 3) {
        let spot = p.spot_of("degree");
        cx.error(spot, format!("degree = {degree} is neither 2 nor 3"));
        return None;
    }
    // Bezier segments share their end points, segments of a B-spline all but one point.
    let enough = points.len() > degree && (bspline || (points.len() - 1).is_multiple_of(degree));
    if !enough {
        let help = if bspline {
            format!("a B-spline of degree {degree} takes {} points or more", degree + 1)
        } else {
            format!("Bezier segments of degree {degree} take 1 + {degree} n points")
        };
        cx.error_help(spot, format!("{} control points make no curve", points.len()), help);
        return None;
    }
    let segments = if bspline { points.len() - degree } else { (points.len() - 1) / degree };
    let normals = match normals {
        Some((list, spot)) if ribbon && list.len() != segments + 1 => {
            cx.error(
                spot,
                format!("a ribbon of {segments} segments takes {} normals, {} given", segments + 1, list.len()),
            );
            return None;
        }
        Some((list, _)) if ribbon => list,
        Some((_, spot)) => {
            cx.warn(spot, "`N` is used by curves of type `ribbon` only");
            Vec::new()
        }
        None if ribbon => {
            cx.error(p.spot, "a ribbon needs `normal N`, one per segment end");
            return None;
        }
        None => Vec::new(),
    };

    let mut stations: Vec<Vec<Station>> = Vec::new();
    for i in 0..segments {
        let cubic = cubic(&points, i, degree, bspline);
        let share = |t: f32| (i as f32 + t) / segments as f32;
        let width = |t: f32| widths[0] + (widths[1] - widths[0]) * share(t);
        let pieces = pieces(&cubic, width(0.0).max(width(1.0)));
        if !cx.may_generate(2 * (SIDES * pieces) as usize, p.spot) {
            return None;
        }
        let along = |k: u32| {
            let t = k as f32 / pieces as f32;
            let n = if ribbon { normals[i] * (1.0 - t) + normals[i + 1] * t } else { Vec3::ZERO };
            Station { p: at(&cubic, t), t: tangent(&cubic, t), n, u: t, width: width(t) }
        };
        stations.push((0..=pieces).map(along).collect());
    }
    if !ribbon {
        carry(&mut stations);
    }
    Some(Arc::new(mesh(&stations, ribbon)))
}

/// Control points of segment i as a cubic Bezier curve.
fn cubic(points: &[Vec3], i: usize, degree: usize, bspline: bool) -> [Vec3; 4] {
    match (degree, bspline) {
        (3, false) => std::array::from_fn(|k| points[3 * i + k]),
        (2, false) => raised([points[2 * i], points[2 * i + 1], points[2 * i + 2]]),
        (2, true) => {
            // Knots are the middles between control points.
            let [a, b, c] = [points[i], points[i + 1], points[i + 2]];
            raised([(a + b) * 0.5, b, (b + c) * 0.5])
        }
        _ => {
            // The blossom of the uniform cubic B-spline at its knots.
            let [a, b, c, d] = [points[i], points[i + 1], points[i + 2], points[i + 3]];
            let (p, q) = ((b * 2.0 + c) / 3.0, (b + c * 2.0) / 3.0);
            [(a + b * 4.0 + c) / 6.0, p, q, (b + c * 4.0 + d) / 6.0]
        }
    }
}

/// A quadratic Bezier curve as a cubic one.
fn raised([a, b, c]: [Vec3; 3]) -> [Vec3; 4] {
    [a, (a + b * 2.0) / 3.0, (b * 2.0 + c) / 3.0, c]
}

/// Number of chords from which a curve deviates by at most [`DEVIATION`]: sqrt(6 / 8 of the largest second difference / deviation).
fn pieces(c: &[Vec3; 4], width: f32) -> u32 {
    let bend = (c[0] - c[1] * 2.0 + c[2]).length().max((c[1] - c[2] * 2.0 + c[3]).length());
    let size = (0..3).map(|i| c[i].distance(c[i + 1])).sum::<f32>();
    let allowed = (DEVIATION * width).max(1e-4 * size);
    if allowed > 0.0 { ((0.75 * bend / allowed).sqrt().ceil() as u32).clamp(1, MAX_PIECES) } else { 1 }
}

fn at(c: &[Vec3; 4], t: f32) -> Vec3 {
    let s = 1.0 - t;
    c[0] * (s * s * s) + c[1] * (3.0 * s * s * t) + c[2] * (3.0 * s * t * t) + c[3] * (t * t * t)
}

fn tangent(c: &[Vec3; 4], t: f32) -> Vec3 {
    let s = 1.0 - t;
    let d = (c[1] - c[0]) * (s * s) + (c[2] - c[1]) * (2.0 * s * t) + (c[3] - c[2]) * (t * t);
    // Coinciding control points at an end: the chord.
    d.try_normalize().or_else(|| (c[3] - c[0]).try_normalize()).unwrap_or(Vec3::Z)
}

/// Gives the stations of a tube normals that turn as little as the tangents allow.
fn carry(stations: &mut [Vec<Station>]) {
    let mut last: Option<Vec3> = None;
    for s in stations.iter_mut().flatten() {
        let n = last
            .and_then(|n: Vec3| (n - s.t * n.dot(s.t)).try_normalize())
            .unwrap_or_else(|| s.t.any_orthonormal_vector());
        s.n = n;
        last = Some(n);
    }
}

fn mesh(segments: &[Vec<Station>], ribbon: bool) -> GeometryDescription {
    let (mut positions, mut normals, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    // Perimeter 2 SIDES r sin(pi / SIDES) over pi is the width.
    let radius = std::f32::consts::PI / (2.0 * SIDES as f32 * (std::f32::consts::PI / SIDES as f32).sin());
    let columns = if ribbon { 1 } else { SIDES };
    for stations in segments {
        let first = positions.len() as u32;
        for s in stations {
            let across = s.t.cross(s.n).try_normalize().unwrap_or_else(|| s.t.any_orthonormal_vector());
            let up = across.cross(s.t);
            for k in 0..=columns {
                let v = k as f32 / columns as f32;
                let (offset, normal) = if ribbon {
                    (across * (0.5 - v), up)
                } else {
                    let (sin, cos) = (std::f32::consts::TAU * if k == columns { 0.0 } else { v }).sin_cos();
                    let n = up * cos - across * sin;
                    (n * radius, n)
                };
                positions.push(s.p + offset * s.width);
                normals.push(normal);
                uvs.push(Vec2::new(s.u, v));
            }
        }
        let row = columns + 1;
        for j in 0..stations.len() as u32 - 1 {
            for k in 0..columns {
                let (a, b) = (first + j * row + k, first + (j + 1) * row + k);
                indices.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
            }
        }
    }
    GeometryDescription::Mesh { positions, normals, uvs, indices }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_are_their_bezier_segments() {
        let p: Vec<Vec3> =
            [[0.0, 0.0], [1.0, 2.0], [3.0, 1.0], [4.0, -1.0], [6.0, 0.0]].map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec();
        // Basis functions of the uniform cubic B-spline at t = .3 of the second segment.
        let (t, s) = (0.3f32, 0.7f32);
        let weights = [s * s * s, 3.0 * t * t * t - 6.0 * t * t + 4.0, 3.0 * s * s * s - 6.0 * s * s + 4.0, t * t * t];
        let expected = (0..4).map(|k| p[1 + k] * (weights[k] / 6.0)).sum::<Vec3>();
        assert!(at(&cubic(&p, 1, 3, true), t).distance(expected) < 1e-6);
        // Successive segments meet with one tangent.
        for degree in [2, 3] {
            let (a, b) = (cubic(&p, 0, degree, true), cubic(&p, 1, degree, true));
            assert!(a[3].distance(b[0]) < 1e-6 && tangent(&a, 1.0).distance(tangent(&b, 0.0)) < 1e-5);
        }
        let quadratic = cubic(&p, 0, 2, false);
        let direct = p[0] * (s * s) + p[1] * (2.0 * s * t) + p[2] * (t * t);
        assert!(at(&quadratic, t).distance(direct) < 1e-6);
    }

    #[test]
    fn pieces_stay_within_their_deviation() {
        let c = [[0.0, 0.0, 0.0], [1.0, 3.0, 0.0], [2.0, -3.0, 1.0], [3.0, 0.0, 0.0]].map(Vec3::from);
        for width in [0.05, 0.5] {
            let n = pieces(&c, width);
            assert!(n > 1 && n < MAX_PIECES);
            for k in 0..n {
                let (a, b) = (at(&c, k as f32 / n as f32), at(&c, (k + 1) as f32 / n as f32));
                let middle = at(&c, (k as f32 + 0.5) / n as f32);
                let chord = (b - a).normalize();
                let off = (middle - a).reject_from(chord).length();
                assert!(off <= DEVIATION * width * 1.001, "{off} of {width}");
            }
        }
        assert_eq!(pieces(&[Vec3::ZERO; 4], 1.0), 1);
    }
}
