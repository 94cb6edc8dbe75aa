//! The text of a file of host code, with places for errors.

use std::ops::Range;
use std::sync::Arc;

use anyhit_base::error::Place;

/// Depth to which types and constants may be nested.
pub(super) const MAX_DEPTH: usize = 64;

/// A file of host code.
pub(super) struct SourceFile {
    pub(super) name: String,
    pub(super) text: Arc<str>,
}

impl SourceFile {
    /// The place of a range of bytes.
    pub(super) fn place(&self, span: Range<usize>) -> Place {
        Place::Text { file: self.name.clone(), text: self.text.clone(), span }
    }

    /// The byte of a line, from 1, and a column in characters, from 0.
    pub(super) fn byte(&self, line: usize, column: usize) -> usize {
        let before: usize = self.text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
        let rest = self.text.get(before..).unwrap_or_default();
        before + rest.chars().take(column).map(char::len_utf8).sum::<usize>()
    }
}
