//! Copy propagation and dead-store elimination.
//!
//! Shader compilers keep locals in variables. Within a block the translator has forwarded stores to
//! loads. What remains is a load that copies a variable's register, and the store itself, often
//! dead: operations are made to read the variable's own register if its copy is used in one block
//! only, and stores to variables that nothing reads any more are removed.
//!
//! Both passes reason about one lane. For a lane that runs it, a masked store to a register is a
//! full write, for the others it is nothing; so the scalar rules hold, lane by lane.

use std::ops::Range;

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

use crate::machine::{BlockIndex, OpIndex, Reg};
use crate::math::array;
use crate::ops::access::{Access, OperandKind, RegCopy};
use crate::program::{Program, Terminator};

/// The most bits of liveness that are computed: more would take too much memory.
const MAX_LIVENESS_BITS: usize = 1 << 28;

/// Registers that are also accessed in ways that the operands of operations do not tell.
pub(super) struct AliasedRegisters(Vec<bool>);

impl AliasedRegisters {
    /// Registers of interface variables, of inputs, and of variables with computed register
    /// numbers.
    pub(super) fn of(program: &Program, addressed: &[(Reg, u32)]) -> Self {
        let mut aliased = vec![false; program.register_count as usize + 1];
        let interface = program.interface.iter().map(|registers| (registers.first, registers.count));
        let inputs = program.inputs.iter().map(|registers| (registers.first, registers.count));
        for (first, count) in interface.chain(inputs).chain(addressed.iter().copied()) {
            let holds =
                |&&(start, registers): &&(Reg, u32)| (start.0..start.0 + registers).contains(&first.0);
            let (first, count) = program.variables.iter().find(holds).copied().unwrap_or((first, count));
            for register in first.0..first.0 + count {
                aliased[register as usize] = true;
            }
        }
        Self(aliased)
    }

    pub(super) fn contains(&self, reg: Reg) -> bool {
        self.0[reg.0 as usize]
    }
}

/// Makes operations read a variable's register itself if its copy is used in one block only;
/// `eliminate_dead_code` then removes copies without uses.
pub(super) fn propagate_copies(program: &mut Program, addressed: &[(Reg, u32)]) {
    let aliased = AliasedRegisters::of(program, addressed);
    // By register: how many operations write it.
    let mut writes = vec![0u32; program.register_count as usize + 1];
    for op in &program.ops {
        op.accesses(|access| {
            if let Access::Write(first, count) = access {
                (first.0..first.0 + count).for_each(|register| writes[register as usize] += 1);
            }
        });
    }
    // The copies that still equal their originals, by the register of the copy.
    let mut copies: FxHashMap<Reg, Reg> = FxHashMap::default();
    for block in &mut program.blocks {
        copies.clear();
        for at in block.ops() {
            if !copies.is_empty() {
                let op = &mut program.ops[at];
                // The offset of a buffer's access was computed for it: it is no variable's copy.
                if op.accessed_chunk().is_none() {
                    op.visit_single_registers(|reg, kind| {
                        if kind == OperandKind::Use {
                            *reg = copies.get(reg).copied().unwrap_or(*reg);
                        }
                    });
                }
                let mut written: SmallVec<[(Reg, u32); 2]> = SmallVec::new();
                op.accesses(|access| {
                    if let Access::Write(first, count) = access {
                        written.push((first, count));
                    }
                });
                let overwritten = |reg: &Reg| {
                    written.iter().any(|&(first, count)| (first.0..first.0 + count).contains(&reg.0))
                };
                // The copy itself has no other write.
                copies.retain(|_, original| !overwritten(original));
                if op.calls_pipeline() {
                    // The pipeline may write any register before execution continues.
                    copies.clear();
                }
            }
            if let Some(RegCopy { to, from, is_masked: false }) = program.ops[at].copy()
                && writes[to.0 as usize] == 1
                && !aliased.contains(to)
                && !aliased.contains(from)
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

/// Visits the registers that a terminator reads.
pub fn for_each_terminator_read(terminator: &Terminator, mut visit: impl FnMut(Reg)) {
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

/// By operation: `false` for masked stores to registers that no lane reads before it writes them
/// again. `None` if there are none, or too many to tell.
pub(super) fn live_stores(program: &Program, addressed: &[(Reg, u32)]) -> Option<Vec<bool>> {
    let aliased = AliasedRegisters::of(program, addressed);
    let stores = Stores::of(program, &aliased)?;
    let count = program.blocks.len();
    let mut live = vec![0u64; stores.words];
    let mut predecessors: Vec<SmallVec<[BlockIndex; 2]>> = vec![SmallVec::new(); count];
    for (at, block) in program.blocks.iter().enumerate() {
        for_each_successor(&block.terminator, |to| predecessors[to.index()].push(BlockIndex::new(at)));
    }
    let mut live_in = LiveInSets::of(program, &stores, &predecessors);
    // The result of the last visit of each block.
    let mut needed = vec![true; program.ops.len()];
    // Blocks whose live-out set may have grown since the last visit.
    let mut stale = vec![true; count];
    let mut changed = true;
    while changed {
        changed = false;
        for block in (0..count).rev() {
            if !std::mem::take(&mut stale[block]) {
                continue;
            }
            live_in.live_out(program, block, &mut live);
            stores.transfer(block, &mut live, &mut needed);
            if live_in.set(block, &live) {
                predecessors[block].iter().for_each(|&block| stale[block.index()] = true);
                changed = true;
            }
        }
    }
    Some(needed)
}

/// Stands for a register that has no bit.
const NONE: u32 = u32::MAX;

/// The accesses of registers that have masked stores; each such register has a bit in the sets of
/// live registers.
struct Stores {
    /// The number of 64-bit words of a set.
    words: usize,
    /// The accesses, by block; within a block from the last to the first.
    events: Vec<Event>,
    /// The end of each block's events, where those of the next block begin.
    ends: Vec<usize>,
}

/// An access of a bit's register by an operation or a terminator.
#[derive(Clone, Copy)]
enum Event {
    Read(u32),
    Write(u32),
    /// A masked store by operation `at`, from a bit or [`NONE`].
    Store {
        at: OpIndex,
        to: u32,
        from: u32,
    },
}

impl Stores {
    /// `None` if nothing is stored, or if the sets would be too large.
    fn of(program: &Program, aliased: &AliasedRegisters) -> Option<Self> {
        let mut bits = vec![NONE; program.register_count as usize + 1];
        let mut used = 0;
        for op in &program.ops {
            if let Some(RegCopy { to, is_masked: true, .. }) = op.copy()
                && !aliased.contains(to)
                && bits[to.0 as usize] == NONE
            {
                bits[to.0 as usize] = used;
                used += 1;
            }
        }
        let words = (used as usize).div_ceil(64);
        if used == 0 || words * 64 * program.blocks.len() > MAX_LIVENESS_BITS {
            return None;
        }
        let mut stores = Self { words, events: Vec::new(), ends: Vec::new() };
        let mut reads: Vec<(Reg, u32)> = Vec::new();
        for block in &program.blocks {
            for_each_terminator_read(&block.terminator, |reg| stores.record(&bits, reg, 1, Event::Read));
            for at in block.ops().rev() {
                let op = &program.ops[at];
                if let Some(RegCopy { to, from, is_masked: true }) = op.copy()
                    && bits[to.0 as usize] != NONE
                {
                    let [to, from] = array::map([to, from], |reg| bits[reg.0 as usize]);
                    stores.events.push(Event::Store { at: OpIndex::new(at), to, from });
                    continue;
                }
                reads.clear();
                op.accesses(|access| match access {
                    Access::Write(first, count) => stores.record(&bits, first, count, Event::Write),
                    Access::Read(first, count) => reads.push((first, count)),
                    Access::Effect => {}
                });
                reads.iter().for_each(|&(first, count)| stores.record(&bits, first, count, Event::Read));
            }
            stores.ends.push(stores.events.len());
        }
        Some(stores)
    }

    /// By word: the first and the last block that access one of its bits.
    fn spans(&self) -> Vec<(BlockIndex, BlockIndex)> {
        let mut spans = vec![(BlockIndex(u32::MAX), BlockIndex(0)); self.words];
        let mut first = 0;
        for (block, &end) in (0..).map(BlockIndex).zip(&self.ends) {
            for event in &self.events[first..end] {
                let bits = match *event {
                    Event::Read(bit) | Event::Write(bit) => [bit, NONE],
                    Event::Store { to, from, .. } => [to, from],
                };
                for bit in bits.into_iter().filter(|&bit| bit != NONE) {
                    let (low, high) = &mut spans[bit as usize / 64];
                    (*low, *high) = (block.min(*low), block.max(*high));
                }
            }
            first = end;
        }
        spans
    }

    fn record(&mut self, bits: &[u32], first: Reg, count: u32, event: fn(u32) -> Event) {
        let bits = &bits[first.0 as usize..(first.0 + count) as usize];
        self.events.extend(bits.iter().filter(|&&bit| bit != NONE).map(|&bit| event(bit)));
    }

    /// The transfer function of a block: turns its live-out set into its live-in set. Stores to
    /// registers that are not live are not needed, and read nothing.
    fn transfer(&self, block: usize, live: &mut [u64], needed: &mut [bool]) {
        let first = if block == 0 { 0 } else { self.ends[block - 1] };
        for event in &self.events[first..self.ends[block]] {
            let word_and_bit = |bit: u32| (bit as usize / 64, 1u64 << (bit % 64));
            let (read, written) = match *event {
                Event::Read(bit) => (bit, NONE),
                Event::Write(bit) => (NONE, bit),
                Event::Store { at, to, from } => {
                    let (word, bit) = word_and_bit(to);
                    needed[at.index()] = live[word] & bit != 0;
                    if !needed[at.index()] {
                        continue;
                    }
                    (from, to)
                }
            };
            if written != NONE {
                let (word, bit) = word_and_bit(written);
                live[word] &= !bit;
            }
            if read != NONE {
                let (word, bit) = word_and_bit(read);
                live[word] |= bit;
            }
        }
    }
}

/// The live-in sets of blocks.
///
/// The sets are sparse. Bits are numbered in the order of the program, so the bits of a word are
/// accessed by few adjacent blocks. These and the loops around them are the word's span: no path
/// leaves it and returns, so the word is stored for the blocks of its span only.
struct LiveInSets {
    /// By word: the first and the last block of its span.
    spans: Vec<(BlockIndex, BlockIndex)>,
    /// By block: whether a path leads from it to a call or a return, where all registers are live.
    reaches_call: Vec<bool>,
    /// By block: where its entries in `words` begin; then the number of all entries.
    first: Vec<u32>,
    /// By block: the indices of the words that are stored for it.
    words: Vec<u32>,
    /// By entry of `words`: the live bits.
    live: Vec<u64>,
}

impl LiveInSets {
    /// Makes empty sets.
    fn of(program: &Program, stores: &Stores, predecessors: &[SmallVec<[BlockIndex; 2]>]) -> Self {
        let blocks = program.blocks.len();
        let mut loops: Vec<(BlockIndex, BlockIndex)> = Vec::new();
        for (at, block) in (0..).map(BlockIndex).zip(&program.blocks) {
            for_each_successor(&block.terminator, |to| loops.extend((to <= at).then_some((to, at))));
        }
        let mut spans = stores.spans();
        // By block: the words whose span begins there.
        let mut starting = vec![Vec::new(); blocks];
        for (word, (first, last)) in (0u32..).zip(&mut spans) {
            let mut grows = true;
            while std::mem::take(&mut grows) {
                for &(start, end) in &loops {
                    if start <= *last && end >= *first && (start < *first || end > *last) {
                        (*first, *last, grows) = (start.min(*first), end.max(*last), true);
                    }
                }
            }
            starting[first.index()].push(word);
        }
        let reaches_call = vec![false; blocks];
        let mut all = Self { spans, reaches_call, first: vec![0], words: Vec::new(), live: Vec::new() };
        let mut active: Vec<u32> = Vec::new();
        for (block, starting) in (0..).map(BlockIndex).zip(&mut starting) {
            active.append(starting);
            active.retain(|&word| all.spans[word as usize].1 >= block);
            all.words.extend(&active);
            all.first.push(all.words.len() as u32);
        }
        all.live = vec![0; all.words.len()];
        let calls =
            (0..).map(BlockIndex).zip(&program.blocks).filter(|(_, block)| all_is_live(&block.terminator));
        let mut work: Vec<BlockIndex> = calls.map(|(block, _)| block).collect();
        while let Some(block) = work.pop() {
            if !std::mem::replace(&mut all.reaches_call[block.index()], true) {
                work.extend(&predecessors[block.index()]);
            }
        }
        all
    }

    fn range(&self, block: usize) -> Range<usize> {
        self.first[block] as usize..self.first[block + 1] as usize
    }

    /// Computes the live-out set of a block, of the words that are stored for it.
    fn live_out(&self, program: &Program, block: usize, live: &mut [u64]) {
        let terminator = &program.blocks[block].terminator;
        let words = &self.words[self.range(block)];
        let begin = if all_is_live(terminator) { u64::MAX } else { 0 };
        words.iter().for_each(|&word| live[word as usize] = begin);
        for_each_successor(terminator, |to| {
            for at in self.range(to.index()) {
                live[self.words[at] as usize] |= self.live[at];
            }
            if self.reaches_call[to.index()] {
                // Words that are not stored there are not written on that path.
                for &word in words {
                    let (first, last) = self.spans[word as usize];
                    if !(first..=last).contains(&to) {
                        live[word as usize] = u64::MAX;
                    }
                }
            }
        });
    }

    /// Sets the live-in set of a block; returns whether it has changed.
    fn set(&mut self, block: usize, live: &[u64]) -> bool {
        let mut changed = false;
        for at in self.range(block) {
            let live = live[self.words[at] as usize];
            changed |= std::mem::replace(&mut self.live[at], live) != live;
        }
        changed
    }
}

/// Whether all registers are live after a terminator: functions share registers with callers.
fn all_is_live(terminator: &Terminator) -> bool {
    matches!(terminator, Terminator::Call { .. } | Terminator::Return)
}

/// Visits the successors of a terminator, except for calls.
fn for_each_successor(terminator: &Terminator, mut visit: impl FnMut(BlockIndex)) {
    match terminator {
        Terminator::Branch(to) => visit(*to),
        Terminator::BranchConditional { then, other, .. } => [*then, *other].into_iter().for_each(visit),
        Terminator::Switch { cases, default, .. } => {
            visit(*default);
            cases.iter().for_each(|&(_, to)| visit(to));
        }
        Terminator::Call { .. } | Terminator::Return | Terminator::Exit(_) | Terminator::Unreachable => {}
    }
}

#[cfg(test)]
mod tests;
