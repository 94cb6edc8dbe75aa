//! Barrier instructions (SPIR-V 3.3.21).
//!
//! Every access is visible to all later ones, so an `OpMemoryBarrier` has nothing to do, and
//! neither has an `OpControlBarrier` of scope Subgroup: the invocations of a subgroup run in one
//! batch, in lockstep. One of scope Workgroup stops the batch until the whole workgroup has reached
//! it. A split barrier (`SPV_EXT_split_barrier`) stops the batch at the wait; the arrival has
//! nothing to do.

use rspirv::spirv::Scope;

use crate::module::interface::Stage;
use crate::module::{Instruction, Opcode};
use crate::ops::op::Op;
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::ControlBarrier,
    Opcode::ControlBarrierArriveINTEL,
    Opcode::ControlBarrierWaitINTEL,
    Opcode::MemoryBarrier,
];

/// Translates barriers; `false` for an instruction of another section.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    match opcode {
        Opcode::MemoryBarrier => {}
        opcode if opcode.is_control_barrier() => {
            let arrives = opcode == Opcode::ControlBarrierArriveINTEL;
            let id = translator.id(instruction, 0)?;
            let scope = translator.constant_integer(id)?;
            match u32::try_from(scope).ok().and_then(Scope::from_u32) {
                Some(Scope::Subgroup) => {}
                Some(Scope::Workgroup) if translator.stage == Stage::Compute && arrives => {}
                Some(Scope::Workgroup) if translator.stage == Stage::Compute => translator.emit(Op::Barrier),
                Some(Scope::Workgroup) => {
                    let message =
                        format!("a barrier with scope Workgroup is used in {}", translator.stage.name());
                    return Err(translator.invalid(message).note("VUID-StandaloneSpirv-None-04637"));
                }
                _ => {
                    let message = format!(
                        "the scope of a control barrier is {scope}: it must be Workgroup or Subgroup"
                    );
                    return Err(translator.invalid(message).note("VUID-StandaloneSpirv-None-04636"));
                }
            }
        }
        _ => return Ok(false),
    }
    Ok(true)
}
