//! Where each object of the showcase stands: x to the right, y away from the camera, z up, the table at z = 0 \[mm\].

use std::f64::consts::FRAC_PI_2;

use glam::{DMat3, DVec3};

use crate::mesh::Mesh;
use crate::{chess, leaf, soap, vessels};

/// Height of every object above the table \[mm\]: enough to keep boundaries apart in 32-bit floats, too thin to see.
pub const CLEARANCE: f64 = 0.01;

/// All meshes of the scene with the stem of their file name, in scene coordinates.
pub fn showcase() -> Vec<(&'static str, Mesh)> {
    let turned = |mesh: Mesh, degrees: f64| {
        let turn = DMat3::from_rotation_z(degrees.to_radians());
        mesh.mapped(|p| turn * p)
    };
    // Move the parts of the tumbler and of the candle together: they keep their distances.
    let [glass, flame] = [DVec3::new(-82.0, 42.0, CLEARANCE), DVec3::new(98.0, 58.0, CLEARANCE)];
    let upright = DMat3::from_rotation_x(FRAC_PI_2);
    vec![
        ("tumbler", vessels::tumbler().mapped(|p| p + glass)),
        ("milk", vessels::milk().mapped(|p| p + glass)),
        ("candle", vessels::candle().mapped(|p| p + flame)),
        ("wick", vessels::wick().mapped(|p| p + flame)),
        ("flame", vessels::flame().mapped(|p| p + flame)),
        ("queen", chess::queen().placed(-24.0, 14.0, CLEARANCE)),
        ("rook", turned(chess::rook(), 17.0).placed(20.0, 52.0, CLEARANCE)),
        ("pawn", turned(chess::fallen_pawn(), -152.0).placed(20.0, -46.0, CLEARANCE)),
        ("soap", turned(soap::soap().mapped(|p| upright * p), -16.0).placed(56.0, -8.0, CLEARANCE)),
        ("leaf", turned(leaf::leaf(1.35), 14.0).placed(-77.0, -47.0, CLEARANCE)),
    ]
}
