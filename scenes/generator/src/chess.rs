//! Turned chess pieces: queen, rook and pawn, standing on z = 0 around the z axis, in millimetres.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use crate::mesh::Mesh;
use crate::profile::{Profile, even_angles, lathe, smoothstep};

/// The common foot: a plinth with rounded edges and one step, up to the start of the stem.
fn foot(radius: f64) -> Profile {
    Profile::from_axis(0.0)
        .to(radius, 0.0, 0.8)
        .to(radius + 0.3, 4.2, 1.6)
        .to(radius - 2.2, 5.0, 0.6)
        .to(radius - 2.0, 7.4, 0.9)
        .to(radius - 3.6, 8.6, 0.4)
}

/// The queen, 84 mm high, with a crown of nine scallops and a ball on top.
pub fn queen() -> Mesh {
    let line = foot(16.5)
        .curve([10.5, 17.0], [5.9, 26.0], [5.3, 44.0], 16)
        .to(5.2, 50.0, 0.5)
        .to(9.0, 51.4, 0.6)
        .to(9.0, 53.2, 0.6)
        .to(5.8, 54.6, 0.5)
        .to(6.9, 56.0, 0.45)
        .to(6.9, 57.4, 0.45)
        .to(5.0, 58.6, 0.5)
        .curve([5.2, 64.0], [7.6, 69.0], [10.4, 75.6], 9)
        .to(10.8, 76.6, 0.3)
        .to(8.2, 76.6, 0.5)
        .to(6.6, 74.2, 0.9)
        .ball(80.6, 3.4, PI - 0.62, 0.25)
        .closed_at(84.0, 5.0);
    // Draw the crown's rim into scallops that also lean outward; the stem below and the ball inside stay round.
    lathe(&line, &even_angles(72)).mapped(|p| {
        let radius = p.truncate().length();
        let weight = smoothstep(68.0, 76.6, p.z) * smoothstep(5.5, 8.0, radius);
        let wave = (9.0 * p.y.atan2(p.x)).cos();
        let stretch = 1.0 + 0.045 * weight * wave;
        DVec3::new(p.x * stretch, p.y * stretch, p.z + 1.25 * weight * wave)
    })
}

/// The rook, 52 mm high: a tower with a sunken top and six merlons.
pub fn rook() -> Mesh {
    const MERLONS: usize = 6;
    const SILL: f64 = 45.6;
    let line = foot(15.5)
        .curve([10.6, 14.0], [8.6, 22.0], [8.4, 33.0], 13)
        .to(8.4, 35.0, 0.4)
        .to(11.4, 36.4, 0.6)
        .to(11.4, 38.4, 0.6)
        .to(9.8, 39.6, 0.5)
        .to(12.2, 43.0, 1.0)
        .to(12.2, 52.0, 0.7)
        .to(8.4, 52.0, 0.7)
        .to(8.2, 43.6, 1.2)
        .closed_at(43.2, 3.0);
    // Cut the gaps between merlons by pressing the rim down; columns gather where its flanks are steep.
    let [half_gap, flank] = [0.155, 0.03];
    let period = TAU / MERLONS as f64;
    let mut angles = Vec::new();
    for merlon in 0..MERLONS {
        let start = merlon as f64 * period;
        let gap: Vec<f64> = [-1.0, 0.0, 1.0].map(|x| x * (half_gap - flank * 1.2)).to_vec();
        let rise = [-0.7, -0.25, 0.25, 0.8].map(|x| half_gap + x * flank);
        let top_width = period - 2.0 * half_gap;
        let top = (0..4).map(|k| half_gap + flank * 1.3 + (top_width - flank * 2.6) * k as f64 / 3.0);
        let fall = rise.iter().rev().map(|x| period - x);
        angles.extend(gap.into_iter().chain(rise).chain(top).chain(fall).map(|x| start + x));
    }
    lathe(&line, &angles).mapped(|p| {
        let phase = (p.y.atan2(p.x).rem_euclid(period) + 0.5 * period) % period - 0.5 * period;
        let gap = 1.0 - smoothstep(half_gap - flank, half_gap + flank, phase.abs());
        let above = (p.z - SILL).max(0.0);
        let inside = smoothstep(3.0, 7.0, p.truncate().length());
        DVec3::new(p.x, p.y, p.z - 0.93 * gap * inside * above)
    })
}

/// The pawn, 44 mm high, lying on its side along x as it came to rest: on the rims of its foot and its ball.
pub fn fallen_pawn() -> Mesh {
    let line = foot(13.0)
        .curve([8.4, 13.0], [5.2, 18.0], [4.7, 26.0], 12)
        .to(4.6, 27.4, 0.4)
        .to(8.2, 28.8, 0.55)
        .to(8.2, 30.4, 0.55)
        .ball(37.2, 7.2, PI - 0.72, 0.3)
        .closed_at(44.4, 4.0);
    let standing = lathe(&line, &even_angles(64));
    // Turn the piece about y by a little more than a right angle, until foot and ball are equally low.
    let turned = |angle: f64| DMat3::from_rotation_y(angle);
    let lowest = |angle: f64, part: &dyn Fn(f64) -> bool| {
        let turn = turned(angle);
        let in_part = standing.positions.iter().filter(|p| part(p.z));
        in_part.map(|p| (turn * *p).z).fold(f64::INFINITY, f64::min)
    };
    let (mut low, mut high) = (0.5 * PI - 0.1, 0.5 * PI + 0.5);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if lowest(middle, &|z| z > 29.0) > lowest(middle, &|z| z < 10.0) {
            low = middle;
        } else {
            high = middle;
        }
    }
    standing.clone().mapped(|p| turned(0.5 * (low + high)) * p)
}
