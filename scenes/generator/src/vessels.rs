//! A tumbler with milk in it, and a candle that has burnt a hollow for its flame, in millimetres around the z axis.

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;
use crate::profile::{Profile, even_angles, lathe, smoothstep};

/// Width of the air film between milk and glass \[mm\].
///
/// A pbrt boundary knows one inside and one outside, and every mesh here is closed by itself; so milk and glass do not
/// share a surface. The film is far wider than the rounding of 32-bit coordinates and far thinner than a pixel.
const FILM: f64 = 0.05;
const COLUMNS: usize = 84;

/// The inner radius of the tumbler at height `z` \[mm\]: a slight flare.
fn inner_radius(z: f64) -> f64 {
    22.0 + 0.055 * z
}

/// The tumbler: 1.6 mm walls, a 6 mm bottom, 80 mm high.
pub fn tumbler() -> Mesh {
    let wall = 1.6;
    let line = Profile::from_axis(0.6)
        .to(17.0, 0.6, 2.0)
        .to(19.0, 0.0, 0.6)
        .to(inner_radius(0.0) + wall, 0.0, 2.6)
        .to(inner_radius(80.0) + wall, 80.0, 0.7)
        .to(inner_radius(80.0), 80.0, 0.7)
        .to(inner_radius(6.0), 6.0, 5.0)
        .closed_at(6.0, 8.0);
    lathe(&line, &even_angles(COLUMNS))
}

/// The milk: it fills the tumbler up to 60 mm and creeps up a little at the wall.
pub fn milk() -> Mesh {
    let level = 60.0;
    let rim = inner_radius(level + 1.2) - FILM;
    let line = Profile::from_axis(6.0 + FILM)
        .to(inner_radius(6.0) - FILM, 6.0 + FILM, 5.0)
        .to(rim, level + 1.2, 0.06)
        .curve([rim - 0.5, level + 0.35], [rim - 1.4, level], [rim - 3.2, level], 8)
        .closed_at(level, 8.0);
    lathe(&line, &even_angles(COLUMNS))
}

/// Height of the pool of wax around the wick \[mm\].
const POOL: f64 = 31.0;

/// The candle: 46 mm wide, its rim melted to between 54 and 62 mm, with a few frozen drips outside.
pub fn candle() -> Mesh {
    let line = Profile::from_axis(0.0)
        .to(23.0, 0.0, 1.4)
        .to(23.0, 58.0, 2.4)
        .to(18.0, 58.0, 2.3)
        .to(17.4, POOL, 4.5)
        .closed_at(POOL - 0.4, 3.2);
    lathe(&line, &even_angles(80)).mapped(|p| {
        let angle = p.y.atan2(p.x);
        // Let the rim sink where the flame leaned, and stand where it did not.
        let rim = 2.2 * (angle - 2.1).cos() + 1.1 * (2.0 * angle + 0.7).cos() + 0.6 * (3.0 * angle - 1.0).cos();
        let lift = rim * smoothstep(38.0, 58.0, p.z) * smoothstep(12.0, 16.0, p.truncate().length());
        // Add the drips: (angle, angular width, lower end, thickness).
        let drips = [
            (-1.9, 0.13, 22.0, 1.5),
            (-1.15, 0.10, 38.0, 1.2),
            (-2.7, 0.12, 30.0, 1.3),
            (0.4, 0.13, 14.0, 1.5),
            (1.6, 0.12, 26.0, 1.4),
        ];
        let outer = smoothstep(20.0, 22.5, p.truncate().length());
        let bulge: f64 = drips
            .iter()
            .map(|(at, width, end, thickness)| {
                let offset = (angle - at).sin().atan2((angle - at).cos()) / width;
                // A drip is thickest just above its lower end.
                let bead = 0.55 + 0.45 * (-((p.z - end - 3.0) / 4.0).powi(2)).exp();
                thickness * bead * (-offset * offset).exp() * smoothstep(*end, end + 2.5, p.z)
            })
            .sum();
        let top = 1.0 - smoothstep(54.0, 58.0, p.z);
        let stretch = 1.0 + bulge * outer * top / 23.0;
        DVec3::new(p.x * stretch, p.y * stretch, p.z + lift)
    })
}

/// The wick, bent as wicks are; it stands just above the pool.
pub fn wick() -> Mesh {
    let foot = POOL - 0.3;
    let line = Profile::from_axis(foot).to(0.8, foot, 0.25).to(0.65, foot + 5.0, 0.3).closed_at(foot + 5.0, 0.8);
    lathe(&line, &even_angles(12)).mapped(|p| {
        let up = p.z - foot;
        DVec3::new(p.x + 0.03 * up * up, p.y, p.z)
    })
}

/// The flame: a drop that starts just above the wick and narrows to a point, 26 mm high.
pub fn flame() -> Mesh {
    let [base, height, radius] = [POOL + 5.0, 26.0, 5.0];
    // A drop: sin(pi t) pulled towards the base, round below and pointed above.
    let steps = 24;
    let line: Vec<DVec2> = (0..=steps)
        .map(|k| {
            let t = 0.5 - 0.5 * (std::f64::consts::PI * k as f64 / steps as f64).cos();
            DVec2::new(radius * 2.38 * t.sqrt() * (1.0 - t).powf(0.8), base + height * t)
        })
        .collect();
    lathe(&line, &even_angles(24)).mapped(|p| DVec3::new(p.x + 0.75, p.y, p.z))
}
