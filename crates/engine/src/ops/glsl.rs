//! `GLSL.std.450`: the componentwise instructions as kernels.
//!
//! Elementary functions are correctly rounded in f32; instructions that the specification defines
//! by a formula follow it operation by operation, each rounded.

use half::f16;

use crate::math::float::Float;
use crate::ops::lane_kernel::{LaneKernel, OpFamily, lane_kernels};

lane_kernels! {
    Round Glsl [f16 f32 f64] (a: T) -> T { Float::round(a) }
    RoundEven Glsl [f16 f32 f64] (a: T) -> T { Float::round_even(a) }
    Trunc Glsl [f16 f32 f64] (a: T) -> T { Float::trunc(a) }
    FAbs Glsl [f16 f32 f64] (a: T) -> T { Float::abs(a) }
    SAbs Glsl [i8 i16 i32 i64] (a: T) -> T { a.wrapping_abs() }
    FSign Glsl [f16 f32 f64] (a: T) -> T {
        if a > T::ZERO { T::ONE } else if a < T::ZERO { -T::ONE } else { a }
    }
    SSign Glsl [i8 i16 i32 i64] (a: T) -> T { a.signum() }
    Floor Glsl [f16 f32 f64] (a: T) -> T { Float::floor(a) }
    Ceil Glsl [f16 f32 f64] (a: T) -> T { Float::ceil(a) }
    Fract Glsl [f16 f32 f64] (a: T) -> T { a - Float::floor(a) }
    Radians Glsl [f16 f32 f64] (a: T) -> T { a * T::of(std::f64::consts::PI / 180.0) }
    Degrees Glsl [f16 f32 f64] (a: T) -> T { a * T::of(180.0 / std::f64::consts::PI) }
    Sin Glsl [f16 f32 f64] (a: T) -> T { Float::sin(a) }
    Cos Glsl [f16 f32 f64] (a: T) -> T { Float::cos(a) }
    Tan Glsl [f16 f32 f64] (a: T) -> T { Float::tan(a) }
    Asin Glsl [f16 f32 f64] (a: T) -> T { Float::asin(a) }
    Acos Glsl [f16 f32 f64] (a: T) -> T { Float::acos(a) }
    Atan Glsl [f16 f32 f64] (a: T) -> T { Float::atan(a) }
    Sinh Glsl [f16 f32 f64] (a: T) -> T { Float::sinh(a) }
    Cosh Glsl [f16 f32 f64] (a: T) -> T { Float::cosh(a) }
    Tanh Glsl [f16 f32 f64] (a: T) -> T { Float::tanh(a) }
    Asinh Glsl [f16 f32 f64] (a: T) -> T { Float::asinh(a) }
    Acosh Glsl [f16 f32 f64] (a: T) -> T { Float::acosh(a) }
    Atanh Glsl [f16 f32 f64] (a: T) -> T { Float::atanh(a) }
    Atan2 Glsl [f16 f32 f64] (y: T, x: T) -> T { Float::atan2(y, x) }
    Pow Glsl [f16 f32 f64] (a: T, b: T) -> T { Float::pow(a, b) }
    Exp Glsl [f16 f32 f64] (a: T) -> T { Float::exp(a) }
    Log Glsl [f16 f32 f64] (a: T) -> T { Float::log(a) }
    Exp2 Glsl [f16 f32 f64] (a: T) -> T { Float::exp2(a) }
    Log2 Glsl [f16 f32 f64] (a: T) -> T { Float::log2(a) }
    Sqrt Glsl [f16 f32 f64] (a: T) -> T { Float::sqrt(a) }
    InverseSqrt Glsl [f16 f32 f64] (a: T) -> T { Float::inverse_sqrt(a) }
    FMin Glsl [f16 f32 f64] (a: T, b: T) -> T { if b < a { b } else { a } }
    UMin Glsl [u8 u16 u32 u64] (a: T, b: T) -> T { a.min(b) }
    SMin Glsl [i8 i16 i32 i64] (a: T, b: T) -> T { a.min(b) }
    FMax Glsl [f16 f32 f64] (a: T, b: T) -> T { if a < b { b } else { a } }
    UMax Glsl [u8 u16 u32 u64] (a: T, b: T) -> T { a.max(b) }
    SMax Glsl [i8 i16 i32 i64] (a: T, b: T) -> T { a.max(b) }
    FClamp Glsl [f16 f32 f64] (a: T, low: T, high: T) -> T {
        let raised = if a < low { low } else { a };
        if high < raised { high } else { raised }
    }
    UClamp Glsl [u8 u16 u32 u64] (a: T, low: T, high: T) -> T { a.max(low).min(high) }
    SClamp Glsl [i8 i16 i32 i64] (a: T, low: T, high: T) -> T { a.max(low).min(high) }
    FMix Glsl [f16 f32 f64] (x: T, y: T, a: T) -> T { x * (T::ONE - a) + y * a }
    Step Glsl [f16 f32 f64] (edge: T, x: T) -> T { if x < edge { T::ZERO } else { T::ONE } }
    SmoothStep Glsl [f16 f32 f64] (low: T, high: T, x: T) -> T {
        let t = (x - low) / (high - low);
        let t = if t < T::ZERO { T::ZERO } else { t };
        let t = if T::ONE < t { T::ONE } else { t };
        t * t * (T::of(3.0) - T::of(2.0) * t)
    }
    /// Multiplied and added, each rounded: the fused form is allowed, not required.
    Fma Glsl [f16 f32 f64] (a: T, b: T, c: T) -> T { a * b + c }
    Ldexp Glsl [f16 f32 f64] (a: T, exponent: i32) -> T { Float::ldexp(a, exponent) }
    FindILsb Glsl [u32] (a: u32) -> i32 { if a == 0 { -1 } else { a.trailing_zeros() as i32 } }
    FindSMsb Glsl [i32] (a: i32) -> i32 { 31 - (a ^ (a >> 31)).leading_zeros() as i32 }
    FindUMsb Glsl [u32] (a: u32) -> i32 { 31 - a.leading_zeros() as i32 }
    NMin Glsl [f16 f32 f64] (a: T, b: T) -> T { if Float::is_nan(a) || b < a { b } else { a } }
    NMax Glsl [f16 f32 f64] (a: T, b: T) -> T { if Float::is_nan(a) || a < b { b } else { a } }
    NClamp Glsl [f16 f32 f64] (a: T, low: T, high: T) -> T {
        let raised = if Float::is_nan(a) || a < low { low } else { a };
        if Float::is_nan(raised) || high < raised { high } else { raised }
    }
}

/// Kernels for parts of instructions: one scalar of several, or one component of a packed word.
pub mod parts {
    use half::f16;

    use crate::math::float::Float;
    use crate::ops::lane_kernel::lane_kernels;

    lane_kernels! {
        ModfFraction Internal [f16 f32 f64] (a: T) -> T {
            if Float::is_infinite(a) { Float::copysign(T::ZERO, a) } else { Float::copysign(a - Float::trunc(a), a) }
        }
        FrexpMantissa Internal [f16 f32 f64] (a: T) -> T { Float::frexp(a).0 }
        FrexpExponent Internal [f16 f32 f64] (a: T) -> i32 { Float::frexp(a).1 }
        /// One component of `PackSnorm4x8`, already in its byte.
        Snorm8 Internal [f32] (a: f32, shift: u32) -> u32 {
            u32::from((a.clamp(-1.0, 1.0) * 127.0).round_ties_even() as i8 as u8) << shift
        }
        Unorm8 Internal [f32] (a: f32, shift: u32) -> u32 {
            u32::from((a.clamp(0.0, 1.0) * 255.0).round_ties_even() as u8) << shift
        }
        Snorm16 Internal [f32] (a: f32, shift: u32) -> u32 {
            u32::from((a.clamp(-1.0, 1.0) * 32767.0).round_ties_even() as i16 as u16) << shift
        }
        Unorm16 Internal [f32] (a: f32, shift: u32) -> u32 {
            u32::from((a.clamp(0.0, 1.0) * 65535.0).round_ties_even() as u16) << shift
        }
        Half Internal [f32] (a: f32, shift: u32) -> u32 { u32::from(f16::from_f32(a).to_bits()) << shift }
        FromSnorm8 Internal [u32] (a: u32, shift: u32) -> f32 {
            (f32::from((a >> shift) as i8) / 127.0).clamp(-1.0, 1.0)
        }
        FromUnorm8 Internal [u32] (a: u32, shift: u32) -> f32 { f32::from((a >> shift) as u8) / 255.0 }
        FromSnorm16 Internal [u32] (a: u32, shift: u32) -> f32 {
            (f32::from((a >> shift) as i16) / 32767.0).clamp(-1.0, 1.0)
        }
        FromUnorm16 Internal [u32] (a: u32, shift: u32) -> f32 { f32::from((a >> shift) as u16) / 65535.0 }
        FromHalf Internal [u32] (a: u32, shift: u32) -> f32 { f16::from_bits((a >> shift) as u16).to_f32() }
    }
}

/// The two functions of a clamp: the first of the value and the lower bound, the second of that and
/// the upper one; `None` for other kernels.
pub fn clamp_parts(kernel: &LaneKernel) -> Option<[&'static OpFamily; 2]> {
    let clamps: [(&OpFamily, [&'static OpFamily; 2]); 4] = [
        (&FClamp, [&FMax, &FMin]),
        (&NClamp, [&NMax, &NMin]),
        (&UClamp, [&UMax, &UMin]),
        (&SClamp, [&SMax, &SMin]),
    ];
    clamps.into_iter().find(|(clamp, _)| kernel.is(clamp)).map(|(_, parts)| parts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::lane_kernel::OpFamily;
    use crate::ops::lane_kernel::tests::check;

    fn unary(family: &'static OpFamily, input: f32, expected: f32) {
        check(family, 32, &[input.to_bits().into()], expected.to_bits().into());
    }

    fn binary(family: &'static OpFamily, a: f32, b: f32, expected: f32) {
        check(family, 32, &[a.to_bits().into(), b.to_bits().into()], expected.to_bits().into());
    }

    #[test]
    fn vectors() {
        unary(&Round, 2.5, 3.0);
        unary(&RoundEven, 2.5, 2.0);
        unary(&Trunc, -2.5, -2.0);
        unary(&FAbs, -0.0, 0.0);
        unary(&FSign, -3.0, -1.0);
        unary(&FSign, -0.0, -0.0);
        check(&SAbs, 32, &[0x8000_0000], 0x8000_0000);
        check(&SSign, 8, &[0x80], 0xFF);
        unary(&Floor, -0.5, -1.0);
        unary(&Ceil, -0.5, -0.0);
        unary(&Fract, -0.25, 0.75);
        unary(&Sin, 0.5, 0.479_425_55);
        unary(&Cos, 0.0, 1.0);
        unary(&Exp2, -149.0, f32::from_bits(1));
        unary(&Log2, 8.0, 3.0);
        unary(&Sqrt, 2.0, std::f32::consts::SQRT_2);
        unary(&InverseSqrt, 4.0, 0.5);
        binary(&Atan2, 0.0, -1.0, std::f32::consts::PI);
        binary(&Pow, 2.0, 0.5, std::f32::consts::SQRT_2);
        binary(&FMin, 1.0, f32::NAN, 1.0);
        binary(&NMin, f32::NAN, 1.0, 1.0);
        binary(&NMax, 1.0, f32::NAN, 1.0);
        binary(&Step, 1.0, 1.0, 1.0);
        let bits = |value: f32| u64::from(value.to_bits());
        check(&FMix, 32, &[bits(2.0), bits(4.0), bits(0.25)], bits(2.5));
        check(&SmoothStep, 32, &[bits(0.0), bits(2.0), bits(1.0)], bits(0.5));
        check(&SmoothStep, 32, &[bits(0.0), bits(2.0), bits(9.0)], bits(1.0));
        check(&FClamp, 32, &[bits(3.0), bits(0.0), bits(1.0)], bits(1.0));
        check(&SClamp, 32, &[0xFFFF_FFFF, 0, 5], 0);
        // (1 + 2^-12)^2 - 1 rounds its square first: 2^-11 exactly, not 2^-11 + 2^-24.
        let near = 1.0 + 2f32.powi(-12);
        check(&Fma, 32, &[bits(near), bits(near), bits(-1.0)], bits(2f32.powi(-11)));
        check(&Ldexp, 32, &[bits(0.75), 3], bits(6.0));
        check(&FindILsb, 32, &[0], 0xFFFF_FFFF);
        check(&FindSMsb, 32, &[0xFFFF_FFFF], 0xFFFF_FFFF);
        check(&FindSMsb, 32, &[0xFFFF_FF00], 7);
        check(&FindUMsb, 32, &[0x100], 8);
    }

    #[test]
    fn parts_of_packing() {
        use parts::{FromHalf, FromSnorm8, FromUnorm16, Half, ModfFraction, Snorm8, Unorm16};
        let bits = |value: f32| u64::from(value.to_bits());
        check(&Snorm8, 32, &[bits(-2.0), 8], 0x8100);
        check(&Unorm16, 32, &[bits(1.0), 16], 0xFFFF_0000);
        check(&Half, 32, &[bits(1.0), 16], 0x3C00_0000);
        check(&FromSnorm8, 32, &[0x8000, 8], bits(-1.0));
        check(&FromUnorm16, 32, &[0xFFFF_0000, 16], bits(1.0));
        check(&FromHalf, 32, &[0xC000, 0], bits(-2.0));
        check(&ModfFraction, 32, &[bits(-2.5)], bits(-0.5));
        check(&ModfFraction, 32, &[bits(f32::NEG_INFINITY)], bits(-0.0));
    }
}
