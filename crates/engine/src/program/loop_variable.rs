//! The variables that the report of a loop can name.

use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Module};

/// A variable in registers, or a phi, of which the report of a loop can tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoopVariable {
    /// Its `OpVariable` or `OpPhi`.
    pub id: Id,
    /// The type of its value: a scalar or a vector.
    pub ty: TypeId,
    /// The inlined call that it belongs to; see
    /// [`Program::scopes`](crate::program::Program::scopes).
    pub scope: u32,
    /// Its first register among [`Program::watched`](crate::program::Program::watched).
    pub first: usize,
    /// How many registers it has.
    pub count: usize,
}

impl LoopVariable {
    /// Whether a report tells of values of a type: scalars and vectors.
    pub fn is_told(module: &Module, ty: TypeId) -> bool {
        match *module.ty(ty) {
            Type::Bool | Type::Int { .. } => true,
            Type::Float { encoding, .. } => encoding.is_none(),
            Type::Vector { component, count } => count <= 4 && Self::is_told(module, component),
            _ => false,
        }
    }
}
