//! The arena of types.

use std::collections::HashMap;

use crate::math::float_format::FloatFormat;
use crate::module::{Id, Module, Opcode};

/// A handle of a type: an index into [`Module::types`](crate::module::Module::types).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TypeId(pub u32);

/// A type. Decorations that shape memory (offsets, strides, matrix layout) are folded in.
///
/// Variants and fields are the operands of the `OpType*` instruction of that name.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the specification's")]
pub enum Type {
    Void,
    Bool,
    /// Width in bits: 8, 16, 32 or 64.
    Int {
        width: u32,
        signed: bool,
    },
    /// Width in bits: 16, 32 or 64, and 8 or 16 with an `encoding`, the optional `FP Encoding`;
    /// see [`Type::float_format`].
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
    /// `OpTypeBufferEXT`: the descriptor of a buffer in a heap.
    Buffer {
        storage_class: u32,
    },
    RayQuery,
    /// `OpTypeHitObjectNV` (`ext` false) or `OpTypeHitObjectEXT`.
    HitObject {
        ext: bool,
    },
    /// A type that this crate does not know: the number of its opcode.
    Other(Opcode),
}

/// `BFloat16KHR` (`SPV_KHR_bfloat16`), an `FP Encoding` of 16 bits.
pub(super) const BFLOAT16: u32 = 0;
/// `Float8E4M3EXT` (`SPV_EXT_float8`), an `FP Encoding` of 8 bits.
pub(super) const FLOAT8_E4M3: u32 = 4214;
/// `Float8E5M2EXT` (`SPV_EXT_float8`), an `FP Encoding` of 8 bits.
pub(super) const FLOAT8_E5M2: u32 = 4215;

impl Type {
    /// Returns true for the types of descriptors in a heap (`SPV_EXT_descriptor_heap`,
    /// "Descriptor").
    pub fn is_descriptor(&self) -> bool {
        matches!(self, Self::Buffer { .. } | Self::Image(_) | Self::AccelerationStructure | Self::Sampler)
    }

    /// The format of a float; `None` for another type, and for encodings that are not known here.
    pub fn float_format(&self) -> Option<FloatFormat> {
        let &Self::Float { width, encoding } = self else { return None };
        Some(match (width, encoding) {
            (16, None) => FloatFormat::Binary16,
            (32, None) => FloatFormat::Binary32,
            (64, None) => FloatFormat::Binary64,
            (16, Some(BFLOAT16)) => FloatFormat::BFloat16,
            (8, Some(FLOAT8_E4M3)) => FloatFormat::E4M3,
            (8, Some(FLOAT8_E5M2)) => FloatFormat::E5M2,
            _ => return None,
        })
    }
}

/// The operands of `OpTypeCooperativeMatrixKHR` but for the component type, as ids of constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CooperativeMatrix {
    /// The type.
    pub ty: TypeId,
    /// The `Scope` whose invocations have the components.
    pub scope: Id,
    /// The number of rows.
    pub rows: Id,
    /// The number of columns.
    pub columns: Id,
    /// The `Cooperative Matrix Use`.
    pub usage: Id,
}

impl CooperativeMatrix {
    /// The smallest subgroup that holds a matrix.
    pub const MIN_SUBGROUP_SIZE: u32 = 8;

    /// The components for which each invocation has room: those of one in the smallest subgroup.
    pub fn components_of_invocation(rows: u64, columns: u64) -> u32 {
        let each = rows.saturating_mul(columns).div_ceil(Self::MIN_SUBGROUP_SIZE.into());
        u32::try_from(each).unwrap_or(u32::MAX)
    }
}

/// The operands of `OpTypeImage`, numbers as in the specification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageType {
    /// The component type of a read, or void.
    pub sampled_type: TypeId,
    /// `Dim`.
    pub dim: u32,
    /// 0 no depth, 1 depth, 2 unknown.
    pub depth: u32,
    /// Whether it has layers.
    pub arrayed: bool,
    /// Whether a texel has several samples.
    pub multisampled: bool,
    /// 0 unknown, 1 sampled, 2 storage.
    pub sampled: u32,
    /// `Image Format`; 0 is unknown.
    pub format: u32,
}

/// A member of a struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its type.
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct MatrixLayout {
    /// Bytes between columns (or rows, where row-major).
    pub stride: u32,
    /// `RowMajor`; else `ColMajor`.
    pub row_major: bool,
}

/// `PhysicalStorageBuffer`: the storage class whose pointers have a size in memory.
const PHYSICAL_STORAGE_BUFFER: u32 = 5349;

impl Module {
    /// The size of a type in bytes, from its first byte to the last one that a part of it covers,
    /// by the explicit layout of its `Offset`, `ArrayStride` and `MatrixStride`.
    ///
    /// Specialization constants have their current values ([`Module::specialize`]). `None` for
    /// types without a size (runtime arrays, opaque types, booleans), for lengths that are not
    /// known, where a decoration is missing, and where the size does not fit 64 bits.
    #[doc(hidden)]
    pub fn size_of(&self, ty: TypeId) -> Option<u64> {
        self.size_of_with(ty, &|id| self.scalar_value(id))
    }

    /// As [`Module::size_of`], with the values of array lengths given by the caller, who may know
    /// results of `OpSpecConstantOp`.
    #[doc(hidden)]
    pub fn size_of_with(&self, ty: TypeId, length: &dyn Fn(Id) -> Option<u64>) -> Option<u64> {
        SizeComputation::new(self, length).size(ty, None)
    }

    /// The number of scalars that a value of a type is made of; opaque types and pointers count
    /// as one.
    ///
    /// Saturates at `u64::MAX`: a few words can ask for `float[2147483647][2147483647]`, so check
    /// the count against a limit before allocating memory for it. `None` for runtime arrays and
    /// lengths that are not known (see [`Module::size_of`]).
    #[doc(hidden)]
    pub fn scalar_count(&self, ty: TypeId) -> Option<u64> {
        self.scalar_count_with(ty, &|id| self.scalar_value(id))
    }

    /// As [`Module::scalar_count`], with the values of array lengths given by the caller.
    #[doc(hidden)]
    pub fn scalar_count_with(&self, ty: TypeId, length: &dyn Fn(Id) -> Option<u64>) -> Option<u64> {
        ScalarCounter { module: self, length, memo: HashMap::new() }.count(ty)
    }
}

/// Computes sizes. Those of structs are memoized: a struct of two structs of two structs... would
/// be visited 2^depth times. The loader bounds the depth.
pub(super) struct SizeComputation<'a> {
    module: &'a Module,
    length: &'a dyn Fn(Id) -> Option<u64>,
    memo: HashMap<TypeId, Option<u64>>,
}

impl<'a> SizeComputation<'a> {
    /// A computation with the lengths of arrays given by the caller.
    pub(super) fn new(module: &'a Module, length: &'a dyn Fn(Id) -> Option<u64>) -> Self {
        Self { module, length, memo: HashMap::new() }
    }

    /// The size of a type; `layout` is the matrix layout of the enclosing struct member.
    pub(super) fn size(&mut self, ty: TypeId, layout: Option<MatrixLayout>) -> Option<u64> {
        match self.module.ty(ty) {
            Type::Int { width, .. } | Type::Float { width, .. } => Some(u64::from(width / 8)),
            Type::Vector { component, count } => self.size(*component, None)?.checked_mul(u64::from(*count)),
            Type::Matrix { column, count } => {
                let Type::Vector { component, count: rows } = self.module.ty(*column) else { return None };
                let (layout, component) = (layout?, self.size(*component, None)?);
                let (vectors, components) = if layout.row_major { (*rows, *count) } else { (*count, *rows) };
                strided_size(u64::from(vectors), u64::from(layout.stride), component * u64::from(components))
            }
            Type::Array { element, length, stride } => {
                let length = (self.length)(*length)?;
                let element = self.size(*element, layout)?;
                strided_size(length, u64::from((*stride)?), element)
            }
            Type::Struct { members, .. } => {
                if let Some(size) = self.memo.get(&ty) {
                    return *size;
                }
                let mut size = Some(0);
                for member in members {
                    let end = member.offset.and_then(|offset| {
                        self.size(member.ty, member.matrix)?.checked_add(u64::from(offset))
                    });
                    size = size.zip(end).map(|(size, end)| size.max(end));
                }
                self.memo.insert(ty, size);
                size
            }
            Type::Pointer { storage_class: PHYSICAL_STORAGE_BUFFER, .. } => Some(8),
            _ => None,
        }
    }
}

/// The bytes from the first of `count` elements to the end of the last.
fn strided_size(count: u64, stride: u64, element: u64) -> Option<u64> {
    count.checked_sub(1)?.checked_mul(stride)?.checked_add(element)
}

/// Counts scalars. The counts of structs are memoized.
struct ScalarCounter<'a> {
    module: &'a Module,
    length: &'a dyn Fn(Id) -> Option<u64>,
    memo: HashMap<TypeId, Option<u64>>,
}

impl ScalarCounter<'_> {
    fn count(&mut self, ty: TypeId) -> Option<u64> {
        match self.module.ty(ty) {
            Type::Void | Type::Function { .. } => Some(0),
            Type::Vector { count, .. } => Some(u64::from(*count)),
            Type::Matrix { column, count } => Some(self.count(*column)?.saturating_mul(u64::from(*count))),
            Type::Array { element, length, .. } => {
                let length = (self.length)(*length)?;
                Some(self.count(*element)?.saturating_mul(length))
            }
            Type::RuntimeArray { .. } => None,
            Type::Struct { members, .. } => {
                if let Some(size) = self.memo.get(&ty) {
                    return *size;
                }
                let mut sum = Some(0_u64);
                for member in members {
                    let count = self.count(member.ty);
                    sum = sum.zip(count).map(|(sum, count)| sum.saturating_add(count));
                }
                self.memo.insert(ty, sum);
                sum
            }
            _ => Some(1),
        }
    }
}

/// How large a type is as a tree of types.
#[derive(Clone, Copy, Debug)]
pub(super) struct TypeExtent {
    /// Levels of nesting, from 1.
    pub(super) depth: u32,
    /// The type itself and its parts with theirs; see [`InputLimit::TypeParts`].
    pub(super) parts: u64,
}

impl TypeExtent {
    /// The extent of a type without parts.
    pub(super) const LEAF: Self = Self { depth: 1, parts: 1 };

    /// The extent of a type around `count` parts of this one.
    pub(super) fn around(self, count: u32) -> Self {
        let parts = self.parts.saturating_mul(count.into()).saturating_add(1);
        Self { depth: self.depth + 1, parts }
    }
}

#[cfg(test)]
mod tests {
    use crate::module::Opcode;
    use pretty_assertions::assert_eq;

    use super::*;
    use crate::module::assemble::Assembler;
    use crate::module::load_with;
    use anyhit_base::input::{InputLimit, InputLimits};

    fn size(module: &Module, id: u32) -> Option<u64> {
        module.size_of(module.type_with_id(Id(id)).unwrap())
    }

    fn count(module: &Module, id: u32) -> Option<u64> {
        module.scalar_count(module.type_with_id(Id(id)).unwrap())
    }

    #[test]
    fn sizes_follow_the_explicit_layout() {
        let mut a = Assembler::new();
        // struct { mat3x2 row-major at 16, stride 16; float[3] at 64, stride 8; pointer at 96 }
        a.op(Opcode::MemberDecorate, &[20, 0, 35, 16]);
        a.op(Opcode::MemberDecorate, &[20, 0, 4]);
        a.op(Opcode::MemberDecorate, &[20, 0, 7, 16]);
        a.op(Opcode::MemberDecorate, &[20, 1, 35, 64]);
        a.op(Opcode::MemberDecorate, &[20, 2, 35, 96]);
        a.op(Opcode::MemberDecorate, &[21, 0, 35, 4]);
        a.op(Opcode::MemberDecorate, &[21, 0, 7, 16]);
        a.op(Opcode::Decorate, &[12, 6, 8]);
        a.op(Opcode::Decorate, &[22, 6, 64]);
        a.types();
        a.op(Opcode::TypeVector, &[10, 6, 2]);
        a.op(Opcode::TypeMatrix, &[11, 10, 3]);
        a.op(Opcode::TypeArray, &[12, 6, 8]);
        a.op(Opcode::TypePointer, &[13, 5349, 6]);
        a.op(Opcode::TypeStruct, &[20, 11, 12, 13]);
        a.op(Opcode::TypeArray, &[22, 11, 8]);
        a.op(Opcode::TypeStruct, &[21, 22]);
        a.op(Opcode::TypeStruct, &[23, 6]);
        a.op(Opcode::TypeRuntimeArray, &[24, 6]);
        let module = a.loaded();
        assert_eq!(size(&module, 7), Some(12));
        // Two elements of stride 8 and one float.
        assert_eq!(size(&module, 12), Some(20));
        assert_eq!(size(&module, 20), Some(104));
        // Column-major: offset 4, two strides of 64 between three matrices, two of 16 between
        // three columns, one column of 8 bytes.
        assert_eq!(size(&module, 21), Some(4 + 2 * 64 + 2 * 16 + 8));
        assert_eq!([3, 11, 23, 24].map(|id| size(&module, id)), [None; 4]);
        // Row-major: two rows, the last one of three floats.
        let Type::Struct { members, .. } = module.ty(module.type_with_id(Id(20)).unwrap()) else { panic!() };
        let length = |id| module.scalar_value(id);
        let mut sizes = SizeComputation::new(&module, &length);
        assert_eq!(sizes.size(members[0].ty, members[0].matrix), Some(16 + 12));
    }

    #[test]
    fn scalars_are_counted_and_huge_counts_saturate() {
        let mut a = Assembler::new();
        a.types();
        a.op(Opcode::Constant, &[5, 10, 0x7fff_ffff]);
        a.op(Opcode::TypeArray, &[11, 6, 10]);
        a.op(Opcode::TypeArray, &[12, 11, 10]);
        a.op(Opcode::TypeArray, &[13, 12, 10]);
        a.op(Opcode::TypeMatrix, &[14, 7, 4]);
        a.op(Opcode::TypeStruct, &[15, 14, 6, 3]);
        a.op(Opcode::TypeRuntimeArray, &[16, 6]);
        let module = a.loaded();
        assert_eq!(count(&module, 12), Some(0x7fff_ffff * 0x7fff_ffff));
        assert_eq!(count(&module, 13), Some(u64::MAX));
        assert_eq!(count(&module, 15), Some(14));
        assert_eq!(count(&module, 16), None);
    }

    #[test]
    fn specialization_changes_sizes() {
        let mut a = Assembler::new();
        a.op(Opcode::Decorate, &[10, 1, 0]);
        a.op(Opcode::Decorate, &[11, 6, 4]);
        a.types();
        a.op(Opcode::SpecConstant, &[5, 10, 2]);
        a.op(Opcode::TypeArray, &[11, 6, 10]);
        let mut module = a.loaded();
        assert_eq!((size(&module, 11), count(&module, 11)), (Some(8), Some(2)));
        module.specialize_bits(0, 5).unwrap();
        assert_eq!((size(&module, 11), count(&module, 11)), (Some(20), Some(5)));
        let ty = module.type_with_id(Id(11)).unwrap();
        assert_eq!(module.size_of_with(ty, &|_| Some(3)), Some(12));
    }

    #[test]
    fn structs_of_structs_of_structs_take_no_time() {
        let mut a = Assembler::new();
        a.types();
        a.op(Opcode::TypeStruct, &[100, 6, 6]);
        // As deep as 2^32 parts allow.
        for id in 101..=130 {
            a.op(Opcode::TypeStruct, &[id, id - 1, id - 1]);
        }
        let limits = InputLimits::default().with(InputLimit::TypeParts, u64::MAX);
        let module = load_with(&a.bytes(), limits).unwrap();
        assert_eq!(count(&module, 130), Some(1 << 31));
        assert_eq!(size(&module, 130), None);
    }
}
