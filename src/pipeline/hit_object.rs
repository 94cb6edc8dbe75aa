//! Hit objects at the pipeline: executing them, and where their shader records lie.

use crate::accel::Tlas;
use crate::machine::hit_object::{Encoded, HitEncoded, HitObject};
use crate::machine::object::ObjectRef;
use crate::machine::stop::Rows;
use crate::machine::{Mask, Observer, Reg, TrapCode};
use crate::ops::row::{Row, Width};
use crate::pipeline::sbt::Record;
use crate::pipeline::stack::{Level, Stack};
use crate::pipeline::trace::{Query, RayState, at, hit_index};
use crate::pipeline::witness::{Caller, Witness};

impl RayState {
    /// Whether it only executes what a hit object encodes.
    pub fn is_settled(&self) -> bool {
        self.record.is_some()
    }

    /// What was found.
    pub fn hit_object(&self) -> HitObject {
        let trace = self.query.trace;
        match self.cursor.committed() {
            None => HitObject::Miss(Encoded { trace, record: self.query.miss_record() }),
            Some(&committed) => {
                let record = hit_index(&self.query, &committed.candidate);
                let attributes = self.committed_attributes().iter().copied().collect();
                let hit = HitEncoded { tlas: self.query.tlas.clone(), committed, attributes };
                HitObject::Hit(Encoded { trace, record }, hit)
            }
        }
    }
}

impl<const W: usize, T: Witness, O: Observer<W>> Stack<'_, W, T, O>
where
    Row: Width<W>,
{
    /// `OpHitObjectExecuteShaderEXT`: closest-hit or miss shaders as for a ray that is over.
    pub(super) fn begin_execute(&mut self, mask: Mask<W>, object: ObjectRef, payload: Rows) {
        let mut trace = self.spare_trace(true);
        let Some(Level::Shader(running)) = self.levels.last_mut() else { return };
        let caller = Caller { shader: running.shader, op: running.batch.op - 1, payload: payload.first };
        for lane in mask.lanes() {
            let batch = &running.batch;
            let invocation = &batch.invocations[lane];
            let depth = invocation.depth + 1;
            let words = || batch.registers.lane_words(payload.first, payload.count, lane);
            let query = |encoded: &Encoded, tlas| Query {
                tlas,
                trace: encoded.trace,
                sbt_offset: 0,
                sbt_stride: 0,
                miss_index: 0,
                payload: words(),
                launch_id: invocation.launch_id,
                launch_size: invocation.launch_size,
                depth,
            };
            let found = object.row(&batch.registers, lane).and_then(|row| {
                let found = batch.hit_objects.get(batch.registers[row].0[lane]);
                match found.unwrap_or(&HitObject::Unrecorded) {
                    HitObject::Unrecorded => Err(TrapCode::HitObjectUnrecorded),
                    HitObject::Empty => Ok(None),
                    _ if depth > self.pipeline.max_recursion => Err(TrapCode::RecursionTooDeep),
                    HitObject::Miss(encoded) => {
                        Ok(Some((query(encoded, Tlas::empty()), encoded.record, None)))
                    }
                    HitObject::Hit(encoded, hit) => {
                        Ok(Some((query(encoded, &hit.tlas), encoded.record, Some(hit))))
                    }
                }
            });
            match found {
                Ok(None) => {}
                Ok(Some((query, record, hit))) => trace.push_settled(lane, query, caller, (record, hit)),
                Err(code) => {
                    let op = running.batch.op - 1;
                    running.batch.trap(Mask::lane(lane), code, op);
                }
            }
        }
        self.levels.push(Level::Trace { trace, payload: Some(payload), object: None });
    }

    /// `OpHitObjectGetShaderRecordBufferHandleEXT`: the device address of a record's data; 0 where
    /// it has none.
    pub(super) fn record_handle(&mut self, mask: Mask<W>, object: ObjectRef, to: Reg) {
        let Some(Level::Shader(running)) = self.levels.last_mut() else { return };
        let memory = &self.bindings[running.shader.0 as usize].memory;
        for lane in mask.lanes() {
            let batch = &mut running.batch;
            let record = object.row(&batch.registers, lane).and_then(|row| {
                let found = batch.hit_objects.get(batch.registers[row].0[lane]);
                let found = found.unwrap_or(&HitObject::Unrecorded);
                let table = match found {
                    HitObject::Hit(..) => &self.pipeline.sbt.hit,
                    _ => &self.pipeline.sbt.miss,
                };
                Ok(at(table, found.encoded()?.record).and_then(Record::shader_record))
            });
            match record {
                Ok(record) => {
                    let base = record.as_ref().and_then(|record| memory.address_of(&record.data));
                    let address = base.map_or(0, |base| base + record.map_or(0, |record| record.offset));
                    let words = [address as u32, (address >> 32) as u32];
                    batch.registers.set_lane_words(to, lane, words);
                }
                Err(code) => {
                    let op = batch.op - 1;
                    batch.trap(Mask::lane(lane), code, op);
                }
            }
        }
    }
}
