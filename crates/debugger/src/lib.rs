//! The debugger: follows one ray, or one invocation of a launch or dispatch, through a scene.
//!
//! A [`session`] runs it under an observer and has its events explained by `anyhit_explain`. The
//! [`debugger`] runs it line by line: breakpoints, watched values, expressions, steps back. Its
//! front ends are the [`console`] of `anyhit trace-one-ray --interactive` and, with the feature
//! `adapter`, the debug adapter for editors. Nothing here writes a file, and a terminal is the
//! caller's; only the server of the adapter reads files.
//!
//! The crate `anyhit` re-exports what its users need; other items may change in any version.

#[cfg(feature = "adapter")]
pub mod adapter;
pub mod command;
mod compute;
pub mod console;
pub mod debugger;
mod deciders;
pub mod drawing;
mod event_log;
pub mod line_recorder;
mod memory;
pub mod session;
pub mod shell;
pub mod source_text;
mod summary;

pub use session::{ExplainRequest, Session};
