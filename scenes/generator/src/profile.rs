//! Profiles for the lathe: polylines in the (radius, height) half-plane whose corners are rounded by arcs.
//!
//! Smooth vertex normals are right only on smooth surfaces, so no profile keeps a sharp corner: each has a fillet, and
//! short guard segments beside it keep the arc's normals from bleeding into the straight part.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;

/// The turn between neighbouring segments of an arc of this radius \[rad\].
///
/// A chord stays within 0.02 mm of its arc, a thirtieth of a pixel of the showcase; shading needs 24 degrees or less.
fn arc_step(radius: f64) -> f64 {
    (2.0 * (1.0 - 0.02 / radius.max(0.04)).acos()).min(24.0 * PI / 180.0)
}

/// A profile under construction: points (radius, height) and the fillet radius at each \[mm\].
#[derive(Clone, Debug, Default)]
pub struct Profile {
    nodes: Vec<(DVec2, f64)>,
}

impl Profile {
    /// A profile that starts on the axis at `height`.
    pub fn from_axis(height: f64) -> Self {
        Self { nodes: vec![(DVec2::new(0.0, height), 0.0)] }
    }

    /// Goes straight to (radius, height) and rounds that corner by an arc of radius `fillet`.
    pub fn to(mut self, radius: f64, height: f64, fillet: f64) -> Self {
        self.nodes.push((DVec2::new(radius, height), fillet));
        self
    }

    /// Goes along a cubic Bezier curve from the present point, over the handles `a` and `b`, to `end`.
    pub fn curve(mut self, a: [f64; 2], b: [f64; 2], end: [f64; 2], steps: usize) -> Self {
        let p0 = self.nodes[self.nodes.len() - 1].0;
        let [p1, p2, p3] = [a, b, end].map(DVec2::from);
        for k in 1..=steps {
            let t = k as f64 / steps as f64;
            let s = 1.0 - t;
            let point = p0 * (s * s * s) + p1 * (3.0 * s * s * t) + p2 * (3.0 * s * t * t) + p3 * (t * t * t);
            self.nodes.push((point, 0.0));
        }
        self
    }

    /// Goes around a ball that sits on the axis, from polar angle `from` (0 = top) up to the axis, without its pole;
    /// the corner where it starts is rounded by `fillet`.
    pub fn ball(mut self, center_height: f64, radius: f64, from: f64, fillet: f64) -> Self {
        let steps = (from / arc_step(radius)).ceil() as usize;
        for k in (1..=steps).rev() {
            let angle = from * k as f64 / steps as f64;
            let point = DVec2::new(radius * angle.sin(), center_height + radius * angle.cos());
            self.nodes.push((point, if k == steps { fillet } else { 0.0 }));
        }
        self
    }

    /// The rounded polyline up to the axis at `end_height`, both end points included, in pieces of at most `longest`.
    pub fn closed_at(mut self, end_height: f64, longest: f64) -> Vec<DVec2> {
        self.nodes.push((DVec2::new(0.0, end_height), 0.0));
        let mut pieces = vec![vec![self.nodes[0].0]];
        for k in 1..self.nodes.len() - 1 {
            pieces.push(rounded_corner(self.nodes[k - 1].0, self.nodes[k], self.nodes[k + 1].0));
        }
        pieces.push(vec![self.nodes[self.nodes.len() - 1].0]);

        let mut line = pieces[0].clone();
        for pair in pieces.windows(2) {
            let [from, to] = [pair[0][pair[0].len() - 1], pair[1][0]];
            let length = from.distance(to);
            // Place guard points beside the arcs, then divide what lies between them evenly.
            let guard = if pair[0].len() > 1 || pair[1].len() > 1 { (0.12 * length).min(0.25) } else { 0.0 };
            let (a, b) = (from.lerp(to, guard / length), to.lerp(from, guard / length));
            let parts = (a.distance(b) / longest).ceil().max(1.0) as usize;
            if pair[0].len() > 1 {
                line.push(a);
            }
            line.extend((1..parts).map(|k| a.lerp(b, k as f64 / parts as f64)));
            if pair[1].len() > 1 {
                line.push(b);
            }
            line.extend(&pair[1]);
        }
        line
    }
}

/// The points that replace one corner: an arc tangent to both sides, or the corner itself where `fillet` is zero.
fn rounded_corner(before: DVec2, (corner, fillet): (DVec2, f64), after: DVec2) -> Vec<DVec2> {
    let [u, v] = [(before - corner).normalize(), (after - corner).normalize()];
    let turn = PI - u.angle_to(v).abs();
    if fillet <= 0.0 || turn < 1e-3 {
        return vec![corner];
    }
    // The tangent points lie fillet * tan(turn / 2) from the corner; the arc's centre lies on the bisector.
    let reach = fillet * (turn / 2.0).tan();
    assert!(reach < before.distance(corner) && reach < after.distance(corner), "fillet too large at {corner}");
    let center = corner + (u + v).normalize() * (fillet / (turn / 2.0).cos());
    let [start, end] = [corner + u * reach - center, corner + v * reach - center];
    let sweep = start.angle_to(end);
    let steps = (turn / arc_step(fillet)).ceil() as usize;
    (0..=steps).map(|k| center + DVec2::from_angle(sweep * k as f64 / steps as f64).rotate(start)).collect()
}

/// `columns` equal angles of a full turn \[rad\].
pub fn even_angles(columns: usize) -> Vec<f64> {
    (0..columns).map(|k| TAU * k as f64 / columns as f64).collect()
}

/// The closed surface of revolution of a profile that starts and ends on the axis, around z.
pub fn lathe(line: &[DVec2], angles: &[f64]) -> Mesh {
    let ring = |p: &DVec2| angles.iter().map(|a| DVec3::new(p.x * a.cos(), p.x * a.sin(), p.y)).collect();
    let rings: Vec<Vec<DVec3>> = line[1..line.len() - 1].iter().map(ring).collect();
    Mesh::tube(DVec3::new(0.0, 0.0, line[0].y), &rings, DVec3::new(0.0, 0.0, line[line.len() - 1].y))
}

/// The cubic step that rises smoothly from 0 at `low` to 1 at `high`.
pub fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
