//! Dead-code elimination: removes operations, builtins and constants that nothing reads.
//!
//! The shader compilers leave unused access chains and undefined values behind. Eliminating them
//! also means that an index which is out of bounds but never used does not trap.

use crate::machine::{OpIndex, Reg};
use crate::ops::access::Access;
use crate::ops::op::Op;
use crate::program::Program;
use crate::program::copy_propagation::for_each_terminator_read;

/// The end of a linked list.
const NONE: u32 = u32::MAX;

/// Marks the operations and registers that are live, from the last operation to the first.
struct LivenessMarker<'a> {
    ops: &'a [Op],
    /// By operation: whether it is needed.
    needed: Vec<bool>,
    /// By register: whether it is live.
    live: Vec<bool>,
    /// By register: a linked list of the visited operations that write it, as long as it is not
    /// live. This is the list's head, an index into `unread_writers`.
    unread_head: Vec<u32>,
    /// Entries of the lists: an operation and the next entry.
    unread_writers: Vec<(OpIndex, u32)>,
    /// Operations whose reads are not marked yet.
    worklist: Vec<OpIndex>,
}

impl<'a> LivenessMarker<'a> {
    fn new(program: &'a Program) -> Self {
        let registers = program.register_count as usize + 1;
        Self {
            ops: &program.ops,
            needed: vec![false; program.ops.len()],
            live: vec![false; registers],
            unread_head: vec![NONE; registers],
            unread_writers: Vec::with_capacity(2 * program.ops.len()),
            worklist: Vec::new(),
        }
    }

    /// Marks registers as read.
    #[inline]
    fn read(&mut self, first: Reg, count: u32) {
        for register in first.0..first.0 + count {
            let register = register as usize;
            if !std::mem::replace(&mut self.live[register], true) {
                let mut next = self.unread_head[register];
                while let Some(&(op, after)) = self.unread_writers.get(next as usize) {
                    self.worklist.push(op);
                    next = after;
                }
            }
        }
    }

    /// Marks all live operations, after the registers that are read elsewhere are marked;
    /// operations for which `stores` is false are dead.
    fn mark(&mut self, stores: Option<&[bool]>) {
        let ops = self.ops;
        for (at, op) in ops.iter().enumerate().rev() {
            if stores.is_some_and(|stores| !stores[at]) {
                continue;
            }
            let mut needed = false;
            let Self { live, unread_head, unread_writers, .. } = self;
            op.accesses(
                #[inline(always)]
                |access| match access {
                    Access::Write(first, count) => {
                        let registers = first.0 as usize..(first.0 + count) as usize;
                        for register in registers {
                            if live[register] {
                                needed = true;
                            } else {
                                unread_writers.push((OpIndex::new(at), unread_head[register]));
                                unread_head[register] = unread_writers.len() as u32 - 1;
                            }
                        }
                    }
                    Access::Effect => needed = true,
                    Access::Read(..) => {}
                },
            );
            self.worklist.extend(needed.then_some(OpIndex::new(at)));
            while let Some(at) = self.worklist.pop() {
                if std::mem::replace(&mut self.needed[at.index()], true) {
                    continue;
                }
                ops[at.index()].accesses(|access| {
                    if let Access::Read(first, count) = access {
                        self.read(first, count);
                    }
                });
            }
        }
    }
}

/// Removes operations whose results are not read. `addressed` are registers that computed register
/// numbers can address; operations for which `stores` is false are dead. Also finds whether the
/// remaining program depends on the order of invocations.
pub fn eliminate_dead_code(program: &mut Program, addressed: &[(Reg, u32)], stores: Option<&[bool]>) {
    let mut marker = LivenessMarker::new(program);
    for &(first, count) in addressed {
        // A computed index may address every register of the variable.
        let holds = |&&(start, registers): &&(Reg, u32)| (start.0..start.0 + registers).contains(&first.0);
        let (first, count) = program.variables.iter().find(holds).copied().unwrap_or((first, count));
        marker.read(first, count);
    }
    // The caller of this program reads payload, attributes and callable data.
    for interface in program.interface.iter().filter(|registers| registers.storage_class >= 5328) {
        marker.read(interface.first, interface.count);
    }
    for block in &program.blocks {
        for_each_terminator_read(&block.terminator, |reg| marker.read(reg, 1));
    }
    marker.mark(stores);
    let LivenessMarker { needed, live, .. } = marker;
    program.inputs.retain(|input| (0..input.count).any(|word| live[(input.first.0 + word) as usize]));
    // Every atomic operation has an effect, and is kept.
    program.order_dependent =
        program.ops.iter().any(|op| op.order_dependent(&|register| live[register.0 as usize]));
    remove(program, &needed);
    program.uses_subgroups = program.ops.iter().any(Op::needs_subgroup);
    program.addresses_records = program.ops.iter().any(Op::addresses_record);
}

/// Removes the operations that are not needed and adjusts the blocks' ranges.
fn remove(program: &mut Program, needed: &[bool]) {
    let mut kept_before = Vec::with_capacity(needed.len() + 1);
    let mut count = 0;
    for &needed in needed {
        kept_before.push(OpIndex(count));
        count += u32::from(needed);
    }
    kept_before.push(OpIndex(count));
    for block in &mut program.blocks {
        block.first = kept_before[block.first.index()];
        block.end = kept_before[block.end.index()];
    }
    let mut keep = needed.iter();
    program.ops.retain(|_| *keep.next().expect("bug in anyhit: an operation that is neither live nor dead"));
    // The origins of terminators follow those of operations.
    let mut keep = needed.iter();
    program.origins.retain(|_| *keep.next().unwrap_or(&true));
    debug_assert!(!program.ops.iter().any(Op::is_noop));
}

#[cfg(test)]
mod tests;
