//! A curled leaf: a closed sheet 0.3 mm thick with a stalk, a midrib and side veins as relief.
//!
//! The loops of the tube run around the blade, and they are bent into chevrons so that side veins follow them: a vein
//! then needs a handful of loops, not a fine grid.

use glam::{DMat3, DVec3};

use crate::mesh::Mesh;
use crate::profile::smoothstep;

const STALK: f64 = 16.0;
const BLADE: f64 = 80.0;
const WIDTH: f64 = 25.0;
/// How far a side vein advances per millimetre away from the midrib.
const SLANT: f64 = 0.62;
/// Radius of the curl across the blade \[mm\].
const CURL: f64 = 19.0;

/// Half width of stalk and blade at arc length `x` along the midrib \[mm\].
fn half_width(x: f64) -> f64 {
    let t = ((x - STALK) / BLADE).clamp(0.0, 1.0);
    let blade = WIDTH * 1.62 * t.powf(0.72) * (1.0 - t).powf(0.62);
    let stalk = 0.85 * (1.0 - 0.9 * smoothstep(STALK, STALK + BLADE, x));
    (blade * blade + stalk * stalk).sqrt()
}

/// Where side veins leave the midrib \[mm\].
fn veins() -> impl Iterator<Item = f64> {
    (0..9).map(|k| STALK + 5.0 + 7.6 * k as f64 - 0.12 * (k * k) as f64)
}

/// Half thickness at arc length `x` and relative distance `t` from the midrib \[mm\].
fn half_thickness(x: f64, t: f64) -> f64 {
    let y = t * half_width(x);
    let along = smoothstep(STALK - 4.0, STALK + 6.0, x);
    let stalk = 0.85 * (1.0 - t * t).max(0.0).sqrt().max(0.12);
    let midrib = (0.62 - 0.40 * smoothstep(STALK, STALK + BLADE, x)) * (-(y / 1.1).powi(2)).exp();
    let fade = 1.0 - smoothstep(0.55, 0.98, t.abs());
    let side: f64 = veins().map(|v| (-((x - v) / 0.55).powi(2)).exp()).sum();
    let blade = (0.15 + 0.20 * side * fade).max(midrib + 0.10) * (1.0 - 0.55 * smoothstep(0.93, 1.0, t.abs()));
    stalk + (blade - stalk) * along
}

/// The point at arc length `x` along the midrib, signed distance `y` from it, and height `h` above the blade's middle.
fn bent(x: f64, y: f64, h: f64) -> DVec3 {
    // Curl across: roll the blade on a cylinder whose radius grows along the stalk.
    let radius = CURL * (1.0 + 0.35 * (1.0 - smoothstep(STALK, STALK + 50.0, x)));
    let roll = y / radius;
    // Waves of the margin keep the curl from looking machined.
    let wave = 0.9 * (y / WIDTH).powi(2) * (0.17 * x + 0.8 * y.signum()).sin();
    let across = DVec3::new(0.0, roll.sin() * radius, (1.0 - roll.cos()) * radius + wave);
    let normal = DVec3::new(0.0, -roll.sin(), roll.cos());
    // Bend along: the midrib is an arc that lifts stalk and tip.
    let arc = 130.0;
    let angle = (x - STALK - 0.42 * BLADE) / arc;
    let local = across + normal * h;
    DVec3::new((arc - local.z) * angle.sin(), local.y, arc - (arc - local.z) * angle.cos())
}

/// The leaf with its midrib along x, rolled by `tilt` \[rad\] about it.
pub fn leaf(tilt: f64) -> Mesh {
    const ACROSS: usize = 26;
    // Place loops on both flanks of every vein, and between veins.
    let mut stations: Vec<f64> = (0..10).map(|k| 0.4 + (STALK - 1.0) * k as f64 / 9.0).collect();
    stations.extend([STALK + 0.6, STALK + 1.4, STALK + 2.4]);
    for v in veins() {
        stations.extend([-0.95, -0.55, -0.2, 0.2, 0.55, 0.95, 2.1, 3.2, 4.3].map(|d| v + d));
    }
    let last = stations[stations.len() - 1];
    let end = STALK + BLADE;
    stations.extend((1..=10).map(|k| last + (end - 0.15 - last) * (1.0 - (1.0 - k as f64 / 10.0).powi(2))));

    let loop_at = |x: f64| -> Vec<DVec3> {
        let side = |t: f64, sign: f64| {
            let w = half_width(x);
            let advance = SLANT * ((t * w).hypot(0.8) - 0.8) * smoothstep(STALK - 2.0, STALK + 6.0, x);
            // Keep the chevrons of the last loops short of the tip.
            let reach = (x + advance).min(x + (end - x) * 0.8 * t.abs());
            bent(reach, t * w, sign * half_thickness(x, t))
        };
        // Gather columns at the midrib and at the margin.
        let column = |k: usize| {
            let u = 2.0 * k as f64 / ACROSS as f64 - 1.0;
            u.signum() * (0.45 * u.abs().powf(1.8) + 0.55 * (1.0 - (1.0 - u.abs()).powf(1.15)))
        };
        let upper = (0..=ACROSS).rev().map(|k| side(column(k), 1.0));
        let lower = (0..=ACROSS).map(|k| side(column(k), -1.0));
        upper.chain(lower).collect()
    };
    let rings: Vec<Vec<DVec3>> = stations.iter().map(|x| loop_at(*x)).collect();
    let turn = DMat3::from_rotation_x(tilt);
    Mesh::tube(bent(0.0, 0.0, 0.0), &rings, bent(end, 0.0, 0.0)).mapped(|p| turn * p)
}
