//! Pointers as numbers: `OpPtrAccessChain` and its kin, comparisons, and the conversions between
//! device addresses (`PhysicalStorageBuffer`) and integers.

use rspirv::spirv::Op as Opcode;
use smallvec::SmallVec;

use crate::error::Result;
use crate::machine::Reg;
use crate::module::ty::Type;
use crate::module::{Id, Instruction};
use crate::ops::conversion::{self, Conversion};
use crate::ops::decode::{Decoder, Value, Words};
use crate::ops::integer_operand::Reading;
use crate::ops::memory::{self, BufferRef, Length};
use crate::ops::op::Op;
use crate::ops::pointer::{self, Place, Pointer, storage};
use crate::ops::pointer_stride;
use crate::ops::relational_logical::{IEqual, LogicalAnd, LogicalNot};

/// Kernels of address arithmetic.
pub mod kernels {
    use crate::lane_kernels;
    use crate::ops::memory::OUT_OF_BOUNDS;

    lane_kernels! {
        /// An address and a checked offset; an offset out of bounds leads to where nothing lies.
        AddressPlus Internal [u64] (base: u64, offset: u32) -> u64 {
            if offset == OUT_OF_BOUNDS { u64::MAX } else { base.wrapping_add(offset.into()) }
        }
        /// The address of an element before or behind another.
        AddressElement Internal [u64] (base: u64, index: i64, stride: u32) -> u64 {
            base.wrapping_add_signed(index.wrapping_mul(stride.into()))
        }
        /// The same for an offset, which becomes out of bounds where it leaves its range.
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

/// Opcodes decoded here.
pub const OPCODES: &[Opcode] = &[
    Opcode::PtrAccessChain,
    Opcode::InBoundsPtrAccessChain,
    Opcode::PtrEqual,
    Opcode::PtrNotEqual,
    Opcode::PtrDiff,
    Opcode::ConvertUToPtr,
    Opcode::ConvertPtrToU,
    Opcode::RawAccessChainNV,
];

/// Decodes the instructions of this file; `false` for any other.
pub fn decode(decoder: &mut Decoder<'_>, opcode: Opcode, instruction: &Instruction) -> Result<bool> {
    match opcode {
        Opcode::PtrAccessChain | Opcode::InBoundsPtrAccessChain => {
            let (base, index) = (decoder.id(instruction, 0)?, decoder.id(instruction, 1)?);
            let stride = stride(decoder, base, &explicit_stride)?;
            let pointer = decoder.pointer(base)?;
            let pointer = element(decoder, pointer, index, stride)?;
            let indices = &decoder.operands(instruction)[2..];
            let pointer = pointer::follow(decoder, pointer, indices)?;
            if let Some(id) = instruction.result {
                decoder.define(id, Value::Pointer(pointer.into()));
            }
        }
        Opcode::RawAccessChainNV => {
            let pointer = raw(decoder, instruction)?;
            if let Some(id) = instruction.result {
                decoder.define(id, Value::Pointer(pointer.into()));
            }
        }
        Opcode::PtrEqual | Opcode::PtrNotEqual => {
            let pointers = [decoder.id(instruction, 0)?, decoder.id(instruction, 1)?];
            let (a, b) = (decoder.carried(pointers[0])?, decoder.carried(pointers[1])?);
            if a.len() != b.len() {
                return Err(decoder.invalid("pointers of different storage classes are compared"));
            }
            let mut result = decoder.constant(1)?;
            for (&a, &b) in a.iter().zip(&b) {
                let equal = decoder.emit_family(&IEqual, 32, &[a, b])?;
                result = decoder.emit_family(&LogicalAnd, 0, &[result, equal])?;
            }
            if opcode == Opcode::PtrNotEqual {
                result = decoder.emit_family(&LogicalNot, 0, &[result])?;
            }
            decoder.result(instruction, SmallVec::from_slice(&[result]));
        }
        Opcode::PtrDiff => {
            let base = decoder.id(instruction, 0)?;
            let stride = stride(decoder, base, &array_stride)?;
            let mut ends = Words::new();
            for at in 0..2 {
                let pointer = decoder.id(instruction, at)?;
                let words = decoder.carried(pointer)?;
                let physical = pointer_class(decoder, base)? == storage::PHYSICAL_STORAGE_BUFFER;
                ends.push(match *words {
                    [low, high] if physical => decoder.pair(low, high)?,
                    [.., offset] => convert(decoder, Conversion::U, 32, 64, offset)?,
                    [] => return Err(decoder.invalid("a pointer without a value")),
                });
            }
            let stride = decoder.constant(stride)?;
            let distance = decoder.emit_kernel(&kernels::Distance.kernels[0], &[ends[0], ends[1], stride])?;
            let ty = decoder.result_type(instruction)?;
            let width = decoder.scalar_width(ty)?;
            let first = convert(decoder, Conversion::S, 64, width, distance)?;
            let words = decoder.spread(&[first], width);
            decoder.result(instruction, words);
        }
        Opcode::ConvertUToPtr => {
            let id = decoder.id(instruction, 0)?;
            let from = decoder.type_of(id).and_then(|ty| decoder.scalar_width(ty))?;
            let words = decoder.operand(instruction, 0)?;
            let ty = decoder.result_type(instruction)?;
            require_physical(decoder, ty)?;
            let first = convert(decoder, Conversion::U, from, 64, words[0])?;
            decoder.result(instruction, SmallVec::from_slice(&[first, first.plus(1)]));
        }
        Opcode::ConvertPtrToU => {
            let id = decoder.id(instruction, 0)?;
            let ty = decoder.type_of(id)?;
            require_physical(decoder, ty)?;
            let words = decoder.carried(id)?;
            let first = decoder.pair(words[0], words[1])?;
            let ty = decoder.result_type(instruction)?;
            let width = decoder.scalar_width(ty)?;
            let first = convert(decoder, Conversion::U, 64, width, first)?;
            let words = decoder.spread(&[first], width);
            decoder.result(instruction, words);
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// `OpRawAccessChainNV`: the bytes at `Stride * Index + Offset` of a block. Accesses are checked
/// scalar by scalar, whatever its operands say of robustness.
fn raw(decoder: &mut Decoder<'_>, instruction: &Instruction) -> Result<Pointer> {
    let base = decoder.id(instruction, 0)?;
    let stride = decoder.id(instruction, 1)?;
    let stride = decoder.constant_integer(stride)? as u32;
    let [index, offset] = [decoder.id(instruction, 2)?, decoder.id(instruction, 3)?];
    let index = decoder.integer(index, Reading::Index)?;
    let offset = decoder.integer(offset, Reading::Index)?;
    let ty = decoder.result_type(instruction)?;
    let Type::Pointer { pointee: Some(pointee), storage_class, .. } = *decoder.module.ty(ty) else {
        return Err(decoder.invalid("a raw access chain gives a pointer"));
    };
    let base = decoder.pointer(base)?;
    if !matches!(base.place, Place::Buffer(_)) || base.storage_class != storage_class {
        return Err(decoder.invalid("a raw access chain leads into a buffer (SPV_NV_raw_access_chains)"));
    }
    let mut index_so_far = base.index;
    for (index, stride) in [(index, stride), (offset, 1)] {
        let to = decoder.fresh(1)?;
        let length = Length::Unknown;
        decoder.emit(Op::Memory(memory::Op::Index { to, base: index_so_far, index, stride, length }));
        index_so_far = Some(to);
    }
    Ok(Pointer { pointee, index: index_so_far, matrix: None, component_stride: None, ..base })
}

/// The device address that a pointer into `PhysicalStorageBuffer` is, as the first of two registers.
pub fn address(decoder: &mut Decoder<'_>, pointer: &Pointer, base: Reg) -> Result<Reg> {
    if pointer.offset == 0 && pointer.index.is_none() {
        return Ok(base);
    }
    let constant = decoder.constant(pointer.offset)?;
    let offset = pointer::shifted(decoder, pointer.index, constant)?;
    decoder.emit_kernel(&kernels::AddressPlus.kernels[0], &[base, offset])
}

/// Whether a type is a pointer that is a device address.
pub fn is_physical(decoder: &Decoder<'_>, ty: crate::module::ty::TypeId) -> bool {
    matches!(decoder.module.ty(ty), Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. })
}

fn require_physical(decoder: &Decoder<'_>, ty: crate::module::ty::TypeId) -> Result<()> {
    if is_physical(decoder, ty) {
        return Ok(());
    }
    let name = decoder.module.describe_type(ty);
    let error = decoder.invalid(format!("only pointers to PhysicalStorageBuffer are numbers, not {name}"));
    Err(error.note("VUID-StandaloneSpirv-PhysicalStorageBuffer64-04710"))
}

fn pointer_class(decoder: &Decoder<'_>, id: Id) -> Result<u32> {
    match *decoder.module.ty(decoder.type_of(id)?) {
        Type::Pointer { storage_class, .. } => Ok(storage_class),
        _ => Err(decoder.invalid("a pointer is needed here")),
    }
}

/// What lies between the elements that a pointer steps over: bytes in buffers, words in registers,
/// descriptors in arrays of them. `untold` gives it for a buffer where the pointer's type does not.
fn stride(
    decoder: &mut Decoder<'_>,
    base: Id,
    untold: &dyn Fn(&Decoder<'_>, Id, &Pointer) -> Result<u32>,
) -> Result<u32> {
    let ty = decoder.type_of(base)?;
    let Type::Pointer { pointee: Some(pointee), stride, .. } = *decoder.module.ty(ty) else {
        return Err(decoder.invalid("a pointer is needed here"));
    };
    let pointer = decoder.pointer(base)?;
    match pointer.place {
        Place::Buffer(_) if pointer.is_packed(decoder) => Ok(decoder.word_count(pointee)? * 4),
        Place::Buffer(_) => match stride {
            Some(stride) => Ok(stride),
            None => untold(decoder, base, &pointer),
        },
        Place::Descriptors { .. } => pointer::descriptor_count(decoder, pointee),
        _ => decoder.word_count(pointee),
    }
}

/// The stride that `OpPtrAccessChain` takes where the pointer's type has none.
fn explicit_stride(decoder: &Decoder<'_>, base: Id, pointer: &Pointer) -> Result<u32> {
    let class = pointer.storage_class;
    if matches!(
        class,
        storage::UNIFORM | storage::STORAGE_BUFFER | storage::PUSH_CONSTANT | storage::WORKGROUP
    ) {
        let class = crate::module::names::storage_class_name(class);
        return Err(decoder
            .invalid(format!("the pointer's type has no ArrayStride decoration, which {class} needs"))
            .note(
                "SPIR-V, OpPtrAccessChain: its base is a pointer whose type is decorated with ArrayStride",
            ));
    }
    // "For all other objects, the implementation calculates the element's address" (OpPtrAccessChain).
    array_stride(decoder, base, pointer)
}

/// The stride of the array that a pointer leads into, or the size of what it points to where nothing
/// tells of an array.
fn array_stride(decoder: &Decoder<'_>, base: Id, pointer: &Pointer) -> Result<u32> {
    let told = pointer_stride::stride_of_array(decoder.module, base);
    let size = || decoder.module.size_of(pointer.pointee).and_then(|size| u32::try_from(size).ok());
    told.or_else(size).ok_or_else(|| decoder.unsupported("a pointer into an array whose stride is not known"))
}

/// The pointer to another element of the array that a pointer leads into.
fn element(decoder: &mut Decoder<'_>, mut pointer: Pointer, index: Id, stride: u32) -> Result<Pointer> {
    let width = decoder.type_of(index).and_then(|ty| decoder.scalar_width(ty))?;
    let words = decoder.words(index)?;
    if words.iter().all(|&word| decoder.constant_word(word) == Some(0)) {
        return Ok(pointer);
    }
    let index = convert(decoder, Conversion::S, width, 64, words[0])?;
    let stride = decoder.constant(stride)?;
    if let Place::Buffer(BufferRef::Address(base)) = pointer.place {
        let base = address(decoder, &pointer, base)?;
        let base = decoder.emit_kernel(&kernels::AddressElement.kernels[0], &[base, index, stride])?;
        pointer.place = Place::Buffer(BufferRef::Address(base));
        pointer.index = None;
    } else {
        let constant = decoder.constant(pointer.offset)?;
        let base = pointer::shifted(decoder, pointer.index, constant)?;
        pointer.index =
            Some(decoder.emit_kernel(&kernels::OffsetElement.kernels[0], &[base, index, stride])?);
    }
    pointer.offset = 0;
    Ok(pointer)
}

fn convert(decoder: &mut Decoder<'_>, kind: Conversion, from: u32, to: u32, first: Reg) -> Result<Reg> {
    match conversion::kernel(kind, from, to) {
        Some(kernel) => decoder.emit_kernel(kernel, &[first]),
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
