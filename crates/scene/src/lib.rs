//! Scenes: `scene.toml` and everything that it names, read into plain descriptions.
//!
//! Reading has two steps. [`mod@file`] parses the text: every value has a span, unknown keys are
//! errors, and an error does not stop reading. [`resolve`] then resolves names,
//! loads meshes, images and modules through [`files`], and runs generators. The result,
//! [`ResolvedScene`], has acceleration structures, bytes and texels, but no pipeline: the
//! pipeline makes its own objects from it. `docs/scene.md` is the format's reference.

pub mod address_entry;
pub mod addresses;
pub mod assemble;
mod assign_addresses;
mod block_sizes;
mod build_input;
pub mod camera;
pub mod data;
pub mod data_sources;
pub mod deferred_file;
pub mod descriptor_kind;
mod descriptors;
mod device;
pub mod encoding;
pub mod entry;
pub mod file;
pub mod files;
pub mod frame;
pub mod generate;
pub mod geometry;
pub mod image;
pub mod image_entry;
pub mod indirect;
pub mod instance_entry;
pub mod mesh;
pub mod mesh_piece;
mod micromap;
pub mod mip;
pub mod models;
pub mod pass;
pub mod pass_entry;
pub mod read;
pub mod resolve;
pub mod resolved;
pub mod resources;
mod run_limits;
pub mod sampler;
pub mod sanitize_table;
pub mod specialization;
pub mod struct_data;
pub mod tree;
pub mod unread_image;
pub mod unwritten;
mod view_entry;

pub use assemble::{Assembled, assemble, assemble_without};
pub use files::{DiskFiles, EmbeddedFiles, Files, SceneFiles};
pub use resolve::{LoadOptions, ParsedScene, load, load_bytes, load_text};
pub use resolved::ResolvedScene;
pub use run_limits::RunLimits;

#[cfg(test)]
mod mesh_tests;
#[cfg(test)]
mod mistakes;
mod motion;
pub mod open_models;
pub mod own_bindings;
mod read_file;
#[cfg(test)]
mod reference_tests;
pub mod scalar;
mod scene_names;
mod structure_names;
mod transform_entry;
mod typed_scalars;
