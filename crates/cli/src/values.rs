//! Values on the command line: each parser says what it would have accepted.

use std::time::Duration;

use moonmilk_core::wavelengths::WavelengthMode;
use moonmilk_optics::profile::MODELS;
use moonmilk_render::film::Aov;
use moonmilk_render::integrator::Policy;
use moonmilk_render::walks::WALKS;

use crate::args::{AovList, MaxDepth, Unit};

/// Longest time that is accepted \[s\]: a year.
const LONGEST: f64 = 3.2e7;

/// Names of the ways to solve the inside that the design has and this version lacks.
const PLANNED: [&str; 1] = ["diffusion"];

/// Returns the names of all ways to solve the inside that this version has.
pub fn subsurface_names() -> impl Iterator<Item = &'static str> + Clone {
    WALKS.iter().map(|w| w.info.name).chain(MODELS.iter().map(|m| m.info.name))
}

/// Names of ways to solve the inside; `None` stands for all.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SubsurfaceList(pub Option<Vec<String>>);

/// Returns names separated by commas, each once, or `all`.
pub fn subsurface_list(s: &str) -> Result<SubsurfaceList, String> {
    if s == "all" {
        return Ok(SubsurfaceList(None));
    }
    let mut names = Vec::new();
    for name in s.split(',') {
        let name = subsurface(name.trim()).map_err(|e| format!("{e}; or all"))?;
        if !names.contains(&name) {
            names.push(name);
        }
    }
    Ok(SubsurfaceList(Some(names)))
}

/// Returns the name of a way to solve the inside: a walk, or a model of the registry.
pub fn subsurface(s: &str) -> Result<String, String> {
    let available = subsurface_names();
    if available.clone().any(|name| name == s) {
        return Ok(s.into());
    }
    let list = available.clone().collect::<Vec<_>>().join(", ");
    if PLANNED.contains(&s) {
        return Err(format!("\"{s}\" is planned but not in this version; available: {list}"));
    }
    let nearest = moonmilk_core::spectra::nearest(s, available.chain(PLANNED));
    Err(format!("there is no \"{s}\"; did you mean \"{nearest}\"? (available: {list})"))
}

/// Returns the policy of a name.
pub fn walk(s: &str) -> Result<Policy, String> {
    if let Some(policy) = Policy::ALL.into_iter().find(|p| p.name() == s) {
        return Ok(policy);
    }
    let names = Policy::ALL.map(Policy::name);
    Err(format!("there is no \"{s}\"; did you mean \"{}\"? (available: {})", nearest(s, &names), names.join(", ")))
}

/// Returns the known name that shares most with s.
fn nearest(s: &str, names: &[&'static str]) -> &'static str {
    moonmilk_core::spectra::nearest(s, names.iter().copied())
}

/// Returns the seconds of a number with an optional unit.
fn seconds(s: &str) -> Result<f64, String> {
    let (number, unit) = s.split_at(s.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(s.len()));
    let factor = match unit {
        "" | "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        "ms" => 1e-3,
        _ if number.is_empty() => return Err("give a time, e.g. 90s, 5m, 1h".into()),
        _ => return Err(format!("unit \"{unit}\" is none of ms, s, m, h")),
    };
    number.parse::<f64>().map(|x| x * factor).map_err(|_| "give a time, e.g. 90s, 5m, 1h".into())
}

/// Returns a positive time; seconds where no unit is given.
pub fn duration(s: &str) -> Result<Duration, String> {
    match seconds(s)? {
        x if x > 0.0 && x < LONGEST => Ok(Duration::from_secs_f64(x)),
        _ => Err("give a positive time of at most a year, e.g. 90s, 5m, 1h".into()),
    }
}

/// Returns a time or zero; seconds where no unit is given.
pub fn interval(s: &str) -> Result<Duration, String> {
    match seconds(s)? {
        x if x < LONGEST => Ok(Duration::from_secs_f64(x)),
        _ => Err("give a time of at most a year, e.g. 20, 0.5, 2m; or 0".into()),
    }
}

/// Returns a positive share, given as such or in per cent.
pub fn fraction(s: &str) -> Result<f64, String> {
    let (number, factor) = s.strip_suffix('%').map_or((s, 1.0), |n| (n, 0.01));
    match number.trim().parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x * factor),
        _ => Err("give a positive error, e.g. 1% or 0.01".into()),
    }
}

/// Returns a treatment of colour.
pub fn wavelengths(s: &str) -> Result<WavelengthMode, String> {
    match s {
        "hero" => Ok(WavelengthMode::Hero),
        "rgb" => Ok(WavelengthMode::Rgb),
        "mono" => Ok(WavelengthMode::MONO),
        _ => match s.parse::<f32>() {
            Ok(nm) if (380.0..=780.0).contains(&nm) => Ok(WavelengthMode::Mono(nm)),
            Ok(nm) => Err(format!("wavelength {nm} nm is outside 380..780")),
            Err(_) => Err("give hero, rgb, mono, or one wavelength in nm".into()),
        },
    }
}

fn numbers<const N: usize>(s: &str) -> Option<[u32; N]> {
    let v: Vec<u32> = s.split(',').map(|x| x.trim().parse().ok()).collect::<Option<_>>()?;
    v.try_into().ok()
}

/// Returns x0, x1, y0, y1.
pub fn crop(s: &str) -> Result<[u32; 4], String> {
    match numbers(s) {
        Some([x0, x1, y0, y1]) if x0 < x1 && y0 < y1 => Ok([x0, x1, y0, y1]),
        _ => Err("give four pixel numbers x0,x1,y0,y1 with x0 < x1 and y0 < y1".into()),
    }
}

/// Returns x, y.
pub fn pixel(s: &str) -> Result<[u32; 2], String> {
    numbers(s).ok_or_else(|| "give two pixel numbers X,Y".into())
}

/// Returns first sample and end.
pub fn range(s: &str) -> Result<(u64, u64), String> {
    let parse = || {
        let (a, b) = s.split_once("..")?;
        let (a, b) = (a.parse().ok()?, b.parse().ok()?);
        (a < b).then_some((a, b))
    };
    parse().ok_or_else(|| "give a range of sample numbers A..B with A < B".into())
}

/// Returns layers, each once, in their fixed order.
pub fn aovs(s: &str) -> Result<AovList, String> {
    if s == "all" {
        return Ok(AovList(Aov::ALL.to_vec()));
    }
    let names: Vec<&str> = Aov::ALL.iter().map(|a| a.name()).collect();
    let find = |name: &str| {
        Aov::ALL.into_iter().find(|a| a.name() == name).ok_or_else(|| {
            format!(
                "there is no layer \"{name}\"; did you mean \"{}\"? ({}, all)",
                nearest(name, &names),
                names.join(", ")
            )
        })
    };
    let mut list = s.split(',').map(|n| find(n.trim())).collect::<Result<Vec<_>, _>>()?;
    list.sort_by_key(|a| Aov::ALL.iter().position(|b| a == b));
    list.dedup();
    Ok(AovList(list))
}

/// Units of length that scenes come in.
const UNITS: [&str; 7] = ["nm", "um", "mm", "cm", "m", "in", "ft"];

/// Returns a unit of length.
pub fn unit(s: &str) -> Result<Unit, String> {
    let found = UNITS.into_iter().find(|u| *u == s).map(|name| Unit { name });
    found.ok_or_else(|| format!("`{s}` is no unit of length; accepted: {}", UNITS.join(", ")))
}

/// Returns a limit of the number of bounces.
pub fn max_depth(s: &str) -> Result<MaxDepth, String> {
    if s == "scene" {
        return Ok(MaxDepth::Scene);
    }
    s.parse().map(MaxDepth::Count).map_err(|_| "give a number of bounces, or scene".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_checked_and_units_understood() {
        assert_eq!(duration("1.5m"), Ok(Duration::from_secs(90)));
        for bad in ["5d", "-1", "", "0", "1e9h", "s", "1..2"] {
            assert!(duration(bad).is_err(), "{bad}");
        }
        assert_eq!((interval("0"), interval("0.25")), (Ok(Duration::ZERO), Ok(Duration::from_millis(250))));
        assert!(interval("-1").is_err() && interval("never").is_err());
        assert!((fraction("2%").expect("valid") - 0.02).abs() < 1e-15);
        assert!(fraction("0").is_err() && crop("1,1,0,2").is_err() && range("5..5").is_err());
        let unknown = subsurface("photn-beam").expect_err("unknown");
        let start = "there is no \"photn-beam\"; did you mean \"photon-beam\"? (available: path, similarity-1, similarity-3, hybrid, jump-shifted, gaussian, ";
        assert!(unknown.starts_with(start), "{unknown}");
        assert!(subsurface("diffusion").expect_err("planned").contains("planned"));
        assert_eq!(subsurface("photon-beam").as_deref(), Ok("photon-beam"));
        assert_eq!(aovs("depth,albedo").expect("valid").0, vec![Aov::Albedo, Aov::Depth]);
    }
}
