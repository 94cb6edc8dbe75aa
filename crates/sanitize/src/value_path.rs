//! The way of a value through the named variables and values of a shader, from the instruction that
//! made it to the one that uses it.

use rustc_hash::FxHashMap;

use anyhit_engine::module::{Definition, Id, Module, Opcode};

/// How the ids of a module's functions are made of each other.
struct Sources<'a> {
    module: &'a Module,
    /// By variable or parameter: what is stored to it or to a part of it.
    stored: FxHashMap<Id, Vec<Id>>,
    /// By parameter: what calls pass for it.
    arguments: FxHashMap<Id, Vec<Id>>,
    /// By function: what it returns.
    returned: FxHashMap<Id, Vec<Id>>,
}

impl<'a> Sources<'a> {
    fn new(module: &'a Module) -> Self {
        let (stored, arguments, returned) = Default::default();
        let mut sources = Self { module, stored, arguments, returned };
        for function in &module.functions {
            for instruction in function.instructions() {
                let operands = module.operands(instruction);
                match (instruction.opcode, operands) {
                    (Opcode::Store, &[pointer, object, ..]) => {
                        let variable = sources.root(Id(pointer));
                        sources.stored.entry(variable).or_default().push(Id(object));
                    }
                    (Opcode::FunctionCall, [callee, passed @ ..]) => {
                        let Some(callee) = module.function(Id(*callee)) else { continue };
                        for (&(parameter, _), &argument) in callee.parameters.iter().zip(passed) {
                            sources.arguments.entry(parameter).or_default().push(Id(argument));
                        }
                    }
                    (Opcode::ReturnValue, &[value]) => {
                        sources.returned.entry(function.id).or_default().push(Id(value));
                    }
                    _ => {}
                }
            }
        }
        sources
    }

    /// The variable or parameter that a pointer points into.
    fn root(&self, pointer: Id) -> Id {
        let mut at = pointer;
        while let Some(made) = self.module.result_instruction(at)
            && let Some(chain) = self.module.access_chain(made)
        {
            at = chain.base;
        }
        at
    }

    /// The ids that an id is made of.
    fn of(&self, id: Id) -> Vec<Id> {
        let mut all: Vec<Id> = [&self.stored, &self.arguments]
            .into_iter()
            .filter_map(|map| map.get(&id))
            .flatten()
            .copied()
            .collect();
        let Some(instruction) = self.module.result_instruction(id) else { return all };
        match instruction.opcode {
            Opcode::Variable => {}
            Opcode::FunctionCall => {
                let operands = self.module.operand_ids(instruction);
                all.extend(
                    operands.first().and_then(|callee| self.returned.get(callee)).into_iter().flatten(),
                );
                // What a callee stores through a pointer that it is given.
                all.extend(operands.into_iter().skip(1));
            }
            _ if self.module.access_chain(instruction).is_some() => all.push(self.root(id)),
            _ => all.extend(self.module.operand_ids(instruction)),
        }
        all
    }
}

/// The names of what a value goes through from the instruction that made it to one that uses it, on
/// the shortest way; both instructions are told by their word offsets. Empty where the value goes
/// through nothing with a name, or its way is not known.
pub(super) fn names_on_path(module: &Module, user: u32, maker: u32) -> Vec<String> {
    let sources = Sources::new(module);
    let user = module.instructions().find(|one| one.offset == user);
    let Some(user) = user else { return Vec::new() };
    let mut open: Vec<(Id, Option<usize>)> =
        module.operand_ids(user).into_iter().map(|id| (id, None)).collect();
    let mut at = 0;
    while let Some(&(id, _)) = open.get(at) {
        if module.result_instruction(id).is_some_and(|made| made.offset == maker) {
            let way = std::iter::successors(Some(at), |&at| open[at].1);
            let mut names: Vec<String> = way.filter_map(|at| name_of_value(module, open[at].0)).collect();
            names.dedup();
            return names;
        }
        for next in sources.of(id) {
            if open.iter().all(|(seen, _)| *seen != next) {
                open.push((next, Some(at)));
            }
        }
        at += 1;
    }
    Vec::new()
}

/// The name of a variable, parameter or value.
fn name_of_value(module: &Module, id: Id) -> Option<String> {
    let has_value = matches!(
        module.definition(id)?,
        Definition::Variable(_) | Definition::Parameter(..) | Definition::Result(..)
    );
    let name = module.name(id).filter(|name| has_value && !name.is_empty());
    name.map(str::to_owned)
}
