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
pub mod block_counts;
pub mod blocks;
mod bound;
#[cfg(feature = "scenes")]
mod clean_launch;
pub mod compute_test;
pub mod data;
pub mod device_buffers;
mod equality;
pub mod explain;
mod fit;
mod given;
pub mod hit;
pub mod host_layout;
mod image_views;
pub mod instance;
pub mod layout;
mod memory;
pub mod mock;
pub mod normal;
pub mod number;
pub mod rust_layout;
pub mod scalars;
pub mod scene;
mod serialize;
pub mod shader_outcome;
pub mod shader_test;
mod side_by_side;
pub mod smoke;
#[cfg(feature = "proptest")]
pub mod strategies;
pub mod struct_data;
mod summaries;
pub mod texels;
pub mod trace;
pub mod typed;
pub mod value;

// What opens scene files, runs them and judges what they leave.
#[cfg(feature = "scenes")]
pub mod blame;
#[cfg(feature = "scenes")]
pub mod bless;
#[cfg(feature = "scenes")]
pub mod case;
#[cfg(feature = "scenes")]
mod changed_scalars;
#[cfg(feature = "scenes")]
mod check_optimizer;
#[cfg(feature = "scenes")]
pub mod cost;
#[cfg(feature = "scenes")]
pub mod coverage;
#[cfg(feature = "scenes")]
pub mod expect;
#[cfg(feature = "scenes")]
pub mod in_order;
#[cfg(feature = "scenes")]
pub mod init;
#[cfg(feature = "libtest")]
pub mod libtest;
#[cfg(feature = "scenes")]
pub mod loaded_scene;
#[cfg(feature = "scenes")]
pub mod many_seeds;
#[cfg(feature = "scenes")]
mod observe;
#[cfg(feature = "scenes")]
mod pairs;
#[cfg(feature = "cli")]
pub mod picture_page;
#[cfg(feature = "scenes")]
pub mod pixel_cost;
#[cfg(feature = "scenes")]
pub mod rendering;
#[cfg(feature = "scenes")]
pub mod run;
#[cfg(feature = "scenes")]
pub mod sanitized;
#[cfg(feature = "cli")]
pub mod scene_schema;
#[cfg(feature = "scenes")]
pub mod shares;
#[cfg(feature = "scenes")]
pub mod source_tree;
#[cfg(feature = "scenes")]
pub mod stability;
#[cfg(feature = "scenes")]
mod structure_names;
#[cfg(feature = "scenes")]
pub mod suite;
#[cfg(feature = "scenes")]
mod tasks;
#[cfg(feature = "scenes")]
pub mod typed_scene;

/// Compiles what `docs/testing.md` shows.
#[cfg(doctest)]
#[doc = include_str!("../../docs/testing.md")]
pub struct TestingGuide;
