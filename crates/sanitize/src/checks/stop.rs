//! What a shader hands to the pipeline with its batch: the operands of a trace or a call, and what
//! an intersection shader reports.

use crate::checks::{births, hit_object, ray, reported};
use crate::report::specials::SpecialSink;
use crate::report::{CallFrame, Sink};
use crate::rule::trace;
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, OpIndex, ShadowRegisters};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::ray_tracing::RayTracingOp;
use anyhit_engine::pipeline::{DEFAULT_CALLABLE_DEPTH, Pipeline};

/// A shader hands its batch to the pipeline.
pub(crate) fn check<const W: usize>(
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
            reported::check(sanitizer, batch, op, t);
            depend_on_attributes(sanitizer, batch, shadow, op);
            shadow.define(accepted);
        }
        RayTracingOp::HitObjectRecordHandle { to, .. } => {
            (0..2).for_each(|word| shadow.define(to.plus(word)));
        }
        RayTracingOp::HitObjectExecute { object, .. } => {
            hit_object::check_execute(sanitizer, batch, op, object);
        }
    }
}

/// Callable shaders that the default size of a pipeline's stack is for.
const CALLABLES_ON_DEFAULT_STACK: usize = 2;

/// A callable shader begins: tells where more of them are in progress than the default stack of a
/// pipeline is for, unless the pipeline says how many may be.
pub(crate) fn check_callable_depth<const W: usize>(sanitizer: &mut Sanitizer<'_>, batch: &Batch<W>) {
    let is_callable = |frame: &&CallFrame| {
        let plan = sanitizer.plans.get(frame.shader.index());
        plan.is_some_and(|plan| plan.program.stage == Stage::Callable)
    };
    let waiting = sanitizer.frames.iter().filter(is_callable).count();
    let is_default = |pipeline: &Pipeline| pipeline.max_callable_depth == DEFAULT_CALLABLE_DEPTH;
    if waiting < CALLABLES_ON_DEFAULT_STACK || !sanitizer.pipeline.is_some_and(is_default) {
        return;
    }
    let Some(op) = sanitizer.frames.last().map(|caller| caller.op) else { return };
    sanitizer.tell(batch, &trace::CALLABLE_DEPTH, op, batch.mask, |_| {
        format!(
            "a callable shader is called while {waiting} others wait: the default stack of a pipeline is for \
             {CALLABLES_ON_DEFAULT_STACK} in all"
        )
    });
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
    for word in 0..registers.count {
        let (register, sink) = (registers.first.plus(word), SpecialSink::Attributes);
        births::reach(sanitizer, batch, shadow, op, register, batch.mask, sink);
    }
}
