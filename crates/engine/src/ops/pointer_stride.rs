//! The array stride, in bytes, of the array that a pointer points into.
//!
//! The type of a pointer gives it as `ArrayStride`, which `OpPtrAccessChain` needs in most storage
//! classes. `OpPtrDiff` needs none: "the element size is the same as in the array" that both
//! pointers point into. So the pointer is traced back to the access chains that made it.

use rustc_hash::FxHashSet;
use smallvec::SmallVec;

use crate::module::access_chain::AccessChain;
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Module, Opcode};
use crate::ops::pointer_layout::{returned, sources};
use crate::ops::translate::Translator;

/// The stride of the array that pointers point into, as far as it is known.
#[derive(Debug)]
pub enum Stride {
    /// The stride of every array that they may point into.
    Unique(u32),
    /// They may point into arrays of different strides.
    Ambiguous,
    /// No array that they point into is known.
    Unknown,
}

/// The stride of the array that all of these pointers of one type point into, and how many
/// definitions, blocks and types were visited: as many as the module has, for one instruction.
pub fn array_stride(translator: &Translator<'_>, pointers: &[Id]) -> (Stride, usize) {
    let module = translator.module;
    let mut all = Strides::default();
    let mut steps = 0;
    for &pointer in pointers {
        let (visited, found) = (FxHashSet::default(), Strides::default());
        let worklist = vec![pointer];
        let mut search = StrideSearch { translator, visited, worklist, found, complete: true, steps: 0 };
        while let Some(id) = search.worklist.pop() {
            search.visit(id);
        }
        steps += search.steps;
        if let ([stride], true) = (search.found.all(), search.complete) {
            return (Stride::Unique(*stride), steps);
        }
        if !search.complete
            && let Some(ty) = module.pointee(pointer)
        {
            steps += module.types.len();
            add_strides_of_arrays_of(module, ty, &mut search.found);
        }
        search.found.all().iter().for_each(|&stride| all.add(stride));
    }
    let stride = match *all.all() {
        [] => Stride::Unknown,
        [stride] => Stride::Unique(stride),
        _ => Stride::Ambiguous,
    };
    (stride, steps)
}

/// Strides that differ: two of them, as more make no difference.
#[derive(Default)]
struct Strides(SmallVec<[u32; 2]>);

impl Strides {
    fn add(&mut self, stride: u32) {
        if self.0.len() < 2 && !self.0.contains(&stride) {
            self.0.push(stride);
        }
    }

    fn all(&self) -> &[u32] {
        &self.0
    }
}

/// Adds the strides of all arrays of a type: for pointers that are loaded from memory.
fn add_strides_of_arrays_of(module: &Module, of: TypeId, found: &mut Strides) {
    for ty in &module.types {
        if let Type::Array { element, stride: Some(stride), .. }
        | Type::RuntimeArray { element, stride: Some(stride) } = *ty
            && element == of
        {
            found.add(stride);
        }
    }
}

/// A search through the definitions of a pointer, of which there may be a chain as long as the
/// module: those that are still to be visited stand in a worklist.
struct StrideSearch<'a, 'm> {
    translator: &'a Translator<'m>,
    /// Visited ids: a loop adds nothing new.
    visited: FxHashSet<Id>,
    worklist: Vec<Id>,
    found: Strides,
    /// Whether each definition was traced back to an array.
    complete: bool,
    /// Definitions and blocks that were looked at.
    steps: usize,
}

impl StrideSearch<'_, '_> {
    fn visit(&mut self, id: Id) {
        self.steps += 1;
        if !self.visited.insert(id) {
            return;
        }
        let module = self.translator.module;
        match module.definition(id) {
            Some(Definition::Parameter(function, at)) => {
                let calls = self.translator.calls(module.functions[function as usize].id);
                let arguments = calls.iter().filter_map(|operands| operands.get(at as usize + 1));
                self.worklist.extend(arguments.map(|&argument| Id(argument)));
            }
            Some(Definition::Result(function, block, at)) => {
                let block = &module.functions[function as usize].blocks[block as usize];
                let instruction = &block.instructions[at as usize];
                self.visit_result(instruction.opcode, module.operands(instruction));
            }
            // The null pointer points to nothing.
            Some(Definition::Constant(_)) => {}
            _ => self.complete = false,
        }
    }

    fn visit_result(&mut self, opcode: Opcode, operands: &[u32]) {
        let module = self.translator.module;
        if let Some(chain) = AccessChain::of(opcode, operands) {
            self.visit_chain(chain);
            return;
        }
        match opcode {
            Opcode::FunctionCall => {
                let Some(Definition::Function(index)) = module.definition(Id(operands[0])) else { return };
                self.steps += module.functions[index as usize].blocks.len();
                self.worklist.extend(returned(module, index));
            }
            Opcode::Undef | Opcode::PoisonKHR => {}
            _ => match sources(opcode, operands) {
                Some(sources) => self.worklist.extend(sources),
                None => self.complete = false,
            },
        }
    }

    /// Adds the array that the last of the indices selects from.
    fn visit_chain(&mut self, chain: AccessChain<'_>) {
        let Some((_, before)) = chain.indices.split_last() else {
            self.worklist.push(chain.base);
            return;
        };
        match self.stride(AccessChain { indices: before, ..chain }) {
            Some(stride) => self.found.add(stride),
            None => self.complete = false,
        }
    }

    /// The stride of the array that indices reach.
    fn stride(&self, chain: AccessChain<'_>) -> Option<u32> {
        let module = self.translator.module;
        let mut ty = module.chain_type(chain)?;
        for &index in chain.indices {
            ty = module.part(ty, module.scalar_value(Id(index)))?;
        }
        match *module.ty(ty) {
            Type::Array { stride, .. } | Type::RuntimeArray { stride, .. } => stride,
            _ => None,
        }
    }
}
