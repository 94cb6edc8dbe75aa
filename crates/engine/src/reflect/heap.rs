//! What shaders find in descriptor heaps (`SPV_EXT_descriptor_heap`), whose variables have no
//! types: their access chains say it.

use std::collections::HashMap;

use crate::module::access_chain::AccessChain;
use crate::module::heap::{ByteCount, DESCRIPTOR_BYTES, Heap};
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Module, Opcode};

/// A use of a descriptor in a heap.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct HeapUse {
    /// The heap.
    pub heap: Heap,
    /// The index of the descriptor; `None` where it is computed.
    pub index: Option<u32>,
    /// The descriptor's type.
    pub ty: TypeId,
    /// Of a buffer: the type that an access gives to its bytes.
    pub block: Option<TypeId>,
}

impl HeapUse {
    /// Whether it is of data between descriptors.
    pub fn is_data(&self, module: &Module) -> bool {
        !module.ty(self.ty).is_descriptor()
    }
}

/// A place in a heap.
#[derive(Clone, Copy)]
struct HeapPlace {
    heap: Heap,
    /// Bytes from the beginning of the heap, where they are known.
    offset: Option<u64>,
    ty: Option<TypeId>,
}

/// The descriptors in heaps that a function and those that it calls use: each once, in order.
///
/// Pointers into a heap that phis choose or functions are given are not followed.
pub fn heap_uses(module: &Module, function: Id) -> Vec<HeapUse> {
    let mut uses = Vec::new();
    for function in module.call_tree(function) {
        let mut places: HashMap<Id, HeapPlace> = HashMap::new();
        let mut buffers: HashMap<Id, HeapPlace> = HashMap::new();
        for instruction in module.functions[function as usize].instructions() {
            let operands = module.operands(instruction);
            let first = operands.first().copied().map(Id);
            if let Some(chain) = module.access_chain(instruction) {
                if let Some(buffer) = buffers.get(&chain.base) {
                    uses.extend(used(module, *buffer, module.chain_type(chain)));
                    continue;
                }
                let base = places.get(&chain.base).copied().or_else(|| heap_of(module, chain.base));
                if let Some((place, result)) = base.zip(instruction.result) {
                    places.insert(result, step(module, place, chain));
                }
                continue;
            }
            match instruction.opcode {
                Opcode::BufferPointerEXT => {
                    let Some(place) = first.and_then(|id| places.get(&id)).copied() else { continue };
                    let pointee = instruction.result.and_then(|id| module.pointee(id));
                    uses.extend(used(module, place, pointee));
                    if let Some(result) = instruction.result {
                        buffers.insert(result, place);
                    }
                }
                Opcode::Load => {
                    if let Some(place) = first.and_then(|id| places.get(&id)) {
                        let place = HeapPlace {
                            ty: instruction.result_type.and_then(|id| module.type_with_id(id)),
                            ..*place
                        };
                        uses.extend(used(module, place, None));
                    } else if let Some(buffer) = first.and_then(|id| buffers.get(&id)) {
                        let ty = instruction.result_type.and_then(|id| module.type_with_id(id));
                        uses.extend(used(module, *buffer, ty));
                    }
                }
                Opcode::UntypedImageTexelPointerEXT => {
                    let (Some(ty), Some(&image)) = (first, operands.get(1)) else { continue };
                    if let Some(place) = places.get(&Id(image)) {
                        let place = HeapPlace { ty: module.type_with_id(ty), ..*place };
                        uses.extend(used(module, place, None));
                    }
                }
                _ => {}
            }
        }
    }
    uses.sort_unstable();
    uses.dedup();
    // A buffer whose bytes have a type is not listed without it, too.
    let typed: Vec<HeapUse> = uses.iter().filter(|one| one.block.is_some()).copied().collect();
    uses.retain(|one| {
        one.block.is_some() || !typed.iter().any(|other| HeapUse { block: None, ..*other } == *one)
    });
    uses
}

/// The first byte of the heap whose base pointer an id is.
fn heap_of(module: &Module, id: Id) -> Option<HeapPlace> {
    let Definition::Variable(at) = module.definition(id)? else { return None };
    let heap = module.heap(&module.variables[at as usize])?;
    Some(HeapPlace { heap, offset: Some(0), ty: None })
}

/// Where a chain leads to.
fn step(module: &Module, from: HeapPlace, chain: AccessChain<'_>) -> HeapPlace {
    let mut place = HeapPlace { ty: module.chain_type(chain), ..from };
    let bytes = |count: Option<ByteCount>| match count? {
        ByteCount::Literal(bytes) => Some(u64::from(bytes)),
        ByteCount::Constant(id) => module.scalar_value(id),
    };
    if chain.element.is_some() {
        place.offset = None;
    }
    for &index in chain.indices {
        let index = module.scalar_value(Id(index));
        let Some(ty) = place.ty else { break };
        let distance = match module.ty(ty) {
            Type::Struct { .. } => index.and_then(|at| bytes(module.heap_offset(ty, at as u32))),
            _ => index.zip(bytes(module.heap_stride(ty))).and_then(|(at, stride)| at.checked_mul(stride)),
        };
        place.offset = place.offset.zip(distance).and_then(|(offset, more)| offset.checked_add(more));
        place.ty = module.part(ty, index);
    }
    place
}

/// The use of a place, whose bytes, of a buffer, have a type.
fn used(module: &Module, place: HeapPlace, block: Option<TypeId>) -> Option<HeapUse> {
    let ty = place.ty?;
    let index = place.offset.map(|offset| offset / u64::from(DESCRIPTOR_BYTES));
    let index = index.and_then(|index| u32::try_from(index).ok());
    let block = block.filter(|_| matches!(module.ty(ty), Type::Buffer { .. }));
    Some(HeapUse { heap: place.heap, index, ty, block })
}
