//! Which programs are followed for what stands for lanes of a subgroup, from which inputs, and
//! which operations take it together with the lanes as they are.

use crate::machine::Reg;
use crate::ops::hit_object::HitObjectOp;
use crate::ops::op::Op;
use crate::ops::ray_tracing::RayTracingOp;
use crate::ops::subgroup::{BallotCount, ReadSource, SubgroupKind, SubgroupOp};
use crate::program::Program;

/// `SubgroupLocalInvocationId`, `SubgroupEqMask` and its siblings.
const LANE_BUILTINS: [u32; 6] = [41, 4416, 4417, 4418, 4419, 4420];

/// The registers of builtins that stand for lanes, of a program that is tracked; `None` for others.
pub(in crate::sanitize) fn tracked_inputs(program: &Program) -> Option<Box<[Reg]>> {
    let repacks = program.ops.iter().any(|op| match op {
        Op::Stop(stop) => may_repack(stop),
        Op::HitObject(object) => **object == HitObjectOp::Reorder,
        _ => false,
    });
    let is_sink = |op: &Op| matches!(op, Op::Subgroup(subgroup) if sink(subgroup).is_some());
    if !repacks || !program.ops.iter().any(is_sink) {
        return None;
    }
    let inputs = program.inputs.iter().filter(|input| LANE_BUILTINS.contains(&input.builtin.number));
    Some(inputs.flat_map(|input| (0..input.count).map(|word| input.first.plus(word))).collect())
}

/// Whether the lanes of a batch may come back from the pipeline in other subgroups.
pub(in crate::sanitize) fn may_repack(stop: &RayTracingOp) -> bool {
    !matches!(stop, RayTracingOp::HitObjectRecordHandle { .. })
}

/// What an operation takes together with the lanes as they are: the value, the second operand, and
/// what it does with them.
pub(in crate::sanitize) fn sink(op: &SubgroupOp) -> Option<(bool, bool, &'static str)> {
    Some(match op.kind {
        SubgroupKind::Read(ReadSource::Index) => (false, true, "says which lane is read"),
        SubgroupKind::BallotBit { own: true } => (true, false, "is asked for the lane's own bit"),
        SubgroupKind::BallotBit { own: false } => (true, true, "says whether a lane is in a ballot"),
        SubgroupKind::BallotCount(BallotCount::CountInclusive | BallotCount::CountExclusive) => {
            (true, false, "is counted up to the lane's own bit")
        }
        _ => return None,
    })
}
