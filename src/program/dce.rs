//! Dead-code elimination: removes operations, builtins and constants that nothing reads.
//!
//! The shader compilers leave unused access chains and undefined values behind. Eliminating them
//! also means that an index which is out of bounds but never used does not trap.

use crate::machine::Reg;
use crate::ops::op::{Access, Op};
use crate::ops::{memory, ray_tracing};
use crate::program::Program;
use crate::program::copy_propagation::each_read;

/// No entry.
const NONE: u32 = u32::MAX;

/// The operations and registers that are needed, found from the last operation to the first.
struct Needs<'a> {
    ops: &'a [Op],
    /// By operation.
    needed: Vec<bool>,
    /// By register: whether it is live.
    live: Vec<bool>,
    /// By register: the operations passed so far that write it and whose results are not read
    /// later. `last` has the last of them, `passed` for each entry the one before.
    last: Vec<u32>,
    passed: Vec<(u32, u32)>,
    /// Operations whose reads are not marked yet.
    work: Vec<u32>,
}

impl<'a> Needs<'a> {
    fn new(program: &'a Program) -> Self {
        let registers = program.register_count as usize + 1;
        Self {
            ops: &program.ops,
            needed: vec![false; program.ops.len()],
            live: vec![false; registers],
            last: vec![NONE; registers],
            passed: Vec::with_capacity(2 * program.ops.len()),
            work: Vec::new(),
        }
    }

    /// Marks registers as read.
    fn read(&mut self, first: Reg, count: u32) {
        for register in first.0..first.0 + count {
            let register = register as usize;
            if register < self.live.len() && !std::mem::replace(&mut self.live[register], true) {
                let mut next = self.last[register];
                while let Some(&(op, before)) = self.passed.get(next as usize) {
                    self.work.push(op);
                    next = before;
                }
            }
        }
    }

    /// Marks what is needed, after the registers that others read; operations for which `stores` is
    /// false are not.
    fn find(&mut self, stores: Option<&[bool]>) {
        let ops = self.ops;
        for (at, op) in ops.iter().enumerate().rev() {
            if stores.is_some_and(|stores| !stores[at]) {
                continue;
            }
            let mut needed = false;
            let Self { live, last, passed, .. } = self;
            op.accesses(
                #[inline(always)]
                |access| match access {
                    Access::Write(first, count) => {
                        let registers = first.0 as usize..(first.0 + count) as usize;
                        for (&live, last) in live[registers.clone()].iter().zip(&mut last[registers]) {
                            if live {
                                needed = true;
                            } else {
                                passed.push((at as u32, *last));
                                *last = passed.len() as u32 - 1;
                            }
                        }
                    }
                    Access::Effect => needed = true,
                    Access::Read(..) => {}
                },
            );
            self.work.extend(needed.then_some(at as u32));
            while let Some(at) = self.work.pop() {
                if std::mem::replace(&mut self.needed[at as usize], true) {
                    continue;
                }
                ops[at as usize].accesses(|access| {
                    if let Access::Read(first, count) = access {
                        self.read(first, count);
                    }
                });
            }
        }
    }
}

/// Removes operations whose results are not read; `addressed` are registers that computed register
/// numbers reach, an operation for which `stores` is false is of no use. Also finds whether the
/// rest depends on the order of invocations.
pub fn eliminate_dead_code(program: &mut Program, addressed: &[(Reg, u32)], stores: Option<&[bool]>) {
    let mut needs = Needs::new(program);
    for &(first, count) in addressed {
        // A computed index may reach every register of the variable.
        let holds = |&&(start, registers): &&(Reg, u32)| (start.0..start.0 + registers).contains(&first.0);
        let (first, count) = program.variables.iter().find(holds).copied().unwrap_or((first, count));
        needs.read(first, count);
    }
    // The caller of this program reads payload, attributes and callable data.
    for interface in program.interface.iter().filter(|registers| registers.storage_class >= 5328) {
        needs.read(interface.first, interface.count);
    }
    for block in &program.blocks {
        each_read(&block.terminator, |reg| needs.read(reg, 1));
    }
    needs.find(stores);
    let Needs { needed, live, .. } = needs;
    program.inputs.retain(|input| (0..input.count).any(|word| live[(input.first.0 + word) as usize]));
    program.order_dependent = program.ops.iter().zip(&needed).any(|(op, &kept)| match op {
        Op::Atomic(op) if kept => {
            op.order_dependent((0..op.words()).any(|word| live[(op.to.0 + word) as usize]))
        }
        _ => false,
    });
    remove(program, &needed);
    program.uses_subgroups = program.ops.iter().any(|op| matches!(op, Op::Subgroup(_)));
    let addresses = |op: &Op| matches!(op, Op::Stop(ray_tracing::RayTracingOp::HitObjectRecordHandle { .. }));
    program.addresses_records = program.ops.iter().any(addresses);
}

/// Removes the operations that are not needed and adjusts the blocks' ranges.
fn remove(program: &mut Program, needed: &[bool]) {
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
    // The origins of terminators follow those of operations.
    let mut keep = needed.iter();
    program.origins.retain(|_| *keep.next().unwrap_or(&true));
    let is_noop = |op: &Op| matches!(op, Op::Memory(memory::MemoryOp::Move { to, from }) if to == from);
    debug_assert!(!program.ops.iter().any(is_noop));
}
