//! Causes: why a value is undefined, a NaN or infinite, from where it was made.

use rustc_hash::FxHashMap;

use crate::rule::Rule;
use anyhit_engine::machine::{OpIndex, ShaderIndex};
use anyhit_engine::module::Id;

/// Where an instruction stands: its shader in the pipeline, and the operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct OpPlace {
    /// The shader.
    pub shader: ShaderIndex,
    /// The operation.
    pub op: OpIndex,
}

/// A value that is no number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Special {
    /// A NaN.
    Nan,
    /// An infinity.
    Infinity,
}

impl Special {
    /// The value in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nan => "a NaN",
            Self::Infinity => "an infinity",
        }
    }
}

/// Why a value is undefined, a NaN or infinite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// A part of a variable that nobody wrote.
    Unwritten {
        /// The shader that declares the variable.
        shader: ShaderIndex,
        /// The variable.
        variable: Id,
        /// Its storage class.
        storage_class: u32,
        /// Which of the variable's words.
        word: u32,
    },
    /// A byte of Workgroup memory that no invocation wrote.
    UnwrittenShared {
        /// The shader.
        shader: ShaderIndex,
        /// The byte's offset in the memory.
        byte: u32,
    },
    /// A part of a buffer or image that neither the scene nor a shader has written.
    UnwrittenPart {
        /// The operation that loads it.
        place: OpPlace,
        /// The number of the buffer or image.
        object: u32,
    },
    /// `OpUndef`, or a component of a shuffle without a source.
    Undef(OpPlace),
    /// `OpUndef` at module scope.
    UndefConstant {
        /// The shader.
        shader: ShaderIndex,
        /// The result.
        id: Id,
    },
    /// An instruction whose result is undefined for its operands.
    Broken {
        /// The instruction.
        place: OpPlace,
        /// The rule that it breaks.
        rule: &'static str,
    },
    /// A builtin that the hit does not have.
    Builtin {
        /// The shader that reads it.
        shader: ShaderIndex,
        /// Its number.
        builtin: u32,
        /// The rule that says so.
        rule: &'static str,
    },
    /// What is undefined for another cause, of which `OpBitFieldInsert` has filled some bits.
    Filled {
        /// The number of the other cause.
        of: u32,
        /// The bits that are defined.
        bits: u32,
    },
    /// An instruction that made a NaN of something else, or an infinity of numbers.
    Born {
        /// The instruction.
        place: OpPlace,
        /// What it made.
        special: Special,
    },
}

/// What the first report of a cause tells beside its place.
#[derive(Clone, Debug)]
pub struct CauseDetails {
    /// The rule that was broken.
    pub rule: &'static Rule,
    /// What the instruction did, such as `pow(-0.5, 2.0)`.
    pub message: String,
    /// The number of the cause of an operand that was a NaN or infinite; 0 where there was none.
    pub operand: u32,
}

/// All causes so far, by number.
#[derive(Debug)]
pub struct Causes {
    causes: Vec<(Cause, Option<CauseDetails>)>,
    numbers: FxHashMap<Cause, u32>,
    /// By the cause of the first of several words: its number, which those of the others follow.
    spans: FxHashMap<Cause, u32>,
}

impl Default for Causes {
    fn default() -> Self {
        // Number 0 is no cause.
        let nothing = Cause::Undef(OpPlace { shader: ShaderIndex(u32::MAX), op: OpIndex(u32::MAX) });
        let (numbers, spans) = Default::default();
        Self { causes: vec![(nothing, None)], numbers, spans }
    }
}

impl Causes {
    /// The number of a cause; `details` are taken from where it is met first.
    pub fn number(&mut self, cause: Cause, details: impl FnOnce() -> Option<CauseDetails>) -> u32 {
        *self.numbers.entry(cause).or_insert_with(|| {
            self.causes.push((cause, details()));
            self.causes.len() as u32 - 1
        })
    }

    /// The number of the cause of the first of several words, which those of the others follow.
    pub fn of_words(&mut self, count: u32, cause: impl Fn(u32) -> Cause) -> u32 {
        let Self { causes, spans, .. } = self;
        *spans.entry(cause(0)).or_insert_with(|| {
            let first = causes.len() as u32;
            causes.extend((0..count).map(|word| (cause(word), None)));
            first
        })
    }

    /// The cause of a number but for bits that were filled since, and these bits.
    pub fn unfilled(&self, number: u32) -> (u32, u32) {
        match self.get(number) {
            Some((Cause::Filled { of, bits }, _)) => (of, bits),
            _ => (number, 0),
        }
    }

    /// The cause of a number, and its details; `None` where none is known.
    pub fn get(&self, number: u32) -> Option<(Cause, Option<&CauseDetails>)> {
        let (cause, details) = self.causes.get(number as usize).filter(|_| number > 0)?;
        Some((*cause, details.as_ref()))
    }
}
