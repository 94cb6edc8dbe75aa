//! How input is read: how large it may be ([`limits`]), which files a path may name
//! ([`file`](mod@file)), how several threads decode one input ([`threads`]), and how a reader of
//! another crate is kept from taking the program down ([`contained()`]).
//!
//! A path that the user typed may be a file, a pipe or `-` for standard input. A path that stands
//! inside a file (a scene, a mesh, a test) comes from whoever wrote that file: it names a regular
//! file, and one inside a root folder where one is given.

mod contained;
pub mod file;
pub mod limits;
pub mod threads;

pub use contained::contained;
pub use file::{
    RootFolder, STANDARD_INPUT, check_regular, is_stream, read_argument, read_head, read_regular,
};
pub use limits::{InputLimit, InputLimits};
