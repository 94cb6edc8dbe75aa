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
pub mod blame;
pub mod bless;
pub mod block_counts;
pub mod blocks;
mod bound;
pub mod case;
mod check_optimizer;
pub mod compute_test;
pub mod cost;
pub mod coverage;
pub mod data;
pub mod device_buffers;
pub mod expect;
pub mod explain;
mod given;
pub mod hit;
pub mod init;
pub mod instance;
pub mod layout;
pub mod loaded_scene;
mod memory;
pub mod mock;
pub mod number;
mod observe;
pub mod rendering;
pub mod run;
pub mod rust_layout;
pub mod scalars;
pub mod scene;
pub mod shader_outcome;
pub mod shader_test;
pub mod smoke;
pub mod stability;
#[cfg(feature = "proptest")]
pub mod strategies;
pub mod struct_data;
pub mod suite;
mod tasks;
pub mod texels;
pub mod trace;
pub mod typed;
pub mod typed_scene;
pub mod value;

/// Compiles what `docs/testing.md` shows.
#[cfg(doctest)]
#[doc = include_str!("../../docs/testing.md")]
pub struct TestingGuide;
