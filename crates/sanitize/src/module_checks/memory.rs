//! Rules about single accesses to memory: what may be read and written, and how.

use rspirv::spirv::MemoryAccess as AccessMask;

use crate::module_checks::Fault;
use crate::module_checks::code::{EntryCode, MemoryAccess, Part};
use anyhit_engine::module::constant::ConstantValue;
use anyhit_engine::module::decoration::number;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::module::names::storage_class_name;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::module::{Definition, Id, Module, Opcode};
use anyhit_engine::ops::atomic;
use anyhit_engine::ops::pointer::storage;

/// `PhysicalStorageBuffer64`
const PHYSICAL_ADDRESSING: u32 = 5348;

pub(super) fn uniform_store(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for access in code.accesses().filter(|access| access.writes) {
        let uniform = code.reached(&access).find(|&variable| {
            let block = code.module.pointee(variable).map(|ty| code.module.ty(block_of(code.module, ty)));
            code.storage_class(variable) == Some(storage::UNIFORM)
                && matches!(block, Some(Type::Struct { block: true, buffer_block: false, .. }))
        });
        if let Some(variable) = uniform {
            let name = code.describe(Part::Variable(variable));
            let message = format!("{} writes to the uniform buffer {name}", named(&access));
            faults.push(Fault { offset: access.offset, message });
        }
    }
}

pub(super) fn non_writable(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for access in code.accesses().filter(|access| access.writes && !is_initializer(code, access)) {
        decorated(code, &access, number::NON_WRITABLE, "writes to", "NonWritable", faults);
    }
}

/// Whether an access stores a constant to a whole local variable. That is what spirv-opt makes of
/// the initializer where it inlines a function, and the decoration stays (SPIRV-Tools, pass
/// `inline-entry-points-exhaustive`).
fn is_initializer(code: &EntryCode<'_>, access: &MemoryAccess) -> bool {
    let stored = code.module.words.get(access.offset as usize + 2);
    access.opcode == Opcode::Store
        && code.storage_class(access.pointer) == Some(storage::FUNCTION)
        && code.result(access.pointer).is_some_and(|made| made.opcode == Opcode::Variable)
        && stored.is_some_and(|&id| matches!(code.module.definition(Id(id)), Some(Definition::Constant(_))))
}

pub(super) fn non_readable(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for access in code.accesses().filter(|access| access.reads) {
        decorated(code, &access, number::NON_READABLE, "reads", "NonReadable", faults);
    }
}

/// Acceleration structures that come from nowhere, or from a variable that is no descriptor.
pub(super) fn as_load_source(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    let module = code.module;
    let is_structure =
        |id: Id| module.type_of(id).is_some_and(|ty| matches!(module.ty(ty), Type::AccelerationStructure));
    let is_undef = |id: Id| match module.definition(id) {
        Some(Definition::Constant(at)) => {
            matches!(module.constants[at as usize].value, ConstantValue::Undef)
        }
        _ => code.result(id).is_some_and(|instruction| instruction.opcode.is_undefined()),
    };
    for (opcode, instruction, operands) in code.with_operands() {
        let class = operands.first().and_then(|&pointer| code.storage_class(Id(pointer)));
        let message = match (opcode, class) {
            (Opcode::Load, Some(class))
                if class != storage::UNIFORM_CONSTANT && instruction.result.is_some_and(is_structure) =>
            {
                let class = storage_class_name(class);
                format!(
                    "an acceleration structure is loaded from storage class {class}, where no descriptor is"
                )
            }
            _ if operands.iter().any(|&id| is_structure(Id(id)) && is_undef(Id(id))) => {
                format!("{} uses an acceleration structure that is OpUndef", opcode)
            }
            _ => continue,
        };
        faults.push(Fault { offset: instruction.offset, message });
    }
}

/// Tells of an access to something that has a decoration.
fn decorated(
    code: &EntryCode<'_>,
    access: &MemoryAccess,
    number: u32,
    does: &str,
    decoration: &str,
    faults: &mut Vec<Fault>,
) {
    let decorations = &code.module.decorations;
    let part = code.parts(access.pointer).into_iter().find(|&part| match part {
        Part::Variable(id) | Part::Parameter(id) => decorations.find(id, number).is_some(),
        Part::Member(id, member) => decorations.find_member(id, member, number).is_some(),
    });
    if let Some(part) = part {
        let message = format!("{} {does} {}, which is {decoration}", named(access), code.describe(part));
        faults.push(Fault { offset: access.offset, message });
    }
}

/// Writes to hit attributes that lowering does not refuse: copies, and those through parameters.
pub(super) fn attr_readonly(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    if code.entry.stage == Stage::Intersection {
        return;
    }
    for access in code.accesses().filter(|access| access.writes) {
        if code.storage_class(access.pointer) == Some(storage::HIT_ATTRIBUTE) {
            let message =
                format!("{} writes to hit attributes in {}", named(&access), code.entry.stage.name());
            faults.push(Fault { offset: access.offset, message });
        }
    }
}

pub(super) fn record_block(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    let is_record = |class: u32| class == storage::SHADER_RECORD_BUFFER;
    for variable in code.variables.iter().filter(|variable| is_record(variable.storage_class)) {
        let Some(ty) = variable.ty else { continue };
        if !matches!(code.module.ty(ty), Type::Struct { block: true, .. }) {
            let name = code.describe(Part::Variable(variable.id));
            let ty = code.module.describe_type(ty);
            let message = format!("the shader record {name} is {ty}, which is no Block");
            faults.push(Fault { offset: offset_of(code.module, variable.id), message });
        }
    }
    for access in code.accesses().filter(|access| access.writes) {
        if code.storage_class(access.pointer).is_some_and(is_record) {
            let message = format!("{} writes to the shader record", named(&access));
            faults.push(Fault { offset: access.offset, message });
        }
    }
}

pub(super) fn aligned_operand(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    if code.module.memory_model.0 != PHYSICAL_ADDRESSING {
        return;
    }
    for (opcode, instruction, operands) in code.with_operands() {
        let (pointers, mask_at) = match opcode {
            Opcode::Load => (&operands[..1], 1),
            Opcode::Store => (&operands[..1], 2),
            // With operands for the source alone, only the target's are read.
            Opcode::CopyMemory if operands.len() > 4 => (&operands[..1], 2),
            Opcode::CopyMemory => (&operands[..2], 2),
            Opcode::CopyMemorySized if operands.len() > 5 => (&operands[..1], 3),
            Opcode::CopyMemorySized => (&operands[..2], 3),
            _ => continue,
        };
        let physical = pointers
            .iter()
            .map(|&id| Id(id))
            .filter(|&id| code.storage_class(id) == Some(storage::PHYSICAL_STORAGE_BUFFER));
        for pointer in physical {
            let aligned = operands.get(mask_at).filter(|&mask| mask & AccessMask::ALIGNED.bits() != 0);
            let alignment = aligned.and_then(|_| operands.get(mask_at + 1)).copied();
            let scalar = code.module.pointee(pointer).map_or(0, |ty| largest_scalar(code.module, ty));
            let name = opcode;
            let message = match alignment {
                None => format!("{name} through a physical pointer says nothing about its alignment"),
                Some(alignment) if scalar != 0 && alignment % scalar != 0 => format!(
                    "{name} through a physical pointer is Aligned {alignment}, and its largest scalar has \
                     {scalar} bytes"
                ),
                Some(_) => continue,
            };
            faults.push(Fault { offset: instruction.offset, message });
        }
    }
}

pub(super) fn atomic_class(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    /// `Image`
    const IMAGE: u32 = 11;
    /// `TaskPayloadWorkgroupEXT`
    const TASK_PAYLOAD: u32 = 5402;
    const CLASSES: [u32; 6] = [
        storage::UNIFORM,
        storage::WORKGROUP,
        IMAGE,
        storage::STORAGE_BUFFER,
        storage::PHYSICAL_STORAGE_BUFFER,
        TASK_PAYLOAD,
    ];
    for access in code.accesses().filter(|access| atomic::OPCODES.contains(&access.opcode)) {
        let class = code.storage_class(access.pointer);
        if class.is_some_and(|class| !CLASSES.contains(&class)) {
            let part = code.parts(access.pointer).last().map(|&part| code.describe(part));
            let name = part.unwrap_or_else(|| "a variable".to_owned());
            let message = format!("{} accesses {name}, which no other invocation reaches", named(&access));
            faults.push(Fault { offset: access.offset, message });
        }
    }
}

/// The name of an access's instruction.
fn named(access: &MemoryAccess) -> impl std::fmt::Display + use<> {
    access.opcode
}

/// The offset of a variable's declaration.
pub(super) fn offset_of(module: &Module, variable: Id) -> u32 {
    module.variables.iter().find(|one| one.id == variable).map_or(0, |one| one.offset)
}

/// The type behind all arrays.
fn block_of(module: &Module, ty: TypeId) -> TypeId {
    match *module.ty(ty) {
        Type::Array { element, .. } | Type::RuntimeArray { element, .. } => block_of(module, element),
        _ => ty,
    }
}

/// The bytes of the largest scalar of a type; 0 where it has none.
fn largest_scalar(module: &Module, ty: TypeId) -> u32 {
    match *module.ty(ty) {
        Type::Int { width, .. } | Type::Float { width, .. } => width / 8,
        Type::Pointer { storage_class: storage::PHYSICAL_STORAGE_BUFFER, .. } => 8,
        Type::Vector { component: part, .. }
        | Type::Matrix { column: part, .. }
        | Type::Array { element: part, .. }
        | Type::RuntimeArray { element: part, .. } => largest_scalar(module, part),
        Type::Struct { ref members, .. } => {
            members.iter().map(|member| largest_scalar(module, member.ty)).max().unwrap_or(0)
        }
        _ => 0,
    }
}

pub(super) fn pointer_convert(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for (opcode, instruction, operands) in code.with_operands() {
        let integer = match opcode {
            Opcode::ConvertPtrToU => instruction.result,
            Opcode::ConvertUToPtr => operands.first().map(|&operand| Id(operand)),
            _ => continue,
        };
        let ty = integer.and_then(|id| code.module.type_of(id)).map(|ty| code.module.ty(ty));
        if let Some(&Type::Int { width, .. }) = ty.filter(|ty| !matches!(ty, Type::Int { width: 64, .. })) {
            let message = format!("{} with an integer of {width} bits", opcode);
            faults.push(Fault { offset: instruction.offset, message });
        }
    }
}
