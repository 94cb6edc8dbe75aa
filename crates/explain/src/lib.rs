//! Explains what a ray hit and which shaders it called.
//!
//! The events of a pipeline are read by an [`EventReader`](reader::EventReader) into a
//! [`transcript`]: a tree of plain data, with names instead of indices and typed values instead of
//! words. [`render`] turns it into text, and its JSON is the tree itself. Nothing here reads or
//! writes a file or a terminal, and nothing needs a scene file: what a scene calls its parts comes
//! through the trait [`SceneNames`](names::SceneNames).
//!
//! The crate `anyhit` re-exports what its users need; other items may change in any version.

mod builtin_names;
pub mod executed_lines;
pub mod given_block;
pub mod hints;
pub mod layout;
pub mod names;
mod near_hits;
pub mod page;
mod query_reader;
pub mod reader;
pub mod render;
pub mod summary_words;
pub mod transcript;
mod traversal;
mod traversal_hints;
pub mod walk;

pub use transcript::Transcript;
