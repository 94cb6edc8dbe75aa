//! Values that go stale while a shader keeps them: what stands for lanes of a subgroup (an index, a
//! mask, a ballot) over an instruction that may repack them, the nearest hit so far over a report
//! that is accepted, the clock of a subgroup over an instruction behind which it may run elsewhere.
//!
//! Each register is followed from where a builtin or an instruction gives it such a value, through
//! moves and arithmetic, in programs alone that have all it takes.

use crate::checks::lanes::{each_element, operand_words};
use crate::plan::Executed;
use crate::plan::stale::{StaleKind, StalePlan, elects, sink};
use crate::rule::subgroup;
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::stop::RegSpan;
use anyhit_engine::machine::{Batch, Freshness, Mask, OpIndex, Reg, ShadowRegisters};
use anyhit_engine::ops::access::{Access, ComputedRegisters, RegCopy};
use anyhit_engine::ops::image::ImageOp;
use anyhit_engine::ops::lane_kernel::LaneKernel;
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::subgroup::{BallotCount, SubgroupKind, SubgroupOp};
use anyhit_engine::ops::{arithmetic, bit, glsl};

/// A shader is about to hand its batch to the pipeline by an operation.
pub(crate) fn stop<const W: usize>(
    shadow: &mut ShadowRegisters<W>,
    plans: &[StalePlan],
    op: &Op,
    lanes: Mask<W>,
) {
    for (kind, plan) in plans.iter().enumerate() {
        if plan.kind != StaleKind::RayTmax && op.may_repack() {
            shadow.expire(kind, lanes);
        }
    }
}

/// A reported hit was accepted in some lanes, and is the nearest one.
pub(crate) fn report_accepted<const W: usize>(
    shadow: &mut ShadowRegisters<W>,
    plans: &[StalePlan],
    lanes: Mask<W>,
) {
    for (kind, plan) in plans.iter().enumerate() {
        if plan.kind == StaleKind::RayTmax {
            shadow.expire(kind, lanes);
        }
    }
}

/// A kind of values that is followed, with its number in the shadow.
type Tracked<'a> = (usize, &'a StalePlan);

/// Where a register holds a value of a kind.
fn held<const W: usize>(
    shadow: &ShadowRegisters<W>,
    (kind, plan): Tracked<'_>,
    register: Reg,
) -> Freshness<W> {
    match plan.inputs.contains(&register) {
        true => Freshness { current: Mask::ALL, stale: Mask::NONE },
        false => shadow.freshness(kind, register),
    }
}

/// Follows values that go stale through an operation that has run.
pub(crate) fn track<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    op: &Op,
    tracked: Tracked<'_>,
) {
    let (kind, plan) = tracked;
    if let Some(RegCopy { to, from, is_masked }) = op.copy() {
        let (lanes, value) = match plan.kind == StaleKind::Clock && executed.step.reads_clock {
            true => (batch.mask, Freshness { current: Mask::ALL, stale: Mask::NONE }),
            false => (if is_masked { batch.mask } else { Mask::ALL }, held(shadow, tracked, from)),
        };
        return shadow.set_freshness(kind, to, lanes, value);
    }
    if let Some(ComputedRegisters { first, index, count, other, writes }) = op.computed_registers() {
        return each_element(batch, first, index, count, |lane, word, element| {
            let (to, from) = match writes {
                true => (element, other.plus(word)),
                false => (other.plus(word), element),
            };
            shadow.set_freshness(kind, to, Mask::lane(lane), held(shadow, tracked, from));
        });
    }
    if plan.kind == StaleKind::OwnLane
        && let Some((from, chunk)) = op.buffer_store()
    {
        let words = (0..chunk.count).map(|word| held(shadow, tracked, from.plus(word)));
        return tell_own_lane(sanitizer, batch, executed.place.op, words, "is stored");
    }
    match op {
        Op::LaneKernel { kernel, to, from } => {
            check_kernel(sanitizer, batch, shadow, executed.place.op, kernel, from, tracked);
            let operands = operand_words(kernel, from);
            let held = operands.map(|(first, word)| held(shadow, tracked, first.plus(word)));
            let mut result = held.fold(Freshness::NONE, Freshness::joined);
            // A comparison with the nearest hit is none itself, nor is a difference of clocks, nor
            // a random number that is made of a lane's index.
            if needs_current(plan.kind, kernel) || (plan.kind == StaleKind::OwnLane && mixes_bits(kernel)) {
                result = Freshness::NONE;
            }
            (0..kernel.words).for_each(|word| shadow.set_freshness(kind, to.plus(word), Mask::ALL, result));
        }
        Op::Subgroup(op) if plan.kind == StaleKind::Lanes => {
            track_subgroup(sanitizer, batch, shadow, executed.place.op, op, tracked);
        }
        Op::Subgroup(op) if plan.kind == StaleKind::OwnLane && elects(op) => {
            let current = Freshness { current: Mask::ALL, stale: Mask::NONE };
            shadow.set_freshness(kind, op.to, batch.mask, current);
        }
        Op::Image(ImageOp::Write(write)) if plan.kind == StaleKind::OwnLane => {
            let words = write.from.iter().map(|&register| held(shadow, tracked, register));
            tell_own_lane(sanitizer, batch, executed.place.op, words, "is stored");
        }
        op if op.may_repack() && !op.stops() => {
            if plan.kind != StaleKind::RayTmax {
                shadow.expire(kind, batch.mask);
            }
        }
        op => {
            let mut forget = |RegSpan { first, count }: RegSpan| {
                (0..count).for_each(|word| {
                    shadow.set_freshness(kind, first.plus(word), batch.mask, Freshness::NONE);
                });
            };
            op.undefines().into_iter().for_each(&mut forget);
            op.accesses(|access| {
                if let Access::Write(first, count) = access {
                    forget(RegSpan { first, count });
                }
            });
        }
    }
}

/// A block ends with a branch that a register decides.
pub(crate) fn branch<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &ShadowRegisters<W>,
    plans: &[StalePlan],
    op: OpIndex,
    register: Reg,
) {
    for tracked in plans.iter().enumerate().filter(|(_, plan)| plan.kind == StaleKind::OwnLane) {
        let decides = std::iter::once(held(shadow, tracked, register));
        tell_own_lane(sanitizer, batch, op, decides, "decides a branch");
    }
}

/// Reports what an invocation was in a subgroup, where something depends on it behind an
/// instruction that may repack lanes.
fn tell_own_lane<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    op: OpIndex,
    held: impl Iterator<Item = Freshness<W>>,
    does: &str,
) {
    let stale = held.fold(Freshness::NONE, Freshness::joined).stale;
    sanitizer.tell(batch, &subgroup::STALE_SUBGROUP, op, stale & batch.mask, |_| {
        format!("a lane's index, or whether it was elected, from before lanes may be repacked, {does}")
    });
}

/// Whether a kernel makes of a lane's index what no longer stands for the lane, as a hash does.
fn mixes_bits(kernel: &LaneKernel) -> bool {
    kernel.is_one_of(&[&arithmetic::IMul, &bit::BitwiseXor, &bit::ShiftLeftLogical, &bit::ShiftRightLogical])
}

/// Whether a kernel needs a value of a kind to be true: it compares it, or subtracts clocks.
fn needs_current(kind: StaleKind, kernel: &LaneKernel) -> bool {
    match kind {
        StaleKind::Lanes | StaleKind::OwnLane => false,
        StaleKind::RayTmax => {
            let compares = kernel.float_operands[0] > 0 && kernel.operands[1] > 0 && kernel.float_result == 0;
            compares
                || kernel.is_one_of(&[
                    &glsl::FMin,
                    &glsl::FMax,
                    &glsl::FClamp,
                    &glsl::NMin,
                    &glsl::NMax,
                    &glsl::NClamp,
                ])
        }
        StaleKind::Clock => kernel.is(&arithmetic::ISub),
    }
}

/// Reports a stale value that a kernel needs to be true.
fn check_kernel<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &ShadowRegisters<W>,
    op: OpIndex,
    kernel: &LaneKernel,
    from: &[Reg; 3],
    tracked: Tracked<'_>,
) {
    let (_, plan) = tracked;
    if !needs_current(plan.kind, kernel) {
        return;
    }
    let of = |at: usize| {
        let words = 0..kernel.operands[at];
        words.fold(Freshness::NONE, |all, word| all.joined(held(shadow, tracked, from[at].plus(word))))
    };
    let each = [of(0), of(1), of(2)];
    match plan.kind {
        StaleKind::Lanes | StaleKind::OwnLane => {}
        StaleKind::RayTmax => {
            let stale = each.iter().fold(Mask::NONE, |all, one| all | one.stale) & batch.mask;
            sanitizer.tell(batch, &subgroup::STALE_RAYTMAX, op, stale, |_| {
                "the RayTmaxKHR from before a report that was accepted is compared".to_owned()
            });
        }
        StaleKind::Clock => {
            let across = (each[0].current & each[1].stale) | (each[0].stale & each[1].current);
            sanitizer.tell(batch, &subgroup::STALE_CLOCK, op, across & batch.mask, |_| {
                "the clock of the subgroup is subtracted from one behind an instruction that may repack lanes"
                    .to_owned()
            });
        }
    }
}

/// Follows what stands for lanes through a subgroup instruction, and reports it where it is stale.
fn track_subgroup<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    index: OpIndex,
    op: &SubgroupOp,
    tracked: Tracked<'_>,
) {
    let current = Freshness { current: Mask::ALL, stale: Mask::NONE };
    let join = |first: Reg, count: u32| {
        let words = (0..count).map(|word| held(shadow, tracked, first.plus(word)));
        words.fold(Freshness::NONE, Freshness::joined)
    };
    let (value, operand) = (join(op.value, op.values), join(op.operand, op.operands));
    if let Some((takes_value, takes_operand, does)) = sink(op) {
        let none = Mask::NONE;
        let stale =
            if takes_value { value.stale } else { none } | if takes_operand { operand.stale } else { none };
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
        _ => Freshness::NONE,
    };
    (0..op.results).for_each(|word| shadow.set_freshness(tracked.0, op.to.plus(word), batch.mask, result));
}
