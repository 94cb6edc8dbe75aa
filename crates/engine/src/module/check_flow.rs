//! Checks the control-flow graph of each function: targets of branches, and parents of `OpPhi`.

use smallvec::{SmallVec, smallvec};

use crate::module::span::invalid;
use crate::module::{BasicBlock, Definition, Function, Id, Instruction, Module, Opcode};
use anyhit_base::error::Result;

/// Checks the edges between the blocks of every function.
///
/// # Errors
/// `InvalidModule` where the first block is a branch's target, or an `OpPhi` does not name each
/// block that branches to its own block exactly once.
pub(super) fn functions(module: &Module) -> Result<()> {
    for function in &module.functions {
        let predecessors = predecessors(module, function)?;
        for (index, block) in function.blocks.iter().enumerate() {
            let phis = block.instructions.iter().take_while(|instruction| instruction.opcode == Opcode::Phi);
            for phi in phis {
                check_phi(module, function, &predecessors[index], phi)?;
            }
        }
    }
    Ok(())
}

/// The indices of the blocks that branch to each block, each once, ascending.
fn predecessors(module: &Module, function: &Function) -> Result<Vec<SmallVec<[u32; 4]>>> {
    let mut predecessors = vec![SmallVec::<[u32; 4]>::new(); function.blocks.len()];
    for (index, block) in function.blocks.iter().enumerate() {
        let Some(last) = block.instructions.last() else { continue };
        for target in module.branch_targets(last) {
            let Some(Definition::Label(_, target)) = module.definition(target) else { continue };
            if target == 0 {
                return Err(invalid(
                    last.offset as usize,
                    format!(
                        "a branch leads to %{}, the first block of its function",
                        function.blocks[0].label.0
                    ),
                ));
            }
            let from = &mut predecessors[target as usize];
            if from.last() != Some(&(index as u32)) {
                from.push(index as u32);
            }
        }
    }
    Ok(predecessors)
}

/// Checks that a phi has one pair of value and parent for each block that branches to its block.
fn check_phi(module: &Module, function: &Function, predecessors: &[u32], phi: &Instruction) -> Result<()> {
    // By predecessor: whether the phi names it.
    let mut seen: SmallVec<[bool; 8]> = smallvec![false; predecessors.len()];
    for (index, pair) in module.operands(phi).chunks_exact(2).enumerate() {
        let at = phi.operands.start as usize + 2 * index + 1;
        let Some(Definition::Label(_, parent)) = module.definition(Id(pair[1])) else { continue };
        if ends_in_unknown_opcode(&function.blocks[parent as usize]) {
            continue;
        }
        let Ok(position) = predecessors.binary_search(&parent) else {
            return Err(invalid(at, format!("OpPhi names %{}, which does not branch to its block", pair[1])));
        };
        if std::mem::replace(&mut seen[position], true) {
            return Err(invalid(at, format!("OpPhi names the block %{} twice", pair[1])));
        }
    }
    let parents = seen.iter().filter(|&&seen| seen).count();
    if parents < predecessors.len() {
        return Err(invalid(
            phi.offset as usize,
            format!("OpPhi has {parents} parents, but {} blocks branch to its block", predecessors.len()),
        ));
    }
    Ok(())
}

/// Whether a block ends with an unknown opcode, so that its successors are not known.
fn ends_in_unknown_opcode(block: &BasicBlock) -> bool {
    block.instructions.last().is_some_and(|last| !last.opcode.is_known())
}
