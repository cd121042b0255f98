//! The sum over vertices that a collision sees, eight of them at a time.

use std::f32::consts::FRAC_1_PI;

use moonmilk_core::{Random, Spectrum, Stream, Vec3};
use moonmilk_walk::jump::Scattering;
use moonmilk_walk::{Medium, PhaseFunction};
use wide::f32x8;

use super::FLIGHTS;
use super::eights::{Eight, exp};

/// The light of vertices that a collision sees, as far as it is summed up.
pub(super) struct Sum<'a, const N: usize, P, S> {
    p: [f32x8; 3],
    medium: &'a Medium<N, P>,
    vertex: &'a S,
    density: f32x8,
    /// What scattering at both ends lets through, where it is the same in all directions.
    even: Option<[f32x8; N]>,
    /// Eight parts of each lane's sum.
    lanes: [f32x8; N],
    /// The sum of means over lanes, and one vertex in proportion to that: place, squared distance and colour of mean 1.
    pub total: f32,
    pub drawn: Option<(Vec3, f32, Spectrum<N>)>,
    choices: Stream,
}

impl<'a, const N: usize, P: PhaseFunction, S: Scattering<N>> Sum<'a, N, P, S> {
    pub fn new(p: Vec3, density: f32, medium: &'a Medium<N, P>, vertex: &'a S, choices: Stream) -> Self {
        let (p, zero) = ([p.x, p.y, p.z].map(f32x8::splat), f32x8::splat(0.0));
        let density = f32x8::splat(density);
        let law = &medium.law;
        let even = vertex.uniform().filter(|_| law.is_isotropic());
        let even = even.map(|sent| std::array::from_fn(|k| f32x8::splat(law.eval(0.0) * sent[k])));
        Self { p, medium, vertex, density, even, lanes: [zero; N], total: 0.0, drawn: None, choices }
    }

    /// Returns the sum, lane by lane.
    pub fn light(&self) -> Spectrum<N> {
        Spectrum::from_fn(|k| self.lanes[k].reduce_add())
    }

    /// Adds eight vertices with these weights.
    pub fn add(&mut self, eight: &Eight, weights: f32x8) {
        let v: [f32x8; 3] = std::array::from_fn(|k| eight.p[k] - self.p[k]);
        let r2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        let r = r2.sqrt();
        let sigma_t = self.medium.sigma_t;
        let transmittance = |k: usize| exp(r * f32x8::splat(-sigma_t[k]));
        let (t, q): ([f32x8; N], f32x8) = if self.medium.is_gray() {
            let t = transmittance(0);
            ([t; N], t * f32x8::splat(sigma_t[0]))
        } else {
            let t: [f32x8; N] = std::array::from_fn(transmittance);
            let q = (0..N).fold(f32x8::splat(0.0), |q, k| q + t[k] * f32x8::splat(sigma_t[k] / N as f32));
            (t, q)
        };
        let n = self.density * eight.kept;
        let w = n / (n * r2 + q * f32x8::splat(FLIGHTS * 0.25 * FRAC_1_PI));
        let w = w * weights;
        let turned = self.even.unwrap_or_else(|| self.turned(eight, v, r));
        let mut mean = f32x8::splat(0.0);
        for k in 0..N {
            let c = w * t[k] * turned[k] * eight.light[k];
            self.lanes[k] += c;
            mean += c;
        }
        // One of all, in proportion to its mean.
        mean *= f32x8::splat(1.0 / N as f32);
        let some = mean.reduce_add();
        self.total += some;
        let mut left = self.choices.uniform() * self.total;
        if some > 0.0 && left < some {
            let means = mean.to_array();
            let chosen = means.iter().position(|m| {
                left -= m;
                left < 0.0
            });
            // By rounding, none may be reached: the brightest, then.
            let l = chosen.unwrap_or_else(|| (0..8).max_by(|&a, &b| means[a].total_cmp(&means[b])).unwrap_or(0));
            let y = Vec3::from_array(eight.p.map(|p| p.to_array()[l]));
            let colour = Spectrum::from_fn(|k| (w * t[k] * turned[k] * eight.light[k]).to_array()[l] / means[l]);
            self.drawn = Some((y, r2.to_array()[l], colour));
        }
    }

    /// Returns what scattering at both ends lets through: of light that arrived at the vertices towards the collision, and there towards the camera.
    fn turned(&self, eight: &Eight, v: [f32x8; 3], r: f32x8) -> [f32x8; N] {
        let inverse = f32x8::splat(1.0) / r.fast_max(f32x8::splat(f32::MIN_POSITIVE));
        let d = v.map(|v| v * inverse);
        let cosine = eight.d[0] * d[0] + eight.d[1] * d[1] + eight.d[2] * d[2];
        let arriving = f32x8::from(cosine.to_array().map(|c| self.medium.law.eval(-c)));
        let [x, y, z] = d.map(|d| d.to_array());
        let sent: [Spectrum<N>; 8] = std::array::from_fn(|l| self.vertex.towards(Vec3::new(x[l], y[l], z[l])).0);
        std::array::from_fn(|k| arriving * f32x8::from(sent.map(|s| s[k])))
    }
}
