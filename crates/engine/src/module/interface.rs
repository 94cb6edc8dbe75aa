//! Entry points: their stages, execution modes and interface variables.

use std::collections::HashSet;

use rspirv::spirv::Decoration;

use crate::module::ty::TypeId;
use crate::module::{Definition, Id, Module};

pub use anyhit_base::error::Stage;

/// An `OpEntryPoint` with its execution modes.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EntryPoint {
    /// The execution model.
    pub stage: Stage,
    /// The name; several entry points of one module may share it under different models.
    pub name: String,
    /// The function's id.
    #[doc(hidden)]
    pub function: Id,
    /// Ids of the interface variables.
    #[doc(hidden)]
    pub interface: Vec<Id>,
    /// Execution modes (`OpExecutionMode`, `OpExecutionModeId`): number and operand words.
    #[doc(hidden)]
    pub modes: Vec<(u32, Vec<u32>)>,
    /// The word offset of its instruction.
    #[doc(hidden)]
    pub offset: u32,
}

/// A variable of module scope that an entry point uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InterfaceVariable {
    /// The result id of its `OpVariable`.
    pub id: Id,
    /// The storage class's number.
    pub storage_class: u32,
    /// The type pointed to; `None` for untyped variables.
    pub ty: Option<TypeId>,
    /// Its name in the source; where a block has no name as a variable, its name as a type; else
    /// empty.
    pub name: String,
    /// `BuiltIn`: the builtin's number.
    pub builtin: Option<u32>,
    /// `DescriptorSet`.
    pub descriptor_set: Option<u32>,
    /// `Binding`.
    pub binding: Option<u32>,
    /// `Location`.
    pub location: Option<u32>,
}

impl Module {
    /// The module-scope variables that an entry point's call tree uses, in the module's order.
    ///
    /// Before SPIR-V 1.4 `OpEntryPoint` lists Input and Output variables only, and from 1.4 on
    /// compilers list more than is used. So this looks at the instructions instead. A variable that
    /// initializes a used one is used, too.
    #[doc(hidden)]
    pub fn interface_of(&self, entry_point: &EntryPoint) -> Vec<InterfaceVariable> {
        let mut used = vec![false; self.variables.len()];
        for function in self.call_tree(entry_point.function) {
            let named = &self.functions[function as usize].variables;
            named.iter().for_each(|&variable| used[variable as usize] = true);
        }
        // An initializer that is a variable precedes the variable that it initializes.
        for (at, variable) in self.variables.iter().enumerate().rev() {
            let initializer = variable.initializer.and_then(|id| self.definition(id));
            if let (true, Some(Definition::Variable(index))) = (used[at], initializer) {
                used[index as usize] = true;
            }
        }
        let literal = |id: Id, decoration: Decoration| self.decorations.literal(id, decoration as u32);
        self.variables
            .iter()
            .zip(used)
            .filter_map(|(variable, used)| used.then_some(variable))
            .map(|variable| {
                let ty = variable.ty;
                let name = self.name(variable.id).or_else(|| self.name(self.id_of_type(ty?)?));
                InterfaceVariable {
                    id: variable.id,
                    storage_class: variable.storage_class,
                    ty,
                    name: name.unwrap_or_default().to_owned(),
                    builtin: literal(variable.id, Decoration::BuiltIn),
                    descriptor_set: literal(variable.id, Decoration::DescriptorSet),
                    binding: literal(variable.id, Decoration::Binding),
                    location: literal(variable.id, Decoration::Location),
                }
            })
            .collect()
    }

    /// Indices of the functions that are reachable from a function by calls, itself first, each
    /// once.
    #[doc(hidden)]
    pub fn call_tree(&self, function: Id) -> Vec<u32> {
        let index_of = |id: Id| match self.definition(id) {
            Some(Definition::Function(index)) => Some(index),
            _ => None,
        };
        let mut order: Vec<u32> = index_of(function).into_iter().collect();
        let mut seen: HashSet<u32> = order.iter().copied().collect();
        let mut next = 0;
        while let Some(&function) = order.get(next) {
            next += 1;
            let calls = self.functions[function as usize].calls.iter().copied();
            order.extend(calls.filter(|&callee| seen.insert(callee)));
        }
        order
    }
}

#[cfg(test)]
mod tests {
    use crate::module::Opcode;
    use pretty_assertions::assert_eq;

    use super::*;
    use crate::module::assemble::Assembler;

    /// Two entry points and a shared function: `%20` a builtin, `%21` a buffer, `%22` unused.
    fn module() -> Module {
        let mut a = Assembler::new();
        a.with_string(Opcode::EntryPoint, &[5316, 30], "hit", &[]);
        a.with_string(Opcode::EntryPoint, &[5317, 40], "miss", &[]);
        a.with_string(Opcode::Name, &[21], "image", &[]);
        a.op(Opcode::Decorate, &[20, 11, 5330]);
        a.op(Opcode::Decorate, &[21, 34, 1]);
        a.op(Opcode::Decorate, &[21, 33, 2]);
        a.op(Opcode::Decorate, &[23, 30, 6]);
        a.types();
        a.op(Opcode::TypePointer, &[10, 1, 6]);
        a.op(Opcode::TypePointer, &[11, 12, 6]);
        a.op(Opcode::TypePointer, &[12, 5342, 6]);
        a.op(Opcode::Variable, &[10, 20, 1]);
        a.op(Opcode::Variable, &[11, 21, 12]);
        a.op(Opcode::Variable, &[11, 22, 12]);
        a.op(Opcode::Variable, &[12, 23, 5342]);
        a.function(30, 31, |a| {
            a.op(Opcode::Load, &[6, 32, 20]);
            a.op(Opcode::FunctionCall, &[1, 33, 50]);
            a.op(Opcode::FunctionCall, &[1, 34, 50]);
            a.op(Opcode::Return, &[]);
        });
        a.function(40, 41, |a| {
            // %22 is a literal here: the alignment.
            a.op(Opcode::Load, &[6, 42, 23, 2, 22]);
            a.op(Opcode::Return, &[]);
        });
        a.function(50, 51, |a| {
            a.op(Opcode::Load, &[6, 52, 21]);
            a.op(Opcode::Return, &[]);
        });
        a.loaded()
    }

    #[test]
    fn the_call_tree_decides_what_is_used() {
        let module = module();
        let hit = module.interface_of(&module.entry_points[0]);
        assert_eq!(hit.iter().map(|one| one.id).collect::<Vec<_>>(), [Id(20), Id(21)]);
        assert_eq!((hit[0].storage_class, hit[0].builtin), (1, Some(5330)));
        assert_eq!(
            (hit[1].name.as_str(), hit[1].descriptor_set, hit[1].binding),
            ("image", Some(1), Some(2))
        );
        assert_eq!(module.describe_type(hit[1].ty.unwrap()), "float");
        let miss = module.interface_of(&module.entry_points[1]);
        assert_eq!(miss.iter().map(|one| (one.id, one.location)).collect::<Vec<_>>(), [(Id(23), Some(6))]);
    }

    #[test]
    fn each_function_of_the_call_tree_stands_once() {
        let module = module();
        assert_eq!(module.call_tree(Id(30)), [0, 2]);
        assert_eq!(module.call_tree(Id(40)), [1]);
        assert!(module.call_tree(Id(20)).is_empty());
    }
}
