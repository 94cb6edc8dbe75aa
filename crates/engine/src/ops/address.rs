//! Pointer arithmetic: `OpPtrAccessChain` and `OpInBoundsPtrAccessChain`, comparisons, and the
//! conversions between device addresses (`PhysicalStorageBuffer`) and integers.

use smallvec::SmallVec;

use crate::machine::Reg;
use crate::module::ty::Type;
use crate::module::{Id, Instruction, Opcode};
use crate::ops::conversion::{self, Conversion};
use crate::ops::integer_operand::ReadAs;
use crate::ops::memory::{self, BufferRef, Length};
use crate::ops::op::Op;
use crate::ops::pointer::{self, PointeeLayout, Pointer, PointerBase, storage};
use crate::ops::pointer_stride::{Stride, array_stride};
use crate::ops::relational_logical::{IEqual, LogicalAnd, LogicalNot};
use crate::ops::translate::{IdValue, Translator};
use crate::ops::untyped_pointer::{chain_base, is_untyped};
use crate::ops::value_registers::Words;
use anyhit_base::error::Result;

/// Kernels of address arithmetic.
pub mod kernels {
    use crate::ops::lane_kernel::lane_kernels;
    use crate::ops::memory::OUT_OF_BOUNDS;

    lane_kernels! {
        /// An address plus a checked offset; an offset out of bounds gives an address without a
        /// buffer.
        AddressPlus Internal [u64] (base: u64, offset: u32) -> u64 {
            if offset == OUT_OF_BOUNDS { u64::MAX } else { base.wrapping_add(offset.into()) }
        }
        /// The address of an element before or behind another.
        AddressElement Internal [u64] (base: u64, index: i64, stride: u32) -> u64 {
            base.wrapping_add_signed(index.wrapping_mul(stride.into()))
        }
        /// The offset of an element, which becomes out of bounds where it leaves its range.
        OffsetElement Internal [u32] (base: u32, index: i64, stride: u32) -> u32 {
            let sum = i128::from(base) + i128::from(index) * i128::from(stride);
            if base == OUT_OF_BOUNDS { base } else { u32::try_from(sum).unwrap_or(OUT_OF_BOUNDS) }
        }
        /// Elements between two offsets or addresses.
        Distance Internal [i64] (a: i64, b: i64, stride: u32) -> i64 {
            a.wrapping_sub(b).checked_div(stride.into()).unwrap_or(0)
        }
    }
}

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::PtrAccessChain,
    Opcode::InBoundsPtrAccessChain,
    Opcode::UntypedPtrAccessChainKHR,
    Opcode::UntypedInBoundsPtrAccessChainKHR,
    Opcode::PtrEqual,
    Opcode::PtrNotEqual,
    Opcode::PtrDiff,
    Opcode::ConvertUToPtr,
    Opcode::ConvertPtrToU,
    Opcode::RawAccessChainNV,
];

/// Translates the instructions of this file; `false` for any other.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    match opcode {
        Opcode::PtrAccessChain
        | Opcode::InBoundsPtrAccessChain
        | Opcode::UntypedPtrAccessChainKHR
        | Opcode::UntypedInBoundsPtrAccessChainKHR => {
            let chain = translator.module.access_chain(instruction);
            let Some((chain, index)) = chain.and_then(|chain| Some((chain, chain.element?))) else {
                return Err(translator.invalid("an access chain without an element"));
            };
            let pointer = chain_base(translator, chain)?;
            let stride = stride(translator, chain.base, &pointer, &explicit_stride)?;
            let pointer = element(translator, pointer, index, stride)?;
            let pointer = pointer::access_chain(translator, pointer, chain.indices)?;
            if let Some(id) = instruction.result {
                translator.define(id, IdValue::Pointer(pointer.into()));
            }
        }
        Opcode::RawAccessChainNV => {
            let pointer = raw_access_chain(translator, instruction)?;
            if let Some(id) = instruction.result {
                translator.define(id, IdValue::Pointer(pointer.into()));
            }
        }
        Opcode::PtrEqual | Opcode::PtrNotEqual => {
            let pointers = [translator.id(instruction, 0)?, translator.id(instruction, 1)?];
            let types = [translator.type_of(pointers[0])?, translator.type_of(pointers[1])?];
            let untyped = is_untyped(translator, pointers[0])? || is_untyped(translator, pointers[1])?;
            if types[0] != types[1] && !untyped {
                let [a, b] = types.map(|ty| translator.module.describe_type(ty));
                return Err(translator.invalid(format!("{opcode} compares {a} with {b}")));
            }
            let (a, b) = (translator.words_unchecked(pointers[0])?, translator.words_unchecked(pointers[1])?);
            if a.len() != b.len() {
                return Err(translator.invalid("the compared pointers have different storage classes"));
            }
            let mut result = translator.constant(1)?;
            for (&a, &b) in a.iter().zip(&b) {
                let equal = translator.emit_family(&IEqual, 32, &[a, b])?;
                result = translator.emit_family(&LogicalAnd, 0, &[result, equal])?;
            }
            if opcode == Opcode::PtrNotEqual {
                result = translator.emit_family(&LogicalNot, 0, &[result])?;
            }
            translator.define_result(instruction, SmallVec::from_slice(&[result]));
        }
        Opcode::PtrDiff => {
            // Both point into one array, and the stride may be known from either.
            let [base, other] = [translator.id(instruction, 0)?, translator.id(instruction, 1)?];
            let default_stride = |translator: &mut Translator<'_>, base, pointer: &Pointer| {
                let (stride, steps) = array_stride(translator, &[base, other]);
                translator.charge(steps);
                match stride {
                    Stride::Unique(stride) => Ok(stride),
                    Stride::Unknown => packed_stride(translator, pointer),
                    Stride::Ambiguous => Err(translator
                        .unsupported("a pointer into an array whose stride is ambiguous is not supported")),
                }
            };
            let stride = match is_untyped(translator, base)? {
                // The array is interpreted as one of 8-bit integers.
                true => 1,
                false => {
                    let pointer = translator.pointer(base)?;
                    stride(translator, base, &pointer, &default_stride)?
                }
            };
            let mut ends = Words::new();
            for at in 0..2 {
                let pointer = translator.id(instruction, at)?;
                let words = translator.words_unchecked(pointer)?;
                let physical = pointer_class(translator, base)? == storage::PHYSICAL_STORAGE_BUFFER;
                ends.push(match *words {
                    [low, high] if physical => translator.pair(low, high)?,
                    [.., offset] => convert(translator, Conversion::U, 32, 64, offset)?,
                    [] => return Err(translator.invalid("the pointer has no value")),
                });
            }
            let stride = translator.constant(stride)?;
            let distance =
                translator.emit_kernel(&kernels::Distance.kernels[0], &[ends[0], ends[1], stride])?;
            let ty = translator.result_type(instruction)?;
            let width = translator.scalar_width(ty)?;
            let first = convert(translator, Conversion::S, 64, width, distance)?;
            let words = translator.expand_components(&[first], width);
            translator.define_result(instruction, words);
        }
        Opcode::ConvertUToPtr => {
            let id = translator.id(instruction, 0)?;
            let from = translator.type_of(id).and_then(|ty| translator.scalar_width(ty))?;
            let words = translator.operand(instruction, 0)?;
            let ty = translator.result_type(instruction)?;
            require_physical(translator, ty)?;
            let first = convert(translator, Conversion::U, from, 64, words[0])?;
            translator.define_result(instruction, SmallVec::from_slice(&[first, first.plus(1)]));
        }
        Opcode::ConvertPtrToU => {
            let id = translator.id(instruction, 0)?;
            let ty = translator.type_of(id)?;
            require_physical(translator, ty)?;
            let words = translator.words_unchecked(id)?;
            let first = translator.pair(words[0], words[1])?;
            let ty = translator.result_type(instruction)?;
            let width = translator.scalar_width(ty)?;
            let first = convert(translator, Conversion::U, 64, width, first)?;
            let words = translator.expand_components(&[first], width);
            translator.define_result(instruction, words);
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// `OpRawAccessChainNV`: the bytes at `Stride * Index + Offset` of a block. Accesses are checked
/// scalar by scalar, whatever its operands say of robustness.
fn raw_access_chain(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<Pointer> {
    let base = translator.id(instruction, 0)?;
    let stride = translator.id(instruction, 1)?;
    let stride = translator.constant_integer(stride)? as u32;
    let [index, offset] = [translator.id(instruction, 2)?, translator.id(instruction, 3)?];
    let index = translator.integer(index, ReadAs::Index)?;
    let offset = translator.integer(offset, ReadAs::Index)?;
    let ty = translator.result_type(instruction)?;
    let Type::Pointer { pointee: Some(pointee), storage_class, .. } = *translator.module.ty(ty) else {
        return Err(translator.invalid("the result of a raw access chain must be a pointer"));
    };
    let block = translator.pointer(base)?;
    if !matches!(block.base, PointerBase::Buffer(_)) || block.storage_class != storage_class {
        return Err(
            translator.invalid("a raw access chain must point into a buffer (SPV_NV_raw_access_chains)")
        );
    }
    let mut index_so_far = block.index;
    for (index, stride) in [(index, stride), (offset, 1)] {
        let to = translator.fresh(1)?;
        let length = Length::Unknown;
        translator.emit(Op::Memory(memory::MemoryOp::Index {
            to,
            base: index_so_far,
            index,
            stride,
            length,
        }));
        index_so_far = Some(to);
    }
    Ok(Pointer { pointee, index: index_so_far, layout: PointeeLayout::default(), ..block })
}

/// The device address that a pointer into `PhysicalStorageBuffer` is, as the first of two
/// registers.
pub fn address(translator: &mut Translator<'_>, pointer: &Pointer, base: Reg) -> Result<Reg> {
    if pointer.offset == 0 && pointer.index.is_none() {
        return Ok(base);
    }
    let constant = translator.constant(pointer.offset)?;
    let offset = pointer::add_offset(translator, pointer.index, constant)?;
    translator.emit_kernel(&kernels::AddressPlus.kernels[0], &[base, offset])
}

/// Whether a type is a pointer that is a device address.
pub fn is_physical(translator: &Translator<'_>, ty: crate::module::ty::TypeId) -> bool {
    matches!(translator.module.ty(ty), Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. })
}

fn require_physical(translator: &Translator<'_>, ty: crate::module::ty::TypeId) -> Result<()> {
    if is_physical(translator, ty) {
        return Ok(());
    }
    let name = translator.module.describe_type(ty);
    let error = translator
        .invalid(format!("only PhysicalStorageBuffer pointers convert to and from integers, not {name}"));
    Err(error.note("VUID-StandaloneSpirv-PhysicalStorageBuffer64-04710"))
}

fn pointer_class(translator: &Translator<'_>, id: Id) -> Result<u32> {
    match *translator.module.ty(translator.type_of(id)?) {
        Type::Pointer { storage_class, .. } => Ok(storage_class),
        _ => Err(translator.invalid("the operand must be a pointer")),
    }
}

/// The stride between the elements that a pointer steps over: bytes in buffers, words in registers,
/// descriptors in arrays of them. `default_stride` computes it for a buffer where the pointer's
/// type has none.
fn stride(
    translator: &mut Translator<'_>,
    base: Id,
    pointer: &Pointer,
    default_stride: &dyn Fn(&mut Translator<'_>, Id, &Pointer) -> Result<u32>,
) -> Result<u32> {
    let ty = translator.type_of(base)?;
    let Type::Pointer { stride, .. } = *translator.module.ty(ty) else {
        return Err(translator.invalid("the operand must be a pointer"));
    };
    let pointee = pointer.pointee;
    match pointer.base {
        PointerBase::Buffer(_) if pointer.is_packed(translator) => Ok(translator.word_count(pointee)? * 4),
        PointerBase::Buffer(_) | PointerBase::Heap(_) => match stride {
            Some(stride) => Ok(stride),
            None => default_stride(translator, base, pointer),
        },
        PointerBase::Descriptors { .. } => pointer::descriptor_count(translator, pointee),
        _ => translator.word_count(pointee),
    }
}

/// The stride that `OpPtrAccessChain` takes where the pointer's type has none.
fn explicit_stride(translator: &mut Translator<'_>, base: Id, pointer: &Pointer) -> Result<u32> {
    let class = pointer.storage_class;
    let needs_stride = matches!(
        class,
        storage::UNIFORM | storage::STORAGE_BUFFER | storage::PUSH_CONSTANT | storage::WORKGROUP
    );
    if needs_stride || is_untyped(translator, base)? {
        let class = crate::module::names::storage_class_name(class);
        return Err(translator
            .invalid(format!("the pointer type has no ArrayStride decoration, which {class} requires"))
            .note(
                "SPIR-V, OpPtrAccessChain: its base is a pointer whose type is decorated with ArrayStride",
            ));
    }
    // "For all other objects, the implementation calculates the element's address"
    // (OpPtrAccessChain).
    let (stride, steps) = array_stride(translator, &[base]);
    translator.charge(steps);
    match stride {
        Stride::Unique(stride) => Ok(stride),
        Stride::Unknown | Stride::Ambiguous => packed_stride(translator, pointer),
    }
}

/// The size of the pointee: the stride of a tightly packed array.
fn packed_stride(translator: &Translator<'_>, pointer: &Pointer) -> Result<u32> {
    let size = translator.module.size_of(pointer.pointee).and_then(|size| u32::try_from(size).ok());
    size.ok_or_else(|| translator.unsupported("a pointer into an array of unknown stride is not supported"))
}

/// The pointer to another element of the array that a pointer leads into.
fn element(translator: &mut Translator<'_>, mut pointer: Pointer, index: Id, stride: u32) -> Result<Pointer> {
    let width = translator.type_of(index).and_then(|ty| translator.scalar_width(ty))?;
    let words = translator.words(index)?;
    if words.iter().all(|&word| translator.constant_word(word) == Some(0)) {
        return Ok(pointer);
    }
    let index = convert(translator, Conversion::S, width, 64, words[0])?;
    let stride = translator.constant(stride)?;
    if let PointerBase::Buffer(BufferRef::Address(base)) = pointer.base {
        let base = address(translator, &pointer, base)?;
        let base = translator.emit_kernel(&kernels::AddressElement.kernels[0], &[base, index, stride])?;
        pointer.base = PointerBase::Buffer(BufferRef::Address(base));
        pointer.index = None;
    } else {
        let constant = translator.constant(pointer.offset)?;
        let base = pointer::add_offset(translator, pointer.index, constant)?;
        pointer.index =
            Some(translator.emit_kernel(&kernels::OffsetElement.kernels[0], &[base, index, stride])?);
    }
    pointer.offset = 0;
    Ok(pointer)
}

fn convert(translator: &mut Translator<'_>, kind: Conversion, from: u32, to: u32, first: Reg) -> Result<Reg> {
    match conversion::kernel(kind, from, to) {
        Some(kernel) => translator.emit_kernel(kernel, &[first]),
        None => Ok(first),
    }
}

#[cfg(test)]
mod tests {
    use super::kernels::{AddressElement, AddressPlus, Distance, OffsetElement};
    use crate::ops::lane_kernel::tests::check;

    #[test]
    fn address_arithmetic() {
        check(&AddressPlus, 64, &[0x1_FFFF_FFFC, 8], 0x2_0000_0004);
        check(&AddressPlus, 64, &[0x1_0000_0000, 0xFFFF_FFFF], u64::MAX);
        check(&AddressElement, 64, &[0x1_0000_0010, u64::MAX, 16], 0x1_0000_0000);
        check(&AddressElement, 64, &[0x1_0000_0000, 3, 12], 0x1_0000_0024);
        check(&OffsetElement, 32, &[32, -2i64 as u64, 16], 0);
        check(&OffsetElement, 32, &[32, -3i64 as u64, 16], 0xFFFF_FFFF);
        check(&OffsetElement, 32, &[0xFFFF_FFFF, -1i64 as u64, 4], 0xFFFF_FFFF);
        check(&Distance, 64, &[16, 48, 16], -2i64 as u64);
        check(&Distance, 64, &[16, 48, 0], 0);
    }
}
