//! The types that the specifications give to builtins and to what getters read.

use crate::module::ty::{Type, TypeId};
use crate::ops::builtin::{Builtin, ValueShape, stage_letter};
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Checks stage and type of a builtin variable against its rules.
///
/// # Errors
/// `InvalidModule` with the rule's VUID.
pub fn check(translator: &Translator<'_>, builtin: &'static Builtin, ty: TypeId) -> Result<()> {
    if !builtin.stages.contains(stage_letter(translator.stage)) {
        let message = format!("the builtin {} cannot be read in {}", builtin.name, translator.stage.name());
        return Err(translator.invalid(message).note(format!("VUID-{}", builtin.vuids[0])));
    }
    if !matches(translator, builtin.shape, ty) {
        let found = translator.module.describe_type(ty);
        let message =
            format!("the builtin {} must be {}, not {found}", builtin.name, builtin.shape.describe());
        return Err(translator.invalid(message).note(format!("VUID-{}", builtin.vuids[2])));
    }
    Ok(())
}

/// Whether a type has the shape of a builtin.
pub fn matches(translator: &Translator<'_>, shape: ValueShape, ty: TypeId) -> bool {
    let module = translator.module;
    let is_float = |ty| matches!(module.ty(ty), Type::Float { width: 32, encoding: None });
    let is_int = |ty| matches!(module.ty(ty), Type::Int { width: 32, .. });
    let is_float3 =
        |ty| matches!(*module.ty(ty), Type::Vector { component, count: 3 } if is_float(component));
    let array = |ty, expected| match *module.ty(ty) {
        Type::Array { element, length, .. } if module.constant_scalar(length) == Some(expected) => {
            Some(element)
        }
        _ => None,
    };
    match shape {
        ValueShape::Bool => matches!(module.ty(ty), Type::Bool),
        ValueShape::Int => is_int(ty),
        ValueShape::Int2 => {
            matches!(*module.ty(ty), Type::Vector { component, count: 2 } if is_int(component))
        }
        ValueShape::Int4 => {
            matches!(*module.ty(ty), Type::Vector { component, count: 4 } if is_int(component))
        }
        ValueShape::Int3 => {
            matches!(*module.ty(ty), Type::Vector { component, count: 3 } if is_int(component))
        }
        ValueShape::Float => is_float(ty),
        ValueShape::Float2 => {
            matches!(*module.ty(ty), Type::Vector { component, count: 2 } if is_float(component))
        }
        ValueShape::Float3 => is_float3(ty),
        ValueShape::Matrix4x3 => {
            matches!(*module.ty(ty), Type::Matrix { column, count: 4 } if is_float3(column))
        }
        ValueShape::FloatArray2 => array(ty, 2).is_some_and(is_float),
        ValueShape::Float3Array2 => array(ty, 2).is_some_and(is_float3),
        ValueShape::Float3Array3 => array(ty, 3).is_some_and(is_float3),
    }
}
