//! Translates ray-tracing instructions to operations.

use smallvec::SmallVec;

use crate::machine::Reg;
use crate::machine::stop::RegSpan;
use crate::module::decoration::number;
use crate::module::{Definition, Id, Instruction, Opcode};
use crate::ops::op::Op as Operation;
use crate::ops::pointer::{Pointer, PointerBase, storage};
use crate::ops::ray_tracing::{RayTracingOp, TRACE_OPERANDS};
use crate::ops::translate::Translator;
use anyhit_base::error::Result;

/// Where the operands of these instructions are described. The validator knows no rules for those
/// of NVIDIA.
const RULES: &str = "SPV_KHR_ray_tracing, SPV_NV_ray_tracing, SPV_NV_ray_tracing_motion_blur";

/// Translates ray-tracing instructions; `false` for an instruction of another section.
pub fn translate(translator: &mut Translator<'_>, instruction: &Instruction) -> Result<bool> {
    let opcode = instruction.opcode;
    match opcode {
        Opcode::TraceRayKHR | Opcode::TraceNV | Opcode::TraceRayMotionNV | Opcode::TraceMotionNV => {
            let has_motion = matches!(opcode, Opcode::TraceRayMotionNV | Opcode::TraceMotionNV);
            let count = if has_motion { 11 } else { 10 };
            let mut words: SmallVec<[Reg; 16]> = SmallVec::new();
            for at in 0..count {
                words.extend(translator.operand(instruction, at)?);
            }
            if !has_motion {
                words.push(translator.constant(0)?);
            }
            if words.len() != TRACE_OPERANDS as usize {
                return Err(translator
                    .invalid(format!("the operands of {opcode} have wrong types"))
                    .note(RULES));
            }
            let operands = translator.consecutive(&words)?;
            let classes = &[storage::RAY_PAYLOAD, storage::INCOMING_RAY_PAYLOAD];
            let payload = named_variable(translator, instruction, count, classes)?;
            translator.emit(Operation::Stop(RayTracingOp::TraceRay { operands, payload }));
            translator.invalidate_known_values();
        }
        Opcode::ExecuteCallableKHR | Opcode::ExecuteCallableNV => {
            let index = translator.operand(instruction, 0)?;
            let classes = &[storage::CALLABLE_DATA, storage::INCOMING_CALLABLE_DATA];
            let data = named_variable(translator, instruction, 1, classes)?;
            let Some(&index) = index.first() else {
                return Err(translator.invalid("the SBT index has no value").note(RULES));
            };
            translator.emit(Operation::Stop(RayTracingOp::ExecuteCallable { index, data }));
            translator.invalidate_known_values();
        }
        Opcode::ReportIntersectionKHR => {
            let (t, hit_kind) = (translator.operand(instruction, 0)?, translator.operand(instruction, 1)?);
            let (&[t], &[hit_kind]) = (&t[..], &hit_kind[..]) else {
                return Err(translator.invalid("the operands of OpReportIntersectionKHR have wrong types"));
            };
            let accepted = translator.fresh(1)?;
            translator.emit(Operation::Stop(RayTracingOp::ReportIntersection { t, hit_kind, accepted }));
            translator.invalidate_known_values();
            translator.define_result(instruction, SmallVec::from_slice(&[accepted]));
        }
        Opcode::ConvertUToAccelerationStructureKHR => {
            let words = translator.operand(instruction, 0)?;
            let &[low, high] = &words[..] else {
                return Err(translator.invalid("a device address must have 64 bits"));
            };
            let first = translator.pair(low, high)?;
            translator.define_result(instruction, SmallVec::from_slice(&[first, first.plus(1)]));
        }
        _ => return Ok(false),
    }
    Ok(true)
}

/// The variable that `SPV_NV_ray_tracing` names by its `Location`. There is none where nothing
/// reads or writes the payload: optimizers remove a variable that no instruction names by its id.
fn variable_at(translator: &mut Translator<'_>, location: Id, classes: &[u32]) -> Result<Option<Id>> {
    let location = translator.constant_integer(location)?;
    let module = translator.module;
    let found = module.variables.iter().find(|variable| {
        let own = module.decorations.literal(variable.id, number::LOCATION).map(u64::from);
        classes.contains(&variable.storage_class) && own == Some(location)
    });
    Ok(found.map(|variable| variable.id))
}

/// The registers of the payload or callable data variable that an operand names.
fn named_variable(
    translator: &mut Translator<'_>,
    instruction: &Instruction,
    at: usize,
    classes: &[u32],
) -> Result<RegSpan> {
    let mut id = translator.id(instruction, at)?;
    if matches!(instruction.opcode, Opcode::TraceNV | Opcode::TraceMotionNV | Opcode::ExecuteCallableNV) {
        match variable_at(translator, id, classes)? {
            Some(variable) => id = variable,
            // A fresh register, so that no interface variable begins there.
            None => return Ok(RegSpan { first: translator.fresh(1)?, count: 0 }),
        }
    }
    variable_span(translator, id, classes)
}

/// The registers of a whole variable of one of some storage classes.
pub fn variable_span(translator: &mut Translator<'_>, id: Id, classes: &[u32]) -> Result<RegSpan> {
    if !matches!(translator.module.definition(id), Some(Definition::Variable(_))) {
        let message = format!("%{} is not a variable: the operand must be a whole variable", id.0);
        return Err(translator.invalid(message).note(RULES));
    }
    let pointer = translator.pointer(id)?;
    if !classes.contains(&pointer.storage_class) {
        let name = crate::module::names::storage_class_name;
        let wanted: Vec<_> = classes.iter().map(|&class| name(class)).collect();
        let found = name(pointer.storage_class);
        let wanted = wanted.join(" or ");
        let message = format!("the variable is in storage class {found} instead of {wanted}");
        return Err(translator.invalid(message).note(RULES));
    }
    match pointer {
        Pointer { base: PointerBase::Registers { first, .. }, index: None, offset, pointee, .. } => {
            Ok(RegSpan { first: first.plus(offset), count: translator.word_count(pointee)? })
        }
        _ => Err(translator.unsupported("a payload that is not a whole variable is not supported")),
    }
}
