//! Which bodies and open surfaces a model of subsurface scattering renders.

use std::collections::BTreeMap;

use moonmilk_geometry::Bounds;
use moonmilk_optics::profile::{Model, find};

use super::{OPEN_MODEL, Object, SceneError, Side};
use crate::bssrdf::Bank;
use crate::description::{MaterialId, MaterialKind, MediumKind, SceneDescription, Warning};
use crate::texture::property;

/// Returns the model that renders open meshes where walks render the rest.
pub(super) fn for_open() -> &'static Model {
    find(OPEN_MODEL).expect("a registered model")
}

/// Gives profiles to all bodies and open surfaces around a homogeneous medium that scatters, or to open ones alone, and joins those of one set.
///
/// *Errors*: a medium that the model rejects.
pub(super) fn choose(
    model: &'static Model,
    open_alone: bool,
    d: &SceneDescription,
    objects: &mut [Object],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Bank>, SceneError> {
    let mut banks = Vec::new();
    let mut known = BTreeMap::new();
    let mut sets: BTreeMap<(u32, bool, &str), u32> = BTreeMap::new();
    for (i, o) in objects.iter_mut().enumerate() {
        (o.set, o.common) = (i as u32, o.reach);
        let Some(body) = o.open.or(o.body.filter(|_| o.yields && !open_alone)) else {
            continue;
        };
        let g = match asymmetry(d, o.material, o.inside) {
            Ok(Some(g)) => g,
            Ok(None) => continue,
            Err(Uneven) => {
                let message = format!("{}: its medium differs from place to place: walked through exactly", o.name);
                warnings.push(Warning { place: Some(o.place.clone()), message });
                continue;
            }
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
        // Bodies of one instance with one name act as one, and so do open surfaces.
        if let Some(set) = &d.materials[o.material].set {
            o.set = *sets.entry((body.instance, o.open.is_some(), set)).or_insert(i as u32);
        }
    }
    let mut boxes: BTreeMap<u32, Bounds> = BTreeMap::new();
    for o in objects.iter() {
        let all = boxes.entry(o.set).or_insert(Bounds::EMPTY);
        *all = all.union(o.reach);
    }
    objects.iter_mut().for_each(|o| o.common = boxes[&o.set]);
    if banks.is_empty() && !open_alone {
        let message = format!("there is no body around a homogeneous medium for {} to render", model.info.name);
        warnings.push(Warning { place: None, message });
    }
    Ok(banks)
}

/// A medium that differs from place to place, which no model knows.
pub(super) struct Uneven;

/// Returns the asymmetry of a medium that a model can render; `None` if there is none or it does not scatter.
pub(super) fn asymmetry(d: &SceneDescription, material: MaterialId, inside: Side) -> Result<Option<f32>, Uneven> {
    match inside {
        Side::Own => Ok(match d.materials[material].kind {
            MaterialKind::Subsurface { g, .. } => Some(g),
            _ => None,
        }),
        Side::Medium(id) => match &d.media[id].kind {
            MediumKind::Homogeneous { g, sigma_s, .. } => {
                Ok(property(sigma_s).is_ok_and(|s| s.max_value() > 0.0).then_some(*g))
            }
            _ => Err(Uneven),
        },
        Side::Same | Side::Vacuum => Ok(None),
    }
}
