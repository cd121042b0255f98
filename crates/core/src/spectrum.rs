//! Spectra sampled at the N wavelengths that one light path carries.

use std::array;
use std::ops::{Add, AddAssign, Div, DivAssign, Index, Mul, MulAssign, Sub};

/// A value per wavelength of a path: N = 1 (one monochromatic problem), 3 (rgb) or 4 (hero wavelengths).
///
/// Lane 0 is the hero: directions and distances are sampled for it, the others follow with weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrum<const N: usize>(pub [f32; N]);

impl<const N: usize> Spectrum<N> {
    /// Returns the spectrum whose lane i is f(i).
    #[inline]
    pub fn from_fn(f: impl FnMut(usize) -> f32) -> Self {
        Self(array::from_fn(f))
    }

    /// All lanes zero.
    pub const ZERO: Self = Self([0.0; N]);
    /// All lanes one.
    pub const ONE: Self = Self([1.0; N]);

    /// Returns a spectrum with the same value in every lane.
    #[inline]
    pub fn splat(x: f32) -> Self {
        Self([x; N])
    }

    /// Returns f applied to each lane.
    #[inline]
    pub fn map(self, f: impl FnMut(f32) -> f32) -> Self {
        Self(self.0.map(f))
    }

    /// Returns f applied to corresponding lanes of two spectra.
    #[inline]
    pub fn zip(self, o: Self, mut f: impl FnMut(f32, f32) -> f32) -> Self {
        Self(array::from_fn(|i| f(self.0[i], o.0[i])))
    }

    /// Returns the arithmetic mean over the lanes.
    #[inline]
    pub fn mean(self) -> f32 {
        self.0.iter().sum::<f32>() * (1.0 / N as f32)
    }

    /// Returns the largest lane.
    #[inline]
    pub fn max_value(self) -> f32 {
        self.0.iter().copied().fold(f32::NEG_INFINITY, f32::max)
    }

    /// Returns the smallest lane.
    #[inline]
    pub fn min_value(self) -> f32 {
        self.0.iter().copied().fold(f32::INFINITY, f32::min)
    }

    /// Returns whether every lane is zero.
    #[inline]
    pub fn is_black(self) -> bool {
        self.0.iter().all(|&x| x == 0.0)
    }

    /// Returns whether every lane is finite.
    #[inline]
    pub fn is_finite(self) -> bool {
        self.0.iter().all(|x| x.is_finite())
    }

    /// Returns whether all lanes are equal (an achromatic value).
    #[inline]
    pub fn is_gray(self) -> bool {
        self.0.iter().all(|&x| x == self.0[0])
    }

    /// Returns the quotient per lane, 0 where the divisor is 0.
    #[inline]
    pub fn safe_div(self, o: Self) -> Self {
        self.zip(o, |a, b| if b != 0.0 { a / b } else { 0.0 })
    }
}

macro_rules! lane_ops {
    ($($trait:ident $f:ident $assign:ident $fa:ident $op:tt),*) => {$(
        impl<const N: usize> $trait for Spectrum<N> {
            type Output = Self;
            #[inline]
            fn $f(self, o: Self) -> Self {
                Self(array::from_fn(|i| self.0[i] $op o.0[i]))
            }
        }
        impl<const N: usize> $trait<f32> for Spectrum<N> {
            type Output = Self;
            #[inline]
            fn $f(self, o: f32) -> Self {
                Self(self.0.map(|x| x $op o))
            }
        }
    )*};
}
lane_ops!(Add add AddAssign add_assign +, Sub sub SubAssign sub_assign -, Mul mul MulAssign mul_assign *, Div div DivAssign div_assign /);

impl<const N: usize> AddAssign for Spectrum<N> {
    #[inline]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<const N: usize> MulAssign for Spectrum<N> {
    #[inline]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}
impl<const N: usize> MulAssign<f32> for Spectrum<N> {
    #[inline]
    fn mul_assign(&mut self, o: f32) {
        *self = *self * o;
    }
}
impl<const N: usize> DivAssign<f32> for Spectrum<N> {
    #[inline]
    fn div_assign(&mut self, o: f32) {
        *self = *self / o;
    }
}
impl<const N: usize> Index<usize> for Spectrum<N> {
    type Output = f32;
    #[inline]
    fn index(&self, i: usize) -> &f32 {
        &self.0[i]
    }
}
