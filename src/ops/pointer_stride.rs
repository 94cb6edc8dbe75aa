//! The bytes between the elements of the array that a pointer leads into.
//!
//! The type of a pointer tells them where it has an `ArrayStride`, which `OpPtrAccessChain` needs
//! in most storage classes. `OpPtrDiff` needs none: "the element size is the same as in the array"
//! that both pointers lead into. So the pointer is traced back to the access chains that made it.

use std::collections::HashSet;

use smallvec::SmallVec;

use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Module};
use crate::ops::pointer_layout::{instructions, opcode};

/// The one stride of all arrays that a pointer may lead into; `None` where nothing tells it or
/// where several differ.
pub fn stride_of_array(module: &Module, pointer: Id) -> Option<u32> {
    let mut trace = Trace { module, seen: HashSet::new(), found: SmallVec::new() };
    trace.follow(pointer);
    if trace.found.is_empty() {
        trace.found = arrays_of(module, pointee(module, pointer)?);
    }
    match trace.found[..] {
        [stride] => Some(stride),
        _ => None,
    }
}

fn pointee(module: &Module, pointer: Id) -> Option<TypeId> {
    match *module.ty(module.type_of(pointer)?) {
        Type::Pointer { pointee, .. } => pointee,
        _ => None,
    }
}

/// The strides of all arrays of a type: for pointers that were stored and loaded.
fn arrays_of(module: &Module, of: TypeId) -> SmallVec<[u32; 1]> {
    let mut found = SmallVec::new();
    for ty in &module.types {
        if let Type::Array { element, stride: Some(stride), .. }
        | Type::RuntimeArray { element, stride: Some(stride) } = *ty
            && element == of
            && !found.contains(&stride)
        {
            found.push(stride);
        }
    }
    found
}

/// A search through what defines a pointer.
struct Trace<'m> {
    module: &'m Module,
    /// Ids on the way: a loop adds nothing to what it began with.
    seen: HashSet<Id>,
    found: SmallVec<[u32; 1]>,
}

impl Trace<'_> {
    fn follow(&mut self, id: Id) {
        if !self.seen.insert(id) {
            return;
        }
        let module = self.module;
        match module.definition(id) {
            Some(Definition::Parameter(function, at)) => {
                let function = module.functions[function as usize].id;
                let calls = instructions(module).filter(move |one| one.opcode == opcode::FUNCTION_CALL);
                let calls =
                    calls.map(|call| module.operands(call)).filter(|operands| operands[0] == function.0);
                self.all(calls.filter_map(|operands| operands.get(at as usize + 1).copied()));
            }
            Some(Definition::Result(function, block, at)) => {
                let block = &module.functions[function as usize].blocks[block as usize];
                let instruction = &block.instructions[at as usize];
                self.result(instruction.opcode, module.operands(instruction));
            }
            _ => {}
        }
    }

    fn all(&mut self, sources: impl Iterator<Item = u32>) {
        sources.for_each(|source| self.follow(Id(source)));
    }

    fn result(&mut self, opcode: u16, operands: &[u32]) {
        let module = self.module;
        match opcode {
            opcode::PHI => self.all(operands.iter().copied().step_by(2)),
            opcode::SELECT => self.all(operands[1..].iter().copied()),
            opcode::COPY_OBJECT => self.all(operands[..1].iter().copied()),
            opcode::FUNCTION_CALL => {
                let Some(Definition::Function(index)) = module.definition(Id(operands[0])) else { return };
                let blocks = module.functions[index as usize].blocks.iter();
                let last = blocks.filter_map(|block| block.instructions.last());
                let returns = last.filter(|one| one.opcode == opcode::RETURN_VALUE);
                self.all(returns.map(|one| module.operands(one)[0]));
            }
            opcode::ACCESS_CHAIN | opcode::IN_BOUNDS_ACCESS_CHAIN => self.chain(operands[0], &operands[1..]),
            opcode::PTR_ACCESS_CHAIN | opcode::IN_BOUNDS_PTR_ACCESS_CHAIN => {
                self.chain(operands[0], &operands[2..]);
            }
            _ => {}
        }
    }

    /// The array that the last of the indices goes into.
    fn chain(&mut self, base: u32, indices: &[u32]) {
        let module = self.module;
        let Some((_, before)) = indices.split_last() else { return self.follow(Id(base)) };
        let Some(mut ty) = pointee(module, Id(base)) else { return };
        for &index in before {
            ty = match module.ty(ty) {
                Type::Struct { members, .. } => {
                    let at = module.scalar_value(Id(index)).unwrap_or(u64::MAX);
                    let Some(member) = members.get(at as usize) else { return };
                    member.ty
                }
                Type::Matrix { column: part, .. }
                | Type::Vector { component: part, .. }
                | Type::Array { element: part, .. }
                | Type::RuntimeArray { element: part, .. } => *part,
                _ => return,
            };
        }
        if let Type::Array { stride: Some(stride), .. } | Type::RuntimeArray { stride: Some(stride), .. } =
            *module.ty(ty)
            && !self.found.contains(&stride)
        {
            self.found.push(stride);
        }
    }
}
