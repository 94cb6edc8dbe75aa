//! Translates ray query instructions to operations.

use smallvec::SmallVec;

use crate::machine::Reg;
use crate::module::ty::Type;
use crate::module::{Instruction, Opcode};
use crate::ops::builtin::ValueShape;
use crate::ops::object::{define_result, object_ref};
use crate::ops::op::Op as Operation;
use crate::ops::ray_query::{AABB_OPAQUE, GETTERS, MicromapMode, OPCODES, OPERANDS, RAY_GETTERS, RayQueryOp};
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Translates ray query instructions; `false` for an instruction of another section.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    if !OPCODES.contains(&opcode) {
        return Ok(false);
    }
    let id = translator.id(instruction, 0)?;
    let query = object_ref(translator, id, |ty| matches!(ty, Type::RayQuery))?;
    let op = match opcode {
        Opcode::RayQueryInitializeKHR => {
            let mut words: SmallVec<[Reg; 12]> = SmallVec::new();
            for at in 1..8 {
                words.extend(translator.operand(instruction, at)?);
            }
            if words.len() != OPERANDS as usize {
                return Err(translator.invalid("the operands of OpRayQueryInitializeKHR have wrong types"));
            }
            let operands = translator.consecutive(&words)?;
            let micromaps = match translator.micromap_mode {
                Some(mode) => match translator.constant_integer(mode)? {
                    0 => MicromapMode::Disabled,
                    _ => MicromapMode::Enabled,
                },
                None => MicromapMode::Undeclared,
            };
            RayQueryOp::Initialize { query, operands, micromaps }
        }
        Opcode::RayQueryProceedKHR => {
            RayQueryOp::Proceed { query, to: define_result(translator, instruction, ValueShape::Bool)? }
        }
        Opcode::RayQueryTerminateKHR => RayQueryOp::Terminate { query },
        Opcode::RayQueryConfirmIntersectionKHR => RayQueryOp::Confirm { query },
        Opcode::RayQueryGenerateIntersectionKHR => match translator.operand(instruction, 1)?[..] {
            [t] => RayQueryOp::Generate { query, t },
            _ => return Err(translator.invalid("a hit distance must be a 32-bit float")),
        },
        Opcode::RayQueryGetIntersectionTypeKHR => {
            let committed = committed(translator, instruction)?;
            RayQueryOp::Type {
                query,
                committed,
                to: define_result(translator, instruction, ValueShape::Int)?,
            }
        }
        Opcode::RayQueryGetIntersectionCandidateAABBOpaqueKHR => {
            let getter = &AABB_OPAQUE;
            RayQueryOp::Get {
                query,
                committed: false,
                getter,
                to: define_result(translator, instruction, getter.shape)?,
            }
        }
        _ => {
            if let Some(getter) = RAY_GETTERS.iter().find(|getter| getter.opcode == opcode) {
                RayQueryOp::GetRay {
                    query,
                    getter,
                    to: define_result(translator, instruction, getter.shape)?,
                }
            } else if let Some(getter) = GETTERS.iter().find(|getter| getter.opcode == opcode) {
                let committed = committed(translator, instruction)?;
                RayQueryOp::Get {
                    query,
                    committed,
                    getter,
                    to: define_result(translator, instruction, getter.shape)?,
                }
            } else {
                return Ok(false);
            }
        }
    };
    translator.emit(Operation::RayQuery(op));
    Ok(true)
}

/// The operand Intersection: 0 for the candidate, 1 for what is committed.
fn committed(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let id = translator.id(instruction, 1)?;
    if !matches!(translator.module.ty(translator.type_of(id)?), Type::Int { width: 32, .. }) {
        let message = "the operand Intersection is not a 32-bit integer (SPV_KHR_ray_query)";
        return Err(translator.invalid(message));
    }
    match translator.constant_integer(id)? {
        0 => Ok(false),
        1 => Ok(true),
        other => Err(translator.invalid(format!(
            "the operand Intersection is {other}: it must be 0 (candidate) or 1 (committed) (SPV_KHR_ray_query)"
        ))),
    }
}
