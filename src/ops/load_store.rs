//! Loads and stores through pointers: moves between registers, gathers and scatters where a register is
//! computed, and stretches of scalars in buffers.

use smallvec::SmallVec;

use crate::error::Result;
use crate::machine::resource::STRUCTURE_HANDLE;
use crate::machine::{Bindings, Reg};
use crate::module::ty::{MatrixLayout, Type, TypeId};
use crate::ops::decode::{Decoder, Words, registers_from};
use crate::ops::memory::{self, BufferRef, Chunk};
use crate::ops::op::Op;
use crate::ops::pointer::{Place, Pointer, descriptor_count, shifted, storage};

/// Reads what a pointer leads to.
pub fn load(decoder: &mut Decoder<'_>, pointer: &Pointer) -> Result<Words> {
    load_aligned(decoder, pointer, 1)
}

/// The same for a device address that must be a multiple of `alignment`.
pub(super) fn load_aligned(decoder: &mut Decoder<'_>, pointer: &Pointer, alignment: u32) -> Result<Words> {
    let count = match pointer.place {
        Place::Descriptors { .. } => 1,
        _ => decoder.word_count(pointer.pointee)?,
    };
    match pointer.place {
        Place::Registers { first: variable, count: registers, constant } => {
            let first = variable.plus(pointer.offset);
            match pointer.index {
                None if constant => Ok(registers_from(first, count)),
                None => load_registers(decoder, first, count),
                Some(index) => {
                    decoder.addressed.push((variable, registers));
                    gather(decoder, first, index, count)
                }
            }
        }
        Place::ComputedRegisters => {
            let index = pointer.index.ok_or_else(|| decoder.invalid("a pointer without a value"))?;
            gather(decoder, pointer.pointed_registers(), index, count)
        }
        Place::Buffer(buffer) => {
            let scalars = scalars(decoder, pointer)?;
            let to = decoder.fresh(count)?;
            let mut register = to;
            for chunk in chunks(&scalars, buffer, pointer, alignment) {
                decoder.emit(Op::Memory(memory::Op::BufferLoad { to: register, chunk }));
                register = register.plus(chunk.count);
            }
            Ok(registers_from(to, count))
        }
        Place::Texel(_) => Err(decoder.invalid("a load through a pointer to a texel, which is for atomics")),
        Place::Descriptors { buffers: true, .. } => {
            Err(decoder.invalid("a load of a whole array of buffers"))
        }
        Place::Descriptors { first, array, .. } => {
            if let (true, &Type::Array { element, .. }) = (array, decoder.module.ty(pointer.pointee)) {
                let each = descriptor_count(decoder, element)?;
                let mut words = Words::new();
                for at in 0..descriptor_count(decoder, pointer.pointee)? / each {
                    let offset = pointer.offset + at * each;
                    let part = Pointer { pointee: element, offset, ..pointer.clone() };
                    words.extend(load(decoder, &part)?);
                }
                return Ok(words);
            }
            let base = decoder.constant(Bindings::element_handle(first, pointer.offset))?;
            let handle = shifted(decoder, pointer.index, base)?;
            match *decoder.module.ty(pointer.pointee) {
                // An image and a sampler, or a handle that stands for a device address.
                Type::SampledImage(_) => Ok(SmallVec::from_slice(&[handle, handle])),
                Type::AccelerationStructure => {
                    let high = decoder.constant(STRUCTURE_HANDLE)?;
                    let first = decoder.pair(handle, high)?;
                    Ok(SmallVec::from_slice(&[first, first.plus(1)]))
                }
                _ => Ok(SmallVec::from_slice(&[handle])),
            }
        }
    }
}

fn load_registers(decoder: &mut Decoder<'_>, first: Reg, count: u32) -> Result<Words> {
    let known: Option<Words> = (0..count).map(|word| decoder.recall(first.plus(word))).collect();
    if let Some(known) = known {
        return Ok(known);
    }
    let to = decoder.fresh_words(count)?;
    for (word, &to) in to.iter().enumerate() {
        let variable = first.plus(word as u32);
        decoder.emit(Op::Memory(memory::Op::Move { to, from: variable }));
        decoder.remember(variable, to);
    }
    Ok(to)
}

fn gather(decoder: &mut Decoder<'_>, first: Reg, index: Reg, count: u32) -> Result<Words> {
    let to = decoder.fresh(count)?;
    decoder.emit(Op::Memory(memory::Op::Gather { to, count, first, index }));
    Ok(registers_from(to, count))
}

/// Writes a value to where a pointer leads.
pub fn store(decoder: &mut Decoder<'_>, pointer: &Pointer, words: &[Reg]) -> Result<()> {
    store_aligned(decoder, pointer, words, 1)
}

/// The same for a device address that must be a multiple of `alignment`.
pub(super) fn store_aligned(
    decoder: &mut Decoder<'_>,
    pointer: &Pointer,
    words: &[Reg],
    alignment: u32,
) -> Result<()> {
    if matches!(
        pointer.storage_class,
        storage::INPUT | storage::PUSH_CONSTANT | storage::SHADER_RECORD_BUFFER | storage::UNIFORM_CONSTANT
    ) {
        let class = crate::module::names::storage_class_name(pointer.storage_class);
        return Err(decoder.invalid(format!("a store to {class}, which is read-only")));
    }
    match pointer.place {
        Place::Registers { constant: true, .. } => Err(decoder.invalid("a store to an input variable")),
        Place::Registers { first: variable, count: registers, .. } => {
            let first = variable.plus(pointer.offset);
            match pointer.index {
                None => {
                    for (word, &from) in words.iter().enumerate() {
                        let to = first.plus(word as u32);
                        decoder.emit(Op::Memory(memory::Op::MoveMasked { to, from }));
                        decoder.remember(to, from);
                    }
                }
                Some(index) => {
                    decoder.addressed.push((variable, registers));
                    scatter(decoder, first, index, words)?;
                }
            }
            Ok(())
        }
        Place::ComputedRegisters => {
            let index = pointer.index.ok_or_else(|| decoder.invalid("a pointer without a value"))?;
            scatter(decoder, pointer.pointed_registers(), index, words)
        }
        Place::Buffer(buffer) => {
            let scalars = scalars(decoder, pointer)?;
            let mut register = decoder.consecutive(words)?;
            for chunk in chunks(&scalars, buffer, pointer, alignment) {
                decoder.emit(Op::Memory(memory::Op::BufferStore { from: register, chunk }));
                register = register.plus(chunk.count);
            }
            Ok(())
        }
        Place::Descriptors { .. } => Err(decoder.invalid("a store to a descriptor")),
        Place::Texel(_) => Err(decoder.invalid("a store through a pointer to a texel, which is for atomics")),
    }
}

fn scatter(decoder: &mut Decoder<'_>, first: Reg, index: Reg, words: &[Reg]) -> Result<()> {
    let from = decoder.consecutive(words)?;
    let count = words.len() as u32;
    decoder.emit(Op::Memory(memory::Op::Scatter { from, count, first, index }));
    decoder.forget();
    Ok(())
}

/// Scalars of a buffer: byte offset and width.
type Scalars = SmallVec<[(u32, u32); 4]>;

/// The scalars of what a pointer leads to in a buffer; a 64-bit one is two.
fn scalars(decoder: &mut Decoder<'_>, pointer: &Pointer) -> Result<Scalars> {
    if pointer.is_packed(decoder) {
        let words = decoder.word_count(pointer.pointee)?;
        return Ok((0..words).map(|word| (pointer.offset + word * 4, 32)).collect());
    }
    let mut scalars = Scalars::new();
    let layout = (pointer.matrix, pointer.component_stride);
    collect(decoder, pointer.storage_class, pointer.pointee, pointer.offset, layout, &mut scalars)?;
    Ok(scalars)
}

fn collect(
    decoder: &mut Decoder<'_>,
    class: u32,
    ty: TypeId,
    offset: u32,
    (matrix, component_stride): (Option<MatrixLayout>, Option<u32>),
    scalars: &mut Scalars,
) -> Result<()> {
    let at = |decoder: &Decoder<'_>, index: u32, stride: u32| {
        let sum = index.checked_mul(stride).and_then(|bytes| offset.checked_add(bytes));
        sum.ok_or_else(|| decoder.unsupported("an offset beyond 4 GiB"))
    };
    match *decoder.module.ty(ty) {
        Type::Int { width: 64, .. } | Type::Float { width: 64, .. } => {
            scalars.extend([(offset, 32), (at(decoder, 1, 4)?, 32)]);
        }
        Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. } => {
            scalars.extend([(offset, 32), (at(decoder, 1, 4)?, 32)]);
        }
        Type::Int { width, .. } | Type::Float { width, .. } => scalars.push((offset, width)),
        Type::Vector { component, count } => {
            let stride = component_stride.unwrap_or(decoder.scalar_width(component)? / 8);
            for index in 0..count {
                collect(decoder, class, component, at(decoder, index, stride)?, (None, None), scalars)?;
            }
        }
        Type::Matrix { column, count } => {
            let Some(layout) = matrix else {
                return Err(decoder.not_laid_out(class, "a buffer's matrix has no MatrixStride decoration"));
            };
            let width = decoder.scalar_width(column)? / 8;
            let (stride, inner) =
                if layout.row_major { (width, Some(layout.stride)) } else { (layout.stride, None) };
            for index in 0..count {
                collect(decoder, class, column, at(decoder, index, stride)?, (None, inner), scalars)?;
            }
        }
        Type::Array { element, length, stride } => {
            let length = decoder.array_length(length)?;
            let stride = stride.ok_or_else(|| {
                decoder.not_laid_out(class, "a buffer's array has no ArrayStride decoration")
            })?;
            for index in 0..length {
                collect(decoder, class, element, at(decoder, index, stride)?, (matrix, None), scalars)?;
            }
        }
        Type::Struct { ref members, .. } => {
            for member in members {
                let inside = member.offset.ok_or_else(|| {
                    decoder.not_laid_out(class, "a buffer's struct has no Offset decoration")
                })?;
                collect(decoder, class, member.ty, at(decoder, 1, inside)?, (member.matrix, None), scalars)?;
            }
        }
        _ => {
            let name = decoder.module.describe_type(ty);
            return Err(decoder.unsupported(format!("{name} in a buffer")));
        }
    }
    Ok(())
}

/// Joins scalars that touch; the alignment holds for the pointer itself.
fn chunks(
    scalars: &[(u32, u32)],
    buffer: BufferRef,
    pointer: &Pointer,
    alignment: u32,
) -> SmallVec<[Chunk; 1]> {
    let mut chunks: SmallVec<[Chunk; 1]> = SmallVec::new();
    for &(offset, width) in scalars {
        match chunks.last_mut() {
            Some(last) if last.width == width && last.offset + last.count * (width / 8) == offset => {
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
