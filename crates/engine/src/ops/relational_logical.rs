//! Relational and logical instructions (SPIR-V 3.3.15).

#![allow(clippy::double_comparisons, reason = "`a < b || a > b` is not `a != b` where one is NaN")]

use half::f16;

use crate::math::float::Float;
use crate::ops::lane_kernel::lane_kernels;

lane_kernels! {
    IsNan Core [f16 f32 f64] (a: T) -> bool { Float::is_nan(a) }
    IsInf Core [f16 f32 f64] (a: T) -> bool { Float::is_infinite(a) }
    LogicalEqual Core [bool] (a: bool, b: bool) -> bool { a == b }
    LogicalNotEqual Core [bool] (a: bool, b: bool) -> bool { a != b }
    LogicalOr Core [bool] (a: bool, b: bool) -> bool { a | b }
    LogicalAnd Core [bool] (a: bool, b: bool) -> bool { a & b }
    LogicalNot Core [bool] (a: bool) -> bool { !a }
    IEqual Core [u8 u16 u32 u64] (a: T, b: T) -> bool { a == b }
    INotEqual Core [u8 u16 u32 u64] (a: T, b: T) -> bool { a != b }
    UGreaterThan Core [u8 u16 u32 u64] (a: T, b: T) -> bool { a > b }
    SGreaterThan Core [i8 i16 i32 i64] (a: T, b: T) -> bool { a > b }
    UGreaterThanEqual Core [u8 u16 u32 u64] (a: T, b: T) -> bool { a >= b }
    SGreaterThanEqual Core [i8 i16 i32 i64] (a: T, b: T) -> bool { a >= b }
    ULessThan Core [u8 u16 u32 u64] (a: T, b: T) -> bool { a < b }
    SLessThan Core [i8 i16 i32 i64] (a: T, b: T) -> bool { a < b }
    ULessThanEqual Core [u8 u16 u32 u64] (a: T, b: T) -> bool { a <= b }
    SLessThanEqual Core [i8 i16 i32 i64] (a: T, b: T) -> bool { a <= b }
    FOrdEqual Core [f16 f32 f64] (a: T, b: T) -> bool { a == b }
    FUnordEqual Core [f16 f32 f64] (a: T, b: T) -> bool { !(a < b || a > b) }
    FOrdNotEqual Core [f16 f32 f64] (a: T, b: T) -> bool { a < b || a > b }
    FUnordNotEqual Core [f16 f32 f64] (a: T, b: T) -> bool { a != b }
    FOrdLessThan Core [f16 f32 f64] (a: T, b: T) -> bool { a < b }
    FUnordLessThan Core [f16 f32 f64] (a: T, b: T) -> bool { !matches!(a.partial_cmp(&b), Some(std::cmp::Ordering::Greater | std::cmp::Ordering::Equal)) }
    FOrdGreaterThan Core [f16 f32 f64] (a: T, b: T) -> bool { a > b }
    FUnordGreaterThan Core [f16 f32 f64] (a: T, b: T) -> bool { !matches!(a.partial_cmp(&b), Some(std::cmp::Ordering::Less | std::cmp::Ordering::Equal)) }
    FOrdLessThanEqual Core [f16 f32 f64] (a: T, b: T) -> bool { a <= b }
    FUnordLessThanEqual Core [f16 f32 f64] (a: T, b: T) -> bool { !matches!(a.partial_cmp(&b), Some(std::cmp::Ordering::Greater)) }
    FOrdGreaterThanEqual Core [f16 f32 f64] (a: T, b: T) -> bool { a >= b }
    FUnordGreaterThanEqual Core [f16 f32 f64] (a: T, b: T) -> bool { !matches!(a.partial_cmp(&b), Some(std::cmp::Ordering::Less)) }
    Ordered Core [f16 f32 f64] (a: T, b: T) -> bool { !(Float::is_nan(a) || Float::is_nan(b)) }
    Unordered Core [f16 f32 f64] (a: T, b: T) -> bool { Float::is_nan(a) || Float::is_nan(b) }
    LessOrGreater Core [f16 f32 f64] (a: T, b: T) -> bool { a < b || a > b }
}

/// `OpSelect` on one word; wider values are selected word by word.
pub mod select {
    use crate::ops::lane_kernel::lane_kernels;

    lane_kernels! {
        SelectWord Internal [bool] (condition: bool, a: u32, b: u32) -> u32 { if condition { a } else { b } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::lane_kernel::tests::check;

    #[test]
    fn vectors() {
        const NAN: u64 = 0x7FC0_0000;
        const ONE: u64 = 0x3F80_0000;
        const NEGATIVE_ZERO: u64 = 0x8000_0000;
        check(&FOrdEqual, 32, &[0, NEGATIVE_ZERO], 1);
        check(&FOrdEqual, 32, &[NAN, NAN], 0);
        check(&FUnordEqual, 32, &[NAN, ONE], 1);
        check(&FOrdNotEqual, 32, &[NAN, ONE], 0);
        check(&FUnordNotEqual, 32, &[NAN, NAN], 1);
        check(&FUnordNotEqual, 32, &[ONE, ONE], 0);
        check(&FUnordLessThan, 32, &[NAN, ONE], 1);
        check(&FUnordLessThan, 32, &[ONE, ONE], 0);
        check(&FOrdLessThan, 32, &[NAN, ONE], 0);
        check(&FUnordGreaterThan, 32, &[0, ONE], 0);
        check(&FUnordLessThanEqual, 32, &[ONE, ONE], 1);
        check(&FUnordGreaterThanEqual, 32, &[0, ONE], 0);
        check(&Ordered, 32, &[ONE, NAN], 0);
        check(&Unordered, 32, &[NAN, ONE], 1);
        check(&IsInf, 32, &[0xFF80_0000], 1);
        check(&IsNan, 16, &[0x7E00], 1);
        check(&SLessThan, 32, &[0xFFFF_FFFF, 0], 1);
        check(&ULessThan, 32, &[0xFFFF_FFFF, 0], 0);
        check(&SLessThan, 8, &[0x80, 0], 1);
        check(&SGreaterThan, 64, &[0, u64::MAX], 1);
        check(&LogicalNot, 0, &[1], 0);
        check(&select::SelectWord, 0, &[0, 5, 6], 6);
        check(&select::SelectWord, 0, &[1, 5, 6], 5);
    }
}
