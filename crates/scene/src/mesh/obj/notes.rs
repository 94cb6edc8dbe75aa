//! Notes on statements that are not read.

use std::borrow::Cow;
use std::path::Path;

use anyhit_base::escape;

/// The content of one file that is not read, and its lines: equal notes are counted.
#[derive(Debug, Default)]
pub(super) struct Notes(Vec<Kind>);

#[derive(Debug)]
struct Kind {
    text: Cow<'static, str>,
    line: usize,
    count: usize,
}

impl Notes {
    /// Distinct notes of one file; all others become one.
    const MOST: usize = 32;

    /// Adds a note on a line.
    pub(super) fn add(&mut self, line: usize, text: impl Into<Cow<'static, str>>) {
        self.add_kind(Kind { text: text.into(), line, count: 1 });
    }

    fn add_kind(&mut self, mut new: Kind) {
        let place_of = |kinds: &[Kind], new: &Kind| kinds.iter().position(|kind| kind.text == new.text);
        let mut known = place_of(&self.0, &new);
        if known.is_none() && self.0.len() + 1 >= Self::MOST {
            new.text = "further statements".into();
            known = place_of(&self.0, &new);
        }
        match known {
            Some(at) => {
                self.0[at].count += new.count;
                self.0[at].line = self.0[at].line.min(new.line);
            }
            None => self.0.push(new),
        }
    }

    /// Adds the notes on another part of the file.
    pub(super) fn append(&mut self, other: Self) {
        other.0.into_iter().for_each(|kind| self.add_kind(kind));
    }

    /// The notes in the order of their lines, which are those of the model's file or of another.
    pub(super) fn list(mut self, other: Option<&Path>) -> Vec<String> {
        self.0.sort_by_key(|kind| kind.line);
        let note = |Kind { text, line, count }| {
            let place = match other {
                None => format!("line {line}"),
                Some(file) => format!("{}:{line}", escape::path(file)),
            };
            let times = if count == 1 { String::new() } else { format!(" ({count} times)") };
            format!("{place}: {text}{times}")
        };
        self.0.into_iter().map(note).collect()
    }
}
