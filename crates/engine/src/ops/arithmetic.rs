//! Arithmetic instructions (SPIR-V 3.3.13).
//!
//! Integer division by zero, which the specification leaves undefined, gives all ones, and the
//! remainder gives the dividend: this is what most GPUs do, and it is the same on every machine
//! here.

use half::f16;

use crate::math::float::Float;
use crate::ops::lane_kernel::lane_kernels;

lane_kernels! {
    SNegate Core [i8 i16 i32 i64] (a: T) -> T { a.wrapping_neg() }
    IAdd Core [u8 u16 u32 u64] (a: T, b: T) -> T { a.wrapping_add(b) }
    ISub Core [u8 u16 u32 u64] (a: T, b: T) -> T { a.wrapping_sub(b) }
    IMul Core [u8 u16 u32 u64] (a: T, b: T) -> T { a.wrapping_mul(b) }
    UDiv Core [u8 u16 u32 u64] (a: T, b: T) -> T { a.checked_div(b).unwrap_or(T::MAX) }
    SDiv Core [i8 i16 i32 i64] (a: T, b: T) -> T { if b == 0 { -1 } else { a.wrapping_div(b) } }
    UMod Core [u8 u16 u32 u64] (a: T, b: T) -> T { a.checked_rem(b).unwrap_or(a) }
    /// The sign follows the dividend.
    SRem Core [i8 i16 i32 i64] (a: T, b: T) -> T { if b == 0 { a } else { a.wrapping_rem(b) } }
    /// The sign follows the divisor.
    SMod Core [i8 i16 i32 i64] (a: T, b: T) -> T {
        if b == 0 {
            return a;
        }
        let rest = a.wrapping_rem(b);
        if rest != 0 && (rest < 0) != (b < 0) { rest + b } else { rest }
    }
    FNegate Core [f16 f32 f64] (a: T) -> T { -a }
    FAdd Core [f16 f32 f64] (a: T, b: T) -> T { a + b }
    FSub Core [f16 f32 f64] (a: T, b: T) -> T { a - b }
    FMul Core [f16 f32 f64] (a: T, b: T) -> T { a * b }
    FDiv Core [f16 f32 f64] (a: T, b: T) -> T { a / b }
    /// Fused: rounded once (`SPV_KHR_fma`).
    FmaKHR Core [f16 f32 f64] (a: T, b: T, c: T) -> T { Float::mul_add(a, b, c) }
    /// `x - y * trunc(x / y)`, each operation rounded (SPIR-V environment of Vulkan).
    FRem Core [f16 f32 f64] (a: T, b: T) -> T { a - b * Float::trunc(a / b) }
    /// `x - y * floor(x / y)`, each operation rounded (SPIR-V environment of Vulkan).
    FMod Core [f16 f32 f64] (a: T, b: T) -> T { a - b * Float::floor(a / b) }
}

/// Kernels for the second members of extended arithmetic, whose result is a struct of two members.
pub mod extended {
    use crate::ops::lane_kernel::lane_kernels;

    lane_kernels! {
        Carry Internal [u8 u16 u32 u64] (a: T, b: T) -> T { T::from(a.overflowing_add(b).1) }
        Borrow Internal [u8 u16 u32 u64] (a: T, b: T) -> T { T::from(a < b) }
        UMulHigh Internal [u8 u16 u32 u64] (a: T, b: T) -> T {
            ((u128::from(a) * u128::from(b)) >> T::BITS) as T
        }
        SMulHigh Internal [i8 i16 i32 i64] (a: T, b: T) -> T {
            ((i128::from(a) * i128::from(b)) >> T::BITS) as T
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::lane_kernel::tests::check;

    #[test]
    fn vectors() {
        // Hand-derived: two's complement wrap-around and IEEE 754 arithmetic.
        check(&IAdd, 32, &[0xFFFF_FFFF, 2], 1);
        check(&IAdd, 8, &[0xFF, 2], 1);
        check(&ISub, 16, &[0, 1], 0xFFFF);
        check(&IMul, 32, &[0x8000_0001, 2], 2);
        check(&IMul, 64, &[1 << 33, 1 << 31], 0);
        check(&SNegate, 32, &[0x8000_0000], 0x8000_0000);
        check(&UDiv, 32, &[7, 2], 3);
        check(&UDiv, 32, &[7, 0], 0xFFFF_FFFF);
        check(&SDiv, 32, &[-7i32 as u32 as u64, 2], -3i32 as u32 as u64);
        check(&SDiv, 32, &[0x8000_0000, 0xFFFF_FFFF], 0x8000_0000);
        check(&SDiv, 32, &[5, 0], 0xFFFF_FFFF);
        check(&UMod, 32, &[7, 0], 7);
        check(&SRem, 32, &[-7i32 as u32 as u64, 3], -1i32 as u32 as u64);
        check(&SMod, 32, &[-7i32 as u32 as u64, 3], 2);
        check(&SMod, 32, &[7, -3i32 as u32 as u64], -2i32 as u32 as u64);
        check(&FNegate, 32, &[0], 0x8000_0000);
        check(&FAdd, 32, &[0x3F80_0000, 0x3400_0000], 0x3F80_0001); // 1 + 2^-23
        check(&FAdd, 16, &[0x3C00, 0x1000], 0x3C00); // 1 + 2^-11 is a tie: to even
        check(&FSub, 32, &[0x3F80_0001, 0x3F80_0000], 0x3400_0000); // exact
        check(&FMul, 32, &[0x0080_0000, 0x3F00_0000], 0x0040_0000); // a denormal result is kept
        check(&FMul, 64, &[2f64.to_bits(), 3f64.to_bits()], 6f64.to_bits());
        check(&FDiv, 32, &[0x3F80_0000, 0], 0x7F80_0000);
        // A NaN result always has the same bits: for any NaN operand, and without one (infinity -
        // infinity, 0 / 0).
        check(&FAdd, 32, &[0xFFC0_1234, 0x7FC0_0001], 0x7FC0_0000);
        check(&FMul, 32, &[0x7FC0_0001, 0xFFC0_1234], 0x7FC0_0000);
        check(&FSub, 32, &[0x7F80_0000, 0x7F80_0000], 0x7FC0_0000);
        check(&FDiv, 64, &[0, 0], 0x7FF8 << 48);
        check(&FAdd, 16, &[0xFE01, 0x3C00], 0x7E00);
        // (1 + 2^-12)^2 - 1 = 2^-11 + 2^-24, rounded once; rounded twice it would be 2^-11.
        let near = u64::from((1.0 + 2f32.powi(-12)).to_bits());
        let sum = u64::from((2f32.powi(-11) + 2f32.powi(-24)).to_bits());
        check(&FmaKHR, 32, &[near, near, (-1f32).to_bits().into()], sum);
        // (1 + 2^-6)^2 - 1 = 2^-5 (1 + 2^-7).
        check(&FmaKHR, 16, &[0x3C10, 0x3C10, 0xBC00], 0x2808);
        check(&FRem, 32, &[(-7f32).to_bits().into(), 3f32.to_bits().into()], (-1f32).to_bits().into());
        check(&FMod, 32, &[(-7f32).to_bits().into(), 3f32.to_bits().into()], 2f32.to_bits().into());
    }

    #[test]
    fn extended_halves() {
        check(&extended::Carry, 32, &[0xFFFF_FFFF, 1], 1);
        check(&extended::Carry, 32, &[0xFFFF_FFFF, 0], 0);
        check(&extended::Carry, 64, &[u64::MAX, 1], 1);
        check(&extended::Carry, 8, &[0xFF, 1], 1);
        check(&extended::Borrow, 16, &[0, 1], 1);
        check(&extended::Borrow, 32, &[0, 1], 1);
        check(&extended::Borrow, 64, &[1, 1], 0);
        check(&extended::UMulHigh, 32, &[0xFFFF_FFFF, 0xFFFF_FFFF], 0xFFFF_FFFE);
        check(&extended::SMulHigh, 32, &[0xFFFF_FFFF, 0xFFFF_FFFF], 0);
        check(&extended::UMulHigh, 64, &[1 << 63, 4], 2);
    }
}
