//! Memory operations under the sanitizer: variables, buffers, shared memory and images.

use crate::machine::{Batch, Bindings, Mask, NO_CAUSE, OpIndex, Reg, ShaderIndex, ShadowRegisters};
use crate::ops::image::ImageOp;
use crate::ops::memory::{BufferRef, Chunk, MemoryOp, is_workgroup};
use crate::ops::pointer::storage;
use crate::sanitize::cause::{Cause, OpPlace};
use crate::sanitize::memory_shadow::WorkgroupShadow;
use crate::sanitize::plan::Executed;
use crate::sanitize::races::{AccessKind, Race};
use crate::sanitize::report::Sink;
use crate::sanitize::rule::arithmetic;
use crate::sanitize::sanitizer::Sanitizer;
use crate::sanitize::sanitizer::kernels::nan_lanes;
use crate::sanitize::shared_checks;
use crate::sanitize::shared_checks::SharedAccess;

impl Sanitizer<'_> {
    pub(super) fn memory<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        bindings: &Bindings,
        shadow: &mut ShadowRegisters<W>,
        executed: Executed<'_>,
        op: &MemoryOp,
    ) {
        let Executed { place, step } = executed;
        let mask = batch.mask;
        match *op {
            MemoryOp::Move { to, from } => shadow.copy(to, from),
            MemoryOp::MoveMasked { to, from } => shadow.copy_lanes(to, from, mask),
            MemoryOp::Undefine { first, count } => self.undefine(batch, shadow, place, first, count),
            MemoryOp::Index { to, base, index, .. } => {
                shadow.copy(to, index);
                if let Some(base) = base {
                    let lanes = shadow.undefined(base) & mask;
                    shadow.set_undefined(to, shadow.undefined(to) | lanes);
                    shadow.copy_causes(to, base, lanes);
                }
            }
            MemoryOp::Gather { to, count, first, index } => {
                self.depend(batch, shadow, place.op, index, Sink::Index);
                each_element(batch, first, index, count, |lane, word, element| {
                    shadow.copy_lane(to.plus(word), element, lane);
                });
            }
            MemoryOp::Scatter { from, count, first, index } => {
                self.depend(batch, shadow, place.op, index, Sink::Index);
                each_element(batch, first, index, count, |lane, word, element| {
                    shadow.copy_lane(element, from.plus(word), lane);
                });
            }
            MemoryOp::BufferLoad { to, chunk } => {
                self.depend_on_location(batch, shadow, place.op, &chunk);
                (0..chunk.count).for_each(|word| shadow.define(to.plus(word)));
                let lanes = workgroup_lanes(batch, &chunk);
                let load = SharedAccess { chunk: &chunk, registers: to, lanes };
                shared_checks::load(self, batch, bindings, shadow, place, load);
                self.access_buffer(batch, bindings, place, &chunk, AccessKind::Load, None);
            }
            MemoryOp::BufferStore { from, chunk } => {
                self.depend_on_location(batch, shadow, place.op, &chunk);
                let lanes = workgroup_lanes(batch, &chunk);
                let store = SharedAccess { chunk: &chunk, registers: from, lanes };
                shared_checks::store(self, batch, bindings, shadow, place, store);
                self.access_buffer(batch, bindings, place, &chunk, AccessKind::Store, Some(from));
                let lanes = mask.without(lanes);
                if lanes.is_empty() {
                    return;
                }
                for word in 0..chunk.count {
                    let register = from.plus(word);
                    self.depend_in(batch, shadow, place.op, register, Sink::Buffer, lanes);
                    if step.watches_nan {
                        let nans = nan_lanes(&batch.registers, register, 32) & lanes;
                        self.reporter(batch).nan(&arithmetic::NAN_OUTPUT, shadow, place.op, register, nans);
                    }
                }
            }
            MemoryOp::ArrayLength { to, .. } => shadow.define(to),
        }
    }

    /// Looks for races of a load or store.
    pub(super) fn access_buffer<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        bindings: &Bindings,
        place: OpPlace,
        chunk: &Chunk,
        kind: AccessKind,
        values: Option<Reg>,
    ) {
        let Some(races) = self.races.as_mut().filter(|races| races.watches(place)) else { return };
        let found = races.access_buffer(batch, bindings, place, chunk, kind, values);
        self.tell_races(batch, place.op, &found);
    }

    pub(super) fn tell_races<const W: usize>(&mut self, batch: &Batch<W>, op: OpIndex, found: &[Race]) {
        for race in found {
            self.reporter(batch).race(op, race);
        }
    }

    /// The causes of the bytes of a lane's workgroup.
    pub(in crate::sanitize) fn shared_causes<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        lane: usize,
        shader: ShaderIndex,
    ) -> Option<&mut [u32]> {
        let workgroup = batch.invocations.workgroup(lane)?;
        let program = &self.plans.get(shader.index())?.program;
        Some(self.shared.causes(workgroup.index() as u32, |causes| {
            causes.resize(workgroup.memory.size() as usize, WorkgroupShadow::UNWRITTEN);
            for variable in program.workgroup_variables.iter().filter(|variable| variable.is_initialized) {
                causes[variable.bytes.start as usize..variable.bytes.end as usize].fill(NO_CAUSE);
            }
        }))
    }

    pub(super) fn depend_on_location<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        chunk: &Chunk,
    ) {
        match chunk.buffer {
            BufferRef::Computed(handle) => self.depend(batch, shadow, op, handle, Sink::Resource),
            BufferRef::Address(first) => self.depend_on_all(batch, shadow, op, first, 2, Sink::Address),
            _ => {}
        }
        if let Some(index) = chunk.index {
            self.depend(batch, shadow, op, index, Sink::Index);
        }
    }

    /// A variable begins to live, or `OpUndef` is executed.
    pub(super) fn undefine<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        place: OpPlace,
        first: Reg,
        count: u32,
    ) {
        let Some((shader, plan)) = self.plan() else { return };
        let variable = plan.variable_at(place.op);
        self.undefine_variable(shadow, batch.mask, first, count, |word| match variable {
            Some(variable) => Cause::Unwritten { shader, variable, storage_class: storage::FUNCTION, word },
            None => Cause::Undef(place),
        });
    }

    pub(super) fn image<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        image: &ImageOp,
    ) {
        if let ImageOp::Write(write) = image {
            for register in write.texel.registers() {
                self.depend(batch, shadow, op, register, Sink::Coordinate);
            }
            for register in write.from {
                self.depend(batch, shadow, op, register, Sink::Image);
                if write.is_float() {
                    let nans = nan_lanes(&batch.registers, register, 32) & batch.mask;
                    self.reporter(batch).nan(&arithmetic::NAN_OUTPUT, shadow, op, register, nans);
                }
            }
            return;
        }
        self.depend_on_reads(batch, shadow, op, Sink::Coordinate, &mut |visit| image.accesses(visit));
    }
}

/// The elements that a computed index selects, by lane and word.
pub(in crate::sanitize) fn each_element<const W: usize>(
    batch: &Batch<W>,
    first: Reg,
    index: Reg,
    count: u32,
    mut visit: impl FnMut(usize, u32, Reg),
) {
    for lane in batch.mask.lanes() {
        let element = first.computed(batch.registers[index].0[lane]);
        if u64::from(element.0) + u64::from(count) > batch.registers.len() as u64 {
            continue;
        }
        (0..count).for_each(|word| visit(lane, word, element.plus(word)));
    }
}

/// The lanes whose access is to the memory of their workgroup.
#[inline]
pub(in crate::sanitize) fn workgroup_lanes<const W: usize>(batch: &Batch<W>, chunk: &Chunk) -> Mask<W> {
    match chunk.buffer {
        BufferRef::Workgroup => batch.mask,
        BufferRef::Computed(_) => {
            batch.mask & Mask::from_fn(|lane| is_workgroup(&batch.registers, lane, chunk.buffer))
        }
        _ => Mask::NONE,
    }
}
