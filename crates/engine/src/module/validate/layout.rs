//! Layouts of blocks: members that overlap, strides of 0, alignments, bools, runtime arrays.
//!
//! Every variable of the module counts, and everything that device addresses lead to. Arrays have
//! the lengths that their specialization constants give them now; those of computed lengths
//! (`OpSpecConstantOp`) are checked where an entry point is lowered.

use std::collections::HashSet;

use crate::module::names::storage_class_name;
use crate::module::ty::{Type, TypeId};
use crate::module::validate::explicit_layout::{
    LayoutFault, LayoutFeatures, PHYSICAL_STORAGE_BUFFER, STORAGE_BUFFER, UNIFORM, WORKGROUP,
    find_layout_fault, has_explicit_layout,
};
use crate::module::validate::runtime_array;
use crate::module::validate::{ValidationClass, ValidationFinding};
use crate::module::{Id, Module};

const INPUT: u32 = 1;
const OUTPUT: u32 = 3;
const BUILT_IN: u32 = 11;

/// SPIR-V on bools in memory that is visible outside of shaders.
const BOOL: &str = "SPIR-V, 3.3.6, OpTypeBool: it has no size and cannot be stored in storage classes \
    that are visible outside shaders";

/// Checks the layouts of all blocks of a module, with every feature of a device that allows more.
pub(super) fn check(module: &Module) -> Vec<ValidationFinding> {
    let faults = layout_faults(module, LayoutFeatures::ALL, &|id| module.scalar_value(id));
    faults.into_iter().map(|(word, id, fault)| finding(module, word, id, fault)).collect()
}

fn finding(module: &Module, word: usize, id: Option<Id>, fault: LayoutFault) -> ValidationFinding {
    let LayoutFault { message, rule, fix } = fault;
    let name = id.map_or_else(String::new, |id| module.name_or_number(id));
    ValidationFinding::new(ValidationClass::Layout, name, rule, (word, id), message, fix)
}

/// The first fault of each block of a module: the word of its variable, or of the first instruction
/// that has its address, with the id of its type. `length` gives the lengths of arrays.
pub fn layout_faults(
    module: &Module,
    features: LayoutFeatures,
    length: &dyn Fn(Id) -> Option<u64>,
) -> Vec<(usize, Option<Id>, LayoutFault)> {
    let mut faults = runtime_array::type_faults(module);
    let mut seen = HashSet::new();
    let mut check = |ty: TypeId, class: u32, word: u32| {
        if !seen.insert((ty, class)) {
            return None;
        }
        let fault =
            bool_fault(module, ty, class).or_else(|| find_layout_fault(module, ty, class, features, length));
        fault.map(|fault| (word as usize, module.id_of_type(ty), fault))
    };
    for variable in &module.variables {
        let class = variable.storage_class;
        let Some(ty) = variable.ty else { continue };
        let fault = runtime_array::variable_fault(module, ty, class)
            .or_else(|| interface_bool_fault(module, variable.id, ty, class));
        faults.extend(fault.map(|fault| (variable.offset as usize, Some(variable.id), fault)));
        if let Some(ty) = block_of(module, ty, class) {
            faults.extend(check(ty, class, variable.offset));
        }
    }
    // The base types of untyped access chains (SPV_KHR_untyped_pointers).
    let has_untyped = module.types.iter().any(|ty| matches!(ty, Type::Pointer { pointee: None, .. }));
    for instruction in module.instructions().filter(|_| has_untyped) {
        let Some(base) = module.access_chain(instruction).and_then(|chain| chain.base_type) else { continue };
        let pointer = instruction.result_type.and_then(|id| module.type_with_id(id));
        if let Some(&Type::Pointer { storage_class, .. }) = pointer.map(|ty| module.ty(ty))
            && let Some(ty) = module.type_with_id(base).and_then(|ty| block_of(module, ty, storage_class))
        {
            faults.extend(check(ty, storage_class, instruction.offset));
        }
    }
    let has_addresses =
        |ty: &Type| matches!(ty, Type::Pointer { storage_class: PHYSICAL_STORAGE_BUFFER, .. });
    if !module.types.iter().any(has_addresses) {
        return faults;
    }
    for instruction in module.instructions() {
        let Some(ty) = instruction.result_type.and_then(|id| module.type_with_id(id)) else { continue };
        if let Type::Pointer { storage_class: PHYSICAL_STORAGE_BUFFER, pointee: Some(ty), .. } =
            *module.ty(ty)
        {
            faults.extend(check(ty, PHYSICAL_STORAGE_BUFFER, instruction.offset));
        }
    }
    faults
}

/// The block of a variable in a storage class with explicit layouts.
fn block_of(module: &Module, mut ty: TypeId, class: u32) -> Option<TypeId> {
    if !has_explicit_layout(class) {
        return None;
    }
    if matches!(class, UNIFORM | STORAGE_BUFFER) {
        // An array of descriptors has no layout.
        while let Type::Array { element, .. } | Type::RuntimeArray { element, .. } = *module.ty(ty) {
            ty = element;
        }
    }
    match *module.ty(ty) {
        Type::Struct { block, .. } if block || class != WORKGROUP => Some(ty),
        _ => None,
    }
}

/// The fault of an input or output that holds a bool and is no builtin.
fn interface_bool_fault(module: &Module, variable: Id, ty: TypeId, class: u32) -> Option<LayoutFault> {
    if !matches!(class, INPUT | OUTPUT) || !has_bool(module, ty) {
        return None;
    }
    let is_builtin = module.decorations.find(variable, BUILT_IN).is_some()
        || matches!(module.ty(ty), Type::Struct { members, .. } if members.iter().any(|one| one.builtin.is_some()));
    let fault = LayoutFault {
        message: format!("{} contains a bool in {}", module.quoted_name(variable), storage_class_name(class)),
        rule: "VUID-StandaloneSpirv-Input-07290".to_owned(),
        fix: "pass a 32-bit integer, 0 or 1, or decorate the variable as a builtin".to_owned(),
    };
    (!is_builtin).then_some(fault)
}

/// The fault of a bool in memory whose layout matters.
fn bool_fault(module: &Module, ty: TypeId, class: u32) -> Option<LayoutFault> {
    if class == WORKGROUP || !has_bool(module, ty) {
        return None;
    }
    let name = module.id_of_type(ty).map_or_else(String::new, |id| module.quoted_name(id));
    Some(LayoutFault {
        message: format!("{name} contains a bool, which is not allowed in {}", storage_class_name(class)),
        rule: BOOL.to_owned(),
        fix: "store a 32-bit integer, 0 or 1".to_owned(),
    })
}

/// Whether a bool is part of a type; what pointers lead to is not.
fn has_bool(module: &Module, ty: TypeId) -> bool {
    let mut seen = HashSet::new();
    let mut worklist = vec![ty];
    while let Some(ty) = worklist.pop() {
        if !seen.insert(ty) {
            continue;
        }
        match *module.ty(ty) {
            Type::Bool => return true,
            Type::Vector { component: part, .. }
            | Type::Array { element: part, .. }
            | Type::RuntimeArray { element: part, .. } => worklist.push(part),
            Type::Struct { ref members, .. } => worklist.extend(members.iter().map(|member| member.ty)),
            _ => {}
        }
    }
    false
}
