//! Names of parts of variables, as a source writes them.

use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::module::{Definition, Id, Module, Opcode};
use anyhit_engine::program::Program;

/// The source expression of the scalar of a variable of a type that one of its words in registers
/// belongs to.
pub(super) fn word_path(module: &Module, variable: Id, ty: TypeId, word: u32) -> String {
    part_path(module, module.name_or_number(variable), ty, word)
}

/// As [`word_path`], of a variable with another name than the source's.
fn part_path(module: &Module, name: String, ty: TypeId, word: u32) -> String {
    let (mut path, mut ty, mut word) = (name, ty, word);
    loop {
        match module.ty(ty) {
            Type::Struct { members, .. } => {
                let mut rest = word;
                let mut at = 0;
                while let Some(member) = members.get(at) {
                    let count = word_count(module, member.ty);
                    if rest < count {
                        break;
                    }
                    rest -= count;
                    at += 1;
                }
                let Some(member) = members.get(at) else { return path };
                let id = module.id_of_type(ty);
                let names = &module.debug_info.member_names;
                let name = id.and_then(|id| names.get(&(id, at as u32))).filter(|name| !name.is_empty());
                path += &name.map_or_else(|| format!(".member{at}"), |name| format!(".{name}"));
                (ty, word) = (member.ty, rest);
            }
            &Type::Array { element, .. } => {
                let count = word_count(module, element).max(1);
                path += &format!("[{}]", word / count);
                (ty, word) = (element, word % count);
            }
            &Type::Matrix { column, .. } => {
                let count = word_count(module, column).max(1);
                path += &format!("[{}]", word / count);
                (ty, word) = (column, word % count);
            }
            &Type::Vector { component, .. } => {
                let at = word / word_count(module, component).max(1);
                return path
                    + &["x", "y", "z", "w"]
                        .get(at as usize)
                        .map_or_else(|| format!("[{at}]"), |name| format!(".{name}"));
            }
            _ => return path,
        }
    }
}

/// The source expression of what lies at a byte of the workgroup's memory, with its variable.
pub(super) fn workgroup_path(program: &Program, byte: u32) -> Option<(Id, String)> {
    let module = &program.module;
    let variable = program.workgroup_variables.iter().find(|variable| variable.bytes.contains(&byte))?;
    let id = variable.id;
    let path = match *module.ty(module.type_of(id)?) {
        Type::Pointer { pointee: Some(ty), .. } if !variable.is_block => {
            word_path(module, id, ty, (byte - variable.bytes.start) / 4)
        }
        _ => module.name_or_number(id),
    };
    Some((id, path))
}

/// The function that declares a local variable, as its source names it; `None` where that is an
/// entry point, or has no name.
pub(super) fn function_of(module: &Module, variable: Id) -> Option<&str> {
    let Definition::Result(function, ..) = module.definition(variable)? else { return None };
    let function = module.functions[function as usize].id;
    let is_entry = module.entry_points.iter().any(|entry| entry.function == function);
    module.name(function).filter(|_| !is_entry)
}

/// The argument of a call that a variable is, which a compiler made for it.
pub(super) struct Argument<'a> {
    /// The function that is called, as its source names it.
    pub function: &'a str,
    /// The number of the argument, from 1.
    pub number: usize,
    /// The parameter's name, if it has one.
    parameter: Option<&'a str>,
}

impl<'a> Argument<'a> {
    /// The argument that a variable of a function is, if it is one: glslang copies arguments to
    /// variables that it names `param`, and passes pointers to these.
    pub(super) fn of(module: &'a Module, variable: Id) -> Option<Self> {
        if module.name(variable) != Some("param") {
            return None;
        }
        let Definition::Result(function, ..) = module.definition(variable)? else { return None };
        let mut instructions = module.functions[function as usize].instructions();
        instructions.find_map(|one| {
            let [callee, arguments @ ..] = module.operands(one) else { return None };
            let at = arguments.iter().position(|&argument| argument == variable.0)?;
            let callee = module.function(Id(*callee)).filter(|_| one.opcode == Opcode::FunctionCall)?;
            let (parameter, _) = *callee.parameters.get(at)?;
            let function = module.name(callee.id)?;
            Some(Self { function, number: at + 1, parameter: module.name(parameter) })
        })
    }

    /// The source expression of the scalar that a word of the argument belongs to, by the
    /// parameter's name.
    pub(super) fn word_path(&self, module: &Module, ty: TypeId, word: u32) -> String {
        part_path(module, self.parameter.unwrap_or("param").to_owned(), ty, word)
    }
}

/// How many words a value of a type has in registers.
fn word_count(module: &Module, ty: TypeId) -> u32 {
    match *module.ty(ty) {
        Type::Int { width: 64, .. }
        | Type::Float { width: 64, .. }
        | Type::AccelerationStructure
        | Type::SampledImage(_) => 2,
        Type::Vector { component: part, count } | Type::Matrix { column: part, count } => {
            count * word_count(module, part)
        }
        Type::Array { element, length, .. } => {
            let count = module.scalar_value(length).unwrap_or(0) as u32;
            count.saturating_mul(word_count(module, element))
        }
        Type::Struct { ref members, .. } => {
            members.iter().fold(0u32, |sum, member| sum.saturating_add(word_count(module, member.ty)))
        }
        Type::Pointer { storage_class, .. } => anyhit_engine::ops::pointer::pointer_word_count(storage_class),
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::module::assemble::Assembler;

    /// A function `shade` of two pointers to vectors, called with `%42` and `%43`, of which the
    /// second is named so.
    fn module(name: &str) -> Module {
        let mut a = Assembler::new();
        a.with_string(Opcode::Name, &[50], "shade(vf3;vf3;", &[]);
        a.with_string(Opcode::Name, &[52], "albedo", &[]);
        a.with_string(Opcode::Name, &[43], name, &[]);
        a.types();
        a.op(Opcode::TypePointer, &[40, 7, 7]);
        a.op(Opcode::TypeFunction, &[41, 1, 40, 40]);
        a.op(Opcode::Function, &[1, 50, 0, 41]);
        a.op(Opcode::FunctionParameter, &[40, 51]);
        a.op(Opcode::FunctionParameter, &[40, 52]);
        a.op(Opcode::Label, &[53]);
        a.op(Opcode::Return, &[]);
        a.op(Opcode::FunctionEnd, &[]);
        a.function(30, 31, |a| {
            a.op(Opcode::Variable, &[40, 42, 7]);
            a.op(Opcode::Variable, &[40, 43, 7]);
            a.op(Opcode::FunctionCall, &[1, 44, 50, 42, 43]);
            a.op(Opcode::Return, &[]);
        });
        a.loaded()
    }

    #[test]
    fn a_copy_of_an_argument_is_told_by_the_call() {
        let copied = module("param");
        let argument = Argument::of(&copied, Id(43)).expect("an argument");
        assert_eq!((argument.function, argument.number), ("shade", 2));
        let vector = copied.pointee(Id(43)).expect("a pointer");
        assert_eq!(argument.word_path(&copied, vector, 1), "albedo.y");
        assert!(Argument::of(&copied, Id(42)).is_none(), "it has no such name");
        let own = module("color");
        assert!(Argument::of(&own, Id(43)).is_none(), "a variable of the source");
        assert_eq!(word_path(&own, Id(43), vector, 2), "color.z");
    }
}
