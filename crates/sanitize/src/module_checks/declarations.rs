//! Rules about variables, execution modes and single instructions without memory.

use rspirv::spirv::{ExecutionMode, FPFastMathMode as FastMath};

use crate::module_checks::Fault;
use crate::module_checks::code::{EntryCode, Part};
use crate::module_checks::memory::offset_of;
use anyhit_engine::module::decoration::number;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::module::names::{execution_mode_name, storage_class_name};
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::module::{Definition, Id, Module, Opcode};
use anyhit_engine::ops::hit_object::hint_operand;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::trace_operands::possible_constants;

pub(super) fn interface_initializer(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    let used = |id: Id| code.variables.iter().any(|variable| variable.id == id);
    let variables = code.module.variables.iter();
    for variable in variables.filter(|variable| variable.initializer.is_some() && used(variable.id)) {
        let allowed = [storage::OUTPUT, storage::PRIVATE, storage::FUNCTION, storage::WORKGROUP];
        if !allowed.contains(&variable.storage_class) {
            let name = code.describe(Part::Variable(variable.id));
            let class = storage_class_name(variable.storage_class);
            let message = format!("{name} has an initializer, and storage class {class}");
            faults.push(Fault { offset: variable.offset, message });
        }
    }
}

pub(super) fn workgroup_in_rt(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    if matches!(code.entry.stage, Stage::Compute | Stage::Other(_)) {
        return;
    }
    for variable in code.variables.iter().filter(|one| one.storage_class == storage::WORKGROUP) {
        let name = code.describe(Part::Variable(variable.id));
        let message = format!("{name} is a Workgroup variable in {}", code.entry.stage.name());
        faults.push(Fault { offset: offset_of(code.module, variable.id), message });
    }
}

pub(super) fn payload_location(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for variable in &code.variables {
        let has = |number: u32| code.module.decorations.find(variable.id, number).is_some();
        if !has(number::LOCATION) && !has(number::COMPONENT) {
            continue;
        }
        let name = code.describe(Part::Variable(variable.id));
        let message = match variable.storage_class {
            _ if variable.builtin.is_some() => format!("{name} is a builtin, and has a Location"),
            storage::INPUT
            | storage::OUTPUT
            | storage::RAY_PAYLOAD
            | storage::INCOMING_RAY_PAYLOAD
            | storage::HIT_ATTRIBUTE
            | storage::HIT_OBJECT_ATTRIBUTE_NV
            | storage::HIT_OBJECT_ATTRIBUTE_EXT
            | storage::CALLABLE_DATA
            | storage::INCOMING_CALLABLE_DATA
            | storage::SHADER_RECORD_BUFFER => continue,
            other => format!("{name} has a Location, and storage class {}", storage_class_name(other)),
        };
        faults.push(Fault { offset: offset_of(code.module, variable.id), message });
    }
}

/// Traces that get the payload of the shader's caller, where a payload of its own gets none.
pub(super) fn payload_aliasing(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    let own: Vec<Id> = code
        .variables
        .iter()
        .filter(|variable| variable.storage_class == storage::RAY_PAYLOAD)
        .map(|variable| variable.id)
        .collect();
    if own.is_empty() {
        return;
    }
    let accesses = |opcode: Opcode| {
        opcode.selects_part() || matches!(opcode, Opcode::Load | Opcode::Store | Opcode::CopyMemory)
    };
    let passes = |variable: &Id| {
        let others = code.instructions.iter().filter(|one| !accesses(one.opcode));
        others.into_iter().any(|instruction| code.module.operand_ids(instruction).contains(variable))
    };
    let Some(forgotten) = own.iter().find(|variable| !passes(variable)) else { return };
    for (opcode, instruction, operands) in code.with_operands() {
        let Some(&payload) = operands.last().filter(|_| opcode == Opcode::TraceRayKHR) else { continue };
        if code.storage_class(Id(payload)) == Some(storage::INCOMING_RAY_PAYLOAD) {
            let [payload, forgotten] = [Id(payload), *forgotten].map(|id| code.describe(Part::Variable(id)));
            let message = format!(
                "a trace gets {payload}, the payload of the shader's caller; no trace gets {forgotten}, \
                 which the shader uses"
            );
            faults.push(Fault { offset: instruction.offset, message });
        }
    }
}

pub(super) fn no_repack_mode(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    /// `MaximallyReconvergesKHR`
    const MAXIMALLY_RECONVERGES: u32 = 6023;
    let uniform = ExecutionMode::SubgroupUniformControlFlowKHR as u32;
    let mut modes = code.entry.modes.iter().map(|(mode, _)| *mode);
    let Some(mode) = modes.find(|mode| [MAXIMALLY_RECONVERGES, uniform].contains(mode)) else { return };
    let mode = if mode == uniform { execution_mode_name(mode) } else { "MaximallyReconvergesKHR".into() };
    if let Some((opcode, instruction, _)) = code.with_operands().find(|(opcode, ..)| repacks(*opcode)) {
        let message = format!("{} in an entry point of mode {mode}", opcode);
        faults.push(Fault { offset: instruction.offset, message });
    }
}

/// Reorderings whose hint has bits that are not used.
pub(super) fn reorder_hint_bits(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    const HINT_BITS: u64 = 32;
    for (opcode, instruction, operands) in code.with_operands() {
        let Some(at) = hint_operand(opcode) else { continue };
        let greatest = |at: usize| {
            let constants = possible_constants(code.module, Id(*operands.get(at)?))?;
            constants.last().copied()
        };
        let message = match (greatest(at), greatest(at + 1)) {
            (_, Some(bits)) if bits > HINT_BITS => {
                format!("a reordering takes {bits} bits of its hint, which has {HINT_BITS}")
            }
            (Some(hint), Some(bits)) if hint >> bits != 0 => {
                format!("the hint of a reordering is {hint:#x}, of which only the {bits} lowest bits count")
            }
            _ => continue,
        };
        faults.push(Fault { offset: instruction.offset, message });
    }
}

/// Whether an instruction may distribute invocations to subgroups anew.
fn repacks(opcode: Opcode) -> bool {
    matches!(
        opcode,
        Opcode::TraceRayKHR
            | Opcode::TraceRayMotionNV
            | Opcode::ExecuteCallableKHR
            | Opcode::ReportIntersectionKHR
            | Opcode::ReorderThreadWithHintNV
            | Opcode::ReorderThreadWithHitObjectNV
            | Opcode::ReorderThreadWithHintEXT
            | Opcode::ReorderThreadWithHitObjectEXT
            | Opcode::HitObjectReorderExecuteShaderEXT
            | Opcode::HitObjectTraceReorderExecuteEXT
            | Opcode::HitObjectTraceMotionReorderExecuteEXT
    )
}

pub(super) fn fastmath_modes(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    let default = ExecutionMode::FPFastMathDefault as u32;
    let defaults = code.entry.modes.iter().filter(|(mode, _)| *mode == default);
    let others = [ExecutionMode::ContractionOff, ExecutionMode::SignedZeroInfNanPreserve];
    let other = others.into_iter().find(|&one| code.entry.modes.iter().any(|(mode, _)| *mode == one as u32));
    let offset = code.entry.offset;
    let mut has_default = false;
    for (_, operands) in defaults {
        has_default = true;
        let mode = operands.get(1).and_then(|&id| code.module.scalar_value(Id(id)));
        let mode = mode.map(|bits| FastMath::from_bits_retain(bits as u32));
        let message = match (other, mode) {
            (Some(other), _) => format!("FPFastMathDefault stands together with {other:?}"),
            (None, Some(mode)) if lacks_transform(mode) => {
                "FPFastMathDefault has AllowTransform, and not both AllowContract and AllowReassoc".into()
            }
            _ => continue,
        };
        faults.push(Fault { offset, message });
    }
    for &instruction in &code.instructions {
        let Some(result) = instruction.result else { continue };
        let Some(bits) = code.module.decorations.literal(result, number::FP_FAST_MATH_MODE) else { continue };
        let mode = FastMath::from_bits_retain(bits);
        let says = match () {
            () if lacks_transform(mode) => "AllowTransform, and not both AllowContract and AllowReassoc",
            () if has_default && mode.contains(FastMath::FAST) => {
                "Fast, in an entry point of FPFastMathDefault"
            }
            () => continue,
        };
        let message = format!("the FPFastMathMode of {} has {says}", instruction.opcode);
        faults.push(Fault { offset: instruction.offset, message });
    }
}

fn lacks_transform(mode: FastMath) -> bool {
    let needed = FastMath::ALLOW_CONTRACT | FastMath::ALLOW_REASSOC;
    mode.contains(FastMath::ALLOW_TRANSFORM) && !mode.contains(needed)
}

pub(super) fn bitop_width(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for (opcode, instruction, operands) in code.with_operands() {
        let counts = matches!(
            opcode,
            Opcode::BitCount
                | Opcode::BitReverse
                | Opcode::BitFieldInsert
                | Opcode::BitFieldSExtract
                | Opcode::BitFieldUExtract
        );
        let base = operands.first().filter(|_| counts).and_then(|&base| code.module.type_of(Id(base)));
        if let Some(width) = base.and_then(|ty| width(code.module, ty)).filter(|&width| width != 32) {
            let message = format!("{} of an integer of {width} bits", opcode);
            faults.push(Fault { offset: instruction.offset, message });
        }
    }
}

fn width(module: &Module, ty: TypeId) -> Option<u32> {
    match *module.ty(ty) {
        Type::Int { width, .. } => Some(width),
        Type::Vector { component, .. } => width(module, component),
        _ => None,
    }
}

/// That the constant is from 0 to 3 is checked where the gather is executed.
pub(super) fn gather_component(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    for (opcode, instruction, operands) in code.with_operands() {
        if !matches!(opcode, Opcode::ImageGather | Opcode::ImageSparseGather) {
            continue;
        }
        let Some(&component) = operands.get(2) else { continue };
        if !matches!(code.module.definition(Id(component)), Some(Definition::Constant(_))) {
            let message = "the component of a gather is no constant".into();
            faults.push(Fault { offset: instruction.offset, message });
        }
    }
}
