//! Control flow of a function: predecessors, dominators, constructs.

use std::collections::{HashMap, HashSet};

use super::words::Function;

/// The blocks of a function by their places in it.
pub struct Graph {
    /// The place of each label.
    pub at: HashMap<u32, usize>,
    /// Which blocks branch to each, once each.
    pub predecessors: Vec<Vec<usize>>,
    dominators: Vec<Option<usize>>,
    /// Labels that a merge instruction names as merge block.
    pub merges: HashSet<u32>,
    /// Labels that a loop names as merge block or continue target.
    pub loop_exits: HashSet<u32>,
    /// Labels that a loop names as continue target.
    pub continues: HashSet<u32>,
}

impl Graph {
    /// Reads a function.
    pub fn of(function: &Function) -> Self {
        let blocks = &function.blocks;
        let at: HashMap<u32, usize> = blocks.iter().enumerate().map(|(at, block)| (block.id(), at)).collect();
        let successors: Vec<Vec<usize>> =
            blocks.iter().map(|block| block.successors().iter().map(|id| at[id]).collect()).collect();
        let mut predecessors = vec![Vec::new(); blocks.len()];
        for (from, all) in successors.iter().enumerate() {
            for to in all {
                if !predecessors[*to].contains(&from) {
                    predecessors[*to].push(from);
                }
            }
        }
        let (mut merges, mut loop_exits, mut continues) = (HashSet::new(), HashSet::new(), HashSet::new());
        for merge in blocks.iter().filter_map(|block| block.merge()) {
            merges.insert(merge.rest[0]);
            if merge.op == anyhit_engine::module::Opcode::LoopMerge {
                loop_exits.extend([merge.rest[0], merge.rest[1]]);
                continues.insert(merge.rest[1]);
            }
        }
        let dominators = dominators(&successors, &predecessors);
        Self { at, predecessors, dominators, merges, loop_exits, continues }
    }

    /// Whether control can get to a block.
    pub fn is_reachable(&self, block: usize) -> bool {
        block == 0 || self.dominators[block].is_some()
    }

    /// Whether every way to a reachable block leads through another, or it is that one.
    pub fn dominates(&self, above: usize, block: usize) -> bool {
        let mut at = block;
        loop {
            if at == above {
                return true;
            }
            match self.dominators[at] {
                Some(up) if at != 0 => at = up,
                _ => return false,
            }
        }
    }

    /// The blocks of a construct, from its first one up to its merge block, and the labels outside
    /// that it branches to. Constructs within are left through their own merge blocks.
    pub fn construct(&self, function: &Function, from: usize, merge: u32) -> (Vec<usize>, HashSet<u32>) {
        let (mut region, mut exits) = (vec![from], HashSet::new());
        let mut inner = HashSet::new();
        let mut next = 0;
        while let Some(at) = region.get(next).copied() {
            let block = &function.blocks[at];
            next += 1;
            if let Some(declared) = block.merge().filter(|declared| declared.rest[0] != merge) {
                inner.extend(declared.operands());
            }
            for label in block.successors() {
                let leaves = self.merges.contains(&label) || self.loop_exits.contains(&label);
                let to = self.at[&label];
                if region.contains(&to) {
                    continue;
                }
                // The header of a loop around it is left for, too.
                if label == merge || (leaves && !inner.contains(&label)) || self.dominates(to, at) {
                    exits.insert(label);
                } else {
                    region.push(to);
                }
            }
        }
        (region, exits)
    }
}

/// Immediate dominators (Cooper, Harvey and Kennedy); the entry and unreachable blocks have none.
fn dominators(successors: &[Vec<usize>], predecessors: &[Vec<usize>]) -> Vec<Option<usize>> {
    let count = successors.len();
    let (mut order, mut seen) = (Vec::new(), vec![false; count]);
    let mut stack = if count > 0 { vec![(0, 0)] } else { Vec::new() };
    if let Some(first) = seen.first_mut() {
        *first = true;
    }
    while let Some((block, next)) = stack.pop() {
        match successors[block].get(next) {
            Some(to) => {
                stack.push((block, next + 1));
                if !seen[*to] {
                    seen[*to] = true;
                    stack.push((*to, 0));
                }
            }
            None => order.push(block),
        }
    }
    let mut number = vec![0; count];
    order.iter().enumerate().for_each(|(at, block)| number[*block] = at);
    let mut above: Vec<Option<usize>> = vec![None; count];
    let mut changed = true;
    while changed {
        changed = false;
        for block in order.iter().rev().copied().filter(|block| *block != 0) {
            let known =
                predecessors[block].iter().copied().filter(|from| *from == 0 || above[*from].is_some());
            let meet = known.reduce(|mut one, mut other| {
                while one != other {
                    while number[one] < number[other] {
                        one = above[one].unwrap_or(0);
                    }
                    while number[other] < number[one] {
                        other = above[other].unwrap_or(0);
                    }
                }
                one
            });
            if meet != above[block] {
                above[block] = meet;
                changed = true;
            }
        }
    }
    above
}
