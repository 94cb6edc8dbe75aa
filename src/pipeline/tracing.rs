//! Traces on the stack: from the operands of an instruction to rays, and back to the caller.

use std::sync::Arc;

use crate::accel::{RayFlags, RayRule, Tlas, TraceRay};
use crate::geometry::Ray;
use crate::machine::object::ObjectRef;
use crate::machine::stop::Rows;
use crate::machine::{Invocation, Mask, Observer, Reg, TrapCode};
use crate::ops::hit_object;
use crate::ops::ray_tracing::TRACE_OPERANDS;
use crate::ops::row::{Row, Width};
use crate::pipeline::PipelineFlags;
use crate::pipeline::stack::{Level, Stack};
use crate::pipeline::trace::{Query, RayState};
use crate::pipeline::witness::{Caller, Event, Witness};

impl<const W: usize, T: Witness, O: Observer<W>> Stack<'_, W, T, O>
where
    Row: Width<W>,
{
    pub(super) fn begin_trace(
        &mut self,
        mask: Mask<W>,
        operands: Reg,
        payload: Rows,
        object: Option<ObjectRef>,
    ) {
        let mut trace = self.spare_trace(object.is_none());
        let Some(Level::Shader(running)) = self.levels.last_mut() else { return };
        let bindings = &self.bindings[running.shader.0 as usize];
        let caller = Caller { shader: running.shader, op: running.batch.op - 1, payload: payload.first };
        for lane in mask.lanes() {
            let batch = &running.batch;
            let mut words = [0; TRACE_OPERANDS as usize];
            let read = batch.registers.lane_words(operands, TRACE_OPERANDS, lane);
            words.iter_mut().zip(read).for_each(|(to, word)| *to = word);
            let invocation = &batch.invocations[lane];
            let depth = invocation.depth + 1;
            let place = object.map_or(Ok(Reg(0)), |object| object.row(&batch.registers, lane));
            let mut asked = u64::from(words[0]) | u64::from(words[1]) << 32;
            let query = match bindings.acceleration_structure([words[0], words[1]]) {
                _ if let Err(code) = place => Err(code),
                None => Err(TrapCode::AccelerationStructureMissing),
                Some(_) if depth > self.pipeline.max_recursion => Err(TrapCode::RecursionTooDeep),
                Some(tlas) => {
                    let payload = batch.registers.lane_words(payload.first, payload.count, lane);
                    query(tlas, &words, payload, invocation, depth, self.pipeline.flags).map_err(|broken| {
                        asked = broken as u64;
                        TrapCode::InvalidTrace
                    })
                }
            };
            match query {
                Ok(query) => trace.push(lane, query, Some(caller), self.witness),
                Err(code) => {
                    let op = running.batch.op - 1;
                    running.batch.asked[lane] = asked;
                    running.batch.trap(Mask::lane(lane), code, op);
                }
            }
        }
        self.stats.rays += trace.lanes().len() as u64;
        self.levels.push(Level::Trace { trace, payload: Some(payload), object });
    }

    /// Takes a trace whose rays are done from the stack; its ray where nothing called it.
    pub(super) fn end_trace(&mut self) -> Option<RayState> {
        let Some(Level::Trace { trace, payload, object }) = self.levels.pop() else { return None };
        self.stats = std::mem::take(&mut self.stats).plus(&trace.stats);
        if T::ACTIVE {
            for &lane in trace.lanes().iter().filter(|&&lane| !trace.ray(lane).is_settled()) {
                let payload = trace.ray(lane).query.payload.to_vec();
                self.witness.invocation(trace.ray(lane).query.launch_id);
                self.witness.event(Event::Traced { payload });
            }
        }
        let (Some(Level::Shader(below)), Some(payload)) = (self.levels.last_mut(), payload) else {
            return Some(trace.ray(0).clone());
        };
        for &lane in trace.lanes() {
            let ray = trace.ray(lane);
            below.batch.registers.set_lane_words(payload.first, lane, ray.query.payload.iter().copied());
            if let Some(code) = ray.trapped {
                let op = below.batch.op - 1;
                below.batch.trap(Mask::lane(lane), code, op);
            } else if let Some(object) = object {
                hit_object::store(&mut below.batch, object, lane, ray.hit_object())
                    .expect("bug in anyhit: a hit object has moved");
            }
        }
        self.spare_traces.push(trace);
        None
    }
}

/// `SkipTrianglesKHR` and `SkipAABBsKHR`
const SKIPS: u32 = 0x300;

/// A trace as the operands of its instruction say. Where the pipeline skips one kind of primitive the
/// ray must not skip the other.
fn query<'a, P: Iterator<Item = u32>>(
    tlas: &'a Arc<Tlas>,
    words: &[u32; TRACE_OPERANDS as usize],
    payload: P,
    invocation: &Invocation,
    depth: u32,
    flags: PipelineFlags,
) -> Result<Query<&'a Arc<Tlas>, P>, RayRule> {
    let trace = trace_operands(words)?;
    if (trace.flags.0 | flags.ray_flags()) & SKIPS == SKIPS {
        return Err(match trace.flags.contains(RayFlags::SKIP_TRIANGLES) {
            true => RayRule::SkipsTrianglesBesidePipeline,
            false => RayRule::SkipsAabbsBesidePipeline,
        });
    }
    Ok(Query {
        tlas,
        trace,
        sbt_offset: words[4],
        sbt_stride: words[5],
        miss_index: words[6],
        payload,
        launch_id: invocation.launch_id,
        launch_size: invocation.launch_size,
        depth,
    })
}

/// Ray, flags, cull mask and time of a trace's operands, checked.
pub(crate) fn trace_operands(words: &[u32; TRACE_OPERANDS as usize]) -> Result<TraceRay, RayRule> {
    let float = |at: usize| f32::from_bits(words[at]);
    let ray = Ray {
        origin: [float(7), float(8), float(9)],
        t_min: float(10),
        direction: [float(11), float(12), float(13)],
        t_max: float(14),
    };
    let trace = TraceRay { ray, flags: RayFlags(words[2]), cull_mask: words[3], time: float(15) };
    trace.check()?;
    Ok(trace)
}
