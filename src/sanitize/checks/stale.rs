//! What stands for lanes of a subgroup (an index, a mask, a ballot) and is kept over an instruction
//! that may repack them.
//!
//! Each register is tracked from where a builtin or a ballot gives it such a value, through moves
//! and arithmetic, in programs alone that have both an instruction that repacks and one that takes
//! such a value together with the lanes as they are.

use crate::machine::{Batch, LaneIdentity, Mask, OpIndex, Reg, ShadowRegisters};
use crate::ops::access::Access;
use crate::ops::hit_object::HitObjectOp;
use crate::ops::memory::MemoryOp;
use crate::ops::op::Op;
use crate::ops::subgroup::{BallotCount, SubgroupKind};
use crate::sanitize::checks::lanes::{each_element, operand_words};
use crate::sanitize::plan::lane_inputs::sink;
use crate::sanitize::rule::subgroup;
use crate::sanitize::sanitizer::Sanitizer;

/// Follows what stands for lanes through an operation that has run.
pub(in crate::sanitize) fn track<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    index: OpIndex,
    op: &Op,
    inputs: &[Reg],
) {
    let current = LaneIdentity { current: Mask::ALL, stale: Mask::NONE };
    let of = |shadow: &ShadowRegisters<W>, register: Reg| match inputs.contains(&register) {
        true => current,
        false => shadow.lane_identity(register),
    };
    match op {
        Op::LaneKernel { kernel, to, from } => {
            let operands = operand_words(kernel, from).map(|(first, word)| of(shadow, first.plus(word)));
            let result = operands.fold(LaneIdentity::NONE, LaneIdentity::joined);
            (0..kernel.words).for_each(|word| shadow.set_lane_identity(to.plus(word), Mask::ALL, result));
        }
        &Op::Memory(MemoryOp::Move { to, from }) => {
            shadow.set_lane_identity(to, Mask::ALL, of(shadow, from));
        }
        &Op::Memory(MemoryOp::MoveMasked { to, from }) => {
            shadow.set_lane_identity(to, batch.mask, of(shadow, from));
        }
        &Op::Memory(MemoryOp::Gather { to, count, first, index }) => {
            each_element(batch, first, index, count, |lane, word, element| {
                shadow.set_lane_identity(to.plus(word), Mask::lane(lane), of(shadow, element));
            });
        }
        &Op::Memory(MemoryOp::Scatter { from, count, first, index }) => {
            each_element(batch, first, index, count, |lane, word, element| {
                shadow.set_lane_identity(element, Mask::lane(lane), of(shadow, from.plus(word)));
            });
        }
        &Op::Memory(MemoryOp::Undefine { first, count }) => {
            (0..count)
                .for_each(|word| shadow.set_lane_identity(first.plus(word), batch.mask, LaneIdentity::NONE));
        }
        Op::Subgroup(op) => {
            let join = |first: Reg, count: u32| {
                let words = (0..count).map(|word| of(shadow, first.plus(word)));
                words.fold(LaneIdentity::NONE, LaneIdentity::joined)
            };
            let (value, operand) = (join(op.value, op.values), join(op.operand, op.operands));
            if let Some((takes_value, takes_operand, does)) = sink(op) {
                let none = Mask::NONE;
                let stale = if takes_value { value.stale } else { none }
                    | if takes_operand { operand.stale } else { none };
                sanitizer.tell(batch, &subgroup::STALE_SUBGROUP, index, stale & batch.mask, |_| {
                    format!("a lane's index or a ballot, from before lanes may be repacked, {does}")
                });
            }
            let result = match op.kind {
                SubgroupKind::Ballot | SubgroupKind::Partition => current,
                SubgroupKind::BallotCount(BallotCount::CountInclusive | BallotCount::CountExclusive) => {
                    value.joined(current)
                }
                SubgroupKind::BallotCount(BallotCount::FindLsb | BallotCount::FindMsb) => value,
                SubgroupKind::Read(_) => value,
                _ => LaneIdentity::NONE,
            };
            (0..op.results).for_each(|word| shadow.set_lane_identity(op.to.plus(word), batch.mask, result));
        }
        Op::HitObject(object) if **object == HitObjectOp::Reorder => shadow.repack(batch.mask),
        op => op.accesses(|access| {
            if let Access::Write(first, count) = access {
                (0..count).for_each(|word| {
                    shadow.set_lane_identity(first.plus(word), batch.mask, LaneIdentity::NONE);
                });
            }
        }),
    }
}
