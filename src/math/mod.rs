//! Numerics below everything else: elementary functions behind one door, exact arithmetic, error
//! bounds, distances in ulp.

pub mod ahead;
pub mod doubles;
pub mod eight;
pub mod error_bound;
pub mod exact;
pub mod float;
pub mod float_format;
pub mod four;
pub mod hard;
pub mod power;
pub mod real;
pub mod srgb;
pub mod surd;
pub mod toward_zero;
pub mod ulp;
pub mod vectors;

pub use ulp::{ulp_error, ulps};
