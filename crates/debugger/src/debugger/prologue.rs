//! Where the body of a function begins: behind what compilers put before its first statement.

use std::collections::HashSet;

use anyhit_engine::module::debug_scopes::LocationForm;
use anyhit_engine::module::{Function, Id, Instruction, Module, Opcode};

/// The word offset from which on the instructions of a function are those of its statements. Before
/// it are its variables, and the stores that give its parameters variables of their own: there
/// nothing has a value yet.
pub(super) fn body_offset(module: &Module, function: &Function) -> u32 {
    let Some(first) = function.blocks.first() else { return function.offset };
    let own_variables = variables_of_parameters(module, function);
    let (mut body, mut line) = (first.offset, None);
    // The pointers to those variables and to parts of them.
    let mut pointers = own_variables;
    for (at, instruction) in first.instructions.iter().enumerate() {
        let next = first.instructions.get(at + 1).map_or(instruction.offset, |next| next.offset);
        match instruction.opcode {
            Opcode::Variable => body = next,
            opcode if opcode.is_undefined() => body = next,
            // Another line is a statement's.
            _ if *line.get_or_insert(line_of(module, instruction)) != line_of(module, instruction) => break,
            Opcode::Load | Opcode::CompositeExtract | Opcode::CopyObject | Opcode::FreezeKHR => {}
            opcode if opcode.selects_part() => {
                let chain = module.access_chain(instruction);
                let is_known = chain.is_some_and(|chain| pointers.contains(&chain.base));
                pointers.extend(instruction.result.filter(|_| is_known));
            }
            Opcode::Store
                if module.operands(instruction).first().is_some_and(|&to| pointers.contains(&Id(to))) =>
            {
                body = next;
            }
            _ => break,
        }
    }
    body
}

/// The line of an instruction, with its file.
fn line_of(module: &Module, instruction: &Instruction) -> Option<(u32, u32)> {
    module.debug_info.line_at(instruction.offset).map(|line| (line.file, line.line))
}

/// The variables of a function that debug information declares as its parameters: the compiler
/// stores there what the function is given.
fn variables_of_parameters(module: &Module, function: &Function) -> HashSet<Id> {
    let debug = module.debug_scopes();
    let all = debug.locations_between(function.offset, module.end_of(function)).iter();
    let declared = all.filter(|one| one.form == LocationForm::Declared && one.inlined.is_none());
    let is_parameter =
        |variable: u32| debug.variables.get(variable as usize).is_some_and(|one| one.argument > 0);
    let of_parameters = declared.filter(|one| is_parameter(one.variable)).map(|one| one.value);
    of_parameters.filter(|id| function.parameters.iter().all(|(parameter, _)| parameter != id)).collect()
}
