//! The accesses of an operation to registers.

use crate::machine::Reg;
use crate::machine::object::ObjectRef;

/// An access of an operation to registers, for passes over programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Reads this many registers.
    Read(Reg, u32),
    /// Writes this many registers.
    Write(Reg, u32),
    /// Has a side effect: the operation must not be eliminated.
    Effect,
}

/// How an operation accesses an operand that is a single register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OperandKind {
    /// Reads it.
    Use,
    /// Writes it.
    Def,
}

/// A copy of one register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RegCopy {
    /// The register that is written.
    pub to: Reg,
    /// The register that is read.
    pub from: Reg,
    /// Whether only running lanes are copied.
    pub is_masked: bool,
}

/// An access to registers that an index chooses, lane by lane; see [`Reg::computed`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComputedRegisters {
    /// The register at index 0.
    pub first: Reg,
    /// The register of the index.
    pub index: Reg,
    /// How many registers are read or written.
    pub count: u32,
    /// The first of the registers that take what is read, or hold what is written.
    pub other: Reg,
    /// Whether they are written.
    pub writes: bool,
}

/// Reports the registers that an operation reads to find an object (see
/// [`crate::ops::op::Op::accesses`]).
pub fn object_accesses(object: ObjectRef, visit: &mut dyn FnMut(Access)) {
    match object {
        ObjectRef::Register(reg) => visit(Access::Read(reg, 1)),
        ObjectRef::Computed { index, .. } => visit(Access::Read(index, 1)),
    }
}

/// Reports the registers of an operation that replaces an object: it reads and writes the handle.
pub fn object_write_accesses(object: ObjectRef, visit: &mut dyn FnMut(Access)) {
    object_accesses(object, visit);
    if let ObjectRef::Register(reg) = object {
        visit(Access::Write(reg, 1));
    }
    visit(Access::Effect);
}
