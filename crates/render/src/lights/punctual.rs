//! Lights without extent: points, spots, goniometric and projection lights, and parallel light.
//!
//! A goniometric light multiplies its intensity by a picture over the sphere of directions; a projection light throws a picture like a slide
//! projector. Both take the colour of the nearest pixel, as pbrt-v4 (`lights.cpp`).

use std::f64::consts::{FRAC_PI_2, PI};

use moonmilk_core::glam::Mat3;
use moonmilk_core::upsampling::sample_unbounded;
use moonmilk_core::{DVec3, Spectra, Spectrum, Vec3, Wavelengths};

use super::bounds::LightBounds;
use super::emission::{LUMINANCE, Picture, checked, emission, factor, mean_of};
use super::error::LightError;
use super::octahedral::square_of;
use crate::description::{ImageDescription, LightDescription, LightKind, SpectrumDescription};

/// Returns where a light is in world space, if it is at a point.
pub fn position(light: &LightDescription) -> Option<Vec3> {
    match &light.kind {
        LightKind::Point { from, .. } | LightKind::Spot { from, .. } => {
            Some(light.light_to_world.transform_point3(*from))
        }
        LightKind::Goniometric { .. } | LightKind::Projection { .. } => Some(light.light_to_world.w_axis.truncate()),
        _ => None,
    }
}

/// A light at a point.
#[derive(Debug)]
pub struct Punctual {
    position: Vec3,
    intensity: Spectra,
    mean: f64,
    pattern: Pattern,
}

/// How the intensity depends on the direction.
#[derive(Debug)]
enum Pattern {
    /// Not at all.
    Even,
    /// A spot.
    Cone(Cone),
    /// By a picture over the sphere, equal-area octahedral: the mean of its components.
    Sphere { picture: Picture, to_light: Mat3 },
    /// By a picture on a plane across the light's z axis.
    Slide(Slide),
}

/// The slide of a projector.
#[derive(Debug)]
struct Slide {
    picture: Picture,
    to_light: Mat3,
    /// Axis in world space.
    axis: Vec3,
    /// Half width and half height of the picture at distance 1.
    half: [f32; 2],
}

impl Slide {
    /// Returns the colour that is thrown in a world direction.
    fn colour(&self, d: Vec3) -> Option<[f32; 3]> {
        let w = (self.to_light * d).normalize();
        // pbrt-v4's near plane.
        if w.z < 1e-3 {
            return None;
        }
        let [x, y] = [w.x / (w.z * self.half[0]), w.y / (w.z * self.half[1])];
        (x.abs() <= 1.0 && y.abs() <= 1.0)
            .then(|| self.picture.nearest([f64::from(0.5 + 0.5 * x), f64::from(0.5 + 0.5 * y)]))
    }

    /// Returns the integral of the luminance over directions: of a pixel at (x, y) on the plane at distance 1, dA / (1 + x^2 + y^2)^(3/2).
    fn power(&self) -> f64 {
        let (w, h) = (self.picture.width, self.picture.height);
        let [a, b] = self.half.map(f64::from);
        let place = |i: usize, n: usize, half: f64| half * (2.0 * (i as f64 + 0.5) / n as f64 - 1.0);
        let sum: f64 = (0..w * h)
            .map(|i| {
                let (x, y) = (place(i % w, w, a), place(i / w, h, b));
                let luminance: f32 = self.picture.rgb[i].iter().zip(LUMINANCE).map(|(c, l)| c * l).sum();
                f64::from(luminance) / (1.0 + x * x + y * y).powf(1.5)
            })
            .sum();
        sum * 4.0 * a * b / (w * h) as f64
    }
}

/// The cone of a spot: full intensity up to `start`, none from `end` on, a cubic in the cosine between (pbrt-v4's smooth step).
#[derive(Debug)]
struct Cone {
    axis: Vec3,
    cos_start: f32,
    cos_end: f32,
}

impl Cone {
    fn falloff(&self, cosine: f32) -> f32 {
        if self.cos_start <= self.cos_end {
            return if cosine > self.cos_end { 1.0 } else { 0.0 };
        }
        let t = ((cosine - self.cos_end) / (self.cos_start - self.cos_end)).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }
}

impl Punctual {
    /// Returns the light at a point that is described; other kinds are an invariant of the caller.
    pub fn new(light: &LightDescription, images: &[ImageDescription]) -> Result<Self, LightError> {
        let m = &light.light_to_world;
        let to_light = || {
            let inverse = Mat3::from_mat4(*m).inverse();
            if inverse.is_finite() { Ok(inverse) } else { Err(LightError::Direction { place: light.place.clone() }) }
        };
        match &light.kind {
            LightKind::Spot { from, to, intensity, cone_angle, cone_delta_angle } => {
                let axis = m.transform_vector3(*to - *from);
                let axis = axis.try_normalize().ok_or_else(|| LightError::Direction { place: light.place.clone() })?;
                let end = f64::from(checked("coneangle", *cone_angle, &light.place)?.min(180.0)).to_radians();
                let delta = f64::from(checked("conedeltaangle", *cone_delta_angle, &light.place)?).to_radians();
                let (cos_start, cos_end) = ((end - delta).max(0.0).cos(), end.cos());
                // The power at intensity 1: the integral of the smooth step is half its width.
                let power = 2.0 * PI * (1.0 - 0.5 * (cos_start + cos_end));
                let cone = Cone { axis, cos_start: cos_start as f32, cos_end: cos_end as f32 };
                Self::with(light, *from, intensity, power, Pattern::Cone(cone))
            }
            LightKind::Point { from, intensity } => Self::with(light, *from, intensity, 4.0 * PI, Pattern::Even),
            LightKind::Goniometric { intensity, image } => {
                let picture = Picture::new(&images[*image], &light.place)?;
                if picture.width != picture.height {
                    return Err(LightError::NotSquare {
                        place: light.place.clone(),
                        name: images[*image].name.clone(),
                        width: picture.width as u32,
                        height: picture.height as u32,
                    });
                }
                let mean = picture.mean_of(|[r, g, b]| (r + g + b) / 3.0);
                let pattern = Pattern::Sphere { picture, to_light: to_light()? };
                let mut lamp = Self::with(light, Vec3::ZERO, intensity, 4.0 * PI * mean, pattern)?;
                lamp.mean *= mean;
                Ok(lamp)
            }
            LightKind::Projection { image, fov } => {
                let picture = Picture::new(&images[*image], &light.place)?;
                let tangent = (0.5 * checked("fov", *fov, &light.place)?.to_radians()).tan();
                // The angle is that across the shorter side.
                let aspect = picture.width as f32 / picture.height as f32;
                let half = [tangent * aspect.max(1.0), tangent * (1.0 / aspect).max(1.0)];
                let axis = m.transform_vector3(Vec3::Z).try_normalize();
                let axis = axis.ok_or_else(|| LightError::Direction { place: light.place.clone() })?;
                let mean = picture.mean_of(|[r, g, b]| (r + g + b) / 3.0);
                let slide = Slide { picture, to_light: to_light()?, axis, half };
                let white = SpectrumDescription::Rgb([1.0; 3]);
                let mut lamp = Self::with(light, Vec3::ZERO, &white, slide.power(), Pattern::Slide(slide))?;
                lamp.mean *= mean;
                Ok(lamp)
            }
            _ => Err(LightError::Direction { place: light.place.clone() }),
        }
    }

    fn with(
        light: &LightDescription,
        from: Vec3,
        intensity: &SpectrumDescription,
        power: f64,
        pattern: Pattern,
    ) -> Result<Self, LightError> {
        let factor = factor(light.scale, light.power, power, &light.place)?;
        let intensity = emission(intensity, factor, &light.place)?;
        let mean = mean_of(&intensity);
        Ok(Self { position: light.light_to_world.transform_point3(from), intensity, mean, pattern })
    }

    /// Returns where the light is.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Returns where the light is and where it shines.
    pub fn bounds(&self) -> LightBounds {
        let (axis, theta_o, theta_e) = match &self.pattern {
            Pattern::Even | Pattern::Sphere { .. } => (DVec3::Z, PI, FRAC_PI_2),
            Pattern::Cone(c) => {
                // Rounded outwards by more than the cosines' own rounding near 1.
                let (start, end) = (f64::from(c.cos_start).acos(), f64::from(c.cos_end).acos());
                let theta_e = (end - start + 1e-3).min(FRAC_PI_2);
                // A soft edge wider than a right angle does not fit into theta_e: widen the core instead.
                (c.axis.as_dvec3(), start.max(end - theta_e + 1e-3).min(PI), theta_e)
            }
            Pattern::Slide(s) => {
                // A cone that holds all directions of the hemisphere that the slide may reach; a skewed transform may bend it anywhere.
                let corner = f64::from(s.half[0].hypot(s.half[1])).atan();
                let rigid = (s.to_light * s.to_light.transpose())
                    .abs_diff_eq(Mat3::IDENTITY * s.to_light.x_axis.length_squared(), 1e-5);
                (s.axis.as_dvec3(), if rigid { corner + 1e-3 } else { PI }, 1e-3)
            }
        };
        LightBounds {
            min: self.position,
            max: self.position,
            axis,
            theta_o,
            theta_e,
            two_sided: false,
            intensity: self.mean,
        }
    }

    /// Returns irradiance on a plane at p that faces the light, direction to it and distance; `None` where none is.
    pub fn sample<const N: usize>(&self, p: Vec3, wavelengths: &Wavelengths<N>) -> Option<(Spectrum<N>, Vec3, f32)> {
        let to = self.position.as_dvec3() - p.as_dvec3();
        let distance = to.length();
        if distance == 0.0 {
            return None;
        }
        let wi = (to / distance).as_vec3();
        let inverse_square = 1.0 / (distance * distance);
        let (weight, colour) = match &self.pattern {
            Pattern::Even => (1.0, None),
            Pattern::Cone(c) => (c.falloff(-c.axis.dot(wi)), None),
            Pattern::Sphere { picture, to_light } => {
                let [r, g, b] = picture.nearest(square_of((*to_light * -wi).normalize()));
                ((r + g + b) / 3.0, None)
            }
            Pattern::Slide(slide) => (1.0, Some(slide.colour(-wi)?)),
        };
        let mut irradiance = self.intensity.sample(wavelengths) * (f64::from(weight) * inverse_square) as f32;
        if let Some(rgb) = colour {
            irradiance *= sample_unbounded(rgb, wavelengths);
        }
        (weight > 0.0 && irradiance.is_finite()).then_some((irradiance, wi, distance as f32))
    }
}

/// Parallel light.
#[derive(Debug)]
pub struct Distant {
    /// Unit direction towards the light.
    pub towards: Vec3,
    irradiance: Spectra,
    mean: f32,
}

impl Distant {
    /// Returns the distant light that is described; other kinds are an invariant of the caller.
    pub fn new(light: &LightDescription) -> Result<Self, LightError> {
        let LightKind::Distant { from, to, irradiance } = &light.kind else {
            return Err(LightError::Direction { place: light.place.clone() });
        };
        let towards = light.light_to_world.transform_vector3(*from - *to);
        let towards = towards.try_normalize().ok_or_else(|| LightError::Direction { place: light.place.clone() })?;
        // Its power is the illuminance of a plane that faces it.
        let factor = factor(light.scale, light.power, 1.0, &light.place)?;
        let irradiance = emission(irradiance, factor, &light.place)?;
        let mean = mean_of(&irradiance) as f32;
        Ok(Self { towards, irradiance, mean })
    }

    /// Returns the irradiance on a plane that faces the light.
    pub fn irradiance<const N: usize>(&self, wavelengths: &Wavelengths<N>) -> Spectrum<N> {
        self.irradiance.sample(wavelengths)
    }

    /// Returns the mean irradiance on a surface of normal n, or on one that faces the light.
    #[inline]
    pub fn importance(&self, n: Option<Vec3>) -> f32 {
        self.mean * n.map_or(1.0, |n| n.dot(self.towards).max(0.0))
    }
}
