//! Ray-tracing instructions (`SPV_KHR_ray_tracing`) that hand the batch to the pipeline.

use rspirv::spirv::Op as Opcode;
use smallvec::SmallVec;

use crate::error::Result;
use crate::machine::object::ObjectRef;
use crate::machine::stop::RegSpan;
use crate::machine::{Batch, Reg, Stop};
use crate::module::{Id, Instruction};
use crate::ops::memory::{self, PointerBase};
use crate::ops::object;
use crate::ops::op::{Access, Op as Operation};
use crate::ops::pointer::storage;
use crate::ops::translate::Translator;

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::TraceRayKHR,
    Opcode::ExecuteCallableKHR,
    Opcode::ReportIntersectionKHR,
    Opcode::ConvertUToAccelerationStructureKHR,
    Opcode::TraceNV,
    Opcode::TraceRayMotionNV,
    Opcode::TraceMotionNV,
    Opcode::ExecuteCallableNV,
];

/// Words of the operands of a trace: see [`Stop::TraceRay`].
pub const TRACE_OPERANDS: u32 = 16;

/// An operation that stops the interpreter.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "a variant's line tells its fields")]
pub enum RayTracingOp {
    /// `OpTraceRayKHR`, `OpTraceRayMotionNV`
    TraceRay { operands: Reg, payload: RegSpan },
    /// `OpExecuteCallableKHR`
    ExecuteCallable { index: Reg, data: RegSpan },
    /// `OpReportIntersectionKHR`
    ReportIntersection { t: Reg, hit_kind: Reg, accepted: Reg },
    /// `OpHitObjectTraceRayEXT`
    HitObjectTrace { object: ObjectRef, operands: Reg, payload: RegSpan },
    /// `OpHitObjectExecuteShaderEXT`
    HitObjectExecute { object: ObjectRef, payload: RegSpan },
    /// `OpHitObjectGetShaderRecordBufferHandleEXT`
    HitObjectRecordHandle { object: ObjectRef, to: Reg },
}

impl RayTracingOp {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        visit(Access::Effect);
        match *self {
            Self::TraceRay { operands, payload } => {
                visit(Access::Read(operands, TRACE_OPERANDS));
                visit(Access::Read(payload.first, payload.count));
                visit(Access::Write(payload.first, payload.count));
            }
            Self::ExecuteCallable { index, data } => {
                visit(Access::Read(index, 1));
                visit(Access::Read(data.first, data.count));
                visit(Access::Write(data.first, data.count));
            }
            Self::ReportIntersection { t, hit_kind, accepted } => {
                visit(Access::Read(t, 1));
                visit(Access::Read(hit_kind, 1));
                visit(Access::Write(accepted, 1));
            }
            Self::HitObjectTrace { object, operands, payload } => {
                object::write_accesses(object, visit);
                visit(Access::Read(operands, TRACE_OPERANDS));
                visit(Access::Read(payload.first, payload.count));
                visit(Access::Write(payload.first, payload.count));
            }
            Self::HitObjectExecute { object, payload } => {
                object::accesses(object, visit);
                visit(Access::Read(payload.first, payload.count));
                visit(Access::Write(payload.first, payload.count));
            }
            Self::HitObjectRecordHandle { object, to } => {
                object::accesses(object, visit);
                visit(Access::Write(to, 2));
            }
        }
    }

    /// The registers of the payload or callable data that a called shader is given.
    pub fn payload_span(&self) -> Option<RegSpan> {
        match *self {
            Self::TraceRay { payload, .. }
            | Self::HitObjectTrace { payload, .. }
            | Self::HitObjectExecute { payload, .. } => Some(payload),
            Self::ExecuteCallable { data, .. } => Some(data),
            Self::ReportIntersection { .. } | Self::HitObjectRecordHandle { .. } => None,
        }
    }

    /// The stop that the running lanes make.
    pub fn stop<const W: usize>(&self, batch: &Batch<W>) -> Stop<W> {
        let mask = batch.mask;
        match *self {
            Self::TraceRay { operands, payload } => Stop::TraceRay { mask, operands, payload },
            Self::ExecuteCallable { index, data } => Stop::ExecuteCallable { mask, index, data },
            Self::ReportIntersection { t, hit_kind, accepted } => {
                Stop::ReportIntersection { mask, t, hit_kind, accepted }
            }
            Self::HitObjectTrace { object, operands, payload } => {
                Stop::HitObjectTrace { mask, object, operands, payload }
            }
            Self::HitObjectExecute { object, payload } => Stop::HitObjectExecute { mask, object, payload },
            Self::HitObjectRecordHandle { object, to } => Stop::HitObjectRecordHandle { mask, object, to },
        }
    }
}

/// An instruction that traces a ray at a point in time (ray-tracing motion).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionInstruction {
    /// Its name.
    pub name: &'static str,
    /// The rule that demands a pipeline with motion enabled, where one is written.
    pub rule: Option<&'static str>,
}

impl MotionInstruction {
    /// The instruction of an opcode, if it is one.
    pub fn of(opcode: u16) -> Option<Self> {
        let (name, rule) = match Opcode::from_u32(opcode.into())? {
            Opcode::TraceRayMotionNV => {
                ("OpTraceRayMotionNV", Some("VUID-RuntimeSpirv-OpTraceRayMotionNV-06367"))
            }
            Opcode::TraceMotionNV => ("OpTraceMotionNV", None),
            Opcode::HitObjectTraceRayMotionNV => {
                ("OpHitObjectTraceRayMotionNV", Some("VUID-RuntimeSpirv-OpHitObjectTraceRayMotionNV-07711"))
            }
            Opcode::HitObjectTraceRayMotionEXT => ("OpHitObjectTraceRayMotionEXT", None),
            Opcode::HitObjectTraceMotionReorderExecuteEXT => {
                ("OpHitObjectTraceMotionReorderExecuteEXT", None)
            }
            _ => return None,
        };
        Some(Self { name, rule })
    }
}

/// Where the operands of these instructions are described. The validator knows no rules for those
/// of NVIDIA.
const RULES: &str = "SPV_KHR_ray_tracing, SPV_NV_ray_tracing, SPV_NV_ray_tracing_motion_blur";

/// Translates ray-tracing instructions; `false` for an instruction of another section.
pub fn translate(translator: &mut Translator<'_>, opcode: Opcode, instruction: &Instruction) -> Result<bool> {
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
                let name = crate::module::names::opcode_name(instruction.opcode);
                return Err(translator
                    .invalid(format!("the operands of {name} have wrong types"))
                    .note(RULES));
            }
            let operands = translator.consecutive(&words)?;
            let classes = &[storage::RAY_PAYLOAD, storage::INCOMING_RAY_PAYLOAD];
            let payload = named_variable(translator, opcode, instruction, count, classes)?;
            translator.emit(Operation::Stop(RayTracingOp::TraceRay { operands, payload }));
            translator.invalidate_known_values();
        }
        Opcode::ExecuteCallableKHR | Opcode::ExecuteCallableNV => {
            let index = translator.operand(instruction, 0)?;
            let classes = &[storage::CALLABLE_DATA, storage::INCOMING_CALLABLE_DATA];
            let data = named_variable(translator, opcode, instruction, 1, classes)?;
            let Some(&index) = index.first() else {
                return Err(translator.invalid("an SBT index without a value").note(RULES));
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
                return Err(translator.invalid("a device address has 64 bits"));
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
    const LOCATION: u32 = 30;
    let location = translator.constant_integer(location)?;
    let module = translator.module;
    let found = module.variables.iter().find(|variable| {
        let own = module.decorations.literal(variable.id, LOCATION).map(u64::from);
        classes.contains(&variable.storage_class) && own == Some(location)
    });
    Ok(found.map(|variable| variable.id))
}

/// The registers of the payload or callable data variable that an operand names.
fn named_variable(
    translator: &mut Translator<'_>,
    opcode: Opcode,
    instruction: &Instruction,
    at: usize,
    classes: &[u32],
) -> Result<RegSpan> {
    let mut id = translator.id(instruction, at)?;
    if matches!(opcode, Opcode::TraceNV | Opcode::TraceMotionNV | Opcode::ExecuteCallableNV) {
        match variable_at(translator, id, classes)? {
            Some(variable) => id = variable,
            // A fresh register, so that no interface variable begins there.
            None => return Ok(RegSpan { first: translator.fresh(1)?, count: 0 }),
        }
    }
    variable_span(translator, id, classes)
}

/// The registers of a whole variable of one of some storage classes.
pub(super) fn variable_span(translator: &mut Translator<'_>, id: Id, classes: &[u32]) -> Result<RegSpan> {
    let pointer = translator.pointer(id)?;
    if !classes.contains(&pointer.storage_class) {
        let name = crate::module::names::storage_class_name;
        let wanted: Vec<_> = classes.iter().map(|&class| name(class)).collect();
        let found = name(pointer.storage_class);
        let wanted = wanted.join(" or ");
        let message = format!("a variable in storage class {found}: {wanted} is needed here");
        return Err(translator.invalid(message).note(RULES));
    }
    match pointer {
        memory::Pointer {
            base: PointerBase::Registers { first, .. }, index: None, offset, pointee, ..
        } => Ok(RegSpan { first: first.plus(offset), count: translator.word_count(pointee)? }),
        _ => Err(translator.unsupported("a payload that is no whole variable")),
    }
}
