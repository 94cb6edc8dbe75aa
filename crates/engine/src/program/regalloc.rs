//! Register allocation for superblocks, and the passes that go with it.
//!
//! Lowering gives every value a register of its own, where an observer may read it at any later
//! time. Batches without an observer run a copy of the operations, [`OptimizedCode`], made here:
//!
//! * basic blocks that only follow one another form a [`Superblock`];
//! * a local value (or variable: written and then read within one superblock, as a single register)
//!   gets a register whose previous value has had its last use, so that the registers of a batch
//!   stay in the L1 cache;
//! * copies of such values are propagated to their uses;
//! * regular operations are scheduled so that each uses the result of the one before it, where
//!   possible ([`crate::program::schedule`]).
//!
//! All other values keep their registers, so that everything outside (constants, interfaces,
//! loop-carried values, terminators) is unchanged. Operations that can trap keep their indices, by
//! which traps name them.

mod direct_registers;

use std::ops::Range;

use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::SmallVec;

use crate::machine::{BlockIndex, OpIndex, Reg};
use crate::ops::access::{Access, OperandKind, RegCopy};
use crate::ops::bit;
use crate::ops::conversion::{self, Conversion};
use crate::ops::op::Op;
use crate::ops::superop::{ResultUse, SuperCode, takes_float};
use crate::program::copy_propagation::{AliasedRegisters, for_each_terminator_read};
use crate::program::schedule::ListScheduler;
use crate::program::{Program, Terminator};
use direct_registers::{rename_constants, rename_values};

/// The operations of a program as batches without an observer run them.
#[derive(Clone, Debug, Default)]
pub struct OptimizedCode {
    /// One for each of [`Program::ops`].
    pub ops: Vec<Op>,
    /// The operations as superinstructions; `None` in programs that are not optimised.
    pub supercode: Option<SuperCode>,
    /// One for each of [`Program::blocks`].
    pub superblocks: Vec<Superblock>,
    /// Those of [`Program::watched`] that may hold other values, or whose values other registers
    /// hold. How often they are written does not tell: another value may be written as often.
    pub reassigned: Vec<Reg>,
}

/// Basic blocks that follow each other without a branch: one entry, one exit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Superblock {
    /// One past the last operation.
    pub end: OpIndex,
    /// The last block, whose terminator ends the superblock.
    pub last: BlockIndex,
}

/// Makes the [`OptimizedCode`] of a program. Returns, by register, the one that now holds its
/// value, if that outlives a superblock.
pub(super) fn allocate_registers(program: &mut Program, addressed: &[(Reg, u32)]) -> Vec<Reg> {
    let superblocks = superblocks(program);
    let superblock_starts = superblock_starts(program, &superblocks);
    let mut ops = program.ops.clone();
    let aliased = AliasedRegisters::of(program, addressed);
    let values = LocalValues::of(program, &mut ops, &superblock_starts, &aliased);
    for op in &mut ops {
        // All lanes that read such a value later in the superblock are running now.
        if let Some(RegCopy { to, from, is_masked: true }) = op.copy()
            && values.is_local(to)
        {
            *op = Op::copy_of(to, from);
        }
    }
    let mut written = vec![0u32; program.register_count as usize];
    let mut copies = Copies::new(program.register_count);
    for &(start, superblock) in &superblock_starts {
        let superblock = ops_of(program, start, superblock);
        propagate_local_copies(&mut ops, superblock, &values, &aliased, &mut written, &mut copies);
    }
    // Tables by register are large: the passes below reuse their memory.
    drop((written, copies));
    for &(start, superblock) in &superblock_starts {
        let superblock = ops_of(program, start, superblock);
        use_signed_conversions(&mut ops[superblock], &program.constants);
    }
    let mut scheduler = ListScheduler::new(program.register_count);
    for &(start, superblock) in &superblock_starts {
        scheduler.order(&mut ops[ops_of(program, start, superblock)]);
    }
    drop(scheduler);
    let freed = values.freed_registers();
    let mut reassigned: Vec<Reg> = Vec::new();
    if !program.watched.is_empty() {
        let watched: FxHashSet<Reg> = program.watched.iter().copied().collect();
        reassigned.extend(freed.iter().filter(|reg| watched.contains(reg)));
    }
    let mut pool = RegisterPool::new(program.register_count, freed);
    let mut expired: SmallVec<[Reg; 4]> = SmallVec::new();
    // By value: its assigned register, and the last operation that uses it.
    let mut assigned = vec![Reg(0); program.register_count as usize];
    let mut last_use = vec![OpIndex(0); program.register_count as usize];
    for &(start, superblock) in &superblock_starts {
        let superblock = ops_of(program, start, superblock);
        for at in superblock.clone() {
            ops[at].visit_single_registers(|reg, _| last_use[reg.0 as usize] = OpIndex::new(at));
        }
        for at in superblock {
            let op = &mut ops[at];
            if op.is_noop() {
                continue;
            }
            op.visit_single_registers(|reg, kind| {
                let value = reg.0 as usize;
                if kind == OperandKind::Use && values.is_local(*reg) {
                    *reg = assigned[value];
                    if last_use[value] == OpIndex::new(at) && !expired.contains(reg) {
                        expired.push(*reg);
                    }
                }
            });
            // A regular operation reads all lanes before it writes one, so its result may have the
            // register of an operand whose last use it is.
            if op.writes_all_lanes() {
                pool.free.extend(expired.drain(..));
            }
            op.visit_single_registers(|reg, kind| {
                let value = reg.0 as usize;
                if kind == OperandKind::Def && values.is_local(*reg) {
                    *reg = pool.take();
                    assigned[value] = *reg;
                    if last_use[value] == OpIndex::new(at) {
                        expired.push(*reg);
                    }
                }
            });
            pool.free.extend(expired.drain(..));
        }
    }
    let result_uses = result_uses(program, &mut ops, &superblock_starts, &pool);
    let (taken, renamed) = rename_values(program, &mut ops, &pool, &aliased, &values);
    rename_constants(program, &mut ops, &pool, &taken);
    let moved = |reg: &&Reg| renamed.get(reg.0 as usize).is_some_and(|to| to != *reg);
    reassigned.extend(program.watched.iter().filter(moved));
    program.register_count = pool.next;
    let ranges = superblock_starts.iter().map(|&(start, superblock)| ops_of(program, start, superblock));
    let supercode = SuperCode::of(&ops, ranges, &result_uses, &program.constants);
    program.optimized = OptimizedCode { supercode: Some(supercode), ops, superblocks, reassigned };
    renamed
}

/// Replaces conversions of unsigned integers to floats by conversions of signed ones if the
/// integers were shifted to the right, and so are less than 2^31. The floats are equal, and
/// processors have an instruction for signed ones only.
fn use_signed_conversions(ops: &mut [Op], constants: &[(Reg, u32)]) {
    let cast = |from| conversion::kernel(from, 32, 32);
    let (Some(unsigned), Some(signed)) = (cast(Conversion::UToF), cast(Conversion::SToF)) else { return };
    if !ops.iter().any(|op| matches!(op, Op::LaneKernel { kernel, .. } if std::ptr::eq(*kernel, unsigned))) {
        return;
    }
    let amounts: FxHashSet<Reg> =
        constants.iter().filter(|(_, word)| (1..32).contains(word)).map(|&(reg, _)| reg).collect();
    let mut written: FxHashMap<Reg, usize> = FxHashMap::default();
    for at in 0..ops.len() {
        if let Op::LaneKernel { kernel, from: [from, ..], .. } = ops[at]
            && std::ptr::eq(kernel, unsigned)
            && let Some(&Op::LaneKernel { kernel: shift, from: [_, by, _], .. }) =
                written.get(&from).map(|&by| &ops[by])
            && bit::ShiftRightLogical.kernel(32).is_some_and(|known| std::ptr::eq(known, shift))
            && amounts.contains(&by)
            && let Op::LaneKernel { kernel, .. } = &mut ops[at]
        {
            *kernel = signed;
        }
        ops[at].accesses(|access| {
            if let Access::Write(first, count) = access {
                (first.0..first.0 + count).for_each(|register| {
                    written.insert(Reg(register), at);
                });
            }
        });
    }
}

/// How each operation's result is used: for a result in a register of the pool, the operations that
/// read it until the register is written again.
///
/// The registers are those after allocation. A copy that got the register of its original is a
/// no-op, and the uses of the copy read the original.
fn result_uses(
    program: &Program,
    ops: &mut [Op],
    superblock_starts: &[(BlockIndex, Superblock)],
    pool: &RegisterPool,
) -> Vec<ResultUse> {
    const NO_DEFINITION: OpIndex = OpIndex(u32::MAX);
    let mut result_uses = vec![ResultUse::UNKNOWN; ops.len()];
    // By register: the operation that defines its value.
    let mut definition = vec![NO_DEFINITION; pool.next as usize];
    for &(start, superblock) in superblock_starts {
        for at in ops_of(program, start, superblock) {
            let op = &mut ops[at];
            if op.is_noop() {
                continue;
            }
            let kernel = match op {
                Op::LaneKernel { kernel, .. } => Some(*kernel),
                _ => None,
            };
            let mut operand = 0;
            op.visit_single_registers(|reg, kind| {
                if kind == OperandKind::Use {
                    if let Some(result_use) = result_uses.get_mut(definition[reg.0 as usize].index()) {
                        result_use.reads = result_use.reads.map(|reads| reads + 1);
                        result_use.nan_payload_observed |=
                            !kernel.is_some_and(|kernel| takes_float(kernel, operand));
                    }
                    operand += 1;
                }
            });
            let defines = op.writes_all_lanes();
            op.visit_single_registers(|reg, kind| {
                if kind == OperandKind::Def && pool.is_pooled(*reg) {
                    definition[reg.0 as usize] = if defines { OpIndex::new(at) } else { NO_DEFINITION };
                    if defines {
                        result_uses[at] = ResultUse { reads: Some(0), nan_payload_observed: false };
                    }
                }
            });
        }
    }
    result_uses
}

/// By block: the superblock that begins with it.
pub(super) fn superblocks(program: &Program) -> Vec<Superblock> {
    let blocks = &program.blocks;
    let mut predecessor_counts = vec![0u32; blocks.len() + 1];
    let mut count = |block: BlockIndex| predecessor_counts[block.index()] += 1;
    for block in blocks {
        match &block.terminator {
            Terminator::Branch(to) => count(*to),
            Terminator::BranchConditional { then, other, .. } => {
                [*then, *other].into_iter().for_each(&mut count)
            }
            Terminator::Switch { cases, default, .. } => {
                count(*default);
                cases.iter().for_each(|&(_, to)| count(to));
            }
            Terminator::Call { function, return_to } => {
                [*function, *return_to].into_iter().for_each(&mut count);
            }
            Terminator::Return | Terminator::Exit(_) | Terminator::Unreachable => {}
        }
    }
    let mut superblocks: Vec<Superblock> =
        (0..).map(BlockIndex).zip(blocks).map(|(last, block)| Superblock { end: block.end, last }).collect();
    for at in (0..blocks.len().saturating_sub(1)).rev() {
        let next = &blocks[at + 1];
        let falls_through = blocks[at].terminator == Terminator::Branch(BlockIndex::new(at + 1));
        if falls_through && predecessor_counts[at + 1] == 1 && next.first == blocks[at].end {
            superblocks[at] = superblocks[at + 1];
        }
    }
    superblocks
}

/// The blocks at which superblocks begin, each with its superblock; they partition the blocks.
fn superblock_starts(program: &Program, superblocks: &[Superblock]) -> Vec<(BlockIndex, Superblock)> {
    let mut superblock_starts = Vec::new();
    let mut at = 0;
    while at < program.blocks.len() {
        superblock_starts.push((BlockIndex::new(at), superblocks[at]));
        at = superblocks[at].last.index() + 1;
    }
    superblock_starts
}

/// The operations of a superblock that begins at a block.
fn ops_of(program: &Program, start: BlockIndex, superblock: Superblock) -> Range<usize> {
    program.blocks[start.index()].first.index()..superblock.end.index()
}

/// What a register is a copy of: another register as it was before operation `at`.
#[derive(Clone, Copy)]
struct CopySource {
    at: u32,
    from: Reg,
    /// Whether the copy equals its original wherever it is read.
    is_valid: bool,
}

/// The copies in local values, found by the register of the copy. Those of other superblocks are in
/// nobody's way, as only one superblock names a local value.
struct Copies {
    entries: Vec<CopySource>,
    /// By register: the index of its copy in `entries` plus one; 0 if it is no copy.
    indices: Vec<u32>,
}

impl Copies {
    fn new(registers: u32) -> Self {
        Self { entries: Vec::new(), indices: vec![0; registers as usize] }
    }

    fn find(&mut self, reg: Reg) -> Option<&mut CopySource> {
        let index = self.indices[reg.0 as usize].checked_sub(1)?;
        Some(&mut self.entries[index as usize])
    }

    fn insert(&mut self, reg: Reg, copy: CopySource) {
        match self.find(reg) {
            Some(known) => *known = copy,
            None => {
                self.entries.push(copy);
                self.indices[reg.0 as usize] = self.entries.len() as u32;
            }
        }
    }
}

/// Makes the operations of a superblock read the originals of local values that are copies; copies
/// without uses then become no-ops. `written` has, for each register, the operation that wrote it
/// last, or 0 if none did: no copy stands before that one.
fn propagate_local_copies(
    ops: &mut [Op],
    superblock: Range<usize>,
    values: &LocalValues,
    aliased: &AliasedRegisters,
    written: &mut [u32],
    copies: &mut Copies,
) {
    let copies_all_lanes = |op: &Op| op.copy().is_some_and(|copy| !copy.is_masked);
    if !ops[superblock.clone()].iter().any(copies_all_lanes) {
        return;
    }
    // The last stop for the pipeline, or 0 before it.
    let mut stopped = 0;
    // First find the copies that equal their originals whenever they are read, then rename.
    for at in superblock.clone() {
        let op = &mut ops[at];
        let at = at as u32;
        op.visit_single_registers(|reg, kind| {
            if let (OperandKind::Use, Some(copy)) = (kind, copies.find(*reg)) {
                let stopped = if values.is_local(copy.from) { 0 } else { stopped };
                copy.is_valid &= written[copy.from.0 as usize].max(stopped) <= copy.at;
            }
        });
        op.accesses(|access| {
            if let Access::Write(first, count) = access {
                (first.0..first.0 + count).for_each(|register| written[register as usize] = at);
            }
        });
        if op.stops() {
            stopped = at;
        } else if let Some(RegCopy { to, from, is_masked: false }) = op.copy()
            && values.is_local(to)
        {
            let is_valid = values.is_written_once(to) && !aliased.contains(from);
            // A copy of a copy is a copy of the first original.
            let from = copies.find(from).filter(|copy| copy.is_valid).map_or(from, |copy| copy.from);
            copies.insert(to, CopySource { at, from, is_valid });
        }
    }
    for at in superblock {
        let op = &mut ops[at];
        op.visit_single_registers(|reg, kind| {
            if let (OperandKind::Use, Some(&mut CopySource { from, is_valid: true, .. })) =
                (kind, copies.find(*reg))
            {
                *reg = from;
            }
        });
        if let Some(RegCopy { to, from, is_masked: false }) = op.copy()
            && copies.find(to).is_some_and(|copy| copy.is_valid && copy.at as usize == at)
        {
            *op = Op::copy_of(from, from);
        }
    }
}

/// The pool of registers that local values share, a stack: the register that was freed last is
/// taken next. At first the lowest is taken, so that superinstructions have few extended registers.
struct RegisterPool {
    /// The number of the next new register.
    next: u32,
    free: Vec<Reg>,
    /// The number of free registers that have never been taken.
    never_taken: usize,
    /// By register: whether it has been taken.
    taken: Vec<bool>,
}

impl RegisterPool {
    fn new(next: u32, free: Vec<Reg>) -> Self {
        Self { next, never_taken: free.len(), free, taken: vec![false; next as usize] }
    }

    fn take(&mut self) -> Reg {
        let free = self.free.pop();
        self.never_taken = self.never_taken.min(self.free.len());
        let reg = free.unwrap_or_else(|| {
            self.next += 1;
            self.taken.push(false);
            Reg(self.next - 1)
        });
        self.taken[reg.0 as usize] = true;
        reg
    }

    /// Whether a register has been taken from the pool.
    fn is_pooled(&self, reg: Reg) -> bool {
        self.taken[reg.0 as usize]
    }

    fn never_taken(&self) -> &[Reg] {
        &self.free[..self.never_taken]
    }
}

/// Which registers hold values that live within one superblock.
struct LocalValues(Vec<RegisterUses>);

/// How a register is accessed.
#[derive(Clone)]
struct RegisterUses {
    /// The first block of the superblock that defines it first.
    defining_block: BlockIndex,
    /// The number of accesses by operands of several registers, or that may not be renamed for
    /// another reason.
    grouped_accesses: u32,
    /// How many operations write it; 2 stands for more.
    writes: u8,
    /// Whether it is written and then read in one superblock only, by operands that may be renamed.
    local: bool,
}

impl LocalValues {
    fn of(
        program: &Program,
        ops: &mut [Op],
        superblock_starts: &[(BlockIndex, Superblock)],
        aliased: &AliasedRegisters,
    ) -> Self {
        const NO_BLOCK: BlockIndex = BlockIndex(u32::MAX);
        let initial = |register| RegisterUses {
            defining_block: NO_BLOCK,
            grouped_accesses: 0,
            writes: 0,
            local: !aliased.contains(Reg(register)),
        };
        let mut registers: Vec<RegisterUses> = (0..program.register_count).map(initial).collect();
        program.constants.iter().for_each(|&(reg, _)| registers[reg.0 as usize].local = false);
        for &(start, superblock) in superblock_starts {
            for op in &mut ops[ops_of(program, start, superblock)] {
                op.accesses(|access| {
                    let (Access::Read(first, count) | Access::Write(first, count)) = access else { return };
                    let write = matches!(access, Access::Write(..));
                    for register in &mut registers[first.0 as usize..(first.0 + count) as usize] {
                        register.grouped_accesses = register.grouped_accesses.wrapping_add(1);
                        register.writes = (register.writes + u8::from(write)).min(2);
                        if register.defining_block == NO_BLOCK && write {
                            register.defining_block = start;
                        }
                        register.local &= register.defining_block == start;
                    }
                });
                op.visit_single_registers(|reg, _| {
                    let register = &mut registers[reg.0 as usize];
                    register.grouped_accesses = register.grouped_accesses.wrapping_sub(1);
                });
            }
        }
        for block in &program.blocks {
            for_each_terminator_read(&block.terminator, |reg| registers[reg.0 as usize].local = false);
        }
        registers.iter_mut().for_each(|register| register.local &= register.grouped_accesses == 0);
        Self(registers)
    }

    /// Whether a register holds a local value. New registers of the pool do not: they come after
    /// all others.
    fn is_local(&self, reg: Reg) -> bool {
        self.0.get(reg.0 as usize).is_some_and(|register| register.local)
    }

    /// The registers of local values, which are free once these share registers; the lowest last.
    fn freed_registers(&self) -> Vec<Reg> {
        let registers = (0..self.0.len() as u32).zip(&self.0).rev();
        registers
            .filter(|(_, register)| register.local && register.writes > 0)
            .map(|(register, _)| Reg(register))
            .collect()
    }

    fn is_written_once(&self, reg: Reg) -> bool {
        self.0[reg.0 as usize].writes == 1
    }

    /// Whether all accesses of a register are operands that may be renamed.
    fn is_renameable(&self, reg: Reg) -> bool {
        self.0[reg.0 as usize].grouped_accesses == 0
    }
}

#[cfg(test)]
mod tests;
