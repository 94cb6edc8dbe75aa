//! What shaders say of the shader binding table: offset, stride and miss index of their rays, where
//! these are constants.

use std::collections::BTreeSet;
use std::fmt::Write;

use rspirv::spirv::Op;

use crate::harness::init::Shader;
use crate::module::{Definition, Id, Instruction, Module};

/// How many values are followed one after the other to constants.
const DEPTH: u32 = 32;

/// Records of one kind that a scene is written with at most.
const MOST: u64 = 16;

/// What a shader binding table needs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BindingTable {
    /// The hit groups that follow each other for one instance, for rays of several kinds.
    pub groups_of_instance: usize,
    /// Null records behind each hit group.
    pub null_records: usize,
    /// The miss records.
    pub miss: usize,
    /// Why, in comments.
    pub comment: String,
}

impl BindingTable {
    /// The table for the rays of some shaders, with so many hit groups and miss shaders.
    pub fn of(shaders: &[Shader], groups: usize, miss: usize) -> Self {
        let mut table = Self { groups_of_instance: 1, null_records: 0, miss, comment: String::new() };
        let mut traces: Vec<(&str, Operands)> = Vec::new();
        for (at, shader) in shaders.iter().enumerate() {
            // All functions of a module are looked at, once.
            let is_known = shaders[..at].iter().any(|one| std::ptr::eq(&*one.module, &*shader.module));
            if !is_known {
                traces.extend(Operands::all(&shader.module).map(|found| (shader.reference.as_str(), found)));
            }
        }
        if traces.is_empty() {
            return table;
        }
        let offsets = union(traces.iter().map(|(_, found)| &found.sbt_offset));
        let strides = union(traces.iter().map(|(_, found)| &found.sbt_stride));
        let misses = union(traces.iter().map(|(_, found)| &found.miss_index));
        let mut unknown = Vec::new();
        for (name, values) in [("SBT offset", &offsets), ("SBT stride", &strides), ("miss index", &misses)] {
            if values.is_none() {
                unknown.push(name);
            }
        }
        let known = [("SBT offset", &offsets), ("SBT stride", &strides), ("miss index", &misses)];
        let known = known.iter().filter_map(|(name, values)| Some((name, list(values.as_ref()?))));
        let known: Vec<_> = known.map(|(name, values)| format!("{name} {values}")).collect();
        // Writing to a string does not fail.
        if !known.is_empty() {
            let _ = writeln!(table.comment, "# Rays are traced with {}.", known.join(", "));
        }
        if !unknown.is_empty() {
            let mut names: Vec<_> = traces.iter().map(|(name, _)| format!("`{name}`")).collect();
            names.dedup();
            let _ = writeln!(
                table.comment,
                "# {} of rays in {} are no constants: give the records that they ask for.",
                unknown.join(" and "),
                names.join(", ")
            );
        }
        if let Some(last) = misses.as_ref().and_then(|all| all.last()).filter(|last| **last < MOST) {
            table.miss = table.miss.max(*last as usize + 1);
        }
        let _ = writeln!(
            table.comment,
            "# A hit's record is the instance's sbt_offset + geometry index x SBT stride + SBT offset."
        );
        // Each instance has one geometry, so that its records end at the greatest offset.
        if let Some(last) =
            offsets.as_ref().and_then(|all| all.last()).filter(|last| (1..MOST).contains(*last))
        {
            let records = *last as usize + 1;
            if groups > 0 && groups.is_multiple_of(records) {
                table.groups_of_instance = records;
            } else {
                table.null_records = records - 1;
            }
        }
        table
    }
}

/// `0`, `0 and 1`, `0, 1 and 2`
fn list(values: &BTreeSet<u64>) -> String {
    let words: Vec<_> = values.iter().map(u64::to_string).collect();
    match words.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => words.concat(),
    }
}

/// All values; `None` where some are not known.
fn union<'a>(all: impl Iterator<Item = &'a Option<BTreeSet<u64>>>) -> Option<BTreeSet<u64>> {
    all.cloned().reduce(|a, b| Some(&a? | &b?)).flatten()
}

/// The operands of an instruction that traces a ray; `None` where they are no constants.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Operands {
    sbt_offset: Option<BTreeSet<u64>>,
    sbt_stride: Option<BTreeSet<u64>>,
    miss_index: Option<BTreeSet<u64>>,
}

impl Operands {
    fn all(module: &Module) -> impl Iterator<Item = Self> + '_ {
        instructions(module).filter_map(move |(_, instruction)| {
            let first = match Op::from_u32(instruction.opcode.into())? {
                Op::TraceRayKHR | Op::TraceRayMotionNV | Op::TraceNV | Op::TraceMotionNV => 3,
                // Behind the hit object.
                Op::HitObjectTraceRayEXT
                | Op::HitObjectTraceRayNV
                | Op::HitObjectTraceRayMotionEXT
                | Op::HitObjectTraceRayMotionNV
                | Op::HitObjectTraceReorderExecuteEXT
                | Op::HitObjectTraceMotionReorderExecuteEXT => 4,
                _ => return None,
            };
            let operands = module.operands(instruction);
            let values = |at: usize| values(module, Id(*operands.get(at)?), DEPTH);
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
    module.functions.iter().enumerate().flat_map(|(at, function)| {
        let all = function.blocks.iter().flat_map(|block| &block.instructions);
        all.map(move |instruction| (at as u32, instruction))
    })
}

/// The constants that a value may be; `None` where it may be something else.
fn values(module: &Module, id: Id, depth: u32) -> Option<BTreeSet<u64>> {
    let depth = depth.checked_sub(1)?;
    if let Some(constant) = module.scalar_value(id) {
        return Some(BTreeSet::from([constant]));
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
            match Op::from_u32(instruction.opcode.into())? {
                Op::CopyObject | Op::Bitcast | Op::UConvert => operand(0),
                Op::Select => merge([operand(1), operand(2)].into_iter()),
                Op::Load => stored(module, function, Id(*operands.first()?), depth),
                _ => None,
            }
        }
        _ => None,
    }
}

/// The constants that a variable of a function, or what a parameter points to, may hold.
fn stored(module: &Module, function: u32, pointer: Id, depth: u32) -> Option<BTreeSet<u64>> {
    let depth = depth.checked_sub(1)?;
    // Other functions store to a variable of the module, too.
    let (Definition::Parameter(..) | Definition::Result(..)) = module.definition(pointer)? else {
        return None;
    };
    let mut found = Vec::new();
    for (_, instruction) in instructions(module).filter(|(at, _)| *at == function) {
        let operands = module.operands(instruction);
        let names_it = operands.contains(&pointer.0);
        match Op::from_u32(instruction.opcode.into())? {
            Op::Store if operands.first() == Some(&pointer.0) => {
                found.push(values(module, Id(*operands.get(1)?), depth));
            }
            Op::Variable if instruction.result == Some(pointer) => {
                found.extend(operands.get(1).map(|id| values(module, Id(*id), depth)));
            }
            // A function that is given the variable may store to it.
            Op::FunctionCall if names_it => {
                let parameter = operands.iter().skip(1).position(|id| *id == pointer.0)?;
                let Definition::Function(callee) = module.definition(Id(*operands.first()?))? else {
                    return None;
                };
                let (own, _) = module.functions[callee as usize].parameters.get(parameter)?;
                if is_written(module, callee, *own) {
                    return None;
                }
            }
            Op::Load => {}
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
        Op::from_u32(instruction.opcode.into()) != Some(Op::Load)
            && module.operands(instruction).contains(&pointer.0)
    })
}

/// What callers give for a parameter: the caller's index and the argument.
fn arguments(module: &Module, function: u32, parameter: u32) -> impl Iterator<Item = (u32, Id)> + '_ {
    let callee = module.functions[function as usize].id;
    instructions(module).filter_map(move |(caller, instruction)| {
        let operands = module.operands(instruction);
        let is_call = Op::from_u32(instruction.opcode.into()) == Some(Op::FunctionCall);
        let is_call = is_call && operands.first() == Some(&callee.0);
        is_call.then(|| Some((caller, Id(*operands.get(parameter as usize + 1)?))))?
    })
}

/// All values of some; `None` where there are none, or some are not known.
fn merge(all: impl Iterator<Item = Option<BTreeSet<u64>>>) -> Option<BTreeSet<u64>> {
    all.reduce(|a, b| Some(&a? | &b?)).flatten()
}
