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
//! | `sanitizer` | with `scenes` | `ShaderTest::sanitize` and `ComputeTest::sanitize` |
//! | `scenes` | yes | scene files, smoke tests, `debug` of tests, `compilers` and `sanitizer` |
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
//! `default-features = false` and compiles the engine and the interface for unit tests alone. How
//! all this works inside stands in `docs/architecture.md`.

#![warn(unreachable_pub)]
#![cfg_attr(docsrs, feature(doc_cfg))]

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
#[cfg(feature = "scenes")]
#[doc(hidden)]
pub mod demo;

// A module, and how a source becomes one.
pub use anyhit_base::error::Stage;
pub use anyhit_base::input::{InputLimit, InputLimits};
pub use anyhit_compile::{CompileOptions, CompilerFlags, DebugInfoLevel, Language, Optimize, Source};
pub use anyhit_engine::module::Module;
pub use anyhit_engine::module::interface::EntryPoint;
pub use anyhit_engine::module::scalar_value::ScalarValue;
pub use anyhit_engine::module::validate::{ValidationClass, ValidationFinding};
pub use anyhit_engine::program::Program;

// A shader in a unit test.
pub use anyhit_engine::machine::Exit;
pub use anyhit_unit_test::compute_test::{ComputeOutcome, ComputeTest};
pub use anyhit_unit_test::data::TypedBytes;
pub use anyhit_unit_test::device_buffers::DeviceBuffers;
pub use anyhit_unit_test::explain::Explain;
pub use anyhit_unit_test::hit::Hit;
pub use anyhit_unit_test::host_struct::HostLayout;
pub use anyhit_unit_test::mock::{CallableCall, ExecuteCall, TraceCall};
pub use anyhit_unit_test::scalars::{NestedScalars, Scalars};
pub use anyhit_unit_test::shader_outcome::{ReportedHit, ShaderOutcome};
pub use anyhit_unit_test::shader_test::ShaderTest;
#[cfg(feature = "proptest")]
pub use anyhit_unit_test::strategies;
pub use anyhit_unit_test::struct_data::StructData;
pub use anyhit_unit_test::texels::Texels;
pub use anyhit_unit_test::value::Value;
pub use anyhit_unit_test::{assert_near, assert_payload_eq, assert_ulps, host_layout};

// What rays meet.
pub use anyhit_engine::accel::{
    EndCaps, GeometryData, GeometryFlags, HitKind, Indexing, InstanceFlags, Motion, RayFlags, Srt, TraceRay,
};
pub use anyhit_engine::geometry::{Precision, Ray};
pub use anyhit_unit_test::instance::Instance;
pub use anyhit_unit_test::scene::Scene;

// What shaders are bound.
pub use anyhit_engine::machine::format::{Component, Format};
pub use anyhit_engine::machine::image::{Dimension, Image, ImageShape};
pub use anyhit_engine::machine::sampler::{AddressMode, BorderColor, CompareOp, Filter, Sampler};
pub use anyhit_engine::machine::{Buffer, Descriptor};

// Pipelines, launches and single rays.
pub use anyhit_engine::machine::LaunchLimits;
pub use anyhit_engine::machine::printed::PrintedLine;
pub use anyhit_engine::pipeline::{
    Band, DeviceProfile, HostScene, Pipeline, PipelineBuilder, PipelineFlags, RayOperands, Sbt, SbtRecord,
    Stats, StreamedImage,
};
pub use anyhit_unit_test::trace::{HitRecord, Launched, Traced};

// Scene files, cases and whole modules.
#[cfg(feature = "scenes")]
pub use anyhit_cases::case::Case;
#[cfg(feature = "libtest")]
pub use anyhit_cases::cases;
#[cfg(feature = "scenes")]
pub use anyhit_cases::loaded_scene::{LoadedScene, SceneOutcome};
#[cfg(feature = "scenes")]
pub use anyhit_cases::many_seeds::compute_test::SeededRuns;
#[cfg(feature = "scenes")]
pub use anyhit_cases::smoke::{SmokeOptions, SmokeReport};
#[cfg(feature = "scenes")]
pub use anyhit_debugger::ExplainRequest;

// What goes wrong.
pub use anyhit_base::error::{
    DescriptorElement, Error, ErrorKind, Place, Result, ShaderFrame, Trap, TrapCode, TrapOperands, Warning,
};
#[cfg(feature = "sanitizer")]
pub use anyhit_sanitize::WarningReports;

/// Compiles what `docs/testing.md` shows.
#[cfg(doctest)]
#[doc = include_str!("../docs/testing.md")]
pub struct TestingGuide;
