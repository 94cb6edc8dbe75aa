//! Undefined values, NaNs and infinities in the memory of a workgroup: what is loaded is as
//! undefined as what was stored, and was made where that was.

use smallvec::SmallVec;

use crate::cause::{Cause, OpPlace};
use crate::checks::atomic::follow;
use crate::checks::lanes::workgroup_lanes;
use crate::memory_shadow::{WorkgroupShadow, undefined_byte};
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Bindings, Mask, NO_CAUSE, Reg, ShadowRegisters};
use anyhit_engine::ops::atomic::{AtomicKind, AtomicOp, AtomicTarget};
use anyhit_engine::ops::memory::{Chunk, access_location};

/// A load or store of consecutive registers, and the lanes in which it is one of workgroup memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SharedAccess<'a, const W: usize> {
    pub chunk: &'a Chunk,
    pub registers: Reg,
    pub lanes: Mask<W>,
}

/// A load into consecutive registers has run.
pub(crate) fn load<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    load: SharedAccess<'_, W>,
) {
    let SharedAccess { chunk, registers: to, lanes } = load;
    for lane in lanes.lanes() {
        let Some((_, first)) = access_location(batch, lane, bindings, chunk) else { continue };
        let width = (chunk.width / 8) as usize;
        for scalar in 0..chunk.count {
            let at = first as usize + scalar as usize * width;
            let Some(cause) = cause_at(sanitizer, batch, lane, place, at, width) else { continue };
            match sanitizer.is_born(cause) {
                true => shadow.set_cause(to.plus(scalar), Mask::lane(lane), cause),
                false => shadow.undefine(to.plus(scalar), Mask::lane(lane), cause),
            }
        }
    }
}

/// A store of consecutive registers has run.
pub(crate) fn store<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &ShadowRegisters<W>,
    place: OpPlace,
    store: SharedAccess<'_, W>,
) {
    let SharedAccess { chunk, registers: from, lanes } = store;
    for lane in lanes.lanes() {
        let Some((_, first)) = access_location(batch, lane, bindings, chunk) else { continue };
        let Some(causes) = sanitizer.shared_causes(batch, lane, place.shader) else { continue };
        let width = (chunk.width / 8) as usize;
        for scalar in 0..chunk.count {
            let cause = shadow.cause(from.plus(scalar), lane);
            let at = first as usize + scalar as usize * width;
            causes.get_mut(at..at + width).into_iter().for_each(|bytes| bytes.fill(cause));
        }
    }
}

/// An atomic instruction has run.
pub(crate) fn atomic<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    bindings: &Bindings,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    op: &AtomicOp,
) {
    let AtomicTarget::Buffer(chunk) = &op.target else { return };
    let width = (op.width / 8) as usize;
    let lanes = workgroup_lanes(batch, chunk);
    follow(sanitizer, batch, shadow, place, op, lanes, |sanitizer, lane, written| {
        let (_, first) = access_location(batch, lane, bindings, chunk)?;
        let first = first as usize;
        let found = cause_at(sanitizer, batch, lane, place, first, width);
        let Some(written) = written else { return found };
        // A NaN stays one, unless it is replaced.
        let kept = found.filter(|&cause| sanitizer.is_born(cause)).unwrap_or(NO_CAUSE);
        let cause = match op.kind {
            AtomicKind::Exchange => written,
            AtomicKind::CompareExchange if !is_exchanged(batch, lane, op) => kept,
            AtomicKind::CompareExchange => written,
            _ if written != NO_CAUSE => written,
            _ => kept,
        };
        if let Some(causes) = sanitizer.shared_causes(batch, lane, place.shader) {
            causes.get_mut(first..first + width).into_iter().for_each(|bytes| bytes.fill(cause));
        }
        found
    });
}

/// Whether a comparing exchange has replaced the value, which equalled the comparator.
fn is_exchanged<const W: usize>(batch: &Batch<W>, lane: usize, op: &AtomicOp) -> bool {
    let words = |first: Reg| batch.registers.lane_words(first, op.words(), lane);
    words(op.to).eq(words(op.comparator))
}

/// The number of the cause why one of some bytes of a lane's workgroup is undefined; where none is,
/// the cause of the NaN or infinity that they hold.
#[inline]
fn cause_at<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    lane: usize,
    place: OpPlace,
    first: usize,
    width: usize,
) -> Option<u32> {
    let causes = sanitizer.shared_causes(batch, lane, place.shader)?;
    let causes = causes.get(first..first + width)?;
    let (byte, cause) = undefined_byte(causes)?;
    if cause != WorkgroupShadow::UNWRITTEN {
        let others: SmallVec<[u32; 8]> = causes.iter().copied().filter(|&one| one != cause).collect();
        if sanitizer.is_born(cause) {
            let is_undefined = |one: &u32| {
                !matches!(*one, NO_CAUSE | WorkgroupShadow::UNWRITTEN) && !sanitizer.is_born(*one)
            };
            return others.into_iter().find(is_undefined).or(Some(cause));
        }
        return Some(cause);
    }
    let cause = Cause::UnwrittenShared { shader: place.shader, byte: (first + byte) as u32 };
    Some(sanitizer.cause(cause, || None))
}
