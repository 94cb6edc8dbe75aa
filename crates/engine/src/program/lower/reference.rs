//! Completes programs without any optimisation: the reference that the optimizer is checked
//! against.

use rustc_hash::FxHashMap;

use crate::machine::BlockIndex;
use crate::ops::op::Op;
use crate::ops::translate::Origin;
use crate::program::{OptimizedCode, Program, Superblock};

/// Makes a program ready to run as it was translated, given the optimised one of the same entry
/// point.
///
/// The optimised program only determines the schedule of a launch, on which results depend if
/// invocations share memory, and which instructions are eliminated.
pub(super) fn complete(program: &mut Program, optimized: &Program) {
    program.silent = silent(program, optimized);
    program.order_dependent = optimized.order_dependent;
    program.accesses.clone_from(&optimized.accesses);
    program.uses_subgroups = program.ops.iter().any(Op::needs_subgroup);
    program.addresses_records = program.ops.iter().any(Op::addresses_record);
    let superblocks = (0..)
        .map(BlockIndex)
        .zip(&program.blocks)
        .map(|(last, block)| Superblock { end: block.end, last })
        .collect();
    let reassigned = Vec::new();
    program.optimized = OptimizedCode { ops: program.ops.clone(), supercode: None, superblocks, reassigned };
}

/// The offset, width and count of a load, which identify it among the loads of one instruction: a
/// load of a whole structure has several.
type LoadedBytes = Option<(u32, u32, u32)>;

/// By operation: whether the optimised program lacks it. If a dead load is eliminated, its trap is
/// eliminated, too.
fn silent(program: &Program, optimized: &Program) -> Vec<bool> {
    let mut kept: FxHashMap<Origin, Vec<LoadedBytes>> = FxHashMap::default();
    for (op, origin) in optimized.ops.iter().zip(&optimized.origins).filter(|(op, _)| op.may_trap()) {
        kept.entry(*origin).or_default().push(loaded_bytes(op));
    }
    let mut counts: FxHashMap<Origin, usize> = FxHashMap::default();
    for (_, origin) in program.ops.iter().zip(&program.origins).filter(|(op, _)| op.may_trap()) {
        *counts.entry(*origin).or_default() += 1;
    }
    let is_silent = |(op, origin): (&Op, &Origin)| {
        op.may_trap()
            && match kept.get(origin) {
                None => true,
                Some(parts) => parts.len() < counts[origin] && !parts.contains(&loaded_bytes(op)),
            }
    };
    program.ops.iter().zip(&program.origins).map(is_silent).collect()
}

fn loaded_bytes(op: &Op) -> LoadedBytes {
    op.buffer_load().map(|(_, chunk)| (chunk.offset, chunk.width, chunk.count))
}
