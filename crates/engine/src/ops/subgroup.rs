//! Subgroup instructions (SPIR-V 3.3.24, `SPV_KHR_shader_ballot`, `SPV_KHR_subgroup_vote`,
//! `SPV_EXT_shader_subgroup_partitioned`, `SPV_AMD_shader_ballot`).
//!
//! A subgroup is a run of consecutive launch indices, x fastest; in a called shader, those of the
//! caller's subgroup that reached the same shader record, by its index. A launch of a pipeline that
//! has these instructions holds each subgroup in one batch, whatever width was asked for. What the
//! specification leaves undefined (reading an inactive invocation) gives 0; sums go
//! from the lowest invocation to the highest, each step rounded.

use crate::module::Opcode;
use smallvec::SmallVec;

use crate::machine::{Batch, Reg, Registers};
use crate::ops::access::Access;
use crate::ops::lane_kernel::LaneKernel;

pub use translate::{read, read_from_index, translate};

mod translate;

/// Opcodes translated here.
pub const OPCODES: &[Opcode] = &[
    Opcode::GroupNonUniformElect,
    Opcode::GroupNonUniformAll,
    Opcode::GroupNonUniformAny,
    Opcode::GroupNonUniformAllEqual,
    Opcode::GroupNonUniformBroadcast,
    Opcode::GroupNonUniformBroadcastFirst,
    Opcode::GroupNonUniformBallot,
    Opcode::GroupNonUniformInverseBallot,
    Opcode::GroupNonUniformBallotBitExtract,
    Opcode::GroupNonUniformBallotBitCount,
    Opcode::GroupNonUniformBallotFindLSB,
    Opcode::GroupNonUniformBallotFindMSB,
    Opcode::GroupNonUniformShuffle,
    Opcode::GroupNonUniformShuffleXor,
    Opcode::GroupNonUniformShuffleUp,
    Opcode::GroupNonUniformShuffleDown,
    Opcode::GroupNonUniformIAdd,
    Opcode::GroupNonUniformFAdd,
    Opcode::GroupNonUniformIMul,
    Opcode::GroupNonUniformFMul,
    Opcode::GroupNonUniformSMin,
    Opcode::GroupNonUniformUMin,
    Opcode::GroupNonUniformFMin,
    Opcode::GroupNonUniformSMax,
    Opcode::GroupNonUniformUMax,
    Opcode::GroupNonUniformFMax,
    Opcode::GroupNonUniformBitwiseAnd,
    Opcode::GroupNonUniformBitwiseOr,
    Opcode::GroupNonUniformBitwiseXor,
    Opcode::GroupNonUniformLogicalAnd,
    Opcode::GroupNonUniformLogicalOr,
    Opcode::GroupNonUniformLogicalXor,
    Opcode::GroupNonUniformQuadBroadcast,
    Opcode::GroupNonUniformQuadSwap,
    Opcode::GroupNonUniformQuadAllKHR,
    Opcode::GroupNonUniformQuadAnyKHR,
    Opcode::GroupNonUniformRotateKHR,
    Opcode::GroupNonUniformPartitionEXT,
    Opcode::SubgroupBallotKHR,
    Opcode::SubgroupFirstInvocationKHR,
    Opcode::SubgroupAllKHR,
    Opcode::SubgroupAnyKHR,
    Opcode::SubgroupAllEqualKHR,
    Opcode::SubgroupReadInvocationKHR,
    Opcode::GroupIAddNonUniformAMD,
    Opcode::GroupFAddNonUniformAMD,
    Opcode::GroupFMinNonUniformAMD,
    Opcode::GroupUMinNonUniformAMD,
    Opcode::GroupSMinNonUniformAMD,
    Opcode::GroupFMaxNonUniformAMD,
    Opcode::GroupUMaxNonUniformAMD,
    Opcode::GroupSMaxNonUniformAMD,
];

/// The active lanes of a subgroup, each with its `SubgroupLocalInvocationId`, ascending.
pub type Members = SmallVec<[(usize, u32); 32]>;

/// The invocation whose value is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadSource {
    /// The lowest active invocation.
    First,
    /// The invocation whose id is the operand.
    Index,
    /// This invocation's id, exclusive or the operand.
    Xor,
    /// This invocation's id minus the operand.
    Up,
    /// This invocation's id plus the operand.
    Down,
    /// This invocation's id plus the operand, modulo a cluster of this size.
    Rotate(u32),
    /// The invocation of the same quad whose index is the operand.
    Quad,
    /// This invocation's id with this bit set: the greater side of the quad along x (1) or y (2).
    QuadSet(u32),
    /// This invocation's id with this bit cleared.
    QuadClear(u32),
    /// The opposite invocation of the quad: horizontally, vertically or diagonally, by the operand.
    QuadSwap,
}

/// How the bits of a ballot are counted or searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BallotCount {
    /// The number of bits set.
    Count,
    /// The number of bits set up to this invocation's id.
    CountInclusive,
    /// The number of bits set below this invocation's id.
    CountExclusive,
    /// The index of the lowest bit set.
    FindLsb,
    /// The index of the highest bit set.
    FindMsb,
}

/// A reduction or scan (SPIR-V, "Group Operation"): the invocations whose values are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReductionKind {
    /// All active invocations (0), or those in the same cluster of this size.
    Reduce(u32),
    /// The invocations up to this one.
    InclusiveScan,
    /// The invocations below this one. The register holds the identity.
    ExclusiveScan(Reg),
}

/// The kind of a subgroup instruction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SubgroupKind {
    /// Whether this is the lowest active invocation.
    Elect,
    /// Whether a bool holds everywhere, in clusters of this size.
    All(u32),
    /// Whether a bool holds anywhere, in clusters of this size.
    Any(u32),
    /// Whether a value is the same everywhere.
    AllEqual,
    /// The mask of the invocations in which a bool holds.
    Ballot,
    /// The mask of the invocations with the same value.
    Partition,
    /// Another invocation's value.
    Read(ReadSource),
    /// A count of the bits set in a ballot, or the index of one.
    BallotCount(BallotCount),
    /// The bit of a ballot at the index in the operand, or at this invocation's id.
    BallotBit {
        /// Whether this invocation's id is the index.
        own: bool,
    },
    /// A reduction or scan of values by a kernel.
    Reduce {
        /// The kernel that combines two.
        kernel: &'static LaneKernel,
        /// The invocations whose values are combined.
        reduction: ReductionKind,
        /// Whether the operand is a ballot of the invocations in this invocation's partition.
        partitioned: bool,
    },
}

/// A subgroup operation.
#[derive(Clone, Debug, PartialEq)]
pub struct SubgroupOp {
    /// The kind.
    pub kind: SubgroupKind,
    /// The first register of the result.
    pub to: Reg,
    /// Registers of the result.
    pub results: u32,
    /// The first register of the value.
    pub value: Reg,
    /// Registers of the value.
    pub values: u32,
    /// The first register of a second operand.
    pub operand: Reg,
    /// Registers of the second operand.
    pub operands: u32,
}

impl SubgroupOp {
    /// See [`crate::ops::op::Op::accesses`].
    pub fn accesses(&self, visit: &mut dyn FnMut(Access)) {
        visit(Access::Read(self.value, self.values));
        visit(Access::Read(self.operand, self.operands));
        if let SubgroupKind::Reduce { kernel, reduction: ReductionKind::ExclusiveScan(identity), .. } =
            self.kind
        {
            visit(Access::Read(identity, kernel.words));
        }
        visit(Access::Write(self.to, self.results));
    }

    /// The operand `ClusterSize`, where the instruction has one.
    pub fn cluster_size(&self) -> Option<u32> {
        match self.kind {
            SubgroupKind::Read(ReadSource::Rotate(size))
            | SubgroupKind::Reduce { reduction: ReductionKind::Reduce(size), .. } => {
                Some(size).filter(|size| *size != 0)
            }
            _ => None,
        }
    }

    /// Whether every active lane's value counts for the result of each.
    pub fn reads_every_lane(&self) -> bool {
        match self.kind {
            SubgroupKind::All(_)
            | SubgroupKind::Any(_)
            | SubgroupKind::AllEqual
            | SubgroupKind::Ballot
            | SubgroupKind::Partition
            | SubgroupKind::Reduce { .. } => true,
            SubgroupKind::Elect
            | SubgroupKind::Read(_)
            | SubgroupKind::BallotCount(_)
            | SubgroupKind::BallotBit { .. } => false,
        }
    }

    /// Of an instruction that reads another lane's value: by running lane, the lane that it reads;
    /// `None` where that one is not active. Empty for any other instruction.
    pub fn read_lanes<const W: usize>(&self, batch: &Batch<W>) -> Vec<(usize, Option<usize>)> {
        let SubgroupKind::Read(from) = self.kind else { return Vec::new() };
        let size = batch.invocations.subgroup_size();
        let mut all = Vec::new();
        for members in subgroups(batch) {
            for &(lane, id) in &members {
                let operand = batch.registers[self.operand].0[lane];
                let source = source_id(from, id, operand, size).unwrap_or(members[0].1);
                all.push((lane, members.iter().find(|peer| peer.1 == source).map(|peer| peer.0)));
            }
        }
        all
    }

    /// Runs the operation for the running lanes.
    pub fn eval<const W: usize>(&self, batch: &mut Batch<W>) {
        let size = batch.invocations.subgroup_size();
        for members in subgroups(batch) {
            self.eval_subgroup(batch, &members, size);
        }
    }

    /// Runs the operation for one subgroup. Results are written when all are known, as their
    /// registers may be those of operands.
    fn eval_subgroup<const W: usize>(&self, batch: &mut Batch<W>, members: &Members, size: u32) {
        let registers = &batch.registers;
        let value = |lane: usize| -> SmallVec<[u32; 4]> {
            registers.lane_words(self.value, self.values, lane).collect()
        };
        let operand = |lane: usize| registers[self.operand].0[lane];
        let holds = |lane: usize| registers[self.value].0[lane] != 0;
        let ballot = |which: &dyn Fn(usize) -> bool| -> SmallVec<[u32; 4]> {
            let mut words = SmallVec::from_elem(0, 4);
            for &(_, id) in members.iter().filter(|&&(lane, _)| which(lane)) {
                words[id as usize / 32] |= 1 << (id % 32);
            }
            words
        };
        let one = |word: bool| SmallVec::<[u32; 4]>::from_slice(&[u32::from(word)]);
        let same = |cluster: u32, a: u32, b: u32| cluster == 0 || a / cluster == b / cluster;
        let mut results: SmallVec<[(usize, SmallVec<[u32; 4]>); 32]> = SmallVec::new();
        for &(lane, id) in members {
            let peers = |cluster: u32| members.iter().filter(move |peer| same(cluster, id, peer.1));
            let words = match self.kind {
                SubgroupKind::Elect => one(id == members[0].1),
                SubgroupKind::All(cluster) => one(peers(cluster).all(|peer| holds(peer.0))),
                SubgroupKind::Any(cluster) => one(peers(cluster).any(|peer| holds(peer.0))),
                SubgroupKind::AllEqual => one(self.all_equal(registers, members)),
                SubgroupKind::Ballot => ballot(&holds),
                SubgroupKind::Partition => {
                    let own = value(lane);
                    ballot(&|peer| value(peer) == own)
                }
                SubgroupKind::Read(from) => {
                    let source = source_id(from, id, operand(lane), size).unwrap_or(members[0].1);
                    let found = members.iter().find(|peer| peer.1 == source);
                    found.map_or_else(|| SmallVec::from_elem(0, self.values as usize), |peer| value(peer.0))
                }
                SubgroupKind::BallotCount(bits) => {
                    SmallVec::from_slice(&[count_ballot(bits, &value(lane), id, size)])
                }
                SubgroupKind::BallotBit { own } => {
                    let at = if own { id } else { operand(lane) };
                    let word = value(lane).get(at as usize / 32).copied().unwrap_or(0);
                    one(word >> (at % 32) & 1 != 0)
                }
                SubgroupKind::Reduce { kernel, reduction, partitioned } => {
                    let in_partition = |peer: &(usize, u32)| {
                        if !partitioned {
                            return true;
                        }
                        let word = registers[self.operand.plus(peer.1 / 32)].0[lane];
                        word >> (peer.1 % 32) & 1 != 0
                    };
                    let in_range = |peer: &(usize, u32)| match reduction {
                        ReductionKind::Reduce(cluster) => same(cluster, id, peer.1),
                        ReductionKind::InclusiveScan => peer.1 <= id,
                        ReductionKind::ExclusiveScan(_) => peer.1 < id,
                    };
                    let chosen = members.iter().filter(|peer| in_partition(peer) && in_range(peer));
                    let combined = reduce(kernel, chosen.map(|peer| value(peer.0)));
                    combined.unwrap_or_else(|| match reduction {
                        ReductionKind::ExclusiveScan(identity) => {
                            registers.lane_words(identity, kernel.words, lane).collect()
                        }
                        _ => value(lane),
                    })
                }
            };
            results.push((lane, words));
        }
        for (lane, words) in results {
            batch.registers.set_lane_words(self.to, lane, words);
        }
    }

    fn all_equal<const W: usize>(&self, registers: &Registers<W>, members: &Members) -> bool {
        let words = |lane| registers.lane_words(self.value, self.values, lane);
        members.iter().all(|peer| words(peer.0).eq(words(members[0].0)))
    }
}

/// The active lanes of a batch by subgroup, in the order of their ids in it.
pub fn subgroups<const W: usize>(batch: &Batch<W>) -> SmallVec<[Members; 4]> {
    let mut groups: SmallVec<[([u64; 3], Members); 4]> = SmallVec::new();
    for lane in batch.mask.lanes() {
        let invocation = batch.invocations.lane(lane);
        let workgroup = invocation.workgroup.map_or(0, |group| group.index());
        let key = [workgroup, invocation.subgroup_id(), batch.invocations.record_indices[lane].0];
        let member = (lane, invocation.subgroup_local_invocation_id());
        match groups.iter_mut().find(|(found, _)| *found == key) {
            Some((_, members)) => {
                let place = members.partition_point(|&(_, id)| id < member.1);
                members.insert(place, member);
            }
            None => groups.push((key, SmallVec::from_slice(&[member]))),
        }
    }
    groups.into_iter().map(|(_, members)| members).collect()
}

/// The id of the invocation that a value is read from; `None` for the lowest active one.
fn source_id(from: ReadSource, id: u32, operand: u32, size: u32) -> Option<u32> {
    Some(match from {
        ReadSource::First => return None,
        ReadSource::Index => operand,
        ReadSource::Xor => id ^ operand,
        ReadSource::Up => id.checked_sub(operand).unwrap_or(u32::MAX),
        ReadSource::Down => id.saturating_add(operand),
        ReadSource::Rotate(cluster) => {
            let cluster = if cluster == 0 { size } else { cluster };
            id / cluster * cluster + (id % cluster).wrapping_add(operand) % cluster
        }
        ReadSource::QuadSet(bit) => id | bit,
        ReadSource::QuadClear(bit) => id & !bit,
        ReadSource::Quad => id / 4 * 4 + operand % 4,
        // The operand is 0 for horizontal, 1 for vertical, 2 for diagonal.
        ReadSource::QuadSwap => id ^ (operand % 3 + 1),
    })
}

fn count_ballot(bits: BallotCount, ballot: &[u32], id: u32, size: u32) -> u32 {
    let mut wide = 0u128;
    for (at, &word) in ballot.iter().enumerate().take(4) {
        wide |= u128::from(word) << (32 * at);
    }
    let below = |count: u32| if count >= 128 { u128::MAX } else { (1 << count) - 1 };
    let counted = wide & below(size);
    match bits {
        BallotCount::Count => counted.count_ones(),
        BallotCount::CountInclusive => (counted & below(id + 1)).count_ones(),
        BallotCount::CountExclusive => (counted & below(id)).count_ones(),
        BallotCount::FindLsb => counted.trailing_zeros(),
        BallotCount::FindMsb => 127u32.wrapping_sub(counted.leading_zeros()),
    }
}

/// Combines values from left to right; `None` where there are none.
fn reduce(
    kernel: &LaneKernel,
    mut values: impl Iterator<Item = SmallVec<[u32; 4]>>,
) -> Option<SmallVec<[u32; 4]>> {
    let mut sum = values.next()?;
    let mut registers = Registers::<1>::new(6);
    for value in values {
        registers.set_lane_words(Reg(0), 0, sum.iter().copied());
        registers.set_lane_words(Reg(2), 0, value);
        (kernel.eval_1)(registers.all_mut(), Reg(4), &[Reg(0), Reg(2), Reg(0)]);
        sum = registers.lane_words(Reg(4), kernel.words, 0).collect();
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources() {
        assert_eq!(source_id(ReadSource::First, 5, 0, 32), None);
        assert_eq!(source_id(ReadSource::Index, 5, 7, 32), Some(7));
        assert_eq!(source_id(ReadSource::Xor, 5, 1, 32), Some(4));
        assert_eq!(source_id(ReadSource::Up, 5, 2, 32), Some(3));
        assert_eq!(source_id(ReadSource::Up, 1, 2, 32), Some(u32::MAX));
        assert_eq!(source_id(ReadSource::Down, 5, 2, 32), Some(7));
        assert_eq!(source_id(ReadSource::Rotate(0), 31, 2, 32), Some(1));
        assert_eq!(source_id(ReadSource::Rotate(4), 7, 1, 32), Some(4));
        assert_eq!(source_id(ReadSource::Quad, 6, 3, 32), Some(7));
        assert_eq!(
            [4, 5, 6, 7].map(|id| source_id(ReadSource::QuadSet(2), id, 0, 32)),
            [6, 7, 6, 7].map(Some)
        );
        assert_eq!(
            [4, 5, 6, 7].map(|id| source_id(ReadSource::QuadClear(1), id, 0, 32)),
            [4, 4, 6, 6].map(Some)
        );
        assert_eq!(
            [0, 1, 2].map(|way| source_id(ReadSource::QuadSwap, 4, way, 32)),
            [Some(5), Some(6), Some(7)]
        );
    }

    #[test]
    fn bits_of_ballots() {
        let ballot = [0b1011_0100, 0, 0, 0];
        let of = |bits| count_ballot(bits, &ballot, 4, 32);
        assert_eq!(of(BallotCount::Count), 4);
        assert_eq!(of(BallotCount::CountInclusive), 2);
        assert_eq!(of(BallotCount::CountExclusive), 1);
        assert_eq!(of(BallotCount::FindLsb), 2);
        assert_eq!(of(BallotCount::FindMsb), 7);
        // Bits beyond the subgroup do not count.
        assert_eq!(count_ballot(BallotCount::Count, &ballot, 0, 4), 1);
        assert_eq!(count_ballot(BallotCount::Count, &[u32::MAX; 4], 0, 128), 128);
    }
}
