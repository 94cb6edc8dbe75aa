//! Kernels of programs that are not optimised, which a sanitizer looks at: what instructions say of
//! values without changing them.

use crate::ops::lane_kernel::lane_kernels;

lane_kernels! {
    /// The condition of `OpAssumeTrueKHR`.
    Assumption Internal [bool] (a: bool) -> bool { a }
    /// The value and the expected value of `OpExpectKHR`.
    Expectation Internal [u32] (value: u32, expected: u32) -> u32 { value ^ expected }
    /// The square of the length of a vector that should have length 1.
    SquaredLength Internal [f32] (square: f32) -> f32 { square }
    /// The double that two words make.
    PackedDouble Internal [u32] (low: u32, high: u32) -> u64 { u64::from(high) << 32 | u64::from(low) }
}
