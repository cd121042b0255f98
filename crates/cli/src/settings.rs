//! What must agree between a checkpoint and the run that resumes it.

use moonmilk_core::wavelengths::WavelengthMode;
use moonmilk_io::pbrt::Loaded;
use moonmilk_render::film::Aov;
use moonmilk_render::integrator::Integrator;
use serde_json::{Map, Value, json};

use crate::args::Open;
use crate::budget::Budget;

/// Key of the budget in a checkpoint: recorded, but free to change.
const BUDGET: &str = "budget";

/// The settings that decide the value of every sample, as they stand in pictures and checkpoints.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings(Map<String, Value>);

impl Settings {
    /// Returns the settings of a render.
    pub fn new(
        loaded: &Loaded,
        integrator: &Integrator,
        subsurface: &str,
        open: Option<Open>,
        crop: [u32; 4],
        aovs: &[Aov],
    ) -> Self {
        let wavelengths = match integrator.wavelengths {
            WavelengthMode::Hero => "hero".into(),
            WavelengthMode::Rgb => "rgb".into(),
            WavelengthMode::Mono(nm) => format!("{nm} nm"),
        };
        let hash: String = loaded.hash.iter().map(|b| format!("{b:02x}")).collect();
        let entries = [
            ("version", json!(env!("CARGO_PKG_VERSION"))),
            ("scene", json!(hash)),
            ("seed", json!(integrator.seed.to_string())),
            ("wavelengths", json!(wavelengths)),
            ("subsurface", json!(subsurface)),
            ("walk", json!(integrator.policy.name())),
            ("max_depth", json!(integrator.max_depth.map_or_else(|| "none".into(), |d| d.to_string()))),
            ("open", json!(open.map_or_else(|| "refuse".into(), |o| format!("{o:?}").to_lowercase()))),
            ("crop", json!(crop)),
            ("aov", json!(aovs.iter().map(|a| a.name()).collect::<Vec<_>>())),
            ("factor", json!(loaded.scene.film.imaging_ratio)),
        ];
        Self(entries.into_iter().map(|(k, v)| (k.to_owned(), v)).collect())
    }

    /// Returns the settings and the budget of a checkpoint's text; nothing if it is not such.
    pub fn parse(text: &str) -> Option<(Self, Option<Budget>)> {
        let mut map: Map<String, Value> = serde_json::from_str(text).ok()?;
        let budget = map.remove(BUDGET).and_then(|b| Budget::parse(b.as_str()?));
        Some((Self(map), budget))
    }

    /// Returns the text for a checkpoint.
    pub fn record(&self, budget: &Budget) -> String {
        let mut map = self.0.clone();
        map.insert(BUDGET.into(), json!(budget.to_string()));
        Value::Object(map).to_string()
    }

    /// Returns the text for a checkpoint, with more entries of an object that are not compared.
    pub fn record_with(&self, budget: &Budget, more: &Value) -> String {
        let mut map = self.0.clone();
        map.insert(BUDGET.into(), json!(budget.to_string()));
        map.extend(more.as_object().cloned().unwrap_or_default());
        Value::Object(map).to_string()
    }

    /// Returns the text for a picture.
    pub fn text(&self) -> String {
        Value::Object(self.0.clone()).to_string()
    }

    /// Returns a setting that is text.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key)?.as_str()
    }

    /// Returns the factor on the finished picture.
    pub fn factor(&self) -> f32 {
        self.0.get("factor").and_then(Value::as_f64).unwrap_or(1.0) as f32
    }

    /// Returns what differs from other settings, one phrase each.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let keys: std::collections::BTreeSet<&String> = self.0.keys().chain(other.0.keys()).collect();
        let show = |v: Option<&Value>| v.map_or_else(|| "absent".into(), ToString::to_string);
        keys.into_iter()
            .filter(|k| self.0.get(*k) != other.0.get(*k))
            .map(|k| match k.as_str() {
                // A hash tells nobody anything.
                "scene" => "the scene (it or a file it uses has changed)".into(),
                _ => format!("{k} is {}, was {}", show(self.0.get(k)), show(other.0.get(k))),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_is_recorded_but_not_compared() {
        let s = Settings::parse(r#"{"seed":"3","factor":0.1}"#).expect("settings").0;
        let (back, budget) = Settings::parse(&s.record(&Budget::Samples(9))).expect("settings");
        assert_eq!((&back, budget), (&s, Some(Budget::Samples(9))));
        // The nearest f64 of an f32 comes back as that f32.
        assert_eq!((s.factor(), s.get("seed")), (0.1, Some("3")));
        let other = Settings::parse(r#"{"seed":"4","factor":0.1,"scene":"00"}"#).expect("settings").0;
        assert_eq!(s.differences(&other), ["the scene (it or a file it uses has changed)", "seed is \"3\", was \"4\""]);
    }
}
