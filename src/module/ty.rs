//! The arena of types.

use crate::module::Id;

/// A handle of a type: an index into [`Module::types`](crate::module::Module::types).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TypeId(pub u32);

/// A type. Decorations that shape memory (offsets, strides, matrix layout) are folded in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Type {
    Void,
    Bool,
    /// Width in bits: 8, 16, 32 or 64.
    Int {
        width: u32,
        signed: bool,
    },
    /// Width in bits: 16, 32 or 64; `encoding` is the optional operand (bfloat16, ...).
    Float {
        width: u32,
        encoding: Option<u32>,
    },
    Vector {
        component: TypeId,
        count: u32,
    },
    /// `column` is a vector.
    Matrix {
        column: TypeId,
        count: u32,
    },
    /// `length` is the id of a constant: a specialization may change it. `stride` in bytes.
    Array {
        element: TypeId,
        length: Id,
        stride: Option<u32>,
    },
    RuntimeArray {
        element: TypeId,
        stride: Option<u32>,
    },
    Struct {
        members: Vec<Member>,
        /// Decorated `Block` or `BufferBlock`.
        block: bool,
        /// Decorated `BufferBlock`.
        buffer_block: bool,
    },
    Pointer {
        storage_class: u32,
        /// `None` between `OpTypeForwardPointer` and its definition, and for untyped pointers.
        pointee: Option<TypeId>,
        /// `ArrayStride` of the pointer type, in bytes (`OpPtrAccessChain`).
        stride: Option<u32>,
    },
    Function {
        return_type: TypeId,
        parameters: Vec<TypeId>,
    },
    Image(ImageType),
    Sampler,
    /// The image type.
    SampledImage(TypeId),
    AccelerationStructure,
    RayQuery,
    /// `OpTypeHitObjectNV` (`ext` false) or `OpTypeHitObjectEXT`.
    HitObject {
        ext: bool,
    },
    /// A type that this crate carries without knowing: opcode's number.
    Other(u16),
}

/// The operands of `OpTypeImage`, numbers as in the specification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageType {
    pub sampled_type: TypeId,
    /// `Dim`.
    pub dim: u32,
    /// 0 no depth, 1 depth, 2 unknown.
    pub depth: u32,
    pub arrayed: bool,
    pub multisampled: bool,
    /// 0 unknown, 1 sampled, 2 storage.
    pub sampled: u32,
    /// `Image Format`; 0 is unknown.
    pub format: u32,
}

/// A member of a struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    pub ty: TypeId,
    /// `OpMemberName`, or empty.
    pub name: String,
    /// `Offset` in bytes, where decorated.
    pub offset: Option<u32>,
    /// `MatrixStride` in bytes and `RowMajor`, where decorated.
    pub matrix: Option<MatrixLayout>,
    /// The `BuiltIn` number, where decorated.
    pub builtin: Option<u32>,
}

/// How a matrix (or an array of matrices) in a struct lies in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MatrixLayout {
    /// Bytes between columns (or rows, where row-major).
    pub stride: u32,
    pub row_major: bool,
}
