//! What lowering one entry point may take, however few words ask for it.

use crate::ops::translate::{IdValue, Translator};
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::input::InputLimit;

/// Work of an instruction that is not counted, in steps; see [`Translator::charge`].
const FREE_STEPS: usize = 64;

/// How many words are copied, or members counted, in the time of one step.
pub(in crate::ops) const WORDS_OF_A_STEP: usize = 16;

/// How many registers a value names.
#[inline]
pub(super) fn named(value: &IdValue) -> u64 {
    if let IdValue::Words(words) = value { words.len() as u64 } else { 1 }
}

impl Translator<'_> {
    /// The error that the current instruction needs more than a limit of the module allows.
    #[cold]
    pub fn beyond(&self, limit: InputLimit, found: Option<u64>) -> Error {
        let error = self.module.limits.exceeded(limit, found, ErrorKind::UnsupportedModule);
        error.at(Place::Word(self.origin.offset as usize))
    }

    /// Holds the operations so far, and the registers that values name, against their limit: to be
    /// asked after each instruction, which by itself makes no more than there are registers.
    ///
    /// # Errors
    /// `UnsupportedModule` where there are too many ([`InputLimit::Operations`]).
    pub fn check_operations(&self) -> Result<()> {
        let found = self.ops.len() as u64 + self.named_registers;
        match found <= self.module.limits.get(InputLimit::Operations) {
            true => Ok(()),
            false => Err(self.beyond(InputLimit::Operations, Some(found))),
        }
    }

    /// Counts steps of work that an instruction asks for beside its operations, towards
    /// [`InputLimit::Operations`]; few are free.
    pub(in crate::ops) fn charge(&mut self, steps: usize) {
        if steps > FREE_STEPS {
            self.named_registers += steps as u64;
        }
    }
}
