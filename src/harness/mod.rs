//! Tests of shaders, at three depths.
//!
//! * One shader by itself: a [`ShaderTest`](shader_test::ShaderTest) gives it a hand-made
//!   [`Hit`](hit::Hit), any builtin, a payload, buffers, and reads back what it left.
//! * One ray through a [`Scene`](scene::Scene) of a few instances, with
//!   [`Pipeline::trace`](crate::Pipeline::trace).
//! * A whole launch, with [`Pipeline::launch`](crate::Pipeline::launch), or a [`case`]: a
//!   `scene.toml` whose `[expect]` says what must come out.
//!
//! [`smoke`] runs whatever a module holds on made-up inputs, to see that it runs at all.
//!
//! `docs/testing.md` shows each.

pub mod assertions;
#[cfg(feature = "scenes")]
pub mod blame;
#[cfg(feature = "scenes")]
pub mod bless;
pub mod block_counts;
pub mod blocks;
mod bound;
#[cfg(feature = "scenes")]
pub mod case;
#[cfg(feature = "scenes")]
mod check_optimizer;
pub mod compute_test;
#[cfg(feature = "scenes")]
pub mod cost;
#[cfg(feature = "scenes")]
pub mod coverage;
pub mod data;
pub mod device_buffers;
#[cfg(feature = "scenes")]
pub mod expect;
pub mod explain;
mod given;
pub mod hit;
#[cfg(feature = "scenes")]
pub mod init;
pub mod instance;
pub mod layout;
#[cfg(feature = "scenes")]
pub mod loaded_scene;
mod memory;
pub mod mock;
pub mod number;
#[cfg(feature = "scenes")]
mod observe;
#[cfg(feature = "scenes")]
pub mod rendering;
#[cfg(feature = "scenes")]
pub mod run;
pub mod rust_layout;
pub mod scalars;
pub mod scene;
pub mod shader_outcome;
pub mod shader_test;
pub mod smoke;
#[cfg(feature = "scenes")]
pub mod stability;
#[cfg(feature = "proptest")]
pub mod strategies;
pub mod struct_data;
#[cfg(feature = "scenes")]
pub mod suite;
#[cfg(feature = "scenes")]
mod tasks;
pub mod texels;
pub mod trace;
pub mod typed;
#[cfg(feature = "scenes")]
pub mod typed_scene;
pub mod value;

/// Compiles what `docs/testing.md` shows.
#[cfg(doctest)]
#[doc = include_str!("../../docs/testing.md")]
pub struct TestingGuide;
