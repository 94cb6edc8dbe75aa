//! Begins and ends traces on the stack: reads their operands and returns results to the caller.

use std::sync::Arc;

use crate::accel::{RayFlags, RayRule, Tlas, TraceRay};
use crate::geometry::Ray;
use crate::machine::object::ObjectRef;
use crate::machine::stop::RegSpan;
use crate::machine::{AccessFault, Bindings, Mask, Reg, Registers, ShadowRegisters, TrapCode};
use crate::math::array;
use crate::ops::hit_object;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::ray_tracing::TRACE_OPERANDS;
use crate::pipeline::host_ray::RayOperands;
use crate::pipeline::observer::{Caller, Event};
use crate::pipeline::stack::{ShaderCallFrame, Stack};
use crate::pipeline::trace::{Trace, Words};
use crate::pipeline::{PipelineFlags, payload};

impl<const W: usize> Trace<W> {
    /// Reads the operands of an instruction for the lanes of a mask; returns the lanes whose
    /// acceleration structure exists.
    fn read_operands(
        &mut self,
        registers: &Registers<W>,
        operands: Reg,
        bindings: &Bindings,
        mask: Mask<W>,
    ) -> Mask<W> {
        let operand = |at: u32| &registers[operands.plus(at)];
        self.rays.copy(registers, operands.plus(2), operands.plus(3), operands.plus(7));
        (self.sbt_offset, self.sbt_stride, self.miss_index) = (*operand(4), *operand(5), *operand(6));
        let (mut rest, mut found) = (mask, Mask::NONE);
        while let Some(lane) = rest.lowest() {
            let handle = [operand(0).0[lane], operand(1).0[lane]];
            let same = rest & Mask::equal(operand(0), handle[0]) & Mask::equal(operand(1), handle[1]);
            rest = rest.without(same);
            if let Some(tlas) = bindings.acceleration_structure(handle) {
                self.structures.set(same, tlas);
                found = found | same;
            }
        }
        found
    }

    /// Sets the first lane to the operands of a ray from the host; returns the registers of its
    /// payload, which have shadows where the shaders are observed.
    pub(super) fn set_host_operands(
        &mut self,
        tlas: &Arc<Tlas>,
        operands: RayOperands,
        is_observed: bool,
    ) -> RegSpan {
        let RayOperands { trace, sbt_offset, sbt_stride, miss_index, payload } = operands;
        self.set_host_caller();
        self.structures.set(Mask::lane(0), tlas);
        self.rays.set(0, &trace);
        (self.sbt_offset.0[0], self.sbt_stride.0[0], self.miss_index.0[0]) =
            (sbt_offset, sbt_stride, miss_index);
        let mut registers = Registers::new(payload.len());
        let span = RegSpan { first: Reg(0), count: payload.len() as u32 };
        registers.set_lane_words(span.first, 0, payload);
        registers.shadow = is_observed.then(|| Box::new(ShadowRegisters::new(registers.len())));
        self.host_payload = Some(registers);
        self.begin(Mask::lane(0));
        span
    }

    /// The registers that hold the payload; `below` are the frames under the trace.
    #[inline]
    pub(super) fn payload<'a>(&'a mut self, below: &'a mut [ShaderCallFrame<W>]) -> &'a mut Registers<W> {
        match (&mut self.host_payload, below) {
            (Some(own), _) => own,
            (None, [.., ShaderCallFrame::Shader(caller)]) => &mut caller.batch.registers,
            _ => unreachable!("bug in anyhit: a trace without a caller"),
        }
    }
}

impl<const W: usize> Stack<'_, W>
where
    LaneKernel: Width<W>,
{
    pub(super) fn begin_trace(
        &mut self,
        mask: Mask<W>,
        operands: Reg,
        payload: RegSpan,
        object: Option<ObjectRef>,
    ) {
        let mut trace = self.acquire_trace(object.is_none());
        let is_full = self.is_full();
        let Some(ShaderCallFrame::Shader(running)) = self.frames.last_mut() else { return };
        let bindings = &self.bindings[running.shader.index()];
        let batch = &mut running.batch;
        let caller = Caller { shader: running.shader, op: batch.stopped_at(), payload: payload.first };
        let program = &self.pipeline.programs[running.shader.index()];
        trace.set_caller(caller, payload::outgoing_scalars(program, payload), &batch.invocations);
        let found = trace.read_operands(&batch.registers, operands, bindings, mask);
        let flags = self.pipeline.flags;
        let mut lanes = found & trace.rays.valid_rays(flags.ray_flags());
        if trace.depth > self.pipeline.max_recursion
            || is_full
            || matches!(object, Some(ObjectRef::Computed { .. }))
        {
            lanes = Mask::NONE;
        }
        // Lanes whose rays may break a rule are checked one by one.
        for lane in mask.without(lanes).lanes() {
            let register = object.map_or(Ok(Reg(0)), |object| object.register(&batch.registers, lane));
            let handle = || {
                let word = |at: u32| u64::from(batch.registers[operands.plus(at)].0[lane]);
                word(0) | word(1) << 32
            };
            let checked = register.map(|_| check_trace(&trace.rays.get(lane), flags));
            let trap = match checked {
                Err(code) => Some((code, 0)),
                _ if !found.contains(lane) => Some((TrapCode::AccelerationStructureMissing, handle())),
                _ if trace.depth > self.pipeline.max_recursion => Some((TrapCode::RecursionTooDeep, 0)),
                _ if is_full => Some((TrapCode::StackOverflow, 0)),
                Ok(Err(broken)) => Some((TrapCode::InvalidTrace, broken as u64)),
                Ok(Ok(())) => None,
            };
            match trap {
                None => lanes = lanes | Mask::lane(lane),
                Some((code, fault_value)) => {
                    let op = batch.stopped_at();
                    batch.fault_value[lane] = fault_value;
                    if code == TrapCode::AccelerationStructureMissing {
                        let fault = AccessFault::structure(fault_value, bindings);
                        fault.into_iter().for_each(|fault| batch.record_access_fault(lane, fault));
                    }
                    batch.trap(Mask::lane(lane), code, op);
                }
            }
        }
        trace.begin(lanes);
        self.push_trace(trace, payload, object);
    }

    /// Pushes a trace whose rays have begun.
    pub(super) fn push_trace(
        &mut self,
        mut trace: Box<Trace<W>>,
        payload: RegSpan,
        object: Option<ObjectRef>,
    ) {
        self.stats.rays += u64::from(trace.lanes().count());
        self.stats.zero_directions += u64::from((trace.rays.without_direction() & trace.lanes()).count());
        if let Some(observer) = &mut self.pipeline_observer
            && !observer.counts_tests()
        {
            for lane in trace.lanes().lanes() {
                let registers = trace.payload(&mut self.frames);
                let words = registers.lane_words(payload.first, payload.count, lane).collect();
                let launch_id = trace.launch_id(lane);
                observer.invocation(launch_id);
                observer.event(Event::Trace {
                    caller: trace.caller(),
                    tlas: trace.tlas(lane).clone(),
                    launch_id,
                    depth: trace.depth,
                    trace: trace.rays.get(lane),
                    sbt: array::map([&trace.sbt_offset, &trace.sbt_stride, &trace.miss_index], |operand| {
                        operand.0[lane]
                    }),
                    payload: words,
                });
            }
        }
        self.frames.push(ShaderCallFrame::Trace { trace, payload, object });
    }

    /// Advances the trace on top of the stack: pushes the next shader that its rays call, or ends
    /// the trace. Returns the ended trace if the host called it.
    pub(super) fn advance_trace(&mut self) -> Option<Box<Trace<W>>> {
        let [below @ .., ShaderCallFrame::Trace { trace, payload, .. }] = &mut self.frames[..] else {
            unreachable!("bug in anyhit: the top frame is not a trace");
        };
        let registers = match below.last_mut() {
            Some(ShaderCallFrame::Shader(caller)) => Some((&mut caller.batch.registers, *payload)),
            _ => None,
        };
        let caller = trace.caller().map_or(0, |caller| caller.shader.index());
        let choices = self.bindings.get(caller).and_then(|bindings| bindings.choices.as_deref());
        let choices = choices.filter(|choices| choices.draws_traversals());
        match trace.advance(self.pipeline, choices, registers, &mut self.pipeline_observer) {
            Some(call) => {
                self.push_traced_shader(call);
                None
            }
            None => self.end_trace(),
        }
    }

    /// Pops a trace whose rays are done; returns it if the host called it.
    fn end_trace(&mut self) -> Option<Box<Trace<W>>> {
        let Some(ShaderCallFrame::Trace { mut trace, payload, object }) = self.frames.pop() else {
            return None;
        };
        self.stats = std::mem::take(&mut self.stats).plus(&trace.stats);
        if let Some(observer) = &mut self.pipeline_observer
            && !trace.from_hit_objects
            && !observer.counts_tests()
        {
            for lane in trace.lanes().lanes() {
                let registers = trace.payload(&mut self.frames);
                let payload: Words = registers.lane_words(payload.first, payload.count, lane).collect();
                observer.invocation(trace.launch_id(lane));
                observer.event(Event::Traced { payload: payload.to_vec() });
            }
        }
        let Some(ShaderCallFrame::Shader(below)) = self.frames.last_mut() else { return Some(trace) };
        for lane in trace.trapped_lanes().lanes() {
            let op = below.batch.stopped_at();
            let trap = trace.ray_trap(lane);
            if let Some(fault_value) = trap.and_then(|trap| trap.fault_value) {
                below.batch.fault_value[lane] = fault_value;
            }
            if let Some(terms) = trap.and_then(|trap| trap.terms) {
                below.batch.record_access_fault(lane, AccessFault::HitRecord(terms));
            }
            let code = trap.map_or(TrapCode::Callee, |trap| trap.code);
            below.batch.trap(Mask::lane(lane), code, op);
        }
        if let Some(object) = object {
            for lane in trace.lanes().without(trace.trapped_lanes()).lanes() {
                hit_object::store(&mut below.batch, object, lane, trace.hit_object(lane))
                    .expect("bug in anyhit: a hit object has moved");
            }
        }
        self.free_traces.push(trace);
        None
    }

    /// Takes a free trace, or makes one; no ray has begun yet.
    pub(super) fn acquire_trace(&mut self, invokes_hit_or_miss: bool) -> Box<Trace<W>> {
        let mut trace = self.free_traces.pop().unwrap_or_default();
        trace.reset(invokes_hit_or_miss);
        trace.observed = self.pipeline_observer.is_some() || self.observer.is_some();
        trace.pipeline_flags = self.pipeline.flags.ray_flags();
        trace
    }
}

/// `SkipTrianglesKHR` and `SkipAABBsKHR`
const SKIPS: u32 = 0x300;

/// Checks a ray against the valid usage of `OpTraceRayKHR`. If the pipeline skips one kind of
/// primitive, the ray must not skip the other.
pub(super) fn check_trace(trace: &TraceRay, flags: PipelineFlags) -> Result<(), RayRule> {
    trace.check()?;
    if (trace.flags.0 | flags.ray_flags()) & SKIPS == SKIPS {
        return Err(match trace.flags.contains(RayFlags::SKIP_TRIANGLES) {
            true => RayRule::SkipTrianglesWithPipelineSkipAabbs,
            false => RayRule::SkipAabbsWithPipelineSkipTriangles,
        });
    }
    Ok(())
}

/// Reads and checks the ray, flags, cull mask and time of a trace's operands.
pub fn trace_operands(words: &[u32; TRACE_OPERANDS as usize]) -> Result<TraceRay, RayRule> {
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
