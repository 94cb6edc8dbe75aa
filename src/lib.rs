//! `anyhit` runs ray-tracing shaders on the CPU, exactly: SPIR-V as a compiler wrote it, over
//! scenes of triangles, boxes, spheres and linear swept spheres, so that the logic of hit shaders
//! can be unit-tested, followed one ray at a time and guarded in CI without a GPU.
//!
//! # One ray's journey
//!
//! **A module** comes first. [`module::load()`] walks the words of a SPIR-V file and fills arenas
//! of types, constants, variables and functions. Bytes that break a rule are rejected with the
//! offset of the word; a valid instruction that this crate does not support is kept, and rejected
//! only where a shader would execute it. [`ops::support`] tells the two apart, for all of SPIR-V.
//!
//! **A program** is one entry point, prepared by [`program::lower()`]. A register is one scalar
//! component for all lanes of a batch, so a `vec3` is three registers and composites vanish here:
//! extracting and shuffling only rearrange lists of registers. What remains are [lane
//! kernels](ops::lane_kernel), one scalar function each, and blocks in structured order, in which
//! lanes that diverge at a branch reconverge. Dead code is eliminated, builtins that nothing reads
//! included.
//!
//! **A scene** is a [`accel::Tlas`] of instances over [`accel::Blas`]es. Whether a ray hits a
//! primitive is decided exactly for the given floats ([`geometry`]): first in floating point with
//! an error bound, and where the bound does not decide, in exact arithmetic. The reported t is the
//! correctly rounded one. BVHs make this fast and do not change the result.
//!
//! **A launch** ([`pipeline::Launch`]) cuts a grid of invocations into batches of 64 lanes and runs
//! the ray generation shader. The interpreter ([`interp::run()`]) never calls the host: at
//! `OpTraceRayKHR` it [stops](machine::Stop), and the pipeline moves the ray's cursor to its next
//! candidate. Opaque triangles are committed at once; for the others the record of the shader
//! binding table is
//!
//! ```text
//! instance's offset + geometry index * sbt_stride + sbt_offset
//! ```
//!
//! and the intersection and any-hit shaders of its group run as a batch of their own, which reads
//! and writes the caller's payload. They commit the candidate, ignore it or end the ray. Candidates
//! come in ascending t, then by instance, geometry and primitive: so the order in which any-hit
//! shaders run does not depend on the BVH, the number of lanes, the threads or the machine.
//!
//! **The end of the ray** is one closest-hit or miss shader. Then ray generation continues after
//! its trace, with the payload as they left it. Every fault on the way is a [trap](machine::trap)
//! with a launch index, a source line and the stack of shaders that led there.
//!
//! # A ray by hand
//!
//! One sphere, a closest-hit and a miss shader, one ray; no ray generation shader is needed:
//!
//! ```
//! use anyhit::{Instance, Module, Pipeline, Program, Ray, Scene};
//!
//! # fn main() -> anyhit::Result<()> {
//! # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/spirv-fixtures/pass/sphere/closest-hit");
//! let shader = |file| Program::of(&Module::open(format!("{folder}/{file}"))?, "main");
//! let pipeline = Pipeline::builder().hit([shader("main.rchit.spv")?])?.miss(shader("main.rmiss.spv")?)?.build()?;
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
//! [`ShaderTest`] runs one shader by itself on a [`Hit`]; [`harness::case`] runs folders of cases.
//!
//! # Layers
//!
//! Imports go one way, and a test enforces it: `cli -> harness -> {debug, recording, stress,
//! check_math} -> scene -> {pipeline, compile} -> interp -> program -> ops -> {module, machine ->
//! accel} -> geometry -> math -> {input, atomic_file} -> error`.

#![deny(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod accel;
mod atomic_file;
#[cfg(feature = "stress")]
mod check_math;
mod cli;
mod compile;
mod debug;
mod error;
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
mod recording;
mod scene;
#[cfg(feature = "stress")]
mod stress;

// A module, and how a source becomes one.
pub use compile::{CompileOptions, CompilerFlags, DebugInfoLevel, Language, Optimize, Source};
pub use input::{InputLimit, InputLimits};
pub use module::Module;
pub use module::interface::{EntryPoint, Stage};
pub use program::Program;

// A shader in a unit test.
pub use harness::compute_test::{ComputeOutcome, ComputeTest};
pub use harness::data::TypedBytes;
pub use harness::device_buffers::DeviceBuffers;
pub use harness::explain::Explain;
pub use harness::hit::Hit;
pub use harness::mock::{CallableCall, ExecuteCall, TraceCall};
pub use harness::scalars::Scalars;
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
pub use geometry::Ray;
pub use harness::instance::Instance;
pub use harness::scene::Scene;

// What shaders are bound.
pub use machine::format::{Component, Format};
pub use machine::image::{Dimension, Image, ImageShape};
pub use machine::sampler::{AddressMode, BorderColor, CompareOp, Filter, Sampler};
pub use machine::{Buffer, Descriptor};

// Pipelines, launches and single rays.
pub use harness::trace::{HitRecord, Launched, Traced};
pub use machine::printed::PrintedLine;
pub use machine::{LaunchFuel, LaunchLimits};
pub use pipeline::{
    Band, DeviceFeatures, DeviceLimits, DeviceProfile, Pipeline, PipelineBuilder, PipelineFlags, RayOperands,
    Sbt, SbtRecord, Stats, StreamedImage,
};

// Scene files, cases and whole modules.
pub use debug::ExplainRequest;
pub use harness::case::Case;
pub use harness::loaded_scene::{LoadedScene, SceneOutcome};
pub use harness::smoke::{SmokeOptions, SmokeReport};

// What goes wrong.
pub use error::{
    DescriptorElement, Error, ErrorKind, Place, Result, ShaderFrame, Trap, TrapCode, TrapOperands, Warning,
};
