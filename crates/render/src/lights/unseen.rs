//! Lights without extent, points and parallel beams, by themselves: no ray ever meets them, so whoever needs a path to one must construct it.
//!
//! Half of the choices among points follow the light tree, half their intensity alone: behind a refractive boundary light arrives from other directions than the straight one, for which
//! the tree may prove that there is none.

use moonmilk_core::{Spectrum, Vec3, Wavelengths};

use super::bounds::LightBounds;
use super::tree::LightTree;
use super::{Lights, Placed, Shares, refined};

/// Points among the lights that have a position.
#[derive(Debug, Default)]
pub(super) struct Unseen {
    tree: LightTree,
    /// Numbers of the points, and the sum of their intensities up to and with each.
    points: Vec<(u32, f64)>,
}

/// A light without extent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lamp {
    /// Number of the light.
    Point(u32),
    /// Number among the distant ones.
    Distant(u32),
}

/// Where a light without extent is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// At a point.
    Point(Vec3),
    /// At infinity, in a unit direction.
    Direction(Vec3),
}

impl Unseen {
    /// Returns the points among some lights with given bounds.
    pub fn new(placed: &[Placed], bounds: &[Option<LightBounds>]) -> Self {
        let only: Vec<Option<LightBounds>> = placed
            .iter()
            .zip(bounds)
            .map(|(l, b)| b.filter(|b| matches!(l, Placed::Punctual(_)) && b.intensity > 0.0))
            .collect();
        let mut sum = 0.0;
        let points = (0u32..)
            .zip(&only)
            .filter_map(|(i, b)| {
                sum += b.as_ref()?.intensity;
                Some((i, sum))
            })
            .collect();
        Self { tree: LightTree::new(&only), points }
    }

    fn total(&self) -> f64 {
        self.points.last().map_or(0.0, |p| p.1)
    }

    /// Returns the share of the intensity that a point has.
    fn share(&self, light: u32) -> f64 {
        let Ok(i) = self.points.binary_search_by_key(&light, |p| p.0) else { return 0.0 };
        (self.points[i].1 - if i > 0 { self.points[i - 1].1 } else { 0.0 }) / self.total()
    }

    fn probability(&self, p: Vec3, light: u32) -> f64 {
        0.5 * (f64::from(self.tree.probability(p, None, light)) + self.share(light))
    }

    /// Chooses a point for a variate in [0, 1).
    fn sample(&self, p: Vec3, u: f64) -> Option<u32> {
        if u < 0.5 {
            return self.tree.sample(p, None, 2.0 * u).map(|l| l.0);
        }
        let at = (2.0 * u - 1.0) * self.total();
        let i = self.points.partition_point(|p| p.1 <= at);
        self.points.get(i).or(self.points.last()).map(|p| p.0)
    }
}

impl Lights {
    /// Returns whether there are lights without extent.
    pub fn has_unseen(&self) -> bool {
        self.unseen.total() > 0.0 || self.distant.iter().any(|d| d.importance(None) > 0.0)
    }

    /// Returns whether a light is a lamp of opacity 0, which rays pass.
    pub fn is_hidden(&self, light: u32) -> bool {
        matches!(self.placed.get(light as usize), Some(Placed::Surface { cut: super::Cut::Hidden, .. }))
    }

    /// Chooses a light without extent for a point that its light may reach on bent ways, and returns it with the probability of that choice, which is positive for
    /// all that shine. The second and third variate only give the first more digits.
    pub fn choose_unseen(&self, p: Vec3, u: [f32; 3]) -> Option<(Lamp, f32)> {
        let total = self.unseen.total();
        let points =
            if total > 0.0 { f64::from(self.unseen.tree.importance(p, None)).max(f64::MIN_POSITIVE) } else { 0.0 };
        let mut shares = Shares { tree: points, environment: 0.0, sum: 0.0, count: 0.0 };
        let distant = self.distant.iter().map(|l| f64::from(l.importance(None)));
        for e in std::iter::once(points).chain(distant).filter(|&e| e > 0.0) {
            shares.sum += e;
            shares.count += 1.0;
        }
        let mut choice = refined(u);
        let share = shares.of(points);
        if choice < share {
            let light = self.unseen.sample(p, choice / share)?;
            return Some((Lamp::Point(light), (share * self.unseen.probability(p, light)) as f32));
        }
        choice -= share;
        for (i, light) in (0u32..).zip(&self.distant) {
            let share = shares.of(f64::from(light.importance(None)));
            if choice < share {
                return Some((Lamp::Distant(i), share as f32));
            }
            choice -= share;
        }
        None
    }

    /// Returns where a light without extent is.
    pub fn target(&self, lamp: Lamp) -> Option<Target> {
        match lamp {
            Lamp::Point(l) => match self.placed.get(l as usize)? {
                Placed::Punctual(lamp) => Some(Target::Point(lamp.position())),
                Placed::Surface { .. } => None,
            },
            Lamp::Distant(i) => Some(Target::Direction(self.distant.get(i as usize)?.towards)),
        }
    }

    /// Returns the irradiance at p on a plane that faces a light without extent, the direction to it and its distance; `None` where it does not shine.
    pub fn irradiance<const N: usize>(
        &self,
        lamp: Lamp,
        p: Vec3,
        wavelengths: &Wavelengths<N>,
    ) -> Option<(Spectrum<N>, Vec3, f32)> {
        match lamp {
            Lamp::Point(l) => match self.placed.get(l as usize)? {
                Placed::Punctual(lamp) => lamp.sample(p, wavelengths),
                Placed::Surface { .. } => None,
            },
            Lamp::Distant(i) => {
                let light = self.distant.get(i as usize)?;
                Some((light.irradiance(wavelengths), light.towards, f32::INFINITY))
            }
        }
    }
}
