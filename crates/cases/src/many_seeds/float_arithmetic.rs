//! Arithmetic on the bits of floats of any width, by this crate's own kernels.

use anyhit_engine::ops::arithmetic::{FAdd, FDiv, FMul, FmaKHR};
use anyhit_engine::ops::lane_kernel::{LaneKernel, OpFamily};
use anyhit_engine::ops::shadow_op::ScratchRegisters;

/// Calculates with the bits of floats of 16, 32 or 64 bits.
#[derive(Debug, Default)]
pub(super) struct FloatArithmetic(ScratchRegisters);

impl FloatArithmetic {
    /// `a + b`, rounded.
    pub(super) fn add(&mut self, width: u32, a: u64, b: u64) -> u64 {
        self.run_family(&FAdd, width, [a, b, 0])
    }

    /// `a * b`, rounded.
    pub(super) fn mul(&mut self, width: u32, a: u64, b: u64) -> u64 {
        self.run_family(&FMul, width, [a, b, 0])
    }

    /// `a / b`, rounded.
    pub(super) fn div(&mut self, width: u32, a: u64, b: u64) -> u64 {
        self.run_family(&FDiv, width, [a, b, 0])
    }

    /// `a * b + c`, rounded once.
    pub(super) fn fma(&mut self, width: u32, a: u64, b: u64, c: u64) -> u64 {
        self.run_family(&FmaKHR, width, [a, b, c])
    }

    /// The result of a kernel.
    pub(super) fn run(&mut self, kernel: &LaneKernel, operands: [u64; 3]) -> u64 {
        self.0.run(kernel, operands)
    }

    fn run_family(&mut self, family: &'static OpFamily, width: u32, operands: [u64; 3]) -> u64 {
        let kernel = family.kernel(width).expect("bug in anyhit: a float does not have 16, 32 or 64 bits");
        self.0.run(kernel, operands)
    }
}

/// The bit of the sign of a float.
pub(super) fn sign_bit(width: u32) -> u64 {
    1 << (width - 1)
}

/// 1 as a float of a width.
pub(super) fn one(width: u32) -> u64 {
    match width {
        16 => half::f16::ONE.to_bits().into(),
        32 => 1f32.to_bits().into(),
        _ => 1f64.to_bits(),
    }
}

/// Whether a float is denormal.
pub(super) fn is_denormal(width: u32, bits: u64) -> bool {
    let fraction = match width {
        16 => 10,
        32 => 23,
        _ => 52,
    };
    let magnitude = bits & !sign_bit(width);
    magnitude != 0 && magnitude >> fraction == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn denormal_numbers_lie_between_0_and_the_least_normal_one() {
        let single = |float: f32| is_denormal(32, float.to_bits().into());
        assert_eq!([0.0, -0.0, f32::MIN_POSITIVE, 1.0, f32::INFINITY].map(single), [false; 5]);
        assert_eq!([1e-40, -1e-40, f32::from_bits(1)].map(single), [true; 3]);
        // 2^-14 is the least normal half, with the bits 0x0400.
        assert!(is_denormal(16, 0x83FF) && !is_denormal(16, 0x0400));
        assert!(is_denormal(64, 1) && !is_denormal(64, f64::MIN_POSITIVE.to_bits()));
    }

    #[test]
    fn products_are_added_with_one_rounding_or_two() {
        // (1 + 2^-12)^2 - 1 = 2^-11 + 2^-24; the product alone rounds to 1 + 2^-11.
        let bits = |float: f32| u64::from(float.to_bits());
        let (near, minus) = (bits(1.0 + 2f32.powi(-12)), bits(-1.0));
        let mut arithmetic = FloatArithmetic::default();
        let product = arithmetic.mul(32, near, near);
        assert_eq!(arithmetic.add(32, product, minus), bits(2f32.powi(-11)));
        assert_eq!(arithmetic.fma(32, near, near, minus), bits(2f32.powi(-11) + 2f32.powi(-24)));
        assert_eq!(arithmetic.div(32, bits(1.0), bits(4.0)), bits(0.25));
        assert_eq!([16, 32, 64].map(one), [0x3C00, 0x3F80_0000, 0x3FF0_0000_0000_0000]);
    }
}
