//! The engine: runs SPIR-V of the ray-tracing and compute stages on the CPU.
//!
//! Its modules import one way only, from the last of this list to the first:
//!
//! * [`math`]: SIMD lanes, error bounds, exact arithmetic, float formats.
//! * [`geometry`]: primitives and their exact intersection with a ray, one file each.
//! * [`accel`]: acceleration structures, and a traversal that stops for shaders.
//! * [`module`], [`machine`]: SPIR-V as a typed module; the state of a running batch.
//! * [`ops`]: the instruction set, with translation and evaluation of each instruction.
//! * [`reflect`]: layouts of types, names of their parts, values read from bytes.
//! * [`program`]: a lowered entry point, its optimised form, and the proof that both agree.
//! * [`interp`]: the loops over the operations of a batch.
//! * [`pipeline`]: launches, the shader binding table, the stack of shader calls.
//!
//! All of this is one crate so that nothing hot crosses a border between crates: the interpreter
//! and the traversal are compiled twice, for observers behind a pointer and for none.
//! `docs/architecture.md` follows a ray and an instruction through these modules. The crate
//! `anyhit` re-exports what its users need; other items may change in any version.

pub mod accel;
pub mod geometry;
pub mod interp;
pub mod machine;
pub mod math;
pub mod module;
pub mod ops;
pub mod pipeline;
pub mod program;
pub mod reflect;
