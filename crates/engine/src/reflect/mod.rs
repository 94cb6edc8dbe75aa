//! Reflection: where the parts of a shader's types lie in bytes, their names, and values read from
//! bytes.
//!
//! A [`Layout`] is a type with the [`Rules`] that place its parts; [`lookup`] finds the structs of
//! a module by name and the blocks that its variables declare; [`table`] lists a struct's members;
//! [`Layout::read`] builds values, such as a [`TypedValue`](value::TypedValue), from bytes. Tests,
//! scenes, the debugger and messages ask here.

pub mod heap;
mod layout;
pub mod lookup;
mod path;
mod read;
pub mod table;
pub mod value;

pub use layout::{Layout, MAX_WORDS, Rules};
pub use path::{MemoryPart, ScalarSearch, shorten};
pub use read::FromParts;
