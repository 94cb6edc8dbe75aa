//! Memory operations under the sanitizer: variables, buffers and shared memory.

use crate::cause::{Cause, OpPlace};
use crate::checks::births;
use crate::checks::lanes::{each_element, workgroup_lanes};
use crate::checks::shared::{self, SharedAccess};
use crate::checks::{bounds, contents};
use crate::plan::Executed;
use crate::races::AccessKind;
use crate::report::Sink;
use crate::report::specials::SpecialSink;
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Bindings, Mask, OpIndex, Reg, ShadowRegisters};
use anyhit_engine::ops::memory::{BufferRef, Chunk, MemoryOp};
use anyhit_engine::ops::pointer::storage;

/// A memory operation has run.
#[inline]
pub(crate) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    op: &MemoryOp,
) {
    let (place, mask) = (executed.place, batch.mask);
    match *op {
        MemoryOp::Move { to, from } => shadow.copy(to, from),
        MemoryOp::MoveMasked { to, from } => shadow.copy_lanes(to, from, mask),
        MemoryOp::Undefine { first, count } => undefine(sanitizer, batch, shadow, executed, first, count),
        MemoryOp::Freeze { first, count } => {
            (0..count).for_each(|word| shadow.set_undefined(first.plus(word), Mask::NONE));
        }
        MemoryOp::Index { to, base, index, .. } => {
            shadow.copy(to, index);
            if let Some(base) = base {
                let lanes = shadow.undefined(base) & mask;
                shadow.set_undefined(to, shadow.undefined(to) | lanes);
                shadow.copy_causes(to, base, lanes);
            }
        }
        MemoryOp::Gather { to, count, first, index } => {
            sanitizer.depend(batch, shadow, place.op, index, Sink::Index);
            each_element(batch, first, index, count, |lane, word, element| {
                shadow.copy_lane(to.plus(word), element, lane);
            });
        }
        MemoryOp::Scatter { from, count, first, index } => {
            sanitizer.depend(batch, shadow, place.op, index, Sink::Index);
            each_element(batch, first, index, count, |lane, word, element| {
                shadow.copy_lane(element, from.plus(word), lane);
            });
        }
        MemoryOp::BufferLoad { to, ref chunk } => load(sanitizer, batch, bindings, shadow, place, to, chunk),
        MemoryOp::BufferStore { from, ref chunk } => {
            store(sanitizer, batch, bindings, shadow, place, from, chunk);
        }
        MemoryOp::ArrayLength { to, .. } => shadow.define(to),
    }
}

/// A load from a buffer or shared memory has run.
#[inline(never)]
fn load<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    to: Reg,
    chunk: &Chunk,
) {
    depend_on_location(sanitizer, batch, shadow, place.op, chunk);
    (0..chunk.count).for_each(|word| shadow.define(to.plus(word)));
    let lanes = workgroup_lanes(batch, chunk);
    let load = SharedAccess { chunk, registers: to, lanes };
    shared::load(sanitizer, batch, bindings, shadow, place, load);
    bounds::check_buffer(sanitizer, batch, bindings, place.op, chunk);
    contents::load(sanitizer, batch, bindings, shadow, place, chunk, to);
    access_buffer(sanitizer, batch, bindings, place, chunk, AccessKind::Load, None);
}

/// A store to a buffer or shared memory has run.
#[inline(never)]
fn store<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    from: Reg,
    chunk: &Chunk,
) {
    depend_on_location(sanitizer, batch, shadow, place.op, chunk);
    let lanes = workgroup_lanes(batch, chunk);
    let store = SharedAccess { chunk, registers: from, lanes };
    shared::store(sanitizer, batch, bindings, shadow, place, store);
    bounds::check_buffer(sanitizer, batch, bindings, place.op, chunk);
    contents::store(sanitizer, batch, bindings, chunk);
    access_buffer(sanitizer, batch, bindings, place, chunk, AccessKind::Store, Some(from));
    let lanes = batch.mask.without(lanes);
    if lanes.is_empty() {
        return;
    }
    for word in 0..chunk.count {
        let register = from.plus(word);
        sanitizer.depend_in(batch, shadow, place.op, register, Sink::Buffer, lanes);
        births::reach(sanitizer, batch, shadow, place.op, register, lanes, SpecialSink::Buffer);
    }
}

/// Looks for races of a load or store.
pub(crate) fn access_buffer<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    place: OpPlace,
    chunk: &Chunk,
    kind: AccessKind,
    values: Option<Reg>,
) {
    let Some(races) = sanitizer.races.as_mut().filter(|races| races.watches(place)) else { return };
    let found = races.access_buffer(batch, bindings, place, chunk, kind, values);
    sanitizer.tell_races(batch, place.op, &found);
}

/// The location of an access must not be undefined.
pub(crate) fn depend_on_location<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    op: OpIndex,
    chunk: &Chunk,
) {
    match chunk.buffer {
        BufferRef::Computed(handle) => sanitizer.depend(batch, shadow, op, handle, Sink::Resource),
        BufferRef::Address(first) => sanitizer.depend_on_all(batch, shadow, op, first, 2, Sink::Address),
        _ => {}
    }
    if let Some(index) = chunk.index {
        sanitizer.depend(batch, shadow, op, index, Sink::Index);
    }
}

/// A variable begins to live, or `OpUndef` is executed.
fn undefine<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    first: Reg,
    count: u32,
) {
    let Executed { place, step } = executed;
    let (shader, storage_class) = (place.shader, storage::FUNCTION);
    sanitizer.undefine_variable(shadow, batch.mask, first, count, |word| match step.variable {
        Some(variable) => Cause::Unwritten { shader, variable, storage_class, word },
        None => Cause::Undef(place),
    });
}
