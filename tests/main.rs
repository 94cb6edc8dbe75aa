//! All integration tests of the crate, as one executable: a module for each area.
//!
//! `cargo test --test main stability::` runs one area. What is not here is `cases.rs`, which lists
//! its tests while it runs. The tests share a process: none may change what belongs to all of it,
//! such as environment variables, the current directory or the panic hook. Whoever needs that
//! starts the program `anyhit` as a process of its own.

mod support;

#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod action;
mod addresses;
mod atomic_files;
#[cfg(feature = "wgsl")]
mod bands;
mod bare_modules;
mod book;
mod cli;
mod compile;
mod conformance;
#[cfg(all(feature = "scenes", feature = "wgsl"))]
mod conversions;
#[cfg(feature = "debugger")]
mod dap;
#[cfg(feature = "debugger")]
mod debugger;
#[cfg(feature = "debugger")]
mod debugger_steps;
#[cfg(feature = "debugger")]
mod debugger_walks;
mod descriptors;
mod device;
mod device_buffers;
mod driver_golden;
#[cfg(feature = "stress")]
mod exact_intersections;
mod examples;
#[cfg(feature = "wgsl")]
mod explanations;
mod expressions;
mod file_circles;
mod first_tests;
mod fixtures;
mod given_sizes;
mod gltf_models;
mod grammar_delta;
mod growth_fit;
mod host_layout;
mod hostile_text;
mod instructions;
#[cfg(all(feature = "proptest", feature = "wgsl"))]
mod laws;
mod layering;
mod layouts;
mod limits;
mod load_fixtures;
mod load_hostile;
mod load_limits;
mod looking;
mod lower_fixtures;
mod lower_hostile;
mod misuse;
mod module_validation;
mod names;
mod obstacles;
#[cfg(feature = "wgsl")]
mod outcomes;
#[cfg(feature = "wgsl")]
mod pass_bindings;
mod passes;
mod pictures;
mod pipeline;
mod printed_commands;
mod profiles;
mod public_face;
mod random_modules;
mod random_programs;
mod readers;
mod reading;
mod readme;
mod real_calls;
mod result_types;
mod rewriting;
mod robustness;
mod rust_interface;
mod sanitized_modules;
mod sanitized_outputs;
#[cfg(feature = "glsl")]
mod sanitized_values;
#[cfg(feature = "wgsl")]
mod saved_pictures;
mod scene_init;
mod scene_schema;
mod shares;
mod shares_recipes;
#[cfg(feature = "wgsl")]
mod sizes_in_buffers;
mod skips;
mod skips_payload;
mod smoke;
#[cfg(feature = "wgsl")]
mod smoke_values;
mod source_variables;
mod stability;
#[cfg(feature = "stress")]
mod stress;
mod struct_data;
mod support_table;
mod swept_sphere_tables;
mod test_command;
mod test_files;
#[cfg(all(feature = "scenes", feature = "wgsl"))]
mod toml_conversions;
mod trace_one_ray;
mod traps;
mod traversal_lints;
mod traversal_order;
mod traversal_rules;
mod unit_test;
mod verdict;
mod verify;
#[cfg(feature = "wgsl")]
mod wgsl_values;
