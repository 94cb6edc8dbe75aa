//! Reads the files that a scene names.

use std::path::Path;

use crate::files::Files;
use crate::read::Span;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::escape;
use anyhit_base::input::InputLimit;

/// Reads a file that a scene names; the error points at the name.
pub(crate) fn read(files: &dyn Files, path: &str, span: &Span) -> Result<Vec<u8>> {
    read_limited(files, path, span, InputLimit::FileBytes)
}

/// Reads a file that a scene names and whose kind has a limit of its own.
pub(crate) fn read_limited(files: &dyn Files, path: &str, span: &Span, limit: InputLimit) -> Result<Vec<u8>> {
    let path = span.source.sibling(path);
    files.read_limited(&path, limit).map_err(|error| file_error(error, span, &path))
}

/// The error of a file that a scene names, at its name.
pub(crate) fn file_error(error: Error, span: &Span, path: &Path) -> Error {
    match error.kind() {
        ErrorKind::Io => error.at_with(span.place(), format!("looked for at {}", escape::path(&path))),
        _ => error.at(span.place()),
    }
}
