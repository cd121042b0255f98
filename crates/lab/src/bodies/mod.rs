//! Light in closed bodies of any shape, and detectors around them.
//!
//! Bodies are closed surfaces around homogeneous media, apart from one another; between them is nothing. Light flies from its source until it meets a body, where it is reflected or refracted by
//! Fresnel's law; inside it walks as in layers, until it leaves and flies on. Detectors are surfaces that take all light that meets them and count it; one of them may shine.
//!
//! Powers are shares of the light that the source sends out. [`Light::Uniform`] and [`Light::Parallel`] send it through a ball around everything, whose radius is a result (`radius`): uniform light of radiance L
//! sends 4 pi^2 R^2 L, parallel light of irradiance E sends pi R^2 E.
//!
//! ```
//! use moonmilk_geometry::generate::bumpy_sphere;
//! use moonmilk_lab::bodies::{BodySpec, Bodies, Light, run};
//!
//! // The mean path per incident ray of a body that does not absorb is 4 eta^2 V / S, whatever its shape.
//! let mesh = bumpy_sphere(3, 0.3);
//! let exact = 4.0 * 1.4f64.powi(2) * mesh.volume() / mesh.area();
//! let body = BodySpec { name: "stone".into(), shape: mesh.into(), n: 1.4, sigma_a: 0.0, sigma_s: 3.0, g: 0.5 };
//! let mut e = Bodies::new(vec![body], Light::Uniform);
//! e.photons = 20_000;
//! let r = run(&e)?;
//! let (path, incident) = (r.scalar("path.stone").unwrap(), r.scalar("incident.stone").unwrap());
//! assert!((path.mean / incident.mean / exact - 1.0).abs() < 0.03);
//! # Ok::<(), moonmilk_lab::Error>(())
//! ```

mod recorder;
mod trace;

use moonmilk_core::Vec3;
use moonmilk_geometry::{Bounds, Shape};

use crate::error::{Error, within};
use crate::experiment::Unit;

pub use trace::run;

/// A body.
#[derive(Clone, Debug)]
pub struct BodySpec {
    /// Name in the results.
    pub name: String,
    /// Its closed surface, normals outward.
    pub shape: Shape,
    /// Refractive index over that of the surroundings.
    pub n: f64,
    /// Absorption coefficient \[1/L\].
    pub sigma_a: f64,
    /// Scattering coefficient \[1/L\].
    pub sigma_s: f64,
    /// Asymmetry of the Henyey-Greenstein law.
    pub g: f64,
}

/// A surface that takes all light that meets it, from either side.
#[derive(Clone, Debug)]
pub struct DetectorSpec {
    /// Name in the results.
    pub name: String,
    /// Its surface, open or closed.
    pub shape: Shape,
}

/// Where light comes from; one unit of power in all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// The same radiance from all directions.
    Uniform,
    /// Parallel light.
    Parallel {
        /// Where it flies to; any length but 0.
        direction: Vec3,
    },
    /// Lambertian light from a detector's mesh, even over its surface; the mesh still takes the light that meets it.
    Surface {
        /// Number of the detector.
        detector: usize,
        /// Whether both sides shine, or the side of the normals alone.
        two_sided: bool,
    },
    /// A point, inside a body or outside: all directions alike, or a cone of them.
    Point {
        /// The point.
        at: Vec3,
        /// The axis of the cone; any length but 0.
        axis: Vec3,
        /// Cosines of the cone: light is even up to the first and falls to nothing at the second, by pbrt's smooth step. (-1, -1) is all directions, (1, 1) a beam.
        cosines: (f32, f32),
    },
}

impl Light {
    /// Returns the isotropic point source.
    pub fn point(at: Vec3) -> Self {
        Self::Point { at, axis: Vec3::Z, cosines: (-1.0, -1.0) }
    }

    /// Returns a pencil beam.
    pub fn beam(at: Vec3, direction: Vec3) -> Self {
        Self::Point { at, axis: direction, cosines: (1.0, 1.0) }
    }
}

/// Which grids are recorded: cubic cells over the box of all bodies, this many along its longest side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Grids {
    /// Fluence inside bodies, by track length.
    pub fluence: Option<usize>,
    /// Absorption, by collisions.
    pub absorption: Option<usize>,
}

/// Light, bodies and detectors.
#[derive(Clone, Debug)]
pub struct Bodies {
    /// Unit of all lengths, for labels.
    pub unit: Unit,
    /// The bodies.
    pub bodies: Vec<BodySpec>,
    /// The detectors.
    pub detectors: Vec<DetectorSpec>,
    /// The light.
    pub light: Light,
    /// Number of paths.
    pub photons: u64,
    /// Seed of the random numbers.
    pub seed: u64,
    /// What is recorded beside the totals.
    pub grids: Grids,
    /// Collisions after which a path is given up; its light is `unfinished`.
    pub max_collisions: u32,
}

/// Most cells of a grid.
pub const MOST_CELLS: usize = 1 << 20;
/// Most cells along a side.
const MOST_ALONG: usize = 1024;

impl Bodies {
    /// Returns an experiment of a million paths without detectors and grids, in mm.
    pub fn new(bodies: Vec<BodySpec>, light: Light) -> Self {
        Self {
            unit: Unit::Millimetre,
            bodies,
            detectors: Vec::new(),
            light,
            photons: 1_000_000,
            seed: 1,
            grids: Grids::default(),
            max_collisions: 1_000_000,
        }
    }

    /// Checks that everything is in its domain. Whether bodies overlap is found while light flies.
    ///
    /// *Errors*: the first quantity that is not, with its body, value and range; open or inverted surfaces.
    pub fn check(&self) -> Result<(), Error> {
        if self.bodies.is_empty() {
            return Err(Error::NoBodies);
        }
        for b in &self.bodies {
            let place = format!("{}: ", b.name);
            within(format!("{place}n"), b.n, b.n > 0.0 && b.n.is_finite(), "(0, inf)")?;
            for (name, x) in [("sigma_a", b.sigma_a), ("sigma_s", b.sigma_s)] {
                within(format!("{place}{name}"), x, x >= 0.0 && x.is_finite(), "[0, inf)")?;
            }
            within(format!("{place}g"), b.g, b.g.abs() < 1.0, "(-1, 1)")?;
            if !b.shape.is_closed() {
                return Err(Error::Open { body: b.name.clone() });
            }
            if b.shape.volume() <= 0.0 {
                return Err(Error::InsideOut { body: b.name.clone(), volume: b.shape.volume() });
            }
        }
        match self.light {
            Light::Uniform => {}
            Light::Surface { detector, .. } => {
                let mesh = self.detectors.get(detector).is_some_and(|d| d.shape.mesh().is_some());
                within("number of the detector that shines", detector as f64, mesh, "those of meshes")?;
            }
            Light::Parallel { direction: d } | Light::Point { axis: d, .. } => {
                let length = f64::from(d.length());
                within("length of the light's direction", length, length > 0.0 && length.is_finite(), "(0, inf)")?;
            }
        }
        if let Light::Point { at, cosines: (a, b), .. } = self.light {
            within("distance of the light", f64::from(at.length()), at.is_finite(), "[0, inf)")?;
            within(
                "cosine of the light's cone",
                f64::from(b),
                (-1.0..=a).contains(&b) && a <= 1.0,
                "[-1, cosine of its full light]",
            )?;
        }
        for (name, n) in [("fluence", self.grids.fluence), ("absorption", self.grids.absorption)] {
            if let Some(n) = n {
                within(format!("{name}: cells"), n as f64, (1..=MOST_ALONG).contains(&n), "[1, 1024]")?;
                let cells: usize = self.axes(n).iter().map(|e| e.len() - 1).product();
                if cells > MOST_CELLS {
                    return Err(Error::TooManyCells { cells, most: MOST_CELLS });
                }
            }
        }
        within("photons", self.photons as f64, (64..=1_000_000_000_000).contains(&self.photons), "[64, 1e12]")
    }

    /// Returns the box of all bodies.
    fn bounds(&self) -> Bounds {
        self.bodies.iter().fold(Bounds::EMPTY, |all, b| all.union(b.shape.bounds()))
    }

    /// Returns the edges of cubic cells, n along the longest side of the box of all bodies.
    fn axes(&self, n: usize) -> [Vec<f64>; 3] {
        let b = self.bounds();
        let size = f64::from(b.extent().max_element()) / n as f64;
        [0, 1, 2].map(|k| {
            let (low, high) = (f64::from(b.min[k]), f64::from(b.max[k]));
            // A side that is a whole number of cells but for rounding has that number.
            let cells = ((high - low) / size - 1e-5).ceil().max(1.0) as usize;
            let first = 0.5 * (low + high) - 0.5 * size * cells as f64;
            (0..=cells).map(|i| first + size * i as f64).collect()
        })
    }
}
