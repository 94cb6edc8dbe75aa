//! Places of problems in inputs.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// The place of a problem in an input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A word of a SPIR-V module, counted from its first word.
    Word(usize),
    /// A span of a text file; the range counts bytes.
    Text {
        /// The file's name as the user gave it.
        file: String,
        /// The whole text of the file.
        text: Arc<str>,
        /// The range of the problem, in bytes.
        span: Range<usize>,
    },
    /// A line and a column of a source whose text is not available.
    Line {
        /// The file's name as the debug information gives it.
        file: String,
        /// The line, from 1.
        line: u32,
        /// The column, from 1; 0 if unknown.
        column: u32,
    },
    /// A file as a whole.
    File(PathBuf),
}

/// The columns of a part of a line. They count characters, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SourceColumns {
    /// The first column.
    pub start: u32,
    /// The column behind the last; `None` if it is unknown or in another line.
    pub end: Option<u32>,
}

impl Place {
    /// Returns the name of the file and the line, from 1, of a place in a text; `None` for a word
    /// of a module and for a file as a whole.
    #[doc(hidden)]
    #[must_use]
    pub fn file_line(&self) -> Option<(&str, u32)> {
        match self {
            Self::Text { file, text, span } => Some((file, line_at(text, span.start))),
            Self::Line { file, line, .. } => Some((file, *line)),
            Self::Word(_) | Self::File(_) => None,
        }
    }

    /// Returns the columns of a place in a text; `None` for another place, and where they are
    /// unknown.
    #[doc(hidden)]
    #[must_use]
    pub fn columns(&self) -> Option<SourceColumns> {
        match self {
            Self::Text { text, span, .. } => {
                let span = clamp_span(span, text);
                let begin = text[..span.start].rfind('\n').map_or(0, |at| at + 1);
                let column = |end: usize| u32::try_from(text[begin..end].chars().count() + 1).ok();
                let is_in_line = !span.is_empty() && !text[span.clone()].contains('\n');
                let end = if is_in_line { column(span.end) } else { None };
                Some(SourceColumns { start: column(span.start)?, end })
            }
            Self::Line { column: 0, .. } | Self::Word(_) | Self::File(_) => None,
            Self::Line { column, .. } => Some(SourceColumns { start: *column, end: None }),
        }
    }
}

/// Returns the line of a byte offset in a text, from 1.
pub(super) fn line_at(text: &str, offset: usize) -> u32 {
    let before = &text[..clamp_span(&(offset..offset), text).start];
    u32::try_from(before.matches('\n').count()).map_or(u32::MAX, |lines| lines.saturating_add(1))
}

/// A span that lies within the text, on character boundaries.
pub(super) fn clamp_span(span: &Range<usize>, text: &str) -> Range<usize> {
    let floor = |mut at: usize| {
        at = at.min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        at
    };
    let start = floor(span.start);
    start..floor(span.end).max(start)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_those_of_the_first_byte() {
        let text: Arc<str> = "ab\n\u{e4}\nc".into();
        let line = |start| {
            let place = Place::Text { file: "a.rgen".to_owned(), text: text.clone(), span: start..start };
            place.file_line().map(|(file, line)| (file.to_owned(), line))
        };
        // Offset 4 is within the second line's letter, and 99 is beyond the text.
        for (start, wanted) in [(0, 1), (2, 1), (3, 2), (4, 2), (6, 3), (99, 3)] {
            assert_eq!(line(start), Some(("a.rgen".to_owned(), wanted)), "{start}");
        }
        let place = Place::Line { file: "b".to_owned(), line: 7, column: 2 };
        assert_eq!(place.file_line(), Some(("b", 7)));
        assert_eq!((Place::Word(1).file_line(), Place::File("c".into()).file_line()), (None, None));
    }

    #[test]
    fn columns_count_characters() {
        let text: Arc<str> = "ab\n\u{e4}x = y\nc".into();
        let columns = |span: Range<usize>| {
            let place = Place::Text { file: "a.rgen".to_owned(), text: text.clone(), span };
            place.columns().map(|SourceColumns { start, end }| (start, end))
        };
        // `y` of the second line: after `äx = `, five characters of six bytes, from byte 3.
        assert_eq!(columns(9..10), Some((6, Some(7))));
        assert_eq!(columns(0..2), Some((1, Some(3))));
        assert_eq!(columns(1..4), Some((2, None)));
        assert_eq!(columns(5..5), Some((2, None)));
        let line = |column| Place::Line { file: "b".to_owned(), line: 7, column };
        assert_eq!(line(2).columns(), Some(SourceColumns { start: 2, end: None }));
        assert_eq!((line(0).columns(), Place::Word(1).columns()), (None, None));
    }
}
