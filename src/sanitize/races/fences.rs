//! Which fences stand before an atomic instruction, and which behind it: a release synchronizes
//! through an atomic instruction that it is program-ordered before, an acquire through one that it
//! is program-ordered after (Vulkan, Memory Model, "Synchronizes-With").
//!
//! Fences are followed along all paths of the control flow, those of called functions included,
//! whichever of them an invocation takes.

use rspirv::spirv::Op as Opcode;
use rustc_hash::FxHashMap;

use crate::module::interface::EntryPoint;
use crate::module::{Function, Id, Instruction, Module};
use crate::ops::atomic;
use crate::program::control_flow::block_of;
use crate::sanitize::races::class::Reach;
use crate::sanitize::races::ordering::{Ordering, scope};

/// By the offset of an atomic instruction that an entry point may execute: what the fences release
/// that may stand before it, and what those acquire that may stand behind it.
pub(super) fn around_atomics(module: &Module, entry: &EntryPoint) -> FxHashMap<u32, Ordering> {
    let flow = Flow::new(module, entry);
    if flow.sections.iter().all(|section| section.fences == Ordering::default()) {
        return FxHashMap::default();
    }
    let forward = flow.sections.iter().enumerate();
    let forward = forward.flat_map(|(at, section)| section.next.iter().map(move |&next| (at, next)));
    let backward = forward.clone().map(|(at, next)| (next, at));
    let before = flow.reaching(forward, |fences| fences.releases);
    let behind = flow.reaching(backward, |fences| fences.acquires);
    let mut around = FxHashMap::default();
    for (at, section) in flow.sections.iter().enumerate() {
        let mut releases = before[at];
        for instruction in &section.instructions {
            match instruction {
                Synchronizing::Fence(fence) => releases = releases.with(fence.releases),
                Synchronizing::Atomic(offset) => {
                    around.insert(*offset, Ordering { releases, acquires: Reach::default() });
                }
            }
        }
        let mut acquires = behind[at];
        for instruction in section.instructions.iter().rev() {
            match instruction {
                Synchronizing::Fence(fence) => acquires = acquires.with(fence.acquires),
                Synchronizing::Atomic(offset) => {
                    around.entry(*offset).or_default().acquires = acquires;
                }
            }
        }
    }
    around
}

/// An instruction that synchronizes, or lets others do so.
enum Synchronizing {
    /// A memory barrier, or a control barrier, which is one, too.
    Fence(Ordering),
    /// An atomic instruction, by its offset.
    Atomic(u32),
}

/// A part of a block that is executed as a whole: up to a call, or the end of the block.
#[derive(Default)]
struct Section {
    instructions: Vec<Synchronizing>,
    /// What its fences order.
    fences: Ordering,
    /// The sections that may come next.
    next: Vec<usize>,
}

/// The sections of all functions that an entry point calls.
struct Flow {
    sections: Vec<Section>,
}

impl Flow {
    fn new(module: &Module, entry: &EntryPoint) -> Self {
        let functions: Vec<&Function> = module
            .call_tree(entry.function)
            .into_iter()
            .map(|function| &module.functions[function as usize])
            .collect();
        let is_call = |instruction: &&Instruction| instruction.opcode == Opcode::FunctionCall as u16;
        // The first section of each block, by function and block.
        let mut firsts: FxHashMap<Id, Vec<usize>> = FxHashMap::default();
        let mut count = 0;
        for function in &functions {
            let of_blocks = function.blocks.iter().map(|block| {
                let first = count;
                count += 1 + block.instructions.iter().filter(is_call).count();
                first
            });
            firsts.insert(function.id, of_blocks.collect());
        }
        let mut sections: Vec<Section> = (0..count).map(|_| Section::default()).collect();
        let mut calls: Vec<(usize, Id)> = Vec::new();
        let mut ends: FxHashMap<Id, Vec<usize>> = FxHashMap::default();
        for function in &functions {
            for (block, &first) in function.blocks.iter().zip(&firsts[&function.id]) {
                let mut at = first;
                for instruction in &block.instructions {
                    if is_call(&instruction) {
                        let callee = module.operands(instruction).first();
                        calls.extend(callee.map(|&callee| (at, Id(callee))));
                        at += 1;
                        continue;
                    }
                    if let Some(fence) = fence(module, instruction) {
                        sections[at].fences = sections[at].fences.with(fence);
                        sections[at].instructions.push(Synchronizing::Fence(fence));
                    } else if is_atomic(instruction) {
                        sections[at].instructions.push(Synchronizing::Atomic(instruction.offset));
                    }
                }
                let Some(terminator) = block.instructions.last() else { continue };
                let targets = module.branch_targets(terminator).into_iter();
                let targets = targets.filter_map(|label| block_of(module, function, label));
                sections[at].next = targets.map(|block| firsts[&function.id][block]).collect();
                if sections[at].next.is_empty() {
                    ends.entry(function.id).or_default().push(at);
                }
            }
        }
        for (at, callee) in calls {
            match firsts.get(&callee).and_then(|blocks| blocks.first()) {
                Some(&first) => {
                    sections[at].next.push(first);
                    for &end in ends.get(&callee).into_iter().flatten() {
                        sections[end].next.push(at + 1);
                    }
                }
                None => sections[at].next.push(at + 1),
            }
        }
        Self { sections }
    }

    /// By section: a part of what the fences of the sections order from which edges lead to it.
    fn reaching(
        &self,
        edges: impl Iterator<Item = (usize, usize)> + Clone,
        part: impl Fn(Ordering) -> Reach,
    ) -> Vec<Reach> {
        let mut reaching = vec![Reach::default(); self.sections.len()];
        let mut grows = true;
        while grows {
            grows = false;
            for (from, to) in edges.clone() {
                let all = reaching[to].with(reaching[from]).with(part(self.sections[from].fences));
                grows |= all != reaching[to];
                reaching[to] = all;
            }
        }
        reaching
    }
}

/// What a memory barrier or control barrier orders; `None` of another instruction.
fn fence(module: &Module, instruction: &Instruction) -> Option<Ordering> {
    let operands = module.operands(instruction);
    let scope_at = match Opcode::from_u32(instruction.opcode.into()) {
        Some(Opcode::MemoryBarrier) => 0,
        Some(Opcode::ControlBarrier) => 1,
        _ => return None,
    };
    let semantics = operands.get(scope_at + 1).and_then(|&id| module.scalar_value(Id(id)));
    Some(Ordering::of(semantics, scope(module, operands.get(scope_at))))
}

fn is_atomic(instruction: &Instruction) -> bool {
    Opcode::from_u32(instruction.opcode.into()).is_some_and(|opcode| atomic::OPCODES.contains(&opcode))
}
