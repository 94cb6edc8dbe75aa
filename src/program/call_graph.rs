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

#[cfg(test)]
mod tests {
    use super::*;

    /// A module of functions that return nothing, each with the functions that it calls; the first
    /// is the entry point.
    fn module(functions: &[(u32, &[u32])]) -> Module {
        let mut words = vec![0x0723_0203, 0x0001_0400, 0, 1000, 0];
        let mut op = |opcode: u32, operands: &[u32]| {
            words.push(opcode | (operands.len() as u32 + 1) << 16);
            words.extend(operands);
        };
        op(17, &[4479]); // RayTracingKHR
        op(14, &[0, 1]);
        op(15, &[5313, functions[0].0, u32::from_le_bytes(*b"main"), 0]);
        op(19, &[1]);
        op(33, &[2, 1]);
        for &(function, calls) in functions {
            op(54, &[1, function, 0, 2]);
            op(248, &[function + 1]);
            for (result, &callee) in (function + 2..).zip(calls) {
                op(57, &[1, result, callee]);
            }
            op(253, &[]);
            op(56, &[]);
        }
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        crate::module::load(&bytes).expect("a valid module")
    }

    #[test]
    fn uncalled_functions_may_be_mutually_recursive() {
        let module = module(&[(10, &[40, 40]), (20, &[30]), (30, &[20]), (40, &[])]);
        let sizes = sizes(&module, 0);
        // Three instructions of its own, and one of each call.
        assert_eq!((sizes[0].instructions, sizes[0].calls), (5, 0));
        assert_eq!((sizes[3].instructions, sizes[3].calls), (1, 2));
    }
}
