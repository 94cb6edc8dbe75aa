//! How large functions are and how often they are called: what decides whether a call is inlined.

use crate::module::Module;

/// How large a function is with its callees inlined, and how often it is called.
#[derive(Clone, Copy, Default)]
pub(super) struct Size {
    /// Of the function and all that it calls.
    pub instructions: u64,
    /// Calls in the text of the module.
    pub calls: u32,
}

/// The size of every function that is called from one, itself among them, by index.
pub(super) fn sizes(module: &Module, root: u32) -> Vec<Size> {
    let mut sizes = vec![Size::default(); module.functions.len()];
    for callee in module.functions.iter().flat_map(|function| &function.calls) {
        sizes[*callee as usize].calls += 1;
    }
    // Callees first: a walk without recursion, as the depth is the module's.
    let mut done = vec![false; module.functions.len()];
    let mut stack = vec![(root, false)];
    while let Some((at, ready)) = stack.pop() {
        if done[at as usize] {
            continue;
        }
        let function = &module.functions[at as usize];
        if ready {
            let own = function.blocks.iter().map(|block| block.instructions.len() as u64).sum();
            let below = function.calls.iter().map(|&callee| sizes[callee as usize].instructions);
            sizes[at as usize].instructions = below.fold(own, u64::saturating_add);
            done[at as usize] = true;
        } else {
            stack.push((at, true));
            let below = function.calls.iter().filter(|&&callee| !done[callee as usize]);
            stack.extend(below.map(|&callee| (callee, false)));
        }
    }
    sizes
}
