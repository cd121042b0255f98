//! Light from infinitely far away in all directions: constant radiance and environment pictures.
//!
//! All such lights together are one strategy: a direction is chosen from a mixture of their densities and carries the radiance
//! of all of them, so that a ray that escapes needs a single density for multiple importance sampling.
//!
//! *Aims.* Paths through a refractive boundary find an even sky by chance, with hardly any noise, and a sun never. So connections aim at what is brighter than
//! the mean: a picture L with the density
//!
//! $$ p(\omega) = \frac{\max(0, L - \bar L)}{\int \max(0, L - \bar L)\, d\omega} , $$
//!
//! \[Karlik2019\], which leave to chance what chance finds well, and a portal, behind which all else is dark. Constant radiance and pictures that vary
//! by less than [`EVEN`] are *even* and take no part.

use std::f32::consts::{FRAC_1_PI, PI};

use moonmilk_core::glam::{DMat3, Mat3};
use moonmilk_core::upsampling::sample_unbounded;
use moonmilk_core::{DVec3, Frame, Mat4, Spectra, Spectrum, Vec3, Wavelengths};

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

/// Variance of the radiance over the sphere, relative to the mean squared, below which a picture is even: it is what chance adds to the noise. Balls of milk under one of .03, .27, .67, 1, 4.5
/// (a slight gradient, a strong one, sky and ground, a chessboard, a softbox) have 1.54, 1.19, 1.06, .97, .51 times the variance with connections.
const EVEN: f64 = 2.0;
/// Largest half angle of the cone of a sun \[radians\]: flights in the directions that refraction may lead into it look for it, and wider cones of them cost more than they gain.
const NARROW: f64 = 0.4;
/// Share of a picture's excess that is in the cone of its sun.
const MOST_OF_IT: f64 = 0.9;

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

    /// Chooses a direction and returns its density; `choice` in \[0, 1) between the portal and the picture.
    fn sample(&self, p: Vec3, choice: f64, u: [f64; 2]) -> Option<(Vec3, f32)> {
        match &self.source {
            Source::Picture(picture) if choice >= f64::from(AT_PORTAL) => {
                let (d, pdf) = picture.draw(picture.distribution.as_ref()?, u)?;
                Some((d, AT_PORTAL * self.portal.pdf(p, d) + (1.0 - AT_PORTAL) * pdf))
            }
            _ => self.portal.sample(p, u).map(|d| (d, self.pdf(p, d))),
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
    /// Mean radiance of what connections aim at.
    aimed: f32,
    /// Axis and cosine of the half angle of the cone that holds most of the excess of the brightest picture, if it is narrow, and that excess.
    sun: Option<(Vec3, f32, f32)>,
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
        self.aimed += light.excess();
        if self.sun.is_none_or(|s| s.2 < light.excess())
            && let Some((axis, cos)) = light.sun()
        {
            self.sun = Some((axis, cos, light.excess()));
        }
        self.pictures.push(light);
    }

    /// Adds a light of constant radiance behind a portal.
    pub fn add_constant_behind(&mut self, portal: Portal, radiance: Spectra) {
        let mean = mean_of(&radiance) as f32;
        self.mean += mean;
        self.aimed += mean;
        self.windowed.push(Windowed { portal, source: Source::Constant(radiance), mean });
    }

    /// Adds a picture behind a portal.
    pub fn add_picture_behind(&mut self, portal: Portal, light: PictureLight) {
        let mean = light.mean;
        self.mean += mean;
        self.aimed += mean;
        self.windowed.push(Windowed { portal, source: Source::Picture(light), mean });
    }

    /// Returns an estimate of the irradiance that everything at infinity causes; 0 if all is black.
    pub fn importance(&self) -> f32 {
        PI * self.mean
    }

    /// Returns the radiance that arrives at p from the unit direction `d`; only portals ask where p is.
    #[inline]
    pub fn radiance<const N: usize>(&self, p: Vec3, d: Vec3, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        self.even_radiance(d, wavelengths) + self.aimed_radiance(p, d, wavelengths)
    }

    /// Returns the part of the radiance that connections leave to chance.
    #[inline]
    pub fn even_radiance<const N: usize>(&self, d: Vec3, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        let mut sum = Spectrum::ZERO;
        for c in &self.constants {
            sum += c.sample(wavelengths);
        }
        for picture in self.pictures.iter().filter(|l| l.aim.is_none()) {
            sum += picture.radiance(d, wavelengths);
        }
        sum
    }

    /// Returns the part of the radiance that connections take part in: that of whole lights, not of their bright spots.
    #[inline]
    pub fn aimed_radiance<const N: usize>(&self, p: Vec3, d: Vec3, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        let mut sum = Spectrum::ZERO;
        for picture in self.pictures.iter().filter(|l| l.aim.is_some()) {
            sum += picture.radiance(d, wavelengths);
        }
        for light in &self.windowed {
            sum += light.radiance(p, d, wavelengths);
        }
        sum
    }

    /// Returns axis and cosine of the half angle of a narrow cone that holds most of what there is to aim at, if there is one.
    pub fn sun(&self) -> Option<(Vec3, f32)> {
        self.sun.map(|s| (s.0, s.1))
    }

    /// Returns an estimate of the irradiance by what connections aim at; 0 if there is nothing.
    pub fn aimed_importance(&self) -> f32 {
        PI * self.aimed
    }

    /// Returns the density of [`Environment::aim`] for the unit direction `d` [1/sr].
    pub fn aimed_pdf(&self, p: Vec3, d: Vec3) -> f32 {
        self.aimed_pdf_with(p, d, None)
    }

    /// The same where the density of one picture is known.
    fn aimed_pdf_with(&self, p: Vec3, d: Vec3, known: Option<(usize, f32)>) -> f32 {
        let mut sum = 0.0;
        for (i, l) in self.pictures.iter().enumerate() {
            let pdf = match (known, &l.aim) {
                (Some((k, pdf)), _) if k == i => pdf,
                (_, Some(aim)) => l.density(&aim.0, d),
                (_, None) => 0.0,
            };
            sum += l.excess() * pdf;
        }
        self.windowed.iter().fold(sum, |s, l| s + l.mean * l.pdf(p, d)) / self.aimed
    }

    /// Chooses a direction that connections aim at, and returns its density: of the pixel that was drawn, on whichever side of its edge rounding
    /// puts the direction. Beside a sun of a single pixel that would make a factor of 1e5.
    pub fn aim(&self, p: Vec3, choice: f64, u: [f64; 2]) -> Option<(Vec3, f32)> {
        let mut choice = choice * f64::from(self.aimed);
        for light in &self.windowed {
            let mean = f64::from(light.mean);
            if choice < mean {
                let (d, pdf) = light.sample(p, choice / mean, u)?;
                let others = self.aimed_pdf(p, d) - light.mean / self.aimed * light.pdf(p, d);
                return Some((d, others.max(0.0) + light.mean / self.aimed * pdf));
            }
            choice -= mean;
        }
        let mut chosen = None;
        for (i, l) in self.pictures.iter().enumerate() {
            let Some((distribution, excess)) = &l.aim else { continue };
            chosen = Some((i, distribution));
            choice -= f64::from(*excess);
            if choice < 0.0 {
                break;
            }
        }
        let (i, distribution) = chosen?;
        let (d, pdf) = self.pictures[i].draw(distribution, u)?;
        Some((d, self.aimed_pdf_with(p, d, Some((i, pdf)))))
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
                    return light.sample(p, (choice / mean).clamp(0.0, 1.0 - f64::EPSILON), u).map(|s| s.0);
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
    /// The density of connections, and the mean of the excess; `None` for a picture that is even.
    aim: Option<(PixelDistribution, f32)>,
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
        let plain = picture.mean_of(|[r, g, b]| (r + g + b) / 3.0);
        let mean = (plain * f64::from(factor)) as f32;
        let variance = picture.mean_of(|[r, g, b]| ((r + g + b) / 3.0 / plain as f32).powi(2)) - 1.0;
        let above: Vec<f32> = weights.iter().map(|w| (w - plain as f32).max(0.0)).collect();
        let excess = (above.iter().map(|&x| f64::from(x)).sum::<f64>() / above.len() as f64 * f64::from(factor)) as f32;
        let distribution =
            |w: &[f32]| PixelDistribution::new(picture.width, picture.height, w).filter(|_| factor > 0.0);
        Ok(Self {
            distribution: distribution(&weights),
            aim: if variance < EVEN { None } else { distribution(&above).map(|d| (d, excess)) },
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
        self.distribution.as_ref().map_or(0.0, |distribution| self.density(distribution, d))
    }

    fn sample(&self, u: [f64; 2]) -> Option<Vec3> {
        self.draw(self.distribution.as_ref()?, u).map(|s| s.0)
    }

    /// Returns the mean by which what connections aim at exceeds the mean radiance; 0 if they leave the picture out.
    fn excess(&self) -> f32 {
        self.aim.as_ref().map_or(0.0, |a| a.1)
    }

    /// Returns axis and cosine of the half angle of a narrow cone with most of the excess, if there is one.
    fn sun(&self) -> Option<(Vec3, f32)> {
        const BINS: usize = 64;
        let (distribution, _) = self.aim.as_ref()?;
        let (width, height) = (self.picture.width, self.picture.height);
        let pixels = || {
            (0..width * height).filter_map(|i| {
                let (x, y) = ((i % width) as f64, (i / width) as f64);
                let at = [(x + 0.5) / width as f64, (y + 0.5) / height as f64];
                let excess = distribution.pdf(at);
                (excess > 0.0).then(|| ((self.to_world * direction_of(at)).normalize().as_dvec3(), excess))
            })
        };
        let axis = pixels().fold(DVec3::ZERO, |sum, (d, excess)| sum + d * excess).try_normalize()?;
        let (mut bins, mut total) = ([0.0; BINS], 0.0);
        for (d, excess) in pixels() {
            total += excess;
            let bin = (d.dot(axis).clamp(-1.0, 1.0).acos() / NARROW * BINS as f64) as usize;
            if bin < BINS {
                bins[bin] += excess;
            }
        }
        let mut sum = 0.0;
        let bin = bins.iter().position(|b| {
            sum += b;
            sum >= MOST_OF_IT * total
        })?;
        // Half the diagonal of a pixel is about 2.5 / width.
        let half = NARROW * (bin + 1) as f64 / BINS as f64 + 2.5 / width as f64;
        Some((axis.as_vec3(), half.cos() as f32))
    }

    /// Returns the density of a direction over the sphere, for one over the picture [1/sr].
    fn density(&self, distribution: &PixelDistribution, d: Vec3) -> f32 {
        let local = self.to_light * d;
        let length = local.length();
        self.per_angle(distribution.pdf(square_of(local / length)), length)
    }

    /// Draws a direction, and returns its density as that of the pixel drawn.
    fn draw(&self, distribution: &PixelDistribution, u: [f64; 2]) -> Option<(Vec3, f32)> {
        let at = distribution.sample(u);
        let d = (self.to_world * direction_of(at)).try_normalize()?;
        Some((d, self.per_angle(distribution.pdf(at), (self.to_light * d).length())))
    }

    /// Returns a density over the sphere from one over the picture, for a direction of some length in the light's own space.
    fn per_angle(&self, density: f64, length: f32) -> f32 {
        let density = density as f32 * (0.25 * FRAC_1_PI);
        // A transform that stretches space changes solid angles by |det| / |M d|^3.
        if self.rigid { density } else { density / (self.inverse_determinant * length * length * length) }
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
