//! The examples' own tests: each example is a module here, so that its test needs no executable of
//! its own.

#[cfg(feature = "wgsl")]
#[path = "../../examples/bands.rs"]
mod bands;
#[cfg(feature = "wgsl")]
#[path = "../../examples/launch.rs"]
mod launch;
#[path = "../../examples/one_ray.rs"]
mod one_ray;
#[path = "../../examples/one_shader.rs"]
mod one_shader;
#[path = "../../examples/renderer.rs"]
mod renderer;
