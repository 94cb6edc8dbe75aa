//! The source locations of findings.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::module_files::module_files;
use anyhit_engine::program::Program;
use anyhit_explain::names::source_line_at;
use anyhit_scene::{Assembled, ResolvedScene};

/// A line of a shader's source, or an instruction if the module has no debug information.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SourceLocation {
    /// The source file's name as the compiler wrote it; without debug information the module's.
    pub file: String,
    /// The line's number, from 1; 0 without debug information.
    pub line: u32,
    /// The line's text, if the module holds its source; the instruction, if there is no line.
    pub text: Option<String>,
}

impl SourceLocation {
    /// `file:line`, or the file and the instruction.
    pub fn label(&self) -> String {
        let file = self.file.rsplit(['/', '\\']).next().unwrap_or(&self.file);
        match (self.line, &self.text) {
            (0, Some(instruction)) => format!("{file} {instruction}"),
            (0, None) => file.to_owned(),
            (line, _) => format!("{file}:{line}"),
        }
    }
}

/// The programs of a scene, in the order of [`Assembled::programs`].
#[derive(Clone, Debug)]
pub(super) struct Programs {
    pub all: Vec<Arc<Program>>,
    files: Vec<String>,
    /// The index of the first program of each pipeline: `[pipeline]`, then the named ones.
    first: Vec<usize>,
}

impl Programs {
    pub(super) fn of(scene: &ResolvedScene, assembled: &Assembled) -> Self {
        let (all, files) = (assembled.programs().cloned().collect(), module_files(scene, assembled));
        let first = assembled.all_pipelines().map(|(index, _)| assembled.first_program(index)).collect();
        Self { all, files, first }
    }

    /// The index of the first program of a pipeline: a named one by its index, or `[pipeline]`.
    pub(super) fn first(&self, pipeline: Option<usize>) -> usize {
        self.first[pipeline.map_or(0, |index| index + 1)]
    }

    /// The location of the instruction at a word offset of a shader's module.
    pub(super) fn location(&self, shader: usize, offset: u32) -> SourceLocation {
        let program = &self.all[shader];
        if let Some(line) = source_line_at(program, offset) {
            return SourceLocation { file: line.file, line: line.line, text: line.text };
        }
        let mut functions = program.module.functions.iter();
        let function = functions.rfind(|function| function.offset <= offset);
        let within = function.map_or_else(String::new, |function| {
            format!(" in function {}", program.module.quoted_name(function.id))
        });
        let text = Some(format!("word {offset}{within}"));
        SourceLocation { file: self.files[shader].clone(), line: 0, text }
    }
}
