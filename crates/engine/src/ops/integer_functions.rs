//! Integer functions of `SPV_INTEL_shader_integer_functions2`.

use crate::ops::lane_kernel::lane_kernels;

lane_kernels! {
    /// All bits where the operand is 0.
    UCountLeadingZerosINTEL Core [u8 u16 u32 u64] (a: T) -> T { a.leading_zeros() as T }
    /// All bits where the operand is 0.
    UCountTrailingZerosINTEL Core [u8 u16 u32 u64] (a: T) -> T { a.trailing_zeros() as T }
    /// The distance, which an unsigned number of the same width always holds.
    AbsISubINTEL Core [i8 i16 i32 i64] (a: T, b: T) -> T { a.abs_diff(b) as T }
    AbsUSubINTEL Core [u8 u16 u32 u64] (a: T, b: T) -> T { a.abs_diff(b) }
    IAddSatINTEL Core [i8 i16 i32 i64] (a: T, b: T) -> T { a.saturating_add(b) }
    UAddSatINTEL Core [u8 u16 u32 u64] (a: T, b: T) -> T { a.saturating_add(b) }
    ISubSatINTEL Core [i8 i16 i32 i64] (a: T, b: T) -> T { a.saturating_sub(b) }
    USubSatINTEL Core [u8 u16 u32 u64] (a: T, b: T) -> T { a.saturating_sub(b) }
    /// Half of the sum, which does not overflow, rounded downwards.
    IAverageINTEL Core [i8 i16 i32 i64] (a: T, b: T) -> T { ((i128::from(a) + i128::from(b)) >> 1) as T }
    UAverageINTEL Core [u8 u16 u32 u64] (a: T, b: T) -> T { ((u128::from(a) + u128::from(b)) >> 1) as T }
    /// Half of the sum, rounded upwards.
    IAverageRoundedINTEL Core [i8 i16 i32 i64] (a: T, b: T) -> T {
        ((i128::from(a) + i128::from(b) + 1) >> 1) as T
    }
    UAverageRoundedINTEL Core [u8 u16 u32 u64] (a: T, b: T) -> T {
        ((u128::from(a) + u128::from(b) + 1) >> 1) as T
    }
    /// The product with the lower half of the second operand, sign-extended.
    IMul32x16INTEL Core [i32] (a: i32, b: i32) -> i32 { a.wrapping_mul(i32::from(b as i16)) }
    /// The product with the lower half of the second operand, zero-extended.
    UMul32x16INTEL Core [u32] (a: u32, b: u32) -> u32 { a.wrapping_mul(u32::from(b as u16)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::lane_kernel::tests::check;

    #[test]
    fn vectors() {
        // Derived by hand from the extension's text.
        check(&UCountLeadingZerosINTEL, 32, &[0], 32);
        check(&UCountLeadingZerosINTEL, 8, &[0x10], 3);
        check(&UCountTrailingZerosINTEL, 16, &[0x8000], 15);
        check(&AbsISubINTEL, 8, &[0x80, 0x7F], 0xFF);
        check(&AbsISubINTEL, 32, &[3, 0xFFFF_FFFF], 4);
        check(&AbsUSubINTEL, 32, &[3, 0xFFFF_FFFF], 0xFFFF_FFFC);
        check(&IAddSatINTEL, 16, &[0x7FFF, 1], 0x7FFF);
        check(&UAddSatINTEL, 32, &[0xFFFF_FFFF, 1], 0xFFFF_FFFF);
        check(&ISubSatINTEL, 8, &[0x80, 1], 0x80);
        check(&USubSatINTEL, 64, &[1, 2], 0);
        // (-3 + 0) / 2 = -1.5: down -2, up -1.
        check(&IAverageINTEL, 32, &[0xFFFF_FFFD, 0], 0xFFFF_FFFE);
        check(&IAverageRoundedINTEL, 32, &[0xFFFF_FFFD, 0], 0xFFFF_FFFF);
        check(&UAverageINTEL, 32, &[0xFFFF_FFFF, 0xFFFF_FFFE], 0xFFFF_FFFE);
        check(&UAverageRoundedINTEL, 64, &[u64::MAX, u64::MAX - 1], u64::MAX);
        check(&IMul32x16INTEL, 32, &[2, 0x0001_FFFF], 0xFFFF_FFFE);
        check(&UMul32x16INTEL, 32, &[2, 0x0001_FFFF], 0x0001_FFFE);
    }
}
