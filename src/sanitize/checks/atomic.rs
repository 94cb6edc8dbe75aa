//! Atomic instructions on memory whose contents may be undefined.

use crate::machine::{Batch, Mask, ShadowRegisters};
use crate::ops::atomic::{AtomicKind, AtomicOp};
use crate::sanitize::cause::OpPlace;
use crate::sanitize::report::Sink;
use crate::sanitize::sanitizer::Sanitizer;

/// Follows an atomic instruction that has run in some lanes: one that changes what is undefined
/// depends on it, and a load or an exchange returns it. `undefined` returns the cause why the
/// memory of a lane was undefined, and notes that it is written where the instruction writes.
pub(super) fn follow<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    op: &AtomicOp,
    lanes: Mask<W>,
    mut undefined: impl FnMut(&mut Sanitizer<'_>, usize, bool) -> Option<u32>,
) {
    let writes = op.kind != AtomicKind::Load;
    for lane in lanes.lanes() {
        let Some(cause) = undefined(sanitizer, lane, writes) else { continue };
        shadow.undefine_span(op.to, op.words(), Mask::lane(lane), cause);
        if !matches!(op.kind, AtomicKind::Load | AtomicKind::Exchange) {
            sanitizer.depend_on_all(batch, shadow, place.op, op.to, op.words(), Sink::Atomic);
        }
    }
}
