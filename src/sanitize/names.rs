//! Names of parts of variables, as a source writes them.

use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Module};
use crate::program::Program;

/// The source expression of the scalar of a variable of a type that one of its words in registers
/// belongs to.
pub(super) fn word_path(module: &Module, variable: Id, ty: TypeId, word: u32) -> String {
    let name = module.name(variable).map_or_else(|| format!("%{}", variable.0), str::to_owned);
    let mut path = name;
    let (mut ty, mut word) = (ty, word);
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
        _ => module.name(id).map_or_else(|| format!("%{}", id.0), str::to_owned),
    };
    Some((id, path))
}

/// The function that declares a local variable, as its source names it; `None` where that is an
/// entry point, or has no name.
pub(super) fn function_of(module: &Module, variable: Id) -> Option<&str> {
    let Definition::Result(function, ..) = module.definition(variable)? else { return None };
    let function = module.functions[function as usize].id;
    let is_entry = module.entry_points.iter().any(|entry| entry.function == function);
    // glslang writes the types of parameters behind the name.
    let name = module.name(function).filter(|_| !is_entry)?;
    name.split('(').next().filter(|name| !name.is_empty())
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
        Type::Pointer { storage_class, .. } => crate::ops::pointer::pointer_word_count(storage_class),
        _ => 1,
    }
}
