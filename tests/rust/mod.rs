//! The Rust interface.

#[cfg(all(feature = "scenes", feature = "wgsl"))]
pub mod conversions;
mod device_buffers;
mod examples;
mod first_tests;
mod host_layout;
#[cfg(feature = "wgsl")]
mod outcomes;
mod public_face;
mod result_types;
mod rust_interface;
mod unit_test;
