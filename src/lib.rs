//! `anyhit` runs ray-tracing shaders on the CPU, exactly: SPIR-V as a compiler wrote it, over
//! scenes of triangles, boxes, spheres and linear swept spheres, so that the logic of hit shaders
//! can be unit-tested, followed one ray at a time and guarded in CI without a GPU.
//!
//! # Load a shader
//!
//! [`Module::open`] reads SPIR-V, or compiles a [`Source`] of GLSL, WGSL, Slang or HLSL as
//! [`CompileOptions`] say. [`Program::of`] prepares one of its entry points: what the module breaks
//! of the specification, and what this crate does not run, is an [`Error`] with the place.
//!
//! # Test one shader
//!
//! [`ShaderTest`] runs one shader by itself on a [`Hit`] that is really intersected, with any
//! builtin, payload and resource; closures answer what it calls ([`TraceCall`], [`ExecuteCall`],
//! [`CallableCall`]). [`ComputeTest`] dispatches a compute shader. Results are [`Value`]s by the
//! names of the shader's members, or plain Rust types; [`StructData`] writes by names.
//! [`assert_ulps!`], [`assert_near!`] and [`assert_payload_eq!`] compare.
//!
//! # Trace a ray, launch a pipeline
//!
//! A [`Scene`] holds [`Instance`]s and what shaders are bound. [`Pipeline::trace`] traces one
//! [`Ray`] through hit and miss shaders, [`Pipeline::launch`] runs ray generation over a grid:
//!
//! ```
//! use anyhit::{Instance, Module, Pipeline, Program, Ray, Scene};
//!
//! # fn main() -> anyhit::Result<()> {
//! # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/spirv-fixtures/pass/sphere/closest-hit");
//! let shader = |file| Program::of(&Module::open(format!("{folder}/{file}"))?, "main");
//! let pipeline = Pipeline::builder()
//!     .hit([shader("main.rchit.spv")?])?
//!     .miss(shader("main.rmiss.spv")?)?
//!     .build()?;
//! let scene = Scene::new([Instance::sphere([0.0; 3], 0.5)])?;
//!
//! let traced = pipeline.trace(&scene, Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]))?;
//! // The ray starts at z = 4 and the sphere's surface is at z = 1/2.
//! assert_eq!(traced.hit().t, 3.5);
//! assert_eq!(traced.payload["normal"].vec3(), [0.0, 0.0, 1.0]);
//! # Ok(())
//! # }
//! ```
//!
//! # Use scene files
//!
//! [`LoadedScene`] opens a `scene.toml`, changes and launches it. [`Case`] finds folders of cases
//! and checks them; [`SmokeReport`] runs whatever a module holds on made-up inputs.
//!
//! # See why
//!
//! [`Explain`] tells the way of a ray or of a shader's results, as `anyhit trace-one-ray` does; so
//! does [`LoadedScene::explain`]. An [`Error`] renders its place in the source, and [`Error::kind`]
//! says whose mistake it is: the input's, this crate's, or the shader's while it ran. Then
//! [`Error::trap`] has what happened as data: code, stack, place, values and the rule's number.
//!
//! # Features
//!
//! | feature | default | what it adds |
//! |---|---|---|
//! | `cli` | yes | the program `anyhit`; with it `scenes` and `recordings` |
//! | `debugger` | yes | `trace-one-ray --interactive` and `anyhit dap`; with it `cli` |
//! | `scenes` | yes | scene files ([`LoadedScene`], [`Case`]); with it `compilers` |
//! | `gltf`, `obj` | yes | models of these files in scenes |
//! | `images` | yes | PNG and JPEG files in scenes, PNG of what was rendered |
//! | `compilers` | yes | GLSL, Slang and HLSL through installed compilers, cached modules |
//! | `stress` | yes | the commands `stress` and `check-math`, through exact numbers |
//! | `wgsl` | yes | WGSL sources, through naga |
//! | `glsl` | | GLSL sources, through glslang (built from C++ source, minutes, once) |
//! | `exr` | | OpenEXR files |
//! | `flamegraph` | | flame graphs of `anyhit render --profile`, through inferno (CDDL-1.0) |
//! | `recordings` | with `cli` | recordings of hits, for `anyhit verify` |
//! | `libtest` | | `cases!`: folders of cases as tests of `cargo test`, through libtest-mimic |
//! | `proptest` | | `strategies`: rays, primitives and instances for property tests |
//!
//! A library that only runs SPIR-V, on a [`Scene`] or a [`Hit`] built in Rust, takes
//! `default-features = false`. How all this works inside stands in `docs/architecture.md`.

#![deny(unsafe_code)]
#![warn(unreachable_pub)]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod accel;
#[cfg(feature = "compilers")]
mod atomic_file;
#[cfg(feature = "stress")]
mod check_math;
#[cfg(feature = "cli")]
mod cli;
mod compile;
mod debug;
#[cfg(feature = "cli")]
mod drawing;
mod error;
mod escape;
mod geometry;
mod harness;
mod input;
#[doc(hidden)]
pub mod internals;
mod interp;
mod machine;
mod math;
mod module;
mod ops;
mod pipeline;
mod program;
#[cfg(feature = "recordings")]
mod recording;
mod sanitize;
#[cfg(feature = "scenes")]
mod scene;
mod sorted;
#[cfg(feature = "stress")]
mod stress;

// A module, and how a source becomes one.
pub use compile::{CompileOptions, CompilerFlags, DebugInfoLevel, Language, Optimize, Source};
pub use input::{InputLimit, InputLimits};
pub use module::Module;
pub use module::interface::{EntryPoint, Stage};
pub use module::scalar_value::ScalarValue;
pub use module::validate::{ValidationClass, ValidationFinding};
pub use program::Program;

// A shader in a unit test.
pub use harness::compute_test::{ComputeOutcome, ComputeTest};
pub use harness::data::TypedBytes;
pub use harness::device_buffers::DeviceBuffers;
pub use harness::explain::Explain;
pub use harness::hit::Hit;
pub use harness::host_layout::HostLayout;
pub use harness::mock::{CallableCall, ExecuteCall, TraceCall};
pub use harness::scalars::{NestedScalars, Scalars};
pub use harness::shader_outcome::{ReportedHit, ShaderOutcome};
pub use harness::shader_test::ShaderTest;
#[cfg(feature = "proptest")]
pub use harness::strategies;
pub use harness::struct_data::StructData;
pub use harness::texels::Texels;
pub use harness::value::Value;
pub use machine::Exit;

// What rays meet.
pub use accel::{
    EndCaps, GeometryData, GeometryFlags, HitKind, Indexing, InstanceFlags, Motion, RayFlags, Srt, TraceRay,
};
pub use geometry::{Precision, Ray};
pub use harness::instance::Instance;
pub use harness::scene::Scene;

// What shaders are bound.
pub use machine::format::{Component, Format};
pub use machine::image::{Dimension, Image, ImageShape};
pub use machine::sampler::{AddressMode, BorderColor, CompareOp, Filter, Sampler};
pub use machine::{Buffer, Descriptor};

// Pipelines, launches and single rays.
pub use harness::trace::{HitRecord, Launched, Traced};
pub use machine::LaunchLimits;
pub use machine::printed::PrintedLine;
pub use pipeline::{
    Band, DeviceProfile, Pipeline, PipelineBuilder, PipelineFlags, RayOperands, Sbt, SbtRecord, Stats,
    StreamedImage,
};

// Scene files, cases and whole modules.
#[cfg(feature = "scenes")]
pub use debug::ExplainRequest;
#[cfg(feature = "scenes")]
pub use harness::case::Case;
#[cfg(feature = "scenes")]
pub use harness::loaded_scene::{LoadedScene, SceneOutcome};
pub use harness::smoke::{SmokeOptions, SmokeReport};

// What goes wrong.
pub use error::{
    DescriptorElement, Error, ErrorKind, Place, Result, ShaderFrame, Trap, TrapCode, TrapOperands, Warning,
};
pub use sanitize::WarningReports;
