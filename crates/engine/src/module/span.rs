//! Where an instruction stands in a module's words, and errors there.

use std::ops::Range;

use crate::module::{Instruction, Opcode};
use anyhit_base::error::{Error, ErrorKind, Place};

/// The error for a violated rule at a word of the module.
#[cold]
pub(crate) fn invalid(offset: usize, message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidModule, message).at(Place::Word(offset))
}

/// One instruction: its opcode and the range of its words, the first (count and opcode) included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    pub(crate) opcode: Opcode,
    pub(crate) start: usize,
    pub(crate) end: usize,
}

impl Span {
    /// The range of its operands, result type and result id included.
    pub(crate) fn operands(self) -> Range<usize> {
        self.start + 1..self.end
    }
}

/// Whether one of the word's four bytes is zero.
pub(crate) fn ends_string(word: u32) -> bool {
    word.to_le_bytes().contains(&0)
}

/// The words of an instruction, the first one included.
pub(super) fn span_of(instruction: &Instruction) -> Span {
    Span {
        opcode: instruction.opcode,
        start: instruction.offset as usize,
        end: instruction.operands.end as usize,
    }
}
