//! Names, source files and lines.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use crate::module::Id;
use anyhit_base::escape;

/// A source file that debug information names, with its text where the module holds it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFile {
    /// The name as the compiler wrote it, hidden characters as escapes.
    pub name: String,
    /// The text, where embedded.
    pub text: Option<Arc<str>>,
}

/// A line and a column in a source file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SourceLine {
    /// Index into [`DebugInfo::files`].
    pub file: u32,
    /// The line, from 1.
    pub line: u32,
    /// The column, from 1; 0 if unknown.
    pub column: u32,
}

/// Everything that helps a reader of messages and does not change results.
#[derive(Clone, Debug, Default)]
pub struct DebugInfo {
    /// `OpName`.
    pub names: HashMap<Id, String>,
    /// `OpMemberName`.
    pub member_names: HashMap<(Id, u32), String>,
    /// Names of functions in the source, by the id of their `OpFunction`: from `DebugFunction`.
    pub function_names: HashMap<Id, Arc<str>>,
    /// Names of variables in the source, by the id of the variable or value that holds them: from
    /// `DebugDeclare`, `DebugValue` and `DebugGlobalVariable`.
    pub variable_names: HashMap<Id, Arc<str>>,
    /// `OpString`: file names, source texts, formats of `NonSemantic.DebugPrintf`.
    pub strings: HashMap<Id, Arc<str>>,
    /// Source files, from `OpString`/`OpSource` and `DebugSource`.
    pub files: Vec<SourceFile>,
    /// The source line of the instructions from a word offset on, ascending by offset; `None` where
    /// they have none.
    pub lines: Vec<(u32, Option<SourceLine>)>,
}

impl DebugInfo {
    /// An `OpString` as a name: hidden characters are escapes.
    pub fn name(&self, id: Id) -> Option<Arc<str>> {
        let text = self.strings.get(&id)?;
        Some(match escape::line(text) {
            Cow::Borrowed(_) => text.clone(),
            Cow::Owned(escaped) => escaped.into(),
        })
    }

    /// The source line of the instruction at a word offset.
    pub fn line_at(&self, offset: u32) -> Option<SourceLine> {
        let after = self.lines.partition_point(|&(start, _)| start <= offset);
        self.lines[..after].last()?.1
    }

    /// The last source line at or before a word offset, but not before `from`, even if an
    /// `OpNoLine` has ended it.
    pub fn line_before(&self, offset: u32, from: u32) -> Option<SourceLine> {
        let after = self.lines.partition_point(|&(start, _)| start <= offset);
        let lines = self.lines[..after].iter().rev().take_while(|&&(start, _)| start >= from);
        lines.into_iter().find_map(|&(_, line)| line)
    }
}
