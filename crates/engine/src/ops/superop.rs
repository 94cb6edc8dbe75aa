//! Superinstructions: frequent operations on 32-bit values, encoded to run without leaving one
//! loop.
//!
//! Most operations of a shader are some ninety regular instructions on 32-bit values, and moves. A
//! [`SuperOp`] names one of them by an opcode, which is one arm of the loop in `interp::superop`.
//! The result of each superinstruction stays in an *accumulator*, which the loop keeps in vector
//! registers from one superinstruction to the next: an operand that the one before it computed is
//! not loaded, and a result without other uses is never stored. Frequent pairs and chains of
//! operations have an opcode of their own, because dispatch takes time, too. Each of their
//! operations is rounded separately; none is fused.
//!
//! Lane kernels write every NaN as the canonical one ([`crate::machine::Scalar::to_words`]). Here
//! that is a superinstruction of its own, `CanonicalizeNan`. It is emitted only after results whose
//! NaN payload may be observed: an operation on floats treats all NaNs alike.
//!
//! Operands that are constants are often uniform: read as one word for all lanes. Such opcodes keep
//! the word in a vector register, where the register would be loaded vector by vector. A batch has
//! its constants in all lanes from the beginning, and no operation writes their registers, so it
//! does not matter which lanes are active.
//!
//! What superinstructions there are, `table` lists; `plan` selects them for operations, and
//! `verify` proves that they do the same. A lane kernel without an opcode is called as a function,
//! and so is one that reads or writes an extended register ([`DIRECT_REGISTERS`]); an irregular
//! operation leaves the loop. Only functions that need few vector registers have an opcode: one arm
//! that needs all sixteen makes the compiler spill the accumulator in every arm.

pub(crate) mod function;
mod plan;
pub(crate) mod table;
mod verify;

use std::ops::Range;

use crate::math::array;

pub use plan::{ResultUse, takes_float};

/// One superinstruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SuperOp {
    /// The function, which operand the accumulator is, and whether the result goes to its register,
    /// too.
    pub(crate) opcode: u16,
    /// The direct register of the result.
    pub(crate) to: u8,
    /// The direct registers of the operands; those behind the last one are read by nobody.
    pub(crate) from: Operands<u8>,
}

/// The operands of a superinstruction: one operation has up to three, chains have more. With an
/// array of eight, the compiler loads the register numbers as one vector and splits it, which takes
/// longer.
pub(crate) type Operands<T> = [T; 6];

/// The operations of a program as superinstructions.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SuperCode {
    pub(crate) superops: Vec<SuperOp>,
    /// The operation that each superinstruction comes from.
    pub(crate) op_of: Vec<u32>,
    /// The first superinstruction of each operation, and one more entry.
    first: Vec<u32>,
}

/// How many registers are direct: superinstructions name them by one byte, which needs no bounds
/// check. An operation on any of the others, the extended ones, becomes no superinstruction.
pub const DIRECT_REGISTERS: usize = 256;

impl SuperCode {
    /// Which superinstructions come from a range of operations.
    #[inline]
    pub(crate) fn range(&self, ops: &Range<u32>) -> Range<usize> {
        let [start, end] = array::map([ops.start, ops.end], |op| self.first[op as usize] as usize);
        start..end
    }
}

#[cfg(test)]
pub(crate) mod tests;
