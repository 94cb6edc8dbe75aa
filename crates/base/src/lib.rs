//! The base of all crates of anyhit: the error type and its rendering, escaping of untrusted text,
//! reading and writing of files, and sorted collections.
//!
//! The kind of an [`Error`](error::Error) shows whose mistake it is. Its places are words of a
//! module or spans of a text file, and it renders them like a compiler. Text from a file reaches a
//! terminal, a page or a report only through [`escape`]. Files are read within
//! [`InputLimits`](input::InputLimits) and written through [`atomic_file`], so a failed write keeps
//! the old content. [`sorted`] contains vectors as maps and sets, which iterate in the same order
//! on every machine. [`threads`] runs independent work, which a host ends by an [`interrupt`] and
//! whose [`progress`] it may show.
//!
//! This crate contains nothing about shaders except the names of their stages. The crate `anyhit`
//! re-exports the items for users; other items may change in any version.

#[cfg(feature = "compilers")]
pub mod atomic_file;
pub mod count;
pub mod error;
pub mod escape;
pub mod input;
pub mod interrupt;
pub mod progress;
pub mod sorted;
pub mod style;
pub mod threads;
