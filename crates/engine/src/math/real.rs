//! The binary formats that a floating-point filter of a geometric predicate is written for.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::math::array;

/// `f32` or `f64`: the operations of formulas that are generic over both.
pub trait Real:
    Copy
    + Default
    + PartialOrd
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// The number 0.
    const ZERO: Self;
    /// The number 1.
    const ONE: Self;
    /// The unit roundoff: 2^-24 or 2^-53. One operation is off by at most this, relatively.
    const UNIT: Self;

    /// Converts exactly.
    fn from_f32(value: f32) -> Self;
    /// Rounds to nearest.
    fn from_f64(value: f64) -> Self;
    /// Rounds to nearest even.
    fn to_f32(self) -> f32;
    /// The correctly rounded square root.
    fn sqrt(self) -> Self;
    /// The absolute value.
    fn abs(self) -> Self;

    /// The maximum; the other one if one is a NaN.
    fn max(self, other: Self) -> Self;
    /// The minimum; the other one if one is a NaN.
    fn min(self, other: Self) -> Self;
}

macro_rules! real {
    ($ty:ty, $unit:expr) => {
        impl Real for $ty {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const UNIT: Self = $unit;

            #[inline(always)]
            fn from_f32(value: f32) -> Self {
                value.into()
            }

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as $ty
            }

            #[inline(always)]
            fn to_f32(self) -> f32 {
                self as f32
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                self.sqrt()
            }

            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }

            #[inline(always)]
            fn max(self, other: Self) -> Self {
                self.max(other)
            }

            #[inline(always)]
            fn min(self, other: Self) -> Self {
                self.min(other)
            }
        }
    };
}

real!(f32, f32::EPSILON / 2.0);
real!(f64, f64::EPSILON / 2.0);

/// Converts three components to another format, exactly.
#[inline(always)]
pub fn from_f32<R: Real>(v: [f32; 3]) -> [R; 3] {
    array::map(v, R::from_f32)
}

/// The difference `a - b`.
#[inline(always)]
pub fn sub<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The sum `a + b`.
#[inline(always)]
pub fn add<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// The vector `s * v`.
#[inline(always)]
pub fn scale<R: Real>(s: R, v: [R; 3]) -> [R; 3] {
    [s * v[0], s * v[1], s * v[2]]
}

/// The dot product.
#[inline(always)]
pub fn dot<R: Real>(a: [R; 3], b: [R; 3]) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The cross product.
#[inline(always)]
pub fn cross<R: Real>(a: [R; 3], b: [R; 3]) -> [R; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The 1-norm, the sum of the absolute components: an upper bound of the length without a square
/// root.
#[inline(always)]
pub fn norm1<R: Real>(v: [R; 3]) -> R {
    v[0].abs() + v[1].abs() + v[2].abs()
}
