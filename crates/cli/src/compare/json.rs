//! The findings for programs: `metrics.json`.

use moonmilk_core::Estimate;
use moonmilk_io::split::Figures;
use serde_json::{Value, json};

use super::bins::{AXES, SIGNIFICANCE};
use super::bodies::CHANNELS;
use super::measure::{Findings, Measured, rms, rms_error};
use super::shoot::Cost;

fn estimate(e: &Estimate) -> Value {
    json!({"mean": e.mean, "std_err": e.std_err})
}

fn figures(f: &Figures) -> Value {
    json!({
        "pixels": f.pixels,
        "ratio": estimate(&f.ratio),
        "bias_rms": {"mean": rms(f.bias2.mean), "std_err": rms_error(&f.bias2)},
        "rel_mse": {"total": estimate(&f.total), "bias2": estimate(&f.bias2), "variance": estimate(&f.variance)},
    })
}

fn cost(c: &Cost) -> Value {
    json!({"seconds": c.seconds, "cpu_seconds": c.cpu, "memory_bytes": c.memory, "spp": c.spp})
}

/// Returns all findings.
pub fn of(f: &Findings) -> Value {
    let bodies: Vec<Value> = f
        .bodies
        .iter()
        .map(|b| {
            let alpha_prime = [0, 1, 2].map(|c| b.alpha_prime(c));
            json!({
                "name": b.name, "place": b.place, "pixels": b.pixels, "sigma_a": b.sigma_a, "sigma_s": b.sigma_s, "g": b.g, "eta": b.eta,
                "alpha_prime": alpha_prime,
                "thickness_transport_mfp": b.thickness,
            })
        })
        .collect();
    let settings: serde_json::Map<String, Value> =
        f.settings.iter().map(|(k, v)| ((*k).to_owned(), json!(v))).collect();
    json!({
        "moonmilk": env!("CARGO_PKG_VERSION"),
        "scene": f.scene,
        "scene_hash": f.hash,
        "width": f.size[0],
        "height": f.size[1],
        "budget": f.budget,
        "settings": settings,
        "object_pixels": f.object_pixels,
        "reference": {
            "name": f.exact.name,
            "image": f.exact.file,
            "cost": cost(&f.exact.cost),
            "variance": estimate(&f.exact.variance),
            "variance_with_a_models_budget": f.exact.at_equal,
            "noise_is_known": f.exact.known,
        },
        "bodies": bodies,
        "notes": f.notes,
        "error_scale": f.scale,
        "exposure_stops": f.stops,
        "models": f.models.iter().map(|m| model(f, m)).collect::<Vec<_>>(),
        "left_out": f.left_out.iter().map(|(name, reason)| json!({"name": name, "reason": reason})).collect::<Vec<_>>(),
        "definitions": DEFINITIONS.iter().map(|(k, v)| ((*k).to_owned(), json!(v))).collect::<serde_json::Map<_, _>>(),
    })
}

fn model(f: &Findings, m: &Measured) -> Value {
    let fails: Vec<Value> = AXES
        .iter()
        .zip(&m.bins)
        .map(|(axis, bins)| {
            let list: Vec<Value> = bins
                .iter()
                .enumerate()
                .filter_map(|(b, found)| {
                    let mut v = figures(found.as_ref()?);
                    let [from, to] = axis.limits(b);
                    v["from"] = json!(from);
                    v["to"] = json!(to);
                    Some(v)
                })
                .collect();
            json!({"axis": axis.name, "what": axis.what, "bins": list})
        })
        .collect();
    let worst = m.worst.map(|w| {
        let [from, to] = AXES[w.axis].limits(w.bin);
        json!({"axis": AXES[w.axis].name, "from": from, "to": to, "p": w.p, "by": format!("{:?}", w.by).to_lowercase()})
    });
    let b = m.budget(f.planar());
    let profiles: Vec<Value> = f
        .bodies
        .iter()
        .zip(&m.worth.bodies)
        .map(|(body, found)| {
            let one = |c: usize| json!({"channel": CHANNELS[c], "l1": found[c].map(|d| d.l1), "energy": found[c].map(|d| d.total)});
            json!({"body": body.name, "channels": [one(0), one(1), one(2)]})
        })
        .collect();
    let mut v = figures(&m.object);
    v["name"] = json!(m.name);
    v["summary"] = json!(m.info.map(|i| i.summary));
    v["source"] = json!(m.info.map(|i| i.source));
    v["valid"] = json!(m.info.map(|i| i.valid));
    v["image"] = json!(format!("{}.exr", m.name));
    v["whole_picture"] = figures(&m.whole);
    v["flip"] = json!(m.flip);
    v["cost"] = cost(&m.cost);
    v["speed"] = json!(m.speed);
    v["error_budget"] = json!({
        "profile_l1": b.profile_l1,
        "profile_energy": b.profile_energy,
        "geometry_energy": b.geometry_energy,
        "remaining_energy": b.remaining_energy,
        "profile_rms": b.profile_rms,
        "geometry_rms": b.geometry_rms,
        "remaining_square": b.remaining_square,
        "profiles": profiles,
    });
    v["fails"] = json!(fails);
    v["worst"] = json!(worst);
    v["verdict"] = json!(m.verdict());
    v["warnings"] = json!(m.warnings);
    v
}

/// What the numbers mean, for the JSON file and the report.
pub const DEFINITIONS: [(&str, &str); 9] = [
    (
        "pixels",
        "Figures are over the pixels that show a translucent body (a ray through the middle of each, straight through clear surfaces), and over the three channels.",
    ),
    ("energy", "Mean radiance of the model's picture over that of the exact one; its error is that of noise."),
    (
        "error",
        "Root of bias^2 = mean of ((A - R)(B - R) - S^2) / D. A and B are halves of the model's samples, R is the mean and S half the difference of the halves of the exact picture. No noise of either picture is in its expectation.",
    ),
    ("noise", "Root of the mean of (A - B)^2 / (4 D): the noise of the model's picture."),
    (
        "relMSE",
        "bias^2 + noise^2. D = (mean of R over the 24 pixels around)^2 + 0.01: a pixel's weight does not depend on its own noise. (`moonmilk diff` divides by the pixel's own square + 0.01.)",
    ),
    (
        "speed",
        "Noise^2 times processor time of the exact picture over the same of the model: how many times faster it is at equal noise.",
    ),
    (
        "profile",
        "What the model's R(r) does wrong on a half-space of the scene's media, against `tabulated`: L1 is the light at the wrong radius, energy the albedo; mean over bodies and channels as seen. As a picture: the model's against that of `tabulated`.",
    ),
    (
        "geometry",
        "The picture of `tabulated` against the exact one: bodies are taken for half-spaces, and light from all sides for light along the normal.",
    ),
    (
        "remaining",
        "What is left. Of the energy, (1 + profile)(1 + geometry)(1 + remaining) is the ratio; of squares, profile^2 + geometry^2 + remaining is the bias^2. For models that know directions it is what they gain or lose by it; for radial ones, how profile and geometry work together.",
    ),
];

/// What the search for the worst kind of place accepts.
pub fn significance() -> String {
    format!(
        "A kind of place is named as worst only if its bias^2, or where noise hides that the deviation of its mean, exceeds that of all other pixels at a significance of {SIGNIFICANCE} after Sidak over all bins of the model."
    )
}
