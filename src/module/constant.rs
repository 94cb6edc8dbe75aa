//! Constants and specialization constants of module scope.

use crate::module::Id;
use crate::module::ty::TypeId;

/// A constant with its type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Constant {
    /// Its result id.
    pub id: Id,
    /// Its type.
    pub ty: TypeId,
    /// Its value.
    pub value: ConstantValue,
    /// The `SpecId` decoration.
    pub spec_id: Option<u32>,
    /// Made by one of the `OpSpecConstant*`: a specialization may change it, directly or through
    /// what it is made of.
    pub specializable: bool,
    /// Where it stands, in words.
    pub offset: u32,
}

/// The value of a constant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ConstantValue {
    /// A bool (0 or 1), an integer (its low `width` bits, zero-extended) or a float's bits.
    Scalar(u64),
    /// Ids of the constituents.
    Composite(Vec<Id>),
    /// `OpConstantNull`.
    Null,
    /// `OpUndef` at module scope.
    Undef,
    /// `OpSpecConstantOp`: the opcode's number and its operand words.
    Operation { opcode: u16, operands: Vec<u32> },
    /// A kind that this crate does not evaluate (`OpConstantSampler`, ...): the opcode's number.
    Other(u16),
}
