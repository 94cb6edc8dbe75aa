//! Reads names, source files and lines. Nothing here is an error: debug information that is
//! broken or absent leaves gaps, never more.
//!
//! SPIR-V specification, section 3.3.2 "Debug Instructions";
//! `NonSemantic.Shader.DebugInfo.100` (and later revisions, which keep its instructions).

use std::collections::HashMap;
use std::sync::Arc;

use rspirv::spirv::{NonsemanticShaderDebuginfo100Op as DebugOp, Op};

use crate::module::debug_info::{DebugInfo, Line, SourceFile};
use crate::module::words::{Span, lossy_string};
use crate::module::{Id, Module};

/// Collects debug information in the order of the module.
pub(super) struct DebugReader<'w> {
    words: &'w [u32],
    info: DebugInfo,
    /// Index of each source file, by the id of the `OpString` that names it.
    files: HashMap<Id, u32>,
    /// The text of each file, by index.
    texts: Vec<Text>,
    /// The file that continued source text belongs to.
    open_source: Option<u32>,
    /// File of each `DebugSource`.
    sources: HashMap<Id, u32>,
    /// Name of each `DebugLocalVariable`.
    locals: HashMap<Id, Arc<str>>,
    /// Name of each `DebugFunction`.
    debug_functions: HashMap<Id, Arc<str>>,
    function: Option<Id>,
    /// Bytes of source text that may still be copied together.
    text_budget: usize,
}

/// A source text while its parts come in.
enum Text {
    Absent,
    /// The text of one `OpString`, shared.
    Whole(Arc<str>),
    Parts(String),
}

impl<'w> DebugReader<'w> {
    pub(super) fn new(words: &'w [u32]) -> Self {
        Self {
            words,
            info: DebugInfo::default(),
            files: HashMap::new(),
            texts: Vec::new(),
            open_source: None,
            sources: HashMap::new(),
            locals: HashMap::new(),
            debug_functions: HashMap::new(),
            function: None,
            // Many instructions may continue with the same long string.
            text_budget: 16 * words.len() + 65_536,
        }
    }

    pub(super) fn enter_function(&mut self, id: Id) {
        self.function = Some(id);
    }

    pub(super) fn leave_function(&mut self) {
        self.function = None;
    }

    /// A line holds to the end of its block (specification, `OpLine`).
    pub(super) fn leave_block(&mut self, offset: usize) {
        self.set_line(offset, None);
    }

    /// An instruction of the core set.
    pub(super) fn core(&mut self, span: Span, op: Op) {
        let words = &self.words[span.operands()];
        match (op, words) {
            (Op::Name, [target, name @ ..]) => {
                self.info.names.entry(Id(*target)).or_insert_with(|| lossy_string(name));
            }
            (Op::MemberName, [target, member, name @ ..]) => {
                self.info.member_names.entry((Id(*target), *member)).or_insert_with(|| lossy_string(name));
            }
            (Op::String, [id, text @ ..]) => {
                self.info.strings.insert(Id(*id), lossy_string(text).into());
            }
            (Op::Source, [_, _, file, text @ ..]) => {
                self.open_source = self.file(Id(*file));
                if let (Some(file), false) = (self.open_source, text.is_empty()) {
                    self.add_text(file, &lossy_string(text));
                }
            }
            (Op::Source, _) => self.open_source = None,
            (Op::SourceContinued, text) => {
                if let Some(file) = self.open_source {
                    self.add_text(file, &lossy_string(text));
                }
            }
            (Op::Line, [file, line, column]) => {
                let line = self.file(Id(*file)).map(|file| Line { file, line: *line, column: *column });
                self.set_line(span.end, line);
            }
            (Op::NoLine, _) => self.set_line(span.end, None),
            _ => {}
        }
    }

    /// An instruction of a debug information set: its ids stand behind set and number.
    pub(super) fn extended(&mut self, span: Span, module: &Module) {
        let [_, result, _, number, operands @ ..] = &self.words[span.operands()] else { return };
        let result = Id(*result);
        let Some(op) = DebugOp::from_u32(*number) else { return };
        let constant = |id: &u32| module.constant_scalar(Id(*id)).and_then(|bits| u32::try_from(bits).ok());
        match (op, operands) {
            (DebugOp::DebugSource, [file, text @ ..]) => {
                let Some(index) = self.file(Id(*file)) else { return };
                self.sources.insert(result, index);
                self.open_source = Some(index);
                if let Some(text) = text.first().and_then(|id| self.info.strings.get(&Id(*id)))
                    && matches!(self.texts[index as usize], Text::Absent)
                {
                    self.texts[index as usize] = Text::Whole(text.clone());
                }
            }
            (DebugOp::DebugSourceContinued, [text]) => {
                let text = self.info.strings.get(&Id(*text)).cloned();
                if let (Some(file), Some(text)) = (self.open_source, text) {
                    self.add_text(file, &text);
                }
            }
            (DebugOp::DebugLine, [source, line, _line_end, column, ..]) => {
                let line = match (self.sources.get(&Id(*source)), constant(line)) {
                    (Some(&file), Some(line)) => {
                        Some(Line { file, line, column: constant(column).unwrap_or(0) })
                    }
                    _ => None,
                };
                self.set_line(span.end, line);
            }
            (DebugOp::DebugNoLine, _) => self.set_line(span.end, None),
            (DebugOp::DebugFunction, [name, ..]) => {
                if let Some(name) = self.info.strings.get(&Id(*name)) {
                    self.debug_functions.insert(result, name.clone());
                }
            }
            (DebugOp::DebugFunctionDefinition, [function, definition]) => {
                if let Some(name) = self.debug_functions.get(&Id(*function)) {
                    self.info.function_names.insert(Id(*definition), name.clone());
                }
            }
            // OpenCL.DebugInfo.100 opens a function with a scope and no definition.
            (DebugOp::DebugScope, [scope, ..]) => {
                if let (Some(function), Some(name)) = (self.function, self.debug_functions.get(&Id(*scope))) {
                    self.info.function_names.entry(function).or_insert_with(|| name.clone());
                }
            }
            (DebugOp::DebugLocalVariable, [name, ..]) => {
                if let Some(name) = self.info.strings.get(&Id(*name)) {
                    self.locals.insert(result, name.clone());
                }
            }
            (DebugOp::DebugDeclare | DebugOp::DebugValue, [local, value, ..]) => {
                if let Some(name) = self.locals.get(&Id(*local)) {
                    self.info.variable_names.entry(Id(*value)).or_insert_with(|| name.clone());
                }
            }
            (DebugOp::DebugGlobalVariable, [name, _, _, _, _, _, _, variable, ..]) => {
                if let Some(name) = self.info.strings.get(&Id(*name)) {
                    self.info.variable_names.entry(Id(*variable)).or_insert_with(|| name.clone());
                }
            }
            _ => {}
        }
    }

    pub(super) fn finish(mut self) -> DebugInfo {
        for (file, text) in self.info.files.iter_mut().zip(self.texts) {
            file.text = match text {
                Text::Absent => None,
                Text::Whole(text) => Some(text),
                Text::Parts(text) => Some(text.into()),
            };
        }
        self.info
    }

    /// The file that an `OpString` names.
    fn file(&mut self, name: Id) -> Option<u32> {
        if let Some(&index) = self.files.get(&name) {
            return Some(index);
        }
        let text = self.info.strings.get(&name)?.to_string();
        let index = self.info.files.len() as u32;
        self.info.files.push(SourceFile { name: text, text: None });
        self.texts.push(Text::Absent);
        self.files.insert(name, index);
        Some(index)
    }

    fn add_text(&mut self, file: u32, more: &str) {
        let text = &mut self.texts[file as usize];
        if let Text::Whole(whole) = text {
            let Some(left) = self.text_budget.checked_sub(whole.len()) else { return };
            self.text_budget = left;
            *text = Text::Parts(whole.to_string());
        }
        let Some(left) = self.text_budget.checked_sub(more.len()) else { return };
        self.text_budget = left;
        match text {
            Text::Parts(parts) => parts.push_str(more),
            _ => *text = Text::Parts(more.to_owned()),
        }
    }

    fn set_line(&mut self, offset: usize, line: Option<Line>) {
        if self.info.lines.last().and_then(|(_, last)| *last) != line {
            self.info.lines.push((offset as u32, line));
        }
    }
}
