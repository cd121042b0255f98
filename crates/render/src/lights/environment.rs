//! Light from infinitely far away in all directions: constant radiance and environment pictures.
//!
//! All such lights together are one strategy: a direction is chosen from a mixture of their densities and carries the radiance
//! of all of them, so that a ray that escapes needs a single density for multiple importance sampling.

use std::f32::consts::{FRAC_1_PI, PI};

use moonmilk_core::glam::{DMat3, Mat3};
use moonmilk_core::upsampling::sample_unbounded;
use moonmilk_core::{Frame, Mat4, Spectra, Spectrum, Vec3, Wavelengths};

use super::distribution::PixelDistribution;
use super::emission::{LUMINANCE, Picture, factor, mean_of};
use super::error::LightError;
use super::octahedral::{direction_of, square_of};
use super::portal::Portal;
use crate::description::{ImageDescription, Place};

/// A light that shines through a portal.
#[derive(Debug)]
struct Windowed {
    portal: Portal,
    source: Source,
    mean: f32,
}

#[derive(Debug)]
enum Source {
    Constant(Spectra),
    Picture(PictureLight),
}

/// Share of the samples of a light behind a portal that look at the portal; the rest follow its picture, where a sun may be.
const AT_PORTAL: f32 = 0.5;

impl Windowed {
    fn radiance<const N: usize>(&self, p: Vec3, d: Vec3, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        match &self.source {
            _ if !self.portal.is_open(p, d) => Spectrum::ZERO,
            Source::Constant(s) => s.sample(wavelengths),
            Source::Picture(picture) => picture.radiance(d, wavelengths),
        }
    }

    fn pdf(&self, p: Vec3, d: Vec3) -> f32 {
        match &self.source {
            Source::Constant(_) => self.portal.pdf(p, d),
            Source::Picture(picture) => AT_PORTAL * self.portal.pdf(p, d) + (1.0 - AT_PORTAL) * picture.pdf(d),
        }
    }

    /// Chooses a direction; `choice` in \[0, 1) between the portal and the picture.
    fn sample(&self, p: Vec3, choice: f64, u: [f64; 2]) -> Option<Vec3> {
        match &self.source {
            Source::Picture(picture) if choice >= f64::from(AT_PORTAL) => picture.sample(u),
            _ => self.portal.sample(p, u),
        }
    }
}

/// All lights at infinity that are not single directions.
#[derive(Debug, Default)]
pub struct Environment {
    constants: Vec<Spectra>,
    /// Mean radiance of the constants.
    constant_mean: f32,
    pictures: Vec<PictureLight>,
    windowed: Vec<Windowed>,
    /// Mean radiance of everything.
    mean: f32,
}

impl Environment {
    /// Adds a light of constant radiance.
    pub fn add_constant(&mut self, radiance: Spectra) {
        let mean = mean_of(&radiance) as f32;
        self.constants.push(radiance);
        self.constant_mean += mean;
        self.mean += mean;
    }

    /// Adds a picture.
    pub fn add_picture(&mut self, light: PictureLight) {
        self.mean += light.mean;
        self.pictures.push(light);
    }

    /// Adds a light of constant radiance behind a portal.
    pub fn add_constant_behind(&mut self, portal: Portal, radiance: Spectra) {
        let mean = mean_of(&radiance) as f32;
        self.mean += mean;
        self.windowed.push(Windowed { portal, source: Source::Constant(radiance), mean });
    }

    /// Adds a picture behind a portal.
    pub fn add_picture_behind(&mut self, portal: Portal, light: PictureLight) {
        let mean = light.mean;
        self.mean += mean;
        self.windowed.push(Windowed { portal, source: Source::Picture(light), mean });
    }

    /// Returns an estimate of the irradiance that everything at infinity causes; 0 if all is black.
    pub fn importance(&self) -> f32 {
        PI * self.mean
    }

    /// Returns the radiance that arrives at p from the unit direction `d`; only portals ask where p is.
    #[inline]
    pub fn radiance<const N: usize>(&self, p: Vec3, d: Vec3, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        let mut sum = Spectrum::ZERO;
        for c in &self.constants {
            sum += c.sample(wavelengths);
        }
        for picture in &self.pictures {
            sum += picture.radiance(d, wavelengths);
        }
        for light in &self.windowed {
            sum += light.radiance(p, d, wavelengths);
        }
        sum
    }

    /// Returns the density of [`Environment::sample`] for the unit direction `d` [1/sr].
    pub fn pdf(&self, p: Vec3, n: Option<Vec3>, d: Vec3) -> f32 {
        if self.mean == 0.0 {
            return 0.0;
        }
        let constant = match n {
            Some(n) => n.dot(d).max(0.0) * FRAC_1_PI,
            None => 0.25 * FRAC_1_PI,
        };
        let sum = self.pictures.iter().fold(self.constant_mean * constant, |s, l| s + l.mean * l.pdf(d));
        self.windowed.iter().fold(sum, |s, l| s + l.mean * l.pdf(p, d)) / self.mean
    }

    /// Chooses a direction at a point with normal `n`, or in a medium, for a variate that chooses the light and two that
    /// choose the direction.
    ///
    /// Each light is chosen in proportion to its mean radiance. A constant one is sampled by the cosine to n, or uniformly over
    /// the sphere; a picture in proportion to its pixels; one behind a portal by the portal as well.
    pub fn sample(&self, p: Vec3, n: Option<Vec3>, choice: f64, u: [f64; 2]) -> Option<Vec3> {
        let mut choice = choice * f64::from(self.mean) - f64::from(self.constant_mean);
        if choice < 0.0 || (self.pictures.is_empty() && self.windowed.is_empty()) {
            return (self.mean > 0.0).then(|| constant_direction(n, u));
        }
        let behind: f64 = self.windowed.iter().map(|l| f64::from(l.mean)).sum();
        if choice < behind || self.pictures.is_empty() {
            for (i, light) in self.windowed.iter().enumerate() {
                let mean = f64::from(light.mean);
                if choice < mean || i + 1 == self.windowed.len() {
                    return light.sample(p, (choice / mean).clamp(0.0, 1.0 - f64::EPSILON), u);
                }
                choice -= mean;
            }
        }
        choice -= behind;
        let mut chosen = &self.pictures[0];
        for p in self.pictures.iter().filter(|p| p.mean > 0.0) {
            chosen = p;
            choice -= f64::from(p.mean);
            if choice < 0.0 {
                break;
            }
        }
        chosen.sample(u)
    }
}

/// Returns a direction by the cosine to a normal, or uniform over the sphere.
fn constant_direction(n: Option<Vec3>, u: [f64; 2]) -> Vec3 {
    let (sin_phi, cos_phi) = (2.0 * std::f64::consts::PI * u[1]).sin_cos();
    let (z, s) = match n {
        Some(_) => ((1.0 - u[0]).sqrt(), u[0].sqrt()),
        None => {
            let z = 1.0 - 2.0 * u[0];
            (z, (1.0 - z * z).max(0.0).sqrt())
        }
    };
    let local = Vec3::new((s * cos_phi) as f32, (s * sin_phi) as f32, z as f32);
    n.map_or(local, |n| Frame::new(n).to_world(local)).normalize()
}

/// An environment picture in the equal-area octahedral layout, as pbrt-v4's `infinite` light with a `filename`.
///
/// A direction takes the colour of the pixel it falls into, without interpolation (as pbrt-v4 does), so that the density, constant per
/// pixel, is exactly proportional to the mean of the components.
#[derive(Debug)]
pub struct PictureLight {
    picture: Picture,
    /// `None` for a black picture.
    distribution: Option<PixelDistribution>,
    factor: f32,
    to_light: Mat3,
    to_world: Mat3,
    /// 1 / |det to_light|: with |to_light d|^3 the ratio of solid angles.
    inverse_determinant: f32,
    rigid: bool,
    mean: f32,
}

impl PictureLight {
    /// Returns a picture light; `illuminance` asks for that much light on a plane that faces the light's +z.
    pub fn new(
        image: &ImageDescription,
        light_to_world: &Mat4,
        scale: f32,
        illuminance: Option<f32>,
        place: &Place,
    ) -> Result<Self, LightError> {
        if image.width != image.height {
            return Err(LightError::NotSquare {
                place: place.clone(),
                name: image.name.clone(),
                width: image.width,
                height: image.height,
            });
        }
        let picture = Picture::new(image, place)?;
        let to_world = Mat3::from_mat4(*light_to_world);
        let to_light = to_world.as_dmat3().inverse();
        let determinant = to_light.determinant();
        if !(determinant.is_finite() && determinant != 0.0) {
            return Err(LightError::Direction { place: place.clone() });
        }
        let factor = factor(scale, illuminance, upper_illuminance(&picture), place)?;
        let weights: Vec<f32> = picture.rgb.iter().map(|[r, g, b]| (r + g + b) / 3.0).collect();
        let mean = (picture.mean_of(|[r, g, b]| (r + g + b) / 3.0) * f64::from(factor)) as f32;
        Ok(Self {
            distribution: PixelDistribution::new(picture.width, picture.height, &weights).filter(|_| factor > 0.0),
            picture,
            factor,
            to_light: to_light.as_mat3(),
            to_world,
            inverse_determinant: (1.0 / determinant.abs()) as f32,
            rigid: is_rigid(&to_light),
            mean,
        })
    }

    fn radiance<const N: usize>(&self, d: Vec3, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        let p = square_of((self.to_light * d).normalize());
        sample_unbounded(self.picture.nearest(p), wavelengths) * self.factor
    }

    fn pdf(&self, d: Vec3) -> f32 {
        let Some(distribution) = &self.distribution else {
            return 0.0;
        };
        let local = self.to_light * d;
        let length = local.length();
        let density = distribution.pdf(square_of(local / length)) as f32 * (0.25 * FRAC_1_PI);
        // A transform that stretches space changes solid angles by |det| / |M d|^3.
        if self.rigid { density } else { density / (self.inverse_determinant * length * length * length) }
    }

    fn sample(&self, u: [f64; 2]) -> Option<Vec3> {
        let local = direction_of(self.distribution.as_ref()?.sample(u));
        (self.to_world * local).try_normalize()
    }
}

fn is_rigid(m: &DMat3) -> bool {
    // Within what f32 matrices of a file can express of a rotation or reflection.
    (*m * m.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-6)
}

/// Returns the illuminance of a picture's upper hemisphere on a plane that faces +z.
fn upper_illuminance(p: &Picture) -> f64 {
    let mut sum = 0.0;
    for y in 0..p.height {
        for x in 0..p.width {
            let d = direction_of([(x as f64 + 0.5) / p.width as f64, (y as f64 + 0.5) / p.height as f64]);
            if d.z > 0.0 {
                let luminance: f32 = p.rgb[y * p.width + x].iter().zip(LUMINANCE).map(|(c, w)| c * w).sum();
                sum += f64::from(luminance * d.z);
            }
        }
    }
    // Each pixel has the solid angle 4 pi / count.
    sum * 4.0 * std::f64::consts::PI / (p.width * p.height) as f64
}
