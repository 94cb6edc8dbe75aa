//! Numerics below everything else: elementary functions behind one door, exact arithmetic, error
//! bounds, distances in ulp.

pub mod doubles;
pub mod eight;
pub mod error_bound;
pub mod exact;
pub mod float;
pub mod float_format;
pub mod four;
pub mod hard;
pub mod lane_ops;
pub mod power;
pub mod prefetch;
pub mod real;
pub mod srgb;
pub mod surd;
pub mod toward_zero;
pub mod ulp;

pub use ulp::{ulp_error, ulps};
