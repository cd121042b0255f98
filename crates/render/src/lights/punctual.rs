//! Lights without extent: points, spots and parallel light.

use std::f64::consts::{FRAC_PI_2, PI};

use moonmilk_core::{DVec3, Spectra, Spectrum, Vec3, Wavelengths};

use super::bounds::LightBounds;
use super::emission::{checked, emission, factor, mean_of};
use super::error::LightError;
use crate::description::{LightDescription, LightKind, SpectrumDescription};

/// Returns where a light is in world space, if it is at a point.
pub fn position(light: &LightDescription) -> Option<Vec3> {
    match &light.kind {
        LightKind::Point { from, .. } | LightKind::Spot { from, .. } => {
            Some(light.light_to_world.transform_point3(*from))
        }
        _ => None,
    }
}

/// A point or spot light.
#[derive(Debug)]
pub struct Punctual {
    position: Vec3,
    intensity: Spectra,
    mean: f64,
    /// Axis and edges of a spot.
    cone: Option<Cone>,
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
    /// Returns the point or spot that is described; other kinds are an invariant of the caller.
    pub fn new(light: &LightDescription) -> Result<Self, LightError> {
        let m = &light.light_to_world;
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
                Self::with(light, *from, intensity, power, Some(cone))
            }
            LightKind::Point { from, intensity } => Self::with(light, *from, intensity, 4.0 * PI, None),
            _ => Err(LightError::Direction { place: light.place.clone() }),
        }
    }

    fn with(
        light: &LightDescription,
        from: Vec3,
        intensity: &SpectrumDescription,
        power: f64,
        cone: Option<Cone>,
    ) -> Result<Self, LightError> {
        let factor = factor(light.scale, light.power, power, &light.place)?;
        let intensity = emission(intensity, factor, &light.place)?;
        let mean = mean_of(&intensity);
        Ok(Self { position: light.light_to_world.transform_point3(from), intensity, mean, cone })
    }

    /// Returns where the light is.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Returns where the light is and where it shines.
    pub fn bounds(&self) -> LightBounds {
        let (axis, theta_o, theta_e) = match &self.cone {
            None => (DVec3::Z, PI, FRAC_PI_2),
            Some(c) => {
                // Rounded outwards by more than the cosines' own rounding near 1.
                let (start, end) = (f64::from(c.cos_start).acos(), f64::from(c.cos_end).acos());
                (c.axis.as_dvec3(), start, (end - start + 1e-3).min(FRAC_PI_2))
            }
        };
        // A soft edge wider than a right angle does not fit into theta_e: widen the core instead.
        let theta_o = match &self.cone {
            Some(c) => theta_o.max(f64::from(c.cos_end).acos() - theta_e + 1e-3).min(PI),
            None => theta_o,
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

    /// Returns irradiance on a plane at p that faces the light, direction to it and distance; `None` outside a spot's cone.
    pub fn sample<const N: usize>(&self, p: Vec3, wavelengths: &Wavelengths<N>) -> Option<(Spectrum<N>, Vec3, f32)> {
        let to = self.position.as_dvec3() - p.as_dvec3();
        let distance = to.length();
        if distance == 0.0 {
            return None;
        }
        let wi = (to / distance).as_vec3();
        let falloff = self.cone.as_ref().map_or(1.0, |c| c.falloff(-c.axis.dot(wi)));
        let weight = f64::from(falloff) / (distance * distance);
        let irradiance = self.intensity.sample(wavelengths) * weight as f32;
        (falloff > 0.0 && irradiance.is_finite()).then_some((irradiance, wi, distance as f32))
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
