//! Instruction scheduling: orders the regular operations between two irregular ones so that each
//! uses the result of the preceding one, if possible. The value then stays in the accumulator of
//! superinstructions ([`crate::ops::superop`]) and need not be stored and loaded.
//!
//! A regular operation neither traps nor stops, and has no effect except on the registers that it
//! writes. Every order that keeps the order of the reads and writes of each register gives the same
//! results.

use crate::machine::Reg;
use crate::ops::access::Access;
use crate::ops::op::Op;

/// No operation, or the end of a linked list.
const NONE: u32 = u32::MAX;

/// A list scheduler; its memory is reused for each superblock.
pub(super) struct ListScheduler {
    /// By register: the operation of this region that wrote it last, and those that have read it
    /// since.
    registers: Vec<RegisterUse>,
    /// The registers that operations of this region access.
    accessed: Vec<u32>,
    /// Operations that read a register, each linked to the previous reader.
    readers: Vec<(u32, u32)>,
    /// The edges of the dependency graph: an operation, and an earlier one that it depends on.
    edges: Vec<(u32, u32)>,
    /// The nodes of the dependency graph, by operation.
    nodes: Vec<DependencyNode>,
    /// The successors of all nodes, grouped by node.
    successors: Vec<u32>,
    /// The operations in their new order.
    order: Vec<u32>,
}

#[derive(Clone, Copy)]
struct RegisterUse {
    written: u32,
    /// An index into `readers`.
    read: u32,
}

impl RegisterUse {
    const UNUSED: Self = Self { written: NONE, read: NONE };
}

/// An operation as a node of the dependency graph.
#[derive(Clone, Copy)]
struct DependencyNode {
    /// The number of predecessors that are not scheduled yet.
    pending: u32,
    /// The range of its successors in `successors`.
    first: u32,
    end: u32,
    /// The successor that was found last.
    last: u32,
    /// Whether it is scheduled.
    done: bool,
}

impl ListScheduler {
    /// Makes a scheduler for programs with so many registers.
    pub(super) fn new(registers: u32) -> Self {
        Self {
            registers: vec![RegisterUse::UNUSED; registers as usize],
            accessed: Vec::new(),
            readers: Vec::new(),
            edges: Vec::new(),
            nodes: Vec::new(),
            successors: Vec::new(),
            order: Vec::new(),
        }
    }

    /// Orders the operations of a superblock.
    pub(super) fn order(&mut self, ops: &mut [Op]) {
        let regular = |op: &Op| op.writes_all_lanes() || op.copy().is_some();
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
        self.find_successors();
        let Self { nodes, successors, order, .. } = self;
        order.clear();
        let mut previous: Option<u32> = None;
        // The first operation that is left is ready, as all depend on earlier ones.
        let mut earliest = 0;
        while order.len() < ops.len() {
            while nodes[earliest].done {
                earliest += 1;
            }
            let successors_of = |at: u32| {
                let DependencyNode { first, end, .. } = nodes[at as usize];
                &successors[first as usize..end as usize]
            };
            let chained = previous.and_then(|previous| {
                let result = result(&ops[previous as usize])?;
                let is_ready = |at: u32| nodes[at as usize].pending == 0 && !nodes[at as usize].done;
                let mut candidates = successors_of(previous).iter().copied();
                candidates.find(|&at| is_ready(at) && reads(&ops[at as usize], result))
            });
            let next = chained.unwrap_or(earliest as u32);
            order.push(next);
            let DependencyNode { first, end, .. } = nodes[next as usize];
            nodes[next as usize].done = true;
            for &successor in &successors[first as usize..end as usize] {
                nodes[successor as usize].pending -= 1;
            }
            // A masked copy leaves the value that it copies in the accumulator.
            let copies = |op: &Op| op.copy().is_some_and(|copy| copy.is_masked);
            if chained.is_none() || !copies(&ops[next as usize]) {
                previous = Some(next);
            }
        }
    }

    /// Finds what each operation depends on: the operations that wrote what it reads, and those
    /// that read or wrote what it writes.
    fn find_edges(&mut self, ops: &[Op]) {
        let Self { registers, accessed, readers, edges, nodes, .. } = self;
        edges.clear();
        readers.clear();
        nodes.clear();
        nodes.resize(ops.len(), DependencyNode { pending: 0, first: 0, end: 0, last: NONE, done: false });
        for (at, op) in (0..).zip(ops) {
            if op.is_noop() {
                continue;
            }
            let mut depend_on = |earlier: u32| {
                if earlier != NONE && earlier != at {
                    let entry = &mut nodes[earlier as usize];
                    // One edge, however many registers they have in common.
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
                        accessed.push(register);
                        let register = &mut registers[register as usize];
                        depend_on(register.written);
                        readers.push((at, register.read));
                        register.read = readers.len() as u32 - 1;
                    }
                }
                Access::Write(first, count) => {
                    for register in first.0..first.0 + count {
                        accessed.push(register);
                        let register = &mut registers[register as usize];
                        depend_on(std::mem::replace(&mut register.written, at));
                        let mut next = std::mem::replace(&mut register.read, NONE);
                        while let Some(&(reader, previous)) = readers.get(next as usize) {
                            depend_on(reader);
                            next = previous;
                        }
                    }
                }
                Access::Effect => {}
            });
        }
        accessed.drain(..).for_each(|register| registers[register as usize] = RegisterUse::UNUSED);
    }

    /// Groups the successors of each node.
    fn find_successors(&mut self) {
        let Self { edges, nodes, successors, .. } = self;
        let mut first = 0;
        for node in nodes.iter_mut() {
            let count = node.end;
            (node.first, node.end) = (first, first);
            first += count;
        }
        successors.clear();
        successors.resize(edges.len(), NONE);
        for &(later, earlier) in edges.iter() {
            let end = &mut nodes[earlier as usize].end;
            successors[*end as usize] = later;
            *end += 1;
            nodes[later as usize].pending += 1;
        }
    }
}

/// The register of an operation's result, if it is a single one.
fn result(op: &Op) -> Option<Reg> {
    match *op {
        Op::LaneKernel { kernel, to, .. } => (kernel.words == 1).then_some(to),
        // Of a masked copy not its own register, in which lanes that do not run keep their values.
        _ => op.copy().map(|copy| if copy.is_masked { copy.from } else { copy.to }),
    }
}

/// Whether an operation reads a register.
fn reads(op: &Op, wanted: Reg) -> bool {
    let mut found = false;
    op.accesses(|access| found |= access == Access::Read(wanted, 1));
    found
}

#[cfg(test)]
mod tests;
