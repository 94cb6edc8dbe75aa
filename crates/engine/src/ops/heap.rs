//! Descriptor heaps (`SPV_EXT_descriptor_heap`): pointers to descriptors and to data that lie in
//! the memory of a heap.
//!
//! A pointer into a heap counts bytes. Where it is used, its type says what lies there: a
//! descriptor, which is an element of a slot of its own, [`DESCRIPTOR_BYTES`] from the next one, or
//! data, which are a buffer.

use crate::machine::{Binding, Bindings, Reg};
use crate::module::heap::{ByteCount, DESCRIPTOR_BYTES, Heap};
use crate::module::names::storage_class_name;
use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Instruction, Opcode};
use crate::ops::heap_descriptor::{HEAP_BYTES, HeapDescriptor};
use crate::ops::memory::BufferRef;
use crate::ops::op::Op;
use crate::ops::pointer::{Pointer, PointerBase, add_slot, buffer_of_handle};
use crate::ops::translate::{IdValue, Slot, Translator};
use anyhit_base::error::Result;

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[Opcode::BufferPointerEXT];

/// Translates the instructions of this file; `false` for any other.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    match instruction.opcode {
        Opcode::BufferPointerEXT => buffer_pointer(translator, instruction)?,
        _ => return Ok(false),
    }
    Ok(true)
}

/// The pointer to the first byte of a heap, which a variable without a type of data is.
pub fn variable(translator: &Translator<'_>, index: u32) -> Result<Pointer> {
    let variable = &translator.module.variables[index as usize];
    match translator.module.heap(variable) {
        Some(_) => Ok(Pointer::new(PointerBase::Heap(index), variable.pointer, variable.storage_class)),
        None => Err(translator.invalid(format!("variable %{} has no type of data", variable.id.0))),
    }
}

/// What stands for the descriptors of a heap among the bindings.
pub fn binding(heap: Heap) -> Binding {
    match heap {
        Heap::Resources => Binding::RESOURCE_HEAP,
        Heap::Samplers => Binding::SAMPLER_HEAP,
    }
}

/// The handle of the first descriptor, or of the data, of the heap that a variable is. Its slot is
/// allocated on first use.
fn slot(translator: &mut Translator<'_>, variable: u32, is_data: bool) -> Result<u32> {
    let variable = &translator.module.variables[variable as usize];
    let Some(heap) = translator.module.heap(variable) else {
        return Err(translator.invalid(format!("%{} is not a heap", variable.id.0)));
    };
    let binding = if is_data { binding(heap).heap_data() } else { binding(heap) };
    let id = variable.id;
    match handle_in(&translator.slots, id, binding) {
        Some(handle) => Ok(handle),
        None => {
            let name = translator.module.name(id).unwrap_or(heap.variable_name()).to_owned();
            add_slot(translator, binding, name, id)
        }
    }
}

/// The handle of the first descriptor that a variable finds at a binding, by the slots of a
/// program.
pub fn handle_in(slots: &[Slot], variable: Id, binding: Binding) -> Option<u32> {
    let slot = slots.iter().position(|slot| slot.variable == variable && slot.binding == binding)?;
    Some(Bindings::handle(slot as u32, 0))
}

fn bytes(translator: &mut Translator<'_>, count: ByteCount) -> Result<u32> {
    match count {
        ByteCount::Literal(bytes) => Ok(bytes),
        ByteCount::Constant(id) => Ok(u32::try_from(translator.constant_integer(id)?).unwrap_or(u32::MAX)),
    }
}

/// The bytes from one element of an array in a heap to the next.
pub fn array_stride(translator: &mut Translator<'_>, array: TypeId) -> Result<Option<u32>> {
    let stride = translator.module.heap_stride(array);
    stride.map(|stride| bytes(translator, stride)).transpose()
}

/// The bytes in front of a member of a struct in a heap.
pub fn member_offset(translator: &mut Translator<'_>, ty: TypeId, member: usize) -> Result<Option<u32>> {
    let offset = translator.module.heap_offset(ty, member as u32);
    offset.map(|offset| bytes(translator, offset)).transpose()
}

/// What lies where a pointer into a heap points.
#[derive(Clone, Debug)]
pub enum HeapContent {
    /// A descriptor: its handle.
    Descriptor(Reg),
    /// Data: the pointer to them.
    Data(Pointer),
}

/// What lies where a pointer into the heap that a variable is points, by its type.
pub fn content(translator: &mut Translator<'_>, variable: u32, pointer: &Pointer) -> Result<HeapContent> {
    match translator.module.ty(pointer.pointee) {
        ty if ty.is_descriptor() => handle(translator, variable, pointer).map(HeapContent::Descriptor),
        Type::SampledImage(_) => {
            let error = translator.invalid("a heap has no combined image samplers");
            Err(error.note("SPV_EXT_descriptor_heap, Descriptor"))
        }
        Type::Pointer { pointee: None, .. } => {
            Err(translator.unsupported("a pointer into a heap as a value is not supported"))
        }
        _ => {
            let data = BufferRef::Handle(slot(translator, variable, true)?);
            Ok(HeapContent::Data(Pointer { base: PointerBase::Buffer(data), ..pointer.clone() }))
        }
    }
}

fn handle(translator: &mut Translator<'_>, variable: u32, pointer: &Pointer) -> Result<Reg> {
    let first = slot(translator, variable, false)?;
    let (offset, size) = (pointer.offset, DESCRIPTOR_BYTES);
    let Some(index) = pointer.index else {
        if !offset.is_multiple_of(size) {
            let message = format!("a descriptor lies at byte {offset} of its heap, no multiple of {size}");
            return Err(translator.invalid(message).note("the alignment of a descriptor"));
        }
        // No descriptor has the handle of one outside.
        let is_inside = offset < HEAP_BYTES;
        return translator.constant(match is_inside {
            true => Bindings::element_handle(first, offset / size),
            false => u32::MAX,
        });
    };
    let to = translator.fresh(1)?;
    translator.emit(Op::HeapDescriptor(HeapDescriptor { to, first, offset, index }));
    Ok(to)
}

/// `OpBufferPointerEXT`: a pointer to the bytes of the buffer that a descriptor names.
fn buffer_pointer(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let ty = translator.result_type(instruction)?;
    let Type::Pointer { storage_class, pointee, .. } = *translator.module.ty(ty) else {
        return Err(translator.invalid("the result of OpBufferPointerEXT must be a pointer"));
    };
    let id = translator.id(instruction, 0)?;
    let descriptor = translator.pointer(id)?;
    match *translator.module.ty(descriptor.pointee) {
        Type::Buffer { storage_class: declared } if declared != storage_class => {
            let [found, declared] = [storage_class, declared].map(storage_class_name);
            let message = format!("a pointer in {found} is made to a buffer in {declared}");
            let error = translator.invalid(message);
            return Err(error.note("SPV_EXT_descriptor_heap, OpTypeBufferEXT, Storage Class"));
        }
        // A pointer that a function is given does not say what it points to.
        Type::Buffer { .. } | Type::Pointer { .. } => {}
        _ => {
            let name = translator.module.describe_type(descriptor.pointee);
            return Err(translator.invalid(format!("%{} points to {name} instead of a buffer", id.0)));
        }
    }
    let handle = match descriptor.base {
        PointerBase::Heap(variable) => handle(translator, variable, &descriptor)?,
        PointerBase::Descriptors { first: 0, buffers: false, .. } => {
            descriptor.index.ok_or_else(|| translator.invalid("the pointer has no value"))?
        }
        _ => return Err(translator.invalid(format!("%{} does not point into a heap", id.0))),
    };
    let buffer = buffer_of_handle(translator, handle);
    let pointer = Pointer::new(PointerBase::Buffer(buffer), pointee.unwrap_or(ty), storage_class);
    if let Some(id) = instruction.result {
        translator.define(id, IdValue::Pointer(pointer.into()));
    }
    Ok(())
}
