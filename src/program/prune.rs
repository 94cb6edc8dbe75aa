//! Drops what nothing reads: operations, builtins and constants.
//!
//! The shader compilers leave unused access chains and undefined values behind; dropping them here
//! also means that an index which is out of bounds but never followed does not trap.

use crate::machine::Reg;
use crate::ops::op::{Access, Op};
use crate::ops::{memory, ray_tracing};
use crate::program::{Program, Terminator};

/// No entry.
const NONE: u32 = u32::MAX;

/// Removes operations whose results are not read; `addressed` are rows that computed row numbers
/// reach. What is left also tells whether the order of invocations matters.
pub fn prune(program: &mut Program, addressed: &[(Reg, u32)]) {
    let mut live = vec![false; program.rows as usize + 1];
    let mut work: Vec<usize> = Vec::new();
    let mut effects = Vec::new();
    // The operations that write each row: the last of them, and for each entry the one before.
    let mut last = vec![NONE; program.rows as usize + 1];
    let mut writers: Vec<(u32, u32)> = Vec::with_capacity(2 * program.ops.len());
    for (at, op) in program.ops.iter().enumerate() {
        op.accesses(|access| match access {
            Access::Write(first, count) => {
                for row in first.0..first.0 + count {
                    let last = &mut last[row as usize];
                    writers.push((at as u32, *last));
                    *last = writers.len() as u32 - 1;
                }
            }
            Access::Effect => effects.push(at),
            Access::Read(..) => {}
        });
    }
    let rows = |first: Reg, count: u32, live: &mut Vec<bool>, work: &mut Vec<usize>| {
        for row in first.0..first.0 + count {
            let row = row as usize;
            if row < live.len() && !std::mem::replace(&mut live[row], true) {
                let mut next = last[row];
                while let Some(&(op, before)) = writers.get(next as usize) {
                    work.push(op as usize);
                    next = before;
                }
            }
        }
    };
    for &(first, count) in addressed {
        // A computed index may reach every row of the variable.
        let holds = |&&(start, rows): &&(Reg, u32)| (start.0..start.0 + rows).contains(&first.0);
        let (first, count) = program.variables.iter().find(holds).copied().unwrap_or((first, count));
        rows(first, count, &mut live, &mut work);
    }
    // Whoever calls this program reads payload, attributes and callable data.
    for interface in program.interface.iter().filter(|rows| rows.storage_class >= 5328) {
        rows(interface.first, interface.count, &mut live, &mut work);
    }
    for block in &program.blocks {
        match block.terminator {
            Terminator::BranchConditional { condition, .. } => rows(condition, 1, &mut live, &mut work),
            Terminator::Switch { selector, wide, .. } => {
                rows(selector, 1 + u32::from(wide), &mut live, &mut work);
            }
            _ => {}
        }
    }
    work.extend(effects);
    let mut visited = vec![false; program.ops.len()];
    while let Some(at) = work.pop() {
        if std::mem::replace(&mut visited[at], true) {
            continue;
        }
        program.ops[at].accesses(|access| {
            if let Access::Read(first, count) = access {
                rows(first, count, &mut live, &mut work);
            }
        });
    }
    program.inputs.retain(|input| (0..input.count).any(|word| live[(input.first.0 + word) as usize]));
    program.order_dependent = program.ops.iter().zip(&visited).any(|(op, &kept)| match op {
        Op::Atomic(op) if kept => op.order_dependent(live[op.to.0 as usize]),
        _ => false,
    });
    remove(program, &visited);
    program.uses_subgroups = program.ops.iter().any(|op| matches!(op, Op::Subgroup(_)));
    let addresses = |op: &Op| matches!(op, Op::Stop(ray_tracing::Op::HitObjectRecordHandle { .. }));
    program.addresses_records = program.ops.iter().any(addresses);
}

/// Removes the operations that are not needed and moves the blocks' borders.
pub(super) fn remove(program: &mut Program, needed: &[bool]) {
    let mut before = Vec::with_capacity(needed.len() + 1);
    let mut count = 0;
    for &needed in needed {
        before.push(count);
        count += u32::from(needed);
    }
    before.push(count);
    for block in &mut program.blocks {
        block.first = before[block.first as usize];
        block.end = before[block.end as usize];
    }
    let mut keep = needed.iter();
    program.ops.retain(|_| *keep.next().expect("bug in anyhit: an operation without a verdict"));
    let mut keep = needed.iter();
    program.origins.retain(|_| *keep.next().expect("bug in anyhit: an operation without a verdict"));
    let is_noop = |op: &Op| matches!(op, Op::Memory(memory::Op::Move { to, from }) if to == from);
    debug_assert!(!program.ops.iter().any(is_noop));
}
