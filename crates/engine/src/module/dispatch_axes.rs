//! Which axes of a dispatch or launch a shader asks for: the components of `GlobalInvocationId` and
//! `WorkgroupId`, or of `LaunchIdKHR`, that it reads.

use rspirv::spirv::BuiltIn;
use rustc_hash::FxHashSet;

use crate::module::decoration::number;
use crate::module::ty::Type;
use crate::module::{Definition, Id, Instruction, Module, Opcode};

/// What the invocations of a shader lie in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grid {
    /// A dispatch of workgroups.
    Dispatch,
    /// A launch of ray generation shaders.
    Launch,
}

impl Grid {
    /// The builtins that tell where in it an invocation stands.
    fn places(self) -> &'static [BuiltIn] {
        match self {
            Self::Dispatch => &[BuiltIn::GlobalInvocationId, BuiltIn::WorkgroupId],
            Self::Launch => &[BuiltIn::LaunchIdKHR],
        }
    }
}

/// The components of the builtins for a place in a grid that the functions of a module read, as far
/// as their way is seen: through loads, copies, local variables and calls.
pub fn axes_read(module: &Module, grid: Grid) -> [bool; 3] {
    let asks = |id: &Id| {
        let builtin = module.decorations.literal(*id, number::BUILT_IN).and_then(BuiltIn::from_u32);
        builtin.is_some_and(|builtin| grid.places().contains(&builtin))
    };
    // Vectors and pointers to them.
    let mut whole: FxHashSet<Id> = module.variables.iter().map(|variable| variable.id).filter(asks).collect();
    let mut read = [false; 3];
    loop {
        let known = whole.len();
        for instruction in module.instructions() {
            follow(module, instruction, &mut whole, &mut read);
        }
        if whole.len() == known || read == [true; 3] {
            return read;
        }
    }
}

/// Follows vectors of three components, and pointers to them, through an instruction.
fn follow(module: &Module, instruction: &Instruction, whole: &mut FxHashSet<Id>, read: &mut [bool; 3]) {
    let operands = module.operands(instruction);
    let is_whole = |id: u32| whole.contains(&Id(id));
    if let Some(chain) = module.access_chain(instruction)
        && let [index] = chain.indices
        && is_whole(chain.base.0)
    {
        read_component(read, module.scalar_value(Id(*index)));
        return;
    }
    match (instruction.opcode, operands) {
        (Opcode::Load | Opcode::CopyObject | Opcode::FreezeKHR | Opcode::Bitcast, &[from, ..])
            if is_whole(from) =>
        {
            whole.extend(instruction.result);
        }
        (Opcode::CompositeExtract, &[vector, at]) if is_whole(vector) => {
            read_component(read, Some(at.into()));
        }
        (Opcode::VectorShuffle, &[left, right, ref components @ ..]) if is_whole(left) => {
            let of_left = components.iter().filter(|&&at| at < 3);
            of_left.for_each(|&at| read_component(read, Some(at.into())));
            if is_whole(right) {
                let of_right = components.iter().filter_map(|at| at.checked_sub(3));
                of_right.for_each(|at| read_component(read, Some(at.into())));
            }
        }
        (Opcode::Store, &[pointer, value, ..]) => {
            if is_whole(value) && is_variable(module, Id(pointer)) {
                whole.insert(Id(pointer));
            } else if is_whole(value) {
                *read = [true; 3];
            }
        }
        (Opcode::FunctionCall, &[callee, ref arguments @ ..]) => {
            let Some(callee) = module.function(Id(callee)) else { return };
            for (&(parameter, _), &argument) in callee.parameters.iter().zip(arguments) {
                if whole.contains(&Id(argument)) {
                    whole.insert(parameter);
                }
            }
        }
        // What only debug information says of it.
        (Opcode::ExtInst, _) if is_void(module, instruction) => {}
        _ if module.operand_ids(instruction).iter().any(|id| whole.contains(id)) => *read = [true; 3],
        _ => {}
    }
}

/// Notes that a component is read; all of them, where it is not known which.
fn read_component(read: &mut [bool; 3], at: Option<u64>) {
    match at.and_then(|at| read.get_mut(usize::try_from(at).ok()?)) {
        Some(is_read) => *is_read = true,
        None => *read = [true; 3],
    }
}

/// Whether an id is a variable, not a part of one.
fn is_variable(module: &Module, id: Id) -> bool {
    match module.definition(id) {
        Some(Definition::Variable(_)) => true,
        Some(Definition::Result(function, block, at)) => {
            let block = &module.functions[function as usize].blocks[block as usize];
            block.instructions[at as usize].opcode == Opcode::Variable
        }
        _ => false,
    }
}

/// Whether an instruction has no value.
fn is_void(module: &Module, instruction: &Instruction) -> bool {
    let ty = instruction.result_type.and_then(|ty| module.type_with_id(ty));
    ty.is_some_and(|ty| *module.ty(ty) == Type::Void)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::module::assemble::Assembler;

    /// The axes of a shader that uses the `GlobalInvocationId` that it loads, `%41`:
    /// `%5` is the type of unsigned integers, `%50` of vectors of three.
    fn axes_of(uses: impl FnOnce(&mut Assembler)) -> [bool; 3] {
        let mut a = Assembler::new();
        a.op(Opcode::Decorate, &[35, 11, BuiltIn::GlobalInvocationId as u32]);
        a.types();
        a.op(Opcode::TypeVector, &[50, 5, 3]);
        a.op(Opcode::TypePointer, &[51, 1, 50]);
        a.op(Opcode::TypePointer, &[52, 7, 50]);
        a.op(Opcode::Variable, &[51, 35, 1]);
        a.function(30, 31, |a| {
            a.op(Opcode::Variable, &[52, 40, 7]);
            a.op(Opcode::Load, &[50, 41, 35]);
            uses(a);
            a.op(Opcode::Return, &[]);
        });
        let module = a.loaded();
        assert_eq!(axes_read(&module, Grid::Launch), [false; 3], "it is in a dispatch");
        axes_read(&module, Grid::Dispatch)
    }

    #[test]
    fn an_axis_is_read_where_its_component_is() {
        let x = axes_of(|a| _ = a.op(Opcode::CompositeExtract, &[5, 42, 41, 0]));
        let y = axes_of(|a| {
            a.op(Opcode::Store, &[40, 41]);
            a.op(Opcode::Load, &[50, 42, 40]);
            a.op(Opcode::CompositeExtract, &[5, 43, 42, 1]);
        });
        let both = axes_of(|a| _ = a.op(Opcode::VectorShuffle, &[50, 42, 41, 41, 1, 3, 1]));
        let all = axes_of(|a| _ = a.op(Opcode::IAdd, &[50, 42, 41, 41]));
        let [no, yes] = [false, true];
        assert_eq!([x, y, both, all], [[yes, no, no], [no, yes, no], [yes, yes, no], [yes; 3]]);
        assert_eq!(axes_of(|_| ()), [no; 3]);
    }
}
