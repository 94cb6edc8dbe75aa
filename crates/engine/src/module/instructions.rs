//! The instructions of functions, one after the other.

use std::slice;

use crate::module::{BasicBlock, Function, Instruction, Module};

/// The instructions of functions or blocks in the module's order.
#[derive(Clone, Debug)]
pub struct Instructions<'m> {
    functions: slice::Iter<'m, Function>,
    blocks: slice::Iter<'m, BasicBlock>,
    instructions: slice::Iter<'m, Instruction>,
}

impl<'m> Instructions<'m> {
    /// Those of blocks of a function.
    pub fn of(blocks: &'m [BasicBlock]) -> Self {
        Self { functions: [].iter(), blocks: blocks.iter(), instructions: [].iter() }
    }
}

impl<'m> Iterator for Instructions<'m> {
    type Item = &'m Instruction;

    fn next(&mut self) -> Option<&'m Instruction> {
        loop {
            if let Some(instruction) = self.instructions.next() {
                return Some(instruction);
            }
            match self.blocks.next() {
                Some(block) => self.instructions = block.instructions.iter(),
                None => self.blocks = self.functions.next()?.blocks.iter(),
            }
        }
    }
}

impl Function {
    /// The instructions of its blocks.
    pub fn instructions(&self) -> Instructions<'_> {
        Instructions::of(&self.blocks)
    }
}

impl Module {
    /// The instructions of all functions.
    #[doc(hidden)]
    pub fn instructions(&self) -> Instructions<'_> {
        Instructions { functions: self.functions.iter(), ..Instructions::of(&[]) }
    }
}
