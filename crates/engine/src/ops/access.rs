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

/// The kind of access to a single-register operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OperandKind {
    /// Reads the register.
    Use,
    /// Writes the register.
    Def,
}

/// A copy of one register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RegCopy {
    /// Destination register.
    pub to: Reg,
    /// Source register.
    pub from: Reg,
    /// True if only the running lanes are copied.
    pub is_masked: bool,
}

/// An access to registers selected by an index per lane; see [`Reg::computed`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ComputedRegisters {
    /// The register at index 0.
    pub first: Reg,
    /// The register of the index.
    pub index: Reg,
    /// Number of registers read or written.
    pub count: u32,
    /// First destination register of a read, first source register of a write.
    pub other: Reg,
    /// True for a write.
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
