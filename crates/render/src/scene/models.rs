//! Which bodies a model of subsurface scattering renders.

use std::collections::BTreeMap;

use moonmilk_geometry::Bounds;
use moonmilk_optics::profile::Model;

use super::{Object, SceneError, Side};
use crate::bssrdf::Bank;
use crate::description::{MaterialKind, MediumKind, SceneDescription, Warning};
use crate::texture::property;

/// Gives profiles to all closed bodies around a homogeneous medium that scatters, and joins those of one set.
///
/// *Errors*: a medium that the model rejects.
pub(super) fn choose(
    model: &'static Model,
    d: &SceneDescription,
    objects: &mut [Object],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Bank>, SceneError> {
    let mut banks = Vec::new();
    let mut known = BTreeMap::new();
    let mut sets: BTreeMap<(u32, &str), u32> = BTreeMap::new();
    for (i, o) in objects.iter_mut().enumerate() {
        (o.set, o.common) = (i as u32, o.reach);
        let Some(g) = asymmetry(d, o, warnings) else {
            continue;
        };
        let key = (g.to_bits(), o.index.to_bits());
        let bank = match known.get(&key) {
            Some(&bank) => bank,
            None => {
                let made = Bank::new(model, f64::from(g), f64::from(o.index)).map_err(|e| SceneError::Model {
                    place: o.place.clone(),
                    name: o.name.to_string(),
                    model: model.info.name,
                    reason: e.to_string(),
                })?;
                if let Some(limit) = &made.limit {
                    let message = format!(
                        "{}: {limit}; where the albedo of scattering is outside, the nearest inside is used",
                        model.info.name
                    );
                    warnings.push(Warning { place: Some(o.place.clone()), message });
                }
                banks.push(made);
                known.insert(key, banks.len() as u32 - 1);
                banks.len() as u32 - 1
            }
        };
        o.bank = Some(bank);
        o.passable = o.alpha.is_some();
        // Bodies of one instance with one name act as one.
        if let (Some(set), Some(body)) = (&d.materials[o.material].set, o.body) {
            o.set = *sets.entry((body.instance, set)).or_insert(i as u32);
        }
    }
    let mut boxes: BTreeMap<u32, Bounds> = BTreeMap::new();
    for o in objects.iter() {
        let all = boxes.entry(o.set).or_insert(Bounds::EMPTY);
        *all = all.union(o.reach);
    }
    objects.iter_mut().for_each(|o| o.common = boxes[&o.set]);
    if banks.is_empty() {
        let message = format!("there is no closed body around a homogeneous medium for {} to render", model.info.name);
        warnings.push(Warning { place: None, message });
    }
    Ok(banks)
}

/// Returns the asymmetry of the medium in a body that a model can render.
fn asymmetry(d: &SceneDescription, o: &Object, warnings: &mut Vec<Warning>) -> Option<f32> {
    if o.body.is_none() || !o.yields {
        return None;
    }
    match o.inside {
        Side::Own => match d.materials[o.material].kind {
            MaterialKind::Subsurface { g, .. } => Some(g),
            _ => None,
        },
        Side::Medium(id) => match &d.media[id].kind {
            MediumKind::Homogeneous { g, sigma_s, .. } => {
                property(sigma_s).is_ok_and(|s| s.max_value() > 0.0).then_some(*g)
            }
            _ => {
                let message = format!("{}: its medium differs from place to place: walked through exactly", o.name);
                warnings.push(Warning { place: Some(o.place.clone()), message });
                None
            }
        },
        Side::Same | Side::Vacuum => None,
    }
}
