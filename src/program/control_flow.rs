//! The order of a function's blocks, and which values outlive the loop that makes them.

use rustc_hash::FxHashSet;
use smallvec::SmallVec;

use crate::module::{Definition, Function, Id, Module};

/// Opcodes that this file looks at.
const LOOP_MERGE: u16 = 246;
const SELECTION_MERGE: u16 = 247;
const PHI: u16 = 245;

/// The blocks of a function that can be reached, in structured order: a merge block stands after
/// everything that it merges, a continue target after the loop's body, a loop's merge block after
/// the loop.
///
/// It is the reverse postorder of a walk that visits merge block and continue target before the
/// other successors.
pub fn structured_order(module: &Module, function: &Function) -> Vec<usize> {
    let mut seen = vec![false; function.blocks.len()];
    let mut order = Vec::with_capacity(function.blocks.len());
    let mut stack = Vec::new();
    if !function.blocks.is_empty() {
        seen[0] = true;
        stack.push((0, successors(module, function, 0), 0));
    }
    while let Some((block, next, at)) = stack.last_mut() {
        match next.get(*at).copied() {
            Some(successor) => {
                *at += 1;
                if !seen[successor] {
                    seen[successor] = true;
                    stack.push((successor, successors(module, function, successor), 0));
                }
            }
            None => {
                order.push(*block);
                stack.pop();
            }
        }
    }
    order.reverse();
    order
}

/// Merge block and continue target first, then the targets, the last of them first, so that they
/// come out in the order in which they are written.
fn successors(module: &Module, function: &Function, block: usize) -> SmallVec<[usize; 4]> {
    let instructions = &function.blocks[block].instructions;
    let mut blocks = SmallVec::new();
    let mut push = |id: Id| blocks.extend(block_of(module, function, id));
    for instruction in instructions.iter().rev().take(2) {
        let labels = match instruction.opcode {
            LOOP_MERGE => 2,
            SELECTION_MERGE => 1,
            _ => 0,
        };
        module.operands(instruction).iter().take(labels).for_each(|&id| push(Id(id)));
    }
    if let Some(terminator) = instructions.last() {
        module.branch_targets(terminator).into_iter().rev().for_each(push);
    }
    blocks
}

/// The block of a function that a label opens.
pub fn block_of(module: &Module, function: &Function, label: Id) -> Option<usize> {
    let Some(Definition::Label(_, block)) = module.definition(label) else { return None };
    // Labels of other functions are no blocks of this one.
    function.blocks.get(block as usize).filter(|block| block.label == label)?;
    Some(block as usize)
}

/// Values that are used after the loop in which they are made.
///
/// A lane that has left a loop waits while others go round again, and an operation writes all
/// lanes: such a value needs a row of its own that is written for the running lanes only.
pub fn escaping_values(module: &Module, function: &Function, order: &[usize]) -> FxHashSet<Id> {
    let mut place = vec![usize::MAX; function.blocks.len()];
    for (position, &block) in order.iter().enumerate() {
        place[block] = position;
    }
    let position_of = |label: Id| block_of(module, function, label).map(|block| place[block]);
    // The loop around each position, innermost: its end. Loops nest, so a stack serves.
    let mut loop_end = vec![usize::MAX; order.len()];
    let mut open: Vec<usize> = Vec::new();
    for (position, &block) in order.iter().enumerate() {
        open.retain(|&end| position < end);
        let merge = function.blocks[block].instructions.iter().rev().nth(1);
        if let Some(merge) = merge.filter(|merge| merge.opcode == LOOP_MERGE) {
            let end = module.operands(merge).first().and_then(|&id| position_of(Id(id)));
            // A merge block that is never reached stands nowhere: the loop then ends with the rest.
            let end = end.filter(|&end| end > position && end != usize::MAX).unwrap_or(order.len());
            open.push(end);
        }
        loop_end[position] = open.iter().copied().min().unwrap_or(usize::MAX);
    }
    let mut escaping = FxHashSet::default();
    // What is used before any loop ends escapes none.
    let Some(&first_end) = loop_end.iter().min().filter(|&&end| end != usize::MAX) else { return escaping };
    let this = module.definition(function.id);
    let escapes = |id: Id, position: usize| {
        matches!(module.definition(id), Some(Definition::Result(index, block, _))
            if this == Some(Definition::Function(index))
                && loop_end.get(place[block as usize]).is_some_and(|&end| position >= end))
    };
    for (position, &block) in order.iter().enumerate().skip(first_end) {
        for instruction in &function.blocks[block].instructions {
            // Most use none, whichever of their words are ids.
            let may = |&word: &u32| escapes(Id(word), position);
            if instruction.opcode != PHI && module.operands(instruction).iter().any(may) {
                let ids = module.operand_ids(instruction).into_iter();
                escaping.extend(ids.filter(|&id| escapes(id, position)));
            }
        }
    }
    for &block in order {
        let phis = function.blocks[block].instructions.iter();
        for phi in phis.take_while(|instruction| instruction.opcode == PHI) {
            // A phi reads at the end of the block that its value comes from.
            for pair in module.operands(phi).chunks_exact(2) {
                let from = position_of(Id(pair[1])).filter(|&from| from != usize::MAX);
                if from.is_some_and(|from| escapes(Id(pair[0]), from)) {
                    escaping.insert(Id(pair[0]));
                }
            }
        }
    }
    escaping
}
