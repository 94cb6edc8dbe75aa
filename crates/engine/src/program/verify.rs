//! Checks what a pass of the optimizer has done (translation validation).
//!
//! Both versions of a program are executed symbolically, superblock by superblock, for a lane that
//! runs through it. They must have equal effects in the same order, with equal operands, take the
//! same branch at the end, and leave equal values in every register that is live there. Liveness is
//! computed here independently of the passes. Registers that are live beyond a superblock may be
//! renamed, no two to the same register. No other operation may write these in all lanes, because
//! lanes that wait elsewhere would lose their values.
//!
//! Debug builds check every pass of every program, as do the tests.

use std::fmt;
use std::ops::Range;

use rustc_hash::{FxHashMap, FxHashSet};

use crate::machine::{BlockIndex, Reg};
use crate::ops::access::Access;
use crate::ops::op::Op;
use crate::ops::superop::SuperCode;
use crate::ops::symbolic::{ImplicitRegisters, State, ValueTable};
use crate::program::copy_propagation::for_each_terminator_read;
use crate::program::{Block, Program, Superblock, Terminator};

/// Programs of more operations are not checked.
const MAX_OPERATIONS: usize = 20_000;
/// Programs whose operations access more registers together are not checked either. Each may access
/// all registers that code outside the program, or a computed index, can access.
const MAX_ACCESSES: usize = 1 << 22;

/// A program between two passes.
#[derive(Clone, Debug)]
pub struct Version {
    /// The operations.
    pub ops: Vec<Op>,
    /// The blocks.
    pub blocks: Vec<Block>,
    /// Registers that hold constants.
    pub constants: Vec<(Reg, u32)>,
}

impl Version {
    /// A program in the version that observers run.
    pub fn of(program: &Program) -> Self {
        Self {
            ops: program.ops.clone(),
            blocks: program.blocks.clone(),
            constants: program.constants.clone(),
        }
    }
}

/// The blocks of a superblock.
#[derive(Clone, Copy, Debug)]
struct SuperblockSpan {
    /// The first block.
    first: BlockIndex,
    /// The last block, whose terminator ends the superblock.
    last: BlockIndex,
}

impl SuperblockSpan {
    /// The operations of the superblock, in the version of the program that has these blocks.
    fn operations(self, blocks: &[Block]) -> Range<usize> {
        blocks[self.first.index()].first.index()..blocks[self.last.index()].end.index()
    }
}

impl fmt::Display for SuperblockSpan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "blocks ({}, {})", self.first, self.last)
    }
}

/// The state of a program before a pass, with which the result of the pass is compared.
#[derive(Debug)]
pub struct Verifier {
    before: Version,
    /// The superblocks, in the order of their blocks.
    superblocks: Vec<SuperblockSpan>,
    implicit: ImplicitRegisters,
    /// The registers that have a value where the program begins.
    defined: FxHashSet<Reg>,
    /// The registers that the caller reads where the program ends.
    results: Vec<Reg>,
    /// Registers that are live where a superblock begins or ends.
    global: Vec<Reg>,
    /// By superblock: the registers that are live at its end.
    live_out: Vec<FxHashSet<Reg>>,
}

impl Verifier {
    /// Records a program before a pass; `known` has, by block, the superblock that begins with it.
    ///
    /// `None` if the program is too large to be checked.
    pub fn new(program: &Program, addressed: &[(Reg, u32)], known: Option<&[Superblock]>) -> Option<Self> {
        if program.ops.len() > MAX_OPERATIONS {
            return None;
        }
        let before = Version::of(program);
        let mut superblocks = Vec::new();
        let mut at = BlockIndex(0);
        while at.index() < before.blocks.len() {
            let last = known.map_or(at, |known| known[at.index()].last);
            superblocks.push(SuperblockSpan { first: at, last });
            at = last.plus(1);
        }
        let registers = |first: Reg, count: u32| (first.0..first.0 + count).map(Reg);
        let whole_variable = |&(first, count): &(Reg, u32)| {
            let holds =
                |&&(start, registers): &&(Reg, u32)| (start.0..start.0 + registers).contains(&first.0);
            program.variables.iter().find(holds).copied().unwrap_or((first, count))
        };
        let mut implicit = ImplicitRegisters::default();
        implicit
            .addressed
            .extend(addressed.iter().map(whole_variable).flat_map(|(first, count)| registers(first, count)));
        // A table of constants is never written.
        implicit.addressed.retain(|reg| !program.constants.iter().any(|(constant, _)| constant == reg));
        implicit.addressed.sort_unstable();
        implicit.addressed.dedup();
        let interface = program.interface.iter().flat_map(|one| registers(one.first, one.count));
        let inputs = program.inputs.iter().flat_map(|one| registers(one.first, one.count));
        implicit.written_by_pipeline.extend(interface.chain(inputs));
        implicit.written_by_pipeline.sort_unstable();
        implicit.written_by_pipeline.dedup();
        let variables = program.variables.iter().flat_map(|&(first, count)| registers(first, count));
        let defined = variables.chain(implicit.written_by_pipeline.iter().copied()).collect();
        let results = program.interface.iter().filter(|one| one.storage_class >= 5328);
        let results: Vec<Reg> = results.flat_map(|one| registers(one.first, one.count)).collect();
        implicit.read_by_pipeline.clone_from(&results);
        let registers =
            implicit.read_by_pipeline.len() + implicit.addressed.len() + implicit.written_by_pipeline.len();
        let named = before.ops.iter().map(accessed_registers).fold(0, usize::saturating_add);
        if registers.saturating_mul(before.ops.len()).saturating_add(named) > MAX_ACCESSES {
            return None;
        }
        let mut verifier = Self {
            before,
            superblocks,
            implicit,
            defined,
            results,
            global: Vec::new(),
            live_out: Vec::new(),
        };
        verifier.find_liveness();
        Some(verifier)
    }

    /// The transfer function of a superblock: computes what is live at its beginning, given what is
    /// live at its end. An operation that has no effect and whose results are dead reads nothing.
    fn transfer(&self, superblock: SuperblockSpan, live: &mut FxHashSet<Reg>) {
        let terminator = &self.before.blocks[superblock.last.index()].terminator;
        for_each_terminator_read(terminator, |reg| {
            live.insert(reg);
        });
        for op in self.before.ops[superblock.operations(&self.before.blocks)].iter().rev() {
            let mut needed = false;
            op.accesses(|access| match access {
                Access::Effect => needed = true,
                Access::Write(first, count) => {
                    needed |= (first.0..first.0 + count).any(|reg| live.contains(&Reg(reg)));
                }
                Access::Read(..) => {}
            });
            if !needed {
                continue;
            }
            op.accesses(|access| {
                if let Access::Write(first, count) = access {
                    (first.0..first.0 + count).for_each(|reg| {
                        live.remove(&Reg(reg));
                    });
                }
            });
            op.accesses(|access| {
                if let Access::Read(first, count) = access {
                    live.extend((first.0..first.0 + count).map(Reg));
                }
            });
            if op.stops() {
                live.extend(&self.implicit.read_by_pipeline);
            }
            if op.reaches_addressed().0 {
                live.extend(&self.implicit.addressed);
            }
        }
        self.before.constants.iter().for_each(|(reg, _)| {
            live.remove(reg);
        });
        // What computed indices can address is live everywhere.
        live.extend(&self.implicit.addressed);
    }

    fn find_liveness(&mut self) {
        let blocks = &self.before.blocks;
        let starts: FxHashMap<BlockIndex, usize> =
            self.superblocks.iter().enumerate().map(|(at, superblock)| (superblock.first, at)).collect();
        let returns: Vec<usize> = blocks
            .iter()
            .filter_map(|block| match block.terminator {
                Terminator::Call { return_to, .. } => Some(starts[&return_to]),
                _ => None,
            })
            .collect();
        let successors = |last: BlockIndex| match &blocks[last.index()].terminator {
            Terminator::Branch(to) => vec![starts[to]],
            Terminator::BranchConditional { then, other, .. } => vec![starts[then], starts[other]],
            Terminator::Switch { cases, default, .. } => {
                cases.iter().map(|(_, to)| to).chain([default]).map(|to| starts[to]).collect()
            }
            Terminator::Call { function, return_to } => vec![starts[function], starts[return_to]],
            // A return may go to any call.
            Terminator::Return => returns.clone(),
            Terminator::Exit(_) | Terminator::Unreachable => Vec::new(),
        };
        let count = self.superblocks.len();
        let mut live_in: Vec<FxHashSet<Reg>> = vec![FxHashSet::default(); count];
        let mut live_out = live_in.clone();
        let mut changed = true;
        while std::mem::take(&mut changed) {
            for at in (0..count).rev() {
                let superblock = self.superblocks[at];
                let mut live: FxHashSet<Reg> = self.implicit.addressed.iter().copied().collect();
                if let Terminator::Exit(_) = blocks[superblock.last.index()].terminator {
                    live.extend(&self.results);
                }
                successors(superblock.last)
                    .into_iter()
                    .for_each(|successor| live.extend(&live_in[successor]));
                live_out[at].clone_from(&live);
                self.transfer(superblock, &mut live);
                if live != live_in[at] {
                    (live_in[at], changed) = (live, true);
                }
            }
        }
        let mut global: Vec<Reg> = live_in.iter().chain(&live_out).flatten().copied().collect();
        global.sort_unstable();
        global.dedup();
        (self.global, self.live_out) = (global, live_out);
    }

    /// Compares the program after a pass with the one before. `renamed` returns the new name of a
    /// register that is live beyond a superblock.
    ///
    /// # Errors
    /// What differs, and where.
    pub fn compare(&self, after: &Version, renamed: &dyn Fn(Reg) -> Reg) -> Result<(), String> {
        let constants: FxHashMap<Reg, u32> = self.before.constants.iter().copied().collect();
        let known: FxHashMap<Reg, u32> = after.constants.iter().copied().collect();
        // By new register: the register that is renamed to it.
        let mut owners: FxHashMap<Reg, Reg> = FxHashMap::default();
        for &reg in self.global.iter().chain(&self.results).chain(&self.implicit.written_by_pipeline) {
            let now = renamed(reg);
            if let Some(other) = owners.insert(now, reg).filter(|&other| other != reg) {
                return Err(format!("r{} holds both r{} and r{}", now.0, other.0, reg.0));
            }
            if known.contains_key(&now) && !constants.contains_key(&reg) {
                return Err(format!("r{} holds r{} and a constant", now.0, reg.0));
            }
            if now != reg && self.defined.contains(&reg) {
                return Err(format!("r{} begins with a value and is r{} now", reg.0, now.0));
            }
        }
        let initial_before = |reg: Reg, table: &mut ValueTable| match constants.get(&reg) {
            Some(&word) => table.constant(word),
            None => table.initial(reg),
        };
        let initial_after = |reg: Reg, table: &mut ValueTable| match (known.get(&reg), owners.get(&reg)) {
            (Some(&word), _) => table.constant(word),
            (None, Some(&owner)) => table.initial(owner),
            (None, None) => table.undefined(reg),
        };
        for (at, &superblock) in self.superblocks.iter().enumerate() {
            let mut table = ValueTable::new();
            let mut old = State::new(&initial_before, &self.implicit);
            let mut new = State::new(&initial_after, &self.implicit);
            for op in &self.before.ops[superblock.operations(&self.before.blocks)] {
                old.execute(op, &mut table);
            }
            for op in &after.ops[superblock.operations(&after.blocks)] {
                if let Some(constant) = written_constant(op, &known) {
                    return Err(format!("{op:?} writes r{}, which holds a constant", constant.0));
                }
                new.execute(op, &mut table);
            }
            let place = |what: &str| format!("{superblock}: {what}");
            if old.effects.len() != new.effects.len() {
                return Err(place(&format!("{} effects, not {}", new.effects.len(), old.effects.len())));
            }
            if let Some(effect) = old.effects.iter().zip(&new.effects).position(|(old, new)| old != new) {
                let [old, new] = [&old, &new].map(|state| &state.effects[effect].operands);
                let operand = old.iter().zip(new).position(|(old, new)| old != new);
                let [old, new] = match operand {
                    Some(at) => table.difference(old[at], new[at]),
                    None => [old.len(), new.len()].map(|count| format!("{count} operands")),
                };
                return Err(place(&format!("effect {effect}, operand {operand:?}: {new}, not {old}")));
            }
            let reads = |block: &Block| {
                let mut regs = Vec::new();
                for_each_terminator_read(&block.terminator, |reg| regs.push(reg));
                regs
            };
            let [was, is] =
                [&self.before.blocks, &after.blocks].map(|blocks| reads(&blocks[superblock.last.index()]));
            let mut pairs: Vec<(String, Reg, Reg)> = was
                .into_iter()
                .zip(is)
                .map(|(was, is)| ("the terminator's operand".to_owned(), was, is))
                .collect();
            for &reg in &self.live_out[at] {
                pairs.push((format!("r{} (r{} now)", reg.0, renamed(reg).0), reg, renamed(reg)));
            }
            for (what, was, is) in pairs {
                let (old, new) = (old.get(was, &mut table), new.get(is, &mut table));
                if old != new {
                    let [was, is] = table.difference(old, new);
                    return Err(place(&format!("{what} holds {is}, not {was}")));
                }
            }
            let allowed: FxHashSet<Reg> = old.written_in_all_lanes.iter().map(|&reg| renamed(reg)).collect();
            if let Some(reg) =
                new.written_in_all_lanes.iter().find(|reg| owners.contains_key(reg) && !allowed.contains(reg))
            {
                return Err(place(&format!(
                    "r{} is written in all lanes, while others may wait with it",
                    reg.0
                )));
            }
        }
        Ok(())
    }

    /// Compares superinstructions with the operations that they replace; `after` and `renamed` as
    /// for [`Verifier::compare`].
    ///
    /// # Errors
    /// What differs, and where.
    pub fn compare_supercode(
        &self,
        after: &Version,
        renamed: &dyn Fn(Reg) -> Reg,
        supercode: &SuperCode,
    ) -> Result<(), String> {
        let known: FxHashMap<Reg, u32> = after.constants.iter().copied().collect();
        let seen: FxHashSet<Reg> = self.global.iter().chain(&self.results).map(|&reg| renamed(reg)).collect();
        let initial_before = |reg: Reg, table: &mut ValueTable| match known.get(&reg) {
            Some(&word) => table.constant(word),
            None => table.initial(reg),
        };
        for &superblock in &self.superblocks {
            let mut table = ValueTable::new();
            let state = State::new(&initial_before, &self.implicit);
            let range = superblock.operations(&after.blocks);
            let is_seen = |reg: Reg| seen.contains(&reg);
            supercode
                .verify(&after.ops, range, &state, &mut table, &is_seen)
                .map_err(|problem| format!("{superblock}: {problem}"))?;
        }
        Ok(())
    }
}

/// The number of registers that an operation names.
fn accessed_registers(op: &Op) -> usize {
    let mut registers = 0;
    op.accesses(|access| match access {
        Access::Read(_, count) | Access::Write(_, count) => registers += count as usize,
        Access::Effect => {}
    });
    registers
}

/// A register that an operation writes although it holds a constant.
fn written_constant(op: &Op, constants: &FxHashMap<Reg, u32>) -> Option<Reg> {
    if op.is_noop() {
        return None;
    }
    let mut found = None;
    op.accesses(|access| {
        if let Access::Write(first, count) = access {
            found = found.or((first.0..first.0 + count).map(Reg).find(|reg| constants.contains_key(reg)));
        }
    });
    found
}

#[cfg(test)]
mod tests;
