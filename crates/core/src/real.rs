//! One formula, many kinds of number: `f32`, `f64` and forward dual numbers.
//!
//! A formula written once over `T: Real` gives its value with `f64` and its exact derivatives with [`Dual`]: no difference quotients and
//! no second copy of the source.
//!
//! ```
//! use moonmilk_core::{Dual, Real};
//!
//! fn yukawa<T: Real>(r: T, kappa: T) -> T {
//!     (-(kappa * r)).exp() / r
//! }
//! let (r, kappa) = (Dual::<2>::variable(2.0, 0), Dual::variable(0.5, 1));
//! let y = yukawa(r, kappa);
//! assert_eq!(y.value, yukawa(2.0, 0.5));
//! assert!((y.partials[0] + y.value * (0.5 + 0.5)).abs() < 1e-15); // d/dr = -(kappa + 1/r) y
//! ```

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number that formulas can be written over.
pub trait Real:
    Copy
    + Debug
    + PartialOrd
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Whether the number carries derivatives, so that costly slopes can be left out where they are not used.
    const CARRIES_DERIVATIVES: bool;

    /// Returns the constant x.
    fn from_f64(x: f64) -> Self;

    /// Returns the value, without derivatives.
    fn value(self) -> f64;

    /// Returns f(self) for a function known by its value and its slope at `self`: any special function enters here.
    fn lift(self, value: f64, slope: f64) -> Self;

    /// Returns e^x.
    fn exp(self) -> Self;

    /// Returns the natural logarithm.
    fn ln(self) -> Self;

    /// Returns the square root.
    fn sqrt(self) -> Self;

    /// Returns x to a whole power.
    fn powi(self, n: i32) -> Self;

    /// Returns k x for a constant k.
    #[inline]
    fn scale(self, k: f64) -> Self {
        self * Self::from_f64(k)
    }

    /// Returns x + k for a constant k.
    #[inline]
    fn offset(self, k: f64) -> Self {
        self + Self::from_f64(k)
    }

    /// Returns x x.
    #[inline]
    fn squared(self) -> Self {
        self * self
    }

    /// Returns 1 / x.
    #[inline]
    fn recip(self) -> Self {
        Self::from_f64(1.0) / self
    }

    /// Returns x to a real power, for x > 0.
    #[inline]
    fn powf(self, p: f64) -> Self {
        (self.ln().scale(p)).exp()
    }

    /// Returns the larger of two numbers, by value.
    #[inline]
    fn larger(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
}

macro_rules! plain {
    ($t:ty) => {
        impl Real for $t {
            const CARRIES_DERIVATIVES: bool = false;

            #[inline]
            fn from_f64(x: f64) -> Self {
                x as $t
            }
            #[inline]
            fn value(self) -> f64 {
                self as f64
            }
            #[inline]
            fn lift(self, value: f64, _slope: f64) -> Self {
                value as $t
            }
            #[inline]
            fn exp(self) -> Self {
                self.exp()
            }
            #[inline]
            fn ln(self) -> Self {
                self.ln()
            }
            #[inline]
            fn sqrt(self) -> Self {
                self.sqrt()
            }
            #[inline]
            fn powi(self, n: i32) -> Self {
                self.powi(n)
            }
            #[inline]
            fn powf(self, p: f64) -> Self {
                self.powf(p as $t)
            }
        }
    };
}
plain!(f32);
plain!(f64);

/// A number with its partial derivatives by N variables (forward mode).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const N: usize> {
    /// The value.
    pub value: f64,
    /// Derivatives by the N variables.
    pub partials: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// Returns the variable number `index` at the value x: its own derivative is 1, all others are 0.
    ///
    /// *Domain*: index < N.
    pub fn variable(x: f64, index: usize) -> Self {
        let mut partials = [0.0; N];
        partials[index] = 1.0;
        Self { value: x, partials }
    }

    /// Combines the derivatives of two numbers with two factors.
    #[inline]
    fn combine(self, other: Self, value: f64, a: f64, b: f64) -> Self {
        Self { value, partials: std::array::from_fn(|i| a * self.partials[i] + b * other.partials[i]) }
    }
}

impl<const N: usize> PartialOrd for Dual<N> {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        self.combine(o, self.value + o.value, 1.0, 1.0)
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        self.combine(o, self.value - o.value, 1.0, -1.0)
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        self.combine(o, self.value * o.value, o.value, self.value)
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    #[inline]
    fn div(self, o: Self) -> Self {
        let q = self.value / o.value;
        self.combine(o, q, 1.0 / o.value, -q / o.value)
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        self.lift(-self.value, -1.0)
    }
}

impl<const N: usize> Real for Dual<N> {
    const CARRIES_DERIVATIVES: bool = N > 0;

    #[inline]
    fn from_f64(x: f64) -> Self {
        Self { value: x, partials: [0.0; N] }
    }
    #[inline]
    fn value(self) -> f64 {
        self.value
    }
    #[inline]
    fn lift(self, value: f64, slope: f64) -> Self {
        Self { value, partials: self.partials.map(|p| if p == 0.0 { 0.0 } else { slope * p }) }
    }
    #[inline]
    fn exp(self) -> Self {
        let e = self.value.exp();
        self.lift(e, e)
    }
    #[inline]
    fn ln(self) -> Self {
        self.lift(self.value.ln(), 1.0 / self.value)
    }
    #[inline]
    fn sqrt(self) -> Self {
        let s = self.value.sqrt();
        self.lift(s, 0.5 / s)
    }
    #[inline]
    fn powi(self, n: i32) -> Self {
        self.lift(self.value.powi(n), f64::from(n) * self.value.powi(n - 1))
    }
    #[inline]
    fn powf(self, p: f64) -> Self {
        self.lift(self.value.powf(p), p * self.value.powf(p - 1.0))
    }
    #[inline]
    fn scale(self, k: f64) -> Self {
        self.lift(self.value * k, k)
    }
    #[inline]
    fn offset(self, k: f64) -> Self {
        Self { value: self.value + k, partials: self.partials }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uses every operation once.
    fn formula<T: Real>(x: T, y: T) -> T {
        let a = (x * y).exp() / (x + y).sqrt() - x.ln().scale(3.0);
        a + y.powi(3) - x.powf(1.7).offset(0.5) * (-y).exp() + x.recip().larger(y.recip()) + x.squared()
    }

    #[test]
    fn derivatives_agree_with_differences() {
        for (x, y) in [(0.7, 1.3), (2.0, 0.4), (1.1, 1.2)] {
            let d = formula(Dual::<2>::variable(x, 0), Dual::variable(y, 1));
            assert_eq!(d.value, formula(x, y));
            // Central differences of h = 1e-5: h^2 and rounding over h are below 1e-9 of values of order 10.
            let h = 1e-5;
            let dx = (formula(x + h, y) - formula(x - h, y)) / (2.0 * h);
            let dy = (formula(x, y + h) - formula(x, y - h)) / (2.0 * h);
            assert!((d.partials[0] - dx).abs() < 1e-8 && (d.partials[1] - dy).abs() < 1e-8, "{d:?} {dx} {dy}");
        }
    }

    #[test]
    fn single_precision_follows_the_same_source() {
        // A few roundings of f32 of values of order 10.
        assert!((f64::from(formula(0.7f32, 1.3f32)) - formula(0.7f64, 1.3)).abs() < 1e-5);
    }
}
