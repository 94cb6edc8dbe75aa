//! Which programs are followed for values that go stale: what stands for lanes of a subgroup, the
//! nearest hit so far, the clock of a subgroup. Where such values come from, and which operations
//! need them to be true.

use crate::plan::instruction::InstructionWords;
use anyhit_engine::machine::Reg;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::module::{Id, Module, Opcode};
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::subgroup::{BallotCount, ReadSource, SubgroupKind, SubgroupOp};
use anyhit_engine::program::Program;

/// `SubgroupLocalInvocationId`, `SubgroupEqMask` and its siblings.
const LANE_BUILTINS: [u32; 6] = [41, 4416, 4417, 4418, 4419, 4420];
/// `SubgroupLocalInvocationId`
const LANE_INDEX: [u32; 1] = [41];
/// `RayTmaxKHR`
const RAY_T_MAX: [u32; 1] = [5326];

/// A kind of value that goes stale.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StaleKind {
    /// The index or mask of lanes of a subgroup, until they may be repacked.
    Lanes,
    /// Which lane of its subgroup an invocation is: its index, or whether it was elected.
    OwnLane,
    /// The t of the nearest hit so far, until a report is accepted.
    RayTmax,
    /// The clock of a subgroup, until its lanes may go on elsewhere.
    Clock,
}

/// A kind of value that is followed through a program.
#[derive(Clone, Debug)]
pub struct StalePlan {
    /// The kind.
    pub kind: StaleKind,
    /// The registers of builtins that have such values.
    pub inputs: Box<[Reg]>,
}

/// The kinds of values that are followed through a program: those that it has, and that go stale in
/// it before something needs them to be true.
pub(super) fn stale_plans(program: &Program) -> Vec<StalePlan> {
    let has = |test: &dyn Fn(&Op) -> bool| program.ops.iter().any(test);
    let registers_of = |builtins: &[u32]| -> Box<[Reg]> {
        let inputs = program.inputs.iter().filter(|input| builtins.contains(&input.builtin.number));
        inputs.flat_map(|input| (0..input.count).map(|word| input.first.plus(word))).collect()
    };
    let repacks = has(&Op::may_repack);
    let mut plans = Vec::new();
    if repacks && has(&|op| matches!(op, Op::Subgroup(subgroup) if sink(subgroup).is_some())) {
        plans.push(StalePlan { kind: StaleKind::Lanes, inputs: registers_of(&LANE_BUILTINS) });
    }
    let own = registers_of(&LANE_INDEX);
    if repacks && (!own.is_empty() || has(&|op| matches!(op, Op::Subgroup(subgroup) if elects(subgroup)))) {
        plans.push(StalePlan { kind: StaleKind::OwnLane, inputs: own });
    }
    let limit = registers_of(&RAY_T_MAX);
    if program.stage == Stage::Intersection && !limit.is_empty() {
        plans.push(StalePlan { kind: StaleKind::RayTmax, inputs: limit });
    }
    let mut origins = program.origins.iter();
    if repacks && origins.any(|origin| reads_clock(&program.module, origin.offset)) {
        plans.push(StalePlan { kind: StaleKind::Clock, inputs: Box::default() });
    }
    plans
}

/// Whether the instruction at a word offset reads the clock of the subgroup.
pub(super) fn reads_clock(module: &Module, offset: u32) -> bool {
    const SUBGROUP: u64 = 3;
    let instruction = InstructionWords::at(module, offset);
    match (instruction.opcode, instruction.words) {
        (Opcode::ReadClockKHR, &[_, _, _, scope, ..]) => module.scalar_value(Id(scope)) == Some(SUBGROUP),
        _ => false,
    }
}

/// Whether an operation elects a lane of the subgroup.
pub(crate) fn elects(op: &SubgroupOp) -> bool {
    op.kind == SubgroupKind::Elect
}

/// What an operation takes together with the lanes as they are: the value, the second operand, and
/// what it does with them.
pub(crate) fn sink(op: &SubgroupOp) -> Option<(bool, bool, &'static str)> {
    Some(match op.kind {
        SubgroupKind::Read(ReadSource::Index) => (false, true, "says which lane is read"),
        SubgroupKind::BallotBit { own: true } => (true, false, "is asked for the lane's own bit"),
        SubgroupKind::BallotBit { own: false } => (true, true, "says whether a lane is in a ballot"),
        SubgroupKind::BallotCount(BallotCount::CountInclusive | BallotCount::CountExclusive) => {
            (true, false, "is counted up to the lane's own bit")
        }
        SubgroupKind::BallotCount(BallotCount::Count) => (true, false, "is counted"),
        _ => return None,
    })
}
