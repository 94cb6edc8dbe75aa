//! `anyhit` runs ray-tracing shaders on the CPU, exactly.

#![deny(unsafe_code)]

pub mod accel;
pub mod cli;
pub mod compile;
pub mod debug;
pub mod error;
pub mod geometry;
pub mod harness;
pub mod interp;
pub mod machine;
pub mod math;
pub mod module;
pub mod ops;
pub mod pipeline;
pub mod program;
pub mod scene;

pub use error::{Error, ErrorKind};
