//! A bar of soap: a pillow with a crescent moon and a drop sunk into both faces, where light finds a short way.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;
use crate::profile::smoothstep;

/// Half length, half width and half height \[mm\].
const HALF: DVec3 = DVec3::new(36.0, 24.0, 6.5);
/// Exponents of the superellipses that give the plan and the side view.
const PLAN: f64 = 5.0;
const SIDE: f64 = 3.4;

/// How far the relief at (x, y) of either face is sunk below the plain pillow \[mm\].
fn relief(p: DVec2, reach: f64) -> f64 {
    // The moon is a disk without a shifted disk; both distances are exact, so its flanks are equally steep.
    let moon = (p - DVec2::new(-4.0, 0.5)).length() - 16.0;
    let bite = 13.0 - (p - DVec2::new(3.4, 3.8)).length();
    // A smooth maximum rounds the horns, whose flanks would otherwise meet in creases.
    let overlap = (2.5 - (moon - bite).abs()).max(0.0);
    let crescent = 1.0 - smoothstep(-2.2, 1.6, moon.max(bite) + overlap * overlap / 10.0);
    // The drop of milk is a disk that moves up and shrinks; its distance is the least of all stages.
    let stage = |k: i32| {
        let t = f64::from(k) / 16.0;
        (p - DVec2::new(9.0, -1.5 + 7.5 * t)).length() - 3.6 * (1.0 - 0.8 * t)
    };
    let drop = 1.0 - smoothstep(-2.2, 1.6, (0..=16).map(stage).fold(f64::INFINITY, f64::min));
    let groove = (-((reach - 0.84) / 0.022).powi(2)).exp();
    4.5 * crescent + 3.3 * drop + 0.6 * groove
}

/// The bar, 72 x 48 x 13 mm, its centre at the origin; the relief is on both faces, so that the floor of the moon is thin.
pub fn soap() -> Mesh {
    const COLUMNS: usize = 130;
    // Rings of the flanks follow the superellipse, those of the faces are evenly spaced in radius to carry the relief.
    let edge = 0.5f64.powf(1.0 / SIDE);
    let face = |k: usize| {
        let reach = edge * k as f64 / 44.0;
        (reach, (1.0 - reach.powf(SIDE)).powf(1.0 / SIDE))
    };
    let flank = (-8..=8).map(|k| {
        let (s, c) = (0.25 * PI * f64::from(k) / 8.0).sin_cos();
        let scale = (c.powf(SIDE) + s.abs().powf(SIDE)).powf(-1.0 / SIDE);
        (c * scale, s * scale)
    });
    let lower = (1..44).map(face).map(|(reach, height)| (reach, -height));
    let upper = (1..44).rev().map(face);
    let rings: Vec<_> = lower.chain(flank).chain(upper).map(|(reach, height)| ring(reach, height, COLUMNS)).collect();
    let pole = DVec3::new(0.0, 0.0, HALF.z - relief(DVec2::ZERO, 0.0));
    Mesh::tube(-pole, &rings, pole)
}

/// One loop of the pillow at relative distance `reach` from the axis and relative height `height`.
fn ring(reach: f64, height: f64, columns: usize) -> Vec<DVec3> {
    (0..columns)
        .map(|k| {
            let angle = TAU * k as f64 / columns as f64;
            // Near the centre the plan is an ellipse, towards the rim a superellipse.
            let exponent = 2.0 + (PLAN - 2.0) * smoothstep(0.3, 0.9, reach);
            let [c, s] = [angle.cos(), angle.sin()];
            let scale = (c.abs().powf(exponent) + s.abs().powf(exponent)).powf(-1.0 / exponent);
            let plan = DVec2::new(HALF.x * c, HALF.y * s) * (scale * reach);
            let sunk = smoothstep(0.2, 0.4, height.abs()) * relief(plan, reach);
            DVec3::new(plan.x, plan.y, HALF.z * height - height.signum() * sunk)
        })
        .collect()
}
