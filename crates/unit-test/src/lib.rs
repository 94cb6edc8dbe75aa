//! Unit tests of single shaders: a [`ShaderTest`](shader_test::ShaderTest) gives a shader a
//! [`Hit`](hit::Hit), any builtin, a payload and resources, and reads back what it left; a
//! [`ComputeTest`](compute_test::ComputeTest) dispatches a compute shader. Macros compare results,
//! and [`Explain`](explain::Explain) tells how one came about.
//!
//! This is the light way to test: the crate needs the engine alone. With the feature `sanitizer`
//! shaders are checked while they run, with `debugger` they are followed line by line.
//!
//! The crate `anyhit` re-exports what its users need; other items may change in any version.

pub mod assertions;
pub mod block_counts;
pub mod blocks;
pub mod bound;
#[cfg(feature = "debugger")]
mod compute_scene;
pub mod compute_test;
pub mod data;
pub mod device_buffers;
mod equality;
pub mod explain;
pub mod fit;
mod given;
pub mod hit;
pub mod host_struct;
mod image_views;
pub mod instance;
mod layout_mismatch;
pub mod memory;
pub mod mock;
pub mod normal;
pub mod number;
pub mod rust_layout;
#[cfg(feature = "sanitizer")]
mod sanitized;
pub mod scalars;
pub mod scene;
mod serialize;
pub mod shader_outcome;
pub mod shader_test;
#[cfg(feature = "sanitizer")]
pub mod side_by_side;
#[cfg(feature = "proptest")]
pub mod strategies;
pub mod struct_data;
mod summaries;
pub mod texels;
pub mod trace;
pub mod typed;
pub mod value;
