//! Bit instructions (SPIR-V 3.3.14).
//!
//! A shift by the width or more, which the specification leaves undefined, shifts everything out.

use crate::ops::lane_kernel::lane_kernels;

lane_kernels! {
    ShiftRightLogical Core [u8 u16 u32 u64] (a: T, by: u32) -> T { a.checked_shr(by).unwrap_or(0) }
    ShiftRightArithmetic Core [i8 i16 i32 i64] (a: T, by: u32) -> T { a >> by.min(T::BITS - 1) }
    ShiftLeftLogical Core [u8 u16 u32 u64] (a: T, by: u32) -> T { a.checked_shl(by).unwrap_or(0) }
    BitwiseOr Core [u8 u16 u32 u64] (a: T, b: T) -> T { a | b }
    BitwiseXor Core [u8 u16 u32 u64] (a: T, b: T) -> T { a ^ b }
    BitwiseAnd Core [u8 u16 u32 u64] (a: T, b: T) -> T { a & b }
    Not Core [u8 u16 u32 u64] (a: T) -> T { !a }
    BitReverse Core [u8 u16 u32 u64] (a: T) -> T { a.reverse_bits() }
    BitCount Core [u8 u16 u32 u64] (a: T) -> u32 { a.count_ones() }
}

/// Kernels to which bit-field instructions are translated, as those have up to four operands.
pub mod field {
    use crate::ops::lane_kernel::lane_kernels;

    lane_kernels! {
        /// A mask of `count` ones, shifted left by `offset`.
        FieldMask Internal [u8 u16 u32 u64] (offset: u32, count: u32) -> T {
            let ones = if count >= T::BITS { T::MAX } else { ((1 as T) << count) - 1 };
            ones.checked_shl(offset).unwrap_or(0)
        }
        /// The bits of `a` where the mask is one, else those of `b`.
        FieldMerge Internal [u8 u16 u32 u64] (mask: T, a: T, b: T) -> T { a & mask | b & !mask }
        FieldUExtract Internal [u8 u16 u32 u64] (a: T, offset: u32, count: u32) -> T {
            let ones = if count >= T::BITS { T::MAX } else { ((1 as T) << count) - 1 };
            a.checked_shr(offset).unwrap_or(0) & ones
        }
        FieldSExtract Internal [i8 i16 i32 i64] (a: T, offset: u32, count: u32) -> T {
            if count == 0 || offset >= T::BITS {
                return 0;
            }
            let up = T::BITS.saturating_sub(offset.saturating_add(count));
            let down = T::BITS.saturating_sub(count);
            (a << up) >> down.max(up)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::lane_kernel::tests::check;

    #[test]
    fn vectors() {
        check(&ShiftLeftLogical, 32, &[1, 31], 0x8000_0000);
        check(&ShiftLeftLogical, 32, &[1, 32], 0);
        check(&ShiftRightLogical, 8, &[0x80, 7], 1);
        check(&ShiftRightArithmetic, 8, &[0x80, 7], 0xFF);
        check(&ShiftRightArithmetic, 32, &[0x8000_0000, 99], 0xFFFF_FFFF);
        check(&Not, 16, &[0x00FF], 0xFF00);
        check(&BitReverse, 32, &[1], 0x8000_0000);
        check(&BitCount, 64, &[u64::MAX], 64);
        check(&field::FieldMask, 32, &[4, 8], 0xFF0);
        check(&field::FieldMask, 32, &[0, 32], 0xFFFF_FFFF);
        check(&field::FieldMerge, 32, &[0xFF0, 0xAA0, 0x123], 0xAA3);
        check(&field::FieldUExtract, 32, &[0xABCD, 4, 8], 0xBC);
        check(&field::FieldSExtract, 32, &[0xABCD, 4, 8], 0xFFFF_FFBC);
        check(&field::FieldSExtract, 32, &[0x7F, 0, 32], 0x7F);
        check(&field::FieldSExtract, 32, &[0x7F, 3, 0], 0);
    }
}
