//! The debugger: explains what a ray hit and which shaders it called.
//!
//! A [`session`] runs one invocation or one ray under an observer and reads the pipeline's events
//! into a [`transcript`]: a tree of plain data, with names instead of indices and typed values
//! instead of words. [`render`] turns it into text, and its JSON is the tree itself. Nothing here
//! reads or writes a file or a terminal.

#[cfg(feature = "debugger")]
pub mod adapter;
mod builtin_names;
#[cfg(feature = "scenes")]
pub mod console;
#[cfg(feature = "scenes")]
pub mod debugger;
pub mod executed_lines;
pub mod given_block;
pub mod hints;
mod layout;
pub mod names;
mod near_hits;
pub(crate) mod page;
mod query_reader;
pub mod reader;
pub mod render;
mod summary_words;
pub mod transcript;
mod traversal;
mod traversal_hints;
pub mod values;
mod walk;

// What explains a scene file by its own names.
#[cfg(feature = "scenes")]
pub mod command;
#[cfg(feature = "scenes")]
mod compute;
#[cfg(feature = "scenes")]
mod deciders;
#[cfg(feature = "scenes")]
pub mod drawing;
#[cfg(feature = "scenes")]
mod event_log;
#[cfg(feature = "scenes")]
pub mod line_recorder;
#[cfg(feature = "scenes")]
mod memory;
#[cfg(feature = "scenes")]
mod scene_names;
#[cfg(feature = "scenes")]
pub mod session;
#[cfg(feature = "scenes")]
pub mod shell;
#[cfg(feature = "scenes")]
pub mod source_text;
#[cfg(feature = "scenes")]
mod summary;

#[cfg(feature = "scenes")]
pub use session::{ExplainRequest, Session};
pub use transcript::Transcript;
