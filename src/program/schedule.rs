//! Instruction scheduling: orders the regular operations between two irregular ones so that each
//! uses the result of the one before it, where possible. The value then stays in the accumulator of
//! superinstructions ([`crate::ops::superop`]) and need not be stored and loaded.
//!
//! A regular operation neither traps nor stops, and has no effect except on the registers that it
//! writes. Every order that keeps the order of the reads and writes of each register gives the same
//! results.

use crate::machine::Reg;
use crate::ops::memory;
use crate::ops::op::{Access, Op};
use crate::program::regalloc::is_idle;

/// No entry.
const NONE: u32 = u32::MAX;

/// A list scheduler; its memory is reused for each superblock.
pub(super) struct Schedule {
    /// By register: the operation of this region that wrote it last, and the last of those that
    /// have read it since.
    registers: Vec<RegisterUse>,
    touched: Vec<u32>,
    /// Operations that read a register, each linked to the previous reader.
    readers: Vec<(u32, u32)>,
    /// The dependences: an operation, and an earlier one that it waits for.
    edges: Vec<(u32, u32)>,
    waiting: Vec<Waiting>,
    /// The operations that wait, by the operation that they wait for.
    followers: Vec<u32>,
    order: Vec<u32>,
}

#[derive(Clone, Copy)]
struct RegisterUse {
    written: u32,
    /// An index into `readers`.
    read: u32,
}

impl RegisterUse {
    const UNTOUCHED: Self = Self { written: NONE, read: NONE };
}

/// An operation that waits for others.
#[derive(Clone, Copy)]
struct Waiting {
    /// The number of operations that it waits for.
    count: u32,
    /// The range of `followers` that wait for it.
    first: u32,
    end: u32,
    /// The last operation that was found to wait for it.
    last: u32,
    done: bool,
}

impl Schedule {
    /// For a program of so many registers.
    pub fn new(registers: u32) -> Self {
        Self {
            registers: vec![RegisterUse::UNTOUCHED; registers as usize],
            touched: Vec::new(),
            readers: Vec::new(),
            edges: Vec::new(),
            waiting: Vec::new(),
            followers: Vec::new(),
            order: Vec::new(),
        }
    }

    /// Orders the operations of a superblock.
    pub fn order(&mut self, ops: &mut [Op]) {
        let regular = |op: &Op| {
            matches!(
                op,
                Op::LaneKernel { .. }
                    | Op::Memory(memory::MemoryOp::Move { .. } | memory::MemoryOp::MoveMasked { .. })
            )
        };
        for region in ops.chunk_by_mut(|a, b| regular(a) == regular(b)) {
            if region.len() > 2 && regular(&region[0]) {
                self.find_order(region);
                if self.order.is_sorted() {
                    continue;
                }
                let sorted: Vec<Op> = self.order.iter().map(|&at| region[at as usize].clone()).collect();
                region.iter_mut().zip(sorted).for_each(|(op, sorted)| *op = sorted);
            }
        }
    }

    /// Finds the order of the operations of a region.
    fn find_order(&mut self, ops: &[Op]) {
        self.find_edges(ops);
        self.find_followers();
        let Self { waiting, followers, order, .. } = self;
        order.clear();
        let mut before: Option<u32> = None;
        // The first that is left has no pending predecessor, as all depend on earlier ones.
        let mut earliest = 0;
        while order.len() < ops.len() {
            while waiting[earliest].done {
                earliest += 1;
            }
            let behind = |at: u32| {
                let Waiting { first, end, .. } = waiting[at as usize];
                &followers[first as usize..end as usize]
            };
            let goes_on = before.and_then(|before| {
                let result = result(&ops[before as usize])?;
                let is_ready = |at: u32| waiting[at as usize].count == 0 && !waiting[at as usize].done;
                let mut behind = behind(before).iter().copied();
                behind.find(|&at| is_ready(at) && reads(&ops[at as usize], result))
            });
            let next = goes_on.unwrap_or(earliest as u32);
            order.push(next);
            let Waiting { first, end, .. } = waiting[next as usize];
            waiting[next as usize].done = true;
            for &follower in &followers[first as usize..end as usize] {
                waiting[follower as usize].count -= 1;
            }
            // A masked copy leaves the value that it copies in the accumulator.
            let copies = |op: &Op| matches!(op, Op::Memory(memory::MemoryOp::MoveMasked { .. }));
            if goes_on.is_none() || !copies(&ops[next as usize]) {
                before = Some(next);
            }
        }
    }

    /// Finds what each operation depends on: the operations that wrote what it reads, and those
    /// that read or wrote what it writes.
    fn find_edges(&mut self, ops: &[Op]) {
        let Self { registers, touched, readers, edges, waiting, .. } = self;
        edges.clear();
        readers.clear();
        waiting.clear();
        waiting.resize(ops.len(), Waiting { count: 0, first: 0, end: 0, last: NONE, done: false });
        for (at, op) in (0..).zip(ops) {
            if is_idle(op) {
                continue;
            }
            let mut wait = |earlier: u32| {
                if earlier != NONE && earlier != at {
                    let entry = &mut waiting[earlier as usize];
                    // Once, however many registers they have in common.
                    if std::mem::replace(&mut entry.last, at) != at {
                        entry.end += 1;
                        edges.push((at, earlier));
                    }
                }
            };
            // Regular operations report their reads before their writes.
            op.accesses(|access| match access {
                Access::Read(first, count) => {
                    for register in first.0..first.0 + count {
                        touched.push(register);
                        let register = &mut registers[register as usize];
                        wait(register.written);
                        readers.push((at, register.read));
                        register.read = readers.len() as u32 - 1;
                    }
                }
                Access::Write(first, count) => {
                    for register in first.0..first.0 + count {
                        touched.push(register);
                        let register = &mut registers[register as usize];
                        wait(std::mem::replace(&mut register.written, at));
                        let mut next = std::mem::replace(&mut register.read, NONE);
                        while let Some(&(reader, before)) = readers.get(next as usize) {
                            wait(reader);
                            next = before;
                        }
                    }
                }
                Access::Effect => {}
            });
        }
        touched.drain(..).for_each(|register| registers[register as usize] = RegisterUse::UNTOUCHED);
    }

    /// Groups the operations that wait by what they wait for.
    fn find_followers(&mut self) {
        let Self { edges, waiting, followers, .. } = self;
        let mut first = 0;
        for waiting in waiting.iter_mut() {
            let count = waiting.end;
            (waiting.first, waiting.end) = (first, first);
            first += count;
        }
        followers.clear();
        followers.resize(edges.len(), NONE);
        for &(later, earlier) in edges.iter() {
            let end = &mut waiting[earlier as usize].end;
            followers[*end as usize] = later;
            *end += 1;
            waiting[later as usize].count += 1;
        }
    }
}

/// The register of an operation's result, if it is a single one.
fn result(op: &Op) -> Option<Reg> {
    match *op {
        Op::LaneKernel { kernel, to, .. } => (kernel.words == 1).then_some(to),
        Op::Memory(memory::MemoryOp::Move { to, .. }) => Some(to),
        // The lanes that do not run keep what the register has.
        Op::Memory(memory::MemoryOp::MoveMasked { from, .. }) => Some(from),
        _ => None,
    }
}

/// Whether an operation reads a register.
fn reads(op: &Op, wanted: Reg) -> bool {
    let mut found = false;
    op.accesses(|access| found |= access == Access::Read(wanted, 1));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ops::arithmetic::{FAdd, FMul};

    fn kernel(family: &'static crate::ops::lane_kernel::OpFamily, to: u32, a: u32, b: u32) -> Op {
        let kernel = family.kernel(32).expect("a kernel of 32 bits");
        Op::LaneKernel { kernel, to: Reg(to), from: [Reg(a), Reg(b), Reg(a)] }
    }

    fn store(to: u32, from: u32) -> Op {
        Op::Memory(memory::MemoryOp::MoveMasked { to: Reg(to), from: Reg(from) })
    }

    #[test]
    fn an_operation_follows_the_one_whose_result_it_reads() {
        // x * x + z and y * y + z, as a compiler emits them that works by components.
        let mut ops = [
            kernel(&FMul, 10, 0, 0),
            kernel(&FMul, 11, 1, 1),
            kernel(&FAdd, 12, 10, 2),
            kernel(&FAdd, 13, 11, 2),
        ];
        let expected = [ops[0].clone(), ops[2].clone(), ops[1].clone(), ops[3].clone()];
        Schedule::new(20).order(&mut ops);
        assert_eq!(ops, expected);
    }

    #[test]
    fn reads_and_writes_of_a_row_keep_their_order() {
        // Register 1 is a variable: what is read of it before the store stays before.
        let mut ops =
            [kernel(&FMul, 10, 0, 0), kernel(&FAdd, 11, 1, 1), store(1, 10), kernel(&FAdd, 12, 1, 11)];
        let expected = [ops[0].clone(), ops[1].clone(), ops[2].clone(), ops[3].clone()];
        Schedule::new(20).order(&mut ops);
        assert_eq!(ops, expected);
    }

    #[test]
    fn irregular_operations_stay_where_they_are() {
        let mut ops = [
            kernel(&FMul, 10, 0, 0),
            kernel(&FMul, 11, 1, 1),
            Op::Barrier,
            kernel(&FAdd, 12, 10, 2),
            kernel(&FAdd, 13, 11, 2),
        ];
        let expected = ops.clone();
        Schedule::new(20).order(&mut ops);
        assert_eq!(ops, expected);
    }
}
