//! What a shader hands to the pipeline with its batch: the operands of a trace or a call, and what
//! an intersection shader reports.

use crate::machine::{Batch, OpIndex, ShadowRegisters};
use crate::ops::pointer::storage;
use crate::ops::ray_tracing::RayTracingOp;
use crate::sanitize::checks::{births, ray};
use crate::sanitize::report::Sink;
use crate::sanitize::report::specials::SpecialSink;
use crate::sanitize::sanitizer::Sanitizer;

/// A shader hands its batch to the pipeline.
pub(in crate::sanitize) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    op: OpIndex,
    stop: &RayTracingOp,
) {
    match *stop {
        RayTracingOp::TraceRay { operands, .. } | RayTracingOp::HitObjectTrace { operands, .. } => {
            ray::check_trace(sanitizer, batch, shadow, op, operands);
        }
        RayTracingOp::ExecuteCallable { index, .. } => {
            sanitizer.depend(batch, shadow, op, index, Sink::Record);
        }
        RayTracingOp::ReportIntersection { t, hit_kind, accepted } => {
            sanitizer.depend(batch, shadow, op, t, Sink::ReportedT);
            sanitizer.depend(batch, shadow, op, hit_kind, Sink::HitKind);
            births::reach(sanitizer, batch, shadow, op, t, batch.mask, SpecialSink::ReportedT);
            depend_on_attributes(sanitizer, batch, shadow, op);
            shadow.define(accepted);
        }
        RayTracingOp::HitObjectRecordHandle { to, .. } => {
            (0..2).for_each(|word| shadow.define(to.plus(word)));
        }
        RayTracingOp::HitObjectExecute { .. } => {}
    }
}

/// The hit attributes that a report carries.
fn depend_on_attributes<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    op: OpIndex,
) {
    let Some((_, plan)) = sanitizer.plan() else { return };
    let Some(registers) = plan.program.interface_registers(storage::HIT_ATTRIBUTE) else { return };
    sanitizer.depend_on_all(batch, shadow, op, registers.first, registers.count, Sink::Report);
}
