//! What an experiment is: plain data, checked before it runs.

use moonmilk_core::{Spectrum, Vec3};
use moonmilk_walk::{Medium, PhaseFunction, Stack};

use crate::error::{Error, within};
use crate::law::Law;

/// Light into a stack of plane layers.
///
/// Lengths are in any one unit, coefficients in its inverse; `unit` only labels results and gives times their scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// Unit of all lengths.
    pub unit: Unit,
    /// Index above the stack (z < 0).
    pub n_above: f64,
    /// Index below the stack.
    pub n_below: f64,
    /// The layers, from z = 0 downwards.
    pub layers: Vec<LayerSpec>,
    /// The light.
    pub source: Source,
    /// Number of paths.
    pub photons: u64,
    /// Seed of the random numbers.
    pub seed: u64,
    /// What is recorded beside the totals.
    pub tallies: Tallies,
    /// Collisions after which a path is given up; its light is recorded as `unfinished`. Matters where nothing absorbs and a half-space
    /// would keep paths for ever.
    pub max_collisions: u32,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Micrometre.
    Micrometre,
    /// Millimetre.
    Millimetre,
    /// Centimetre.
    Centimetre,
    /// Metre.
    Metre,
}

impl Unit {
    /// All units with their symbols and lengths in mm.
    pub const ALL: [(Self, &'static str, f64); 4] = [
        (Self::Micrometre, "um", 1e-3),
        (Self::Millimetre, "mm", 1.0),
        (Self::Centimetre, "cm", 10.0),
        (Self::Metre, "m", 1e3),
    ];

    fn row(self) -> (Self, &'static str, f64) {
        Self::ALL.into_iter().find(|u| u.0 == self).expect("the list holds every unit")
    }

    /// Returns the symbol.
    pub fn symbol(self) -> &'static str {
        self.row().1
    }

    /// Returns the unit's length in mm.
    pub fn in_mm(self) -> f64 {
        self.row().2
    }
}

/// A plane layer.
#[derive(Clone, Debug, PartialEq)]
pub struct LayerSpec {
    /// Name in the results.
    pub name: String,
    /// Thickness \[L\]; infinite is allowed for the last one.
    pub thickness: f64,
    /// Refractive index.
    pub n: f64,
    /// Absorption coefficient \[1/L\].
    pub sigma_a: f64,
    /// Scattering coefficient \[1/L\].
    pub sigma_s: f64,
    /// Law of scattering.
    pub law: Law,
}

/// Where light comes from; one unit of power in all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Source {
    /// A pencil beam from above that meets the origin, tilted in the x-z plane.
    Pencil {
        /// Angle from the normal, outside \[rad\], in \[0, pi/2).
        angle: f64,
    },
    /// Lambertian light from above onto the origin.
    Lambertian,
    /// An isotropic point source inside.
    Point {
        /// Its depth \[L\].
        depth: f64,
    },
}

/// Equal bins from 0 to `max`, or bins of equal ratio from `first` to `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bins {
    /// 0 for equal bins; else the lower edge of the first of bins of equal ratio.
    pub first: f64,
    /// End of the last bin.
    pub max: f64,
    /// Number of bins.
    pub bins: usize,
}

/// What is recorded beside the totals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tallies {
    /// Radius \[L\]: reflectance, transmittance.
    pub radius: Option<Bins>,
    /// Depth \[L\]: absorption, fluence; with `radius` also on the grid of both.
    pub depth: Option<Bins>,
    /// Equal bins of the exit angle in \[0, pi/2\]; with `radius` also on the grid of both.
    pub angle: Option<usize>,
    /// x and y of the exit point in \[-max, max\] \[L\], `bins` each: for oblique beams.
    pub plane: Option<Bins>,
    /// Path length \[L\] of what leaves.
    pub path: Option<Bins>,
    /// Time of flight \[ps\] of what leaves; with `radius` also on the grid of both.
    pub time: Option<Bins>,
    /// Octaves of the number of collisions of what leaves: 1, 2-3, 4-7, ...
    pub collisions: Option<usize>,
}

impl Experiment {
    /// Returns an experiment in air with a million paths and no tallies beside the totals, in mm.
    pub fn new(layers: Vec<LayerSpec>, source: Source) -> Self {
        Self {
            unit: Unit::Millimetre,
            n_above: 1.0,
            n_below: 1.0,
            layers,
            source,
            photons: 1_000_000,
            seed: 1,
            tallies: Tallies::default(),
            max_collisions: 1_000_000,
        }
    }

    /// Checks that everything is in its domain.
    ///
    /// *Errors*: the first quantity that is not, with its layer, value and range.
    pub fn check(&self) -> Result<(), Error> {
        let positive = |name: &str, x: f64| within(name, x, x > 0.0 && x.is_finite(), "(0, inf)");
        positive("n_above", self.n_above)?;
        positive("n_below", self.n_below)?;
        if self.layers.is_empty() {
            return Err(Error::NoLayers);
        }
        for (i, l) in self.layers.iter().enumerate() {
            let place = format!("layer {} ({}): ", i + 1, l.name);
            let last = i + 1 == self.layers.len();
            let thick = l.thickness > 0.0 && (l.thickness.is_finite() || last);
            within(format!("{place}thickness"), l.thickness, thick, "(0, inf), or inf for the last layer")?;
            positive(&format!("{place}n"), l.n)?;
            for (name, x) in [("sigma_a", l.sigma_a), ("sigma_s", l.sigma_s)] {
                within(format!("{place}{name}"), x, x >= 0.0 && x.is_finite(), "[0, inf)")?;
            }
            if l.sigma_s > 0.0 {
                l.law.check(&place)?;
            }
        }
        match self.source {
            Source::Pencil { angle } => {
                within("angle [rad]", angle, (0.0..std::f64::consts::FRAC_PI_2).contains(&angle), "[0, pi/2)")?;
            }
            Source::Lambertian => {}
            Source::Point { depth } => {
                let total: f64 = self.layers.iter().map(|l| l.thickness).sum();
                within("depth", depth, depth > 0.0 && depth < total, "(0, thickness of the stack)")?;
            }
        }
        within("photons", self.photons as f64, (2..=MOST_PHOTONS).contains(&self.photons), "[2, 1e12]")?;
        let t = &self.tallies;
        for (name, bins) in
            [("radius", t.radius), ("depth", t.depth), ("plane", t.plane), ("path", t.path), ("time", t.time)]
        {
            if let Some(b) = bins {
                positive(&format!("{name}: max"), b.max)?;
                within(format!("{name}: first"), b.first, (0.0..b.max).contains(&b.first), "[0, max)")?;
                within(
                    format!("{name}: first"),
                    b.first,
                    b.first == 0.0 || name != "plane",
                    "[0, 0]: x and y have equal bins",
                )?;
                within(format!("{name}: bins"), b.bins as f64, (1..=MOST_BINS).contains(&b.bins), "[1, 1000000]")?;
            }
        }
        for (name, bins, most, range) in
            [("angle", t.angle, MOST_BINS, "[1, 1000000]"), ("collisions", t.collisions, 32, "[1, 32]")]
        {
            if let Some(b) = bins {
                within(format!("{name}: bins"), b as f64, b > 0 && b <= most, range)?;
            }
        }
        Ok(())
    }

    /// Returns the stack as the walk sees it; `law` turns a layer's law into the walk's.
    pub(crate) fn stack<P: PhaseFunction>(&self, law: impl Fn(&Law) -> P) -> Stack<P> {
        let layers = self.layers.iter().map(|l| {
            let medium = Medium::with_law(Spectrum([l.sigma_a as f32]), Spectrum([l.sigma_s as f32]), law(&l.law));
            (l.thickness as f32, l.n as f32, medium)
        });
        Stack::new(self.n_above as f32, layers.collect(), self.n_below as f32)
    }

    /// Returns the layer of a depth, and the depth within it.
    pub(crate) fn locate(&self, depth: f64) -> (usize, f64) {
        let mut top = 0.0;
        for (i, l) in self.layers.iter().enumerate() {
            if depth < top + l.thickness || i + 1 == self.layers.len() {
                return (i, depth - top);
            }
            top += l.thickness;
        }
        unreachable!("a checked experiment has layers")
    }
}

/// Most bins of an axis.
const MOST_BINS: usize = 1_000_000;
/// Largest number of paths: a week on a hundred cores.
const MOST_PHOTONS: u64 = 1_000_000_000_000;

/// Returns the direction of flight inside for a direction outside, and the reflected share; `None` if all is reflected.
pub(crate) fn enter(d: Vec3, eta: f32) -> (f32, Option<Vec3>) {
    let f = moonmilk_optics::fresnel::dielectric(d.z, eta);
    let inside = moonmilk_optics::fresnel::refract(-d, Vec3::NEG_Z, eta);
    (f.reflectance, inside)
}
