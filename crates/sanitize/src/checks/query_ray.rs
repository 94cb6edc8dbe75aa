//! Lints about the rays of ray queries: where they begin, at which time, and in which space hits in
//! boxes are generated. Those of traces are in `traversal_lints`.

use crate::rule::traversal;
use crate::sanitizer::Sanitizer;
use crate::surface_point::SurfacePoint;
use anyhit_engine::accel::HitPrimitive;
use anyhit_engine::machine::object::ObjectRef;
use anyhit_engine::machine::{Batch, Mask, OpIndex, Reg};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::ray_query::RayQueryOp;

/// A ray query is about to be initialized, with operands in consecutive registers: notes the
/// surfaces on which rays may begin whose t_min is 0. What the query has hit before is lost then.
pub(crate) fn before_initialize<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    operands: Reg,
) {
    sanitizer.query_surfaces.clear();
    let t_min = &batch.registers[operands.plus(7)];
    let starts_at_zero = batch.mask & Mask::from_fn(|lane| f32::from_bits(t_min.0[lane]) == 0.0);
    if starts_at_zero.is_empty() {
        return;
    }
    let queries = batch.queries.iter().filter(|query| starts_at_zero.contains(query.lane()));
    for query in queries {
        if let Some(hit) = query.committed() {
            let point = SurfacePoint::new(query.tlas(), query.trace(), hit.candidate.hit_primitive(), hit.t);
            sanitizer.query_surfaces.push((query.lane(), point));
        }
    }
    let stage = sanitizer.plan().map(|(_, plan)| plan.program.stage);
    if !matches!(stage, Some(Stage::ClosestHit | Stage::AnyHit)) {
        return;
    }
    let invocations = &batch.invocations;
    for lane in starts_at_zero.lanes() {
        let Some(tlas) = invocations.structures.get(lane) else { continue };
        let hits = &invocations.hits;
        let [instance, geometry, primitive] =
            [&hits.instance, &hits.geometry, &hits.primitive].map(|lanes| lanes.0[lane]);
        let hit = HitPrimitive { instance, geometry, primitive };
        let t = f32::from_bits(invocations.t_max.0[lane]);
        sanitizer.query_surfaces.push((lane, SurfacePoint::new(tlas, &invocations.rays.get(lane), hit, t)));
    }
}

/// A ray query was initialized.
pub(crate) fn initialized<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &mut Batch<W>,
    op: OpIndex,
    object: ObjectRef,
) {
    let surfaces = std::mem::take(&mut sanitizer.query_surfaces);
    let (mut on_surface, mut without_time) = (Mask::NONE, Mask::NONE);
    for lane in batch.mask.lanes() {
        let time = f32::from_bits(batch.invocations.rays.time.0[lane]);
        let Ok(register) = object.register(&batch.registers, lane) else { continue };
        let handle = batch.registers[register].0[lane];
        let Ok(query) = batch.queries.query(handle) else { continue };
        let begins_on = |(at, point): &(usize, SurfacePoint)| {
            *at == lane && point.is_origin_of(query.tlas(), query.trace())
        };
        if surfaces.iter().any(begins_on) {
            on_surface = on_surface | Mask::lane(lane);
        }
        if time != 0.0 && query.tlas().moves() {
            without_time = without_time | Mask::lane(lane);
        }
    }
    sanitizer.tell(batch, &traversal::RAY_FROM_SURFACE, op, on_surface, |_| {
        "a ray query begins on a surface that was hit before, with a t_min of 0".to_owned()
    });
    let times = &batch.invocations.rays.time;
    sanitizer.tell(batch, &traversal::RAY_LOSES_TIME, op, without_time, |lane| {
        let time = f32::from_bits(times.0[lane]);
        format!("a ray query has no time, where the ray that called its shader has {time:?}")
    });
}

/// A hit was generated in a box: the shader must know the object space of its instance.
pub(crate) fn generated<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &mut Batch<W>,
    op: OpIndex,
    object: ObjectRef,
) {
    let Some((_, plan)) = sanitizer.plan() else { return };
    let asks =
        |op: &Op| matches!(op, Op::RayQuery(RayQueryOp::Get { getter, .. }) if getter.reads_object_space());
    if plan.program.ops.iter().any(asks) {
        return;
    }
    let mut transformed = Mask::NONE;
    for lane in batch.mask.lanes() {
        let Ok(register) = object.register(&batch.registers, lane) else { continue };
        let handle = batch.registers[register].0[lane];
        let Ok(query) = batch.queries.query(handle) else { continue };
        let instance = query.candidate().ok().map(|candidate| candidate.instance);
        let instance = instance.and_then(|at| query.tlas().instances().get(at as usize));
        if instance.is_some_and(|instance| !instance.is_identity()) {
            transformed = transformed | Mask::lane(lane);
        }
    }
    sanitizer.tell(batch, &traversal::WORLD_RAY_IN_INTERSECTION, op, transformed, |_| {
        "a hit is generated in a box of a transformed instance, and the shader reads neither the candidate's ray \
         in object space nor its transform"
            .to_owned()
    });
}
