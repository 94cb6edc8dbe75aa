//! Barrier instructions (SPIR-V 3.3.21).
//!
//! Every access is seen by all that follow it already, so an `OpMemoryBarrier` has nothing to do,
//! and neither has an `OpControlBarrier` of scope Subgroup: the invocations of a subgroup stand in
//! one batch and go side by side. One of scope Workgroup stops the batch until the whole workgroup
//! has come to it.

use rspirv::spirv::{Op as Opcode, Scope};

use crate::error::Result;
use crate::module::Instruction;
use crate::module::interface::Stage;
use crate::ops::decode::Decoder;
use crate::ops::op::Op;

/// Opcodes decoded here.
pub const OPCODES: &[Opcode] = &[Opcode::ControlBarrier, Opcode::MemoryBarrier];

/// Decodes barriers; `false` for an instruction of another section.
pub fn decode(decoder: &mut Decoder<'_>, opcode: Opcode, instruction: &Instruction) -> Result<bool> {
    match opcode {
        Opcode::MemoryBarrier => {}
        Opcode::ControlBarrier => {
            let id = decoder.id(instruction, 0)?;
            let scope = decoder.constant_integer(id)?;
            match u32::try_from(scope).ok().and_then(Scope::from_u32) {
                Some(Scope::Subgroup) => {}
                Some(Scope::Workgroup) if decoder.stage == Stage::Compute => decoder.emit(Op::Barrier),
                Some(Scope::Workgroup) => {
                    let message = format!("a barrier of scope Workgroup in {}", decoder.stage.name());
                    return Err(decoder.invalid(message).note("VUID-StandaloneSpirv-None-04637"));
                }
                _ => {
                    let message = format!("a control barrier of scope {scope}: it is Workgroup or Subgroup");
                    return Err(decoder.invalid(message).note("VUID-StandaloneSpirv-None-04636"));
                }
            }
        }
        _ => return Ok(false),
    }
    Ok(true)
}
