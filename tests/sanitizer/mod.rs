//! The sanitizer on modules that no case of `shaders/` has.

mod cooperative;
mod modules;
mod outputs;
mod traversal_lints;
#[cfg(feature = "glsl")]
mod values;
