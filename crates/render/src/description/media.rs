//! Participating media as a file says them.

use moonmilk_core::{Mat4, Vec3};

use super::{Place, SpectrumDescription};

/// A participating medium.
#[derive(Clone, Debug)]
pub struct MediumDescription {
    /// Name in the file.
    pub name: String,
    /// Where it was defined.
    pub place: Place,
    /// Its kind and coefficients.
    pub kind: MediumKind,
}

/// Kinds of media.
#[derive(Clone, Debug)]
pub enum MediumKind {
    /// The same everywhere.
    Homogeneous {
        /// Absorption coefficient [1/scene unit], scale applied separately.
        sigma_a: SpectrumDescription,
        /// Scattering coefficient [1/scene unit].
        sigma_s: SpectrumDescription,
        /// Factor on both coefficients.
        scale: f32,
        /// Asymmetry of the Henyey-Greenstein phase function.
        g: f32,
        /// Emitted radiance per unit length is sigma_a times this, as in pbrt; `None` for no emission.
        emission: Option<(SpectrumDescription, f32)>,
    },
    /// Coefficients times a density given on a grid: pbrt's `uniformgrid`.
    Densities(Box<DensityGrid>),
    /// Coefficients given on a grid as colours: pbrt's `rgbgrid`.
    Colours(Box<ColourGrid>),
    /// Coefficients times a procedural density: pbrt's `cloud`.
    Cloud(Box<CloudDescription>),
}

impl MediumKind {
    /// Returns whether the medium can emit.
    pub fn emits(&self) -> bool {
        match self {
            Self::Homogeneous { emission, .. } => emission.is_some(),
            Self::Densities(d) => !matches!(d.emission, GridEmission::None),
            Self::Colours(c) => !c.emission.is_empty() && c.emission_scale > 0.0,
            Self::Cloud(_) => false,
        }
    }
}

/// Where a field lies: a box in medium space. Outside it is empty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldBox {
    /// Medium to world space. Coefficients are per world unit, whatever its scale.
    pub medium_to_world: Mat4,
    /// A corner of the box in medium space.
    pub p0: Vec3,
    /// The opposite corner.
    pub p1: Vec3,
}

/// Densities at the centres of voxels, and what they multiply.
#[derive(Clone, Debug)]
pub struct DensityGrid {
    /// Where it lies.
    pub bounds: FieldBox,
    /// Numbers of voxels along x, y, z.
    pub size: [u32; 3],
    /// Densities, x fastest.
    pub density: Vec<f32>,
    /// Absorption coefficient at density 1 [1/scene unit].
    pub sigma_a: SpectrumDescription,
    /// Scattering coefficient at density 1 [1/scene unit].
    pub sigma_s: SpectrumDescription,
    /// Factor on both coefficients.
    pub scale: f32,
    /// Asymmetry of the Henyey-Greenstein phase function.
    pub g: f32,
    /// Its emission.
    pub emission: GridEmission,
    /// Factors on the emission at the centres of voxels, as many as densities; empty for 1.
    pub emission_scale: Vec<f32>,
}

/// Emission of a grid of densities; emitted radiance per unit length is sigma_a times it.
#[derive(Clone, Debug)]
pub enum GridEmission {
    /// None.
    None,
    /// The same spectrum everywhere.
    Spectrum(SpectrumDescription),
    /// Black bodies, peak 1 as in pbrt, of temperature (value - offset) * scale kelvin; none at 100 K and below.
    Temperature {
        /// Values at the centres of voxels, as many as densities.
        values: Vec<f32>,
        /// Subtracted from the interpolated value.
        offset: f32,
        /// Factor on the difference.
        scale: f32,
    },
}

/// Coefficients at the centres of voxels as linear sRGB colours.
#[derive(Clone, Debug)]
pub struct ColourGrid {
    /// Where it lies.
    pub bounds: FieldBox,
    /// Numbers of voxels along x, y, z.
    pub size: [u32; 3],
    /// Absorption coefficients [1/scene unit], x fastest; empty for 1 everywhere in the box.
    pub sigma_a: Vec<[f32; 3]>,
    /// Scattering coefficients [1/scene unit], x fastest; empty for 1 everywhere in the box.
    pub sigma_s: Vec<[f32; 3]>,
    /// Factor on both coefficients.
    pub scale: f32,
    /// Asymmetry of the Henyey-Greenstein phase function.
    pub g: f32,
    /// Emission; emitted radiance per unit length is sigma_a times it. Empty for none.
    pub emission: Vec<[f32; 3]>,
    /// Factor on the emission.
    pub emission_scale: f32,
}

/// pbrt's procedural cloud.
#[derive(Clone, Debug)]
pub struct CloudDescription {
    /// Where it lies.
    pub bounds: FieldBox,
    /// Absorption coefficient at density 1 [1/scene unit].
    pub sigma_a: SpectrumDescription,
    /// Scattering coefficient at density 1 [1/scene unit].
    pub sigma_s: SpectrumDescription,
    /// Asymmetry of the Henyey-Greenstein phase function.
    pub g: f32,
    /// Factor on the noise.
    pub density: f32,
    /// Strength of the swirls, 0 for none.
    pub wispiness: f32,
    /// Frequency of the noise.
    pub frequency: f32,
}

/// What is wrong with a field, and the parameter of the file that says it.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldFault {
    /// pbrt's name of the parameter.
    pub parameter: &'static str,
    /// One sentence.
    pub reason: String,
}

/// Returns the first fault of a list of voxels, if there is one.
fn check_voxels<'a>(
    parameter: &'static str,
    size: [u32; 3],
    n: usize,
    values: impl Iterator<Item = &'a f32>,
    signed: bool,
) -> Result<(), FieldFault> {
    let fault = |reason| Err(FieldFault { parameter, reason });
    let expected = size.iter().map(|&s| u128::from(s)).product::<u128>();
    if n as u128 != expected {
        let [x, y, z] = size;
        return fault(format!("`{parameter}` has {n} values, but nx * ny * nz = {x} * {y} * {z} = {expected}"));
    }
    for (i, &v) in values.enumerate() {
        if !(v.is_finite() && (signed || v >= 0.0)) {
            let range = if signed { "finite" } else { "in [0, inf)" };
            return fault(format!("value {} of `{parameter}` is {v}, not {range}", i + 1));
        }
    }
    Ok(())
}

fn check_number(parameter: &'static str, value: f32, valid: bool, range: &str) -> Result<(), FieldFault> {
    match valid {
        true => Ok(()),
        false => Err(FieldFault { parameter, reason: format!("{parameter} = {value} is outside {range}") }),
    }
}

fn check_common(bounds: &FieldBox, g: f32, scale: f32) -> Result<(), FieldFault> {
    check_number("g", g, g > -1.0 && g < 1.0, "(-1, 1)")?;
    check_number("scale", scale, scale >= 0.0 && scale.is_finite(), "[0, inf)")?;
    let FieldBox { medium_to_world, p0, p1 } = bounds;
    let flat = (*p1 - *p0).abs().min_element() <= 0.0 || !p0.is_finite() || !p1.is_finite();
    if flat {
        return Err(FieldFault { parameter: "p1", reason: format!("the box from {p0} to {p1} has no volume") });
    }
    let inverse = medium_to_world.inverse();
    if !medium_to_world.is_finite() || !inverse.is_finite() {
        return Err(FieldFault { parameter: "type", reason: "the transform of the medium has no inverse".into() });
    }
    Ok(())
}

impl DensityGrid {
    /// Returns the first fault, if there is one.
    pub fn check(&self) -> Result<(), FieldFault> {
        check_common(&self.bounds, self.g, self.scale)?;
        check_voxels("density", self.size, self.density.len(), self.density.iter(), false)?;
        if !self.emission_scale.is_empty() {
            check_voxels("Lescale", self.size, self.emission_scale.len(), self.emission_scale.iter(), false)?;
        }
        if let GridEmission::Temperature { values, offset, scale } = &self.emission {
            check_voxels("temperature", self.size, values.len(), values.iter(), true)?;
            check_number("temperatureoffset", *offset, offset.is_finite(), "(-inf, inf)")?;
            check_number("temperaturescale", *scale, scale.is_finite(), "(-inf, inf)")?;
        }
        Ok(())
    }
}

impl ColourGrid {
    /// Returns the first fault, if there is one.
    pub fn check(&self) -> Result<(), FieldFault> {
        check_common(&self.bounds, self.g, self.scale)?;
        check_number("Lescale", self.emission_scale, self.emission_scale.is_finite(), "(-inf, inf)")?;
        if self.sigma_a.is_empty() && self.sigma_s.is_empty() {
            let reason = "`sigma_a` or `sigma_s` is needed".into();
            return Err(FieldFault { parameter: "type", reason });
        }
        if self.sigma_a.is_empty() && !self.emission.is_empty() {
            return Err(FieldFault { parameter: "Le", reason: "`Le` needs `sigma_a`".into() });
        }
        for (name, colours) in [("sigma_a", &self.sigma_a), ("sigma_s", &self.sigma_s), ("Le", &self.emission)] {
            if !colours.is_empty() {
                check_voxels(name, self.size, colours.len(), colours.iter().flatten(), false)?;
            }
        }
        Ok(())
    }
}

impl CloudDescription {
    /// Returns the first fault, if there is one.
    pub fn check(&self) -> Result<(), FieldFault> {
        check_common(&self.bounds, self.g, 1.0)?;
        check_number("density", self.density, self.density >= 0.0 && self.density.is_finite(), "[0, inf)")?;
        check_number("wispiness", self.wispiness, self.wispiness.is_finite(), "(-inf, inf)")?;
        check_number("frequency", self.frequency, self.frequency.is_finite(), "(-inf, inf)")
    }
}
