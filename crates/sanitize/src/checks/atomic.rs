//! Atomic instructions on memory whose contents may be undefined.

use crate::cause::OpPlace;
use crate::report::Sink;
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Mask, ShadowRegisters};
use anyhit_engine::ops::atomic::{AtomicKind, AtomicOp};

/// Follows an atomic instruction that has run in some lanes: one that changes what is undefined
/// depends on it, and a load or an exchange returns it. `memory` returns the cause why the memory
/// of a lane was undefined, or of the NaN that it held. It is given the cause of the NaN or
/// infinity that the instruction writes, 0 where that is a number, and `None` where the instruction
/// writes nothing.
pub(super) fn follow<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    op: &AtomicOp,
    lanes: Mask<W>,
    mut memory: impl FnMut(&mut Sanitizer<'_>, usize, Option<u32>) -> Option<u32>,
) {
    for lane in lanes.lanes() {
        let written = (op.kind != AtomicKind::Load).then(|| shadow.cause(op.value, lane));
        let Some(cause) = memory(sanitizer, lane, written) else { continue };
        if sanitizer.is_born(cause) {
            (0..op.words()).for_each(|word| shadow.set_cause(op.to.plus(word), Mask::lane(lane), cause));
            continue;
        }
        shadow.undefine_span(op.to, op.words(), Mask::lane(lane), cause);
        if !matches!(op.kind, AtomicKind::Load | AtomicKind::Exchange) {
            sanitizer.depend_on_all(batch, shadow, place.op, op.to, op.words(), Sink::Atomic);
        }
    }
}
