//! A small assembler for tests: it appends instructions and returns the offset of each.

use crate::module::{Module, Opcode, load};
use anyhit_base::error::{Error, Result};

/// A module under assembly.
#[derive(Clone, Debug)]
pub struct Assembler {
    /// The words so far.
    pub words: Vec<u32>,
}

impl Default for Assembler {
    fn default() -> Self {
        Self::new()
    }
}

impl Assembler {
    /// A module of version 1.6 and this bound, with the header only.
    pub fn bare(bound: u32) -> Self {
        Self { words: vec![0x0723_0203, 0x0001_0600, 0, bound, 0] }
    }

    /// The header, `OpCapability Shader` (words 5 and 6) and `OpMemoryModel Logical GLSL450`
    /// (words 7 to 9).
    pub fn new() -> Self {
        let mut assembler = Self::bare(1000);
        assembler.op(Opcode::Capability, &[1]);
        assembler.op(Opcode::MemoryModel, &[0, 1]);
        assembler
    }

    /// Appends an instruction and returns its offset.
    pub fn op(&mut self, op: Opcode, operands: &[u32]) -> usize {
        let offset = self.words.len();
        self.words.push((operands.len() as u32 + 1) << 16 | u32::from(op.0));
        self.words.extend(operands);
        offset
    }

    /// Appends an instruction with a string among its operands.
    pub fn with_string(&mut self, op: Opcode, before: &[u32], text: &str, after: &[u32]) -> usize {
        let operands = [before, &string_words(text), after].concat();
        self.op(op, &operands)
    }

    /// `%1 = void`, `%2 = void()`, `%3 = bool`, `%4 = int`, `%5 = uint`, `%6 = float`,
    /// `%7 = vec3`, `%8 = uint 3`.
    pub fn types(&mut self) -> &mut Self {
        self.op(Opcode::TypeVoid, &[1]);
        self.op(Opcode::TypeFunction, &[2, 1]);
        self.op(Opcode::TypeBool, &[3]);
        self.op(Opcode::TypeInt, &[4, 32, 1]);
        self.op(Opcode::TypeInt, &[5, 32, 0]);
        self.op(Opcode::TypeFloat, &[6, 32]);
        self.op(Opcode::TypeVector, &[7, 6, 3]);
        self.op(Opcode::Constant, &[5, 8, 3]);
        self
    }

    /// A `void` function without parameters: its id, the id of its label, and its body.
    pub fn function(&mut self, id: u32, label: u32, body: impl FnOnce(&mut Self)) -> usize {
        let offset = self.op(Opcode::Function, &[1, id, 0, 2]);
        self.op(Opcode::Label, &[label]);
        body(self);
        self.op(Opcode::FunctionEnd, &[]);
        offset
    }

    /// The module as the bytes of a file.
    pub fn bytes(&self) -> Vec<u8> {
        self.words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    /// Loads the module.
    ///
    /// # Errors
    /// As [`load()`].
    pub fn load(&self) -> Result<Module> {
        load(&self.bytes())
    }

    /// Loads the module, which must be valid.
    pub fn loaded(&self) -> Module {
        self.load().unwrap()
    }

    /// The error of loading, which must fail.
    pub fn refused(&self) -> Error {
        match self.load() {
            Ok(_) => panic!("the module loads, though it should not"),
            Err(error) => error,
        }
    }
}

/// A literal string as words.
pub fn string_words(text: &str) -> Vec<u32> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.push(0);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes.chunks(4).map(|chunk| u32::from_le_bytes(chunk.try_into().unwrap())).collect()
}
