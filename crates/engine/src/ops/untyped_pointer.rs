//! Untyped pointers (`SPV_KHR_untyped_pointers`): what lies there is said by the instruction that
//! uses one.

use crate::module::access_chain::AccessChain;
use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Instruction, Opcode};
use crate::ops::memory::{Chunk, MemoryOp};
use crate::ops::op::Op;
use crate::ops::pointer::{PointeeLayout, Pointer, PointerBase, alignment};
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[Opcode::CopyMemorySized];

/// Translates the instructions of this file; `false` for any other.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    match instruction.opcode {
        Opcode::CopyMemorySized => copy(translator, instruction)?,
        _ => return Ok(false),
    }
    Ok(true)
}

/// Returns true if the type of a pointer does not say what it points to.
pub fn is_untyped(translator: &Translator<'_>, pointer: Id) -> Result<bool> {
    let ty = translator.type_of(pointer)?;
    Ok(matches!(translator.module.ty(ty), Type::Pointer { pointee: None, .. }))
}

/// The pointer that an id is, where an untyped one points to a value of this type.
pub fn pointer_to(translator: &mut Translator<'_>, id: Id, ty: TypeId) -> Result<Pointer> {
    let pointer = translator.pointer(id)?;
    Ok(if pointer.pointee != ty && is_untyped(translator, id)? { retyped(pointer, ty) } else { pointer })
}

/// A pointer to a value of another type at the same place. The layout of a matrix to which access
/// chains led stays.
fn retyped(pointer: Pointer, ty: TypeId) -> Pointer {
    match pointer.pointee == ty {
        true => pointer,
        false => Pointer { pointee: ty, layout: PointeeLayout::default(), ..pointer },
    }
}

/// The pointer that an access chain begins with, to a value of the type whose parts it selects.
pub fn chain_base(translator: &mut Translator<'_>, chain: AccessChain<'_>) -> Result<Pointer> {
    let pointer = translator.pointer(chain.base)?;
    let Some(id) = chain.base_type else { return Ok(pointer) };
    let Some(ty) = translator.module.type_with_id(id) else {
        return Err(translator.invalid(format!("%{} is not a type", id.0)));
    };
    let is_array = matches!(translator.module.ty(ty), Type::Array { .. } | Type::RuntimeArray { .. });
    if matches!(pointer.base, PointerBase::Descriptors { .. }) && !is_array {
        let name = translator.module.describe_type(ty);
        let error = translator.invalid(format!("an array of descriptors is accessed as {name}"));
        return Err(error.note("SPV_KHR_untyped_pointers, OpUntypedAccessChainKHR, Base Type"));
    }
    Ok(retyped(pointer, ty))
}

/// `OpCopyMemorySized`: bytes from one buffer to another.
fn copy(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let [to, from, size] = [0, 1, 2].map(|at| translator.id(instruction, at));
    let (to, from, size) = (to?, from?, size?);
    if translator.module.constant_scalar(size).is_none() {
        return Err(
            translator.unsupported("OpCopyMemorySized of a size that is not constant is not supported")
        );
    }
    let size = translator.constant_integer(size)?;
    let count = u32::try_from(size).unwrap_or(u32::MAX);
    let [to, from] = [translator.pointer(to)?, translator.pointer(from)?];
    let (PointerBase::Buffer(target), PointerBase::Buffer(source)) = (&to.base, &from.base) else {
        return Err(translator.unsupported("OpCopyMemorySized outside of buffers is not supported"));
    };
    if count == 0 {
        return Ok(());
    }
    let alignment = alignment(translator, instruction, 3)?;
    let chunk = |buffer, pointer: &Pointer| {
        let (offset, index) = (pointer.offset, pointer.index);
        Chunk { buffer, offset, index, width: 8, count, alignment }
    };
    let (target, source) = (chunk(*target, &to), chunk(*source, &from));
    let bytes = translator.fresh(count)?;
    translator.emit(Op::Memory(MemoryOp::BufferLoad { to: bytes, chunk: source }));
    translator.emit(Op::Memory(MemoryOp::BufferStore { from: bytes, chunk: target }));
    Ok(())
}
