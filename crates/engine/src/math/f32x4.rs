//! Four `f32` lanes of SIMD: SSE2 registers on x86-64, NEON on 64-bit Arm, scalars elsewhere.
//!
//! [`F32x4`] wraps glam's `Vec4`. It uses only IEEE operations on single lanes, which round alike
//! on all machines; none of glam's sums, dot products or lengths. [`FmaOps`] has the operations
//! that may round once instead of twice.

use std::ops::{Add, Div, Mul, Sub};

use glam::Vec4;
#[cfg(target_arch = "x86_64")]
use pulp::x86::V3;

use crate::math::array;
use crate::math::baseline_simd::BaselineSimd;

/// The number of lanes.
pub const LANES: usize = 4;

/// Four `f32` lanes.
#[derive(Clone, Copy, Debug, Default)]
pub struct F32x4(Vec4);

impl F32x4 {
    /// 0 in all lanes.
    pub const ZERO: Self = Self(Vec4::ZERO);

    /// Makes a value from its lanes.
    #[inline(always)]
    pub fn new(values: [f32; LANES]) -> Self {
        Self(Vec4::from_array(values))
    }

    /// One value in all lanes.
    #[inline(always)]
    pub fn splat(value: f32) -> Self {
        Self(Vec4::splat(value))
    }

    /// The lanes as an array.
    #[inline(always)]
    pub fn to_array(self) -> [f32; LANES] {
        self.0.to_array()
    }

    /// The absolute value of each lane.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self(self.0.abs())
    }

    /// The square root of each lane.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        // `map` over four lanes is not inlined.
        let [a, b, c, d] = self.to_array();
        Self::new([a.sqrt(), b.sqrt(), c.sqrt(), d.sqrt()])
    }

    /// The maximum of each lane; unspecified which of the two if one is a NaN.
    #[inline(always)]
    pub fn relaxed_max(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }

    /// The minimum of each lane; unspecified which of the two if one is a NaN.
    #[inline(always)]
    pub fn relaxed_min(self, other: Self) -> Self {
        Self(self.0.min(other.0))
    }

    /// The maximum of each lane; `other` if one of the two is a NaN (SSE's `maxps`).
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        if cfg!(target_feature = "sse2") {
            // `maxps` has these semantics.
            return Self(self.0.max(other.0));
        }
        Self(Vec4::select(self.0.cmpgt(other.0), self.0, other.0))
    }

    /// The minimum of each lane; `other` if one of the two is a NaN (SSE's `minps`).
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        if cfg!(target_feature = "sse2") {
            return Self(self.0.min(other.0));
        }
        Self(Vec4::select(self.0.cmplt(other.0), self.0, other.0))
    }

    /// The next smaller number in each lane, as [`f32::next_down`] of what is no NaN. It is written
    /// without branches, for all lanes at once.
    #[inline(always)]
    pub fn next_down(self) -> Self {
        // Ascends with the numbers; a zero counts as the negative one.
        let key = |x: f32| {
            let bits = (-(0.0 - x)).to_bits() as i32;
            bits ^ ((bits >> 31) as u32 >> 1) as i32
        };
        let least = key(f32::NEG_INFINITY);
        let keys = array::map(self.to_array(), |x| (key(x) - 1).max(least));
        Self::new(array::map(keys, |key| f32::from_bits((key ^ ((key >> 31) as u32 >> 1) as i32) as u32)))
    }

    /// The next greater number in each lane, as [`f32::next_up`] of what is no NaN.
    #[inline(always)]
    pub fn next_up(self) -> Self {
        Self(-(Self(-self.0).next_down().0))
    }

    /// A mask of the lanes in which `self > other`.
    #[inline(always)]
    pub fn cmp_gt(self, other: Self) -> u32 {
        self.0.cmpgt(other.0).bitmask()
    }

    /// A mask of the lanes in which `self >= other`.
    #[inline(always)]
    pub fn cmp_ge(self, other: Self) -> u32 {
        self.0.cmpge(other.0).bitmask()
    }
}

/// Multiply-add operations, for filters with an error bound only: whether the product is rounded
/// depends on the CPU.
pub trait FmaOps: Copy {
    /// `a b + c`, rounded once or twice.
    fn fma(self, a: F32x4, b: F32x4, c: F32x4) -> F32x4;
    /// `a b - c`, rounded once or twice.
    fn fms(self, a: F32x4, b: F32x4, c: F32x4) -> F32x4;

    /// The dot product of three-component vectors.
    #[inline(always)]
    fn fma_dot(self, a: [F32x4; 3], b: [F32x4; 3]) -> F32x4 {
        self.fma(a[0], b[0], self.fma(a[1], b[1], a[2] * b[2]))
    }

    /// The cross product.
    #[inline(always)]
    fn fma_cross(self, a: [F32x4; 3], b: [F32x4; 3]) -> [F32x4; 3] {
        [
            self.fms(a[1], b[2], a[2] * b[1]),
            self.fms(a[2], b[0], a[0] * b[2]),
            self.fms(a[0], b[1], a[1] * b[0]),
        ]
    }
}

/// On the baseline every product is rounded.
impl FmaOps for BaselineSimd {
    #[inline(always)]
    fn fma(self, a: F32x4, b: F32x4, c: F32x4) -> F32x4 {
        a * b + c
    }

    #[inline(always)]
    fn fms(self, a: F32x4, b: F32x4, c: F32x4) -> F32x4 {
        a * b - c
    }
}

/// On AVX2 no product is rounded. To be used in code that [`V3::vectorize`] compiles.
#[cfg(target_arch = "x86_64")]
impl FmaOps for V3 {
    #[inline(always)]
    fn fma(self, a: F32x4, b: F32x4, c: F32x4) -> F32x4 {
        let [a, b, c] = [a.to_array(), b.to_array(), c.to_array()];
        F32x4::new(pulp::cast(self.mul_add_f32x4(pulp::cast(a), pulp::cast(b), pulp::cast(c))))
    }

    #[inline(always)]
    fn fms(self, a: F32x4, b: F32x4, c: F32x4) -> F32x4 {
        let [a, b, c] = [a.to_array(), b.to_array(), c.to_array()];
        F32x4::new(pulp::cast(self.mul_sub_f32x4(pulp::cast(a), pulp::cast(b), pulp::cast(c))))
    }
}

macro_rules! operators {
    ($($operator:ident $method:ident)*) => {$(
        impl $operator for F32x4 {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self($operator::$method(self.0, other.0))
            }
        }
    )*};
}
operators!(Add add Sub sub Mul mul Div div);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_the_scalar_operations() {
        let special = [
            0.0,
            -0.0,
            1.0,
            -2.5,
            1e-45,
            f32::MAX,
            f32::INFINITY,
            f32::NAN,
            -1e-45,
            f32::MIN,
            f32::NEG_INFINITY,
            -f32::MIN_POSITIVE,
        ];
        let same = |a: f32, b: f32| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
        for i in 0..144 {
            let a: [f32; 4] = std::array::from_fn(|lane| special[(i + lane) % 12]);
            let b: [f32; 4] = std::array::from_fn(|lane| special[(i / 12 + 3 * lane) % 12]);
            let (x, y) = (F32x4::new(a), F32x4::new(b));
            let results =
                [x + y, x - y, x * y, x / y, x.abs(), x.sqrt(), x.max(y), x.min(y)].map(F32x4::to_array);
            for lane in 0..4 {
                let (p, q) = (a[lane], b[lane]);
                let (above, below) = (if p > q { p } else { q }, if p < q { p } else { q });
                let wanted = [p + q, p - q, p * q, p / q, p.abs(), p.sqrt(), above, below];
                for (found, wanted) in results.iter().zip(wanted) {
                    assert!(same(found[lane], wanted), "{p} {q}: {} {wanted}", found[lane]);
                }
                assert_eq!(x.cmp_gt(y) >> lane & 1 != 0, p > q);
                assert_eq!(x.cmp_ge(y) >> lane & 1 != 0, p >= q);
                if !p.is_nan() {
                    assert!(same(x.next_down().to_array()[lane], p.next_down()), "{p}");
                    assert!(same(x.next_up().to_array()[lane], p.next_up()), "{p}");
                }
                if !p.is_nan() && !q.is_nan() {
                    assert_eq!(x.relaxed_max(y).to_array()[lane], p.max(q));
                    assert_eq!(x.relaxed_min(y).to_array()[lane], p.min(q));
                }
            }
        }
    }
}
