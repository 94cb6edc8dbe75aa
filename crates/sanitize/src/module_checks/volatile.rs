//! Rules about builtins that change while a shader runs: their variables are Volatile, or each
//! load.

use rspirv::spirv::MemoryAccess;

use crate::module_checks::Fault;
use crate::module_checks::code::{EntryCode, Part};
use crate::module_checks::memory::offset_of;
use anyhit_engine::module::decoration::number;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::module::names::builtin_name;
use anyhit_engine::module::{Id, Opcode};

/// `RayTmaxKHR`
const RAY_T_MAX: u32 = 5326;
/// Builtins that may change wherever lanes are repacked: `SubgroupSize`,
/// `SubgroupLocalInvocationId`, `SubgroupEqMask` and its siblings, `WarpIDNV`, `SMIDNV`.
const SUBGROUP_BUILTINS: [u32; 9] = [36, 41, 4416, 4417, 4418, 4419, 4420, 5376, 5377];

pub(super) fn volatile_subgroup(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    if may_be_repacked(code.entry.stage) {
        variables(code, &SUBGROUP_BUILTINS, faults);
    }
}

pub(super) fn volatile_raytmax(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    if code.entry.stage == Stage::Intersection {
        variables(code, &[RAY_T_MAX], faults);
    }
}

/// Variables of builtins that are not decorated. With the Vulkan memory model each load is volatile
/// by itself.
fn variables(code: &EntryCode<'_>, builtins: &[u32], faults: &mut Vec<Fault>) {
    if code.module.has_vulkan_memory_model() {
        return;
    }
    for variable in &code.variables {
        let Some(number) = variable.builtin.filter(|number| builtins.contains(number)) else { continue };
        if code.module.decorations.find(variable.id, number::VOLATILE).is_none() {
            let message = format!("the variable of {} is not Volatile", builtin_name(number));
            faults.push(Fault { offset: offset_of(code.module, variable.id), message });
        }
    }
}

pub(super) fn volatile_load(code: &EntryCode<'_>, faults: &mut Vec<Fault>) {
    if !code.module.has_vulkan_memory_model() {
        return;
    }
    let stage = code.entry.stage;
    let changes = |builtin: &u32| {
        may_be_repacked(stage) && SUBGROUP_BUILTINS.contains(builtin)
            || stage == Stage::Intersection && *builtin == RAY_T_MAX
    };
    for (opcode, instruction, operands) in code.with_operands() {
        let is_volatile = operands.get(1).is_some_and(|mask| mask & MemoryAccess::VOLATILE.bits() != 0);
        if opcode != Opcode::Load || is_volatile {
            continue;
        }
        let builtin = code.parts(Id(operands[0])).into_iter().find_map(|part| match part {
            Part::Variable(id) => code.module.decorations.literal(id, number::BUILT_IN),
            _ => None,
        });
        if let Some(number) = builtin.filter(changes) {
            let message = format!("the load of {} is not Volatile", builtin_name(number));
            faults.push(Fault { offset: instruction.offset, message });
        }
    }
}

/// Whether the lanes of a stage may be in another subgroup after an instruction.
fn may_be_repacked(stage: Stage) -> bool {
    matches!(
        stage,
        Stage::RayGeneration | Stage::Intersection | Stage::ClosestHit | Stage::Miss | Stage::Callable
    )
}
