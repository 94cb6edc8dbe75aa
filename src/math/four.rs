//! Four `f32` side by side, operated on at once.
//!
//! glam's four-component vector under another name: SSE2 registers on x86-64, NEON on 64-bit Arm,
//! scalars elsewhere. Only lane-wise operations of IEEE are used, which round alike on all of them;
//! none of glam's sums, products of vectors or lengths. What may round once instead of twice is said by
//! [`Fused`].

use std::ops::{Add, Div, Mul, Sub};

use glam::Vec4;
#[cfg(target_arch = "x86_64")]
use pulp::x86::V3;

use crate::math::eight::TwoFours;

/// How many lanes there are.
pub const LANES: usize = 4;

/// Four numbers.
#[derive(Clone, Copy, Debug)]
pub struct Four(Vec4);

impl Four {
    /// 0 in all lanes.
    pub const ZERO: Self = Self(Vec4::ZERO);

    /// Lane by lane.
    #[inline(always)]
    pub fn new(values: [f32; LANES]) -> Self {
        Self(Vec4::from_array(values))
    }

    /// The same in all lanes.
    #[inline(always)]
    pub fn splat(value: f32) -> Self {
        Self(Vec4::splat(value))
    }

    /// The lanes.
    #[inline(always)]
    pub fn to_array(self) -> [f32; LANES] {
        self.0.to_array()
    }

    /// Magnitudes.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self(self.0.abs())
    }

    /// Square roots.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        // Not by `map` over four, which is a function of its own to the compiler.
        let [a, b, c, d] = self.to_array();
        Self::new([a.sqrt(), b.sqrt(), c.sqrt(), d.sqrt()])
    }

    /// The greater one; either where one is a NaN.
    #[inline(always)]
    pub fn greater(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }

    /// The lesser one; either where one is a NaN.
    #[inline(always)]
    pub fn lesser(self, other: Self) -> Self {
        Self(self.0.min(other.0))
    }

    /// `self` where it is greater, otherwise, and for a NaN, `other`.
    #[inline(always)]
    pub fn if_above(self, other: Self) -> Self {
        if cfg!(target_feature = "sse2") {
            // That is what its instruction does.
            return Self(self.0.max(other.0));
        }
        Self(Vec4::select(self.0.cmpgt(other.0), self.0, other.0))
    }

    /// `self` where it is less, otherwise, and for a NaN, `other`.
    #[inline(always)]
    pub fn if_below(self, other: Self) -> Self {
        if cfg!(target_feature = "sse2") {
            return Self(self.0.min(other.0));
        }
        Self(Vec4::select(self.0.cmplt(other.0), self.0, other.0))
    }

    /// A bit for each lane in which `self` is greater; none for a NaN.
    #[inline(always)]
    pub fn above(self, other: Self) -> u32 {
        self.0.cmpgt(other.0).bitmask()
    }

    /// A bit for each lane in which `self` is greater or equal; none for a NaN.
    #[inline(always)]
    pub fn at_least(self, other: Self) -> u32 {
        self.0.cmpge(other.0).bitmask()
    }
}

/// A way to make products that go into sums, for bounded attempts alone: whether such a product is rounded
/// depends on the processor.
pub trait Fused: Copy {
    /// `a b + c`
    fn fused_sum(self, a: Four, b: Four, c: Four) -> Four;
    /// `a b - c`
    fn fused_difference(self, a: Four, b: Four, c: Four) -> Four;

    /// The scalar product.
    #[inline(always)]
    fn fused_dot(self, a: [Four; 3], b: [Four; 3]) -> Four {
        self.fused_sum(a[0], b[0], self.fused_sum(a[1], b[1], a[2] * b[2]))
    }

    /// The vector product.
    #[inline(always)]
    fn fused_cross(self, a: [Four; 3], b: [Four; 3]) -> [Four; 3] {
        [
            self.fused_difference(a[1], b[2], a[2] * b[1]),
            self.fused_difference(a[2], b[0], a[0] * b[2]),
            self.fused_difference(a[0], b[1], a[1] * b[0]),
        ]
    }
}

/// On any machine: all are rounded.
impl Fused for TwoFours {
    #[inline(always)]
    fn fused_sum(self, a: Four, b: Four, c: Four) -> Four {
        a * b + c
    }

    #[inline(always)]
    fn fused_difference(self, a: Four, b: Four, c: Four) -> Four {
        a * b - c
    }
}

/// None is rounded; to be used in code that [`V3::vectorize`] compiles.
#[cfg(target_arch = "x86_64")]
impl Fused for V3 {
    #[inline(always)]
    fn fused_sum(self, a: Four, b: Four, c: Four) -> Four {
        let [a, b, c] = [a.to_array(), b.to_array(), c.to_array()];
        Four::new(pulp::cast(self.mul_add_f32x4(pulp::cast(a), pulp::cast(b), pulp::cast(c))))
    }

    #[inline(always)]
    fn fused_difference(self, a: Four, b: Four, c: Four) -> Four {
        let [a, b, c] = [a.to_array(), b.to_array(), c.to_array()];
        Four::new(pulp::cast(self.mul_sub_f32x4(pulp::cast(a), pulp::cast(b), pulp::cast(c))))
    }
}

macro_rules! operators {
    ($($operator:ident $method:ident)*) => {$(
        impl $operator for Four {
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
        let special = [0.0, -0.0, 1.0, -2.5, 1e-45, f32::MAX, f32::INFINITY, f32::NAN];
        let same = |a: f32, b: f32| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
        for i in 0..64 {
            let a: [f32; 4] = std::array::from_fn(|lane| special[(i + lane) % 8]);
            let b: [f32; 4] = std::array::from_fn(|lane| special[(i / 8 + 3 * lane) % 8]);
            let (x, y) = (Four::new(a), Four::new(b));
            let results = [x + y, x - y, x * y, x / y, x.abs(), x.sqrt(), x.if_above(y), x.if_below(y)]
                .map(Four::to_array);
            for lane in 0..4 {
                let (p, q) = (a[lane], b[lane]);
                let (above, below) = (if p > q { p } else { q }, if p < q { p } else { q });
                let wanted = [p + q, p - q, p * q, p / q, p.abs(), p.sqrt(), above, below];
                for (found, wanted) in results.iter().zip(wanted) {
                    assert!(same(found[lane], wanted), "{p} {q}: {} {wanted}", found[lane]);
                }
                assert_eq!(x.above(y) >> lane & 1 != 0, p > q);
                assert_eq!(x.at_least(y) >> lane & 1 != 0, p >= q);
                if !p.is_nan() && !q.is_nan() {
                    assert_eq!(x.greater(y).to_array()[lane], p.max(q));
                    assert_eq!(x.lesser(y).to_array()[lane], p.min(q));
                }
            }
        }
    }
}
