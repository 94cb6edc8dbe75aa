//! Reads names, source files and lines. Debug information that is invalid or absent is no error:
//! it leaves gaps only.
//!
//! SPIR-V specification, section 3.3.2 "Debug Instructions";
//! `NonSemantic.Shader.DebugInfo.100` (and later revisions, which keep its instructions).

use std::collections::HashMap;
use std::sync::Arc;

use rspirv::spirv::NonsemanticShaderDebuginfo100Op as DebugOp;

use crate::module::debug_info::{DebugInfo, SourceFile, SourceLine};
use crate::module::span::Span;
use crate::module::words::lossy_string;
use crate::module::{Id, Module, Opcode};
use anyhit_base::escape;

/// Collects debug information in the order of the module.
pub(super) struct DebugReader<'w> {
    words: &'w [u32],
    info: DebugInfo,
    /// The index of each source file, by the id of the `OpString` that names it.
    files: HashMap<Id, u32>,
    /// The text of each file, by index.
    texts: Vec<Text>,
    /// The file that `OpSourceContinued` and `DebugSourceContinued` append to.
    open_source: Option<u32>,
    /// The index of the file of each `DebugSource`.
    sources: HashMap<Id, u32>,
    /// The name of each `DebugLocalVariable`.
    locals: HashMap<Id, Arc<str>>,
    /// The name of each `DebugFunction`.
    debug_functions: HashMap<Id, Arc<str>>,
    function: Option<Id>,
    /// Bytes of source text that may still be copied together.
    remaining_text: usize,
}

/// A source text, of which more parts may follow.
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
            remaining_text: 16 * words.len() + 65_536,
        }
    }

    pub(super) fn enter_function(&mut self, id: Id) {
        self.function = Some(id);
    }

    pub(super) fn leave_function(&mut self) {
        self.function = None;
    }

    /// Ends the current line, which holds to the end of its block (specification, `OpLine`).
    pub(super) fn leave_block(&mut self, offset: usize) {
        self.set_line(offset, None);
    }

    /// Reads an instruction of the core grammar.
    pub(super) fn core(&mut self, span: Span) {
        let words = &self.words[span.operands()];
        match (span.opcode, words) {
            (Opcode::Name, [target, name @ ..]) => {
                self.info.names.entry(Id(*target)).or_insert_with(|| name_of(name));
            }
            (Opcode::MemberName, [target, member, name @ ..]) => {
                self.info.member_names.entry((Id(*target), *member)).or_insert_with(|| name_of(name));
            }
            (Opcode::String, [id, text @ ..]) => {
                self.info.strings.insert(Id(*id), lossy_string(text).into());
            }
            (Opcode::Source, [_, _, file, text @ ..]) => {
                self.open_source = self.file(Id(*file));
                if let (Some(file), false) = (self.open_source, text.is_empty()) {
                    self.add_text(file, &lossy_string(text));
                }
            }
            (Opcode::Source, _) => self.open_source = None,
            (Opcode::SourceContinued, text) => {
                if let Some(file) = self.open_source {
                    self.add_text(file, &lossy_string(text));
                }
            }
            (Opcode::Line, [file, line, column]) => {
                let line = self.file(Id(*file)).map(|file| SourceLine { file, line: *line, column: *column });
                self.set_line(span.end, line);
            }
            (Opcode::NoLine, _) => self.set_line(span.end, None),
            _ => {}
        }
    }

    /// Reads an instruction of a debug information set: its operands follow set and number.
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
                        Some(SourceLine { file, line, column: constant(column).unwrap_or(0) })
                    }
                    _ => None,
                };
                self.set_line(span.end, line);
            }
            (DebugOp::DebugNoLine, _) => self.set_line(span.end, None),
            (DebugOp::DebugFunction, [name, ..]) => {
                if let Some(name) = self.info.name(Id(*name)) {
                    self.debug_functions.insert(result, name);
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
                if let Some(name) = self.info.name(Id(*name)) {
                    self.locals.insert(result, name);
                }
            }
            (DebugOp::DebugDeclare | DebugOp::DebugValue, [local, value, ..]) => {
                if let Some(name) = self.locals.get(&Id(*local)) {
                    self.info.variable_names.entry(Id(*value)).or_insert_with(|| name.clone());
                }
            }
            (DebugOp::DebugGlobalVariable, [name, _, _, _, _, _, _, variable, ..]) => {
                if let Some(name) = self.info.name(Id(*name)) {
                    self.info.variable_names.entry(Id(*variable)).or_insert(name);
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

    /// The index of the file that an `OpString` names.
    fn file(&mut self, name: Id) -> Option<u32> {
        if let Some(&index) = self.files.get(&name) {
            return Some(index);
        }
        let text = self.info.name(name)?.to_string();
        let index = self.info.files.len() as u32;
        self.info.files.push(SourceFile { name: text, text: None });
        self.texts.push(Text::Absent);
        self.files.insert(name, index);
        Some(index)
    }

    fn add_text(&mut self, file: u32, more: &str) {
        let text = &mut self.texts[file as usize];
        if let Text::Whole(whole) = text {
            let Some(left) = self.remaining_text.checked_sub(whole.len()) else { return };
            self.remaining_text = left;
            *text = Text::Parts(whole.to_string());
        }
        let Some(left) = self.remaining_text.checked_sub(more.len()) else { return };
        self.remaining_text = left;
        match text {
            Text::Parts(parts) => parts.push_str(more),
            _ => *text = Text::Parts(more.to_owned()),
        }
    }

    fn set_line(&mut self, offset: usize, line: Option<SourceLine>) {
        if self.info.lines.last().and_then(|(_, last)| *last) != line {
            self.info.lines.push((offset as u32, line));
        }
    }
}

/// A name, whose hidden characters are escapes from here on.
fn name_of(words: &[u32]) -> String {
    escape::into_line(lossy_string(words))
}

#[cfg(test)]
mod tests {
    use pretty_assertions::assert_eq;

    use super::*;
    use crate::module::assemble::Assembler;

    const SET: u32 = 100;
    const VOID: u32 = 1;

    fn debug(a: &mut Assembler, id: u32, op: DebugOp, operands: &[u32]) {
        a.op(Opcode::ExtInst, &[&[VOID, id, SET, op as u32], operands].concat());
    }

    /// Strings, then module scope with the usual types and a debug source of two parts.
    fn module_scope() -> Assembler {
        let mut a = Assembler::new();
        a.with_string(Opcode::Extension, &[], "SPV_KHR_non_semantic_info", &[]);
        a.with_string(Opcode::ExtInstImport, &[SET], "NonSemantic.Shader.DebugInfo.100", &[]);
        a.with_string(Opcode::String, &[110], "hit.slang", &[]);
        a.with_string(Opcode::String, &[111], "float f;\n", &[]);
        a.with_string(Opcode::String, &[112], "float g;\n", &[]);
        a.with_string(Opcode::String, &[113], "closestHit", &[]);
        a.with_string(Opcode::String, &[114], "colour", &[]);
        a.with_string(Opcode::String, &[115], "scene", &[]);
        a.types();
        a.op(Opcode::Constant, &[5, 120, 7]);
        a.op(Opcode::Constant, &[5, 121, 9]);
        a.op(Opcode::TypePointer, &[122, 7, 6]);
        a.op(Opcode::TypePointer, &[123, 6, 6]);
        debug(&mut a, 130, DebugOp::DebugSource, &[110, 111]);
        debug(&mut a, 131, DebugOp::DebugSourceContinued, &[112]);
        debug(&mut a, 132, DebugOp::DebugFunction, &[113, 8, 130, 8, 8, 8, 113, 8, 8]);
        debug(&mut a, 133, DebugOp::DebugLocalVariable, &[114, 8, 130, 8, 8, 132, 8]);
        a.op(Opcode::Variable, &[123, 140, 6]);
        debug(&mut a, 134, DebugOp::DebugGlobalVariable, &[115, 8, 130, 8, 8, 132, 115, 140, 8]);
        a
    }

    #[test]
    fn names_sources_and_lines_are_read_and_left_out_of_the_blocks() {
        let mut a = module_scope();
        a.function(50, 51, |a| {
            debug(a, 150, DebugOp::DebugFunctionDefinition, &[132, 50]);
            a.op(Opcode::Variable, &[122, 52, 7]);
            debug(a, 151, DebugOp::DebugDeclare, &[133, 52, 8]);
            debug(a, 152, DebugOp::DebugLine, &[130, 120, 120, 121, 121]);
            a.op(Opcode::Load, &[6, 53, 52]);
            debug(a, 153, DebugOp::DebugNoLine, &[]);
            a.op(Opcode::Load, &[6, 54, 52]);
            a.op(Opcode::Return, &[]);
        });
        let module = a.loaded();
        let info = &module.debug_info;
        assert_eq!(info.files.len(), 1);
        assert_eq!(info.files[0].name, "hit.slang");
        assert_eq!(info.files[0].text.as_deref(), Some("float f;\nfloat g;\n"));
        assert_eq!(
            [50, 52, 140, 53].map(|id| module.name(Id(id))),
            [Some("closestHit"), Some("colour"), Some("scene"), None]
        );
        let instructions = &module.functions[0].blocks[0].instructions;
        assert_eq!(instructions.iter().map(|one| one.opcode.0).collect::<Vec<_>>(), [59, 61, 61, 253]);
        assert_eq!(info.line_at(instructions[1].offset), Some(SourceLine { file: 0, line: 7, column: 9 }));
        assert_eq!(info.line_at(instructions[2].offset), None);
    }

    #[test]
    fn broken_debug_information_is_no_error() {
        let mut a = Assembler::new();
        a.with_string(Opcode::ExtInstImport, &[SET], "NonSemantic.Shader.DebugInfo.102", &[]);
        a.with_string(Opcode::ExtInstImport, &[101], "NonSemantic.Whatever", &[]);
        a.op(Opcode::Name, &[]);
        a.op(Opcode::Name, &[999]);
        a.op(Opcode::Name, &[998, 0x6161_6161]);
        a.op(Opcode::MemberName, &[6, 77, 0]);
        a.op(Opcode::String, &[110, 0xffff_ffff]);
        a.op(Opcode::Source, &[]);
        a.op(Opcode::Source, &[2, 460, 555]);
        a.op(Opcode::SourceContinued, &[0x6161_6161]);
        a.types();
        a.op(Opcode::Line, &[555, 1]);
        debug(&mut a, 130, DebugOp::DebugSource, &[]);
        debug(&mut a, 131, DebugOp::DebugSource, &[777]);
        debug(&mut a, 131, DebugOp::DebugFunction, &[6]);
        a.op(Opcode::ExtInstWithForwardRefsKHR, &[VOID, 132, SET, 5000, 900, 901]);
        a.op(Opcode::ExtInst, &[VOID, 6, 101, 1]);
        a.function(50, 51, |a| {
            debug(a, 150, DebugOp::DebugLine, &[131, 6, 6, 6, 6]);
            debug(a, 151, DebugOp::DebugLine, &[130]);
            debug(a, 152, DebugOp::DebugDeclare, &[6, 7]);
            a.op(Opcode::Return, &[]);
        });
        let module = a.loaded();
        assert_eq!(module.name(Id(998)), Some("aaaa"));
        assert!(module.debug_info.lines.is_empty());
        assert!(module.debug_info.variable_names.is_empty());
    }

    #[test]
    fn printf_is_kept_with_its_format() {
        let mut a = Assembler::new();
        a.with_string(Opcode::ExtInstImport, &[SET], "NonSemantic.DebugPrintf", &[]);
        a.with_string(Opcode::String, &[110], "t = %f", &[]);
        a.types();
        a.op(Opcode::Constant, &[6, 120, 0]);
        a.function(50, 51, |a| {
            a.op(Opcode::ExtInst, &[VOID, 150, SET, 1, 110, 120]);
            a.op(Opcode::Return, &[]);
        });
        let module = a.loaded();
        let instructions = &module.functions[0].blocks[0].instructions;
        assert_eq!(module.operands(&instructions[0]), [SET, 1, 110, 120]);
        assert_eq!(&*module.debug_info.strings[&Id(110)], "t = %f");
    }

    #[test]
    fn a_text_that_is_continued_with_itself_over_and_over_stays_small() {
        let mut a = module_scope();
        let long = "x".repeat(200_000);
        a.with_string(Opcode::String, &[160], &long, &[]);
        for id in 0..1000 {
            debug(&mut a, 200 + id % 700, DebugOp::DebugSourceContinued, &[160]);
        }
        let module = a.loaded();
        let length = module.debug_info.files[0].text.as_ref().unwrap().len();
        assert!(length <= 16 * module.words.len() + 65_536, "{length} bytes");
    }
}
