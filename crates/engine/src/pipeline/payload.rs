//! Payloads and callable data: checks that a shader and the shader that it calls declare the same
//! type.

use crate::machine::Reg;
use crate::machine::stop::RegSpan;
use crate::module::Module;
use crate::module::ty::{Type, TypeId};
use crate::ops::pointer::storage;
use crate::ops::translate::InterfaceRegisters;
use crate::program::Program;

/// The interface variable of a shader that begins at a register: its payload or callable data.
fn outgoing_variable(program: &Program, first: Reg) -> Option<&InterfaceRegisters> {
    program.interface.iter().find(|registers| registers.first == first)
}

/// The incoming payload or callable data of a shader, if it uses one.
fn incoming_variable(program: &Program) -> Option<&InterfaceRegisters> {
    let classes = [storage::INCOMING_RAY_PAYLOAD, storage::INCOMING_CALLABLE_DATA];
    classes.into_iter().find_map(|class| program.interface_registers(class))
}

/// The scalars of the payload or callable data that a shader passes in a span of registers; see
/// [`InterfaceRegisters::scalar_fingerprint`].
pub(super) fn outgoing_scalars(program: &Program, span: RegSpan) -> Option<u64> {
    outgoing_variable(program, span.first).map(|registers| registers.scalar_fingerprint)
}

/// Whether a shader accepts a payload or callable data of these scalars. A shader that does not use
/// its data accepts any.
pub(super) fn accepts(program: &Program, scalars: Option<u64>) -> bool {
    let Some(scalars) = scalars else { return true };
    incoming_variable(program).is_none_or(|registers| registers.scalar_fingerprint == scalars)
}

/// Describes both types: the one that the called shader declares, and the one that its caller
/// passes.
pub(super) fn mismatch(caller: &Program, first: Reg, called: &Program) -> Option<String> {
    let (outgoing, incoming) = (outgoing_variable(caller, first)?, incoming_variable(called)?);
    Some(format!(
        "{} `{}`{} expects {}, but receives {}",
        called.stage.name(),
        called.name,
        source_file(&called.module),
        describe_with_members(&called.module, incoming.ty),
        describe_with_members(&caller.module, outgoing.ty)
    ))
}

/// ` (FILE)` for the source file that a module names, if any: many entry points are called `main`.
pub fn source_file(module: &Module) -> String {
    let file = module.debug_info.files.first().filter(|file| !file.name.is_empty());
    file.map_or_else(String::new, |file| format!(" ({})", file.name))
}

/// Describes a type, a struct with its members.
pub fn describe_with_members(module: &Module, ty: TypeId) -> String {
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
