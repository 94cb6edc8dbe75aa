//! Pointers while a function is lowered: what they point to is mostly known statically.

use smallvec::SmallVec;

use crate::machine::resource::{ELEMENT_BITS, MAX_SLOTS};
use crate::machine::{Binding, Bindings, REGISTER_POINTER, Reg};
use crate::module::decoration::number;
use crate::module::ty::{MatrixLayout, Type, TypeId};
use crate::module::{Id, Instruction, Opcode};
use crate::ops::heap::{self, HeapContent};
use crate::ops::image::texel_ref::TexelRef;
use crate::ops::integer_operand::ReadAs;
use crate::ops::load_store::{load, load_aligned, store, store_aligned};
use crate::ops::memory::{self, BufferRef, Length};
use crate::ops::object::check_copyable;
use crate::ops::op::Op;
use crate::ops::translate::budget::WORDS_OF_A_STEP;
use crate::ops::translate::{InputRegisters, InterfaceRegisters, Slot, Translator, WorkgroupVariable};
use crate::ops::untyped_pointer::{chain_base, is_untyped, pointer_to};
use crate::ops::value_registers::Words;
use crate::ops::{address, builtin};
use anyhit_base::error::{Error, Result};

/// Storage classes, numbers of the specification.
#[allow(missing_docs, reason = "the names are the specification's")]
pub mod storage {
    pub const UNIFORM_CONSTANT: u32 = 0;
    pub const INPUT: u32 = 1;
    pub const UNIFORM: u32 = 2;
    pub const OUTPUT: u32 = 3;
    pub const WORKGROUP: u32 = 4;
    pub const PRIVATE: u32 = 6;
    pub const FUNCTION: u32 = 7;
    pub const PUSH_CONSTANT: u32 = 9;
    pub const STORAGE_BUFFER: u32 = 12;
    pub const CALLABLE_DATA: u32 = 5328;
    pub const INCOMING_CALLABLE_DATA: u32 = 5329;
    pub const RAY_PAYLOAD: u32 = 5338;
    pub const HIT_ATTRIBUTE: u32 = 5339;
    pub const INCOMING_RAY_PAYLOAD: u32 = 5342;
    pub const SHADER_RECORD_BUFFER: u32 = 5343;
    pub const PHYSICAL_STORAGE_BUFFER: u32 = 5349;
    pub const HIT_OBJECT_ATTRIBUTE_NV: u32 = 5385;
    pub const HIT_OBJECT_ATTRIBUTE_EXT: u32 = 5411;
}

/// The base of a pointer.
#[derive(Clone, Debug, PartialEq)]
pub enum PointerBase {
    /// Registers of the register file, from a known one on.
    Registers {
        /// The variable's first register.
        first: Reg,
        /// How many registers the variable has.
        count: u32,
        /// Whether they are never written while the shader runs.
        constant: bool,
    },
    /// Registers of the register file; the pointer's index is the register's number with
    /// [`REGISTER_POINTER`].
    ComputedRegisters,
    /// Bytes of a buffer.
    Buffer(BufferRef),
    /// Descriptors of a slot; the offset counts array elements.
    Descriptors {
        /// The handle of the first one; 0 where the pointer's index is a handle.
        first: u32,
        /// Whether the binding is an array.
        array: bool,
        /// Whether the descriptors are buffers, whose contents further indices reach.
        buffers: bool,
    },
    /// Bytes of the descriptor heap that a variable of the module is.
    Heap(u32),
    /// A texel, for atomic instructions only.
    Texel(Box<TexelRef>),
}

/// A pointer: a base and an offset.
#[derive(Clone, Debug, PartialEq)]
pub struct Pointer {
    /// The base.
    pub base: PointerBase,
    /// What it points to.
    pub pointee: TypeId,
    /// Its storage class.
    pub storage_class: u32,
    /// The constant part of the offset: words in registers, bytes in buffers, elements in
    /// descriptors.
    pub offset: u32,
    /// The computed part of the offset.
    pub index: Option<Reg>,
    /// How the pointee lies in a buffer, as far as its type does not say it.
    pub layout: PointeeLayout,
}

/// How a pointee lies in a buffer, as far as its type does not say it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PointeeLayout {
    /// The layout of matrices in the pointee.
    pub matrix: Option<MatrixLayout>,
    /// The byte stride of the components of the vector pointed to, if they are not adjacent.
    pub component_stride: Option<u32>,
}

impl PointeeLayout {
    /// The layout of a pointee that is a matrix, or that holds matrices, with a layout; `None` for
    /// other pointees.
    pub fn of_matrix(matrix: Option<MatrixLayout>) -> Self {
        Self { matrix, component_stride: None }
    }
}

impl Pointer {
    /// A pointer to the start of a base.
    pub fn new(base: PointerBase, pointee: TypeId, storage_class: u32) -> Self {
        let (offset, index, layout) = (0, None, PointeeLayout::default());
        Self { base, pointee, storage_class, offset, index, layout }
    }

    /// The register from which the index of [`PointerBase::ComputedRegisters`] counts.
    pub fn pointed_registers(&self) -> Reg {
        Reg(REGISTER_POINTER.wrapping_add(self.offset))
    }

    /// Whether it points into memory without a layout of its own, where each scalar takes as many
    /// words as in registers: workgroup memory, unless its variables are blocks
    /// (`WorkgroupMemoryExplicitLayoutKHR`).
    pub fn is_packed(&self, translator: &Translator<'_>) -> bool {
        self.storage_class == storage::WORKGROUP && !translator.workgroup_blocks
    }
}

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::Load,
    Opcode::Store,
    Opcode::CopyMemory,
    Opcode::AccessChain,
    Opcode::InBoundsAccessChain,
    Opcode::UntypedAccessChainKHR,
    Opcode::UntypedInBoundsAccessChainKHR,
    Opcode::ArrayLength,
    Opcode::UntypedArrayLengthKHR,
];

/// Storage classes whose variables have a base.
pub const STORAGE_CLASSES: &[u32] = &[
    storage::UNIFORM_CONSTANT,
    storage::INPUT,
    storage::UNIFORM,
    storage::WORKGROUP,
    storage::PRIVATE,
    storage::FUNCTION,
    storage::PUSH_CONSTANT,
    storage::STORAGE_BUFFER,
    storage::CALLABLE_DATA,
    storage::INCOMING_CALLABLE_DATA,
    storage::RAY_PAYLOAD,
    storage::HIT_ATTRIBUTE,
    storage::INCOMING_RAY_PAYLOAD,
    storage::SHADER_RECORD_BUFFER,
    storage::PHYSICAL_STORAGE_BUFFER,
    storage::HIT_OBJECT_ATTRIBUTE_NV,
    storage::HIT_OBJECT_ATTRIBUTE_EXT,
];

/// The number of words of a pointer as a value.
pub fn pointer_word_count(storage_class: u32) -> u32 {
    match storage_class {
        storage::UNIFORM
        | storage::STORAGE_BUFFER
        | storage::WORKGROUP
        | storage::PUSH_CONSTANT
        | storage::SHADER_RECORD_BUFFER => 2,
        storage::PHYSICAL_STORAGE_BUFFER => 2,
        _ => 1,
    }
}

/// The pointer to a variable at module scope; its registers or slot are allocated on first use.
pub fn variable(translator: &mut Translator<'_>, index: u32) -> Result<Pointer> {
    let variable = translator.module.variables[index as usize].clone();
    let id = variable.id;
    let Some(pointee) = variable.ty else { return heap::variable(translator, index) };
    let pointer = |base| Pointer::new(base, pointee, variable.storage_class);
    match variable.storage_class {
        storage::INPUT => {
            let number = translator.module.decorations.literal(id, number::BUILT_IN);
            let Some(number) = number else {
                return Err(user_defined_input(translator, id, pointee));
            };
            let builtin = builtin::find(number).ok_or_else(|| {
                translator.unsupported(format!(
                    "the builtin {} is not supported",
                    crate::module::names::builtin_name(number)
                ))
            })?;
            let count = translator.word_count(pointee)?;
            let first = translator.fresh(count)?;
            translator.inputs.push(InputRegisters { builtin, first, count });
            Ok(pointer(PointerBase::Registers { first, count, constant: !builtin.volatile }))
        }
        storage::PRIVATE
        | storage::CALLABLE_DATA
        | storage::INCOMING_CALLABLE_DATA
        | storage::RAY_PAYLOAD
        | storage::HIT_ATTRIBUTE
        | storage::INCOMING_RAY_PAYLOAD
        | storage::HIT_OBJECT_ATTRIBUTE_NV
        | storage::HIT_OBJECT_ATTRIBUTE_EXT => {
            let count = translator.word_count(pointee)?;
            let first = translator.fresh(count)?;
            let scalar_fingerprint = match variable.storage_class {
                storage::CALLABLE_DATA
                | storage::INCOMING_CALLABLE_DATA
                | storage::RAY_PAYLOAD
                | storage::INCOMING_RAY_PAYLOAD => translator.scalar_fingerprint(pointee)?,
                _ => 0,
            };
            let registers = InterfaceRegisters {
                variable: id,
                storage_class: variable.storage_class,
                ty: pointee,
                first,
                count,
                scalar_fingerprint,
            };
            translator.interface.push(registers);
            translator.variables.push((first, count));
            Ok(pointer(PointerBase::Registers { first, count, constant: false }))
        }
        storage::WORKGROUP => {
            let bytes = translator.allocate_workgroup(&variable, pointee)?;
            let offset = bytes.start;
            translator.workgroup_variables.push(WorkgroupVariable {
                id,
                bytes,
                is_initialized: variable.initializer.is_some(),
                is_block: translator.workgroup_blocks,
            });
            Ok(Pointer { offset, ..pointer(PointerBase::Buffer(BufferRef::Workgroup)) })
        }
        storage::PUSH_CONSTANT => {
            let offset = translator.module.offset_in_bank(id);
            Ok(Pointer { offset, ..pointer(PointerBase::Buffer(BufferRef::PushConstants)) })
        }
        storage::SHADER_RECORD_BUFFER => Ok(pointer(PointerBase::Buffer(BufferRef::ShaderRecord))),
        storage::UNIFORM_CONSTANT | storage::UNIFORM | storage::STORAGE_BUFFER => {
            let decorations = &translator.module.decorations;
            let (Some(set), Some(binding)) =
                (decorations.literal(id, number::DESCRIPTOR_SET), decorations.literal(id, number::BINDING))
            else {
                return Err(translator.invalid(format!(
                    "variable %{} has no DescriptorSet and Binding (VUID-StandaloneSpirv-UniformConstant-06677)",
                    id.0
                )));
            };
            // A block without an instance name is named after its type.
            let block = || translator.module.name(translator.module.id_of_type(pointee)?);
            let name = translator.module.name(id).or_else(block).unwrap_or_default().to_string();
            let first = add_slot(translator, Binding { set, binding }, name, id)?;
            let array =
                matches!(translator.module.ty(pointee), Type::Array { .. } | Type::RuntimeArray { .. });
            let buffers = variable.storage_class != storage::UNIFORM_CONSTANT;
            Ok(match (buffers, array) {
                (true, false) => {
                    let offset = translator.module.offset_in_bank(id);
                    Pointer { offset, ..pointer(PointerBase::Buffer(BufferRef::Handle(first))) }
                }
                _ => pointer(PointerBase::Descriptors { first, array, buffers }),
            })
        }
        other => {
            let name = crate::module::names::storage_class_name(other);
            Err(translator.unsupported(format!("variables of storage class {name} are not supported")))
        }
    }
}

/// Adds a slot for the descriptors of a variable; returns the handle of the first of them.
pub(super) fn add_slot(
    translator: &mut Translator<'_>,
    binding: Binding,
    name: String,
    variable: Id,
) -> Result<u32> {
    let slot = translator.slots.len() as u32;
    if translator.slots.len() == MAX_SLOTS {
        return Err(
            translator.unsupported(format!("more than {MAX_SLOTS} descriptor bindings are not supported"))
        );
    }
    translator.slots.push(Slot { binding, name, variable });
    Ok(Bindings::handle(slot, 0))
}

/// The error of an input variable that is no builtin: no stage precedes those that run here.
fn user_defined_input(translator: &Translator<'_>, id: Id, pointee: TypeId) -> Error {
    let message = format!("input variable %{} is not a builtin", id.0);
    let members = matches!(translator.module.ty(pointee), Type::Struct { .. });
    if members || translator.module.decorations.find(id, number::LOCATION).is_some() {
        return translator.unsupported(message);
    }
    translator.invalid(message + ", and has no Location").note("VUID-StandaloneSpirv-Location-04916")
}

/// A pointer as the words of a value, for phis, selects and calls. The null pointer is all zeros,
/// as is the initial value of a variable; no other pointer is.
pub fn pointer_words(translator: &mut Translator<'_>, pointer: &Pointer) -> Result<Words> {
    match pointer.base {
        PointerBase::Registers { first, count, .. } => {
            translator.addressed.push((first, count));
            translator.invalidate_known_values();
            let base = first.0.checked_add(pointer.offset).filter(|&at| at < REGISTER_POINTER);
            let base = base.ok_or_else(|| beyond_4_gib(translator))?;
            let base = translator.constant(REGISTER_POINTER + base)?;
            Ok(SmallVec::from_slice(&[add_offset(translator, pointer.index, base)?]))
        }
        PointerBase::ComputedRegisters => {
            let base = translator.constant(pointer.offset)?;
            Ok(SmallVec::from_slice(&[add_offset(translator, pointer.index, base)?]))
        }
        PointerBase::Buffer(buffer) => {
            let handle = match buffer {
                BufferRef::Handle(handle) => translator.constant(handle)?,
                BufferRef::Computed(reg) => reg,
                BufferRef::PushConstants => translator.constant(memory::PUSH_CONSTANTS_HANDLE)?,
                BufferRef::ShaderRecord => translator.constant(memory::SHADER_RECORD_HANDLE)?,
                BufferRef::Workgroup => translator.constant(memory::WORKGROUP_HANDLE)?,
                BufferRef::Address(base) => {
                    let first = address::address(translator, pointer, base)?;
                    return Ok(SmallVec::from_slice(&[first, first.plus(1)]));
                }
            };
            let base = translator.constant(pointer.offset)?;
            Ok(SmallVec::from_slice(&[handle, add_offset(translator, pointer.index, base)?]))
        }
        PointerBase::Heap(variable) => match heap::content(translator, variable, pointer)? {
            HeapContent::Descriptor(handle) => Ok(SmallVec::from_slice(&[handle])),
            HeapContent::Data(_) => {
                Err(translator.unsupported("a pointer into a heap as a value is not supported"))
            }
        },
        PointerBase::Descriptors { first, buffers, .. } => {
            let handle = element_handle(translator, first, pointer)?;
            if !buffers {
                return Ok(SmallVec::from_slice(&[handle]));
            }
            let offset = translator.constant(0)?;
            Ok(SmallVec::from_slice(&[handle, offset]))
        }
        PointerBase::Texel(_) => {
            Err(translator.unsupported("a pointer to a texel as a value is not supported"))
        }
    }
}

/// The pointer that the words of [`pointer_words`] represent.
pub fn pointer_from_words(translator: &mut Translator<'_>, ty: TypeId, words: &[Reg]) -> Result<Pointer> {
    let Type::Pointer { storage_class, pointee, .. } = *translator.module.ty(ty) else {
        return Err(translator.invalid("the operand must be a pointer"));
    };
    // Instructions that use an untyped pointer give it the type of the access.
    let pointee = pointee.unwrap_or(ty);
    let (base, index) = match (storage_class, words) {
        (storage::PHYSICAL_STORAGE_BUFFER, &[low, high]) => {
            (PointerBase::Buffer(BufferRef::Address(translator.pair(low, high)?)), None)
        }
        (storage::UNIFORM | storage::STORAGE_BUFFER, &[handle, _])
            if is_buffer_array(translator, pointee) =>
        {
            (PointerBase::Descriptors { first: 0, array: true, buffers: true }, Some(handle))
        }
        (
            storage::UNIFORM
            | storage::STORAGE_BUFFER
            | storage::WORKGROUP
            | storage::PUSH_CONSTANT
            | storage::SHADER_RECORD_BUFFER,
            &[handle, offset],
        ) => (PointerBase::Buffer(BufferRef::Computed(handle)), Some(offset)),
        (storage::UNIFORM_CONSTANT, &[handle]) => {
            let array =
                matches!(translator.module.ty(pointee), Type::Array { .. } | Type::RuntimeArray { .. });
            (PointerBase::Descriptors { first: 0, array, buffers: false }, Some(handle))
        }
        (storage::PRIVATE | storage::FUNCTION | storage::INPUT, &[register]) => {
            (PointerBase::ComputedRegisters, Some(register))
        }
        (5328.., &[register]) if storage_class != storage::PHYSICAL_STORAGE_BUFFER => {
            (PointerBase::ComputedRegisters, Some(register))
        }
        _ => {
            let name = crate::module::names::storage_class_name(storage_class);
            return Err(translator.unsupported(format!("pointers to {name} as values are not supported")));
        }
    };
    Ok(Pointer { index, ..Pointer::new(base, pointee, storage_class) })
}

/// Whether a type is an array of blocks, each in a buffer of its own.
fn is_buffer_array(translator: &Translator<'_>, mut ty: TypeId) -> bool {
    let mut array = false;
    while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = *translator.module.ty(ty) {
        (ty, array) = (element, true);
    }
    array && matches!(translator.module.ty(ty), Type::Struct { block: true, .. })
}

/// The number of descriptors of a binding's type; arrays of arrays are flattened.
pub fn descriptor_count(translator: &mut Translator<'_>, mut ty: TypeId) -> Result<u32> {
    let mut count = 1u32;
    while let Type::Array { element, length, .. } = *translator.module.ty(ty) {
        let length = translator.array_length(length)?;
        count = count.checked_mul(length).ok_or_else(|| translator.invalid("too many descriptors"))?;
        ty = element;
    }
    Ok(count)
}

/// The sum of a computed offset and a constant one.
pub fn add_offset(translator: &mut Translator<'_>, index: Option<Reg>, base: Reg) -> Result<Reg> {
    let Some(index) = index else { return Ok(base) };
    if translator.constant_word(base) == Some(0) {
        return Ok(index);
    }
    // Saturating, so that an offset that is out of bounds stays out of bounds.
    let to = translator.fresh(1)?;
    let one = translator.constant(1)?;
    let scale = translator.constant_word(base).unwrap_or(0);
    translator.emit(Op::Memory(memory::MemoryOp::Index {
        to,
        base: Some(index),
        index: one,
        stride: scale,
        length: Length::Unknown,
    }));
    Ok(to)
}

/// `OpAccessChain` and similar instructions: the pointer that indices lead to.
pub fn access_chain(
    translator: &mut Translator<'_>,
    mut pointer: Pointer,
    indices: &[u32],
) -> Result<Pointer> {
    for &index in indices {
        pointer = access_chain_step(translator, pointer, crate::module::Id(index))?;
    }
    Ok(pointer)
}

fn access_chain_step(
    translator: &mut Translator<'_>,
    mut pointer: Pointer,
    index: crate::module::Id,
) -> Result<Pointer> {
    let packed = pointer.is_packed(translator);
    let in_buffer = matches!(pointer.base, PointerBase::Buffer(_) | PointerBase::Heap(_)) && !packed;
    match *translator.module.ty(pointer.pointee) {
        Type::Struct { ref members, .. } => {
            let at = translator.constant_integer(index)? as usize;
            let Some(member) = members.get(at) else {
                return Err(translator.invalid(format!(
                    "an access chain uses member {at} of a struct that has {}",
                    members.len()
                )));
            };
            if in_buffer {
                let offset = match pointer.base {
                    PointerBase::Heap(_) => heap::member_offset(translator, pointer.pointee, at)?,
                    _ => member.offset,
                };
                let offset = offset.ok_or_else(|| {
                    translator.missing_layout(
                        pointer.storage_class,
                        format!("member {at} of a buffer's struct has no Offset decoration"),
                    )
                })?;
                let sum = pointer.offset.checked_add(offset);
                pointer.offset = sum.ok_or_else(|| beyond_4_gib(translator))?;
                pointer.layout.matrix = member.matrix;
            } else {
                let unit = if packed { 4 } else { 1 };
                translator.charge(at / WORDS_OF_A_STEP);
                for member in &members[..at] {
                    let size = translator.word_count(member.ty)?.checked_mul(unit);
                    let offset = size.and_then(|size| pointer.offset.checked_add(size));
                    pointer.offset = offset.ok_or_else(|| beyond_4_gib(translator))?;
                }
            }
            pointer.pointee = member.ty;
            Ok(pointer)
        }
        Type::Array { element, length, stride } => {
            let length = translator.array_length(length)?;
            element_step(translator, pointer, index, element, stride, Length::Known(length))
        }
        Type::RuntimeArray { element, stride } => {
            element_step(translator, pointer, index, element, stride, Length::Unknown)
        }
        Type::Matrix { column, count } => {
            let stride = match (in_buffer, pointer.layout.matrix) {
                (false, _) => None,
                (true, Some(layout)) if layout.row_major => {
                    pointer.layout.component_stride = Some(layout.stride);
                    Some(translator.scalar_width(column)? / 8)
                }
                (true, Some(layout)) => Some(layout.stride),
                (true, None) => {
                    return Err(translator.missing_layout(
                        pointer.storage_class,
                        "a buffer's matrix has no MatrixStride decoration",
                    ));
                }
            };
            element_step(translator, pointer, index, column, stride, Length::Known(count))
        }
        Type::Vector { component, count } => {
            let bytes = translator.scalar_width(component)? / 8;
            let stride =
                if in_buffer { Some(pointer.layout.component_stride.take().unwrap_or(bytes)) } else { None };
            element_step(translator, pointer, index, component, stride, Length::Known(count))
        }
        _ => {
            let name = translator.module.describe_type(pointer.pointee);
            Err(translator.invalid(format!("an access chain has an index into {name}")))
        }
    }
}

/// The error of a constant offset that 32 bits do not hold.
#[cold]
pub(super) fn beyond_4_gib(translator: &Translator<'_>) -> Error {
    translator.unsupported("an offset beyond 4 GiB is not supported")
}

fn element_step(
    translator: &mut Translator<'_>,
    mut pointer: Pointer,
    index: crate::module::Id,
    element: TypeId,
    stride: Option<u32>,
    length: Length,
) -> Result<Pointer> {
    let stride = match pointer.base {
        PointerBase::Buffer(_) if pointer.is_packed(translator) => {
            let words = translator.word_count(element)?;
            words.checked_mul(4).ok_or_else(|| beyond_4_gib(translator))?
        }
        PointerBase::Buffer(_) | PointerBase::Heap(_) => {
            let of_heap = matches!(pointer.base, PointerBase::Heap(_)) && stride.is_none();
            let by_id = if of_heap { heap::array_stride(translator, pointer.pointee)? } else { None };
            stride.or(by_id).ok_or_else(|| {
                let message = "a buffer's array has no ArrayStride decoration";
                translator.missing_layout(pointer.storage_class, message)
            })?
        }
        PointerBase::Descriptors { .. } => descriptor_count(translator, element)?,
        _ => translator.word_count(element)?,
    };
    pointer.pointee = element;
    let index = translator.integer(index, ReadAs::Index)?;
    let constant = translator.constant_word(index);
    // A handle's upper bits name the slot: an index into a runtime array must not reach them.
    let length = match (&pointer.base, length) {
        (PointerBase::Descriptors { .. }, Length::Unknown) => Length::Known(1 << ELEMENT_BITS),
        _ => length,
    };
    let inside = |at: u32| match length {
        Length::Known(length) => at < length,
        Length::Unknown => true,
    };
    let fits = constant.filter(|&at| inside(at)).and_then(|at| at.checked_mul(stride));
    match fits.and_then(|bytes| pointer.offset.checked_add(bytes)) {
        Some(offset) => pointer.offset = offset,
        None => {
            let to = translator.fresh(1)?;
            let base = pointer.index;
            translator.emit(Op::Memory(memory::MemoryOp::Index { to, base, index, stride, length }));
            pointer.index = Some(to);
        }
    }
    let is_array = matches!(translator.module.ty(element), Type::Array { .. } | Type::RuntimeArray { .. });
    if let PointerBase::Descriptors { first, buffers: true, .. } = pointer.base
        && !is_array
    {
        // The element of an array of buffers is selected: the indices that follow are into its
        // bytes.
        let handle = element_handle(translator, first, &pointer)?;
        let buffer = buffer_of_handle(translator, handle);
        (pointer.base, pointer.offset, pointer.index) = (PointerBase::Buffer(buffer), 0, None);
    }
    Ok(pointer)
}

/// The register with the handle of an element of a slot, of which `first` is the first.
pub(super) fn element_handle(translator: &mut Translator<'_>, first: u32, pointer: &Pointer) -> Result<Reg> {
    let base = translator.constant(Bindings::element_handle(first, pointer.offset))?;
    add_offset(translator, pointer.index, base)
}

/// The buffer whose handle a register has.
pub(super) fn buffer_of_handle(translator: &Translator<'_>, handle: Reg) -> BufferRef {
    translator.constant_word(handle).map_or(BufferRef::Computed(handle), BufferRef::Handle)
}

/// The alignment in the memory operands that begin at a position: a mask, then a literal if its
/// second bit is set.
pub(super) fn alignment(translator: &Translator<'_>, instruction: &Instruction, at: usize) -> Result<u32> {
    const ALIGNED: u32 = 2;
    match translator.operands(instruction).get(at) {
        Some(mask) if mask & ALIGNED != 0 => translator.literal(instruction, at + 1),
        _ => Ok(1),
    }
}

/// Translates the memory instructions; `false` for an instruction of another section.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    match opcode {
        Opcode::Load => {
            let (id, ty) = (translator.id(instruction, 0)?, translator.result_type(instruction)?);
            let pointer = pointer_to(translator, id, ty)?;
            check_copyable(translator, pointer.pointee)?;
            let alignment = alignment(translator, instruction, 1)?;
            let words = load_aligned(translator, &pointer, alignment)?;
            translator.define_result(instruction, words);
        }
        Opcode::Store => {
            let (to, from) = (translator.id(instruction, 0)?, translator.id(instruction, 1)?);
            let ty = translator.type_of(from)?;
            let pointer = pointer_to(translator, to, ty)?;
            check_copyable(translator, pointer.pointee)?;
            let words = translator.words(from)?;
            let alignment = alignment(translator, instruction, 2)?;
            store_aligned(translator, &pointer, &words, alignment)?;
        }
        Opcode::CopyMemory => {
            let (to, from) = (translator.id(instruction, 0)?, translator.id(instruction, 1)?);
            // At least one of them says what is copied.
            let typed = match (is_untyped(translator, from)?, is_untyped(translator, to)?) {
                (true, true) => None,
                (true, false) => translator.module.pointee(to),
                (false, _) => translator.module.pointee(from),
            };
            let ty = typed.ok_or_else(|| translator.invalid("OpCopyMemory between untyped pointers"))?;
            let from = pointer_to(translator, from, ty)?;
            check_copyable(translator, from.pointee)?;
            let to = pointer_to(translator, to, ty)?;
            let words = load(translator, &from)?;
            store(translator, &to, &words)?;
        }
        Opcode::ArrayLength | Opcode::UntypedArrayLengthKHR => array_length(translator, instruction)?,
        opcode if opcode.selects_part() => {
            let Some(chain) = translator.module.access_chain(instruction) else {
                return Err(translator.invalid("an access chain without a base"));
            };
            let pointer = chain_base(translator, chain)?;
            let pointer = access_chain(translator, pointer, chain.indices)?;
            if let Some(id) = instruction.result {
                translator.define(id, crate::ops::translate::IdValue::Pointer(pointer.into()));
            }
        }
        _ => return Ok(false),
    }
    Ok(true)
}

fn array_length(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let untyped = usize::from(instruction.opcode == Opcode::UntypedArrayLengthKHR);
    let structure = translator.id(instruction, untyped)?;
    let member = translator.literal(instruction, untyped + 1)?;
    let mut pointer = translator.pointer(structure)?;
    if untyped == 1 {
        let structure = translator.id(instruction, 0)?;
        let ty = translator.module.type_with_id(structure);
        pointer.pointee = ty.ok_or_else(|| translator.invalid(format!("%{} is not a type", structure.0)))?;
    }
    /// `Shader64BitIndexingEXT`
    const WIDE_INDEXING: u32 = 5426;
    let opcode = instruction.opcode;
    let ty = translator.result_type(instruction)?;
    let width = translator.scalar_width(ty)?;
    let is_wide = width == 64 && translator.module.capabilities.contains(&WIDE_INDEXING);
    if width != 32 && !is_wide {
        let message = format!("{opcode}: a length of {width} bits instead of 32");
        return Err(translator.invalid(message).note("SPIR-V, OpArrayLength; SPV_EXT_shader_64bit_indexing"));
    }
    let Type::Struct { ref members, .. } = *translator.module.ty(pointer.pointee) else {
        return Err(translator.invalid(format!("the base of {opcode} is not a struct")));
    };
    let layout = members.get(member as usize).and_then(|member| {
        let Type::RuntimeArray { stride, .. } = translator.module.ty(member.ty) else { return None };
        Some((member.offset?, (*stride)?))
    });
    let (Some((offset, stride)), &PointerBase::Buffer(buffer)) = (layout, &pointer.base) else {
        return Err(translator.invalid(format!("the member of {opcode} is not a runtime array in a buffer")));
    };
    let to = translator.fresh(1)?;
    translator.emit(Op::Memory(memory::MemoryOp::ArrayLength { to, buffer, offset, stride }));
    let mut words = SmallVec::from_slice(&[to]);
    if is_wide {
        let high = translator.constant(0)?;
        let first = translator.pair(to, high)?;
        words = SmallVec::from_slice(&[first, first.plus(1)]);
    }
    translator.define_result(instruction, words);
    Ok(())
}
