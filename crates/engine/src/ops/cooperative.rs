//! Cooperative vectors (`SPV_NV_cooperative_vector`) and matrices (`SPV_KHR_cooperative_matrix`).
//!
//! A cooperative vector belongs to one invocation: it is a vector of any number of components, and
//! most of its instructions are those of other vectors. [`vector`] has the product with a matrix in
//! memory. The sums of the training instructions are atomic instructions, one for each element.
//!
//! The components of a cooperative matrix are spread over the invocations of a subgroup, which have
//! a vector of them each: [`matrix`] defines who has which.

pub mod component;
pub mod matrix;
pub mod product;
pub mod translate;
pub mod vector;

use crate::machine::{Batch, Bindings};
use crate::module::Opcode;
use crate::ops::access::Access;
use crate::ops::memory::Chunk;
use crate::ops::shared_access::SharedUse;

pub use matrix::MatrixOp;
pub use translate::translate;
pub use vector::VectorProduct;

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::CooperativeVectorLoadNV,
    Opcode::CooperativeVectorStoreNV,
    Opcode::CooperativeVectorMatrixMulNV,
    Opcode::CooperativeVectorMatrixMulAddNV,
    Opcode::CooperativeVectorOuterProductAccumulateNV,
    Opcode::CooperativeVectorReduceSumAccumulateNV,
];

/// Opcodes of cooperative matrices translated here.
pub const MATRIX_OPCODES: &[Opcode] = &[
    Opcode::CooperativeMatrixLoadKHR,
    Opcode::CooperativeMatrixStoreKHR,
    Opcode::CooperativeMatrixMulAddKHR,
    Opcode::CooperativeMatrixLengthKHR,
    Opcode::CooperativeMatrixConvertNV,
    Opcode::CooperativeMatrixTransposeNV,
];

/// A cooperative operation.
#[derive(Clone, Debug, PartialEq)]
pub enum CooperativeOp {
    /// A matrix times a cooperative vector.
    VectorProduct(VectorProduct),
    /// An operation on cooperative matrices.
    Matrix(MatrixOp),
}

impl CooperativeOp {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        match self {
            Self::VectorProduct(product) => product.accesses(visit),
            Self::Matrix(op) => op.accesses(visit),
        }
    }

    /// The part of a buffer that is read, or written by a store.
    pub(super) fn chunk(&self) -> Option<&Chunk> {
        match self {
            Self::VectorProduct(product) => Some(&product.matrix),
            Self::Matrix(MatrixOp::Access(access)) => Some(&access.memory),
            Self::Matrix(MatrixOp::Product(_) | MatrixOp::Transpose(_)) => None,
        }
    }

    /// What is done with [`CooperativeOp::chunk`].
    pub(super) fn shared_use(&self) -> SharedUse {
        match self {
            Self::Matrix(MatrixOp::Access(access)) if access.stores => SharedUse::Store,
            _ => SharedUse::Load,
        }
    }

    /// Whether the operation needs the other invocations of its subgroup.
    pub(super) fn needs_subgroup(&self) -> bool {
        matches!(self, Self::Matrix(_))
    }

    /// Runs the operation for the running lanes.
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>, bindings: &Bindings) {
        match self {
            Self::VectorProduct(product) => product.eval(batch, bindings),
            Self::Matrix(op) => op.eval(batch, bindings),
        }
    }
}
