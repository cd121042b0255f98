//! Media whose coefficients depend on the place.
//!
//! A [`Field`] returns the coefficients at a point, an upper bound of the extinction along a ray ([`Majorants`]), and the
//! phase function. [`Grid`] holds values at the centres of voxels. Free flights through a field are sampled by
//! [`crate::heterogeneous`].

use moonmilk_core::{Random, Spectrum, Vec3};

use crate::medium::Medium;

pub mod grid;
pub mod majorants;

pub use grid::Grid;
pub use majorants::{Majorants, Track};

/// A medium whose coefficients depend on the place, at the N wavelengths of one walk.
pub trait Field<const N: usize> {
    /// Returns bounds over the cells of a grid, and the factor [1/length] that makes them bounds of sigma_t in every lane.
    ///
    /// Outside the grid the field is empty.
    fn majorants(&self) -> (&Majorants, f32);

    /// Returns (sigma_a, sigma_s) [1/length] at a point: random values whose *mean* is the field there, none of which exceeds
    /// the majorant.
    ///
    /// A random voxel, chosen by the weights of interpolation, serves as well as the interpolated value: the transport
    /// equation is linear in the coefficients at each point, and one look-up replaces eight.
    fn at<R: Random>(&self, p: Vec3, rng: &mut R) -> (Spectrum<N>, Spectrum<N>);

    /// Returns whether anything scatters. Where nothing does, light is attenuated on its way instead of ended at random.
    fn scatters(&self) -> bool;

    /// Returns whether anything is emitted.
    fn emits(&self) -> bool {
        false
    }

    /// Returns the radiance L_e at a point; sigma_a L_e is emitted per unit length.
    fn emission(&self, _p: Vec3) -> Spectrum<N> {
        Spectrum::ZERO
    }

    /// Returns a homogeneous medium of the given coefficients with the field's phase function: what a collision sees.
    fn local(&self, sigma_a: Spectrum<N>, sigma_s: Spectrum<N>) -> Medium<N>;
}
