//! Rules about hit objects that are no traps: what their attributes are, and were recorded as; what
//! a ray query leaves out; the index of their record.

use crate::checks::births;
use crate::interface_types::scalars;
use crate::plan::InstructionWords;
use crate::report::Sink;
use crate::report::specials::SpecialSink;
use crate::rule::{Rule, hit_object};
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::hit_object::{EncodedHit, EncodedRay, HitObject};
use anyhit_engine::machine::object::ObjectRef;
use anyhit_engine::machine::{Batch, Mask, OpIndex, ShadowRegisters};
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{Type, TypeId};
use anyhit_engine::ops::hit_object::{HitObjectOp, has_time};
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::ray_tracing::RayTracingOp;
use anyhit_engine::program::Program;

/// Checks an operation on hit objects that has run.
pub(crate) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    op: OpIndex,
    object_op: &HitObjectOp,
) {
    match *object_op {
        HitObjectOp::Get { object, getter, .. } if getter.reads_time() => {
            check_time(sanitizer, batch, op, object);
        }
        HitObjectOp::GetAttributes { object, to } => {
            let Some((_, plan)) = sanitizer.plan() else { return };
            let variable = plan.program.interface.iter().find(|one| one.first == to.first);
            let Some(ty) = variable.map(|variable| variable.ty) else { return };
            let reads = |_: &EncodedRay| Some((&*plan.program, ty));
            let rule = &hit_object::HO_ATTRIBUTES_TYPE;
            check_type(sanitizer, batch, op, object, reads, rule, |reads, recorded| {
                format!("the attributes of a hit object are read as {reads}, and {recorded}")
            });
        }
        HitObjectOp::RecordHit { object, attributes, .. } => {
            check_kind(sanitizer, batch, op, object);
            sanitizer.depend_on_all(batch, shadow, op, attributes.first, attributes.count, Sink::HitObject);
            for word in 0..attributes.count {
                let (register, sink) = (attributes.first.plus(word), SpecialSink::Attributes);
                births::reach(sanitizer, batch, shadow, op, register, batch.mask, sink);
            }
        }
        HitObjectOp::RecordFromQuery { object, attributes, hit_kind, .. } => {
            check_kind(sanitizer, batch, op, object);
            let boxes = lanes(batch, object, |found| {
                found.hit().is_ok_and(|(_, hit)| hit.committed.candidate.is_box())
            });
            if hit_kind.is_none() {
                sanitizer.tell(batch, &hit_object::HO_FROM_QUERY, op, boxes, |_| {
                    "a hit object is made from a ray query that has hit a box, without a hit kind".to_owned()
                });
            }
            for word in 0..attributes.count {
                let register = attributes.first.plus(word);
                sanitizer.depend_in(batch, shadow, op, register, Sink::HitObject, boxes);
            }
        }
        HitObjectOp::SetRecord { record, .. } => {
            let Some(limit) = sanitizer.pipeline.map(|pipeline| pipeline.max_record_index) else { return };
            let index = |lane: usize| batch.registers[record].0[lane];
            let above = batch.mask & Mask::from_fn(|lane| u64::from(index(lane)) > limit);
            sanitizer.tell(batch, &hit_object::HO_SBT_LIMIT, op, above, |lane| {
                format!("the record's index {} is set in a hit object: {limit} is the most", index(lane))
            });
        }
        _ => {}
    }
}

/// Checks what a hit object hands to the closest-hit shader that it executes.
pub(crate) fn check_execute<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    object: ObjectRef,
) {
    let Some(pipeline) = sanitizer.pipeline else { return };
    let declares = |encoded: &EncodedRay| {
        let program = &*pipeline.programs[pipeline.hit_group(encoded.record)?.closest_hit?.index()];
        Some((program, program.interface_registers(storage::HIT_ATTRIBUTE)?.ty))
    };
    let rule = &hit_object::HO_EXECUTE_ATTRIBUTES;
    check_type(sanitizer, batch, op, object, declares, rule, |declared, recorded| {
        format!(
            "a hit object executes a closest-hit shader whose attributes are {declared}, and its own {recorded}"
        )
    });
}

/// Tells of a box whose recorded hit kind is one of triangles.
fn check_kind<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    object: ObjectRef,
) {
    let kind = |found: &HitObject| {
        let (_, hit) = found.hit().ok()?;
        hit.committed.candidate.is_box().then_some(hit.committed.hit_kind.0)
    };
    let above = lanes(batch, object, |found| kind(found).is_some_and(|kind| kind > 127));
    sanitizer.tell(batch, &hit_object::HO_RECORD_KIND, op, above, |lane| {
        let kind = of_lane(batch, object, lane).and_then(kind).unwrap_or_default();
        format!("the hit kind {kind} is recorded for a box, and 127 is the most")
    });
}

/// Tells of a time that is read where none was recorded.
fn check_time<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    object: ObjectRef,
) {
    let Some((_, plan)) = sanitizer.plan() else { return };
    let without = lanes(batch, object, |found| {
        let op = found.encoded().ok().and_then(|encoded| encoded.origin.op);
        let origin = op.and_then(|op| plan.program.origins.get(op.index()));
        origin
            .is_some_and(|origin| !has_time(InstructionWords::at(&plan.program.module, origin.offset).opcode))
    });
    sanitizer.tell(batch, &hit_object::HO_TIME, op, without, |_| {
        "the time of a hit object is read, which was recorded without one".to_owned()
    });
}

/// The hit object of a lane, where it was recorded.
fn of_lane<const W: usize>(batch: &Batch<W>, object: ObjectRef, lane: usize) -> Option<&HitObject> {
    let register = object.register(&batch.registers, lane).ok()?;
    batch.hit_objects.get(batch.registers[register].0[lane])
}

/// The lanes whose hit object something holds for.
fn lanes<const W: usize>(batch: &Batch<W>, object: ObjectRef, holds: impl Fn(&HitObject) -> bool) -> Mask<W> {
    let lanes = batch.mask.lanes().filter(|&lane| of_lane(batch, object, lane).is_some_and(&holds));
    lanes.fold(Mask::NONE, |mask, lane| mask | Mask::lane(lane))
}

/// Tells where the attributes of a hit object were not recorded as the type that they are used as,
/// which is given with its program. The message is made of both types.
fn check_type<'p, const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    object: ObjectRef,
    used_as: impl Fn(&EncodedRay) -> Option<(&'p Program, TypeId)>,
    rule: &'static Rule,
    message: impl Fn(&str, &str) -> String,
) {
    let mismatch = |found: &HitObject| {
        let (encoded, hit) = found.hit().ok()?;
        let ((program, ty), recorded) = (used_as(encoded)?, recorded_type(sanitizer, encoded, hit)?);
        let used = || format!("`{}`", program.module.describe_type(ty));
        (!recorded.is(&program.module, ty)).then(|| message(&used(), &recorded.describe()))
    };
    let broken = lanes(batch, object, |found| mismatch(found).is_some());
    let first = broken.lowest().and_then(|lane| mismatch(of_lane(batch, object, lane)?));
    if let Some(text) = first {
        sanitizer.tell(batch, rule, op, broken, |_| text);
    }
}

/// What the attributes of a hit object were recorded as.
#[derive(Clone, Copy, Debug)]
enum RecordedType<'a> {
    /// Those of a triangle, sphere or linear swept sphere: two floats.
    BuiltIn,
    /// Those of a variable of this type.
    Variable(&'a Module, TypeId),
    /// None, as the intersection shader declares none.
    Nothing,
}

impl RecordedType<'_> {
    /// Whether it is a type, scalar by scalar.
    fn is(self, module: &Module, ty: TypeId) -> bool {
        let used = scalars(module, ty);
        match self {
            Self::BuiltIn => {
                used.len() <= 2 && used.iter().all(|one| matches!(one, Type::Float { width: 32, .. }))
            }
            Self::Variable(module, ty) => used == scalars(module, ty),
            Self::Nothing => used.is_empty(),
        }
    }

    fn describe(self) -> String {
        match self {
            Self::BuiltIn => "are two floats, as of all triangles, spheres and linear swept spheres".into(),
            Self::Variable(module, ty) => format!("were recorded as `{}`", module.describe_type(ty)),
            Self::Nothing => "are none: the intersection shader declares none".into(),
        }
    }
}

/// What the attributes of a hit were recorded as; `None` where that is not known.
fn recorded_type<'a>(
    sanitizer: &Sanitizer<'a>,
    encoded: &EncodedRay,
    hit: &EncodedHit,
) -> Option<RecordedType<'a>> {
    let (_, plan) = sanitizer.plan()?;
    let is_box = hit.committed.candidate.is_box();
    match plan.program.ops.get(encoded.origin.op?.index())? {
        Op::HitObject(object) => match **object {
            HitObjectOp::RecordFromQuery { .. } if !is_box => Some(RecordedType::BuiltIn),
            HitObjectOp::RecordHit { attributes, .. } | HitObjectOp::RecordFromQuery { attributes, .. } => {
                let variable = plan.program.interface.iter().find(|one| one.first == attributes.first)?;
                Some(RecordedType::Variable(&plan.program.module, variable.ty))
            }
            _ => None,
        },
        Op::Stop(RayTracingOp::HitObjectTrace { .. }) if is_box => {
            let pipeline = sanitizer.pipeline?;
            let group = pipeline.hit_group(encoded.origin.record)?;
            let program = &pipeline.programs[group.intersection?.index()];
            Some(match program.interface_registers(storage::HIT_ATTRIBUTE) {
                Some(registers) => RecordedType::Variable(&program.module, registers.ty),
                None => RecordedType::Nothing,
            })
        }
        Op::Stop(RayTracingOp::HitObjectTrace { .. }) => Some(RecordedType::BuiltIn),
        _ => None,
    }
}
