//! Translates the hit object instructions of a module to operations.

use smallvec::SmallVec;

use crate::machine::Reg;
use crate::machine::stop::RegSpan;
use crate::module::interface::Stage;
use crate::module::ty::Type;
use crate::module::{Instruction, Opcode};
use crate::ops::builtin::ValueShape;
use crate::ops::hit_object::getters::GETTERS;
use crate::ops::hit_object::{HitObjectOp, MISS_OPERANDS, hit_operands};
use crate::ops::object::{self, define_result};
use crate::ops::op::Op as Operation;
use crate::ops::pointer::storage;
use crate::ops::ray_tracing::translate::variable_span;
use crate::ops::ray_tracing::{self, TRACE_OPERANDS};
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Opcodes translated here, beside those of `GETTERS`.
pub const OPCODES: &[Opcode] = &[
    Opcode::HitObjectTraceRayEXT,
    Opcode::HitObjectTraceRayNV,
    Opcode::HitObjectTraceRayMotionEXT,
    Opcode::HitObjectTraceRayMotionNV,
    Opcode::HitObjectRecordHitNV,
    Opcode::HitObjectRecordHitWithIndexNV,
    Opcode::HitObjectRecordHitMotionNV,
    Opcode::HitObjectRecordHitWithIndexMotionNV,
    Opcode::HitObjectRecordMissEXT,
    Opcode::HitObjectRecordMissNV,
    Opcode::HitObjectRecordMissMotionEXT,
    Opcode::HitObjectRecordMissMotionNV,
    Opcode::HitObjectRecordEmptyEXT,
    Opcode::HitObjectRecordEmptyNV,
    Opcode::HitObjectRecordFromQueryEXT,
    Opcode::HitObjectExecuteShaderEXT,
    Opcode::HitObjectExecuteShaderNV,
    Opcode::HitObjectReorderExecuteShaderEXT,
    Opcode::HitObjectTraceReorderExecuteEXT,
    Opcode::HitObjectTraceMotionReorderExecuteEXT,
    Opcode::HitObjectSetShaderBindingTableRecordIndexEXT,
    Opcode::HitObjectGetShaderRecordBufferHandleEXT,
    Opcode::HitObjectGetShaderRecordBufferHandleNV,
    Opcode::HitObjectGetAttributesEXT,
    Opcode::HitObjectGetAttributesNV,
    Opcode::ReorderThreadWithHintEXT,
    Opcode::ReorderThreadWithHintNV,
    Opcode::ReorderThreadWithHitObjectEXT,
    Opcode::ReorderThreadWithHitObjectNV,
    Opcode::HitObjectIsEmptyEXT,
    Opcode::HitObjectIsEmptyNV,
    Opcode::HitObjectIsMissEXT,
    Opcode::HitObjectIsMissNV,
    Opcode::HitObjectIsHitEXT,
    Opcode::HitObjectIsHitNV,
    Opcode::HitObjectGetRayTMinEXT,
    Opcode::HitObjectGetRayTMinNV,
    Opcode::HitObjectGetRayTMaxEXT,
    Opcode::HitObjectGetRayTMaxNV,
    Opcode::HitObjectGetRayFlagsEXT,
    Opcode::HitObjectGetWorldRayOriginEXT,
    Opcode::HitObjectGetWorldRayOriginNV,
    Opcode::HitObjectGetWorldRayDirectionEXT,
    Opcode::HitObjectGetWorldRayDirectionNV,
    Opcode::HitObjectGetCurrentTimeEXT,
    Opcode::HitObjectGetCurrentTimeNV,
    Opcode::HitObjectGetShaderBindingTableRecordIndexEXT,
    Opcode::HitObjectGetShaderBindingTableRecordIndexNV,
    Opcode::HitObjectGetInstanceCustomIndexEXT,
    Opcode::HitObjectGetInstanceCustomIndexNV,
    Opcode::HitObjectGetInstanceIdEXT,
    Opcode::HitObjectGetInstanceIdNV,
    Opcode::HitObjectGetGeometryIndexEXT,
    Opcode::HitObjectGetGeometryIndexNV,
    Opcode::HitObjectGetPrimitiveIndexEXT,
    Opcode::HitObjectGetPrimitiveIndexNV,
    Opcode::HitObjectGetHitKindEXT,
    Opcode::HitObjectGetHitKindNV,
    Opcode::HitObjectGetObjectRayOriginEXT,
    Opcode::HitObjectGetObjectRayOriginNV,
    Opcode::HitObjectGetObjectRayDirectionEXT,
    Opcode::HitObjectGetObjectRayDirectionNV,
    Opcode::HitObjectGetObjectToWorldEXT,
    Opcode::HitObjectGetObjectToWorldNV,
    Opcode::HitObjectGetWorldToObjectEXT,
    Opcode::HitObjectGetWorldToObjectNV,
    Opcode::HitObjectGetIntersectionTriangleVertexPositionsEXT,
    Opcode::HitObjectGetClusterIdNV,
    Opcode::HitObjectIsSphereHitNV,
    Opcode::HitObjectIsLSSHitNV,
    Opcode::HitObjectGetSpherePositionNV,
    Opcode::HitObjectGetSphereRadiusNV,
    Opcode::HitObjectGetLSSPositionsNV,
    Opcode::HitObjectGetLSSRadiiNV,
];

/// Translates hit object instructions; `false` for an instruction of another section.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    if !OPCODES.contains(&opcode) {
        return Ok(false);
    }
    check_stage(translator, instruction)?;
    check_hint(translator, instruction)?;
    if matches!(opcode, Opcode::ReorderThreadWithHintEXT | Opcode::ReorderThreadWithHintNV) {
        reorder(translator, instruction)?;
        return Ok(true);
    }
    let id = translator.id(instruction, 0)?;
    let object = object::object_ref(translator, id, |ty| matches!(ty, Type::HitObject { .. }))?;
    if let Some(getter) = GETTERS.iter().find(|getter| getter.opcodes.contains(&opcode)) {
        let to = define_result(translator, instruction, getter.shape)?;
        emit(translator, HitObjectOp::Get { object, getter, to });
        return Ok(true);
    }
    match opcode {
        Opcode::HitObjectTraceRayEXT
        | Opcode::HitObjectTraceRayNV
        | Opcode::HitObjectTraceReorderExecuteEXT
        | Opcode::HitObjectTraceRayMotionEXT
        | Opcode::HitObjectTraceRayMotionNV
        | Opcode::HitObjectTraceMotionReorderExecuteEXT => {
            let end = if has_time(opcode) { 12 } else { 11 };
            let operands =
                operands_with_time(translator, instruction, 1..end, has_time(opcode), TRACE_OPERANDS)?;
            let payload = payload(translator, instruction, end)?;
            translator.emit(Operation::Stop(ray_tracing::RayTracingOp::HitObjectTrace {
                object,
                operands,
                payload,
            }));
            translator.invalidate_known_values();
            if matches!(
                opcode,
                Opcode::HitObjectTraceReorderExecuteEXT | Opcode::HitObjectTraceMotionReorderExecuteEXT
            ) {
                reorder(translator, instruction)?;
                translator
                    .emit(Operation::Stop(ray_tracing::RayTracingOp::HitObjectExecute { object, payload }));
            }
        }
        Opcode::HitObjectExecuteShaderEXT
        | Opcode::HitObjectExecuteShaderNV
        | Opcode::HitObjectReorderExecuteShaderEXT => {
            let payload = payload(translator, instruction, 1)?;
            if opcode == Opcode::HitObjectReorderExecuteShaderEXT {
                reorder(translator, instruction)?;
            }
            translator.emit(Operation::Stop(ray_tracing::RayTracingOp::HitObjectExecute { object, payload }));
            translator.invalidate_known_values();
        }
        Opcode::HitObjectGetShaderRecordBufferHandleEXT | Opcode::HitObjectGetShaderRecordBufferHandleNV => {
            let to = define_result(translator, instruction, ValueShape::Int2)?;
            translator.emit(Operation::Stop(ray_tracing::RayTracingOp::HitObjectRecordHandle { object, to }));
        }
        Opcode::HitObjectRecordHitNV
        | Opcode::HitObjectRecordHitWithIndexNV
        | Opcode::HitObjectRecordHitMotionNV
        | Opcode::HitObjectRecordHitWithIndexMotionNV => {
            let with_index = matches!(
                opcode,
                Opcode::HitObjectRecordHitWithIndexNV | Opcode::HitObjectRecordHitWithIndexMotionNV
            );
            let end = 12 - usize::from(with_index) + usize::from(has_time(opcode));
            let operands = operands_with_time(
                translator,
                instruction,
                1..end,
                has_time(opcode),
                hit_operands(with_index),
            )?;
            let attributes = attributes(translator, instruction, end)?;
            emit(translator, HitObjectOp::RecordHit { object, operands, with_index, attributes });
        }
        Opcode::HitObjectRecordMissEXT | Opcode::HitObjectRecordMissMotionEXT => {
            let end = if has_time(opcode) { 8 } else { 7 };
            let operands =
                operands_with_time(translator, instruction, 1..end, has_time(opcode), MISS_OPERANDS)?;
            emit(translator, HitObjectOp::RecordMiss { object, operands });
        }
        Opcode::HitObjectRecordMissNV | Opcode::HitObjectRecordMissMotionNV => {
            // These have no ray flags.
            let mut words: Words = SmallVec::from_slice(&[translator.constant(0)?]);
            let end = if has_time(opcode) { 7 } else { 6 };
            for at in 1..end {
                words.extend(translator.operand(instruction, at)?);
            }
            if !has_time(opcode) {
                words.push(translator.constant(0)?);
            }
            let operands = consecutive_operands(translator, instruction, &words, MISS_OPERANDS)?;
            emit(translator, HitObjectOp::RecordMiss { object, operands });
        }
        Opcode::HitObjectRecordEmptyEXT | Opcode::HitObjectRecordEmptyNV => {
            emit(translator, HitObjectOp::RecordEmpty { object });
        }
        Opcode::HitObjectRecordFromQueryEXT => {
            let query = translator.id(instruction, 1)?;
            let query = object::object_ref(translator, query, |ty| matches!(ty, Type::RayQuery))?;
            let record = scalar(translator, instruction, 2)?;
            let attributes = attributes(translator, instruction, 3)?;
            let has_kind = translator.operands(instruction).len() > 4;
            let hit_kind = if has_kind { Some(scalar(translator, instruction, 4)?) } else { None };
            let op = HitObjectOp::RecordFromQuery { object, query, record, attributes, hit_kind };
            emit(translator, op);
        }
        Opcode::HitObjectSetShaderBindingTableRecordIndexEXT => {
            let record = scalar(translator, instruction, 1)?;
            emit(translator, HitObjectOp::SetRecord { object, record });
        }
        Opcode::HitObjectGetAttributesEXT | Opcode::HitObjectGetAttributesNV => {
            let to = attributes(translator, instruction, 1)?;
            emit(translator, HitObjectOp::GetAttributes { object, to });
            translator.invalidate_known_values();
        }
        // OpReorderThreadWithHitObject*
        _ => reorder(translator, instruction)?,
    }
    Ok(true)
}

/// Emits a reordering, with the hint of its instruction, if there is one.
fn reorder(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<()> {
    let opcode = instruction.opcode;
    let given = hint_operand(opcode).filter(|&at| at < translator.operands(instruction).len());
    let hint = given.map(|at| scalar(translator, instruction, at)).transpose()?;
    emit(translator, HitObjectOp::Reorder { hint });
    Ok(())
}

fn emit(translator: &mut Translator<'_>, op: HitObjectOp) {
    translator.emit(Operation::HitObject(Box::new(op)));
}

/// Checks the stage: hit objects are allowed in three stages, reordering in one.
fn check_stage(translator: &Translator<'_>, instruction: &Instruction) -> Result<()> {
    let opcode = instruction.opcode;
    let reorders = matches!(
        opcode,
        Opcode::ReorderThreadWithHintEXT
            | Opcode::ReorderThreadWithHintNV
            | Opcode::ReorderThreadWithHitObjectEXT
            | Opcode::ReorderThreadWithHitObjectNV
            | Opcode::HitObjectReorderExecuteShaderEXT
            | Opcode::HitObjectTraceReorderExecuteEXT
            | Opcode::HitObjectTraceMotionReorderExecuteEXT
    );
    let allowed = match translator.stage {
        Stage::RayGeneration => true,
        Stage::ClosestHit | Stage::Miss => !reorders,
        _ => false,
    };
    if allowed {
        return Ok(());
    }
    let stages = if reorders { "ray generation" } else { "ray generation, closest hit and miss" };
    let found = translator.stage.name();
    Err(translator.invalid(format!(
        "{opcode} is used in {found}: it is allowed only in {stages} (SPV_EXT_shader_invocation_reorder)"
    )))
}

/// Rejects a hint without its number of bits.
fn check_hint(translator: &Translator<'_>, instruction: &Instruction) -> Result<()> {
    let opcode = instruction.opcode;
    let hint = hint_operand(opcode);
    if hint.is_some_and(|hint| translator.operands(instruction).len() == hint + 1) {
        return Err(translator.invalid(format!(
            "{opcode} has a hint, but no number of bits (SPV_EXT_shader_invocation_reorder)"
        )));
    }
    Ok(())
}

/// Which operand of an instruction that reorders is the hint, where it has one; the number of its
/// bits follows.
pub fn hint_operand(opcode: Opcode) -> Option<usize> {
    Some(match opcode {
        Opcode::ReorderThreadWithHintNV | Opcode::ReorderThreadWithHintEXT => 0,
        Opcode::ReorderThreadWithHitObjectNV | Opcode::ReorderThreadWithHitObjectEXT => 1,
        Opcode::HitObjectReorderExecuteShaderEXT => 2,
        Opcode::HitObjectTraceReorderExecuteEXT => 12,
        Opcode::HitObjectTraceMotionReorderExecuteEXT => 13,
        _ => return None,
    })
}

type Words = SmallVec<[Reg; 17]>;

/// Whether an instruction takes a time.
pub fn has_time(opcode: Opcode) -> bool {
    matches!(
        opcode,
        Opcode::HitObjectTraceRayMotionEXT
            | Opcode::HitObjectTraceRayMotionNV
            | Opcode::HitObjectTraceMotionReorderExecuteEXT
            | Opcode::HitObjectRecordHitMotionNV
            | Opcode::HitObjectRecordHitWithIndexMotionNV
            | Opcode::HitObjectRecordMissMotionEXT
            | Opcode::HitObjectRecordMissMotionNV
    )
}

/// Operands in consecutive registers, the last of them a time, which is 0 where none is given.
fn operands_with_time(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    range: std::ops::Range<usize>,
    has_time: bool,
    count: u32,
) -> Result<Reg> {
    let mut words = Words::new();
    for at in range {
        words.extend(translator.operand(instruction, at)?);
    }
    if !has_time {
        words.push(translator.constant(0)?);
    }
    consecutive_operands(translator, instruction, &words, count)
}

fn consecutive_operands(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    words: &[Reg],
    count: u32,
) -> Result<Reg> {
    if words.len() != count as usize {
        let opcode = instruction.opcode;
        let error = translator.invalid(format!("the operands of {opcode} have wrong types"));
        return Err(error.note("SPV_NV_shader_invocation_reorder, SPV_EXT_shader_invocation_reorder"));
    }
    translator.consecutive(words)
}

fn scalar(translator: &mut Translator<'_>, instruction: &Instruction, at: usize) -> Result<Reg> {
    match translator.operand(instruction, at)?[..] {
        [reg] => Ok(reg),
        _ => Err(translator.invalid(format!("operand {at} must be a 32-bit integer"))),
    }
}

fn payload(translator: &mut Translator<'_>, instruction: &Instruction, at: usize) -> Result<RegSpan> {
    let id = translator.id(instruction, at)?;
    variable_span(translator, id, &[storage::RAY_PAYLOAD, storage::INCOMING_RAY_PAYLOAD])
}

fn attributes(translator: &mut Translator<'_>, instruction: &Instruction, at: usize) -> Result<RegSpan> {
    let id = translator.id(instruction, at)?;
    variable_span(translator, id, &[storage::HIT_OBJECT_ATTRIBUTE_EXT, storage::HIT_OBJECT_ATTRIBUTE_NV])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::module::assemble::Assembler;
    use anyhit_base::error::ErrorKind;

    #[test]
    fn hit_objects_and_reordering_keep_to_their_stages() {
        const HIT_OBJECTS: &[Stage] = &[Stage::RayGeneration, Stage::ClosestHit, Stage::Miss];
        const REORDERING: &[Stage] = &[Stage::RayGeneration];
        let mut a = Assembler::new();
        a.types();
        let module = a.loaded();
        for (opcode, allowed) in [
            (Opcode::HitObjectTraceRayEXT, HIT_OBJECTS),
            (Opcode::HitObjectTraceRayNV, HIT_OBJECTS),
            (Opcode::HitObjectRecordEmptyEXT, HIT_OBJECTS),
            (Opcode::HitObjectIsHitEXT, HIT_OBJECTS),
            (Opcode::HitObjectExecuteShaderEXT, HIT_OBJECTS),
            (Opcode::ReorderThreadWithHintEXT, REORDERING),
            (Opcode::ReorderThreadWithHitObjectNV, REORDERING),
            (Opcode::HitObjectReorderExecuteShaderEXT, REORDERING),
            (Opcode::HitObjectTraceReorderExecuteEXT, REORDERING),
        ] {
            let instruction =
                Instruction { opcode, offset: 0, result_type: None, result: None, operands: 0..0 };
            for stage in [
                Stage::RayGeneration,
                Stage::Intersection,
                Stage::AnyHit,
                Stage::ClosestHit,
                Stage::Miss,
                Stage::Callable,
                Stage::Compute,
            ] {
                let found = check_stage(&Translator::new(&module, stage), &instruction).err();
                let kind = (!allowed.contains(&stage)).then_some(ErrorKind::InvalidModule);
                assert_eq!(found.map(|error| error.kind()), kind, "{opcode} in {}", stage.name());
            }
        }
    }
}
