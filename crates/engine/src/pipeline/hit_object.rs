//! Hit objects in the pipeline: executes them and finds their shader records.

use crate::accel::Tlas;
use crate::machine::hit_object::{EncodedHit, EncodedRay, HitObject};
use crate::machine::object::ObjectRef;
use crate::machine::stop::RegSpan;
use crate::machine::{Mask, Reg, TrapCode};
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::observer::Caller;
use crate::pipeline::payload;
use crate::pipeline::sbt::SbtRecord;
use crate::pipeline::stack::{ShaderCallFrame, Stack};
use crate::pipeline::trace::{Trace, record_at};

impl<const W: usize> Trace<W> {
    /// The hit object of a lane's ray.
    pub(super) fn hit_object(&self, lane: usize) -> HitObject {
        let trace = self.rays.get(lane);
        let op = self.caller().map(|caller| caller.op);
        match self.committed[lane] {
            None => HitObject::Miss(EncodedRay::new(trace, self.miss_record_index(lane), op)),
            Some(committed) => {
                let record = self.hit_record_index(lane, &committed.candidate);
                let attributes = self.committed_attributes(lane).iter().copied().collect();
                let hit = EncodedHit { tlas: self.tlas(lane).clone(), committed, attributes };
                HitObject::Hit(EncodedRay::new(trace, record, op), hit)
            }
        }
    }
}

impl<const W: usize> Stack<'_, W>
where
    LaneKernel: Width<W>,
{
    /// Begins `OpHitObjectExecuteShaderEXT`: calls closest-hit or miss shaders as at the end of a
    /// ray.
    pub(super) fn begin_hit_object_execute(&mut self, mask: Mask<W>, object: ObjectRef, payload: RegSpan) {
        let mut trace = self.acquire_trace(true);
        let is_full = self.is_full();
        let Some(ShaderCallFrame::Shader(running)) = self.frames.last_mut() else { return };
        let caller =
            Caller { shader: running.shader, op: running.batch.stopped_at(), payload: payload.first };
        let program = &self.pipeline.programs[running.shader.index()];
        trace.set_caller(caller, payload::outgoing_scalars(program, payload), &running.batch.invocations);
        trace.from_hit_objects = true;
        let mut lanes = Mask::NONE;
        for lane in mask.lanes() {
            let batch = &running.batch;
            let found = object.register(&batch.registers, lane).and_then(|register| {
                let found = batch.hit_objects.get(batch.registers[register].0[lane]);
                match found.unwrap_or(&HitObject::Unrecorded) {
                    HitObject::Unrecorded => Err(TrapCode::HitObjectUnrecorded),
                    HitObject::Empty => Ok(false),
                    _ if trace.depth > self.pipeline.max_recursion => Err(TrapCode::RecursionTooDeep),
                    _ if is_full => Err(TrapCode::StackOverflow),
                    HitObject::Miss(encoded) => {
                        trace.add_hit_object(lane, Tlas::empty(), &encoded.trace, encoded.record, None);
                        Ok(true)
                    }
                    HitObject::Hit(encoded, hit) => {
                        trace.add_hit_object(lane, &hit.tlas, &encoded.trace, encoded.record, Some(hit));
                        Ok(true)
                    }
                }
            });
            match found {
                Ok(executes) => lanes = if executes { lanes | Mask::lane(lane) } else { lanes },
                Err(code) => {
                    let op = running.batch.stopped_at();
                    running.batch.trap(Mask::lane(lane), code, op);
                }
            }
        }
        trace.begin(lanes);
        self.frames.push(ShaderCallFrame::Trace { trace, payload, object: None });
    }

    /// `OpHitObjectGetShaderRecordBufferHandleEXT`: the device address of a record's data; 0 where
    /// it has none.
    pub(super) fn record_handle(&mut self, mask: Mask<W>, object: ObjectRef, to: Reg) {
        let Some(ShaderCallFrame::Shader(running)) = self.frames.last_mut() else { return };
        let memory = &self.bindings[running.shader.index()].memory;
        for lane in mask.lanes() {
            let batch = &mut running.batch;
            let record = object.register(&batch.registers, lane).and_then(|register| {
                let found = batch.hit_objects.get(batch.registers[register].0[lane]);
                let found = found.unwrap_or(&HitObject::Unrecorded);
                let table = match found {
                    HitObject::Hit(..) => &self.pipeline.sbt.hit,
                    _ => &self.pipeline.sbt.miss,
                };
                Ok(record_at(table, found.encoded()?.record).and_then(SbtRecord::shader_record))
            });
            match record {
                Ok(record) => {
                    let base = record.as_ref().and_then(|record| memory.address_of(&record.data));
                    let address = base.map_or(0, |base| base + record.map_or(0, |record| record.offset));
                    let words = [address as u32, (address >> 32) as u32];
                    batch.registers.set_lane_words(to, lane, words);
                }
                Err(code) => {
                    let op = batch.stopped_at();
                    batch.trap(Mask::lane(lane), code, op);
                }
            }
        }
    }
}
