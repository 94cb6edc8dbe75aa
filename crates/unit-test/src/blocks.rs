//! Counts the basic blocks that an entry point has entered.

use crate::block_counts::BlockCounts;
use anyhit_base::sorted::SortedSet;
use anyhit_engine::machine::ShaderIndex;
use anyhit_engine::module::interface::EntryPoint;
use anyhit_engine::module::{Function, Id, Module, Opcode};
use anyhit_engine::program::Program;
use anyhit_engine::program::control_flow::block_of;

/// The blocks of a module that an entry point can reach, by the word offset of their first
/// instruction, and which of them were entered.
///
/// A block of SPIR-V counts once, however many inlined copies a program has of it, and whatever
/// the values of specialization constants: a branch that they decide has two ways. A block that
/// holds `OpUnreachable` alone is none that could be entered.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Blocks {
    all: SortedSet<u32>,
    entered: SortedSet<u32>,
}

impl Blocks {
    /// Those of an entry point and of all functions that it calls; none is entered.
    pub fn of(module: &Module, entry: &EntryPoint) -> Self {
        let functions = module.call_tree(entry.function).into_iter();
        let functions = functions.map(|function| &module.functions[function as usize]);
        Self { all: functions.flat_map(|function| reachable(module, function)).collect(), ..Self::default() }
    }

    /// Adds what a program of the entry point has entered.
    pub fn enter(&mut self, program: &Program, counts: &BlockCounts, shader: ShaderIndex) {
        let ran = program.instruction_spans.iter().filter(|span| counts.entered(shader, span.block) > 0);
        for span in ran {
            self.entered.extend(self.all.range(span.first..=span.last).iter().copied());
        }
    }

    /// How many were entered.
    pub fn entered(&self) -> usize {
        self.entered.len()
    }

    /// How many there are.
    pub fn all(&self) -> usize {
        self.all.len()
    }

    /// The first instructions of those that were not entered.
    pub fn missing(&self) -> impl Iterator<Item = u32> {
        self.all.difference(&self.entered).copied()
    }
}

/// The first instructions of the blocks that a function's branches lead to.
fn reachable(module: &Module, function: &Function) -> Vec<u32> {
    let mut seen = vec![false; function.blocks.len()];
    let mut next: Vec<usize> = if function.blocks.is_empty() { Vec::new() } else { vec![0] };
    let mut found = Vec::new();
    while let Some(index) = next.pop() {
        if std::mem::replace(&mut seen[index], true) {
            continue;
        }
        let instructions = &function.blocks[index].instructions;
        let (Some(first), Some(last)) = (instructions.first(), instructions.last()) else { continue };
        if first.opcode != Opcode::Unreachable {
            found.push(first.offset);
        }
        let targets = module.branch_targets(last).into_iter();
        next.extend(targets.filter_map(|label: Id| block_of(module, function, label)));
    }
    found
}
