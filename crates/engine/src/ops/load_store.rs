//! Loads and stores through pointers: moves between registers, gathers and scatters where a
//! register is computed, and consecutive scalars in buffers.

use smallvec::SmallVec;

use crate::machine::Reg;
use crate::machine::device_memory::STRUCTURE_HANDLE;
use crate::module::ty::{Type, TypeId};
use crate::ops::heap::{self, HeapContent};
use crate::ops::memory::{self, BufferRef, Chunk};
use crate::ops::op::Op;
use crate::ops::pointer::{
    PointeeLayout, Pointer, PointerBase, beyond_4_gib, descriptor_count, element_handle, storage,
};
use crate::ops::translate::Translator;
use crate::ops::value_registers::{Words, registers_from};
use anyhit_base::error::Result;

/// Translates a load through a pointer.
pub fn load(translator: &mut Translator<'_>, pointer: &Pointer) -> Result<Words> {
    load_aligned(translator, pointer, 1)
}

/// As [`load`], for a device address that must be a multiple of `alignment`.
pub(super) fn load_aligned(
    translator: &mut Translator<'_>,
    pointer: &Pointer,
    alignment: u32,
) -> Result<Words> {
    let count = match pointer.base {
        PointerBase::Descriptors { .. } | PointerBase::Heap(_) => 1,
        _ => translator.word_count(pointer.pointee)?,
    };
    match pointer.base {
        PointerBase::Registers { first: variable, count: registers, constant } => {
            let first = variable.plus(pointer.offset);
            match pointer.index {
                None if constant => Ok(registers_from(first, count)),
                None => load_registers(translator, first, count),
                Some(index) => {
                    translator.addressed.push((variable, registers));
                    gather(translator, first, index, count)
                }
            }
        }
        PointerBase::ComputedRegisters => {
            let index = pointer.index.ok_or_else(|| translator.invalid("the pointer has no value"))?;
            gather(translator, pointer.pointed_registers(), index, count)
        }
        PointerBase::Buffer(buffer) => {
            let scalars = scalars(translator, pointer)?;
            let to = translator.fresh(count)?;
            let mut register = to;
            for chunk in chunks(&scalars, buffer, pointer, alignment) {
                translator.emit(Op::Memory(memory::MemoryOp::BufferLoad { to: register, chunk }));
                register = register.plus(chunk.count);
            }
            Ok(registers_from(to, count))
        }
        PointerBase::Texel(_) => {
            Err(translator.invalid("a load uses a pointer to a texel: only atomic instructions may use it"))
        }
        PointerBase::Descriptors { buffers: true, .. } => {
            Err(translator.invalid("a load reads a whole array of buffers"))
        }
        PointerBase::Heap(variable) => match heap::content(translator, variable, pointer)? {
            HeapContent::Descriptor(handle) => descriptor_value(translator, pointer.pointee, handle),
            HeapContent::Data(data) => load_aligned(translator, &data, alignment),
        },
        PointerBase::Descriptors { first, array, .. } => {
            if let (true, &Type::Array { element, .. }) = (array, translator.module.ty(pointer.pointee)) {
                // Before its words are listed: a binding may have more elements than that.
                translator.word_count(pointer.pointee)?;
                let each = descriptor_count(translator, element)?;
                let mut words = Words::new();
                for at in 0..descriptor_count(translator, pointer.pointee)? / each.max(1) {
                    let offset = at.checked_mul(each).and_then(|at| pointer.offset.checked_add(at));
                    let offset = offset.ok_or_else(|| translator.invalid("too many descriptors"))?;
                    let part = Pointer { pointee: element, offset, ..pointer.clone() };
                    words.extend(load(translator, &part)?);
                }
                return Ok(words);
            }
            let handle = element_handle(translator, first, pointer)?;
            descriptor_value(translator, pointer.pointee, handle)
        }
    }
}

/// The value of a descriptor of a type.
fn descriptor_value(translator: &mut Translator<'_>, ty: TypeId, handle: Reg) -> Result<Words> {
    match *translator.module.ty(ty) {
        // An image and a sampler, or a handle that stands for a device address.
        Type::SampledImage(_) => Ok(SmallVec::from_slice(&[handle, handle])),
        Type::AccelerationStructure => {
            let high = translator.constant(STRUCTURE_HANDLE)?;
            let first = translator.pair(handle, high)?;
            Ok(SmallVec::from_slice(&[first, first.plus(1)]))
        }
        Type::Buffer { .. } => Err(translator.invalid("a load reads the descriptor of a buffer")),
        _ => Ok(SmallVec::from_slice(&[handle])),
    }
}

fn load_registers(translator: &mut Translator<'_>, first: Reg, count: u32) -> Result<Words> {
    let known: Option<Words> = (0..count).map(|word| translator.known_value(first.plus(word))).collect();
    if let Some(known) = known {
        return Ok(known);
    }
    let to = translator.fresh_words(count)?;
    for (word, &to) in to.iter().enumerate() {
        let variable = first.plus(word as u32);
        translator.emit(Op::Memory(memory::MemoryOp::Move { to, from: variable }));
        translator.set_known_value(variable, to);
    }
    Ok(to)
}

fn gather(translator: &mut Translator<'_>, first: Reg, index: Reg, count: u32) -> Result<Words> {
    let to = translator.fresh(count)?;
    translator.emit(Op::Memory(memory::MemoryOp::Gather { to, count, first, index }));
    Ok(registers_from(to, count))
}

/// Translates a store through a pointer.
pub fn store(translator: &mut Translator<'_>, pointer: &Pointer, words: &[Reg]) -> Result<()> {
    store_aligned(translator, pointer, words, 1)
}

/// As [`store`], for a device address that must be a multiple of `alignment`.
pub(super) fn store_aligned(
    translator: &mut Translator<'_>,
    pointer: &Pointer,
    words: &[Reg],
    alignment: u32,
) -> Result<()> {
    if matches!(
        pointer.storage_class,
        storage::INPUT | storage::PUSH_CONSTANT | storage::SHADER_RECORD_BUFFER | storage::UNIFORM_CONSTANT
    ) {
        let class = crate::module::names::storage_class_name(pointer.storage_class);
        return Err(translator.invalid(format!("a store writes to {class}, which is read-only")));
    }
    match pointer.base {
        PointerBase::Registers { constant: true, .. } => {
            Err(translator.invalid("a store writes to an input variable"))
        }
        PointerBase::Registers { first: variable, count: registers, .. } => {
            let first = variable.plus(pointer.offset);
            match pointer.index {
                None => {
                    for (word, &from) in words.iter().enumerate() {
                        let to = first.plus(word as u32);
                        translator.emit(Op::Memory(memory::MemoryOp::MoveMasked { to, from }));
                        translator.set_known_value(to, from);
                    }
                }
                Some(index) => {
                    translator.addressed.push((variable, registers));
                    scatter(translator, first, index, words)?;
                }
            }
            Ok(())
        }
        PointerBase::ComputedRegisters => {
            let index = pointer.index.ok_or_else(|| translator.invalid("the pointer has no value"))?;
            scatter(translator, pointer.pointed_registers(), index, words)
        }
        PointerBase::Buffer(buffer) => {
            let scalars = scalars(translator, pointer)?;
            let mut register = translator.consecutive(words)?;
            for chunk in chunks(&scalars, buffer, pointer, alignment) {
                translator.emit(Op::Memory(memory::MemoryOp::BufferStore { from: register, chunk }));
                register = register.plus(chunk.count);
            }
            Ok(())
        }
        PointerBase::Descriptors { .. } | PointerBase::Heap(_) => {
            Err(translator.invalid("a store writes to a descriptor"))
        }
        PointerBase::Texel(_) => {
            Err(translator.invalid("a store uses a pointer to a texel: only atomic instructions may use it"))
        }
    }
}

fn scatter(translator: &mut Translator<'_>, first: Reg, index: Reg, words: &[Reg]) -> Result<()> {
    let from = translator.consecutive(words)?;
    let count = words.len() as u32;
    translator.emit(Op::Memory(memory::MemoryOp::Scatter { from, count, first, index }));
    translator.invalidate_known_values();
    Ok(())
}

/// Scalars of a buffer: byte offset and width.
type Scalars = SmallVec<[(u32, u32); 4]>;

/// The scalars of the pointee of a pointer into a buffer; a 64-bit scalar counts as two.
fn scalars(translator: &mut Translator<'_>, pointer: &Pointer) -> Result<Scalars> {
    if pointer.is_packed(translator) {
        let words = translator.word_count(pointer.pointee)?;
        let end = words.checked_mul(4).and_then(|bytes| pointer.offset.checked_add(bytes));
        end.ok_or_else(|| beyond_4_gib(translator))?;
        return Ok((0..words).map(|word| (pointer.offset + word * 4, 32)).collect());
    }
    let mut scalars = Scalars::new();
    collect_scalars(
        translator,
        pointer.storage_class,
        pointer.pointee,
        pointer.offset,
        pointer.layout,
        &mut scalars,
    )?;
    Ok(scalars)
}

fn collect_scalars(
    translator: &mut Translator<'_>,
    class: u32,
    ty: TypeId,
    offset: u32,
    layout: PointeeLayout,
    scalars: &mut Scalars,
) -> Result<()> {
    let at = |translator: &Translator<'_>, index: u32, stride: u32| {
        let sum = index.checked_mul(stride).and_then(|bytes| offset.checked_add(bytes));
        sum.ok_or_else(|| beyond_4_gib(translator))
    };
    // Parts without scalars are not walked: a few of them nest to any number.
    if translator.word_count(ty)? == 0 {
        return Ok(());
    }
    match *translator.module.ty(ty) {
        Type::Int { width: 64, .. } | Type::Float { width: 64, .. } => {
            scalars.extend([(offset, 32), (at(translator, 1, 4)?, 32)]);
        }
        Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. } => {
            scalars.extend([(offset, 32), (at(translator, 1, 4)?, 32)]);
        }
        Type::Int { width, .. } | Type::Float { width, .. } => scalars.push((offset, width)),
        Type::Vector { component, count } => {
            let stride = layout.component_stride.unwrap_or(translator.scalar_width(component)? / 8);
            for index in 0..count {
                collect_scalars(
                    translator,
                    class,
                    component,
                    at(translator, index, stride)?,
                    PointeeLayout::default(),
                    scalars,
                )?;
            }
        }
        Type::Matrix { column, count } => {
            let Some(matrix) = layout.matrix else {
                return Err(
                    translator.missing_layout(class, "a buffer's matrix has no MatrixStride decoration")
                );
            };
            let width = translator.scalar_width(column)? / 8;
            let (stride, component_stride) =
                if matrix.row_major { (width, Some(matrix.stride)) } else { (matrix.stride, None) };
            for index in 0..count {
                collect_scalars(
                    translator,
                    class,
                    column,
                    at(translator, index, stride)?,
                    PointeeLayout { matrix: None, component_stride },
                    scalars,
                )?;
            }
        }
        Type::Array { element, length, stride } => {
            let length = translator.array_length(length)?;
            let stride = stride.ok_or_else(|| {
                translator.missing_layout(class, "a buffer's array has no ArrayStride decoration")
            })?;
            for index in 0..length {
                collect_scalars(
                    translator,
                    class,
                    element,
                    at(translator, index, stride)?,
                    PointeeLayout::of_matrix(layout.matrix),
                    scalars,
                )?;
            }
        }
        Type::Struct { ref members, .. } => {
            for member in members {
                let inside = member.offset.ok_or_else(|| {
                    translator.missing_layout(class, "a buffer's struct has no Offset decoration")
                })?;
                collect_scalars(
                    translator,
                    class,
                    member.ty,
                    at(translator, 1, inside)?,
                    PointeeLayout::of_matrix(member.matrix),
                    scalars,
                )?;
            }
        }
        _ => {
            let name = translator.module.describe_type(ty);
            return Err(translator.unsupported(format!("{name} in a buffer is not supported")));
        }
    }
    Ok(())
}

/// Joins adjacent scalars of one width to chunks; the alignment is that of the pointer itself.
fn chunks(
    scalars: &[(u32, u32)],
    buffer: BufferRef,
    pointer: &Pointer,
    alignment: u32,
) -> SmallVec<[Chunk; 1]> {
    let mut chunks: SmallVec<[Chunk; 1]> = SmallVec::new();
    for &(offset, width) in scalars {
        match chunks.last_mut() {
            Some(last)
                if last.width == width
                    && last.count.checked_mul(width / 8).and_then(|size| last.offset.checked_add(size))
                        == Some(offset) =>
            {
                last.count += 1;
            }
            _ => {
                let alignment = if offset == pointer.offset { alignment } else { 1 };
                chunks.push(Chunk { buffer, offset, index: pointer.index, width, count: 1, alignment });
            }
        }
    }
    chunks
}
