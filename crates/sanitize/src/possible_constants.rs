//! The constants that a value of a module can be, whatever the inputs.

use rustc_hash::FxHashMap;

use anyhit_engine::module::{Id, Module, Opcode};

/// Finds the constants that values of a module can be, through variables, arguments and choices.
#[derive(Debug)]
pub(super) struct PossibleConstants<'a> {
    module: &'a Module,
    /// By pointer: what is stored through it.
    stored: FxHashMap<Id, Vec<Id>>,
    /// By parameter: what calls pass for it.
    arguments: FxHashMap<Id, Vec<Id>>,
}

impl<'a> PossibleConstants<'a> {
    /// Of the values of a module.
    pub(super) fn of(module: &'a Module) -> Self {
        let mut constants = Self { module, stored: FxHashMap::default(), arguments: FxHashMap::default() };
        for instruction in module.instructions() {
            match (instruction.opcode, module.operands(instruction)) {
                (Opcode::Store, &[pointer, object, ..]) => {
                    constants.stored.entry(Id(pointer)).or_default().push(Id(object));
                }
                (Opcode::FunctionCall, [callee, passed @ ..]) => {
                    let Some(callee) = module.function(Id(*callee)) else { continue };
                    for (&(parameter, _), &argument) in callee.parameters.iter().zip(passed) {
                        constants.arguments.entry(parameter).or_default().push(Id(argument));
                    }
                }
                _ => {}
            }
        }
        constants
    }

    /// The low 32 bits of the constants that a value can be, ascending; `None` where it may be
    /// something else.
    pub(super) fn values(&self, value: Id) -> Option<Vec<u32>> {
        let mut found = Vec::new();
        self.follow(value, &mut Vec::new(), &mut found)?;
        found.sort_unstable();
        found.dedup();
        Some(found)
    }

    /// Adds the constants that a value can be; `None` where it may be something else.
    fn follow(&self, value: Id, seen: &mut Vec<Id>, found: &mut Vec<u32>) -> Option<()> {
        if let Some(constant) = self.module.scalar_value(value) {
            found.push(constant as u32);
            return Some(());
        }
        // A value that depends on itself adds nothing new.
        if seen.contains(&value) {
            return Some(());
        }
        seen.push(value);
        let mut all = |ids: &[Id]| ids.iter().try_for_each(|&id| self.follow(id, seen, found));
        let sources = [&self.stored, &self.arguments].into_iter().find_map(|map| map.get(&value));
        if let Some(sources) = sources {
            return all(sources);
        }
        let instruction = self.module.result_instruction(value)?;
        let operands = self.module.operands(instruction);
        match (instruction.opcode, operands) {
            (
                Opcode::Load
                | Opcode::CopyObject
                | Opcode::FreezeKHR
                | Opcode::Bitcast
                | Opcode::UConvert
                | Opcode::SConvert,
                &[operand, ..],
            ) => all(&[Id(operand)]),
            (Opcode::Select, &[_, then, other]) => all(&[Id(then), Id(other)]),
            (Opcode::Phi, pairs) => pairs.iter().step_by(2).try_for_each(|&id| all(&[Id(id)])),
            _ => None,
        }
    }
}
