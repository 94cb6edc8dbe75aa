//! Translates atomic instructions to operations.

use rspirv::spirv::Capability;
use smallvec::SmallVec;

use crate::machine::Reg;
use crate::module::ty::{Type, TypeId};
use crate::module::{Instruction, Opcode};
use crate::ops::atomic::{AtomicKind, AtomicOp, AtomicTarget};
use crate::ops::memory::Chunk;
use crate::ops::op::Op as Operation;
use crate::ops::pointer::{Pointer, PointerBase};
use crate::ops::translate::Translator;
use crate::ops::untyped_pointer::pointer_to;
use crate::ops::value_registers::{Words, registers_from};
use anyhit_base::error::Result;

/// Translates atomic instructions; `false` for an instruction of another section.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    let kind = match opcode {
        Opcode::AtomicLoad => AtomicKind::Load,
        Opcode::AtomicStore | Opcode::AtomicExchange => AtomicKind::Exchange,
        Opcode::AtomicCompareExchange => AtomicKind::CompareExchange,
        Opcode::AtomicIIncrement | Opcode::AtomicIAdd => AtomicKind::Add,
        Opcode::AtomicIDecrement | Opcode::AtomicISub => AtomicKind::Sub,
        Opcode::AtomicSMin => AtomicKind::SMin,
        Opcode::AtomicUMin => AtomicKind::UMin,
        Opcode::AtomicSMax => AtomicKind::SMax,
        Opcode::AtomicUMax => AtomicKind::UMax,
        Opcode::AtomicAnd => AtomicKind::And,
        Opcode::AtomicOr => AtomicKind::Or,
        Opcode::AtomicXor => AtomicKind::Xor,
        Opcode::AtomicFAddEXT => AtomicKind::FAdd,
        Opcode::AtomicFMinEXT => AtomicKind::FMin,
        Opcode::AtomicFMaxEXT => AtomicKind::FMax,
        _ => return Ok(false),
    };
    let id = translator.id(instruction, 0)?;
    let ty = match opcode {
        Opcode::AtomicStore => translator.id(instruction, 3).and_then(|value| translator.type_of(value))?,
        _ => translator.result_type(instruction)?,
    };
    let pointer = pointer_to(translator, id, ty)?;
    let width = match *translator.module.ty(pointer.pointee) {
        Type::Int { width, .. } | Type::Float { width, encoding: None } => width,
        Type::Vector { component, count } => {
            check_f16_vector(translator, opcode, component, count)?;
            return vector_components(translator, instruction, kind, count, &pointer).map(|()| true);
        }
        _ => return Err(translator.invalid("an atomic instruction requires a scalar")),
    };
    if width == 8 {
        return Err(translator.invalid("an atomic instruction accesses an 8-bit value"));
    }
    // The pointer is followed by scope and semantics (two for a comparison), then by the operands.
    let none = translator.wide_constant(0)?;
    let (value, comparator) = match opcode {
        Opcode::AtomicLoad => (none, none),
        Opcode::AtomicIIncrement | Opcode::AtomicIDecrement => (translator.wide_constant(1)?, none),
        Opcode::AtomicCompareExchange => {
            (scalar(translator, instruction, 4, width)?, scalar(translator, instruction, 5, width)?)
        }
        _ => (scalar(translator, instruction, 3, width)?, none),
    };
    let target = atomic_target(translator, &pointer, width, 1)?;
    let alignment = alignment(translator, &pointer, width);
    let to = emit(
        translator,
        AtomicOp { kind, width, component: (0, 1), alignment, target, to: none, value, comparator },
    )?;
    let words = registers_from(to, width.div_ceil(32));
    translator.define_result(instruction, SmallVec::from_slice(&words));
    Ok(true)
}

/// Appends an operation with fresh registers for the old value, and returns the first of them.
fn emit(translator: &mut Translator<'_>, mut op: AtomicOp) -> Result<Reg> {
    op.to = translator.fresh(op.words())?;
    if let AtomicTarget::Registers { .. } = op.target {
        translator.invalidate_known_values();
    }
    let to = op.to;
    translator.emit(Operation::Atomic(Box::new(op)));
    Ok(to)
}

/// The bytes that the offset of a scalar must be a multiple of. Workgroup memory without a layout
/// of its own is an array of words, and one thread's.
fn alignment(translator: &Translator<'_>, pointer: &Pointer, width: u32) -> u32 {
    if pointer.is_packed(translator) { (width / 8).min(4) } else { width / 8 }
}

/// Rejects vectors that atomic instructions must not be used with.
fn check_f16_vector(
    translator: &Translator<'_>,
    opcode: Opcode,
    component: TypeId,
    count: u32,
) -> Result<()> {
    const FLOAT16_VECTOR: u32 = Capability::AtomicFloat16VectorNV as u32;
    const SECTION: &str = "(SPV_NV_shader_atomic_fp16_vector, Validation Rules)";
    let takes_vectors = matches!(
        opcode,
        Opcode::AtomicExchange | Opcode::AtomicFAddEXT | Opcode::AtomicFMinEXT | Opcode::AtomicFMaxEXT
    );
    let halves = matches!(*translator.module.ty(component), Type::Float { width: 16, encoding: None });
    if !(takes_vectors && halves && matches!(count, 2 | 4)) {
        return Err(translator.invalid(format!(
            "an atomic instruction accesses a vector; only additions, minima, maxima and exchanges support \
             vectors, of two or four 16-bit floats {SECTION}"
        )));
    }
    if !translator.module.capabilities.contains(&FLOAT16_VECTOR) {
        let message = format!(
            "an atomic instruction on a vector requires the capability AtomicFloat16VectorNV {SECTION}"
        );
        return Err(translator.invalid(message));
    }
    Ok(())
}

/// An operation for each component of a vector of f16.
fn vector_components(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    kind: AtomicKind,
    count: u32,
    pointer: &Pointer,
) -> Result<()> {
    let values = translator.operand(instruction, 3)?;
    if values.len() as u32 != count {
        return Err(
            translator.invalid("the operand of an atomic instruction differs in type from the memory")
        );
    }
    let none = translator.wide_constant(0)?;
    let stride = match pointer.base {
        PointerBase::Buffer(_) if pointer.is_packed(translator) => 4,
        PointerBase::Buffer(_) => pointer.layout.component_stride.unwrap_or(2),
        _ => 1,
    };
    let mut words = Words::new();
    for (component, &value) in values.iter().enumerate() {
        let component = component as u32;
        let mut part = pointer.clone();
        let offset = component.checked_mul(stride).and_then(|bytes| part.offset.checked_add(bytes));
        part.offset =
            offset.ok_or_else(|| translator.unsupported("an offset beyond 4 GiB is not supported"))?;
        let target = atomic_target(translator, &part, 16, count)?;
        let (component, alignment) = ((component, count), alignment(translator, pointer, 16));
        let (to, comparator) = (none, none);
        words.push(emit(
            translator,
            AtomicOp { kind, width: 16, component, alignment, target, to, value, comparator },
        )?);
    }
    translator.define_result(instruction, words);
    Ok(())
}

/// The first register of an operand that must be a scalar of a width.
fn scalar(translator: &mut Translator<'_>, instruction: &Instruction, at: usize, width: u32) -> Result<Reg> {
    let words = translator.operand(instruction, at)?;
    match words.first() {
        Some(&first) if words.len() as u32 == width.div_ceil(32) => Ok(first),
        _ => Err(translator.invalid("the operand of an atomic instruction differs in type from the memory")),
    }
}

fn atomic_target(
    translator: &mut Translator<'_>,
    pointer: &Pointer,
    width: u32,
    count: u32,
) -> Result<AtomicTarget> {
    match pointer.base {
        PointerBase::Texel(ref texel) if (width == 64) == texel.view.wide && width * count >= 32 => {
            Ok(AtomicTarget::Texel(texel.clone()))
        }
        PointerBase::Texel(_) => {
            Err(translator.invalid("an atomic instruction differs in width from its texel"))
        }
        PointerBase::Buffer(buffer) => {
            let (count, part) = if width == 64 { (2, 32) } else { (1, width) };
            let (offset, index) = (pointer.offset, pointer.index);
            Ok(AtomicTarget::Buffer(Chunk { buffer, offset, index, width: part, count, alignment: 1 }))
        }
        PointerBase::Registers { constant: true, .. } => {
            Err(translator.invalid("an atomic instruction accesses an input variable"))
        }
        PointerBase::Registers { first, .. } => {
            let first = first.plus(pointer.offset);
            if pointer.index.is_some() {
                translator.addressed.push((first, width.div_ceil(32)));
            }
            Ok(AtomicTarget::Registers { first, index: pointer.index })
        }
        PointerBase::ComputedRegisters => {
            Ok(AtomicTarget::Registers { first: pointer.pointed_registers(), index: pointer.index })
        }
        PointerBase::Descriptors { .. } | PointerBase::Heap(_) => {
            Err(translator.invalid("an atomic instruction accesses a descriptor"))
        }
    }
}
