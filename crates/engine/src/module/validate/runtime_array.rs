//! Where runtime arrays may be: last in a block, or outermost in an array of descriptors
//! (VUID-StandaloneSpirv-OpTypeRuntimeArray-04680).

use std::collections::HashSet;

use crate::module::names::storage_class_name;
use crate::module::ty::{Type, TypeId};
use crate::module::validate::explicit_layout::{
    LayoutFault, PHYSICAL_STORAGE_BUFFER, RUNTIME_ARRAY, STORAGE_BUFFER, UNIFORM,
};
use crate::module::words::Walker;
use crate::module::{Id, Module, Opcode};

const UNIFORM_CONSTANT: u32 = 0;

/// The faults of types that no variable may have: the word and id of each, in their order.
pub(super) fn type_faults(module: &Module) -> Vec<(usize, Option<Id>, LayoutFault)> {
    let is_runtime = |ty: TypeId| matches!(module.ty(ty), Type::RuntimeArray { .. });
    let mut faults = Vec::new();
    for (index, ty) in module.types.iter().enumerate() {
        let Some(id) = module.id_of_type(TypeId(index as u32)) else { continue };
        let (message, fix) = match ty {
            Type::Struct { members, block: false, .. }
                if members.last().is_some_and(|last| is_runtime(last.ty)) =>
            {
                ("ends in a runtime array but is not a Block", "decorate it with Block")
            }
            Type::Array { element, .. } | Type::RuntimeArray { element, .. } if is_runtime(*element) => {
                ("is an array of runtime arrays", "give the inner array a length")
            }
            _ => continue,
        };
        let message = format!("{} {message}", module.quoted_name(id));
        let fault = LayoutFault { message, rule: RUNTIME_ARRAY.to_owned(), fix: fix.to_owned() };
        faults.push((word_of(module, id), Some(id), fault));
    }
    faults
}

/// The word at which a type is declared.
fn word_of(module: &Module, id: Id) -> usize {
    let mut walker = Walker::new(&module.words, module.limits);
    while let Ok(Some(span)) = walker.next() {
        // Types have their id first.
        if module.words.get(span.start + 1) == Some(&id.0)
            && (Opcode::TypeVoid..=Opcode::TypeFunction).contains(&span.opcode)
        {
            return span.start;
        }
    }
    0
}

/// The fault of a variable whose storage class allows no runtime array of its form.
pub(super) fn variable_fault(module: &Module, ty: TypeId, class: u32) -> Option<LayoutFault> {
    let fault = |message: String| {
        let fix = "keep the runtime array in a Block in StorageBuffer".to_owned();
        Some(LayoutFault { message, rule: RUNTIME_ARRAY.to_owned(), fix })
    };
    match *module.ty(ty) {
        Type::RuntimeArray { .. } if !matches!(class, STORAGE_BUFFER | UNIFORM | UNIFORM_CONSTANT) => {
            fault(format!("a runtime array of variables in {}", storage_class_name(class)))
        }
        Type::Struct { block, .. } if holds_runtime_array(module, ty) => {
            let name = module.id_of_type(ty).map_or_else(String::new, |id| module.quoted_name(id));
            match class {
                STORAGE_BUFFER | PHYSICAL_STORAGE_BUFFER if block => None,
                // In Uniform by the feature shaderUniformBufferUnsizedArray.
                STORAGE_BUFFER | PHYSICAL_STORAGE_BUFFER | UNIFORM if block => None,
                STORAGE_BUFFER | PHYSICAL_STORAGE_BUFFER | UNIFORM => {
                    fault(format!("{name} contains a runtime array but is not a Block"))
                }
                _ => fault(format!("{name} contains a runtime array in {}", storage_class_name(class))),
            }
        }
        _ => None,
    }
}

/// Whether a struct, or a struct in it, has a runtime array as a member.
fn holds_runtime_array(module: &Module, ty: TypeId) -> bool {
    let mut seen = HashSet::new();
    let mut worklist = vec![ty];
    while let Some(ty) = worklist.pop() {
        match module.ty(ty) {
            Type::RuntimeArray { .. } => return true,
            Type::Struct { members, .. } if seen.insert(ty) => {
                worklist.extend(members.iter().map(|member| member.ty));
            }
            _ => {}
        }
    }
    false
}
