//! Scene files: resources, passes, data by member name, pictures.

mod addresses;
mod device;
mod given_sizes;
mod gltf_models;
mod heaps;
#[cfg(feature = "wgsl")]
mod pass_bindings;
mod passes;
mod pictures;
#[cfg(feature = "wgsl")]
mod saved_pictures;
mod scene_init;
mod scene_schema;
#[cfg(feature = "wgsl")]
mod sizes_in_buffers;
mod struct_data;
#[cfg(all(feature = "scenes", feature = "wgsl"))]
mod toml_conversions;
#[cfg(feature = "wgsl")]
mod wgsl_values;
