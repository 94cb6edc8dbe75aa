//! Undefined values in the memory of a workgroup: what is loaded is as undefined as what was
//! stored.

use crate::machine::{Batch, Bindings, Mask, NO_CAUSE, Reg, ShadowRegisters};
use crate::ops::atomic::{AtomicOp, AtomicTarget};
use crate::ops::memory::{Chunk, access_location};
use crate::sanitize::cause::{Cause, OpPlace};
use crate::sanitize::checks::atomic::follow;
use crate::sanitize::checks::lanes::workgroup_lanes;
use crate::sanitize::memory_shadow::{WorkgroupShadow, undefined_byte};
use crate::sanitize::sanitizer::Sanitizer;

/// A load or store of consecutive registers, and the lanes in which it is one of workgroup memory.
#[derive(Clone, Copy, Debug)]
pub(in crate::sanitize) struct SharedAccess<'a, const W: usize> {
    pub chunk: &'a Chunk,
    pub registers: Reg,
    pub lanes: Mask<W>,
}

/// A load into consecutive registers has run.
pub(in crate::sanitize) fn load<const W: usize>(
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
            if let Some(cause) = undefined_at(sanitizer, batch, lane, place, at, width) {
                shadow.undefine(to.plus(scalar), Mask::lane(lane), cause);
            }
        }
    }
}

/// A store of consecutive registers has run.
pub(in crate::sanitize) fn store<const W: usize>(
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
            let register = from.plus(scalar);
            let undefined = shadow.undefined(register).contains(lane);
            let cause = if undefined { shadow.cause(register, lane) } else { NO_CAUSE };
            let at = first as usize + scalar as usize * width;
            causes.get_mut(at..at + width).into_iter().for_each(|bytes| bytes.fill(cause));
        }
    }
}

/// An atomic instruction has run.
pub(in crate::sanitize) fn atomic<const W: usize>(
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
    follow(sanitizer, batch, shadow, place, op, lanes, |sanitizer, lane, writes| {
        let (_, first) = access_location(batch, lane, bindings, chunk)?;
        let first = first as usize;
        let found = undefined_at(sanitizer, batch, lane, place, first, width);
        if writes && let Some(causes) = sanitizer.shared_causes(batch, lane, place.shader) {
            causes.get_mut(first..first + width).into_iter().for_each(|bytes| bytes.fill(NO_CAUSE));
        }
        found
    });
}

/// The number of the cause why one of some bytes of a lane's workgroup is undefined.
#[inline]
fn undefined_at<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    lane: usize,
    place: OpPlace,
    first: usize,
    width: usize,
) -> Option<u32> {
    let causes = sanitizer.shared_causes(batch, lane, place.shader)?;
    let (byte, cause) = undefined_byte(causes.get(first..first + width)?)?;
    if cause != WorkgroupShadow::UNWRITTEN {
        return Some(cause);
    }
    let cause = Cause::UnwrittenShared { shader: place.shader, byte: (first + byte) as u32 };
    Some(sanitizer.cause(cause, || None))
}
