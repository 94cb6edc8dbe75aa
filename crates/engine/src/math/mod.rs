//! Numerics: elementary functions, SIMD lanes, exact arithmetic, error bounds, distances in ulp.

pub mod array;
pub mod baseline_simd;
pub mod error_bound;
pub mod exact;
mod exponent;
pub mod f32x4;
pub mod f32x8;
pub mod f64x4;
pub mod float;
pub mod float_format;
pub mod hard;
pub mod lane_ops;
pub mod permutation;
pub mod power;
pub mod prefetch;
pub mod random;
pub mod real;
pub mod srgb;
pub mod surd;
pub mod toward_zero;
pub mod ulp;

pub use ulp::{ulp_error, ulps};
