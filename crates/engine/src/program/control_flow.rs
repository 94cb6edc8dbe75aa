//! The structured order of a function's blocks, and the values that are live after their loop.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rustc_hash::FxHashSet;

use crate::module::{Definition, Function, Id, Module, Opcode};

/// The blocks of a function that can be reached, in structured order: a merge block comes after
/// everything that it merges, a continue target after the loop's body, a loop's merge block after
/// the loop.
///
/// It is the reverse postorder of a depth-first search that visits merge block and continue target
/// before the other successors.
pub fn structured_order(module: &Module, function: &Function) -> Vec<usize> {
    let mut seen = vec![false; function.blocks.len()];
    let mut order = Vec::with_capacity(function.blocks.len());
    // The blocks on the path from the first one, and where their successors begin among all blocks
    // that are still to be visited.
    let mut open: Vec<(u32, u32)> = Vec::new();
    let mut next: Vec<u32> = Vec::new();
    if !function.blocks.is_empty() {
        next.push(0);
    }
    loop {
        let base = open.last().map_or(0, |&(_, base)| base as usize);
        if next.len() > base
            && let Some(block) = next.pop()
        {
            let block = block as usize;
            if !std::mem::replace(&mut seen[block], true) {
                open.push((block as u32, next.len() as u32));
                push_successors(module, function, block, &mut next);
            }
        } else if let Some((block, _)) = open.pop() {
            order.push(block as usize);
        } else {
            break;
        }
    }
    order.reverse();
    order
}

/// Pushes the successors of a block on a stack: the targets of its branch, then continue target and
/// merge block, which are thus popped first.
fn push_successors(module: &Module, function: &Function, block: usize, next: &mut Vec<u32>) {
    let instructions = &function.blocks[block].instructions;
    let mut push = |id: Id| next.extend(block_of(module, function, id).map(|block| block as u32));
    if let Some(terminator) = instructions.last() {
        module.branch_targets(terminator).into_iter().for_each(&mut push);
    }
    if let Some(merge) = instructions.iter().rev().nth(1) {
        let labels = match merge.opcode {
            Opcode::LoopMerge => 2,
            Opcode::SelectionMerge => 1,
            _ => 0,
        };
        module.operands(merge).iter().take(labels).rev().for_each(|&id| push(Id(id)));
    }
}

/// The index of a function's block, by its label.
#[inline]
pub fn block_of(module: &Module, function: &Function, label: Id) -> Option<usize> {
    let Some(Definition::Label(_, block)) = module.definition(label) else { return None };
    // The label may be that of another function.
    function.blocks.get(block as usize).filter(|block| block.label == label)?;
    Some(block as usize)
}

/// The values that are used after the loop in which they are computed.
///
/// A lane that has left a loop waits while others run further iterations, and an operation writes
/// all lanes. So such a value needs a register of its own that is written for the running lanes
/// only.
pub fn escaping_values(module: &Module, function: &Function, order: &[usize]) -> FxHashSet<Id> {
    let mut position_of_block = vec![usize::MAX; function.blocks.len()];
    for (position, &block) in order.iter().enumerate() {
        position_of_block[block] = position;
    }
    let position_of = |label: Id| block_of(module, function, label).map(|block| position_of_block[block]);
    // By position: the end of the innermost loop around it. The nearest end comes first, as loops
    // of a hostile module need not nest.
    let mut loop_ends = vec![usize::MAX; order.len()];
    let mut open: BinaryHeap<Reverse<usize>> = BinaryHeap::new();
    for (position, &block) in order.iter().enumerate() {
        while open.peek().is_some_and(|&Reverse(end)| end <= position) {
            open.pop();
        }
        let merge = function.blocks[block].instructions.iter().rev().nth(1);
        if let Some(merge) = merge.filter(|merge| merge.opcode == Opcode::LoopMerge) {
            let end = module.operands(merge).first().and_then(|&id| position_of(Id(id)));
            // If the merge block is unreachable, the loop ends with the function.
            let end = end.filter(|&end| end > position && end != usize::MAX).unwrap_or(order.len());
            open.push(Reverse(end));
        }
        loop_ends[position] = open.peek().map_or(usize::MAX, |&Reverse(end)| end);
    }
    let mut escaping = FxHashSet::default();
    // Before the end of the first loop no value escapes.
    let Some(&first_end) = loop_ends.iter().min().filter(|&&end| end != usize::MAX) else { return escaping };
    let this = module.definition(function.id);
    let escapes = |id: Id, position: usize| {
        matches!(module.definition(id), Some(Definition::Result(index, block, _))
            if this == Some(Definition::Function(index))
                && loop_ends.get(position_of_block[block as usize]).is_some_and(|&end| position >= end))
    };
    for (position, &block) in order.iter().enumerate().skip(first_end) {
        for instruction in &function.blocks[block].instructions {
            // A quick check that takes all operand words for ids.
            let may = |&word: &u32| escapes(Id(word), position);
            if instruction.opcode != Opcode::Phi && module.operands(instruction).iter().any(may) {
                let ids = module.operand_ids(instruction).into_iter();
                escaping.extend(ids.filter(|&id| escapes(id, position)));
            }
        }
    }
    let has_back_edge = |from: usize| {
        let terminator = function.blocks[order[from]].instructions.last();
        let targets = terminator.map(|terminator| module.branch_targets(terminator)).into_iter().flatten();
        targets.filter_map(position_of).any(|to| to <= from)
    };
    for &block in order {
        let phis = function.blocks[block].instructions.iter();
        for phi in phis.take_while(|instruction| instruction.opcode == Opcode::Phi) {
            // A phi reads at the end of the parent block. If that has a back edge, too, lanes that
            // leave wait on their edge while others run further iterations: the phi then reads
            // after the loop.
            for pair in module.operands(phi).chunks_exact(2) {
                let from = position_of(Id(pair[1])).filter(|&from| from != usize::MAX);
                let read = from
                    .map(|from| if has_back_edge(from) { position_of_block[block].max(from) } else { from });
                if read.is_some_and(|read| escapes(Id(pair[0]), read)) {
                    escaping.insert(Id(pair[0]));
                }
            }
        }
    }
    escaping
}
