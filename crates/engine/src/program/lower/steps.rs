//! Steps for debuggers, in programs that are not optimised: a line whose instructions become no
//! operation has a place to stop at, and so have calls that are inlined and barriers with nothing
//! to do.

use crate::module::{Instruction, Opcode};
use crate::ops::op::Op;
use crate::ops::translate::Origin;
use crate::program::lower::Lowering;

impl Lowering<'_> {
    /// An instruction is lowered next: where it begins another line, and no instruction of the line
    /// before has become an operation, that line gets a step.
    pub(super) fn open_step(&mut self, instruction: &Instruction) {
        let Some(first) = self.without_step else { return };
        let line = |offset: u32| self.module.debug_info.line_at(offset).map(|line| (line.file, line.line));
        if line(first.offset) != line(instruction.offset) {
            self.add_step(first);
        }
    }

    /// An instruction has been lowered, from which on there were `before` operations.
    pub(super) fn close_step(&mut self, instruction: &Instruction, before: usize) {
        if self.translator.optimizes {
            return;
        }
        match instruction.opcode {
            Opcode::Variable | Opcode::Phi | Opcode::LoopMerge | Opcode::SelectionMerge => {}
            // A call has its step, and the end of a block is one.
            Opcode::FunctionCall | Opcode::IgnoreIntersectionNV | Opcode::TerminateRayNV => {
                self.without_step = None;
            }
            opcode if opcode.ends_block() => self.without_step = None,
            _ if self.translator.ops.len() > before => self.without_step = None,
            _ if instruction.result.is_none() => self.add_step(self.translator.origin),
            _ if self.without_step.is_none() => {
                let has_line = self.module.debug_info.line_at(instruction.offset).is_some();
                self.without_step = has_line.then_some(self.translator.origin);
            }
            _ => {}
        }
    }

    /// Adds a step at a call that is inlined.
    pub(super) fn add_call_step(&mut self) {
        if !self.translator.optimizes {
            self.add_step(self.translator.origin);
        }
    }

    /// Adds a step at an instruction.
    fn add_step(&mut self, at: Origin) {
        self.without_step = None;
        let here = std::mem::replace(&mut self.translator.origin, at);
        self.translator.emit(Op::Step);
        self.translator.origin = here;
    }
}
