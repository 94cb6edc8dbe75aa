//! Ray-tracing instructions (`SPV_KHR_ray_tracing`) that hand the batch to the pipeline.

use crate::module::Opcode;

use crate::machine::object::ObjectRef;
use crate::machine::stop::RegSpan;
use crate::machine::{Batch, Reg, Stop};
use crate::ops::access::{Access, object_accesses, object_write_accesses};

pub use translate::translate;

pub mod translate;

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
                object_write_accesses(object, visit);
                visit(Access::Read(operands, TRACE_OPERANDS));
                visit(Access::Read(payload.first, payload.count));
                visit(Access::Write(payload.first, payload.count));
            }
            Self::HitObjectExecute { object, payload } => {
                object_accesses(object, visit);
                visit(Access::Read(payload.first, payload.count));
                visit(Access::Write(payload.first, payload.count));
            }
            Self::HitObjectRecordHandle { object, to } => {
                object_accesses(object, visit);
                visit(Access::Write(to, 2));
            }
        }
    }

    /// The registers of the payload or callable data that a called shader is given.
    pub fn payload_span(&self) -> Option<RegSpan> {
        match *self {
            Self::ExecuteCallable { data, .. } => Some(data),
            _ => self.ray_payload(),
        }
    }

    /// The registers of the payload that the shaders of a ray are given.
    pub fn ray_payload(&self) -> Option<RegSpan> {
        match *self {
            Self::TraceRay { payload, .. }
            | Self::HitObjectTrace { payload, .. }
            | Self::HitObjectExecute { payload, .. } => Some(payload),
            Self::ExecuteCallable { .. }
            | Self::ReportIntersection { .. }
            | Self::HitObjectRecordHandle { .. } => None,
        }
    }

    /// The first of the two registers with the acceleration structure in which it traces.
    pub(super) fn traced_structure(&self) -> Option<Reg> {
        match *self {
            Self::TraceRay { operands, .. } | Self::HitObjectTrace { operands, .. } => Some(operands),
            _ => None,
        }
    }

    /// Whether lanes may continue in other subgroups.
    pub(super) fn may_repack(&self) -> bool {
        !self.addresses_record()
    }

    /// Whether it gives the device address of a shader record.
    pub(super) fn addresses_record(&self) -> bool {
        matches!(self, Self::HitObjectRecordHandle { .. })
    }

    /// The hit object that it writes or reads, where there is one.
    pub fn hit_object(&self) -> Option<ObjectRef> {
        match *self {
            Self::HitObjectTrace { object, .. }
            | Self::HitObjectExecute { object, .. }
            | Self::HitObjectRecordHandle { object, .. } => Some(object),
            Self::TraceRay { .. } | Self::ExecuteCallable { .. } | Self::ReportIntersection { .. } => None,
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
    pub fn of(opcode: Opcode) -> Option<Self> {
        let (name, rule) = match opcode {
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
