//! The layout of matrices behind pointers that are values.
//!
//! The layout of a matrix in a buffer is a decoration of the member that holds it, not of the type
//! of a pointer into it. A pointer that comes from a phi, a select or a call is therefore traced
//! back to the access chains that made it.

use rustc_hash::FxHashSet;
use smallvec::SmallVec;

use crate::module::access_chain::AccessChain;
use crate::module::ty::{MatrixLayout, Type, TypeId};
use crate::module::{Definition, Id, Module, Opcode};
use crate::ops::pointer::{PointeeLayout, Pointer, PointerBase};
use crate::ops::translate::{IdValue, Translator};
use anyhit_base::error::Result;

/// Infers the layout of a pointer that was read from registers: the one that all its sources have.
/// Returns how many definitions were visited.
///
/// # Errors
/// `UnsupportedModule` if they do not agree.
pub fn infer_layout(translator: &Translator<'_>, id: Id, pointer: &mut Pointer) -> Result<usize> {
    let module = translator.module;
    let needs_layout = match module.ty(pointer.pointee) {
        Type::Vector { .. } => true,
        _ => ends_in_matrix(module, pointer.pointee),
    };
    if !needs_layout || !matches!(pointer.base, PointerBase::Buffer(_)) || pointer.is_packed(translator) {
        return Ok(0);
    }
    let mut search = LayoutSearch { translator, visited: FxHashSet::default(), worklist: Vec::new() };
    match *search.layouts(id) {
        // Nothing is loaded or stored through null: any layout is correct.
        [] => pointer.layout.matrix = Some(MatrixLayout { stride: 16, row_major: false }),
        [layout] => pointer.layout = layout,
        _ => {
            let message = "a pointer into matrices of different layouts is not supported";
            return Err(translator.unsupported(message));
        }
    }
    Ok(search.visited.len())
}

/// Whether a type is a matrix or an array of them.
pub fn ends_in_matrix(module: &Module, mut ty: TypeId) -> bool {
    while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = *module.ty(ty) {
        ty = element;
    }
    matches!(module.ty(ty), Type::Matrix { .. })
}

/// What the indices between a pointer and the one that is asked for make of its layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Selection {
    /// There are none, or only into arrays.
    Whole,
    /// One selects a column of its matrix.
    Column,
}

impl Selection {
    fn of(self, layout: PointeeLayout) -> PointeeLayout {
        match self {
            Self::Whole => layout,
            Self::Column => {
                let row_major = layout.matrix.filter(|matrix| matrix.row_major);
                PointeeLayout { matrix: None, component_stride: row_major.map(|matrix| matrix.stride) }
            }
        }
    }
}

/// A search through the definitions of pointers, of which there may be a chain as long as the
/// module: those that are still to be visited stand in a worklist.
struct LayoutSearch<'a, 'm> {
    translator: &'a Translator<'m>,
    /// Visited ids: a loop adds nothing new.
    visited: FxHashSet<(Id, Selection)>,
    worklist: Vec<(Id, Selection)>,
}

type Layouts = SmallVec<[PointeeLayout; 1]>;

impl LayoutSearch<'_, '_> {
    fn layouts(&mut self, id: Id) -> Layouts {
        let mut layouts = Layouts::new();
        self.worklist.push((id, Selection::Whole));
        while let Some((id, selection)) = self.worklist.pop() {
            let Some(found) = self.visit(id, selection) else { continue };
            if !layouts.contains(&found) {
                layouts.push(found);
            }
        }
        layouts
    }

    /// The layout behind one id; `None` where it has none of its own, but that of ids which are put
    /// on the list.
    fn visit(&mut self, id: Id, selection: Selection) -> Option<PointeeLayout> {
        if let Some(IdValue::Pointer(known)) = self.translator.local(id) {
            return Some(selection.of(known.layout));
        }
        if !self.visited.insert((id, selection)) {
            return None;
        }
        let module = self.translator.module;
        let (opcode, operands) = match module.definition(id) {
            Some(Definition::Parameter(function, at)) => {
                let calls = self.translator.calls(module.functions[function as usize].id);
                let arguments = calls.iter().filter_map(|operands| operands.get(at as usize + 1));
                self.worklist.extend(arguments.map(|&argument| (Id(argument), selection)));
                return None;
            }
            Some(Definition::Result(function, block, at)) => {
                let block = &module.functions[function as usize].blocks[block as usize];
                let instruction = &block.instructions[at as usize];
                (instruction.opcode, module.operands(instruction))
            }
            // The null pointer points into no matrix: it agrees with every layout.
            Some(Definition::Constant(_)) => return None,
            _ => return Some(PointeeLayout::default()),
        };
        if let Some(chain) = AccessChain::of(opcode, operands) {
            return self.chain(chain, selection);
        }
        match opcode {
            Opcode::Undef | Opcode::PoisonKHR => None,
            Opcode::FunctionCall => {
                let Some(Definition::Function(index)) = module.definition(Id(operands[0])) else {
                    return None;
                };
                let returns = returned(module, index);
                self.worklist.extend(returns.map(|value| (value, selection)));
                None
            }
            _ => match sources(opcode, operands) {
                Some(sources) => {
                    self.worklist.extend(sources.map(|source| (source, selection)));
                    None
                }
                None => Some(PointeeLayout::default()),
            },
        }
    }

    /// What indices make of the layout of the pointer that they begin with.
    fn chain(&mut self, chain: AccessChain<'_>, selection: Selection) -> Option<PointeeLayout> {
        let module = self.translator.module;
        let base = chain.base;
        // From the first index on: the layout once it is known, else what happens to that of the
        // base.
        let mut known: Option<PointeeLayout> = None;
        let mut steps = Selection::Whole;
        let mut ty = module.chain_type(chain);
        for &index in chain.indices {
            ty = match ty.map(|ty| module.ty(ty)) {
                Some(Type::Struct { members, .. }) => {
                    let at = module.scalar_value(Id(index)).and_then(|at| usize::try_from(at).ok());
                    let member = at.and_then(|at| members.get(at));
                    known = member.map(|member| PointeeLayout::of_matrix(member.matrix)).or(known);
                    member.map(|member| member.ty)
                }
                Some(Type::Matrix { column, .. }) => {
                    match &mut known {
                        Some(layout) => *layout = Selection::Column.of(*layout),
                        None if steps == Selection::Column => known = Some(PointeeLayout::default()),
                        None => steps = Selection::Column,
                    }
                    Some(*column)
                }
                Some(Type::Vector { component, .. }) => {
                    known = Some(PointeeLayout::default());
                    Some(*component)
                }
                Some(Type::Array { element, .. } | Type::RuntimeArray { element, .. }) => Some(*element),
                _ => break,
            };
        }
        match (known, steps, selection) {
            (Some(layout), ..) => Some(selection.of(layout)),
            (None, Selection::Column, Selection::Column) => Some(PointeeLayout::default()),
            (None, Selection::Column, Selection::Whole) => {
                self.worklist.push((base, Selection::Column));
                None
            }
            (None, Selection::Whole, selection) => {
                self.worklist.push((base, selection));
                None
            }
        }
    }
}

/// The pointers that a phi, a select or a copy gives one of; `None` for another instruction.
pub(super) fn sources(opcode: Opcode, operands: &[u32]) -> Option<impl Iterator<Item = Id>> {
    let (first, step, end) = match opcode {
        Opcode::Phi => (0, 2, operands.len()),
        Opcode::Select => (1, 1, operands.len()),
        Opcode::CopyObject | Opcode::FreezeKHR => (0, 1, 1),
        _ => return None,
    };
    let sources = operands.get(first..end).unwrap_or_default();
    Some(sources.iter().step_by(step).map(|&id| Id(id)))
}

/// The values that a function returns.
pub(super) fn returned(module: &Module, function: u32) -> impl Iterator<Item = Id> {
    let blocks = module.functions[function as usize].blocks.iter();
    let last = blocks.filter_map(|block| block.instructions.last());
    let returns = last.filter(|one| one.opcode == Opcode::ReturnValue);
    returns.map(|one| Id(module.operands(one)[0]))
}
