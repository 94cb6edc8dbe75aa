//! Barriers of a subgroup that some of its lanes do not reach.

use crate::rule::subgroup;
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::{Batch, Mask};

/// The running lanes enter a block, which may have barriers of scope Subgroup.
pub(crate) fn enter_block<const W: usize>(sanitizer: &mut Sanitizer<'_>, batch: &Batch<W>) {
    let Some((_, plan)) = sanitizer.plan() else { return };
    let mut barriers = plan.subgroup_barriers.iter().filter(|(block, _)| *block == batch.block).peekable();
    if barriers.peek().is_none() {
        return;
    }
    let subgroup = |lane: usize| {
        let invocation = batch.invocations.lane(lane);
        let workgroup = invocation.workgroup.map(|group| group.index());
        (workgroup, invocation.subgroup_id(), batch.invocations.record_indices[lane])
    };
    let missing = batch.live().without(batch.mask);
    let waits = |lane: usize| missing.lanes().any(|other| subgroup(other) == subgroup(lane));
    let alone = batch.mask & Mask::from_fn(|lane| batch.mask.contains(lane) && waits(lane));
    if alone.is_empty() {
        return;
    }
    for &(_, offset) in barriers {
        let rule = &subgroup::BARRIER_SUBGROUP_DIVERGENT;
        let message = "a barrier of the subgroup is reached by some of its lanes, while others are elsewhere";
        sanitizer.reporter(batch).broken_at(rule, offset, alone, message.to_owned());
    }
}
