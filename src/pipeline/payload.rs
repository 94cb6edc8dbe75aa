//! Payloads and callable data: checks that a shader and the shader that it calls declare one type.

use crate::machine::Reg;
use crate::machine::stop::RegSpan;
use crate::module::Module;
use crate::module::ty::{Type, TypeId};
use crate::ops::pointer::storage;
use crate::ops::translate::InterfaceRegisters;
use crate::program::Program;

/// The interface variable of a shader whose first register this is.
fn given(program: &Program, first: Reg) -> Option<&InterfaceRegisters> {
    program.interface.iter().find(|registers| registers.first == first)
}

/// The variable for incoming payload or callable data, if the shader has one that it uses.
fn taken(program: &Program) -> Option<&InterfaceRegisters> {
    let classes = [storage::INCOMING_RAY_PAYLOAD, storage::INCOMING_CALLABLE_DATA];
    classes.into_iter().find_map(|class| program.interface_registers(class))
}

/// The scalars of the data that a shader passes from a span; see
/// [`InterfaceRegisters::scalar_fingerprint`].
pub(super) fn scalars_given(program: &Program, span: RegSpan) -> Option<u64> {
    given(program, span.first).map(|registers| registers.scalar_fingerprint)
}

/// Whether a shader accepts data of these scalars. A shader that does not use its data accepts any.
pub(super) fn takes(program: &Program, scalars: Option<u64>) -> bool {
    let Some(scalars) = scalars else { return true };
    taken(program).is_none_or(|registers| registers.scalar_fingerprint == scalars)
}

/// Both types: of the data that a shader passes, and of the data that the called one declares.
pub(super) fn mismatch(caller: &Program, first: Reg, called: &Program) -> Option<String> {
    let (given, taken) = (given(caller, first)?, taken(called)?);
    Some(format!(
        "{} `{}`{} takes {}, and is given {}",
        called.stage.name(),
        called.name,
        source(&called.module),
        of_type(&called.module, taken.ty),
        of_type(&caller.module, given.ty)
    ))
}

/// The source file that a module names, if any: many entry points are called `main`.
fn source(module: &Module) -> String {
    let file = module.debug_info.files.first().filter(|file| !file.name.is_empty());
    file.map_or_else(String::new, |file| format!(" ({})", file.name))
}

/// A type as text, a struct with its members.
fn of_type(module: &Module, ty: TypeId) -> String {
    let name = module.describe_type(ty);
    let Type::Struct { members, .. } = module.ty(ty) else { return name };
    let id = module.type_ids[ty.0 as usize];
    let members = (0..).zip(members).map(|(at, member)| {
        let ty = module.describe_type(member.ty);
        match module.debug_info.member_names.get(&(id, at)) {
            Some(name) => format!("{ty} {name}"),
            None => ty,
        }
    });
    format!("{name} {{ {} }}", members.collect::<Vec<_>>().join(", "))
}
