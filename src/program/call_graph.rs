//! How large functions are and how often they are called: what decides whether a call is inlined.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::module::{Id, Module};

/// How large a function is with its callees inlined, and how often it is called.
#[derive(Clone, Copy, Default)]
pub(super) struct Size {
    /// Of the function and all that it calls.
    pub instructions: u64,
    /// Calls in the text of the module.
    pub calls: u32,
}

/// The size of every function.
pub(super) fn sizes(module: &Module) -> FxHashMap<Id, Size> {
    const CALL: u16 = 57;
    let mut sizes: FxHashMap<Id, Size> = FxHashMap::default();
    let mut callees: FxHashMap<Id, Vec<Id>> = FxHashMap::default();
    for function in &module.functions {
        let instructions = function.blocks.iter().flat_map(|block| &block.instructions);
        let own = sizes.entry(function.id).or_default();
        own.instructions = instructions.clone().count() as u64;
        for call in instructions.filter(|instruction| instruction.opcode == CALL) {
            if let Some(&callee) = module.operands(call).first() {
                callees.entry(function.id).or_default().push(Id(callee));
            }
        }
    }
    for callee in callees.values().flatten() {
        sizes.entry(*callee).or_default().calls += 1;
    }
    // Callees first: a walk without recursion, as the depth is the module's.
    let mut done = FxHashSet::default();
    for function in &module.functions {
        let mut stack = vec![(function.id, false)];
        while let Some((id, ready)) = stack.pop() {
            if done.contains(&id) {
                continue;
            }
            let below = callees.get(&id).map_or(&[][..], Vec::as_slice);
            if ready {
                let sum: u64 = below.iter().fold(0, |sum: u64, callee| {
                    sum.saturating_add(sizes.get(callee).map_or(0, |size| size.instructions))
                });
                let size = sizes.entry(id).or_default();
                size.instructions = size.instructions.saturating_add(sum);
                done.insert(id);
            } else {
                stack.push((id, true));
                stack.extend(
                    below.iter().filter(|callee| !done.contains(callee)).map(|&callee| (callee, false)),
                );
            }
        }
    }
    sizes
}
