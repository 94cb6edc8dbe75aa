//! Places of problems in inputs.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

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

impl Place {
    /// Returns the file name and the line, from 1, of a place in a text; `None` for a word of
    /// a module and for a file as a whole.
    #[must_use]
    pub fn file_line(&self) -> Option<(&str, u32)> {
        match self {
            Self::Text { file, text, span } => Some((file, line_at(text, span.start))),
            Self::Line { file, line, .. } => Some((file, *line)),
            Self::Word(_) | Self::File(_) => None,
        }
    }

    /// Returns the column of a place in a text, in characters from 1; `None` where it is not known.
    #[must_use]
    pub fn column(&self) -> Option<u32> {
        match self {
            Self::Text { text, span, .. } => Some(column_at(text, span.start)),
            Self::Line { column, .. } => (*column > 0).then_some(*column),
            Self::Word(_) | Self::File(_) => None,
        }
    }
}

/// Returns the line of a byte offset in a text, from 1.
pub(super) fn line_at(text: &str, offset: usize) -> u32 {
    let before = &text[..clamp_span(&(offset..offset), text).start];
    u32::try_from(before.matches('\n').count()).map_or(u32::MAX, |lines| lines.saturating_add(1))
}

/// Returns the column of a byte offset in a text, in characters from 1.
fn column_at(text: &str, offset: usize) -> u32 {
    let before = &text[..clamp_span(&(offset..offset), text).start];
    let line = before.rsplit('\n').next().unwrap_or(before);
    u32::try_from(line.chars().count()).map_or(u32::MAX, |count| count.saturating_add(1))
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
        let text: Arc<str> = "ab\n\u{e4}x\nc".into();
        let column =
            |start| Place::Text { file: String::new(), text: text.clone(), span: start..start }.column();
        // The letter of two bytes is one column wide; offset 4 is within it.
        for (start, wanted) in [(0, 1), (1, 2), (2, 3), (3, 1), (4, 1), (5, 2), (7, 1), (99, 2)] {
            assert_eq!(column(start), Some(wanted), "{start}");
        }
        assert_eq!(Place::Line { file: String::new(), line: 3, column: 0 }.column(), None);
    }
}
