//! The cost of inlining functions: how large they are and how often they are called.

use crate::module::Module;

/// The size of a function with its callees inlined, and how often it is called.
#[derive(Clone, Copy, Default)]
pub(super) struct InlineCost {
    /// The number of instructions of the function and of all that it calls.
    pub instructions: u64,
    /// The number of calls in the module.
    pub calls: u32,
}

/// By function index: the cost of inlining, for `root` and all functions that are reachable from
/// it.
pub(super) fn inline_costs(module: &Module, root: u32) -> Vec<InlineCost> {
    let mut inline_costs = vec![InlineCost::default(); module.functions.len()];
    for callee in module.functions.iter().flat_map(|function| &function.calls) {
        inline_costs[*callee as usize].calls += 1;
    }
    // Visits callees first, with a stack of its own, because the module decides the depth.
    let mut done = vec![false; module.functions.len()];
    let mut stack = vec![(root, false)];
    while let Some((at, ready)) = stack.pop() {
        if done[at as usize] {
            continue;
        }
        let function = &module.functions[at as usize];
        if ready {
            let own = function.blocks.iter().map(|block| block.instructions.len() as u64).sum();
            let callees = function.calls.iter().map(|&callee| inline_costs[callee as usize].instructions);
            inline_costs[at as usize].instructions = callees.fold(own, u64::saturating_add);
            done[at as usize] = true;
        } else {
            stack.push((at, true));
            let callees = function.calls.iter().filter(|&&callee| !done[callee as usize]);
            stack.extend(callees.map(|&callee| (callee, false)));
        }
    }
    inline_costs
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
        let inline_costs = inline_costs(&module, 0);
        // Three instructions of its own, and one of each call.
        assert_eq!((inline_costs[0].instructions, inline_costs[0].calls), (5, 0));
        assert_eq!((inline_costs[3].instructions, inline_costs[3].calls), (1, 2));
    }
}
