//! Execution: instructions, whole programs and launches, at every width of a batch.

#[cfg(feature = "wgsl")]
mod bands;
mod descriptors;
mod instructions;
mod pipeline;
mod random_modules;
mod random_programs;
mod real_calls;
mod rewriting;
mod skips;
mod skips_payload;
mod traps;
