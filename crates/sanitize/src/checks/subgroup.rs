//! Rules about lanes that read each other's values.

use smallvec::SmallVec;

use crate::cause::{Cause, CauseDetails, OpPlace};
use crate::checks::births;
use crate::plan::Executed;
use crate::report::Sink;
use crate::rule::{Rule, subgroup};
use crate::sanitizer::Sanitizer;
use anyhit_engine::machine::stop::RegSpan;
use anyhit_engine::machine::{Batch, Mask, NO_CAUSE, ShadowRegisters};
use anyhit_engine::ops::subgroup::{BallotCount, Members, ReadSource, SubgroupKind, SubgroupOp, subgroups};

/// Checks a subgroup operation that has run.
pub(crate) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    executed: Executed<'_>,
    op: &SubgroupOp,
) {
    let Executed { place, step } = executed;
    // What one lane gives to all is undefined for all: the first to depend on it is the operation.
    if op.reads_every_lane() {
        sanitizer.depend_on_all(batch, shadow, place.op, op.value, op.values, Sink::Subgroup);
    }
    sanitizer.depend_on_all(batch, shadow, place.op, op.operand, op.operands, Sink::Subgroup);
    shadow.define_span(op.to, op.results, batch.mask);
    let size = batch.invocations.subgroup_size();
    if let Some(cluster) = op.cluster_size().filter(|cluster| *cluster > size) {
        sanitizer.tell(batch, &subgroup::CLUSTER_SIZE, place.op, batch.mask, |_| {
            format!("clusters of {cluster} lanes, in a subgroup of {size}")
        });
    }
    match op.kind {
        SubgroupKind::Read(source) => read(sanitizer, batch, shadow, place, step.inactive, op, source),
        SubgroupKind::BallotBit { own } => {
            spread_ballot(batch, shadow, op);
            if own {
                inverse_ballot(sanitizer, batch, place, op);
                return;
            }
            let index = &batch.registers[op.operand];
            let outside = batch.mask & Mask::from_fn(|lane| index.0[lane] >= size);
            undefine(sanitizer, shadow, place, op, &subgroup::BALLOT_INDEX, outside, |lane| {
                format!("bit {} of a ballot, in a subgroup of {size} lanes", index.0[lane])
            });
        }
        SubgroupKind::BallotCount(BallotCount::FindLsb | BallotCount::FindMsb) => {
            spread_ballot(batch, shadow, op);
            let is_empty = |lane: usize| {
                let mut words = batch.registers.lane_words(op.value, op.values, lane).zip(0..);
                words.all(|(word, at)| word & bits_below(size, at) == 0)
            };
            let empty = batch.mask & Mask::from_fn(is_empty);
            undefine(sanitizer, shadow, place, op, &subgroup::BALLOT_FIND_NONE, empty, |_| {
                "the search for a bit in a ballot that has none".to_owned()
            });
        }
        SubgroupKind::BallotCount(_) => spread_ballot(batch, shadow, op),
        SubgroupKind::Reduce { kernel, .. } => {
            births::reduce(sanitizer, batch, shadow, executed, kernel, [op.to, op.value]);
        }
        _ => {}
    }
}

/// The bits of a ballot's word that stand for lanes of a subgroup of a size.
fn bits_below(size: u32, word: u32) -> u32 {
    match size.saturating_sub(32 * word) {
        count @ 0..32 => (1 << count) - 1,
        _ => u32::MAX,
    }
}

/// Makes the result of an operation undefined in the lanes that break a rule.
fn undefine<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    op: &SubgroupOp,
    rule: &'static Rule,
    lanes: Mask<W>,
    message: impl FnOnce(usize) -> String,
) {
    let Some(lane) = lanes.lowest() else { return };
    let cause = Cause::Broken { place, rule: rule.id };
    let number =
        sanitizer.cause(cause, || Some(CauseDetails { rule, message: message(lane), operand: NO_CAUSE }));
    shadow.undefine_span(op.to, op.results, lanes, number);
}

/// What is read from a ballot is undefined where the ballot is.
fn spread_ballot<const W: usize>(batch: &Batch<W>, shadow: &mut ShadowRegisters<W>, op: &SubgroupOp) {
    for word in 0..op.values {
        let value = op.value.plus(word);
        let lanes = shadow.undefined(value) & batch.mask;
        if lanes.is_empty() {
            continue;
        }
        for result in 0..op.results {
            let to = op.to.plus(result);
            shadow.set_undefined(to, shadow.undefined(to) | lanes);
            shadow.copy_causes(to, value, lanes);
        }
    }
}

/// Checks an instruction that reads another lane's value.
fn read<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    place: OpPlace,
    rule: Option<&'static Rule>,
    op: &SubgroupOp,
    source: ReadSource,
) {
    let (mut inactive, mut seen) = (Mask::NONE, Mask::NONE);
    for (lane, source) in op.read_lanes(batch) {
        let Some(source) = source else {
            inactive = inactive | Mask::lane(lane);
            continue;
        };
        for word in 0..op.results {
            let (to, value) = (op.to.plus(word), op.value.plus(word));
            if shadow.undefined(value).contains(source) {
                let number = shadow.cause(value, source);
                shadow.undefine(to, Mask::lane(lane), number);
                seen = seen | Mask::lane(lane);
            } else if shadow.caused(value).contains(source) {
                let number = shadow.cause(value, source);
                shadow.set_cause(to, Mask::lane(lane), number);
            }
        }
    }
    let Some(rule) = rule else { return };
    let index = &batch.registers[op.operand];
    if source == ReadSource::Quad {
        let beyond = batch.mask & Mask::from_fn(|lane| index.0[lane] > 3);
        let differing = differing_lanes(batch, RegSpan { first: op.operand, count: 1 }, 4);
        let broken = beyond | differing;
        undefine(sanitizer, shadow, place, op, rule, broken, |lane| match differing.contains(lane) {
            true => "a quad broadcast whose index differs in the quad".to_owned(),
            false => format!("a quad broadcast from index {}", index.0[lane]),
        });
        inactive = inactive.without(broken);
    }
    undefine(sanitizer, shadow, place, op, rule, inactive.without(seen), |lane| match source {
        ReadSource::Index => format!("the value of lane {}, which is not active", index.0[lane]),
        _ => "the value of a lane that is not active".to_owned(),
    });
    if rule == &subgroup::BROADCAST_INACTIVE {
        let differing = differing_lanes(batch, RegSpan { first: op.operand, count: 1 }, 0);
        sanitizer.tell(batch, &subgroup::BROADCAST_UNIFORM, place.op, differing, |lane| {
            let other = differing.lanes().map(|other| index.0[other]).find(|other| *other != index.0[lane]);
            let other = other.unwrap_or_default();
            format!("lanes of a subgroup broadcast from lane {} and from lane {other}", index.0[lane])
        });
    }
}

/// Checks that all lanes give the same ballot to `OpGroupNonUniformInverseBallot`.
fn inverse_ballot<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    place: OpPlace,
    op: &SubgroupOp,
) {
    let differing = differing_lanes(batch, RegSpan { first: op.value, count: op.values }, 0);
    sanitizer.tell(batch, &subgroup::INVERSE_BALLOT_UNIFORM, place.op, differing, |lane| {
        let words = |lane: usize| -> SmallVec<[u32; 4]> {
            batch.registers.lane_words(op.value, op.values, lane).collect()
        };
        let own = words(lane);
        let other = differing.lanes().map(words).find(|other| *other != own).unwrap_or_default();
        format!("lanes of a subgroup give the ballots {own:x?} and {other:x?} to an inverse ballot")
    });
}

/// The lanes of subgroups, or of their clusters of a size other than 0, in which consecutive
/// registers are not the same in all active lanes.
pub(crate) fn differing_lanes<const W: usize>(batch: &Batch<W>, registers: RegSpan, cluster: u32) -> Mask<W> {
    let RegSpan { first, count } = registers;
    let Some(lane) = batch.mask.lowest() else { return Mask::NONE };
    let is_uniform = (0..count).all(|word| {
        let register = &batch.registers[first.plus(word)];
        Mask::equal(register, register.0[lane]).covers(batch.mask)
    });
    if is_uniform {
        return Mask::NONE;
    }
    let words = |lane: usize| batch.registers.lane_words(first, count, lane);
    let mut differing = Mask::NONE;
    for members in subgroups(batch) {
        let clusters: SmallVec<[Members; 4]> = match cluster {
            0 => SmallVec::from_iter([members]),
            size => members.chunk_by(|a, b| a.1 / size == b.1 / size).map(Members::from_slice).collect(),
        };
        for members in clusters {
            if members.iter().any(|member| !words(member.0).eq(words(members[0].0))) {
                differing = members.iter().fold(differing, |lanes, member| lanes | Mask::lane(member.0));
            }
        }
    }
    differing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_of_lanes_that_a_subgroup_has() {
        assert_eq!([0, 1, 3].map(|word| bits_below(32, word)), [u32::MAX, 0, 0]);
        assert_eq!([0, 1, 2].map(|word| bits_below(40, word)), [u32::MAX, 0xFF, 0]);
        assert_eq!([0, 1].map(|word| bits_below(4, word)), [0xF, 0]);
        assert_eq!(bits_below(128, 3), u32::MAX);
    }
}
