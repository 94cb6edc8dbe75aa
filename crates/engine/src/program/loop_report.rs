//! The report of a loop that has no end: where it begins, and what its variables did in its last
//! turns.

use crate::machine::{BlockIndex, LaneTrap, LoopTurns, OpIndex, Reg};
use crate::math::array;
use crate::module::ty::{Type, TypeId};
use crate::module::{Id, Module};
use crate::ops::access::Access;
use crate::ops::op::Op;
use crate::program::loop_variable::LoopVariable;
use crate::program::lower::{LowerOptions, lower_with, translate};
use crate::program::{Program, Terminator};

/// Variables that a report tells of at most: so many that changed, and so many that did not.
const MOST: usize = 8;

impl Program {
    /// What the loop did in which an invocation was stopped by a limit, from its last turns: the
    /// source line, the variables that changed and those that did not. `None` where it was stopped
    /// in no loop.
    #[doc(hidden)]
    pub fn describe_loop(&self, trap: LaneTrap, turns: &[LoopTurns]) -> Option<String> {
        let block = match self.block_of_terminator(trap.op) {
            Some(block) => block,
            None => {
                let holds = |block: &crate::program::Block| (block.first..block.end).contains(&trap.op);
                BlockIndex::new(self.blocks.iter().position(holds)?)
            }
        };
        // The outermost loop around the place that came round at least twice.
        let edges = turns.iter().filter_map(|turns| {
            let from = self.block_of_terminator(turns.op)?;
            let to = self.back_edge(from)?;
            ((to..=from).contains(&block)).then_some((turns, to, from))
        });
        let (turns, to, from) =
            edges.max_by_key(|&(turns, to, from)| (turns.count > 1, from.0 - to.0, turns.count))?;
        let header = self.origins.get(self.terminator_index(to).index())?.offset;
        let line = match (self.place_at(header), self.place_near(header)) {
            (Some(place), _) | (None, Some(place)) => {
                let line = place.file_line().map(|(file, line)| format!("{file}:{line}"));
                format!("the loop at {}", line.unwrap_or_default())
            }
            (None, None) => format!("the loop at word {header} of the module"),
        };
        let known = self.known_variables(to, from);
        let (mut changed, mut same) = (Vec::new(), Vec::new());
        for variable in known {
            let words = variable.first..variable.first + variable.count;
            let (Some(first), Some(last)) = (turns.first.get(words.clone()), turns.last.get(words)) else {
                continue;
            };
            let name = self.variable_name(variable.id);
            let value = |words: &[u32]| value(&self.module, variable.ty, words);
            if first == last {
                same.push(format!("{name} = {}", value(first)));
            } else {
                changed.push(format!("{name} changed from {} to {}", value(first), value(last)));
            }
        }
        let list = |mut all: Vec<String>| {
            let hidden = all.len().saturating_sub(MOST);
            all.truncate(MOST);
            let more = if hidden > 0 { format!(", and {hidden} more") } else { String::new() };
            format!("{}{more}", all.join(", "))
        };
        let (nothing_changed, all_changed) = (changed.is_empty(), same.is_empty());
        let turned = turns.count - 1;
        let told = match (nothing_changed, all_changed) {
            _ if turned == 0 => format!("{line} had completed one iteration when the invocation was stopped"),
            (true, true) => format!("{line}: none of its variables is known in its last {turned} iterations"),
            (true, false) => {
                format!("{line}: in its last {turned} iterations, nothing changed: {}", list(same))
            }
            (false, true) => format!("{line}: in its last {turned} iterations, {}", list(changed)),
            (false, false) => format!(
                "{line}: in its last {turned} iterations, {}; unchanged: {}",
                list(changed),
                list(same)
            ),
        };
        Some(told)
    }

    /// The block whose terminator an index is of; `None` for an operation.
    fn block_of_terminator(&self, op: OpIndex) -> Option<BlockIndex> {
        op.index().checked_sub(self.ops.len()).map(BlockIndex::new)
    }

    /// The block that a block's terminator goes back to.
    fn back_edge(&self, from: BlockIndex) -> Option<BlockIndex> {
        let mut targets: Vec<BlockIndex> = Vec::new();
        match &self.blocks.get(from.index())?.terminator {
            Terminator::Branch(to) => targets.push(*to),
            Terminator::BranchConditional { then, other, .. } => targets.extend([*then, *other]),
            Terminator::Switch { cases, default, .. } => {
                targets.extend(cases.iter().map(|(_, to)| *to).chain([*default]));
            }
            _ => {}
        }
        targets.into_iter().filter(|&to| to <= from).min()
    }

    /// The variables that the blocks of a loop use and whose registers hold their values: no pass
    /// has removed a store to them, and their registers are not shared with other values.
    fn known_variables(&self, to: BlockIndex, from: BlockIndex) -> Vec<LoopVariable> {
        let entry = self
            .module
            .entry_points
            .iter()
            .find(|entry| entry.stage == self.stage && entry.name == self.name);
        let options = LowerOptions { verify: false, ..LowerOptions::default() };
        let lowered = entry.and_then(|entry| {
            let (translated, _) = translate(&self.module, entry, options).ok()?;
            Some((translated, lower_with(&self.module, entry, options).ok()?))
        });
        let Some((translated, optimized)) = lowered else { return Vec::new() };
        if translated.loop_variables != self.loop_variables || translated.blocks.len() != self.blocks.len() {
            return Vec::new();
        }
        let registers = translated.register_count.max(optimized.register_count) as usize;
        // Between these two operations only vanish: where as many write a register, they are the
        // same.
        let stores = [&translated.ops, &optimized.ops].map(|ops| {
            let mut stores = vec![0u32; registers];
            for op in ops.iter().filter(|op| !op.is_noop()) {
                each_register(op, true, &mut |reg| {
                    if let Some(count) = stores.get_mut(reg.0 as usize) {
                        *count += 1;
                    }
                });
            }
            stores
        });
        let mut used = vec![false; registers];
        for block in &translated.blocks[to.index()..=from.index()] {
            for op in &translated.ops[block.ops()] {
                each_register(op, false, &mut |reg| {
                    if let Some(used) = used.get_mut(reg.0 as usize) {
                        *used = true;
                    }
                });
            }
        }
        let is_known = |variable: &&LoopVariable| {
            translated.watched[variable.first..variable.first + variable.count].iter().all(|reg| {
                let [all, kept] = array::map([&stores[0], &stores[1]], |of| of[reg.0 as usize]);
                used[reg.0 as usize] && all == kept && !optimized.optimized.reassigned.contains(reg)
            })
        };
        translated.loop_variables.iter().filter(is_known).copied().collect()
    }

    /// The name of a variable in the source, else its id.
    fn variable_name(&self, id: Id) -> String {
        let debug = &self.module.debug_info;
        let name = debug.variable_names.get(&id).map(|name| &**name);
        let name = name.or_else(|| debug.names.get(&id).map(String::as_str)).filter(|name| !name.is_empty());
        name.map_or_else(|| format!("%{}", id.0), |name| format!("`{name}`"))
    }
}

/// The registers that an operation writes, or all that it uses.
fn each_register(op: &Op, only_written: bool, visit: &mut dyn FnMut(Reg)) {
    op.accesses(|access| match access {
        Access::Write(first, count) => (0..count).for_each(|word| visit(first.plus(word))),
        Access::Read(first, count) if !only_written => {
            (0..count).for_each(|word| visit(first.plus(word)));
        }
        _ => {}
    });
}

/// A value as it is written in a source.
fn value(module: &Module, ty: TypeId, words: &[u32]) -> String {
    let low = words.first().copied().unwrap_or(0);
    let wide = u64::from(low) | u64::from(words.get(1).copied().unwrap_or(0)) << 32;
    match *module.ty(ty) {
        Type::Bool => (low != 0).to_string(),
        Type::Int { width, signed: true } => {
            let shift = 64 - width.clamp(1, 64);
            ((wide << shift) as i64 >> shift).to_string()
        }
        Type::Int { width: 64, .. } => wide.to_string(),
        Type::Int { .. } => low.to_string(),
        Type::Float { width: 64, .. } => f64::from_bits(wide).to_string(),
        Type::Float { width: 16, .. } => half::f16::from_bits(low as u16).to_string(),
        Type::Float { .. } => f32::from_bits(low).to_string(),
        Type::Vector { component, count } => {
            let each = words.len() / (count.max(1) as usize);
            let parts = words.chunks(each.max(1)).map(|words| value(module, component, words));
            format!("({})", parts.collect::<Vec<_>>().join(", "))
        }
        _ => String::new(),
    }
}
