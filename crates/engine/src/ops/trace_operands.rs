//! Offset, stride and miss index of the rays that a module traces, where they are constants.

use crate::module::{Definition, Id, Instruction, Module, Opcode};
use anyhit_base::sorted::SortedSet;

/// How many values are followed one after the other to constants.
const DEPTH: u32 = 32;

/// The constants that the operands of an instruction which traces a ray may be; `None` where they
/// may be something else.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TraceOperands {
    /// `SBT Offset`
    pub sbt_offset: Option<SortedSet<u64>>,
    /// `SBT Stride`
    pub sbt_stride: Option<SortedSet<u64>>,
    /// `Miss Index`
    pub miss_index: Option<SortedSet<u64>>,
}

impl TraceOperands {
    /// Every instruction of a module that traces a ray.
    pub fn all(module: &Module) -> impl Iterator<Item = Self> + '_ {
        instructions(module).filter_map(move |(_, instruction)| {
            let first = match instruction.opcode {
                Opcode::TraceRayKHR | Opcode::TraceRayMotionNV | Opcode::TraceNV | Opcode::TraceMotionNV => 3,
                // Behind the hit object.
                Opcode::HitObjectTraceRayEXT
                | Opcode::HitObjectTraceRayNV
                | Opcode::HitObjectTraceRayMotionEXT
                | Opcode::HitObjectTraceRayMotionNV
                | Opcode::HitObjectTraceReorderExecuteEXT
                | Opcode::HitObjectTraceMotionReorderExecuteEXT => 4,
                _ => return None,
            };
            let operands = module.operands(instruction);
            let values = |at: usize| possible_constants(module, Id(*operands.get(at)?));
            Some(Self {
                sbt_offset: values(first),
                sbt_stride: values(first + 1),
                miss_index: values(first + 2),
            })
        })
    }
}

/// All instructions with the index of their function.
fn instructions(module: &Module) -> impl Iterator<Item = (u32, &Instruction)> {
    module
        .functions
        .iter()
        .enumerate()
        .flat_map(|(at, function)| function.instructions().map(move |instruction| (at as u32, instruction)))
}

/// The constants that a value may be; `None` where it may be something else.
pub fn possible_constants(module: &Module, id: Id) -> Option<SortedSet<u64>> {
    values(module, id, DEPTH)
}

/// As [`possible_constants`], to a depth.
fn values(module: &Module, id: Id, depth: u32) -> Option<SortedSet<u64>> {
    let depth = depth.checked_sub(1)?;
    if let Some(constant) = module.scalar_value(id) {
        return Some(SortedSet::from([constant]));
    }
    match module.definition(id)? {
        Definition::Parameter(function, parameter) => {
            let arguments = arguments(module, function, parameter);
            merge(arguments.map(|(_, id)| values(module, id, depth)))
        }
        Definition::Result(function, block, at) => {
            let instruction =
                &module.functions[function as usize].blocks[block as usize].instructions[at as usize];
            let operands = module.operands(instruction);
            let operand = |at: usize| values(module, Id(*operands.get(at)?), depth);
            match instruction.opcode {
                Opcode::CopyObject | Opcode::FreezeKHR | Opcode::Bitcast | Opcode::UConvert => operand(0),
                Opcode::Select => merge([operand(1), operand(2)].into_iter()),
                Opcode::Load => stored(module, function, Id(*operands.first()?), depth),
                _ => None,
            }
        }
        _ => None,
    }
}

/// The constants that a variable of a function, or what a parameter points to, may hold.
fn stored(module: &Module, function: u32, pointer: Id, depth: u32) -> Option<SortedSet<u64>> {
    let depth = depth.checked_sub(1)?;
    // Other functions store to a variable of the module, too.
    let (Definition::Parameter(..) | Definition::Result(..)) = module.definition(pointer)? else {
        return None;
    };
    let mut found = Vec::new();
    for (_, instruction) in instructions(module).filter(|(at, _)| *at == function) {
        let operands = module.operands(instruction);
        let names_it = operands.contains(&pointer.0);
        match instruction.opcode {
            Opcode::Store if operands.first() == Some(&pointer.0) => {
                found.push(values(module, Id(*operands.get(1)?), depth));
            }
            Opcode::Variable if instruction.result == Some(pointer) => {
                found.extend(operands.get(1).map(|id| values(module, Id(*id), depth)));
            }
            // A function that is given the variable may store to it.
            Opcode::FunctionCall if names_it => {
                let parameter = operands.iter().skip(1).position(|id| *id == pointer.0)?;
                let Definition::Function(callee) = module.definition(Id(*operands.first()?))? else {
                    return None;
                };
                let (own, _) = module.functions[callee as usize].parameters.get(parameter)?;
                if is_written(module, callee, *own) {
                    return None;
                }
            }
            Opcode::Load => {}
            _ if names_it => return None,
            _ => {}
        }
    }
    if let Some(Definition::Parameter(function, parameter)) = module.definition(pointer) {
        let arguments = arguments(module, function, parameter);
        found.extend(arguments.map(|(caller, id)| stored(module, caller, id, depth)));
    }
    merge(found.into_iter())
}

/// Whether a function does anything with a pointer but load from it.
fn is_written(module: &Module, function: u32, pointer: Id) -> bool {
    let mut others = instructions(module).filter(|(at, _)| *at == function);
    others.any(|(_, instruction)| {
        instruction.opcode != Opcode::Load && module.operands(instruction).contains(&pointer.0)
    })
}

/// What callers give for a parameter: the caller's index and the argument.
fn arguments(module: &Module, function: u32, parameter: u32) -> impl Iterator<Item = (u32, Id)> + '_ {
    let callee = module.functions[function as usize].id;
    instructions(module).filter_map(move |(caller, instruction)| {
        let operands = module.operands(instruction);
        let is_call = instruction.opcode == Opcode::FunctionCall;
        let is_call = is_call && operands.first() == Some(&callee.0);
        is_call.then(|| Some((caller, Id(*operands.get(parameter as usize + 1)?))))?
    })
}

/// All values of several operands; `None` where there are none, or some are not known.
pub fn merge(all: impl Iterator<Item = Option<SortedSet<u64>>>) -> Option<SortedSet<u64>> {
    let both = |a: Option<SortedSet<u64>>, b: Option<SortedSet<u64>>| {
        let mut all = a?;
        all.extend(b?);
        Some(all)
    };
    all.reduce(both).flatten()
}
