//! The layout of matrices behind pointers that are values.
//!
//! The layout of a matrix in a buffer is a decoration of the member that holds it, not of the type
//! of a pointer into it. A pointer that comes from a phi, a select or a call is therefore traced
//! back to the access chains that made it.

use std::collections::HashSet;

use smallvec::SmallVec;

use crate::error::Result;
use crate::module::ty::{MatrixLayout, Type, TypeId};
use crate::module::{Definition, Id, Instruction, Module};
use crate::ops::pointer::{Pointer, PointerBase};
use crate::ops::translate::{IdValue, Translator};

/// The layout of matrices in the pointee, and the byte stride of the components of the vector
/// pointed to, if they are not adjacent: as in [`Pointer`].
pub type Layout = (Option<MatrixLayout>, Option<u32>);

/// Infers the layout of a pointer that was read from registers: the one that all its sources have.
///
/// # Errors
/// `UnsupportedModule` if they do not agree.
pub fn infer_layout(translator: &Translator<'_>, id: Id, pointer: &mut Pointer) -> Result<()> {
    let module = translator.module;
    let needs_layout = match module.ty(pointer.pointee) {
        Type::Vector { .. } => true,
        _ => ends_in_matrix(module, pointer.pointee),
    };
    if !needs_layout || !matches!(pointer.base, PointerBase::Buffer(_)) || pointer.is_packed(translator) {
        return Ok(());
    }
    let mut search = LayoutSearch { translator, module, visited: HashSet::new() };
    match *search.layouts(id) {
        // Nothing is loaded or stored through null: any layout is correct.
        [] => pointer.matrix = Some(MatrixLayout { stride: 16, row_major: false }),
        [layout] => (pointer.matrix, pointer.component_stride) = layout,
        _ => {
            let message = "a pointer that may lead into matrices of different layouts";
            return Err(translator.unsupported(message));
        }
    }
    Ok(())
}

/// Whether a type is a matrix or an array of them.
pub fn ends_in_matrix(module: &Module, mut ty: TypeId) -> bool {
    while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = *module.ty(ty) {
        ty = element;
    }
    matches!(module.ty(ty), Type::Matrix { .. })
}

/// A search through the definitions of pointers for their layouts.
struct LayoutSearch<'a, 'm> {
    translator: &'a Translator<'m>,
    module: &'m Module,
    /// Visited ids: a loop adds nothing new.
    visited: HashSet<Id>,
}

type Layouts = SmallVec<[Layout; 1]>;

impl LayoutSearch<'_, '_> {
    fn layouts(&mut self, id: Id) -> Layouts {
        if let Some(IdValue::Pointer(known)) = self.translator.local(id) {
            return SmallVec::from_slice(&[(known.matrix, known.component_stride)]);
        }
        if !self.visited.insert(id) {
            return Layouts::new();
        }
        let module = self.module;
        match module.definition(id) {
            Some(Definition::Parameter(function, at)) => {
                let function = module.functions[function as usize].id;
                let calls = instructions(module).filter(move |one| one.opcode == opcode::FUNCTION_CALL);
                let calls =
                    calls.map(|call| module.operands(call)).filter(|operands| operands[0] == function.0);
                self.merged_layouts(calls.filter_map(|operands| operands.get(at as usize + 1).copied()))
            }
            Some(Definition::Result(function, block, at)) => {
                let block = &module.functions[function as usize].blocks[block as usize];
                self.result_layouts(&block.instructions[at as usize])
            }
            // The null pointer points into no matrix: it agrees with every layout.
            Some(Definition::Constant(_)) => Layouts::new(),
            _ => SmallVec::from_slice(&[(None, None)]),
        }
    }

    fn merged_layouts(&mut self, sources: impl Iterator<Item = u32>) -> Layouts {
        let mut all = Layouts::new();
        for source in sources {
            for layout in self.layouts(Id(source)) {
                if !all.contains(&layout) {
                    all.push(layout);
                }
            }
        }
        all
    }

    fn result_layouts(&mut self, instruction: &Instruction) -> Layouts {
        let module = self.module;
        let operands = module.operands(instruction);
        match instruction.opcode {
            opcode::UNDEF => Layouts::new(),
            opcode::PHI => self.merged_layouts(operands.iter().copied().step_by(2)),
            opcode::SELECT => self.merged_layouts(operands[1..].iter().copied()),
            opcode::COPY_OBJECT => self.merged_layouts(operands[..1].iter().copied()),
            opcode::FUNCTION_CALL => {
                let Some(Definition::Function(index)) = module.definition(Id(operands[0])) else {
                    return Layouts::new();
                };
                let blocks = module.functions[index as usize].blocks.iter();
                let last = blocks.filter_map(|block| block.instructions.last());
                let returns = last.filter(|one| one.opcode == opcode::RETURN_VALUE);
                self.merged_layouts(returns.map(|one| module.operands(one)[0]))
            }
            opcode::ACCESS_CHAIN | opcode::IN_BOUNDS_ACCESS_CHAIN => {
                self.chain_layouts(operands[0], &operands[1..])
            }
            opcode::PTR_ACCESS_CHAIN | opcode::IN_BOUNDS_PTR_ACCESS_CHAIN => {
                self.chain_layouts(operands[0], &operands[2..])
            }
            _ => SmallVec::from_slice(&[(None, None)]),
        }
    }

    fn chain_layouts(&mut self, base: u32, indices: &[u32]) -> Layouts {
        let module = self.module;
        let mut layouts = self.layouts(Id(base));
        let pointee = module.type_of(Id(base)).and_then(|ty| match *module.ty(ty) {
            Type::Pointer { pointee, .. } => pointee,
            _ => None,
        });
        let Some(mut ty) = pointee else { return layouts };
        for &index in indices {
            match module.ty(ty) {
                Type::Struct { members, .. } => {
                    let at = module.scalar_value(Id(index)).unwrap_or(u64::MAX);
                    let Some(member) = members.get(at as usize) else { return layouts };
                    layouts = SmallVec::from_slice(&[(member.matrix, None)]);
                    ty = member.ty;
                }
                Type::Matrix { column, .. } => {
                    for (matrix, stride) in &mut layouts {
                        *stride = matrix.filter(|layout| layout.row_major).map(|layout| layout.stride);
                        *matrix = None;
                    }
                    ty = *column;
                }
                Type::Vector { component, .. } => {
                    layouts = SmallVec::from_slice(&[(None, None)]);
                    ty = *component;
                }
                Type::Array { element, .. } | Type::RuntimeArray { element, .. } => ty = *element,
                _ => return layouts,
            }
        }
        layouts
    }
}

/// Every instruction of every function.
pub(super) fn instructions(module: &Module) -> impl Iterator<Item = &Instruction> {
    let blocks = module.functions.iter().flat_map(|function| &function.blocks);
    blocks.flat_map(|block| &block.instructions)
}

/// Opcodes that compute pointers from pointers.
pub(super) mod opcode {
    pub const UNDEF: u16 = 1;
    pub const FUNCTION_CALL: u16 = 57;
    pub const ACCESS_CHAIN: u16 = 65;
    pub const IN_BOUNDS_ACCESS_CHAIN: u16 = 66;
    pub const PTR_ACCESS_CHAIN: u16 = 67;
    pub const IN_BOUNDS_PTR_ACCESS_CHAIN: u16 = 70;
    pub const COPY_OBJECT: u16 = 83;
    pub const SELECT: u16 = 169;
    pub const PHI: u16 = 245;
    pub const RETURN_VALUE: u16 = 254;
}
