//! Pointers to ray queries and hit objects: each variable holds a handle, in one register.

use crate::machine::Reg;
use crate::machine::object::ObjectRef;
use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Instruction, Module, Opcode};
use crate::ops::builtin::{self, ValueShape};
use crate::ops::pointer::{PointerBase, storage};
use crate::ops::translate::Translator;
use crate::ops::value_registers::registers_from;
use anyhit_base::error::Result;

/// Whether a value of this type is, or holds, a ray query or a hit object.
pub fn holds_object(module: &Module, ty: TypeId) -> bool {
    match module.ty(ty) {
        Type::RayQuery | Type::HitObject { .. } => true,
        Type::Array { element, .. } => holds_object(module, *element),
        Type::Struct { members, .. } => members.iter().any(|member| holds_object(module, member.ty)),
        _ => false,
    }
}

/// The object that an operand points to.
///
/// # Errors
/// `InvalidModule` where it is no pointer to such an object in Function or Private storage
/// (SPIR-V, "Universal Validation Rules"; SPV_KHR_ray_query, SPV_EXT_shader_invocation_reorder).
pub fn object_ref(
    translator: &mut Translator<'_>,
    id: Id,
    is_wanted: impl Fn(&Type) -> bool,
) -> Result<ObjectRef> {
    const RULES: &str =
        "SPV_KHR_ray_query, SPV_NV_shader_invocation_reorder, SPV_EXT_shader_invocation_reorder";
    if !matches!(translator.module.ty(translator.type_of(id)?), Type::Pointer { .. }) {
        return Err(translator.invalid(format!("%{} is not a pointer to a variable", id.0)).note(RULES));
    }
    if is_chosen(translator.module, id) {
        let message = format!("%{} selects between pointers: this operand must be a variable", id.0);
        return Err(translator.invalid(message).note(RULES));
    }
    let pointer = translator.pointer(id)?;
    if !is_wanted(translator.module.ty(pointer.pointee)) {
        let found = translator.module.describe_type(pointer.pointee);
        let message = format!("%{} points to {found}, which this instruction does not accept", id.0);
        return Err(translator.invalid(message).note(RULES));
    }
    if !matches!(pointer.storage_class, storage::FUNCTION | storage::PRIVATE) {
        let class = crate::module::names::storage_class_name(pointer.storage_class);
        let found = translator.module.describe_type(pointer.pointee);
        let error = translator
            .invalid(format!("{found} is in storage class {class}, which must be Function or Private"));
        return Err(error.note(extension(translator.module.ty(pointer.pointee))));
    }
    match (&pointer.base, pointer.index) {
        (&PointerBase::Registers { first, .. }, None) => Ok(ObjectRef::Register(first.plus(pointer.offset))),
        (&PointerBase::Registers { first, count, .. }, Some(index)) => {
            translator.addressed.push((first, count));
            Ok(ObjectRef::Computed { first: first.plus(pointer.offset), index })
        }
        (PointerBase::ComputedRegisters, Some(index)) => {
            Ok(ObjectRef::Computed { first: pointer.pointed_registers(), index })
        }
        _ => Err(translator.invalid(format!("%{} is not a pointer to a variable", id.0)).note(RULES)),
    }
}

/// Whether a pointer, or what its access chains begin with, is the result of `OpPhi` or `OpSelect`.
fn is_chosen(module: &Module, mut id: Id) -> bool {
    while let Some(instruction) = module.result_instruction(id) {
        match (instruction.opcode, module.access_chain(instruction)) {
            (Opcode::Phi | Opcode::Select, _) => return true,
            (_, Some(chain)) if chain.element.is_none() => id = chain.base,
            _ => return false,
        }
    }
    false
}

/// The extension that says where an object may be kept.
fn extension(ty: &Type) -> &'static str {
    match ty {
        Type::RayQuery => "SPV_KHR_ray_query",
        Type::HitObject { ext: false } => "SPV_NV_shader_invocation_reorder",
        _ => "SPV_EXT_shader_invocation_reorder",
    }
}

/// Rejects loads, stores, copies and initializers of objects that can only be used through a
/// pointer.
///
/// # Errors
/// `InvalidModule`
pub fn check_copyable(translator: &Translator<'_>, ty: TypeId) -> Result<()> {
    if !holds_object(translator.module, ty) {
        return Ok(());
    }
    let found = translator.module.describe_type(ty);
    let error = translator.invalid(format!(
        "{found} cannot be loaded, stored, copied or initialized: only pointers to it can be used"
    ));
    Err(error.note("SPV_KHR_ray_query, SPV_NV_shader_invocation_reorder, SPV_EXT_shader_invocation_reorder"))
}

/// Checks the result type of an instruction and gives its result registers.
///
/// # Errors
/// `InvalidModule` where the type has another shape.
pub fn define_result(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    shape: ValueShape,
) -> Result<Reg> {
    let ty = translator.result_type(instruction)?;
    if !builtin::matches(translator, shape, ty) {
        let name = instruction.opcode.to_string();
        let found = translator.module.describe_type(ty);
        // The validator lets the lengths of arrays pass, and knows fewer of these instructions.
        let rule = if name.starts_with("OpRayQuery") {
            "SPV_KHR_ray_query, SPV_KHR_ray_tracing_position_fetch, SPV_NV_linear_swept_spheres"
        } else {
            "SPV_NV_shader_invocation_reorder, SPV_EXT_shader_invocation_reorder"
        };
        let message = format!("the result of {name} must be {}, not {found}", shape.describe());
        return Err(translator.invalid(message).note(rule));
    }
    let to = translator.fresh(shape.words())?;
    translator.define_result(instruction, registers_from(to, shape.words()));
    Ok(to)
}
