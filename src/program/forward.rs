//! Takes moves away that lowering leaves behind: copies of rows that can be read where they are, and
//! stores to variables that nothing reads any more.
//!
//! Shader compilers keep locals in variables. Within a block the decoder has forwarded what is
//! stored to what is loaded; what remains is a load that copies a variable's row, and the store
//! itself, often dead.
//!
//! Both passes follow one lane. A masked store to a row is, for a lane that runs it, a whole write,
//! and nothing at all for the others; so the ordinary rules hold, lane by lane.

use std::collections::HashMap;

use crate::machine::Reg;
use crate::ops::memory;
use crate::ops::op::{Access, Op};
use crate::program::prune::remove;
use crate::program::{Program, Terminator};

/// More bits of liveness than this are not worth their memory.
const MOST_BITS: usize = 1 << 28;

/// Rows that the program's operations do not fully account for.
pub(super) struct Shared(Vec<bool>);

impl Shared {
    /// Rows of interface variables, of inputs, and of variables with computed row numbers.
    pub fn of(program: &Program, addressed: &[(Reg, u32)]) -> Self {
        let mut shared = vec![false; program.rows as usize + 1];
        let interface = program.interface.iter().map(|rows| (rows.first, rows.count));
        let inputs = program.inputs.iter().map(|rows| (rows.first, rows.count));
        for (first, count) in interface.chain(inputs).chain(addressed.iter().copied()) {
            let holds = |&&(start, rows): &&(Reg, u32)| (start.0..start.0 + rows).contains(&first.0);
            let (first, count) = program.variables.iter().find(holds).copied().unwrap_or((first, count));
            for row in first.0..first.0 + count {
                shared[row as usize] = true;
            }
        }
        Self(shared)
    }

    pub fn holds(&self, reg: Reg) -> bool {
        self.0[reg.0 as usize]
    }
}

/// Lets operations read a variable's row itself, where its copy serves this block alone; what nobody
/// reads then is left to `prune`.
pub fn forward_copies(program: &mut Program, addressed: &[(Reg, u32)]) {
    let shared = Shared::of(program, addressed);
    // How often a row is written, and read: by operations and terminators alike.
    let mut writes = vec![0u32; program.rows as usize + 1];
    let mut reads = vec![0u32; program.rows as usize + 1];
    for op in &program.ops {
        op.accesses(|access| match access {
            Access::Write(first, count) => {
                (first.0..first.0 + count).for_each(|row| writes[row as usize] += 1)
            }
            Access::Read(first, count) => (first.0..first.0 + count).for_each(|row| reads[row as usize] += 1),
            Access::Effect => {}
        });
    }
    for block in &program.blocks {
        each_read(&block.terminator, |reg| reads[reg.0 as usize] += 1);
    }
    for block in &mut program.blocks {
        // Each copy that is still the same as its original, and the reads that it has left.
        let mut copies: HashMap<Reg, Reg> = HashMap::new();
        for at in block.first as usize..block.end as usize {
            if !copies.is_empty() {
                let op = &mut program.ops[at];
                each_single(op, |reg| {
                    if let Some(&original) = copies.get(reg) {
                        reads[reg.0 as usize] -= 1;
                        reads[original.0 as usize] += 1;
                        *reg = original;
                    }
                });
                let mut written: Vec<(Reg, u32)> = Vec::new();
                op.accesses(|access| {
                    if let Access::Write(first, count) = access {
                        written.push((first, count));
                    }
                });
                let lost = |reg: &Reg| {
                    written.iter().any(|&(first, count)| (first.0..first.0 + count).contains(&reg.0))
                };
                copies.retain(|copy, original| !lost(copy) && !lost(original));
                if let Op::Stop(_) = op {
                    // The pipeline may write what it likes meanwhile.
                    copies.clear();
                }
            }
            if let Op::Memory(memory::Op::Move { to, from }) = program.ops[at]
                && writes[to.0 as usize] == 1
                && !shared.holds(to)
                && !shared.holds(from)
            {
                copies.insert(to, from);
            }
        }
        match &mut block.terminator {
            Terminator::BranchConditional { condition: reg, .. }
            | Terminator::Switch { selector: reg, wide: false, .. } => {
                *reg = copies.get(reg).copied().unwrap_or(*reg);
            }
            _ => {}
        }
    }
}

/// The rows that a terminator reads.
pub(super) fn each_read(terminator: &Terminator, mut visit: impl FnMut(Reg)) {
    match *terminator {
        Terminator::BranchConditional { condition, .. } => visit(condition),
        Terminator::Switch { selector, wide, .. } => {
            visit(selector);
            if wide {
                visit(selector.plus(1));
            }
        }
        _ => {}
    }
}

/// The operands of an operation that are one row each, wherever it lies.
fn each_single(op: &mut Op, mut visit: impl FnMut(&mut Reg)) {
    match op {
        Op::Row { row, from, .. } => {
            for (reg, &words) in from.iter_mut().zip(&row.operands) {
                if words == 1 {
                    visit(reg);
                }
            }
        }
        Op::Memory(memory::Op::Move { from, .. } | memory::Op::MoveMasked { from, .. }) => visit(from),
        Op::Memory(memory::Op::Index { base, index, .. }) => {
            visit(index);
            base.iter_mut().for_each(visit);
        }
        _ => {}
    }
}

/// Removes masked stores to rows that no lane reads before it writes them again.
pub fn drop_dead_stores(program: &mut Program, addressed: &[(Reg, u32)]) {
    let shared = Shared::of(program, addressed);
    // Only rows that are stored to take part: each has a bit.
    let mut bits: HashMap<Reg, usize> = HashMap::new();
    for op in &program.ops {
        if let Op::Memory(memory::Op::MoveMasked { to, .. }) = op
            && !shared.holds(*to)
        {
            let next = bits.len();
            bits.entry(*to).or_insert(next);
        }
    }
    let words = bits.len().div_ceil(64);
    if bits.is_empty() || words * 64 * program.blocks.len() > MOST_BITS {
        return;
    }
    let each_bit = |first: Reg, count: u32, visit: &mut dyn FnMut(usize)| {
        for row in first.0..first.0 + count {
            if let Some(&bit) = bits.get(&Reg(row)) {
                visit(bit);
            }
        }
    };
    // Runs backwards over a block from what is live behind it.
    let before = |program: &Program, block: usize, live: &mut [u64], dead: &mut dyn FnMut(usize)| {
        let block = &program.blocks[block];
        each_read(&block.terminator, |reg| {
            each_bit(reg, 1, &mut |bit| live[bit / 64] |= 1 << (bit % 64));
        });
        for at in (block.first as usize..block.end as usize).rev() {
            let op = &program.ops[at];
            if let Op::Memory(memory::Op::MoveMasked { to, .. }) = op
                && let Some(&bit) = bits.get(to)
                && live[bit / 64] >> (bit % 64) & 1 == 0
            {
                dead(at);
                continue;
            }
            op.accesses(|access| {
                if let Access::Write(first, count) = access {
                    each_bit(first, count, &mut |bit| live[bit / 64] &= !(1 << (bit % 64)));
                }
            });
            op.accesses(|access| {
                if let Access::Read(first, count) = access {
                    each_bit(first, count, &mut |bit| live[bit / 64] |= 1 << (bit % 64));
                }
            });
        }
    };
    let count = program.blocks.len();
    let mut entry = vec![vec![0u64; words]; count];
    let mut changed = true;
    while changed {
        changed = false;
        for block in (0..count).rev() {
            let mut live = behind(&program.blocks[block].terminator, &entry, words);
            before(program, block, &mut live, &mut |_| {});
            if live != entry[block] {
                entry[block] = live;
                changed = true;
            }
        }
    }
    let mut needed = vec![true; program.ops.len()];
    for block in 0..count {
        let mut live = behind(&program.blocks[block].terminator, &entry, words);
        before(program, block, &mut live, &mut |at| needed[at] = false);
    }
    remove(program, &needed);
}

/// What is live behind a terminator.
fn behind(terminator: &Terminator, entry: &[Vec<u64>], words: usize) -> Vec<u64> {
    let mut live = vec![0u64; words];
    let mut join = |block: u32| {
        live.iter_mut().zip(&entry[block as usize]).for_each(|(live, more)| *live |= more);
    };
    match terminator {
        Terminator::Branch(to) => join(*to),
        Terminator::BranchConditional { then, other, .. } => [*then, *other].into_iter().for_each(join),
        Terminator::Switch { cases, default, .. } => {
            join(*default);
            cases.iter().for_each(|&(_, to)| join(to));
        }
        // Functions share rows with their callers.
        Terminator::Call { .. } | Terminator::Return => live.fill(u64::MAX),
        Terminator::Exit(_) | Terminator::Unreachable => {}
    }
    live
}
