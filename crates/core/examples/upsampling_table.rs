//! Writes the table of Jakob-Hanika coefficients for sRGB that the crate embeds (`data/srgb.spec`).
//!
//! Command: `cargo run --release -p moonmilk-core --example upsampling_table -- crates/core/data/srgb.spec`.
//!
//! The file has the format of the crate `rgb2spec` ("SPEC", resolution, scale, coefficients; little endian), whose reader we
//! use. Its optimiser diverges at some nodes (dark saturated blues reflect up to 1.4) and has another D65, so
//! that the nodes are fitted here: least squares in CIELAB by Levenberg-Marquardt, against the observer of `color`.

use std::io::Write;

use moonmilk_core::color::{OBSERVED, SAMPLES};

/// Nodes per axis: 32^3 x 3 x 3 floats are 1.18 MB.
const RESOLUTION: usize = 32;
/// Step through the 1 nm tables of the observer; the spectra are smooth.
const STEP: usize = 2;
/// Weight of |c|^2 in the cost: keeps the coefficients of unreachable colours finite, costs others less than .01 in CIELAB.
const TAME: f64 = 1e-9;

type Vector = [f64; 3];
type Matrix = [Vector; 3];

/// XYZ of a spectrum under D65 over that of D65: weights per sampled wavelength, t = (lambda - 380) / 400.
struct Sensor {
    t: Vec<f64>,
    weights: Vec<Vector>,
    white: Vector,
}

impl Sensor {
    fn new() -> Self {
        let o = &*OBSERVED;
        let at: Vec<usize> = (0..SAMPLES).step_by(STEP).collect();
        let end = |i: usize| if i == 0 || i == SAMPLES - 1 { 0.5 } else { 1.0 };
        let mut weights: Vec<Vector> = at.iter().map(|&i| o.xyz_bar[i].map(|x| x * o.d65[i] * end(i))).collect();
        let sum: Vector = [0, 1, 2].map(|k| weights.iter().map(|w| w[k]).sum());
        weights.iter_mut().for_each(|w| *w = std::array::from_fn(|k| w[k] / sum[k]));
        let white = o.xyz_from_rgb.map(|row| row.iter().sum());
        Self { t: at.iter().map(|&i| i as f64 / (SAMPLES - 1) as f64).collect(), weights, white }
    }

    /// Returns XYZ / white of the spectrum with coefficients c, and its derivatives by them.
    fn measure(&self, c: Vector) -> (Vector, Matrix) {
        let (mut value, mut jacobian) = ([0.0; 3], [[0.0; 3]; 3]);
        for (&t, w) in self.t.iter().zip(&self.weights) {
            let x = (c[0] * t + c[1]) * t + c[2];
            let r = 1.0 / (1.0 + x * x).sqrt();
            let (s, ds) = (0.5 + 0.5 * x * r, 0.5 * r * r * r);
            for k in 0..3 {
                value[k] += w[k] * s;
                for (j, d) in [t * t, t, 1.0].into_iter().enumerate() {
                    jacobian[k][j] += w[k] * ds * d;
                }
            }
        }
        (value, jacobian)
    }

    fn target(&self, rgb: Vector) -> Vector {
        let xyz = OBSERVED.xyz_from_rgb.map(|row| (0..3).map(|k| row[k] * rgb[k]).sum::<f64>());
        std::array::from_fn(|k| xyz[k] / self.white[k])
    }

    /// Fits the coefficients of a colour, starting from c.
    fn fit(&self, rgb: Vector, mut c: Vector) -> Vector {
        let goal = lab(self.target(rgb)).0;
        let residual = |c: Vector| {
            let (v, dv) = self.measure(c);
            let (l, dl) = lab(v);
            let r: Vector = std::array::from_fn(|k| l[k] - goal[k]);
            let j: Matrix = std::array::from_fn(|a| std::array::from_fn(|b| (0..3).map(|k| dl[a][k] * dv[k][b]).sum()));
            let cost = r.iter().map(|x| x * x).sum::<f64>() + TAME * c.iter().map(|x| x * x).sum::<f64>();
            (r, j, cost)
        };
        let (mut r, mut j, mut cost) = residual(c);
        let mut damping = 1e-3;
        for _ in 0..200 {
            let gradient: Vector = std::array::from_fn(|a| (0..3).map(|k| j[k][a] * r[k]).sum::<f64>() + TAME * c[a]);
            let mut m: Matrix =
                std::array::from_fn(|a| std::array::from_fn(|b| (0..3).map(|k| j[k][a] * j[k][b]).sum()));
            for (a, row) in m.iter_mut().enumerate() {
                row[a] = (row[a] + TAME) * (1.0 + damping);
            }
            let step = solve(m, gradient);
            let next: Vector = std::array::from_fn(|a| c[a] - step[a]);
            let (r1, j1, cost1) = residual(next);
            if cost1 < cost {
                let done = cost - cost1 < 1e-9 * cost;
                (c, r, j, cost) = (next, r1, j1, cost1);
                damping = (damping * 0.2).max(1e-12);
                if done || cost < 1e-14 {
                    break;
                }
            } else {
                damping *= 5.0;
                if damping > 1e12 {
                    break;
                }
            }
        }
        c
    }
}

/// Returns CIELAB of XYZ / white and its derivatives.
fn lab(v: Vector) -> (Vector, Matrix) {
    let d: f64 = 6.0 / 29.0;
    let f = v.map(|t| if t > d * d * d { t.cbrt() } else { t / (3.0 * d * d) + 4.0 / 29.0 });
    let g = v.map(|t| if t > d * d * d { 1.0 / (3.0 * t.cbrt().powi(2)) } else { 1.0 / (3.0 * d * d) });
    (
        [116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])],
        [[0.0, 116.0 * g[1], 0.0], [500.0 * g[0], -500.0 * g[1], 0.0], [0.0, 200.0 * g[1], -200.0 * g[2]]],
    )
}

/// Solves m x = b by Cramer's rule.
fn solve(m: Matrix, b: Vector) -> Vector {
    let det = |m: &Matrix| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    let d = det(&m);
    std::array::from_fn(|c| {
        let mut n = m;
        (0..3).for_each(|r| n[r][c] = b[r]);
        det(&n) / d
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: upsampling_table OUTPUT")?;
    let sensor = Sensor::new();
    let smooth = |x: f64| x * x * (3.0 - 2.0 * x);
    let n = RESOLUTION;
    let scale: Vec<f64> = (0..n).map(|k| smooth(smooth(k as f64 / (n - 1) as f64))).collect();
    let mut data = vec![0f32; 9 * n * n * n];
    for largest in 0..3 {
        for (j, i) in (0..n * n).map(|ij| (ij / n, ij % n)) {
            let (x, y) = (i as f64 / (n - 1) as f64, j as f64 / (n - 1) as f64);
            let mut column = |order: &mut dyn Iterator<Item = usize>, mut c: Vector| {
                for k in order {
                    let mut rgb = [0.0; 3];
                    (rgb[largest], rgb[(largest + 1) % 3], rgb[(largest + 2) % 3]) =
                        (scale[k], x * scale[k], y * scale[k]);
                    c = sensor.fit(rgb, c);
                    // From t = (lambda - 380) / 400 to lambda in nm.
                    let (l0, s) = (380.0, 1.0 / 400.0);
                    let at = 3 * (((largest * n + k) * n + j) * n + i);
                    data[at] = (c[0] * s * s) as f32;
                    data[at + 1] = (c[1] * s - 2.0 * c[0] * l0 * s * s) as f32;
                    data[at + 2] = (c[2] - c[1] * l0 * s + c[0] * (l0 * s) * (l0 * s)) as f32;
                }
            };
            // Continue from middle brightness, where the fit starts from a constant, to both ends.
            let middle = n / 2;
            column(&mut (middle..n), [0.0; 3]);
            column(&mut (0..=middle).rev(), [0.0; 3]);
        }
    }
    let mut file = std::fs::File::create(path)?;
    file.write_all(b"SPEC")?;
    file.write_all(&(n as u32).to_le_bytes())?;
    let bytes: Vec<u8> = scale.iter().map(|&x| x as f32).chain(data).flat_map(f32::to_le_bytes).collect();
    file.write_all(&bytes)?;
    Ok(())
}
