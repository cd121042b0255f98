//! Lights, as a file says them.

use moonmilk_core::{Mat4, Vec3};

use super::*;

/// Emission of a shape.
#[derive(Clone, Debug)]
pub struct AreaLightDescription {
    /// Where it was said.
    pub place: Place,
    /// Emitted radiance before `scale`.
    pub radiance: SpectrumDescription,
    /// Factor, with `power` already resolved to `None` or kept there.
    pub scale: f32,
    /// Emits on both sides.
    pub two_sided: bool,
    /// Total power asked for.
    pub power: Option<f32>,
    /// Image of the radiance over (u, v).
    pub image: Option<ImageId>,
}

/// A light that is not a shape.
#[derive(Clone, Debug)]
pub struct LightDescription {
    /// Where it was said.
    pub place: Place,
    /// Light to world space.
    pub light_to_world: Mat4,
    /// Factor on its emission.
    pub scale: f32,
    /// Total power or illuminance asked for (meaning per kind as in pbrt).
    pub power: Option<f32>,
    /// Kind and parameters.
    pub kind: LightKind,
    /// Medium around the light.
    pub medium: Option<MediumId>,
    /// Corners in world space of a rectangle through which alone an infinite light shines.
    pub portal: Option<[Vec3; 4]>,
}

/// Kinds of lights.
#[derive(Clone, Debug)]
pub enum LightKind {
    /// A point that shines equally in all directions; intensity [power per solid angle].
    Point {
        /// Position in light space.
        from: Vec3,
        /// Intensity.
        intensity: SpectrumDescription,
    },
    /// A cone of light.
    Spot {
        /// Position in light space.
        from: Vec3,
        /// Point looked at.
        to: Vec3,
        /// Intensity on the axis.
        intensity: SpectrumDescription,
        /// Half angle of the cone \[degrees\].
        cone_angle: f32,
        /// Width of the soft edge \[degrees\].
        cone_delta_angle: f32,
    },
    /// A point whose intensity is multiplied by a picture over the sphere of directions.
    Goniometric {
        /// Intensity where the picture is 1.
        intensity: SpectrumDescription,
        /// Square equal-area octahedral picture in light space, of which the mean of the components counts.
        image: ImageId,
    },
    /// A point that throws a picture along +z; its first row is at negative y, its first column at negative x.
    Projection {
        /// Picture, whose colours are intensities.
        image: ImageId,
        /// Angle across its shorter side \[degrees\].
        fov: f32,
    },
    /// Parallel light; radiance x solid angle [irradiance on a facing plane].
    Distant {
        /// Where the light comes from, in light space.
        from: Vec3,
        /// Where it goes to.
        to: Vec3,
        /// Irradiance on a plane that faces it.
        irradiance: SpectrumDescription,
    },
    /// The same radiance from all directions.
    Constant {
        /// Radiance.
        radiance: SpectrumDescription,
    },
    /// Radiance from an equal-area octahedral picture, in light space.
    Environment {
        /// Square picture.
        image: ImageId,
    },
}
