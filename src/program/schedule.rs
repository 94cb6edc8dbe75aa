//! The order of regular operations between two irregular ones: each goes on with the result of the one
//! before it, where an operation can, so that the value need not be stored and loaded in between
//! ([`crate::ops::stretch`]).
//!
//! A regular operation neither traps nor stops, and has no effect beside the rows that it writes. Any order
//! gives the same in which reads and writes of each row keep theirs.

use std::collections::BTreeSet;

use crate::machine::Reg;
use crate::ops::memory;
use crate::ops::op::{Access, Op};
use crate::program::reuse::is_idle;

/// Orders operations; its memory serves one run after the other.
pub(super) struct Schedule {
    /// By row: the operation of this stretch that wrote it last, and those that have read it since.
    rows: Vec<Row>,
    touched: Vec<u32>,
}

#[derive(Clone, Default)]
struct Row {
    written: Option<u32>,
    read: Vec<u32>,
}

/// An operation that waits for others.
#[derive(Clone, Default)]
struct Waiting {
    /// How many it waits for.
    count: u32,
    /// Those that wait for it.
    followers: Vec<u32>,
}

impl Schedule {
    /// For a program of so many rows.
    pub fn new(rows: u32) -> Self {
        Self { rows: vec![Row::default(); rows as usize], touched: Vec::new() }
    }

    /// Orders the operations of a run.
    pub fn order(&mut self, ops: &mut [Op]) {
        let regular = |op: &Op| {
            matches!(op, Op::Row { .. } | Op::Memory(memory::Op::Move { .. } | memory::Op::MoveMasked { .. }))
        };
        for stretch in ops.chunk_by_mut(|a, b| regular(a) == regular(b)) {
            if stretch.len() > 2 && regular(&stretch[0]) {
                let order = self.ordered(stretch);
                let sorted: Vec<Op> = order.into_iter().map(|at| stretch[at as usize].clone()).collect();
                stretch.clone_from_slice(&sorted);
            }
        }
    }

    /// The order of the operations of a stretch.
    fn ordered(&mut self, ops: &[Op]) -> Vec<u32> {
        let mut waiting = self.waiting(ops);
        let mut ready: BTreeSet<u32> =
            (0..ops.len() as u32).filter(|&at| waiting[at as usize].count == 0).collect();
        let mut order = Vec::with_capacity(ops.len());
        let mut before: Option<u32> = None;
        while let Some(&earliest) = ready.first() {
            let result = before.and_then(|at| result(&ops[at as usize]));
            let goes_on = result.and_then(|result| {
                let followers = &waiting[before? as usize].followers;
                followers.iter().copied().find(|at| ready.contains(at) && reads(&ops[*at as usize], result))
            });
            let next = goes_on.unwrap_or(earliest);
            ready.remove(&next);
            order.push(next);
            for follower in std::mem::take(&mut waiting[next as usize].followers) {
                let entry = &mut waiting[follower as usize];
                entry.count -= 1;
                if entry.count == 0 {
                    ready.insert(follower);
                }
                waiting[next as usize].followers.push(follower);
            }
            // A masked copy leaves the value at hand that it copies.
            let copies = |op: &Op| matches!(op, Op::Memory(memory::Op::MoveMasked { .. }));
            if goes_on.is_none() || !copies(&ops[next as usize]) {
                before = Some(next);
            }
        }
        order
    }

    /// What each operation waits for: whoever wrote what it reads, and read or wrote what it writes.
    fn waiting(&mut self, ops: &[Op]) -> Vec<Waiting> {
        let mut waiting = vec![Waiting::default(); ops.len()];
        for (at, op) in (0..).zip(ops) {
            if is_idle(op) {
                continue;
            }
            let mut after: Vec<u32> = Vec::new();
            op.accesses(|access| {
                if let Access::Read(first, count) = access {
                    for row in first.0..first.0 + count {
                        self.touched.push(row);
                        let row = &mut self.rows[row as usize];
                        after.extend(row.written);
                        row.read.push(at);
                    }
                }
            });
            op.accesses(|access| {
                if let Access::Write(first, count) = access {
                    for row in first.0..first.0 + count {
                        self.touched.push(row);
                        let row = &mut self.rows[row as usize];
                        after.extend(row.written.replace(at));
                        after.extend(row.read.drain(..).filter(|&reader| reader != at));
                    }
                }
            });
            after.sort_unstable();
            after.dedup();
            waiting[at as usize].count = after.len() as u32;
            for earlier in after {
                waiting[earlier as usize].followers.push(at);
            }
        }
        for row in self.touched.drain(..) {
            let row = &mut self.rows[row as usize];
            row.written = None;
            row.read.clear();
        }
        waiting
    }
}

/// The row of an operation's result, where it is one.
fn result(op: &Op) -> Option<Reg> {
    match *op {
        Op::Row { row, to, .. } => (row.words == 1).then_some(to),
        Op::Memory(memory::Op::Move { to, .. }) => Some(to),
        // The lanes that do not run keep what the row has.
        Op::Memory(memory::Op::MoveMasked { from, .. }) => Some(from),
        _ => None,
    }
}

/// Whether an operation reads a row.
fn reads(op: &Op, wanted: Reg) -> bool {
    let mut found = false;
    op.accesses(|access| found |= access == Access::Read(wanted, 1));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::arithmetic::{FAdd, FMul};

    fn row(family: &'static crate::ops::row::Family, to: u32, a: u32, b: u32) -> Op {
        let row = family.row(32).expect("a row of 32 bits");
        Op::Row { row, to: Reg(to), from: [Reg(a), Reg(b), Reg(a)] }
    }

    fn store(to: u32, from: u32) -> Op {
        Op::Memory(memory::Op::MoveMasked { to: Reg(to), from: Reg(from) })
    }

    #[test]
    fn an_operation_follows_the_one_whose_result_it_reads() {
        // x * x + z and y * y + z, as a compiler writes them that goes by components.
        let mut ops =
            [row(&FMul, 10, 0, 0), row(&FMul, 11, 1, 1), row(&FAdd, 12, 10, 2), row(&FAdd, 13, 11, 2)];
        let expected = [ops[0].clone(), ops[2].clone(), ops[1].clone(), ops[3].clone()];
        Schedule::new(20).order(&mut ops);
        assert_eq!(ops, expected);
    }

    #[test]
    fn reads_and_writes_of_a_row_keep_their_order() {
        // Row 1 is a variable: what is read of it before the store stays before.
        let mut ops = [row(&FMul, 10, 0, 0), row(&FAdd, 11, 1, 1), store(1, 10), row(&FAdd, 12, 1, 11)];
        let expected = [ops[0].clone(), ops[1].clone(), ops[2].clone(), ops[3].clone()];
        Schedule::new(20).order(&mut ops);
        assert_eq!(ops, expected);
    }

    #[test]
    fn irregular_operations_stay_where_they_are() {
        let mut ops = [
            row(&FMul, 10, 0, 0),
            row(&FMul, 11, 1, 1),
            Op::Barrier,
            row(&FAdd, 12, 10, 2),
            row(&FAdd, 13, 11, 2),
        ];
        let expected = ops.clone();
        Schedule::new(20).order(&mut ops);
        assert_eq!(ops, expected);
    }
}
