//! Where the values are that ids of a module stand for, in a program that is not optimised.

use std::sync::Arc;

use crate::debugger::lane_state::LaneState;
use crate::debugger::place_memory::{MemoryBase, MemoryPlace, PlaceContext};
use crate::debugger::variable_place::VariablePlace;
use anyhit_engine::machine::{Bindings, REGISTER_POINTER, Reg};
use anyhit_engine::module::constant::ConstantValue;
use anyhit_engine::module::heap::DESCRIPTOR_BYTES;
use anyhit_engine::module::ty::{MatrixLayout, Type, TypeId};
use anyhit_engine::module::{Definition, Id, Module};
use anyhit_engine::ops::heap;
use anyhit_engine::ops::memory::{BufferRef, OUT_OF_BOUNDS};
use anyhit_engine::ops::pointer::{PointeeLayout, Pointer, PointerBase};
use anyhit_engine::ops::translate::IdValue;
use anyhit_engine::program::Program;
use anyhit_engine::reflect::{Layout, Rules};

/// Why a value that is no variable cannot be set.
const NO_VARIABLE: &str = "it is a value, not a variable: the compiler may have used it already";
/// Why an input cannot be set.
const INPUT: &str = "it is an input of the shader";

/// Finds the places of ids in one inlined call of a program.
#[derive(Clone, Debug)]
pub(super) struct IdPlaces<'a> {
    pub(super) program: &'a Program,
    pub(super) context: Arc<PlaceContext>,
    pub(super) state: &'a dyn LaneState,
    /// The inlined call; see [`Program::scopes`].
    pub(super) scope: u32,
}

impl IdPlaces<'_> {
    /// The value of an id.
    pub(super) fn value(&self, id: Id) -> VariablePlace {
        let module = &self.program.module;
        let Some(ty) = module.type_of(id) else { return self.unavailable(id, self.void()) };
        match self.program.id_values.find(self.scope, id) {
            Some(IdValue::Words(words)) => {
                VariablePlace::registers(&self.context, ty, words.clone()).fixed(NO_VARIABLE)
            }
            Some(IdValue::Pointer(pointer)) => match pointer.base {
                PointerBase::Buffer(BufferRef::Address(base)) => {
                    let offset = self.offset(pointer).unwrap_or(0);
                    let address = self.address(base).wrapping_add(offset);
                    let words = vec![address as u32, (address >> 32) as u32];
                    VariablePlace::constant(&self.context, ty, words)
                }
                _ => VariablePlace::pointer(&self.context, ty, self.of_pointer(pointer)),
            },
            None => match constant_words(module, id) {
                Some(words) => VariablePlace::constant(&self.context, ty, words),
                None => self.unavailable(id, ty),
            },
        }
    }

    /// What an id points to.
    pub(super) fn pointee(&self, id: Id) -> VariablePlace {
        let module = &self.program.module;
        let (Some(pointer), Some(ty)) = (module.type_of(id), module.pointee(id)) else {
            return self.unavailable(id, self.void());
        };
        match self.program.id_values.find(self.scope, id) {
            Some(IdValue::Pointer(pointer)) => self.of_pointer(pointer),
            Some(IdValue::Words(words)) => {
                let words: Vec<u32> = words.iter().map(|&reg| self.state.register(reg)).collect();
                let found = VariablePlace::of_pointer(&self.context, pointer, &words);
                found.unwrap_or_else(|why| VariablePlace::unavailable(&self.context, ty, why))
            }
            None => self.unavailable(id, ty),
        }
    }

    fn unavailable(&self, id: Id, ty: TypeId) -> VariablePlace {
        let is_undefined = match self.program.module.definition(id) {
            Some(Definition::Constant(at)) => {
                self.program.module.constants[at as usize].value == ConstantValue::Undef
            }
            _ => false,
        };
        let why = match is_undefined {
            true => "optimized out: the compiler records no value for it here".to_owned(),
            false => format!("optimized out: nothing in this call of the function calculates %{}", id.0),
        };
        VariablePlace::unavailable(&self.context, ty, why)
    }

    /// The type of what has none.
    pub(super) fn void(&self) -> TypeId {
        let types = &self.program.module.types;
        TypeId(types.iter().position(|ty| matches!(ty, Type::Void)).unwrap_or(0) as u32)
    }

    fn address(&self, base: Reg) -> u64 {
        u64::from(self.state.register(base)) | u64::from(self.state.register(base.plus(1))) << 32
    }

    /// The whole offset of a pointer; `None` where its index is out of bounds.
    fn offset(&self, pointer: &Pointer) -> Option<u64> {
        let index = pointer.index.map_or(0, |index| self.state.register(index));
        (index != OUT_OF_BOUNDS).then(|| u64::from(pointer.offset) + u64::from(index))
    }

    fn of_pointer(&self, pointer: &Pointer) -> VariablePlace {
        self.try_of_pointer(pointer)
            .unwrap_or_else(|why| VariablePlace::unavailable(&self.context, pointer.pointee, why))
    }

    fn try_of_pointer(&self, pointer: &Pointer) -> Result<VariablePlace, &'static str> {
        let (context, ty) = (&self.context, pointer.pointee);
        let outside = "an index of its access chain is out of bounds";
        let words = || context.packed(ty).word_count().ok_or("it cannot be read as a whole");
        match pointer.base {
            PointerBase::Registers { first, count, constant } => {
                let (offset, words) = (self.offset(pointer).ok_or(outside)?, words()?);
                if offset + u64::from(words) > count.into() {
                    return Err(outside);
                }
                let first = first.plus(offset as u32);
                let place =
                    VariablePlace::registers(context, ty, (0..words).map(|at| first.plus(at)).collect());
                Ok(if constant { place.fixed(INPUT) } else { place })
            }
            PointerBase::ComputedRegisters => {
                let index = pointer.index.map_or(0, |index| self.state.register(index));
                match index {
                    OUT_OF_BOUNDS => Err(outside),
                    0..REGISTER_POINTER => Err("the pointer is null"),
                    _ => {
                        let first = pointer.pointed_registers().computed(index);
                        let registers = (0..words()?).map(|at| first.computed(at)).collect();
                        Ok(VariablePlace::registers(context, ty, registers))
                    }
                }
            }
            PointerBase::Buffer(buffer) => {
                let base = match buffer {
                    BufferRef::Handle(handle) => MemoryBase::Descriptor(handle),
                    BufferRef::Computed(reg) => MemoryBase::of_handle(self.state.register(reg)),
                    BufferRef::PushConstants => MemoryBase::PushConstants,
                    BufferRef::ShaderRecord => MemoryBase::ShaderRecord,
                    BufferRef::Workgroup => MemoryBase::Workgroup,
                    BufferRef::Address(reg) => MemoryBase::Address(self.address(reg)),
                };
                let offset = self.offset(pointer).ok_or(outside)?;
                let PointeeLayout { matrix, component_stride } = pointer.layout;
                // A vector whose components lie apart is a column of a row-major matrix.
                let column = component_stride.map(|stride| MatrixLayout { stride, row_major: true });
                let (rules, matrix) = (context.rules(pointer.storage_class), matrix.or(column));
                let memory = MemoryPlace { base, offset, rules, matrix };
                Ok(VariablePlace::memory(context, ty, memory))
            }
            PointerBase::Descriptors { first, buffers, .. } => {
                let index = pointer.index.map_or(0, |index| self.state.register(index));
                if index == OUT_OF_BOUNDS {
                    return Err(outside);
                }
                let handle = Bindings::element_handle(first, pointer.offset).wrapping_add(index);
                Ok(VariablePlace::descriptors(context, ty, handle, buffers))
            }
            PointerBase::Heap(variable) => {
                let (offset, module) = (self.offset(pointer).ok_or(outside)?, &self.program.module);
                let id = module.variables[variable as usize].id;
                let heap = module.heap(&module.variables[variable as usize]).ok_or("it is not a heap")?;
                let at = |binding| heap::handle_in(&self.program.slots, id, binding);
                let unused = "the shader uses nothing of this kind in the heap";
                match module.ty(ty) {
                    Type::Pointer { .. } | Type::Void => Err("the type of what lies there is not known"),
                    lying if lying.is_descriptor() => {
                        let first = at(heap::binding(heap)).ok_or(unused)?;
                        let element = offset / u64::from(DESCRIPTOR_BYTES);
                        let element = u32::try_from(element).map_err(|_| outside)?;
                        let handle = Bindings::element_handle(first, element);
                        Ok(VariablePlace::descriptors(context, ty, handle, false))
                    }
                    _ => {
                        let base = MemoryBase::Descriptor(at(heap::binding(heap).heap_data()).ok_or(unused)?);
                        let (rules, matrix) = (Rules::Explicit, pointer.layout.matrix);
                        let memory = MemoryPlace { base, offset, rules, matrix };
                        Ok(VariablePlace::memory(context, ty, memory))
                    }
                }
            }
            PointerBase::Texel(_) => Err("it is a texel, which only atomic instructions access"),
        }
    }
}

/// The words of a constant; `None` where it has to be calculated.
fn constant_words(module: &Module, id: Id) -> Option<Vec<u32>> {
    let Some(Definition::Constant(index)) = module.definition(id) else { return None };
    let constant = &module.constants[index as usize];
    let count = Layout::new(module, constant.ty, Rules::Packed).word_count()?;
    Some(match &constant.value {
        &ConstantValue::Scalar(bits) => [bits as u32, (bits >> 32) as u32][..count.min(2) as usize].to_vec(),
        ConstantValue::Composite(parts) => {
            let mut words = Vec::new();
            for &part in parts {
                words.extend(constant_words(module, part)?);
            }
            Some(words).filter(|words| words.len() == count as usize)?
        }
        ConstantValue::Null => vec![0; count as usize],
        _ => return None,
    })
}
