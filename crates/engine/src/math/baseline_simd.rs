//! The SIMD of the baseline instruction set of the target.

/// SIMD on the baseline instruction set of the target: SSE2 on x86-64, NEON on 64-bit Arm.
#[derive(Clone, Copy, Debug)]
pub struct BaselineSimd;
