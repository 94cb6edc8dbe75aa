//! What every crate of anyhit shares: the error type with its rendering, escaping of untrusted
//! text, reading and writing of files, and sorted collections.
//!
//! An [`Error`](error::Error) says whose mistake it is by its kind, has places (a word of a module,
//! a span of a text file) and renders them as a compiler does. Text that a file can set reaches a
//! terminal, a page or a report through [`escape`] alone. Files are read within
//! [`InputLimits`](input::InputLimits) and written through [`atomic_file`], so that a failure
//! leaves the old content. [`sorted`] has vectors as maps and sets, which iterate in one order on
//! every machine.
//!
//! Nothing here knows of shaders beyond the names of their stages. The crate `anyhit` re-exports
//! what its users need; other items may change in any version.

#[cfg(feature = "compilers")]
pub mod atomic_file;
pub mod error;
pub mod escape;
pub mod input;
pub mod sorted;
