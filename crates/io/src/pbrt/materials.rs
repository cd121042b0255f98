//! `Material` and `MakeNamedMaterial`.

use std::collections::HashMap;

use moonmilk_core::named::NAMES;
use moonmilk_render::description::{
    ConductorColor, HairAbsorption, IndexSpectrum, MaterialDescription, MaterialId, MaterialKind, Roughness,
    SpectrumDescription, SubsurfaceMedium,
};

use super::context::Context;
use super::lexer::Spot;
use super::media::DEFAULT_COEFFICIENTS;
use super::named_media;
use super::params::{Params, SPECTRUM_TEXTURE, Type, did_you_mean};
use super::spectra::{self, Role};
use super::textures::Textures;

/// A material, waiting for the end of the file.
pub(crate) struct MaterialEntity {
    /// Name of a named material.
    pub name: Option<String>,
    /// Type; of a named material its parameter `type`.
    pub kind: Option<(String, Spot)>,
    pub params: Params,
}

const KINDS: [&str; 14] = [
    "coatedconductor",
    "coateddiffuse",
    "conductor",
    "dielectric",
    "diffuse",
    "diffusetransmission",
    "hair",
    "interface",
    "measured",
    "mix",
    "none",
    "subsurface",
    "thindielectric",
    "",
];

/// What to write instead of a material of pbrt-v3.
fn former(kind: &str) -> Option<&'static str> {
    Some(match kind {
        "matte" => "write `diffuse` with `reflectance`",
        "plastic" | "substrate" => "write `coateddiffuse` with `reflectance` and `roughness`",
        "metal" => "write `conductor` with `eta`, `k` and `roughness`",
        "mirror" => "write `conductor` with `rgb reflectance` and `float roughness` 0",
        "glass" => "write `dielectric` with `float eta`",
        "translucent" => "write `diffusetransmission` with `reflectance` and `transmittance`",
        "uber" | "disney" | "fourier" => "choose one of `coateddiffuse`, `conductor`, `dielectric`, `diffuse`",
        "kdsubsurface" => "write `subsurface` with `reflectance` and `mfp`",
        _ => return None,
    })
}

/// Makes all materials: the list in the order given, and the numbers of the named ones.
pub(crate) fn build(
    cx: &mut Context,
    textures: &mut Textures,
    entities: Vec<MaterialEntity>,
) -> (Vec<MaterialDescription>, HashMap<String, MaterialId>) {
    let mut names: HashMap<String, MaterialId> = HashMap::new();
    for (id, entity) in entities.iter().enumerate() {
        if let Some(name) = &entity.name
            && names.insert(name.clone(), id).is_some()
        {
            cx.error(entity.params.spot, format!("material `{name}` is defined twice"));
        }
    }
    let list = entities.into_iter().enumerate().map(|(id, entity)| make(cx, textures, &names, id, entity)).collect();
    (list, names)
}

fn make(
    cx: &mut Context,
    textures: &mut Textures,
    names: &HashMap<String, MaterialId>,
    id: MaterialId,
    entity: MaterialEntity,
) -> MaterialDescription {
    let MaterialEntity { name, kind, params: mut p } = entity;
    let place = cx.place(p.spot);
    let kind = match kind {
        Some(kind) => Some(kind),
        None => {
            let given = p.string(cx, "type");
            if given.is_none() && !p.has("type") {
                cx.error_help(
                    p.spot,
                    format!("{} needs `string type`", p.entity),
                    format!("accepted: {}", KINDS[..13].join(", ")),
                );
            }
            given
        }
    };
    let mut checked = true;
    let kind = match kind {
        None => None,
        Some((kind, spot)) => {
            if !KINDS.contains(&kind.as_str()) {
                let help = match former(&kind) {
                    Some(advice) => format!("pbrt-v3 syntax: {advice}"),
                    None => did_you_mean(&kind, &KINDS[..13], "accepted"),
                };
                cx.error_help(spot, format!("`{kind}` is no type of material"), help);
                checked = false;
                None
            } else {
                p.entity = format!("material \"{kind}\"");
                kind_of(cx, textures, names, id, &mut p, &kind, spot)
            }
        }
    };
    let displacement = textures.float_or_none(cx, &mut p, "displacement");
    let normal_map = p
        .string(cx, "normalmap")
        .filter(|(path, _)| !path.is_empty())
        .and_then(|(path, spot)| textures.images.load(cx, &path, spot, "linear"));
    let set = p.string(cx, "moonmilk.set").map(|s| s.0);
    let priority = p.integer_or_none(cx, "moonmilk.priority");
    let mapped = displacement.is_some() || normal_map.is_some();
    let (displacement, normal_map) = if mapped && matches!(kind, Some(MaterialKind::Mix { .. })) {
        cx.warn(
            p.spot,
            "a mix has no surface of its own, as in pbrt: give `displacement` and `normalmap` to its parts",
        );
        (None, None)
    } else {
        if displacement.is_some() && normal_map.is_some() {
            cx.warn(p.spot, "`displacement` is not used beside `normalmap`, as in pbrt");
        }
        (displacement.filter(|_| normal_map.is_none()), normal_map)
    };
    // pbrt does not look at the parameters of an interface.
    if checked && !matches!(kind, Some(MaterialKind::Interface)) {
        p.finish(cx);
    }
    let kind = kind.unwrap_or_else(|| MaterialKind::StandIn {
        reflectance: textures.constant_spectrum(SpectrumDescription::Constant(0.5)),
    });
    MaterialDescription { name, place, kind, displacement, normal_map, set, priority }
}

fn kind_of(
    cx: &mut Context,
    t: &mut Textures,
    names: &HashMap<String, MaterialId>,
    id: MaterialId,
    p: &mut Params,
    kind: &str,
    spot: Spot,
) -> Option<MaterialKind> {
    use SpectrumDescription::Constant;
    Some(match kind {
        "" | "none" | "interface" => MaterialKind::Interface,
        "diffuse" => {
            MaterialKind::Diffuse { reflectance: t.spectrum(cx, p, "reflectance", Role::Albedo, Constant(0.5)) }
        }
        "diffusetransmission" => {
            p.ignore(&[("remaproughness", &[Type::Bool])]);
            MaterialKind::DiffuseTransmission {
                reflectance: t.spectrum(cx, p, "reflectance", Role::Albedo, Constant(0.25)),
                transmittance: t.spectrum(cx, p, "transmittance", Role::Albedo, Constant(0.25)),
                scale: p.float(cx, "scale", 1.0),
            }
        }
        "coateddiffuse" => {
            p.ignore(&[("twosided", &[Type::Bool])]);
            MaterialKind::CoatedDiffuse {
                reflectance: t.spectrum(cx, p, "reflectance", Role::Albedo, Constant(0.5)),
                roughness: roughness(cx, t, p, ["roughness", "uroughness", "vroughness"]),
                thickness: t.float(cx, p, "thickness", 0.01),
                eta: index(cx, p, "eta", 1.5),
                g: t.float(cx, p, "g", 0.0),
                albedo: t.spectrum(cx, p, "albedo", Role::Albedo, Constant(0.0)),
                max_depth: p.integer(cx, "maxdepth", 10, 0),
                samples: p.integer(cx, "nsamples", 1, 1),
            }
        }
        "coatedconductor" => MaterialKind::CoatedConductor {
            interface_roughness: roughness(
                cx,
                t,
                p,
                ["interface.roughness", "interface.uroughness", "interface.vroughness"],
            ),
            thickness: t.float(cx, p, "thickness", 0.01),
            interface_eta: index(cx, p, "interface.eta", 1.5),
            g: t.float(cx, p, "g", 0.0),
            albedo: t.spectrum(cx, p, "albedo", Role::Albedo, Constant(0.0)),
            conductor: conductor(cx, t, p, "conductor.eta", "conductor.k"),
            conductor_roughness: roughness(
                cx,
                t,
                p,
                ["conductor.roughness", "conductor.uroughness", "conductor.vroughness"],
            ),
            max_depth: p.integer(cx, "maxdepth", 10, 0),
            samples: p.integer(cx, "nsamples", 1, 1),
        },
        "conductor" => MaterialKind::Conductor {
            color: conductor(cx, t, p, "eta", "k"),
            roughness: roughness(cx, t, p, ["roughness", "uroughness", "vroughness"]),
        },
        "dielectric" => MaterialKind::Dielectric {
            eta: index(cx, p, "eta", 1.5),
            roughness: roughness(cx, t, p, ["roughness", "uroughness", "vroughness"]),
        },
        "thindielectric" => MaterialKind::ThinDielectric { eta: index(cx, p, "eta", 1.5) },
        "subsurface" => subsurface(cx, t, p)?,
        "mix" => mix(cx, t, names, id, p)?,
        "hair" => hair(cx, t, p),
        _ => {
            p.ignore(&[("filename", &[Type::String])]);
            cx.warn(spot, format!("materials of type `{kind}` are not supported yet: a diffuse grey is used"));
            MaterialKind::StandIn { reflectance: t.constant_spectrum(Constant(0.5)) }
        }
    })
}

/// The colour of hair in one of four forms, of which the first given counts; pbrt's defaults.
fn hair(cx: &mut Context, t: &mut Textures, p: &mut Params) -> MaterialKind {
    let sigma_a = t.spectrum_or_none(cx, p, "sigma_a", Role::Unbounded);
    let reflectance = t.spectrum_or_none(cx, p, "reflectance", Role::Albedo);
    let reflectance = reflectance.or(t.spectrum_or_none(cx, p, "color", Role::Albedo));
    let eumelanin = t.float_or_none(cx, p, "eumelanin");
    let pheomelanin = t.float_or_none(cx, p, "pheomelanin");
    // Say which of the parameters a more specific form overrides.
    let by = if sigma_a.is_some() { "sigma_a" } else { "reflectance" };
    let others: &[&str] = match (sigma_a, reflectance) {
        (Some(_), _) => &["reflectance", "color", "eumelanin", "pheomelanin"],
        (None, Some(_)) => &["eumelanin", "pheomelanin"],
        _ => &[],
    };
    for &name in others.iter().filter(|n| p.has(n)) {
        cx.warn(p.spot_of(name), format!("`{name}` is not used: `{by}` determines the colour of the hair"));
    }
    let absorption = match (sigma_a, reflectance) {
        (Some(s), _) => HairAbsorption::Coefficient(s),
        (None, Some(r)) => HairAbsorption::Reflectance(r),
        (None, None) => {
            let default = if eumelanin.is_none() && pheomelanin.is_none() { 1.3 } else { 0.0 };
            HairAbsorption::Pigments {
                eumelanin: eumelanin.unwrap_or_else(|| t.constant(default)),
                pheomelanin: pheomelanin.unwrap_or_else(|| t.constant(0.0)),
            }
        }
    };
    MaterialKind::Hair {
        absorption,
        eta: t.float(cx, p, "eta", 1.55),
        beta_m: t.float(cx, p, "beta_m", 0.3),
        beta_n: t.float(cx, p, "beta_n", 0.3),
        alpha: t.float(cx, p, "alpha", 2.0),
    }
}

/// Roughness under three names: both axes, first axis, second axis.
fn roughness(cx: &mut Context, t: &mut Textures, p: &mut Params, [both, u, v]: [&'static str; 3]) -> Roughness {
    let given = t.float_or_none(cx, p, both);
    let both = given.unwrap_or_else(|| t.constant(0.0));
    Roughness {
        u: t.float_or_none(cx, p, u).unwrap_or(both),
        v: t.float_or_none(cx, p, v).unwrap_or(both),
        remap: p.bool(cx, "remaproughness", true),
    }
}

/// A dielectric's index: a number or a spectrum.
fn index(cx: &mut Context, p: &mut Params, name: &'static str, default: f32) -> IndexSpectrum {
    let types = &[Type::Float, Type::Rgb, Type::Spectrum, Type::Blackbody];
    let Some(param) = p.find(name, types).cloned() else {
        return SpectrumDescription::Constant(default);
    };
    if param.ty != Type::Float {
        return spectra::describe(cx, &param, Role::Unbounded).unwrap_or(SpectrumDescription::Constant(default));
    }
    SpectrumDescription::Constant(p.float_in(cx, name, default, |eta| eta > 0.0, "(0, inf)"))
}

fn conductor(cx: &mut Context, t: &mut Textures, p: &mut Params, eta: &'static str, k: &'static str) -> ConductorColor {
    let reflectance = t.spectrum_or_none(cx, p, "reflectance", Role::Albedo);
    let given = [t.spectrum_or_none(cx, p, eta, Role::Unbounded), t.spectrum_or_none(cx, p, k, Role::Unbounded)];
    if let Some(reflectance) = reflectance {
        if p.has(eta) || p.has(k) {
            let spot = p.spot_of("reflectance");
            cx.error_help(
                spot,
                format!("{} has both `reflectance` and an index", p.entity),
                format!("give either `reflectance` or `{eta}` and `{k}`"),
            );
        }
        return ConductorColor::Reflectance(reflectance);
    }
    let copper = |part: &str| {
        SpectrumDescription::Named(
            NAMES.iter().find(|n| n.ends_with(part)).map_or_else(String::new, |n| (*n).to_owned()),
        )
    };
    let [eta, k] = given;
    ConductorColor::Index {
        eta: eta.unwrap_or_else(|| t.constant_spectrum(copper("-Cu-eta"))),
        k: k.unwrap_or_else(|| t.constant_spectrum(copper("-Cu-k"))),
    }
}

/// The four forms of pbrt's `subsurface`: by name; coefficients; reflectance and mean free path; defaults.
fn subsurface(cx: &mut Context, t: &mut Textures, p: &mut Params) -> Option<MaterialKind> {
    use SpectrumDescription::{Constant, Rgb};
    let mut g = p.float_in(cx, "g", 0.0, |g| g > -1.0 && g < 1.0, "(-1, 1)");
    let name = p.string(cx, "name").filter(|(name, _)| !name.is_empty());
    let sigma_a = t.spectrum_or_none(cx, p, "sigma_a", Role::Unbounded);
    let sigma_s = t.spectrum_or_none(cx, p, "sigma_s", Role::Unbounded);
    let reflectance = t.spectrum_or_none(cx, p, "reflectance", Role::Albedo);
    let mfp = t.spectrum_or_none(cx, p, "mfp", Role::Unbounded);
    // Say which of the parameters a more specific form overrides.
    let overridden = |cx: &mut Context, p: &Params, by: &str, names: &[&str]| {
        for &name in names.iter().filter(|n| p.has(n)) {
            cx.warn(p.spot_of(name), format!("`{name}` is not used: {by} determines the medium"));
        }
    };
    let medium = if let Some((name, spot)) = name {
        let Some((a, s)) = named_media::find(&name) else {
            let help = did_you_mean(&name, &named_media::names(), "accepted");
            cx.error_help(spot, format!("`{name}` is no named medium"), help);
            return None;
        };
        overridden(cx, p, "`name`", &["sigma_a", "sigma_s", "reflectance", "mfp"]);
        if g != 0.0 {
            let spot = p.spot_of("g");
            cx.warn(
                spot,
                format!("g = {g} is not used: named media are given by reduced coefficients, which go with g = 0"),
            );
            g = 0.0;
        }
        SubsurfaceMedium::Coefficients { sigma_a: t.constant_spectrum(Rgb(a)), sigma_s: t.constant_spectrum(Rgb(s)) }
    } else if p.has("sigma_a") || p.has("sigma_s") {
        for (one, other) in [("sigma_a", "sigma_s"), ("sigma_s", "sigma_a")] {
            if !p.has(other) && p.find(one, SPECTRUM_TEXTURE).is_some() {
                let spot = p.spot_of(one);
                cx.error_help(
                    spot,
                    format!("`{one}` is given without `{other}`"),
                    "give both, or `reflectance` and `mfp`, or `string name`",
                );
            }
        }
        overridden(cx, p, "`sigma_a` and `sigma_s`", &["reflectance", "mfp"]);
        let (Some(sigma_a), Some(sigma_s)) = (sigma_a, sigma_s) else {
            return Some(stand_in(t));
        };
        SubsurfaceMedium::Coefficients { sigma_a, sigma_s }
    } else if let Some(reflectance) = reflectance {
        SubsurfaceMedium::Reflectance { reflectance, mfp: mfp.unwrap_or_else(|| t.constant_spectrum(Constant(1.0))) }
    } else {
        if mfp.is_some() {
            let spot = p.spot_of("mfp");
            cx.warn(spot, "`mfp` is not used without `reflectance`: pbrt's default medium is taken");
        }
        let (a, s) = DEFAULT_COEFFICIENTS;
        SubsurfaceMedium::Coefficients { sigma_a: t.constant_spectrum(Rgb(a)), sigma_s: t.constant_spectrum(Rgb(s)) }
    };
    Some(MaterialKind::Subsurface {
        medium,
        scale: p.float_in(cx, "scale", 1.0, |s| s >= 0.0, "[0, inf)"),
        g,
        eta: p.float_in(cx, "eta", 1.33, |eta| eta > 0.0, "(0, inf)"),
        roughness: roughness(cx, t, p, ["roughness", "uroughness", "vroughness"]),
    })
}

fn stand_in(t: &mut Textures) -> MaterialKind {
    MaterialKind::StandIn { reflectance: t.constant_spectrum(SpectrumDescription::Constant(0.5)) }
}

fn mix(
    cx: &mut Context,
    t: &mut Textures,
    names: &HashMap<String, MaterialId>,
    id: MaterialId,
    p: &mut Params,
) -> Option<MaterialKind> {
    let amount = t.float(cx, p, "amount", 0.5);
    let given = p.strings("materials");
    let spot = p.spot_of("materials");
    let [a, b] = given.as_slice() else {
        cx.error(spot, format!("a mix takes the names of 2 materials, {} given", given.len()));
        return None;
    };
    let mut find = |name: &String| match names.get(name) {
        // Only what is defined above may be mixed; so no mixture can contain itself.
        Some(&found) if found < id => Some(found),
        Some(_) => {
            cx.error(spot, format!("material `{name}` must be defined above the mix that uses it"));
            None
        }
        None if cx.include_missing => None,
        None => {
            let mut known: Vec<&str> = names.keys().map(String::as_str).collect();
            known.sort_unstable();
            known.truncate(20);
            cx.error_help(spot, format!("no material `{name}` is defined"), did_you_mean(name, &known, "defined"));
            None
        }
    };
    Some(MaterialKind::Mix { materials: [find(a)?, find(b)?], amount })
}
