//! Fields of pbrt-v4: `uniformgrid`, `rgbgrid`, `cloud`.
//!
//! Coefficients are per world unit whatever the scale of the medium's transform, values are interpolated as pbrt does
//! ([`Grid`]), and emission is per unit of sigma_a. *Source*: pbrt-v4, `media.h`, `media.cpp`.

use std::collections::HashMap;

use moonmilk_core::glam::DMat4;
use moonmilk_core::upsampling::RgbSpectrum;
use moonmilk_core::{Mat4, Random, Spectra, Spectrum, Vec3, Wavelengths};
use moonmilk_walk::{Field, Grid, Majorants, Medium};
use rayon::prelude::*;

use super::blackbody::{Colours, Y_INTEGRAL};
use super::{coefficient, glow, noise};
use crate::description::{CloudDescription, ColourGrid, DensityGrid, FieldBox, GridEmission, Place};
use crate::scene::SceneError;

/// Most distinct colours that are refined to meet their sRGB within 1e-5; more are within 3e-3 (core's `upsampling`). 2^16 take a second or two.
const MOST_REFINED: usize = 1 << 16;

/// Slabs of a cloud's bounds along its height.
const SLABS: u32 = 16;

/// A medium that differs from place to place, before wavelengths are chosen.
#[derive(Debug)]
pub(crate) struct FieldMedium {
    majorants: Majorants,
    /// World to medium space.
    to_medium: Mat4,
    /// World to the unit cube of the box.
    to_unit: Mat4,
    g: f32,
    /// Coefficients at density 1, or the mean ones of colours.
    mean: [Spectra; 2],
    /// Mean density.
    density: f32,
    substance: Substance,
}

#[derive(Debug)]
enum Substance {
    /// A density times the coefficients `mean`.
    Density(Density, Emission),
    Colours {
        sigma_a: Option<Grid<RgbSpectrum>>,
        sigma_s: Option<Grid<RgbSpectrum>>,
        scale: f32,
        emission: Option<Grid<RgbSpectrum>>,
        /// Factor on the emission.
        brightness: f32,
    },
}

#[derive(Debug)]
enum Density {
    Grid(Grid<f32>),
    Cloud(CloudDescription),
}

#[derive(Debug)]
enum Emission {
    None,
    Spectrum(Spectra, Option<Grid<f32>>),
    Temperature { values: Grid<f32>, offset: f32, scale: f32, colours: Box<Colours>, factor: Option<Grid<f32>> },
}

/// Returns the maps from the world to medium space and to the unit cube.
fn maps(b: &FieldBox) -> (Mat4, Mat4) {
    // In double precision: boxes may be far from the origin.
    let to_medium = b.medium_to_world.as_dmat4().inverse();
    let (low, high) = (b.p0.min(b.p1).as_dvec3(), b.p0.max(b.p1).as_dvec3());
    let to_unit = DMat4::from_scale(1.0 / (high - low)) * DMat4::from_translation(-low) * to_medium;
    (to_medium.as_mat4(), to_unit.as_mat4())
}

fn grid<T>(size: [u32; 3], values: Vec<T>) -> Grid<T> {
    Grid::new(size, values).expect("the sizes were checked")
}

impl FieldMedium {
    /// Returns a grid of densities that passed its check.
    pub(super) fn densities(
        d: &DensityGrid,
        fail: &impl Fn(String) -> SceneError,
        place: &Place,
    ) -> Result<Self, SceneError> {
        let (to_medium, to_unit) = maps(&d.bounds);
        let sigma_a = coefficient(&d.sigma_a, "sigma_a", d.scale).map_err(fail)?;
        let sigma_s = coefficient(&d.sigma_s, "sigma_s", d.scale).map_err(fail)?;
        let factor = (!d.emission_scale.is_empty()).then(|| grid(d.size, d.emission_scale.clone()));
        let emission = match &d.emission {
            GridEmission::None => Emission::None,
            GridEmission::Spectrum(s) => match glow(s, place)? {
                s if s.is_black() => Emission::None,
                s => Emission::Spectrum(s, factor),
            },
            GridEmission::Temperature { values, offset, scale } => {
                let hottest = values.iter().fold(0.0f32, |m, v| m.max((v - offset) * scale));
                let colours = Box::new(Colours::new(hottest));
                let values = grid(d.size, values.clone());
                Emission::Temperature { values, offset: *offset, scale: *scale, colours, factor }
            }
        };
        let typical = sigma_a.max_value() + sigma_s.max_value();
        let majorants = Majorants::of_voxels(d.size, |i| d.density[i], typical, &to_unit);
        let sum = d.density.iter().map(|&x| f64::from(x)).sum::<f64>();
        let density = (sum / d.density.len() as f64) as f32;
        let substance = Substance::Density(Density::Grid(grid(d.size, d.density.clone())), emission);
        Ok(Self { majorants, to_medium, to_unit, g: d.g, mean: [sigma_a, sigma_s], density, substance })
    }

    /// Returns a procedural cloud that passed its check.
    pub(super) fn cloud(d: &CloudDescription, fail: &impl Fn(String) -> SceneError) -> Result<Self, SceneError> {
        let (to_medium, to_unit) = maps(&d.bounds);
        let sigma_a = coefficient(&d.sigma_a, "sigma_a", 1.0).map_err(fail)?;
        let sigma_s = coefficient(&d.sigma_s, "sigma_s", 1.0).map_err(fail)?;
        let (low, high) = (d.bounds.p0.y.min(d.bounds.p1.y), d.bounds.p0.y.max(d.bounds.p1.y));
        let at = |i: u32| low + (high - low) * i as f32 / SLABS as f32;
        // A point that rounding puts into the wrong slab is covered by a margin.
        let margin = 1e-4 * (high - low);
        let bounds = (0..SLABS).map(|i| most_cloud(d, at(i) - margin, at(i + 1) + margin)).collect();
        let majorants = Majorants::new([1, SLABS, 1], bounds, &to_unit);
        let substance = Substance::Density(Density::Cloud(d.clone()), Emission::None);
        // Nobody knows a cloud's mean; of one that is there at all, half is a fair guess for messages.
        Ok(Self { majorants, to_medium, to_unit, g: d.g, mean: [sigma_a, sigma_s], density: 0.5, substance })
    }

    /// Returns a grid of colours that passed its check.
    pub(super) fn colours(d: &ColourGrid) -> Self {
        let (to_medium, to_unit) = maps(&d.bounds);
        let spectra = |colours: &[[f32; 3]]| (!colours.is_empty()).then(|| grid(d.size, upsampled(colours)));
        let (sigma_a, sigma_s) = (spectra(&d.sigma_a), spectra(&d.sigma_s));
        let emission = if d.emission_scale > 0.0 { spectra(&d.emission) } else { None };
        let bound = |grid: &Option<Grid<RgbSpectrum>>, i: usize| grid.as_ref().map_or(1.0, |g| most(&g.values()[i]));
        let n = d.size.iter().map(|&n| n as usize).product::<usize>();
        // A grid that is missing stands for 1 in the whole box, beyond its outermost voxels too.
        let bounds: Vec<f32> =
            (0..n).into_par_iter().map(|i| d.scale * (bound(&sigma_a, i) + bound(&sigma_s, i))).collect();
        let majorants = Majorants::of_voxels(d.size, |i| bounds[i], 1.0, &to_unit);
        let mean = [&d.sigma_a, &d.sigma_s].map(|colours| {
            let n = colours.len().max(1) as f64;
            let sum = colours.iter().fold([0.0f64; 3], |s, c| std::array::from_fn(|k| s[k] + f64::from(c[k])));
            let rgb = if colours.is_empty() { [d.scale; 3] } else { sum.map(|x| (x / n) as f32 * d.scale) };
            Spectra::rgb_unbounded(rgb).unwrap_or(Spectra::Constant(0.0))
        });
        let brightness = d.emission_scale * Y_INTEGRAL;
        let substance = Substance::Colours { sigma_a, sigma_s, scale: d.scale, emission, brightness };
        Self { majorants, to_medium, to_unit, g: d.g, mean, density: 1.0, substance }
    }

    /// Returns the field at the wavelengths of a path.
    pub(crate) fn at<'a, const N: usize>(&'a self, w: &Wavelengths<N>) -> FieldAt<'a, N> {
        let [sigma_a, sigma_s] = [0, 1].map(|k| self.mean[k].sample(w));
        let (factor, emission, scatters) = match &self.substance {
            Substance::Density(_, emission) => {
                let emission = match emission {
                    Emission::None => None,
                    Emission::Spectrum(s, _) => Some(s.sample(w)),
                    Emission::Temperature { .. } => Some(Spectrum::ONE),
                };
                ((sigma_a + sigma_s).max_value(), emission, !sigma_s.is_black())
            }
            Substance::Colours { emission, .. } => (1.0, emission.as_ref().map(|_| Spectrum::ONE), !sigma_s.is_black()),
        };
        FieldAt { field: self, w: *w, sigma_a, sigma_s, factor, emission, scatters }
    }

    /// Returns the bytes held.
    pub(crate) fn memory(&self) -> usize {
        let floats = |g: &Option<Grid<f32>>| g.as_ref().map_or(0, |g| size_of_val(g.values()));
        let colours = |g: &Option<Grid<RgbSpectrum>>| g.as_ref().map_or(0, |g| size_of_val(g.values()));
        self.majorants.memory()
            + match &self.substance {
                Substance::Density(density, emission) => {
                    let density = match density {
                        Density::Grid(g) => size_of_val(g.values()),
                        Density::Cloud(_) => 0,
                    };
                    density
                        + match emission {
                            Emission::None => 0,
                            Emission::Spectrum(_, factor) => floats(factor),
                            Emission::Temperature { values, factor, .. } => {
                                size_of_val(values.values()) + floats(factor)
                            }
                        }
                }
                Substance::Colours { sigma_a, sigma_s, emission, .. } => {
                    colours(sigma_a) + colours(sigma_s) + colours(emission)
                }
            }
    }
}

/// Returns the spectra of colours, refined where their number allows it.
fn upsampled(colours: &[[f32; 3]]) -> Vec<RgbSpectrum> {
    let key = |c: &[f32; 3]| c.map(f32::to_bits);
    let mut number: HashMap<[u32; 3], usize> = HashMap::new();
    let mut distinct = Vec::new();
    for c in colours {
        number.entry(key(c)).or_insert_with(|| {
            distinct.push(*c);
            distinct.len() - 1
        });
        if distinct.len() > MOST_REFINED {
            return colours.par_iter().map(|c| RgbSpectrum::unbounded(*c)).collect();
        }
    }
    let spectra: Vec<RgbSpectrum> = distinct.par_iter().map(|c| RgbSpectrum::unbounded(*c).refined()).collect();
    colours.iter().map(|c| spectra[number[&key(c)]]).collect()
}

/// Returns an upper bound of a colour's spectrum over all wavelengths and channels, with a margin for rounding.
fn most(s: &RgbSpectrum) -> f32 {
    // The sigmoid of a quadratic is largest at an end of the range or at the vertex.
    let spectral = [380.0, 780.0].into_iter().chain(s.vertex()).map(|l| s.eval(l)).fold(0.0, f32::max);
    s.rgb.into_iter().fold(spectral, f32::max) * (1.0 + 1e-5)
}

/// Returns pbrt's density of a cloud at a point of medium space, in [0, 1].
fn cloud_density(c: &CloudDescription, p: Vec3) -> f32 {
    let mut q = p * c.frequency;
    // Swirl the point.
    if c.wispiness > 0.0 {
        let (mut weight, mut frequency) = (0.05 * c.wispiness, 10.0);
        for _ in 0..2 {
            q += noise::differences(q * frequency) * weight;
            weight *= 0.5;
            frequency *= OCTAVE;
        }
    }
    let (mut sum, mut weight, mut frequency) = (0.0, 0.5, 1.0);
    for _ in 0..5 {
        sum += weight * noise::noise(q * frequency);
        weight *= 0.5;
        frequency *= OCTAVE;
    }
    // Thin it out with the height.
    let wisps = ((1.0 - p.y) * 4.5 * c.density * sum).clamp(0.0, 1.0);
    (wisps + 2.0 * (0.5 - p.y).max(0.0)).clamp(0.0, 1.0)
}

/// Ratio of frequencies of the cloud's octaves.
const OCTAVE: f32 = 1.99;

/// Returns an upper bound of a cloud's density between two heights.
fn most_cloud(c: &CloudDescription, low: f32, high: f32) -> f32 {
    // Weights 1/2, 1/4, ... 1/32 of the noise's bound.
    let sum = 0.96875 * noise::MOST;
    let wisps = ((1.0 - low).abs().max((1.0 - high).abs()) * 4.5 * c.density * sum).min(1.0);
    (wisps + 2.0 * (0.5 - low).max(0.0)).min(1.0)
}

/// A field at the wavelengths of a path.
pub(crate) struct FieldAt<'a, const N: usize> {
    field: &'a FieldMedium,
    w: Wavelengths<N>,
    sigma_a: Spectrum<N>,
    sigma_s: Spectrum<N>,
    factor: f32,
    emission: Option<Spectrum<N>>,
    scatters: bool,
}

impl<const N: usize> FieldAt<'_, N> {
    /// Returns a homogeneous medium of the mean coefficients: for messages and auxiliary pictures.
    pub(crate) fn mean(&self) -> Medium<N> {
        let density = self.field.density;
        Medium::new(self.sigma_a * density, self.sigma_s * density, self.field.g)
    }
}

impl<const N: usize> Field<N> for FieldAt<'_, N> {
    #[inline]
    fn majorants(&self) -> (&Majorants, f32) {
        (&self.field.majorants, self.factor)
    }

    #[inline]
    fn at<R: Random>(&self, p: Vec3, rng: &mut R) -> (Spectrum<N>, Spectrum<N>) {
        let f = self.field;
        match &f.substance {
            Substance::Density(Density::Grid(grid), _) => {
                let density = grid.pick(f.to_unit.transform_point3(p), rng).copied().unwrap_or(0.0);
                (self.sigma_a * density, self.sigma_s * density)
            }
            Substance::Density(Density::Cloud(cloud), _) => {
                let density = cloud_density(cloud, f.to_medium.transform_point3(p));
                (self.sigma_a * density, self.sigma_s * density)
            }
            Substance::Colours { sigma_a, sigma_s, scale, .. } => {
                // The same voxel for both, or their sum could exceed the bound.
                let grid = sigma_a.as_ref().or(sigma_s.as_ref()).expect("a grid of colours has one of the two");
                let voxel = grid.choose(f.to_unit.transform_point3(p), rng);
                let value = |grid: &Option<Grid<RgbSpectrum>>| match (grid, voxel) {
                    (Some(g), Some(i)) => g.values()[i].sample(&self.w) * *scale,
                    (Some(_), None) => Spectrum::ZERO,
                    (None, _) => Spectrum::splat(*scale),
                };
                (value(sigma_a), value(sigma_s))
            }
        }
    }

    fn scatters(&self) -> bool {
        self.scatters
    }

    fn emits(&self) -> bool {
        self.emission.is_some()
    }

    fn emission(&self, p: Vec3) -> Spectrum<N> {
        let f = self.field;
        let Some(emission) = self.emission else { return Spectrum::ZERO };
        let u = f.to_unit.transform_point3(p);
        let interpolated = |factor: &Option<Grid<f32>>| factor.as_ref().map_or(1.0, |g| g.interpolate(u));
        match &f.substance {
            Substance::Density(_, Emission::None) => Spectrum::ZERO,
            Substance::Density(_, Emission::Spectrum(_, factor)) => emission * interpolated(factor),
            Substance::Density(_, Emission::Temperature { values, offset, scale, colours, factor }) => {
                // Below 100 K pbrt emits nothing, and nothing is visible.
                let kelvin = (values.interpolate(u) - offset) * scale;
                match kelvin > 100.0 {
                    true => colours.radiance(kelvin, &self.w) * interpolated(factor),
                    false => Spectrum::ZERO,
                }
            }
            Substance::Colours { emission, brightness, .. } => {
                let mut sum = Spectrum::ZERO;
                if let Some(grid) = emission {
                    grid.around(u, |s, weight| sum += s.sample(&self.w) * (weight * brightness));
                }
                sum
            }
        }
    }

    fn local(&self, sigma_a: Spectrum<N>, sigma_s: Spectrum<N>) -> Medium<N> {
        Medium::new(sigma_a, sigma_s, self.field.g)
    }
}
