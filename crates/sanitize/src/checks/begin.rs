//! What is undefined when a shader begins: its variables, and builtins that its hit does not have.

use crate::cause::Cause;
use crate::rule::{Rule, contract};
use crate::sanitizer::Sanitizer;
use anyhit_engine::accel::HitKind;
use anyhit_engine::machine::{Batch, Mask, ShaderIndex, ShadowRegisters};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::builtin::Builtin;
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::ray_tracing::RayTracingOp;
use anyhit_engine::ops::value_registers::UndefinedConstant;

/// A shader begins.
pub(crate) fn begin<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    shader: ShaderIndex,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
) {
    shadow.clear();
    let Some(plan) = sanitizer.plans.get(shader.index()) else { return };
    let program = &plan.program;
    shadow.track_freshness(plan.stale.len());
    let is_hit_shader = matches!(program.stage, Stage::AnyHit | Stage::ClosestHit);
    for registers in &program.interface {
        let cause = |word| Cause::Unwritten {
            shader,
            variable: registers.variable,
            storage_class: registers.storage_class,
            word,
        };
        let (first, skipped, lanes) = match registers.storage_class {
            storage::INCOMING_RAY_PAYLOAD | storage::INCOMING_CALLABLE_DATA => continue,
            // The attributes of primitives that are built in are two floats.
            storage::HIT_ATTRIBUTE if is_hit_shader => {
                let unset = batch.mask & Mask::from_fn(|lane| has_no_attributes(sanitizer, batch, lane));
                sanitizer.undefine_variable(shadow, unset, registers.first, registers.count, cause);
                let lanes = batch.mask & Mask::from_fn(|lane| is_built_in(hit_kind(batch, lane)));
                (registers.first.plus(2.min(registers.count)), 2.min(registers.count), lanes)
            }
            _ => (registers.first, 0, batch.mask),
        };
        let count = registers.count - skipped;
        sanitizer.undefine_variable(shadow, lanes, first, count, |word| cause(skipped + word));
    }
    for &UndefinedConstant { id, first, count, .. } in &program.undefined_constants {
        let cause = Cause::UndefConstant { shader, id };
        sanitizer.undefine_variable(shadow, batch.mask, first, count, |_| cause);
    }
    for input in &program.inputs {
        let Some((rule, has)) = needs_primitive(input.builtin) else { continue };
        let lacking = batch.mask & Mask::from_fn(|lane| !has(hit_kind(batch, lane)));
        if !lacking.is_empty() {
            let builtin = input.builtin.number;
            let cause = Cause::Builtin { shader, builtin, rule: rule.id };
            sanitizer.undefine_variable(shadow, lacking, input.first, input.count, |_| cause);
        }
    }
}

/// Workgroups begin to run, unless they have begun with another batch.
pub(crate) fn begin_workgroups<const W: usize>(sanitizer: &mut Sanitizer<'_>, batch: &Batch<W>) {
    let first = batch.mask.lowest().and_then(|lane| batch.invocations.workgroup(lane));
    let Some(first) = first.map(|group| group.index() as u32) else { return };
    if sanitizer.first_workgroup == Some(first) {
        return;
    }
    sanitizer.first_workgroup = Some(first);
    sanitizer.shared.begin(first);
    if let Some(races) = &mut sanitizer.races {
        races.begin_workgroups(first, batch.invocations.subgroup_size());
    }
}

fn hit_kind<const W: usize>(batch: &Batch<W>, lane: usize) -> HitKind {
    HitKind(batch.invocations.hits.kind.0[lane])
}

fn is_triangle(kind: HitKind) -> bool {
    matches!(kind, HitKind::FRONT_FACING_TRIANGLE | HitKind::BACK_FACING_TRIANGLE)
}

/// Whether a hit is of a triangle, sphere or linear swept sphere.
fn is_built_in(kind: HitKind) -> bool {
    is_triangle(kind) || matches!(kind, HitKind::SPHERE | HitKind::LINEAR_SWEPT_SPHERE)
}

/// Whether the hit that a shader has begun for in a lane was reported by an intersection shader
/// that uses no hit attributes.
fn has_no_attributes<const W: usize>(sanitizer: &Sanitizer<'_>, batch: &Batch<W>, lane: usize) -> bool {
    if is_built_in(hit_kind(batch, lane)) {
        return false;
    }
    let Some(pipeline) = sanitizer.pipeline else { return false };
    // The frame of the shader that begins lies on that of its caller.
    let caller = sanitizer.frames.iter().rev().nth(1);
    let calls = caller.and_then(|caller| pipeline.programs[caller.shader.index()].ops.get(caller.op.index()));
    // Of a hit object that was recorded the attributes are those that were recorded with it.
    if matches!(calls, Some(Op::Stop(RayTracingOp::HitObjectExecute { .. }))) {
        return false;
    }
    let group = pipeline.hit_group(batch.invocations.record_indices[lane]);
    let intersection = group.and_then(|group| group.intersection);
    intersection.is_some_and(|shader| {
        pipeline.programs[shader.index()].interface_registers(storage::HIT_ATTRIBUTE).is_none()
    })
}

/// Whether a hit is of a primitive that has a builtin.
type HasBuiltin = fn(HitKind) -> bool;

/// The rule of a builtin that only hits of some primitives have, and which those are.
fn needs_primitive(builtin: &Builtin) -> Option<(&'static Rule, HasBuiltin)> {
    Some(match builtin.number {
        5335 => (&contract::POSITIONS_KIND, is_triangle),
        5361 | 5420 => (&contract::SPHERE_LSS_BUILTIN, |kind| kind == HitKind::SPHERE),
        5396 | 5421 => (&contract::SPHERE_LSS_BUILTIN, |kind| kind == HitKind::LINEAR_SWEPT_SPHERE),
        _ => return None,
    })
}
