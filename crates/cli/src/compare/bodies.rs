//! The media that the camera sees, and what a model is worth for them: its domain, and the error of its profile.

use std::collections::BTreeMap;

use moonmilk_optics::OpticalProperties;
use moonmilk_optics::profile::{Distance, Model, distance, find};
use moonmilk_render::scene::Scene;
use moonmilk_render::seen::Seen;

/// The model that the profiles of others are compared with: exact up to a table's error.
pub const EXACT_PROFILE: &str = "tabulated";

/// Error of a profile from which it counts as outside of its domain: half of the light at the wrong radius, as much as between different materials.
pub const FAR_OFF: f64 = 0.5;

/// Names of the channels.
pub const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// A translucent body, as far as the camera sees it; instances of one shape count together.
#[derive(Clone, Debug)]
pub struct BodySeen {
    /// Its name.
    pub name: String,
    /// Where it was said.
    pub place: String,
    /// Pixels that show it.
    pub pixels: u64,
    /// Mean absorption coefficient over these \[1/L\].
    pub sigma_a: [f64; 3],
    /// Mean scattering coefficient over these \[1/L\].
    pub sigma_s: [f64; 3],
    /// Asymmetry.
    pub g: f64,
    /// Index.
    pub eta: f64,
    /// Median of the local thickness \[transport mean free paths\].
    pub thickness: [f64; 3],
}

impl BodySeen {
    fn medium(&self, channel: usize) -> Result<OpticalProperties, moonmilk_optics::Error> {
        OpticalProperties::new(self.sigma_a[channel], self.sigma_s[channel], self.g, self.eta)
    }

    /// Returns the reduced albedo of a channel.
    pub fn alpha_prime(&self, channel: usize) -> f64 {
        let scattering = (1.0 - self.g) * self.sigma_s[channel];
        scattering / (self.sigma_a[channel] + scattering)
    }
}

/// Returns the bodies in the order in which the picture shows them first.
pub fn bodies(scene: &Scene, map: &[Option<Seen>]) -> Vec<BodySeen> {
    let mut list: Vec<(BodySeen, [Vec<f64>; 3])> = Vec::new();
    let mut known: BTreeMap<(String, String), usize> = BTreeMap::new();
    for s in map.iter().flatten() {
        let o = &scene.objects[s.object as usize];
        let key = (o.name.to_string(), o.place.to_string());
        let i = *known.entry(key.clone()).or_insert(list.len());
        if i == list.len() {
            let (name, place) = key;
            let zero = [0.0; 3];
            let (g, eta) = (f64::from(s.g), f64::from(o.index));
            let body = BodySeen { name, place, pixels: 0, sigma_a: zero, sigma_s: zero, g, eta, thickness: zero };
            list.push((body, Default::default()));
        }
        let (body, depths) = &mut list[i];
        body.pixels += 1;
        for (c, depths) in depths.iter_mut().enumerate() {
            body.sigma_a[c] += f64::from(s.sigma_a[c]);
            body.sigma_s[c] += f64::from(s.sigma_s[c]);
            depths.push(f64::from(s.thickness) * f64::from(s.sigma_t_prime(c)));
        }
    }
    list.into_iter()
        .map(|(mut body, mut depths): (BodySeen, [Vec<f64>; 3])| {
            let n = body.pixels as f64;
            body.sigma_a = body.sigma_a.map(|s| s / n);
            body.sigma_s = body.sigma_s.map(|s| s / n);
            body.thickness = depths.each_mut().map(|list| {
                list.sort_by(f64::total_cmp);
                list[list.len() / 2]
            });
            body
        })
        .collect()
}

/// Returns what no planar model can know of the bodies: those thinner than a transport mean free path.
pub fn thin(bodies: &[BodySeen]) -> Vec<String> {
    let one = |b: &BodySeen| {
        let (c, depth) = (0..3).map(|c| (c, b.thickness[c])).min_by(|a, b| a.1.total_cmp(&b.1))?;
        (depth < 1.0).then(|| {
            format!(
                "{} ({}) is {depth:.2} transport mean free paths thick in {} (median of what the camera sees): a model of a half-space does not know that light leaves at the other side",
                b.name, b.place, CHANNELS[c]
            )
        })
    };
    bodies.iter().filter_map(one).collect()
}

/// What a model's profile is worth for the media of the scene.
#[derive(Clone, Debug, Default)]
pub struct Worth {
    /// Mean over pixels and channels of the distance from the exact profile; `None` where neither is defined.
    pub mean: Option<Distance>,
    /// The distances body by body and channel by channel.
    pub bodies: Vec<[Option<Distance>; 3]>,
    /// Where the scene is outside of the model's domain.
    pub warnings: Vec<String>,
}

/// Returns what a model is worth for some bodies.
pub fn worth(model: &Model, bodies: &[BodySeen]) -> Worth {
    let mut out = Worth::default();
    let (mut l1, mut total, mut pixels) = (0.0, 0.0, 0.0);
    for b in bodies {
        let mut told: Vec<(String, Vec<&str>)> = Vec::new();
        let mut tell = |what: String, c: usize| match told.iter_mut().find(|t| t.0 == what) {
            Some(t) => t.1.push(CHANNELS[c]),
            None => told.push((what, vec![CHANNELS[c]])),
        };
        let mut found = [None; 3];
        for (c, found) in found.iter_mut().enumerate() {
            let Ok(medium) = b.medium(c) else {
                continue;
            };
            if medium.sigma_s() <= 0.0 {
                continue;
            }
            let prepared = match model.prepare(&medium) {
                Ok(p) => p,
                Err(e) => {
                    tell(format!("outside of the model's domain ({e}): the nearest albedo inside is used"), c);
                    continue;
                }
            };
            let Some(exact) = find(EXACT_PROFILE).ok().and_then(|m| m.prepare(&medium).ok()) else {
                continue;
            };
            let d = distance(&prepared, &exact, 1.0 / medium.sigma_t());
            (l1, total, pixels) =
                (l1 + d.l1 * b.pixels as f64, total + d.total * b.pixels as f64, pixels + b.pixels as f64);
            if d.l1 > FAR_OFF {
                let (wrong, alpha) = (100.0 * d.l1, b.alpha_prime(c));
                tell(
                    format!(
                        "outside of what the model describes: its profile puts {wrong:.0} % of the light at the wrong radius for reduced albedo {alpha:.3}"
                    ),
                    c,
                );
            }
            *found = Some(d);
        }
        out.warnings.extend(told.into_iter().map(|(what, channels)| {
            let list = if channels.len() == 3 { String::new() } else { format!(", {}", channels.join(" and ")) };
            format!("{} ({}){list}: {what}", b.name, b.place)
        }));
        out.bodies.push(found);
    }
    out.mean = (pixels > 0.0).then(|| Distance { l1: l1 / pixels, total: total / pixels });
    out
}
