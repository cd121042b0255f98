//! Experiments as TOML.
//!
//! ```toml
//! unit = "mm"             # um, mm, cm or m: unit of every length below, and inverse unit of every coefficient (default mm)
//! photons = 1e6           # number of paths (default 1e6)
//! seed = 1                # of the random numbers (default 1)
//! n_above = 1.0           # indices around the stack (default 1)
//! n_below = 1.0
//! max_collisions = 1e6    # after which a path is given up and counted as unfinished (default 1e6)
//!
//! [source]                # default: pencil, angle 0
//! type = "pencil"         # pencil, lambertian, or point
//! angle = 0               # of a pencil: degrees from the normal, outside
//! # depth = 0.5           # of a point
//!
//! [[layer]]               # from the top downwards
//! name = "epidermis"      # default: its number
//! thickness = 0.1         # inf is allowed for the last one
//! n = 1.4
//! sigma_a = 0.2
//! sigma_s = 20
//! g = 0.8                 # Henyey-Greenstein (default 0), or instead one of
//! # phase = { type = "two-lobe", weight = 0.9, g1 = 0.9, g2 = -0.2 }
//! # phase = { type = "rayleigh" }, { type = "cornette-shanks", g = 0.8 }, { type = "von-mises-fisher", kappa = 5 }
//! # phase = { type = "table", cosines = [-1, 0, 1], values = [1, 1, 2] }    # linear between, normalised
//!
//! [tally]                 # what is recorded beside the totals; all optional
//! radius = { max = 5, bins = 50 }      # equal bins; with first = 0.01 bins of equal ratio from there
//! depth = { max = 2, bins = 40 }
//! angle = { bins = 9 }
//! plane = { max = 5, bins = 20 }
//! path = { max = 50, bins = 50 }
//! time = { max = 200, bins = 50 }      # ps
//! collisions = { bins = 16 }           # octaves: 1, 2-3, 4-7, ...
//! ```
//!
//! Unknown keys are errors, and every error has its place.

use std::ops::Range;

use moonmilk_lab::experiment::Unit;
use moonmilk_lab::{Bins, Error, Experiment, Law, LayerSpec, Source, Tallies};
use moonmilk_optics::phase::function::{PhaseFunction, Tabulated};
use serde::Deserialize;
use toml::Spanned;

use crate::pbrt::LoadError;

/// A number with its place; whole numbers are numbers too.
type Number = Spanned<f64>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    unit: Option<Spanned<String>>,
    photons: Option<Number>,
    seed: Option<Number>,
    n_above: Option<Number>,
    n_below: Option<Number>,
    max_collisions: Option<Number>,
    source: Option<SourceTable>,
    layer: Vec<LayerTable>,
    #[serde(default)]
    tally: TallyTable,
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
enum SourceTable {
    Pencil {
        #[serde(default)]
        angle: f64,
    },
    Lambertian {},
    Point {
        depth: f64,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LayerTable {
    name: Option<String>,
    thickness: Number,
    n: Number,
    sigma_a: Number,
    sigma_s: Number,
    g: Option<Number>,
    phase: Option<Spanned<PhaseTable>>,
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
enum PhaseTable {
    HenyeyGreenstein { g: f64 },
    TwoLobe { weight: f64, g1: f64, g2: f64 },
    Rayleigh {},
    CornetteShanks { g: f64 },
    VonMisesFisher { kappa: f64 },
    Table { cosines: Vec<f64>, values: Vec<f64> },
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct TallyTable {
    radius: Option<Spanned<BinsTable>>,
    depth: Option<Spanned<BinsTable>>,
    angle: Option<Spanned<CountTable>>,
    plane: Option<Spanned<BinsTable>>,
    path: Option<Spanned<BinsTable>>,
    time: Option<Spanned<BinsTable>>,
    collisions: Option<Spanned<CountTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BinsTable {
    #[serde(default)]
    first: f64,
    max: f64,
    bins: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CountTable {
    bins: usize,
}

/// Places of quantities, under the names that [`Error`] gives them.
struct Places<'a> {
    file: &'a str,
    text: &'a str,
    known: Vec<(String, Range<usize>)>,
}

impl Places<'_> {
    fn number(&mut self, name: &str, x: &Number) -> f64 {
        self.known.push((name.to_owned(), x.span()));
        *x.get_ref()
    }

    /// Returns a whole number, or the error that it is none.
    fn count(&mut self, name: &str, x: &Number, most: f64) -> Result<u64, LoadError> {
        let v = self.number(name, x);
        if v >= 0.0 && v <= most && v.fract() == 0.0 {
            return Ok(v as u64);
        }
        Err(self.at(x.span(), &format!("{name} = {v} is not a whole number in [0, {most}]"), None))
    }

    fn at(&self, span: Range<usize>, message: &str, help: Option<String>) -> LoadError {
        LoadError::at(self.file, self.text.as_bytes(), span, message, help)
    }

    /// Gives an error of the laboratory its place.
    fn locate(&self, e: &Error) -> LoadError {
        let span = match e {
            Error::Range { name, .. } => self.known.iter().find(|k| name.starts_with(&k.0)).map(|k| k.1.clone()),
            _ => None,
        };
        self.at(span.unwrap_or(0..0), &e.to_string(), None)
    }
}

/// Reads an experiment; `file` is its name in errors.
///
/// *Errors*: wrong TOML, unknown or missing keys, values outside their ranges, each with its place.
pub fn parse(file: &str, text: &str) -> Result<Experiment, LoadError> {
    let parsed: File = toml::from_str(text)
        .map_err(|e| LoadError::at(file, text.as_bytes(), e.span().unwrap_or(0..0), e.message(), None))?;
    let mut places = Places { file, text, known: Vec::new() };
    let mut layers = Vec::new();
    for (i, l) in parsed.layer.iter().enumerate() {
        let name = l.name.clone().unwrap_or_else(|| (i + 1).to_string());
        let place = format!("layer {} ({name}): ", i + 1);
        let mut of = |key: &str, x: &Number| places.number(&format!("{place}{key}"), x);
        let (thickness, n) = (of("thickness", &l.thickness), of("n", &l.n));
        let (sigma_a, sigma_s) = (of("sigma_a", &l.sigma_a), of("sigma_s", &l.sigma_s));
        let law = match (&l.g, &l.phase) {
            (Some(_), Some(phase)) => {
                return Err(places.at(phase.span(), "a layer has `g` or `phase`, not both", None));
            }
            (Some(g), None) => Law::HenyeyGreenstein(of("g", g) as f32),
            (None, None) => Law::HenyeyGreenstein(0.0),
            (None, Some(phase)) => {
                places.known.push((place.clone(), phase.span()));
                Law::from(match phase.get_ref() {
                    PhaseTable::HenyeyGreenstein { g } => PhaseFunction::HenyeyGreenstein(*g),
                    PhaseTable::TwoLobe { weight, g1, g2 } => {
                        PhaseFunction::TwoLobes { g_1: *g1, g_2: *g2, w: *weight }
                    }
                    PhaseTable::Rayleigh {} => PhaseFunction::Rayleigh,
                    PhaseTable::CornetteShanks { g } => PhaseFunction::CornetteShanks(*g),
                    PhaseTable::VonMisesFisher { kappa } => PhaseFunction::VonMisesFisher(*kappa),
                    PhaseTable::Table { cosines, values } => {
                        let table = Tabulated::new(cosines, values);
                        PhaseFunction::Tabulated(table.map_err(|e| places.at(phase.span(), &e.to_string(), None))?)
                    }
                })
            }
        };
        layers.push(LayerSpec { name, thickness, n, sigma_a, sigma_s, law });
    }
    let source = match parsed.source {
        None => Source::Pencil { angle: 0.0 },
        Some(SourceTable::Pencil { angle }) => Source::Pencil { angle: angle.to_radians() },
        Some(SourceTable::Lambertian {}) => Source::Lambertian,
        Some(SourceTable::Point { depth }) => Source::Point { depth },
    };
    let mut e = Experiment::new(layers, source);
    if let Some(unit) = &parsed.unit {
        let found = Unit::ALL.into_iter().find(|u| u.1 == unit.get_ref());
        e.unit = found
            .ok_or_else(|| {
                let message = format!("unknown unit \"{}\"", unit.get_ref());
                places.at(unit.span(), &message, Some("accepted: um, mm, cm, m".into()))
            })?
            .0;
    }
    if let Some(x) = &parsed.photons {
        e.photons = places.count("photons", x, 1e12)?;
    }
    if let Some(x) = &parsed.seed {
        e.seed = places.count("seed", x, 9_007_199_254_740_992.0)?;
    }
    if let Some(x) = &parsed.max_collisions {
        e.max_collisions = places.count("max_collisions", x, 4e9)? as u32;
    }
    if let Some(x) = &parsed.n_above {
        e.n_above = places.number("n_above", x);
    }
    if let Some(x) = &parsed.n_below {
        e.n_below = places.number("n_below", x);
    }
    let t = &parsed.tally;
    let mut bins = |name: &str, b: &Option<Spanned<BinsTable>>| {
        let b = b.as_ref()?;
        places.known.push((format!("{name}: "), b.span()));
        Some(Bins { first: b.get_ref().first, max: b.get_ref().max, bins: b.get_ref().bins })
    };
    e.tallies = Tallies {
        radius: bins("radius", &t.radius),
        depth: bins("depth", &t.depth),
        plane: bins("plane", &t.plane),
        path: bins("path", &t.path),
        time: bins("time", &t.time),
        angle: t.angle.as_ref().map(|b| b.get_ref().bins),
        collisions: t.collisions.as_ref().map(|b| b.get_ref().bins),
    };
    for (name, count) in [("angle: ", &t.angle), ("collisions: ", &t.collisions)] {
        places.known.extend(count.as_ref().map(|c| (name.to_owned(), c.span())));
    }
    e.check().map_err(|e| places.locate(&e))?;
    Ok(e)
}
